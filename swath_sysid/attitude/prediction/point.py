"""Motion at named points of the craft, away from the sensor: the lever arm with the whole rotation.

With u(roll, pitch) the world's vertical in the craft's axes and r the point, its height above the sensor is u . r, its
vertical velocity and acceleration the derivatives of that in time (Fossen 2021, section 2.2, of the third row of the
rotation matrix).
"""
from dataclasses import dataclass

import numpy as np

POINT_MOTION = ('heave', 'vertical_velocity', 'vertical_acceleration')


@dataclass(frozen=True)
class Point:
    """A point of the craft.

    Attributes
    ----------
    name : str
    place : tuple of 3 floats
        m from the sensor, x forward, y port, z up.
    """

    name: str
    place: tuple[float, float, float]


@dataclass(frozen=True)
class PointMotion:
    """Vertical motion of a point at L leads.

    Attributes
    ----------
    mean : ndarray, shape (L, 3)
        `POINT_MOTION`: m about the mean level, m/s, m/s^2.
    covariance : ndarray, shape (L, 3, 3)
    """

    mean: np.ndarray
    covariance: np.ndarray


def vertical_partial(roll, pitch, in_roll, in_pitch):
    """Partial derivative of the world's vertical in the craft's axes, so many times in roll and in pitch.

    Parameters
    ----------
    roll, pitch : ndarray, shape (L,)
        rad.
    in_roll, in_pitch : int

    Returns
    -------
    ndarray, shape (L, 3)
    """
    # a derivative of a sine is the sine a quarter turn on
    a, b = roll + 0.5 * np.pi * in_roll, pitch + 0.5 * np.pi * in_pitch
    along = -np.sin(b) if in_roll == 0 else np.zeros_like(b)
    return np.stack([along, np.sin(a) * np.cos(b), np.cos(a) * np.cos(b)], axis=-1)


def point_motion(place, mean_attitude, motion, covariance):
    """Vertical motion at a point from that at the sensor, with its covariance to first order.

    Parameters
    ----------
    place : sequence of 3 floats
        m from the sensor.
    mean_attitude : tuple of 2 floats
        Roll and pitch about which the craft moves, rad: there the point is at its mean level.
    motion : ndarray, shape (L, 9)
        Heave, vertical velocity and acceleration, roll and pitch acceleration, roll, pitch and their rates.
    covariance : ndarray, shape (L, 9, 9)
        Of these.

    Returns
    -------
    PointMotion
    """
    r = np.asarray(place, dtype=float)
    heave, velocity, acceleration, roll_acc, pitch_acc, roll, pitch, roll_rate, pitch_rate = motion.T

    def h(in_roll, in_pitch):
        return vertical_partial(roll, pitch, in_roll, in_pitch) @ r

    def turning(i, j):
        """(d/dt)^2 of u . r, differentiated i times in roll and j times in pitch."""
        return (
            h(i + 2, j) * roll_rate**2 + 2.0 * h(i + 1, j + 1) * roll_rate * pitch_rate + h(i, j + 2) * pitch_rate**2
            + h(i + 1, j) * roll_acc + h(i, j + 1) * pitch_acc
        )  # fmt: skip

    level = (vertical_partial(*np.asarray(mean_attitude)[:, None], 0, 0) @ r)[0]
    velocity_of_turning = h(1, 0) * roll_rate + h(0, 1) * pitch_rate
    mean = np.stack([heave + h(0, 0) - level, velocity + velocity_of_turning, acceleration + turning(0, 0)], axis=1)
    zero, one = np.zeros_like(roll), np.ones_like(roll)
    jacobian = np.stack([
        [one, zero, zero, zero, zero, h(1, 0), h(0, 1), zero, zero],
        [zero, one, zero, zero, zero, h(2, 0) * roll_rate + h(1, 1) * pitch_rate,
         h(1, 1) * roll_rate + h(0, 2) * pitch_rate, h(1, 0), h(0, 1)],
        [zero, zero, one, h(1, 0), h(0, 1), turning(1, 0), turning(0, 1),
         2.0 * (h(2, 0) * roll_rate + h(1, 1) * pitch_rate), 2.0 * (h(1, 1) * roll_rate + h(0, 2) * pitch_rate)],
    ]).transpose(2, 0, 1)  # fmt: skip
    return PointMotion(mean, jacobian @ covariance @ jacobian.transpose(0, 2, 1))
