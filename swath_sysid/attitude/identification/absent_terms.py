"""Which likelihood suits some records, and the term that an equation lacks and their motion shows.

A likelihood-ratio test of the equation against one with every other term (Wilks 1938).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import DAMPING_NAMES
from swath_sysid.attitude.identification.basin_likelihood import BasinFit, BasinLikelihood
from swath_sysid.attitude.identification.motion_fit import InitialState
from swath_sysid.attitude.identification.problem import Problem, motion_fit
from swath_sysid.attitude.identification.pruning import LINEAR_PRIOR
from swath_sysid.attitude.identification.residual_posterior import residual_posterior
from swath_sysid.attitude.identification.scoring import Evaluation, LogPosterior

CHANCE = 0.001  #: Probability that the likelihood ratio calls a complete equation incomplete.
SMOOTH_TERMS = (*DAMPING_NAMES[1:], 'r2', 'r3')


@dataclass(frozen=True)
class AbsentTerm:
    """A term that an equation lacks."""

    name: str
    significance: float  #: Root of twice the gain in log-likelihood by all that it lacks.


def suits_likelihood(problem: Problem, equation: Equation) -> bool:
    """Whether coefficients come from the likelihood of a basin that moves: with angle and rate in each record.

    The likelihood takes the two to differ by noise and a bias only, and so separates the craft's motion from the
    sensor's. An angle alone mostly comes filtered or rounded, from optical tracking, and is trusted far beyond what it
    is worth; dry friction is not smooth enough for the filter.
    """
    both = all(m.angle is not None and m.rate is not None for m in problem.motions)
    return both and 'b0' not in equation.terms


def basin_likelihood(
    problem: Problem, equation: Equation, ratio_prior: np.ndarray | float = LINEAR_PRIOR
) -> BasinLikelihood:
    """The likelihood of an equation on the undisturbed motion of a problem's records."""
    record = problem.observed, problem.states
    return BasinLikelihood(*record, equation, problem.scales, problem.friction_rate, ratio_prior)


def lacking(equation: Equation, names: Sequence[str]) -> list[str]:
    """The names that can still be added to an equation: s2 replaces r2."""
    taken = (*equation.terms, *(('r2',) if 's2' in equation.terms else ()))
    return [name for name in names if name not in taken]


def absent_by_residuals(
    problem: Problem, equation: Equation, ratios: np.ndarray, states: Sequence[InitialState]
) -> AbsentTerm | None:
    """The term that the least-squares residuals show most, dry friction included, at ratios (9,) and states."""
    added = lacking(equation, ('b0', *SMOOTH_TERMS))
    if not added:
        return None
    richer = _with_terms(equation, added)
    start = motion_fit(problem, richer).pack(ratios, states)
    posterior, complete = residual_posterior(problem, richer, start)
    held = np.r_[[name in added for name in richer.terms], np.zeros(start.size - len(richer.terms), dtype=bool)]
    (without,) = posterior.search_each([start], [held])
    return _shown(posterior, complete, without, added)


def basin_fit(
    problem: Problem, equation: Equation, ratios: np.ndarray, states: Sequence[InitialState]
) -> tuple[BasinFit | None, AbsentTerm | None]:
    """The likelihood's optimum, started from ratios (9,) and states, and the term whose absence it shows.

    The equation has no dry friction. The optimum is None where the motion diverges.
    """
    likelihood, added = basin_likelihood(problem, equation), lacking(equation, SMOOTH_TERMS)
    optima, absent = likelihood.minimise(likelihood.starts(ratios, states)), None
    if optima and added:
        richer = basin_likelihood(problem, _with_terms(equation, added))
        own = np.ones(optima[0].z.size + len(added), dtype=bool)
        own[[richer.equation.terms.index(name) for name in added]] = False
        start = np.zeros(own.size)
        start[own] = optima[0].z
        complete = richer.minimise([start])
        if complete and _shown(richer, complete[0], optima[0], added) is not None:
            # what is missing may have been a better optimum of the equation itself
            optima = likelihood.minimise([optima[0].z, complete[0].z[own]])
            absent = _shown(richer, complete[0], optima[0], added)
    return (likelihood.described(optima) if optima else None), absent


def _with_terms(equation: Equation, names: Sequence[str]):
    return replace(equation, name=f'{equation.name} and {", ".join(names)}', terms=(*equation.terms, *names))


def _shown(posterior: LogPosterior, complete: Evaluation, without: Evaluation, added: Sequence[str]):
    """The added term that alone explains most; None where chance explains what all of them gain."""
    gain = without.cost - complete.cost
    if not (complete.is_finite and chdtrc(len(added), max(2.0 * gain, 0.0)) < CHANCE):
        return None
    held = np.zeros((len(added), complete.z.size), dtype=bool)
    held[:, : len(posterior.equation.terms)] = [
        [each in added and each != name for each in posterior.equation.terms] for name in added
    ]
    alone = posterior.search_each([np.where(stays, 0.0, complete.z) for stays in held], list(held))
    best = min(range(len(added)), key=lambda place: alone[place].cost)
    return AbsentTerm(added[best], float(np.sqrt(2.0 * gain)))
