"""Cleaning of records, and a time column that counts something else than its name says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hypothesis_numpy

from swath_sysid.attitude.motion.attitude import quaternion
from swath_sysid.attitude.motion.cleaning import (
    GYRO,
    MIN_ROWS,
    QUATERNION,
    assemble_trial,
    clean,
    one_row_per_sample,
    spikes_in,
)
from swath_sysid.attitude.motion.stamps import check_time_base, motion_period
from swath_sysid.common.errors import InputError
from swath_sysid.formats.csv_trials import read_csv


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


def test_rows_without_stamp_out_of_order_or_with_the_last_stamp_are_left_out():
    time, channels = record()
    time[[10, 20]] = np.nan, np.inf
    time[31], time[50] = time[30], 1e9
    kept, cleaned, advice = clean(time, channels)
    counted = {each.code: each.message[:6] for each in advice}
    assert counted == {'missing-stamps': '2 rows', 'repeated-stamps': '1 row ', 'out-of-order-stamps': '1 row '}
    assert np.array_equal(cleaned['roll'], np.delete(channels['roll'], [10, 20, 31, 50]))
    assert np.all(np.diff(kept) > 0)


@pytest.mark.parametrize('noise', [0.0, 1e-5, 3e-4])
def test_samples_that_are_sent_several_times_are_one(noise):
    draws, (time, channels) = np.random.default_rng(1), record()
    sent = {name: np.repeat(row, 3) + noise * draws.standard_normal(3 * row.size) for name, row in channels.items()}
    sent['heading'] = np.repeat(np.tile([0.001, 2.0 * np.pi - 0.001], time.size // 2), 3)
    sent['heading'][1::3] += noise
    kept, merged, (advice,) = one_row_per_sample(np.repeat(time, 3), sent)
    assert np.array_equal(kept, time) and merged['roll'] == pytest.approx(channels['roll'], abs=4 * noise)
    assert np.abs(merged['heading'] - sent['heading'][::3]).max() <= noise
    assert advice.code == 'repeated-samples' and advice.message.startswith(f'{2 * time.size} rows (67%)')
    # a driver that stamps a batch, beside a channel that is held in it
    at = np.arange(3 * time.size)
    batch = {'roll': 0.1 * np.sin(0.02 * at) + noise * draws.standard_normal(at.size), 'heading': sent['heading']}
    assert one_row_per_sample(np.repeat(time, 3), batch)[2] == []


@pytest.mark.parametrize('other', [lambda t: 0.12 * np.sin(2.1 * t) + 0.02, lambda t: 0.04 + 0.05 * np.cos(1.7 * t)])
def test_rows_of_two_sensors_with_one_stamp_are_not_spread(other):
    time = 0.1 * np.arange(300)
    both = np.column_stack([0.1 * np.sin(2.1 * time), other(time)]).ravel()
    with pytest.raises(InputError, match='those of two sensors'):
        clean(np.repeat(time, 2), {'roll': both})
    batch = 0.1 * np.sin(2.1 * (0.05 * np.arange(600)))
    assert 'rounded-stamps' in codes(clean(np.repeat(time, 2), {'roll': batch})[2])


def test_values_with_one_stamp_in_two_rows_are_one_sample_and_empty_rows_none():
    time, channels = record()
    rows = {'roll': np.full(3 * time.size, np.nan), 'gyro_x': np.full(3 * time.size, np.nan)}
    rows['roll'][::3], rows['gyro_x'][1::3] = channels['roll'], channels['roll']
    stamps = np.column_stack([time, time, np.where(time < 1.0, np.nan, np.inf)]).ravel()
    with np.errstate(all='raise'):
        kept, merged, advice = one_row_per_sample(stamps, rows)
    assert np.array_equal(kept, time) and all(np.array_equal(row, channels['roll']) for row in merged.values())
    assert codes(advice) == ['empty-rows', 'repeated-samples']


@pytest.mark.parametrize('interval', [0.02, 0.1, 0.4])
def test_single_wrong_angles_are_left_out_and_no_others(interval):
    draws, time = np.random.default_rng(5), interval * np.arange(1500)
    roll = 0.15 * np.sin(2.0 * time) * np.cos(0.13 * time) + 1e-4 * draws.standard_normal(time.size)
    at = np.array([50, 58, 400, 1000, 1490])
    spoilt, pitch = roll.copy(), np.round(roll / 1e-3) * 1e-3
    spoilt[at] = -np.pi, roll[58] - 0.15, np.pi, roll[1000] + 0.12, 2.0
    kept, cleaned, advice = clean(time, {'roll': spoilt, 'pitch': pitch})
    assert np.flatnonzero(np.isnan(cleaned['roll'])).tolist() == at.tolist()
    assert np.array_equal(cleaned['pitch'], pitch) and f'roll: 5 of {time.size})' in advice[0].message
    parts = dict(zip(QUATERNION, quaternion(spoilt, pitch, 0.3), strict=True))
    trial = assemble_trial(time, parts | {name: 0.01 * time for name in GYRO})
    lost = np.isnan(trial.roll)
    assert np.flatnonzero(lost).tolist() == at.tolist() and np.array_equal(np.isnan(trial.roll_rate), lost)
    twice, pairs = roll.copy(), [50, 51, 400, 401, 1490, 1491]
    twice[pairs] = -2.8, -2.9, 2.0, 2.0, 1.5, 2.0
    assert np.flatnonzero(spikes_in(time, twice)).tolist() == pairs
    # a released hull, steps, a jerk between even steps of the sensor: all true
    decay = np.where(time > 10.0, 0.2 * np.exp(-0.1 * (time - 10.0)) * np.cos(2.0 * (time - 10.0)), 0.2)
    steps = np.repeat(decay[::5], 5) + 0.1 * (time > 30.0)
    kinks = np.interp(time, time[::7], 0.2 * np.sin(2.0 * time[::7]))
    toggles = np.round(1e-4 * draws.standard_normal(time.size) / 1e-4) * 1e-4
    gust = np.r_[np.zeros(40), 0.2, 0.5, 0.5, 0.2, np.zeros(40)]
    assert not spikes_in(time[: gust.size], gust + 1e-3 * draws.standard_normal(gust.size)).any()
    assert not any(
        spikes_in(time, angle).any() for angle in (decay, steps, kinks, toggles, draws.standard_normal(time.size))
    )


def longest_increasing_length(values):
    best = []
    for at, value in enumerate(values):
        best.append(1 + max((best[before] for before in range(at) if values[before] < value), default=0))
    return max(best, default=0)


@given(st.lists(st.integers(0, 12), min_size=8, max_size=40))
def test_no_more_rows_are_lost_than_must_be(stamps):
    time = np.array(stamps, dtype=float)
    best, own = longest_increasing_length(stamps), 1 + np.count_nonzero(np.diff(time))
    if best < MIN_ROWS or own - best >= MIN_ROWS:
        with pytest.raises(InputError):
            clean(time, {'roll': 0 * time})
    else:
        kept, _, _ = clean(time, {'roll': 0 * time})
        assert kept.size == best and np.all(np.diff(kept) > 0)


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
    assert (
        'roll: 1 of 100, roll_rate: 1 of 99, pitch: 1 of 100, accel_z: 1 of 100, gyro_z: 1 of 100' in advice[0].message
    )


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


def test_what_cannot_be_cleaned_is_refused():
    time, channels = record()
    roll = {'roll': channels['roll']}
    stamps = np.sort(np.random.default_rng(1).integers(0, 300, 3000) ** 2 / 900.0)
    for given_time, given_channels, words in (
        (time, {'roll': np.nan * time}, '0 rows of 100'),
        (np.nan * time, roll, 'at least 8'),
        (time[: MIN_ROWS - 1], {'roll': np.zeros(MIN_ROWS - 1)}, 'at least 8'),
        (time[:0], {'roll': time[:0]}, 'at least 8'),
        (time, {}, '0 rows of 100'),
        (stamps, {'roll': np.sin(np.arange(3000.0))}, 'the stamp of the previous row, and no even sampling'),
        (time[::-1], roll, 'the time runs backwards, from .* s: reverse the order'),
        (-time, roll, 'the time runs backwards'),
    ):
        with pytest.raises(InputError, match=words):
            clean(given_time, given_channels)


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


@pytest.mark.parametrize('rate,code', [(11.4, 'rounded-stamps'), (10.8, 'repeated-stamps')])
def test_stamps_that_few_rows_share_are_not_taken_for_rounded(rate, code):
    true = np.arange(2000) / rate
    assert code in codes(clean(np.floor(true / 0.1) * 0.1, {'roll': np.sin(true)})[2])


def swing(size, samples_a_cycle):
    return 0.1 * np.sin(2.0 * np.pi * np.arange(size) / samples_a_cycle)


def test_period_is_that_of_the_swing():
    assert motion_period(0.02 * np.arange(2000), swing(2000, 150.0)) == pytest.approx(3.0, rel=1e-2)
    assert motion_period(np.arange(50.0), np.full(50, 2.0)) is None


@pytest.mark.parametrize(
    ('start', 'step', 'words'),
    [
        (0.0, 10.0, 'call it time_ms, as its unit is'),
        (0.0, 1000.0, 'call it time_ms or time_us'),
        (0.0, 1e7, 'call it time_ns'),
        (1.7e12, 10.0, 'call it time_ms, as'),
        (1.7e15, 1e4, 'call it time_us, as'),
        (1.7e18, 1e7, 'call it time_ns, as'),
        (0.0, 1e-5, 'more often than any sensor'),
        (0.0, 1.0, 'name it time_samples'),
    ],
)
def test_other_units_are_refused_with_their_cure_and_slow_sensors_pass(start, step, words):
    with pytest.raises(InputError, match=words):
        check_time_base(start + step * np.arange(900), [swing(900, 200.0)], 'a.csv')
    with pytest.raises(InputError, match='too seldom'):
        check_time_base(np.arange(700.0) / 0.4, [], 'a.csv')
    with pytest.raises(InputError, match='more often'):
        check_time_base(np.arange(700.0) / 12e3, [], 'a.csv')
    for plausible in (0.6, 8e3):
        check_time_base(np.arange(700.0) / plausible, [], 'a.csv')
    time = np.arange(700.0)
    for samples_a_cycle in (8.0, 50.0):
        check_time_base(time, [swing(700, samples_a_cycle)], 'a.csv')
    check_time_base(time, [np.random.default_rng(1).normal(size=700)], 'a.csv')
    check_time_base(1.7e9 + 0.02 * time, [swing(700, 100.0)], 'a.csv')


@pytest.mark.parametrize(
    ('name', 'amplitude', 'is_doubted'),
    [('roll_deg', 0.1, True), ('roll_deg', 3.0, False), ('roll_rad', 2.5, True), ('roll_rad', 0.5, False)],
)
def test_angles_of_an_unlikely_size_may_have_the_other_unit(tmp_path, name, amplitude, is_doubted):
    path = tmp_path / 'a.csv'
    motion = swing(900, 200.0)
    rows = '\n'.join(f'{0.01 * k},{v}' for k, v in enumerate(amplitude / np.ptp(motion) * 2 * motion))
    path.write_text(f'time_s,{name}\n{rows}\n')
    assert ('other-unit-likely' in {a.code for a in read_csv(path).advice}) == is_doubted


def test_sample_numbers_are_read_where_their_rate_is_given(tmp_path):
    path = tmp_path / 'a.csv'
    rows = '\n'.join(f'{k},{v}' for k, v in enumerate(swing(900, 200.0)))
    path.write_text(f'# sample_rate_hz: 100\ntime_samples,roll_rad\n{rows}\n')
    trial = read_csv(path)
    assert trial.time == pytest.approx(0.01 * np.arange(900))
    path.write_text(f'time_samples,roll_rad\n{rows}\n')
    with pytest.raises(InputError, match='sample_rate_hz'):
        read_csv(path)


@pytest.mark.parametrize('amplitude', [0.2, 0.0])
def test_an_orientation_that_was_never_filled_in_is_left_out_of_a_record(amplitude):
    """A craft that rolls, and one that lies still with its head where the orientation begins."""
    time = np.arange(3000) / 100.0
    readings = {f'quaternion_{part}': np.full(time.size, float(part == 'w')) for part in 'xyzw'}
    readings |= {f'gyro_{part}': np.random.default_rng(1).normal(0.0, 2e-3, time.size) for part in 'xyz'}
    readings['gyro_x'] += amplitude * np.cos(2.0 * time)
    trial = assemble_trial(time, readings)
    is_blank = amplitude > 0.0
    assert ('blank-orientation' in {each.code for each in trial.advice}) == is_blank == (trial.roll is None)
    assert trial.roll_rate is not None


@pytest.mark.parametrize('steepest, is_told', [(82.0, True), (80.0, False)])
def test_euler_angles_near_the_vertical_are_reported(steepest, is_told):
    time = np.arange(0.0, 20.0, 0.05)
    pitch = np.radians(steepest) * np.sin(time)
    trial = assemble_trial(time, {'roll': 0.1 * np.sin(2.0 * time), 'pitch': pitch})
    assert ('near-vertical' in codes(trial.advice)) == is_told


@pytest.mark.parametrize('step', [0.1, 0.5, 1.0])
def test_a_craft_at_rest_on_a_coarse_sensor_is_not_taken_for_a_stuck_one(step):
    time = np.arange(0.0, 90.0, 0.05)
    angle = sum(8.0 * np.exp(-0.15 * (time - t0)) * np.cos(2.5 * (time - t0)) * (time > t0) for t0 in (10.0, 60.0))
    assert 'angles-stuck' not in codes(clean(time, {'roll': np.radians(step * np.round(angle / step))}, 'x.csv')[2])


@pytest.mark.parametrize('ends, goes_on, is_left_out', [(True, 0.0, True), (False, 0.2, True), (False, 0.0, False)])
def test_angles_that_a_sensor_repeats_are_left_out_but_not_a_craft_that_is_held(ends, goes_on, is_left_out):
    time = np.arange(0.0, 60.0, 0.05)
    roll = 0.2 * np.sin(4.0 * time)
    first, last = (386 if ends else 409), (time.size if ends else 600)
    roll[first:last] = roll[first - 1]
    roll[last:] = roll[first - 1] * np.cos(4.0 * (time[last:] - time[last - 1])) + goes_on if not ends else 0.0
    _, cleaned, advice = clean(time, {'roll': roll})
    assert ('angles-stuck' in codes(advice)) == is_left_out
    assert np.isnan(cleaned['roll'][first + 1 : last]).all() == is_left_out


@pytest.mark.parametrize('lost, is_read', [(4, True), (6, False)])
def test_a_record_that_loses_more_than_a_twentieth_for_one_cause_is_refused(lost, is_read):
    time, roll = np.arange(200) * 0.05, 0.1 * np.sin(np.arange(200) * 0.1)
    places = np.arange(5, 5 + 2 * lost) * 9
    for damaged_time, damaged, cause in (
        (np.where(np.isin(np.arange(200), places), np.nan, time), roll, 'no readable time'),
        (time, np.where(np.isin(np.arange(200), places), 9.0, roll), 'are impossible, up to 9'),
        (np.where(np.isin(np.arange(200), places), time - 2.0, time), roll, 'steps back'),
    ):
        if is_read:
            assert clean(damaged_time, {'roll': damaged})[2]
        else:
            with pytest.raises(InputError, match=cause):
                clean(damaged_time, {'roll': damaged})
