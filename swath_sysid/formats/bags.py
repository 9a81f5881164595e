"""Rosbag2 bags: IMU topics as trials, and trials as IMU topics."""
import os
import tempfile
from collections import defaultdict
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from swath_sysid.attitude.motion.attitude import body_rates, quaternion
from swath_sysid.attitude.motion.sensor_mount import ACCEL, GYRO, QUATERNION, Installation, assemble_trial
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing
from swath_sysid.formats.mcap_checksums import add_checksums, chunk_holds, damage_of

IMU_TYPE = 'sensor_msgs/msg/Imu'
METADATA_FILE = 'metadata.yaml'
MAGIC = {b'\x89MCAP0\r\n': '.mcap', b'SQLite format 3\0': '.db3'}
"""First bytes of a storage file, and the ending it should have."""

STORAGES = {'.mcap': StoragePlugin.MCAP, '.db3': StoragePlugin.SQLITE3}

MESSAGES_AT_ONCE = 50_000

IMU_VALUES = 37
"""Doubles in an Imu message: orientation 4, 9 of covariance, then rates and acceleration 3 and 9 each."""

ORIENTATION, RATES, FORCE = slice(0, 4), slice(13, 16), slice(25, 28)
ORIENTATION_COVARIANCE, RATES_COVARIANCE, FORCE_COVARIANCE = slice(4, 13), slice(16, 25), slice(28, 37)

MCAP_FOOTER = 0x02
MCAP_CHUNK = 0x06
MCAP_DATA_END = 0x0F


@dataclass(frozen=True)
class ImuRecord:
    """The messages of one IMU topic, as they are in the bag.

    Attributes
    ----------
    topic, frame_id : str
    stamps : ndarray of int64, shape (N,)
        header.stamp, ns.
    received : ndarray of int64, shape (N,)
        When the recorder got them, ns; they are in this order.
    values : ndarray, shape (N, 37)
        The numbers of each message in the order of the message definition.
    advice : tuple of Advice
    """

    topic: str
    frame_id: str
    stamps: np.ndarray
    received: np.ndarray
    values: np.ndarray
    advice: tuple[Advice, ...] = ()

    @property
    def orientation(self):
        """Quaternions x, y, z, w, shape (N, 4)."""
        return self.values[:, ORIENTATION]

    @property
    def orientation_covariance(self):
        """Shape (N, 9); -1 in the first place means that there is no orientation."""
        return self.values[:, ORIENTATION_COVARIANCE]

    @property
    def angular_velocity(self):
        """Body rates, rad/s, shape (N, 3)."""
        return self.values[:, RATES]

    @property
    def angular_velocity_covariance(self):
        """Shape (N, 9); -1 in the first place means that there are no rates."""
        return self.values[:, RATES_COVARIANCE]

    @property
    def linear_acceleration(self):
        """Specific force, m/s^2, shape (N, 3)."""
        return self.values[:, FORCE]

    @property
    def linear_acceleration_covariance(self):
        """Shape (N, 9); -1 in the first place means that there is no acceleration."""
        return self.values[:, FORCE_COVARIANCE]


def is_bag(path):
    """Whether something is a rosbag2 bag: a folder of storage files, or one such file."""
    path = Path(path)
    if path.is_dir():
        return (path / METADATA_FILE).is_file() or bool(_storage_files(path))
    return _storage_kind(path) is not None


def read_bag(path, topic=None, frame=None, mounting=(0.0, 0.0, 0.0)):
    """Read a trial from an IMU topic of a rosbag2 bag.

    Time is that of the header stamps, from the first message. Angles come from the orientation
    (none if its covariance begins with -1), Euler rates from it and the angular velocity.

    Parameters
    ----------
    path : str or Path
        A bag folder, or a single .mcap or .db3 file.
    topic : str, optional
        Which topic, needed only if the bag holds several of type sensor_msgs/msg/Imu.
    frame : str, optional
        ``flu`` (default) or ``frd``: what the sensor's axes mean.
    mounting : tuple of 3 floats
        Roll, pitch, yaw of the sensor in the craft, rad.

    Returns
    -------
    Trial

    Raises
    ------
    InputError
        There is no such bag or topic, the choice of the topic is open, the bag is damaged beyond
        reading, or holds too few usable messages.
    """
    installation = Installation(frame or 'flu', mounting)
    record = read_imu(path, topic)
    stamps, advice = record.stamps, list(record.advice)
    if np.all(stamps == stamps[0]) and stamps.size > 1:
        stamps = record.received
        advice.append(Advice('no-header-stamps', (
            f'{record.topic} carries no header stamps, so the times of arrival are used: let the driver stamp its '
            f'messages'
        )))
    readings = {}
    for names, columns, covariance in (
        (QUATERNION, ORIENTATION, ORIENTATION_COVARIANCE),
        (GYRO, RATES, RATES_COVARIANCE),
        (ACCEL, FORCE, FORCE_COVARIANCE),
    ):
        measured = record.values[:, covariance.start] != -1
        if measured.any():
            block = np.where(measured[:, None], record.values[:, columns], np.nan)
            readings.update(zip(names, np.ascontiguousarray(block.T), strict=True))
    return assemble_trial(
        (stamps - stamps[0]) / 1e9, readings, installation, source=f'{path} {record.topic}', advice=advice)


def read_imu(path, topic=None):
    """Read the messages of an IMU topic of a rosbag2 bag, as they are.

    Of a bag that was cut off, what is whole is read, and advice tells so.

    Parameters
    ----------
    path : str or Path
        A bag folder, or a single .mcap or .db3 file.
    topic : str, optional
        Needed only if the bag holds several of type sensor_msgs/msg/Imu.

    Returns
    -------
    ImuRecord

    Raises
    ------
    InputError
        There is no such bag or topic, the choice of the topic is open, or the bag is damaged
        beyond reading.
    """
    path = Path(path)
    with ExitStack() as stack:
        readers, advice = _open_bag(path, stack)
        if advice and not any(c.msgtype == IMU_TYPE for reader in readers for c in reader.connections):
            raise InputError(f'{path} is damaged and nothing of an IMU topic is left in it: record it again')
        topic = _choose_topic(path, readers, topic)
        decoder = _ImuDecoder()
        for reader in readers:
            connections = [c for c in reader.connections if c.topic == topic and c.msgtype == IMU_TYPE]
            if connections:
                try:
                    for _, received, raw in reader.messages(connections):
                        decoder.add(received, raw)
                except Exception as error:  # the libraries raise whatever a broken byte leads them to
                    advice.append(_damage(path, error))
    stamps, received, values = decoder.arrays()
    if not stamps.size:
        problem = f' ({advice[-1].message})' if advice else ''
        raise InputError(f'{path} holds no readable message on {topic}{problem}: record it again')
    if decoder.damaged:
        advice.append(Advice('damaged-messages', (
            f'{decoder.damaged} messages on {topic} are no {IMU_TYPE} and were left out: check the recorder'
        )))
    order = np.argsort(received, kind='stable')
    if np.any(np.diff(order) != 1):
        stamps, received, values = stamps[order], received[order], values[order]
    if len(decoder.frame_ids) > 1:
        names = ', '.join(repr(name[:40]) for name in list(decoder.frame_ids)[:3])
        advice.append(Advice('frame-id-changed', (
            f'the messages on {topic} come in {len(decoder.frame_ids)} frames ({names}): if these are two sensors, '
            f'record each on a topic of its own; else look whether the mounting is still right'
        )))
    return ImuRecord(topic, next(iter(decoder.frame_ids), ''), stamps, received, values, tuple(advice))


def write_imu_bag(path, trial, *, start_stamp_ns=0, topic='/imu/data', frame_id='imu_link'):
    """Write a trial as an IMU would have sent it.

    Body rates and orientation are those of the trial's angles and Euler rates, the orientation
    without yaw; an angle or rate that the trial does not hold is taken as zero, unless it holds none
    of roll and pitch. An Imu message has no place for heave.

    Parameters
    ----------
    path : str or Path
        ``NAME.mcap`` or ``NAME.db3`` for a single file, else a bag folder (mcap).
    trial : Trial
    start_stamp_ns : int
        Stamp of the first sample.
    topic, frame_id : str

    Raises
    ------
    InputError
        Something stands at `path` that may not be replaced, or it cannot be written.
    """
    path = Path(path)
    stamps = int(start_stamp_ns) + np.round((trial.time - trial.time[0]) * 1e9).astype(np.int64)
    with replacing(path) as temporary:
        kind = path.suffix if path.suffix in STORAGES else None
        folder = temporary.with_suffix('') if kind else temporary
        with Writer(folder, version=9, storage_plugin=STORAGES[kind or '.mcap']) as writer:
            store = get_typestore(Stores.ROS2_JAZZY)
            connection = writer.add_connection(topic, IMU_TYPE, typestore=store)
            for stamp, message in _imu_messages(store.types, trial, stamps.tolist(), frame_id):
                writer.write(connection, stamp, store.serialize_cdr(message, IMU_TYPE))
        if kind != '.db3':
            add_checksums(folder / f'{folder.name}.mcap')
        if kind:
            os.replace(folder / f'{folder.name}{kind}', temporary)


def _imu_messages(types, trial, stamps, frame_id):
    """The stamp and the message of every sample."""
    make_header, make_time = types['std_msgs/msg/Header'], types['builtin_interfaces/msg/Time']
    make_quaternion, make_vector = types['geometry_msgs/msg/Quaternion'], types['geometry_msgs/msg/Vector3']
    make_imu = types[IMU_TYPE]
    unknown, absent = np.zeros(9), np.array([-1.0, *8 * [0.0]])

    def covariance(*channels):
        return absent if all(channel is None for channel in channels) else unknown

    def known(channel):
        return np.zeros(trial.time.size) if channel is None else channel

    roll, pitch = known(trial.roll), known(trial.pitch)
    orientation = quaternion(roll, pitch, np.zeros(trial.time.size))
    rates = body_rates(roll, pitch, known(trial.roll_rate), known(trial.pitch_rate), known(trial.yaw_rate))
    force = known(trial.accel_x), known(trial.accel_y), known(trial.accel_z)
    covariances = (
        covariance(trial.roll, trial.pitch), covariance(trial.roll_rate, trial.pitch_rate),
        covariance(trial.accel_x, trial.accel_y, trial.accel_z),
    )
    for stamp, turn, rate, push in zip(stamps, *(np.stack(parts, axis=1).tolist()
                                                 for parts in (orientation, rates, force)), strict=True):
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        header = make_header(stamp=make_time(sec=seconds, nanosec=nanoseconds), frame_id=frame_id)
        yield stamp, make_imu(
            header=header,
            orientation=make_quaternion(*turn), orientation_covariance=covariances[0],
            angular_velocity=make_vector(*rate), angular_velocity_covariance=covariances[1],
            linear_acceleration=make_vector(*push), linear_acceleration_covariance=covariances[2],
        )


class _ImuDecoder:
    """Turns serialised Imu messages into arrays, many at once.

    Messages of one length and frame_id have their numbers in the same places (CDR, as ROS 2
    sends it), so that a block of them is an array already.
    """

    def __init__(self):
        self.frame_ids = {}
        self.damaged = 0
        self._waiting = []
        self._blocks = []

    def add(self, received, raw):
        self._waiting.append((received, raw))
        if len(self._waiting) == MESSAGES_AT_ONCE:
            self._decode()

    def arrays(self):
        """Stamps, times of arrival, and values of all messages so far."""
        self._decode()
        empty = np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, IMU_VALUES))
        return tuple(np.concatenate(parts) for parts in zip(empty, *self._blocks, strict=True))

    def _decode(self):
        alike = defaultdict(list)
        for received, raw in self._waiting:
            alike[raw[:4], raw[12:16], len(raw)].append((received, raw))
        self._waiting = []
        for (encoding, name_length, size), messages in alike.items():
            layout = _imu_layout(encoding, name_length, size)
            if layout is None:
                self.damaged += len(messages)
                continue
            table = np.frombuffer(b''.join(raw for _, raw in messages), dtype=layout)
            first = table['frame_id'][0]
            ids = np.unique(table['frame_id']) if np.any(table['frame_id'] != first) else [first]
            self.frame_ids.update(dict.fromkeys(frame_id.decode('utf-8', 'replace') for frame_id in ids))
            stamps = table['sec'].astype(np.int64) * 1_000_000_000 + table['nanosec']
            received = np.array([time for time, _ in messages], dtype=np.int64)
            self._blocks.append((stamps, received, table['values'].astype(float)))


def _imu_layout(encoding, name_length, size):
    """Where the numbers stand in a serialised Imu message, None if it is none (CDR, OMG formal/02-06-51)."""
    if encoding[:2] not in (b'\0\0', b'\0\1') or len(name_length) < 4:
        return None
    order = '<' if encoding[1] else '>'
    length = int.from_bytes(name_length, 'little' if encoding[1] else 'big')
    # alignment counts from behind the four bytes that tell the encoding
    values = 4 + -(-(12 + length) // 8) * 8
    if not 1 <= length <= size or values + 8 * IMU_VALUES > size:
        return None
    return np.dtype({
        'names': ['sec', 'nanosec', 'frame_id', 'values'],
        'formats': [f'{order}i4', f'{order}u4', f'S{length}', (f'{order}f8', IMU_VALUES)],
        'offsets': [4, 8, 16, values],
        'itemsize': size,
    })


@contextmanager
def opened_bag(path):
    """The open readers of everything in a bag, in the order of recording, and what to tell of its state.

    Parameters
    ----------
    path : str or Path
        A bag folder, or a single .mcap or .db3 file; of one that was cut off, what is whole can be read.

    Yields
    ------
    readers : list
        Each with ``connections`` and ``messages(connections)``, as those of rosbags.
    advice : list of Advice

    Raises
    ------
    InputError
        There is no such bag, or it is damaged beyond reading.
    """
    with ExitStack() as stack:
        yield _open_bag(Path(path), stack)


def _open_bag(path, stack):
    """Readers of everything in a bag, opened, and what to tell of its state."""
    if not path.exists():
        raise InputError(f'there is no bag {path}: check the name')
    if path.is_dir():
        return _open_folder(path, stack)
    return _open_storage(path, stack)


def _open_folder(path, stack):
    files = _storage_files(path)
    problem = 'its metadata.yaml is missing'
    if (path / METADATA_FILE).is_file():
        try:
            return [stack.enter_context(Reader(path))], []
        except Exception as error:  # as above
            problem = str(error)
    if not files:
        raise InputError(f'{path} is no rosbag2 bag that can be read ({_reason(path, problem)}): give a bag folder, or '
                         f'a .mcap or .db3 file')
    readers, advice = [], [_damage(path, problem)]
    for file in files:
        try:
            opened, more = _open_storage(file, stack)
        except InputError as error:
            advice.append(Advice('damaged-bag', str(error)))
        else:
            readers += opened
            advice += more
    if not readers:
        raise InputError(advice[-1].message)
    return readers, advice


def _open_storage(path, stack):
    try:
        kind = _storage_kind(path)
    except OSError as error:
        raise InputError(f'cannot read {path}: {error.strerror}') from error
    if kind is None:
        raise InputError(f'{path} is neither an mcap nor a SQLite file: give a rosbag2 bag')
    open_storage = Reader.STORAGE_PLUGINS[kind]
    try:
        storage = _opened(open_storage(path))
        if kind == '.mcap' and (damage := damage_of(path)):
            raise InputError(damage)
        return [stack.enter_context(storage)], []
    except Exception as error:  # as above
        if kind != '.mcap':
            raise InputError(f'{path} is damaged ({_reason(path, error)}): recover it with the sqlite3 tool, as in '
                             f"sqlite3 OLD.db3 '.recover' | sqlite3 NEW.db3") from error
        advice = [_damage(path, error)]
    try:
        mended = Path(stack.enter_context(tempfile.TemporaryDirectory())) / path.name
        _copy_whole_records(path, mended)
        return [stack.enter_context(_opened(open_storage(mended)))], advice
    except Exception as error:  # as above
        raise InputError(f'{path} is damaged beyond reading ({_reason(path, error)}): record it again') from error


@contextmanager
def _opened(storage):
    storage.open()
    try:
        yield storage
    finally:
        storage.close()


def _copy_whole_records(path, target):
    """Copy an mcap file up to its last whole record, without chunks of which the check sum does not hold or an index.

    Records are an operation code, a length of eight bytes, and the content (mcap.dev/spec).
    """
    (magic,) = (start for start, ending in MAGIC.items() if ending == '.mcap')
    size = path.stat().st_size
    with open(path, 'rb') as source, open(target, 'wb') as copy:
        copy.write(source.read(len(magic)))
        while len(head := source.read(9)) == 9 and head[0] not in (MCAP_FOOTER, MCAP_DATA_END):
            length = int.from_bytes(head[1:], 'little')
            if source.tell() + length <= size:
                content = source.read(length)
                if head[0] != MCAP_CHUNK or chunk_holds(content):
                    copy.write(head + content)
            elif head[0] != MCAP_CHUNK or not _enter_plain_chunk(source):
                break
        copy.write(bytes([MCAP_FOOTER]) + (20).to_bytes(8, 'little') + bytes(20) + magic)


def _enter_plain_chunk(source):
    """Go to the first record in a chunk (records that may also stand alone); False if it is compressed."""
    times_sizes_and_checksum, name_length, records_length = 28, 4, 8
    source.seek(times_sizes_and_checksum, os.SEEK_CUR)
    if int.from_bytes(source.read(name_length), 'little'):
        return False
    source.seek(records_length, os.SEEK_CUR)
    return True


def _storage_files(folder):
    """The storage files in a folder, in the order in which a recorder numbers them."""
    return sorted((file for file in folder.iterdir() if file.suffix in STORAGES and file.is_file()),
                  key=lambda file: (len(file.name), file.name))


def _storage_kind(path):
    """The ending that a storage file with these first bytes should have, None for any other file."""
    with open(path, 'rb') as file:
        start = file.read(16)
    return next((ending for magic, ending in MAGIC.items() if start.startswith(magic)), None)


def _choose_topic(path, readers, topic):
    """The IMU topic to read."""
    types = {c.topic: c.msgtype for reader in readers for c in reader.connections}
    filled = {c.topic for reader in readers for c in reader.connections if c.msgcount and c.msgtype == IMU_TYPE}
    imus = sorted(filled or (name for name, kind in types.items() if kind == IMU_TYPE))
    listed = ', '.join(imus) or 'none'
    if topic:
        name = topic if topic.startswith('/') else f'/{topic}'
        if types.get(name) == IMU_TYPE:
            return name
        if name in types:
            raise InputError(f'{path}: {name} is of type {types[name]}, not {IMU_TYPE}: choose an IMU topic ({listed})')
        raise InputError(f'{path} holds no topic {name}: choose an IMU topic ({listed})')
    if len(imus) == 1:
        return imus[0]
    if imus:
        raise InputError(f'{path} holds {len(imus)} IMU topics: choose one of {listed}')
    held = ', '.join(sorted(f'{name} ({kind})' for name, kind in types.items())) or 'none'
    raise InputError(f'{path} holds no topic of type {IMU_TYPE} (topics in it: {held}): record one')


def _damage(path, error):
    return Advice('damaged-bag', (
        f'{path} is damaged ({_reason(path, error)}): what is whole was read; let the recorder finish before its '
        f'power goes'
    ))


def _reason(path, error):
    """What a library said of a file, short and on one line."""
    words = ' '.join(str(error).replace(f' {path}', '').split()).rstrip('.')
    return words[:120] or type(error).__name__
