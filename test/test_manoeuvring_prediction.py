"""Filter, forecast, their scores, and the model file of manoeuvring."""

import math
from dataclasses import replace

import numpy as np
import pytest
from manoeuvring_runs import OLD, identified, runs_of

from swath_sysid.common.errors import InputError
from swath_sysid.formats.manoeuvring_model_file import (
    manoeuvring_from_yaml,
    manoeuvring_to_yaml,
    read_manoeuvring_model,
    write_manoeuvring_model,
)
from swath_sysid.manoeuvring.hull.programme import trial_programme
from swath_sysid.manoeuvring.hull.simulation import simulate
from swath_sysid.manoeuvring.hull.thrust import ThrustMemory, acting_thrust
from swath_sysid.manoeuvring.prediction.predictor import ManoeuvreFilter, ManoeuvreFilterSettings
from swath_sysid.manoeuvring.prediction.skill import filtered, fit_arx, score_forecasts


def test_model_file_round_trip(tmp_path):
    model = replace(OLD.with_values(lag=0.3), current=(0.1, -0.2), name='mine')
    write_manoeuvring_model(tmp_path / 'm.yaml', identified(model))
    found = read_manoeuvring_model(tmp_path / 'm.yaml')
    assert np.array_equal(found.model.values, model.values)
    assert found.model == replace(model, values=found.model.values)
    assert np.array_equal(found.covariance, identified().covariance)
    assert manoeuvring_to_yaml(found) == (tmp_path / 'm.yaml').read_text()


@pytest.mark.parametrize(
    'change, match',
    [
        (lambda t: 'format: other\n', 'not a manoeuvring model'),
        (lambda t: t.replace('version: 1', 'version: 9'), 'version 9'),
        (lambda t: t.replace('Xuu:', 'Xww:'), "no parameter 'Xww'"),
    ],
)
def test_bad_model_files_are_named(change, match):
    with pytest.raises(InputError, match=match):
        manoeuvring_from_yaml(change(manoeuvring_to_yaml(identified())))


def test_thrust_memory_is_the_thrust_of_the_simulation():
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
    assert not memory.command(1.0, 0.0, 0.0)
    assert not memory.command(99.0, math.nan, 0.0)


def test_forecast_without_noise_is_the_simulation():
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


def test_filter_is_consistent():
    """Normalised innovations of a filter with the true model are not larger than its covariance says."""
    run = runs_of(OLD, 1, ['mixed'])[0]
    truth = trial_programme(OLD)['mixed']
    settings = ManoeuvreFilterSettings(yaw_rate_noise=0.005, heading_noise=0.005, position_noise=0.3)
    errors = []
    for k, filter_ in filtered(identified(), run, settings):
        if k > 100:
            miss = filter_.x[[0, 1, 2]] - [truth.u[k], truth.v[k], truth.yaw_rate[k]]
            errors.append(miss @ np.linalg.solve(filter_.P[:3, :3], miss))
    assert np.mean(errors) < 4.5
    assert np.mean(errors) > 0.2


def test_outliers_are_refused_until_they_stay():
    filter_ = ManoeuvreFilter(identified())
    filter_.start(0.0, surge=1.0, heading=0.0, x=0.0, y=0.0)
    told = [a.code for _ in range(12) for a in filter_.correct('x', 500.0)]
    assert told[:10] == ['outlier'] * 10
    assert told[10] == 'sensor-followed'
    assert filter_.x[4] > 400
    assert filter_.correct('x', math.nan) == ()


def test_heading_wraps():
    filter_ = ManoeuvreFilter(identified())
    filter_.start(0.0, heading=3.13)
    assert filter_.correct('heading', -3.13) == ()
    assert abs(filter_.x[3] - math.pi) < 0.02


def test_current_and_wind_are_followed():
    model = replace(OLD, current=(0.2, 0.1))
    run = runs_of(model, 1, ['zigzag_20'])[0]
    *_, (_, filter_) = filtered(identified(), run)
    assert np.allclose(filter_.x[6:8], model.current, atol=0.1)


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


@pytest.mark.slow
def test_arx_learns_a_linear_craft():
    runs = runs_of(OLD, 0, ['turns_fast', 'speed_up'])
    arx = fit_arx(runs)
    motion, inputs = runs[0].channels.T, np.stack([runs[0].port, runs[0].starboard], axis=1)
    ahead = arx.run(motion[290:300], np.concatenate([inputs[290:299], inputs[299:349]]))
    assert ahead.shape == (50, 3)
    assert np.sqrt(np.mean((ahead[:, 2] - motion[300:350, 2]) ** 2)) < 0.02
    assert fit_arx(runs, until=0.05) is None


def test_settings_must_be_positive():
    for setting in ('speed_noise', 'gate_probability'):
        with pytest.raises(InputError, match=setting):
            ManoeuvreFilterSettings(**{setting: 0.0})
