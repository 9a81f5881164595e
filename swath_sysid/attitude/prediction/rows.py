"""Rows: the motion at even steps, of samples of any rate."""

import math
from collections.abc import Sequence
from operator import itemgetter

from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.prediction.point import ATTITUDE

#: Channels that may show the waves; a record without some is forecast from the others.
CHANNELS = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'yaw_rate', 'accel_x', 'accel_y', 'accel_z', 'heave')

#: Columns of a row: `CHANNELS`, filtered where the sensor is much quicker than the rows; `ATTITUDE` as the row's own
#: sample has it; and its mean over the samples since the row before.
OF_CHANNELS = slice(len(CHANNELS))
OF_SAMPLE = slice(OF_CHANNELS.stop, OF_CHANNELS.stop + len(ATTITUDE))
OF_MEANS = slice(OF_SAMPLE.stop, OF_SAMPLE.stop + len(ATTITUDE))

ROW_RATE = 10.0  #: Hz; small craft move below 1.5 Hz. A slower sensor gives one row per sample.

#: Samples per row from which the rows hold filtered values: fewer cannot be smoothed without delay.
SMOOTHED_FROM = 5

NEW, CORRECTED = 'new', 'corrected'  #: What became of the step between rows.

_REGULAR = 0.5  #: Relative difference of an interval from the usual one that is still jitter.
_IRREGULAR_SAMPLES = 10  #: In a row: then the sensor has another rate.
_NEW_STEP, _INEXACT_STEP = 0.15, 2e-3  #: Relative differences of a step that begin rows anew, and correct it.
_SETTLING_INTERVALS = (5, 20, 60, 200)  #: Intervals after which the step is corrected.

_channels_of = itemgetter(*[CraftSample._fields.index(name) for name in CHANNELS])


class RowClock:
    """Finds the interval of a sensor and makes every so many of its samples a row."""

    def __init__(self) -> None:
        self.interval = self.step = math.nan  #: s between samples and between rows; NaN while unknown.
        self.samples = 1  #: Per row.
        self.since_row = 0.0  #: s since the newest row.
        self._intervals = self._irregular = 0
        self.restart()

    def restart(self) -> None:
        """Forget the samples since the newest row: the next sample is a row."""
        self.since_row = self.step
        self._values = [math.nan] * len(CHANNELS)
        self._clear_block()

    def _clear_block(self):
        self._sums, self._counts = [0.0] * len(ATTITUDE), [0] * len(ATTITUDE)

    @property
    def is_smoothed(self) -> bool:
        """Whether rows hold filtered values."""
        return self.samples >= SMOOTHED_FROM

    def is_even(self, elapsed: float) -> bool:
        """Whether an interval, s, is the usual one."""
        return abs(elapsed - self.interval) < _REGULAR * self.interval

    def follow(self, elapsed: float) -> str | None:
        """Follow the interval by one more, s, as the mean of similar ones; `NEW` or `CORRECTED` where the step changed.

        A new rate shows by the lack of similar intervals.
        """
        if self.is_even(elapsed):
            self._intervals = min(self._intervals + 1, 1000)
            self.interval += (elapsed - self.interval) / self._intervals
            self._irregular = 0
        else:
            self._irregular += 1
            if self.interval == self.interval and self._irregular < _IRREGULAR_SAMPLES:
                return None
            self.interval, self._intervals, self._irregular = elapsed, 1, 0
        samples = max(1, round(1.0 / (ROW_RATE * self.interval)))
        # at 25 Hz, jitter decides whether two or three come nearest to a row's time: as many as before do, too
        deviation = min(abs(count * self.interval / self.step - 1.0) for count in (self.samples, samples))
        if not deviation < _NEW_STEP:
            self.samples, self.step = samples, samples * self.interval
            self.restart()
            return NEW
        if self._intervals in _SETTLING_INTERVALS and deviation > _INEXACT_STEP:
            self.samples = round(self.step / self.interval)
            self.step = self.samples * self.interval
            return CORRECTED
        return None

    def take(self, sample: CraftSample, elapsed: float) -> int:
        """Take a sample, ``elapsed`` s after the one before: steps from the newest row to the one it is; 0 if none."""
        self.since_row += elapsed
        measured = _channels_of(sample)
        for place in range(len(ATTITUDE)):
            value = measured[place]
            if value == value:
                self._sums[place] += value
                self._counts[place] += 1
        if self.is_smoothed:
            gain, values = 2.0 / self.samples, self._values
            for place, value in enumerate(measured):
                if value == value:
                    before = values[place]
                    values[place] = before + gain * (value - before) if before == before else value
        else:
            self._values = list(measured)
        steps = round(self.since_row / self.step)
        if steps < 1 or self.since_row < self.step - 0.5 * self.interval:
            return 0
        # a row is a sample's, whatever the clocks of sensor and rows make of their steps
        self.since_row = 0.0
        self._measured = measured[: len(ATTITUDE)]
        return steps

    def row(self, filtered: Sequence[tuple[float, float] | None]) -> list[float]:
        """The row of the newest sample, NaN where not measured.

        Filtered angle and rate by axis, where known, take the part of smoothed ones.
        """
        channels = list(self._values)
        for place, motion in enumerate(filtered if self.is_smoothed else ()):
            if motion is not None:
                channels[place], channels[place + len(filtered)] = motion
        means = [total / count if count else math.nan for total, count in zip(self._sums, self._counts, strict=True)]
        self._clear_block()
        return [*channels, *self._measured, *means]
