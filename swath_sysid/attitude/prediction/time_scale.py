"""The time scale of a motion, by which everything that belongs to it is laid out."""

import math

import numpy as np

from swath_sysid.attitude.prediction.memories import LOOKED_AT, NOW, USUAL_PERIOD
from swath_sysid.attitude.prediction.rows import ROWS_A_PERIOD

_FIRST_LOOK = 0.25  #: Periods of motion; doubled from look to look until it is settled, and one from then on.
#: Periods of motion: any part of a slower one, where it turns, seems to have lasted for less.
_CONCLUSIVE = 1.25
_LEAST_SAMPLES = 10.0  #: A period; whoever chooses a sensor expects to see the motion.
#: Relative differences from which another period is taken: at first, until it is settled, and for another sea.
_EARLY, _SETTLED, _OTHER = 0.15, 0.05, 0.4
_EARLY_PERIODS, _SETTLED_PERIODS = 3.0, 12.0  #: Of motion that each of the first two lasts.


def period_of(
    angles: np.ndarray, rates: np.ndarray, step: float, angle_noise: np.ndarray, rate_noise: np.ndarray, block: int
) -> float:
    """Period, s, of motion about all axes: that of a sine with its standard deviations of rate and angle.

    The deviations are those within blocks of so many rows, so that a list that changes is no motion.

    Angles and rates (N, A), rad and rad/s, NaN where not measured, ``step`` s apart, with the variances of their noise
    (A,). Where rates are not measured, from differences. NaN where the motion is no more than the noise.
    """
    of_angle = of_rate = 0.0
    for angle, rate, *noise in zip(angles.T, rates.T, angle_noise, rate_noise, strict=True):
        seen = np.isfinite(angle)
        if seen.sum() < 3:
            continue
        if np.isfinite(rate).sum() < 3:
            rate, noise[1] = np.diff(angle) / step, 2.0 * noise[0] / step**2
        square, rate_square = _variance_within(angle, block) - noise[0], _square_within(rate, block) - noise[1]
        if square > noise[0] and rate_square > 0.0:
            of_angle, of_rate = of_angle + square, of_rate + rate_square
    return 2.0 * math.pi * math.sqrt(of_angle / of_rate) if of_rate else math.nan


def _square_within(rates: np.ndarray, block: int) -> float:
    """Of rates, NaN where missing: their variance, or their mean square in less than a block: a mean is motion."""
    if rates.size >= block:
        return _variance_within(rates, block)
    seen = rates[np.isfinite(rates)]
    return float(seen @ seen) / max(seen.size, 1)


def _variance_within(values: np.ndarray, block: int) -> float:
    """Of values, NaN where missing, about the means of the newest blocks of so many."""
    blocks = values[values.size % block :].reshape(-1, block) if values.size >= block else values[None]
    blocks = blocks[np.isfinite(blocks).sum(axis=1) > 1]
    return float(np.nanmean((blocks - np.nanmean(blocks, axis=1, keepdims=True)) ** 2)) if blocks.size else 0.0


class TimeScale:
    """The period that a motion's rows and memories are laid out by, and when to look at it again."""

    def __init__(self) -> None:
        self.period = self._usual = USUAL_PERIOD  #: s.
        self._begun, self._due = 0.0, math.nan

    def expect(self, interval: float) -> None:
        """Before any motion: of a craft for which a sensor has this interval, s, and which may be quick."""
        self._usual = max(USUAL_PERIOD, _LEAST_SAMPLES * interval)
        self.period = min(self._usual, ROWS_A_PERIOD * interval)

    def know(self, period: float) -> None:
        """Begin with the period, s, of a motion that is remembered."""
        self.period = period

    def is_due(self, age: float) -> bool:
        """Whether to look again after so many s of samples."""
        if self._due != self._due:
            self._due = _FIRST_LOOK * self.period
        return age >= self._due

    def past(self, age: float) -> tuple[float, float]:
        """s of the past to look at, and of the blocks that it is looked at in."""
        return min(age, LOOKED_AT * self.period), NOW * self.period

    def follow(self, found: float, age: float) -> bool:
        """Take the period, s, of the past after so many s of samples; whether another one is used from now on.

        NaN where nothing moves yet: what is found next is the first of another motion, of the usual period or more.
        """
        if found != found:
            before, self.period = self.period, max(self.period, self._usual)
            self._begun, self._due = age, age + _FIRST_LOOK * self.period
            return self.period != before
        first = _FIRST_LOOK * self.period
        since = max(age - self._begun, first)
        known = since / self.period
        tolerance = _EARLY if known < _EARLY_PERIODS else _SETTLED if known < _SETTLED_PERIODS else _OTHER
        if since < _CONCLUSIVE * found:
            # a slower motion would look the same
            found = max(found, self.period)
        # less than a period of motion says so much less
        found = self.period * (found / self.period) ** min(1.0, since / found)
        is_other = not 1.0 / (1.0 + tolerance) < found / self.period < 1.0 + tolerance
        if is_other:
            self.period = found
        self._due = age + (since if known < _SETTLED_PERIODS else self.period)
        return is_other
