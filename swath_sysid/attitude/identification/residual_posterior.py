"""The log posterior of least squares, where the basin likelihood is not suited.

Residuals of N samples that are equivalent to n independent ones are weighted by n / N.
"""

from collections.abc import Sequence

import numpy as np

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import DAMPING_NAMES
from swath_sysid.attitude.identification.problem import Problem, motion_fit
from swath_sysid.attitude.identification.pruning import LINEAR_PRIOR, weak_prior
from swath_sysid.attitude.identification.scoring import Evaluation, LogPosterior
from swath_sysid.common.covariance import sandwich_covariance


class ResidualPosterior(LogPosterior):
    """Negative log posterior of an equation's dimensionless ratios and the initial states of records.

    Parameters are those of `MotionFit.pack`. The noise is that of the residuals at parameters ``about``. States have
    the prior of a linear term: rates alone say nothing of the trim.
    """

    def __init__(self, problem: Problem, equation: Equation, about: np.ndarray) -> None:
        self.equation, self.ratio_prior = equation, weak_prior(equation, problem.decayed_to)
        self._fit = motion_fit(problem, equation)
        residuals, jacobians = self._fit.residuals_and_jacobian(about)
        independent = sandwich_covariance(residuals, jacobians, problem.shortest_memory).effective_samples
        self._variance = sum(float(r @ r) for r in residuals) / independent
        others = about.size - self.ratio_prior.size
        self._weight = np.r_[self.ratio_prior**-2, np.full(others, LINEAR_PRIOR**-2)]
        self._mean = np.r_[[float(name in ('r1', 's1')) for name in equation.terms], np.zeros(others)]
        self.lowest = np.full(about.size, -np.inf)
        self.lowest[: self.ratio_prior.size][[name in DAMPING_NAMES for name in equation.terms]] = 0.0

    def evaluate(self, points: Sequence[np.ndarray]) -> list[Evaluation]:
        """The posterior and its derivatives at some points (p,)."""
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


def residual_posterior(problem: Problem, equation: Equation, start: np.ndarray) -> tuple[ResidualPosterior, Evaluation]:
    """The posterior whose noise is what its optimum leaves, and that optimum, from parameters (p,)."""
    (first,) = ResidualPosterior(problem, equation, start).minimise([start]) or (None,)
    found = ResidualPosterior(problem, equation, start if first is None else first.z)
    return found, (found.minimise([start if first is None else first.z]) or found.evaluate([start]))[0]
