"""Whittle's (1953) likelihood of a hull and a sea that together make a measured motion.

The moment over inertia d = w' + b1 w + b2 |w| w + r1 x + r2 x^2 + r3 x^3 must have the spectrum of a sea plus a floor:
that of the vertical acceleration times a power of frequency, or JONSWAP (Hasselmann et al. 1973) with a free tail.
"""

from collections.abc import Callable, Iterator
from math import inf
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.amplitude import amplitude_curves
from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.attitude.hull.terms import TERM_INDEX, TERM_NAMES
from swath_sysid.attitude.identification.motion_fit import PERTURBATION
from swath_sysid.attitude.identification.scoring import Evaluation, LogPosterior
from swath_sysid.attitude.identification.sea_motion import GAUSSIAN_RATE, SeaMotion, term_spectra
from swath_sysid.common.stopping import Cancelled

#: Parameters of hull and level, with mean and standard deviation before the record is seen; those of the sea's shape
#: follow. Frequency over that of the spectrum's peak; nonlinear terms as parts of the linear one.
HULL_PRIORS = {
    'log frequency': (0.0, 1.0),
    'log damping': (np.log(0.15), 1.2),
    'quadratic damping': (0.0, 0.5),
    'quadratic restoring': (0.0, 0.3),
    'cubic restoring': (0.0, 0.1),
    'log level': (0.0, inf),
}
_FREQUENCY, _DAMPING, _QUADRATIC, _EVEN, _CUBIC, _LEVEL = range(len(HULL_PRIORS))
_NONLINEAR = slice(_QUADRATIC, _LEVEL)

#: Of the sea's shape, the log of the floor over its peak last. JONSWAP: log peak frequency over that of the spectrum,
#: log of its peakedness less one (with less than its mean, 3.3, a hull near resonance takes part of the sea's peak for
#: its own), tail; the measured heave: power of the frequency.
SEA_PRIORS = {'jonswap': ((0.0, 0.5), (np.log(2.3), 1.0), (3.0, 2.0), (-7.0, 2.0)), 'heave': ((0.0, 1.0), (-7.0, 2.0))}

MISSING_TOGETHER = 12  #: Neighbouring bands whose misfits may be correlated.


def excitation_spectrum(frequency: np.ndarray, peak: Any, peakedness: Any, tail: Any) -> np.ndarray:
    """JONSWAP (Hasselmann et al. 1973) with a tail frequency^-tail, one at its peak; frequency (B,) and peak in rad/s.

    The tail is 5 where the moment follows wave height, 1 where it follows wave slope in deep water.
    """
    u = frequency / peak
    width = np.where(u <= 1.0, 0.07, 0.09)
    log_peak = np.log(peakedness) * (np.exp(-0.5 * ((u - 1.0) / width) ** 2) - 1.0)
    return np.exp(log_peak - tail * np.log(u) - 1.25 * (u**-4 - 1.0))


class SeaPosterior(LogPosterior):
    """Whittle's likelihood of one record in waves: in a JONSWAP sea, or one as the vertical acceleration shows it.

    ``shown`` is the spectrum of that acceleration at the bands, (B,), or None. Parameters (p,) are those of
    `HULL_PRIORS` and of the sea's shape, the floor last.
    """

    def __init__(
        self, sea: SeaMotion, shown: np.ndarray | None = None, should_cancel: Callable[[], bool] | None = None
    ) -> None:
        self.sea, self.spectra, self._should_cancel = sea, term_spectra(sea), should_cancel
        self.noise = sea.noise(self.spectra.frequency)
        self._shown = None if shown is None else shown / shown.max()
        self.name = 'jonswap' if shown is None else 'heave'  #: Source of the sea's spectrum.
        self._in_peaks = [_FREQUENCY, *([len(HULL_PRIORS)] if shown is None else [])]
        mean, std = np.array([*HULL_PRIORS.values(), *SEA_PRIORS[self.name]]).T
        mean[self._in_peaks] += np.log(sea.peak)
        super().__init__(EQUATIONS['linear'], mean, std)

    def _waves(self, shape: np.ndarray):
        """Spectrum (P, B) of the sea of P shapes, one about its peak."""
        w, floor = self.spectra.frequency, np.exp(shape[:, -1:])
        if self._shown is not None:
            return self._shown * (w / self.sea.peak) ** shape[:, :1] + floor
        return excitation_spectrum(w, np.exp(shape[:, :1]), 1.0 + np.exp(shape[:, 1:2]), shape[:, 2:3]) + floor

    def _weights(self, points: np.ndarray):
        """Coefficients (P, 6) of the terms in the exciting moment."""
        frequency, damping = np.exp(points[:, [_FREQUENCY, _DAMPING]].T)
        b, r = 2.0 * damping * frequency, frequency**2
        return np.column_stack([np.ones_like(b), b, r, points[:, _NONLINEAR] * np.column_stack([b, r, r])])

    def parts(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of P points, each (P, B): spectra of the moment that the hull needs and that the sea gives, and the hull's
        squared stiffness.
        """
        own, w = self._weights(points), self.spectra.frequency
        needed = (own[:, :, None] * own[:, None, :]).reshape(len(own), -1) @ self.spectra.matrices.reshape(w.size, -1).T
        stiffness = (own[:, 2:3] - w**2) ** 2 + (own[:, 1:2] * w) ** 2
        given = np.exp(points[:, [_LEVEL]]) * self._waves(points[:, len(HULL_PRIORS) :])
        return needed, given + stiffness * self.noise, stiffness

    def likelihoods(self, points: np.ndarray) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
        """Whittle's, at points (P, p), all at once."""
        if self._should_cancel is not None and self._should_cancel():
            raise Cancelled
        size, counts = self.mean.size, self.spectra.counts
        moved = points[:, None] + PERTURBATION * np.vstack([np.zeros(size), np.eye(size)])
        parts = (np.split(part, len(points)) for part in self.parts(moved.reshape(-1, size)))
        for z, needed, given, stiffness in zip(points, *parts, strict=True):
            # the bands are those of the measured angle: the change of variables to the moment is the stiffness
            logs = np.log(given / stiffness), np.log(needed / given)
            ratio = needed[0] / given[0]
            by_given, by_ratio = ((log[1:] - log[0]) / PERTURBATION for log in logs)
            cost, gradient = float(counts @ (logs[0][0] + ratio)), (by_given + ratio * by_ratio) @ counts
            # a nonlinear term has nothing in common with the sea that the hull needs otherwise: it adds to it
            by_ratio[_NONLINEAR] = 0.0
            information = (by_ratio * counts) @ by_ratio.T
            units = self._weights(z[None])[0, [1, 2, 2]]
            added = np.tensordot(2.0 * counts / given[0], self.spectra.matrices[:, 3:, 3:], 1)
            information[_NONLINEAR, _NONLINEAR] += added * np.outer(units, units)
            yield cost, gradient, information

    def starts(self) -> list[np.ndarray]:
        """Parameters (p,) of hulls and seas of several frequencies, with the level that suits them."""
        found = []
        for of_hull in np.geomspace(0.5, 5.6, 8):
            for of_sea in (0.7, 1.0, 1.4) if self._shown is None else (None,):
                start = self.mean.copy()
                start[self._in_peaks] += np.log([of_hull, *([of_sea] if of_sea else [])])
                needed, given, _ = self.parts(start[None])
                weight = self.spectra.counts * self.spectra.angle
                start[_LEVEL] = np.log(np.average((needed / given)[0], weights=weight))
                found.append(start)
        return found

    def hull(self, z: np.ndarray) -> np.ndarray:
        """Ratios (9,) of the nonlinear hull about its angle of rest."""
        _, b, r, quadratic, even, cubic = self._weights(z[None])[0]
        s, q, x = self.sea.angle.std(), self.sea.rate.std(), self.sea.angle
        mean = -even * s - cubic * np.mean(x**3) / s**2
        restoring = np.polynomial.Polynomial([mean, r - 3.0 * cubic, even / s, cubic / s**2])
        rest = 0.0
        for _ in range(5):
            slope = restoring.deriv()(rest)
            if slope <= 0.0:
                rest = 0.0
                break
            rest -= restoring(rest) / slope
        ratios = np.zeros(len(TERM_NAMES))
        ratios[TERM_INDEX['b1']], ratios[TERM_INDEX['b2']] = b - GAUSSIAN_RATE * quadratic, quadratic / q
        for power, name in enumerate(('r1', 'r2', 'r3'), 1):
            ratios[TERM_INDEX[name]] = restoring.deriv(power)(rest) / (1.0, 2.0, 6.0)[power - 1]
        return ratios

    def estimate(self, z: np.ndarray) -> np.ndarray:
        """Logarithms of natural frequency, rad/s, and damping ratio at the record's amplitude."""
        curves = amplitude_curves(self.hull(z), np.array([np.sqrt(2.0) * self.sea.angle.std()]), 1e-6)
        frequency, damping = float(curves.frequency[0]), float(curves.damping_ratio[0])
        # without a closed orbit of that size, what remains is the Gaussian linearisation
        is_known = np.isfinite(frequency) and damping > 0.0
        return np.log([frequency, damping]) if is_known else z[[_FREQUENCY, _DAMPING]]

    def _ratio(self, point: Evaluation):
        needed, given, _ = self.parts(point.z[None])
        return (needed / given)[0]

    def deviance(self, point: Evaluation) -> float:
        """Deviance a degree of freedom."""
        ratio = self._ratio(point)
        total = 2.0 * self.spectra.counts @ (ratio - np.log(ratio) - 1.0)
        return float(total / max(1, ratio.size - point.z.size))

    def inflation(self, point: Evaluation) -> float:
        """Variance of the parameters over that of a perfect fit, at least one.

        The deviance times the summed autocorrelation of neighbouring bands' residuals (as Newey and West 1987): where
        the sea has another shape, neighbouring bands miss together.
        """
        residual = np.sqrt(self.spectra.counts) * (self._ratio(point) - 1.0).clip(-1.0, 3.0)
        residual = residual - residual.mean()
        together = 1.0
        for lag in range(1, MISSING_TOGETHER):
            share = 2.0 * (1.0 - lag / MISSING_TOGETHER)
            together += share * (residual[lag:] @ residual[:-lag]) / (residual @ residual)
        return max(1.0, self.deviance(point) * max(1.0, together))
