"""What the benchmark of measured records makes of them: losses and changes of sea."""

import importlib
from pathlib import Path

import numpy as np
import pytest

from swath_sysid.attitude.motion.trial import Trial

TIME = 0.1 * np.arange(1000)


@pytest.fixture
def benchmark(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[1] / 'benchmark')
    return importlib.import_module('record_forecasts')


def test_samples_are_taken_out_at_the_beginning_of_each_period(benchmark):
    left = benchmark.without_samples(Trial(TIME, roll=np.arange(1000.0)), 5)
    assert left.time.size == 1000 - 5 * 5
    gone = sorted(set(range(1000)) - set(left.roll.astype(int)))
    assert gone == [200 * period + sample for period in range(5) for sample in range(5)]
    assert np.array_equal(left.time, 0.1 * left.roll)


def test_records_are_joined_without_a_gap_in_the_channels_of_both(benchmark):
    first = Trial(TIME, roll=np.zeros(1000), heave=np.zeros(1000))
    second = Trial(TIME + 7.0, pitch=np.zeros(1000), roll=np.ones(1000))
    both = benchmark.spliced(first, second)
    assert list(both.channels) == ['roll']
    assert np.diff(both.time) == pytest.approx(np.full(1999, 0.1))
    assert both.roll.sum() == 1000


def test_a_buoy_that_turned_meets_the_sea_from_the_side(benchmark, data_folder):
    straight, turned = benchmark.buoy(), benchmark.buoy_that_turned()
    later = turned.time >= benchmark.SPLICE
    was = straight.time >= benchmark.SPLICE
    # turned by a quarter, what was pitch is roll, nearly: Euler angles do not change places exactly
    assert np.corrcoef(turned.roll[later], straight.pitch[was])[0, 1] ** 2 > 0.98
    assert np.array_equal(turned.roll[~later], straight.roll[~was])
