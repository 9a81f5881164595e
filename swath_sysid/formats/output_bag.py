"""Bags of what the nodes publish, written without ROS: mcap, messages through rosbags' type system."""
import os
from contextlib import contextmanager
from functools import lru_cache
from struct import Struct

import numpy as np
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.typesys import Stores, get_typestore

from swath_sysid.attitude.identification.refit import COEFFICIENT_NAMES, coefficients
from swath_sysid.attitude.motion.window import COLUMNS
from swath_sysid.attitude.prediction.forecast import NOT_GIVEN
from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing
from swath_sysid.formats.mcap_checksums import add_checksums
from swath_sysid.formats.model_file import model_to_yaml
from swath_sysid.formats.topics import HORIZON_TOPIC, NEXT_TOPIC, QUIESCENCE_TOPIC, lead_topic

IMU, TRAJECTORY, CLOUD = 'sensor_msgs/msg/Imu', 'trajectory_msgs/msg/JointTrajectory', 'sensor_msgs/msg/PointCloud2'
STRING, ARRAY, FLOAT = 'std_msgs/msg/String', 'std_msgs/msg/Float64MultiArray', 'std_msgs/msg/Float32'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'

IMU_TOPIC = 'imu/data'
WINDOW_TOPIC = 'motion/window'
DESCRIPTION_TOPIC = 'model/description'
COEFFICIENTS_TOPIC = 'model/coefficients'
DIAGNOSTICS_TOPIC = '/diagnostics'

LATCHED_TOPICS = (WINDOW_TOPIC, DESCRIPTION_TOPIC, COEFFICIENTS_TOPIC)
"""Transient local: who comes late gets the last one."""

FOR_EVER = QosTime(9223372036, 854775807)

SECOND_NS = 1_000_000_000
FLOAT64 = 8
"""sensor_msgs/PointField's number for doubles."""

LITTLE_ENDIAN = b'\0\1\0\0'
ENCAPSULATION_BYTES = len(LITTLE_ENDIAN)
FLOAT64_BYTES = 8
_STAMP = Struct('<II')
_FLOAT32 = Struct('<4sf')

MESSAGE_RECORD, MESSAGE_HEAD_BYTES, CHUNK_BYTES = 0x05, 22, 2**20
_MESSAGE = Struct('<BQHIQQ')
"""An mcap record of a message up to its data: kind, length, channel, sequence, times of logging and publishing."""

_PADDING = b'', bytes(3), bytes(2), bytes(1)


@contextmanager
def writing_output_bag(path, *, frame_id='base_link', namespace=''):
    """An `OutputBag` that takes its final name at the end; nothing is left behind if the block raises.

    Parameters
    ----------
    path : str or Path
        ``NAME.mcap``.
    frame_id : str
    namespace : str
        Of the topics.

    Yields
    ------
    OutputBag

    Raises
    ------
    InputError
        The name does not end in .mcap, or the file cannot be written.
    """
    if not str(path).endswith('.mcap'):
        raise InputError(f"the messages are written as mcap: give an output name that ends in .mcap, not '{path}'")
    with replacing(path) as temporary:
        folder = temporary.with_suffix('')
        with _QuickWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            yield OutputBag(writer, frame_id, namespace)
        add_checksums(folder / f'{folder.name}.mcap')
        os.replace(folder / f'{folder.name}.mcap', temporary)


class _QuickStorage(McapWriter):
    """rosbags' mcap storage, which puts a message together field by field: in one piece that takes a third of the time.

    The same calls give the same file.
    """

    def write(self, connection, timestamp, data):
        """Write a message; see `McapWriter.write`."""
        chunk, number = self.chunk, connection.id
        if timestamp < chunk.message_start_time:
            chunk.message_start_time = timestamp
            self.message_start_time = min(timestamp, self.message_start_time)
        if timestamp > chunk.message_end_time:
            chunk.message_end_time = timestamp
            self.message_end_time = max(timestamp, self.message_end_time)
        self.channel_stats[number] += 1
        place = chunk.bio.tell()
        chunk.msgs[number].append((timestamp, place))
        head = _MESSAGE.pack(MESSAGE_RECORD, MESSAGE_HEAD_BYTES + len(data), number, 0, timestamp, timestamp)
        if place + chunk.bio.write(head + data) > CHUNK_BYTES:
            self.close_chunk()


class _QuickWriter(Writer):
    STORAGE_PLUGINS = {StoragePlugin.MCAP: _QuickStorage}


class OutputBag:
    """What the nodes publish, as messages of an open bag.

    The same values give the same bytes: padding is zero.

    Parameters
    ----------
    writer : rosbags.rosbag2.Writer
        Open.
    frame_id : str
        Of all messages with a header.
    namespace : str
    """

    def __init__(self, writer, frame_id='base_link', namespace=''):
        self._writer = writer
        self._frame_id = frame_id
        self._prefix = f'/{namespace.strip("/")}' if namespace.strip('/') else ''
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._types = self._store.types
        self._connections = {}
        self._imu = None
        self._horizons = {}
        self.counts = {}

    def add_played(self, played):
        """Everything that one step of a play-through published.

        Parameters
        ----------
        played : Played
        """
        time_ns, step = played.stamp_ns, played.step
        if played.models is not None:
            self.add_models(time_ns, played.models)
        if step.next is not None:
            self.add_attitude(NEXT_TOPIC, time_ns, step.next)
        for lead, forecast in step.attitudes():
            self.add_attitude(lead_topic(lead), time_ns, forecast)
        if step.horizon is not None:
            self.add_horizon(time_ns, step.trajectory())
        if step.quiescence is not None:
            self._write(QUIESCENCE_TOPIC, FLOAT, time_ns, _FLOAT32.pack(LITTLE_ENDIAN, step.quiescence))
        if played.window is not None:
            self.add_window(time_ns, played.window)

    def add_attitude(self, topic, time_ns, forecast):
        """An `AttitudeForecast` as a sensor_msgs/Imu.

        Parameters
        ----------
        topic : str
        time_ns : int
            When it is published.
        forecast : AttitudeForecast
        """
        self.add_imu(topic, time_ns, forecast.stamp_ns, (
            *forecast.orientation, *forecast.orientation_covariance, *forecast.rates, *forecast.rates_covariance,
            0.0, 0.0, 0.0, *NOT_GIVEN,
        ))  # fmt: skip

    def add_imu(self, topic, time_ns, stamp_ns, values):
        """A sensor_msgs/Imu.

        Parameters
        ----------
        topic : str
        time_ns, stamp_ns : int
            When it is published, and its header's stamp.
        values : sequence of 37 floats
            In the order of the message definition.
        """
        if self._imu is None:
            self._imu = _Template(self._store, IMU, self._imu_message)
        self._write(topic, IMU, time_ns, self._imu.filled(stamp_ns, values))

    def add_horizon(self, time_ns, horizon):
        """A `HorizonForecast` as a trajectory_msgs/JointTrajectory."""
        shape = horizon.columns, horizon.leads_ns
        if shape not in self._horizons:
            self._horizons = {shape: _Template(self._store, TRAJECTORY, lambda v: self._horizon_message(horizon, v))}
        values = np.concatenate([horizon.positions, horizon.velocities], axis=1).ravel()
        self._write(HORIZON_TOPIC, TRAJECTORY, time_ns, self._horizons[shape].filled(horizon.stamp_ns, values))

    def add_window(self, time_ns, table):
        """A `MotionTable` as a sensor_msgs/PointCloud2, a row a sample."""
        field = self._types['sensor_msgs/msg/PointField']
        rows = np.ascontiguousarray(table.rows, dtype='<f8')
        self._serialise(WINDOW_TOPIC, CLOUD, time_ns, self._types[CLOUD](
            header=self._header(table.stamp_ns), height=1, width=len(rows),
            fields=[field(name=n, offset=8 * i, datatype=FLOAT64, count=1) for i, n in enumerate(COLUMNS)],
            is_bigendian=False, point_step=8 * len(COLUMNS), row_step=rows.nbytes,
            data=np.frombuffer(rows.tobytes(), dtype=np.uint8), is_dense=bool(np.isfinite(rows).all()),
        ))  # fmt: skip

    def add_models(self, time_ns, models):
        """Models by axis, as ``model/description`` and ``model/coefficients``."""
        self._serialise(DESCRIPTION_TOPIC, STRING, time_ns, self._types[STRING](data=model_to_yaml(models)))
        dimension = self._types['std_msgs/msg/MultiArrayDimension']
        layout = self._types['std_msgs/msg/MultiArrayLayout']
        axes, values = coefficients(models)
        columns = len(COEFFICIENT_NAMES)
        self._serialise(COEFFICIENTS_TOPIC, ARRAY, time_ns, self._types[ARRAY](
            layout=layout(dim=[
                dimension(label=','.join(axes), size=len(axes), stride=values.size),
                dimension(label=','.join(COEFFICIENT_NAMES), size=columns, stride=columns),
            ], data_offset=0),
            data=values.ravel(),
        ))  # fmt: skip

    def add_diagnostics(self, time_ns, statuses):
        """A diagnostic_msgs/DiagnosticArray.

        Parameters
        ----------
        time_ns : int
        statuses : sequence of (int, str, str, dict of str to str)
            Level, name, message and values of each.
        """
        self._write(DIAGNOSTICS_TOPIC, DIAGNOSTICS, time_ns, diagnostics_cdr(time_ns, statuses))

    def _serialise(self, topic, kind, time_ns, message):
        self._write(topic, kind, time_ns, self._store.serialize_cdr(message, kind))

    def _write(self, topic, kind, time_ns, raw):
        connection = self._connections.get(topic)
        if connection is None:
            name = topic if topic.startswith('/') else f'{self._prefix}/{topic}'
            qos = offered_qos(topic in LATCHED_TOPICS, topic != IMU_TOPIC)
            connection = self._writer.add_connection(name, kind, typestore=self._store, offered_qos_profiles=[qos])
            self._connections[topic] = connection
            self.counts[topic] = 0
        self._writer.write(connection, time_ns, raw)
        self.counts[topic] += 1

    def _header(self, stamp_ns, frame_id=None):
        seconds, rest = divmod(stamp_ns, SECOND_NS)
        time = self._types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=rest)
        return self._types['std_msgs/msg/Header'](stamp=time, frame_id=self._frame_id if frame_id is None else frame_id)

    def _imu_message(self, values):
        turn, vector = self._types['geometry_msgs/msg/Quaternion'], self._types['geometry_msgs/msg/Vector3']
        return self._types[IMU](
            header=self._header(0),
            orientation=turn(*(next(values) for _ in range(4))), orientation_covariance=_taken(values, 9),
            angular_velocity=vector(*(next(values) for _ in range(3))), angular_velocity_covariance=_taken(values, 9),
            linear_acceleration=vector(*(next(values) for _ in range(3))),
            linear_acceleration_covariance=_taken(values, 9),
        )  # fmt: skip

    def _horizon_message(self, horizon, values):
        point = self._types['trajectory_msgs/msg/JointTrajectoryPoint']
        duration = self._types['builtin_interfaces/msg/Duration']
        count, nothing = len(horizon.columns), np.empty(0)
        points = []
        for lead in horizon.leads_ns:
            seconds, rest = divmod(lead, SECOND_NS)
            points.append(point(
                positions=_taken(values, count), velocities=_taken(values, count), accelerations=nothing,
                effort=nothing, time_from_start=duration(sec=seconds, nanosec=rest),
            ))  # fmt: skip
        return self._types[TRAJECTORY](header=self._header(0), joint_names=list(horizon.columns), points=points)


def diagnostics_cdr(stamp_ns, statuses):
    """A serialised diagnostic_msgs/DiagnosticArray; a tenth of the time that a type system takes.

    Parameters
    ----------
    stamp_ns : int
    statuses : sequence of (int, str, str, dict of str to str)
        Level, name, message and values of each.

    Returns
    -------
    bytes
        CDR, little-endian: numbers of four bytes stand at multiples of four, a text is its length, its
        bytes and a zero (OMG formal/02-06-51).
    """
    seconds, rest = divmod(stamp_ns, SECOND_NS)
    raw = bytearray(LITTLE_ENDIAN + _STAMP.pack(seconds & 0xFFFFFFFF, rest) + _text(''))
    _append(raw, _number(len(statuses)))
    for level, name, message, values in statuses:
        raw.append(level)
        for words in (name, message, ''):
            _append(raw, _text(words))
        _append(raw, _number(len(values)))
        for key, value in values.items():
            _append(raw, _text(key))
            _append(raw, _text(value))
    return bytes(raw)


def _append(raw, part):
    raw.extend(_PADDING[len(raw) % 4] + part)


def _number(value):
    return value.to_bytes(4, 'little')


@lru_cache(maxsize=1024)
def _text(words):
    content = words.encode() + b'\0'
    return _number(len(content)) + content


def offered_qos(latched, reliable):
    """What a bag says of the publisher of a topic.

    Parameters
    ----------
    latched : bool
        Transient local.
    reliable : bool

    Returns
    -------
    rosbags.interfaces.Qos
    """
    return Qos(
        QosHistory.KEEP_LAST, 1 if latched else 10,
        QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        FOR_EVER, FOR_EVER, QosLiveliness.AUTOMATIC, FOR_EVER, False,
    )  # fmt: skip


class _Template:
    """A serialised message in which stamp and doubles are replaced: messages of one shape differ in nothing else.

    Serialising each costs 20 us to 1 ms, this 2 us.

    Parameters
    ----------
    store : rosbags.typesys.store.Typestore
    kind : str
        A message type that begins with a header.
    message_of : callable
        Makes a message of the shape, taking its doubles from an iterator.
    """

    def __init__(self, store, kind, message_of):
        markers = _Markers()
        raw = store.serialize_cdr(message_of(markers), kind)
        # CDR places doubles at multiples of eight bytes, counted from behind the encapsulation header
        self._raw, self._size = bytearray(raw) + bytes(FLOAT64_BYTES), len(raw)
        count = len(raw) // FLOAT64_BYTES
        self._doubles = np.frombuffer(self._raw, dtype='<f8', count=count, offset=ENCAPSULATION_BYTES)
        place_of = {value: place for place, value in enumerate(self._doubles.tolist())}
        self._places = np.array([place_of[marker] for marker in markers.given])
        self._pack_into = None
        if np.all(np.diff(self._places) == 1):
            # side by side: three times as fast
            self._pack_into = Struct(f'<{self._places.size}d').pack_into
            self._first = ENCAPSULATION_BYTES + FLOAT64_BYTES * int(self._places[0])

    def filled(self, stamp_ns, values):
        """The message's bytes with this stamp and these doubles."""
        raw = self._raw
        _STAMP.pack_into(raw, ENCAPSULATION_BYTES, stamp_ns // SECOND_NS & 0xFFFFFFFF, stamp_ns % SECOND_NS)
        if self._pack_into is None:
            self._doubles[self._places] = values
        else:
            self._pack_into(raw, self._first, *values)
        return bytes(raw[:self._size])


class _Markers:
    """Endless doubles that occur in no message otherwise."""

    def __init__(self):
        self.given = []

    def __iter__(self):
        return self

    def __next__(self):
        self.given.append(1e300 * (1.0 + 1e-6 * len(self.given)))
        return self.given[-1]


def _taken(values, count):
    return np.array([next(values) for _ in range(count)])
