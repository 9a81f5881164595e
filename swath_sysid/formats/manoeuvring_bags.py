"""Rosbag2 records of manoeuvres: odometry, IMU, and thrusters as VRX names them or as a JointState."""

import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.attitude.motion.attitude import quaternion
from swath_sysid.attitude.motion.intake import NOT_MEASURED
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import opened_bag
from swath_sysid.formats.manoeuvring_messages import odometry_message, odometry_reading
from swath_sysid.formats.messages import (
    FORCE_COVARIANCE,
    IMU_VALUES,
    ORIENTATION,
    RATES,
    ImuMessage,
    number_message,
    typestore,
)
from swath_sysid.formats.output_bag import writing_bag
from swath_sysid.formats.topics import IMU, ODOMETRY
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre
from swath_sysid.manoeuvring.motion.trial import COMMAND, FORCE, ManoeuvringTrial
from swath_sysid.manoeuvring.motion.window import LARGEST_COMMAND
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreState

Table = dict[str, np.ndarray]
Series = tuple[np.ndarray, np.ndarray]  #: Times, s, and values.

JOINTS = 'sensor_msgs/msg/JointState'
NUMBERS = ('std_msgs/msg/Float64', 'std_msgs/msg/Float32')
SIDES = {'port': re.compile(r'left|port', re.I), 'starboard': re.compile(r'right|starboard|stbd', re.I)}
THRUSTER = re.compile('thrust|thruster|motor|cmd|command|prop|drive', re.I)

MOTION = ('x', 'y', 'heading', 'surge', 'sway', 'yaw_rate')

CLOCKS_APART = 1.0  #: s by which header stamps may drift against times of arrival.
SAME_TIME = 3  #: Decimals, s, within which two messages are simultaneous.
TWIST_SPAN = 3.0  #: s over which velocity and change of position are compared.
LONGEST_HOLD = 1.0  #: s for which one thruster's last message holds beside the other's.


def read_manoeuvring_bag(
    path: str | Path,
    odometry: str | None = None,
    imu: str | None = None,
    port: str | None = None,
    starboard: str | None = None,
    thrust_input: str | None = None,
) -> ManoeuvringTrial:
    """Read a manoeuvre from a bag folder or a single .mcap or .db3 file; topics may be named where several fit.

    Pose and twist come from nav_msgs/Odometry (pose in ENU, twist in body axes x forward, y to port), yaw rate from
    sensor_msgs/Imu where there is one, thrust from two std_msgs/Float64 (or Float32) topics with left or port, right or
    starboard in their names, or from a sensor_msgs/JointState with two such joints (effort, else velocity). Values
    within -1 and 1 are commands unless ``thrust_input`` is given.
    """
    path = Path(path)
    with opened_bag(path) as (readers, advice):
        advice = list(advice)
        chosen = _choose(path, _topics_by_type(readers), odometry, imu, port, starboard)
        tables = _read(path, readers, set(chosen.values()), advice)
    pose = tables[chosen['odometry']]
    offset = _clock_offset(pose, path, advice)
    shifted = {topic: _times(table, offset) for topic, table in tables.items()}
    sides, effort = _thrust(chosen, tables, shifted, path)
    time, left, right = _together(*sides)
    most = max(np.max(np.abs(left), initial=0.0), np.max(np.abs(right), initial=0.0))
    if thrust_input is None:
        thrust_input = FORCE if effort or most > LARGEST_COMMAND else COMMAND
        if thrust_input == COMMAND:
            advice.append(Advice.of('taken-as-commands', path=path))
    motion = _motion(pose['values'], shifted[chosen['odometry']], path, advice)
    series = {name: (shifted[chosen['odometry']], values) for name, values in motion.items()}
    if 'imu' in chosen and tables[chosen['imu']]['values'].size:
        series['yaw_rate'] = (shifted[chosen['imu']], tables[chosen['imu']]['values'][:, 0])
    start = min(time[0], *(t[0] for t, _ in series.values()))
    series = {name: (np.round(t - start, SAME_TIME), values) for name, (t, values) in series.items()}
    time = np.round(time - start, SAME_TIME)
    everything = np.unique(np.concatenate([time, *(t for t, _ in series.values())]))

    def on_all(times: np.ndarray, values: np.ndarray) -> np.ndarray:
        found = np.full(everything.size, np.nan)
        found[np.searchsorted(everything, times)] = values
        return found

    channels: dict[str, Any] = {name: on_all(times, values) for name, (times, values) in series.items()}
    return ManoeuvringTrial(
        everything,
        on_all(time, left),
        on_all(time, right),
        thrust_input,
        **channels,
        frame='enu',
        source=str(path),
        advice=tuple(advice),
    )


def holds_manoeuvres(path: str | Path) -> tuple[bool, bool]:
    """Whether a bag holds odometry and thrust, and whether it holds an IMU."""
    path = Path(path)
    with opened_bag(path) as (readers, _):
        topics = _topics_by_type(readers)
    numbers = set().union(*(topics.get(kind, set()) for kind in NUMBERS))
    sides = all(any(p.search(t) and THRUSTER.search(t) for t in numbers) for p in SIDES.values())
    return bool(topics.get(ODOMETRY) and (sides or topics.get(JOINTS))), bool(topics.get(IMU))


def write_manoeuvring_bag(path: str | Path, manoeuvre: Manoeuvre, *, start_stamp_ns: int = 0) -> None:
    """Write a simulated manoeuvre with the topics of VRX; path and stamp as for
    `swath_sysid.formats.bags.write_imu_bag`. Topics are ``/wamv/thrusters/left/thrust`` and ``right/thrust``
    (std_msgs/Float64, the inputs), ``/wamv/odometry`` (nav_msgs/Odometry) and ``/wamv/sensors/imu/imu/data``
    (sensor_msgs/Imu).
    """
    m = manoeuvre
    imu = ImuMessage('wamv/imu_link')
    unknown = np.zeros((3, 3))
    sides = [(f'/wamv/thrusters/{side}/thrust', thrust) for side, thrust in (('left', m.port), ('right', m.starboard))]
    with writing_bag(path) as add:
        for k, t in enumerate((m.time - m.time[0]).tolist()):
            stamp = int(start_stamp_ns) + round(t * 1e9)
            motion = {name: float(getattr(m, name)[k]) for name in MOTION}
            state = ManoeuvreState(t, **motion, pose_covariance=unknown, twist_covariance=unknown)
            for topic, thrust in sides:
                add(topic, NUMBERS[0], stamp, number_message(thrust[k]))
            odometry = odometry_message(state, 'odom', 'wamv/base_link', stamp)
            add('/wamv/odometry', ODOMETRY, stamp, odometry)
            values = np.zeros(IMU_VALUES)
            values[ORIENTATION] = quaternion(0.0, 0.0, state.heading)
            values[RATES] = 0.0, 0.0, state.yaw_rate
            values[FORCE_COVARIANCE.start] = NOT_MEASURED
            add('/wamv/sensors/imu/imu/data', IMU, stamp, imu.of_values(stamp, values))


def _topics_by_type(readers: Sequence[Any]) -> dict[str, set[str]]:
    topics: dict[str, set[str]] = {}
    for connection in (connection for reader in readers for connection in reader.connections):
        topics.setdefault(connection.msgtype, set()).add(connection.topic)
    return topics


def _choose(
    path: str | Path,
    topics: dict[str, set[str]],
    odometry: str | None,
    imu: str | None,
    port: str | None,
    starboard: str | None,
) -> dict[str, str]:
    """Topic of each role."""
    chosen = {'odometry': _only(path, topics.get(ODOMETRY, set()), odometry, ODOMETRY)}
    if imu or topics.get(IMU):
        chosen['imu'] = _only(path, topics.get(IMU, set()), imu, IMU)
    numbers = set().union(*(topics.get(kind, set()) for kind in NUMBERS))
    for side, given in (('port', port), ('starboard', starboard)):
        if given is not None:
            if given not in numbers:
                raise InputError(f'{path} has no topic {given} of {NUMBERS[0]}: it has {_listed(numbers)}')
            chosen[side] = given
            continue
        found = [t for t in numbers if SIDES[side].search(t) and THRUSTER.search(t)]
        # a thruster may have an angle topic (.../pos) beside its thrust
        found = [t for t in found if not re.search(r'(pos|angle|position)$', t)] or found
        if len(found) > 1:
            raise InputError(
                f'{path} has several topics for the {side} thruster ({_listed(found)}): choose one', 'several-topics'
            )
        if found:
            chosen[side] = found[0]
    if 'port' in chosen and 'starboard' in chosen:
        return chosen
    if topics.get(JOINTS):
        chosen = {k: v for k, v in chosen.items() if k in ('odometry', 'imu')}
        chosen['joints'] = _only(path, topics[JOINTS], None, JOINTS)
        return chosen
    raise InputError(
        f'{path} has no thrust of both sides: looked for two topics of {NUMBERS[0]} with left or port and '
        f'right or starboard in their names, or one of {JOINTS}; name the topics',
        'several-topics',
    )


def _only(path: str | Path, topics: Collection[str], given: str | None, msgtype: str) -> str:
    if given is not None:
        if given not in topics:
            raise InputError(f'{path} has no topic {given} of {msgtype}: it has {_listed(topics)}')
        return given
    if not topics:
        raise InputError(f'{path} has no topic of {msgtype}: record one')
    if len(topics) > 1:
        raise InputError(f'{path} has several topics ({_listed(topics)}) of {msgtype}: choose one', 'several-topics')
    return next(iter(topics))


def _listed(topics: Collection[str]) -> str:
    return ', '.join(sorted(topics)) or 'none'


def _read(path: str | Path, readers: Sequence[Any], topics: Collection[str], advice: list[Advice]) -> dict[str, Table]:
    """Stamps (NaN without a header), times of arrival, s, and numbers of the messages of some topics."""
    store = typestore()
    rows: dict[str, list[tuple]] = {topic: [] for topic in topics}
    names: dict[str, list[int]] = {}
    damaged = 0
    for reader in readers:
        connections = [c for c in reader.connections if c.topic in topics]
        if not connections:
            continue
        for connection, received, raw in reader.messages(connections):
            try:
                message = store.deserialize_cdr(raw, connection.msgtype)
                numbers = _numbers(message, connection.msgtype, names)
            except InputError:
                raise
            except Exception:  # the library raises whatever a broken byte leads it to; counted and reported below
                damaged += 1
                continue
            header = getattr(message, 'header', None)
            stamp = np.nan if header is None else header.stamp.sec + 1e-9 * header.stamp.nanosec
            rows[connection.topic].append((stamp, 1e-9 * received, *numbers))
    if damaged:
        advice.append(Advice.of('damaged-messages: run', path=path, number=damaged))
    tables = {}
    for topic, found in rows.items():
        if not found:
            raise InputError(f'{path} holds no readable message on {topic}: record it again')
        table = np.array(found, dtype=float)
        tables[topic] = {'stamps': table[:, 0], 'received': table[:, 1], 'values': table[:, 2:]}
    return tables


def _numbers(message: Any, msgtype: str, names: dict[str, list[int]]) -> tuple[float, ...]:
    if msgtype == ODOMETRY:
        reading = odometry_reading(message)
        return tuple(getattr(reading, name) for name in MOTION)
    if msgtype == IMU:
        return (message.angular_velocity.z,)
    if msgtype == JOINTS:
        places = names.get('joints')
        if places is None:
            places = names['joints'] = _joints(message)
        source = message.effort if len(message.effort) == len(message.name) else message.velocity
        return *(float(source[k]) for k in places), float(source is message.effort)
    return (float(message.data),)


def _joints(message: Any) -> list[int]:
    places = []
    for side, pattern in SIDES.items():
        found = [k for k, name in enumerate(message.name) if pattern.search(name)]
        if len(found) != 1:
            held = ', '.join(message.name)
            raise InputError(
                f'the joints {held} hold {len(found)} for the {side} thruster: record a JointState with '
                f'one joint per thruster, left or port and right or starboard'
            )
        places += found
    return places


def _clock_offset(odometry: Table, path: str | Path, advice: list[Advice]) -> float | None:
    """Offset from times of arrival to header stamps, s; None: use arrival throughout."""
    difference = odometry['stamps'] - odometry['received']
    if not np.all(np.isfinite(difference)) or np.ptp(odometry['stamps']) == 0.0:
        return None
    if np.ptp(difference) > CLOCKS_APART:
        advice.append(Advice.of('clocks-apart', path=path))
        return None
    # the least delayed messages give the offset of the clocks
    return float(np.quantile(difference, 0.9))


def _times(table: Table, offset: float | None) -> np.ndarray:
    if offset is None:
        return table['received']
    stamps = table['stamps']
    return stamps if np.all(np.isfinite(stamps)) else table['received'] + offset


def _thrust(
    chosen: dict[str, str], tables: dict[str, Table], times: dict[str, np.ndarray], path: str | Path
) -> tuple[tuple[Series, Series], bool]:
    if 'joints' in chosen:
        table = tables[chosen['joints']]['values']
        if table.shape[1] != 3:
            raise InputError(f'{path}: {chosen["joints"]} holds neither effort nor velocity of two thrusters')
        effort = bool(table[:, 2].all())
        values = table[:, :2]
        if not effort:
            values = values / max(np.max(np.abs(values)), 1e-9)
        clock = times[chosen['joints']]
        return ((clock, values[:, 0]), (clock, values[:, 1])), effort
    port, starboard = ((times[chosen[s]], tables[chosen[s]]['values'][:, 0]) for s in SIDES)
    return (port, starboard), False


def _together(port: Series, starboard: Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Both thrusters at every message of either, the other held."""
    time = np.unique(np.concatenate([port[0], starboard[0]]))
    held = []
    for clock, values in (port, starboard):
        order = np.argsort(clock, kind='stable')
        clock, values = clock[order], values[order]
        last = np.searchsorted(clock, time, side='right') - 1
        age = time - clock[np.maximum(last, 0)]
        held.append(np.where((last >= 0) & (age <= LONGEST_HOLD), values[np.maximum(last, 0)], np.nan))
    known = np.isfinite(held[0]) & np.isfinite(held[1])
    return time[known], held[0][known], held[1][known]


def _motion(values: np.ndarray, time: np.ndarray, path: str | Path, advice: list[Advice]) -> dict[str, np.ndarray]:
    """Channels of the odometry; a twist in world axes is turned into body axes."""
    x, y, yaw, surge, sway, rate = values.T
    span = max(1, round(TWIST_SPAN / max(float(np.median(np.diff(time))), 1e-6))) if time.size > 1 else 1
    if time.size > 4 * span and np.ptp(x) + np.ptp(y) > 2.0:
        cosine, sine = np.cos(yaw), np.sin(yaw)

        def missed(east: np.ndarray, north: np.ndarray) -> float:
            """Median distance of the integrated velocity from the change of position."""
            way = [np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(time))]) for v in (east, north)]
            return np.median(
                np.hypot(*((w[span:] - w[:-span]) - (p[span:] - p[:-span]) for w, p in zip(way, (x, y), strict=True)))
            )

        body, world = missed(surge * cosine - sway * sine, surge * sine + sway * cosine), missed(surge, sway)
        if world < 0.5 * body:
            advice.append(Advice.of('twist-in-world-axes', path=path))
            surge, sway = surge * np.cos(yaw) + sway * np.sin(yaw), -surge * np.sin(yaw) + sway * np.cos(yaw)
    return {'x': x, 'y': y, 'heading': yaw, 'surge': surge, 'sway': sway, 'yaw_rate': rate}
