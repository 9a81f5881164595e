"""Filter, forecast, their scores, the model file of manoeuvring, and the live predictor between its messages."""

import math
from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from manoeuvring_runs import MODEL, OLD, identified, runs_of

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.simulation import simulate
from swath_sysid.manoeuvring.hull.standard_tests import RunNoise, trial_programme, with_noise
from swath_sysid.manoeuvring.hull.thrust import ThrustMemory, acting_thrust
from swath_sysid.manoeuvring.prediction.pipeline import (
    ManoeuvreOutlook,
    ManoeuvreOutlookSettings,
    ManoeuvringHealth,
    OdometryReading,
)
from swath_sysid.manoeuvring.prediction.predictor import MEASURABLE, STATES, ManoeuvreFilter, ManoeuvreFilterSettings
from swath_sysid.manoeuvring.prediction.skill import filtered, score_forecasts


def test_forecast_without_noise_is_the_simulation_whose_thrust_is_remembered():
    model = OLD.with_values(gain=100.0, dead_band=0.05, lag=0.25, delay=0.15, balance=0.03)
    rng = np.random.default_rng(2)
    port, starboard = rng.uniform(-1, 1, (2, 60))
    expected = np.array(acting_thrust(port, starboard, model.values, 0.1))
    memory, found = ThrustMemory(model.values), []
    memory.command(-10.0, port[0], starboard[0])
    for k in range(60):
        memory.command(0.1 * k, port[k], starboard[k])
        found.append(memory.advance(0.1 * k, 0.1))
    assert np.allclose(np.array(found).T, expected, atol=1e-9)
    filter_ = ManoeuvreFilter(identified())
    filter_.thrust.command(0.0, 40.0, 90.0)
    filter_.start(0.0, surge=0.5, sway=0.1, yaw_rate=0.05, heading=1.0, x=3.0, y=-2.0)
    forecast = filter_.forecast([1.0, 5.0, 10.0])
    exact = simulate(OLD, np.full(1000, 40.0), np.full(1000, 90.0), 0.01, (0.5, 0.1, 0.05), 1.0, (3.0, -2.0))
    expected = np.array([exact.u, exact.v, exact.yaw_rate, exact.heading, exact.x, exact.y]).T[[100, 500, 1000]]
    assert np.allclose(forecast.states[:, :6], expected, atol=1e-3)
    assert np.all(np.linalg.eigvalsh(forecast.covariances) > -1e-12)
    spread = np.sqrt(forecast.covariances[:, 4, 4])
    assert spread[0] < spread[1] < spread[2]
    assert filter_.stamp == 0.0
    turned = filter_.forecast([5.0], [(0.0, 90.0, 40.0)])
    assert turned.states[0, 2] < 0 < forecast.states[1, 2]


@pytest.mark.long
def test_filter_is_consistent():
    run = runs_of(OLD, 1, ['mixed'])[0]
    truth = trial_programme(OLD)['mixed']
    settings = ManoeuvreFilterSettings(yaw_rate_noise=0.005, heading_noise=0.005, position_noise=0.3)
    errors = []
    for k, filter_ in filtered(identified(), run, settings):
        if k > 100:
            miss = filter_.x[[0, 1, 2]] - [truth.u[k], truth.v[k], truth.yaw_rate[k]]
            errors.append(miss @ np.linalg.solve(filter_.P[:3, :3], miss))
    assert 0.2 < np.mean(errors) < 4.5
    # the current is followed
    model = replace(OLD, current=(0.2, 0.1))
    *_, (_, filter_) = filtered(identified(), runs_of(model, 1, ['zigzag_20'])[0])
    assert np.allclose(filter_.x[6:8], model.current, atol=0.1)


@pytest.mark.parametrize('name', MEASURABLE)
def test_a_correction_is_one_update_of_filterpys_and_the_conditioned_gaussian(name, monkeypatch):
    calls, update = [], ExtendedKalmanFilter.update
    monkeypatch.setattr(ExtendedKalmanFilter, 'update', lambda *a, **k: (calls.append(1), update(*a, **k)))
    filter_ = ManoeuvreFilter(identified(), ManoeuvreFilterSettings())
    filter_.start(0.0, surge=0.5, sway=0.1, yaw_rate=0.05, heading=math.pi - 0.01, x=3.0, y=-2.0)
    filter_.advance(2.0)
    before, p, place = filter_.x, filter_.P, MEASURABLE.index(name)
    around = before[:, None] + 1e-4 * np.hstack([np.zeros((STATES, 1)), np.eye(STATES), -np.eye(STATES)])
    recorded = filter_._recorded(around)[place]
    row, noise = (recorded[1 : STATES + 1] - recorded[STATES + 1 :]) / 2e-4, filter_.settings.noise(name)
    innovation = 0.5 * math.sqrt(row @ p @ row + noise**2)
    value = recorded[0] + innovation
    assert filter_.correct(name, value - 2.0 * math.pi if name == 'heading' else value) == ()
    gain = p @ row / (row @ p @ row + noise**2)
    assert filter_.x == pytest.approx(before + gain * innovation, abs=1e-6)
    assert filter_.P == pytest.approx(p - np.outer(gain, row @ p), abs=1e-6) and len(calls) == 1


def test_outliers_are_refused_until_they_stay():
    filter_ = ManoeuvreFilter(identified())
    filter_.start(0.0, surge=1.0, heading=0.0, x=0.0, y=0.0)
    told = [a.code for _ in range(12) for a in filter_.correct('x', 500.0)]
    assert told[:10] == ['outlier'] * 10
    assert told[10] == 'sensor-followed'
    assert filter_.x[4] > 400
    assert filter_.correct('x', math.nan) == ()
    # a heading wraps
    filter_.start(1.0, heading=3.13)
    assert filter_.correct('heading', -3.13) == ()
    assert abs(filter_.x[3] - math.pi) < 0.02


@pytest.mark.long
@pytest.mark.slow
def test_model_forecasts_better_than_steady_motion():
    runs = runs_of(OLD, 0, ['mixed', 'turns_fast', 'zigzag_10'])
    scores = score_forecasts(identified(), runs[:1], training=runs[1:], supplied=True, leads=(1.0, 5.0, 10.0))
    position = {method: table['position_m'] for method, table in scores.rmse.items()}
    for other in ('constant-velocity', 'constant-turn-rate', 'arx'):
        assert position['model'][2] < 0.5 * position[other][2]
    assert np.all(scores.spread['surge_m_s'] > 0.85)
    held = score_forecasts(identified(), runs[:1], training=runs[1:], leads=(1.0, 5.0))
    assert held.rmse['model']['heading_rad'][1] > scores.rmse['model']['heading_rad'][1]
    assert held.rmse['model']['heading_rad'][0] < held.rmse['constant-turn-rate']['heading_rad'][0]
    with pytest.raises(InputError, match='same kind'):
        score_forecasts(identified(), [replace(runs[0], thrust_input='command')])


@pytest.mark.parametrize(
    'kind, wrong',
    [
        (ManoeuvreFilterSettings, {'speed_noise': 0.0}),
        (ManoeuvreFilterSettings, {'gate_probability': 0.0}),
        (ManoeuvreOutlookSettings, {'leads': (2.0, 1.0)}),
        (ManoeuvreOutlookSettings, {'leads': ()}),
        (ManoeuvreOutlookSettings, {'horizon_step': 99.0}),
        (ManoeuvreOutlookSettings, {'rate': 0.0}),
    ],
)
def test_impossible_settings_are_refused(kind, wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        kind(**wrong)


SETTINGS = ManoeuvreOutlookSettings(leads=(1.0, 5.0), horizon=5.0, rate=1.0)


@pytest.fixture(scope='module')
def manoeuvre():
    return with_noise(trial_programme(OLD)['mixed'], RunNoise(), 1)


def readings(m, start=1e9):
    return [
        OdometryReading(start + t, x, y, math.remainder(h, 2 * math.pi), u, v, r, {})
        for t, x, y, h, u, v, r in zip(m.time, m.x, m.y, m.heading, m.surge, m.sway, m.yaw_rate, strict=True)
    ]


def play(outlook, m, rows):
    steps = []
    for k, reading in rows:
        outlook.add_thrust(reading.stamp, 'port', float(m.port[k]))
        outlook.add_thrust(reading.stamp, 'starboard', float(m.starboard[k]))
        outlook.add_yaw_rate(reading.stamp, reading.yaw_rate)
        steps.append((k, outlook.add_odometry(reading)))
    return [(k, step) for k, step in steps if step.path]


def lead_errors(found, m, lead):
    step = round(lead / 0.1)
    index = {1.0: 0, 5.0: 1}[lead]
    return [
        math.hypot(s.leads[index].x - m.x[k + step], s.leads[index].y - m.y[k + step])
        for k, s in found
        if 100 < k < len(m.time) - step
    ]


@pytest.mark.long
@pytest.mark.slow
def test_forecasts_are_due_and_right(manoeuvre):
    found = play(ManoeuvreOutlook(SETTINGS, MODEL), manoeuvre, list(enumerate(readings(manoeuvre))))
    assert 100 <= len(found) <= 107
    state = found[50][1].leads[1]
    assert state.stamp == pytest.approx(found[50][1].leads[0].stamp + 4.0)
    assert [p.stamp - state.stamp for p in found[50][1].path[:3]] == pytest.approx([-4.5, -4.0, -3.5], abs=1e-6)
    steady = play(ManoeuvreOutlook(SETTINGS), manoeuvre, list(enumerate(readings(manoeuvre))))
    assert np.median(lead_errors(found, manoeuvre, 5.0)) < 0.7
    assert np.mean(lead_errors(found, manoeuvre, 5.0)) < 0.6 * np.mean(lead_errors(steady, manoeuvre, 5.0))
    assert np.all(np.linalg.eigvalsh(state.pose_covariance) > 0)
    assert np.all(np.linalg.eigvalsh(state.twist_covariance) > 0)


@pytest.mark.long
def test_faults_are_counted_and_survived(manoeuvre):
    outlook = ManoeuvreOutlook(SETTINGS, MODEL)
    rows = readings(manoeuvre)
    play(outlook, manoeuvre, list(enumerate(rows))[:300])
    outlook.add_odometry(replace(rows[300], x=math.nan))
    outlook.add_odometry(rows[290])
    outlook.add_thrust(1e9, 'port', math.inf)
    outlook.add_thrust(rows[300].stamp, 'port', float(manoeuvre.port[300]))
    outlook.add_thrust(rows[300].stamp, 'starboard', float(manoeuvre.starboard[300]))
    for reading in rows[300:303]:
        outlook.add_odometry(replace(reading, x=reading.x + 300.0))
    play(outlook, manoeuvre, list(enumerate(rows))[303:330])
    counts = outlook.counts
    assert (counts['not-finite'], counts['late'], counts['outlier']) == (2, 1, 3)
    outlook.add_odometry(rows[500])
    assert counts['long-gap'] == 1
    outlook.add_odometry(rows[0])
    assert counts['jumped-back'] == 1
    found = play(outlook, manoeuvre, list(enumerate(rows))[1:300])
    assert np.median(lead_errors(found, manoeuvre, 1.0)) < 0.7


def test_supplied_thrust_bends_the_path_and_silent_thrusters_stop_if_asked(manoeuvre):
    outlook = ManoeuvreOutlook(replace(SETTINGS, stop_after=1.0), MODEL)
    rows = readings(manoeuvre)
    play(outlook, manoeuvre, list(enumerate(rows))[:100])
    outlook.supply([(0.0, 150.0, 0.0)])
    (_, right), *_ = play(outlook, manoeuvre, list(enumerate(rows))[100:120])
    assert right.leads[1].yaw_rate < -0.1
    outlook.supply([])
    for reading in rows[120:150]:
        step = outlook.add_odometry(reading)
    assert outlook.counts['no-thrust'] == 1
    while not step.path:
        step = outlook.add_odometry(replace(reading, stamp=reading.stamp + 1.0))
    assert abs(step.leads[1].surge) < 0.5


@pytest.mark.long
def test_thrust_stamped_by_another_clock_before_the_first_odometry_acts():
    """The node's clock may be far ahead of a simulator's, which is told only by its odometry."""
    outlook = ManoeuvreOutlook(ManoeuvreOutlookSettings(leads=(5.0,)), MODEL)
    for side, value in (('port', 40.0), ('starboard', 90.0)):
        outlook.add_thrust(1.7e9, side, value)
    for k in range(100):
        for side, value in (('port', 40.0), ('starboard', 90.0)):
            outlook.add_thrust(10.0 + 0.1 * k, side, value)
        step = outlook.add_odometry(OdometryReading(10.0 + 0.1 * k, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, {}))
        if step.leads:
            last = step.leads[0]
    assert last.yaw_rate > 0.05


def test_a_silent_odometry_hides_neither_a_refused_model_nor_late_messages():
    outlook = ManoeuvreOutlook(SETTINGS, MODEL)
    health = ManoeuvringHealth('/odometry', outlook)
    health.note_refused_model('the model has no sway')
    outlook.counts['late'] += 3
    (told,) = health.reports(0.0)
    assert told.level == 2 and 'no odometry on /odometry' in told.message
    assert 'the model has no sway' in told.message and 'late (3 times lately)' in told.message
    assert set(told.codes) == {'sensor-silent', 'bad-model', 'late'}
