"""Vertical motion ahead: on simulated and measured seas, at the sensor and at points, with intervals that hold."""

import math

import numpy as np
import pytest
from records_at_sea import evenly, swell
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.vertical import LeakyIntegrals, vertical_acceleration, zero_phase_integral
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.point import Point, point_motion
from swath_sysid.attitude.prediction.quiescence import PointLimits, QuiescenceLimits
from swath_sysid.attitude.prediction.variate_analysis import identify
from swath_sysid.attitude.prediction.vertical_forecast import VerticalRequest, fit_vertical, states_from_lags
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import run_through

STEP = 0.1
LEADS = np.array([0.1, 0.5, 1.0, 2.0, 3.0, 5.0])
#: m/s; the swell keeps it for a second or two at a time
LIMIT = 0.25
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
    trial, motion = swell(300.0)
    velocities = [motion(trial.time, point.place[0])[:, 1] for point in POINTS]
    limits = QuiescenceLimits(duration=1.0, points=(PointLimits('bow', vertical_velocity=LIMIT),), probability=0.6)
    return trial, velocities, run_through(trial, ForecasterSettings(points=POINTS, quiescence=limits))


PLACES = [(0.0, 0.0, 0.0), (2.5, 0.0, 0.0), (0.0, -1.2, 0.4), (3.0, 1.0, -2.0)]


def heights(place, times):
    """Height of a point of a craft that heaves, rolls and pitches by much, by scipy's rotations, and its motion."""
    (roll, pitch, heave), *derivatives = (
        [
            size * w**order * np.cos(w * times + phase + 0.5 * np.pi * order)
            for size, w, phase in (
                (0.4, 1.3, 0.2 - 0.5 * np.pi),
                (0.3, 0.9, -1.0 - 0.5 * np.pi),
                (0.8, 0.7, -0.5 * np.pi),
            )
        ]
        for order in range(3)
    )
    turned = Rotation.from_euler('ZYX', np.stack([0.0 * roll, pitch, roll], axis=1)).apply(place)
    (roll_rate, pitch_rate, velocity), (rolling, pitching, acceleration) = derivatives
    motion = heave, velocity, acceleration, rolling, pitching, roll, pitch, roll_rate, pitch_rate
    return heave + turned[:, 2], np.stack(motion, axis=1)


def test_the_lever_arm_is_that_of_a_rigid_body():
    times, step = np.linspace(0.0, 10.0, 41), 1e-3
    for place in PLACES:
        found = point_motion(place, (0.05, -0.02), heights(place, times)[1], np.zeros((times.size, 9, 9))).mean
        level = Rotation.from_euler('ZYX', (0.0, -0.02, 0.05)).apply(place)[2]
        height = np.stack([heights(place, times + shift)[0] for shift in np.arange(-3, 4) * step])
        np.testing.assert_allclose(found[:, 0], height[3] - level, atol=1e-12)
        velocity = np.array([-1, 9, -45, 0, 45, -9, 1]) @ height / (60.0 * step)
        np.testing.assert_allclose(found[:, 1], velocity, atol=1e-9)
        acceleration = np.array([2, -27, 270, -490, 270, -27, 2]) @ height / (180.0 * step**2)
        np.testing.assert_allclose(found[:, 2], acceleration, atol=3e-8)


def test_the_covariance_at_a_point_is_that_of_draws():
    rng, place = np.random.default_rng(5), (2.5, 0.8, -0.6)
    mean = np.array([[0.3, -0.2, 0.1, 0.05, -0.1, 0.10, -0.06, 0.12, 0.08]])
    root = rng.normal(size=(9, 9)) * np.array([0.2, 0.2, 0.3, 0.05, 0.05, 0.02, 0.02, 0.03, 0.03])[:, None]
    draws = mean + rng.normal(size=(10_000, 9)) @ root.T
    found = point_motion(place, (0.0, 0.0), mean, (root @ root.T)[None]).covariance[0]
    drawn = np.cov(point_motion(place, (0.0, 0.0), draws, np.zeros((10_000, 9, 9))).mean.T, draws[:, 5:].T)
    size = np.sqrt(np.diag(found))
    np.testing.assert_allclose(drawn / np.outer(size, size), found / np.outer(size, size), atol=0.03)


@pytest.mark.release
def test_vertical_velocity_is_forecast_at_the_sensor_and_ahead_of_it(at_sea):
    trial, velocities, run = at_sea
    for point, velocity in zip(POINTS, velocities, strict=True):
        errors, _ = errors_of(run, point.name, trial.time, velocity, 220.0, 290.0)
        assert (np.sqrt(np.mean(errors**2, axis=0)) / velocity.std())[:4] == pytest.approx([0.1] * 4, abs=0.1)
    assert 90.0 < next(step.stamp for step in run.steps if step.forecast.points) - trial.time[0] < 200.0
    for step in run.steps[-100::20]:
        for ahead in (*step.forecast.points.values(), *step.horizon.points.values()):
            assert np.linalg.eigvalsh(ahead.covariance).min() > -1e-12
    # the future is not looked at
    again = run_through(trial.between(None, trial.time[2299]), ForecasterSettings(points=POINTS))
    whole = [step.forecast.points['bow'].mean for step in run.steps[: len(again.steps)] if step.forecast.points]
    part = [step.forecast.points['bow'].mean for step in again.steps if step.forecast.points]
    assert len(part) > 100
    np.testing.assert_array_equal(part, whole)


@pytest.mark.slow
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
    model = identify(rows[:1900], names, STEP, 2.0 * math.pi / w[0])
    fit = fit_vertical(rows[:1900], names, STEP, model, VerticalRequest(20))
    later = np.arange(1900, 2100)
    # what the filter's state differs from that of the lags by is a small part of each channel
    seen = rows + 1e-4 * rows.std(axis=0) * np.random.default_rng(1).normal(size=rows.shape)
    integrals = LeakyIntegrals(STEP).of(vertical_acceleration(roll, pitch, rows[:, 4:]))
    states = states_from_lags(model, seen[:, model.places], later)
    mean = np.column_stack([states, integrals[later], np.ones(later.size)]) @ fit.weights[10, 0]
    assert np.std(mean - heave[later + 10]) < 0.2 * heave.std()


@pytest.mark.release
def test_windows_of_calm_are_calm(at_sea):
    trial, velocities, run = at_sea
    speed, told, kept = np.abs(velocities[1]), [], []
    for step in run.steps:
        calm = step.outlook.calm
        if calm is not None and step.stamp + calm.end < trial.time[-1]:
            inside = (trial.time >= step.stamp + calm.begin - 1e-6) & (trial.time <= step.stamp + calm.end + 1e-6)
            told.append(calm.probability)
            kept.append((speed[inside] < LIMIT).all())
            assert calm.end - calm.begin >= 1.0 - 1e-9
    assert len(told) > 50 and min(told) >= 0.6 and np.mean(kept) > 0.6


@pytest.mark.release
def test_a_buoy_at_sea(data_folder):
    """Vertical velocity of the Morro Bay buoy; the truth is the zero-phase integral of the whole record."""
    trial = read_trial(data_folder / 'waves' / 'morro_buoy.csv', frame='frd')
    run = run_through(trial.between(None, trial.time[0] + 960.0), ForecasterSettings(points=POINTS))
    time, acceleration, channels = evenly(trial, STEP)
    velocity = zero_phase_integral(acceleration, STEP, 1)
    ahead = velocity - 2.5 * np.cos(channels['pitch']) * channels['pitch_rate']
    for name, truth, largest in (
        ('sensor', velocity, (0.06, 0.085, 0.29, 0.65, 0.9, 1.05)),
        ('bow', ahead, (0.06, 0.085, 0.22, 0.56, 0.75, 1.05)),
    ):
        errors, deviations = errors_of(run, name, time, truth, 600.0, 950.0)
        nrmse = np.sqrt(np.mean(errors**2, axis=0)) / truth.std()
        assert (nrmse < largest).all(), nrmse
        held = np.mean(np.abs(errors) < 1.645 * deviations, axis=0)
        assert (np.abs(held - 0.9) < 0.06).all(), held
