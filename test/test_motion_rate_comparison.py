"""Rates held against angles: delay, gain, offset and axis are those that were put in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.motion.rate_comparison import compare_rates

STEP = 0.05


def rolling(seed, duration=30.0, delay=0.0):
    """Roll and pitch of a few waves, shape (N, 2), and the derivatives of roll, pitch, yaw some time ago, (N, 3)."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, STEP)
    angles, rates = np.zeros((2, time.size, 3))
    for axis in range(3):
        for _ in range(6):
            w, phase = 2 * np.pi * rng.uniform(0.1, 0.5), rng.uniform(0, 2 * np.pi)
            angles[:, axis] += 0.03 * np.sin(w * time + phase)
            rates[:, axis] += 0.03 * w * np.cos(w * (time - delay) + phase)
    return angles[:, :2], rates


@given(st.integers(0, 10_000), st.floats(-0.5, 0.5))
def test_a_delay_is_found_with_its_sign(seed, delay):
    found = compare_rates(STEP, *rolling(seed, delay=delay))
    assert found.evidenced.tolist() == [0, 1]
    assert found.lag == pytest.approx([delay] * 2, abs=0.02)
    assert np.all(found.lagged > 0.99) and found.gain == pytest.approx([1.0] * 2, abs=0.1)


@given(st.integers(0, 10_000), st.floats(0.01, 100.0), st.floats(-2.0, 2.0))
def test_gain_and_offset_are_found(seed, gain, offset):
    angles, rates = rolling(seed)
    found = compare_rates(STEP, angles, gain * rates + offset)
    assert found.gain == pytest.approx([gain] * 2, rel=0.02)
    # the mean of the rates is the change of the angle, times the gain
    change = (angles[-1] - angles[0]) / (STEP * (len(angles) - 1))
    assert found.offset == pytest.approx(offset + (gain - 1.0) * change, abs=1e-4 * max(gain, 1.0))


def test_a_rate_on_another_axis_is_found_there():
    angles, rates = rolling(3)
    found = compare_rates(STEP, angles, rates[:, [1, 0, 2]] * [1.0, -1.0, 1.0])
    assert found.at_once[0, 1] > 0.99 and found.at_once[1, 0] < -0.99
    assert abs(found.at_once[0, 0]) < 0.7


def test_the_standard_deviation_of_a_delay_is_that_of_repeats():
    lags, told = [], []
    for seed in range(200):
        angles, rates = rolling(7)
        noise = np.random.default_rng(seed).normal(0.0, 0.15, rates.shape)
        found = compare_rates(STEP, angles, rates + noise)
        lags.append(found.lag[0])
        told.append(found.lag_std[0])
    assert 0.3 < np.std(lags) / np.mean(told) < 1.5


def test_what_hardly_moves_or_is_mere_noise_shows_nothing():
    rng = np.random.default_rng(1)
    still = compare_rates(STEP, *(1e-3 * part for part in rolling(1)))
    noise = compare_rates(STEP, rng.normal(0.0, 0.05, (600, 2)), rng.normal(0.0, 0.05, (600, 3)))
    assert not still.moves.any() and not noise.moves.any()


def test_a_decay_shows_within_a_long_rest():
    """One swing in 40 s of noise, from which only the part that moves may be looked at."""
    time = np.arange(0.0, 40.0, STEP)
    since = np.maximum(time - 20.0, 0.0)
    angle = 0.1 * np.exp(-0.8 * since) * np.cos(3.0 * since)
    rate = np.where(time < 20.0, 0.0, np.gradient(angle, STEP))
    noise = np.random.default_rng(2).normal(0.0, 1.0, (2, time.size)) * [[1e-3], [2e-2]]
    unknown = np.full((time.size, 1), np.nan)
    found = compare_rates(
        STEP, np.column_stack([angle + noise[0], unknown]), np.column_stack([-rate + noise[1], unknown, unknown])
    )
    assert found.moves.tolist() == [True, False] and found.has_rate.tolist() == [True, False, False]
    assert found.at_once[0, 0] < -0.95 and np.isnan(found.at_once[1, 1])
