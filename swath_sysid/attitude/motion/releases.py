"""The moment at which a craft that was held away from its trim was let go: its acceleration jumps towards the trim."""

from collections.abc import Sequence
from math import factorial

import numpy as np

from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.signals import noise_level

BEFORE, AFTER = 0.12, 0.15  #: Natural periods before and after the times tried that show the kink.
HAND = 3  #: Degree of the polynomial that follows a hand's wobble before the release,
HULL = 4  #: ... and of that which follows the free motion after it.
CANDIDATES = 40  #: Times tried.


def kink_time(motion: AxisMotion, earliest: float, latest: float, period: float, held: float) -> float | None:
    """The expected time, s, at which the acceleration jumps towards the trim, or None where it does not.

    The times tried, between two, s, are weighted by their likelihood. The natural period is in s; ``held`` has the sign
    of the angle at which the craft was held.
    """
    noises = tuple(0.0 if each is None else max(noise_level(each), 1e-9) for each in (motion.angle, motion.rate))
    inside = motion.between(earliest - BEFORE * period, latest + AFTER * period)
    times = np.linspace(earliest, latest, CANDIDATES)
    misfits = np.array([_misfit(inside, noises, time, held) for time in times])
    if not np.isfinite(misfits).any():
        return None
    likelihood = np.exp(-0.5 * (misfits - misfits.min()))
    return float(likelihood @ times / likelihood.sum())


def _misfit(motion: AxisMotion, noises: Sequence[float], time: float, side: float) -> float:
    """Squared residuals of a hand's motion until a time and a free one after; infinite without a jump to the trim."""
    held, free = np.minimum(motion.time - time, 0.0), np.maximum(motion.time - time, 0.0)
    powers = [(held, power) for power in range(2, HAND + 1)] + [(free, power) for power in range(2, HULL + 1)]
    rows, right = [], []
    for order, (values, noise) in enumerate(zip((motion.angle, motion.rate), noises, strict=True)):
        if values is not None:
            line = [np.full(motion.size, 1.0 - order), (held + free) ** (1 - order)]
            curves = [part ** (power - order) / factorial(power - order) for part, power in powers]
            rows.append(np.column_stack(line + curves) / noise)
            right.append(values / noise)
    matrix, target = np.concatenate(rows), np.concatenate(right)
    if target.size <= matrix.shape[1]:
        return np.inf
    solution = np.linalg.lstsq(matrix, target, rcond=None)[0]
    before, after = -side * solution[2], -side * solution[1 + HAND]
    return float(np.sum((matrix @ solution - target) ** 2)) if after > max(0.0, before) else np.inf
