"""Sensor noise that is not reported: white noise from the roughness of the samples, and disagreement of channels."""

import math
from collections import deque
from math import comb

_FIRST, _MEMORY = 20, 1000  #: Samples that the first guess counts for, and over which the variance is averaged.

_THIRD_DIFFERENCE_GAIN = comb(6, 3)  # 1 + 9 + 9 + 1: variance of the third difference of white noise
#: s; time constant with which sizes are forgotten, of errors as of the motion: a shorter one follows wave groups, in
#: which errors grow less than the motion.
MEMORY_OF_SIZE = 60.0

#: A squared error over its expected value counts as this much at the most: what nobody could foresee, such as a glitch
#: or a hand on the craft, says little of the errors to come.
CREDIBLE = 9.0

STRAIN_GAIN = 0.2  #: Of the running mean of a filter's innovations squared over their expectation.

_SPAN = 0.5  #: s over which the rate is integrated: some tenths of a craft's period.
_AGREEMENT_MEMORY = 30.0  #: s; averaging time.

#: Mean square disagreement over that of the noise, above which the channels contradict each other.
_BEYOND_CHANCE = 2.0


class NoiseMeter:
    """Running variance of the white noise in one evenly sampled channel, initial and bounds in its unit.

    The third difference removes motion that is quadratic over four samples and leaves 20 times the noise variance
    (Hamming 1973). Motion left at slow sampling counts as noise: an upper bound, kept below ``most``.
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
        """Add the next value and return the noise variance."""
        a, b, c = self._a, self._b, self._c
        self._a, self._b, self._c = b, c, value
        third = value - 3.0 * c + 3.0 * b - a
        if third == third:
            # clipped, so that a glitch counts as at most a few samples; the first guess weighs as 20 samples
            average, square = self._average, third * third / _THIRD_DIFFERENCE_GAIN
            if square > CREDIBLE * average:
                square = CREDIBLE * average
            if self._count < _MEMORY:
                self._count += 1
            average += (square - average) / self._count
            self._average = average = average if average > self._floor else self._floor
            self.variance = self._least if average < self._least else self._most if average > self._most else average
        return self.variance


class AgreementMeter:
    """Additional noise variance of a rate that a filter uses as the derivative of an angle.

    Filtered attitude lags behind the gyroscopes, or has a gain, so that over half a second the angle's change differs
    from the rate's integral by more than white noise explains.
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
        """Additional variance, rad^2/s^2, after the next sample; zero where angle and rate agree within their noise.

        Elapsed s, angle, rad, and rate, rad/s (NaN: not measured), and variances of their white noise.
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
        while len(past) > 1 and self._time - past[1][0] > _SPAN - 1e-6:
            past.popleft()
        span = self._time - past[0][0]
        if span > _SPAN - 1e-6:
            self._seconds = min(self._seconds + elapsed, _AGREEMENT_MEMORY)
            gain = elapsed / self._seconds
            chance = 2.0 * angle_variance + rate_variance * elapsed * span
            square = (departure - past[0][1]) ** 2
            self._square += gain * (square - self._square)
            self._chance += gain * (chance - self._chance)
        return self._excess(elapsed)

    def _excess(self, elapsed: float):
        if self._seconds < 10.0 * _SPAN or self._square < _BEYOND_CHANCE * self._chance:
            return 0.0
        return (self._square - self._chance) / (_SPAN * elapsed)
