"""Intervals that hold what they say: quantiles of past errors, corrected by their own record.

Online conformal prediction (Gibbs and Candes 2021; Angelopoulos, Candes and Tibshirani 2023): after
each error the log of a quantile moves up when the interval missed and down when it held, by steps
whose ratio makes misses as frequent as wanted, whatever the errors' distribution.
"""
import math

import numpy as np

LEVELS = np.array([0.5, 0.9, 0.99])
NORMAL_QUANTILES = np.array([0.6744897501960817, 1.6448536269514722, 2.5758293035489004])
_LARGEST_LOG = 6.0
# a rare level has few misses to learn from, so each counts for more; much more would make its width jump about
_BOLDNESS = np.array([0.6, 1.0, 1.5])


class Calibrator:
    """Half widths of central intervals, in multiples of a nominal deviation, for any array of forecasts.

    Parameters
    ----------
    shape : tuple of int
        Of the array of forecasts.
    rate : float
        Step of the log quantile for one miss, for errors a second apart.
    """

    def __init__(self, shape, rate=0.15):
        self._rate = rate
        self._start = np.broadcast_to(np.log(NORMAL_QUANTILES), (*shape, LEVELS.size))
        self.forget()

    def forget(self):
        """Start anew from the normal distribution's quantiles."""
        self._log = self._start.copy()
        self.held = np.zeros(self._log.shape)
        self.count = np.zeros(self._log.shape[:-1])

    def learn(self, errors, issued, elapsed):
        """Take in errors over the nominal deviation they were issued with.

        Parameters
        ----------
        errors : ndarray, shape of the forecasts
            NaN where none has become known.
        issued : ndarray, shape (..., 3)
            The quantiles that those forecasts were issued with.
        elapsed : float
            s since the last call.
        """
        known = np.isfinite(errors)
        # what was told counts, not what would be told now: that is what makes the told intervals right
        inside = np.abs(errors)[..., None] <= issued
        self.held += inside & known[..., None]
        self.count += known
        # errors closer together than a second are nearly the same error: each moves the quantile less
        gain = self._rate * math.sqrt(min(max(elapsed, 1e-3), 4.0))
        step = gain * np.where(inside, LEVELS - 1.0, LEVELS) * _BOLDNESS
        moved = np.clip(self._log + np.where(known[..., None], step, 0.0), -_LARGEST_LOG, _LARGEST_LOG)
        # a wider interval must not end inside a narrower one
        self._log = np.maximum.accumulate(moved, axis=-1)

    @property
    def quantiles(self):
        """Half widths over the nominal deviation, shape (..., 3)."""
        return np.exp(self._log)

    @property
    def coverage(self):
        """Share of intervals that held, shape (..., 3); NaN before the first."""
        with np.errstate(invalid='ignore', divide='ignore'):
            return self.held / self.count[..., None]
