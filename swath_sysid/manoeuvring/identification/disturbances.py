"""What a model leaves of the accelerations, and by how much thrust to come differs from held thrust."""
import numpy as np

from swath_sysid.common.signals import white_noise
from swath_sysid.manoeuvring.hull.identified_model import ForecastNoise
from swath_sysid.manoeuvring.hull.measurement import through_water
from swath_sysid.manoeuvring.hull.thrust import acting_thrust

LAGS = (1.0, 4.0)
"""s; sensor noise and its smoothing are forgotten at the first, a gust is not at the second."""

SHORTEST_TIME, LONGEST_TIME = 1.0, 30.0
"""s."""

THRUST_LEAD = 5.0
"""s over which the change of the thrust is measured."""

MIN_SHARE = 0.002
"""Of the accelerations that the thrust gives: no disturbance is smaller."""

SENSORS = np.array([0.05, 0.01, 0.01, 0.5])
MIN_SENSORS = np.array([0.005, 0.0005, 0.0005, 0.01])


def forecast_noise(model, runs):
    """Disturbances, thrust to come and sensors, as the runs show them.

    A disturbance is taken for first-order Gauss-Markov; its variance and time follow from the autocovariance of the
    accelerations left at two lags.

    Parameters
    ----------
    model : ManoeuvringModel
        As identified.
    runs : sequence of Run
        Those that it was identified on.

    Returns
    -------
    ForecastNoise
        With intervals not yet calibrated.
    """
    covariances, counts = np.zeros((len(LAGS), 3)), np.zeros((len(LAGS), 3))
    changes = []
    for run in runs:
        left, pushed = _accelerations_left(model, run)
        for j, lag in enumerate(LAGS):
            product = left[:, round(lag / run.step) :] * left[:, : -round(lag / run.step)]
            covariances[j] += np.nansum(product, axis=1)
            counts[j] += np.isfinite(product).sum(axis=1)
        later = round(THRUST_LEAD / run.step)
        changes.append(pushed[:, later:] - pushed[:, :-later])
    near, far = covariances / np.maximum(counts, 1.0)
    with np.errstate(invalid='ignore', divide='ignore'):
        time = (LAGS[1] - LAGS[0]) / np.log(near / np.clip(far, 1e-3 * near, 0.999 * near))
    time = np.clip(np.nan_to_num(time, nan=SHORTEST_TIME), SHORTEST_TIME, LONGEST_TIME)
    thrust = np.sqrt(np.nanmean(np.concatenate(changes, axis=1) ** 2, axis=1) / 2.0)
    least = (MIN_SHARE * np.max(np.abs(thrust)) + 1e-6) ** 2
    disturbance = np.sqrt(np.maximum(near * np.exp(LAGS[0] / time), least))
    return ForecastNoise(disturbance, time, thrust, np.maximum(_sensors(runs), MIN_SENSORS))


def _accelerations_left(model, run):
    """Accelerations that the model leaves, and those of the thrust; shape (3, N) each."""
    port, starboard = acting_thrust(run.port, run.starboard, model.values, run.step)
    surge, sway, rate = run.smooth
    heading = np.zeros_like(rate) if run.heading is None else run.heading
    u, v = through_water(surge, sway, rate, heading, model.current, model.values)
    u, v, r = (np.nan_to_num(values) for values in (u, v, rate))
    expected = np.array(model.accelerations(u, v, r, port, starboard))
    coasting = np.array(model.accelerations(u, v, r, 0.0 * port, 0.0 * port))
    measured = np.gradient(np.stack([u, v, r]), run.step, axis=1)
    unknown = ~np.isfinite(run.smooth) | ~run.driven
    return np.where(unknown, np.nan, measured - expected), expected - coasting


def _sensors(runs):
    """Standard deviations of the sensors' white noise, usual ones where they are not recorded."""
    found = []
    for names, usual in zip((('surge', 'sway'), ('yaw_rate',), ('heading',), ('x', 'y')), SENSORS, strict=True):
        series = [getattr(run, name) for run in runs for name in names]
        noise = [white_noise(s[np.isfinite(s)]) for s in series if s is not None and np.isfinite(s).sum() > 20]
        found.append(float(np.median(noise)) if noise else usual)
    return np.array(found)
