"""Which readings of angle and rate are believed: each fault of a sensor against the motion that it hides."""

import math

import numpy as np
import pytest

from swath_sysid.attitude.motion.channels import Channels, Motion

PERIOD, SIZE, INTERVAL = 3.2, 0.05, 0.01
TIME = INTERVAL * np.arange(7000)
BEGINS, ENDS = 3000, 6000
IS_WRONG = (np.arange(TIME.size) >= BEGINS) & (np.arange(TIME.size) < ENDS)


def motion_of(seed=1, period=PERIOD):
    """Angle and rate of a sea about a period, without noise."""
    generator = np.random.default_rng(seed)
    frequencies = math.tau / period * generator.uniform(0.7, 1.4, 20)[:, None]
    phases, size = frequencies * TIME + generator.uniform(0.0, math.tau, (20, 1)), SIZE * math.sqrt(0.1)
    return size * np.sin(phases).sum(axis=0), (size * frequencies * np.cos(phases)).sum(axis=0)


def measured(angle, rate, seed=2):
    noise = np.random.default_rng(seed).normal(size=(2, TIME.size))
    return angle + 3e-4 * noise[0], rate + 2e-3 * noise[1]


def believed(angles, rates, interval=INTERVAL, period=PERIOD):
    """Angles and rates as they are believed, the readings that are expected of them and their variance, and codes."""
    channels, motion = Channels(), Motion(period, SIZE, (9e-8, 4e-6), (0.0, 1e-8))
    told, codes = [], []
    for number, (angle, rate) in enumerate(zip(angles.tolist(), rates.tolist(), strict=True)):
        used = channels.take(angle, rate, math.nan, interval if number else 0.0, motion)
        told.append((*used, *channels.reading))
        codes.append(channels.findings(period / math.tau))
    return np.array(told).T, codes


def held(told, true):
    """Whether the 90 % interval of the sensor's angle holds the true one, where the angle is told."""
    angle, _, level, variance = told
    known = np.isfinite(angle)
    return np.mean(np.abs(angle + level - true)[known] <= 1.645 * np.sqrt(variance + 1e-6)[known])


@pytest.mark.parametrize('sign', [1.0, -1.0])
@pytest.mark.parametrize(('seed', 'interval'), [(1, 0.01), (2, 0.005), (3, 0.04)])
def test_a_sound_sensor_is_believed_as_it_is(seed, interval, sign):
    angles, rates = measured(*motion_of(seed, PERIOD * INTERVAL / interval), seed)
    told, codes = believed(sign * angles, sign * rates * INTERVAL / interval, interval)
    np.testing.assert_array_equal(told[:2], [sign * angles, sign * rates * INTERVAL / interval])
    assert not any(codes)


@pytest.mark.parametrize('at', [3000, 3037, 3123, 3160])
def test_a_rate_in_another_unit_is_left_out_until_it_is_right_again(at):
    angles, rates = measured(*motion_of())
    is_wrong = (np.arange(TIME.size) >= at) & (np.arange(TIME.size) < ENDS)
    (angle, rate, *_), codes = believed(angles, np.where(is_wrong, math.degrees(1.0) * rates, rates))
    used = np.isfinite(rate)
    assert np.abs(rate[used & is_wrong]).max(initial=0.0) < 3.0 * np.abs(rates).max()
    assert used[is_wrong].mean() < 0.02
    assert used[ENDS + 120 :].all() and 'rate-wrong' in codes[at + 100] and not any(codes[ENDS + 120 :])
    np.testing.assert_array_equal(angle[at + 1 : ENDS], angles[at + 1 : ENDS])


def test_a_frame_that_turns_is_never_taken_over():
    angles, rates = measured(*motion_of())
    sign = np.where(IS_WRONG, -1.0, 1.0)
    (angle, rate, *_), codes = believed(sign * angles, sign * rates)
    assert np.isnan(angle[IS_WRONG]).all() and np.isnan(rate[IS_WRONG]).all()
    np.testing.assert_array_equal(angle[~IS_WRONG], angles[~IS_WRONG])
    assert all(each == ('frame-turned',) for each in codes[BEGINS:ENDS]) and not any(codes[ENDS:])


def test_after_a_silence_that_nothing_bridges_a_turned_sensor_begins_anew():
    angles, rates = measured(*motion_of())
    channels, motion = Channels(), Motion(PERIOD, SIZE, (9e-8, 4e-6), (0.0, 1e-8))
    for number in range(4000):
        sign = -1.0 if number >= BEGINS else 1.0
        channels.take(sign * angles[number], sign * rates[number], math.nan, INTERVAL, motion)
    assert channels.is_turned
    assert channels.take(0.01, 0.02, math.nan, 0.0, motion) == (0.01, 0.02) and not channels.is_turned


@pytest.mark.parametrize('ramp', [0.01, 0.05])
def test_a_mount_that_is_hit_is_the_new_level_within_four_periods(ramp):
    true, rate = motion_of()
    true = true + 0.09 * np.clip((TIME - TIME[BEGINS]) / ramp, 0.0, 1.0)
    told, codes = believed(*measured(true, rate))
    during = slice(BEGINS, BEGINS + round(4.0 * PERIOD / INTERVAL))
    assert held(told[:, during], true[during]) > 0.9
    np.testing.assert_allclose((told[0] + told[2])[during.stop :], true[during.stop :], atol=2e-3)
    assert 'angle-jumped' in codes[BEGINS + 60] and not any(codes[during.stop :])
    # what filters follow has not jumped
    assert np.nanmax(np.abs(np.diff(told[0][BEGINS - 5 :]))) < 0.01


def test_a_sensor_that_finds_back_to_its_level_is_told_by_its_rate_meanwhile():
    true, rate = motion_of()
    off = np.where(TIME >= TIME[BEGINS], 0.07 * np.exp((TIME[BEGINS] - TIME) / 3.0), 0.0)
    told, codes = believed(*measured(true + off, rate))
    during = slice(BEGINS, BEGINS + round(4.0 * PERIOD / INTERVAL))
    assert held(told[:, during], true[during]) > 0.9
    np.testing.assert_allclose((told[0] + told[2])[-1000:], true[-1000:], atol=3e-3)
    assert 'angle-jumped' in codes[BEGINS + 60] and not any(codes[-500:])


def test_an_angle_that_comes_late_is_taken_for_what_it_was():
    true, rate = motion_of()
    angles, rates = measured(true, rate)
    angles = np.where(IS_WRONG, np.roll(angles, 10), angles)
    told, codes = believed(angles, rates)
    later = slice(BEGINS + round(2.0 * PERIOD / INTERVAL), ENDS)
    error = np.sqrt(np.mean((told[0] + told[2] - true)[later] ** 2))
    assert error < 0.2 * np.sqrt(np.mean((angles - true)[later] ** 2))
    assert 'angle-late' in codes[later.stop - 1] and not any(codes[-50:])


def test_an_angle_that_is_corrected_though_it_is_not_late_is_believed_again():
    angles, rates = measured(*motion_of())
    channels, motion = Channels(), Motion(PERIOD, SIZE, (9e-8, 4e-6), (0.0, 1e-8))
    told = []
    for number, (angle, rate) in enumerate(zip(angles.tolist(), rates.tolist(), strict=True)):
        if number == BEGINS:
            channels.lag = 0.05
        told.append(channels.take(angle, rate, math.nan, INTERVAL, motion)[0])
    assert channels.lag == 0.0
    np.testing.assert_array_equal(told[-1500:], angles[-1500:])


@pytest.mark.parametrize('size', [0.03, 0.1, math.pi])
def test_single_wrong_angles_are_left_out_and_change_nothing_else(size):
    angles, rates = measured(*motion_of())
    spiked = angles.copy()
    places = np.arange(3000, 6000, 47)
    spiked[places] += size
    (angle, rate, level, variance), codes = believed(spiked, rates)
    # half a turn, by which nothing is hit, is expected of no reading to come
    assert np.abs(level).max() < (0.06 * size if size < 1.0 else 1e-6) and variance[places[-1]] < 1e-3
    others = np.setdiff1d(np.arange(TIME.size), places)
    assert np.isnan(angle[places]).all()
    np.testing.assert_array_equal(angle[others], angles[others])
    assert sum('outlier' in each for each in codes) == places.size


def test_a_shock_is_believed_at_once_and_a_coarser_angle_within_two_periods():
    true, rate = motion_of()
    # the rate jumps within a sample, as of a hull that a line catches, and the angle follows it
    kick = np.where(TIME >= TIME[BEGINS], 0.25 * np.exp((TIME[BEGINS] - TIME) / 0.4), 0.0)
    angles, rates = measured(true + np.cumsum(kick) * INTERVAL, rate + kick)
    told, codes = believed(angles, rates)
    assert np.isfinite(told[:2, BEGINS + 10 :]).all() and not any(codes[BEGINS + 10 :])
    coarse = np.where(IS_WRONG, 0.01 * np.round(angles / 0.01), angles)
    told, codes = believed(coarse, rates)
    assert not any('outlier' in each or 'angle-jumped' in each for each in codes[BEGINS + 700 : ENDS])


def test_after_a_gap_an_angle_is_believed():
    angles, rates = measured(*motion_of())
    angles[IS_WRONG] = math.nan
    (angle, rate, *_), codes = believed(angles, rates + 0.01)
    np.testing.assert_array_equal(angle, angles)
    assert not any(codes) and np.isfinite(rate).all()


def test_a_dead_axis_is_known_by_its_gyroscope_though_attitude_is_mixed_into_its_rate():
    angles, rates = measured(*motion_of())
    dead = np.where(IS_WRONG, 0.0, rates)
    mixed = dead + 1e-4 * np.sin(TIME)
    channels, motion = Channels(), Motion(PERIOD, SIZE, (9e-8, 4e-6), (0.0, 1e-8))
    found = np.array([channels.take(*each, INTERVAL, motion) for each in zip(angles, mixed, dead, strict=True)])
    assert np.isnan(found[BEGINS + 60 : ENDS, 1]).all() and np.isfinite(found[ENDS + 120 :, 1]).all()
    np.testing.assert_array_equal(found[BEGINS + 60 : ENDS, 0], angles[BEGINS + 60 : ENDS])
