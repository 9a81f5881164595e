"""ROS messages as serialised bytes and as plain values, without ROS.

rclpy publishes such bytes as they are and bags hold them, so nodes and play-through send the same.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from functools import cache, lru_cache
from math import nan, radians
from struct import Struct
from typing import TYPE_CHECKING, Any

import numpy as np

from swath_sysid.attitude.hull.identified_model import COEFFICIENT_NAMES, MOUNTING, coefficients
from swath_sysid.attitude.motion.attitude import FRAMES, FrameTree, Installation, Quaternion
from swath_sysid.attitude.motion.intake import NANOSECOND, ImuReading
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.motion.window import COLUMNS, MotionTable, NoticedDecay
from swath_sysid.common.errors import InputError
from swath_sysid.formats.topics import IMU, STRING, TYPES, WINDOW_TOPIC

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swath_sysid.attitude.hull.identified_model import IdentifiedModel

SECOND_NS = round(1.0 / NANOSECOND)
SENSOR_COLUMNS = ('sensor_roll', 'sensor_pitch', 'sensor_yaw')  #: rad; its mounting, in every row; NaN: not stated.
#: ``decay`` is 1 (roll) or 2 (pitch) in the rows of the free decay that the window was published for by itself, else 0.
WINDOW_COLUMNS = (*COLUMNS, 'decay', *SENSOR_COLUMNS)
ORIENTATION, RATES, FORCE = slice(0, 4), slice(13, 16), slice(25, 28)
ORIENTATION_COVARIANCE, RATES_COVARIANCE, FORCE_COVARIANCE = slice(4, 13), slice(16, 25), slice(28, 37)
#: The doubles of an Imu message, in their order.
IMU_PARTS = (ORIENTATION, ORIENTATION_COVARIANCE, RATES, RATES_COVARIANCE, FORCE, FORCE_COVARIANCE)
IMU_VALUES = FORCE_COVARIANCE.stop

ENCAPSULATION_BYTES, FLOAT64_BYTES = 4, np.dtype(float).itemsize
_STAMP = Struct('<iI')


@cache
def typestore() -> Any:
    """The message types of ROS 2 Jazzy."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def serialised(message: Any) -> bytes:
    """The bytes of a message of the `typestore`."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__))


def make(kind: str, *values: Any) -> Any:
    """A message of the `typestore` from its fields in their order; those that are messages too may be tuples."""
    return _maker(kind)(*values)


@cache
def _maker(kind: str) -> Callable:
    """Of a message that holds no others, its class."""
    from rosbags.interfaces import Nodetype

    made, makers = typestore().types[kind], []
    for _, (node, what) in typestore().fielddefs[kind][1]:
        node, what = what[0] if node in (Nodetype.ARRAY, Nodetype.SEQUENCE) else (node, what)
        makers.append(_maker(what) if node == Nodetype.NAME else None)
    if not any(makers):
        return made

    def of(*values: Any) -> Any:
        parts = []
        for maker, value in zip(makers, values, strict=True):
            if maker and isinstance(value, list):
                value = [maker(*each) for each in value]
            parts.append(maker(*value) if maker and isinstance(value, tuple) else value)
        return made(*parts)

    return of


def stamp_of(message: Any) -> int | None:
    """The header stamp of a message, ns; None where it has none."""
    header = getattr(message, 'header', None)
    stamp_ns = 0 if header is None else header.stamp.sec * SECOND_NS + header.stamp.nanosec
    return stamp_ns or None


def frame_tree(message: Any) -> FrameTree:
    """Parent and orientation of each frame in a tf2_msgs/TFMessage, or in whatever has its fields."""
    frames: dict[str, tuple[str, Quaternion]] = {}
    for each in message.transforms:
        turn = each.transform.rotation
        parts = float(turn.x), float(turn.y), float(turn.z), float(turn.w)
        frames[each.child_frame_id.lstrip('/')] = each.header.frame_id.lstrip('/'), parts
    return frames


def header(stamp_ns: int, frame_id: str) -> tuple:
    """The fields of a std_msgs/Header."""
    return divmod(int(stamp_ns), SECOND_NS), frame_id


class Template:
    """A serialised message in which only the stamp and ``count`` doubles are replaced, in the order of its fields.
    Filling one costs 5 us, serialising it 20 us to 1 ms.
    """

    def __init__(self, message_of: Callable[[np.ndarray], Any], count: int) -> None:
        marks = 1e300 * (1.0 + 1e-6 * np.arange(count))
        self._raw = bytearray(serialised(message_of(marks)))
        # CDR places doubles at multiples of eight bytes, counted from behind the encapsulation header
        size = (len(self._raw) - ENCAPSULATION_BYTES) // FLOAT64_BYTES
        self._doubles = np.frombuffer(self._raw, '<f8', size, ENCAPSULATION_BYTES)
        self._places = np.flatnonzero(np.isin(self._doubles, marks))
        self._begin = ENCAPSULATION_BYTES + FLOAT64_BYTES * int(self._places[0] if count else 0)
        are_together = not count or self._places[-1] - self._places[0] == count - 1
        # a third of the time of an assignment to an array
        self._together = Struct(f'<{count}d') if are_together else None

    def filled(self, stamp_ns: int, values: Any) -> bytes:
        """The message's bytes with this stamp and these doubles."""
        _STAMP.pack_into(self._raw, ENCAPSULATION_BYTES, *divmod(stamp_ns, SECOND_NS))
        if self._together is None:
            self._doubles[self._places] = values
        else:
            self._together.pack_into(self._raw, self._begin, *values)
        return bytes(self._raw)


class ImuMessage:
    """The sensor_msgs/Imu messages of one sender."""

    def __init__(self, frame_id: str) -> None:
        self._template = Template(
            lambda v: make(
                IMU,
                header(0, frame_id),
                tuple(v[ORIENTATION]),
                v[ORIENTATION_COVARIANCE],
                tuple(v[RATES]),
                v[RATES_COVARIANCE],
                tuple(v[FORCE]),
                v[FORCE_COVARIANCE],
            ),
            IMU_VALUES,
        )

    def of_values(self, stamp_ns: int, values: Any) -> bytes:
        """The message of a stamp and 37 numbers in the order of the message definition."""
        return self._template.filled(stamp_ns, values)


def imu_reading(message: Any) -> ImuReading:
    """The `ImuReading` of a sensor_msgs/Imu."""
    turn, rates, force = message.orientation, message.angular_velocity, message.linear_acceleration
    return ImuReading(
        stamp_ns(message.header.stamp),
        (turn.x, turn.y, turn.z, turn.w),
        message.orientation_covariance.tolist(),
        (rates.x, rates.y, rates.z),
        message.angular_velocity_covariance.tolist(),
        (force.x, force.y, force.z),
        message.linear_acceleration_covariance.tolist(),
    )


def stamp_ns(stamp: Any) -> int:
    """A builtin_interfaces/Time in nanoseconds."""
    return stamp.sec * SECOND_NS + stamp.nanosec


def raw_stamp_ns(raw: bytes) -> int:
    """The stamp, in nanoseconds, of a serialised message that begins with a header, without reading the rest."""
    seconds, rest = _STAMP.unpack_from(raw, ENCAPSULATION_BYTES)
    return seconds * SECOND_NS + rest


def trajectory_point(
    time_ns: int, positions: ArrayLike = (), velocities: ArrayLike = (), accelerations: ArrayLike = ()
) -> tuple:
    """The fields of a trajectory_msgs/JointTrajectoryPoint without efforts."""
    arrays = [np.asarray(part, dtype=float) for part in (positions, velocities, accelerations, ())]
    return *arrays, divmod(time_ns, SECOND_NS)


def trajectory_values(message: Any) -> tuple[int, list[int], list[str], list[float]]:
    """Stamp and times from it, ns, columns, and the positions of each time in turn, of a JointTrajectory.

    Raises:
        InputError: A time has another number of positions than there are columns.
    """
    columns = list(message.joint_names)
    for point in message.points:
        if len(point.positions) != len(columns):
            raise InputError(f'a time has {len(point.positions)} positions for {len(columns)} names: send one for each')
    times_ns = [stamp_ns(point.time_from_start) for point in message.points]
    return stamp_ns(message.header.stamp), times_ns, columns, [v for point in message.points for v in point.positions]


def window_message(table: MotionTable, frame_id: str) -> bytes:
    """The sensor_msgs/PointCloud2 of a `MotionTable`: one row for each sample."""
    mounting = None if table.installation is None else table.installation.mounting
    of_sensor = np.tile((nan, nan, nan) if mounting is None else mounting, (len(table.rows), 1))
    rows = np.column_stack([table.rows, _marks(table), of_sensor]).astype('<f8')
    size = FLOAT64_BYTES * len(WINDOW_COLUMNS)
    float64 = typestore().types['sensor_msgs/msg/PointField'].FLOAT64
    fields = [(name, FLOAT64_BYTES * place, float64, 1) for place, name in enumerate(WINDOW_COLUMNS)]
    data, is_dense = rows.view(np.uint8).ravel(), bool(np.isfinite(rows).all())
    head = header(table.stamp_ns, frame_id)
    return serialised(
        make(TYPES[WINDOW_TOPIC], head, 1, len(rows), fields, False, size, size * len(rows), data, is_dense)
    )


#: s; a longer step within a window is no pause: imu_buffer holds at most as much (its parameter window_s).
LONGEST_WINDOW = 3600.0


def _marks(table: MotionTable) -> np.ndarray:
    """The values of the column that marks a decay."""
    marks, noticed = np.zeros(len(table.rows)), table.noticed
    if noticed is not None:
        inside = (table.rows[:, 0] >= noticed.start) & (table.rows[:, 0] <= noticed.end)
        marks[inside] = 1 + AXES.index(noticed.axis)
    return marks


def _noticed(stamps: np.ndarray, marks: np.ndarray) -> NoticedDecay | None:
    """The decay that the last column marks."""
    for number, axis in enumerate(AXES, 1):
        marked = stamps[marks == number]
        if marked.size:
            return NoticedDecay(axis, float(marked[0]), float(marked[-1]))
    return None


def window_table(message: Any) -> MotionTable:
    """The `MotionTable` of a sensor_msgs/PointCloud2, whatever order its columns have."""
    fields = {field.name: field for field in message.fields}
    order = '>' if message.is_bigendian else '<'
    count = message.width * message.height
    float64 = typestore().types['sensor_msgs/msg/PointField'].FLOAT64
    for name in WINDOW_COLUMNS:
        if name not in fields or fields[name].datatype != float64:
            raise InputError(f'the window has no FLOAT64 column {name}: publish the table that imu_buffer publishes')
        if fields[name].offset + FLOAT64_BYTES > message.point_step:
            raise InputError(f'the column {name} of the window reaches beyond its rows: check point_step and offsets')
    if len(message.data) < count * message.point_step:
        raise InputError(f'the window has {len(message.data)} of {count * message.point_step} bytes: send it again')
    layout = np.dtype(
        {
            'names': WINDOW_COLUMNS,
            'formats': [f'{order}f8'] * len(WINDOW_COLUMNS),
            'offsets': [fields[name].offset for name in WINDOW_COLUMNS],
            'itemsize': message.point_step,
        }
    )
    table = np.frombuffer(memoryview(message.data), dtype=layout, count=count)
    *columns, marks, roll, pitch, yaw = (table[name].astype(float) for name in WINDOW_COLUMNS)
    _check_stamps(columns[0])
    mounting = (roll[0], pitch[0], yaw[0]) if count and np.isfinite((roll[0], pitch[0], yaw[0])).all() else None
    installation, noticed = Installation('flu', mounting), _noticed(columns[0], marks)
    return MotionTable(np.stack(columns, axis=1), stamp_ns(message.header.stamp), noticed, installation)


def text_message(text: str) -> bytes:
    """A std_msgs/String."""
    return serialised(make(STRING, text))


def number_message(value: float, kind: str = 'std_msgs/msg/Float64') -> bytes:
    """A std_msgs/Float64, or Float32."""
    return serialised(make(kind, float(value)))


def coefficients_message(models: Mapping[str, IdentifiedModel]) -> bytes:
    """The std_msgs/Float64MultiArray of models by axis, with the labels of rows and columns."""
    rows, values = coefficients(models)
    columns = len(COEFFICIENT_NAMES)
    dimensions = [(','.join(rows), len(rows), values.size), (','.join(COEFFICIENT_NAMES), columns, columns)]
    return serialised(make('std_msgs/msg/Float64MultiArray', (dimensions, 0), values.ravel()))


def named_numbers_message(values: Mapping[str, float]) -> bytes:
    """A std_msgs/Float32MultiArray of named numbers, with their names in its only dimension."""
    numbers = np.array([*values.values()], '<f4')
    return _before_named_numbers(tuple(values)) + numbers.tobytes()


@lru_cache
def _before_named_numbers(names: tuple[str, ...]) -> bytes:
    dimension = ','.join(names), len(names), len(names)
    whole = make('std_msgs/msg/Float32MultiArray', ([dimension], 0), np.zeros(len(names), np.float32))
    return serialised(whole)[: -whole.data.nbytes or None]


def diagnostics_message(
    stamp_ns: int, statuses: Iterable[tuple[int, str, str, Mapping[str, str]]], hardware_id: str = ''
) -> bytes:
    """A diagnostic_msgs/DiagnosticArray of level, name, message and values of each status, all of one hardware id."""
    plain = [(level, name, said, hardware_id, list(values.items())) for level, name, said, values in statuses]
    return serialised(make('diagnostic_msgs/msg/DiagnosticArray', header(stamp_ns, ''), plain))


def told_installation(message: Any, topic: str) -> Installation | None:
    """Frame and mounting of the sensor on a topic, as a diagnostic_msgs/DiagnosticArray of imu_buffer states them."""
    for status in message.status:
        said = {each.key: each.value for each in status.values}
        if said.get('topic', '').strip('/') == topic.strip('/') and said.get('frame') in FRAMES:
            angles = re.fullmatch(','.join([r'(-?\d+(?:\.\d+)?)'] * 3), said.get(MOUNTING, ''))
            roll, pitch, yaw = map(radians, map(float, angles.groups())) if angles else (nan, nan, nan)
            return Installation(said['frame'], (roll, pitch, yaw) if angles else None)
    return None


def _check_stamps(stamps: np.ndarray) -> None:
    """Raise `InputError` unless the stamps of a window, s, are those of motion; the check sizes no array by them."""
    steps = np.diff(stamps)
    missing, late = np.count_nonzero(~np.isfinite(stamps)), np.count_nonzero(steps <= 0.0)
    if missing:
        found = f'{missing} of {stamps.size} rows of the window have no stamp'
    elif late:
        found = f'{late} of {stamps.size} rows of the window are not later than the previous row'
    elif steps.size and steps.max() > LONGEST_WINDOW:
        found = f'the stamps of the window jump by {steps.max():.3g} s'
    else:
        return
    raise InputError(f'{found}: fill its column t with increasing times in s, as imu_buffer does')
