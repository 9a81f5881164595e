"""When a fit of the waves comes into use, live: 0.5 s of stamps after its samples, or later, which is counted."""

import math

import pytest

rclpy = pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import imu_message  # noqa: E402

from swath_sysid.nodes.predictor import Predictor  # noqa: E402
from swath_sysid.nodes.worker import WorkerError  # noqa: E402
from swath_sysid.pipeline.health import HARMLESS, LATE_FIT, NOT_FITTED  # noqa: E402

pytestmark = pytest.mark.dds

INTERVAL_NS = 100_000_000
DELAY = 5
"""Samples between a request and the use of its fit: 0.5 s."""


class LaterWorker:
    """Keeps what is submitted until the test has it done."""

    def __init__(self):
        self.work = []

    def submit(self, function, arguments, on_end):
        self.work.append((function, arguments, on_end))

    def finish(self):
        function, arguments, on_end = self.work.pop(0)
        on_end(function(*arguments), None)

    def close(self):
        pass


@pytest.fixture
def predictor():
    rclpy.init()
    node = Predictor()
    node.sea.close()
    node.sea.worker = LaterWorker()
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def sail(node, first, count):
    """So many samples of a craft in waves, of two periods."""
    for k in range(first, first + count):
        roll = 0.05 * math.sin(0.2 * k) + 0.03 * math.sin(0.13 * k)
        rate = 10.0 * (0.05 * 0.2 * math.cos(0.2 * k) + 0.03 * 0.13 * math.cos(0.13 * k))
        node._on_imu(imu_message(reading(EPOCH_NS + k * INTERVAL_NS, roll=roll, roll_rate=rate)))
        if node.sea.worker.work:
            return k + 1
    return first + count


@pytest.mark.parametrize(('samples_meanwhile', 'late'), [(0, 0), (DELAY - 1, 0), (DELAY, 1), (2 * DELAY, 1)])
def test_a_fit_that_comes_after_its_time_is_counted(predictor, samples_meanwhile, late):
    following = sail(predictor, 0, 600)
    assert predictor.sea.worker.work, 'a fit was asked for'
    for k in range(samples_meanwhile):
        sail(predictor, following + k, 1)
    predictor.sea.worker.finish()
    sail(predictor, following + samples_meanwhile, 1)
    assert predictor.health.counts[LATE_FIT] == late


def test_a_fit_that_another_one_kept_from_beginning_is_counted_and_warns_nobody(predictor):
    following = sail(predictor, 0, 600)
    for k in range(60):
        sail(predictor, following + k, 1)
    assert predictor.health.counts[LATE_FIT] == 1 and len(predictor.sea.worker.work) == 1
    assert LATE_FIT in HARMLESS


def test_waves_that_cannot_be_fitted_warn_until_they_can(predictor):
    following = sail(predictor, 0, 600)
    _, _, on_end = predictor.sea.worker.work.pop(0)
    on_end(None, WorkerError('out of memory'))
    levels = []
    for k in range(120):
        sail(predictor, following + k, 1)
        if predictor.sea.worker.work:
            break
        levels.append(predictor.health.holding)
    assert levels and all('waves-not-fitted' in told for told in levels)
    predictor.sea.worker.finish()
    sail(predictor, following + k + 1, 1)
    assert predictor.health.holding == '' and predictor.health.counts[NOT_FITTED] == 1
