"""One general hull, pruned: every term with a weak prior, then the terms that the motion does not need go, one by one.

A nonlinear term has a Gaussian prior of the linear one at the largest amplitude: restoring against the linear
stiffness, damping, which only takes energy, against critical damping. Dry friction has the restoring moment at the
smallest amplitude: more would have held the craft there. A term goes where the evidence rises without it
(MacKay 1992), by Laplace's approximation about the optimum; each hull is refitted from the optimum before.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.scaling import UPPER
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, TERM_INDEX
from swath_sysid.attitude.identification.scoring import Evaluation, LogPosterior

#: Standard deviation, dimensionless, of a linear term before the record is seen: beyond any craft's.
LINEAR_PRIOR = float(UPPER[TERM_INDEX['b1']])
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
