"""CSV trials: a line of column names that say their units, and lines of numbers."""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from swath_sysid.attitude.motion.assembly import ACCEL, QUATERNION, assemble_trial
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, euler_angles
from swath_sysid.attitude.motion.sensor_mount import Installation
from swath_sysid.attitude.motion.time_base import check_time_base, motion_period
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.input_files import reading
from swath_sysid.formats.tables import (
    ANGLE_UNITS,
    EPOCH_SECONDS,
    LENGTH_UNITS,
    PURE,
    RATE_UNITS,
    TIME_UNITS,
    Progress,
    TableHead,
    known_columns,
    listed_names,
    plain_name,
    read_columns,
    read_head,
    remark_number,
    shown,
    write_table,
)

SAMPLES = 'samples'  #: The unit of a time column that numbers the samples; a comment line says how many a second.

ACCELERATION_UNITS = {'m_s2': 1.0, 'g': STANDARD_GRAVITY}

TIME_NAMES = ('time', 't', 'stamp', 'timestamp', 'header_stamp')
DATE_NAMES = (*TIME_NAMES, 'date', 'datetime', 'date_time', 'utc', 'time_utc', 'utc_time')  #: Of dates, without a unit.
#: Names before the unit, reading, and units with their size in SI.
QUANTITIES = (
    (('roll', 'roll_angle'), 'roll', ANGLE_UNITS),
    (('pitch', 'pitch_angle'), 'pitch', ANGLE_UNITS),
    (('yaw', 'yaw_angle'), 'yaw', ANGLE_UNITS),
    (('heading',), 'heading', ANGLE_UNITS),
    (('roll_rate',), 'roll_rate', RATE_UNITS),
    (('pitch_rate',), 'pitch_rate', RATE_UNITS),
    (('yaw_rate',), 'yaw_rate', RATE_UNITS),
    (('heave',), 'heave', LENGTH_UNITS),
    *(((f'gyro_{part}', f'gyr_{part}', f'angular_velocity_{part}'), f'gyro_{part}', RATE_UNITS) for part in 'xyz'),
    *(
        ((f'accel_{part}', f'acc_{part}', f'linear_acceleration_{part}'), f'accel_{part}', ACCELERATION_UNITS)
        for part in 'xyz'
    ),
    *(((f'quaternion_{part}', f'orientation_{part}', f'q{part}'), f'quaternion_{part}', PURE) for part in 'xyzw'),
)

TIMES = ('time', 'time_sec', 'time_nanosec')

#: rad, with some rounding: beyond these there is no roll or pitch.
LARGEST_ANGLES = {'roll': 1.01 * np.pi, 'pitch': 0.51 * np.pi}

#: Values beyond all limits, or their share, that may be broken packets.
BROKEN_PACKETS, BROKEN_SHARE = 3, 0.002

MIN_SWING_RAD, LARGEST_SWING_RAD = 0.03, 0.7  #: Half the range of angles in rad of a craft that moves by 2 to 40 deg.
MIN_SAMPLES_A_CYCLE = 8  #: Noise of a sensor at rest turns faster.

#: Difference of two columns of one quantity, as share or in SI units, that is rounding.
SAME_SHARE, SAME_AT_LEAST = 0.02, 1e-3

#: Readings without any of which there is no roll or pitch.
MOTION = frozenset(('roll', 'pitch', 'roll_rate', 'pitch_rate', 'gyro_x', 'gyro_y', 'quaternion_x'))

UNIT_ADVICE = 'add it to the name, as in roll_deg, gyro_x_rad_s or accel_z_m_s2'

LOOKED_FOR = 'roll_rad, pitch_rad, roll_rate_rad_s, pitch_rate_rad_s, gyro_x_rad_s, gyro_y_rad_s (or deg for rad)'
WRITTEN_UNITS = {reading: next(iter(units)) for _, reading, units in QUANTITIES}


def read_csv(
    path: str | Path,
    frame: str | None = None,
    mounting: tuple[float, float, float] = (0.0, 0.0, 0.0),
    progress: Progress | None = None,
) -> Trial:
    """Read a trial from a CSV file.

    Columns are found by name, in any order; capitals, spaces, brackets and slashes do not matter:
    ``Roll rate [deg/s]`` is ``roll_rate_deg_s``. Delimiters are comma, semicolon, tab or spaces;
    with the others than the comma, numbers may have decimal commas.

    ===================================== ======================= ===========================
    column                                units                   reading
    ===================================== ======================= ===========================
    time, t, stamp, timestamp             s, ms, us, ns, samples  needed; no unit where it holds ISO 8601 dates
    roll, pitch, yaw                      rad, deg                Euler angles
    heading                               rad, deg                clockwise from north
    quaternion_x, _y, _z, _w              (none)                  orientation
    roll_rate, pitch_rate, yaw_rate       rad_s, deg_s            Euler rates
    gyro_x, _y, _z                        rad_s, deg_s            body rates
    accel_x, _y, _z                       m_s2, g                 specific force
    heave                                 m                       along the frame's vertical
    ===================================== ======================= ===========================

    Comment lines above (``# key: value``) may give ``draft_m``, ``initial_angle_deg`` or
    ``initial_angle_rad``, ``frame``, ``mounting_deg`` (roll, pitch, yaw of the sensor, as in ``180, 0, 0``), and
    ``sample_rate_hz``, which goes with ``time_samples``.

    A quantity that stands in two columns is read where both agree. Frame and mounting, where they are not given, are
    those that the file states. Parameters and errors are those of `swath_sysid.formats.reading.read_trial`.
    """
    with reading(path):
        head = read_head(path)
        columns, unitless = _find_columns(path, head)
        values, advice = read_columns(path, head, [column.index for column in columns], progress)
    _check_units(path, columns, values)
    readings = _agreeing(path, columns, values)
    if unitless:
        advice += (Advice.of('unit-missing', columns=listed_names(unitless), unit_advice=UNIT_ADVICE),)
    times = [column for column in columns if column.reading in TIMES]
    time = _time([readings.pop(name) for name in TIMES if name in readings])
    if times[0].unit == SAMPLES:
        time = time / _sample_rate(path, head.remarks)
    trial = assemble_trial(
        time,
        readings,
        _installation(path, head.remarks, frame, mounting),
        source=str(path),
        draft=remark_number(path, head.remarks, 'draft_m'),
        initial_angle=_initial_angle(path, head.remarks),
        advice=(*advice, *_small_angle_advice(columns, values)),
    )
    swinging = [values for name, values in trial.channels.items() if name not in ACCEL]
    start = _first_finite(values[columns.index(times[0])]) * times[0].scale
    moved = trial.time + (start - trial.time[0]) if times[0].unit == 's' else trial.time
    found = check_time_base(moved, swinging, str(path), times[0].name, times[0].unit)
    return replace(trial, advice=(*trial.advice, *found))


def write_csv(path: str | Path, trial: Trial) -> None:
    """Write every channel of a trial as a CSV file, whole or not at all, that `read_csv` reads back exactly."""
    remarks = {'frame': 'flu', 'draft_m': trial.draft, 'initial_angle_rad': trial.initial_angle}
    channels = {f'{name}_{WRITTEN_UNITS[name]}': values for name, values in trial.channels.items()}
    write_table(path, remarks, {'time_s': trial.time, **channels})


@dataclass(frozen=True)
class Column:
    """A column that is read: what it holds, where it stands, and in which unit."""

    reading: str
    name: str
    index: int
    unit: str
    scale: float


def _find_columns(path: str | Path, head: TableHead) -> tuple[list[Column], list[str]]:
    """The columns to read, those of the time first, and the names of those that lack a unit."""
    names = head.names
    known = known_columns(QUANTITIES)
    bare = {alias for aliases, _, units in QUANTITIES for alias in aliases if '' not in units}
    plain = [plain_name(name) for name in names]
    columns, unitless = _dates(plain, head) or _time_columns(plain, names), []
    if not columns:
        _refuse_without_time(path, names, plain)
    for index, name in enumerate(plain):
        if name in known:
            reading, unit, scale = known[name]
            columns.append(Column(reading, names[index], index, unit, scale))
        elif name in bare:
            unitless.append(names[index])
    if not any(column.reading in MOTION for column in columns):
        if unitless:
            raise InputError(f"{path} has a column '{shown(unitless[0])}' without a unit: {UNIT_ADVICE}")
        raise InputError(
            f'{path} has no roll or pitch motion: looked for {LOOKED_FOR}, '
            f'found {listed_names(names)}; name the columns so'
        )
    read = [plain[column.index] for column in columns]
    twice = next((column.name for place, column in enumerate(columns) if read[place] in read[:place]), None)
    if twice is not None:
        raise InputError(f"{path} has two columns '{shown(twice)}': leave one out, or rename it")
    return columns, unitless


def _agreeing(path: str | Path, columns: Sequence[Column], values: Iterable[np.ndarray]) -> dict[str, np.ndarray]:
    """Reading to values in SI units, of the first column of each; columns that contradict it are refused."""
    readings, first = {}, {}
    for column, row in zip(columns, values, strict=True):
        row = row if column.scale == 1 else row * column.scale
        if column.reading not in readings:
            readings[column.reading], first[column.reading] = row, column
        elif column.reading != 'yaw' and not _agree(readings[column.reading], row):
            raise InputError(
                f"{path}: its columns '{shown(first[column.reading].name)}' and '{shown(column.name)}' "
                f'contradict each other: leave out the one that is wrong'
            )
    _refuse_contradicting_orientation(path, readings)
    return readings


def _agree(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two columns say the same, as far as rounding and a few broken packets allow."""
    apart = np.abs(one - other)
    known = np.isfinite(apart)
    if not known.any():
        return True
    size = np.percentile(np.abs(one[known] - np.median(one[known])), 95)
    return float(np.percentile(apart[known], 90)) <= max(SAME_SHARE * float(size), SAME_AT_LEAST)


def _refuse_contradicting_orientation(path: str | Path, readings: dict[str, np.ndarray]) -> None:
    """Hold roll and pitch against the quaternion."""
    if not all(part in readings for part in QUATERNION):
        return
    roll, pitch, _ = euler_angles(*(readings[part] for part in QUATERNION))
    for name, angle in (('roll', roll), ('pitch', pitch)):
        if name in readings and np.isfinite(angle).any() and not _agree(readings[name], angle):
            raise InputError(
                f'{path}: its {name} and its quaternion contradict each other: leave out the one that is wrong'
            )


def _check_units(path: str | Path, columns: Sequence[Column], values: Iterable[np.ndarray]) -> None:
    """Refuse angles that are called rad and can only be degrees."""
    for column, row in zip(columns, values, strict=True):
        limit = LARGEST_ANGLES.get(column.reading)
        known = row[np.isfinite(row)]
        if column.unit != 'rad' or limit is None or not known.size:
            continue
        beyond = np.count_nonzero(np.abs(known) > limit)
        if beyond > max(BROKEN_PACKETS, BROKEN_SHARE * known.size):
            name = re.sub('rad', 'deg', column.name, flags=re.IGNORECASE)
            raise InputError(
                f"{path}: '{shown(column.name)}' goes to {np.abs(known).max():.4g} in {beyond} rows, more "
                f"than an angle in rad can be: if it is in degrees, call it '{shown(name)}'"
            )


def _small_angle_advice(columns: Sequence[Column], values: Iterable[np.ndarray]) -> tuple[Advice, ...]:
    """Advice (``hardly-moves``) where all angles are declared in degrees but move as little as angles in rad do."""
    angles = {
        column.name: row[np.isfinite(row)]
        for column, row in zip(columns, values, strict=True)
        if column.reading in LARGEST_ANGLES and column.unit == 'deg'
    }
    swings = {name: float(np.subtract(*np.percentile(row, [99, 1]))) / 2 for name, row in angles.items() if row.size}
    if not swings or not MIN_SWING_RAD < max(swings.values()) < LARGEST_SWING_RAD:
        return ()
    name = max(swings, key=lambda angle: swings[angle])
    samples_a_cycle = motion_period(np.arange(angles[name].size), angles[name], 1)
    if samples_a_cycle is None or samples_a_cycle < MIN_SAMPLES_A_CYCLE:
        return ()
    other = re.sub('deg', 'rad', name, flags=re.IGNORECASE)
    return (Advice.of('hardly-moves', name=shown(name), swing=swings[name], other=shown(other)),)


def _sample_rate(path: str | Path, remarks: dict[str, str]) -> float:
    rate = remark_number(path, remarks, 'sample_rate_hz')
    if rate is None:
        raise InputError(
            f"{path} numbers its samples but states no rate: put a line '# sample_rate_hz: 100' above the columns"
        )
    if not 0.0 < rate < math.inf:
        raise InputError(
            f"{path} says 'sample_rate_hz: {shown(remarks['sample_rate_hz'])}', which must be greater than zero"
        )
    return rate


def _refuse_without_time(path: str | Path, names: Sequence[str], plain: Sequence[str]) -> NoReturn:
    """Say what is wrong where no time column was found."""
    for name, simple in zip(names, plain, strict=True):
        if simple in TIME_NAMES:
            raise InputError(
                f"{path} has a column '{shown(name)}' without a unit: call it time_s, time_ms, time_us or time_ns"
            )
    raise InputError(
        f'{path} has no time column: looked for time_s, time_ms, time_us, time_ns (or t_, stamp_, '
        f'timestamp_), or time with dates such as 2026-05-01T12:00:00.25Z, found {listed_names(names)}; name the '
        f'columns so'
    )


def _dates(plain: Sequence[str], head: TableHead) -> list[Column]:
    """The column that holds dates with times of day, if it is named as a time."""
    named = {f'{alias}_{unit}' for alias in TIME_NAMES for unit in TIME_UNITS}.union(DATE_NAMES)
    found = [place for place in sorted(head.dates) if place < len(plain) and plain[place] in named]
    return [Column(TIMES[0], head.names[place], place, 's', 1.0) for place in found[:1]]


def _time_columns(plain: Sequence[str], names: Sequence[str]) -> list[Column]:
    """The column (or the two columns, seconds and nanoseconds) of the time, by any of its names."""
    for alias in TIME_NAMES:
        for unit, scale in {**TIME_UNITS, SAMPLES: 1.0}.items():
            found = [index for index, name in enumerate(plain) if name == f'{alias}_{unit}']
            if found:
                return [Column(TIMES[0], names[index], index, unit, scale) for index in found]
    for alias in ('', *(f'{name}_' for name in TIME_NAMES)):
        if f'{alias}sec' in plain and f'{alias}nanosec' in plain:
            places = plain.index(f'{alias}sec'), plain.index(f'{alias}nanosec')
            scales = 1.0, TIME_UNITS['ns']
            return [
                Column(reading, names[index], index, 's', scale)
                for reading, index, scale in zip(TIMES[1:], places, scales, strict=True)
            ]
    return []


def _time(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Seconds, from the first sample where the column counts from an epoch."""
    seconds = parts[0]
    start = _first_finite(seconds)
    if abs(start) <= EPOCH_SECONDS:
        return sum(parts[1:], seconds)
    # subtracted before the nanoseconds are added: a double resolves an epoch to 0.2 us only
    time = sum(parts[1:], seconds - start)
    return time - _first_finite(time)


def _first_finite(values: np.ndarray) -> float:
    finite = np.flatnonzero(np.isfinite(values))
    return values[finite[0]] if finite.size else 0.0


def _installation(
    path: str | Path, remarks: dict[str, str], frame: str | None, mounting: tuple[float, float, float]
) -> Installation:
    """The mounting of the sensor: as given, else as the file states."""
    if remarks.get('mounting_deg') and not any(mounting):
        parts = re.split(r'[,;\s]+', remarks['mounting_deg'].strip('[]() '))
        try:
            roll, pitch, yaw = (float(part) * ANGLE_UNITS['deg'] for part in parts)
            mounting = roll, pitch, yaw
        except ValueError as error:
            raise InputError(
                f"{path} says 'mounting_deg: {shown(remarks['mounting_deg'])}', which is not three "
                f'angles: write it as 180, 0, 0'
            ) from error
    return Installation(frame or remarks.get('frame', 'flu').lower(), mounting)


def _initial_angle(path: str | Path, remarks: dict[str, str]) -> float | None:
    angle = remark_number(path, remarks, 'initial_angle_rad')
    if angle is None and (degrees := remark_number(path, remarks, 'initial_angle_deg')) is not None:
        return degrees * ANGLE_UNITS['deg']
    return angle
