"""The nodes manoeuvring_predictor and manoeuvring_identifier over DDS."""

import math
import time
from contextlib import closing
from itertools import count

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy')

from hostile_manoeuvring_models import manoeuvring_text, manoeuvring_texts  # noqa: E402
from live_bench import RELIABLE, Bench, settings, start_node, stop, wait_for  # noqa: E402
from manoeuvring_runs import MODEL, OLD  # noqa: E402
from nav_msgs.msg import Odometry, Path  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from spoilt_messages import spoilt  # noqa: E402
from std_msgs.msg import Float32, Float64, Float64MultiArray, String  # noqa: E402
from test_nodes_model_intake import (  # noqa: E402
    Intake,
    assert_a_bad_model_file_does_not_end,
    assert_each_text_is_refused_while_forecasts_go_on,
)

from swath_sysid.formats.messages import stamp_ns  # noqa: E402
from swath_sysid.manoeuvring.formats.model_file import (  # noqa: E402
    manoeuvring_from_yaml,
    manoeuvring_to_yaml,
    read_manoeuvring_model,
)
from swath_sysid.manoeuvring.hull.simulation import simulate  # noqa: E402
from swath_sysid.manoeuvring.hull.standard_tests import RunNoise, with_noise  # noqa: E402
from swath_sysid.manoeuvring.nodes.identifier import ManoeuvringIdentifier  # noqa: E402
from swath_sysid.manoeuvring.nodes.predictor import ManoeuvringPredictor, odometry_message, odometry_reading  # noqa: E402
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreState  # noqa: E402
from swath_sysid.nodes.qos import LATCHED  # noqa: E402

pytestmark = pytest.mark.dds


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
    message.pose.covariance[[0, 7]] = 0.8e4, 1.2e4  # so large a variance says that nothing was measured
    assert {'x', 'y'} & odometry_reading(message).std.keys() == {'x'}


@pytest.mark.long
@pytest.mark.parametrize('kind', [ManoeuvringPredictor, ManoeuvringIdentifier])
def test_messages_of_which_any_field_is_spoilt_end_nothing_and_good_ones_are_used_after_them(kind):
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node, samples = kind(), count()
    port, starboard = map(node._thrust_callback, ('port', 'starboard'))

    def good():
        time_ = 0.1 * next(samples)
        state = ManoeuvreState(START + time_, time_, 0.0, 0.0, 1.0, 0.0, 0.0, np.eye(3), np.eye(3))
        return deserialize_message(odometry_message(state, 'odom', 'base_link'), Odometry)

    def drive(seconds):
        for _ in range(round(seconds / 0.1)):
            port(Float64(data=50.0))
            starboard(Float64(data=50.0))
            node._on_odometry(good())

    try:
        drive(10.0)
        callbacks = [(Float64(data=50.0), port), (good(), node._on_odometry)]
        if kind is ManoeuvringPredictor:
            turning = Imu(header=good().header)
            future = Float64MultiArray(data=[0.0, 50.0, 50.0])
            callbacks += [(turning, node._on_imu), (future, node._on_future), (String(data='no'), node._on_model)]
        for message, take in callbacks:
            for _, each in spoilt(message):
                take(each)
                node._on_odometry(good())
        before = sum(node.pipeline.counts.values()) if kind is ManoeuvringPredictor else 0
        drive(30.0)
        if kind is ManoeuvringPredictor:
            assert sum(node.pipeline.counts.values()) == before
            (path,) = (step.path for step in [node.pipeline._forecast()])
            assert np.allclose([state.surge for state in path], 1.0, atol=0.1)
        else:
            assert np.all(np.abs(node.window.trial().surge) < 100.0) and node.window.size > 300
    finally:
        node.destroy_node()
        rclpy.shutdown()


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
        self.run, self.sensed = run, with_noise(run, RunNoise(), 3)
        self.odometry = bench.publisher(Odometry, 'odometry')
        self.imu = bench.publisher(Imu, 'imu/data')
        self.left = bench.publisher(Float64, 'thrusters/left/thrust')
        self.right = bench.publisher(Float64, 'thrusters/right/thrust')
        self.sensors = self.odometry, self.left, self.right

    def drive(self, begin, end):
        """Publish the samples from begin to end, s."""
        covariances = np.diag([0.3, 0.3, 0.005]) ** 2, np.diag([0.05, 0.05, 0.005]) ** 2
        for k in range(round(begin / 0.1), round(end / 0.1)):
            s = self.sensed
            motion = (float(a[k]) for a in (s.x, s.y, s.heading, s.surge, s.sway, s.yaw_rate))
            self.left.publish(Float64(data=float(s.port[k])))
            self.right.publish(Float64(data=float(s.starboard[k])))
            state = ManoeuvreState(START + s.time[k], *motion, *covariances)
            odometry = odometry_message(state, 'odom', 'base_link')
            turning = Imu(header=deserialize_message(odometry, Odometry).header)
            turning.angular_velocity.z = state.yaw_rate
            self.imu.publish(turning)
            self.odometry.publish(odometry)
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
def test_forecasts_over_dds():
    process = start_node('manoeuvring_predictor', '-p', 'leads_s:=[1.0, 5.0]', '-r', '__ns:=/wamv')
    bench = Bench('wamv')
    paths, leads = [], []
    try:
        bench.node.create_subscription(Path, 'manoeuvring/forecast', paths.append, RELIABLE)
        bench.node.create_subscription(Odometry, 'manoeuvring/lead_5_0s', leads.append, RELIABLE)
        run = simulate(OLD, np.full(200, 40.0), np.full(200, 90.0), 0.1, (1.0, 0.0, 0.0))
        craft, model = Craft(bench, run), bench.publisher(String, 'manoeuvring/model', LATCHED)
        wait_for(lambda: all(sensor.get_subscription_count() for sensor in craft.sensors), 'subscriptions')
        wait_for(lambda: any('no ' in text for _, text, _ in bench.statuses.values()), 'diagnostic')
        model.publish(String(data='{'))
        wait_for(lambda: any(v.get('bad_models') == '1' for _, _, v in bench.statuses.values()), 'count of bad models')
        model.publish(String(data=manoeuvring_to_yaml(MODEL)))
        craft.drive(0.0, 8.0)
        bad = ManoeuvreState(START + 8.0, math.nan, *[0.0] * 5, *np.zeros((2, 3, 3)))
        craft.odometry.publish(odometry_message(bad, 'odom', 'base_link'))
        wait_for(lambda: leads and stamp_ns(leads[-1].header.stamp) * 1e-9 > START + 12.0, 'forecast')
        at = round((stamp_ns(leads[-1].header.stamp) * 1e-9 - START) / 0.1)
        pose, twist = leads[-1].pose, leads[-1].twist.twist
        assert np.hypot(pose.pose.position.x - run.x[at], pose.pose.position.y - run.y[at]) < 0.5
        assert twist.angular.z == pytest.approx(run.yaw_rate[at], abs=0.02)
        assert 0 < pose.covariance[0] < 100
        stamps = [stamp_ns(p.header.stamp) * 1e-9 for p in paths[-1].poses]
        assert len(stamps) == 40 and np.allclose(np.diff(stamps), 0.5)
        wait_for(lambda: any(v.get('not-finite') == '1' for _, _, v in bench.statuses.values()), 'counts')
    finally:
        bench.close()
        code, output = stop(process)
    assert code == 0, output
    assert 'new model' in output


@pytest.mark.release
def test_identify_on_demand_sharpens_the_forecasts(tmp_path):
    path = tmp_path / 'craft.yaml'
    options = ('-r', '__ns:=/wamv')
    given = settings(f'leads_s:=[{LEAD}]', 'forecast_rate_hz:=1.0', 'horizon_s:=2.0')
    predictor = start_node('manoeuvring_predictor', *given, *options)
    file = tmp_path / 'parameters.yaml'
    file.write_text('/**/manoeuvring_identifier: {ros__parameters: {mass_kg: 180.0, lever_m: 1.027135}}')
    given = '--params-file', str(file), '-p', f'model_path:={path}'
    identifier = start_node('manoeuvring_identifier', *given, *options)
    bench = Bench('wamv')
    forecasts, models, progress = [], [], []
    try:
        craft = Craft(bench, driven())
        bench.node.create_subscription(Odometry, 'manoeuvring/lead_2_0s', forecasts.append, RELIABLE)
        bench.node.create_subscription(String, 'manoeuvring/model', models.append, LATCHED)
        bench.node.create_subscription(Float32, 'manoeuvring_identifier/progress', progress.append, RELIABLE)
        wait_for(lambda: all(sensor.get_subscription_count() == 2 for sensor in craft.sensors), 'subscriptions')
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
        # of two minutes nothing is held out, so the model is used and told to be doubtful
        assert found.verdict == 'doubtful' and 'three minutes' in found.verdict_sentence
        assert f'doubtful: {found.verdict_sentence}' in response.message
        in_use = f'the model is doubtful: {found.verdict_sentence}'
        wait_for(lambda: any(in_use in words for _, words, _ in bench.statuses.values()), 'the model in use')
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


@pytest.mark.long
def test_each_text_that_is_no_model_is_refused_while_forecasts_go_on():
    def refusals(bench):
        return bench.statuses[status][2].get('bad_models', 0)

    node, status = 'manoeuvring_predictor', 'manoeuvring_predictor: manoeuvre'
    with closing(Intake('manoeuvring/model', manoeuvring_text(), status, refusals, node)) as intake:
        assert_each_text_is_refused_while_forecasts_go_on(intake)


@pytest.mark.long
def test_a_model_file_that_cannot_be_used_does_not_end_the_node(tmp_path):
    path = tmp_path / 'model.yaml'
    path.write_text(manoeuvring_texts()['mass NaN'][0])

    def told(statuses):
        _, _, values = statuses.get('refusing/manoeuvring_predictor: manoeuvre', (0, '', {}))
        return str(path) in values.get('refused_model', '')

    assert_a_bad_model_file_does_not_end('manoeuvring_predictor', 'model_file', path, told)
