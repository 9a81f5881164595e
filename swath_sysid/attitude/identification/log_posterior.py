"""The optimum of a log posterior by Fisher's scoring within bounds, and of its terms those that the motion needs.

With a_k = d e_k / d z and b_k = d s_k / d z of innovations e_k and their variances s_k,

    gradient    = sum(a_k e_k / s_k + b_k (1 - e_k^2 / s_k) / (2 s_k)),
    information = sum(a_k a_k' / s_k + b_k b_k' / (2 s_k^2)).

A nonlinear term has a Gaussian prior of the linear one at the largest amplitude: restoring against the linear
stiffness, damping, which only takes energy, against critical damping. Dry friction has the restoring moment at the
smallest amplitude: more would have held the craft there. A term goes where the evidence rises without it
(MacKay 1992), by Laplace's approximation about the optimum; each hull is refitted from the optimum before.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import log_ndtr

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import AT, DAMPING_NAMES, UPPER

MAX_ITERATIONS = 30
CONVERGED = 0.003  #: Decrease of the negative log likelihood that a further step promises.
NEAR = 10.0  #: Of a log posterior below its maximum, from which a peak is its curvature.
#: Of the expected information along any direction, taken for the curvature of a step where less was learned.
LEAST_SHARE = 0.1
SAME_MODE = 0.5  #: Standard deviations of each ratio within which two optima are one.


@dataclass(frozen=True)
class Evaluation:
    """The negative log posterior at some parameters."""

    z: np.ndarray  #: (p,)
    cost: float  #: Infinite where the motion runs away.
    gradient: np.ndarray  #: (p,); first derivatives, not finite where the motion runs away.
    information: np.ndarray  #: (p, p); expected second derivatives.

    @property
    def is_finite(self) -> bool:
        """Whether a search may go on from here."""
        return all(np.isfinite(each).all() for each in (self.cost, self.gradient, self.information))


class LogPosterior(ABC):
    """A negative log posterior whose first parameters are the dimensionless ratios of an equation's terms. The prior is
    Gaussian, with ``mean`` and ``std`` (p,); ``bounded`` are those of the first parameters that are not negative.
    """

    def __init__(self, equation: Equation, mean: np.ndarray, std: np.ndarray, bounded: Sequence[bool] = ()) -> None:
        self.equation, self.mean, self._weight = equation, mean, std**-2.0
        self.ratio_prior = std[: len(equation.terms)]  #: (n,)
        self.lowest = np.full(mean.size, -np.inf)  #: (p,); bounds from below.
        self.lowest[: len(bounded)][np.array(bounded, dtype=bool)] = 0.0

    @abstractmethod
    def likelihoods(self, points: np.ndarray) -> Iterable[tuple[float, np.ndarray, np.ndarray]]:
        """The negative log likelihood at points (P, p), its gradient and its information."""

    def evaluate(self, points: Sequence[np.ndarray]) -> list[Evaluation]:
        """The posterior and its derivatives at some points (p,)."""
        found = []
        with np.errstate(all='ignore'):
            for z, (cost, gradient, information) in zip(points, self.likelihoods(np.array(points)), strict=True):
                pull = self._weight * (z - self.mean)
                cost += 0.5 * float(pull @ (z - self.mean))
                found.append(
                    Evaluation(
                        z, cost if np.isfinite(cost) else np.inf, gradient + pull, information + np.diag(self._weight)
                    )
                )
        return found

    def is_upright(self, point: Evaluation) -> bool:
        """Whether the craft returns to its upright position."""
        return np.isfinite(point.cost)

    def minimise(self, starts: Sequence[np.ndarray]) -> list[Evaluation]:
        """The optima found from some parameters (p,), side by side, the most likely first. A search ends where it comes
        to an optimum that another has found. Empty where the motion runs away from each start. Without those whose
        upright position is unstable, if there are others: a craft at rest some way from a position that throws it off
        oscillates as likely.
        """
        nothing = np.zeros(self.lowest.size, dtype=bool)
        optima = self.search_each(starts, [nothing] * len(starts), self._is_at)
        found = sorted((o for o in optima if o.is_finite), key=lambda optimum: optimum.cost)
        return [o for o in found if self.is_upright(o)] or found

    def search_each(
        self,
        starts: Sequence[np.ndarray],
        held: Sequence[np.ndarray],
        is_at: Callable[[Evaluation, Evaluation], bool] = lambda point, optimum: False,
    ) -> list[Evaluation]:
        """The optimum found from each start (p,), by searches that share the passes of what is evaluated. ``held`` are
        masks (p,) of the parameters that stay as each search starts. A search that ``is_at`` the optimum of another is
        left out.
        """
        searches = [
            scoring(np.clip(z, self.lowest, np.inf), np.where(stays, z, self.lowest), np.where(stays, z, np.inf))
            for z, stays in zip(starts, held, strict=True)
        ]
        asked = {k: next(search) for k, search in enumerate(searches)}
        best: dict[int, Evaluation] = {}
        found: dict[int, Evaluation] = {}
        while asked:
            for k, evaluation in zip(list(asked), self.evaluate(list(asked.values())), strict=True):
                best[k] = min(best.get(k, evaluation), evaluation, key=lambda each: each.cost)
                try:
                    asked[k] = searches[k].send(evaluation)
                except StopIteration as end:
                    found[k] = end.value
                    del asked[k]
            asked = {k: z for k, z in asked.items() if not any(is_at(best[k], o) for o in found.values())}
        return [found[k] for k in sorted(found)]

    def _is_at(self, point: Evaluation, optimum: Evaluation) -> bool:
        """Whether a point is one that an optimum stands for: not more likely, and the same ratios."""
        if not (optimum.is_finite and optimum.cost <= point.cost < np.inf):
            return False
        n = len(self.equation.terms)
        std = np.sqrt(np.diag(np.linalg.inv(optimum.information)))
        return bool(np.all(np.abs(point.z - optimum.z)[:n] < SAME_MODE * std[:n]))


def scoring(z: np.ndarray, low: np.ndarray, high: np.ndarray) -> Generator[np.ndarray, Evaluation, Evaluation]:
    """Fisher's scoring with Levenberg's damping, within bounds: yields points, is sent the `Evaluation` of each. Near
    the optimum it learns from the gradients what of the curvature is not expected of the model but of this record
    (Dennis, Gay and Welsch 1981): without that its steps overshoot there, and it ends slowly. Begins at ``z`` (p,) and
    returns the best.
    """
    best = yield z
    if not best.is_finite:
        return replace(best, cost=np.inf)
    damping, learned = 0.1, np.zeros_like(best.information)
    for _ in range(MAX_ITERATIONS):
        curvature = with_learned(best.information, learned) if learned.any() else best.information
        damped = curvature + damping * np.diag(np.diag(best.information))
        trial = clipped_step(best.z, best.gradient, damped, low, high)
        step = trial - best.z
        expected = -float(best.gradient @ step)
        if expected < CONVERGED:
            break
        tried = yield trial
        # at the edge of where the motion runs away it may be known, but not how it changes
        better = tried.cost < best.cost and tried.is_finite
        if expected < NEAR and tried.is_finite:
            information = tried.information if better else best.information
            learned = secant(learned, step, tried.gradient - best.gradient, information)
        if better:
            gained, best = best.cost - tried.cost, tried
            damping = max(damping / 5.0, 1e-6)
            if gained < CONVERGED and expected < 10.0 * CONVERGED:
                break
        else:
            damping = max(6.0 * damping, 1e-2)
            if damping > 1e6:
                break
    return best


def with_learned(information: np.ndarray, learned: np.ndarray) -> np.ndarray:
    """The information (p, p) and what was learned beyond it, no less than ``LEAST_SHARE`` of the former anywhere."""
    root = np.linalg.cholesky(information)
    values, vectors = np.linalg.eigh(np.linalg.solve(root, np.linalg.solve(root, learned).T))
    directions = root @ vectors
    return directions * np.maximum(1.0 + values, LEAST_SHARE) @ directions.T


def secant(learned: np.ndarray, step: np.ndarray, change: np.ndarray, information: np.ndarray) -> np.ndarray:
    """What the gradient's change over a step adds to the curvature beyond the information, (p, p): the update of
    Dennis, Gay and Welsch (1981), of the least change that agrees with it.
    """
    along = float(change @ step)
    if along <= 0.0:
        return learned
    beyond = change - information @ step
    before = abs(float(step @ learned @ step))
    sized = learned * min(1.0, abs(float(step @ beyond)) / before) if before > 0.0 else learned
    missing = beyond - sized @ step
    both = np.outer(missing, change)
    return sized + (both + both.T) / along - float(missing @ step) * np.outer(change, change) / along**2


def clipped_step(
    z: np.ndarray, gradient: np.ndarray, information: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Newton's step within bounds: what would leave them is held at them and the rest solved again."""
    free = np.ones(z.size, dtype=bool)
    trial = z.copy()
    for _ in range(z.size):
        held = trial - z
        right = -(gradient + information @ np.where(free, 0.0, held))[free]
        trial[free] = z[free] + np.linalg.solve(information[np.ix_(free, free)], right)
        outside = free & ((trial < low) | (trial > high))
        if not outside.any():
            break
        trial = np.where(outside, np.clip(trial, low, high), trial)
        free &= ~outside
    return trial


#: Standard deviation, dimensionless, of a linear term before the record is seen: beyond any craft's.
LINEAR_PRIOR = float(UPPER[AT.b1])
LINEAR = 'b1', 'r1'  #: Terms that stay.


@dataclass(frozen=True)
class Pruned:
    """What pruning leaves of a hull."""

    kept: np.ndarray  #: (n,); mask of the terms.
    optimum: Evaluation  #: Without the other terms, which are zero.


def weak_prior(equation: Equation, decayed_to: float) -> np.ndarray:
    """Standard deviations (n,) of the dimensionless ratios of an equation's terms before the record is seen.
    ``decayed_to`` is the smallest amplitude seen over the largest. Critical damping makes twice the restoring moment.
    """
    special = {'b0': decayed_to, 'b1': LINEAR_PRIOR, 'r1': LINEAR_PRIOR}
    return np.array([special.get(name, 2.0 if name in DAMPING_NAMES else 1.0) for name in equation.terms])


def prune(posterior: LogPosterior, complete: Evaluation) -> Pruned:
    """Leave out the terms without which the evidence rises, from a posterior of every term and its optimum."""
    terms = posterior.equation.terms
    stays = np.array([name in LINEAR for name in terms])
    kept, best = np.ones(len(terms), dtype=bool), complete
    while True:
        # evidence rises without a term that a bound holds: its likelihood falls from there, and the prior is weak
        kept &= stays | (best.z[: len(terms)] > posterior.lowest[: len(terms)])
        candidates = np.flatnonzero(kept & ~stays)
        if not candidates.size:
            return Pruned(kept, best)
        masks = [kept & (np.arange(len(terms)) != place) for place in candidates]
        held = [np.r_[~mask, np.zeros(best.z.size - len(terms), dtype=bool)] for mask in masks]
        starts = [_without(best, int(place), ~_free(kept, best)) for place in candidates]
        found = posterior.search_each(starts, held)
        smaller = [(log_evidence(posterior, e, mask), mask, e) for e, mask in zip(found, masks, strict=True)]
        evidence, mask, optimum = max(smaller, key=lambda hull: hull[0])
        if not evidence > log_evidence(posterior, best, kept):
            return Pruned(kept, best)
        kept, best = mask, optimum


def log_evidence(posterior: LogPosterior, optimum: Evaluation, kept: np.ndarray) -> float:
    """Logarithm of the evidence of a hull's kept terms (n,) but for what is the same in every hull of a record."""
    if not optimum.is_finite:
        return -np.inf
    free = np.flatnonzero(_free(kept, optimum))
    covariance = np.linalg.inv(optimum.information[np.ix_(free, free)])
    nonlinear = kept & [name not in LINEAR for name in posterior.equation.terms]
    found = -optimum.cost + 0.5 * np.linalg.slogdet(covariance)[1]
    found -= float(np.sum(np.log(posterior.ratio_prior[nonlinear])))
    # of a damping term the prior and the posterior are the part of their Gaussians above zero
    bounded = nonlinear & [name in DAMPING_NAMES for name in posterior.equation.terms]
    places = np.searchsorted(free, np.flatnonzero(bounded))
    ratios = optimum.z[np.flatnonzero(bounded)]
    return float(found + np.sum(np.log(2.0) + log_ndtr(ratios / np.sqrt(np.diag(covariance)[places]))))


def _free(kept: np.ndarray, optimum: Evaluation):
    return np.r_[kept, np.ones(optimum.z.size - kept.size, dtype=bool)]


def _without(optimum: Evaluation, place: int, held: np.ndarray):
    """Where the quadratic about an optimum is least with a further term held at zero."""
    free = np.flatnonzero(~held)
    covariance = np.linalg.inv(optimum.information[np.ix_(free, free)])
    column = covariance[:, np.searchsorted(free, place)]
    z = optimum.z.copy()
    z[free] -= column / column[np.searchsorted(free, place)] * optimum.z[place]
    z[place] = 0.0
    return z
