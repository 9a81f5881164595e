"""The moment at which a craft that was held away from its trim was let go: its acceleration jumps towards the trim."""

from collections.abc import Sequence
from math import factorial

import numpy as np

from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.signals import noise_level

#: Natural periods before and after a release that show its kink, in three rounds, each about the best of the last.
BEFORE, AFTER = (0.15, 0.2, 0.1), (0.2, 0.3, 0.15)
CLOSER = 0.15, 0.05  #: Natural periods about the best time of a round within which the next are tried.
HAND = 3, 3, 2  #: Degrees of the polynomials that follow a hand's wobble before the release,
HULL = 4  #: ... and the free motion after it.
CANDIDATES = 50  #: Times tried in each round.
MIN_ACCELERATION = 0.5  #: Of the acceleration of a free oscillation of that angle and period.


def kink_time(motion: AxisMotion, earliest: float, latest: float, period: float, held: float) -> float | None:
    """The likeliest time, s, at which the acceleration jumps towards the trim, or None where it does not.

    It is sought between two times, for a natural period, s, and the angle at which the craft was held, rad from trim.
    """
    noises = tuple(0.0 if each is None else max(noise_level(each), 1e-9) for each in (motion.angle, motion.rate))
    least_acceleration = -MIN_ACCELERATION * (2.0 * np.pi / period) ** 2 * held
    found, first, last = None, earliest, latest
    for before, after, hand, reach in zip(BEFORE, AFTER, HAND, (*CLOSER, 0.0), strict=True):
        inside = motion.between(first - before * period, last + after * period)
        times = np.linspace(earliest, latest, CANDIDATES)
        misfits = [_misfit(inside, noises, time, hand, least_acceleration) for time in times]
        best = int(np.argmin(misfits))
        if not np.isfinite(misfits[best]):
            break
        found = first = last = float(times[best])
        earliest, latest = found - reach * period, found + reach * period
    return found


def _misfit(motion: AxisMotion, noises: Sequence[float], time: float, hand: int, least_acceleration: float) -> float:
    """Squared residuals of a hand's motion until a time and a free one after; infinite without a jump to the trim."""
    held, free = np.minimum(motion.time - time, 0.0), np.maximum(motion.time - time, 0.0)
    powers = [(held, power) for power in range(2, hand + 1)] + [(free, power) for power in range(2, HULL + 1)]
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
    before, after = solution[2] / least_acceleration, solution[1 + hand] / least_acceleration
    return float(np.sum((matrix @ solution - target) ** 2)) if after >= max(1.0, before) else np.inf
