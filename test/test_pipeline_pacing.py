"""Which samples are used when they come faster than they can be handled."""

from collections import deque

import pytest

from swath_sysid.pipeline.pacing import Pace


def played(rate, cost, duration, stalls=()):
    """Times at which samples of a sensor are used, s, with the times at which that was done; one takes ``cost`` s."""
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
        is_used = pace.is_used(len(waiting))
        sample = waiting.popleft()
        if is_used:
            now += cost
            pace.note(cost)
            used.append((sample, now))
    return used


@pytest.mark.parametrize(('rate', 'cost'), [(100.0, 0.009), (1000.0, 0.0009), (10.0, 0.05)])
def test_a_processor_that_keeps_up_uses_every_sample(rate, cost):
    used = played(rate, cost, 20.0)
    assert [round(sample * rate) for sample, _ in used] == list(range(len(used)))


def test_after_a_stall_that_can_be_made_up_for_nothing_is_left_out():
    used = played(100.0, 0.002, 20.0, stalls=[(5.0, 6.2)])
    assert [round(sample * 100.0) for sample, _ in used] == list(range(len(used)))


@pytest.mark.parametrize(('rate', 'cost'), [(100.0, 0.02), (100.0, 0.2), (1000.0, 0.003), (1000.0, 0.1)])
def test_behind_it_uses_samples_evenly_and_the_newest_used_is_never_old(rate, cost):
    used = [each for each in played(rate, cost, 60.0) if each[1] > 20.0]
    ages = [now - sample for sample, now in used]
    steps = [b[0] - a[0] for a, b in zip(used, used[1:], strict=False)]
    assert max(ages) < 1.0 + cost
    assert max(steps) <= 3.0 * sorted(steps)[len(steps) // 2]
    busy = len(used) * cost / 40.0
    assert busy > 0.9  # nothing is left out while there is time for it
