"""Rows: the motion at even steps, of samples of any rate, where their stamps say.

A sensor's clock is better than its stamps: `SampleClock` takes the jitter of stamps for noise of time, and what is
missing between two samples for lost. `RowClock` makes every so many samples a row and draws a line over those of a row
that were lost; a row without a sample is missing.
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import chain
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.stamps import JITTER
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.state_space import cubic_weights
from swath_sysid.common.conventions import THREE_STD

#: Channels that may show the waves; a record without some is forecast from the others.
CHANNELS = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'yaw_rate', 'accel_x', 'accel_y', 'accel_z', 'heave')

#: Columns of a row: `CHANNELS`, filtered where the sensor is much quicker than the rows; `ATTITUDE` as the row's own
#: sample has it; and its mean over the samples since the row before.
OF_CHANNELS = slice(len(CHANNELS))
OF_SAMPLE = slice(OF_CHANNELS.stop, OF_CHANNELS.stop + len(ATTITUDE))
OF_MEANS = slice(OF_SAMPLE.stop, OF_SAMPLE.stop + len(ATTITUDE))

ROWS_A_PERIOD = 32.0  #: A slower sensor gives one row per sample.

#: Samples per row from which the rows hold filtered values: fewer cannot be smoothed without delay.
SMOOTHED_FROM = 5

_REGULAR = 0.5  #: Relative difference of an interval from the usual one that is still jitter.
_IRREGULAR_SAMPLES = 10  #: In a row: then the sensor has another rate.
_PHASE_GAIN = 0.1  #: Share of a stamp's deviation that is the clock's.
_INTERVALS = 51  #: Of which the first guess of the interval is the median, and over which jitter is averaged.
#: Relative differences of a step: that begin rows anew (of the interval: from which samples are read between), and up
#: to which it is the same one.
_NEW_STEP, _SAME_STEP = 0.3, 2e-3
AT_ONCE = 0.02  #: Of a step or an interval: what is less apart in time is not told apart.
_UNKNOWN = (math.nan, math.nan)

_channels_of = itemgetter(*[CraftSample._fields.index(name) for name in CHANNELS])


class Sampled(NamedTuple):
    """When a sample was measured."""

    elapsed: float  #: s since the sample before, without the jitter of the stamps.
    intervals: int  #: Usual ones since then: more than one where samples were lost, none where one comes early.


class SampleClock:
    """Finds the interval of a sensor and the times of its samples by a phase-locked loop on their stamps."""

    def __init__(self) -> None:
        self.interval = math.nan  #: s; NaN while unknown.
        self.count = 0  #: Samples that it is known from.
        self._newest: deque[float] = deque(maxlen=_INTERVALS)
        # s since the newest tick of the clock, and how much of that has been told
        self._behind = self._told = 0.0
        self._jitter = 0.0
        self._irregular = 0

    @property
    def lateness(self) -> float:
        """s from the newest sample to its stamp; zero where no more than rounding."""
        offset = self._behind - self._told
        return offset if abs(offset) > AT_ONCE * self.interval else 0.0

    def reset(self) -> None:
        """Forget the time of the newest sample."""
        self._behind = self._told = 0.0

    def follow(self, elapsed: float, count: int = 1) -> Sampled:
        """Take the time, s, between the stamps of a sample and of the one before; of ``count`` it is the one used."""
        self._newest.append(elapsed / count)
        self.count = min(self.count + 1, 1000)
        if self.count <= _INTERVALS:
            # while the loop settles; most samples arrive, so that the median is of whole intervals
            newest = np.array(self._newest)
            self.interval = float(newest.sum() / max(np.round(newest / np.median(newest)).sum(), 1.0))
        since = self._behind + elapsed
        relative = since / self.interval
        doubt = THREE_STD * max(self._jitter - JITTER, 0.0)
        more = math.copysign(max(round(abs(relative - 1.0) - doubt), 0), relative - 1.0)
        intervals = max(1 + int(more), 0 if self.count > _INTERVALS else 1)
        # what was behind may be so many of another interval, while this one is guessed
        deviation = max(relative - intervals, -float(_INTERVALS))
        if self._has_another_rate(elapsed / count):
            return Sampled(elapsed, 1)
        if intervals == 0:
            passed = elapsed if doubt == 0.0 else JITTER * self.interval
            self._behind, self._told = since, self._told + passed
            return Sampled(passed, 0)
        told, self._told = self._told, 0.0
        self._jitter += (min(abs(deviation), 0.5) - self._jitter) / _INTERVALS
        self.interval *= 1.0 + 0.25 * _PHASE_GAIN**2 * deviation / intervals
        self._behind = (1.0 - _PHASE_GAIN) * deviation * self.interval
        return Sampled(max(since - self._behind - told, JITTER * self.interval), intervals)

    def _has_another_rate(self, elapsed: float) -> bool:
        """Whether the sensor has: so many intervals in a row are unusual, and alike; then begin with them."""
        self._irregular = self._irregular + 1 if _differ(elapsed, self.interval) else 0
        if self._irregular < _IRREGULAR_SAMPLES:
            return False
        newest = list(self._newest)[-_IRREGULAR_SAMPLES:]
        usual = float(np.median(newest))
        if any(_differ(interval, usual) for interval in newest):
            return False
        self._newest.clear()
        self._newest.extend(newest)
        self.interval, self.count = usual, len(newest)
        self._behind = self._told = self._jitter = 0.0
        self._irregular = 0
        return True


def _differ(interval: float, usual: float) -> bool:
    return abs(interval / usual - 1.0) >= _REGULAR


class RowClock:
    """Makes every so many samples of a sensor a row; samples that were lost are filled in linearly, and so are those of
    a sensor whose rate has changed since the rows were laid out.
    """

    def __init__(self) -> None:
        self.sensor = SampleClock()
        self.step = math.nan  #: s between rows; NaN while unknown.
        self.samples = 1  #: Per row.
        self.period = USUAL_PERIOD  #: s; of the motion that the rows are laid out for.
        self._tick = math.nan  #: s between the samples that rows are made of.
        self._laid_for = math.nan  #: s; the sensor's interval then.
        self._corrections = 0
        self.reset()

    def reset(self, *, is_next_row: bool = True) -> None:
        """Forget the samples since the newest row: the next one is a row, or, after a silence, the first of many."""
        self._ticks = self.samples - 1 if is_next_row else 0
        self._newest, self._filtered = [math.nan] * len(CHANNELS), list[float]()
        self._stands_in: Sequence[bool] = ()
        self._begin_block()
        if not is_next_row:
            self.sensor.reset()

    def _begin_block(self):
        self._lag, self._values = 0.0, [math.nan] * len(CHANNELS)
        self._clear_sums()

    def _clear_sums(self):
        self._sums, self._counts = [0.0] * len(ATTITUDE), [0] * len(CHANNELS)

    @property
    def interval(self) -> float:
        """Usual time between samples, s; NaN while unknown."""
        return self.sensor.interval

    @property
    def longest_filled(self) -> float:
        """s, a step: where more lies between two samples, a row has no sample of its own, and is not known."""
        return (1.0 + AT_ONCE) * self.step

    @property
    def since_row(self) -> float:
        """s since the newest row."""
        return self._ticks * self._tick + self._lag

    @property
    def is_smoothed(self) -> bool:
        """Whether rows hold filtered values."""
        return self.samples >= SMOOTHED_FROM

    def lay_out(self, period: float) -> bool:
        """Lay out rows for a motion of this period, s; whether that gives another step."""
        self.period, self._laid_for = period, self.interval
        samples = max(1, round(period / ROWS_A_PERIOD / self.interval))
        is_slower = self.interval > (1.0 + _SAME_STEP) * self.step
        if not is_slower and abs(samples * self.interval / self.step - 1.0) < _NEW_STEP:
            self._keep_step()
            return False
        self.samples, self._tick = samples, self.interval
        self.step, self._corrections = samples * self.interval, self.sensor.count
        self.reset()
        return True

    def _keep_step(self):
        """Make the same rows of the sensor's present samples, where so many of them are as long."""
        samples = max(1, round(self.step / self.interval))
        if abs(samples * self.interval / self.step - 1.0) < _SAME_STEP:
            self._ticks, self._lag = min(round(self.since_row / self.interval), samples - 1), 0.0
            self.samples, self._tick = samples, self.interval
            self._corrections = self.sensor.count

    def is_laid_out_for(self, period: float) -> bool:
        """Whether the rows are those for a motion of this period, s, and for the sensor's present rate."""
        return period == self.period and abs(self.interval / self._laid_for - 1.0) < _NEW_STEP

    def corrected(self) -> bool:
        """Follow the interval, each time that twice as many samples show it; whether that has changed the step."""
        if self.sensor.count < 2 * self._corrections:
            return False
        self._corrections = self.sensor.count
        step = self.samples * self.interval
        if not _SAME_STEP < abs(step / self.step - 1.0) < _NEW_STEP:
            return False
        self.step, self._tick = step, self.interval
        return True

    def first(self, sample: CraftSample) -> list[float]:
        """The row of a sample by itself."""
        values = list(_channels_of(sample))
        return [*values, *values[: len(ATTITUDE)], *values[: len(ATTITUDE)]]

    def take(
        self,
        sample: CraftSample,
        sampled: Sampled,
        filtered: Sequence[tuple[float, float] | None],
        stands_in: Sequence[bool] = (),
    ) -> list[tuple[float, list[float] | None]]:
        """Take a sample: the rows that it completes, each with its age, s, and None where nothing is known of one.

        Filtered angle and rate by axis, where known, take the part of smoothed ones, and where the filtered angle
        stands in, of one that is not measured while the rate is.
        """
        self._stands_in = stands_in
        elapsed = sampled.intervals * self.interval
        before, self._newest = self._newest, list(_channels_of(sample))
        angles_and_rates = zip(*(motion or _UNKNOWN for motion in filtered), strict=True)
        filtered_before, self._filtered = self._filtered, list(chain.from_iterable(angles_and_rates))
        filtered_before = filtered_before or self._filtered
        if abs(self.interval / self._tick - 1.0) < _NEW_STEP:
            shares = [(place + 1) / sampled.intervals for place in range(sampled.intervals)]
            elapsed = sampled.intervals * self._tick
        else:
            first = self._tick - self._lag
            ticks = math.floor((elapsed - first) / self._tick + 1.0 + 1e-6)
            self._lag = self._lag + elapsed - ticks * self._tick
            shares = [min((first + place * self._tick) / elapsed, 1.0) for place in range(ticks)]
        if elapsed > max(self.longest_filled, 1.5 * self.interval):
            return self._after_gap(before, filtered_before, elapsed)
        rows: list[tuple[float, list[float] | None]] = []
        for share in shares:
            if share < 1.0:
                values = _between(before, self._newest, share, elapsed)
                motion = _between(filtered_before, self._filtered, share, elapsed)
            else:
                values, motion = self._newest, self._filtered
            if self._is_row(values):
                rows.append(((1.0 - share) * elapsed, self._row(values, motion)))
        return rows

    def _after_gap(
        self, before: Sequence[float], filtered_before: Sequence[float], elapsed: float
    ) -> list[tuple[float, list[float] | None]]:
        """The rows of a gap, whole steps after those before: missing, but for one less than a step before its end.

        Of that, the sample at its end tells, or a line over two steps at most.
        """
        ticks = max(round(self._ticks + elapsed / self._tick), 1)
        is_at_end = ticks % self.samples == 0 and elapsed < self.period / math.tau
        is_told = is_at_end or elapsed < self.longest_filled + self.step
        # else the row to come is of as many samples as any: fewer are less smooth
        count = (ticks - 1) // self.samples if is_told else math.ceil((ticks - 1) / self.samples)
        since = ticks - count * self.samples
        rows: list[tuple[float, list[float] | None]] = [
            ((ticks - (place + 1) * self.samples) * self._tick, None) for place in range(count)
        ]
        self._begin_block()
        if is_told and count and since < self.samples:
            share, self._ticks = 1.0 - since * self._tick / elapsed, self.samples - 1
            values = _between(before, self._newest, share, elapsed)
            self._is_row(values)
            rows[-1] = since * self._tick, self._row(values, _between(filtered_before, self._filtered, share, elapsed))
        self._ticks = since - 1
        if self._is_row(self._newest):
            rows.append((0.0, self._row(self._newest, self._filtered)))
        return rows

    def _is_row(self, values: Sequence[float]) -> bool:
        """Take the values one tick later; whether they are a row."""
        for place, value in enumerate(values):
            if value == value:
                self._counts[place] += 1
                if place < len(ATTITUDE):
                    self._sums[place] += value
        if self.is_smoothed:
            gain, smoothed = 2.0 / self.samples, self._values
            for place, value in enumerate(values):
                if value == value:
                    then = smoothed[place]
                    smoothed[place] = then + gain * (value - then) if then == then else value
        else:
            self._values = list(values)
        self._ticks += 1
        if self._ticks == 0:
            self._clear_sums()
        if self._ticks < self.samples:
            return False
        self._ticks = 0
        return True

    def _row(self, values: Sequence[float], filtered: Sequence[float]) -> list[float]:
        # what none of its samples has measured is missing in a row
        self._values = [value if count else math.nan for value, count in zip(self._values, self._counts, strict=True)]
        channels = list(self._values)
        if self.is_smoothed:
            for place, value in enumerate(filtered):
                if value == value and channels[place] == channels[place]:
                    channels[place] = value
        means = [total / count if count else math.nan for total, count in zip(self._sums, self._counts, strict=False)]
        self._clear_sums()
        sampled = list(values[: len(ATTITUDE)])
        for angle, stands_in in enumerate(self._stands_in):
            if stands_in and sampled[angle + len(AXES)] == sampled[angle + len(AXES)]:
                channels[angle] = sampled[angle] = filtered[angle]
        return [*channels, *sampled, *means]


def _between(before: Sequence[float], after: Sequence[float], share: float, elapsed: float) -> list[float]:
    """Values, `ATTITUDE` first, at a share of the elapsed s between two samples: linear, angles by Hermite's cubics."""
    values = [a + share * (b - a) for a, b in zip(before, after, strict=True)]
    rest = 1.0 - share
    for angle in range(len(AXES)):
        rate = angle + len(AXES)
        # what the rates at both ends add to the line between the angles
        over = before[angle] + elapsed * before[rate] - after[angle]
        under = after[angle] - elapsed * after[rate] - before[angle]
        added = share * rest * (rest * over + share * under)
        if added == added:
            values[angle] += added
    return values


def resampled(rows: np.ndarray, ratio: float) -> np.ndarray:
    """Rows (N, C) at steps as many times as long, the newest the same, by cubics; NaN where one of four is missing."""
    count = int((len(rows) - 1) / ratio) if len(rows) else 0
    place = len(rows) - 1 - ratio * np.arange(count, -1, -1)
    whole = np.clip(np.floor(place).astype(int), 1, max(len(rows) - 3, 1))
    if len(rows) < 4:
        return rows[np.clip(np.round(place).astype(int), 0, len(rows) - 1)] if len(rows) else rows
    weights = cubic_weights(place - whole)
    return np.einsum('nw,nwc->nc', weights, rows[whole[:, None] + np.arange(-1, 3)])
