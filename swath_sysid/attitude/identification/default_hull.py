"""What is identified where no equation is named: the general hull, pruned on the records themselves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.hull.catalogue import GENERAL_HULL, composed
from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.identified_model import HullPosterior
from swath_sysid.attitude.identification.basin_likelihood import BasinFit, BasinLikelihood
from swath_sysid.attitude.identification.motion_fit import InitialState
from swath_sysid.attitude.identification.problem import Problem, motion_fit
from swath_sysid.attitude.identification.pruning import Pruned, prune, weak_prior
from swath_sysid.attitude.identification.residual_posterior import ResidualPosterior
from swath_sysid.common.covariance import sandwich_covariance


@dataclass(frozen=True)
class PrunedHull:
    """The terms that some records show, fitted to them."""

    equation: Equation  #: Named by its terms.
    parameters: np.ndarray  #: Of `MotionFit`, dimensionless.
    basin: BasinFit | None  #: None where least squares has found it.
    posterior: HullPosterior  #: Of every term.


def suits_likelihood(problem: Problem, equation: Equation) -> bool:
    """Whether coefficients come from the likelihood of a basin that moves: with angle and rate in each record.

    The likelihood takes the two to differ by noise and a bias only, and so tells the craft's motion from the
    sensor's. An angle alone mostly comes filtered or rounded, from optical tracking, and is trusted far beyond what it
    is worth; dry friction is not smooth enough for the filter.
    """
    both = all(m.angle is not None and m.rate is not None for m in problem.motions)
    return both and 'b0' not in equation.terms


def pruned_hull(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]) -> PrunedHull:
    """Prune the general hull by the likelihood that suits the records.

    Args:
        problem: Of `prepare`.
        ratios: (9,); of its least-squares optimum.
        states: Of that.
    """
    found = _by_basin(problem, ratios, states) if suits_likelihood(problem, GENERAL_HULL) else None
    return found or _by_residuals(problem, ratios, states)


def _by_basin(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]):
    """None where the likelihood's motion, unlike the filter's, runs away."""

    prior = weak_prior(GENERAL_HULL, _decayed_to(problem))
    record = problem.observed, problem.states
    general = BasinLikelihood(*record, GENERAL_HULL, problem.scales, problem.friction_rate, prior)
    optima = general.minimise(general.starts(ratios, states))
    if not optima:
        return None
    pruned = prune(general, optima[0])
    equation = _kept(GENERAL_HULL, pruned)
    left, _, _ = general.unpack(pruned.optimum.z)
    fit = motion_fit(problem, equation)
    parameters = fit.pack(left, states)
    if not all(np.isfinite(channel).all() for pair in fit.simulated(parameters) for channel in pair):
        return None
    every = general.described(general.minimise([*(each.z for each in optima), pruned.optimum.z]))
    posterior = HullPosterior(GENERAL_HULL, every.ratios[GENERAL_HULL.indices], every.covariance)
    kept = np.ix_(pruned.kept, pruned.kept)
    basin = replace(every, ratios=left, covariance=every.covariance[kept], intervals=every.intervals[pruned.kept])
    return PrunedHull(equation, fit.refine_states(parameters), basin, posterior)


def _by_residuals(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]):
    """By least squares, with dry friction among the terms."""
    general = composed(('b0', *GENERAL_HULL.terms))
    fit = motion_fit(problem, general)
    start = fit.pack(ratios, states)

    def likelihood_about(parameters: np.ndarray):
        residuals, jacobians = fit.residuals_and_jacobian(parameters)
        independent = sandwich_covariance(residuals, jacobians, problem.shortest_memory).effective_samples
        variance = sum(float(r @ r) for r in residuals) / independent
        return ResidualPosterior(fit, general, variance, weak_prior(general, _decayed_to(problem)), start.size)

    first = likelihood_about(start).optimum(start, ())
    # what friction explains is no noise
    likelihood = likelihood_about(first.z)
    pruned = prune(likelihood, likelihood.optimum(first.z, ()))
    # what has no friction is smooth for whoever uses the posterior
    held = () if pruned.kept[0] else (0,)
    every = likelihood.optimum(pruned.optimum.z, held)
    of_terms = np.setdiff1d(np.arange(len(general.terms)), held)
    complete = composed([general.terms[place] for place in of_terms])
    free = np.setdiff1d(np.arange(start.size), held)
    units = problem.scales.ratio_units[complete.indices]
    covariance = np.linalg.inv(every.information[np.ix_(free, free)])[: units.size, : units.size]
    posterior = HullPosterior(complete, every.z[of_terms] * units, covariance * np.outer(units, units))
    equation = _kept(general, pruned)
    parameters = pruned.optimum.z[_with_the_rest(pruned)]
    return PrunedHull(equation, parameters, None, posterior)


def _decayed_to(problem: Problem):
    """The last amplitude of the record that decays least, over the first."""
    unit = problem.scales.rate if problem.motions[0].angle is None else problem.scales.amplitude
    return min(1.0, max(s.final_amplitude for s in problem.segments) / unit)


def _kept(equation: Equation, pruned: Pruned):
    return composed([name for name, kept in zip(equation.terms, pruned.kept, strict=True) if kept])


def _with_the_rest(pruned: Pruned):
    """Mask of the parameters that pruning has left."""
    return np.r_[pruned.kept, np.ones(pruned.optimum.z.size - pruned.kept.size, dtype=bool)]
