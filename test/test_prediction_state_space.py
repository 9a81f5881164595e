"""The state space in innovations form against filterpy's Kalman filter, closed forms and long pasts."""

from copy import deepcopy

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag, solve_discrete_lyapunov

from swath_sysid.attitude.prediction.candidate import OnRows
from swath_sysid.attitude.prediction.state_space import (
    BREAK,
    InnovationsFilter,
    InnovationsModel,
    cubic_weights,
    side_by_side,
)

STEP = 0.1


def _model(seed=0, states=4, channels=('roll', 'pitch', 'heave'), places=None):
    rng = np.random.default_rng(seed)
    count = len(channels)
    c = rng.normal(size=(count, states))
    closed = rng.normal(size=(states, states))
    closed *= 0.8 / np.abs(np.linalg.eigvals(closed)).max()
    k = 0.1 * rng.normal(size=(states, count))
    a = closed + k @ c
    if np.abs(np.linalg.eigvals(a)).max() > 0.97:
        return _model(seed + 100, states, channels, places)
    root = rng.normal(size=(count, count))
    s = root @ root.T + 0.1 * np.eye(count)
    prior = solve_discrete_lyapunov(a, k @ s @ k.T)
    mean, scale = rng.normal(size=count), rng.uniform(0.5, 2.0, count)
    return InnovationsModel(channels, places or tuple(range(count)), STEP, mean, scale, a, k, c, s, prior)


def _filter(model, rows=None, targets=None, horizon=1.0):
    ours = InnovationsFilter(model, targets or model.channels, horizon)
    if rows is not None:
        ours.seed(rows)
    return ours


def _rows(model, count, seed=1):
    rng = np.random.default_rng(seed)
    root, x = np.linalg.cholesky(model.s), np.zeros(model.a.shape[0])
    rows = []
    for _ in range(count):
        e = root @ rng.normal(size=len(model.channels))
        rows.append(model.mean + model.scale * (model.c @ x + e))
        x = model.a @ x + model.k @ e
    return np.array(rows)


class Oracle:
    """The same system with the innovation as part of the state, so that filterpy's noises are independent."""

    def __init__(self, model):
        states, count = model.k.shape
        self.model = model
        self.kf = KalmanFilter(dim_x=states + count, dim_z=count)
        self.kf.F = np.block([[model.a, model.k], [np.zeros((count, states + count))]])
        self.kf.Q = block_diag(np.zeros((states, states)), model.s)
        self.kf.x = np.zeros((states + count, 1))
        self.kf.P = block_diag(model.prior, model.s)
        self.h = np.hstack([model.c, np.eye(count)])

    def step(self, row):
        z = (row - self.model.mean) / self.model.scale
        seen = np.isfinite(z)
        if seen.any():
            noise = 1e-12 * np.eye(seen.sum())
            self.kf.dim_z = int(seen.sum())
            self.kf._I = np.eye(self.kf.dim_x)
            self.kf.update(z[seen][:, None], R=noise, H=self.h[seen])
        self.kf.predict()

    def ahead(self, steps):
        x, p = self.kf.x.copy(), self.kf.P.copy()
        for _ in range(steps - 1):
            x, p = self.kf.F @ x, self.kf.F @ p @ self.kf.F.T + self.kf.Q
        unit = np.diag(self.model.scale)
        return self.model.mean + self.model.scale * (self.h @ x)[:, 0], unit @ self.h @ p @ self.h.T @ unit


@settings(max_examples=25)
@given(seed=st.integers(0, 50), lost=st.floats(0.0, 0.6))
def test_lost_channels_and_samples_are_filterpys_kalman_update(seed, lost):
    model = _model(seed)
    rows = _rows(model, 60, seed)
    rows[np.random.default_rng(seed).uniform(size=rows.shape) < lost] = np.nan
    ours, oracle = _filter(model), Oracle(model)
    for row in rows:
        ours.take(row)
        oracle.step(row)
    means, covariances = ours.ahead(np.array([1, 5, 10]))
    for steps, mean, covariance in zip((1, 5, 10), means, covariances, strict=True):
        wanted = oracle.ahead(steps)
        # a state that is nearly known is taken as known
        assert mean == pytest.approx(wanted[0], abs=0.05)
        assert covariance == pytest.approx(wanted[1], rel=2e-3, abs=1e-3)


def test_a_forecast_while_nothing_comes_grows_to_the_motions_own_spread():
    model, spread = _model(3), []
    ours = _filter(model, _rows(model, 300))
    for _ in range(400):
        ours.take(np.full(3, np.nan))
        spread.append(np.diagonal(ours.ahead([1])[1][0]))
    assert spread[-1] == pytest.approx(model.scale**2 * np.diag(model.c @ model.prior @ model.c.T + model.s), rel=1e-6)
    assert (np.diff(spread, axis=0) > -1e-9).all()
    assert ours.ahead([5])[0][0] == pytest.approx(model.mean, abs=1e-4)


def test_after_complete_rows_the_state_is_known_again_and_a_break_in_the_motion_voids_the_past():
    model = _model(5)
    rows = _rows(model, 300)
    lost, jump = rows.copy(), rows.copy()
    lost[100:120] = np.nan
    broken, whole = _filter(model, lost), _filter(model, rows)
    assert broken.state_covariance is None and whole.state_covariance is None
    assert broken.ahead([5])[0] == pytest.approx(whole.ahead([5])[0], abs=1e-3)
    jump[200:] += 100.0 * model.scale
    ours, fresh = _filter(model, jump[:201]), _filter(model, jump[200:201])
    assert ours.ahead([5])[0] == pytest.approx(fresh.ahead([5])[0])
    assert ours.state_covariance is not None


def test_between_whole_steps_a_forecast_is_smooth():
    assert cubic_weights(np.array([0.0, 1.0])).tolist() == [[0, 1, 0, 0], [0, 0, 1, 0]]
    part = np.linspace(0.0, 1.0, 7)
    cubic = np.poly1d([0.3, -1.0, 2.0, 0.5])
    assert cubic_weights(part) @ cubic(np.arange(-1, 3)) == pytest.approx(cubic(part))


def test_age_is_added_to_the_lead_and_a_rate_is_the_difference_of_an_angle_that_has_none():
    """Of a known oscillation, whose rate is the derivative of the angle."""
    w = 2 * np.pi
    turn = np.array([[np.cos(w * STEP), np.sin(w * STEP)], [-np.sin(w * STEP), np.cos(w * STEP)]])
    gain, c = turn @ np.array([[0.5], [0.1]]), np.array([[1.0, 0.0]])
    model = InnovationsModel(('roll',), (0,), STEP, np.zeros(1), np.ones(1), turn, gain, c, 1e-6 * np.eye(1), np.eye(2))
    time = np.arange(0.0, 20.0, STEP)
    ours = _filter(model, np.sin(w * time)[:, None], ('roll', 'roll_rate', 'yaw'))
    leads, age = np.array([0.0, 0.3, 0.8]), 0.03
    mean, covariance = ours.ahead((leads + age) / STEP)
    then = time[-1] + age + leads
    assert mean[:, 0] == pytest.approx(np.sin(w * then), abs=0.003)
    assert mean[:, 1] == pytest.approx(w * np.cos(w * then), abs=0.04 * w)
    assert np.isnan(mean[:, 2]).all()
    assert np.isnan(covariance[:, 2]).all() and np.isfinite(covariance[:, :2, :2]).all()


@settings(max_examples=20)
@given(st.lists(st.integers(1, 9), min_size=1, max_size=12), st.integers(2, 4))
def test_a_filter_on_every_so_many_rows_is_one_of_these_rows_alone(gaps, every):
    """Whichever rows are missing, and between the rows that it uses too."""
    model = _model()
    rows, plain = _rows(model, 200), _filter(model, horizon=2.0)
    plain.seed(rows[99 % every : 100 : every])
    ours = OnRows(deepcopy(plain), every)
    number = used = 99
    for gap in gaps:
        ours.predict(gap - 1)
        ours.take(rows[number + gap])
        # rows before this one, counted from the newest of the seed
        for place in range(number + 1, number + gap + 1):
            if (place - 99) % every == 0:
                plain.take(rows[place] if place == number + gap else np.full(3, np.nan))
                used = place
        number += gap
        for asked in (np.array([1.0, 3.3, 8.0]), np.array([1, 3, 8])):
            for found, wanted in zip(ours.ahead(asked), plain.ahead((asked + number - used) / every), strict=True):
                np.testing.assert_allclose(found, wanted, rtol=1e-7, atol=1e-9)
        assert ours.space.nis == plain.nis


def test_the_rates_covariance_is_that_of_the_difference():
    """Against simulated futures of one system, from the same state."""
    model = _model(6, channels=('roll',), states=3)
    ours = _filter(model, _rows(model, 300), ('roll', 'roll_rate'))
    mean, covariance = ours.ahead([5])
    rng, path, state = np.random.default_rng(0), [], np.tile(ours.state, (40000, 1))
    for _ in range(7):
        e = np.sqrt(model.s[0, 0]) * rng.normal(size=(40000, 1))
        path.append(model.mean + model.scale * (state @ model.c.T + e))
        state = state @ model.a.T + e @ model.k.T
    path = np.array(path)[..., 0]
    rate = (path[2] - 8 * path[3] + 8 * path[5] - path[6]) / (12 * STEP)
    sample = np.cov(path[4], rate)
    assert covariance[0] == pytest.approx(sample, rel=0.05, abs=0.03 * sample.max())
    assert mean[0] == pytest.approx([path[4].mean(), rate.mean()], abs=0.1)


def test_models_side_by_side_forecast_as_they_do_alone():
    first, second = _model(8, channels=('roll',), places=(1,)), _model(9, channels=('pitch', 'heave'), places=(2, 0))
    both = side_by_side([first, second])
    rows = np.random.default_rng(2).normal(size=(80, 3))
    rows[40:45, 1] = np.nan
    filters = (_filter(model, rows, ('roll', 'pitch', 'heave')) for model in (first, second, both))
    one, two, whole = (each.ahead([3])[0][0] for each in filters)
    assert whole == pytest.approx([one[0], two[1], two[2]], abs=1e-6)
    assert both.from_lags is None


@pytest.mark.long
@settings(max_examples=25)
@given(st.integers(0, 1000))
def test_covariances_stay_those_of_something(seed):
    rng = np.random.default_rng(seed)
    model = _model(seed % 20)
    rows = _rows(model, 100, seed)
    rows[rng.uniform(size=rows.shape) < 0.3] = np.nan
    ours = InnovationsFilter(model, (*model.channels, 'roll_rate'), 2.0)
    for row in rows:
        ours.take(row)
        if rng.uniform() < 0.1:
            OnRows(ours).predict(int(rng.integers(0, 700)))
            covariance = ours.ahead(rng.uniform(1.5, 19.5, 3))[1]
            assert np.allclose(covariance, covariance.transpose(0, 2, 1), rtol=1e-9, atol=1e-9)
            assert np.linalg.eigvalsh(covariance).min() > -1e-7 * covariance.max()


@pytest.mark.parametrize('every', [1, 2])
def test_a_break_in_the_motion_is_forgotten_though_a_channel_comes_with_every_other_row(every):
    """Strain is what issued intervals are widened by: it must not stand still while the state is not fully known."""
    model = _model()
    rows = _rows(model, 400)
    rows[100:102] += 200.0 * model.scale
    rows[np.arange(400) % every > 0, 1] = np.nan
    ours = _filter(model, rows[:102])
    assert ours.nis > BREAK
    for row in rows[102:]:
        ours.take(row)
    assert 0.3 < ours.nis < 3.0


@pytest.mark.parametrize('turn', [30.0, -30.0])
def test_a_channel_beyond_what_was_learnt_of_it_tells_the_targets_nothing(turn):
    """Such as the yaw rate of a model from a straight course, once the craft turns."""
    model = _model(6)
    rows = _rows(model, 300)
    turning, without = rows.copy(), rows.copy()
    turning[250:, 2] += turn * model.scale[2] * np.minimum(0.05 * np.arange(1, 51), 1.0)
    beyond = np.abs(turning[:, 2] - model.mean[2]) > 5.0 * model.scale[2]
    without[250:, 2] = np.where(beyond[250:], np.nan, turning[250:, 2])
    turned, unseen = (_filter(model, each, targets=('roll', 'pitch')) for each in (turning, without))
    assert beyond[260:].all()
    for ours, wanted in zip(turned.ahead([1, 5]), unseen.ahead([1, 5]), strict=True):
        assert ours.tolist() == wanted.tolist()
