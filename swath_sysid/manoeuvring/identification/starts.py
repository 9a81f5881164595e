"""First guesses: linear regression of speed changes on smoothed motion and thrust.

The change of each speed over a second or so is the integral of its acceleration, which is linear in the ratios to
inertia; bounded least squares (scipy's lsq_linear) keeps damping negative.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import lsq_linear

from swath_sysid.manoeuvring.motion.trial import Run

SPAN = 1.0  #: s.


def _changes(series: np.ndarray, span: int):
    return series[span:] - series[:-span]


def _integrals(series: np.ndarray, span: int, step: float):
    total = np.concatenate([[0.0], np.cumsum(0.5 * (series[1:] + series[:-1]))]) * step
    return total[span:] - total[:-span]


def _regress(columns: Sequence[np.ndarray], target: np.ndarray, lower: Sequence[float], upper: Sequence[float]):
    """Bounded regression on columns scaled to unit size; zeros where there are too few usable rows."""
    matrix, target = np.stack(columns, axis=1), np.asarray(target)
    known = np.all(np.isfinite(matrix), axis=1) & np.isfinite(target)
    size = np.sqrt(np.mean(matrix[known] ** 2, axis=0)) if known.sum() > 10 * len(columns) else np.zeros(len(columns))
    if not np.all(size > 0.0):
        return np.zeros(len(columns))
    found = lsq_linear(matrix[known] / size, target[known], bounds=(lower, upper))
    return found.x / size


def _rows(runs: Sequence[Run], thrust: Sequence[tuple[np.ndarray, np.ndarray]], features: Callable):
    """Stacked changes and integrals over all runs: ``features(run, thrust)`` gives the target and the columns."""
    targets, columns = [], []
    for run, acting in zip(runs, thrust, strict=True):
        span = max(1, round(SPAN / run.step))
        target, series = features(run, acting)
        driven = np.where(run.driven, 0.0, np.nan)
        targets.append(_changes(target, span))
        columns.append([_integrals(s + driven, span, run.step) for s in series])
    return np.concatenate(targets), [np.concatenate(parts) for parts in zip(*columns, strict=True)]


def surge_ratios(runs: Sequence[Run], thrust: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Thrust gain over inertia (at least 0), linear and quadratic damping over inertia (at most 0); zeros where not
    determined.
    """

    def features(run: Run, acting: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        u = run.smooth[0]
        return u, (acting[0] + acting[1], u, np.abs(u) * u)

    target, columns = _rows(runs, thrust, features)
    return _regress(columns, target, [0.0, -np.inf, -np.inf], [np.inf, 0.0, 0.0])


def yaw_ratios(runs: Sequence[Run], thrust: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Gain of the thrust difference over inertia, and linear yaw damping over inertia, shape (2,). Where speed and sway
    are measured the regression includes further damping and the Munk moment, without which a marginally course-stable
    craft looks heavy.
    """

    def features(run: Run, acting: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        r = run.smooth[2]
        return r, (acting[1] - acting[0], r)

    def further(run: Run, acting: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        u, v, r = run.smooth
        return r, (acting[1] - acting[0], r, np.abs(r) * r, np.abs(u) * r, u * v)

    target, columns = _rows(runs, thrust, features)
    plain = _regress(columns, target, [0.0, -np.inf], [np.inf, 0.0])
    target, columns = _rows(runs, thrust, further)
    rich = _regress(columns, target, [0.0, *3 * [-np.inf], -np.inf], [np.inf, 0.0, 0.0, 0.0, np.inf])
    return np.array([rich[0], plain[1] * rich[0] / plain[0]]) if rich[0] > plain[0] > 0.0 else plain


def sway_ratios(runs: Sequence[Run], thrust: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Mass over sway inertia (of -u r), and linear sway damping over inertia, shape (2,)."""

    def features(run: Run, _: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        u, v, r = run.smooth
        return v, (-u * r, v)

    target, columns = _rows(runs, thrust, features)
    return _regress(columns, target, [0.0, -np.inf], [np.inf, 0.0])
