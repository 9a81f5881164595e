"""Bounded Levenberg-Marquardt for many residuals and few unknowns.

Condenses the Jacobian to its triangular factor once a step, where scipy's least_squares decomposes it whole, and
solves the remaining small bounded problem by scipy's lsq_linear.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import lsq_linear

FIRST_DAMPING = 1e-3


@dataclass(frozen=True)
class Minimum:
    """Outcome of `minimise`."""

    x: np.ndarray  #: (n,)
    cost: float  #: Half the sum of squares.
    evaluations: int  #: Of the residuals.
    aside: Any  #: What the residuals gave aside at the minimum.


def minimise(
    residuals: Callable[[np.ndarray, Any], tuple[np.ndarray, Any]],
    jacobian: Callable[[np.ndarray, Any], np.ndarray],
    start: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    aside: Any = None,
    max_evaluations: int = 30,
    tolerance: float = 1e-5,
) -> Minimum:
    """Minimise half the sum of squares of residuals (m,) with Jacobian (m, n) within bounds (n,), until the cost falls
    by less than a share ``tolerance``. Both functions get what the residuals gave aside at the last
    accepted point, at first ``aside``.
    """
    x = np.clip(start, lower, upper)
    residual, aside = residuals(x, aside)
    cost, evaluations = 0.5 * float(residual @ residual), 1
    damping = FIRST_DAMPING
    while evaluations < max_evaluations:
        slopes = jacobian(x, aside)
        factor, right, size = _condensed(slopes, residual)
        promised = cost
        while evaluations < max_evaluations:
            move = _bounded_step(factor, right, size, damping, lower - x, upper - x)
            promised = float(right @ (factor @ move) * -1.0 - 0.5 * np.sum((factor @ move) ** 2))
            if promised <= tolerance * cost:
                return Minimum(x, cost, evaluations, aside)
            tried = np.clip(x + move, lower, upper)
            found, found_aside = residuals(tried, aside)
            evaluations += 1
            new_cost = 0.5 * float(found @ found)
            if np.isfinite(new_cost) and cost - new_cost > 0.01 * promised:
                break
            damping *= 8.0
        else:
            break
        decrease = cost - new_cost
        x, residual, cost, aside = tried, found, new_cost, found_aside
        damping *= 0.1 if decrease > 0.5 * promised else 1.0
        if decrease < tolerance * cost:
            break
    return Minimum(x, cost, evaluations, aside)


def _condensed(jacobian: np.ndarray, residual: np.ndarray):
    """Triangular factor of the Jacobian, the residual projected on it, and the sizes of the columns."""
    size = np.sqrt(np.einsum('mn,mn->n', jacobian, jacobian))
    size = np.where(size > 0.0, size, 1.0)
    scaled = jacobian / size
    normal = scaled.T @ scaled
    factor = np.linalg.cholesky(normal + np.finfo(float).eps * jacobian.size * np.eye(size.size)).T
    right = np.linalg.solve(factor.T, scaled.T @ residual)
    return factor * size, right, size


def _bounded_step(
    factor: np.ndarray, right: np.ndarray, size: np.ndarray, damping: float, lower: np.ndarray, upper: np.ndarray
):
    """The damped Gauss-Newton step that stays within bounds."""
    matrix = np.concatenate([factor, np.sqrt(damping) * np.diag(size)]) / size
    target = np.concatenate([-right, np.zeros(size.size)])
    step = np.linalg.lstsq(matrix, target, rcond=None)[0]
    low, high = lower * size, upper * size
    if np.any(step < low) or np.any(step > high):
        room = 1e-12 * (1.0 + np.abs(high))
        step = lsq_linear(matrix, target, bounds=(np.minimum(low, -room), np.maximum(high, room))).x
        step = np.clip(step, low, high)
    return step / size
