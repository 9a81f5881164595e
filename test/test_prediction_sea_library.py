"""The library of seas against Gaussian processes solved one by one, and what must not change a forecast."""

from threading import Thread

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import cho_factor, cho_solve

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction import sea_library
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.memories import LEAST_SIZE
from swath_sysid.attitude.prediction.sea_library import TEMPER, Predictors, SeaLibrary, seas
from swath_sysid.pipeline.record_run import run_through

STEPS = np.array([1, 2, 5, 11])


def _waves(count, step, period, seed=0, size=0.1):
    """Roll, pitch and their rates (N, 4) of three sines with nearly the period, s."""
    rng, time = np.random.default_rng(seed), step * np.arange(count)
    w = 2.0 * np.pi / period * rng.uniform(0.8, 1.25, (2, 3, 1))
    phase = w * time + rng.uniform(0.0, 6.3, (2, 3, 1))
    return size * np.vstack([np.sin(phase).sum(axis=1), (w * np.cos(phase)).sum(axis=1)]).T


def _followed(rows, step=0.2, period=3.0, furthest=11):
    library = SeaLibrary(step, period, step * (furthest + 2))
    for row in rows:
        library.take(row)
    return library


def _process(member, shape, ahead, rows):
    """Unit covariance of so many (rows, readings) and with angle and rate ``ahead`` rows after the newest.

    From the lines of the spectrum as a linear combination of independent unit sines and cosines.
    """
    sea, (count, kinds) = seas(), shape
    times, kinds = np.repeat(np.arange(count), kinds), np.tile(np.arange(kinds), count)
    w, root = 2.0 * np.pi * sea.frequency / rows, np.sqrt(sea.power[member])

    def features(time, kind):
        lines = np.concatenate([np.cos(w * time), np.sin(w * time)])
        if kind:
            lines = np.concatenate([-np.sin(w * time), np.cos(w * time)]) * np.tile(sea.frequency, 2)
        return np.append(np.tile(root, 2) * lines, 0.0 if kind else np.sqrt(sea.level[member]))

    read = np.array([features(time, kind) for time, kind in zip(times, kinds, strict=True)])
    wanted = np.array([features(count - 1.0 + ahead, kind) for kind in (0, 1)])
    own = np.array([1.0, np.sum((sea.frequency * root) ** 2)])
    noise = sea.noise[member] * own
    return read @ read.T + np.diag(noise[kinds]), read @ wanted.T, wanted @ wanted.T + np.diag(noise)


@pytest.mark.parametrize(('step', 'count'), [(0.2, 9), (0.05, 24)])
@pytest.mark.parametrize('rated', [False, True])
def test_it_is_the_mixture_of_processes_weighted_by_the_likelihood_of_all_rows(rated, step, count, monkeypatch):
    """Each process is solved by Cholesky's method; the size's part of the likelihood is its maximum over sizes.

    Rows of every stride have a process of their own, and count as one.
    """
    monkeypatch.setattr(sea_library, 'NEGLIGIBLE', 0.0)
    rows = _waves(count, step, 3.0)
    rows[:, 2:] = rows[:, 2:] if rated else np.nan
    lead = 4
    library = _followed(rows, step, furthest=8)
    a_period, unit, stride = library._rows, library._unit, library._stride
    assert stride == round(0.2 / step)
    values = np.column_stack([rows[:, 0], rows[:, 2] * unit])[:, : 2 if rated else 1]
    size, score, means, covariances = [], [], [], []
    for member in range(sea_library.MEMBERS):
        square, log, known = LEAST_SIZE**2, 0.0, 2.0
        for first in range(stride):
            own = values[first::stride]
            factor = np.linalg.cholesky(_process(member, own.shape, 0.0, a_period)[0])
            # the innovations of the readings, each in units of its deviation
            white = np.linalg.solve(factor, own.ravel()).reshape(own.shape)
            square += (white**2).sum() / stride
            log -= np.log(np.diag(factor)).sum() / stride
            known += own.size / stride
        own = values[(count - 1) % stride :: stride]
        gram, across, wanted = _process(member, own.shape, lead / stride, a_period)
        factor = cho_factor(gram, lower=True)
        size.append(square / known)
        score.append(log - 0.5 * known * np.log(size[-1]))
        means.append(across.T @ cho_solve(factor, own.ravel()))
        covariances.append(wanted - across.T @ cho_solve(factor, across))
    weight = np.exp(TEMPER * (np.array(score) - max(score)))
    weight /= weight.sum()
    mean = weight @ np.array(means)
    apart = np.array(means) - mean
    covariance = np.einsum('m,m,mpq->pq', weight, size, covariances) + np.einsum('m,mp,mq->pq', weight, apart, apart)
    ours, spread = library.ahead(np.array([1, lead, 8]))
    per_unit = np.diag([1.0, 1.0 / unit])
    assert ours[1, ::2] == pytest.approx(per_unit @ mean, rel=1e-6)
    assert spread[1, ::2, ::2] == pytest.approx(per_unit @ covariance @ per_unit, rel=1e-6)


@settings(max_examples=10, deadline=None)
@given(
    factor=st.sampled_from([0.1, 4.0]),
    sign=st.sampled_from([-1.0, 1.0]),
    unit=st.floats(0.5, 20.0),
    seed=st.integers(0, 9),
)
def test_time_sign_and_unit_change_nothing_else(factor, sign, unit, seed):
    rows = _waves(30, 0.2, 3.0, seed)
    mean, covariance = _followed(rows).ahead(np.array([0.35, 1.05]) / 0.2)
    other = unit * sign * rows / [1.0, 1.0, factor, factor]
    same, spread = _followed(other, factor * 0.2, factor * 3.0).ahead(np.array([0.35, 1.05]) / 0.2)
    per_unit = unit * sign / np.array([1.0, 1.0, factor, factor])
    # a craft at rest has a size, whatever the unit
    assert same == pytest.approx(mean * per_unit, rel=1e-3, abs=1e-4 * unit)
    assert spread == pytest.approx(covariance * np.outer(per_unit, per_unit), rel=1e-2, abs=1e-12)


@pytest.mark.parametrize(('step', 'count'), [(0.05, 240), (0.1, 120), (0.2, 60), (0.5, 24)])
def test_four_periods_show_the_waves_at_any_rate_of_rows(step, count):
    """Two waves of which the past shows all; from 60 to 5 rows a period, with and without rates."""
    leads, fine = np.array([0.4, 0.8]), round(step / 0.05)
    motion = np.column_stack([_waves((count + 20) * fine, 0.05, 3.0, seed)[:, [0, 2]] for seed in (1, 2)])
    motion = motion[:, [0, 2, 1, 3]]
    rows, size = motion[::fine], motion[:, :2].std(axis=0)
    truth = motion[(count - 1) * fine + np.round(leads / 0.05).astype(int), :2]
    for known in (rows, np.where([True, True, False, False], rows, np.nan)):
        library = _followed(known[:count], step, furthest=round(1.0 / step))
        mean, covariance = library.ahead(leads / step)
        error = np.abs(mean[:, :2] - truth)
        assert (error / size < [[0.25], [0.5]]).all()
        assert (error < 4.0 * np.sqrt(covariance[:, [0, 1], [0, 1]])).all()


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 999), count=st.integers(1, 40), level=st.sampled_from([0.0, 1.0]), noise=st.floats(0.0, 0.001)
)
def test_no_forecast_is_wilder_than_the_motion(seed, count, level, noise):
    """With noise as members have it, the deviation is within three times the size, or the present displacement."""
    rng = np.random.default_rng(seed)
    rows = _waves(count, 0.2, 3.0, seed, 0.05) + rng.normal(0.0, 1.0, (count, 4)) * noise * [1.0, 1.0, 2.0, 2.0]
    rows[:, :2] += level
    library = _followed(rows)
    mean, covariance = library.ahead(np.arange(1.0, 60.0, 2.0))
    size = np.maximum(np.sqrt((rows[:, :2] ** 2).mean(axis=0) + (rows[:, 2:] * 0.5) ** 2), np.abs(rows[-1, :2])).max(
        axis=0
    )
    assert (np.sqrt(covariance[:, [0, 1], [0, 1]]) < 3.0 * size).all()
    assert (np.abs(mean[:, :2]) < 3.0 * size).all()
    assert (np.linalg.eigvalsh(covariance) > -1e-12).all()


def test_lost_rows_widen_the_forecast_and_what_was_learnt_stays():
    rows = _waves(60, 0.2, 3.0)
    library, other = _followed(rows[:40]), _followed(rows[:40])
    before = library.ahead(STEPS)
    library.predict(5)
    assert np.isnan(library.ahead(STEPS)[0]).all()
    for row in rows[45:50]:
        library.take(row)
    after, anew = library.ahead(STEPS), _followed(rows[45:50]).ahead(STEPS)
    assert (before[1][:, 0, 0] <= 1.1 * after[1][:, 0, 0]).all()
    assert after[1][0, 0, 0] < anew[1][0, 0, 0]
    missing = rows[40].copy()
    missing[1] = np.nan
    other.take(missing)
    mean, _ = other.ahead(STEPS)
    assert np.isfinite(mean[:, ::2]).all() and np.isnan(mean[:, 1::2]).all()


@pytest.mark.parametrize('rate', [1.0, 10.0])
@pytest.mark.parametrize('names', [('roll', 'pitch'), ('roll', 'pitch', 'roll_rate', 'pitch_rate')])
def test_the_second_sample_of_a_stream_and_of_one_after_a_break_has_a_forecast(rate, names):
    period = 3.0 if rate > 1.0 else 12.0
    rows = _waves(80, 1.0 / rate, period)
    columns = dict(zip(('roll', 'pitch', 'roll_rate', 'pitch_rate'), rows.T, strict=True))
    time = np.arange(80) / rate + np.where(np.arange(80) < 40, 0.0, 100.0 * period)
    trial = Trial(time, **{name: columns[name] for name in names})
    lead = period / 20.0
    steps = run_through(trial, ForecasterSettings((lead,), horizon=lead, horizon_step=lead, forecast_rate=rate)).steps
    stamps = np.array([step.stamp for step in steps])
    second = steps[0].forecast
    assert stamps[0] == time[1] and np.isfinite(second.mean[:, :2]).all()
    again = steps[int(np.argmax(stamps > time[40]))].forecast
    assert np.isfinite(again.mean[:, :2]).all()
    assert (again.deviation[:, :2] < 3.0 * rows[:, :2].std(axis=0) + np.abs(rows[41, :2])).all()


@pytest.mark.parametrize('period', [3.0, 12.0])
def test_four_memories_after_waves_have_faded_the_forecast_is_as_sure_as_if_they_had_always_been_small(period):
    """To a third within six periods; of nine times the variance, a sixth of one is left."""
    step = period / 15.0
    memory = round(sea_library.LIFETIME * 15.0)
    time = step * (np.arange(5 * memory + 90) - memory)
    part = np.clip(time / (6.0 * period), 0.0, 1.0)
    envelope = 1.0 - np.sin(0.5 * np.pi * part) ** 2 * 2.0 / 3.0
    slope = -np.pi / (18.0 * period) * np.sin(np.pi * part)
    waves = _waves(time.size, step, period)
    faded = waves * envelope[:, None]
    faded[:, 2:] += slope[:, None] * waves[:, :2]
    noise = np.random.default_rng(0).normal(0.0, 0.001, waves.shape) * [1.0, 1.0, 6.0 / period, 6.0 / period]
    sizes = []
    for rows in (faded + noise, waves / 3.0 + noise):
        _, covariance = _followed(rows, step, period).ahead(STEPS)
        sizes.append(np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)))
    assert (sizes[0] < 1.1 * sizes[1]).all() and (sizes[0] > 0.9 * sizes[1]).all()


def test_forecasters_in_two_threads_share_their_predictors():
    """As while a node that forecasts already loads its kernels, which shared the first rows of the same seas."""
    alone, shared, count = Predictors(32.0, True), Predictors(32.0, True), 30
    alone.whiten(count)
    threads = [Thread(target=lambda: [shared.whiten(k + 1) for k in range(count)]) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(shared.white[:, :count], alone.white[:, :count])
