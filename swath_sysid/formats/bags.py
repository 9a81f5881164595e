"""Rosbag2 bags: IMU topics as trials, and trials as IMU topics."""

import os
import re
import shutil
import sqlite3
import tempfile
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import yaml
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.reader import zstd

from swath_sysid.attitude.hull.identified_model import MOUNTING
from swath_sysid.attitude.motion.attitude import FrameTree, Installation, body_rates, mounting_in, quaternion
from swath_sysid.attitude.motion.cleaning import ACCEL, GYRO, QUATERNION, assemble_trial
from swath_sysid.attitude.motion.intake import NOT_MEASURED, ImuReading
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.account import Loss, described, in_words, shortage
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import BLOCK_BYTES, existing, reading
from swath_sysid.formats.mcap_checksums import copy_whole_records, damage_of, is_ros2
from swath_sysid.formats.messages import (
    IMU_PARTS,
    IMU_VALUES,
    SECOND_NS,
    ImuMessage,
    frame_tree,
    stamp_of,
    told_installation,
    typestore,
)
from swath_sysid.formats.output_bag import STORAGES, writing_bag
from swath_sysid.formats.registry import BAGS
from swath_sysid.formats.text_tables import Losses, NamedColumns, damage
from swath_sysid.formats.topics import (
    CRAFT_FRAME,
    DIAGNOSTICS_TOPIC,
    IMU,
    LEADS,
    NEXT_TOPIC,
    ODOMETRY,
    STATIC_FRAMES,
    TRANSFORMS,
    TYPES,
)

METADATA_FILE = 'metadata.yaml'
ON = 'messages on '  #: A topic, that lack.
ZSTD = b'\x28\xb5\x2f\xfd'  #: How what was compressed with zstd begins, as no serialised message does.
#: Tables of a database that messages are read from, and their columns.
ROWS = {
    'topics': 'id, name, type, serialization_format, offered_qos_profiles',
    'messages': 'id, topic_id, timestamp, data',
}

_ANGLES = {'roll': 'x', 'pitch': 'y', 'yaw': 'z'}
_ORIENTATION = {f'q{part}': part for part in 'xyzw'}
#: Messages beside those of an IMU that may hold an attitude: columns and fields, and where in them the fields are.
ATTITUDES = {
    'geometry_msgs/msg/Vector3': (_ANGLES, ''),
    'geometry_msgs/msg/Vector3Stamped': (_ANGLES, 'vector.'),
    'geometry_msgs/msg/Pose2D': (_ANGLES | {'yaw': 'theta'}, ''),
    'geometry_msgs/msg/QuaternionStamped': (_ORIENTATION, 'quaternion.'),
    'geometry_msgs/msg/PoseStamped': (_ORIENTATION, 'pose.orientation.'),
    ODOMETRY: (_ORIENTATION, 'pose.pose.orientation.'),
}


@dataclass(frozen=True)
class ImuRecord:
    """The messages of one IMU."""

    stamps: np.ndarray  #: (N,), int64; header.stamp, ns.
    values: np.ndarray  #: (N, 37), in message order; a covariance that begins with -1: not measured.
    received: np.ndarray | None = None  #: (N,), int64, increasing; when they were recorded, ns.
    topic: str = ''
    frame_id: str = ''
    turned: Installation | None = None  #: Frame and mounting that are applied already; None: none is.
    frames: FrameTree = field(default_factory=dict)  #: What the static transforms of the bag state.
    told: Installation | None = None  #: What the diagnostics of imu_buffer in the bag state.
    advice: tuple[Advice, ...] = ()
    start: float = 0.0  #: s; the first stamp in the time of the trial.

    def __len__(self) -> int:
        return len(self.stamps)

    def installation(self, frame: str | None, mounting: tuple[float, float, float] | None) -> Installation:
        """With the frame and the mounting, rad, that are given, else as imu_buffer had them, else the transforms."""
        told = self.told or Installation()
        frame = frame or told.frame
        if mounting is None and frame == told.frame:
            mounting = told.mounting
        return Installation(frame, mounting or mounting_in(self.frames, self.frame_id.lstrip('/'), CRAFT_FRAME, frame))

    @property
    def measured(self) -> list[np.ndarray]:
        """Quaternions (N, 4), rates and specific forces (N, 3); NaN where the sensor does not measure them."""
        return [
            np.where(self.values[:, [covariance.start]] == NOT_MEASURED, np.nan, self.values[:, columns])
            for columns, covariance in zip(IMU_PARTS[::2], IMU_PARTS[1::2], strict=True)
        ]

    def __iter__(self) -> Iterator[ImuReading]:
        """One `ImuReading` after the other."""
        for stamp, row in zip(self.stamps.tolist(), self.values, strict=True):
            values = row.tolist()
            yield ImuReading(stamp, *(values[part] for part in IMU_PARTS))


def is_bag(path: str | Path) -> bool:
    """Whether something is a rosbag2 bag: a folder of storage files, or one such file, also compressed."""
    path = Path(path)
    if path.is_dir():
        return (path / METADATA_FILE).is_file() or bool(_storage_files(path))
    return _storage_kind(path) is not None or path.suffix == '.zstd' and _unpacked_name(path).suffix in STORAGES


def read_bag(
    path: str | Path,
    topic: str | None = None,
    frame: str | None = None,
    mounting: tuple[float, float, float] | None = None,
    device: str | None = None,
) -> Trial:
    """Read a trial from an IMU topic of a rosbag2 bag, with time from its first stamp; see `read_trial`."""
    record = read_imu(path, topic, device)
    installation = record.installation(frame, mounting)
    stamps, advice = record.stamps, list(record.advice)
    if np.all(stamps == stamps[0]) and stamps.size > 1 and record.received is not None:
        stamps = record.received
        advice.append(Advice.of('no-header-stamps', topic=record.topic))
    time, readings = (stamps - stamps[0]) / 1e9, dict[str, np.ndarray]()
    said = [f'a bag, {IMU} on {record.topic}']
    groups = zip((QUATERNION, GYRO, ACCEL), ('no unit', 'rad_s', 'm_s2'), record.measured, IMU_PARTS[1::2], strict=True)
    for names, unit, block, covariance in groups:
        if np.any(record.values[:, covariance.start] != NOT_MEASURED):
            readings.update(zip(names, np.ascontiguousarray(block.T), strict=True))
            said += [f'{name} ({unit}): {described(time, readings[name])}' for name in names]
    return assemble_trial(time, readings, installation, source=f'{path} {record.topic}', advice=advice, understood=said)


def read_imu(path: str | Path, topic: str | None = None, device: str | None = None) -> ImuRecord:
    """Read the messages of an IMU topic; the topic is needed only where a bag holds several, the device, a frame_id,
    where several send on the topic. The intact part of a truncated bag is read, with advice.
    """
    path = Path(path)
    with opened_bag(path) as (readers, losses):
        if losses and IMU not in {c.msgtype for reader in readers for c in reader.connections}:
            raise InputError(f'{path} is damaged and nothing of an IMU topic is left in it: record it again')
        topic = chosen_topic(path, readers, IMU, topic, 'several-imu-topics')
        decoder, told = _ImuDecoder(), None
        # by topic: in the namespace of another craft, frames of the same names are those of its own sensor
        trees: dict[str, dict] = {name: {} for name in _transforms_for(topic, readers)}
        for connection, time_ns, raw in intact_messages(path, readers, {topic, DIAGNOSTICS_TOPIC, *trees}, losses):
            if connection.msgtype == IMU:
                decoder.add(time_ns, raw)
            elif connection.msgtype == TRANSFORMS or isinstance(raw, bytes) and MOUNTING.encode() in raw:
                try:
                    message = typestore().deserialize_cdr(raw, connection.msgtype)
                except Exception:  # whatever a broken byte leads to
                    decoder.damaged += 1
                    continue
                if connection.msgtype == TRANSFORMS:
                    trees[connection.topic] |= frame_tree(message)
                elif connection.msgtype == TYPES[DIAGNOSTICS_TOPIC]:
                    now = told_installation(message, topic)
                    # before its transforms come, the nodes state none
                    told = now if now and (now.mounting or told is None) else told
    stamps, received, values, frames = decoder.arrays()
    losses.append(Loss('damaged-messages', decoder.damaged, decoder.damaged + stamps.size))
    advice = [*in_words(losses, path)]
    if not stamps.size:
        problem = f' ({advice[-1].message})' if advice else ''
        raise InputError(f'{path} holds no readable message on {topic}{problem}: record it again')
    order = np.argsort(received, kind='stable')
    if np.any(np.diff(order) != 1):
        stamps, received, values, frames = (each[order] for each in (stamps, received, values, frames))
    frame_ids = [each.decode('utf-8', 'replace') for each in dict.fromkeys(frames.tolist())]
    names = ', '.join(repr(name[:40]) for name in frame_ids[:3])
    if device is not None:
        if device not in frame_ids:
            raise InputError(f"{path} holds no device '{device}' on {topic}: choose from {names}")
        own = frames == device.encode()
        stamps, received, values, frame_ids = stamps[own], received[own], values[own], [device]
    elif np.count_nonzero(frames[1:] != frames[:-1]) > 2 * len(frame_ids):
        raise InputError(
            f'{path}: {len(frame_ids)} devices send on {topic}, in the frames {names}: choose one', 'several-devices'
        )
    elif len(frame_ids) > 1:
        advice.append(Advice.of('frame-id-changed', topic=topic, frames=len(frame_ids), names=names))
    frame_id = next(iter(frame_ids), '')
    frames_of = dict(item for tree in trees.values() for item in tree.items())
    return ImuRecord(stamps, values, received, topic, frame_id, frames=frames_of, told=told, advice=tuple(advice))


def _transforms_for(topic: str, readers: Sequence[Any]) -> list[str]:
    """The topics of static transforms in the namespaces that a topic is in, the nearest last."""
    static = {c.topic for reader in readers for c in reader.connections if c.topic.endswith(STATIC_FRAMES)}
    own = (name for name in static if f'/{topic.lstrip("/")}'.startswith(name.removesuffix(STATIC_FRAMES) + '/'))
    return sorted(own, key=len)


def attitude_table(path: str | Path, topic: str) -> NamedColumns | None:
    """The table of a topic with angles, whose unit no message states, or orientations; None of other types."""
    with opened_bag(path) as (readers, _):
        kinds = {c.topic: c.msgtype for reader in readers for c in reader.connections}
    name = topic_named(topic, kinds)
    if kinds.get(name) not in ATTITUDES:
        return None
    columns, place = ATTITUDES[kinds[name]]
    fields = attrgetter(*(place + field for field in columns.values()))

    def read(places: Sequence[int], _: Any) -> tuple[np.ndarray, Losses]:
        rows, stamps, damaged = [], [], 0
        with opened_bag(path) as (readers, losses):
            for connection, arrival, raw in intact_messages(path, readers, (name,), losses):
                try:
                    message = typestore().deserialize_cdr(raw, connection.msgtype)
                except Exception:  # the library raises whatever a broken byte leads it to; counted below
                    damaged += 1
                    continue
                rows.append(fields(message))
                stamps.append((stamp_of(message) or 0, arrival))
        losses.append(Loss('damaged-messages', damaged, damaged + len(rows)))
        sent, received = np.array(stamps, dtype=np.int64).reshape(-1, 2).T
        if not np.any(np.diff(sent)):
            sent = received
            losses.append(Loss('no-header-stamps', said={'topic': name}))
        time = (sent - sent[:1]) / SECOND_NS
        return np.vstack([time, np.reshape(rows, (-1, len(columns))).T])[list(places)], tuple(losses)

    return NamedColumns(('time_s', *columns), read, name=name, place=f'a bag, {kinds[name]}')


def write_imu_bag(
    path: str | Path, trial: Trial, *, start_stamp_ns: int = 0, topic: str = '/imu/data', frame_id: str = 'imu_link'
) -> None:
    """Write a trial in the craft's axes as an IMU would have sent it, the first sample with the stamp given.
    ``NAME.mcap`` or ``NAME.db3`` is a single file, any other path a bag folder. An Imu message has no place for heave.
    """
    stamps = int(start_stamp_ns) + np.round((trial.time - trial.time[0]) * 1e9).astype(np.int64)
    sender = ImuMessage(frame_id)
    with writing_bag(path) as add:
        for stamp, values in zip(stamps.tolist(), imu_values(trial), strict=True):
            add(topic, IMU, stamp, sender.of_values(stamp, values))


def imu_values(trial: Trial) -> np.ndarray:
    """The numbers, shape (N, 37), that an IMU in the craft's axes would have sent, without yaw. A missing angle or
    rate is zero; where a whole group is missing, its covariance says that it was not measured.
    """
    values = np.zeros((trial.time.size, IMU_VALUES))
    angles, turns = (trial.roll, trial.pitch), (trial.roll_rate, trial.pitch_rate)
    forces = trial.accel_x, trial.accel_y, trial.accel_z
    roll, pitch, *rates = (0.0 if channel is None else channel for channel in (*angles, *turns, trial.yaw_rate))
    sent = (
        (quaternion(roll, pitch, 0.0), angles),
        (body_rates(roll, pitch, *rates), turns),
        ([0.0 if channel is None else channel for channel in forces], forces),
    )
    for (parts, channels), columns, covariance in zip(sent, IMU_PARTS[::2], IMU_PARTS[1::2], strict=True):
        for place, part in enumerate(parts, columns.start):
            values[:, place] = part
        if all(channel is None for channel in channels):
            values[:, covariance.start] = NOT_MEASURED
    return values


class _ImuDecoder:
    """Turns serialised Imu messages into arrays: messages of one length and frame_id have one CDR layout."""

    def __init__(self) -> None:
        self.damaged = 0
        self._waiting: list[tuple[int, Any]] = []
        self._bytes = 0
        self._blocks = [(*np.empty((2, 0), np.int64), np.empty((0, IMU_VALUES)), np.empty(0, 'S1'))]

    def add(self, received: Any, raw: Any) -> None:
        # a broken database holds anything, also nothing
        if not isinstance(received, int) or not isinstance(raw, bytes | memoryview):
            self.damaged += 1
            return
        self._waiting.append((received, raw))
        self._bytes += len(raw)
        if self._bytes >= BLOCK_BYTES:
            self._decode()

    def arrays(self) -> tuple[np.ndarray, ...]:
        """Stamps, times of arrival, values and frames of all messages so far."""
        self._decode()
        return tuple(np.concatenate(parts) for parts in zip(*self._blocks, strict=True))

    def _decode(self) -> None:
        alike = defaultdict(list)
        for received, raw in self._waiting:
            alike[raw[:4], raw[12:16], len(raw)].append((received, raw))
        self._waiting, self._bytes = [], 0
        for (encoding, name_length, size), messages in alike.items():
            layout = _imu_layout(encoding, name_length, size)
            if layout is None:
                self.damaged += len(messages)
                continue
            table = np.frombuffer(b''.join(raw for _, raw in messages), dtype=layout)
            stamps = table['sec'].astype(np.int64) * SECOND_NS + table['nanosec']
            times = np.array([time for time, _ in messages], dtype=np.int64)
            self._blocks.append((stamps, times, table['values'].astype(float), table['frame_id']))


def _imu_layout(encoding: bytes, name_length: bytes, size: int) -> np.dtype | None:
    """Positions of the numbers in a serialised Imu message, None if it is none (CDR, OMG formal/02-06-51)."""
    if encoding[:2] not in (b'\0\0', b'\0\1') or len(name_length) < 4:
        return None
    order = '<' if encoding[1] else '>'
    length = int.from_bytes(name_length, 'little' if encoding[1] else 'big')
    # alignment counts from the end of the four bytes of the encapsulation header
    values = 4 + -(-(12 + length) // 8) * 8
    if not 1 <= length <= size or values + 8 * IMU_VALUES > size:
        return None
    return np.dtype(
        {
            'names': ['sec', 'nanosec', 'frame_id', 'values'],
            'formats': [f'{order}i4', f'{order}u4', f'S{length}', (f'{order}f8', IMU_VALUES)],
            'offsets': [4, 8, 16, values],
            'itemsize': size,
        }
    )


@contextmanager
def opened_bag(path: str | Path) -> Iterator[tuple[list[Any], list[Loss]]]:
    """The open readers of a bag folder or storage file, in recording order, and what cannot be read of it."""
    with ExitStack() as stack:
        found = existing(path)
        yield (_open_folder if found.is_dir() else _open_storage)(found, stack)


def _open_folder(path: Path, stack: ExitStack) -> tuple[list[Any], list[Loss]]:
    files, problem = _storage_files(path), 'its metadata.yaml is missing'
    expected: dict[str, int] = {}
    if (path / METADATA_FILE).is_file():
        try:
            content = yaml.safe_load((path / METADATA_FILE).read_bytes())['rosbag2_bagfile_information']
            listed = [path / Path(name).name for name in content['relative_file_paths']]
            counts = content.get('topics_with_message_count') or []
            expected = {each['topic_metadata']['name']: int(each['message_count']) for each in counts}
            absent = [file.name for file in listed if not file.is_file()]
            problem = (
                f'{", ".join(absent)} is missing' if absent else '' if listed else 'its metadata.yaml lists no file'
            )
            files = listed if not problem else files
        except Exception as error:  # the library raises whatever a broken byte leads it to
            problem = f'its metadata.yaml cannot be read: {_reason(path, error)}'
    # rosbag2 numbers the files of one bag
    names = sorted({re.sub(r'_\d+$', '', _unpacked_name(file).stem) for file in files})
    if problem and len(names) > 1:
        raise InputError(f'{path} holds several bags ({", ".join(names)}): give one of them')
    if not files:
        raise InputError(f'{path} is no readable rosbag2 bag ({problem}): give a bag folder, or a .mcap or .db3 file')
    readers, losses = [], [*damage(problem)]
    for file in files:
        try:
            opened, more = _open_storage(file, stack)
        except InputError as error:
            opened, more = [], [Loss('unreadable-file', said={'problem': str(error)})]
        readers += opened
        losses += more
    if not readers:
        raise InputError(in_words(losses, path)[-1].message)
    there = _counted(c for reader in readers for c in reader.connections)
    return readers, [*losses, *_missing(expected, there, 'its metadata.yaml')]


def _counted(connections: Iterable[Any]) -> Counter[str]:
    """How many messages of each topic there are."""
    counts = Counter[str]()
    for connection in connections:
        counts[connection.topic] += connection.msgcount
    return counts


def _missing(expected: Mapping[str, int], read: Mapping[str, int], counter: str) -> Iterator[Loss]:
    for topic, number in expected.items():
        yield from shortage(number, read[topic], counter, f'{ON}{topic}')


class _Schemas(dict):
    """Those of an mcap file, for a library that ends at the first in an encoding other than those of ROS 2."""

    def __setitem__(self, key: int, schema: Any) -> None:
        is_known = schema.encoding in ('ros2msg', 'ros2idl', 'omgidl', '')
        super().__setitem__(key, schema if is_known else schema._replace(encoding='', data=''))


def _named_by_encoding(connection: Any) -> Any:
    """A connection whose type says that its messages are not in CDR."""
    encoding = connection.ext.serialization_format
    own = encoding in ('cdr', '')
    return connection if own else connection._replace(msgtype=f'{connection.msgtype} in {encoding}')


class _Storage:
    """An open storage file, whose messages are unpacked where a recorder has compressed each."""

    def __init__(self, file: Path, kind: str, stack: ExitStack) -> None:
        # the library makes an address of the name of a database
        reader: Any = Reader.STORAGE_PLUGINS[kind](Path(quote(os.fsencode(file))) if kind == '.db3' else file)
        if kind == '.mcap':
            reader.schemas = _Schemas()
        self._reader = reader
        self._reader.open()
        stack.callback(self._reader.close)
        self.connections = [_named_by_encoding(each) for each in self._reader.connections]

    def messages(self, connections: Collection[Any]) -> Iterator[tuple[Any, int, bytes]]:
        """Connection, time of reception, ns, and bytes, by that time or, without an index, as they lie there."""
        scan = getattr(self._reader, 'messages_scan', None)
        read = scan if scan and not getattr(self._reader, 'chunks', None) else self._reader.messages
        own = {each.id for each in connections}
        for connection, time_ns, raw in read([each for each in self._reader.connections if each.id in own]):
            is_packed = isinstance(raw, bytes) and raw.startswith(ZSTD)
            yield connection, time_ns, zstd.decompress(raw) if is_packed else raw


def _open_storage(path: Path, stack: ExitStack) -> tuple[list[Any], list[Loss]]:
    file, kind = path, None
    try:
        with reading(path):
            file = _whole_file(path, stack)
            kind = _storage_kind(file)
            if kind is None:
                raise InputError(f'{path} is neither an mcap nor a SQLite file: give a rosbag2 bag')
            if kind == '.mcap' and (wrong := damage_of(file)):
                raise ValueError(wrong)
            if kind == '.mcap' and not is_ros2(file):
                plain = _temporary(stack)
                copy_whole_records(file, plain)
                file = plain
        return [_Storage(file, kind, stack)], []
    except InputError:
        raise
    except Exception as error:  # the libraries raise whatever a broken byte leads them to
        reason = _reason(file, error)
    try:
        mended = _temporary(stack)
        (copy_whole_records if kind == '.mcap' else _copy_readable_rows)(file, mended)
        return [_Storage(mended, str(kind), stack)], [*damage(reason, source=path)]
    except Exception as error:  # as above
        raise InputError(f'{path} is damaged beyond reading ({_reason(mended, error)}): record it again') from error


def _whole_file(path: Path, stack: ExitStack) -> Path:
    """A storage file, or a temporary one: unpacked, or with what SQLite had still to bring into a database."""
    with open(path, 'rb') as file:
        if file.read(len(ZSTD)) == ZSTD:
            file.seek(0)
            unpacked = _temporary(stack)
            # what was cut off has no end, and is recognised as damaged after this
            with zstd.open(file) as source, open(unpacked, 'wb') as target, suppress(EOFError):
                shutil.copyfileobj(source, target)
            return unpacked
    journals = {ending: Path(f'{path}{ending}') for ending in ('', '-wal', '-journal')}
    if not any(os.path.isfile(each) and os.path.getsize(each) for ending, each in journals.items() if ending):
        return path
    copy = _temporary(stack)
    for ending, each in journals.items():
        if os.path.isfile(each):
            shutil.copyfile(each, f'{copy}{ending}')
    with closing(sqlite3.connect(copy)) as database:
        database.execute('PRAGMA journal_mode = DELETE')
    return copy


def _temporary(stack: ExitStack) -> Path:
    return Path(stack.enter_context(tempfile.TemporaryDirectory()), 'bag')


def _copy_readable_rows(path: Path, target: Path) -> None:
    """Copy a damaged database, which SQLite itself refuses altogether, up to the first row that cannot be read."""
    with closing(sqlite3.connect(path)) as old, closing(sqlite3.connect(target)) as new:
        old.executescript('PRAGMA query_only = ON; PRAGMA writable_schema = ON')
        for table, columns in ROWS.items():
            new.execute(f'CREATE TABLE {table} ({columns})')
            values = ', '.join('?' * len(columns.split()))
            with suppress(sqlite3.DatabaseError):
                new.executemany(f'INSERT INTO {table} VALUES ({values})', old.execute(f'SELECT {columns} FROM {table}'))
        new.commit()


def _storage_files(folder: Path) -> list[Path]:
    """The storage files in a folder, in the order in which a recorder numbers them."""
    found = {_unpacked_name(file): file for file in sorted(folder.iterdir(), reverse=True) if file.is_file()}
    names = (name for name in found if name.suffix in STORAGES)
    return [found[name] for name in sorted(names, key=lambda name: (len(name.name), name.name))]


def _unpacked_name(file: Path) -> Path:
    return file.with_suffix('') if file.suffix == '.zstd' else file


def _storage_kind(path: Path) -> str | None:
    """The ending that a storage file with these first bytes should have, None for any other file."""
    with open(path, 'rb') as file:
        start = file.read(16)
    return next((ending for ending, magic in BAGS.items() if start.startswith(magic)), None)


def topic_named(given: str, topics: Collection[str]) -> str:
    """The topic as a bag names it: some converters leave the slash before it out."""
    return next((name for name in topics if name.lstrip('/') == given.lstrip('/')), f'/{given.lstrip("/")}')


def chosen_topic(path: str | Path, readers: Sequence[Any], kind: str, given: str | None, code: str = '') -> str:
    """The topic of a type to read: that given, else the only one; errors have a code."""
    types = {c.topic: c.msgtype for reader in readers for c in reader.connections}
    filled = {c.topic for reader in readers for c in reader.connections if c.msgcount and c.msgtype == kind}
    fitting = sorted(filled or (name for name, each in types.items() if each == kind))
    # our own recordings hold the forecasts beside the sensor
    measured = [name for name in fitting if f'/{LEADS}' not in name and not name.endswith(f'/{NEXT_TOPIC}')]
    if fitting and not (measured or given):
        raise InputError(f'{path} holds forecasts, and no {kind} of a sensor: record the sensor, or name a topic', code)
    fitting = measured or fitting
    if given:
        name = topic_named(given, types)
        if types.get(name) == kind:
            return name
        problem = f'{name} of type {types[name]}, not {kind}' if name in types else f'no topic {name}'
        raise InputError(f'{path} holds {problem}: choose from {", ".join(fitting) or "none"}')
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise InputError(f'{path} holds {len(fitting)} topics of {kind}: choose one of {", ".join(fitting)}', code)
    held = ', '.join(sorted(f'{name} ({each})' for name, each in types.items())) or 'none'
    problem = f'{path} holds no topic of type {kind} (topics in it: {held})'
    if kind == IMU and ATTITUDES.keys() & types.values():
        raise InputError(f'{problem}: choose the one with the attitude', code)
    raise InputError(f'{problem}: record one')


def intact_messages(
    path: str | Path, readers: Sequence[Any], topics: Collection[str], losses: list[Loss]
) -> Iterator[tuple[Any, int, bytes]]:
    """Connection, time of reception, ns, and bytes of the messages of topics; what cannot be read joins the losses,
    from which what other topics lack is left out.
    """
    losses[:] = [loss for loss in losses if not loss.what.startswith(ON) or loss.what.removeprefix(ON) in topics]
    for reader in readers:
        connections = [c for c in reader.connections if c.topic in topics]
        expected, read = _counted(connections), Counter[str]()
        try:
            for message in reader.messages(connections) if connections else ():
                read[message[0].topic] += 1
                yield message
            losses += _missing(expected, read, 'its index')
        except Exception as error:  # the libraries raise whatever a broken byte leads them to
            losses += damage(f'{_reason(path, error)} after {read.total()} of {expected.total()} messages')


def _reason(path: str | Path, error: object) -> str:
    """What a library said of a file, short and on one line."""
    words = ' '.join(str(error).replace(f' {path}', '').split()).rstrip('.')
    return words[:120] or type(error).__name__
