"""Residual accelerations of a model, and how long thrust is held."""

from collections.abc import Sequence

import numpy as np

from swath_sysid.common.signals import white_noise
from swath_sysid.manoeuvring.hull.identified_model import ForecastNoise
from swath_sysid.manoeuvring.hull.measurement import through_water
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.terms import BALANCE
from swath_sysid.manoeuvring.hull.thrust import acting_thrust, thrust_curve
from swath_sysid.manoeuvring.motion.trial import Run

LAGS = (1.0, 4.0)  #: s; sensor noise and smoothing are uncorrelated at the first, gusts still correlated at the second.
SHORTEST_TIME, LONGEST_TIME = 1.0, 30.0  #: s.
THRUST_LEAD = 5.0  #: s over which changes of thrust are measured.
SHORTEST_HOLD = 0.1  #: s, of a thrust that is always changing.
MIN_SHARE = 0.002  #: Least disturbance as a share of the accelerations by thrust.

SENSORS = np.array([0.05, 0.01, 0.01, 0.5])
MIN_SENSORS = np.array([0.005, 0.0005, 0.0005, 0.01])


def forecast_noise(model: ManoeuvringModel, runs: Sequence[Run]) -> ForecastNoise:
    """Disturbances, thrust changes and sensor noise in the runs of the identification; intervals not yet calibrated. A
    disturbance is first-order Gauss-Markov, with variance and time from the autocovariance of the residual
    accelerations at two lags.
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
    time = np.clip(np.nan_to_num(time, nan=SHORTEST_TIME), SHORTEST_TIME, LONGEST_TIME)
    mean, covariance, held = _thrust(model, runs)
    least = MIN_SHARE * np.sqrt(np.trace(covariance)) / model['m'] + 1e-6
    disturbance = np.sqrt(np.maximum(near * np.exp(LAGS[0] / time), least**2))
    return ForecastNoise(disturbance, time, mean, covariance, held, np.maximum(_sensors(runs), MIN_SENSORS))


def _thrust(model: ManoeuvringModel, runs: Sequence[Run]):
    """Mean and covariance of the thrusts under held inputs, and how long they are held: see `ForecastNoise`."""
    p = model.values
    sides = np.array([1.0 - p[BALANCE], 1.0 + p[BALANCE]])[:, None]
    thrusts = [sides * thrust_curve(np.stack([run.port, run.starboard]), p) for run in runs]
    joined = np.concatenate([thrust[:, run.driven] for thrust, run in zip(thrusts, runs, strict=True)], axis=1)
    mean, covariance = joined.mean(axis=1), np.cov(joined)
    changes = []
    for run, thrust in zip(runs, thrusts, strict=True):
        later = round(THRUST_LEAD / run.step)
        known = run.driven[later:] & run.driven[:-later]
        changes.append((thrust[:, later:] - thrust[:, :-later])[:, known])
    changed = 0.5 * np.mean(np.sum(np.concatenate(changes, axis=1) ** 2, axis=0)) / max(np.trace(covariance), 1e-12)
    # thrusts chosen anew, independently, differ by twice their variance
    longest = max(sum(run.duration for run in runs), THRUST_LEAD)
    held = THRUST_LEAD / -np.log1p(-min(changed, 1.0 - 1e-12)) if changed > 0.0 else longest
    return mean, covariance, float(np.clip(held, SHORTEST_HOLD, longest))


def _accelerations_left(model: ManoeuvringModel, run: Run):
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


def _sensors(runs: Sequence[Run]):
    """Standard deviations of the white noise of the sensors, usual ones where not recorded."""
    found = []
    for names, usual in zip((('surge', 'sway'), ('yaw_rate',), ('heading',), ('x', 'y')), SENSORS, strict=True):
        series = [getattr(run, name) for run in runs for name in names]
        noise = [white_noise(s[np.isfinite(s)]) for s in series if s is not None and np.isfinite(s).sum() > 20]
        found.append(float(np.median(noise)) if noise else usual)
    return np.array(found)
