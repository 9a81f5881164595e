"""What a sensor does not report: its white noise, by the roughness of its samples, and how well its channels agree."""

import math
from collections import deque

_FIRST, _MEMORY = 20, 1000  #: Samples that the first guess counts for, and over which the variance is averaged.

_THIRD_DIFFERENCE_GAIN = 20.0  # 1 + 9 + 9 + 1: variance of the third difference of white noise
_CLIP = 16.0


_SPAN = 0.5  #: s over which the rate is integrated: some tenths of a craft's period, so that a lag or a gain shows.
_WHOLE_SPAN = _SPAN - 1e-6  #: s; sums of intervals round.
_SETTLED, _AGREEMENT_MEMORY = 5.0, 30.0  #: s of motion before a disagreement counts, and over which it is averaged.

#: Disagreement over what the noise explains, mean square, from where on the channels contradict each other.
_BEYOND_CHANCE = 2.0


class NoiseMeter:
    """Running variance of the white noise in one evenly sampled channel.

    The third difference removes any motion that a quadratic follows over four samples and leaves
    20 times the noise variance (Hamming 1973, difference tables).  What the motion itself leaves,
    at slow sampling, is counted as noise: an upper bound, kept below ``most``.

    Args:
        initial, least, most: Standard deviation before enough samples have come, and its bounds, in the channel's unit.
    """

    def __init__(self, initial: float, least: float, most: float) -> None:
        self.variance = self._average = initial**2
        self._least, self._most, self._floor = least**2, most**2, 0.01 * least**2
        self._count = _FIRST
        self.restart()

    def restart(self) -> None:
        """Forget the neighbours (after a gap or a missing value), not what was learnt."""
        self._a = self._b = self._c = math.nan

    def take(self, value: float) -> float:
        """Take in the next value and return the noise variance."""
        a, b, c = self._a, self._b, self._c
        self._a, self._b, self._c = b, c, value
        third = value - 3.0 * c + 3.0 * b - a
        if third == third:
            # clipped, so that a glitch counts as at most a few samples; the first guess weighs as 20 samples
            average, square = self._average, third * third / _THIRD_DIFFERENCE_GAIN
            if square > _CLIP * average:
                square = _CLIP * average
            if self._count < _MEMORY:
                self._count += 1
            average += (square - average) / self._count
            self._average = average = average if average > self._floor else self._floor
            self.variance = self._least if average < self._least else self._most if average > self._most else average
        return self.variance


class AgreementMeter:
    """Variance by which a rate's noise is larger for a filter that takes it for the derivative of an angle.

    Attitude that a sensor has filtered lags behind its gyroscopes by some hundredths of a second, or follows with a
    gain.  Over half a second the angle then changes by another amount than the integral of the rate, by much more than
    white noise explains.  White noise of the rate that explains it has that mean square over span and interval.
    """

    def __init__(self) -> None:
        self._seconds = self._square = self._chance = 0.0
        self._past: deque[tuple[float, float]] = deque()
        self.restart()

    def restart(self) -> None:
        """Forget the neighbours (after a gap or a missing value), not what was learnt."""
        self._past.clear()
        self._rate = math.nan
        self._time = self._integral = 0.0

    def take(self, elapsed: float, angle: float, rate: float, angle_variance: float, rate_variance: float) -> float:
        """Take in the next sample.

        Args:
            elapsed: s since the one before.
            angle, rate: rad, rad/s; NaN: not measured.
            angle_variance, rate_variance: Of their white noise, rad^2 and rad^2/s^2.

        Returns:
            rad^2/s^2; zero where angle and rate agree within their noise.
        """
        change = rate - self._rate
        if change != change or angle != angle:
            self.restart()
            self._rate = rate
            return self._excess(elapsed)
        self._rate = rate
        self._time += elapsed
        self._integral += elapsed * (rate - 0.5 * change)
        # trapezoids with the ends' correction (Euler and Maclaurin)
        departure = angle - self._integral + elapsed / 12.0 * change
        past = self._past
        past.append((self._time, departure))
        while len(past) > 1 and self._time - past[1][0] >= _WHOLE_SPAN:
            past.popleft()
        span = self._time - past[0][0]
        if span >= _WHOLE_SPAN:
            self._seconds = min(self._seconds + elapsed, _AGREEMENT_MEMORY)
            gain = elapsed / self._seconds
            chance = 2.0 * angle_variance + rate_variance * elapsed * span
            square = (departure - past[0][1]) ** 2
            self._square += gain * (square - self._square)
            self._chance += gain * (chance - self._chance)
        return self._excess(elapsed)

    def _excess(self, elapsed: float):
        if self._seconds < _SETTLED or self._square < _BEYOND_CHANCE * self._chance:
            return 0.0
        return (self._square - self._chance) / (_SPAN * elapsed)
