"""Motion at named points of the craft, away from the sensor: the lever arm with the whole rotation.

With u(roll, pitch) the world's vertical in the craft's axes and r the point, its height above the sensor is u . r, and
its vertical velocity and acceleration are the time derivatives (Fossen 2021, section 2.2, third row of the rotation).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

ATTITUDE = ('roll', 'pitch', 'roll_rate', 'pitch_rate')  #: What is measured and forecast of every craft.
POINT_MOTION = ('heave', 'vertical_velocity', 'vertical_acceleration')  #: What is forecast at each point.


@dataclass(frozen=True)
class Point:
    """A point of the craft."""

    name: str
    place: tuple[float, float, float]  #: m from the sensor, x forward, y port, z up.


@dataclass(frozen=True)
class PointMotion:
    """Vertical motion of a point at L leads."""

    place: tuple[float, float, float]  #: m from the sensor.
    mean: np.ndarray  #: (L, 3); `POINT_MOTION`: m about the mean level, m/s, m/s^2.
    covariance: Any  #: (L, 7, 7), or None; of these and of roll, pitch and their rates.

    def chosen(self, places: Any) -> 'PointMotion':
        """At some of the leads, by their places."""
        return PointMotion(self.place, self.mean[places], self.covariance[places])


def height_partials(
    place: Sequence[float], roll: float | np.ndarray, pitch: float | np.ndarray
) -> dict[tuple[int, int], Any]:
    """Height u . r of a point r, m, and its derivatives by their orders in roll and pitch (L,), rad, up to three."""
    x, y, z = place
    # a derivative of a sine is the sine a quarter turn on
    sine_roll, cosine_roll, sine_pitch, cosine_pitch = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    athwart = [y * sine_roll + z * cosine_roll, y * cosine_roll - z * sine_roll]
    along = [cosine_pitch, -sine_pitch]
    sign = (1.0, 1.0, -1.0, -1.0)
    partials = {}
    for in_roll in range(4):
        for in_pitch in range(4 - in_roll):
            turned = sign[in_roll] * sign[in_pitch]
            partials[in_roll, in_pitch] = turned * athwart[in_roll % 2] * along[in_pitch % 2]
    for in_pitch, sine in enumerate((sine_pitch, cosine_pitch, -sine_pitch, -cosine_pitch)):
        partials[0, in_pitch] = partials[0, in_pitch] - x * sine
    return partials


def point_motion(
    place: tuple[float, float, float],
    mean_attitude: tuple[float, float],
    motion: np.ndarray,
    covariance: np.ndarray | None = None,
) -> PointMotion:
    """Vertical motion at a point, m from the sensor, from that at the sensor, covariance (L, 9, 9) to first order.

    Motion (L, 9): heave, vertical velocity and acceleration, roll and pitch acceleration, roll, pitch and their rates.
    At the mean roll and pitch, rad, the point is at its mean level.
    """
    heave, velocity, acceleration, roll_acc, pitch_acc, roll, pitch, roll_rate, pitch_rate = motion.T

    h = height_partials(place, roll, pitch)

    def turning(i: int, j: int) -> np.ndarray:
        """(d/dt)^2 of u . r, differentiated i times in roll and j times in pitch."""
        return (
            h[i + 2, j] * roll_rate**2
            + 2.0 * h[i + 1, j + 1] * roll_rate * pitch_rate
            + h[i, j + 2] * pitch_rate**2
            + h[i + 1, j] * roll_acc
            + h[i, j + 1] * pitch_acc
        )

    level = height_partials(place, *mean_attitude)[0, 0]
    velocity_of_turning = h[1, 0] * roll_rate + h[0, 1] * pitch_rate
    mean = np.stack([heave + h[0, 0] - level, velocity + velocity_of_turning, acceleration + turning(0, 0)], axis=1)
    if covariance is None:
        return PointMotion(place, mean, None)
    of_accelerations, of_angles, of_rates = (slice(first, first + 2) for first in range(3, motion.shape[1], 2))
    slope = np.stack([h[1, 0], h[0, 1]], axis=1)
    changing = np.stack(
        [h[2, 0] * roll_rate + h[1, 1] * pitch_rate, h[1, 1] * roll_rate + h[0, 2] * pitch_rate], axis=1
    )
    jacobian = np.zeros((roll.size, mean.shape[1] + len(ATTITUDE), motion.shape[1]))
    jacobian[:, : mean.shape[1], : mean.shape[1]] = np.eye(mean.shape[1])
    jacobian[:, mean.shape[1] :, of_angles.start :] = np.eye(len(ATTITUDE))
    # each row below is the derivative in time of the one above
    jacobian[:, 0, of_angles] = jacobian[:, 1, of_rates] = jacobian[:, 2, of_accelerations] = slope
    jacobian[:, 1, of_angles], jacobian[:, 2, of_rates] = changing, 2.0 * changing
    jacobian[:, 2, of_angles] = np.stack([turning(1, 0), turning(0, 1)], axis=1)
    return PointMotion(place, mean, jacobian @ covariance @ jacobian.transpose(0, 2, 1))
