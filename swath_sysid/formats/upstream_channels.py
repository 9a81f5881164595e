"""Upstream channels of records and messages: any numeric column of a table, and some topics of a bag."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swath_sysid.attitude.motion.attitude import euler_angles
from swath_sysid.attitude.motion.intake import NOT_MEASURED
from swath_sysid.attitude.motion.vertical import vertical_acceleration
from swath_sysid.common.advice import did_you_mean
from swath_sysid.common.errors import InputError
from swath_sysid.formats.columns import DEVICE, read_table
from swath_sysid.formats.files import existing, reading, shown
from swath_sysid.formats.messages import SECOND_NS, imu_reading, stamp_of, typestore
from swath_sysid.formats.topics import IMU
from swath_sysid.formats.vocabulary import Quantity, plain_name
from swath_sysid.pipeline.record_run import UpstreamSeries

if TYPE_CHECKING:
    from swath_sysid.formats.bags import ImuRecord

#: Fields that may be an upstream channel, by message type; without a field the first, of an Imu all.
FIELDS = {
    'std_msgs/msg/Float64': ('data',),
    'sensor_msgs/msg/Range': ('range',),
    'geometry_msgs/msg/PointStamped': ('z', 'x', 'y'),
    IMU: ('roll', 'pitch', 'vertical_acceleration'),
}


def channels_of(entry: str, kind: str) -> dict[str, str]:
    """Name and field of each channel of ``topic`` or ``topic:field`` with messages of a type."""
    topic, _, field = entry.partition(':')
    known = FIELDS.get(kind, ())
    if not known or field and field not in known:
        held = f'no field {field}: choose of {", ".join(known)}' if known else f'type {kind}: give {", ".join(FIELDS)}'
        raise InputError(f"'{entry}' is no upstream channel, because its topic has {held}")
    if field:
        return {entry: field}
    return {f'{topic}:{each}': each for each in known} if kind == IMU else {entry: known[0]}


def kind_of(entry: str, published: Sequence[str]) -> str | None:
    """Message type of ``topic`` or ``topic:field``: one that is published on the topic, else the one with the field.
    None where neither tells it.
    """
    field = entry.partition(':')[2]
    kinds = [*published] or [kind for kind, fields in FIELDS.items() if field in fields]
    if field and not kinds:
        held = ', '.join(each for fields in FIELDS.values() for each in fields)
        raise InputError(f"'{entry}' is no upstream channel, because no type has a field {field}: choose of {held}")
    return next((kind for kind in kinds if kind in FIELDS), kinds[0] if kinds else None)


def field_value(message: Any, kind: str, field: str) -> float:
    """A field of `FIELDS` of a message; NaN where it was not measured."""
    if kind == IMU:
        sent = imu_reading(message)
        if sent.orientation_covariance[0] == NOT_MEASURED:
            return math.nan
        roll, pitch, _ = euler_angles(*map(float, sent.orientation))
        if field == 'vertical_acceleration':
            return float(vertical_acceleration(roll, pitch, np.array(sent.force)))
        return roll if field == 'roll' else pitch
    return float(getattr(message.point if kind.endswith('PointStamped') else message, field))


def read_upstream(
    path: str | Path, names: Sequence[str], *, topic: str | None = None, columns: Mapping[str, str] | None = None
) -> dict[str, UpstreamSeries]:
    """Read the upstream channels of a record, with the time of `read_trial`.

    Args:
        path: Of a file or a bag folder.
        names: Columns of the table, or topics of the bag, ``topic:field`` where a message has several.
        topic: The IMU topic, for bags that hold several.
        columns: As those of `read_trial`; the time's is used.

    Returns:
        Stamps and values by channel, for `run_through`.

    Raises:
        InputError: A channel is not in the record, or is given twice.

    Example:
        >>> path = records / 'morro_buoy.csv'
        >>> upstream = read_upstream(path, ['accel_z_m_s2'])
        >>> run = run_through(read_trial(path).between(0.0, 20.0), upstream=upstream)
        >>> len(run.steps) > 100
        True
    """
    from swath_sysid.formats.bags import is_bag, read_imu

    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"the upstream channel '{shown(twice[0])}' is given twice: name each once")
    if not names:
        return {}
    with reading(path):
        path = existing(path)
        if is_bag(path):
            return _of_bag(path, names, read_imu(path, topic, (columns or {}).get(DEVICE)))
        return _of_table(path, names, columns or {})


def _of_table(path: Path, names: Sequence[str], columns: Mapping[str, str]) -> dict[str, UpstreamSeries]:
    plain = {plain_name(name): name for name in names}

    def lacking(found: set[str]) -> str:
        missing = [name for each, name in plain.items() if each not in found]
        return f"column '{shown(missing[0])}' for an upstream channel" if missing else ''

    assigned = {quantity: source for quantity, source in columns.items() if plain_name(quantity) in ('time', DEVICE)}
    table = read_table(path, [Quantity(each, (each,), ('',)) for each in plain], lacking, None, assigned)
    time, found = table.time(), {}
    for each, values in table.readings().items():
        known = np.isfinite(values) & np.isfinite(time)
        if not known.any():
            raise InputError(f"{path} holds no number in its column '{shown(plain[each])}': choose another column")
        found[plain[each]] = UpstreamSeries(time[known], values[known])
    return found


def _of_bag(path: Path, names: Sequence[str], imu: ImuRecord) -> dict[str, UpstreamSeries]:
    """Stamps are those of the headers, else those of the IMU when a message arrived."""
    from swath_sysid.formats.bags import intact_messages, opened_bag, topic_named

    assert imu.received is not None, 'messages of a bag have their time of arrival'
    wanted: dict[str, list[tuple[str, str]]] = {}
    with opened_bag(path) as (readers, advice):
        kinds = {c.topic: c.msgtype for reader in readers for c in reader.connections}
        for entry in names:
            topic = topic_named(entry.partition(':')[0], kinds)
            if topic not in kinds:
                raise InputError(
                    f'{path} holds no topic {topic}{did_you_mean(topic, kinds)}: choose from {", ".join(sorted(kinds))}'
                )
            wanted.setdefault(topic, []).extend(channels_of(entry, kinds[topic]).items())
        rows: dict[str, list[tuple[float, float, float]]] = {name: [] for own in wanted.values() for name, _ in own}
        for connection, time_ns, raw in intact_messages(path, readers, tuple(wanted), advice):
            message = typestore().deserialize_cdr(raw, connection.msgtype)
            arrival = float(
                np.interp(time_ns - imu.received[0], imu.received - imu.received[0], imu.stamps - imu.stamps[0])
            )
            stamp_ns = stamp_of(message)
            stamp = arrival if stamp_ns is None else stamp_ns - int(imu.stamps[0])
            for name, field in wanted[connection.topic]:
                rows[name].append(
                    (stamp / SECOND_NS, field_value(message, connection.msgtype, field), arrival / SECOND_NS)
                )
    return {name: UpstreamSeries(*np.array(found).reshape(-1, 3).T) for name, found in rows.items()}
