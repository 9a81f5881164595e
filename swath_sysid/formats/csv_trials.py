"""Trials in tables: column names that say their units, and numbers."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation, euler_angles, tilt_angles
from swath_sysid.attitude.motion.cleaning import ACCEL, QUATERNION, WRAP, assemble_trial, counts_whole_turns
from swath_sysid.attitude.motion.rate_comparison import compare_rates, is_near
from swath_sysid.attitude.motion.stamps import check_time_base, motion_period
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import LOST_SHARE
from swath_sysid.common.errors import InputError
from swath_sysid.formats.clocks import Clock, Column
from swath_sysid.formats.columns import UNKNOWN, Table, agree, read_table
from swath_sysid.formats.files import shown
from swath_sysid.formats.text_tables import NamedColumns, Progress, write_table
from swath_sysid.formats.vocabulary import MOTION_QUANTITIES, UNITS

LARGEST_ANGLES = {'roll': 1.01 * np.pi, 'pitch': 0.51 * np.pi}  #: rad, with some rounding.
RATES_OF = {'roll': ('roll_rate', 'gyro_x'), 'pitch': ('pitch_rate', 'gyro_y')}
ANGLE_UNITS = MOTION_QUANTITIES[0].units

AMPLITUDES_RAD = 0.03, 0.7  #: Half the range of angles in rad of a craft that moves by 2 to 40 deg.
MIN_SAMPLES_A_CYCLE = 8  #: Noise of a sensor at rest turns faster.

#: Readings without any of which there is no roll or pitch.
MOTION = frozenset(('roll', 'pitch', 'roll_rate', 'pitch_rate', 'gyro_x', 'gyro_y', 'quaternion_x', 'up_x'))
UP = frozenset(('up_x', 'up_y', 'up_z'))  #: The world's up in the axes of the sensor.


def read_csv(
    path: str | Path,
    frame: str | None = None,
    mounting: tuple[float, float, float] | None = None,
    progress: Progress | None = None,
    columns: Mapping[str, str] | None = None,
    tables: Sequence[NamedColumns] = (),
) -> Trial:
    """Read a trial from a CSV file, or from a table of another format.

    The table is found where its numbers begin, and its columns by name, in any order; capitals, accents, spaces,
    brackets and slashes do not matter: ``Roll rate [deg/s]`` is ``roll_rate_deg_s``, and units may stand in a row of
    their own. Delimiters are comma, semicolon, tab, bar or spaces; with the others than the comma, numbers may have
    decimal commas.

    ===================================== ======================= ===========================
    column                                units                   reading
    ===================================== ======================= ===========================
    time, t, stamp, timestamp             s, ms, us, ns, samples  needed; no unit where it holds dates or clock times
    roll, pitch, yaw                      rad, mrad, deg, cdeg    Euler angles
    heading                               rad, deg                clockwise from north
    quaternion_x, _y, _z, _w              (none)                  orientation
    roll_rate, pitch_rate, yaw_rate       rad_s, deg_s, dps       Euler rates
    gyro_x, _y, _z                        rad_s, deg_s, dps       body rates
    accel_x, _y, _z                       m_s2, g                 specific force
    heave                                 m, cm, mm               along the frame's vertical
    ===================================== ======================= ===========================

    Comment lines above (``# key: value``) may give ``draft_m``, ``initial_angle_deg`` or
    ``initial_angle_rad``, ``frame``, ``mounting_deg`` (roll, pitch, yaw of the sensor, as in ``180, 0, 0``), and
    ``sample_rate_hz`` (or ``fs``, ``dt``), which goes with ``time_samples`` or replaces the time.

    A quantity that appears in two columns is read where both agree, and a column whose name is near to a known one is
    reported. Frame and mounting, where they are not given, are
    those that the file states. Parameters and errors are those of `swath_sysid.formats.reading.read_trial`.
    """
    table = read_table(path, MOTION_QUANTITIES, _lacking, progress, columns, _units_by_values, tables)
    _check_units(table)
    readings = table.readings()
    if UP <= readings.keys() and not readings.keys() & {'roll', 'quaternion_w'}:
        readings['roll'], readings['pitch'] = tilt_angles(*(readings[part] for part in sorted(UP)))
    readings = {name: values for name, values in readings.items() if name not in UP}
    _refuse_contradicting_orientation(path, readings)
    degrees = table.remark('initial_angle_deg')
    trial = assemble_trial(
        table.time(),
        readings,
        _installation(table, frame, mounting),
        source=str(path),
        draft=table.remark('draft_m'),
        initial_angle=table.remark('initial_angle_rad') if degrees is None else float(np.radians(degrees)),
        advice=(*table.advice, *_unit_advice(table)),
        understood=table.in_words(),
    )
    motions = [values for name, values in trial.channels.items() if name not in ACCEL]
    clock = table.clock
    check_time_base(
        trial.time + (clock.start - trial.time[0]), motions, str(path), clock.name, clock.columns[-1].unit or ''
    )
    return trial


def write_csv(path: str | Path, trial: Trial) -> None:
    """Write every channel of a trial as a CSV file, whole or not at all, that `read_csv` reads back exactly."""
    units = {each.reading: each.units[0] for each in MOTION_QUANTITIES}
    remarks = {'frame': 'flu', 'draft_m': trial.draft, 'initial_angle_rad': trial.initial_angle}
    channels = {f'{name}_{units[name]}': values for name, values in trial.channels.items()}
    write_table(path, remarks, {'time_s': trial.time, **channels})


def _lacking(found: set[str]) -> str:
    if found & MOTION:
        return ''
    return (
        'roll or pitch motion: looked for roll_rad, pitch_rad, roll_rate_rad_s, pitch_rate_rad_s, gyro_x_rad_s, '
        'gyro_y_rad_s (or deg for rad)'
    )


def _refuse_contradicting_orientation(path: str | Path, readings: dict[str, np.ndarray]) -> None:
    """Hold roll and pitch against the quaternion."""
    if not all(part in readings for part in QUATERNION):
        return
    roll, pitch, _ = euler_angles(*(readings[part] for part in QUATERNION))
    for name, angle in (('roll', roll), ('pitch', pitch)):
        apart = np.remainder(readings.get(name, angle) - angle + np.pi, 2.0 * np.pi) - np.pi
        if np.isfinite(angle).any() and not agree(angle + apart, angle):
            raise InputError(f'{path}: its {name} and its quaternion contradict each other: leave out the wrong one')


def _angles(table: Table, unit: str) -> dict[str, tuple[str, np.ndarray]]:
    """Name to reading and known values of the columns of roll and pitch in a unit."""
    return {
        column.name: (column.reading, row[np.isfinite(row)])
        for column, row in zip(table.columns, table.values, strict=True)
        if column.reading in LARGEST_ANGLES and column.unit == unit and np.isfinite(row).any()
    }


def _check_units(table: Table) -> None:
    """Refuse angles whose values their unit cannot have."""
    for column, row in zip(table.columns, table.values, strict=True):
        known = np.abs(row[np.isfinite(row)]) * column.scale
        if column.reading not in LARGEST_ANGLES or not known.size or counts_whole_turns(row * column.scale):
            continue
        name, angle, unit = shown(column.name), column.reading, column.unit
        if unit != 'rad' and _wraps(row, 2.0 * np.pi):
            raise InputError(
                f"{table.path}: '{name}' jumps by 2 pi and never exceeds it, so it is in rad, not in {unit}: assign it "
                f"as in '{angle}={name}:rad'",
                UNKNOWN,
            )
        if np.quantile(known, 1.0 - LOST_SHARE, method='lower') <= LARGEST_ANGLES[angle]:
            continue
        largest = known.max() / column.scale
        if unit == 'rad' and largest <= 180.0:
            other = re.sub('rad', 'deg', column.name, flags=re.IGNORECASE)
            cure = f"call it '{shown(other)}'" if other != column.name else 'assign it with that unit'
            cure = f'if it is in degrees, {cure}'
        else:
            cure = f"if it is in hundredths of a degree, assign it as in '{angle}={name}:cdeg'"
        raise InputError(
            f"{table.path}: '{name}' goes to {largest:.4g}, more than an angle in {unit} can be: {cure}", UNKNOWN
        )


def _wraps(values: np.ndarray, turn: float) -> bool:
    """Whether an angle (N,) jumps by a turn, more than once, and fills one."""
    known = values[np.isfinite(values)]
    jumps = np.count_nonzero(np.abs(np.diff(known)) > WRAP * turn)
    return bool(jumps > 1 and 0.97 * turn < np.ptp(known) < 1.01 * turn)


def _units_by_values(clock: Clock, columns: Sequence[Column], values: np.ndarray) -> dict[int, tuple[str, str]]:
    """Place to unit and reason, of angles that state no unit where their values or rates leave no doubt of it."""
    found: dict[int, tuple[str, str]] = {}
    if all(column.unit is not None for column in columns):
        return found
    known = {column.reading: row * column.scale for column, row in zip(columns, values, strict=True) if column.unit}
    largest = [np.nanmax(np.abs(row), initial=0.0) for row in values]
    # beyond what radians can be: a yaw alone might count whole turns
    is_large = any(largest[at] > LARGEST_ANGLES.get(column.reading, np.inf) for at, column in enumerate(columns))
    for place, column in enumerate(columns):
        is_positive = column.reading == 'heading' and np.nanmin(values[place], initial=0.0) >= 0.0
        limit = 360.0 if is_positive else 180.0 if column.reading == 'yaw' and is_large else 0.0
        if column.unit is None and 1.01 * 2.0 * np.pi < largest[place] <= limit:
            found[place] = 'deg', f'it goes to {largest[place]:.4g}'
        if column.unit is not None or column.reading not in LARGEST_ANGLES:
            continue
        by_turn = next(
            (unit for unit, turn in (('rad', 2.0 * np.pi), ('deg', 360.0)) if _wraps(values[place], turn)), None
        )
        rate = next((known[name] for name in RATES_OF[column.reading] if name in known), None)
        if by_turn is not None:
            found[place] = by_turn, 'it jumps by a whole turn'
        elif rate is not None and (by_rate := _unit_by_rate(clock.time, values[place], rate)):
            found[place] = by_rate, 'its rate says so'
    units = [unit for unit, _ in found.values()]
    for place, column in enumerate(columns if len(set(units)) == 1 else ()):
        if column.unit is None and column.reading in LARGEST_ANGLES and largest[place] <= 180.0:
            found.setdefault(place, (units[0], 'the other angle is'))
    return found


def _unit_by_rate(time: np.ndarray, angle: np.ndarray, rate: np.ndarray) -> str | None:
    """The unit in which an angle (N,) has a slope that is its rate, rad/s."""
    unknown = np.full((time.size, 2), np.nan)
    rates = np.column_stack([rate, unknown])
    slopes = compare_rates(float(np.nanmedian(np.diff(time))), np.column_stack([angle, unknown[:, 0]]), rates)
    gains = [slope.gain for slope in slopes if slope.follows]
    return next((unit for unit in ANGLE_UNITS for gain in gains if is_near(gain, UNITS[unit])), None)


def _unit_advice(table: Table) -> tuple[Advice, ...]:
    """Advice where all angles move as little as those in rad, or more than any: one of ``other-unit-likely``."""
    for unit, other, low, high in (('deg', 'rad', *AMPLITUDES_RAD), ('rad', 'deg', AMPLITUDES_RAD[1], np.inf)):
        angles = {name: known for name, (_, known) in _angles(table, unit).items()}
        amplitudes = {name: float(np.subtract(*np.percentile(known, [99, 1]))) / 2 for name, known in angles.items()}
        if not amplitudes or not low < max(amplitudes.values()) < high:
            continue
        name = max(amplitudes, key=lambda angle: amplitudes[angle])
        samples_a_cycle = motion_period(np.arange(angles[name].size), angles[name])
        if samples_a_cycle is not None and samples_a_cycle >= MIN_SAMPLES_A_CYCLE:
            return (
                Advice.of('other-unit-likely', name=shown(name), amplitude=amplitudes[name], unit=unit, other=other),
            )
    return ()


def _installation(table: Table, frame: str | None, mounting: tuple[float, float, float] | None) -> Installation:
    """The mounting of the sensor: as given, else as the file states."""
    stated = table.remarks.get('mounting_deg')
    if stated and mounting is None:
        try:
            roll, pitch, yaw = (float(np.radians(float(part))) for part in re.split(r'[,;\s]+', stated.strip('[]() ')))
        except ValueError as error:
            raise InputError(
                f"{table.path} says 'mounting_deg: {shown(stated)}', which is not three angles: write it as 180, 0, 0"
            ) from error
        mounting = roll, pitch, yaw
    return Installation(frame or table.remarks.get('frame', 'flu').lower(), mounting)
