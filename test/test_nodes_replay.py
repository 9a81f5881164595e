"""Replay and record over real DDS: what went in comes out, and live nodes forecast as play-through does."""

import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from math import radians

import numpy as np
import pytest
from bag_messages import STORE, decoded, stamp_of
from package_process import PATIENCE, ROOT, command_line, environment, wait_for
from rosbags.rosbag2 import StoragePlugin, Writer

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.cli.main import main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import read_imu, write_imu_bag
from swath_sysid.formats.messages import stamp_ns as time_ns
from swath_sysid.formats.model_file import write_model
from swath_sysid.formats.output_bag import Recording

pytest.importorskip('rclpy', reason='replay and record need ROS 2')

from live_bench import LATCHED, Bench  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import Imu  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from swath_sysid.nodes.replay import SETTLING  # noqa: E402

pytestmark = pytest.mark.dds

HULL = IdentifiedModel.exactly(hull_named('swath-roll').model)


@contextmanager
def verb(*words, ends=signal.SIGINT):
    """A verb in a process of its own, ended by a signal unless it ends by itself; exit code 0."""
    child = command_line(*words)
    try:
        yield child
        if child.poll() is None and ends is not None:
            child.send_signal(ends)
        told, _ = child.communicate(timeout=PATIENCE)
        assert child.returncode == 0, told
    finally:
        if child.poll() is None:
            child.kill()
            child.communicate()


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('bag') / 'release.mcap'
    trial = simulated_trial(HULL.model, radians(5.0), 3.0, 50.0, SensorNoise(0.0005, 0.003), seed=3, hold=1.0)
    write_imu_bag(path, trial, start_stamp_ns=1_700_000_000_000_000_000)
    return path


@pytest.fixture
def bench():
    """It hears the nodes, and is no sensor."""
    bench = Bench(imu_topic='elsewhere')
    yield bench
    bench.close()


def wait_for_recorder(bench, namespace='/'):
    wait_for(lambda: ('record', namespace) in bench.node.get_node_names_and_namespaces(), 'the recorder')


def numbers_on(path, topic):
    """The floats that a forecast fills, of each sensor_msgs/Imu on a topic, by its stamp."""
    found = {}
    for _, message in decoded(path, topic):
        turn, rates = message.orientation, message.angular_velocity
        covariances = *message.orientation_covariance, *message.angular_velocity_covariance
        found[stamp_of(message)] = turn.x, turn.y, turn.z, turn.w, rates.x, rates.y, rates.z, *covariances
    return found


@pytest.mark.long
def test_live_nodes_under_replay_forecast_as_play_through_does(bag, tmp_path, bench):
    model, params = tmp_path / 'hull.yaml', tmp_path / 'params.yaml'
    write_model(model, {'roll': HULL})
    params.write_text(
        f'identifier:\n  ros__parameters: {{model_path: {model}, auto_identify: false}}\n'
        'predictor:\n  ros__parameters: {frame_id: hull}\n'
    )
    samples = len(read_imu(bag).stamps)
    offline = tmp_path / 'offline.mcap'
    assert main(['play-through', str(bag), '--output', str(offline), '--params-file', str(params)]) == 0

    def values(name):
        return bench.statuses.get(name, (0, '', {}))[2]

    def is_worked_off():
        counts = [values(name) for name in ('imu_buffer: imu', 'predictor: imu', 'predictor: forecast')]
        if not all(counts) or any(each['used'] != str(samples) for each in counts[:2]):
            return False
        # the first sample has no forecast of the next
        return int(counts[1]['passed-over']) + int(counts[2]['published']) == samples - 1

    # best effort may lose samples on a busy machine, and other samples make other forecasts
    for attempt in range(3):
        live = tmp_path / f'live_{attempt}.mcap'
        bench.statuses.clear()
        with ExitStack() as stack:
            nodes = stack.enter_context(verb('run', '--params-file', params))
            stack.enter_context(verb('record', '--output', live))
            wait_for(lambda: values('predictor: forecast').get('has_model_roll') == 'True', 'the model')
            wait_for_recorder(bench)
            # imu_buffer, predictor and the recorder
            with verb('replay', bag, '--wait-for', 3, ends=None):
                pass
            over = time.monotonic() + 30.0
            wait_for(lambda end=over: is_worked_off() or time.monotonic() > end, 'what comes of all samples')
            assert nodes.poll() is None
        if is_worked_off() and len(decoded(live, '/imu/data')) == samples:
            break
    else:
        pytest.fail('samples were lost in three replays')
    passed_over = int(values('predictor: imu')['passed-over'])
    assert values('predictor: imu')['late-fit'] == '0'
    for topic in ('/forecast/next', '/forecast/lead_0_5s', '/forecast/lead_2_0s'):
        expected, found = (numbers_on(path, topic) for path in (offline, live))
        assert len(expected) > 30 and len(found) >= len(expected) - passed_over
        assert found == {stamp: expected[stamp] for stamp in found}, topic
    horizons = [{stamp_of(m): m for _, m in decoded(path, '/forecast/horizon')} for path in (offline, live)]
    assert len(horizons[1]) >= len(horizons[0]) - passed_over
    for stamp, other in horizons[1].items():
        for name in ('positions', 'velocities'):
            one, two = ([getattr(point, name) for point in part.points] for part in (horizons[0][stamp], other))
            np.testing.assert_array_equal(one, two)
    shown = {
        f'/diagnostics/{status.name}/{pair.key}'
        for _, message in decoded(live, '/diagnostics')
        for status in message.status
        for pair in status.values
    }
    layout = (ROOT / 'config' / 'plotjuggler_layout.xml').read_text(encoding='utf-8')
    drawn = {part.split('"')[0] for part in layout.split('<curve name="')[1:] if part.startswith('/diagnostics/')}
    assert drawn and drawn <= shown


@pytest.mark.long
def test_a_recording_in_a_namespace_holds_what_was_replayed_there(bag, tmp_path, bench):
    whole, copy = tmp_path / 'whole.mcap', tmp_path / 'copy.mcap'
    assert main(['play-through', str(bag), '--output', str(whole), '--with-imu']) == 0
    within = '--namespace', 'boat'
    topics = '/imu/data', '/forecast/next', '/forecast/lead_1_0s'
    asked = [word for topic in topics for word in ('--topic', topic)]
    with verb('record', '--output', copy, *within, ends=signal.SIGTERM) as recorder:
        wait_for_recorder(bench, '/boat')
        with verb('replay', whole, '--rate', 4, *asked, *within, ends=None):
            # it begins once the recorder has subscribed to the IMU, and soon to the rest
            pass
        assert recorder.poll() is None
        assert (tmp_path / 'copy.recording').is_dir() and not copy.exists()
    assert not (tmp_path / 'copy.recording').exists()
    for topic in topics:
        assert list(numbers_on(copy, f'/boat{topic}').items()) == list(numbers_on(whole, topic).items())


@pytest.mark.long
def test_replay_leaves_out_what_the_nodes_publish_unless_asked(bag, tmp_path, capfd):
    whole = tmp_path / 'whole.mcap'
    assert main(['play-through', str(bag), '--output', str(whole), '--with-imu']) == 0
    quickly = '--rate', '100', '--wait', '0'
    for words, left_out in (([], True), (['--topic', 'forecast/next'], False)):
        assert main(['replay', str(whole), *words, *quickly]) == 0
        told = capfd.readouterr().err
        assert ('left out, because the nodes publish them themselves' in told) == left_out
        assert f'publishing {"/imu/data" if left_out else "/forecast/next"}\n' in told
    assert main(['replay', str(whole), '--topic', '/imu/other', *quickly]) == 2
    assert 'no topic /imu/other: it holds' in capfd.readouterr().err
    assert main(['play-through', str(bag), '--output', str(tmp_path / 'outputs.mcap')]) == 0
    assert main(['replay', str(tmp_path / 'outputs.mcap'), *quickly]) == 2
    assert 'has no topic that the nodes do not publish themselves' in capfd.readouterr().err


@pytest.mark.long
def test_the_sensor_of_the_running_nodes_is_recorded_under_its_name(tmp_path):
    output, sent = tmp_path / 'run.mcap', 50
    bench = Bench(imu_topic='/xsens/imu')
    try:
        with (
            verb('run', '--namespace', 'boat', '--imu-topic', '/xsens/imu'),
            verb('record', '--namespace', 'boat', '--output', output),
        ):
            # imu_buffer, predictor and the recorder
            wait_for(lambda: bench.imu.get_subscription_count() >= 3, 'the recorder at the sensor')
            for _ in range(sent):
                bench.imu.publish(Imu())
                time.sleep(0.01)
    finally:
        bench.close()
    assert 0 < len(decoded(output, '/xsens/imu')) <= sent


@pytest.mark.long
def test_a_recorder_without_a_sensor_warns_soon_and_at_the_end(tmp_path, bench):
    sea = bench.publisher(String, '/sea/state', LATCHED)
    sea.publish(String(data='calm'))
    with command_line('record', '--output', tmp_path / 'run.mcap') as recorder:
        told = ''
        while 'no message on /imu/data (nobody publishes it)' not in told or 'recording /sea/state' not in told:
            assert (line := recorder.stdout.readline()), told
            told += line
        wait_for(lambda: sea.get_subscription_count() > 0, 'the recorder at the sea state')
        time.sleep(SETTLING)
        for _ in range(2):
            recorder.send_signal(signal.SIGINT)
        rest, _ = recorder.communicate(timeout=PATIENCE)
        assert recorder.returncode == 0 and 'no message on /imu/data' in rest and 'Traceback' not in told + rest
    assert len(decoded(tmp_path / 'run.mcap', '/sea/state')) == 1


@pytest.mark.long
def test_a_killed_recording_can_be_read(bag, tmp_path):
    with ExitStack() as stack:
        player = stack.enter_context(verb('replay', bag, '--loop', '--wait-for', 1))
        silent = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
        recorder = command_line('record', '--output', tmp_path / 'cut.mcap', **silent)
        try:
            growing = tmp_path / 'cut.recording' / 'cut.recording.mcap'
            wait_for(lambda: growing.exists() and growing.stat().st_size > 50_000, 'what was recorded')
        finally:
            recorder.kill()
            recorder.wait()
        assert player.poll() is None
    with pytest.raises(InputError, match='can be read as a bag: move it away'):
        Recording(tmp_path / 'cut.mcap')
    record = read_imu(tmp_path / 'cut.recording', '/imu/data')
    assert record.stamps.size > 25
    assert {advice.code for advice in record.advice} == {'damaged-bag'}


@pytest.mark.long
def test_replay_waits_for_its_listeners_tells_the_time_keeps_the_pace_and_loops(bag, bench):
    stamps, arrivals, clocks = [], [], []

    def hear(message):
        stamps.append(stamp_of(message))
        arrivals.append(time.monotonic())

    bench.node.create_subscription(Imu, '/imu/data', hear, 1000)
    bench.node.create_subscription(Clock, '/clock', lambda m: clocks.append(time_ns(m.clock)), 1000)
    with (
        bench.another_node() as other,
        verb('replay', bag, '--loop', '--clock', '--rate', 4, '--wait', PATIENCE, '--wait-for', 2),
    ):
        wait_for(lambda: bench.node.count_publishers('/imu/data'), 'the replay')
        time.sleep(4.0 * SETTLING)
        assert not stamps
        other.create_subscription(Imu, '/imu/data', lambda message: None, 1)
        wait_for(lambda: sum(np.diff(stamps) < 0) >= 1 and len(clocks) > 20, 'the second round')
    last, known = np.flatnonzero(np.diff(stamps) < 0)[0], read_imu(bag).stamps
    assert stamps[: last + 1] == known.tolist(), 'from the first sample on'
    assert known[0] <= min(clocks) and max(clocks) <= known[-1] + 10**9
    # a second for four of the record; the machine may be slow, but nothing comes early
    assert arrivals[last] - arrivals[0] > 0.9


def test_replay_waits_no_longer_than_it_was_told_and_refuses_what_cannot_be(bag, tmp_path, capfd):
    assert main(['replay', str(bag), '--rate', '50', '--wait', '0', '--wait-for', '2']) == 0
    assert 'only 0 of 2 subscribers are connected' in capfd.readouterr().err
    header = STORE.types['std_msgs/msg/Header'](STORE.types['builtin_interfaces/msg/Time'](sec=0, nanosec=0), '')
    with Writer(tmp_path / 'strange', version=9, storage_plugin=StoragePlugin.MCAP) as out:
        kind = {'msgdef': 'std_msgs/Header header\n', 'rihs01': 'RIHS01_0'}
        connection = out.add_connection('/strange', 'somebodys_msgs/msg/Thing', **kind)
        out.write(connection, 0, STORE.serialize_cdr(header, 'std_msgs/msg/Header'))
    for words, sentence in (
        ([tmp_path / 'strange'], 'somebodys_msgs/msg/Thing'),
        ([tmp_path / 'other'], 'file not found'),
        ([bag, '--rate', '0'], ''),
        ([bag, '--wait-for', '-1'], ''),
    ):
        assert main(['replay', *map(str, words)]) == 2
        assert sentence in capfd.readouterr().err


@pytest.mark.parametrize('name', ['out.db3', 'taken.mcap', 'nowhere/out.mcap'])
def test_recordings_that_cannot_be_are_told_at_once(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'taken.mcap').write_text('')
    assert main(['record', '--output', name]) == 2
    assert name in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ['taken.mcap']


@pytest.mark.parametrize('words', [['replay', 'some.mcap'], ['record'], ['demo']])
def test_without_ros_one_sentence_says_what_to_do(words, tmp_path):
    code = f'import sys; sys.modules["rclpy"] = None; from swath_sysid.cli.main import main; sys.exit(main({words}))'
    command = [sys.executable, '-c', code]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment())
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1 and 'pip install' in result.stderr
    assert list(tmp_path.iterdir()) == []
