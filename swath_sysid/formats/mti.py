"""Xsens MTi text exports, as MT Manager writes them."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation, tilt_angles
from swath_sysid.attitude.motion.cleaning import ACCEL, GYRO, QUATERNION, assemble_trial
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.account import in_words
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import reading
from swath_sysid.formats.text_tables import Progress, read_columns, read_head
from swath_sysid.formats.vocabulary import listed_names

SAMPLE_TIME_FINE_HZ = 10_000  #: Ticks a second of the sensor's clock.

#: By column, the type of the counter, which starts again behind its largest number.
CLOCKS = {'SampleTimeFine': 'uint32', 'PacketCounter': 'uint16', 'Counter': 'uint16'}
#: Column to reading: angles in deg, the quaternion with its real part first, rates in rad/s, acceleration in m/s^2.
READINGS = {
    **dict(zip(('Roll', 'Pitch', 'Yaw'), ('roll', 'pitch', 'yaw'), strict=True)),
    **dict(zip(('Quat_q1', 'Quat_q2', 'Quat_q3', 'Quat_q0'), QUATERNION, strict=True)),
    **dict(zip(('Gyr_X', 'Gyr_Y', 'Gyr_Z'), GYRO, strict=True)),
    **dict(zip(('Acc_X', 'Acc_Y', 'Acc_Z'), ACCEL, strict=True)),
}

#: Mat[row][column] turns sensor vectors into world vectors; its last row is the world's up in sensor axes.
MATRIX_LAST_ROW = ('Mat[3][1]', 'Mat[3][2]', 'Mat[3][3]')

MOTION = [*(name for name in READINGS if not name.startswith('Acc')), *MATRIX_LAST_ROW]


def is_mti(names: Sequence[str]) -> bool:
    """Whether a table with columns of these names is an MTi export."""
    known = 'Counter' in names and not {*READINGS, *MATRIX_LAST_ROW}.isdisjoint(names)
    return known or 'SampleTimeFine' in names or 'PacketCounter' in names


def read_mti(
    path: str | Path,
    frame: str | None = None,
    mounting: tuple[float, float, float] | None = None,
    progress: Progress | None = None,
) -> Trial:
    """Read a trial from an Xsens MTi text export; parameters and errors are those of `read_trial`. Time, from the first
    sample, is SampleTimeFine (0.1 ms), or PacketCounter over the update rate in the comments, both unwrapped. Without a
    frame it is taken as delivered, in ENU.
    """
    with reading(path):
        head = read_head(path)
        wanted = [name for name in (*CLOCKS, *READINGS, *MATRIX_LAST_ROW) if name in head.names]
        for kind, sought in (('roll or pitch motion', MOTION), ('time', CLOCKS)):
            if not set(sought) & set(wanted):
                raise InputError(
                    f'{path} holds no {kind}: looked for {", ".join(sought)}, found {listed_names(head.names)}; export '
                    'one of them in MT Manager'
                )
        values, losses = read_columns(path, head, [head.names.index(name) for name in wanted], progress)
    columns = dict(zip(wanted, values, strict=True))
    readings = {reading: columns[name] for name, reading in READINGS.items() if name in columns}
    readings |= {angle: np.radians(readings[angle]) for angle in ('roll', 'pitch', 'yaw') if angle in readings}
    if 'roll' not in readings and all(name in columns for name in MATRIX_LAST_ROW):
        readings['roll'], readings['pitch'] = tilt_angles(*(columns[name] for name in MATRIX_LAST_ROW))
    time = _time(path, columns, head.remarks)
    return assemble_trial(
        time, readings, Installation(frame or 'flu', mounting), source=str(path), advice=in_words(losses, path)
    )


def _time(path: str | Path, columns: dict[str, np.ndarray], remarks: dict[str, str]) -> np.ndarray:
    """Seconds from the first sample."""
    rates = dict.fromkeys(CLOCKS, update_rate(remarks)) | {'SampleTimeFine': SAMPLE_TIME_FINE_HZ}
    for name, kind in CLOCKS.items():
        rate = rates[name]
        if name in columns and rate is not None and np.isfinite(columns[name]).any():
            return _unwrapped(columns[name], np.iinfo(kind).max + 1) / rate
    raise InputError(
        f'{path} holds no time: its SampleTimeFine is empty or missing, so give PacketCounter and a '
        f"line '// Update Rate: 100.0Hz' above the columns"
    )


def update_rate(remarks: dict[str, str]) -> float | None:
    """The update rate that the comment lines give, Hz, or None."""
    for key in ('update rate', 'sample rate', 'output rate'):
        number = re.match(r'\d+([.,]\d+)?', remarks.get(key, ''))
        if number and float(number[0].replace(',', '.')) > 0:
            return float(number[0].replace(',', '.'))
    return None


def _unwrapped(counter: np.ndarray, period: int) -> np.ndarray:
    """A counter that starts again at `period`, from its first value on, without the jumps."""
    unwrapped, counted = counter.copy(), np.isfinite(counter)
    unwrapped[counted] = np.unwrap(counter[counted], period=period)
    return unwrapped - unwrapped[counted][0]
