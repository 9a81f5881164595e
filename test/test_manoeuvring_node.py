"""The node manoeuvring_predictor over DDS."""

import time

import numpy as np
import pytest

pytest.importorskip('rclpy')

from live_bench import Bench, start_node, stop, wait_for  # noqa: E402
from manoeuvring_runs import MODEL, OLD  # noqa: E402
from nav_msgs.msg import Odometry, Path  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from std_msgs.msg import Float64, String  # noqa: E402

from swath_sysid.formats.manoeuvring_model_file import manoeuvring_to_yaml  # noqa: E402
from swath_sysid.formats.messages import stamp_ns  # noqa: E402
from swath_sysid.manoeuvring.hull.simulation import simulate  # noqa: E402
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreState  # noqa: E402
from swath_sysid.nodes.manoeuvring_predictor import odometry_message, odometry_reading  # noqa: E402
from swath_sysid.nodes.qos import LATCHED  # noqa: E402

pytestmark = pytest.mark.dds

RELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


def test_odometry_message_round_trip():
    covariance = np.diag([1.0, 2.0, 0.01])
    state = ManoeuvreState(12.5, 1.0, -2.0, 3.0, 0.5, 0.1, -0.2, covariance, covariance / 4)
    message = deserialize_message(odometry_message(state, 'odom', 'base_link'), Odometry)
    reading = odometry_reading(message)
    assert (reading.stamp, reading.x, reading.y, reading.surge) == (12.5, 1.0, -2.0, 0.5)
    assert reading.heading == pytest.approx(3.0)
    assert reading.std['heading'] == pytest.approx(0.1)
    assert reading.std['sway'] == pytest.approx(np.sqrt(0.5))
    assert message.pose.covariance[35] == pytest.approx(0.01)


def test_forecasts_over_dds():
    process = start_node('manoeuvring_predictor', '-p', 'leads_s:=[1.0, 5.0]', '-r', '__ns:=/wamv')
    bench = Bench('wamv')
    heard = {'path': [], 'lead': []}
    try:
        bench.node.create_subscription(Path, 'manoeuvring/forecast', heard['path'].append, RELIABLE)
        bench.node.create_subscription(Odometry, 'manoeuvring/lead_5_0s', heard['lead'].append, RELIABLE)
        odometry, imu = bench.publisher(Odometry, 'odometry'), bench.publisher(Imu, 'imu/data')
        left = bench.publisher(Float64, 'thrusters/left/thrust')
        right = bench.publisher(Float64, 'thrusters/right/thrust')
        model = bench.publisher(String, 'manoeuvring/model', LATCHED)
        sensors = odometry, left, right, imu
        wait_for(lambda: all(sensor.get_subscription_count() for sensor in sensors), 'subscriptions')
        wait_for(
            lambda: any('no model' in text or 'no odometry' in text for _, text, _ in bench.statuses.values()),
            'diagnostic',
        )
        model.publish(String(data='{'))
        wait_for(lambda: any(v.get('bad_models') == '1' for _, _, v in bench.statuses.values()), 'count of bad models')
        model.publish(String(data=manoeuvring_to_yaml(MODEL)))
        run = simulate(OLD, np.full(400, 40.0), np.full(400, 90.0), 0.05, (1.0, 0.0, 0.0))
        start = time.time()
        for k in range(160):
            motion = (float(a[k]) for a in (run.x, run.y, run.heading, run.surge, run.sway, run.yaw_rate))
            state = ManoeuvreState(start + run.time[k], *motion, np.zeros((3, 3)), np.zeros((3, 3)))
            left.publish(Float64(data=40.0))
            right.publish(Float64(data=90.0))
            message = deserialize_message(odometry_message(state, 'odom', 'base_link'), Odometry)
            turning = Imu(header=message.header)
            turning.angular_velocity.z = state.yaw_rate
            imu.publish(turning)
            odometry.publish(message)
            if k == 100:
                bad = deserialize_message(odometry_message(state, 'odom', 'base_link'), Odometry)
                bad.pose.pose.position.x = float('nan')
                odometry.publish(bad)
            time.sleep(0.02)
        wait_for(lambda: heard['lead'] and stamp_ns(heard['lead'][-1].header.stamp) * 1e-9 > start + 12.0, 'forecast')
        last = heard['lead'][-1]
        at = round((stamp_ns(last.header.stamp) * 1e-9 - start) / 0.05)
        assert np.hypot(last.pose.pose.position.x - run.x[at], last.pose.pose.position.y - run.y[at]) < 0.5
        assert last.twist.twist.angular.z == pytest.approx(run.yaw_rate[at], abs=0.02)
        assert 0 < last.pose.covariance[0] < 100
        poses = heard['path'][-1].poses
        assert len(poses) == 40
        assert np.allclose(np.diff([stamp_ns(p.header.stamp) for p in poses]) * 1e-9, 0.5)
        wait_for(
            lambda: any(
                v.get('not-finite') == '1' and v.get('bad_models') == '1' for _, _, v in bench.statuses.values()
            ),
            'counts',
        )
    finally:
        bench.close()
        code, output = stop(process)
    assert code == 0, output
    assert 'new model' in output
