"""Forecasts as the values of the messages that publish them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.intake import NANOSECOND, NOT_MEASURED
from swath_sysid.attitude.prediction.forecast import Forecast
from swath_sysid.attitude.prediction.hull_track import LARGEST_ANGLE_VARIANCE, LARGEST_RATE_VARIANCE

NOT_GIVEN = (NOT_MEASURED, *8 * (0.0,))  #: Covariance that a sensor_msgs/Imu does not give.
UNKNOWN_PLACE_VARIANCE = 100.0  #: m^2 (and per s^2 and s^4); the horizontal motion is not forecast.

_NOTHING_KNOWN = 0.0, 0.0, LARGEST_ANGLE_VARIANCE, 0.0, LARGEST_RATE_VARIANCE


class AttitudeForecast(NamedTuple):
    """What a sensor_msgs/Imu of a forecast says, in the axes of the craft (FLU in ENU)."""

    stamp_ns: int  #: The time it is for.
    orientation: tuple[float, ...]  #: Quaternion x, y, z, w.
    orientation_covariance: tuple[float, ...]
    rates: tuple[float, ...]  #: Body rates, rad/s.
    rates_covariance: tuple[float, ...]


@dataclass(frozen=True)
class HorizonForecast:
    """What a trajectory_msgs/JointTrajectory of a forecast says."""

    stamp_ns: int  #: When issued.
    columns: tuple[str, ...]  #: ``roll``, ``roll_std``, ... of the axes that the sensor measures.
    leads_ns: tuple[int, ...]  #: From the stamp.
    positions: np.ndarray  #: (L, columns); Angle and its standard deviation, rad.
    velocities: np.ndarray  #: (L, columns); Euler rate and its standard deviation, rad/s.


def attitude_forecast(
    stamp_ns: int, lead: float, axes: Mapping[str, Sequence[float]], yaw: float, yaw_rate: float
) -> AttitudeForecast:
    """The forecast at one lead, s, as an attitude, with a held heading, rad, and its rate, rad/s. By measured axis:
    angle, rate, angle variance, covariance of both, rate variance.
    """
    roll, roll_rate, roll_variance, _, roll_rate_variance = axes.get('roll', _NOTHING_KNOWN)
    pitch, pitch_rate, pitch_variance, _, pitch_rate_variance = axes.get('pitch', _NOTHING_KNOWN)
    return AttitudeForecast(
        stamp_ns + round(lead / NANOSECOND),
        attitude.quaternion(roll, pitch, yaw),
        _diagonal(roll_variance, pitch_variance, LARGEST_ANGLE_VARIANCE) if axes else NOT_GIVEN,
        attitude.body_rates(roll, pitch, roll_rate, pitch_rate, yaw_rate),
        _diagonal(roll_rate_variance, pitch_rate_variance, LARGEST_RATE_VARIANCE) if axes else NOT_GIVEN,
    )


def attitudes_at_leads(
    forecast: Forecast, stamp_ns: int, yaw: float, yaw_rate: float
) -> tuple[tuple[float, AttitudeForecast], ...]:
    """Each lead, s, and the forecast at it as an attitude with covariance; see `attitude_forecast`."""
    moments = {
        axis: np.column_stack(
            [ahead.angle, ahead.rate, ahead.covariance[:, 0, 0], ahead.covariance[:, 0, 1], ahead.covariance[:, 1, 1]]
        ).tolist()
        for axis, ahead in forecast.axes.items()
    }
    return tuple(
        (lead, attitude_forecast(stamp_ns, lead, {axis: rows[k] for axis, rows in moments.items()}, yaw, yaw_rate))
        for k, lead in enumerate(forecast.leads.tolist())
    )


def horizon_forecast(forecast: Forecast, stamp_ns: int) -> HorizonForecast:
    """The forecast over the horizon as a table."""
    positions, velocities = np.empty((2, forecast.leads.size, 2 * len(forecast.axes)))
    for place, ahead in enumerate(forecast.axes.values()):
        positions[:, 2 * place], velocities[:, 2 * place] = ahead.angle, ahead.rate
        np.sqrt(ahead.covariance[:, 0, 0], out=positions[:, 2 * place + 1])
        np.sqrt(ahead.covariance[:, 1, 1], out=velocities[:, 2 * place + 1])
    return HorizonForecast(
        stamp_ns,
        tuple([f'{axis}{kind}' for axis in forecast.axes for kind in ('', '_std')]),
        tuple(np.round(forecast.leads / NANOSECOND).astype(np.int64).tolist()),
        positions,
        velocities,
    )


def _diagonal(about_x: float, about_y: float, about_z: float):
    return (about_x, 0.0, 0.0, 0.0, about_y, 0.0, 0.0, 0.0, about_z)


_NOTHING_KNOWN_OF_POSE = np.diag([UNKNOWN_PLACE_VARIANCE] * 2 + [0.0] * 3 + [LARGEST_ANGLE_VARIANCE])
_NOTHING_KNOWN_OF_TWIST = np.diag([UNKNOWN_PLACE_VARIANCE] * 3 + [0.0] * 2 + [LARGEST_RATE_VARIANCE])
_HEAVE_AND_ATTITUDE = np.ix_((0, 3, 4), (0, 3, 4))


class PointForecast(NamedTuple):
    """What the messages of a point at one lead say: in a level frame that moves with the craft's mean."""

    name: str
    lead: float  #: s.
    stamp_ns: int  #: The time it is for.
    position: tuple[float, ...]  #: m from the sensor's mean place; z from the point's mean level.
    orientation: tuple[float, ...]  #: Quaternion x, y, z, w.
    pose_covariance: np.ndarray  #: (6, 6); Of x, y, z and the rotations about them.
    linear: tuple[float, ...]  #: In the axes of the craft then, m/s.
    angular: tuple[float, ...]  #: rad/s.
    twist_covariance: np.ndarray  #: (6, 6)
    acceleration: float  #: Upwards, m/s^2.
    acceleration_variance: float


def points_at_leads(forecast: Forecast, stamp_ns: int) -> list[PointForecast]:
    """The forecast of each point at each of its leads."""
    if not forecast.points:
        return []
    roll, pitch = forecast.axes['roll'], forecast.axes['pitch']
    attitudes = np.column_stack([roll.angle, pitch.angle, roll.rate, pitch.rate]).tolist()
    return [
        _point_forecast(name, lead, stamp_ns, at, motion.place, motion.mean[k].tolist(), motion.covariance[k])
        for name, motion in forecast.points.items()
        for k, (lead, at) in enumerate(zip(forecast.leads.tolist(), attitudes, strict=True))
    ]


def _point_forecast(
    name: str,
    lead: float,
    stamp_ns: int,
    at: Sequence[float],
    place: Sequence[float],
    motion: Sequence[float],
    covariance: np.ndarray,
):
    heave, velocity, acceleration = motion
    roll, pitch, roll_rate, pitch_rate = at
    orientation = attitude.quaternion(roll, pitch, 0.0)
    back = attitude.conjugate(*orientation)
    angular = attitude.body_rates(roll, pitch, roll_rate, pitch_rate, 0.0)
    level = attitude.rotate(orientation, *place)
    across = attitude.rotate(orientation, *_cross(angular, place))
    linear = attitude.rotate(back, across[0], across[1], velocity)
    pose = _NOTHING_KNOWN_OF_POSE.copy()
    pose[2:5, 2:5] = covariance[_HEAVE_AND_ATTITUDE]
    # the same either way but along the world's vertical, here in the axes of the craft
    up = np.array(attitude.rotate(back, 0.0, 0.0, 1.0))
    twist = _NOTHING_KNOWN_OF_TWIST.copy()
    twist[:3, :3] += (covariance[1, 1] - UNKNOWN_PLACE_VARIANCE) * (up[:, None] * up)
    twist[3:5, 3:5] = covariance[5:, 5:]
    twist[:3, 3:5] = up[:, None] * covariance[1, 5:]
    twist[3:5, :3] = twist[:3, 3:5].T
    return PointForecast(
        name,
        lead,
        stamp_ns + round(lead / NANOSECOND),
        (*level[:2], heave),
        orientation,
        pose,
        linear,
        angular,
        twist,
        acceleration,
        float(covariance[2, 2]),
    )


def _cross(a: Sequence[float], b: Sequence[float]):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
