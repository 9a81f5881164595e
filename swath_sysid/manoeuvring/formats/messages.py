"""Conversion between ROS messages of surge, sway and yaw and plain values, without ROS; messages are returned
serialised.
"""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from swath_sysid.attitude.motion.attitude import is_orientation
from swath_sysid.formats.messages import SECOND_NS, header, make, serialised, stamp_ns
from swath_sysid.formats.topics import ODOMETRY
from swath_sysid.manoeuvring.formats.topics import PATH
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreState, OdometryReading

PLANAR = (0, 1, 5)  #: Rows of x, y, yaw (and of their rates) in a covariance of six.
LARGEST_VARIANCE = 1e4  #: A larger variance marks a quantity that is not measured.


def odometry_message(state: ManoeuvreState, frame_id: str, child_frame_id: str, stamp: int | None = None) -> bytes:
    """The nav_msgs/Odometry of a state, stamp in ns, by default its own; heave, roll, pitch and their variance are
    zero.
    """
    head = header(round(state.stamp * SECOND_NS) if stamp is None else stamp, frame_id)
    twist = (float(state.surge), float(state.sway), 0.0), (0.0, 0.0, float(state.yaw_rate))
    pose, twist_covariance = (_pose(state), _of_six(state.pose_covariance)), _of_six(state.twist_covariance)
    return serialised(make(ODOMETRY, head, child_frame_id, pose, (twist, twist_covariance)))


def path_message(path: Iterable[ManoeuvreState], stamp: float, frame_id: str) -> bytes:
    """The nav_msgs/Path of states, each pose with its own stamp."""
    poses = [(header(round(state.stamp * SECOND_NS), frame_id), _pose(state)) for state in path]
    return serialised(make(PATH, header(round(stamp * SECOND_NS), frame_id), poses))


def _pose(state: ManoeuvreState) -> tuple:
    half = 0.5 * state.heading
    return (float(state.x), float(state.y), 0.0), (0.0, 0.0, float(np.sin(half)), float(np.cos(half)))


def _of_six(block: np.ndarray) -> np.ndarray:
    """Covariance of x, y, yaw as one of six, shape (36,)."""
    full = np.zeros((6, 6))
    full[np.ix_(PLANAR, PLANAR)] = block
    return full.ravel()


def odometry_reading(message: Any) -> OdometryReading:
    """Values of a nav_msgs/Odometry; without a valid quaternion the heading is NaN."""
    pose, twist = message.pose.pose, message.twist.twist
    q = pose.orientation
    heading = math.nan
    if is_orientation(q.x, q.y, q.z, q.w):
        heading = float(np.arctan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z)))
    std = {}
    for names, covariance in (
        (('x', 'y', 'heading'), message.pose.covariance),
        (('surge', 'sway', 'yaw_rate'), message.twist.covariance),
    ):
        for name, place in zip(names, PLANAR, strict=True):
            variance = float(covariance[7 * place])
            # all zero means unknown, as for sensor_msgs
            if 0.0 < variance < LARGEST_VARIANCE:
                std[name] = variance**0.5
    return OdometryReading(
        stamp_ns(message.header.stamp) / SECOND_NS,
        pose.position.x,
        pose.position.y,
        heading,
        twist.linear.x,
        twist.linear.y,
        twist.angular.z,
        std,
    )
