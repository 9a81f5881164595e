"""The regression of the waves, the combination of experts and calibration, against oracles."""
import math

import numpy as np
import pytest

from swath_sysid.errors import InputError
from swath_sysid.hull.catalogue import hull_named
from swath_sysid.hull.simulation import simulate
from swath_sysid.prediction.calibration import LEVELS, Calibrator
from swath_sysid.prediction.combination import Combiner
from swath_sysid.prediction.ekf import runge_kutta_step
from swath_sysid.prediction.excitation import ExcitationSettings, fit_table, iterate, lag_matrix
from swath_sysid.prediction.free_forecast import (
    carry_on,
    longest_horizon_step,
    mean_moments,
    mean_moments_kernel,
    mean_moments_of_arrays,
)
from swath_sysid.prediction.history import History
from swath_sysid.prediction.waves import WaveRequest, fit_waves

ROLL = hull_named('swath-roll').model


def _oscillator(count, seed=0):
    """A second-order autoregression: its best forecast is known exactly."""
    rng = np.random.default_rng(seed)
    a, b = 2 * 0.97 * math.cos(0.25), -(0.97**2)
    values = np.zeros(count)
    for k in range(2, count):
        values[k] = a * values[k - 1] + b * values[k - 2] + rng.normal()
    return values, (a, b)


def test_lags_are_newest_first():
    rows = lag_matrix(np.arange(10.0).reshape(5, 2), 2)
    assert rows.tolist()[0] == [2.0, 3.0, 0.0, 1.0]
    assert rows.shape == (4, 4)


def test_iterating_a_regression_is_applying_it_again_and_again():
    rng = np.random.default_rng(1)
    coefficients, lags = 0.3 * rng.normal(size=(6, 2)), rng.normal(size=(3, 2))
    ahead = iterate(coefficients, 3, [0, 1], 4) @ lags.ravel()
    past = list(lags)
    for k in range(1, 5):
        past.insert(0, np.concatenate(past[:3]) @ coefficients)
        assert np.allclose(ahead[k], past[0])
    assert np.allclose(ahead[0], lags[0])


def test_the_regression_reaches_the_best_forecast():
    values, (a, b) = _oscillator(6000)
    leads = np.array([0.1, 0.5, 1.0])
    table = fit_table(values[:4000, None], 0.1, [0], leads)
    errors, best = [], []
    companion = np.array([[a, b], [1.0, 0.0]])
    for k in range(4000, 5900):
        told = table.forecast(values[k - table.order + 1:k + 1, None][::-1])[:, 0]
        exact = [(np.linalg.matrix_power(companion, h) @ values[[k, k - 1]])[0] for h in (1, 5, 10)]
        truth = values[[k + 1, k + 5, k + 10]]
        errors.append(told - truth)
        best.append(exact - truth)
    assert np.all(np.std(errors, axis=0) < 1.02 * np.std(best, axis=0))
    assert table.error[:, 0] == pytest.approx(np.std(errors, axis=0), rel=0.1)


def test_gaps_in_a_window_are_left_out_and_short_windows_refused():
    values, _ = _oscillator(2000, seed=2)
    whole = fit_table(values[:, None], 0.1, [0], np.array([0.1]))
    values[[300, 900, 901]] = np.nan
    gappy = fit_table(values[:, None], 0.1, [0], np.array([0.1]))
    lags = np.linspace(-1.0, 1.0, 80)[:, None]
    assert gappy.forecast(lags[:gappy.order]) == pytest.approx(whole.forecast(lags[:whole.order]), abs=0.2)
    assert fit_table(values[:8, None], 0.1, [0], np.array([0.1])) is None
    with pytest.raises(InputError, match='folds'):
        ExcitationSettings(folds=1)


def test_the_hull_carried_on_without_moments_is_its_decay():
    time = np.arange(51) * 0.1
    angles, rates = simulate(ROLL, 0.08, -0.1, time)
    step, per_grid = longest_horizon_step(ROLL, 0.1)
    told = carry_on(ROLL, 0.08, -0.1, 0.0, np.zeros(50), step, per_grid)
    assert np.allclose(told[0], angles, atol=2e-4)
    assert np.allclose(told[1], rates, atol=5e-4)


def test_moments_found_from_motion_drive_the_hull_along_it():
    time, rng = np.arange(80) * 0.1, np.random.default_rng(3)
    moments = np.repeat(rng.normal(0.0, 0.2, 80), 1)
    step, per_grid = longest_horizon_step(ROLL, 0.1)
    angles, rates = carry_on(ROLL, 0.02, 0.0, 0.0, moments, step, per_grid)
    found = mean_moments(ROLL, angles, rates, 0.0, step, per_grid)
    assert np.abs(found - moments).max() < 0.02
    assert time.size == found.size


@pytest.mark.parametrize('hull', ['swath-roll', 'swath-pitch'])
def test_moments_found_one_by_one_are_those_found_at_once(hull):
    model, rng = hull_named(hull).model, np.random.default_rng(7)
    angles, rates = 0.1 * rng.normal(size=60), 0.3 * rng.normal(size=60)
    angles[20], rates[40], angles[55] = np.nan, np.nan, 2.0
    step, per_grid = longest_horizon_step(model, 0.2)
    at_once = mean_moments_of_arrays(model, angles, rates, model.trim + 0.01, step, per_grid)
    one_by_one = np.empty(59)
    mean_moments_kernel(
        angles, rates, model.trim + 0.01, step, per_grid, tuple(model.ratios.tolist()), model.equation.active,
        model.friction_rate, one_by_one,
    )  # fmt: skip
    assert np.allclose(one_by_one, at_once, rtol=1e-9, atol=1e-9, equal_nan=True)
    assert 50 < np.isfinite(at_once).sum() < 59


def test_a_hull_that_runs_away_is_held():
    angles, rates = carry_on(ROLL, -1.0, -30.0, 0.0, np.full(50, -500.0), 0.1, 1)
    assert np.isfinite(angles).all() and np.isfinite(rates).all()
    assert np.abs(angles).max() <= 1.5


def test_history_gives_back_any_even_grid():
    history = History(20.0, 0.009, 1)
    for k in range(5000):
        history.append(0.01 * k, [math.sin(0.01 * k)])
    back = history.back(0.1, 50, 0.01)[:, 0]
    assert np.allclose(back, np.sin(49.99 - 0.1 * np.arange(50)), atol=1e-4)
    assert len(history) <= 20.0 / 0.009 + 3
    assert history.at(np.array([45.123]), 0.006)[0, 0] == pytest.approx(math.sin(45.123), abs=1e-4)


def test_history_knows_its_gaps():
    history = History(20.0, 0.009, 1)
    for k in (*range(100), *range(150, 200)):
        history.append(0.1 * k, [float(k)])
    back = history.back(0.1, 120, 0.1)[:, 0]
    assert np.isfinite(back[:50]).all() and np.isnan(back[52:98]).all() and np.isfinite(back[101:]).all()


def test_a_very_fast_sensor_needs_no_more_memory():
    history = History(5.0, 0.009, 1)
    for k in range(20000):
        history.append(0.001 * k, [float(k)])
    assert history.time[-1] == pytest.approx(19.999)
    assert len(history) <= 5.0 / 0.009 + 3


def test_weights_become_the_best_convex_ones():
    rng = np.random.default_rng(4)
    mixing = np.array([[1.0, 0.0, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 3.0]])
    combiner = Combiner(1, 1, 3, 1e4, np.array([1.0]))
    for _ in range(4000):
        combiner.learn((mixing @ rng.normal(size=3))[None, None], 0.1)
        weights, variance = combiner.follow(np.ones((1, 1, 3)))
    covariance = mixing @ mixing.T
    grid = [(a, b, 1 - a - b) for a in np.linspace(0, 1, 101) for b in np.linspace(0, 1 - a, 101)]
    best = min(np.array(w) @ covariance @ w for w in grid)
    w = weights[0, 0]
    assert w.sum() == pytest.approx(1.0) and w.min() >= 0.0
    assert w @ covariance @ w < 1.03 * best
    assert variance[0, 0] == pytest.approx(best, rel=0.1)


def test_an_expert_without_a_forecast_has_no_weight():
    combiner = Combiner(1, 1, 2, 100.0, np.array([1.0]))
    weights, _ = combiner.follow(np.array([[[1.0, np.nan]]]))
    assert weights.tolist() == [[[1.0, 0.0]]]
    weights, _ = combiner.follow(np.array([[[1.0, 0.01]]]))
    assert weights[0, 0, 1] > 0.9


@pytest.mark.parametrize('distribution', ['normal', 'cauchy', 'shrinking'])
def test_calibrated_intervals_hold_what_they_say(distribution):
    rng = np.random.default_rng(5)
    calibrator, held = Calibrator((1,)), []
    for k in range(6000):
        scale = {'normal': 1.0, 'cauchy': 1.0, 'shrinking': math.exp(-k / 2000.0)}[distribution]
        error = scale * (rng.standard_cauchy() if distribution == 'cauchy' else rng.normal())
        issued = calibrator.quantiles
        held.append(abs(error) <= issued[0])
        calibrator.learn(np.array([error]), issued, 0.1)
    assert np.mean(held, axis=0) == pytest.approx(LEVELS, abs=0.02)


def test_calibration_follows_a_change_within_a_minute():
    rng, calibrator = np.random.default_rng(6), Calibrator((1,))
    held = []
    for k in range(1200):
        issued = calibrator.quantiles
        error = (1.0 if k < 600 else 4.0) * rng.normal()
        held.append(abs(error) <= issued[0, 1])
        calibrator.learn(np.array([error]), issued, 0.5)
    assert np.mean(held[720:]) == pytest.approx(0.9, abs=0.03)


def _driven(duration=120.0, dt=0.1, seed=0):
    rng = np.random.default_rng(seed)
    frequency = np.sort(rng.uniform(1.2, 5.0, 200))
    spectrum = frequency**-5 * np.exp(-1.25 * (2.0 / frequency) ** 4)
    amplitude = 0.2 * np.sqrt(2.0 * spectrum / spectrum.sum())
    phase = rng.uniform(0.0, 2.0 * math.pi, 200)
    count, fine = int(duration / dt), 4
    state, rows = (0.0, 0.0), []
    for k in range(count):
        rows.append(state)
        for j in range(fine):
            moment = (amplitude * np.cos(frequency * (k + (j + 0.5) / fine) * dt + phase)).sum()
            state = runge_kutta_step(ROLL.acceleration, *state, moment, dt / fine)
    return np.array(rows, dtype=float)


def test_a_window_of_one_axis_gives_its_motion_and_its_moments():
    motion = _driven()
    values = np.full((motion.shape[0], 7), np.nan)
    values[:, 0], values[:, 2] = motion[:, 0], motion[:, 1]
    request = WaveRequest(0.0, 0.1, values, np.array([0.1, 1.0]), {'roll': ROLL}, {'roll': 0.0})
    fit = fit_waves(request)
    assert fit.channels == (0, 2) and fit.targets == (0, 2)
    assert set(fit.hulls) == {'roll'}
    lags = values[::-1][:fit.reach + 1]
    assert fit.motion_ahead(lags)[0].shape == (2,)
    assert fit.moments_ahead(lags, {'roll': 0.0}).shape == (10, 1)
    assert fit.motion_ahead(lags[:2]) == {}
    again = fit_waves(request)
    assert np.array_equal(fit.motion.matrix, again.motion.matrix)
