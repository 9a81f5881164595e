"""Whether a craft in waves still has the stiffness and the damping of its model."""

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError

NEWEST = 80.0  #: Periods of the motion in which a change shows while the whole past still hides it.
BEYOND_CHANCE = 3.5  #: Standard deviations of a change, in the mean of two looks, from which it is reported.


@dataclass(frozen=True)
class HullLook:
    """One axis to be compared with its model."""

    axis: str
    identified: IdentifiedModel
    is_newest: bool  #: By the `NEWEST` part of the past alone.


class Ratio(NamedTuple):
    """A quantity of the craft over that of its model at the amplitude of the motion."""

    log: float
    std: float  #: Of the logarithm.

    @property
    def is_certain(self) -> bool:
        """Whether it differs from one beyond chance."""
        return abs(self.log) > BEYOND_CHANCE * self.std


@dataclass(frozen=True)
class HullChange:
    """What a look has found."""

    axis: str
    is_newest: bool
    stiffness: Ratio  #: Over inertia.
    damping: Ratio  #: Damping ratio.
    period: float  #: s.
    period_before: float  #: The model's, s.


class HullWatch:
    """What the last two looks at the newest and at the whole past of one axis have in common."""

    def __init__(self) -> None:
        self._newest, self._whole = deque[HullChange](maxlen=2), deque[HullChange](maxlen=2)

    def take(self, change: HullChange) -> None:
        """Add a finding."""
        (self._newest if change.is_newest else self._whole).append(change)

    def told(self, quantity: str) -> tuple[Ratio, HullChange] | None:
        """The certain ratio of a quantity, and the newest finding that it is of."""
        newest, whole = _mean(self._newest, quantity), _mean(self._whole, quantity)
        if newest is not None and newest.is_certain:
            return newest, self._newest[-1]
        if whole is None or not whole.is_certain:
            return None
        # over by now
        if newest is not None and Ratio(newest.log - whole.log, newest.std).is_certain:
            return None
        return whole, self._whole[-1]

    def advice(self) -> list[Advice]:
        """What has changed, and what to do about it."""
        found = []
        if (told := self.told('stiffness')) is not None:
            (log, std), change = told
            more, share, spread = 'more' if log > 0.0 else 'less', abs(np.expm1(log)), std * np.exp(log)
            period, before = change.period, change.period_before
            found.append(
                Advice.of(
                    'hull-changed', axis=change.axis, share=share, std=spread, more=more, period=period, before=before
                )
            )
        if (told := self.told('damping')) is not None:
            (log, std), change = told
            low, high = np.exp(log - 2.0 * std), np.exp(log + 2.0 * std)
            found.append(Advice.of('damping-changed', axis=change.axis, factor=np.exp(log), low=low, high=high))
        return found


def _mean(looks: deque[HullChange], quantity: str) -> Ratio | None:
    """Of two looks, whose windows overlap; None before."""
    if len(looks) < 2:
        return None
    one, other = (getattr(look, quantity) for look in looks)
    return Ratio(0.5 * (one.log + other.log), 0.5 * (one.std + other.std))


def hull_change(look: HullLook, motion: AxisMotion, period: float) -> HullChange | None:
    """What a motion of this period, s, in waves tells of its hull; None where it does not."""
    # identification loads much, and only the process that learns the waves needs it
    from swath_sysid.attitude.identification.at_sea import EQUIVALENT, SeaRecord, identify_seas, prior_of
    from swath_sysid.attitude.identification.fit_quality import amplitude_bands

    identified = look.identified
    if look.is_newest:
        motion = motion.between(motion.time[-1] - NEWEST * period, None)
    amplitude = np.array([EQUIVALENT * np.std(motion.angle)]) if motion.angle is not None else np.full(1, np.nan)
    bands = amplitude_bands(identified.model, identified.covariance, amplitude, identified.posterior)
    frequency, damping = float(bands.curves.frequency[0]), float(bands.curves.damping_ratio[0])
    known = float(bands.frequency_std[0]), float(bands.damping_ratio_std[0])
    if not (np.isfinite([frequency, damping, *known]).all() and damping > 0.0):
        return None
    try:
        found = identify_seas([SeaRecord(motion)], prior_of(identified, motion), searched=True, checks_parts=False)
    except InputError:
        return None  # too few waves, or none that show a hull
    if not found.is_consistent:
        return None
    before, ratio = 2.0 * np.pi / frequency, found.natural_period * frequency / (2.0 * np.pi)
    std = 2.0 * float(np.hypot(found.natural_period_std / found.natural_period, known[0] / frequency))
    damping_std = float(np.hypot(found.damping_ratio_std / found.damping_ratio, known[1] / damping))
    return HullChange(
        look.axis,
        look.is_newest,
        Ratio(-2.0 * float(np.log(ratio)), std),
        Ratio(float(np.log(found.damping_ratio / damping)), damping_std),
        found.natural_period,
        before,
    )
