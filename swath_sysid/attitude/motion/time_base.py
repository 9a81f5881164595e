"""Whether a time column counts what it says: seconds, and not milliseconds, ticks, or samples."""

from collections.abc import Sequence

import numpy as np
from scipy import constants

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError

MIN_RATE, MAX_RATE = 0.5, 10_000.0  #: Hz: sensors of motion lie well within.

SHORTER_UNITS = {'ms': constants.milli, 'us': constants.micro, 'ns': constants.nano}

LONGEST_PERIOD = 60.0  #: s: roll and pitch of small craft take a few seconds, of ships up to 30.


def check_time_base(
    time: np.ndarray, motions: Sequence[np.ndarray], source: str, column: str = 'time_s', unit: str = 's'
) -> None:
    """Reject a time (N,) that cannot be in its unit, or in which motions (N,) have an implausible period."""
    if time.size < 2:
        return
    interval = float(np.median(np.diff(time)))
    name = f"{source}: its column '{column}'"
    if interval > 1.0 / MIN_RATE:
        shorter = SHORTER_UNITS if unit == 's' else {}
        fitting = [u for u, scale in shorter.items() if MIN_RATE <= 1.0 / (interval * scale) <= MAX_RATE]
        cure = f'call it time_{" or time_".join(fitting)}, as its unit is' if fitting else 'give it its true unit'
        raise InputError(
            f'{name} has a sample every {interval:.4g} s, too seldom for the motion of a craft: '
            f'{cure}, or time_samples with a line "# sample_rate_hz: 100" above if it numbers the samples'
        )
    if interval < 1.0 / MAX_RATE:
        raise InputError(
            f'{name} has a sample every {interval:.4g} s, more often than any sensor of motion: call it '
            f'time_s if it counts seconds, or give it its true unit'
        )
    if unit == 's' and np.all(np.abs(np.diff(time) / interval % 1.0) < 1e-9) and interval == 1.0:
        periods = [period for motion in motions if (period := motion_period(time, motion)) is not None]
        if periods and min(periods) > LONGEST_PERIOD:
            raise InputError(Advice.of('time-unit', name=name, period=min(periods)).message)


def motion_period(time: np.ndarray, motion: np.ndarray) -> float | None:
    """Mean period, s, of a motion (N,), by its way up from a standard deviation below the median to one above.

    None with less than a cycle.
    """
    known = np.isfinite(motion)
    if not known.any():
        return None
    time, motion = time[known], motion[known] - np.median(motion[known])
    beyond = np.flatnonzero(np.abs(motion) > motion.std())
    side = motion[beyond] > 0.0
    upward = time[beyond[1:][side[1:] & ~side[:-1]]]
    return float((upward[-1] - upward[0]) / (upward.size - 1)) if upward.size > 1 else None
