"""The log posterior of least squares, where the basin likelihood is not suited.

Residuals of N samples that are equivalent to n independent ones are weighted by n / N.
"""

from collections.abc import Sequence

import numpy as np

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import DAMPING_NAMES
from swath_sysid.attitude.identification.motion_fit import MotionFit
from swath_sysid.attitude.identification.pruning import LINEAR_PRIOR
from swath_sysid.attitude.identification.scoring import Evaluation, search_each


class ResidualPosterior:
    """Negative log posterior of an equation's dimensionless ratios and the initial states of records.

    ``variance`` is that of the weighted residuals times samples per independent one; ``ratio_prior`` (n,) holds prior
    standard deviations, about zero but for the linear stiffness about one. States have that of a linear term.
    """

    def __init__(self, fit: MotionFit, equation: Equation, variance: float, ratio_prior: np.ndarray, size: int) -> None:
        self.equation, self.ratio_prior = equation, ratio_prior
        self._fit, self._variance = fit, variance
        n = ratio_prior.size
        self._weight = np.r_[
            ratio_prior**-2, np.full(size - n, LINEAR_PRIOR**-2)
        ]  # rates alone say nothing of the trim
        self._mean = np.r_[[float(name == 'r1') for name in equation.terms], np.zeros(size - n)]
        self.lowest = np.full(size, -np.inf)
        self.lowest[:n][[name in DAMPING_NAMES for name in equation.terms]] = 0.0

    def optimum(self, start: np.ndarray, held: Sequence[int]) -> Evaluation:
        """The optimum from parameters (p,), those at the places ``held`` kept."""
        stays = np.isin(np.arange(start.size), held)
        (found,) = search_each(self.evaluate, [start], self.lowest, np.full(start.size, np.inf), [stays])
        return found

    def evaluate(self, points: Sequence[np.ndarray]) -> list[Evaluation]:
        """The posterior and its derivatives at some points (p,), as `MotionFit.pack` gives them."""
        return [self._evaluation(z) for z in points]

    def _evaluation(self, z: np.ndarray):
        residuals, jacobians = self._fit.residuals_and_jacobian(z)
        with np.errstate(over='ignore', invalid='ignore'):
            e, slopes = np.concatenate(residuals), np.concatenate(jacobians)
            away = z - self._mean
            cost = 0.5 * float(e @ e) / self._variance + 0.5 * float(self._weight @ away**2)
            gradient = slopes.T @ e / self._variance + self._weight * away
            information = slopes.T @ slopes / self._variance + np.diag(self._weight)
        return Evaluation(z, cost if np.isfinite(cost) else np.inf, gradient, information)
