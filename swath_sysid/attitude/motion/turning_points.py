"""Turning points of a motion: its half-cycles and natural period.

A motion is examined on a pyramid of even time grids, each the pairwise mean of the one before: on the grid with a few
tens of samples per period the noise is small and the turning points are still sharp.
"""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

import numpy as np
import scipy  # its rooms are loaded when they are used: the buffer subscribes first

from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.signals import (
    bin_means,
    noise_level,
    prominent_extremes,
    quantum,
    running_integral,
    without_spikes,
)

MAX_SAMPLES = 65536  #: Longer records are averaged down to this many samples: 20 per period in an hour of 1 s periods.
MIN_PER_PERIOD = 32  #: Samples per period on the coarsest grid used: its smoothing takes 2 % of the amplitude at most.
MIN_PER_PERIOD_UNSMOOTHED = 5  #: On the finest grid nothing is smoothed, and slow sampling is all there is.
PROMINENCE = 5.0  #: A turning point stands out by this many standard deviations of the noise left on its grid.
SMALLEST_PROMINENCE = 0.002  #: ... and by this part of the record's range, to ignore trifles.
LONGEST_BRIDGED_GAP = 0.2  #: A pause longer than this part of the record splits it in two.


@dataclass(frozen=True)
class EvenSignal:
    """One quantity of a motion on an even time grid."""

    quantity: str  #: ``angle`` (rad) or ``rate`` (rad/s).
    start: float  #: Time of the first sample, s.
    interval: float  #: Time between samples, s.
    value: np.ndarray  #: (N,); rad or rad/s.
    noise: float  #: Standard deviation of the white noise in ``value``.
    resolution: float  #: Smallest step between the values as they were recorded.
    gaps: np.ndarray  #: (K, 2); start and end of the gaps, s; interpolated in ``value``.
    smoothed: bool = False  #: False on the finest grid as it was measured.
    record_end: float = np.inf  #: Time of the record's last sample, s; coarse grids end a little earlier.

    @property
    def end(self) -> float:
        """Time of the last sample, s."""
        return self.start + self.interval * (self.value.size - 1)

    @property
    def time(self) -> np.ndarray:
        """Times of the samples, s."""
        return self.start + self.interval * np.arange(self.value.size)

    @cached_property
    def values(self) -> list[float]:
        """``value`` as plain numbers, of which one after another is quicker to read."""
        return self.value.tolist()

    @cached_property
    def final_level(self) -> float:
        """Median of the last third of the values."""
        return float(np.median(self.value[-(self.value.size // 3 + 1) :]))

    @cached_property
    def prominence(self) -> float:
        """How far a turning point of this signal must stand out, in its unit."""
        if self.value.size < 2:
            return 0.0
        trifle = SMALLEST_PROMINENCE * float(np.ptp(self.value))
        return max(PROMINENCE * self.noise, self.resolution, trifle)

    def index(self, time: float) -> int:
        """Index of the sample nearest to a time, within the grid."""
        return min(max(round((time - self.start) / self.interval), 0), self.value.size - 1)


@dataclass(frozen=True)
class TurningPoints:
    """Alternate maxima and minima of a motion."""

    time: np.ndarray  #: (M,); s.
    value: np.ndarray  #: (M,); rad, or rad/s where ``quantity`` is ``rate``.
    quantity: str
    noise: float  #: Standard deviation of the noise of one value.

    @property
    def double_amplitudes(self) -> np.ndarray:
        """Double amplitude from each turning point to the next, shape (M - 1,)."""
        return np.abs(np.diff(self.value))

    @property
    def half_periods(self) -> np.ndarray:
        """Time from each turning point to the next, s, shape (M - 1,)."""
        return np.diff(self.time)


def find_turning_points(motion: AxisMotion, period: float | None = None) -> TurningPoints:
    """Maxima and minima that stand out of the noise, smoothed for a period, s, or the slowest of most of the motion."""
    levels = pyramid(even_signal(motion))
    best = turning_points_of(next(levels))
    for signal in levels:
        points = turning_points_of(signal)
        sizes = points.double_amplitudes
        found = 2.0 * float(np.average(points.half_periods, weights=sizes)) if sizes.size else 0.0
        if (found if period is None else period) >= MIN_PER_PERIOD * signal.interval:
            best = points
    return best


def mean_period(points: TurningPoints) -> float:
    """Period over the turning points, two at least, weighted by the double amplitudes, s."""
    if points.time.size < 2:
        raise ValueError('a period needs at least two turning points')
    if points.time.size < 3:
        return 2.0 * float(points.half_periods[0])
    sizes = points.double_amplitudes
    return float(np.average(points.time[2:] - points.time[:-2], weights=sizes[:-1] + sizes[1:]))


def centre_of_decay(value: np.ndarray) -> float:
    """Value about which a decay oscillates, from its successive turning points, shape (M,), M >= 1. Median, weighted by
    double amplitude, of Aitken's delta-squared limits of three terms; exact for linear damping.
    """
    value = np.asarray(value, dtype=float)
    if value.size < 3:
        return float(np.mean(value[-2:]))
    first, second, third = value[:-2], value[1:-1], value[2:]
    bend = first - 2.0 * second + third
    bent = np.abs(bend) > 0.0
    if not bent.any():
        return float(np.mean(value[-2:]))
    centre = (third[bent] * first[bent] - second[bent] ** 2) / bend[bent]
    return weighted_median(centre.tolist(), np.abs(bend[bent]).tolist())


def weighted_median(value: Sequence[float], weight: Sequence[float]) -> float:
    """Value below and above which half of the weight lies."""
    in_order = sorted(zip(value, weight, strict=True))
    cumulated = list(accumulate(weight for _, weight in in_order))
    return in_order[bisect_left(cumulated, 0.5 * cumulated[-1])][0]


def find_gaps(motion: AxisMotion, longer_than: float | None = None) -> np.ndarray:
    """Start and end, s, of the gaps longer than a limit, s (default 1.5 median intervals), shape (K, 2)."""
    if motion.size < 3:
        return np.empty((0, 2))
    steps = np.diff(motion.time)
    where = np.flatnonzero(steps > (1.5 * np.median(steps) if longer_than is None else longer_than))
    return np.stack([motion.time[where], motion.time[where + 1]], axis=1)


def split_at_pauses(motion: AxisMotion) -> list[AxisMotion]:
    """The parts of a motion, in order of time, between which the recording paused for long."""
    if motion.size < 3:
        return [motion]
    steps = np.diff(motion.time)
    sampled = np.median(steps) * motion.size
    cuts = np.flatnonzero(steps > LONGEST_BRIDGED_GAP * sampled) + 1
    bounds = [0, *cuts.tolist(), motion.size]
    return [motion.only(slice(a, b)) for a, b in zip(bounds[:-1], bounds[1:], strict=True)]


def even_signal(motion: AxisMotion) -> EvenSignal:
    """The angle of a motion (or its rate) on an even grid, without lone spikes, with gaps bridged by straight lines."""
    quantity, value = ('rate', motion.rate) if motion.angle is None else ('angle', motion.angle)
    value = np.asarray(value, dtype=float)
    time = np.asarray(motion.time, dtype=float)
    record_end = float(time[-1])
    if motion.size < 3 or not time[-1] > time[0]:
        none = np.empty((0, 2))
        return EvenSignal(quantity, float(time[0]), 1.0, value.copy(), 0.0, 0.0, none, record_end=record_end)
    start, duration = float(time[0]), float(time[-1] - time[0])
    interval = max(float(np.median(np.diff(time))), duration / (MAX_SAMPLES - 1))
    number = int(np.floor(duration / interval * (1.0 + 1e-9))) + 1
    resolution = quantum(value)
    if number < 0.7 * motion.size:
        bins = np.clip(np.rint((time - start) / interval).astype(int), 0, number - 1)
        _, elapsed, value = bin_means(bins, time - start, value)
        time = start + elapsed
        resolution = 0.0
    even = without_spikes(np.interp(start + interval * np.arange(number), time, value))
    gaps = find_gaps(motion, longer_than=4.0 * interval)
    # rounded values lie on no grid but that of their own times
    noise = min(noise_level(even), noise_level(value))
    return EvenSignal(quantity, start, interval, even, noise, resolution, gaps, record_end=record_end)


def pyramid(signal: EvenSignal) -> Iterator[EvenSignal]:
    """The signal on its finest grid as it is, then smoothed, on ever coarser grids."""
    yield signal
    level = signal
    while level.value.size >= MIN_PER_PERIOD // 2:
        # a standard deviation of one sample leaves 1 / sqrt(2 sqrt(pi)) of white noise
        smooth = scipy.ndimage.gaussian_filter1d(level.value, 1.0, mode='nearest')
        yield replace(level, value=smooth, noise=level.noise / (4.0 * np.pi) ** 0.25, smoothed=True)
        even = level.value.size // 2 * 2
        level = replace(
            level,
            start=level.start + 0.5 * level.interval,
            interval=2.0 * level.interval,
            value=0.5 * (level.value[0:even:2] + level.value[1:even:2]),
            noise=level.noise / np.sqrt(2.0),
        )


def steadied(levels: Sequence[EvenSignal], motion: AxisMotion) -> Sequence[EvenSignal]:
    """The `pyramid` of a motion's angle with the changes within a period from the rate's integral, where both were
    measured: the slow noise of an attitude filter hides how half-cycles shrink.
    """
    if motion.angle is None or motion.rate is None:
        return levels
    even = levels[0]
    turned = np.interp(even.time, motion.time, running_integral(motion.rate, motion.time))
    found = []
    for angle, fast in zip(levels, pyramid(replace(even, value=turned, noise=noise_level(turned))), strict=True):
        slow = scipy.ndimage.gaussian_filter1d(angle.value - fast.value, MIN_PER_PERIOD, mode='nearest')
        found.append(replace(fast, value=fast.value + slow))
    return found


def suits(signal: EvenSignal, period: float) -> bool:
    """Whether to examine a period, s, on this grid; neighbouring grids overlap a little."""
    samples = period / signal.interval
    if signal.smoothed:
        return 0.75 * MIN_PER_PERIOD <= samples <= 3.0 * MIN_PER_PERIOD
    return MIN_PER_PERIOD_UNSMOOTHED <= samples <= 1.5 * MIN_PER_PERIOD


def turning_points_of(signal: EvenSignal) -> TurningPoints:
    """Maxima and minima of one grid, placed between samples by the parabola through three."""
    value = signal.value
    least = signal.prominence
    if value.size < 3 or least == 0.0:
        return TurningPoints(np.empty(0), np.empty(0), signal.quantity, signal.noise)
    index, is_maximum = prominent_extremes(value, least)
    # of equal ones with no other kind between, the first
    index = index[np.concatenate([[True], is_maximum[1:] != is_maximum[:-1]])[: index.size]]
    before, at, after = value[index - 1], value[index], value[index + 1]
    bend = before - 2.0 * at + after
    bent = bend != 0.0
    offset = np.zeros(index.size)
    offset[bent] = np.clip(0.5 * (before - after)[bent] / bend[bent], -0.5, 0.5)
    time = signal.start + signal.interval * (index + offset)
    return TurningPoints(time, at - 0.25 * (before - after) * offset, signal.quantity, signal.noise)
