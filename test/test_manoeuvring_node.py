"""The nodes manoeuvring_predictor and manoeuvring_identifier over DDS."""

import time

import numpy as np
import pytest

pytest.importorskip('rclpy')

from live_bench import Bench, settings, start_node, stop, wait_for  # noqa: E402
from manoeuvring_runs import MODEL, OLD  # noqa: E402
from nav_msgs.msg import Odometry, Path  # noqa: E402
from rclpy.qos import QoSProfile, ReliabilityPolicy  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from std_msgs.msg import Float32, Float64, String  # noqa: E402

from swath_sysid.formats.manoeuvring_model_file import (  # noqa: E402
    manoeuvring_from_yaml,
    manoeuvring_to_yaml,
    read_manoeuvring_model,
)
from swath_sysid.formats.messages import stamp_ns  # noqa: E402
from swath_sysid.manoeuvring.hull.programme import SensorNoise, with_noise  # noqa: E402
from swath_sysid.manoeuvring.hull.simulation import simulate  # noqa: E402
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreState  # noqa: E402
from swath_sysid.nodes.manoeuvring_predictor import odometry_message, odometry_reading  # noqa: E402
from swath_sysid.nodes.qos import LATCHED  # noqa: E402

pytestmark = pytest.mark.dds

RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)


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
        wait_for(lambda: any('no ' in text for _, text, _ in bench.statuses.values()), 'diagnostic')
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
        wait_for(lambda: any(v.get('not-finite') == '1' for _, _, v in bench.statuses.values()), 'counts')
    finally:
        bench.close()
        code, output = stop(process)
    assert code == 0, output
    assert 'new model' in output


START = 1000.0
LEAD = 2.0


def driven(count=2000, step=0.1):
    """The WAM-V under thrust steps straight on, in turns and in zig-zags."""
    rng = np.random.default_rng(5)
    port, starboard = np.zeros((2, count))
    begin = 0
    while begin < count:
        span = slice(begin, begin + round(rng.uniform(5.0, 10.0) / step))
        base, difference = rng.uniform(15.0, 120.0), rng.choice([0.0, 1.0, 1.0]) * rng.uniform(-40.0, 40.0)
        port[span], starboard[span] = base - difference, base + difference
        begin = span.stop
    return simulate(OLD, port, starboard, step)


class Craft:
    """Publishes a run, faster than it was driven, stamped as it was."""

    def __init__(self, bench, run):
        self.run, self.sensed = run, with_noise(run, SensorNoise(), 3)
        self.odometry = bench.publisher(Odometry, 'odometry')
        self.left = bench.publisher(Float64, 'thrusters/left/thrust')
        self.right = bench.publisher(Float64, 'thrusters/right/thrust')

    def drive(self, begin, end):
        """Publish the samples from begin to end, s."""
        covariances = np.diag([0.3, 0.3, 0.005]) ** 2, np.diag([0.05, 0.05, 0.005]) ** 2
        for k in range(round(begin / 0.1), round(end / 0.1)):
            s = self.sensed
            motion = (float(a[k]) for a in (s.x, s.y, s.heading, s.surge, s.sway, s.yaw_rate))
            self.left.publish(Float64(data=float(s.port[k])))
            self.right.publish(Float64(data=float(s.starboard[k])))
            state = ManoeuvreState(START + s.time[k], *motion, *covariances)
            self.odometry.publish(odometry_message(state, 'odom', 'base_link'))
            time.sleep(1.0 / 250.0)

    def yaw_rate_error(self, forecasts, begin, end):
        """Root mean square error of forecasts for stamps between begin and end, rad/s."""
        errors = []
        for message in forecasts:
            at = stamp_ns(message.header.stamp) * 1e-9 - START
            if begin <= at < min(end, self.run.time[-1]):
                errors.append(message.twist.twist.angular.z - np.interp(at, self.run.time, self.run.yaw_rate))
        assert len(errors) > 50
        return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.long
def test_identify_on_demand_sharpens_the_forecasts(tmp_path):
    path = tmp_path / 'craft.yaml'
    options = ('-r', '__ns:=/wamv')
    given = settings(f'leads_s:=[{LEAD}]', 'forecast_rate_hz:=1.0', 'horizon_s:=2.0')
    predictor = start_node('manoeuvring_predictor', *given, *options)
    parameters = tmp_path / 'parameters.yaml'
    parameters.write_text('/**/manoeuvring_identifier: {ros__parameters: {mass_kg: 180.0, lever_m: 1.027135}}')
    identifier = start_node(
        'manoeuvring_identifier', '--params-file', str(parameters), '-p', f'model_path:={path}', *options
    )
    bench = Bench('wamv')
    forecasts, models, progress = [], [], []
    try:
        craft = Craft(bench, driven())
        bench.node.create_subscription(Odometry, 'manoeuvring/lead_2_0s', forecasts.append, RELIABLE)
        bench.node.create_subscription(String, 'manoeuvring/model', models.append, LATCHED)
        bench.node.create_subscription(Float32, 'manoeuvring_identifier/progress', progress.append, RELIABLE)
        sensors = craft.odometry, craft.left, craft.right
        wait_for(lambda: all(sensor.get_subscription_count() == 2 for sensor in sensors), 'subscriptions')
        response = bench.call('manoeuvring_identifier/identify')
        assert not response.success
        assert 'check its topic' in response.message
        craft.drive(0.0, 120.0)
        wait_for(lambda: forecasts, 'forecasts')
        assert not bench.call('manoeuvring_identifier/rollback').success
        response = bench.call('manoeuvring_identifier/identify')
        assert response.success, response.message
        wait_for(lambda: models, 'model')
        assert progress[-1].data == pytest.approx(1.0)
        assert [m.data for m in progress] == sorted(m.data for m in progress)
        found = manoeuvring_from_yaml(models[-1].data, 'manoeuvring/model')
        assert found.model['Nr'] == pytest.approx(OLD['Nr'], rel=0.15)
        assert read_manoeuvring_model(path).model['Nr'] == found.model['Nr']
        before = len(forecasts)
        craft.drive(120.0, 195.0)
        wait_for(lambda: len(forecasts) > before + 70, 'forecasts with the model')
        blind = craft.yaw_rate_error(forecasts[:before], 20.0, 120.0 + LEAD)
        # the first forecast with the model comes without a new start: its state went on
        sharp = craft.yaw_rate_error(forecasts[before:], 121.0 + LEAD, 200.0)
        assert sharp < 0.8 * blind
        again = bench.call_async('manoeuvring_identifier/identify')
        wait_for(lambda: any(v.get('state') == 'identifying' for _, _, v in bench.statuses.values()), 'identification')
        assert bench.call('manoeuvring_identifier/cancel').success
        assert not bench.wait_for_answer(again, 'identify').success
    finally:
        bench.close()
        codes = [stop(process) for process in (predictor, identifier)]
    for code, output in codes:
        assert code == 0, output
    assert 'new model' in codes[0][1]
    assert 'began anew' not in codes[0][1]
