"""Baselines: against closed forms and plain least squares, and blind to the future."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.errors import InputError
from swath_sysid.evaluation.baselines import (
    BASELINES,
    EVEN,
    REFIT_INTERVAL,
    Record,
    baseline_forecasts,
    running_regression,
)

LEADS = np.array([0.1, 0.5, 1.0])


def record_of(step=0.1, **channels):
    count = next(iter(channels.values())).size
    return Record.of(Trial(step * np.arange(count), **channels))


def coupled_sea(count, seed=0):
    rng = np.random.default_rng(seed)
    matrix = np.array([[0.9, 0.3, 0.0], [-0.3, 0.9, 0.1], [0.0, 0.2, 0.5]])
    values = np.zeros((count, 3))
    for k in range(1, count):
        values[k] = matrix @ values[k - 1] + 0.01 * rng.normal(size=3)
    return matrix, values


def test_a_record_is_read_between_its_samples_but_not_across_what_is_missing_which_is_known_for_some_time():
    time = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 6.0, 7.0])
    record = Record.of(Trial(time, roll=np.array([0.0, 2.0, np.nan, 6.0, 10.0, 12.0, 14.0]), pitch=time))
    wanted = np.array([-0.5, 0.0, 0.25, 1.0, 1.5, 3.0, 4.0, 5.0, 6.75, 7.0, 7.5])
    known = [np.nan, 0.0, 0.5, 2.0, np.nan, 6.0, np.nan, 10.0, 13.5, 14.0, np.nan]
    assert np.allclose(record.at(wanted)[:, 0], known, equal_nan=True)
    assert record.at(np.array([1.5]), [1]) == pytest.approx(np.array([[1.5]]))
    assert record.interval == pytest.approx(1.0)
    # so near to a sample a time is the sample's
    assert np.allclose(record.at(np.array([5.985, 6.015, 5.972, 6.028]))[:, 0], [12.0, 12.0, 11.944, 12.056])
    time = np.array([0.0, 1.0, 2.0, 5.0, 6.0, 7.0, 8.0, 9.0])
    record = Record.of(Trial(time, roll=time, pitch=np.where((time == 0.0) | (time == 7.0), np.nan, time)))
    assert record.after_gap('roll', np.array([*time, 2.5]), 2.0).tolist() == [0, 0, 0, 1, 1, 1, 0, 0, 1]
    assert record.after_gap('pitch', time, 0.5).tolist() == [0, 0, 0, 1, 0, 1, 1, 0]


def test_stamps_that_jump_by_years_are_refused_before_a_grid_is_made_of_them():
    time = np.arange(40.0) + np.where(np.arange(40) > 20, 1e9, 0.0)
    with pytest.raises(InputError, match=r'jump by 1e\+09 s after t = 20 s.*cut the record there'):
        baseline_forecasts(Record.of(Trial(time, roll=np.sin(time))), ['roll'], time, LEADS, 60.0)


def test_simple_forecasts_are_what_their_names_say():
    roll = np.array([np.nan, 0.0, 1.0, np.nan, 4.0, 4.0, 4.0, 4.0])
    record = record_of(roll=roll)
    found = baseline_forecasts(record, ['roll'], record.time, LEADS, window=0.35)['roll']
    assert set(found) == set(BASELINES) and np.isnan(found['var_40']).all()
    newest = np.array([np.nan, 0.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0])
    rate = np.array([np.nan, np.nan, 10.0, 10.0, 15.0, 0.0, 0.0, 0.0])
    means = np.array([np.nan, 0.0, 0.5, 0.5, 5.0 / 3.0, 3.0, 4.0, 4.0])
    assert np.allclose(found['persistence'], newest[:, None] * np.ones(3), equal_nan=True)
    assert np.allclose(found['constant_rate'], newest[:, None] + rate[:, None] * LEADS, equal_nan=True)
    assert np.allclose(found['mean'], means[:, None] * np.ones(3), equal_nan=True)
    measured = record_of(roll=np.arange(20.0), roll_rate=np.full(20, 3.0))
    found = baseline_forecasts(measured, ['roll'], measured.time[5:6], LEADS, 60.0)['roll']['constant_rate']
    assert found == pytest.approx(np.array([5.0 + 3.0 * LEADS]))


def test_a_regression_of_a_known_process_forecasts_with_the_powers_of_its_matrix():
    matrix, values = coupled_sea(20_000)
    record = record_of(roll=values[:, 0], pitch=values[:, 1], roll_rate=values[:, 2])
    stamps = record.time[-200:]
    found = running_regression(record, (0, 1, 2), (0, 1), 2, stamps, LEADS, 2000.0)
    for i, steps in enumerate((1, 5, 10)):
        right = values[-200:] @ np.linalg.matrix_power(matrix, steps)[:2].T
        assert np.abs(found[:, i] - right).max() < 0.06 * np.abs(values[:, :2]).max()
        assert np.sqrt(np.mean((found[:, i] - right) ** 2)) < 0.03 * values[:, :2].std()


def test_a_window_that_slid_on_gives_the_least_squares_of_its_own_rows():
    _, values = coupled_sea(3000, seed=3)
    values[1500:1505] = np.nan
    record = record_of(roll=values[:, 0], pitch=values[:, 1])
    order, window, between = 5, 100.0, REFIT_INTERVAL * record.first_periods[0]
    refit_at = between * int(200.0 / between)
    refit = math.ceil(10.0 * refit_at)
    stamp = record.time[[refit]]
    found = running_regression(record, (0, 1), (1,), order, stamp, np.array([0.1]), window)[0, 0, 0]
    # a row may read the sample after it
    last = int(10.0 * refit_at - EVEN)
    rows = range(last - 1000 + 1 + order, last + 1)
    design = np.array([np.append(values[k - order : k, :2][::-1].ravel(), 1.0) for k in rows])
    whole = np.isfinite(design).all(axis=1) & np.isfinite(values[list(rows), 1])
    right = np.linalg.lstsq(design[whole], values[list(rows), 1][whole], rcond=None)[0]
    now = np.append(values[refit - order + 1 : refit + 1, :2][::-1].ravel(), 1.0)
    assert found == pytest.approx(now @ right, abs=1e-6)


@pytest.mark.long
@settings(max_examples=10, deadline=None)
@given(place=st.integers(700, 1190), seed=st.integers(0, 5))
def test_no_baseline_changes_when_the_future_does(place, seed):
    _, values = coupled_sea(1200, seed)
    # uneven stamps: values between them must not be read before they have come
    time = 0.1 * np.arange(1200) + np.random.default_rng(seed).uniform(-0.02, 0.02, 1200)
    changed = values.copy()
    changed[place:] += np.random.default_rng(seed + 1).normal(0.0, 1.0, (1200 - place, 3))
    found = []
    for each in (values, changed):
        record = Record.of(Trial(time, roll=each[:, 0], pitch=each[:, 1], accel_y=each[:, 2]))
        found.append(baseline_forecasts(record, ['roll', 'pitch'], time[:place], LEADS, 60.0))
    for axis in ('roll', 'pitch'):
        for name in BASELINES:
            assert np.array_equal(found[0][axis][name], found[1][axis][name], equal_nan=True), name
    assert np.isfinite(found[0]['roll']['var_40'][-1]).all()
