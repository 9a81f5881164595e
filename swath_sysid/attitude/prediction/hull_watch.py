"""Whether a craft in waves still has the stiffness of its model."""

from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError

WATCH_INTERVAL = 15.0  #: Periods of the motion between two looks.
BEYOND_CHANCE = 3.0  #: Standard deviations of the change from which it is reported.


@dataclass(frozen=True)
class HullChange:
    """The stiffness over inertia of a craft in waves, against its model at that amplitude."""

    log_ratio: float  #: Logarithm of the stiffness over the model's.
    std: float  #: Of that.
    period: float  #: s.
    period_before: float  #: The model's, s.

    @property
    def is_certain(self) -> bool:
        """Whether it is beyond chance."""
        return abs(self.log_ratio) > BEYOND_CHANCE * self.std

    def advice(self, axis: str) -> Advice:
        """What to do about it."""
        more, share = 'more' if self.log_ratio > 0.0 else 'less', abs(np.expm1(self.log_ratio))
        spread = self.std * np.exp(self.log_ratio)
        return Advice.of(
            'hull-changed',
            axis=axis,
            share=share,
            std=spread,
            more=more,
            period=self.period,
            before=self.period_before,
        )


def hull_change(identified: IdentifiedModel, motion: AxisMotion) -> HullChange | None:
    """The change of a craft in waves since its model; None where the waves do not tell."""
    # identification loads much, and only the process that learns the waves needs it
    from swath_sysid.attitude.identification.at_sea import EQUIVALENT, SeaRecord, identify_seas, prior_of
    from swath_sysid.attitude.identification.fit_quality import amplitude_bands

    amplitude = np.array([EQUIVALENT * np.std(motion.angle)]) if motion.angle is not None else np.full(1, np.nan)
    bands = amplitude_bands(identified.model, identified.covariance, amplitude, identified.posterior)
    frequency, damping = float(bands.curves.frequency[0]), float(bands.curves.damping_ratio[0])
    known = float(bands.frequency_std[0]) / frequency
    if not (np.isfinite([frequency, damping, known]).all() and damping > 0.0):
        return None
    try:
        found = identify_seas([SeaRecord(motion)], prior_of(identified, motion), searched=True, checks_parts=False)
    except InputError:
        return None  # too few waves, or none that show a hull
    if not found.is_consistent:
        return None
    before, std = 2.0 * np.pi / frequency, found.natural_period_std / found.natural_period
    log_ratio = -2.0 * float(np.log(found.natural_period / before))
    return HullChange(log_ratio, 2.0 * float(np.hypot(std, known)), found.natural_period, before)
