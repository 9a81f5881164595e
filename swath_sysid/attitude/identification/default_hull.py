"""What is identified where no equation is named: the general hull, pruned on the records themselves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.hull.catalogue import GENERAL_HULL, composed
from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.identified_model import HullPosterior
from swath_sysid.attitude.identification.absent_terms import basin_likelihood, residual_posterior, suits_likelihood
from swath_sysid.attitude.identification.basin_likelihood import BasinFit
from swath_sysid.attitude.identification.motion_fit import InitialState
from swath_sysid.attitude.identification.problem import Problem, motion_fit
from swath_sysid.attitude.identification.pruning import prune, weak_prior


@dataclass(frozen=True)
class FittedHull:
    """An equation fitted to some records."""

    equation: Equation
    parameters: np.ndarray  #: Of `MotionFit`, dimensionless.
    basin: BasinFit | None = None  #: None where least squares has found it.
    posterior: HullPosterior | None = None  #: Of every term; None where the equation was named.


def pruned_hull(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]) -> FittedHull:
    """Prune the general hull by the likelihood that suits the records, from least-squares ratios (9,) and states."""
    found = _by_basin(problem, ratios, states) if suits_likelihood(problem, GENERAL_HULL) else None
    return found or _by_residuals(problem, ratios, states)


def _by_basin(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]):
    """None where the likelihood's motion, unlike the filter's, runs away."""
    general = basin_likelihood(problem, GENERAL_HULL, weak_prior(GENERAL_HULL, problem.decayed_to))
    optima = general.minimise(general.starts(ratios, states))
    if not optima:
        return None
    pruned = prune(general, optima[0])
    equation = _kept(GENERAL_HULL, pruned.kept)
    left, _, _ = general.unpack(pruned.optimum.z)
    fit = motion_fit(problem, equation)
    parameters = fit.pack(left, states)
    if not fit.returns(parameters):
        return None
    every = general.described(general.minimise([*(each.z for each in optima), pruned.optimum.z]))
    posterior = HullPosterior(GENERAL_HULL, every.ratios[GENERAL_HULL.indices], every.covariance)
    basin = replace(every, ratios=left, covariance=every.covariance[np.ix_(pruned.kept, pruned.kept)])
    return FittedHull(equation, fit.refine_states(parameters), basin, posterior)


def _by_residuals(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]):
    """By least squares, with dry friction among the terms."""
    general = composed(('b0', *GENERAL_HULL.terms))
    likelihood, complete = residual_posterior(problem, general, motion_fit(problem, general).pack(ratios, states))
    pruned = prune(likelihood, complete)
    # what has no friction is smooth for whoever uses the posterior
    known = np.r_[pruned.kept[0], np.ones(complete.z.size - 1, dtype=bool)]
    (every,) = likelihood.search_each([pruned.optimum.z], [~known])
    equation = _kept(general, known[: pruned.kept.size])
    units = problem.scales.ratio_units[equation.indices]
    n = units.size
    covariance = np.linalg.inv(every.information[np.ix_(known, known)])[:n, :n] * np.outer(units, units)
    posterior = HullPosterior(equation, every.z[known][:n] * units, covariance)
    rest = np.ones(complete.z.size - pruned.kept.size, dtype=bool)
    return FittedHull(_kept(general, pruned.kept), pruned.optimum.z[np.r_[pruned.kept, rest]], None, posterior)


def _kept(equation: Equation, kept: np.ndarray):
    return composed([name for name, stays in zip(equation.terms, kept, strict=True) if stays])
