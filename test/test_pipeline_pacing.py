"""Which samples are used when they come faster than they can be handled."""

from collections import deque
from itertools import cycle

import numpy as np
import pytest

from swath_sysid.pipeline.pacing import Pace


def played(rate, costs, duration, stalls=()):
    """Times at which samples of a sensor are used, s, with the times at which that was done; they take ``costs``, s."""
    costs = cycle(np.atleast_1d(costs))
    pace, waiting, used, now, sent = Pace(), deque(), [], 0.0, 0
    while now < duration:
        for begin, end in stalls:
            now = end if begin <= now < end else now
        while sent / rate <= now:
            waiting.append(sent / rate)
            sent += 1
        if not waiting:
            now = sent / rate
            continue
        is_used = pace.is_used(len(waiting), now)
        sample = waiting.popleft()
        if is_used:
            now += next(costs)
            pace.note(now)
            used.append((sample, now))
    return used


@pytest.mark.parametrize(('rate', 'cost'), [(100.0, 0.009), (1000.0, 0.0009), (10.0, 0.05)])
def test_a_processor_that_keeps_up_uses_every_sample(rate, cost):
    used = played(rate, cost, 20.0)
    assert [round(sample * rate) for sample, _ in used] == list(range(len(used)))


def test_after_a_stall_that_can_be_made_up_for_nothing_is_left_out():
    used = played(100.0, 0.002, 20.0, stalls=[(5.0, 6.2)])
    assert [round(sample * 100.0) for sample, _ in used] == list(range(len(used)))


# the last of them on one processor of thirteen: three samples in a row, and then the twelve other programs
@pytest.mark.parametrize(
    ('rate', 'costs'), [(100.0, 0.02), (100.0, 0.2), (1000.0, 0.003), (1000.0, 0.1), (100.0, (0.001, 0.001, 0.037))]
)
def test_behind_it_uses_samples_evenly_and_the_newest_used_is_never_old(rate, costs):
    used = [each for each in played(rate, costs, 60.0) if each[1] > 20.0]
    ages = [now - sample for sample, now in used]
    steps = [b[0] - a[0] for a, b in zip(used, used[1:], strict=False)]
    assert max(ages) < 1.0 + np.max(costs)
    assert max(steps) <= 3.0 * sorted(steps)[len(steps) // 2]
    busy = len(used) * np.mean(costs) / 40.0
    assert busy > 0.9  # nothing is left out while there is time for it


def test_a_backlog_of_which_nobody_knew_how_long_it_takes_is_not_worked_off_to_its_end_first():
    used = played(100.0, 0.013, 20.0, stalls=[(0.0, 10.0)])
    assert max(now - sample for sample, now in used if now > 12.0) < 1.0
