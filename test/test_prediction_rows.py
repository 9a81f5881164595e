"""Rows of samples whose motion is known at any time: lost ones, late ones, and other rates and periods."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from repository import ROOT

from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.rows import (
    _NEW_STEP,
    CHANNELS,
    OF_CHANNELS,
    OF_MEANS,
    OF_SAMPLE,
    ROWS_A_PERIOD,
    SMOOTHED_FROM,
    RowClock,
    SampleClock,
    Sampled,
    resampled,
)
from swath_sysid.formats.reading import read_trial
from swath_sysid.pipeline.record_run import run_through

SIZE = np.array([0.1, 0.05])
PHASE = np.array([0.4, 1.9])


def motion(time, period=USUAL_PERIOD):
    """Roll, pitch and their rates, shape (..., 4), of sines with a period."""
    w = 2.0 * math.pi / period
    turn = w * np.asarray(time)[..., None] + PHASE
    return np.concatenate([SIZE * np.sin(turn), SIZE * w * np.cos(turn)], axis=-1)


def sample_at(time, period=USUAL_PERIOD):
    """With an acceleration along x that grows by one a second."""
    return CraftSample(round(1e9 * time), *motion(time, period).tolist(), time, 0.0, 9.8, *(math.nan,) * 4)


def rows_of(clock, times, period=USUAL_PERIOD, stamps=None, filtered=(None, None), change=None):
    """(time, row) of each, the rows laid out for the period, as the forecaster does; ``change``d samples if given."""
    rows, stamps = [], times if stamps is None else stamps
    for before, stamp, time in zip(stamps[:-1], stamps[1:], times[1:], strict=True):
        sampled = clock.sensor.follow(stamp - before)
        if clock.is_laid_out_for(period):
            clock.corrected()
        else:
            clock.lay_out(period)
        sample = sample_at(time, period)
        found = clock.take(sample if change is None else change(sample), sampled, filtered)
        rows += [(time - age, row) for age, row in found]
    return rows


def values_of(rows, columns):
    return np.array([row[columns] for _, row in rows])


def clock_ticks(rate, count):
    return np.arange(count) / rate


# -- whole records


@pytest.mark.parametrize(('rate', 'period'), [(10.0, 3.2), (50.0, 3.2), (100.0, 3.2), (100.0, 12.0), (400.0, 1.0)])
def test_so_many_samples_as_come_nearest_to_a_share_of_the_period_are_a_row(rate, period):
    clock, times = RowClock(), clock_ticks(rate, 2000)
    rows = rows_of(clock, times, period)
    samples = round(period / ROWS_A_PERIOD * rate)
    assert clock.samples == samples and clock.step == pytest.approx(samples / rate)
    at = np.array([time for time, _ in rows])
    assert np.diff(at) == pytest.approx(samples / rate) and len(rows) == 1 + (1998 // samples)
    np.testing.assert_allclose(values_of(rows, OF_SAMPLE), motion(at, period), atol=1e-12)
    means = motion(times[2:], period)[: samples * (len(rows) - 1)].reshape(-1, samples, 4).mean(axis=1)
    np.testing.assert_allclose(values_of(rows[1:], OF_MEANS), means, atol=1e-12)
    if samples < SMOOTHED_FROM:
        np.testing.assert_array_equal(values_of(rows, OF_CHANNELS)[:, :4], values_of(rows, OF_SAMPLE))


def test_a_slower_sensor_gives_one_row_per_sample():
    clock, times = RowClock(), clock_ticks(4.0, 50)
    assert USUAL_PERIOD / ROWS_A_PERIOD < 0.25
    rows = rows_of(clock, times)
    assert [time for time, _ in rows] == pytest.approx(times[1:]) and clock.step == pytest.approx(0.25)


def test_filtered_motion_takes_the_part_of_a_smoothed_one_and_the_rest_is_smoothed():
    clock = RowClock()
    rows = rows_of(clock, clock_ticks(100.0, 500), filtered=((0.7, -0.3), None))
    channels = values_of(rows, OF_CHANNELS)
    assert clock.is_smoothed
    for name, value in (('roll', 0.7), ('roll_rate', -0.3)):
        assert (channels[:, CHANNELS.index(name)] == value).all()
    # a mean that moves by 2 / n is (n - 2) / 2 samples late on a ramp
    late = (clock.samples - 2) / 2.0 / 100.0
    at = np.array([time for time, _ in rows])
    ramp = channels[:, CHANNELS.index('accel_x')]
    assert ramp[20:] == pytest.approx(at[20:] - late, abs=1e-6)
    # no later than on average in the block: the phase of a pitch that is not filtered is as late
    assert np.isnan(channels[:, CHANNELS.index('heave')]).all()


@pytest.mark.parametrize('missing', [('roll_rate',), ('pitch', 'pitch_rate'), ('roll',)])
def test_what_is_not_measured_is_no_channel_though_a_filter_knows_it(missing):
    clock = RowClock()
    rows = rows_of(
        clock,
        clock_ticks(100.0, 500),
        filtered=((0.7, -0.3), (0.2, 0.4)),
        change=lambda sample: sample._replace(**dict.fromkeys(missing, math.nan)),
    )
    assert clock.is_smoothed
    channels = values_of(rows, OF_CHANNELS)
    for name, value in (('roll', 0.7), ('roll_rate', -0.3), ('pitch', 0.2), ('pitch_rate', 0.4)):
        found = channels[:, CHANNELS.index(name)]
        assert np.isnan(found).all() if name in missing else (found == value).all()


# -- lost samples


@pytest.mark.parametrize('rate', [10.0, 30.0, 100.0])
@pytest.mark.parametrize('lost', [1, 2, 4])
def test_a_row_without_a_sample_is_missing_and_the_others_are_measured(rate, lost):
    clock = RowClock()
    samples = max(1, round(USUAL_PERIOD / ROWS_A_PERIOD * rate))
    count = lost * samples
    times = clock_ticks(rate, 120 * samples)
    gaps = samples * np.arange(20, 110, 10)
    rows = rows_of(clock, np.delete(times, [place + k for place in gaps for k in range(count)]))
    at, is_known = np.array([time for time, _ in rows]), np.array([row is not None for _, row in rows])
    assert np.diff(at) == pytest.approx(clock.step)
    # over two steps a line tells the row that lies between two samples
    assert lost - (samples > 1) <= np.count_nonzero(~is_known) / gaps.size <= lost + (samples > 1)
    found = values_of([row for row, known in zip(rows, is_known, strict=True) if known], OF_SAMPLE)
    np.testing.assert_allclose(found, motion(at[is_known]), atol=1e-9 if samples == 1 else 2e-3)


@pytest.mark.long
@example(rate=100.0, bursts=[(23, 1), (10, 1)])
@given(rate=st.sampled_from([30.0, 100.0, 200.0]), bursts=st.lists(st.tuples(st.integers(1, 200), st.integers(1, 12))))
def test_rows_stay_whole_steps_apart_whatever_is_lost_how_soon_after_another_loss(rate, bursts):
    clock, times = RowClock(), clock_ticks(rate, round(4.0 * rate))
    kept, begin = np.ones(times.size, dtype=bool), round(1.5 * rate)
    for lost, between in bursts:
        kept[begin : begin + lost] = False
        begin += lost + between
    rows = rows_of(clock, times[kept])
    assert np.diff([time for time, _ in rows]) == pytest.approx(clock.step)
    known = [(time, row) for time, row in rows if row is not None]
    error = np.abs(values_of(known, OF_SAMPLE) - motion(np.array([time for time, _ in known]))).max(axis=0)
    longest, w = clock.longest_filled + clock.step, 2.0 * math.pi / USUAL_PERIOD
    assert (error[:2] <= longest**4 / 384.0 * w**4 * SIZE).all()
    assert (error[2:] <= longest**2 / 8.0 * w**3 * SIZE).all()


@pytest.mark.parametrize('rate', [30.0, 100.0])
def test_within_a_row_a_line_is_drawn_between_rates_and_a_cubic_between_angles(rate):
    """Errors are within the bounds of their theorems; of a ramp nothing is missing."""
    times = clock_ticks(rate, round(12.0 * rate))
    clock, lost = RowClock(), round(USUAL_PERIOD / ROWS_A_PERIOD * rate) - 1
    kept = np.delete(times, [place + k for place in range(40, times.size - 40, 7 * lost) for k in range(lost)])
    rows = rows_of(clock, kept)
    at = np.array([time for time, _ in rows])
    error = np.abs(values_of(rows, OF_SAMPLE) - motion(at)).max(axis=0)
    h, w = (lost + 1) / rate, 2.0 * math.pi / USUAL_PERIOD
    assert (error[:2] <= 1.001 * h**4 / 384.0 * w**4 * SIZE).all() and (
        error[2:] <= 1.001 * h**2 / 8.0 * w**3 * SIZE
    ).all()
    assert (error > 0.0).all()
    whole = values_of(rows_of(RowClock(), times), OF_CHANNELS)[:, CHANNELS.index('accel_x')]
    assert values_of(rows, OF_CHANNELS)[:, CHANNELS.index('accel_x')] == pytest.approx(whole, abs=1e-9)


@pytest.mark.parametrize('lost', [1, 3])
def test_a_rate_that_is_filled_is_no_noisier_than_those_beside_it(lost):
    """Whatever the noise of the angles, whose difference over so short a time says nothing."""
    rng = np.random.default_rng(0)
    kept = np.delete(clock_ticks(100.0, 2000), [place + k for place in range(100, 1900, 7) for k in range(lost)])
    rows = rows_of(RowClock(), kept, change=lambda sample: sample._replace(roll=rng.normal(0.0, 5e-3), roll_rate=0.01))
    assert values_of(rows, OF_MEANS)[:, 2] == pytest.approx(0.01)


def test_an_angle_without_rate_is_filled_by_a_line():
    kept = np.delete(clock_ticks(100.0, 400), 201)
    rows = rows_of(RowClock(), kept, change=lambda sample: sample._replace(roll_rate=math.nan))
    at = np.array([time for time, _ in rows])
    line = np.interp(at, kept, motion(kept)[:, 0])
    assert (np.abs(at - 2.01) < 1e-6).any()
    np.testing.assert_allclose(values_of(rows, OF_SAMPLE)[:, 0], line, atol=1e-9)


@pytest.mark.parametrize('rate', [10.0, 100.0])
def test_over_a_silence_there_is_a_row_for_each_step_and_none_is_known(rate):
    clock, times = RowClock(), clock_ticks(rate, round(12.0 * rate))
    begin, lost = round(6.0 * rate), round(5.0 * rate) - 1
    rows = rows_of(clock, np.delete(times, np.arange(begin, begin + lost)))
    steps = np.diff([time for time, _ in rows]) / clock.step
    # also where samples come again
    assert np.abs(steps - 1.0).max() < 1e-6, steps.max()
    # the first known row is of a whole step of samples
    empty = [time for time, row in rows if row is None]
    assert empty and all(6.0 - clock.step <= time < 11.0 + clock.step for time in empty)
    known = [(time, row) for time, row in rows if row is not None]
    np.testing.assert_allclose(values_of(known, OF_SAMPLE), motion(np.array([time for time, _ in known])), atol=1e-9)


@pytest.mark.release
@pytest.mark.parametrize('lost', [1, 2])
def test_after_lost_samples_of_a_buoy_forecasts_err_as_those_of_the_whole_record(lost):
    trial = read_trial(ROOT / 'records' / 'morro_buoy.csv').between(0.0, 240.0)
    places = np.arange(1203, trial.time.size - 60, 83)
    kept = np.delete(np.arange(trial.time.size), [place + k for place in places for k in range(lost)])
    thinned = Trial(trial.time[kept], **{name: values[kept] for name, values in trial.channels.items()})
    squares = []
    for measured in (thinned, trial):
        run = run_through(measured, ForecasterSettings((0.1, 0.2, 0.3, 0.5), 0.5, 0.5, forecast_rate=10.0))
        after = [
            issued
            for issued in run.steps
            if 0.05 < np.min((issued.stamp - trial.time[places]) % 1e9) < 2.05 + 0.1 * lost
        ]
        ahead = [issued.stamp + issued.forecast.leads for issued in after]
        errors = [
            [np.interp(time, trial.time, angle) - mean for time, mean in zip(ahead, means, strict=True)]
            for place, angle in enumerate((trial.roll, trial.pitch))
            for means in ([issued.forecast.mean[:, place] for issued in after],)
        ]
        squares.append(np.mean(np.square(errors), axis=1))
    ratio = np.sqrt(squares[0] / squares[1])
    assert len(places) > 10 and ratio.mean() < 1.1 and ratio.max() < 1.25, ratio


@pytest.mark.parametrize('share', [0.01, 0.05, 0.2])
@pytest.mark.parametrize('jitter', [0.0, 0.05, 0.1])
def test_samples_lost_at_random_are_counted_exactly(share, jitter):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        kept = np.flatnonzero(rng.uniform(size=6000) > share)
        stamps = 0.02 * (kept + rng.uniform(-jitter, jitter, kept.size))
        clock = SampleClock()
        counted = [clock.follow(elapsed).intervals for elapsed in np.diff(stamps)]
        # after the first, of which the median is made
        np.testing.assert_array_equal(counted[60:], np.diff(kept)[60:])
        assert clock.interval == pytest.approx(0.02, rel=2e-3)


@pytest.mark.parametrize('share', [0.0, 0.1, 0.3])
def test_the_first_interval_is_known_though_samples_are_lost_from_the_beginning(share):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        kept = np.flatnonzero(rng.uniform(size=200) > share)
        clock, intervals = SampleClock(), []
        for elapsed in 0.02 * np.diff(kept):
            clock.follow(elapsed)
            intervals.append(clock.interval)
        # once most are whole; the loop begins at a tick that may be of two
        assert np.array(intervals[10:]) == pytest.approx(0.02, rel=5e-3 if share else 1e-9)


def test_stamps_in_whole_milliseconds_give_an_interval_between_them():
    """Of 33, 33 and 34 ms, of which the median is 33."""
    stamps = np.round(1e3 * np.arange(52) / 30.0) / 1e3
    clock = SampleClock()
    for count, elapsed in enumerate(np.diff(stamps), 1):
        clock.follow(elapsed)
        # a rounding at either end, over so many
        assert abs(clock.interval * 30.0 - 1.0) < 0.03 / count + 1e-3
    assert np.median(np.diff(stamps)) == pytest.approx(0.033)


# -- stamps


@example(intervals=[5.0, 1e-9, 2e-8])
@given(st.lists(st.one_of(st.just(0.002), st.floats(1e-9, 60.0)), min_size=1, max_size=80))
def test_whatever_stamps_come_the_interval_is_positive_and_time_goes_on(intervals):
    """One that was negative ended the predictor, when spoilt stamps came beside those of the sensor."""
    clock = SampleClock()
    for elapsed in intervals:
        assert clock.follow(elapsed).elapsed > 0.0 and 0.0 < clock.interval < math.inf


@pytest.mark.parametrize('kind', ['white', 'late'])
def test_jitter_of_stamps_is_smoothed(kind):
    """A loop of gain g leaves sqrt(g / (2 - g)) of white jitter: a quarter."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        true = 0.02 * np.arange(4000)
        late = rng.uniform(-0.2, 0.2, true.size) if kind == 'white' else rng.exponential(0.05, true.size)
        stamps = true + 0.02 * late
        clock = SampleClock()
        sampled = [clock.follow(elapsed) for elapsed in np.diff(stamps)]
        told = np.cumsum([each.elapsed for each in sampled])
        error = (told - true[1:])[500:]
        assert error.std() < 0.3 * (0.02 * late).std()
        # and the steps that filters take are even
        steps = np.array([each.elapsed for each in sampled])[500:]
        assert steps.std() < 0.15 * np.diff(stamps).std()
        if kind == 'white':
            assert {each.intervals for each in sampled} == {1}


@pytest.mark.parametrize('late', [0.6, 0.9])
def test_a_sample_that_comes_with_the_next_one_is_none_lost_and_time_goes_on(late):
    """Every fifth on average is late by so much of an interval: then two ticks pass at once, and none."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        delay = np.where(rng.uniform(size=4000) < 0.2, late, 0.0)
        stamps = 0.02 * (np.arange(4000) + delay)
        clock = SampleClock()
        sampled = [clock.follow(elapsed) for elapsed in np.diff(stamps)]
        assert all(each.elapsed > 0.0 for each in sampled)
        intervals = np.array([each.intervals for each in sampled])
        assert intervals.min() >= 0
        assert abs(intervals[60:].sum() - intervals[60:].size) <= 1
        told = np.cumsum([each.elapsed for each in sampled])
        error = (told - 0.02 * np.arange(1, 4000))[500:] / 0.02
        assert np.abs(error).max() < 1.0 and abs(clock.interval / 0.02 - 1.0) < 5e-3


def test_no_row_comes_of_a_sample_within_the_same_interval():
    for rate in (10.0, 100.0):
        clock, times = RowClock(), clock_ticks(rate, 400)
        rows_of(clock, times)
        before, end = clock.since_row, times[-1]
        assert clock.take(sample_at(end + 0.1 / rate), Sampled(0.1 / rate, 0), (None, None)) == []
        assert clock.since_row == before
        # the rows go on as if it had not come
        rows = []
        for place in range(1, 2 * clock.samples + 1):
            rows += clock.take(sample_at(end + place / rate), Sampled(1.0 / rate, 1), (None, None))
        assert len(rows) == 2
        assert [row[OF_SAMPLE] for _, row in rows][-1] == pytest.approx(
            motion(np.array(end + (2 * clock.samples - before * rate) / rate)).tolist()
        )


@pytest.mark.parametrize('drift', [-1e-2, 1e-3, 2e-2])
def test_a_clock_that_drifts_is_followed_and_no_sample_taken_for_lost(drift):
    time = 0.02 * np.arange(6000)
    stamps = time + drift * time**2 / (2.0 * time[-1])
    clock = SampleClock()
    assert {clock.follow(elapsed).intervals for elapsed in np.diff(stamps)} == {1}
    assert clock.interval == pytest.approx(0.02 * (1.0 + drift), rel=1e-3)


# -- other rates and periods


@pytest.mark.parametrize(
    'rates', [(50.0, 10.0), (10.0, 50.0), (100.0, 40.0), (40.0, 100.0), (10.0, 100.0), (50.0, 12.0)]
)
def test_another_rate_is_followed_and_rows_stay_on_the_motion(rates):
    times = np.concatenate([clock_ticks(rates[0], round(30.0 * rates[0])), 30.0 + clock_ticks(rates[1], 1000)])
    clock = RowClock()
    rows = rows_of(clock, times)
    assert clock.interval == pytest.approx(1.0 / rates[1], rel=1e-3)
    samples = max(1, round(USUAL_PERIOD / ROWS_A_PERIOD * rates[1]))
    assert clock.step == pytest.approx(samples / rates[1], rel=_NEW_STEP)
    known = [(time, row) for time, row in rows if row is not None]
    at = np.array([time for time, _ in known])
    # within what a cubic over the longer interval leaves and, until the new rate shows, half an interval's motion
    h, w = 1.0 / min(rates), 2.0 * math.pi / USUAL_PERIOD
    error = np.abs(values_of(known, OF_SAMPLE)[:, :2] - motion(at)[:, :2])
    is_new = (at > 29.99) & (at < 30.0 + 15.0 / rates[1])
    limit = 1.001 * h**4 / 384.0 * w**4 + np.where(is_new, 0.5 / rates[0] * w, 0.0)[:, None]
    assert (error <= limit * SIZE + 1e-9).all()
    after = at[at > times[-500]]
    assert np.diff(after) == pytest.approx(clock.step, rel=0.02)


def test_another_period_gives_another_step_and_one_hardly_different_none():
    clock, times = RowClock(), clock_ticks(100.0, 300)
    rows_of(clock, times)
    assert clock.step == pytest.approx(0.1)
    assert not clock.lay_out(1.1 * USUAL_PERIOD) and clock.step == pytest.approx(0.1)
    assert clock.is_laid_out_for(1.1 * USUAL_PERIOD) and not clock.is_laid_out_for(USUAL_PERIOD)
    for factor in (2.0, 0.5, 4.0):
        assert clock.lay_out(factor * USUAL_PERIOD) and clock.step == pytest.approx(0.1 * factor)
        # the next sample is a row
        assert len(clock.take(sample_at(3.0), Sampled(0.01, 1), (None, None))) == 1


def test_after_a_restart_the_next_sample_is_a_row():
    clock = RowClock()
    rows_of(clock, clock_ticks(100.0, 204))
    assert 0.0 < clock.since_row < clock.step
    clock.reset()
    ((age, row),) = clock.take(sample_at(5.0), Sampled(0.0, 1), (None, None))
    assert age == 0.0 and clock.since_row == 0.0
    np.testing.assert_allclose(row[OF_MEANS], motion(5.0))


# -- rows at another step


@pytest.mark.parametrize('ratio', [0.5, 0.7, 1.3, 2.0, 3.7])
def test_rows_at_another_step_end_with_the_newest_and_lie_on_the_motion(ratio):
    time = 0.1 * np.arange(200)
    found = resampled(motion(time), ratio)
    at = time[-1] - 0.1 * ratio * np.arange(len(found))[::-1]
    assert at[0] >= -1e-9 and at[0] < 0.1 * ratio
    np.testing.assert_allclose(found[-1], motion(time[-1]), atol=1e-12)
    # a cubic through four: 9 / 16 / 24 of the fourth derivative amid them, and one at the edges
    w = 2.0 * math.pi / USUAL_PERIOD
    bound = (0.1 * w) ** 4 / 24.0 * np.concatenate([SIZE, w * SIZE])
    error = np.abs(found - motion(at))
    assert (error[4:-4] <= 9.0 / 16.0 * 1.001 * bound).all() and (error <= 1.001 * bound).all()


def test_rows_beside_a_missing_one_are_missing_and_few_rows_are_taken_as_they_are():
    rows = motion(0.1 * np.arange(50))
    rows[25] = math.nan
    missing = np.flatnonzero(np.isnan(resampled(rows, 2.0)).any(axis=1))
    assert 0 < missing.size <= 2
    assert np.isfinite(np.delete(resampled(rows, 2.0), missing, axis=0)).all()
    for count in (0, 1, 2, 3):
        few = resampled(rows[:count], 1.5)
        assert few.shape[1] == 4 and (not count or (few[-1] == rows[count - 1]).all())
