"""Terms that an equation lacks and the motion shows.

With the likelihood: a ratio test of the equation against one with every smooth term (Wilks 1938).
With least squares: a score test of each term at the optimum without it (Rao 1948).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import DAMPING_NAMES
from swath_sysid.attitude.identification.basin_likelihood import BasinFit, BasinLikelihood, Evaluation
from swath_sysid.attitude.identification.motion_fit import InitialState, MotionFit
from swath_sysid.attitude.identification.problem import Problem
from swath_sysid.common.covariance import sandwich_covariance

if TYPE_CHECKING:
    from swath_sysid.attitude.identification.identify import Identification

SIGNIFICANT = 3.5  #: Standard deviations from zero that chance does not reach with four terms tested at once.
CHANCE = 0.003  #: Probability that the likelihood ratio calls a complete equation incomplete.
TERMS = (*DAMPING_NAMES, 'r2', 'r3')
SMOOTH_TERMS = tuple(name for name in TERMS if name != 'b0')


@dataclass(frozen=True)
class AbsentTerm:
    """A term that an equation lacks."""

    name: str
    #: Standard deviations from zero of one Gauss-Newton step, or the root of twice the gain in log-likelihood.
    significance: float


def absent_term(found: 'Identification') -> AbsentTerm | None:
    """The missing term that the least-squares residuals show most; None where no term is significant."""
    equation = found.model.equation
    terms = []
    for name in _lacking(equation, TERMS):
        step, std = _step_of_least_squares(found, _with_terms(equation, [name]), name)
        # damping takes energy out: a term that would put it in stands for something else
        if std > 0.0 and np.isfinite(step / std) and (step > 0.0 or name not in DAMPING_NAMES):
            terms.append(AbsentTerm(name, abs(step) / std))
    best = max(terms, key=lambda term: term.significance, default=None)
    return best if best is not None and best.significance > SIGNIFICANT else None


def fit_and_test(
    problem: Problem, equation: Equation, ratios: np.ndarray, states: Sequence[InitialState]
) -> tuple[BasinFit | None, AbsentTerm | None]:
    """The likelihood's optimum, started from ratios (9,) and states, and the term whose absence it shows.

    The equation has no dry friction. The optimum is None where the motion diverges, the term where chance explains the
    likelihood ratio.
    """
    likelihood = _likelihood(problem, equation)
    optima = likelihood.minimise(likelihood.starts(ratios, states))
    if not optima:
        return None, None
    added = _lacking(equation, SMOOTH_TERMS)
    if not added:
        return likelihood.described(optima), None
    richer = _with_terms(equation, added)
    is_new = np.array([name in added for name in richer.terms])
    places = np.flatnonzero(np.r_[~is_new, np.ones(optima[0].z.size - len(equation.terms), dtype=bool)])
    start = np.zeros(optima[0].z.size + len(added))
    start[places] = optima[0].z
    complete = _likelihood(problem, richer)
    complete_optima = complete.minimise([start])
    if not complete_optima or _is_chance(complete_optima, optima, len(added)):
        return likelihood.described(optima), None
    # what is missing may have been a better optimum of the equation itself
    optima = likelihood.minimise([optima[0].z, complete_optima[0].z[places]])
    basin = likelihood.described(optima)
    if _is_chance(complete_optima, optima, len(added)):
        return basin, None
    with_all = complete.described(complete_optima)
    strength = np.abs(with_all.ratios[richer.indices]) / np.sqrt(np.diag(with_all.covariance))
    name = richer.terms[int(np.argmax(np.where(is_new, strength, -1.0)))]
    return basin, AbsentTerm(name, float(np.sqrt(2.0 * (with_all.log_likelihood - basin.log_likelihood))))


def lacks_terms(equation: Equation) -> bool:
    """Whether a smooth term can still be added to an equation."""
    return bool(_lacking(equation, SMOOTH_TERMS))


def _lacking(equation: Equation, names: Sequence[str]):
    """The names that can still be added to an equation: s2 replaces r2."""
    taken = (*equation.terms, *(('r2',) if 's2' in equation.terms else ()))
    return [name for name in names if name not in taken]


def _is_chance(complete: Sequence[Evaluation], optima: Sequence[Evaluation], added: int):
    gained = optima[0].cost - complete[0].cost
    return bool(chdtrc(added, max(2.0 * gained, 0.0)) > CHANCE)


def _likelihood(problem: Problem, equation: Equation):
    return BasinLikelihood(problem.observed, problem.states, equation, problem.scales, problem.friction_rate)


def _with_terms(equation: Equation, names: Sequence[str]):
    return Equation(f'{equation.name} and {", ".join(names)}', (*equation.terms, *names))


def _step_of_least_squares(found: 'Identification', equation: Equation, name: str):
    """Gauss-Newton step of a term, and its standard deviation under autocorrelated residuals."""
    problem = found.problem
    fit = MotionFit(problem.motions, equation, problem.scales, problem.noise, problem.friction_rate)
    parameters = fit.pack(found.model.ratios, found.states)
    residuals, jacobians = fit.residuals_and_jacobian(parameters)
    free = _free(found, equation, name, parameters.size)
    jacobians = [j[:, free] for j in jacobians]
    covariance = sandwich_covariance(residuals, jacobians, problem.shortest_memory).matrix
    step = -np.linalg.lstsq(np.concatenate(jacobians), np.concatenate(residuals), rcond=None)[0]
    place = np.count_nonzero(free[: equation.terms.index(name)])
    return float(step[place]), float(np.sqrt(covariance[place, place]))


def _free(found: 'Identification', equation: Equation, name: str, size: int):
    """Mask of the parameters that are not held at a bound."""
    free = np.ones(size, dtype=bool)
    free[: len(equation.terms)] = [
        term == name or term not in DAMPING_NAMES or found.model.terms[term] > 0.0 for term in equation.terms
    ]
    return free
