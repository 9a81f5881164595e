"""Bags: what is read is what was sent, and what is broken is told."""

import resource
import shutil
import sqlite3
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from bag_messages import STORE, break_a_chunk
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from swath_sysid.attitude.motion.attitude import euler_rates, quaternion
from swath_sysid.attitude.motion.trial import CHANNELS, Trial
from swath_sysid.common.account import in_words
from swath_sysid.common.errors import InputError
from swath_sysid.formats import bags
from swath_sysid.formats import messages as layout
from swath_sysid.formats.bags import is_bag, read_bag, read_imu, write_imu_bag
from swath_sysid.formats.output_bag import Recording
from swath_sysid.formats.reading import read_readings, read_trial
from swath_sysid.formats.topics import IMU

COUNT = 200
RNG = np.random.default_rng(1)
STAMPS = 1_700_000_000_123_456_789 + 10_000_000 * np.arange(COUNT)
ROLL, PITCH, YAW = RNG.uniform(-0.5, 0.5, (3, COUNT))
RATES, FORCE = RNG.normal(0, 1, (2, COUNT, 3)) + [[[0.0, 0.0, 0.0]], [[0.0, 0.0, 9.81]]]
STORAGES = {'sqlite3': StoragePlugin.SQLITE3, 'mcap': StoragePlugin.MCAP}


def codes(trial):
    return [advice.code for advice in trial.advice]


def imu(at, frame_id='imu', stamp=None, absent=''):
    covariances = [
        np.array([-float(name == absent), *8 * [0.0]])
        for name in ('orientation', 'angular_velocity', 'linear_acceleration')
    ]
    vectors = tuple(map(float, quaternion(ROLL[at], PITCH[at], YAW[at]))), tuple(RATES[at]), tuple(FORCE[at])
    head = layout.header(STAMPS[at] if stamp is None else stamp, frame_id)
    return layout.make(IMU, head, *(part for pair in zip(vectors, covariances, strict=True) for part in pair))


def write_bag(folder, messages, storage='mcap', compression=None, extra=()):
    writer = Writer(folder, version=9, storage_plugin=STORAGES[storage])
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic: writer.add_connection(topic, IMU, typestore=STORE)
            for topic in dict.fromkeys(topic for topic, _, _ in messages)
        }
        for topic, msgtype, message in extra:
            connection = writer.add_connection(topic, msgtype, typestore=STORE)
            writer.write(connection, 1, STORE.serialize_cdr(message, msgtype))
        for topic, received, message in messages:
            raw = message if isinstance(message, bytes) else bytes(STORE.serialize_cdr(message, IMU))
            writer.write(connections[topic], int(received), raw)
    return folder


def plain_messages(**options):
    return [('/imu/data', STAMPS[at] + 500_000, imu(at, **options)) for at in range(COUNT)]


def assert_right(trial):
    assert np.array_equal(trial.time, (STAMPS - STAMPS[0]) / 1e9)
    assert np.allclose(trial.roll, ROLL) and np.allclose(trial.pitch, PITCH)
    expected = euler_rates(ROLL, PITCH, *RATES.T)
    assert np.allclose(trial.roll_rate, expected[0]) and np.allclose(trial.pitch_rate, expected[1])
    assert np.array_equal(np.stack([trial.accel_x, trial.accel_y, trial.accel_z], axis=1), FORCE)


@pytest.mark.parametrize('storage', STORAGES)
@pytest.mark.parametrize('compression', [None, CompressionMode.FILE, CompressionMode.MESSAGE])
def test_bag_folder_and_its_file(tmp_path, storage, compression):
    trial = read_bag(write_bag(tmp_path / 'bag', plain_messages(), storage, compression))
    assert_right(trial)
    assert trial.advice == () and trial.source == f'{tmp_path / "bag"} /imu/data'
    if compression is None:
        # the file alone, whatever its name
        ending = {'sqlite3': 'db3', 'mcap': 'mcap'}[storage]
        file = next((tmp_path / 'bag').glob(f'*.{ending}')).rename(tmp_path / 'renamed.bin')
        assert is_bag(file)
        assert_right(read_bag(file))
        assert np.allclose(read_bag(file, frame='frd').pitch, -PITCH)


def mcap_record(code, *parts):
    content = b''.join(parts)
    return bytes([code]) + len(content).to_bytes(8, 'little') + content


def text(said):
    return len(said).to_bytes(4, 'little') + said.encode()


@pytest.mark.parametrize('profile', ['', 'ros2'])
@pytest.mark.parametrize(
    'schema, name, encoding', [('jsonschema', 'wind', 'json'), ('ros1msg', 'sensor_msgs/Imu', 'ros1')]
)
def test_channels_in_other_encodings_beside_are_named_and_left_alone(tmp_path, profile, schema, name, encoding):
    file = next(write_bag(tmp_path / 'bag', plain_messages()).glob('*.mcap'))
    raw, number = file.read_bytes(), (77).to_bytes(2, 'little')
    after = 17 + int.from_bytes(raw[9:17], 'little')
    own = mcap_record(3, number, text(name), text(schema), text('{}'))
    own += mcap_record(4, number, number, text('/other'), text(encoding), bytes(4))
    own += mcap_record(5, number, bytes(4), bytes(16), b'{"speed": 3}')
    head = raw[:8] + mcap_record(1, text(profile), text('other 1.0'))
    body = raw[after:]
    at, records = 0, b''
    while body[at] != 0x0F:  # the end of the data
        length = 9 + int.from_bytes(body[at + 1 : at + 9], 'little')
        records, at = records + body[at : at + length], at + length
    ending = mcap_record(0x0F, bytes(4)) + mcap_record(2, bytes(20)) + raw[:8]
    for at, content in enumerate((head + own + records + ending, head + own + ending)):
        (tmp_path / f'{at}.mcap').write_bytes(content)
    trial = read_trial(tmp_path / '0.mcap')
    assert_right(trial)
    assert codes(trial) == []
    with pytest.raises(InputError, match=rf'topics in it: /other \({name} in {encoding}\)'):
        read_trial(tmp_path / '1.mcap')


@pytest.mark.parametrize('frame_id', ['', 'imu_link', 'köln'])
def test_decoding_is_that_of_the_library(tmp_path, frame_id):
    messages = plain_messages(frame_id=frame_id)
    # one that a big-endian computer sent
    messages[3] = (*messages[3][:2], bytes(STORE.serialize_cdr(imu(3, frame_id), IMU, little_endian=False)))
    folder = write_bag(tmp_path / 'bag', messages)
    record = read_imu(folder)
    assert record.frame_id == frame_id
    with AnyReader([folder]) as reader:
        for at, (connection, received, raw) in enumerate(reader.messages()):
            message = reader.deserialize(raw, connection.msgtype)
            assert record.received[at] == received
            assert record.stamps[at] == message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
            turn, values = message.orientation, record.values[at]
            assert values[layout.ORIENTATION].tolist() == [turn.x, turn.y, turn.z, turn.w]
            assert values[layout.RATES][2] == message.angular_velocity.z
            assert values[layout.FORCE][0] == message.linear_acceleration.x
            assert np.array_equal(values[layout.ORIENTATION_COVARIANCE], message.orientation_covariance)
            assert np.array_equal(values[layout.RATES_COVARIANCE], message.angular_velocity_covariance)
            assert np.array_equal(values[layout.FORCE_COVARIANCE], message.linear_acceleration_covariance)


def test_blocks_and_mixed_frames_keep_the_order(tmp_path, monkeypatch):
    monkeypatch.setattr(bags, 'BLOCK_BYTES', 16 * 324)
    messages = [('/imu/data', STAMPS[at], imu(at, frame_id='imu' * (1 + 3 * at // COUNT))) for at in range(COUNT)]
    trial = read_bag(write_bag(tmp_path / 'bag', messages))
    assert_right(trial)
    assert codes(trial) == ['frame-id-changed'] and "3 frames ('imu', 'imuimu'" in trial.advice[0].message
    # two sensors on one topic
    messages = [('/imu/data', STAMPS[at], imu(at, frame_id='port' if at % 2 else 'bow')) for at in range(COUNT)]
    folder = write_bag(tmp_path / 'two', messages)
    with pytest.raises(InputError, match=r"2 devices send on /imu/data, in the frames 'bow', 'port': choose one"):
        read_trial(folder)
    assert read_trial(folder, columns={'device': 'port'}).pitch == pytest.approx(PITCH[1::2])
    with pytest.raises(InputError, match="no device 'aft'"):
        read_trial(folder, columns={'device': 'aft'})


@pytest.mark.parametrize(
    'absent, lost',
    [
        ('orientation', {'roll', 'pitch'}),
        ('angular_velocity', {'roll_rate', 'pitch_rate'}),
        ('linear_acceleration', {'accel_x', 'accel_y', 'accel_z'}),
    ],
)
def test_minus_one_means_not_measured(tmp_path, absent, lost):
    trial = read_bag(write_bag(tmp_path / 'bag', plain_messages(absent=absent)))
    assert set(trial.channels) == {*CHANNELS, 'yaw_rate'} - lost
    if absent == 'orientation':
        assert codes(trial) == ['body-rates']
        assert np.array_equal(trial.roll_rate, RATES[:, 0])
    one = plain_messages()
    one[3] = ('/imu/data', STAMPS[3], imu(3, absent=absent))
    some = read_bag(write_bag(tmp_path / 'some', one))
    assert all(np.flatnonzero(np.isnan(values)).tolist() in ([], [3]) for values in some.channels.values())
    assert np.isnan(some.roll[3]) == (absent == 'orientation') and np.isfinite(some.accel_x[:3]).all()


def test_topic_is_chosen_or_asked_for(tmp_path):
    text = ('/chatter', 'std_msgs/msg/String', STORE.types['std_msgs/msg/String'](data='hello'))
    one = write_bag(tmp_path / 'one', plain_messages(), extra=[text])
    assert read_bag(one).time.size == read_bag(one, 'imu/data').time.size == COUNT
    for topic, said in (('/chatter', 'std_msgs/msg/String'), ('/other', '/imu/data')):
        with pytest.raises(InputError, match=said):
            read_bag(one, topic)
    two = write_bag(tmp_path / 'two', plain_messages() + [('/bow/imu', 1, imu(0))])
    with pytest.raises(InputError, match='choose one of /bow/imu, /imu/data') as told:
        read_bag(two)
    assert told.value.code == 'several-imu-topics'
    assert read_bag(two, '/imu/data').time.size == COUNT
    forecasts = [(name, 1, imu(0)) for name in ('/forecast/next', '/craft/forecast/lead_1_0s')]
    assert read_bag(write_bag(tmp_path / 'ours', plain_messages() + forecasts)).time.size == COUNT
    with pytest.raises(InputError, match='holds forecasts, and no sensor_msgs/msg/Imu of a sensor: record the sensor'):
        read_bag(write_bag(tmp_path / 'forecasts', forecasts))
    none = write_bag(tmp_path / 'none', [], extra=[text])
    with pytest.raises(InputError, match=r'/chatter \(std_msgs/msg/String\)'):
        read_bag(none)


def test_messages_that_are_none_are_left_out_and_stamps_not_set_are_times_of_arrival(tmp_path):
    trial = read_bag(write_bag(tmp_path / 'unset', plain_messages(stamp=0)))
    assert codes(trial) == ['no-header-stamps']
    assert np.allclose(trial.time, 0.01 * np.arange(COUNT))
    messages = plain_messages()
    messages[5] = ('/imu/data', STAMPS[5], b'\0\1\0\0short')
    messages[6] = ('/imu/data', STAMPS[6], b'')
    messages[7] = ('/imu/data', STAMPS[7], b'\0\x07\0\0' + bytes(320))
    messages[8] = ('/imu/data', STAMPS[8], b'\0\1\0\0' + b'\xff' * 320)
    trial = read_bag(write_bag(tmp_path / 'bag', messages, 'sqlite3'))
    assert trial.time.size == COUNT - 4
    assert codes(trial) == ['damaged-messages', 'gaps']


def test_a_folder_of_several_bags_is_none(tmp_path):
    for name in ('first', 'second'):
        write_imu_bag(tmp_path / f'{name}.mcap', Trial(np.arange(9.0), roll=np.zeros(9)))
    with pytest.raises(InputError, match='several bags .first, second.: give one of them'):
        read_bag(tmp_path)


@pytest.mark.parametrize('storage', STORAGES)
@pytest.mark.parametrize('compression', [None, CompressionMode.FILE, CompressionMode.MESSAGE])
def test_bag_whose_recorder_was_killed(tmp_path, storage, compression):
    folder = write_bag(tmp_path / 'bag', plain_messages(), storage, compression)
    (folder / 'metadata.yaml').unlink()
    trial = read_bag(folder)
    assert_right(trial)
    assert codes(trial) == ['damaged-bag']
    for text in ('', '{}', 'rosbag2_bagfile_information: [', '[' * 100):
        (folder / 'metadata.yaml').write_text(text)
        assert_right(read_bag(folder))


@pytest.mark.parametrize('begun', [0, 1, COUNT // 2])
def test_what_a_killed_recorder_left_in_the_log_of_sqlite_is_read_and_left_as_it_is(tmp_path, begun):
    source = write_bag(tmp_path / 'source', plain_messages(), 'sqlite3') / 'source.db3'
    folder = tmp_path / 'bag'
    folder.mkdir()
    # rosbag2's preset `resilient`; killed: copied while it is open
    with closing(sqlite3.connect(tmp_path / 'bag_0.db3')) as database:
        database.executescript('PRAGMA journal_mode = WAL')
        with closing(sqlite3.connect(source)) as other:
            script = [line for line in other.iterdump() if line not in ('BEGIN TRANSACTION;', 'COMMIT;')]
        first = next(at for at, line in enumerate(script) if line.startswith('INSERT INTO "messages"'))
        for at, line in enumerate(script):
            if at == begun + first and begun:
                database.commit()
                database.execute('PRAGMA wal_checkpoint(TRUNCATE)')
                database.execute('PRAGMA wal_autocheckpoint = 0')
            database.execute(line)
        database.commit()
        for ending in ('', '-wal'):
            shutil.copy(tmp_path / f'bag_0.db3{ending}', folder)
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert len(before) == 2 and all(before.values())
    trial = read_bag(folder)
    assert_right(trial)
    assert_right(read_bag(folder / 'bag_0.db3'))
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before
    assert codes(trial) == ['damaged-bag']
    shutil.copy(source.parent / 'metadata.yaml', folder)
    text = (folder / 'metadata.yaml').read_text().replace('source.db3', 'bag_0.db3')
    (folder / 'metadata.yaml').write_text(text)
    assert read_bag(folder).advice == ()
    (folder / 'metadata.yaml').write_text(text.replace(f'message_count: {COUNT}', f'message_count: {2 * COUNT}'))
    advice = read_bag(folder).advice
    assert [each.code for each in advice] == ['incomplete-record'] and f'lacks {COUNT} of the {2 * COUNT}' in str(
        advice
    )


@pytest.mark.parametrize('name', ['cut.db3', 'half 50%41?#.db3'])
def test_the_rows_of_a_cut_off_database_are_read(tmp_path, name):
    whole = next(write_bag(tmp_path / 'bag', plain_messages() * 20, 'sqlite3').glob('*.db3'))
    path = tmp_path / name
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    record = read_imu(path)
    assert 0.3 * COUNT < len(record) / 20 < 0.6 * COUNT and {advice.code for advice in record.advice} == {'damaged-bag'}
    whole.rename(path)
    record = read_imu(path)
    assert len(record) == 20 * COUNT and record.advice == ()


def test_what_is_whole_of_a_cut_off_mcap_is_read(tmp_path):
    # several chunks: one of 1 MiB holds about 3000 messages
    time = 0.001 * np.arange(8000)
    write_imu_bag(tmp_path / 'whole.mcap', Trial(time=time, roll=0.1 * np.sin(time), pitch=0 * time))
    whole = (tmp_path / 'whole.mcap').read_bytes()
    cut = tmp_path / 'cut.mcap'
    sizes = []
    for share in (0.5, 0.9, 0.999):
        cut.write_bytes(whole[: int(share * len(whole))])
        trial = read_bag(cut)
        assert codes(trial) == ['damaged-bag']
        assert np.allclose(trial.roll, 0.1 * np.sin(trial.time), atol=1e-12)
        sizes.append(trial.time.size)
    assert 2000 < sizes[0] < sizes[1] < sizes[2] <= 8000
    folder = tmp_path / 'bag'
    folder.mkdir()
    cut.rename(folder / 'bag_0.mcap')
    assert read_bag(folder).time.size == sizes[2]
    # inside its only chunk
    whole = next(write_bag(tmp_path / 'short', plain_messages()).glob('*.mcap')).read_bytes()
    cut.write_bytes(whole[: len(whole) // 2])
    trial = read_bag(cut)
    assert 80 < trial.time.size < 120 and codes(trial) == ['damaged-bag']
    assert np.allclose(trial.roll, ROLL[: trial.time.size])


def test_a_broken_chunk_in_a_folder_costs_what_follows_and_a_lost_part_of_a_split_bag_itself(tmp_path):
    write_imu_bag(tmp_path / 'trial', Trial(time=0.001 * np.arange(8000), roll=0.1 * np.sin(np.arange(8000) / 500)))
    break_a_chunk(tmp_path / 'trial')
    trial = read_bag(tmp_path / 'trial')
    assert trial.time.size > 500 and codes(trial)[0] == 'damaged-bag'
    folder = tmp_path / 'bag'
    folder.mkdir()
    for part, keep in enumerate((range(100), range(100, 200))):
        bag = write_bag(tmp_path / f'part{part}', [('/imu/data', STAMPS[at], imu(at)) for at in keep])
        next(bag.glob('*.mcap')).rename(folder / f'bag_{part}.mcap')
    assert_right(read_bag(folder))
    (folder / 'bag_0.mcap').write_bytes(b'lost')
    trial = read_bag(folder)
    assert trial.time.size == 100 and codes(trial) == ['damaged-bag', 'unreadable-file']


@pytest.mark.parametrize('ending', ['db3', 'mcap', 'mcap.zstd'])
def test_of_a_split_bag_with_a_part_cut_the_rest_is_read_and_the_share_told(tmp_path, ending):
    folder = tmp_path / 'bag'
    folder.mkdir()
    storage, packed = {'db': 'sqlite3', 'mc': 'mcap'}[ending[:2]], CompressionMode.FILE if 'zstd' in ending else None
    for part in range(3):
        messages = plain_messages()[part * 60 : part * 60 + 60] * 10
        file = next(write_bag(tmp_path / f'part{part}', messages, storage, packed).glob(f'*.{ending}'))
        content = file.read_bytes()
        # of what repeats itself, the last bytes of a packed file are half of the messages
        left = len(content) - 8 if packed else len(content) // 2
        (folder / f'bag_{part}.{ending}').write_bytes(content[:left] if part == 1 else content)
    names = [f'bag_{part}.{ending}' for part in range(3)]
    counts = [{'topic_metadata': {'name': name}, 'message_count': 1800} for name in ('/imu/data', '/absent')]
    content = {'relative_file_paths': names, 'topics_with_message_count': counts}
    (folder / 'metadata.yaml').write_text(yaml.safe_dump({'rosbag2_bagfile_information': content}))
    record = read_imu(folder)
    assert 1300 < len(record) < 1600 and [advice.code for advice in record.advice] == [
        'damaged-bag',
        'incomplete-record',
    ]
    assert f'lacks {1800 - len(record)} of the 1800 messages on /imu/data' in record.advice[1].message


@pytest.mark.parametrize('room, count', [(100_000, 250), (30_000, 50)])
def test_a_recording_that_the_disk_has_no_room_for_ends_whole_and_says_how_far_it_reaches(tmp_path, room, count):
    recording = Recording(tmp_path / 'run.mcap')
    write = recording.add_topic('/imu/data', IMU, latched=False, reliable=True)
    # a file may have so many bytes, as if the disk were full then
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, usual[1]))
    try:
        with pytest.raises(InputError, match='the disk takes no more .File too large') as told:
            for at in range(1000):
                write(int(at * 10_000_000), bytes(STORE.serialize_cdr(imu(at % COUNT), IMU)))
                if at % 50 == 49:
                    recording.save()
        recording.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert [file.name for file in tmp_path.iterdir()] == ['run.mcap']
    record = read_imu(tmp_path / 'run.mcap')
    assert len(record) == count and record.advice == ()
    assert f'run.mcap is whole and holds the first {record.received[-1] / 1e9:.0f} s' in str(told.value)


def written_trial():
    time = 0.01 * np.arange(300)
    angles, rates = (0.2 * np.sin(3 * time), 0.1 * np.cos(2 * time)), (0.6 * np.cos(3 * time), -0.2 * np.sin(2 * time))
    return Trial(time, *angles, *rates, 0.1 * time, 0 * time, 9.81 + 0 * time, yaw_rate=0.3 * np.cos(time))


@pytest.mark.parametrize('name', ['trial.mcap', 'trial.db3', 'trial', 'trial.v2'])
def test_written_bag_comes_back(tmp_path, name):
    trial = written_trial()
    path = tmp_path / name
    write_imu_bag(path, trial, start_stamp_ns=1_700_000_000_000_000_005, topic='/hull/imu', frame_id='imu_1')
    back = read_bag(path)
    assert back.advice == ()
    for channel in ('time', *CHANNELS, 'yaw_rate'):
        assert np.allclose(getattr(back, channel), getattr(trial, channel), atol=1e-9), channel
    record = read_imu(path)
    assert (record.topic, record.frame_id) == ('/hull/imu', 'imu_1')
    assert record.stamps[0] == 1_700_000_000_000_000_005
    with AnyReader([path]) as reader:
        assert reader.message_count == 300
        assert reader.topics['/hull/imu'].msgtype == IMU
    assert [each.name for each in tmp_path.iterdir()] == [name]


def test_bag_folder_is_not_overwritten_but_a_file_is(tmp_path):
    for _ in range(2):
        write_imu_bag(tmp_path / 'bag.mcap', written_trial())
    write_imu_bag(tmp_path / 'run1', written_trial())
    with pytest.raises(InputError, match='exists already'):
        write_imu_bag(tmp_path / 'run1', written_trial())
    assert 'run1.mcap' in (tmp_path / 'run1' / 'metadata.yaml').read_text()
    shutil.move(tmp_path / 'run1', tmp_path / 'run2')
    assert read_bag(tmp_path / 'run2').time.size == 300


def test_what_a_trial_lacks_is_written_as_not_measured(tmp_path):
    time = 0.01 * np.arange(50)
    write_imu_bag(tmp_path / 'a.mcap', Trial(time=time - 0.5, roll_rate=np.sin(time)))
    back = read_bag(tmp_path / 'a.mcap')
    assert set(back.channels) == {'roll_rate', 'pitch_rate', 'yaw_rate'}
    assert np.allclose(back.roll_rate, np.sin(time)) and back.time[0] == 0
    write_imu_bag(tmp_path / 'b.mcap', Trial(time=time, pitch=np.where(time > 0.2, np.nan, 0.1)))
    back = read_bag(tmp_path / 'b.mcap')
    assert set(back.channels) == {'roll', 'pitch'}
    assert np.isnan(back.pitch[-1]) and back.pitch[0] == pytest.approx(0.1)


ORIENTATIONS = np.column_stack(quaternion(ROLL, PITCH, YAW))
GEOMETRY = 'geometry_msgs/msg/'


@pytest.mark.parametrize(
    ('kind', 'fields'),
    [
        ('Vector3', lambda at, head: (ROLL[at], PITCH[at], YAW[at])),
        ('Vector3Stamped', lambda at, head: (head, (ROLL[at], PITCH[at], YAW[at]))),
        ('Pose2D', lambda at, head: (ROLL[at], PITCH[at], YAW[at])),
        ('QuaternionStamped', lambda at, head: (head, tuple(ORIENTATIONS[at]))),
        ('PoseStamped', lambda at, head: (head, ((0.0, 0.0, 0.0), tuple(ORIENTATIONS[at])))),
    ],
)
def test_attitude_of_other_messages_is_read_from_the_topic_chosen(tmp_path, kind, fields):
    arrival = STAMPS + RNG.integers(0, 5_000_000, COUNT)
    topic = 'rpy' if kind == 'PoseStamped' else '/rpy'  # some converters write no slash
    with Writer(tmp_path / 'bag', version=9) as writer:
        connection = writer.add_connection(topic, GEOMETRY + kind, typestore=STORE)
        for at in range(COUNT):
            message = layout.make(GEOMETRY + kind, *fields(at, layout.header(STAMPS[at], 'imu')))
            writer.write(connection, int(arrival[at]), layout.serialised(message))
    with pytest.raises(InputError, match='no topic of type .*Imu .*rpy .*: choose the one with the attitude'):
        read_trial(tmp_path / 'bag')
    columns = {}
    if not kind.endswith(('eStamped', 'nStamped')):
        with pytest.raises(InputError, match="a column 'roll' without a unit, with values up to 0.49"):
            read_trial(tmp_path / 'bag', topic='rpy')
        columns = {'roll': 'roll:rad', 'pitch': 'pitch:rad'}
    trial = read_trial(tmp_path / 'bag', topic='rpy', columns=columns)
    assert np.allclose(trial.roll, ROLL) and np.allclose(trial.pitch, PITCH)
    assert trial.source == f'{tmp_path / "bag"} {topic}'
    stamps = STAMPS if 'Stamped' in kind else arrival
    assert np.allclose(trial.time, (stamps - stamps[0]) / 1e9, atol=1e-9)
    assert ('no-header-stamps' in codes(trial)) == ('Stamped' not in kind)
    assert len(read_readings(tmp_path / 'bag', 'rpy', columns=columns)) == COUNT


def test_messages_that_an_index_counts_and_no_reader_finds_are_told(tmp_path):
    counted = SimpleNamespace(topic='/imu', msgcount=5)
    reader = SimpleNamespace(connections=[counted], messages=lambda connections: iter([(counted, 1, b'')] * 3))
    losses = []
    assert len(list(bags.intact_messages(tmp_path, [reader], {'/imu'}, losses))) == 3
    assert [each.code for each in losses] == ['incomplete-record']
    assert '2 of the 5 messages' in in_words(losses, tmp_path)[0].message
