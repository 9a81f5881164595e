"""CSV trials: a line of column names that say their units, and lines of numbers."""
import re
from pathlib import Path

import numpy as np

from swath_sysid.advice import Advice
from swath_sysid.errors import InputError
from swath_sysid.files.atomic import replacing
from swath_sysid.files.tables import listed_names, read_columns, read_head, shown
from swath_sysid.motion.sensing import Installation, assemble_trial

STANDARD_GRAVITY = 9.80665
"""m/s^2, ISO 80000-3."""

EPOCH_SECONDS = 1e8
"""A time column that begins beyond this counts from an epoch, and is told from its first sample instead."""

TIME_UNITS = {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9}
ANGLE_UNITS = {'rad': 1.0, 'deg': np.pi / 180}
RATE_UNITS = {'rad_s': 1.0, 'deg_s': np.pi / 180}
ACCELERATION_UNITS = {'m_s2': 1.0, 'g': STANDARD_GRAVITY}
LENGTH_UNITS = {'m': 1.0}

TIME_NAMES = ('time', 't', 'stamp', 'timestamp', 'header_stamp')
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
    *(((f'accel_{part}', f'acc_{part}', f'linear_acceleration_{part}'), f'accel_{part}', ACCELERATION_UNITS)
      for part in 'xyz'),
    *(((f'quaternion_{part}', f'orientation_{part}', f'q{part}'), f'quaternion_{part}', {'': 1.0})
      for part in 'xyzw'),
)
"""Names a column may have before its unit, the reading it holds, and its units with their size in SI."""

MOTION = frozenset(('roll', 'pitch', 'roll_rate', 'pitch_rate', 'gyro_x', 'gyro_y', 'quaternion_x'))
"""Readings without any of which there is no roll or pitch."""

UNIT_ADVICE = 'add it to the name, as in roll_deg, gyro_x_rad_s or accel_z_m_s2'

LOOKED_FOR = ('roll_rad', 'pitch_rad', 'roll_deg', 'pitch_deg', 'roll_rate_rad_s', 'pitch_rate_rad_s',
              'gyro_x_rad_s', 'gyro_y_rad_s (or _deg_s)')

WRITTEN_UNITS = {'roll': 'rad', 'pitch': 'rad', 'roll_rate': 'rad_s', 'pitch_rate': 'rad_s',
                 'accel_x': 'm_s2', 'accel_y': 'm_s2', 'accel_z': 'm_s2', 'yaw_rate': 'rad_s', 'heave': 'm'}

LINES_AT_ONCE = 100_000


def read_csv(path, frame=None, mounting=(0.0, 0.0, 0.0)):
    """Read a trial from a CSV file.

    Columns are found by name, in any order; capitals, spaces, brackets and slashes do not matter:
    ``Roll rate [deg/s]`` is ``roll_rate_deg_s``. Delimiters are comma, semicolon, tab or spaces;
    with the others than the comma, numbers may have decimal commas.

    ===================================== ======================= ===========================
    column                                units                   reading
    ===================================== ======================= ===========================
    time, t, stamp, timestamp             s, ms, us, ns           needed
    roll, pitch, yaw                      rad, deg                Euler angles
    heading                               rad, deg                clockwise from north
    quaternion_x, _y, _z, _w              (none)                  orientation
    roll_rate, pitch_rate, yaw_rate       rad_s, deg_s            Euler rates
    gyro_x, _y, _z                        rad_s, deg_s            body rates
    accel_x, _y, _z                       m_s2, g                 specific force
    heave                                 m                       along the frame's vertical
    ===================================== ======================= ===========================

    Comment lines above (``# key: value``) may give ``draft_m``, ``initial_angle_deg`` or
    ``initial_angle_rad``, and ``frame``.

    Parameters
    ----------
    path : str or Path
    frame : str, optional
        ``flu`` or ``frd``; by default what the file says of itself, else ``flu``.
    mounting : tuple of 3 floats
        Roll, pitch, yaw of the sensor in the craft, rad.

    Returns
    -------
    Trial

    Raises
    ------
    InputError
        The file cannot be read, lacks a time column or any roll or pitch motion, names a column
        without its unit, or holds too few usable rows.
    """
    path = Path(path)
    try:
        head = read_head(path)
        columns, time_names, unitless = _find_columns(path, head.names)
        values, advice = read_columns(path, head, [index for index, _ in columns.values()])
    except OSError as error:
        raise InputError(f'cannot read {path}: {error.strerror}') from error
    readings = {
        name: row if scale == 1 else row * scale
        for row, (name, (_, scale)) in zip(values, columns.items(), strict=True)
    }
    if unitless:
        advice += (Advice('unit-missing', (
            f'columns without a unit left out ({listed_names(unitless)}): {UNIT_ADVICE}'
        )),)
    time = _time([readings.pop(name) for name in time_names])
    return assemble_trial(
        time, readings, Installation(frame or head.remarks.get('frame', 'flu').lower(), mounting), source=str(path),
        draft=_remark(path, head.remarks, 'draft_m'), initial_angle=_initial_angle(path, head.remarks), advice=advice,
    )


def write_csv(path, trial):
    """Write a trial as a CSV file that `read_csv` reads back exactly.

    Parameters
    ----------
    path : str or Path
    trial : Trial

    Raises
    ------
    InputError
        The file cannot be written.
    """
    names = ['time_s', *(f'{name}_{WRITTEN_UNITS[name]}' for name in trial.channels)]
    columns = [np.asarray(values, dtype=float) for values in (trial.time, *trial.channels.values())]
    remarks = {'frame': 'flu', 'draft_m': trial.draft, 'initial_angle_rad': trial.initial_angle}
    with replacing(path) as temporary, open(temporary, 'w', encoding='utf-8') as file:
        for key, value in remarks.items():
            if value is not None:
                file.write(f'# {key}: {value}\n')
        file.write(','.join(names) + '\n')
        for start in range(0, trial.time.size, LINES_AT_ONCE):
            rows = zip(*(column[start:start + LINES_AT_ONCE].tolist() for column in columns), strict=True)
            file.writelines(','.join(map(repr, row)) + '\n' for row in rows)


def _find_columns(path, names):
    """Reading to (index, scale) of the columns to read, which of them make up the time, and which lack a unit."""
    known = {f'{alias}_{unit}' if unit else alias: (reading, scale)
             for aliases, reading, units in QUANTITIES for alias in aliases for unit, scale in units.items()}
    bare = {alias for aliases, _, units in QUANTITIES for alias in aliases if '' not in units}
    plain = [_plain_name(name) for name in names]
    readings, unitless = {}, []
    for index, name in enumerate(plain):
        if name in known:
            reading, scale = known[name]
            readings.setdefault(reading, (index, scale))
        elif name in bare:
            unitless.append(names[index])
    times = _time_columns(plain)
    if not times:
        _refuse_without_time(path, names, plain)
    if not any(reading in MOTION for reading in readings):
        if unitless:
            raise InputError(f"{path} has a column '{shown(unitless[0])}' without a unit: {UNIT_ADVICE}")
        raise InputError(f'{path} has no roll or pitch motion: looked for {", ".join(LOOKED_FOR)}, '
                         f'found {listed_names(names)}; name the columns so')
    return {**times, **readings}, tuple(times), unitless


def _refuse_without_time(path, names, plain):
    """Say what is wrong where no time column was found."""
    for name, simple in zip(names, plain, strict=True):
        if simple in TIME_NAMES:
            raise InputError(f"{path} has a column '{shown(name)}' without a unit: call it time_s, time_ms, time_us "
                             f'or time_ns')
    raise InputError(f'{path} has no time column: looked for time_s, time_ms, time_us, time_ns (or t_, stamp_, '
                     f'timestamp_), found {listed_names(names)}; name the columns so')


def _time_columns(plain):
    """The column (or the two columns, seconds and nanoseconds) of the time, by any of its names."""
    for alias in TIME_NAMES:
        for unit, scale in TIME_UNITS.items():
            if f'{alias}_{unit}' in plain:
                return {'time': (plain.index(f'{alias}_{unit}'), scale)}
    for alias in ('', *(f'{name}_' for name in TIME_NAMES)):
        if f'{alias}sec' in plain and f'{alias}nanosec' in plain:
            return {'time_sec': (plain.index(f'{alias}sec'), 1.0),
                    'time_nanosec': (plain.index(f'{alias}nanosec'), TIME_UNITS['ns'])}
    return {}


def _time(parts):
    """Seconds, from the first sample where the column counts from an epoch."""
    seconds = parts[0]
    start = _first_finite(seconds)
    if abs(start) <= EPOCH_SECONDS:
        return sum(parts[1:], seconds)
    # subtracted before the nanoseconds are added: a double resolves an epoch to 0.2 us only
    time = sum(parts[1:], seconds - start)
    return time - _first_finite(time)


def _first_finite(values):
    finite = np.flatnonzero(np.isfinite(values))
    return values[finite[0]] if finite.size else 0.0


def _plain_name(name):
    """``Roll rate [deg/s]`` as ``roll_rate_deg_s``."""
    plain = name.lower().replace('°', 'deg').replace('²', '2').replace('µ', 'u').replace('^', '')
    plain = re.sub('[^a-z0-9]+', '_', plain).strip('_')
    return re.sub('_(per|p)_', '_', plain)


def _remark(path, remarks, key):
    """The number in a ``# key: value`` line, None where there is none."""
    if not remarks.get(key):
        return None
    try:
        return float(remarks[key].replace(',', '.'))
    except ValueError as error:
        raise InputError(f"{path} says '{key}: {shown(remarks[key])}', which is no number: "
                         f'correct that line') from error


def _initial_angle(path, remarks):
    angle = _remark(path, remarks, 'initial_angle_rad')
    if angle is None and (degrees := _remark(path, remarks, 'initial_angle_deg')) is not None:
        return degrees * ANGLE_UNITS['deg']
    return angle
