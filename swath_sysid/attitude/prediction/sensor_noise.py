"""White noise of a sensor that does not tell it, from the roughness of its samples."""
import math

_FIRST, _MEMORY = 20, 1000
"""Samples that the first guess counts for, and over which the variance is averaged."""

_THIRD_DIFFERENCE_GAIN = 20.0  # 1 + 9 + 9 + 1: variance of the third difference of white noise
_CLIP = 16.0


class NoiseMeter:
    """Running variance of the white noise in one evenly sampled channel.

    The third difference removes any motion that a quadratic follows over four samples and leaves
    20 times the noise variance (Hamming 1973, difference tables).  What the motion itself leaves,
    at slow sampling, is counted as noise: an upper bound, kept below ``most``.

    Parameters
    ----------
    initial, least, most : float
        Standard deviation before enough samples have come, and its bounds, in the channel's unit.
    """

    def __init__(self, initial, least, most):
        self.variance = self._average = initial**2
        self._least, self._most, self._floor = least**2, most**2, 0.01 * least**2
        self._count = _FIRST
        self.restart()

    def restart(self):
        """Forget the neighbours (after a gap or a missing value), not what was learnt."""
        self._a = self._b = self._c = math.nan

    def take(self, value):
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
