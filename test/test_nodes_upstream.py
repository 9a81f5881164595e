"""Over DDS: topics of all types become upstream channels, and a leader's motion halves the follower's error."""

import importlib
import math
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest

rclpy = pytest.importorskip('rclpy')

from geometry_msgs.msg import Point, PointStamped, Quaternion, Vector3  # noqa: E402
from live_bench import settings, stamp_ns, start_node, stop  # noqa: E402
from package_process import PATIENCE, ROOT, command_line, wait_for  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from sensor_msgs.msg import Imu, Range  # noqa: E402
from std_msgs.msg import Float64, String  # noqa: E402

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, euler_angles, quaternion  # noqa: E402
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings  # noqa: E402
from swath_sysid.common.errors import InputError  # noqa: E402
from swath_sysid.nodes.executor_loop import events_executor  # noqa: E402
from swath_sysid.nodes.upstream_topics import Upstream  # noqa: E402
from swath_sysid.pipeline.forecast_pipeline import PipelineSettings  # noqa: E402
from swath_sysid.pipeline.health import OK, WARN, Reasons  # noqa: E402
from swath_sysid.pipeline.record_run import run_through  # noqa: E402

pytestmark = pytest.mark.dds


@contextmanager
def a_node(name):
    context = rclpy.Context()
    rclpy.init(context=context)
    found = rclpy.create_node(name, context=context)
    found.spinner = events_executor(context=context)
    found.spinner.add_node(found)
    yield found
    found.spinner.shutdown()
    found.destroy_node()
    rclpy.shutdown(context=context)


@pytest.fixture
def node():
    with a_node('listener') as found:
        yield found


@pytest.fixture
def sensor():
    with a_node('sensor') as found:
        yield found


def spin_until(node, done, what):
    wait_for(done, what, meanwhile=lambda: node.spinner.spin_once(timeout_sec=0.05))


def stamped(kind, stamp_ns, **values):
    message = kind(**values)
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    return message


def listening(node, entries):
    """Upstream channels that hear the node's publishers, what they took, the counts of bad ones, and the pipeline."""
    health, taken, upstream = Reasons('predictor'), [], Upstream(node, entries, 10)
    pipeline = SimpleNamespace(newest_ns=0, add_upstream=lambda *sample: taken.append(sample))
    upstream.listen(pipeline, health)
    return upstream, taken, health, pipeline


def test_topics_of_all_types_are_channels(node):
    """Three know their type by the field, one by its publisher; of an IMU all three quantities are channels."""
    kinds = {'staff': Float64, 'sonar': Range, 'buoy': PointStamped, 'leader/imu': Imu}
    publishers = {topic: node.create_publisher(kind, topic, 10) for topic, kind in kinds.items()}
    upstream, taken, health, _ = listening(node, ['staff:data', 'sonar:range', 'buoy:x', 'buoy:z', 'leader/imu', ''])
    names = upstream.settings(PipelineSettings()).forecaster.upstream
    leader = tuple(f'leader/imu:{field}' for field in ('roll', 'pitch', 'vertical_acceleration'))
    assert names == ('staff:data', 'sonar:range', 'buoy:x', 'buoy:z', *leader)
    for publisher in publishers.values():
        spin_until(node, publisher.get_subscription_count, 'subscription')
    (report,) = upstream.reports()
    assert report.level == WARN and 'no message on /staff yet' in report.message

    publishers['staff'].publish(Float64(data=0.25))
    publishers['sonar'].publish(stamped(Range, 5_000_000_007, range=2.5))
    publishers['buoy'].publish(stamped(PointStamped, 6_000_000_000, point=Point(x=-1.0, z=0.5)))
    up = STANDARD_GRAVITY + 0.3
    x, y, z, w = quaternion(0.1, -0.2, 1.0)
    along = math.sin(0.2), math.sin(0.1) * math.cos(0.2), math.cos(0.1) * math.cos(0.2)
    force = Vector3(**{axis: up * part for axis, part in zip('xyz', along, strict=True)})
    turn = Quaternion(x=x, y=y, z=z, w=w)
    publishers['leader/imu'].publish(stamped(Imu, 7_000_000_000, orientation=turn, linear_acceleration=force))
    spin_until(node, lambda: len(taken) == 7, 'all channels')
    found = {name: (stamp_ns, value) for name, stamp_ns, value in taken}
    assert found['staff:data'] == (None, 0.25)
    assert found['sonar:range'] == (5_000_000_007, pytest.approx(2.5))
    assert (found['buoy:x'], found['buoy:z']) == ((6_000_000_000, -1.0), (6_000_000_000, 0.5))
    assert [found[name][1] for name in leader] == pytest.approx([0.1, -0.2, 0.3], abs=1e-9)
    (report,) = upstream.reports()
    assert report.level == OK and report.values['received_/buoy'] == 1 and not any(health.counts.values())


def test_bad_messages_are_counted_and_left_out(node):
    sonar, leader = node.create_publisher(Range, 'sonar', 10), node.create_publisher(Imu, 'leader', 10)
    upstream, taken, health, _ = listening(node, ['sonar:range', 'leader:roll'])
    for publisher in (sonar, leader):
        spin_until(node, publisher.get_subscription_count, 'subscription')
    without, broken = stamped(Imu, 10**9), stamped(Imu, 2 * 10**9)
    without.orientation_covariance[0], broken.orientation.w = -1.0, math.nan
    for imu in (without, broken):
        leader.publish(imu)
    for seconds, distance in ((1, 1.0), (2, math.inf), (3, math.nan), (3, 2.0), (4, 3.0)):
        sonar.publish(stamped(Range, seconds * 10**9, range=distance))
    spin_until(node, lambda: len(taken) == 2, 'the good ones')
    spin_until(node, lambda: health.counts['bad-upstream'] == 5, 'the bad ones')
    assert [value for _, _, value in taken] == [1.0, 3.0]
    (report,) = upstream.reports()
    assert (report.values['left_out_/sonar'], report.values['left_out_/leader']) == (3, 2)


def test_a_topic_that_falls_silent_is_told_while_the_imu_goes_on(node):
    publisher = node.create_publisher(Float64, 'staff', 10)
    upstream, _, _, pipeline = listening(node, ['staff:data'])
    spin_until(node, publisher.get_subscription_count, 'subscription')

    def level_after(seconds):
        pipeline.newest_ns += round(1e9 * seconds)
        (report,) = upstream.reports()
        return report.level, report.message

    for number in range(4):
        pipeline.newest_ns = 10**18 + 2 * 10**9 * number
        publisher.publish(Float64(data=0.1))
        spin_until(node, lambda sent=number + 1: upstream.reports()[0].values['received_/staff'] == sent, 'a message')
    assert level_after(8.0)[0] == OK
    level, message = level_after(4.0)
    assert level == WARN and 'no message on /staff for 12 s' in message


def test_wrong_types_and_fields_are_errors(node, sensor):
    for kind, topic in ((String, 'words'), (Float64, 'staff')):
        sensor.create_publisher(kind, topic, 10)
        spin_until(node, lambda topic=topic: node.count_publishers(topic), 'publisher')
    for entry, sentence in (
        ('words', 'type std_msgs/msg/String'),
        ('words:data', 'type std_msgs/msg/String'),
        ('staff:range', 'no field range'),
        ('nobody:depth', 'no type has a field depth'),
    ):
        with pytest.raises(InputError, match=sentence):
            Upstream(node, [entry], 10)


def test_a_sensor_that_is_off_needs_a_field(node, sensor, monkeypatch):
    """It may come later, and with another type."""
    monkeypatch.setattr('swath_sysid.nodes.upstream_topics.DISCOVERY', 0.3)
    assert Upstream(node, [''], 10).reports() == []
    upstream, *_ = listening(node, ['buoy', 'sonar:range'])
    assert upstream.settings(PipelineSettings()).forecaster.upstream == ('sonar:range',)
    sensor.create_publisher(Float64, 'sonar', 10)
    words = '/sonar is published as std_msgs/msg/Float64, not sensor_msgs/msg/Range'

    def reported():
        (report,) = upstream.reports()
        return report.level == WARN and words in report.message

    spin_until(node, reported, 'the wrong type')


# -- leader and follower: see examples/leader_and_follower.py

DURATION, WARMUP = 900.0, 600.0


@pytest.fixture
def craft(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / 'examples'))
    return importlib.import_module('leader_and_follower')


def error_at(trial, forecasts, lead):
    """Of the rolls by stamp, s, root mean square over the standard deviation, after the warm-up."""
    errors = [
        angle - np.interp(at + lead, trial.time, trial.roll)
        for at, angle in forecasts.items()
        if WARMUP <= at <= DURATION - lead
    ]
    return float(np.sqrt(np.mean(np.square(errors))) / trial.roll[trial.time >= WARMUP].std()), len(errors)


@pytest.mark.release
def test_a_leader_one_wavelength_ahead_halves_the_error(node, craft, tmp_path):
    """Roll one peak period ahead, from the node, beside the same forecasts without the leader."""
    follower, leader = craft.two_craft(DURATION)
    craft.write_both(tmp_path / 'both.mcap', follower, leader)
    period, heard = craft.PERIOD, {}

    def take(message):
        turn = message.orientation
        heard[(stamp_ns(message) - craft.START_NS) / 1e9 - period] = euler_angles(turn.x, turn.y, turn.z, turn.w)[0]

    node.create_subscription(Imu, 'forecast/lead_5_0s', take, QoSProfile(depth=1000))
    given = settings(
        "upstream:=['leader/imu/data:roll','leader/imu/data:pitch','leader/imu/data:vertical_acceleration']",
        *('leads_s:=[1.0,5.0]', 'forecast_rate_hz:=1.0', 'waves_refit_interval_periods:=4.0', 'in_step:=true'),
    )
    process = start_node('predictor', *given)
    try:
        wait_for(lambda: node.count_subscribers('/leader/imu/data'), 'subscription to the leader')
        how = '--in-step', '--rate', 1000, '--wait-for', 1, '--wait', PATIENCE
        replay = command_line('replay', tmp_path / 'both.mcap', *how)
        spin_until(node, lambda: replay.poll() is not None, 'end of the replay')
        spin_until(node, lambda: max(heard, default=0.0) > DURATION - 3.0, 'the last forecast')
    finally:
        stop(process)
    forecasts = ForecasterSettings(leads=(1.0, period), forecast_rate=1.0, refit_interval=4.0)
    alone = {step.stamp: float(step.forecast.angle('roll')[1]) for step in run_through(follower, forecasts).steps}
    (without, counted), (found, received) = error_at(follower, alone, period), error_at(follower, heard, period)
    # each is sent once, and the next replaces one that has not been taken
    assert received > 0.5 * counted and found <= 0.5 * without
