"""The mounting of a sensor: stated by an argument, a flag, a parameter file or /tf_static; remembered, and missed."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel, check_mounting
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.motion.attitude import Installation, mounting_in
from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.intake import convert
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.cli import run
from swath_sysid.cli.flags import table_of_verbs
from swath_sysid.cli.main import build_parser, main
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import ImuRecord, imu_values
from swath_sysid.formats.identify_records import identify, write_model
from swath_sysid.formats.messages import ImuMessage, diagnostics_message, frame_tree, header, make, serialised
from swath_sysid.formats.model_file import model_to_yaml
from swath_sysid.formats.output_bag import writing_bag
from swath_sysid.formats.reading import read_trial
from swath_sysid.formats.topics import IMU, TRANSFORMS, TYPES

ROTATIONS = (15, -10, 90), (0, 0, 90), (180, 0, 0), (0, -35, 0), (-20, 0, -135)
GRAVITY = 9.81
LINEAR = IdentificationSettings('linear', 'one-step', SearchSettings(generations=1))


def matrix_of(mounting):
    """The oracle: axes of the sensor in the craft, turned by yaw, then pitch, then roll about the turned axes."""
    return Rotation.from_euler('ZYX', mounting[::-1], degrees=True)


def decay(held=2.0, length=20.0, angle=0.14):
    """A release in roll by a hull with a period of 2.5 s; heeled for some seconds before it."""
    time = np.arange(0.0, held + length, 0.02)
    free, frequency = np.maximum(time - held, 0.0), 2.0 * np.pi / 2.5
    roll = angle * np.exp(-0.1 * free) * np.cos(frequency * free)
    noise = np.random.default_rng(1).normal(0.0, 2e-4, (4, time.size))
    forces = GRAVITY * np.sin(roll), GRAVITY * np.cos(roll)
    rates = np.gradient(roll, time) + noise[1], noise[2]
    return Trial(time, roll + noise[0], noise[3], *rates, 0.0 * time, *forces, yaw_rate=0.0 * time)


def turned(trial, mounting):
    """What a sensor mounted like this sends, (N, 37)."""
    turn, values = matrix_of(mounting), imu_values(trial)
    values[:, 0:4] = (Rotation.from_quat(values[:, 0:4]) * turn).as_quat()
    for part in (slice(13, 16), slice(25, 28)):
        values[:, part] = turn.inv().apply(values[:, part])
    return values


def bag_of(path, trial, mounting, frames=()):
    """A bag of a sensor in ``boat/imu``; frames are parent, child and rotation."""
    send = ImuMessage('boat/imu')
    with writing_bag(path) as add:
        if frames:
            each = [
                (header(0, up), name, ((0.0, 0.0, 1.0), tuple(turn.as_quat().tolist()))) for up, name, turn in frames
            ]
            add('/tf_static', TRANSFORMS, 1, serialised(make(TRANSFORMS, each)))
        for stamp, values in zip(np.round(1e9 * trial.time).astype(int).tolist(), turned(trial, mounting), strict=True):
            add('/imu/data', IMU, stamp, send.of_values(stamp, values))
    return path


@pytest.mark.parametrize('mounting', ROTATIONS)
def test_a_turned_sensor_gives_the_motion_of_the_craft_by_argument_and_by_static_transforms(mounting, tmp_path):
    truth, turn = decay(), matrix_of(mounting)
    mast = Rotation.from_euler('ZYX', [30, 5, -7], degrees=True)
    frames = ('boat/base_link', 'boat/mast', mast), ('boat/mast', 'boat/imu', mast.inv() * turn)
    stated = read_trial(bag_of(tmp_path / 'plain.mcap', truth, mounting), mounting=tuple(np.radians(mounting)))
    found = read_trial(bag_of(tmp_path / 'frames.mcap', truth, mounting, frames))
    for trial in (stated, found):
        assert (matrix_of(np.degrees(trial.installation.mounting)) * turn.inv()).magnitude() < np.radians(0.01)
        for axis in ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'accel_z'):
            assert np.allclose(getattr(trial, axis), getattr(truth, axis), atol=1e-6)
        assert not trial.advice


def test_of_several_craft_in_one_recording_each_has_its_own_transforms(tmp_path):
    """Frames of the same names in two namespaces, or of two prefixes on one topic."""
    truth, turns = decay(), ROTATIONS[:2]
    with writing_bag(tmp_path / 'a.mcap') as add:
        for boat, mounting in zip(('boat1', 'boat10'), turns, strict=True):
            for topic, prefix in ((f'/{boat}/tf_static', ''), ('/tf_static', f'{boat}/')):
                placed = ((0.0, 0.0, 0.0), tuple(matrix_of(mounting).as_quat().tolist()))
                frames = [(header(0, f'{prefix}base_link'), f'{prefix}imu', placed)]
                add(topic, TRANSFORMS, 1, serialised(make(TRANSFORMS, frames)))
            for topic, frame in ((f'/{boat}/imu/data', 'imu'), (f'/sensors/{boat}', f'{boat}/imu')):
                send = ImuMessage(frame)
                stamps = np.round(1e9 * truth.time).astype(int).tolist()
                for stamp, values in zip(stamps, turned(truth, mounting), strict=True):
                    add(topic, IMU, stamp, send.of_values(stamp, values))
        for stamp, values in zip(stamps, turned(truth, turns[0]), strict=True):
            add('/boat2/imu/data', IMU, stamp, ImuMessage('imu').of_values(stamp, values))
    for boat in ('boat1', 'boat10'):
        for topic in (f'/{boat}/imu/data', f'/sensors/{boat}'):
            assert np.allclose(read_trial(tmp_path / 'a.mcap', topic=topic).roll, truth.roll, atol=1e-6)
    assert read_trial(tmp_path / 'a.mcap', topic='/boat2/imu/data').installation.mounting is None


def campaign_of(bag):
    path = bag.with_name('campaign.yaml')
    path.write_text(f'title: a\ncraft: {{name: a, draft_m: 0.1}}\ntrials: [{{file: {bag.name}, axis: roll}}]\n')
    return str(path)


#: Verbs that read a sensor, those of wings among them, and what they take to read it soon.
VERBS = {
    'inspect': lambda bag: [str(bag), '--axis', 'roll'],
    'identify': lambda bag: [str(bag), '--axis', 'roll', '--equation', 'linear', '--objective', 'one-step'],
    'identify --at-sea': lambda bag: [str(bag), '--axis', 'roll'],
    'compare': lambda bag: [str(bag), '--axis', 'roll', '--equations', 'linear|linear', '--jobs', '1'],
    'sea': lambda bag: [str(bag)],
    'forecast': lambda bag: [str(bag), '--warmup', '10', '--leads', '0.5'],
    'play-through': lambda bag: [str(bag), '--output', str(bag.with_name('o.mcap'))],
    'history': lambda bag: [str(bag), '--axis', 'roll', '--output', str(bag.with_name('h')), '--jobs', '1'],
    'campaign': lambda bag: [campaign_of(bag), '--output', str(bag.with_name('c')), '--jobs', '1'],
}
VERBS = {words: taken for words, taken in VERBS.items() if words.split()[0] in table_of_verbs()}


@pytest.mark.parametrize('mounting', ROTATIONS)
@pytest.mark.parametrize('verb', VERBS)
def test_every_verb_reads_a_bag_with_the_mounting_that_is_stated(verb, mounting, tmp_path, monkeypatch, capsys):
    """With which the trial is that of the craft: see the test of that."""
    read, decide = [], ImuRecord.installation

    def seen(self, *given, **named):
        read.append(decide(self, *given, **named).mounting)
        raise InputError('that is enough')

    monkeypatch.setattr(ImuRecord, 'installation', seen)
    turn, short = matrix_of(mounting), decay(0.5, 0.5)
    flag = '--mounting=' + ','.join(map(str, mounting))
    parameters = tmp_path / 'p.yaml'
    parameters.write_text(f'predictor: {{ros__parameters: {{mounting_deg: {list(mounting)}}}}}')
    of_file = [] if verb == 'campaign' else [['--params-file', str(parameters)]]
    for frames, *ways in (([('boat/base_link', 'boat/imu', turn)], []), ([], [flag], *of_file), ([], [])):
        for given in ways:
            (tmp_path / 'a.mcap').unlink(missing_ok=True)
            bag = bag_of(tmp_path / 'a.mcap', short, mounting, frames)
            assert main([*verb.split(), *VERBS[verb](bag), *given]) == 2
            found = read.pop()
            if frames or given:
                assert (matrix_of(np.degrees(found)) * turn.inv()).magnitude() < np.radians(0.01)
            else:
                assert found is None
    assert not read


@pytest.mark.parametrize(
    'verb',
    [
        pytest.param(each, marks=[pytest.mark.long] * (each in ('campaign', 'history')))
        for each in VERBS
        if each not in ('inspect', 'identify --at-sea', 'sea', 'forecast')
    ],
)
def test_without_a_stated_mounting_every_verb_reports_the_tilt_and_names_the_axis_of_the_sensor(verb, tmp_path, capsys):
    bag = bag_of(tmp_path / 'a.mcap', decay(length=30.0), (8, 0, 0))
    assert main([*verb.split(), *VERBS[verb](bag)]) in (0, 1)
    out, said = capsys.readouterr()
    assert 'sensor-tilted' in said and re.search(r'\(--mounting (8|7\.9|8\.2),', said)
    assert 'about the x axis of the sensor, whose mounting is not stated' in out


def test_zeros_state_that_the_axes_agree_by_flag_parameter_and_file_and_what_is_not_set_states_none(tmp_path, capsys):
    bag = str(bag_of(tmp_path / 'a.mcap', decay(0.5, 2.0), (0, 0, 0)))
    parameters = tmp_path / 'p.yaml'
    for text, is_stated in (('[0.0, 0.0, 0.0]', True), ('[0, 0, 0]', True), ('[.nan, .nan, .nan]', False)):
        parameters.write_text(f'/**/predictor: {{ros__parameters: {{mounting_deg: {text}}}}}')
        assert main(['inspect', bag, '--params-file', str(parameters)]) == 0
        assert ('not stated' in capsys.readouterr().out) != is_stated
    parameters.write_text('predictor: {ros__parameters: {mounting_deg: [.nan, 0.0, 90.0]}}')
    assert main(['inspect', bag, '--params-file', str(parameters)]) == 2
    assert 'three angles' in capsys.readouterr().err
    assert main(['inspect', bag, '--mounting', '0,0,0']) == 0
    assert 'not stated' not in capsys.readouterr().out


def test_live_zeros_state_that_the_axes_agree_and_no_transform_is_waited_for(spun):
    from swath_sysid.nodes.imu_buffer import ImuBuffer

    given = run.ros_arguments(build_parser('run').parse_args(['run', '--mounting', '0,0,0']))
    assert given[-2:] == ['-p', 'mounting_deg:=[0.0, 0.0, 0.0]']
    node = spun.made(ImuBuffer, *given)
    assert node.window.settings.installation.mounting == (0.0, 0.0, 0.0)
    assert not node.transforms.are_awaited
    # and while a node runs
    other = spun.made(ImuBuffer)
    assert other.window.settings.installation.mounting is None and other.transforms.are_awaited
    assert spun.set_to(other, mounting_deg=[0.0, 0.0, 0.0]) == ['']
    assert other.window.settings.installation.mounting == (0.0, 0.0, 0.0)


def test_a_model_remembers_its_mounting_and_is_rejected_with_another(tmp_path, capsys):
    straight, bag = identify(decay(), LINEAR, axis='roll'), bag_of(tmp_path / 'a.mcap', decay(), ROTATIONS[0])
    found = identify(read_trial(bag, mounting=tuple(np.radians(ROTATIONS[0]))), LINEAR, axis='roll')
    assert np.isclose(found.model.natural_period, straight.model.natural_period, rtol=1e-5)
    model = str(tmp_path / 'model.yaml')
    write_model(model, found)
    assert 'mounting_deg' not in straight.identified_model({}).provenance
    held = {'roll': found.identified_model({})}
    check_mounting(held, Installation('flu', tuple(np.radians([15.0, -10.0, 94.0]))))
    check_mounting(held, None)
    with pytest.raises(InputError, match='mounted at 15,-10,90 deg, and it is stated at 15,-10,96:'):
        check_mounting(held, Installation('flu', tuple(np.radians([15.0, -10.0, 96.0]))))
    for given, words in (((), 'without a stated mounting'), (('--mounting', '-15,10,0'), 'stated at -15,10,0')):
        for verb in VERBS.keys() & {'identify --at-sea', 'play-through', 'forecast'}:
            assert main([*verb.split(), *VERBS[verb](bag), '--model', model, *given]) == 2
            assert words in capsys.readouterr().err


def test_a_tilt_and_an_unstated_mounting_are_reported_with_the_flag_that_sets_it(tmp_path, capsys):
    bag = bag_of(tmp_path / 'a.mcap', decay(), (15, -10, 90))
    assert main(['inspect', str(bag)]) == 0
    out, said = capsys.readouterr()
    assert 'pitch (about the y axis of the sensor, whose mounting is not stated)' in out
    angles = said.split('(--mounting ')[1].split(')')[0].split(',')
    assert np.allclose([float(angle) for angle in angles], [15.0, -10.0, 0.0], atol=0.2)
    (tmp_path / 'p.yaml').write_text('predictor: {ros__parameters: {mounting_deg: [15, -10, 90]}}')
    for given in (('--mounting', ','.join(angles)), ('--params-file', str(tmp_path / 'p.yaml'))):
        assert main(['inspect', str(bag), *given]) == 0
        out, said = capsys.readouterr()
        assert 'sensor' not in (said + out).replace('sensor_msgs', '')
    assert 'roll decay' in out


@pytest.mark.parametrize(('held', 'length', 'angle'), [(2.0, 20.0, 0.14), (60.0, 6.0, 0.2), (100.0, 8.0, 0.14)])
def test_a_craft_that_is_held_heeled_and_released_is_no_tilted_sensor(held, length, angle, tmp_path):
    trial = read_trial(bag_of(tmp_path / 'a.mcap', decay(held, length, angle), (0, 0, 0)))
    assert not trial.advice


def test_live_a_tilt_is_reported_until_the_craft_floats_level_once():
    def reports(*parts):
        check, found, start = InstallationCheck(Installation()), [], 0.0
        for mounting, seconds in parts:
            trial = decay(seconds, 0.02, np.radians(0.1))
            stamps = np.round(1e9 * (start + trial.time)).astype(int)
            for reading in ImuRecord(stamps, turned(trial, mounting)):
                check.add(convert(reading, Installation()))
                found.append([each.code for each in check.judge()])
            start += trial.time[-1] + 0.02
        return found

    tilted = reports(((0, 8, 0), 40.0))
    assert tilted[-1] == ['sensor-tilted'] and tilted[500] == []
    assert all(each == [] for each in reports(((0, 0, 0), 40.0), ((0, 8, 0), 60.0))[-500:])


@pytest.mark.parametrize('pushed', ['bow', 'starboard'])
@pytest.mark.parametrize('mounting', ROTATIONS)
def test_rest_and_a_push_show_the_mounting_and_the_printed_lines_state_it(mounting, pushed, tmp_path, capsys):
    trial = decay(3.0, 60.0, 0.1)
    # a second to push, and a tenth of the motion about the other axis, with another period; later a larger push there
    push = 0.1 * np.clip(trial.time - 2.0, 0.0, 1.0) + np.where(trial.time >= 3.0, trial.roll - 0.1, 0.0)
    across = 0.1 * push * np.cos(3.1 * trial.time) + np.random.default_rng(2).normal(0.0, 2e-3, push.size)
    across += np.where(trial.time > 50.0, 0.3 * np.sin(trial.time), 0.0)
    angles = {'roll': across, 'pitch': push} if pushed == 'bow' else {'roll': push, 'pitch': across}
    bag = bag_of(tmp_path / 'a.mcap', replace(trial, **angles), mounting)
    assert main(['mounting', str(bag), '--pushed', pushed]) == 0
    lines = capsys.readouterr().out
    flag = [float(each) for each in lines.split('--mounting ')[1].split()[0].split(',')]
    parameter = [float(each) for each in lines.split('mounting_deg: [')[1].split(']')[0].split(',')]
    urdf = Rotation.from_euler('xyz', [float(each) for each in lines.split('rpy="')[1].split('"')[0].split()])
    for stated in (matrix_of(flag), matrix_of(parameter), urdf):
        assert (stated * matrix_of(mounting).inv()).magnitude() < np.radians(1.5)


def test_a_record_that_shows_no_mounting_is_refused_in_one_sentence(tmp_path, capsys):
    still, released = decay(10.0, 0.1, 1e-4), decay(0.0, 10.0)
    both = replace(released, pitch=np.roll(released.roll, 30))
    late = replace(decay(3.0, 10.0), roll=np.where(decay(3.0, 10.0).time < 2.0, 0.0, decay(3.0, 10.0).roll))
    circling = replace(late, pitch=0.9 * np.gradient(late.roll, late.time) / 2.5)
    cases = (still, 'shows no push'), (both, 'does not begin at rest'), (circling, 'turns about two axes')
    for trial, words in cases:
        assert main(['mounting', str(bag_of(tmp_path / 'a.mcap', trial, (0, 0, 0))), '--pushed', 'bow']) == 2
        assert words in capsys.readouterr().err
        (tmp_path / 'a.mcap').unlink()


@pytest.fixture
def spun(monkeypatch):
    """Nodes whose ROS seems to have tf2_msgs, and how to send them samples of a sensor in the frame ``boat/imu``."""
    rclpy = pytest.importorskip('rclpy')
    from live_bench import imu_message
    from rclpy.parameter import Parameter
    from std_msgs.msg import Empty

    from swath_sysid.nodes import transforms

    monkeypatch.setattr(transforms, 'message_class', lambda kind: Empty)
    nodes = []

    def end():
        while nodes:
            nodes.pop().destroy_node()
        rclpy.try_shutdown()

    def made(kind, *given):
        end()
        rclpy.init(args=['--ros-args', '-r', '__ns:=/spun', *given])
        nodes.append(kind())
        return nodes[-1]

    def send(node, readings):
        for each in readings:
            message = imu_message(each)
            message.header.frame_id = 'boat/imu'
            node.inbox.put(message)
        node.work(60.0)

    def set_to(node, **values):
        return [each.reason for each in node.set_parameters([Parameter(n, value=v) for n, v in values.items()])]

    yield SimpleNamespace(made=made, send=send, set_to=set_to)
    end()


def frames_of(*sent):
    """What a tf2_msgs/TFMessage holds: parent, child and rotation of each."""
    each = [
        SimpleNamespace(
            header=SimpleNamespace(frame_id=parent),
            child_frame_id=child,
            transform=SimpleNamespace(
                rotation=SimpleNamespace(**dict(zip('xyzw', turn.as_quat().tolist(), strict=True)))
            ),
        )
        for parent, child, turn in sent
    ]
    return SimpleNamespace(transforms=each)


@pytest.mark.parametrize('mounting', ROTATIONS)
def test_live_the_first_samples_wait_for_the_transforms_and_are_turned(mounting, spun):
    from swath_sysid.formats.messages import window_message, window_table
    from swath_sysid.nodes.imu_buffer import ImuBuffer

    truth = decay(0.5, 1.0)
    readings = ImuRecord(np.round(1e9 * (1000.0 + truth.time)).astype(int), turned(truth, mounting))
    node = spun.made(ImuBuffer)
    spun.send(node, readings)
    assert node.window.size == 0 and len(node.inbox) == len(truth.time) and not node.is_behind
    node.transforms.take(frames_of(('boat/base_link', 'boat/imu', matrix_of(mounting))))
    node.work(60.0)
    table = node.window.table()
    assert np.allclose(table.rows[:, 1:3], np.stack([truth.roll, truth.pitch], axis=1), atol=1e-6)
    # the window tells the identifier, and the parameter who asks
    raw = deserialised(window_message(table, 'base_link'))
    stated = window_table(raw).installation.mounting
    for told in (np.degrees(stated), node.get_parameter('mounting_deg').value):
        assert (matrix_of(told) * matrix_of(mounting).inv()).magnitude() < np.radians(0.2)


def deserialised(raw):
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import PointCloud2

    return deserialize_message(raw, PointCloud2)


def test_live_without_a_transform_it_goes_on_after_the_stated_time_and_a_late_one_begins_a_new_window(
    spun, monkeypatch
):
    from swath_sysid.nodes import transforms
    from swath_sysid.nodes.imu_buffer import ImuBuffer

    now = 100.0
    monkeypatch.setattr(transforms, 'perf_counter', lambda: now)
    truth = decay(0.5, 1.0)
    readings = list(ImuRecord(np.round(1e9 * (1000.0 + truth.time)).astype(int), turned(truth, ROTATIONS[0])))
    node = spun.made(ImuBuffer)
    said = []
    node.transforms._log = SimpleNamespace(info=said.append)
    spun.send(node, readings[:30])
    now += node.parameters['mounting_wait_s'] - 0.1
    spun.send(node, readings[30:31])
    assert node.window.size == 0 and not said
    now += 0.2
    spun.send(node, readings[31:32])
    assert node.window.size == 32 and len(said) == 1
    assert 'boat/imu in base_link is not stated' in said[0] and 'set mounting_deg' in said[0]
    node.transforms.take(frames_of(('boat/base_link', 'boat/imu', matrix_of(ROTATIONS[0]))))
    assert node.window.size == 0 and 'at 15, -10, 90 deg' in said[1]
    spun.send(node, readings[32:])
    assert np.allclose(node.window.table().rows[:, 1], truth.roll[32:], atol=1e-6)


def test_live_the_predictor_takes_the_transform_and_then_rejects_a_model_of_another_mounting(spun):
    from swath_sysid.nodes.predictor import Predictor

    identified = IdentifiedModel.exactly(hull_named('swath-roll').model)
    text = model_to_yaml({'roll': replace(identified, provenance={'mounting_deg': [0, 0, -90]})})
    node = spun.made(Predictor)
    node.models._described = node.models.read(text)
    node.models.load()
    assert node.pipeline.models['roll'] is not None
    truth = decay(0.5, 1.0)
    readings = list(ImuRecord(np.round(1e9 * (1000.0 + truth.time)).astype(int), turned(truth, ROTATIONS[0])))
    spun.send(node, readings)
    assert node.pipeline.used == 0
    node.transforms.take(frames_of(('boat/base_link', 'boat/imu', matrix_of(ROTATIONS[0]))))
    node.work(60.0)
    assert node.pipeline.used == len(readings) and node.pipeline.models['roll'] is None
    (report,) = (each for each in node.health.reports(1.0, 1) if each.name == 'forecast')
    assert 'mounted at 0,0,-90 deg, and it is stated at 15,-10,90' in report.message
    # the same by hand
    assert spun.set_to(node, mounting_deg=[0.0, 0.0, 45.0]) == ['']
    assert np.allclose(node.pipeline.settings.installation.mounting, (0.0, 0.0, np.radians(45.0)))


def test_a_bag_is_read_with_what_imu_buffer_said_of_its_sensor_whatever_the_frames_say(spun, tmp_path):
    from swath_sysid.nodes.imu_buffer import ImuBuffer

    truth, node = decay(), spun.made(ImuBuffer)
    for boat, mounting in zip(('one', 'two'), ROTATIONS[:2], strict=True):
        said = [[report.status_of('imu_buffer') for report in node._reports()[1:]]]
        assert spun.set_to(node, mounting_deg=[float(angle) for angle in mounting]) == ['']
        said.append([report.status_of('imu_buffer') for report in node._reports()[1:]])
        other = Installation('flu', (0.1, 0.2, 0.3))
        with writing_bag(tmp_path / f'{boat}.mcap') as add:
            # as ros2 bag records: in the order of arrival; the driver gives its own axes the name of the craft's
            for at, (topic, reports) in enumerate([('/spun/imu/data', said[0]), ('/a/imu', said[1]), ('', said[1])]):
                told = [(*rest, {**values, 'topic': topic or values['topic']}) for *rest, values in reports]
                add('/diagnostics', TYPES['/diagnostics'], at, diagnostics_message(at, told, 'spun'))
            for topic, way in (('/spun/imu/data', mounting), ('/b/imu/data', np.degrees(other.mounting))):
                for stamp, values in zip(np.round(1e9 * truth.time).astype(int), turned(truth, way), strict=True):
                    add(topic, IMU, int(stamp) + 9, ImuMessage('base_link').of_values(int(stamp), values))
        own = read_trial(tmp_path / f'{boat}.mcap', topic='/spun/imu/data')
        assert np.allclose(np.degrees(own.installation.mounting), mounting) and np.allclose(own.roll, truth.roll)
        given = read_trial(tmp_path / f'{boat}.mcap', topic='/b/imu/data', mounting=other.mounting)
        assert np.allclose(given.roll, truth.roll)


def test_frames_are_followed_through_a_tree_and_what_is_not_connected_states_nothing():
    turn, footprint = matrix_of((15, -10, 90)), matrix_of((0, 3, 20))
    both = ('/footprint', '/base_link', footprint), ('footprint', 'imu', footprint * turn)
    tree = frame_tree(frames_of(*both))
    assert np.allclose(np.degrees(mounting_in(tree, 'imu', 'base_link')), (15, -10, 90))
    # axes forward, right, down are those of the frame turned by half a turn about x
    down = frame_tree(frames_of(('base_link', 'imu', matrix_of((180, 0, 0)))))
    assert np.allclose(np.cos(mounting_in(down, 'imu', 'base_link', 'frd')), 1.0)
    assert mounting_in(tree, 'other', 'base_link') is mounting_in(tree, '', 'base_link') is None
    # a driver that gives its own axes the name of the craft's
    assert mounting_in({}, 'boat1/base_link', 'base_link', 'frd') is None
    assert mounting_in({}, 'boat1/base_link', 'base_link') == (0.0, 0.0, 0.0)
    circle = frame_tree(frames_of(('imu', 'base_link', turn), ('base_link', 'imu', turn)))
    assert mounting_in(circle, 'imu', 'base_link') is None
