"""Whether a sensor is mounted as stated, judged from its own data.

Gravity is held against the attitude, and the rates against the derivative of the angles. A sensor whose orientation,
rates and accelerations are all turned alike about the vertical agrees with itself: no such check can see it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.motion.contradictions import (
    FROZEN_CODES,
    GRAVITY_CODES,
    OFFSET_CODES,
    RATE_CODES,
    Contradiction,
)
from swath_sysid.attitude.motion.gravity_check import (
    accelerations_follow,
    direction_of_gravity,
    list_of_craft,
    mean_force_of,
    mean_up,
    points_somewhere,
    size_of_gravity,
)
from swath_sysid.attitude.motion.rate_check import rates_against_angles
from swath_sysid.attitude.motion.rate_comparison import MIN_RATE, RateComparison, compare_rates
from swath_sysid.attitude.motion.sensor_mount import Installation

WINDOW = 30.0  #: s over which the accelerations of waves average out.

#: s; samples are averaged to so coarse a time base, unless their own is coarser: craft roll in 1 s and more.
BIN = 0.05

MIN_BINS = 40

WINDOW_BINS = 300  #: Bins of a window of a sensor so slow that `WINDOW` holds fewer.
FROZEN = 5.0  #: s of fresh stamps with the same values; the noise of a sensor does not repeat.
MIN_FROZEN = 20  #: Bins of the same, at least.
MAX_STRETCHES = 20  #: Of a long record, over which they are spread; up to twice as many are judged.

ANGLES, RATES = ('roll', 'pitch', 'yaw'), ('roll_rate', 'pitch_rate', 'yaw_rate')
PARTS = ANGLES, RATES, ('accel_x', 'accel_y', 'accel_z')


@dataclass(frozen=True)
class Judgement:
    """What a stretch of data says of the installation, and the codes for which there was enough to judge by."""

    contradictions: tuple[Contradiction, ...] = ()
    decided: frozenset[str] = frozenset()


def judge(
    time: np.ndarray,
    angles: np.ndarray,
    rates: np.ndarray,
    force: np.ndarray,
    *,
    installation: Installation,
    interval: float,
) -> Judgement:
    """Judge one stretch of data.

    Args:
        time: (N,); s, increasing.
        angles, rates, force: (N, 3); roll, pitch, yaw, rad; their rates, rad/s; specific force in the axes of the
            craft, m/s^2. All as the installation makes them; NaN where not known.
        installation, interval: What frame and mounting were taken to be; s between the samples of the sensor.
    """
    if time.size < MIN_BINS:
        return Judgement()
    frozen = _frozen(time, angles, rates, force)
    if frozen:
        return Judgement((frozen,), FROZEN_CODES)
    up, mean_force = mean_up(angles), mean_force_of(force)
    comparison = _compared(time, angles[:, :2], rates)
    decided, turn = FROZEN_CODES, None
    found = [] if mean_force is None else size_of_gravity(mean_force)
    if mean_force is not None or up is not None:
        decided |= GRAVITY_CODES
    if mean_force is not None and points_somewhere(mean_force):
        direction = mean_force / np.linalg.norm(mean_force)
        turn, contradictions = direction_of_gravity(direction, up, comparison, installation)
        found += contradictions
    elif up is not None:
        found += list_of_craft(up, installation)
    if comparison is not None and turn is None:
        decided |= OFFSET_CODES | (RATE_CODES if comparison.evidenced.size else frozenset())
        found += rates_against_angles(comparison, interval, accelerations_follow(angles, force), installation)
    return Judgement(tuple(found), decided)


def _frozen(time: np.ndarray, *parts: np.ndarray) -> Contradiction | None:
    """What has not changed for `FROZEN` though it should have; angles that come alone may stand still."""
    first = min(int(np.searchsorted(time, time[-1] - FROZEN)), max(time.size - MIN_FROZEN, 0))
    angles, rates, force = (part[first:] for part in parts)
    known = [bool(np.isfinite(part).any()) for part in (angles, rates, force)]
    if first == 0 or not any(known[1:]):
        return None
    still = [bool(np.all((part == part[0]) | np.isnan(part))) for part in (angles, rates, force)]
    if all(still):
        return Contradiction(
            'sensor-frozen',
            (
                f'every value of the sensor has been the same for {FROZEN:g} s while its stamps go on: restart its '
                f'driver, and look for one that repeats its last message'
            ),
        )
    if known[0] and still[0] and known[1] and np.nanmax(np.nanstd(rates[:, :2], axis=0)) > MIN_RATE:
        return Contradiction(
            'angles-frozen',
            (
                f'the orientation has been the same for {FROZEN:g} s while the rates show motion: check what gives the '
                f'orientation, or have the driver set orientation_covariance[0] to -1'
            ),
        )
    return None


def _compared(time: np.ndarray, angles: np.ndarray, rates: np.ndarray) -> RateComparison | None:
    """Rates and angles compared on an even time base; None where there is too little of either."""
    if not np.isfinite(rates).any() or not np.isfinite(angles).any():
        return None
    values = np.hstack([angles, rates])
    measured = np.isfinite(values).any(axis=0)
    whole = np.isfinite(values[:, measured]).all(axis=1)
    # what is left out is bridged, unless it is much
    if np.count_nonzero(whole) < max(MIN_BINS, 0.5 * time.size):
        return None
    step, kept = float(np.median(np.diff(time))), time[whole]
    even = np.arange(kept[0], kept[-1], step)
    if np.max(np.diff(kept)) > max(1.0, 4.0 * step) or even.size < MIN_BINS:
        return None
    values[whole, :2] = np.unwrap(angles[whole], axis=0)
    evened = np.full((even.size, values.shape[1]), np.nan)
    for place in np.flatnonzero(measured):
        evened[:, place] = np.interp(even, kept, values[whole, place])
    return compare_rates(step, evened[:, :2], evened[:, 2:])


def contradictions_in(
    time: np.ndarray, channels: dict[str, np.ndarray], installation: Installation
) -> tuple[Contradiction, ...]:
    """What contradicts itself in a whole record.

    The record is judged in stretches. A contradiction must show in most that can show it; a frozen sensor, in any.

    Args:
        time: (N,); s, increasing.
        channels: dict of str to (N,); any of roll, pitch and yaw, their rates, and the accelerations, as the
            installation makes them.
        installation: What frame and mounting were taken to be.
    """
    if time.size < MIN_BINS:
        return ()
    interval = float(np.median(np.diff(time)))
    size = max(WINDOW_BINS * samples_a_bin(interval), round(WINDOW / interval))
    starts = range(0, max(time.size - size // 2, 1), size // 2)
    judgements = []
    for start in starts[:: max(len(starts) // MAX_STRETCHES, 1)]:
        rows = slice(start, start + size)
        unknown = np.full(time[rows].size, np.nan)
        parts = [np.stack([channels[n][rows] if n in channels else unknown for n in names], axis=1) for names in PARTS]
        judgements.append(judge(*binned(time[rows], parts, interval), installation=installation, interval=interval))
    found: dict[tuple[str, str | None], list[Contradiction]] = {}
    for judgement in judgements:
        for contradiction in judgement.contradictions:
            found.setdefault((contradiction.code, contradiction.axis), []).append(contradiction)
    return tuple(
        each[len(each) // 2]
        for (code, _), each in found.items()
        if code in FROZEN_CODES or len(each) > 0.5 * sum(code in judgement.decided for judgement in judgements)
    )


def samples_a_bin(interval: float) -> int:
    """This many samples of an interval (s) are averaged to a bin."""
    return max(int(BIN / interval + 0.5), 1)


def binned(time: np.ndarray, parts: Sequence[np.ndarray], interval: float) -> tuple[np.ndarray, ...]:
    """Samples averaged over bins of `BIN` s; a value that is missing leaves its bin unknown.

    Args:
        time: (N,); s.
        parts: sequence of 3 ndarrays, shape (N, 3); angles, rates and specific force.
        interval: s between samples.

    Returns:
        time: (M,)
        angles, rates, force: (M, 3)
    """
    count = samples_a_bin(interval)
    if count == 1 or time.size < 2 * count:
        return time, *parts
    whole = time.size // count * count
    angles, *others = (part[:whole].reshape(-1, count, 3) for part in parts)
    # a mean of angles across the jump at pi would be none
    first = angles[:, :1]
    angles = first + (angles - first + np.pi) % (2.0 * np.pi) - np.pi
    return (
        time[:whole].reshape(-1, count).mean(axis=1),
        angles.mean(axis=1),
        *(other.mean(axis=1) for other in others),
    )
