"""Sampled signals, sampling and the ring buffer of rows, against numbers of known make."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import cumulative_trapezoid
from scipy.signal import find_peaks
from scipy.stats import qmc

from swath_sysid.common.conventions import digits, percent
from swath_sysid.common.optimisers import latin_hypercube
from swath_sysid.common.row_buffer import RowBuffer
from swath_sysid.common.signals import (
    bin_means,
    noise_level,
    prominent_extremes,
    quantum,
    running_integral,
    white_noise,
)


def test_white_noise_and_resolution_are_found():
    time = np.arange(20_000) / 100.0
    noise = np.random.default_rng(1).normal(0.0, 0.003, time.size)
    motion = 0.2 * np.sin(2.0 * time)
    assert white_noise(motion + noise) == pytest.approx(0.003, rel=0.03)
    assert noise_level(motion + noise) == white_noise(motion + noise)
    assert white_noise(motion[:7]) == noise_level(motion[:7]) == 0.0
    noise = np.random.default_rng(2).normal(0.0, 0.01, 5000)
    assert noise_level(np.repeat(noise, 4)) == pytest.approx(2.0 * white_noise(noise))
    assert quantum(np.round(np.sin(np.linspace(0.0, 6.0, 500)), 2)) == pytest.approx(0.01)
    assert quantum(np.ones(5)) == 0.0


def test_numbers_for_readers_are_never_powers_of_ten():
    shown = {
        270.4: '270',
        7.2e-5: '0.000072',
        1234567.0: '1230000',
        -0.5: '-0.5',
        float('inf'): 'inf',
        float('nan'): '-',
    }
    assert {value: digits(3)(value) for value in shown} == shown
    assert percent(2.704) == '270 %' and digits(2)(None) == '-'


def test_means_over_bins_are_those_of_a_loop():
    rng = np.random.default_rng(3)
    bins, first, second = rng.integers(0, 30, 60), rng.normal(size=60), rng.normal(size=60)
    held, *means = bin_means(bins, first, second)
    assert held.tolist() == sorted(set(bins.tolist()))
    for column, mean in zip((first, second), means, strict=True):
        np.testing.assert_allclose(mean, [column[bins == b].mean() for b in held], rtol=1e-12)


@given(st.lists(st.integers(-4, 4), max_size=40), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_extremes_that_stand_out_are_those_of_scipy(values, least, seed):
    noise = np.random.default_rng(seed).normal(size=300)
    for each in (np.array(values, dtype=float), noise + np.cumsum(noise)):
        found, is_maximum = prominent_extremes(each, least)
        for kind, sign in ((is_maximum, 1.0), (~is_maximum, -1.0)):
            np.testing.assert_array_equal(found[kind], find_peaks(sign * each, prominence=least)[0])


@pytest.mark.parametrize('count', [1, 2, 33])
def test_the_sample_is_that_of_scipy(count):
    ours, theirs = np.random.default_rng(3), np.random.default_rng(3)
    for _ in range(2):
        np.testing.assert_array_equal(latin_hypercube(ours, count, 5), qmc.LatinHypercube(5, seed=theirs).random(count))
    assert ours.random() == theirs.random()


CAPACITY, CHANNELS = 5, 2
STEPS = st.lists(
    st.one_of(
        st.tuples(st.just('append'), st.integers(-100, 100)),
        st.tuples(st.just('skip'), st.integers(0, 3 * CAPACITY)),
        st.tuples(st.just('clear'), st.just(0)),
    ),
    max_size=60,
)


def both_after(steps):
    """The history, and a list of all rows since it was last cleared."""
    history, rows = RowBuffer(CAPACITY, CHANNELS), []
    for kind, number in steps:
        if kind == 'append':
            row = [float(number), -0.5 * number]
            history.append(row)
            rows.append(row)
        elif kind == 'skip':
            history.skip(number)
            rows += [[math.nan] * CHANNELS] * number
        else:
            history.clear()
            rows = []
    return history, rows


@given(STEPS, st.integers(0, 2 * CAPACITY))
def test_the_newest_rows_are_those_of_a_list(steps, count):
    history, rows = both_after(steps)
    kept = rows[-CAPACITY:]
    assert len(history) == len(kept) and history.newest == len(rows) - 1
    wanted = np.reshape(kept[len(kept) - min(count, len(kept)) :], (-1, CHANNELS))
    np.testing.assert_array_equal(history.last(count), wanted)


@given(STEPS, st.lists(st.integers(-8, 8 * CAPACITY), max_size=8), st.sampled_from([0.0, 0.25, 0.5]))
def test_rows_by_number_are_those_of_a_list_and_linear_between_two(steps, numbers, share):
    history, rows = both_after(steps)
    oldest = max(0, len(rows) - CAPACITY)

    def row(number):
        return np.array(rows[number]) if oldest <= number < len(rows) else np.full(CHANNELS, math.nan)

    wanted = [row(number) + (share * (row(number + 1) - row(number)) if share else 0.0) for number in numbers]
    found = history.at(np.array(numbers, dtype=float) + share)
    np.testing.assert_allclose(found, np.reshape(wanted, (-1, CHANNELS)), rtol=1e-12)


def test_memory_does_not_grow_nor_a_long_silence_cost_and_what_is_given_is_copied():
    history, row = RowBuffer(CAPACITY, CHANNELS), np.zeros(CHANNELS)
    memory = history._rows
    for number in range(50 * CAPACITY):
        row[:] = number
        history.append(row)
    assert history._rows is memory and history.last(2)[:, 0].tolist() == [50 * CAPACITY - 2, 50 * CAPACITY - 1]
    history.skip(10**12)
    assert history.newest == 10**12 + 50 * CAPACITY - 1 and len(history) == CAPACITY
    assert np.isnan(history.last(CAPACITY)).all()


@given(st.integers(0, 4 * CAPACITY), st.integers(0, 4 * CAPACITY), st.integers(0, 2 * CAPACITY))
def test_the_oldest_rows_can_be_dropped_by_their_first_column(before, limit, after):
    buffer = RowBuffer(CAPACITY, CHANNELS)
    for number in range(before):
        buffer.append([number, 0.0])
    buffer.drop_below(limit)
    for number in range(before, before + after):
        buffer.append([number, 0.0])
    kept = [n for n in range(before + after) if n >= min(limit, before)][-CAPACITY:]
    assert buffer.last()[:, 0].tolist() == [n for n in kept if n >= before - CAPACITY]
    assert len(buffer) == len(buffer.last()) and buffer.newest == before + after - 1


def test_a_running_integral_is_that_of_scipy_to_the_last_bit():
    time, values = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.03, (2, 500)), axis=1)
    assert running_integral(values, time).tolist() == cumulative_trapezoid(values, time, initial=0.0).tolist()
    assert running_integral(values[:1], time[:1]).tolist() == [0.0]
