"""First guesses: linear regression of speed changes on smoothed motion and thrust.

The change of each speed over the first of `LAGS` is the integral of its acceleration, which is linear in the ratios to
inertia; bounded least squares (scipy's lsq_linear) keeps damping negative.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import lsq_linear

from swath_sysid.manoeuvring.identification.disturbances import LAGS
from swath_sysid.manoeuvring.motion.trial import Run

Thrusts = Sequence[np.ndarray]  #: Acting thrust of port and starboard, N, of each run.


def _regressed(runs: Sequence[Run], thrusts: Thrusts, series: Callable, signs: Sequence[int]) -> np.ndarray:
    """Coefficients of the columns, zeros where there are too few usable samples. ``series`` makes target and columns of
    u, v, r, port and starboard; ``signs``: 1 for a coefficient of at least 0, -1 of at most 0, 0 for any.
    """
    targets, rows = [], []
    for run, sides in zip(runs, thrusts, strict=True):
        span = max(1, round(LAGS[0] / run.step))
        target, *columns = series(*run.smooth, *sides)
        known = np.array(columns) + np.where(run.driven, 0.0, np.nan)
        total = np.cumsum(0.5 * (known[:, 1:] + known[:, :-1]), axis=1) * run.step
        total = np.concatenate([np.zeros((len(columns), 1)), total], axis=1)
        targets.append(target[span:] - target[:-span])
        rows.append(total[:, span:] - total[:, :-span])
    matrix, target = np.concatenate(rows, axis=1).T, np.concatenate(targets)
    known = np.all(np.isfinite(matrix), axis=1) & np.isfinite(target)
    size = np.sqrt(np.mean(matrix[known] ** 2, axis=0)) if known.sum() > 10 * len(signs) else np.zeros(len(signs))
    if not np.all(size > 0.0):
        return np.zeros(len(signs))
    sign = np.array(signs)
    bounds = np.where(sign > 0, 0.0, -np.inf), np.where(sign < 0, 0.0, np.inf)
    return lsq_linear(matrix[known] / size, target[known], bounds=bounds).x / size


def surge_ratios(runs: Sequence[Run], thrusts: Thrusts) -> np.ndarray:
    """Thrust gain (at least 0), linear and quadratic damping (at most 0) over inertia; zeros where not determined."""
    return _regressed(
        runs, thrusts, lambda u, v, r, port, starboard: (u, port + starboard, u, np.abs(u) * u), (1, -1, -1)
    )


def yaw_ratios(runs: Sequence[Run], thrusts: Thrusts) -> np.ndarray:
    """Gain of the thrust difference over inertia, and linear yaw damping over inertia, shape (2,). Where speed and sway
    are measured the regression includes further damping and the Munk moment, without which a marginally course-stable
    craft looks heavy.
    """

    def further(u: np.ndarray, v: np.ndarray, r: np.ndarray, *sides: np.ndarray) -> tuple[np.ndarray, ...]:
        return r, sides[1] - sides[0], r, np.abs(r) * r, np.abs(u) * r, u * v

    plain = _regressed(runs, thrusts, lambda u, v, r, port, starboard: (r, starboard - port, r), (1, -1))
    rich = _regressed(runs, thrusts, further, (1, -1, -1, -1, 0))
    return np.array([rich[0], plain[1] * rich[0] / plain[0]]) if rich[0] > plain[0] > 0.0 else plain


def sway_ratios(runs: Sequence[Run], thrusts: Thrusts) -> np.ndarray:
    """Mass over sway inertia (of -u r), and linear sway damping over inertia, shape (2,)."""
    return _regressed(runs, thrusts, lambda u, v, r, port, starboard: (v, -u * r, v), (1, -1))
