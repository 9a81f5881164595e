"""Forecasts as the values of the messages that publish them: what every driver sends or writes."""
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.intake import NANOSECOND

UNKNOWN_ANGLE_VARIANCE = math.pi**2
"""rad^2; of a heading, which is not forecast but held, and of an axis that the sensor does not measure."""

UNKNOWN_RATE_VARIANCE = 100.0
"""rad^2/s^2."""

NOT_GIVEN = (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The covariance of a quantity that a sensor_msgs/Imu does not give."""

_NOTHING_KNOWN = 0.0, 0.0, UNKNOWN_ANGLE_VARIANCE, 0.0, UNKNOWN_RATE_VARIANCE


class AttitudeForecast(NamedTuple):
    """What a sensor_msgs/Imu of a forecast says, in the axes of the craft (FLU in ENU).

    Attributes
    ----------
    stamp_ns : int
        The time it is for.
    orientation : tuple of 4 floats
        Quaternion x, y, z, w.
    orientation_covariance : tuple of 9 floats
    rates : tuple of 3 floats
        Body rates, rad/s.
    rates_covariance : tuple of 9 floats
    """

    stamp_ns: int
    orientation: tuple[float, ...]
    orientation_covariance: tuple[float, ...]
    rates: tuple[float, ...]
    rates_covariance: tuple[float, ...]


@dataclass(frozen=True)
class HorizonForecast:
    """What a trajectory_msgs/JointTrajectory of a forecast says.

    Attributes
    ----------
    stamp_ns : int
        When issued.
    columns : tuple of str
        ``roll``, ``roll_std``, ... of the axes that the sensor measures.
    leads_ns : tuple of int
        From the stamp.
    positions : ndarray, shape (L, columns)
        Angle and its standard deviation, rad.
    velocities : ndarray, shape (L, columns)
        Euler rate and its standard deviation, rad/s.
    """

    stamp_ns: int
    columns: tuple[str, ...]
    leads_ns: tuple[int, ...]
    positions: np.ndarray
    velocities: np.ndarray


def attitude_forecast(stamp_ns, lead, axes, yaw, yaw_rate):
    """The forecast at one lead as an attitude with covariance.

    Parameters
    ----------
    stamp_ns : int
        When issued.
    lead : float
        s.
    axes : dict of str to sequence of 5 floats
        By axis that the sensor measures: angle, rate, angle variance, covariance of both, rate variance.
    yaw, yaw_rate : float
        Held heading, rad, and its rate, rad/s.

    Returns
    -------
    AttitudeForecast
    """
    roll, roll_rate, roll_variance, _, roll_rate_variance = axes.get('roll', _NOTHING_KNOWN)
    pitch, pitch_rate, pitch_variance, _, pitch_rate_variance = axes.get('pitch', _NOTHING_KNOWN)
    return AttitudeForecast(
        stamp_ns + round(lead / NANOSECOND),
        attitude.quaternion(roll, pitch, yaw),
        _diagonal(roll_variance, pitch_variance, UNKNOWN_ANGLE_VARIANCE) if axes else NOT_GIVEN,
        attitude.body_rates(roll, pitch, roll_rate, pitch_rate, yaw_rate),
        _diagonal(roll_rate_variance, pitch_rate_variance, UNKNOWN_RATE_VARIANCE) if axes else NOT_GIVEN,
    )


def attitudes_at_leads(forecast, stamp_ns, yaw, yaw_rate):
    """The forecast at each of its leads as an attitude with covariance.

    Parameters
    ----------
    forecast : Forecast
    stamp_ns : int
        When issued.
    yaw, yaw_rate : float
        See `attitude_forecast`.

    Returns
    -------
    tuple of (float, AttitudeForecast)
        Lead, s, and the attitude.
    """
    moments = {
        axis: np.column_stack([
            ahead.angle, ahead.rate, ahead.covariance[:, 0, 0], ahead.covariance[:, 0, 1], ahead.covariance[:, 1, 1]
        ]).tolist()
        for axis, ahead in forecast.axes.items()
    }
    return tuple([
        (lead, attitude_forecast(stamp_ns, lead, {axis: rows[k] for axis, rows in moments.items()}, yaw, yaw_rate))
        for k, lead in enumerate(forecast.leads.tolist())
    ])


def horizon_forecast(forecast, stamp_ns):
    """The forecast over the horizon as a table.

    Parameters
    ----------
    forecast : Forecast
    stamp_ns : int
        When issued.

    Returns
    -------
    HorizonForecast
    """
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


def _diagonal(about_x, about_y, about_z):
    return (about_x, 0.0, 0.0, 0.0, about_y, 0.0, 0.0, 0.0, about_z)
