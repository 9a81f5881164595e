"""Rosbag2 records of manoeuvres: odometry, IMU, and thrusters as VRX names them or as a JointState."""

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.attitude.motion.attitude import euler_angles, quaternion
from swath_sysid.attitude.motion.cleaning import ACCEL
from swath_sysid.attitude.motion.intake import NOT_MEASURED
from swath_sysid.attitude.motion.sensor_checks import TILT_CODES, contradictions_in
from swath_sysid.common.account import Loss, in_words
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats import messages
from swath_sysid.formats.bags import ImuRecord, chosen_topic, intact_messages, opened_bag, read_imu
from swath_sysid.formats.messages import SECOND_NS
from swath_sysid.formats.output_bag import writing_bag, writing_output_bag
from swath_sysid.formats.topics import IMU, ODOMETRY, lead_topic
from swath_sysid.manoeuvring.formats.messages import odometry_message, odometry_reading, path_message
from swath_sysid.manoeuvring.formats.topics import LEADS, PATH, PATH_TOPIC
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre
from swath_sysid.manoeuvring.motion.resampling import LONGEST_GAP
from swath_sysid.manoeuvring.motion.trial import COMMAND, FORCE, MEASURED, ManoeuvringTrial
from swath_sysid.manoeuvring.motion.window import LARGEST_COMMAND
from swath_sysid.manoeuvring.prediction.pipeline import (
    ManoeuvreOutlook,
    ManoeuvreOutlookSettings,
    ManoeuvreState,
    OdometryReading,
    OutlookStep,
)
from swath_sysid.pipeline.health import LARGEST_STAMP_AGE

Series = tuple[np.ndarray, np.ndarray]  #: Times, s, and values.

JOINTS = 'sensor_msgs/msg/JointState'
NUMBERS = ('std_msgs/msg/Float64', 'std_msgs/msg/Float32')
SIDES = {'port': re.compile(r'left|port', re.I), 'starboard': re.compile(r'right|starboard|stbd', re.I)}
THRUSTER = re.compile('thrust|thruster|motor|cmd|command|prop|drive', re.I)

SEVERAL = 'several-topics'  #: The code of what is asked for by naming topics.

TWIST_SPAN = 3.0  #: s over which velocity and change of position are compared.


def read_manoeuvring_bag(
    path: str | Path,
    odometry: str | None = None,
    imu: str | None = None,
    port: str | None = None,
    starboard: str | None = None,
    thrust_input: str | None = None,
    frame: str | None = None,
    mounting: tuple[float, float, float] | None = None,
) -> ManoeuvringTrial:
    """Read a manoeuvre from a bag folder or a single .mcap or .db3 file; topics may be named where several fit. Pose
    and twist come from nav_msgs/Odometry (pose in ENU, twist in body axes x forward, y to port), yaw rate from
    sensor_msgs/Imu where there is one, thrust from two std_msgs/Float64 (or Float32) topics with left or port, right or
    starboard in their names, or from a sensor_msgs/JointState with two such joints (effort, else velocity). Values
    within -1 and 1 are commands unless ``thrust_input`` is given. Frame and mounting of the IMU: see `read_trial`.
    """
    path = Path(path)
    with opened_bag(path) as (readers, losses):
        roles = {'odometry': chosen_topic(path, readers, ODOMETRY, odometry, SEVERAL)}
        roles |= _thruster_topics(path, readers, port, starboard)
        has_imu = bool(imu or _topics(readers, IMU))
        imu = chosen_topic(path, readers, IMU, imu, SEVERAL) if has_imu else None
        tables = _read(path, readers, roles, losses)
    advice = [*in_words(losses, path)]
    if has_imu:
        tables['imu'], more = _yaw_rates(read_imu(path, imu), frame, mounting, path)
        advice = [*dict.fromkeys([*advice, *more])]
    offset = _clock_offset(tables['odometry'], path, advice)
    series = {role: (_times(table, offset), table[:, 2:]) for role, table in tables.items()}
    sides, effort = _thrust(series, path)
    time, left, right = _together(*sides)
    if thrust_input is None:
        most = max(np.max(np.abs(left), initial=0.0), np.max(np.abs(right), initial=0.0))
        thrust_input = FORCE if effort or most > LARGEST_COMMAND else COMMAND
        if thrust_input == COMMAND:
            advice.append(Advice.of('taken-as-commands', path=path))
    stamps, pose = series['odometry']
    channels = {name: (stamps, values) for name, values in _motion(pose, stamps, path, advice).items()}
    if has_imu and series['imu'][0].size:
        channels['yaw_rate'] = series['imu'][0], series['imu'][1][:, 0]
    channels |= {'port': (time, left), 'starboard': (time, right)}
    everything = np.unique(np.concatenate([times for times, _ in channels.values()]))
    found: dict[str, Any] = {name: np.full(everything.size, np.nan) for name in channels}
    for name, (times, values) in channels.items():
        found[name][np.searchsorted(everything, times)] = values
    time = everything - everything[0]
    return ManoeuvringTrial(
        time, thrust_input=thrust_input, **found, frame='enu', source=str(path), advice=tuple(advice)
    )


def holds_manoeuvres(path: str | Path) -> tuple[bool, bool]:
    """Whether a bag holds odometry and thrust, and whether it holds an IMU."""
    with opened_bag(path) as (readers, _):
        numbers = _topics(readers, *NUMBERS)
        thrust = all(any(p.search(t) and THRUSTER.search(t) for t in numbers) for p in SIDES.values())
        return bool(_topics(readers, ODOMETRY) and (thrust or _topics(readers, JOINTS))), bool(_topics(readers, IMU))


def write_manoeuvring_bag(path: str | Path, manoeuvre: Manoeuvre, *, start_stamp_ns: int = 0) -> None:
    """Write a simulated manoeuvre with the topics of VRX; path and stamp are those of `write_imu_bag`."""
    m = manoeuvre
    imu = messages.ImuMessage('wamv/imu_link')
    unknown = np.zeros((3, 3))
    sides = [(f'/wamv/thrusters/{side}/thrust', thrust) for side, thrust in (('left', m.port), ('right', m.starboard))]
    with writing_bag(path) as add:
        for k, t in enumerate((m.time - m.time[0]).tolist()):
            stamp = int(start_stamp_ns) + round(t * 1e9)
            motion = {name: float(getattr(m, name)[k]) for name in MEASURED}
            state = ManoeuvreState(t, **motion, pose_covariance=unknown, twist_covariance=unknown)
            for topic, thrust in sides:
                add(topic, NUMBERS[0], stamp, messages.number_message(thrust[k]))
            odometry = odometry_message(state, 'odom', 'wamv/base_link', stamp)
            add('/wamv/odometry', ODOMETRY, stamp, odometry)
            values = np.zeros(messages.IMU_VALUES)
            values[messages.ORIENTATION] = quaternion(0.0, 0.0, state.heading)
            values[messages.RATES] = 0.0, 0.0, state.yaw_rate
            values[messages.FORCE_COVARIANCE.start] = NOT_MEASURED
            add('/wamv/sensors/imu/imu/data', IMU, stamp, imu.of_values(stamp, values))


def _topics(readers: Sequence[Any], *kinds: str) -> list[str]:
    return sorted({c.topic for reader in readers for c in reader.connections if c.msgtype in kinds})


def _thruster_topics(path: Path, readers: Sequence[Any], *given: str | None) -> dict[str, str]:
    """The topics of both sides, or of a JointState."""
    numbers = _topics(readers, *NUMBERS)
    chosen: dict[str, str] = {}
    for (side, pattern), name in zip(SIDES.items(), given, strict=True):
        if name is not None and name not in numbers:
            raise InputError(f'{path} has no topic {name} of {NUMBERS[0]}: it has {", ".join(numbers) or "none"}')
        found = [name] if name else [t for t in numbers if pattern.search(t) and THRUSTER.search(t)]
        # a thruster may have an angle topic (.../pos) beside its thrust
        found = [t for t in found if not re.search(r'(pos|angle|position)$', t)] or found
        if len(found) > 1:
            raise InputError(f'{path} has several {side} thruster topics ({", ".join(found)}): choose one', SEVERAL)
        chosen |= dict.fromkeys([side] * len(found), *found)
    if len(chosen) == len(SIDES):
        return chosen
    if _topics(readers, JOINTS):
        return {'joints': chosen_topic(path, readers, JOINTS, None)}
    raise InputError(
        f'{path} has no thrust of both sides: looked for two topics of {NUMBERS[0]} with left or port and '
        f'right or starboard in their names, or one of {JOINTS}; name the topics',
        SEVERAL,
    )


def _read(path: Path, readers: Sequence[Any], roles: dict[str, str], losses: list[Loss]) -> dict[str, np.ndarray]:
    """By role the rows of its messages: stamp (NaN without a header) and time of arrival, s, and numbers."""
    store = messages.typestore()
    rows: dict[str, list[tuple]] = {topic: [] for topic in roles.values()}
    damaged = 0
    for connection, received, raw in intact_messages(path, readers, rows, losses):
        try:
            message = store.deserialize_cdr(raw, connection.msgtype)
            numbers = _numbers(message, connection.msgtype)
        except InputError:
            raise
        except Exception:  # the library raises whatever a broken byte leads it to; counted and reported below
            damaged += 1
            continue
        header = getattr(message, 'header', None)
        stamp = np.nan if header is None else messages.stamp_ns(header.stamp) / messages.SECOND_NS
        rows[connection.topic].append((stamp, received / messages.SECOND_NS, *numbers))
    losses.append(Loss('damaged-messages', damaged, damaged + sum(map(len, rows.values()))))
    empty = next((topic for topic, found in rows.items() if not found), None)
    if empty is not None:
        raise InputError(f'{path} holds no readable message on {empty}: record it again')
    return {role: np.array(rows[topic], dtype=float) for role, topic in roles.items()}


def _yaw_rates(
    record: ImuRecord, frame: str | None, mounting: tuple[float, float, float] | None, path: Path
) -> tuple[np.ndarray, list[Advice]]:
    """Rows as of `_read` with the rate about the craft's z axis, and advice; a sensor on its side is rejected."""
    installation, (orientation, rates, force) = record.installation(frame, mounting), record.measured
    # gravity where there is no attitude: a driver that reverses its sign does not turn the rates
    channels = dict(zip(ACCEL, installation.vector(*force.T), strict=True))
    if not np.isnan(orientation).all():
        channels = dict(zip(('roll', 'pitch'), euler_angles(*installation.orientation(*orientation.T)), strict=False))
    found = contradictions_in((record.stamps - record.stamps[0]) / SECOND_NS, channels, installation)
    for each in found:
        if each.code in ('sensor-turned', 'axes-of-sensor'):
            raise InputError(f'{path} {record.topic}: {each.message}', each.code)
    turning = installation.vector(*rates.T)[2]
    table = np.column_stack([record.stamps / SECOND_NS, np.asarray(record.received) / SECOND_NS, turning])
    return table[np.isfinite(turning)], [*record.advice, *(each for each in found if each.code in TILT_CODES)]


def _numbers(message: Any, msgtype: str) -> tuple[float, ...]:
    if msgtype == ODOMETRY:
        reading = odometry_reading(message)
        return tuple(getattr(reading, name) for name in MEASURED)
    if msgtype == JOINTS:
        effort = len(message.effort) == len(message.name)
        source = message.effort if effort else message.velocity
        return *(float(source[k]) for k in _joints(tuple(message.name))), float(effort)
    return (float(message.data),)


@cache
def _joints(names: tuple[str, ...]) -> list[int]:
    places = []
    for side, pattern in SIDES.items():
        found = [k for k, name in enumerate(names) if pattern.search(name)]
        if len(found) != 1:
            raise InputError(
                f'the joints {", ".join(names)} hold {len(found)} for the {side} thruster: record a JointState with '
                f'one joint per thruster, left or port and right or starboard'
            )
        places += found
    return places


def _clock_offset(odometry: np.ndarray, path: Path, advice: list[Advice]) -> float | None:
    """Offset from times of arrival to header stamps, s; None: use arrival throughout."""
    stamps, received = odometry[:, 0], odometry[:, 1]
    difference = stamps - received
    if not np.all(np.isfinite(difference)) or np.ptp(stamps) == 0.0:
        return None
    if np.ptp(difference) > LARGEST_STAMP_AGE:
        advice.append(Advice.of('clocks-apart', path=path))
        return None
    # the least delayed messages give the offset of the clocks
    return float(np.quantile(difference, 0.9))


def _times(table: np.ndarray, offset: float | None) -> np.ndarray:
    stamps, received = table[:, 0], table[:, 1]
    if offset is None:
        return received
    return stamps if np.all(np.isfinite(stamps)) else received + offset


def _thrust(series: dict[str, Series], path: Path) -> tuple[tuple[Series, Series], bool]:
    """The series of both sides, and whether they are efforts."""
    if 'joints' not in series:
        port, starboard = ((series[side][0], series[side][1][:, 0]) for side in SIDES)
        return (port, starboard), False
    clock, table = series['joints']
    effort = bool(table[:, 2].all())
    values = table[:, :2] if effort else table[:, :2] / max(np.max(np.abs(table[:, :2])), 1e-9)
    return ((clock, values[:, 0]), (clock, values[:, 1])), effort


def _together(port: Series, starboard: Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Both thrusters at every message of either, the other held."""
    time = np.unique(np.concatenate([port[0], starboard[0]]))
    held = []
    for clock, values in (port, starboard):
        order = np.argsort(clock, kind='stable')
        clock, values = clock[order], values[order]
        last = np.searchsorted(clock, time, side='right') - 1
        age = time - clock[np.maximum(last, 0)]
        held.append(np.where((last >= 0) & (age <= LONGEST_GAP), values[np.maximum(last, 0)], np.nan))
    known = np.isfinite(held[0]) & np.isfinite(held[1])
    return time[known], held[0][known], held[1][known]


def _motion(values: np.ndarray, time: np.ndarray, path: str | Path, advice: list[Advice]) -> dict[str, np.ndarray]:
    """Channels of the odometry; a twist in world axes is turned into body axes."""
    surge, sway, rate, yaw, x, y = values.T
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


def play_manoeuvres(
    trial: ManoeuvringTrial, settings: ManoeuvreOutlookSettings, identified: IdentifiedManoeuvringModel | None = None
) -> Iterator[tuple[float, OutlookStep]]:
    """Times and forecasts for the trial of a bag, in ENU, as the live node makes them; same trial, same numbers."""
    names = ('x', 'y', 'heading', 'surge', 'sway')
    missing = [name for name in (*names, 'yaw_rate') if getattr(trial, name) is None]
    if missing:
        raise InputError(f'{trial.source} lacks {", ".join(missing)}: play a bag with odometry through')
    if identified is not None and identified.model.thrust_input != trial.thrust_input:
        raise InputError(
            f'{trial.source} holds thrust as {trial.thrust_input}, the model takes '
            f'{identified.model.thrust_input}: state it if that was mistaken',
            'thrust-input-differs',
        )
    outlook = ManoeuvreOutlook(settings, identified)
    rate, yaw_rate = np.nan, np.asarray(trial.yaw_rate)
    for k, stamp in enumerate(trial.time.tolist()):
        for side in ('port', 'starboard'):
            value = float(getattr(trial, side)[k])
            if np.isfinite(value):
                outlook.add_thrust(stamp, side, value)
        if np.isfinite(yaw_rate[k]):
            rate = float(yaw_rate[k])
            outlook.add_yaw_rate(stamp, rate)
        motion = {name: float(getattr(trial, name)[k]) for name in names}
        if np.all(np.isfinite([*motion.values(), rate])):
            step = outlook.add_odometry(OdometryReading(stamp, **motion, yaw_rate=rate, std={}))
            if step.path:
                yield stamp, step


def write_forecasts(path: str | Path, forecasts: Iterable[tuple[float, OutlookStep]], leads: Sequence[float]) -> int:
    """Write forecasts, each with its stamp, s, as mcap on the topics of manoeuvring_predictor; returns their number."""
    count = 0
    with writing_output_bag(path) as bag:
        for stamp, step in forecasts:
            count += 1
            time_ns = round(stamp * SECOND_NS)
            bag.add(PATH_TOPIC, time_ns, path_message(step.path, stamp, 'odom'), PATH)
            for lead, state in zip(leads, step.leads, strict=True):
                raw = odometry_message(state, 'odom', 'base_link')
                bag.add(lead_topic(lead, LEADS), time_ns, raw, ODOMETRY)
    return count
