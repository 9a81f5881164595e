"""Whether a model still suits the craft: what the filter's innovations and the motion's size say.

An innovation of a filter that knows its craft and its sensor is white and of the size it expects
(Mehra 1970; Bar-Shalom, Li and Kirubarajan 2001, section 5.4). Both tests are by counting, so that a
push now and then does not raise them. The filter follows the waves by a disturbance of its own, which
also takes up what a slightly wrong hull leaves over: these tests find a gross mismatch of hull or
sensor, and a refit is what finds the rest.
"""
import math
from dataclasses import dataclass

from scipy.special import chdtri

from swath_sysid.advice import Advice


@dataclass(frozen=True)
class StalenessSettings:
    """When a model is called stale.

    Attributes
    ----------
    memory : float
        s that count.
    expected : float
        Share of the innovations that lie inside the region the filter expects them in.
    most_outside : float
        Share outside from which on the innovations are too large.
    most_alike : float
        Share of innovations with the sign of the one before from which on they are not white.
    most_beyond : float
        Amplitude, over the largest that the model was identified at, from which on it is no longer believed.
    """

    memory: float = 60.0
    expected: float = 0.95
    most_outside: float = 0.3
    most_alike: float = 0.85
    most_beyond: float = 1.25


class ModelWatch:
    """Watches one axis.

    Parameters
    ----------
    settings : StalenessSettings
    """

    def __init__(self, settings=None):
        self._settings = settings or StalenessSettings()
        self._inside = [math.nan, *(float(chdtri(m, 1.0 - self._settings.expected)) for m in (1, 2))]
        self.restart()

    def restart(self, largest_amplitude=math.inf):
        """Begin anew with a model.

        Parameters
        ----------
        largest_amplitude : float
            The largest that it was identified at, rad.
        """
        self._largest = largest_amplitude
        self._age = 0.0
        self._positive = None
        self.outside = self.alike = self._square = 0.0

    @property
    def amplitude(self):
        """Of the harmonic motion of the same standard deviation, rad."""
        return math.sqrt(2.0 * self._square)

    def take(self, elapsed, nis, measured, innovation, excursion):
        """One sample.

        Parameters
        ----------
        elapsed : float
            s since the one before.
        nis : float
            Normalised innovation squared.
        measured : int
            Its degrees of freedom: 1 or 2.
        innovation : float
            Measured less expected, of the rate where it is measured, else of the angle.
        excursion : float
            Angle from trim, rad.
        """
        self._age += elapsed
        gain = elapsed / min(self._settings.memory, self._age) if self._age > 0.0 else 0.0
        positive = innovation > 0.0
        self.outside += gain * ((nis > self._inside[measured]) - self.outside)
        self.alike += gain * ((positive is self._positive) - self.alike)
        self._square += gain * (excursion * excursion - self._square)
        self._positive = positive

    def advice(self, axis):
        """What to say now.

        Parameters
        ----------
        axis : str

        Returns
        -------
        tuple of Advice
        """
        s, found = self._settings, []
        if self._age < s.memory:
            return ()
        if self.outside > s.most_outside or self.alike > s.most_alike:
            found.append(Advice(
                'stale-model',
                f'the {axis} model no longer explains the sensor ({100 * self.outside:.0f} % of the innovations larger '
                f'than expected, usual: {100 * (1 - s.expected):.0f} %; {100 * self.alike:.0f} % with the sign '
                f'of the one before, usual: 50 %): identify again, and if it stays check the covariances that the '
                f'sensor tells',
            ))  # fmt: skip
        if self.amplitude > s.most_beyond * self._largest:
            found.append(Advice(
                'beyond-amplitude',
                f'the craft moves with an amplitude of {math.degrees(self.amplitude):.1f} deg of {axis}, beyond the '
                f'{math.degrees(self._largest):.1f} deg that its model was identified at: identify again from larger '
                f'motions',
            ))  # fmt: skip
        return tuple(found)
