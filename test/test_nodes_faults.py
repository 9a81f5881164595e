"""The fault table over DDS: each is counted under its own reason, none stops a node, good data are forecast again."""

from math import nan
from time import sleep

import pytest

pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, NOT_GIVEN, UNKNOWN, reading  # noqa: E402
from live_bench import LATCHED, SENSOR, Bench, running, start_together, wait_for  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from sensor_msgs.msg import Imu, PointCloud2  # noqa: E402

from swath_sysid.pipeline.health import BEHIND  # noqa: E402

pytestmark = pytest.mark.dds

STEP = 10_000_000
OF_THE_MACHINE = {'late-fit', 'passed-over', 'sensor-silent'}
"""What a machine that is slow enough does to good data."""

SECOND = 10**9
PATIENT = 10  #: Times that a fault is sent to nodes which are behind.


class Craft:
    def __init__(self, bench, process):
        self.bench, self.process = bench, process
        self.stamp, self.sent = EPOCH_NS, 0

    def wait(self, seconds):
        self.stamp += round(seconds * SECOND)

    def good(self, count=50, step=STEP):
        first, self.stamp = self.stamp, self.stamp + count * step
        self.send([reading(first + (k + 1) * step, 0.01, -0.02) for k in range(count)])

    def bad(self, stamp=None, **changes):
        if stamp is None:
            self.stamp += STEP
            stamp = self.stamp
        self.send([reading(stamp, 0.01, -0.02, **changes)])

    def send(self, readings, publisher=None):
        self.sent += self.bench.send(readings, publisher)

    def counts(self):
        """Counts of both nodes, once they have told of everything that was sent."""
        found = {}
        for node in ('imu_buffer', 'predictor'):
            self.bench.settle(node, self.sent)
            found[node] = self.bench.counts(node)
        return found


def taken(counts):
    """Samples used, and those that a busy machine left no time for."""
    return counts['used'] + counts.get(BEHIND, 0.0)


@pytest.fixture(scope='module')
def craft():
    bench = Bench()
    with running(bench, start_together()) as process:
        yield Craft(bench, process)
    bench.close()


FAULTS = {
    # what is wrong with one sample, or what happens, and the reason
    'repeated': (lambda craft: craft.bad(stamp=craft.stamp), 'duplicate-stamp'),
    'late': (lambda craft: craft.bad(stamp=craft.stamp - SECOND // 10 - STEP // 2), 'out-of-order'),
    'bag loop': (lambda craft: craft.wait(-30.0), 'clock-jumped-back'),
    'gap': (lambda craft: (craft.wait(0.3), sleep(0.3)), 'gap'),
    'long gap': (lambda craft: (craft.wait(2.0), sleep(2.0)), 'gap-too-long'),
    'clock set ahead': (lambda craft: craft.wait(3600.0), 'clock-stepped'),
    'clock set back a little': (lambda craft: craft.wait(-0.6), 'clock-jumped-back'),
    'NaN rates': ({'rates': (nan, 0.0, 0.0)}, 'not-finite'),
    'all NaN': ({'orientation': (nan,) * 4, 'rates': (nan,) * 3, 'force': (nan,) * 3}, 'nothing-usable'),
    'zero quaternion': ({'orientation': (0.0,) * 4}, 'bad-quaternion'),
    'absurd rates': ({'rates': (1e30, 0.0, 0.0)}, 'absurd-value'),
    'unknown covariances': ({'orientation_covariance': UNKNOWN, 'rates_covariance': UNKNOWN}, 'unknown-covariance'),
    'no orientation': ({'orientation_covariance': NOT_GIVEN}, 'no-orientation'),
    'faster': (lambda craft: craft.good(100, STEP // 4), 'rate-changed'),
    'stray future stamp': (lambda craft: craft.bad(stamp=craft.stamp + 3_000_000 * SECOND), 'stray-stamp'),
    # of which only the predictor knows what to expect
    'shock': ({'orientation': (0.0, 0.6, 0.0, 0.8)}, 'outlier-pitch'),
}


@pytest.mark.long
@pytest.mark.parametrize('name', FAULTS)
def test_a_fault_is_counted_and_good_data_are_forecast_again_within_a_second(craft, name):
    fault, reason = FAULTS[name]
    craft.good()
    for _ in range(PATIENT):
        before = craft.counts()
        if isinstance(fault, dict):
            craft.bad(**fault)
        else:
            fault(craft)
        craft.good()
        craft.bench.wait_for_forecast_after(craft.stamp)
        after = craft.counts()
        if after['predictor'].get(BEHIND) == before['predictor'].get(BEHIND):
            break  # else a busy machine may have left out the one that is wrong
    for node in ('imu_buffer', 'predictor'):
        if node == 'predictor' or name != 'shock':
            assert after[node][reason] > before[node][reason], node
        # all but a few of the good samples were taken
        assert taken(after[node]) - taken(before[node]) >= 47
    assert craft.process.poll() is None


def test_good_data_are_not_counted_as_faults(craft):
    craft.good()
    before = craft.counts()
    craft.good(200)
    after = craft.counts()
    for node in before:
        reasons = [key for key in before[node] if '-' in key and key not in OF_THE_MACHINE]
        assert {key: after[node][key] - before[node][key] for key in reasons} == dict.fromkeys(reasons, 0.0)
        assert taken(after[node]) - taken(before[node]) == 200


def test_a_sensor_that_stops_and_returns(craft):
    craft.good()
    before = craft.counts()
    for name in ('predictor: imu', 'imu_buffer: imu'):
        wait_for(lambda name=name: craft.bench.statuses[name][0] == 2, 'error about the silence')
        assert 'no message on /imu/data' in craft.bench.statuses[name][1]
    craft.wait(3.0)
    craft.good()
    craft.bench.wait_for_forecast_after(craft.stamp)
    after = craft.counts()
    # once for this silence; a machine that is slow enough makes others
    assert all(after[node]['sensor-silent'] > before[node]['sensor-silent'] for node in before)


def test_two_publishers(craft):
    """The second lies seven seconds behind: its samples are left out, those of the first are forecast."""
    craft.good()
    before, several = craft.counts()['imu_buffer'], 'several-publishers'
    with craft.bench.another_node() as node:
        second = node.create_publisher(Imu, 'imu/data', SENSOR)
        wait_for(lambda: second.get_subscription_count() == 2, 'second connection')
        wait_for(lambda: craft.counts()['imu_buffer'][several] > before[several], 'count of several publishers')
        for _ in range(50):
            craft.good(1)
            craft.send([reading(craft.stamp - 7 * SECOND, 0.3, 0.3)], second)
        wait_for(lambda: 'more than one node publishes' in craft.bench.statuses['predictor: imu'][1], 'warning')
        craft.bench.wait_for_forecast_after(craft.stamp)
    craft.good()
    craft.bench.wait_for_forecast_after(craft.stamp)
    after = craft.counts()['imu_buffer']
    assert after['out-of-order'] - before['out-of-order'] >= 48 and after['used'] - before['used'] >= 100


def test_a_qos_mismatch_and_a_window_that_is_none_are_counted(craft):
    """A subscription that wants old forecasts, a publisher of windows that keeps none, and one of what is no window."""
    bench, before = craft.bench, craft.counts()

    def at_identifier():
        return bench.counts('identifier', 'identification')

    identifier = at_identifier()
    volatile = QoSProfile(depth=1, durability=DurabilityPolicy.VOLATILE)
    with bench.another_node() as node:
        node.create_subscription(Imu, 'forecast/next', lambda message: None, LATCHED)
        node.create_publisher(PointCloud2, 'motion/window', volatile)
        wait_for(lambda: craft.counts()['predictor']['qos-mismatch'] > before['predictor']['qos-mismatch'], 'count')
        wait_for(lambda: at_identifier()['qos-mismatch'] > identifier['qos-mismatch'], 'count at the identifier')
    craft.good()
    bench.wait_for_forecast_after(craft.stamp)
    with bench.another_node() as node:
        publisher = node.create_publisher(PointCloud2, 'motion/window', LATCHED)
        wait_for(lambda: publisher.get_subscription_count() >= 2, 'connection')
        publisher.publish(PointCloud2(height=1, width=3, point_step=8))
        wait_for(lambda: at_identifier()['bad-window'] > identifier['bad-window'], 'count')
    assert craft.process.poll() is None
