"""Regressions of measured speed changes: residual accelerations of a model, how long thrust is held, first guesses.

The change of each speed over the first of `LAGS` is the integral of its acceleration, which is linear in the ratios to
inertia; bounded least squares (scipy's lsq_linear) keeps damping negative.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import lsq_linear

from swath_sysid.common.signals import white_noise
from swath_sysid.manoeuvring.hull.identified_model import ForecastNoise
from swath_sysid.manoeuvring.hull.measurement import through_water
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.terms import BALANCE
from swath_sysid.manoeuvring.hull.thrust import acting_thrust, thrust_curve
from swath_sysid.manoeuvring.motion.trial import CraftRun

#: s; sensor noise and smoothing are uncorrelated at the first, gusts still correlated at the second.
LAGS = (1.0, 4.0)

SENSORS = np.array([0.05, 0.01, 0.01, 0.5])
MIN_SENSORS = np.array([0.005, 0.0005, 0.0005, 0.01])


def forecast_noise(model: ManoeuvringModel, runs: Sequence[CraftRun]) -> ForecastNoise:
    """Disturbances, thrust changes and sensor noise in the runs of the identification; intervals not yet calibrated. A
    disturbance is first-order Gauss-Markov, with variance and time from the autocovariance of the residual
    accelerations at two lags, but at most the duration of all runs.
    """
    covariances, counts = np.zeros((len(LAGS), 3)), np.zeros((len(LAGS), 3))
    for run in runs:
        left = _accelerations_left(model, run)
        for j, lag in enumerate(LAGS):
            product = left[:, round(lag / run.step) :] * left[:, : -round(lag / run.step)]
            covariances[j] += np.nansum(product, axis=1)
            counts[j] += np.isfinite(product).sum(axis=1)
    near, far = covariances / np.maximum(counts, 1.0)
    with np.errstate(invalid='ignore', divide='ignore'):
        time = (LAGS[1] - LAGS[0]) / np.log(near / np.clip(far, 1e-3 * near, 0.999 * near))
    longest = max(sum(run.duration for run in runs), LAGS[1])
    time = np.clip(np.nan_to_num(time, nan=LAGS[0]), LAGS[0], longest)
    mean, covariance, held = _thrust(model, runs, longest)
    disturbance = np.sqrt(np.maximum(near * np.exp(LAGS[0] / time), 1e-12))
    return ForecastNoise(disturbance, time, mean, covariance, held, np.maximum(_sensors(runs), MIN_SENSORS))


def _thrust(model: ManoeuvringModel, runs: Sequence[CraftRun], longest: float):
    """Mean and covariance of the thrusts under held inputs, and how long they are held: see `ForecastNoise`."""
    p = model.values
    sides = np.array([1.0 - p[BALANCE], 1.0 + p[BALANCE]])[:, None]
    thrusts = [sides * thrust_curve(np.stack([run.port, run.starboard]), p) for run in runs]
    driven = np.concatenate([thrust[:, run.driven] for thrust, run in zip(thrusts, runs, strict=True)], axis=1)
    mean, covariance = driven.mean(axis=1), np.cov(driven)
    changes = []
    for run, thrust in zip(runs, thrusts, strict=True):
        later = round(LAGS[1] / run.step)
        known = run.driven[later:] & run.driven[:-later]
        changes.append((thrust[:, later:] - thrust[:, :-later])[:, known])
    changed = 0.5 * np.mean(np.sum(np.concatenate(changes, axis=1) ** 2, axis=0)) / max(np.trace(covariance), 1e-12)
    # thrusts chosen anew, independently, differ by twice their variance
    held = LAGS[1] / -np.log1p(-min(changed, 1.0 - 1e-12)) if changed > 0.0 else longest
    return mean, covariance, float(np.clip(held, runs[0].step, longest))


def _accelerations_left(model: ManoeuvringModel, run: CraftRun):
    """Accelerations, measured less modelled, shape (3, N)."""
    port, starboard = acting_thrust(run.port, run.starboard, model.values, run.step)
    surge, sway, rate = run.smooth
    heading = np.zeros_like(rate) if run.heading is None else run.heading
    u, v = through_water(surge, sway, rate, heading, model.current, model.values)
    u, v, r = (np.nan_to_num(values) for values in (u, v, rate))
    expected = np.array(model.accelerations(u, v, r, port, starboard))
    measured = np.gradient(np.stack([u, v, r]), run.step, axis=1)
    unknown = ~np.isfinite(run.smooth) | ~run.driven
    return np.where(unknown, np.nan, measured - expected)


def _sensors(runs: Sequence[CraftRun]):
    """Standard deviations of the white noise of the sensors, usual ones where not recorded."""
    found = []
    for names, usual in zip((('surge', 'sway'), ('yaw_rate',), ('heading',), ('x', 'y')), SENSORS, strict=True):
        series = [getattr(run, name) for run in runs for name in names]
        noise = [white_noise(s[np.isfinite(s)]) for s in series if s is not None and np.isfinite(s).sum() > 20]
        found.append(float(np.median(noise)) if noise else usual)
    return np.array(found)


Thrusts = Sequence[np.ndarray]  #: Acting thrust of port and starboard, N, of each run.


def _regressed(runs: Sequence[CraftRun], thrusts: Thrusts, series: Callable, signs: Sequence[int]) -> np.ndarray:
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


def surge_ratios(runs: Sequence[CraftRun], thrusts: Thrusts) -> np.ndarray:
    """Thrust gain (at least 0), linear and quadratic damping (at most 0) over inertia; zeros where not determined."""
    return _regressed(
        runs, thrusts, lambda u, v, r, port, starboard: (u, port + starboard, u, np.abs(u) * u), (1, -1, -1)
    )


def yaw_ratios(runs: Sequence[CraftRun], thrusts: Thrusts) -> np.ndarray:
    """Gain of the thrust difference over inertia, and linear yaw damping over inertia, shape (2,). Where speed and sway
    are measured the regression includes further damping and the Munk moment, without which a marginally course-stable
    craft looks heavy.
    """

    def further(u: np.ndarray, v: np.ndarray, r: np.ndarray, *sides: np.ndarray) -> tuple[np.ndarray, ...]:
        return r, sides[1] - sides[0], r, np.abs(r) * r, np.abs(u) * r, u * v

    plain = _regressed(runs, thrusts, lambda u, v, r, port, starboard: (r, starboard - port, r), (1, -1))
    rich = _regressed(runs, thrusts, further, (1, -1, -1, -1, 0))
    return np.array([rich[0], plain[1] * rich[0] / plain[0]]) if rich[0] > plain[0] > 0.0 else plain


def sway_ratios(runs: Sequence[CraftRun], thrusts: Thrusts) -> np.ndarray:
    """Mass over sway inertia (of -u r), and linear sway damping over inertia, shape (2,)."""
    return _regressed(runs, thrusts, lambda u, v, r, port, starboard: (v, -u * r, v), (1, -1))
