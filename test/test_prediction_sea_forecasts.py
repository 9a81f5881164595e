"""Forecasts in a JONSWAP sea, beside the filter that knows hull, noise and spectrum."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from scipy.integrate import solve_ivp
from scipy.linalg import companion

_PLACE = Path(__file__).resolve().parents[1] / 'benchmark' / 'sea_forecasts.py'


@pytest.fixture(scope='module')
def sea_forecasts():
    """The benchmark, as a module."""
    spec = importlib.util.spec_from_file_location(_PLACE.stem, _PLACE)
    module = importlib.util.module_from_spec(spec)
    # a frozen dataclass looks its module up
    sys.modules[_PLACE.stem] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[_PLACE.stem]


def test_the_shaping_filter_has_the_spectrum_of_the_excitation(sea_forecasts):
    sea = sea_forecasts.make_sea(1, 60.0)
    coefficients, noise, covariance = sea_forecasts.shaping_filter(sea)
    assert covariance[1:] @ coefficients + noise == pytest.approx(covariance[0], rel=1e-6)
    again = [covariance[abs(k - np.arange(1, sea_forecasts.ORDER + 1))] @ coefficients for k in (1, 10, 40)]
    assert again == pytest.approx(covariance[[1, 10, 40]], abs=1e-5 * covariance[0])


def test_the_same_sea_is_read_at_any_rate(sea_forecasts):
    sea = sea_forecasts.make_sea(1, 60.0)
    assert np.array_equal(sea.readings(10.0), sea.readings(100.0)[::10])
    assert sea.angle.std() == pytest.approx(sea_forecasts.SIZE, rel=2e-3)
    assert sea.angle_at(np.array([0.1, 59.99, 60.0])) == pytest.approx([*sea.angle[[10, -1]], np.nan], nan_ok=True)
    with pytest.raises(ValueError, match='not a multiple'):
        sea.readings(30.0)


def test_the_hull_is_carried_on_as_an_ode_solver_does(sea_forecasts):
    hull, moment = sea_forecasts.HULL, 0.4
    right = solve_ivp(
        lambda _, y: [y[1], hull.acceleration(y[0], y[1], moment)],
        (0.0, sea_forecasts.STEP),
        [0.05, -0.2],
        rtol=1e-10,
        atol=1e-12,
    ).y[:, -1]
    assert sea_forecasts.advance(0.05, -0.2, moment) == pytest.approx(right, abs=1e-6)


def test_the_oracle_is_an_extended_kalman_filter_on_hull_and_autoregression(sea_forecasts, monkeypatch):
    monkeypatch.setattr(sea_forecasts, 'ORDER', 12)
    sea, leads = sea_forecasts.make_sea(3, 30.0), (0.1, 0.7)
    coefficients, noise, covariance = sea_forecasts.shaping_filter(sea)
    ekf = ExtendedKalmanFilter(dim_x=14, dim_z=2)
    shift = companion(np.append(1.0, -coefficients))
    ekf.P[:] = 0.0
    ekf.P[:2, :2], ekf.P[2:, 2:] = 1e-2 * np.eye(2), covariance[abs(np.subtract.outer(range(12), range(12)))]
    ekf.R = np.diag([sea_forecasts.ANGLE_NOISE**2, sea_forecasts.RATE_NOISE**2])
    ekf.Q = np.zeros((14, 14))
    ekf.Q[2, 2] = noise

    def following(state):
        return np.concatenate([sea_forecasts.advance(*state[:3]), shift @ state[2:]])

    told = []
    for seen in sea.readings(10.0):
        ekf.update(seen[:, None], lambda x: np.eye(2, 14), lambda x: x[:2])
        now = ekf.x[:, 0]
        ahead = [now]
        for _ in range(7):
            ahead.append(following(ahead[-1]))
        told.append([ahead[1][0], ahead[7][0]])
        ekf.F = np.column_stack([(following(now + d) - following(now - d)) / 2e-5 for d in 1e-5 * np.eye(14)])
        ekf.x = following(now)[:, None]
        ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
    assert sea_forecasts.oracle(sea, leads) == pytest.approx(np.array(told), abs=1e-8)


def test_a_hull_off_by_factors_is_off_in_these_terms_only(sea_forecasts):
    right = sea_forecasts.HULL.terms
    wrong = sea_forecasts.hull_off_by(stiffness=1.15, quadratic_damping=1.5).terms
    ratios = {name: wrong[name] / value for name, value in right.items()}
    assert ratios == pytest.approx({'b1': 1.0, 'b2': 1.5, 'b3': 1.0, 's1': 1.15, 's2': 1.15})


@pytest.mark.long
@pytest.mark.slow
def test_forecasts_in_a_sea_come_near_those_of_the_filter_that_knows_everything(sea_forecasts):
    leads = 0.5, 2.0, 5.0
    sea, nrmse, coverage = sea_forecasts.compare(2, 200.0, 100.0, leads)
    ours, best = nrmse['10 Hz'], nrmse['oracle']
    assert np.abs(sea.angle).max() < 0.12
    assert np.all(best < 1.03) and np.all(best[:2] < ours[:2])
    assert np.all(ours < 1.3 * best) and np.all(ours < 1.03)
    assert np.all(best[:2] < np.min([nrmse[name][:2] for name in ('ar_40', 'var_40', 'var_60')], axis=0))
    assert np.all(np.abs(coverage['10 Hz'] - 0.9) < 0.06)
