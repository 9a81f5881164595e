"""CSV records of manoeuvres: thrusters, speeds, yaw, position."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.input_files import reading
from swath_sysid.formats.tables import (
    ANGLE_UNITS,
    EPOCH_SECONDS,
    LENGTH_UNITS,
    PURE,
    RATE_UNITS,
    TIME_UNITS,
    known_columns,
    listed_names,
    plain_name,
    read_columns,
    read_head,
    remark_number,
    shown,
    write_table,
)
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre
from swath_sysid.manoeuvring.motion.trial import COMMAND, FORCE, ManoeuvringTrial

SPEED_UNITS = {'m_s': 1.0, 'km_h': 1.0 / 3.6, 'kn': 1852.0 / 3600.0}
FORCE_UNITS = {'n': 1.0}
PULSE_UNITS = {'us': 1.0}

#: Names of a column without its unit, its quantity, and its units with their size in SI.
QUANTITIES = (
    (('time', 't', 'stamp', 'timestamp'), 'time', TIME_UNITS),
    *(
        (names, f'{side}_{kind}', units)
        for kind, units in (('thrust', FORCE_UNITS), ('command', PURE), ('pwm', PULSE_UNITS))
        for side, other in (('port', 'left'), ('starboard', 'right'))
        for names in [(f'{side}_{kind}', f'{other}_{kind}', f'{kind}_{side}', f'{kind}_{other}')]
    ),
    (('surge', 'u', 'surge_speed'), 'surge', SPEED_UNITS),
    (('sway', 'v', 'sway_speed'), 'sway', SPEED_UNITS),
    (('yaw_rate', 'r'), 'yaw_rate', RATE_UNITS),
    (('heading', 'yaw', 'psi'), 'heading', ANGLE_UNITS),
    *(((name,), name, LENGTH_UNITS) for name in ('x', 'y', 'east', 'north')),
)

FRAMES = ('enu', 'ned')
USUAL_NEUTRAL, USUAL_FULL = 1500.0, 1900.0  #: us; pulses for no thrust and for full thrust ahead.
LARGEST_COMMAND = 1.5  #: A larger command is not normalised.


def read_manoeuvring_csv(path: str | Path, frame: str | None = None) -> ManoeuvringTrial:
    """Read a record of a manoeuvre.

    Columns, in any order: ``time_s``; ``port_thrust_n`` and ``starboard_thrust_n``, or ``port_command`` and
    ``starboard_command``, or ``port_pwm_us`` and ``starboard_pwm_us``; any of ``surge_m_s``, ``sway_m_s``,
    ``yaw_rate_rad_s`` or ``_deg_s``, ``heading_rad`` or ``_deg``, ``x_m`` and ``y_m`` (or ``east_m`` and
    ``north_m``). Comment lines above may state ``# frame: ned``, ``# lever_m: 1.0``, ``# length_m: 4.9``, and of
    pulses ``# pwm_neutral_us: 1500`` and ``# pwm_full_us: 1900`` (full ahead), which are the usual ones. Empty cells
    are missing values.

    Args:
        path: Of the file.
        frame: ``enu`` or ``ned``; by default what the file states, else not stated.

    Returns:
        The channels in SI units, for `prepare_runs`.

    Raises:
        InputError: The file cannot be read, or lacks time, thrust or motion; the sentence names what was looked for.

    Example:
        >>> trial = read_manoeuvring_csv('runs/zigzag_20.csv')
        >>> trial.thrust_input, sorted(trial.measured())
        ('force', ['heading', 'surge', 'sway', 'x', 'y', 'yaw_rate'])
    """
    with reading(path):
        head = read_head(path)
        columns = _find_columns(path, head.names)
        values, advice = read_columns(path, head, [index for index, _ in columns.values()])
    found = {name: row * scale for row, (name, (_, scale)) in zip(values, columns.items(), strict=True)}
    thrust_input, port, starboard = _thrusters(path, found, head.remarks)
    frame = (frame or head.remarks.get('frame', '')).lower() or None
    if frame not in (None, *FRAMES):
        raise InputError(f"{path} states the frame '{shown(frame)}': state enu or ned")
    x, y = found.get('x'), found.get('y')
    if x is None and 'east' in found and 'north' in found:
        x, y = (found['north'], found['east']) if frame == 'ned' else (found['east'], found['north'])
    time = found['time']
    finite = time[np.isfinite(time)]
    if not finite.size:
        raise InputError(f'{path} has no readable time: check its time column')
    motion = {name: found.get(name) for name in ('surge', 'sway', 'yaw_rate', 'heading')}
    return ManoeuvringTrial(
        time - finite[0] if abs(finite[0]) > EPOCH_SECONDS else time,
        port,
        starboard,
        thrust_input,
        **motion,
        x=x,
        y=y,
        frame=frame,
        lever=remark_number(path, head.remarks, 'lever_m'),
        length=remark_number(path, head.remarks, 'length_m'),
        source=str(path),
        advice=advice,
    )


def write_manoeuvring_csv(path: str | Path, manoeuvre: Manoeuvre, model: ManoeuvringModel) -> None:
    """Write a simulated manoeuvre as `read_manoeuvring_csv` reads it, in ENU, with the inputs of the model."""
    kind = 'thrust_n' if model.thrust_input == FORCE else 'command'
    columns = {
        'time_s': manoeuvre.time,
        f'port_{kind}': manoeuvre.port,
        f'starboard_{kind}': manoeuvre.starboard,
        'surge_m_s': manoeuvre.surge,
        'sway_m_s': manoeuvre.sway,
        'yaw_rate_rad_s': manoeuvre.yaw_rate,
        'heading_rad': manoeuvre.heading,
        'x_m': manoeuvre.x,
        'y_m': manoeuvre.y,
    }
    remarks = {'frame': 'enu', 'lever_m': model['lever'], 'length_m': model.length}
    write_table(path, remarks, {name: np.round(values, 9) for name, values in columns.items()})


def _find_columns(path: str | Path, names: Sequence[str]) -> dict[str, tuple[int, float]]:
    known, columns = known_columns(QUANTITIES), dict[str, tuple[int, float]]()
    for index, name in enumerate(map(plain_name, names)):
        if name in known:
            reading, _, scale = known[name]
            columns.setdefault(reading, (index, scale))
    if 'time' not in columns:
        raise InputError(f'{path} has no time column: looked for time_s, time_ms, t_s; found {listed_names(names)}')
    thrusters = [{f'port_{kind}', f'starboard_{kind}'} for kind in ('thrust', 'command', 'pwm')]
    if not any(pair <= set(columns) for pair in thrusters):
        raise InputError(
            f'{path} has no pair of thrusters: looked for port_thrust_n and starboard_thrust_n, or '
            f'port_command and starboard_command, or port_pwm_us and starboard_pwm_us; '
            f'found {listed_names(names)}'
        )
    motion = set(columns) & {'surge', 'sway', 'yaw_rate', 'heading', 'x', 'east'}
    if not motion:
        raise InputError(
            f'{path} has no motion: looked for surge_m_s, sway_m_s, yaw_rate_rad_s, heading_rad, '
            f'heading_deg, x_m and y_m; found {listed_names(names)}'
        )
    return columns


def _thrusters(
    path: str | Path, found: dict[str, np.ndarray], remarks: dict[str, str]
) -> tuple[str, np.ndarray, np.ndarray]:
    if 'port_thrust' in found and 'starboard_thrust' in found:
        return FORCE, found['port_thrust'], found['starboard_thrust']
    if 'port_pwm' in found and 'starboard_pwm' in found:
        neutral = remark_number(path, remarks, 'pwm_neutral_us') or USUAL_NEUTRAL
        span = (remark_number(path, remarks, 'pwm_full_us') or USUAL_FULL) - neutral
        if not span:
            raise InputError(
                f'{path}: pwm_neutral_us and pwm_full_us are the same: state the pulses of no thrust '
                f'and of full thrust ahead'
            )
        port, starboard = ((found[f'{side}_pwm'] - neutral) / span for side in ('port', 'starboard'))
    else:
        port, starboard = found['port_command'], found['starboard_command']
    most = max((float(np.nanmax(np.abs(c))) for c in (port, starboard) if np.isfinite(c).any()), default=0.0)
    if most > LARGEST_COMMAND:
        raise InputError(
            f'{path}: commands reach {most:g}: normalise them to -1 .. 1, or name them port_thrust_n and '
            f'starboard_thrust_n if they are forces'
        )
    return COMMAND, port, starboard
