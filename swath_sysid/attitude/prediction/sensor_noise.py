"""White noise of a sensor that does not tell it, from the roughness of its samples."""
import math
from dataclasses import dataclass

from swath_sysid.common.errors import InputError


@dataclass(frozen=True)
class NoiseSettings:
    """Bounds of a `NoiseMeter`.

    Attributes
    ----------
    initial, least, most : float
        Standard deviation before enough samples have come, and its bounds, in the channel's unit.
    memory : int
        Samples over which it is averaged.
    """

    initial: float = 0.002
    least: float = 1e-4
    most: float = 0.02
    memory: int = 1000

    def __post_init__(self):
        if not 0.0 < self.least <= self.initial <= self.most:
            raise InputError('noise bounds must be ordered: 0 < least <= initial <= most')
        if self.memory < _FIRST:
            raise InputError(f'memory must be at least {_FIRST} samples')


_FIRST = 20
_THIRD_DIFFERENCE_GAIN = 20.0  # 1 + 9 + 9 + 1: variance of the third difference of white noise
_CLIP = 16.0


class NoiseMeter:
    """Running variance of the white noise in one evenly sampled channel.

    The third difference removes any motion that a quadratic follows over four samples and leaves
    20 times the noise variance (Hamming 1973, difference tables).  What the motion itself leaves,
    at slow sampling, is counted as noise: an upper bound, kept below ``most``.

    Parameters
    ----------
    settings : NoiseSettings
    """

    def __init__(self, settings):
        self.settings = settings
        self.variance = self._average = settings.initial**2
        self._least, self._most, self._floor = settings.least**2, settings.most**2, 0.01 * settings.least**2
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
            if self._count < self.settings.memory:
                self._count += 1
            average += (square - average) / self._count
            self._average = average = average if average > self._floor else self._floor
            self.variance = self._least if average < self._least else self._most if average > self._most else average
        return self.variance
