"""A sensor without orientation: the bias of its rate, and forecasts that know what they do not know."""

import math

import numpy as np
import pytest
from craft_at_sea import known_sea
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.channels import StuckChannels
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.rows import OF_CHANNELS, OF_MEANS, OF_SAMPLE, RowClock, Sampled
from swath_sysid.attitude.prediction.unmeasured_angle import (
    FORCE_STD,
    GYRO_BIAS_STD,
    LEVEL_STD,
    Gravity,
    UnmeasuredAngle,
)
from swath_sysid.pipeline.record_run import run_through

HULL = hull_named('swath-roll').model
KNOWN = {'roll': IdentifiedModel.exactly(HULL)}
LEADS = 0.1, 0.5, 1.0
INTERVAL = 0.05
WINDOW = 375.0
SLOWER = 2.0


@given(
    bias=st.floats(-GYRO_BIAS_STD, GYRO_BIAS_STD),
    amplitude=st.floats(0.01, 0.3),
    period=st.floats(0.5, 12.0),
    phase=st.floats(0.0, math.tau),
    periods=st.floats(0.3, 30.0),
)
def test_a_bias_is_found_within_three_standard_deviations(bias, amplitude, period, phase, periods):
    unmeasured = UnmeasuredAngle(WINDOW)
    unmeasured.period = period
    times = period / 50.0 * np.arange(1, round(50.0 * periods) + 1)
    for rate in bias + amplitude * math.tau / period * np.cos(math.tau / period * times + phase):
        unmeasured.take(math.nan, rate, period / 50.0)
    # a part of a cycle tells too little of the motion's size
    if periods > 1.0:
        assert abs(unmeasured.bias - bias) < 3.0 * math.sqrt(unmeasured.bias_variance) + 0.02 * amplitude / period
        of_angles = (
            (amplitude**2 + 2.0 * (bias * period / math.tau) ** 2) / min(times[-1], 19.0 * period) ** 2 * SLOWER**2
        )
        assert unmeasured.bias_variance == pytest.approx(1.0 / (1.0 / GYRO_BIAS_STD**2 + 1.0 / of_angles), rel=0.5)


def test_an_angle_is_missing_after_a_radian_and_unknown_after_all_that_is_learnt_from():
    unmeasured = UnmeasuredAngle(10.0)
    assert unmeasured.is_missing and unmeasured.is_unknown
    unmeasured.take(0.1, 0.0, 0.0)
    assert not unmeasured.is_missing and not unmeasured.is_unknown
    unmeasured.take(math.nan, 0.0, 0.0)
    assert unmeasured.is_unknown, 'it never changed'
    for angle in (0.11, 0.1):
        unmeasured.take(angle, 0.0, 0.0)
    assert unmeasured.level_variance == 0.0
    unmeasured.take(math.nan, 0.0, unmeasured.period / 6.0)
    assert unmeasured.is_missing and not unmeasured.is_unknown
    unmeasured.take(math.nan, 0.0, 10.0 * unmeasured.period)
    assert unmeasured.is_unknown


@pytest.fixture(scope='module')
def sea():
    return known_sea(HULL, (1,), 1.2, 0.04, 110.0, interval=INTERVAL)


def forecasts_of(sea, models, bias=0.0, **beside):
    """Errors and standard deviations (N, L) of the roll, over the motion's, after a minute."""
    rate = sea.rate[:, 0] + bias + np.random.default_rng(1).normal(scale=2e-3, size=sea.time.size)
    trial = Trial(sea.time - sea.time[0], roll_rate=rate, **beside)
    settings = ForecasterSettings(LEADS, forecast_rate=2.0)
    steps = [step for step in run_through(trial, settings, models).steps if step.stamp > 60.0]
    at = np.array([step.stamp for step in steps])[:, None] + LEADS
    truth = np.interp(at, trial.time, sea.angle[:, 0], right=math.nan)
    errors = np.array([step.forecast.angle('roll') for step in steps]) - truth
    deviations, size = np.array([step.forecast.deviation[:, 0] for step in steps]), sea.angle[:, 0].std()
    known = np.isfinite(errors).all(axis=1)
    return errors[known] / size, deviations[known] / size


@pytest.fixture(scope='module')
def of_complete_sensor(sea):
    """Root mean square errors (L,) where the angle is measured, without a hull."""
    noise = np.random.default_rng(2).normal(scale=5e-4, size=sea.time.size)
    errors, _ = forecasts_of(sea, {}, roll=sea.angle[:, 0] + noise)
    return np.sqrt(np.mean(errors**2, axis=0))


@pytest.mark.release
@pytest.mark.parametrize('bias_deg', [0.3, -3.0])
def test_on_a_known_hull_a_biased_gyroscope_alone_is_as_good_as_a_complete_sensor_without(
    sea, of_complete_sensor, bias_deg
):
    errors, deviations = forecasts_of(sea, KNOWN, math.radians(bias_deg))
    root_mean_square = np.sqrt(np.mean(errors**2, axis=0))
    assert np.all(root_mean_square < 1.15 * of_complete_sensor + [0.1, 0.0, 0.0])
    assert np.all(np.mean(np.abs(errors) < 1.645 * deviations, axis=0) >= 0.85)
    assert np.all(deviations.mean(axis=0) < 2.5 * root_mean_square)


@pytest.mark.long
def test_without_a_hull_forecasts_are_about_a_level_that_nothing_tells(sea, of_complete_sensor):
    errors, deviations = forecasts_of(sea, {}, math.radians(0.3))
    assert np.all(errors.std(axis=0) < 1.15 * of_complete_sensor + [0.15, 0.0, 0.0])
    level = LEVEL_STD / sea.angle[:, 0].std()
    assert np.all((deviations > level) & (deviations < 1.5 * level))


@pytest.mark.parametrize('mounted_deg', [(0.0, 0.0), (5.0, -8.0)])
def test_gravity_tells_the_level_of_a_craft_that_moves(mounted_deg):
    gravity, time, rng = Gravity(), 0.05 * np.arange(1200), np.random.default_rng(1)
    tilt = Rotation.from_euler('yx', np.radians(mounted_deg)[::-1])
    swing = Rotation.from_euler('x', 0.1 * np.sin(2.0 * time)[:, None])
    up = (tilt * swing).inv().apply([0.0, 0.0, 9.81]) + rng.normal(scale=0.5, size=(time.size, 3))
    found = []
    for force in up.tolist():
        gravity.take(force, 0.05, 3.2)
        found.append(gravity.levels(3.2))
    assert not found[100] and found[-1], 'one swing tells nothing'
    for (level, variance), mounted in zip(found[-1], np.radians(mounted_deg), strict=True):
        assert abs(level - mounted) < math.sqrt(variance)
        assert FORCE_STD < math.sqrt(variance) < 1.2 * FORCE_STD


@pytest.mark.parametrize('scale', [0.0, 1.0 / 9.81, 0.7])
def test_what_is_not_as_large_as_gravity_tells_no_level(scale):
    gravity = Gravity()
    for _ in range(1000):
        gravity.take((0.0, 0.0, 9.81 * scale), 0.1, 3.2)
    assert gravity.levels(3.2) == []


@pytest.mark.long
def test_a_level_that_gravity_tells_makes_the_intervals_narrower(sea):
    trim = 0.06
    force = 9.81 * np.stack([np.zeros(sea.time.size), np.sin(trim + sea.angle[:, 0]), np.cos(trim + sea.angle[:, 0])])
    force += np.random.default_rng(4).normal(scale=0.3, size=force.shape)
    errors, deviations = forecasts_of(sea, {}, **dict(zip(('accel_x', 'accel_y', 'accel_z'), force, strict=True)))
    errors -= trim / sea.angle[:, 0].std()
    assert np.all(np.mean(np.abs(errors) < 1.645 * deviations, axis=0) >= 0.85)
    assert np.all(deviations[:, 0] < 0.6 * LEVEL_STD / sea.angle[:, 0].std())


def followed(angles, rates, interval=0.05, noise=(1e-7, 4e-6), bias=(0.0, GYRO_BIAS_STD**2)):
    """The angles and rates that are taken for measured ones, and for how long one had been left out."""
    stuck, found = StuckChannels(), []
    for angle, rate in zip(angles, rates, strict=True):
        found.append((*stuck.take(angle, rate, noise, bias, interval), stuck.seconds()))
    return np.array(found).T


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize('rounding', [0.0, 1e-12])
def test_of_angle_and_rate_the_one_that_repeats_itself_is_left_out_while_it_does(sign, rounding):
    time = 0.01 * np.arange(7000)
    noise, computed = np.random.default_rng(3).normal(size=(2, time.size)), rounding * np.arange(time.size)
    angles, rates = sign * 0.1 * np.sin(2.0 * time) + 3e-4 * noise[0], sign * 0.2 * np.cos(2.0 * time) + 2e-3 * noise[1]
    stands_still = (time >= 40.0) & (time < 60.0)
    for place, channels in enumerate(([np.where(stands_still, angles[4000], angles) + computed, rates],
                                      [angles, np.where(stands_still, rates[4000], rates)])):  # fmt: skip
        found = followed(*channels, 0.01, (9e-8, 4e-6), (0.0, 1e-6))
        lost = np.isnan(found[place])
        assert not np.isnan(found[1 - place]).any()
        np.testing.assert_array_equal(lost[~stands_still], False)
        assert lost[4040:6000].all()
        assert found[2][5999] == pytest.approx(20.0, abs=0.02) and found[2][6000] == 0.0


def test_what_is_repeated_with_all_others_tells_nothing():
    angles, rates, _ = followed(np.full(400, 0.02), np.full(400, 0.2))
    assert np.all(angles == 0.02) and np.all(rates == 0.2)
    twice = np.repeat(0.2 * np.cos(0.1 * np.arange(400)), 2)
    assert np.isnan(followed(np.full(800, 0.02), twice, 0.025, bias=(0.0, 1e-6))[0][100:]).all()


@pytest.mark.parametrize('step', [0.02, 0.002])
def test_an_angle_of_a_coarse_sensor_is_none_that_is_stuck(step):
    time = 0.05 * np.arange(2000)
    angles = step * np.round(0.01 * np.sin(time) / step)
    assert not np.isnan(followed(angles, 0.01 * np.cos(time))[0]).any()


@given(bias=st.floats(-0.03, 0.03), seed=st.integers(0, 99))
def test_an_angle_at_rest_is_one_also_by_a_sensor_that_repeats_it(bias, seed):
    rates = bias + np.random.default_rng(seed).normal(scale=2e-3, size=2000)
    assert np.all(followed(np.full(2000, 0.02), rates)[0] == 0.02)


@pytest.mark.parametrize('bias', [0.01, -0.01])
def test_while_the_angle_is_measured_it_tells_the_rates_bias(bias):
    unmeasured, time = UnmeasuredAngle(WINDOW), 0.05 * np.arange(1300)
    angles, rates = 0.1 * np.sin(2.0 * time), bias + 0.2 * np.cos(2.0 * time)
    for angle, rate in zip(angles, rates, strict=True):
        unmeasured.take(angle, rate, 0.05)
    assert abs(unmeasured.bias - bias) < 3.0 * math.sqrt(unmeasured.bias_variance) < 3e-3


@pytest.mark.long
@pytest.mark.parametrize('freezes', [pytest.param(False, marks=pytest.mark.release), True])
def test_on_a_known_hull_angles_that_are_lost_or_freeze_are_forecast_by_the_rates(sea, of_complete_sensor, freezes):
    time, noise = sea.time - sea.time[0], np.random.default_rng(2).normal(scale=5e-4, size=sea.time.size)
    angle = sea.angle[:, 0] + noise
    angle[time > 61.0] = angle[np.searchsorted(time, 61.0)] if freezes else math.nan
    errors, deviations = (values[10:] for values in forecasts_of(sea, KNOWN, roll=angle))
    assert np.all(np.sqrt(np.mean(errors**2, axis=0)) < of_complete_sensor + [0.1, 0.0, 0.0])
    assert np.all(np.mean(np.abs(errors) < 1.645 * deviations, axis=0) >= 0.9)


@pytest.mark.long
def test_forecasts_of_a_sensor_that_repeats_itself_are_those_of_a_silent_one(sea):
    time, rng = sea.time - sea.time[0], np.random.default_rng(2)
    angle, rate = sea.angle[:, 0] + rng.normal(scale=5e-4, size=time.size), sea.rate[:, 0]
    rate = rate + rng.normal(scale=2e-3, size=time.size)
    first, last = np.searchsorted(time, [70.0, 80.0])
    every = np.arange(time.size)
    silent = np.r_[every[: first + 1], every[last:]]
    hangs = np.where((every >= first) & (every < last), first, every)
    errors = {}
    for name, at_rows, rows in (('silent', silent, silent), ('hangs', every, hangs)):
        trial = Trial(time[at_rows], roll=angle[rows], roll_rate=rate[rows])
        steps = run_through(trial, ForecasterSettings(LEADS, forecast_rate=2.0), KNOWN).steps
        assert not any(70.5 < step.stamp < 80.0 for step in steps)
        later = [step for step in steps if 80.0 + 2.0 * HULL.natural_period < step.stamp < 105.0]
        truth = np.interp(np.array([step.stamp for step in later])[:, None] + LEADS, time, sea.angle[:, 0])
        errors[name] = np.sqrt(
            np.mean((np.array([step.forecast.angle('roll') for step in later]) - truth) ** 2, axis=0)
        )
    assert np.all(errors['hangs'] < 1.1 * errors['silent'])


def sample_with(**values):
    return CraftSample(**{**dict.fromkeys(CraftSample._fields, math.nan), 'stamp_ns': 0, **values})


@pytest.mark.parametrize(('values', 'stands_in', 'roll'), [
    ({'roll_rate': 0.2}, True, 0.1),
    ({'roll_rate': 0.2}, False, math.nan),
    ({'roll': 0.3, 'roll_rate': 0.2}, True, 0.3),
    ({}, True, math.nan),
])  # fmt: skip
def test_the_filtered_angle_stands_in_where_only_the_rate_is_measured(values, stands_in, roll):
    clock = RowClock()
    for _ in range(60):
        clock.sensor.follow(0.1)
    clock.lay_out(3.2)
    filtered = (0.1, 0.2), None
    ((_, row),) = clock.take(
        sample_with(**values), Sampled(0.1, 1), filtered, (stands_in and 'roll' not in values, False)
    )
    assert row[OF_CHANNELS][0] == pytest.approx(roll, nan_ok=True)
    assert row[OF_SAMPLE][0] == pytest.approx(roll, nan_ok=True)
    assert row[OF_MEANS][0] == pytest.approx(values.get('roll', math.nan), nan_ok=True), 'what a hull is learnt from'
