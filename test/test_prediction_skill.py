"""Skill: the baselines against oracles, the scores, and causality."""
import json
from dataclasses import replace

import numpy as np
import pytest

from swath_sysid.errors import InputError
from swath_sysid.files.reading import read_trial
from swath_sysid.motion.trial import Trial
from swath_sysid.prediction import baselines
from swath_sysid.prediction.predictor import PredictorSettings
from swath_sysid.prediction.quiescence import QuiescenceLimits
from swath_sysid.prediction.skill import run_through, score, skill_as_data
from swath_sysid.report.forecast_figure import forecast_figure


def _sea(duration=120.0, dt=0.1, seed=0):
    rng, time = np.random.default_rng(seed), np.arange(0.0, duration, dt)
    frequency, phase = rng.uniform(1.0, 3.0, (2, 60)), rng.uniform(0.0, 6.28, (2, 60))
    angle = [0.01 * np.cos(np.outer(time, f) + p).sum(axis=1) for f, p in zip(frequency, phase, strict=True)]
    rate = [
        (-0.01 * f * np.sin(np.outer(time, f) + p)).sum(axis=1) for f, p in zip(frequency, phase, strict=True)
    ]  # fmt: skip
    noise = [rng.normal(0.0, 1e-3, time.size) for _ in range(4)]
    return Trial(
        time, roll=angle[0] + noise[0], pitch=angle[1] + noise[1], roll_rate=rate[0] + noise[2],
        pitch_rate=rate[1] + noise[3], source='simulated',
    )  # fmt: skip


def test_a_grey_model_follows_an_exponential():
    time = np.arange(40)
    steps = np.array([1, 3])
    told = baselines.gm11(np.exp(0.02 * time), steps)
    assert np.isnan(told[6]).all()
    assert told[20] == pytest.approx(np.exp(0.02 * np.array([21, 23])), rel=0.02)


def test_a_running_regression_forecasts_a_sine_and_sees_only_the_past():
    values = np.sin(0.3 * np.arange(800))[:, None]
    steps = np.array([1, 5])
    told = baselines.running_regression(values, [0], steps, [400, 600], 300)[:, :, 0]
    assert np.isnan(told[:400]).all()
    assert told[500] == pytest.approx(np.sin(0.3 * (500 + steps)), abs=0.01)
    changed = values.copy()
    changed[501:] += 1.0
    assert np.array_equal(baselines.running_regression(changed, [0], steps, [400, 600], 300)[:501, :, 0], told[:501],
                          equal_nan=True)


def test_the_bound_of_an_autoregression_is_its_innovation():
    rng, count = np.random.default_rng(1), 40_000
    values = np.zeros(count)
    for k in range(1, count):
        values[k] = 0.9 * values[k - 1] + rng.normal()
    bound = baselines.spectrum_bound(values, np.array([1, 3]), order=50)
    assert bound == pytest.approx(np.sqrt([1 - 0.9**2, 1 - 0.9**6]), rel=0.03)


def test_scores_are_on_the_same_samples_and_told_as_json():
    skill = score(_sea(), (0.1, 1.0), warmup=60.0)
    data = json.loads(json.dumps(skill_as_data(skill), allow_nan=False))
    assert data['leads_s'] == [0.1, 1.0]
    assert set(data['axes']) == {'roll', 'pitch'}
    told = data['axes']['roll']['nrmse']
    assert set(told) == {'forecast', 'persistence', 'constant_rate', 'ar', 'var', 'gm11', 'bound'}
    assert all(value is not None for values in told.values() for value in values)
    assert told['forecast'][1] < 0.5 * told['persistence'][1]
    assert told['forecast'][1] < 1.1 * min(told['ar'][1], told['var'][1])
    assert 0.8 < data['axes']['roll']['coverage']['90'][0] < 0.97
    assert data['axes']['roll']['samples'][1] > 400
    assert forecast_figure(skill).axes


def test_quiescence_is_scored_after_the_warm_up_by_limits_that_the_warm_up_suggests():
    trial, duration = _sea(duration=300.0), 3.0
    settings = PredictorSettings(quiescence=QuiescenceLimits(duration=duration))
    skill = score(trial, (0.1, 1.0), warmup=100.0, settings=settings)
    told = skill_as_data(skill)['quiescence']
    warm = trial.roll[:1000]
    assert told['limits']['roll'] == pytest.approx(abs(warm.mean()) + 2.0 * warm.std())
    assert told['limits']['roll_rate'] is None and told['limits']['duration'] == duration
    assert 190 <= sum(told['count']) <= 200
    assert told['brier'] < told['brier_of_climate']


def test_a_record_too_short_or_without_angles_is_refused():
    with pytest.raises(InputError, match='warm-up'):
        score(_sea(20.0), (1.0,), warmup=60.0)
    with pytest.raises(InputError, match='angles'):
        score(replace(_sea(90.0), roll=None, pitch=None), (1.0,), warmup=10.0)


def test_changing_the_future_changes_no_forecast_of_the_past():
    trial = _sea(90.0)
    place = 613
    rng = np.random.default_rng(2)
    channels = {
        name: np.concatenate([values[:place], values[place:] + rng.normal(0.0, 0.05, values.size - place)])
        for name, values in trial.channels.items()
    }  # fmt: skip
    settings = PredictorSettings(leads=(0.5, 2.0), window=60.0)
    before = [s for s in run_through(trial, settings, {}).steps if s.stamp < trial.time[place]]
    after = [s for s in run_through(replace(trial, **channels), settings, {}).steps if s.stamp < trial.time[place]]
    assert len(before) == len(after) > 500
    for one, other in zip(before, after, strict=True):
        for axis, told in one.forecast.axes.items():
            assert np.array_equal(told.angle, other.forecast.axes[axis].angle)
            assert np.array_equal(told.half_width, other.forecast.axes[axis].half_width)
            assert np.array_equal(one.horizon.axes[axis].angle, other.horizon.axes[axis].angle)


def test_a_ship_that_tells_angles_once_a_second_is_forecast_and_its_intervals_hold(data_folder):
    skill = score(read_trial(data_folder / 'waves' / 'nbp1406_ship.csv'), (2.0, 5.0), warmup=240.0)
    for axis in ('roll', 'pitch'):
        assert np.all(skill.axes[axis].nrmse['forecast'] < 0.85)
        assert np.all(np.abs(skill.axes[axis].coverage[:, 1] - 0.9) < 0.03)
