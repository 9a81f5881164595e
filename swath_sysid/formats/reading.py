"""Reading trials, whatever file they are in."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.errors import InputError
from swath_sysid.formats.columns import DEVICE
from swath_sysid.formats.csv_trials import read_csv
from swath_sysid.formats.files import existing, reading
from swath_sysid.formats.registry import BAGS
from swath_sysid.formats.text_tables import Progress

if TYPE_CHECKING:
    from swath_sysid.formats.bags import ImuRecord


def read_trial(
    path: str | Path,
    *,
    topic: str | None = None,
    frame: str | None = None,
    mounting: tuple[float, float, float] | None = None,
    progress: Progress | None = None,
    columns: Mapping[str, str] | None = None,
) -> Trial:
    """Read a trial from a rosbag2 bag, an MTi text export or a table: CSV, or a format of data acquisition.

    The kind of file is found from its content, not from its name. Tables have their columns named as in CSV.

    Args:
        path: Of a file or a bag folder.
        topic: The topic of the IMU, for bags that hold several, or of another message with the attitude.
        frame: ``flu`` or ``frd``: the sensor's axes; by default that stated in a CSV file, else ``flu``.
        mounting: Roll, pitch, yaw of the sensor in the craft, rad; by default that stated in a CSV file or by the
            ``/tf_static`` of a bag, else none.
        progress: Called with 0 to 1 while a long table is read.
        columns: The columns of a table by the quantity that they hold, where their names do not say so, as in
            ``{'roll': 'Phi:deg', 'time': 't:s'}``; as ``device`` the name of the one to read, of several.

    Returns:
        The motion in the craft's axes and SI units, with advice on what was repaired or left out.

    Raises:
        InputError: There is no such file, it cannot be read or is none of these, the choice of the topic is open, a
            column lacks its unit or contradicts another, a value is one that its unit cannot have, or there is no time,
            no roll or pitch motion, or too little of it.

    Example:
        >>> trial = read_trial(records / 'kvlcc2_roll_decay.csv')
        >>> trial.axes, trial.time.size
        (('roll', 'pitch'), 2501)
    """
    from swath_sysid.formats.bags import attitude_table, is_bag, read_bag

    with reading(path):
        path = existing(path)
        if not path.is_file() and not path.is_dir():
            raise InputError(f'{path} is not a regular file: give a trial file or a bag folder')
        if is_bag(path):
            table = attitude_table(path, topic) if topic else None
            if table is None:
                return read_bag(path, topic, frame, mounting, (columns or {}).get(DEVICE))
            trial = read_csv(path, frame, mounting, progress, columns, [table])
            return replace(trial, source=f'{path} {table.name}')
        if path.is_dir():
            raise InputError(f'{path} is a folder without a rosbag2 bag in it: give a trial file or a bag folder')
        if topic:
            raise InputError(f'{path} is not a bag, so it has no topic {topic}: leave the topic out, or give a bag')
        try:
            return read_csv(path, frame, mounting, progress, columns)
        except InputError as error:
            if path.suffix in BAGS:
                raise InputError(
                    f'{path} is named as a bag but is none, and no trial as text either: copy or download it again (a '
                    'few lines of text may stand for a file that git lfs pull brings)'
                ) from error
            raise


def read_readings(
    path: str | Path,
    topic: str | None = None,
    *,
    frame: str | None = None,
    mounting: tuple[float, float, float] | None = None,
    columns: Mapping[str, str] | None = None,
) -> ImuRecord:
    """The IMU messages of a bag, as they are; of other trials, those that an IMU would have sent in craft axes."""
    from swath_sysid.formats.bags import ImuRecord, attitude_table, imu_values, is_bag, read_imu

    try:
        bag = is_bag(path)
    except OSError:
        bag = False  # read_trial says what is wrong
    if bag and not (topic and attitude_table(path, topic)):
        return read_imu(path, topic, (columns or {}).get(DEVICE))
    trial = read_trial(path, topic=topic, frame=frame, mounting=mounting, columns=columns)
    stamps = np.round((trial.time - trial.time[0]) * 1e9).astype(np.int64)
    values = imu_values(replace(trial, yaw_rate=None))
    turned, start = trial.installation or Installation(), float(trial.time[0])
    return ImuRecord(stamps, values, turned=turned, advice=trial.advice, start=start)


def source_hash(path: str | Path) -> str:
    """The SHA-256, hexadecimal, of a file, or of the names and contents of the files in a bag folder."""
    path = Path(path)
    with reading(path):
        if not path.is_dir():
            with open(path, 'rb') as file:
                return hashlib.file_digest(file, 'sha256').hexdigest()
        files = sorted(file for file in path.iterdir() if file.is_file())
        return hashlib.sha256('\0'.join(f'{file.name}\0{source_hash(file)}' for file in files).encode()).hexdigest()
