"""Vertical motion ahead: on simulated and measured seas, at the sensor and at points, with intervals that hold."""

import math

import numpy as np
import pytest
from records_at_sea import swell

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.vertical import LeakyIntegrals, vertical_acceleration, zero_phase_integral
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.point import Point
from swath_sysid.attitude.prediction.quiescence import PointLimits, QuiescenceLimits
from swath_sysid.attitude.prediction.variate_analysis import identify
from swath_sysid.attitude.prediction.vertical import VerticalRequest, fit_vertical, states_from_lags
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import run_through

pytestmark = pytest.mark.slow

STEP = 0.1
LEADS = np.array([0.1, 0.5, 1.0, 2.0, 3.0, 5.0])
LIMIT = 0.25
"""m/s; the swell keeps it for a second or two at a time."""
POINTS = Point('sensor', (0.0, 0.0, 0.0)), Point('bow', (2.5, 0.0, 0.0))


def errors_of(run, name, time, velocity, since, until):
    """Errors of the vertical velocity at a point, and their standard deviations, shape (N, L)."""
    errors, deviations = [], []
    for step in run.steps:
        if since <= step.stamp - time[0] < until:
            ahead = step.forecast.points[name]
            errors.append(ahead.mean[:, 1] - np.interp(step.stamp + LEADS, time, velocity))
            deviations.append(np.sqrt(ahead.covariance[:, 1, 1]))
    return np.array(errors), np.array(deviations)


@pytest.fixture(scope='module')
def at_sea():
    """Five minutes of the swell and what was forecast."""
    trial, motion = swell(300.0)
    velocities = [motion(trial.time, point.place[0])[:, 1] for point in POINTS]
    limits = QuiescenceLimits(duration=1.0, points=(PointLimits('bow', vertical_velocity=LIMIT),), probability=0.6)
    return trial, velocities, run_through(trial, ForecasterSettings(points=POINTS, quiescence=limits))


def test_vertical_velocity_is_forecast_at_the_sensor_and_ahead_of_it(at_sea):
    trial, velocities, run = at_sea
    for point, velocity in zip(POINTS, velocities, strict=True):
        errors, _ = errors_of(run, point.name, trial.time, velocity, 220.0, 290.0)
        assert (np.sqrt(np.mean(errors**2, axis=0)) / velocity.std())[:4] == pytest.approx([0.1] * 4, abs=0.1)
    assert 90.0 < next(step.stamp for step in run.steps if step.forecast.points) - trial.time[0] < 200.0
    for step in run.steps[-100::20]:
        for ahead in (*step.forecast.points.values(), *step.horizon.points.values()):
            assert np.linalg.eigvalsh(ahead.covariance).min() > -1e-12


def test_a_swell_of_few_waves_without_noise_is_not_weighed_by_what_rounding_left():
    """Its state space has more states than the swell: in use they are not what they were in training."""
    time, names = STEP * np.arange(2200), ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'accel_x', 'accel_y', 'accel_z')
    w = 2.0 * math.pi * np.array([0.071, 0.093, 0.121, 0.152])
    angle, size = np.outer(time, w) + np.array([0.3, 1.2, 2.2, 0.7]), np.array([0.8, 0.5, 0.4, 0.2])
    heave, acceleration = np.cos(angle) @ size, np.cos(angle) @ (-(w**2) * size)
    roll, pitch = (0.05 * np.cos(angle + turn) @ size for turn in (0.4, -1.0))
    rates = [-0.05 * np.sin(angle + turn) @ (w * size) for turn in (0.4, -1.0)]
    along = np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)], axis=1)
    rows = np.column_stack([roll, pitch, *rates, along * (STANDARD_GRAVITY + acceleration)[:, None]])
    model = identify(rows[:1900], names, STEP)
    fit = fit_vertical(rows[:1900], names, STEP, model, VerticalRequest(20))
    later = np.arange(1900, 2100)
    # what the filter's state differs from that of the lags by is a small part of each channel
    seen = rows + 1e-4 * rows.std(axis=0) * np.random.default_rng(1).normal(size=rows.shape)
    integrals = LeakyIntegrals(STEP).of(vertical_acceleration(roll, pitch, rows[:, 4:]))
    states = states_from_lags(model, seen[:, model.places], later)
    mean = np.column_stack([states, integrals[later], np.ones(later.size)]) @ fit.weights[10, 0]
    assert np.std(mean - heave[later + 10]) < 0.2 * heave.std()


def test_windows_of_calm_are_calm(at_sea):
    trial, velocities, run = at_sea
    speed, told, kept = np.abs(velocities[1]), [], []
    for step in run.steps:
        calm = step.forecast.calm
        if calm is not None and step.stamp + calm.end < trial.time[-1]:
            inside = (trial.time >= step.stamp + calm.begin - 1e-6) & (trial.time <= step.stamp + calm.end + 1e-6)
            told.append(calm.probability)
            kept.append((speed[inside] < LIMIT).all())
            assert calm.end - calm.begin >= 1.0 - 1e-9
    assert len(told) > 50 and min(told) >= 0.6
    assert np.mean(kept) > 0.6


def test_the_future_is_not_looked_at(at_sea):
    trial, _, run = at_sea
    again = run_through(trial.between(None, trial.time[2299]), ForecasterSettings(points=POINTS))
    whole = [step.forecast.points['bow'].mean for step in run.steps[: len(again.steps)] if step.forecast.points]
    part = [step.forecast.points['bow'].mean for step in again.steps if step.forecast.points]
    assert len(part) > 100
    np.testing.assert_array_equal(part, whole)


@pytest.mark.long
def test_a_buoy_at_sea(data_folder):
    """Vertical velocity of the Morro Bay buoy; the truth is the zero-phase integral of the whole record."""
    trial = read_trial(data_folder / 'waves' / 'morro_buoy.csv', frame='frd')
    run = run_through(trial.between(None, trial.time[0] + 960.0), ForecasterSettings(points=POINTS))
    time = np.arange(trial.time[0], trial.time[-1], STEP)

    def even(name):
        values = getattr(trial, name)
        known = np.isfinite(values)
        return np.interp(time, trial.time[known], values[known])

    force = np.stack([even(f'accel_{axis}') for axis in 'xyz'], axis=1)
    velocity = zero_phase_integral(vertical_acceleration(even('roll'), even('pitch'), force), STEP, 1)
    ahead = velocity - 2.5 * np.cos(even('pitch')) * even('pitch_rate')
    for name, truth, largest in (
        ('sensor', velocity, (0.06, 0.085, 0.29, 0.65, 0.9, 1.05)),
        ('bow', ahead, (0.06, 0.085, 0.22, 0.56, 0.75, 1.05)),
    ):
        errors, deviations = errors_of(run, name, time, truth, 600.0, 950.0)
        nrmse = np.sqrt(np.mean(errors**2, axis=0)) / truth.std()
        assert (nrmse < largest).all(), nrmse
        held = np.mean(np.abs(errors) < 1.645 * deviations, axis=0)
        assert (np.abs(held - 0.9) < 0.06).all(), held
