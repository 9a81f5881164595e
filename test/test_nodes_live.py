"""The three nodes over DDS: from the sensor to the model and the forecast, and everything that can be asked of them."""

import os
import signal

import numpy as np
import pytest

pytest.importorskip('rclpy')

from imu_stream import EPOCH_NS, decay_stream, reading  # noqa: E402
from live_bench import (  # noqa: E402
    HEARD,
    LATCHED,
    PATIENCE,
    Bench,
    children,
    running,
    settings,
    stamp_ns,
    start_node,
    start_together,
    stop,
    wait_for,
)
from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import SetBool  # noqa: E402

from swath_sysid.attitude.hull.identified_model import COEFFICIENT_NAMES, coefficients  # noqa: E402
from swath_sysid.attitude.motion.window import MotionWindow, WindowSettings  # noqa: E402
from swath_sysid.formats.messages import window_message, window_table  # noqa: E402
from swath_sysid.formats.model_file import model_from_yaml, read_model  # noqa: E402
from swath_sysid.nodes.parameters.table import ATTITUDE_NODES, parameters_of  # noqa: E402
from swath_sysid.nodes.qos import time_message  # noqa: E402

pytestmark = pytest.mark.dds

RATE, STEP_NS = 50.0, 20_000_000


class Craft:
    def __init__(self, bench, process, model_path):
        self.bench, self.process, self.model_path = bench, process, model_path
        self.stamp = EPOCH_NS
        self.sent = 0

    def rest(self, count=100):
        """With a little noise: a sensor that has moved and repeats itself is silent."""
        noise = 1e-5 * np.random.default_rng(self.sent).standard_normal(count)
        self.move([reading(self.stamp + (k + 1) * STEP_NS, 0.01 + noise[k], -0.02) for k in range(count)])

    def swing(self, duration=22.0, **motion):
        first = self.stamp + STEP_NS
        self.move(list(decay_stream(RATE, duration, release=4.0, hold=1.0, first_ns=first, **motion)))

    def move(self, readings):
        self.sent += self.bench.send(readings)
        self.stamp = readings[-1].stamp_ns
        # the window is asked for next, maybe
        self.bench.settle('imu_buffer', self.sent)

    def identify(self):
        return self.bench.call('identifier/identify')


@pytest.fixture(scope='module')
def craft(tmp_path_factory):
    model_path = tmp_path_factory.mktemp('craft') / 'model.yaml'
    bench = Bench()
    with running(
        bench,
        start_together('-p', f'model_path:={model_path}', '-p', 'window_timeout_s:=60.0', '-p', 'worker_idle_s:=600.0'),
    ) as process:
        yield Craft(bench, process, model_path)
    bench.close()


@pytest.fixture(scope='module')
def identified(craft):
    """The craft after its first decay: noticed, published, identified and forecast without being asked."""
    for topic in ('motion/window', 'model/description', 'model/coefficients'):
        craft.bench.heard[topic].clear()
    craft.swing()
    wait_for(lambda: craft.bench.heard['model/description'], 'model')
    wait_for(lambda: craft.bench.counts('identifier', 'identification')['published'], 'report of the model')
    return craft


#: type, node and whether latched; all are reliable
CONTRACT = {
    'motion/window': ('sensor_msgs/msg/PointCloud2', 'imu_buffer', True),
    'model/description': ('std_msgs/msg/String', 'identifier', True),
    'model/coefficients': ('std_msgs/msg/Float64MultiArray', 'identifier', True),
    'identifier/progress': ('std_msgs/msg/Float32', 'identifier', False),
    'forecast/next': ('sensor_msgs/msg/Imu', 'predictor', False),
    'forecast/lead_5_0s': ('sensor_msgs/msg/Imu', 'predictor', False),
    'forecast/horizon': ('trajectory_msgs/msg/JointTrajectory', 'predictor', False),
    'forecast/calm': ('trajectory_msgs/msg/JointTrajectory', 'predictor', True),
    'forecast/outlook': ('sensor_msgs/msg/JointState', 'predictor', False),
    'forecast/valid_lead': ('std_msgs/msg/Float32MultiArray', 'predictor', False),
}


def test_topics_are_published_and_subscribed_to_as_agreed(craft):
    for topic, (kind, node, is_latched) in CONTRACT.items():
        (found,) = craft.bench.node.get_publishers_info_by_topic(f'/{topic}')
        qos = found.qos_profile
        assert (found.topic_type, found.node_name) == (kind, node)
        assert qos.reliability == ReliabilityPolicy.RELIABLE
        assert (qos.durability == DurabilityPolicy.TRANSIENT_LOCAL) == is_latched
        # DDS does not tell the depth of others everywhere
        assert qos.history != HistoryPolicy.KEEP_LAST or qos.depth == 1 or node == 'identifier', topic
    found = craft.bench.node.get_subscriptions_info_by_topic('/imu/data')
    assert {info.node_name for info in found} == {'imu_buffer', 'predictor'}
    for info in found:
        assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
        assert info.qos_profile.durability == DurabilityPolicy.VOLATILE


@pytest.mark.long
def test_before_a_model_it_says_so_and_forecasts(craft):
    craft.rest()
    craft.bench.wait_for_forecast_after(craft.stamp)
    forecast = 'predictor: forecast'
    wait_for(lambda: 'without a hull model' in craft.bench.statuses[forecast][1], 'word of the missing model')
    level, _, values = craft.bench.statuses[forecast]
    assert level == 0 and values['has_model_pitch'] == 'False'
    assert craft.bench.call('identifier/rollback').message == 'there is no model before this one'
    assert not craft.bench.call('identifier/cancel').success
    answer = craft.identify()
    assert not answer.success and 'hardly moves' in answer.message


@pytest.mark.long
def test_a_decay_is_noticed_identified_and_forecast_unasked(identified):
    bench = identified.bench
    table = window_table(bench.heard['motion/window'][-1])
    assert len(table.rows) > 500
    models = model_from_yaml(bench.heard['model/description'][-1].data)
    assert models['pitch'].model.natural_period == pytest.approx(2.6, rel=0.02)
    assert read_model(identified.model_path) == models
    message = wait_for(lambda: bench.heard['model/coefficients'], 'coefficients')[-1]
    rows, columns = message.layout.dim
    assert (rows.label, rows.size, rows.stride) == ('pitch,pitch_std', 2, 2 * len(COEFFICIENT_NAMES))
    assert (columns.label, columns.size) == (','.join(COEFFICIENT_NAMES), len(COEFFICIENT_NAMES))
    assert list(message.data) == coefficients(models)[1].ravel().tolist()
    wait_for(lambda: bench.statuses['predictor: forecast'][2]['has_model_pitch'] == 'True', 'model at the predictor')
    assert bench.counts('imu_buffer', 'window')['decays_noticed'] >= 1
    shares = [message.data for message in bench.heard['identifier/progress']]
    assert shares and shares[-1] == 1.0


@pytest.mark.long
def test_a_changed_craft_is_followed_and_rollback_leads_back(identified):
    def period_in(path):
        return read_model(path)['pitch'].model.natural_period

    bench, path = identified.bench, identified.model_path
    identified.identify()
    answer = identified.identify()
    assert not answer.success and 'not published, the current model knows the next release as well' in answer.message
    before = bench.heard['model/description'][-1:] or [String(data=path.read_text())]
    assert bench.set_parameters('identifier', auto_identify=False) == []
    assert bench.call('imu_buffer/clear').success
    identified.swing(period=3.1)
    answer = identified.identify()
    assert answer.success and 'contradicts this decay and is forgotten; adequate: ' in answer.message
    wait_for(lambda: bench.heard['model/description'], 'model')
    assert period_in(path) == pytest.approx(3.1, rel=0.02)
    answer = bench.call('identifier/rollback')
    assert answer.success and answer.message.startswith('back to pitch ')
    assert answer.message.endswith(f'the previous model file is kept as {path}.1')
    assert period_in(f'{path}.1') == pytest.approx(3.1, rel=0.02)
    wait_for(lambda: bench.heard['model/description'][-1].data == before[0].data, 'model before')
    assert read_model(path) == model_from_yaml(before[0].data)
    answer = bench.call('identifier/undo_rollback')
    assert answer.success and answer.message.startswith('the rollback is undone: again pitch ')
    assert period_in(path) == pytest.approx(3.1, rel=0.02)
    assert bench.call('identifier/rollback').success
    assert bench.set_parameters('identifier', auto_identify=True) == []


@pytest.mark.long
def test_while_it_identifies_it_answers_and_forecasts_and_can_be_cancelled(identified):
    bench = identified.bench
    assert bench.set_parameters('identifier', population=20000, generations=100000) == []
    running_one = bench.call_async('identifier/identify')
    wait_for(lambda: bench.statuses['identifier: identification'][2]['state'] == 'identifying', 'work')
    assert 'is running' in bench.call('identifier/rollback').message
    another_one = bench.call_async('identifier/identify')
    identified.rest(100)
    bench.wait_for_forecast_after(identified.stamp)
    assert not running_one.done() and not another_one.done()
    assert bench.call('identifier/cancel').success
    for waiting in (running_one, another_one):
        answer = bench.wait_for_answer(waiting, 'identify')
        assert not answer.success and answer.message == 'the identification was cancelled'
    assert bench.set_parameters('identifier', population=0, generations=0) == []


@pytest.mark.long
def test_a_worker_that_dies_is_reported_and_the_next_identification_works(identified):
    bench = identified.bench
    assert bench.set_parameters('identifier', population=20000, generations=100000) == []
    running_one = bench.call_async('identifier/identify')
    wait_for(lambda: bench.statuses['identifier: identification'][2]['state'] == 'identifying', 'work')
    wait_for(lambda: len(children(identified.process.pid)) == 2, 'both workers')
    before = set(children(identified.process.pid))
    for pid in before:
        os.kill(pid, signal.SIGKILL)
    answer = bench.wait_for_answer(running_one, 'identify')
    assert not answer.success and 'was restarted' in answer.message
    wait_for(lambda: bench.counts('identifier', 'identification')['identification-worker-died'] == 1, 'report')
    assert bench.set_parameters('identifier', population=0, generations=0) == []
    assert 'pitch: ' in identified.identify().message
    wait_for(lambda: bench.counts('predictor')['wave-worker-died'] == 1, 'report of the predictor')
    assert len(children(identified.process.pid)) == 2 and not before & set(children(identified.process.pid))


@pytest.mark.long
def test_the_buffer_publishes_clears_and_records_when_asked(identified):
    bench = identified.bench
    assert bench.set_parameters('identifier', auto_identify=False) == []
    assert bench.call('imu_buffer/clear').success
    for answer in (bench.call('imu_buffer/publish_window'), identified.identify()):
        assert not answer.success and 'window is empty' in answer.message
    first = identified.stamp
    identified.rest(50)
    bench.wait_for_forecast_after(identified.stamp)
    bench.heard['motion/window'].clear()
    assert '50 samples' in bench.call('imu_buffer/publish_window').message
    message = wait_for(lambda: bench.heard['motion/window'], 'window')[-1]
    assert stamp_ns(message) == identified.stamp
    times = window_table(message).rows[:, 0]
    np.testing.assert_allclose(times, (first + STEP_NS * np.arange(1, 51)) * 1e-9, atol=1e-6)
    assert 'not recording' in bench.call('imu_buffer/record', SetBool, SetBool.Request(data=False)).message
    identified.rest(50)
    assert '50 samples' in bench.call('imu_buffer/publish_window').message
    answer = bench.call('imu_buffer/record', SetBool, SetBool.Request(data=True))
    assert answer.message == 'recording, the window is empty'
    assert bench.set_parameters('identifier', auto_identify=True) == []


def test_parameters_are_described_and_checked_on_change(craft):
    for node in ATTITUDE_NODES:
        table = parameters_of(node)
        for parameter, told in zip(table, craft.bench.describe_parameters(node, [p.name for p in table]), strict=True):
            assert parameter.meaning in told.description and parameter.unit in told.description
            assert told.read_only == parameter.read_only
    refused = craft.bench.set_parameters('identifier', equation='no-such-equation', axes=['yaw'], seed=-1)
    assert len(refused) == 3 and "there is no equation 'no-such-equation'" in refused[0]
    (reason,) = craft.bench.set_parameters('imu_buffer', frame='frd')
    assert 'read-only' in reason
    assert craft.bench.set_parameters('imu_buffer', window_s=90.0) == []


@pytest.mark.long
def test_names_are_relative_and_time_may_be_simulated(craft):
    """In a namespace, with another topic, on simulated time that is set back; the model file stays."""
    text = craft.model_path.read_text()
    craft.model_path.write_text(f'# of the yard\n{text}')
    bench = Bench('tank', 'sensor/imu')
    clock = bench.publisher(Clock, '/clock', 10)
    given = settings('use_sim_time:=true', f'model_path:={craft.model_path}')
    with running(bench, start_together('-r', '__ns:=/tank', '-r', 'imu/data:=sensor/imu', *given)):
        assert wait_for(lambda: bench.heard['model/description'], 'model')[-1].data == text
        for begin in (EPOCH_NS, EPOCH_NS - 100 * 10**9):
            for stamp in range(begin, begin + 10**9, 100_000_000):
                clock.publish(Clock(clock=time_message(stamp)))
                bench.send([reading(stamp + i * 10_000_000) for i in range(10)])
            bench.wait_for_forecast_after(stamp + 90_000_000)
            before = bench.reports
            wait_for(lambda before=before: bench.reports > before + 9, 'diagnostics while the clock stands still')
        counts = bench.counts('predictor')
        assert counts['clock-jumped-back'] == 1 and abs(counts['stamp_age_s']) < 1.0
        assert 'tank/imu_buffer: window' in bench.statuses
        wait_for(lambda: 'the clock stands still' in bench.statuses['tank/predictor: imu'][1], 'word of the clock')
        level, _, values = bench.statuses['tank/predictor: imu']
        assert (level, values['sensor-silent']) == (0, '0')
    assert craft.model_path.read_text() == f'# of the yard\n{text}'
    bench.close()


@pytest.mark.long
def test_each_node_runs_by_itself_and_ends_cleanly_whatever_the_signal(tmp_path):
    bench, apart, large = Bench('alone'), ('-r', '__ns:=/alone'), settings('population:=20000', 'generations:=100000')
    identifier, status = start_node('identifier', *apart, *large), 'alone/identifier: identification'
    wait_for(lambda: status in bench.statuses, 'diagnostics')
    answer = bench.call('identifier/identify')
    assert not answer.success and 'start imu_buffer' in answer.message
    # it is ended at work
    window, (kind, _) = MotionWindow(WindowSettings()), HEARD['motion/window']
    finished = next(filter(None, (window.add(one).finished for one in decay_stream(50.0, 30.0))))
    bench.publisher(kind, 'motion/window', LATCHED).publish(window_message(finished.table, 'base_link'))
    wait_for(lambda: bench.statuses[status][2]['state'] == 'identifying', 'work')
    processes = [
        (identifier, signal.SIGTERM, 8, 1),
        (start_node('imu_buffer', *apart, '-p', 'window_s:=90'), signal.SIGINT, 8, 0),
        (start_node('predictor', *apart), signal.SIGINT, 1, 1),
    ]
    names = {'alone/imu_buffer: imu', 'alone/predictor: imu'}
    wait_for(lambda: names <= set(bench.statuses), 'diagnostics of all')
    for process, number, times, workers in processes:
        left = children(process.pid)
        assert len(left) == workers
        code, output = stop(process, number, times)
        assert code == 0 and 'Traceback' not in output, output
        assert 'ready: ' in output and 'waiting for the first message on /alone/' in output
        wait_for(lambda left=left: not any(os.path.exists(f'/proc/{pid}') for pid in left), 'end of the workers')
    misspelt = start_node('imu_buffer', *apart, '-p', 'window_sec:=90.0')
    output, _ = misspelt.communicate(timeout=PATIENCE)
    assert misspelt.returncode == 2 and 'there is no parameter window_sec: did you mean window_s?' in output
    bench.close()


@pytest.mark.parametrize(
    ('node', 'given', 'sentence'),
    [
        ('imu_buffer', ('-p', 'window_s:=long'), 'window_s'),
        ('predictor', ('-p', 'leads_s:=[2.0, 1.0]'), 'leads'),
        ('imu_buffer', ('-r', 'imu:=/1imu'), "ROS rejects '-r imu:=/1imu'"),
    ],
)
def test_a_wrong_argument_at_the_start_is_one_sentence_and_exit_code_2(node, given, sentence):
    process = start_node(node, *given)
    output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 2 and sentence in output and 'Traceback' not in output
