"""Whether a craft in waves still has the stiffness and the damping of its model."""

from collections import deque
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.prediction.memories import HULL_MEMORY
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import THREE_STD
from swath_sysid.common.errors import InputError


class HullLook(NamedTuple):
    """One axis to be compared with its model."""

    axis: str
    identified: IdentifiedModel
    is_newest: bool  #: By the `HULL_MEMORY` part of the past alone.


class Ratio(NamedTuple):
    """A quantity of the craft over that of its model at the amplitude of the motion."""

    log: float
    std: float  #: Of the logarithm.

    def differs_from(self, log: float) -> bool:
        """Whether it differs beyond chance from a ratio of this logarithm."""
        return abs(self.log - log) > THREE_STD * self.std


class HullChange(NamedTuple):
    """What a look has found."""

    axis: str
    is_newest: bool
    stiffness: Ratio  #: Over inertia.
    damping: Ratio  #: Damping ratio.
    period: float  #: s.
    period_before: float  #: The model's, s.


class HullWatch:
    """The last two looks at the newest part of the past of one axis, and at the whole: waves deceive one of them."""

    def __init__(self) -> None:
        self._newest, self._whole = deque[HullChange](maxlen=2), deque[HullChange](maxlen=2)

    def take(self, change: HullChange) -> None:
        """Add a finding."""
        (self._newest if change.is_newest else self._whole).append(change)

    def of_stiffness(self) -> HullChange | None:
        """The finding of a certain change."""
        newest, whole = (_confirmed(looks, 'stiffness') for looks in (self._newest, self._whole))
        is_over = whole and self._newest and self._newest[-1].stiffness.differs_from(whole.stiffness.log)
        return newest or (None if is_over else whole)

    def of_damping(self) -> HullChange | None:
        """The finding of a certain change, which only a long past shows."""
        return _confirmed(self._whole, 'damping')

    def advice(self) -> list[Advice]:
        """What has changed, and what to do about it."""
        found = []
        if (change := self.of_stiffness()) is not None:
            log, std = change.stiffness
            more, share, spread = 'more' if log > 0.0 else 'less', abs(np.expm1(log)), std * np.exp(log)
            axis, period, before = change.axis, change.period, change.period_before
            found.append(
                Advice.of('hull-changed', axis=axis, share=share, std=spread, more=more, period=period, before=before)
            )
        if (change := self.of_damping()) is not None:
            low, factor, high = np.exp(change.damping.log + 2.0 * change.damping.std * np.array([-1.0, 0.0, 1.0]))
            found.append(Advice.of('damping-changed', axis=change.axis, factor=factor, low=low, high=high))
        return found


def _confirmed(looks: deque[HullChange], quantity: str) -> HullChange | None:
    """The last of two looks that both find a quantity changed in one direction."""
    signs = {ratio.differs_from(0.0) and np.sign(ratio.log) for ratio in (getattr(look, quantity) for look in looks)}
    return looks[-1] if len(looks) == looks.maxlen and len(signs) == 1 and signs != {False} else None


def hull_change(look: HullLook, motion: AxisMotion, period: float) -> HullChange | None:
    """What a motion of this period, s, in waves tells of its hull; None where it does not."""
    # identification loads much, and only the process that learns the waves needs it
    from swath_sysid.attitude.identification.at_sea import EQUIVALENT, SeaRecord, identify_seas, prior_of
    from swath_sysid.attitude.identification.fit_quality import amplitude_bands

    identified = look.identified
    newest = HULL_MEMORY * period
    # of a young past it is the whole
    is_newest = look.is_newest or motion.duration <= newest
    if is_newest:
        motion = motion.between(motion.time[-1] - newest, None)
    amplitude = np.full(1, np.nan if motion.angle is None else EQUIVALENT * np.std(motion.angle))
    bands = amplitude_bands(identified.model, identified.covariance, amplitude, identified.posterior)
    (frequency,), (damping,) = bands.curves.frequency.tolist(), bands.curves.damping_ratio.tolist()
    (frequency_std,), (damping_std,) = bands.frequency_std.tolist(), bands.damping_ratio_std.tolist()
    if not (np.isfinite([frequency, damping, frequency_std, damping_std]).all() and damping > 0.0):
        return None
    try:
        found = identify_seas([SeaRecord(motion)], prior_of(identified, motion), searched=True, checks_parts=False)
    except InputError:
        return None  # too few waves, or none that show a hull
    if not found.is_consistent:
        return None
    before = 2.0 * np.pi / frequency
    std = 2.0 * np.hypot(found.natural_period_std / found.natural_period, frequency_std / frequency)
    stiffness = Ratio(2.0 * float(np.log(before / found.natural_period)), float(std))
    std = np.hypot(found.damping_ratio_std / found.damping_ratio, damping_std / damping)
    of_damping = Ratio(float(np.log(found.damping_ratio / damping)), float(std))
    return HullChange(look.axis, is_newest, stiffness, of_damping, found.natural_period, before)
