"""Dimensionless ratios: every term over the restoring moment of the record.

A ratio times the moment of its term at amplitude a and rate w0 a, over w0^2 a, is of order one for any craft.
Search, refinement and the ranges below use these numbers.
"""

from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.terms import TERM_NAMES

_RANGES = {
    'b0': (0.0, 0.5),
    'b1': (0.0, 4.0),
    **dict.fromkeys(('b2', 'b3'), (0.0, 12.0)),
    **dict.fromkeys(('r1', 's1'), (0.0, 5.0)),
    **dict.fromkeys(('r2', 's2'), (-3.0, 3.0)),
    'r3': (-3.0, 6.0),
}
#: Damping is not negative. No upper limit is meant to bind.
LOWER, UPPER = np.array([_RANGES[name] for name in TERM_NAMES]).T


@dataclass(frozen=True)
class Scales:
    """Amplitude and frequency of the records under identification."""

    amplitude: float  #: rad.
    frequency: float  #: rad/s.

    @property
    def rate(self) -> float:
        """Amplitude of the rate, rad/s."""
        return self.amplitude * self.frequency

    @property
    def ratio_units(self) -> np.ndarray:
        """The ratio of each term that is one in dimensionless form, shape (9,)."""
        a, w = self.amplitude, self.frequency
        return np.array([w * w * a, w, 1 / a, 1 / (w * a * a), w * w, w * w / a, w * w / (a * a), w * w, w * w / a])
