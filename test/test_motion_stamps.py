"""The order of stamps: what is left out, what is counted, and when the clock has moved."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.motion.stamps import (
    DUPLICATE,
    GAP,
    JUMPED_BACK,
    LONG_GAP,
    OUT_OF_ORDER,
    RATE_CHANGED,
    STAMP_REASONS,
    STRAY,
    StampOrder,
    StampSettings,
)
from swath_sysid.common.errors import InputError

EPOCH = 1_700_000_000


def even(rate, duration, start=0.0):
    """Even stamps, ns."""
    return EPOCH * 10**9 + np.round((start + np.arange(round(duration * rate)) / rate) * 1e9).astype(np.int64)


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
        (spoilt({50: 49, 80: 60}), {DUPLICATE: 1, OUT_OF_ORDER: 1}, {50, 80}),
        (spoilt({100: 0, 200: 2 * EPOCH * 10**9}), {OUT_OF_ORDER: 1, STRAY: 1}, {100, 200}),
        # a bag that loops is followed after one sample
        (np.tile(even(100, 3), 3), {JUMPED_BACK: 2}, {300, 600}),
        # after a long gap the first sample is no neighbour of the next
        (np.concatenate([even(100, 2), even(100, 2, 2.5), even(100, 2, 60.0)]), {GAP: 1, LONG_GAP: 1}, {400}),
    ],
)
def test_what_cannot_follow_is_left_out_and_counted(stamps, counted, left_out):
    kept, counts, _ = place_all(stamps)
    assert counts == counted and set(range(len(stamps))) - set(kept) == left_out


@pytest.mark.parametrize('behind', [0.053, 0.5, 7.0, 1e6])
def test_of_two_publishers_the_one_ahead_is_followed(behind):
    stamps = np.stack([even(100, 3), even(100, 3, -behind)], axis=1).ravel()
    kept, counts, _ = place_all(stamps)
    assert all(index % 2 == 0 for index in kept) and len(kept) == 300
    assert set(counts) == {OUT_OF_ORDER}


@pytest.mark.parametrize('rate', [10, 25, 400, 1000])
def test_a_new_rate_is_counted_once_and_followed(rate):
    _, counts, order = place_all(np.concatenate([even(100, 5), even(rate, 500 / rate, 5.0)]))
    assert counts[RATE_CHANGED] == 1
    assert order.interval == pytest.approx(1 / rate, rel=0.05)
    assert set(counts) <= {RATE_CHANGED, GAP}


@given(st.lists(st.integers(-(2**31) * 10**9, 2**31 * 10**9), max_size=60))
def test_any_stamps_are_placed_and_two_even_ones_are_kept_afterwards(stamps):
    """Whatever came before, a sensor that stamps evenly is heard again at its second sample."""
    order = StampOrder()
    for stamp in stamps:
        assert set(order.place(stamp).reasons) <= set(STAMP_REASONS)
    following = [order.place(int(stamp)).kept for stamp in even(100, 2.5)]
    # a sensor that lies back by less than backward_jump is late until it has caught up
    assert all(following[-120:])


@pytest.mark.parametrize('fields', [{'gap_limit': 0.0}, {'backward_jump': -1.0}, {'gap_limit': float('nan')}])
def test_settings_that_make_no_sense_are_refused(fields):
    with pytest.raises(InputError, match=next(iter(fields))):
        StampSettings(**fields)
