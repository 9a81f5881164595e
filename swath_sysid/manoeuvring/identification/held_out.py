"""Cross-validation over runs: how terms help runs held out one at a time, and how values scatter without each.

The values without a run follow by one Gauss-Newton step on the others; with them the run is simulated freely from its
measured states.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.manoeuvring.identification.shooting import (
    ROBUST_AT,
    Shooting,
    bounded_slopes,
    free_run_residuals,
    instability_slopes,
)

LARGEST_SHARE = 0.25  #: Largest share of one run in the misfit and in its change.

HALVINGS = 4  #: Of a step to values fitted without a part, which far from linear misfits even the other parts.
SCATTER = 0.5  #: Least gain in standard errors over the runs.
MIN_GAIN = 0.003  #: Least gain on runs held out, as a share of the misfit.


@dataclass(frozen=True)
class Information:
    """What K parts tell of n values, in units of the values."""

    units: np.ndarray  #: (n,); 0 at active bounds.
    parts: list[tuple[np.ndarray, np.ndarray]]  #: Residuals and Jacobians.
    total: np.ndarray  #: (n, n); of all parts, regularisation and the demand of stable straight courses.


def information_at(
    shooting: Shooting, values: np.ndarray, parts: Sequence[tuple[np.ndarray, np.ndarray]]
) -> Information:
    """The information of the residuals and Jacobians of `shooting.by_part`."""
    units, spread = shooting.unknowns.units, shooting.unknowns.spread
    at_rest = (values - shooting.unknowns.lower < 1e-9 * units) | (shooting.unknowns.upper - values < 1e-9 * units)
    units = np.where(at_rest, 0.0, units)
    scaled = [(np.clip(np.nan_to_num(r, nan=1e6), -1e6, 1e6), bounded_slopes(j * units)) for r, j in parts]
    prior = np.where(np.isfinite(spread), (units / spread) ** 2, 0.0)
    stability = bounded_slopes(instability_slopes(shooting, values) * units)
    total = sum(j.T @ j for _, j in scaled) + stability.T @ stability + np.diag(prior + 1e-9)
    return Information(units, scaled, total)


def values_without_each_part(shooting: Shooting, values: np.ndarray, told: Information) -> np.ndarray:
    """Values fitted without each part, shape (K, n): the share of a Gauss-Newton step that suits the others best.
    Regularisation, the demand of stable straight courses, and active bounds stay in force, as otherwise unstable models
    would judge a marginally course-stable hull.
    """
    steps = []
    for residual, jacobian in told.parts:
        others = told.total - jacobian.T @ jacobian
        steps.append(np.linalg.lstsq(others, jacobian.T @ residual, rcond=1e-10)[0] * told.units)
    shares = 0.5 ** np.arange(HALVINGS + 1)
    tried = values + shares[:, None, None] * np.array(steps)
    tried = np.clip(tried, shooting.unknowns.lower, shooting.unknowns.upper)
    costs = free_run_costs(shooting, tried.reshape(-1, values.size)).reshape(*tried.shape[:2], -1)
    of_others = costs.sum(axis=2) - np.diagonal(costs, axis1=1, axis2=2)
    return tried[np.argmin(of_others, axis=0), np.arange(len(steps))]


def free_run_costs(shooting: Shooting, candidates: np.ndarray) -> np.ndarray:
    """Misfit of each part in free runs with each of some candidates (C, n); shape (C, K)."""
    residual = free_run_residuals(shooting, candidates)
    residual = np.clip(np.nan_to_num(residual, nan=1e3), -1e3, 1e3) / ROBUST_AT
    by_window = np.sum(np.sqrt(1.0 + residual**2) - 1.0, axis=(1, 2))
    return by_window @ np.eye(shooting.part_of_window.max() + 1)[shooting.part_of_window]


def held_out_costs(shooting: Shooting, values_without_it: np.ndarray) -> np.ndarray:
    """Misfit of each part in free runs with the values fitted without it, (K, n); shape (K,)."""
    return np.diagonal(free_run_costs(shooting, values_without_it))


def helps(costs: np.ndarray, costs_before: np.ndarray) -> bool:
    """Whether terms help runs held out beyond their scatter, by `held_out_costs` (K,) with and without them."""
    if costs.size < 2:
        # nothing can be held out of a single window
        return True
    weight = np.minimum(1.0, LARGEST_SHARE * costs_before.sum() / np.maximum(costs_before, 1e-300))
    gain = weight * (costs_before - costs)
    most = LARGEST_SHARE * np.abs(gain).sum()
    gain = np.clip(gain, -most, most)
    scatter = gain.std(ddof=1) * np.sqrt(gain.size)
    return bool(gain.sum() > max(SCATTER * scatter, MIN_GAIN * float(weight @ costs_before)))


def covariance_over_runs(told: Information, matrix: np.ndarray) -> np.ndarray:
    """A covariance (n, n) with variances of at least the scatter of the runs' shares in the values. The scatter is the
    jackknife (a sandwich over clusters corrected for leverage: Bell and McCaffrey 2002, CR3) where the other runs
    determine a direction better than the run, else CR2 scaled to meet it: what one run alone determines has no scatter.
    """
    if len(told.parts) < 2:
        return matrix
    size, axes = np.linalg.eigh(told.total)
    # by rounding, the least may come out below zero
    root = axes / np.sqrt(np.maximum(size, np.finfo(float).eps * size[-1]))
    scatter = np.zeros(told.units.size)
    for residual, jacobian in told.parts:
        share, turn = np.linalg.eigh(root.T @ jacobian.T @ jacobian @ root)
        others = np.maximum(1.0 - share, np.finfo(float).eps)
        pull = turn.T @ root.T @ jacobian.T @ residual
        move = root @ turn @ (pull * np.where(others > 0.5, 1.0 / others, np.sqrt(2.0 / others)))
        scatter += (told.units * move) ** 2
    return with_variances_of_at_least(matrix, scatter)


def with_variances_of_at_least(matrix: np.ndarray, least: np.ndarray) -> np.ndarray:
    """A covariance with its variances raised to ``least`` (n,) where smaller; correlations stay."""
    variance = np.diag(matrix)
    with np.errstate(invalid='ignore', divide='ignore'):
        larger = np.sqrt(np.where(least > variance, least / variance, 1.0))
    larger = np.where(np.isfinite(larger), larger, 1.0)
    return matrix * np.outer(larger, larger)
