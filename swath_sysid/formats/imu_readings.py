"""The readings of an IMU from any record: a bag's messages as they are, other trials as an IMU would have sent them."""
from dataclasses import replace

import numpy as np

from swath_sysid.formats.bags import ImuRecord, imu_values, is_bag, read_imu
from swath_sysid.formats.reading import read_trial


def read_readings(path, topic=None, *, frame='flu', mounting=(0.0, 0.0, 0.0)):
    """Read the messages of an IMU.

    Parameters
    ----------
    path : str or Path
        A bag, or a trial in CSV or MTi text.
    topic : str, optional
        Needed only if a bag holds several of type sensor_msgs/msg/Imu.
    frame, mounting : str and tuple of 3 floats
        As for `read_trial`; not applied to bags, whose messages stay as they are.

    Returns
    -------
    ImuRecord

    Raises
    ------
    InputError
        See `read_imu` and `read_trial`.
    """
    try:
        bag = is_bag(path)
    except OSError:
        bag = False  # read_trial says what is wrong
    if bag:
        return read_imu(path, topic)
    trial = read_trial(path, topic=topic, frame=None if frame == 'flu' else frame, mounting=mounting)
    stamps = np.round((trial.time - trial.time[0]) * 1e9).astype(np.int64)
    return ImuRecord(stamps, imu_values(replace(trial, yaw_rate=None)), in_craft_axes=True, advice=trial.advice)
