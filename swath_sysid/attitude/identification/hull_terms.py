"""Which likelihood suits some records, and the terms of a hull that they show.

A named equation is tested against one with every other term by the likelihood ratio (Wilks 1938); where none is named,
the general hull is pruned.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from swath_sysid.attitude.hull.catalogue import GENERAL_HULL
from swath_sysid.attitude.hull.decay_model import Equation, composed
from swath_sysid.attitude.hull.identified_model import HullPosterior
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, LINEAR_RESTORING
from swath_sysid.attitude.identification.basin_likelihood import BasinFit, BasinLikelihood
from swath_sysid.attitude.identification.log_posterior import (
    LINEAR_PRIOR,
    Evaluation,
    LogPosterior,
    log_evidence,
    prune,
    weak_prior,
)
from swath_sysid.attitude.identification.motion_fit import InitialState, MotionFit
from swath_sysid.attitude.identification.problem import Problem, motion_fit, residual_covariance

CHANCE = 0.001  #: Probability that a likelihood ratio calls a complete equation incomplete, or the same hull changed.
#: Looked for where an equation lacks them; linear restoring may be a sine's.
SMOOTH_TERMS = tuple(name for name in GENERAL_HULL.terms if name not in LINEAR_RESTORING)
WITH_FRICTION = composed(('b0', *GENERAL_HULL.terms))
#: A hull explains a decay if its own motion leaves at most so many times what least squares leaves, or this part of the
#: motion. Waves of 30 % at resonance leave 3.4 times as much, a hull that a basin took over 4.4 times.
TIMES_LEAST, PART_OF_MOTION = 4.0, 0.02


@dataclass(frozen=True)
class AbsentTerm:
    """A term that an equation lacks."""

    name: str
    significance: float  #: Root of twice the gain in log-likelihood by all that it lacks.


@dataclass(frozen=True)
class FittedHull:
    """An equation fitted to some records."""

    equation: Equation
    parameters: np.ndarray  #: Of `MotionFit`, dimensionless.
    basin: BasinFit | None = None  #: None where least squares has found it.
    posterior: HullPosterior | None = None  #: Of every term; None where the equation was named.


def suits_likelihood(problem: Problem) -> bool:
    """Whether coefficients come from the likelihood of a basin that moves: with angle and rate in each record. The
    likelihood takes the two to differ by noise and a bias only, and so separates the craft's motion from the sensor's.
    An angle alone mostly comes filtered or rounded, from optical tracking, and is trusted far beyond what it is worth.
    """
    return all(m.angle is not None and m.rate is not None for m in problem.motions)


def explaining(
    problem: Problem,
    likelihood: BasinLikelihood,
    optima: Sequence[Evaluation],
    ratios: np.ndarray,
    states: Sequence[InitialState],
) -> list[Evaluation]:
    """Those optima whose hull alone explains the decays about as well as least-squares ratios (9,) and states. In the
    others the basin's moment drives the motion: sensors that smooth angle and rate alike make those likely.
    """
    fit = motion_fit(problem, likelihood.equation)

    def left(parameters: np.ndarray | None):
        if parameters is None:
            return np.inf
        return float(np.sqrt(np.mean(np.concatenate(fit.residuals_and_jacobian(parameters)[0]) ** 2)))

    motion = float(np.sqrt(np.mean([np.var(channel) for channel in problem.weighted])))
    most = max(TIMES_LEAST * left(fit.settled(ratios, states)), PART_OF_MOTION * motion)
    return [each for each in optima if left(fit.settled(likelihood.unpack(each.z)[0], states)) <= most]


class ResidualPosterior(LogPosterior):
    """Negative log posterior of an equation's dimensionless ratios and the initial states of records. Parameters are
    those of `MotionFit.pack`. The noise is that of the residuals at parameters ``about``, of which N are equivalent to
    n independent ones and weighted by n / N. States have the prior of a linear term: rates alone say nothing of the
    trim.
    """

    def __init__(self, problem: Problem, equation: Equation, about: np.ndarray) -> None:
        self._problem, self._fit = problem, motion_fit(problem, equation)
        residual = np.concatenate(self._fit.residuals_and_jacobian(about)[0])
        self._variance = float(residual @ residual) / residual_covariance(problem, self._fit, about).effective_samples
        std = weak_prior(equation, problem.decayed_to)
        states = about.size - std.size
        super().__init__(
            equation,
            np.r_[[float(name in LINEAR_RESTORING) for name in equation.terms], np.zeros(states)],
            np.r_[std, np.full(states, LINEAR_PRIOR)],
            [name in DAMPING_NAMES for name in equation.terms],
        )

    def likelihoods(self, points: np.ndarray) -> Iterator[tuple[float, np.ndarray, np.ndarray]]:
        """That of the residuals at points (P, p)."""
        for z in points:
            e, slopes = (np.concatenate(each) for each in self._fit.residuals_and_jacobian(z))
            yield 0.5 * float(e @ e) / self._variance, slopes.T @ e / self._variance, slopes.T @ slopes / self._variance

    def spread(self, fit: MotionFit, optimum: Evaluation, known: np.ndarray) -> np.ndarray:
        """Covariance (k, k) of the ``known`` parameters, mask (p,), about an optimum: those of ``fit``. The estimate
        lies between the least-squares estimate, which has its own covariance under correlated noise, and the prior: the
        mean square of its error is that of both, each by its share.
        """
        inverse, weight = np.linalg.inv(optimum.information[np.ix_(known, known)]), np.diag(self._weight[known])
        share = np.eye(len(inverse)) - inverse @ weight
        least_squares = np.nan_to_num(residual_covariance(self._problem, fit, optimum.z[known]).matrix)
        return share @ least_squares @ share.T + inverse @ weight @ inverse


def residual_posterior(problem: Problem, equation: Equation, start: np.ndarray) -> tuple[ResidualPosterior, Evaluation]:
    """The posterior whose noise is what its optimum leaves, and that optimum, from parameters (p,)."""
    (first,) = ResidualPosterior(problem, equation, start).minimise([start]) or (None,)
    found = ResidualPosterior(problem, equation, start if first is None else first.z)
    return found, (found.minimise([start if first is None else first.z]) or found.evaluate([start]))[0]


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
) -> BasinFit | AbsentTerm | None:
    """The likelihood's optimum, started from ratios (9,) and states, or the smooth term whose absence it shows. None
    where the motion diverges, or the basin drives it in every optimum.
    """
    likelihood, added = BasinLikelihood(problem, equation), lacking(equation, SMOOTH_TERMS)
    found, absent = likelihood.minimise(likelihood.starts(ratios, states)), None
    optima = explaining(problem, likelihood, found, ratios, states)
    if optima and added:
        richer = BasinLikelihood(problem, _with_terms(equation, added))
        own = np.ones(optima[0].z.size + len(added), dtype=bool)
        own[[richer.equation.terms.index(name) for name in added]] = False
        start = np.zeros(own.size)
        start[own] = optima[0].z
        complete = richer.minimise([start])
        if complete and _shown(richer, complete[0], optima[0], added) is not None:
            # what is missing may have been a better optimum of the equation itself
            optima = likelihood.minimise([optima[0].z, complete[0].z[own]])
            absent = _shown(richer, complete[0], optima[0], added)
    return absent or (likelihood.described(optima) if optima else None)


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


def pruned_hull(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]) -> FittedHull:
    """Prune the general hull by the likelihood that suits the records, from least-squares ratios (9,) and states."""
    found = _by_basin(problem, ratios, states) if suits_likelihood(problem) else None
    return found or _by_residuals(problem, ratios, states)


def _by_basin(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]):
    """With dry friction among the terms where it raises the evidence of least squares; what has none is smooth for
    whoever uses the posterior. None where the likelihood's motion, unlike the filter's, runs away, or the basin drives
    it.
    """
    fit = motion_fit(problem, WITH_FRICTION)
    posterior, complete = residual_posterior(problem, WITH_FRICTION, fit.pack(ratios, states))
    smooth = np.array([name != 'b0' for name in WITH_FRICTION.terms])
    held = np.r_[~smooth, np.zeros(complete.z.size - smooth.size, dtype=bool)]
    (bare,) = posterior.search_each([np.where(held, 0.0, complete.z)], [held])
    is_shown = log_evidence(posterior, complete, np.ones_like(smooth)) > log_evidence(posterior, bare, smooth)
    hulls = ratios, fit.unpack(complete.z)[0]
    found = _pruned_in_basin(problem, WITH_FRICTION, hulls, states) if is_shown else None
    if found is None or 'b0' not in found.equation.terms:
        found = _pruned_in_basin(problem, GENERAL_HULL, (ratios,), states)
    return found


def _pruned_in_basin(problem: Problem, general: Equation, hulls: Sequence[np.ndarray], states: Sequence[InitialState]):
    """A general hull pruned by the likelihood, started from hulls (9,) each."""
    likelihood = BasinLikelihood(problem, general, weak_prior(general, problem.decayed_to))
    found = likelihood.minimise([start for ratios in hulls for start in likelihood.starts(ratios, states)])
    optima = explaining(problem, likelihood, found, hulls[-1], states)
    if not optima:
        return None
    pruned = prune(likelihood, optima[0])
    equation = _kept(general, pruned.kept)
    left, _, _ = likelihood.unpack(pruned.optimum.z)
    parameters = motion_fit(problem, equation).settled(left, states)
    if parameters is None or not explaining(problem, likelihood, [pruned.optimum], hulls[-1], states):
        return None
    every = likelihood.described(likelihood.minimise([*(each.z for each in optima), pruned.optimum.z]))
    posterior = HullPosterior(general, every.ratios[general.indices], every.covariance)
    basin = replace(every, ratios=left, covariance=every.covariance[np.ix_(pruned.kept, pruned.kept)])
    return FittedHull(equation, parameters, basin, posterior)


def _by_residuals(problem: Problem, ratios: np.ndarray, states: Sequence[InitialState]):
    """By least squares, with dry friction among the terms."""
    general = WITH_FRICTION
    likelihood, complete = residual_posterior(problem, general, motion_fit(problem, general).pack(ratios, states))
    pruned = prune(likelihood, complete)
    # what has no friction is smooth for whoever uses the posterior
    known = np.r_[pruned.kept[0], np.ones(complete.z.size - 1, dtype=bool)]
    (every,) = likelihood.search_each([pruned.optimum.z], [~known])
    equation = _kept(general, known[: pruned.kept.size])
    units = problem.scales.ratio_units[equation.indices]
    n = units.size
    spread = likelihood.spread(motion_fit(problem, equation), every, known)[:n, :n] * np.outer(units, units)
    posterior = HullPosterior(equation, every.z[known][:n] * units, spread)
    rest = np.ones(complete.z.size - pruned.kept.size, dtype=bool)
    return FittedHull(_kept(general, pruned.kept), pruned.optimum.z[np.r_[pruned.kept, rest]], None, posterior)


def _kept(equation: Equation, kept: np.ndarray):
    return composed([name for name, stays in zip(equation.terms, kept, strict=True) if stays])
