"""IMU messages: conversion, the order of stamps, and the window of motion with its decays."""

from collections import Counter
from math import inf, isnan, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from imu_stream import EPOCH_NS, GRAVITY, NOT_GIVEN, UNKNOWN, decay_stream, diagonal, reading
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.motion import intake
from swath_sysid.attitude.motion import stamps as reasons_of
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.intake import ImuReading, Intake, convert
from swath_sysid.attitude.motion.stamps import StampOrder, StampSettings
from swath_sysid.attitude.motion.window import (
    COLUMNS,
    WINDOW_REASONS,
    MotionTable,
    MotionWindow,
    WindowSettings,
    averaged,
)
from swath_sysid.common.errors import InputError

STRAIGHT = Installation()
ANGLES = ('roll', 'pitch', 'yaw')
RATES = ('roll_rate', 'pitch_rate')


def values_of(sample, names):
    """Some fields of a sample."""
    return [getattr(sample, name) for name in names]


def test_angles_rates_and_variances_are_those_of_the_craft():
    sample, reasons = convert(reading(EPOCH_NS, 0.2, -0.3, 0.5, -0.6, yaw=1.1), STRAIGHT)
    assert values_of(sample, ANGLES + RATES) == pytest.approx([0.2, -0.3, 1.1, 0.5, -0.6])
    assert sample.stamp_ns == EPOCH_NS and reasons == ()
    assert values_of(sample, ['roll_variance', 'pitch_rate_variance']) == [1e-6, 2.5e-5]
    assert all(type(value) is float for value in sample[1:])
    mounting = (0.3, -0.2, 1.4)
    sits = Rotation.from_euler('ZYX', mounting[::-1]).as_matrix()
    spread = (sits.T @ np.diag([1e-6, 4e-6, 9e-6]) @ sits).ravel().tolist()
    sample, _ = convert(reading(EPOCH_NS, orientation_covariance=spread), Installation('flu', mounting))
    assert values_of(sample, ('roll_variance', 'pitch_variance')) == pytest.approx([1e-6, 4e-6])


def test_what_is_not_measured_or_cannot_be_costs_no_more_than_itself():
    for changes, counted in (
        ({'orientation': (0.0, 0.0, 0.0, 0.0)}, intake.BAD_QUATERNION),
        ({'orientation': (3.0, 1.0, 0.0, 2.0)}, intake.BAD_QUATERNION),
        ({'orientation': (0.0, -inf, 0.0, 1.0)}, intake.NOT_FINITE),
        ({'orientation_covariance': NOT_GIVEN}, intake.NO_ORIENTATION),
    ):
        sample, reasons = convert(reading(EPOCH_NS, 0.2, 0.1, **changes)._replace(rates=(0.1, 0.2, 0.3)), STRAIGHT)
        assert all(isnan(value) for value in values_of(sample, ANGLES)) and reasons == (counted,)
        assert values_of(sample, RATES) == [0.1, 0.2]  # body rates stand for Euler rates
    for changes, counted in (
        ({'rates': (nan, 0, 0)}, intake.NOT_FINITE),
        ({'rates': (0, inf, 0)}, intake.NOT_FINITE),
        ({'rates': (0, 0, 1e3)}, intake.ABSURD),
        ({'rates_covariance': NOT_GIVEN}, intake.NO_RATES),
    ):
        sample, reasons = convert(reading(EPOCH_NS, 0.2, 0.1, **changes), STRAIGHT)
        assert values_of(sample, ('roll', 'pitch')) == pytest.approx([0.2, 0.1])
        assert all(isnan(value) for value in values_of(sample, RATES)) and reasons == (counted,)
    sample, reasons = convert(reading(EPOCH_NS, 0.2, force=(nan, 0.0, 1e9)), STRAIGHT)
    assert isnan(sample.accel_z) and sample.roll == pytest.approx(0.2) and reasons == (intake.NOT_FINITE,)
    sample, reasons = convert(reading(EPOCH_NS, rates=(nan,) * 3, orientation=(0.0,) * 4), STRAIGHT)
    assert sample is None and set(reasons) == {intake.NOT_FINITE, intake.BAD_QUATERNION, intake.EMPTY}
    for pitch, kept in ((-79.0, True), (81.0, False), (-90.0, False)):
        sample, reasons = convert(reading(EPOCH_NS, 0.1, np.radians(pitch)), STRAIGHT)
        assert (sample is not None) == kept and (intake.NEAR_VERTICAL in reasons) != kept


@pytest.mark.parametrize('covariance', [UNKNOWN, diagonal(nan), diagonal(-1e-6), diagonal(inf), diagonal(1e4)])
def test_covariances_that_say_nothing_are_unknown(covariance):
    sample, reasons = convert(reading(EPOCH_NS, rates_covariance=covariance), STRAIGHT)
    assert isnan(sample.roll_rate_variance) and sample.roll_variance == 1e-6
    assert reasons == (*([intake.ABSURD_COVARIANCE] if covariance[0] == 1e4 else []), intake.UNKNOWN_COVARIANCE)
    for std, known in ((0.9 * np.pi, True), (1.1 * np.pi, False), (1e150, False)):
        sample, _ = convert(reading(EPOCH_NS, orientation_covariance=diagonal(std**2)), STRAIGHT)
        assert isnan(sample.roll_variance) != known and sample.pitch_rate_variance == 2.5e-5


numbers = st.floats(width=64)


@given(
    st.tuples(*[st.tuples(*[numbers] * count) for count in (4, 9, 3, 9, 3)]),
    st.sampled_from([STRAIGHT, Installation('frd', (0.1, 0.2, 0.3))]),
)
def test_any_message_is_taken_in_without_an_error(values, sits):
    sample, reasons = convert(ImuReading(EPOCH_NS, *values, UNKNOWN), sits)
    assert set(reasons) <= set(intake.INTAKE_REASONS)
    if sample is not None:
        assert not np.isinf(sample[1:]).any()
        assert not (np.array(values_of(sample, ('roll_variance', 'pitch_rate_variance'))) <= 0.0).any()


@pytest.mark.parametrize('is_blank', [True, False])
def test_an_orientation_that_was_never_filled_in_is_not_measured(is_blank):
    """From a turn by three degrees on, and until it is filled in; one that stands still is an orientation."""
    sensor, turned = Intake(STRAIGHT, StampSettings()), 0.0
    for number, stamp in enumerate(even(100, 4).tolist()):
        rate = 0.2 if is_blank and number else 0.0
        turned += 0.01 * rate
        sample, reasons = sensor.take(
            reading(stamp)._replace(orientation=(0.0, 0.0, 0.0, 1.0), rates=(rate, 0.0, 0.001 * (-1) ** number))
        )
        if abs(turned - np.radians(3.0)) > 0.005:
            assert (intake.BLANK_ORIENTATION in reasons) == (turned > np.radians(3.0)) == np.isnan(sample.roll)
    sample, reasons = sensor.take(reading(stamp + 10_000_000, roll=0.1))
    assert sample.roll == pytest.approx(0.1) and intake.BLANK_ORIENTATION not in reasons


@pytest.mark.parametrize('covariance', [UNKNOWN, NOT_GIVEN])
def test_it_stays_so_while_the_craft_swings_and_is_named_only_where_it_is_claimed(covariance):
    sensor, found = Intake(STRAIGHT, StampSettings()), []
    for number, stamp in enumerate(even(50, 20).tolist()):
        swings = reading(stamp)._replace(
            orientation=(0.0, 0.0, 0.0, 1.0),
            orientation_covariance=covariance,
            rates=(0.2 * np.cos(0.04 * number), 0.0, 0.0),
        )
        found.append(sensor.take(swings))
    assert all(isnan(sample.roll) for sample, _ in found[50:])
    named = [intake.BLANK_ORIENTATION in reasons for _, reasons in found[50:]]
    assert all(named) if covariance is UNKNOWN else not any(named)


def repeating(readings, first, last, times=1):
    """What remains of a sensor that sends each message so many times and hangs from one reading to another."""
    held = readings[:first] + [readings[first]] * (last - first) + readings[last:]
    sent = [each for each in held for _ in range(times)]
    sensor = Intake(STRAIGHT, StampSettings())
    return [
        sensor.take(each._replace(stamp_ns=stamp)) for each, stamp in zip(sent, even(100, 20).tolist(), strict=False)
    ]


def swinging(step=0.0, size=0.1, force=GRAVITY):
    """Ten seconds of a noisy sensor whose values are whole steps; its orientation is that of a craft at rest."""
    noise = np.random.default_rng(3).normal(scale=1e-3, size=(1000, 3))
    rates = size * np.sin(0.02 * np.arange(1000))[:, None] + noise
    rates = step * np.round(rates / step) if step else rates
    return [reading(0, 0.1)._replace(rates=tuple(rate), force=force) for rate in rates.tolist()]


@pytest.mark.parametrize('force', [GRAVITY, (nan,) * 3])
@pytest.mark.parametrize('times', [1, 2])
@pytest.mark.parametrize('first', [40, 400])
def test_a_sensor_that_repeats_itself_is_silent_until_it_goes_on(times, first, force):
    left_out = [intake.FROZEN in reasons for _, reasons in repeating(swinging(force=force), first, 450, times)]
    begins, ends = times * (first + 1), times * 450
    assert all(left_out[begins:ends]) and not any(left_out[:begins] + left_out[ends:])


@pytest.mark.parametrize(('readings', 'last'), [(swinging(0.002, 0.0005), 1000), (swinging(), 0)])
def test_a_coarse_sensor_at_rest_and_one_that_has_never_changed_are_believed(readings, last):
    found = repeating(readings, 400, last) if last else repeating([readings[0]] * 1000, 0, 0)
    assert not any(intake.FROZEN in reasons for _, reasons in found) and found[-1].sample is not None


def even(rate, duration, start=0.0):
    """Even stamps, ns."""
    return EPOCH_NS + np.round((start + np.arange(round(duration * rate)) / rate) * 1e9).astype(np.int64)


def spoilt(changes):
    """Three seconds at 100 Hz in which some samples have the stamps of others, or given ones."""
    stamps = even(100, 3)
    for index, other in changes.items():
        stamps[index] = stamps[other] if 0 < other < 300 else other
    return stamps


def place_all(stamps):
    """Indices kept, and the counts."""
    order, counts, kept = StampOrder(), Counter(), []
    for index, stamp in enumerate(np.asarray(stamps).tolist()):
        placed = order.place(stamp)
        counts.update(placed.reasons)
        if placed.kept:
            kept.append(index)
    return kept, dict(counts), order


@pytest.mark.parametrize('rate', [0.2, 1, 25, 100, 1000])
def test_even_stamps_all_follow(rate):
    kept, counts, order = place_all(even(rate, 200 / rate))
    assert len(kept) == 200 and counts == {}
    assert order.interval == pytest.approx(1 / rate, rel=1e-6)
    jitter = np.random.default_rng(1).uniform(-0.4, 0.4, 6000) / rate
    kept, counts, _ = place_all(even(rate, 6000 / rate) + np.int64(jitter * 1e9))
    assert len(kept) == 6000 and counts == {}


@pytest.mark.parametrize(
    ('stamps', 'counted', 'left_out'),
    [
        (spoilt({50: 49, 80: 60}), {reasons_of.DUPLICATE: 1, reasons_of.OUT_OF_ORDER: 1}, {50, 80}),
        (spoilt({100: 0, 200: 2 * EPOCH_NS}), {reasons_of.OUT_OF_ORDER: 1, reasons_of.STRAY: 1}, {100, 200}),
        # a bag that loops is followed after one sample
        (np.tile(even(100, 3), 3), {reasons_of.JUMPED_BACK: 2}, {300, 600}),
        # after a long gap the first sample is no neighbour of the next
        (
            np.concatenate([even(100, 2), even(100, 2, 2.5), even(100, 2, 60.0)]),
            {reasons_of.GAP: 1, reasons_of.LONG_GAP: 1},
            {400},
        ),
    ],
)
def test_what_cannot_follow_is_left_out_and_counted(stamps, counted, left_out):
    kept, counts, _ = place_all(stamps)
    assert counts == counted and set(range(len(stamps))) - set(kept) == left_out


@pytest.mark.parametrize(
    ('by', 'reason', 'left_out'),
    [
        (0.5, reasons_of.STEPPED, 0),
        (5.0, reasons_of.STEPPED, 1),
        (3600.0, reasons_of.STEPPED, 1),
        (-0.5, reasons_of.JUMPED_BACK, 3),
        (-3600.0, reasons_of.JUMPED_BACK, 1),
    ],
)
def test_a_clock_that_is_set_while_messages_arrive_is_no_silent_sensor(by, reason, left_out):
    stamps = even(100, 4)
    stamps[200:] += round(by * 1e9)
    late = np.random.default_rng(1).exponential(2e-3, stamps.size)
    late[150] = 0.3  # as in a queue
    order = StampOrder()
    placed = [order.place(stamp, 0.01 * k + late[k]) for k, stamp in enumerate(stamps.tolist())]
    assert Counter(reason for each in placed for reason in each.reasons) == {reason: 1}
    assert sum(not each.kept for each in placed) == left_out
    # by the same stamps, of messages that were as long in coming, the sensor was silent
    order = StampOrder()
    silent = [order.place(stamp, (stamp - EPOCH_NS) * 1e-9 + late[k]) for k, stamp in enumerate(stamps.tolist())]
    counts = Counter(reason for each in silent for reason in each.reasons)
    assert counts == {reason if by < 0.0 else reasons_of.GAP if by < 1.0 else reasons_of.LONG_GAP: 1}


def test_a_sensor_that_stamps_zero_for_a_while_was_not_silent():
    stamps = even(100, 20)
    stamps[500:1500] = 0
    kept, counts, _ = place_all(stamps)
    assert counts == {reasons_of.DUPLICATE: 999} and len(kept) == 1000


@pytest.mark.parametrize('behind', [0.053, 0.5, 7.0, 1e6])
def test_of_two_publishers_the_one_ahead_is_followed(behind):
    stamps = np.stack([even(100, 3), even(100, 3, -behind)], axis=1).ravel()
    kept, counts, _ = place_all(stamps)
    assert all(index % 2 == 0 for index in kept) and len(kept) == 300
    assert set(counts) == {reasons_of.OUT_OF_ORDER}


@pytest.mark.parametrize('rate', [1, 25, 400])
def test_a_stamp_that_jitter_sets_back_is_kept_one_nanosecond_after_the_one_before(rate):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        count = 2000
        stamps = even(rate, count / rate) + np.int64(rng.uniform(-0.6, 0.6, count) / rate * 1e9)
        order = StampOrder(StampSettings(backward_jump=10.0, gap_limit=10.0))
        placed = [order.place(stamp) for stamp in stamps.tolist()]
        # after as many as show the jitter
        newest, set_back = 0, 0
        for number, (stamp, each) in enumerate(zip(stamps.tolist(), placed, strict=True)):
            if number > 200:
                # what the tracked interval makes of it leaves nothing out
                assert each.kept and set(each.reasons) <= {reasons_of.RATE_CHANGED, reasons_of.GAP}
                assert each.stamp_ns == max(stamp, newest + 1)
                set_back += stamp < newest
            newest = each.stamp_ns if each.kept else newest
        # of two neighbours, one in seventy: 0.2^2 / 2 of 1.2^2
        assert set_back > 0.005 * count


def test_the_sample_of_a_stamp_that_is_set_back_has_the_later_one():
    rng = np.random.default_rng(0)
    stamps = even(50, 20) + np.int64(rng.uniform(-0.6, 0.6, 1000) / 50 * 1e9)
    readings = [reading(stamp, roll=1e-4 * number) for number, stamp in enumerate(stamps.tolist())]
    of_messages, of_record = Intake(STRAIGHT, StampSettings()), Intake(STRAIGHT, StampSettings())
    taken = [of_messages.take(one) for one in readings]
    placed = [of_record.place(convert(one, STRAIGHT).sample) for one in readings]
    for each_taken in (taken, placed):
        kept = [each.sample for each in each_taken if each.sample is not None]
        found = np.array([sample.stamp_ns for sample in kept])
        assert (np.diff(found) > 0).all() and (np.diff(found) == 1).any()
        # what was measured is that of its own message
        assert [sample.roll for sample in kept[-700:]] == pytest.approx(1e-4 * np.arange(300, 1000))


@pytest.mark.parametrize('jitter', [0.0, 0.03])
@pytest.mark.parametrize('share', [0.01, 0.2])
def test_of_swapped_neighbours_on_a_clean_clock_the_late_one_is_left_out(share, jitter):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        places, swapped = np.arange(4000), []
        for place in range(100, 3998, 2):
            if rng.uniform() < share:
                places[[place, place + 1]] = places[[place + 1, place]]
                swapped.append(place + 1)
        stamps = even(50, 80) + np.int64(rng.uniform(-jitter, jitter, 4000) / 50 * 1e9)
        kept, counts, order = place_all(stamps[places])
        assert set(range(4000)) - set(kept) == set(swapped) and counts == {reasons_of.OUT_OF_ORDER: len(swapped)}
        assert order.interval == pytest.approx(0.02, rel=0.1)


def test_a_stamp_that_is_further_back_than_jitter_is_late_on_a_jittery_clock_also():
    rng = np.random.default_rng(4)
    stamps = even(50, 20) + np.int64(rng.uniform(-0.6, 0.6, 1000) / 50 * 1e9)
    late = np.arange(300, 1000, 50)
    stamps[late] = stamps[late - 5] + 1
    kept, counts, _ = place_all(stamps)
    assert counts[reasons_of.OUT_OF_ORDER] >= late.size and not set(late) & set(kept)
    assert len(kept) >= 1000 - late.size - 20


@pytest.mark.parametrize('rate', [10, 25, 400, 1000])
def test_a_new_rate_is_counted_once_and_followed(rate):
    _, counts, order = place_all(np.concatenate([even(100, 5), even(rate, 500 / rate, 5.0)]))
    assert counts[reasons_of.RATE_CHANGED] == 1
    assert order.interval == pytest.approx(1 / rate, rel=0.05)
    assert set(counts) <= {reasons_of.RATE_CHANGED, reasons_of.GAP}


@given(st.lists(st.integers(-(2**31) * 10**9, 2**31 * 10**9), max_size=60))
def test_any_stamps_are_placed_and_two_even_ones_are_kept_afterwards(stamps):
    """Whatever came before, a sensor that stamps evenly is heard again at its second sample."""
    order = StampOrder()
    for stamp in stamps:
        assert set(order.place(stamp).reasons) <= set(reasons_of.STAMP_REASONS)
    following = [order.place(int(stamp)).kept for stamp in even(100, 2.5)]
    # a sensor that lies back by less than backward_jump is late until it has caught up
    assert all(following[-120:])


def window_of(readings, **settings):
    """A window that has taken in some readings, and its steps."""
    window = MotionWindow(WindowSettings(**settings))
    return window, [window.add(one) for one in readings]


def even_readings(count, rate=100.0, start_s=0.0):
    """Readings whose roll tells their number."""
    for k in range(count):
        yield reading(EPOCH_NS + round((start_s + k / rate) * 1e9), roll=1e-4 * k)


def test_the_window_holds_the_last_seconds_in_order():
    window, steps = window_of(even_readings(1000), window=3.0, detect_decay=False)
    table = window.table()
    assert table.rows.shape == (301, len(COLUMNS)) and table.stamp_ns == EPOCH_NS + 9_990_000_000
    np.testing.assert_allclose(table.rows[:, 1], 1e-4 * np.arange(699, 1000), atol=1e-12)
    np.testing.assert_allclose(np.diff(table.rows[:, 0]), 0.01, atol=1e-6)
    assert all(step.kept for step in steps) and window.duration == pytest.approx(3.0)
    np.testing.assert_array_equal(window.table(table.rows[200, 0]).rows, table.rows[200:])
    # memory does not grow: faster samples shorten the window
    window, _ = window_of(even_readings(2000, rate=400.0), window=4.0, max_rate=100.0, detect_decay=False)
    assert window.size == 401 and window.is_short_of_memory
    assert window.duration == pytest.approx(1.0)
    np.testing.assert_allclose(window.table().rows[:, 1], 1e-4 * np.arange(1599, 2000), atol=1e-12)


def test_a_looping_bag_and_a_new_recording_begin_the_window_anew():
    window, _ = window_of([*even_readings(300), *even_readings(200)], window=60.0, detect_decay=False)
    # the first stamp after the jump is left out: only the second shows that the clock has moved
    assert window.counts[reasons_of.JUMPED_BACK] == 1 and window.size == 199
    window.record(False)
    window.add(reading(EPOCH_NS + 2 * 10**9))
    assert window.size == 199 and not window.recording
    window.record(True)
    assert window.size == 0


def test_what_is_left_out_is_counted_and_no_channel_of_the_trial():
    unusable = reading(EPOCH_NS + 10_000_000, orientation=(0.0,) * 4, rates=(1e9,) * 3)
    window, steps = window_of([reading(EPOCH_NS), reading(EPOCH_NS), unusable, reading(EPOCH_NS + 20_000_000)])
    assert [step.kept for step in steps] == [True, False, False, True]
    assert window.size == 2 and window.samples == 2
    counted = {'duplicate-stamp', 'bad-quaternion', 'absurd-value', 'nothing-usable'}
    assert {reason: count for reason, count in window.counts.items() if count} == dict.fromkeys(counted, 1)
    assert set(window.counts) == set(WINDOW_REASONS)
    without = [r._replace(orientation_covariance=NOT_GIVEN) for r in even_readings(100)]
    window, _ = window_of(without, detect_decay=False)
    trial = window.table().trial()
    assert trial.roll is None and trial.time[0] == 0.0 and trial.axes == ('roll', 'pitch')
    with pytest.raises(InputError, match='window is empty'):
        MotionWindow().table().trial()


# of half a cycle, too, whose period is known less well
@pytest.mark.long
@pytest.mark.parametrize(
    ('rate', 'axis', 'damping', 'near'),
    [(25.0, 'roll', 0.08, 0.03), (200.0, 'pitch', 0.03, 0.03), (25.0, 'pitch', 0.7, 0.15)],
)
def test_a_decay_that_has_ended_is_told_once(rate, axis, damping, near):
    readings = decay_stream(rate, duration=75.0, release=12.0, axis=axis, damping=damping)
    _, steps = window_of(readings)
    told = [(index / rate, step.finished) for index, step in enumerate(steps) if step.finished is not None]
    assert len(told) == 1
    when, decay = told[0]
    begin = decay.table.rows[0, 0] - EPOCH_NS * 1e-9
    assert decay.axis == axis and decay.segment.period == pytest.approx(2.6, rel=near)
    assert begin + decay.segment.start == pytest.approx(12.0, abs=0.4)
    # not before it has fallen to an eighth (the faint tail is not waited for), nor long after
    fallen = 12.0 + np.log(8) / (damping * 2 * np.pi / 2.6)
    assert fallen - 2.0 < when < fallen + 12.0
    assert decay.table.rows[-1, 0] - EPOCH_NS * 1e-9 == pytest.approx(when, abs=1.5 / rate)


@pytest.mark.long
def test_every_one_of_several_decays_is_told_and_none_once_that_is_off():
    streams = [decay_stream(50.0, 40.0, 10.0, seed=n, first_ns=EPOCH_NS + n * 40 * 10**9) for n in range(4)]
    window, steps = window_of(one for stream in streams[:2] for one in stream)
    window.resize(120.0)  # what was told is not told again
    steps += [window.add(one) for one in streams[2]]
    told = [step.finished for step in steps if step.finished is not None]
    starts = [d.table.rows[0, 0] - EPOCH_NS * 1e-9 + d.segment.start for d in told]
    assert starts == pytest.approx([10.0, 50.0, 90.0], abs=0.5)
    window.detect_decay(False)
    assert all(window.add(one).finished is None for one in streams[3])


def test_releases_that_follow_each_other_quickly_are_all_told():
    begun = enumerate(range(EPOCH_NS, EPOCH_NS + 5 * 12_500_000_000, 12_500_000_000))
    streams = [decay_stream(25.0, 12.5, 4.5, hold=2.5, seed=n, first_ns=first) for n, first in begun]
    _, steps = window_of(one for stream in streams for one in stream)
    assert sum(step.finished is not None for step in steps) >= 4


@pytest.mark.parametrize(('rest', 'number'), [(3.0, 0), (4.0, 1)])
def test_a_push_that_waves_follow_is_told_if_the_craft_was_seen_to_rest_before(rest, number):
    time = np.arange(0.0, rest + 25.0, 0.02)
    since, waves = np.maximum(time - rest, 0.0), np.maximum(time - rest - 19.0, 0.0)
    pitch = 0.1 * np.exp(-0.2 * since) * np.sin(np.pi * since) + 0.1 * np.sin(np.pi * waves)
    pitch += np.random.default_rng(0).normal(0.0, 3e-4, time.size)
    stamps = EPOCH_NS + np.rint(1e9 * time).astype(int)
    told = zip(stamps.tolist(), pitch.tolist(), np.gradient(pitch, 0.02).tolist(), strict=True)
    _, steps = window_of(reading(stamp, pitch=angle, pitch_rate=rate) for stamp, angle, rate in told)
    assert sum(step.finished is not None for step in steps) == number


def test_a_fast_table_is_averaged_and_a_slow_one_is_not():
    rows = np.arange(8000.0).reshape(1000, 8)
    rows[:, 0] = np.arange(1000) / 400.0
    found = averaged(MotionTable(rows, 0), 50.0).rows
    assert found.shape == (125, 8)
    np.testing.assert_allclose(found[0], rows[:8].mean(axis=0))
    np.testing.assert_allclose(found[-1], rows[-8:].mean(axis=0))
    assert averaged(MotionTable(rows, 0), 300.0).rows is rows


@pytest.mark.parametrize(('length', 'kept'), [(8.0, 501), (2.0, 201)])
def test_a_window_of_another_length_keeps_what_fits(length, kept):
    window, _ = window_of(even_readings(1000), window=5.0, detect_decay=False)
    before = window.table().rows
    window.resize(length)
    np.testing.assert_array_equal(window.table().rows, before[-kept:])
    for one in even_readings(1000, start_s=10.0):
        window.add(one)
    assert window.duration == pytest.approx(length) and window.size == round(100 * length) + 1


def test_settings_that_make_no_sense_are_refused():
    for kind, name, value in ((StampSettings, 'gap_limit', 0.0), (WindowSettings, 'smallest_decay', nan)):
        with pytest.raises(InputError, match=name):
            kind(**{name: value})


STEPS = np.arange(600)


def burst_stamps(size, within, rate):
    """Samples that are read several at once, ns, and the time of each, s, up to a delay."""
    last = np.minimum(STEPS // size * size + size - 1, STEPS[-1])
    return EPOCH_NS + np.round(1e9 * last / rate).astype(int) + within * (STEPS % size), STEPS / rate


@pytest.mark.parametrize('rate', [20.0, 100.0, 1000.0])
@pytest.mark.parametrize(('size', 'within'), [(3, 3_000), (8, 0), (8, 30_000), (12, 10_000)])
def test_bursts_are_spread_by_the_period_of_the_sensor(rate, size, within):
    stamps, times = burst_stamps(size, within, rate)
    angle, taker = 0.2 * np.sin(2.0 * np.pi * times * rate / 200.0), Intake(STRAIGHT, StampSettings())
    found = [taker.take(reading(int(ns), a)) for ns, a in zip(stamps, angle, strict=True)]
    counted = Counter(reason for each in found for reason in each.reasons)
    assert counted.pop(reasons_of.BURSTS) == 1 and counted.keys() <= {reasons_of.DUPLICATE}
    spread = np.array([each.sample.stamp_ns for each in found[300:]]) * 1e-9 - EPOCH_NS * 1e-9
    assert np.abs(spread - times[300:]).max() < 0.3 / rate + size * within * 1e-9
    assert np.diff(spread) == pytest.approx(1.0 / rate, rel=0.2)
    assert np.degrees([each.sample.roll for each in found[300:]]) == pytest.approx(np.degrees(angle[300:]))


@pytest.mark.parametrize('case', ['even', 'jitter', 'pauses', 'pauses at rest', 'two sensors'])
def test_what_comes_otherwise_is_no_burst(case):
    rng = np.random.default_rng(3)
    times = STEPS / 100.0
    if case == 'jitter':
        times = np.sort(times + rng.normal(0.0, 0.004, times.size))
    if 'pauses' in case:
        times = times + 0.2 * (STEPS // 8)
    if case == 'two sensors':
        times = np.repeat(times[::2], 2)[: STEPS.size]
    angle = 0.2 * np.sin(2.0 * times) * (case != 'pauses at rest') + rng.normal(0.0, 1e-4, times.size)
    taker = Intake(STRAIGHT, StampSettings())
    found = [taker.take(reading(EPOCH_NS + round(1e9 * t), a)) for t, a in zip(times, angle, strict=True)]
    assert not any(reasons_of.BURSTS in each.reasons for each in found)
