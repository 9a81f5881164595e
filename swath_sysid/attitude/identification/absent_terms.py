"""Terms that an equation lacks and the motion shows: a score test of each, at the optimum without it (Rao 1948)."""
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import DAMPING_NAMES
from swath_sysid.attitude.identification.basin_likelihood import BasinLikelihood
from swath_sysid.attitude.identification.motion_fit import MotionFit
from swath_sysid.common.covariance import sandwich_covariance

SIGNIFICANT = 3.5
"""Standard deviations from zero that chance does not make of four terms tried at once."""


@dataclass(frozen=True)
class AbsentTerm:
    """A term that an equation lacks.

    Attributes
    ----------
    name : str
    significance : float
        What one step of scoring from the optimum makes of its ratio, in its standard deviations.
    """

    name: str
    significance: float


def absent_term(found):
    """The term whose absence the motion shows most.

    Parameters
    ----------
    found : Identification
        Of the simulation objective.

    Returns
    -------
    AbsentTerm or None
        None where no term is significant.
    """
    equation = found.model.equation
    step_of = _step_of_least_squares if found.basin is None else _step_of_likelihood
    terms = []
    for name in (*DAMPING_NAMES, *(() if 's2' in equation.terms else ('r2',)), 'r3'):
        if name in equation.terms:
            continue
        step, std = step_of(found, Equation(f'{equation.name} and {name}', (*equation.terms, name)), name)
        # damping takes energy out: a term that would put it in stands for something else
        if std > 0.0 and np.isfinite(step / std) and (step > 0.0 or name not in DAMPING_NAMES):
            terms.append(AbsentTerm(name, abs(step) / std))
    best = max(terms, key=lambda term: term.significance, default=None)
    return best if best is not None and best.significance > SIGNIFICANT else None


def _step_of_least_squares(found, equation, name):
    """What a Gauss-Newton step makes of a term, and its standard deviation under autocorrelated residuals."""
    problem = found.problem
    fit = MotionFit(problem.motions, equation, problem.scales, problem.noise, problem.friction_rate)
    parameters = fit.pack(found.model.ratios, [r.state for r in found.records])
    residuals, jacobians = fit.residuals_and_jacobian(parameters)
    free = _free(found, equation, name, parameters.size)
    jacobians = [j[:, free] for j in jacobians]
    covariance = sandwich_covariance(residuals, jacobians, problem.shortest_memory).matrix
    step = -np.linalg.lstsq(np.concatenate(jacobians), np.concatenate(residuals), rcond=None)[0]
    place = np.count_nonzero(free[: equation.terms.index(name)])
    return float(step[place]), float(np.sqrt(covariance[place, place]))


def _step_of_likelihood(found, equation, name):
    """What a step of scoring makes of a term, and its standard deviation."""
    problem, place = found.problem, equation.terms.index(name)
    likelihood = BasinLikelihood(
        problem.observed, [r.state for r in found.records], equation, problem.scales, problem.friction_rate
    )
    z = np.insert(found.basin.optimum, place, 0.0)
    gradient, information = likelihood.gradient_and_information(z, likelihood.innovations(z))
    free = _free(found, equation, name, z.size)
    covariance = np.linalg.inv(information[np.ix_(free, free)])
    place = np.count_nonzero(free[:place])
    return -float(covariance[place] @ gradient[free]), float(np.sqrt(covariance[place, place]))


def _free(found, equation, name, size):
    """Mask of the parameters that are not held at a bound."""
    free = np.ones(size, dtype=bool)
    free[: len(equation.terms)] = [
        term == name or term not in DAMPING_NAMES or found.model.terms[term] > 0.0 for term in equation.terms
    ]
    return free
