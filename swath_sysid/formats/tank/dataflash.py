"""ArduPilot logs.

Roll, pitch and yaw are those of ``ATT`` (forward-right-down), with the rates and accelerations of the first ``IMU``, at
its times.
"""

import io
from contextlib import redirect_stderr
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.text_tables import NamedColumns, check_size, damage, of_arrays

#: Fields of the messages, and the columns that they are.
FIELDS = {
    'ATT': {'TimeUS': 'time_us', 'Roll': 'roll_deg', 'Pitch': 'pitch_deg', 'Yaw': 'yaw_deg'},
    'IMU': {'TimeUS': 'time_us'}
    | {f'Gyr{part.upper()}': f'gyro_{part}_rad_s' for part in 'xyz'}
    | {f'Acc{part.upper()}': f'accel_{part}_m_s2' for part in 'xyz'},
}


def tables(path: str | Path) -> list[NamedColumns]:
    """The one table of the attitude."""
    from pymavlink.DFReader import DFReader_binary, DFReader_text

    rows: dict[str, list[list[float]]] = {kind: [] for kind in FIELDS}
    # the library prints the place of every damaged byte
    with redirect_stderr(io.StringIO()) as said:
        with open(path, 'rb') as file:
            reader = DFReader_text if file.read(1) == b'F' else DFReader_binary
        log = reader(str(path))
        while (message := log.recv_match(type=list(FIELDS))) is not None:
            # newer logs number the sensors
            if getattr(message, 'I', 0) == 0:
                fields = FIELDS[message.get_type()]
                rows[message.get_type()].append([_field(message, field) for field in fields])
                check_size(path, len(fields) * len(rows[message.get_type()]))
    if not rows['ATT']:
        raise InputError(f'{path} is an ArduPilot log without messages ATT: log the attitude (LOG_BITMASK)')
    attitude = dict(zip(FIELDS['ATT'].values(), np.array(rows['ATT'], dtype=float).T, strict=True))
    sensor = zip(FIELDS['IMU'].values(), np.array(rows['IMU'], dtype=float).T, strict=bool(rows['IMU']))
    _, at = next(sensor, ('', np.nan))
    for column, values in sensor:
        attitude[column] = np.interp(attitude['time_us'], at, values, left=np.nan, right=np.nan)
    return [of_arrays(attitude, {'frame': 'frd'}, '', damage(shown(said.getvalue())))]


def _field(message: Any, name: str) -> float:
    """A field of a message; older logs count the time in ms."""
    older = name == 'TimeUS' and not hasattr(message, name)
    return 1e3 * message.TimeMS if older else getattr(message, name)
