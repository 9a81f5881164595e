"""Cleaning: what is left out, what is marked, what is told."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hypothesis_numpy

from swath_sysid.attitude.motion.cleaning import MIN_ROWS, clean
from swath_sysid.common.errors import InputError


def codes(advice):
    return [each.code for each in advice]


def record(count=100, interval=0.01):
    time = interval * np.arange(count)
    return time, {'roll': 0.1 * np.sin(time), 'roll_rate': 0.1 * np.cos(time)}


@pytest.mark.parametrize('interval', [0.01, 1e-6])
def test_good_record_passes_untouched(interval):
    time, channels = record(1000, interval)
    channels |= {'pitch': 0 * time}
    kept, cleaned, advice = clean(time, channels)
    assert np.array_equal(kept, time) and advice == ()
    assert all(np.array_equal(cleaned[name], channels[name]) for name in channels)


def test_rows_without_stamp_or_with_the_last_one_are_left_out():
    time, channels = record()
    time[[10, 20]] = np.nan, np.inf
    time[31] = time[30]
    kept, cleaned, advice = clean(time, channels)
    assert codes(advice) == ['missing-stamps', 'repeated-stamps']
    assert advice[0].message.startswith('2 rows') and advice[1].message.startswith('1 row ')
    assert np.array_equal(cleaned['roll'], np.delete(channels['roll'], [10, 20, 31]))
    assert np.all(np.diff(kept) > 0)


@pytest.mark.parametrize('stray', [-5.0, 0.0051, 1e9])
def test_one_stray_stamp_costs_one_row(stray):
    time, channels = record()
    time[50] = stray
    kept, _, advice = clean(time, channels)
    assert codes(advice) == ['out-of-order-stamps'] and advice[0].message.startswith('1 row out of order')
    assert np.array_equal(kept, np.delete(time, 50))


def longest_increasing_length(values):
    best = []
    for at, value in enumerate(values):
        best.append(1 + max((best[before] for before in range(at) if values[before] < value), default=0))
    return max(best, default=0)


@given(st.lists(st.integers(0, 12), min_size=8, max_size=40))
def test_no_more_rows_are_lost_than_must_be(stamps):
    time = np.array(stamps, dtype=float)
    best = longest_increasing_length(stamps)
    if best < MIN_ROWS:
        with pytest.raises(InputError):
            clean(time, {'roll': 0 * time})
    else:
        kept, _, _ = clean(time, {'roll': 0 * time})
        assert kept.size == best
        assert np.all(np.diff(kept) > 0)


def test_absurd_values_become_missing():
    time, channels = record()
    channels |= {'pitch': 0 * time, 'accel_z': 9.81 + 0 * time, 'gyro_z': 0 * time}
    for name, value in (('roll', 3.2), ('pitch', -4.0), ('roll_rate', 36.0), ('accel_z', -201.0), ('gyro_z', 1e9)):
        channels[name][5] = value
    channels['roll'][6], channels['roll_rate'][6:8] = 3.1, (np.inf, -34.9)
    _, cleaned, advice = clean(time, channels)
    assert all(np.isnan(cleaned[name][5]) for name in cleaned) and np.isnan(cleaned['roll_rate'][6])
    assert (cleaned['roll'][6], cleaned['roll_rate'][7]) == (3.1, -34.9)
    assert channels['roll'][5] == 3.2, 'the input is not written to'
    assert codes(advice) == ['absurd-values', 'missing-values']
    assert 'roll: 1, roll_rate: 1, pitch: 1, accel_z: 1, gyro_z: 1' in advice[0].message


def test_gaps_and_empty_channels_are_told_and_uneven_steps_are_not():
    time, channels = record()
    uneven = np.cumsum(np.random.default_rng(1).uniform(0.005, 0.015, 500))
    assert codes(clean(uneven, {'roll': 0 * uneven})[2]) == []
    _, cleaned, advice = clean(time, {**channels, 'pitch': np.full(time.size, np.nan)})
    assert 'pitch' not in cleaned and codes(advice) == ['empty-channel']
    time[30:] += 1.0
    time[60:] += 2.5
    (gaps,) = clean(time, channels)[2]
    assert gaps.code == 'gaps' and '2 gaps' in gaps.message and '2.51 s' in gaps.message


def test_nothing_but_nan_and_too_few_rows_are_refused():
    time, channels = record()
    with pytest.raises(InputError, match='0 rows of 100'):
        clean(time, {name: np.nan * values for name, values in channels.items()})
    for few in (np.nan * time, time[: MIN_ROWS - 1], time[:0]):
        with pytest.raises(InputError, match='at least 8'):
            clean(few, {'roll': np.zeros(few.size)})
    with pytest.raises(InputError):
        clean(time, {})


@given(
    table=hypothesis_numpy.arrays(
        float,
        st.tuples(st.just(3), st.integers(0, 30)),
        elements=st.floats(width=64, allow_nan=True, allow_infinity=True),
    )
)
def test_any_numbers_give_a_clean_record_or_one_sentence(table):
    try:
        time, channels, _ = clean(table[0], {'roll': table[1], 'accel_x': table[2]})
    except InputError as error:
        assert '\n' not in str(error)
        return
    assert time.size >= MIN_ROWS and np.all(np.isfinite(time)) and np.all(time[1:] > time[:-1])
    for name, values in channels.items():
        assert values.size == time.size and not np.isinf(values).any() and np.isfinite(values).any(), name


@pytest.mark.parametrize('rate,step,rounding', [(100.0, 0.1, np.round), (100.0, 1.0, np.floor), (33.3, 0.1, np.floor)])
def test_rows_with_rounded_stamps_are_spread_evenly(rate, step, rounding):
    true = 5.0 + np.arange(3000) / rate
    true[2000:] += 20.0  # an outage
    kept, cleaned, advice = clean(rounding(true / step) * step, {'roll': 0.1 * np.sin(true)})
    assert kept.size == 3000 and codes(advice) == ['rounded-stamps', 'gaps']
    assert np.diff(kept)[:1990] == pytest.approx(1.0 / rate, rel=0.01)
    assert np.abs(kept - true - np.mean(kept - true)).max() < 0.5 * step
    assert f'rounded to {step:g} s, about {round(rate * step)} rows each' in advice[0].message


def test_most_rows_with_the_stamps_of_others_are_refused_where_no_even_sampling_explains_them():
    stamps = np.sort(np.random.default_rng(1).integers(0, 300, 3000) ** 2 / 900.0)
    with pytest.raises(InputError, match='have the stamp of the previous row, and no even sampling'):
        clean(stamps, {'roll': np.sin(np.arange(3000.0))})


def test_rows_that_are_written_twice_are_left_out():
    time, channels = record()
    kept, cleaned, advice = clean(np.repeat(time, 3), {name: np.repeat(row, 3) for name, row in channels.items()})
    assert np.array_equal(kept, time) and np.array_equal(cleaned['roll'], channels['roll'])
    assert codes(advice) == ['repeated-stamps'] and advice[0].message.startswith('200 rows')


def test_time_that_runs_backwards_is_refused():
    time, channels = record()
    for reversed_ in (time[::-1], -time):
        with pytest.raises(InputError, match='the time runs backwards, from .* s: reverse the order'):
            clean(reversed_, channels)


@pytest.mark.parametrize('rate,code', [(11.4, 'rounded-stamps'), (10.8, 'repeated-stamps')])
def test_stamps_that_few_rows_share_are_not_taken_for_rounded(rate, code):
    true = np.arange(2000) / rate
    assert code in codes(clean(np.floor(true / 0.1) * 0.1, {'roll': np.sin(true)})[2])
