"""The motion window: fixed memory, the last seconds, and the decays that end in it."""

import numpy as np
import pytest
from imu_stream import EPOCH_NS, NOT_GIVEN, decay_stream, reading

from swath_sysid.attitude.motion.stamps import JUMPED_BACK
from swath_sysid.attitude.motion.window import (
    COLUMNS,
    WINDOW_REASONS,
    MotionTable,
    MotionWindow,
    WindowSettings,
    averaged,
)
from swath_sysid.common.errors import InputError


def window_of(readings, **settings):
    """A window that has taken in some readings, and its steps."""
    window = MotionWindow(WindowSettings(**settings))
    return window, [window.add(one) for one in readings]


def even(count, rate=100.0, start_s=0.0):
    """Readings whose roll tells their number."""
    for k in range(count):
        yield reading(EPOCH_NS + round((start_s + k / rate) * 1e9), roll=1e-4 * k)


def test_the_window_holds_the_last_seconds_in_order():
    window, steps = window_of(even(1000), window=3.0, detect_decay=False)
    table = window.table()
    assert table.rows.shape == (301, len(COLUMNS)) and table.stamp_ns == EPOCH_NS + 9_990_000_000
    np.testing.assert_allclose(table.rows[:, 1], 1e-4 * np.arange(699, 1000), atol=1e-12)
    np.testing.assert_allclose(np.diff(table.rows[:, 0]), 0.01, atol=1e-6)
    assert all(step.kept for step in steps) and window.duration == pytest.approx(3.0)
    np.testing.assert_array_equal(window.table(table.rows[200, 0]).rows, table.rows[200:])


def test_memory_does_not_grow_and_faster_samples_shorten_the_window():
    window, _ = window_of(even(2000, rate=400.0), window=4.0, max_rate=100.0, detect_decay=False)
    assert window.size == 401 and window.is_short_of_memory
    assert window.duration == pytest.approx(1.0)
    np.testing.assert_allclose(window.table().rows[:, 1], 1e-4 * np.arange(1599, 2000), atol=1e-12)


def test_a_looping_bag_and_a_new_recording_begin_the_window_anew():
    window, _ = window_of([*even(300), *even(200)], window=60.0, detect_decay=False)
    # the first stamp after the jump is left out: only the second shows that the clock has moved
    assert window.counts[JUMPED_BACK] == 1 and window.size == 199
    window.record(False)
    window.add(reading(EPOCH_NS + 2 * 10**9))
    assert window.size == 199 and not window.recording
    window.record(True)
    assert window.size == 0
    for one in even(50, start_s=2.1):
        window.add(one)
    window.record(True)
    assert window.size == 50, 'what records already goes on'


def test_what_is_left_out_is_counted():
    unusable = reading(EPOCH_NS + 10_000_000, orientation=(0.0,) * 4, rates=(1e9,) * 3)
    window, steps = window_of([reading(EPOCH_NS), reading(EPOCH_NS), unusable, reading(EPOCH_NS + 20_000_000)])
    assert [step.kept for step in steps] == [True, False, False, True]
    assert window.size == 2 and window.samples == 2
    counted = {'duplicate-stamp', 'bad-quaternion', 'absurd-value', 'nothing-usable'}
    assert {reason: count for reason, count in window.counts.items() if count} == dict.fromkeys(counted, 1)
    assert set(window.counts) == set(WINDOW_REASONS)


def test_the_table_becomes_a_trial_without_what_was_not_measured():
    window, _ = window_of([r._replace(orientation_covariance=NOT_GIVEN) for r in even(100)], detect_decay=False)
    trial = window.table().trial()
    assert trial.roll is None and trial.time[0] == 0.0 and trial.axes == ('roll', 'pitch')
    with pytest.raises(InputError, match='window is empty'):
        MotionWindow().table().trial()


@pytest.mark.parametrize(('rate', 'axis', 'damping'), [(25.0, 'roll', 0.08), (200.0, 'pitch', 0.03)])
def test_a_decay_that_has_ended_is_told_once(rate, axis, damping):
    readings = decay_stream(rate, duration=75.0, release=12.0, axis=axis, damping=damping)
    _, steps = window_of(readings)
    told = [(index / rate, step.finished) for index, step in enumerate(steps) if step.finished is not None]
    assert len(told) == 1
    when, decay = told[0]
    begin = decay.table.rows[0, 0] - EPOCH_NS * 1e-9
    assert decay.axis == axis and decay.segment.period == pytest.approx(2.6, rel=0.03)
    assert begin + decay.segment.start == pytest.approx(12.0, abs=0.4)
    # not before it has fallen to an eighth (the faint tail is not waited for), nor long after
    fallen = 12.0 + np.log(8) / (damping * 2 * np.pi / 2.6)
    assert fallen - 2.0 < when < fallen + 12.0
    assert decay.table.rows[-1, 0] - EPOCH_NS * 1e-9 == pytest.approx(when, abs=1.5 / rate)


def test_every_one_of_several_decays_is_told_and_none_once_that_is_off():
    streams = [decay_stream(50.0, 40.0, 10.0, seed=n, first_ns=EPOCH_NS + n * 40 * 10**9) for n in range(4)]
    window, steps = window_of(one for stream in streams[:3] for one in stream)
    told = [step.finished for step in steps if step.finished is not None]
    starts = [d.table.rows[0, 0] - EPOCH_NS * 1e-9 + d.segment.start for d in told]
    assert starts == pytest.approx([10.0, 50.0, 90.0], abs=0.5)
    window.detect_decay(False)
    assert all(window.add(one).finished is None for one in streams[3])


def test_rest_and_waves_are_no_decays():
    rng = np.random.default_rng(4)
    frequencies, phases = rng.uniform(0.08, 0.35, 200), rng.uniform(0.0, 2 * np.pi, 200)
    for size in (0.0, 0.06):
        swings = size * np.sqrt(2 / 200) * np.cos(np.outer(np.arange(3600) / 20, 2 * np.pi * frequencies) + phases)
        roll = (swings.sum(axis=1) + rng.normal(0.0, 1e-3, 3600)).tolist()
        _, steps = window_of(reading(EPOCH_NS + k * 50_000_000, roll=roll[k]) for k in range(3600))
        assert [step for step in steps if step.finished is not None] == []


def test_a_fast_table_is_averaged_and_a_slow_one_is_not():
    rows = np.arange(8000.0).reshape(1000, 8)
    rows[:, 0] = np.arange(1000) / 400.0
    found = averaged(MotionTable(rows, 0), 50.0).rows
    assert found.shape == (125, 8)
    np.testing.assert_allclose(found[0], rows[:8].mean(axis=0))
    np.testing.assert_allclose(found[-1], rows[-8:].mean(axis=0))
    assert averaged(MotionTable(rows, 0), 300.0).rows is rows


@pytest.mark.parametrize('fields', [{'window': 0.0}, {'max_rate': -1.0}, {'smallest_decay': float('nan')}])
def test_settings_that_make_no_sense_are_refused(fields):
    with pytest.raises(InputError, match=next(iter(fields))):
        WindowSettings(**fields)


@pytest.mark.parametrize(('length', 'kept'), [(8.0, 501), (2.0, 201)])
def test_a_window_of_another_length_keeps_what_fits(length, kept):
    window, _ = window_of(even(1000), window=5.0, detect_decay=False)
    before = window.table().rows
    window.resize(length)
    np.testing.assert_array_equal(window.table().rows, before[-kept:])
    for one in even(1000, start_s=10.0):
        window.add(one)
    assert window.duration == pytest.approx(length) and window.size == round(100 * length) + 1


def test_a_decay_that_was_told_is_not_told_again_in_a_longer_window():
    window, told = MotionWindow(WindowSettings(window=60.0)), []
    for k, one in enumerate(decay_stream(50.0, 40.0)):
        if k == 1500:
            window.resize(120.0)
        told.append(window.add(one).finished)
    assert len([each for each in told if each is not None]) == 1
