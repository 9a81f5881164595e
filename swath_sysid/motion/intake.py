"""The intake: one IMU message, as plain numbers, to a sample of the craft's motion."""
from math import inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from swath_sysid.motion import attitude
from swath_sysid.motion.cleaning import LARGEST_VALUES
from swath_sysid.motion.sensing import Installation

NOT_FINITE = 'not-finite'
ABSURD = 'absurd-value'
BAD_QUATERNION = 'bad-quaternion'
NO_ORIENTATION = 'no-orientation'
UNKNOWN_COVARIANCE = 'unknown-covariance'
EMPTY = 'nothing-usable'
INTAKE_REASONS = (NOT_FINITE, ABSURD, BAD_QUATERNION, NO_ORIENTATION, UNKNOWN_COVARIANCE, EMPTY)
"""Everything that is counted; only the last leaves the whole sample out."""

NOT_MEASURED = -1.0
"""First element of a covariance whose quantity the sensor does not measure (sensor_msgs/Imu)."""

NANOSECOND = 1e-9
_UNKNOWN = (nan, nan)


class ImuReading(NamedTuple):
    """An IMU message as plain numbers, in the axes of the sensor.

    Attributes
    ----------
    stamp_ns : int
        header.stamp.
    orientation : tuple of 4 floats
        Quaternion x, y, z, w.
    orientation_covariance : sequence of 9 floats
        rad^2, by rows; -1 in the first place: no orientation; all zero: unknown.
    rates : tuple of 3 floats
        rad/s.
    rates_covariance : sequence of 9 floats
    force : tuple of 3 floats
        Specific force, m/s^2.
    force_covariance : sequence of 9 floats
    """

    stamp_ns: int
    orientation: tuple[float, float, float, float]
    orientation_covariance: tuple[float, ...]
    rates: tuple[float, float, float]
    rates_covariance: tuple[float, ...]
    force: tuple[float, float, float]
    force_covariance: tuple[float, ...]


class CraftSample(NamedTuple):
    """The motion of the craft at one stamp. NaN marks what is not measured or not known.

    Attributes
    ----------
    stamp_ns : int
    roll, pitch, roll_rate, pitch_rate : float
        Euler angles and rates, rad and rad/s.
    accel_x, accel_y, accel_z : float
        Specific force in the craft's axes, m/s^2.
    roll_variance, pitch_variance, roll_rate_variance, pitch_rate_variance : float
        rad^2 and rad^2/s^2.
    yaw, yaw_rate : float
        rad and rad/s.
    """

    stamp_ns: int
    roll: float
    pitch: float
    roll_rate: float
    pitch_rate: float
    accel_x: float
    accel_y: float
    accel_z: float
    roll_variance: float
    pitch_variance: float
    roll_rate_variance: float
    pitch_rate_variance: float
    yaw: float
    yaw_rate: float

    @property
    def stamp(self):
        """The stamp in seconds."""
        return self.stamp_ns * NANOSECOND

    @property
    def motion(self):
        """Angles, rates and accelerations: the seven channels in the order of a window."""
        return self[1:8]


class Taken(NamedTuple):
    """What one message gave.

    Attributes
    ----------
    sample : CraftSample or None
        None: nothing in it can be used.
    reasons : tuple of str
        From `INTAKE_REASONS`: what is to be counted.
    """

    sample: CraftSample | None
    reasons: tuple[str, ...]


def take_in(reading, installation):
    """Turn one IMU message into the motion of the craft; what cannot be used becomes NaN.

    Without an orientation the body rates stand for the Euler rates, which is good for small
    angles.

    Parameters
    ----------
    reading : ImuReading
    installation : Installation

    Returns
    -------
    Taken
    """
    reasons = []
    orientation = _orientation(reading, reasons)
    rates = _vector(reading.rates, reading.rates_covariance[0], LARGEST_VALUES['rate'], reasons)
    force = _vector(reading.force, reading.force_covariance[0], LARGEST_VALUES['acceleration'], reasons)
    if orientation is None and rates is None:
        return Taken(None, (*reasons, EMPTY))
    angle_variances = rate_variances = _UNKNOWN
    roll = pitch = yaw = roll_rate = pitch_rate = yaw_rate = nan
    if orientation is not None:
        roll, pitch, yaw = map(float, attitude.euler_angles(*installation.orientation(*orientation)))
        angle_variances = _variances(reading.orientation_covariance, installation)
    if rates is not None:
        turned = installation.vector(*rates)
        if orientation is not None:
            turned = attitude.euler_rates(roll, pitch, *turned)
        roll_rate, pitch_rate, yaw_rate = map(float, turned)
        rate_variances = _variances(reading.rates_covariance, installation)
    if (orientation is not None and angle_variances is _UNKNOWN) or (rates is not None and rate_variances is _UNKNOWN):
        reasons.append(UNKNOWN_COVARIANCE)
    accelerations = (nan, nan, nan) if force is None else map(float, installation.vector(*force))
    return Taken(
        CraftSample(
            reading.stamp_ns, roll, pitch, roll_rate, pitch_rate, *accelerations, *angle_variances, *rate_variances,
            yaw, yaw_rate,
        ),
        tuple(reasons),
    )


def _orientation(reading, reasons):
    """The quaternion, None where it is none."""
    quaternion = reading.orientation
    if reading.orientation_covariance[0] == NOT_MEASURED:
        reasons.append(NO_ORIENTATION)
    elif not all(map(isfinite, quaternion)):
        _note(NOT_FINITE, reasons)
    elif not attitude.is_orientation(*quaternion):
        reasons.append(BAD_QUATERNION)
    else:
        return quaternion
    return None


def _vector(values, flag, largest, reasons):
    """A rate or a force, None where it is not measured or cannot be true."""
    if flag == NOT_MEASURED:
        return None
    x, y, z = values
    if -largest <= x <= largest and -largest <= y <= largest and -largest <= z <= largest:
        return values
    _note(ABSURD if all(map(isfinite, values)) else NOT_FINITE, reasons)
    return None


def _note(reason, reasons):
    if reason not in reasons:
        reasons.append(reason)


def _variances(covariance, installation):
    """Variances about the craft's x and y axes; `_UNKNOWN` where the sensor does not tell."""
    about_x, about_y = covariance[0], covariance[4]
    if not (0.0 < about_x < inf and 0.0 < about_y < inf):
        return _UNKNOWN
    if installation.is_turned:
        sensor = np.reshape(covariance, (3, 3))
        turn = np.array(installation.vector(*np.eye(3)))
        about_x, about_y, _ = np.diag(turn @ sensor @ turn.T).tolist()
        if not (0.0 < about_x < inf and 0.0 < about_y < inf):
            return _UNKNOWN
    return about_x, about_y


STRAIGHT = Installation()
"""A sensor whose axes are those of the craft, FLU."""
