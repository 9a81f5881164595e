"""The recent past in rows: against a plain list, whatever was appended, skipped and cleared."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.common.row_buffer import RowBuffer

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
