"""The readings of an IMU from any record: a bag's messages as they are, other trials as an IMU would have sent them."""
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.motion.attitude import body_rates, quaternion
from swath_sysid.attitude.motion.intake import NOT_MEASURED, ImuReading
from swath_sysid.common.advice import Advice
from swath_sysid.formats.bags import (
    FORCE,
    FORCE_COVARIANCE,
    IMU_VALUES,
    ORIENTATION,
    ORIENTATION_COVARIANCE,
    RATES,
    RATES_COVARIANCE,
    is_bag,
    read_imu,
)
from swath_sysid.formats.reading import read_trial

AT_ONCE = 10_000


@dataclass(frozen=True)
class ImuReadings:
    """The messages of one IMU.

    Attributes
    ----------
    topic : str
        Empty where the record is no bag.
    stamps : ndarray of int64, shape (N,)
        header.stamp, ns.
    values : ndarray, shape (N, 37)
        The numbers of each message in the order of the message definition.
    in_craft_axes : bool
        Whether frame and mounting of the sensor were taken into account already.
    advice : tuple of Advice
    """

    topic: str
    stamps: np.ndarray
    values: np.ndarray
    in_craft_axes: bool
    advice: tuple[Advice, ...] = ()

    def __len__(self):
        return len(self.stamps)

    def __iter__(self):
        """One `ImuReading` after the other."""
        parts = ORIENTATION, ORIENTATION_COVARIANCE, RATES, RATES_COVARIANCE, FORCE, FORCE_COVARIANCE
        for first in range(0, len(self), AT_ONCE):
            values = self.values[first:first + AT_ONCE]
            stamps = self.stamps[first:first + AT_ONCE].tolist()
            yield from map(ImuReading, stamps, *(values[:, part].tolist() for part in parts))


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
    ImuReadings

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
        record = read_imu(path, topic)
        return ImuReadings(record.topic, record.stamps, record.values, False, record.advice)
    trial = read_trial(path, topic=topic, frame=None if frame == 'flu' else frame, mounting=mounting)
    return ImuReadings(
        '', np.round((trial.time - trial.time[0]) * 1e9).astype(np.int64), imu_values(trial), True, trial.advice
    )


def imu_values(trial):
    """The numbers of the messages that an IMU in the craft's axes would have sent, without yaw.

    An angle or rate that the trial does not hold is zero, unless it holds none of them: then the
    covariance says that it is not measured.

    Parameters
    ----------
    trial : Trial

    Returns
    -------
    ndarray, shape (N, 37)
    """
    count = trial.time.size
    values = np.zeros((count, IMU_VALUES))

    def known(channel):
        return np.zeros(count) if channel is None else channel

    roll, pitch = known(trial.roll), known(trial.pitch)
    for columns, covariance, parts, channels in (
        (ORIENTATION, ORIENTATION_COVARIANCE, quaternion(roll, pitch, np.zeros(count)), (trial.roll, trial.pitch)),
        (
            RATES, RATES_COVARIANCE,
            body_rates(roll, pitch, known(trial.roll_rate), known(trial.pitch_rate), np.zeros(count)),
            (trial.roll_rate, trial.pitch_rate),
        ),
        (
            FORCE, FORCE_COVARIANCE, [known(c) for c in (trial.accel_x, trial.accel_y, trial.accel_z)],
            (trial.accel_x, trial.accel_y, trial.accel_z),
        ),
    ):  # fmt: skip
        values[:, columns] = np.stack(parts, axis=1)
        if all(channel is None for channel in channels):
            values[:, covariance.start] = NOT_MEASURED
    return values
