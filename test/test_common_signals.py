"""Sampled signals: noise and means against numbers of known make."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import find_peaks

from swath_sysid.common.signals import bin_means, noise_level, prominent_maxima, quantum, white_noise


def test_white_noise_is_found_on_a_slow_motion():
    time = np.arange(20_000) / 100.0
    noise = np.random.default_rng(1).normal(0.0, 0.003, time.size)
    motion = 0.2 * np.sin(2.0 * time)
    assert white_noise(motion + noise) == pytest.approx(0.003, rel=0.03)
    assert noise_level(motion + noise) == white_noise(motion + noise)
    assert white_noise(motion[:7]) == noise_level(motion[:7]) == 0.0


def test_values_repeated_on_a_faster_grid_count_once():
    noise = np.random.default_rng(2).normal(0.0, 0.01, 5000)
    assert noise_level(np.repeat(noise, 4)) == pytest.approx(2.0 * white_noise(noise))


def test_resolution_is_the_smallest_step():
    assert quantum(np.round(np.sin(np.linspace(0.0, 6.0, 500)), 2)) == pytest.approx(0.01)
    assert quantum(np.ones(5)) == 0.0


def test_means_over_bins_are_those_of_a_loop():
    rng = np.random.default_rng(3)
    bins, first, second = rng.integers(0, 30, 60), rng.normal(size=60), rng.normal(size=60)
    held, *means = bin_means(bins, first, second)
    assert held.tolist() == sorted(set(bins.tolist()))
    for column, mean in zip((first, second), means, strict=True):
        np.testing.assert_allclose(mean, [column[bins == b].mean() for b in held], rtol=1e-12)


@given(st.lists(st.integers(-4, 4), max_size=40), st.integers(1, 6))
def test_maxima_that_stand_out_are_those_of_scipy(values, least):
    values = np.array(values, dtype=float)
    np.testing.assert_array_equal(prominent_maxima(values, least), find_peaks(values, prominence=least)[0])
