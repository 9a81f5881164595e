"""CSV records of manoeuvres: thrusters, speeds, yaw, position."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.columns import Table, read_table
from swath_sysid.formats.files import shown
from swath_sysid.formats.text_tables import write_table
from swath_sysid.formats.vocabulary import MANOEUVRE_QUANTITIES
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre
from swath_sysid.manoeuvring.motion.trial import COMMAND, FORCE, MEASURED, ManoeuvringTrial

FRAMES = ('enu', 'ned')
USUAL_NEUTRAL, USUAL_FULL = 1500.0, 1900.0  #: us; pulses for no thrust and for full thrust ahead.
LARGEST_COMMAND = 1.5  #: A larger command is not normalised.


def read_manoeuvring_csv(
    path: str | Path, frame: str | None = None, columns: Mapping[str, str] | None = None
) -> ManoeuvringTrial:
    """Read a record of a manoeuvre from a CSV file or a table of another format.

    Columns, in any order: the time as in trials; ``port_thrust_n`` and ``starboard_thrust_n``, or ``port_command`` and
    ``starboard_command``, or ``port_pwm_us`` and ``starboard_pwm_us``; any of ``surge_m_s``, ``sway_m_s``,
    ``yaw_rate_rad_s`` or ``_deg_s``, ``heading_rad`` or ``_deg``, ``x_m`` and ``y_m`` (or ``east_m`` and
    ``north_m``). Comment lines above may state ``# frame: ned``, ``# lever_m: 1.0``, ``# length_m: 4.9``, and of
    pulses ``# pwm_neutral_us: 1500`` and ``# pwm_full_us: 1900`` (full ahead), which are the usual ones. Empty cells
    are missing values.

    Args:
        path: Of the file.
        frame: ``enu`` or ``ned``; by default what the file states, else not stated.
        columns: Columns by the quantity that they hold, as in `read_trial`.

    Returns:
        The channels in SI units, for `prepare_runs`.

    Raises:
        InputError: The file cannot be read, or lacks time, thrust or motion; the sentence names what was looked for.

    Example:
        >>> trial = read_manoeuvring_csv('runs/zigzag_20.csv')
        >>> trial.thrust_input, sorted(trial.measured())
        ('force', ['heading', 'surge', 'sway', 'x', 'y', 'yaw_rate'])
    """
    table = read_table(path, MANOEUVRE_QUANTITIES, _lacking, assigned=columns)
    found = table.readings()
    thrust_input, port, starboard = _thrusters(table, found)
    frame = (frame or table.remarks.get('frame', '')).lower() or None
    if frame not in (None, *FRAMES):
        raise InputError(f"{path} states the frame '{shown(frame)}': state enu or ned")
    if 'x' not in found and 'east' in found and 'north' in found:
        found['x'], found['y'] = (found[name] for name in (('north', 'east') if frame == 'ned' else ('east', 'north')))
    time = table.time()
    if not np.isfinite(time).any():
        raise InputError(f'{path} has no readable time: check its time column')
    return ManoeuvringTrial(
        time,
        port,
        starboard,
        thrust_input,
        **{name: found[name] for name in MEASURED if name in found},
        frame=frame,
        lever=table.remark('lever_m'),
        length=table.remark('length_m'),
        source=str(path),
        advice=table.advice,
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


def _lacking(found: set[str]) -> str:
    if not any({f'port_{kind}', f'starboard_{kind}'} <= found for kind in ('thrust', 'command', 'pwm')):
        return (
            'pair of thrusters: looked for port_thrust_n and starboard_thrust_n, or port_command and '
            'starboard_command, or port_pwm_us and starboard_pwm_us'
        )
    if not found & {*MEASURED, 'east'}:
        return 'motion: looked for surge_m_s, sway_m_s, yaw_rate_rad_s, heading_rad, heading_deg, x_m and y_m'
    return ''


def _thrusters(table: Table, found: dict[str, np.ndarray]) -> tuple[str, np.ndarray, np.ndarray]:
    if 'port_thrust' in found and 'starboard_thrust' in found:
        return FORCE, found['port_thrust'], found['starboard_thrust']
    if 'port_pwm' in found and 'starboard_pwm' in found:
        neutral, full = (
            1e-6 * (table.remark(f'pwm_{name}_us') or usual)
            for name, usual in (('neutral', USUAL_NEUTRAL), ('full', USUAL_FULL))
        )
        if full == neutral:
            raise InputError(f'{table.path}: pwm_neutral_us is pwm_full_us: state the pulses of no and of full thrust')
        port, starboard = ((found[f'{side}_pwm'] - neutral) / (full - neutral) for side in ('port', 'starboard'))
    else:
        port, starboard = found['port_command'], found['starboard_command']
    most = max((float(np.nanmax(np.abs(c))) for c in (port, starboard) if np.isfinite(c).any()), default=0.0)
    if most > LARGEST_COMMAND:
        raise InputError(
            f'{table.path}: commands reach {most:g}: normalise them to -1 .. 1, or name them port_thrust_n and '
            f'starboard_thrust_n if they are forces'
        )
    return COMMAND, port, starboard
