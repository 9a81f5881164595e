"""A predictor that could not run for a while: it uses every sample, and forecasts from the newest ones."""

import time

import pytest

rclpy = pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, reading  # noqa: E402
from live_bench import Bench, imu_message, stamp_ns, wait_for  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402

from swath_sysid.nodes.executor_loop import events_executor  # noqa: E402
from swath_sysid.nodes.predictor import PASSED_OVER_NS, Predictor  # noqa: E402
from swath_sysid.pipeline.health import PASSED_OVER  # noqa: E402

pytestmark = pytest.mark.dds

INTERVAL_NS = 10_000_000
SAMPLES = 400


@pytest.fixture
def predictor():
    """A predictor that runs only while the test spins it, on the stock executor and on that with the least delay."""
    rclpy.init()
    node = Predictor()
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


@pytest.mark.parametrize('make_executor', [events_executor, rclpy.executors.SingleThreadedExecutor])
def test_after_a_stall_it_forecasts_from_the_newest_and_counts_what_it_passed_over(predictor, make_executor):
    bench = Bench()
    executor = make_executor()
    executor.add_node(predictor)
    # within one process samples arrive as they are published
    sensor = bench.publisher(Imu, 'imu/data', QoSProfile(depth=1000))
    leads = bench.heard['forecast/lead_0_5s']

    def spin_until(condition, what):
        wait_for(lambda: executor.spin_once(timeout_sec=0.02) or condition(), what)

    def send(first, last):
        for k in range(first, last):
            sensor.publish(imu_message(reading(EPOCH_NS + k * INTERVAL_NS, 0.01, -0.02)))

    try:
        spin_until(lambda: sensor.get_subscription_count() and bench.node.count_publishers('/forecast/next'), 'nodes')
        next_try = time.monotonic()
        while predictor.health.received == 0:
            # the subscription may still be connecting when the sensor knows of it: what comes before that is lost
            if time.monotonic() >= next_try:
                send(0, 1)
                next_try = time.monotonic() + 2.0
            executor.spin_once(timeout_sec=0.02)
        for k in range(1, 50):
            send(k, k + 1)
            spin_until(lambda k=k: predictor.health.received > k, 'sample')
        assert predictor.health.counts[PASSED_OVER] == 0
        wait_for(lambda: bench.newest_stamp() == EPOCH_NS + 50 * INTERVAL_NS, 'forecast')
        bench.heard['forecast/next'].clear()
        leads.clear()
        send(50, 50 + SAMPLES)
        spin_until(lambda: predictor.health.received == 50 + SAMPLES, 'all samples')
        newest = EPOCH_NS + (50 + SAMPLES - 1) * INTERVAL_NS
        wait_for(lambda: bench.newest_stamp() == newest + INTERVAL_NS, 'forecast from the newest sample')
        wait_for(lambda: leads, 'leads')
        fresh = PASSED_OVER_NS // INTERVAL_NS + 1
        assert len(bench.heard['forecast/next']) <= fresh and len(leads) <= 2
        assert all(stamp_ns(lead) - 500_000_000 >= newest - PASSED_OVER_NS for lead in leads)
        assert predictor.pipeline.used == 50 + SAMPLES
        assert predictor.health.counts[PASSED_OVER] == SAMPLES - fresh
        told = predictor.health.reports(0.0, newest)[0].values
        assert told[PASSED_OVER] == SAMPLES - fresh
    finally:
        executor.shutdown()
        bench.close()
