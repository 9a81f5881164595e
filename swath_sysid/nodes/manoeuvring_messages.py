"""Messages of manoeuvres to plain values, and back."""
import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path

from swath_sysid.manoeuvring.prediction.pipeline import OdometryReading
from swath_sysid.nodes.messages import NANOSECONDS, stamp_ns, time_message

POSE_PLACES, TWIST_PLACES = (0, 1, 5), (0, 1, 5)
"""Rows of x, y, yaw in a covariance of six."""


def odometry_reading(message):
    """The plain values of a nav_msgs/Odometry."""
    pose, twist = message.pose.pose, message.twist.twist
    q = pose.orientation
    heading = float(np.arctan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z)))
    std = {}
    for names, covariance, places in (
        (('x', 'y', 'heading'), message.pose.covariance, POSE_PLACES),
        (('surge', 'sway', 'yaw_rate'), message.twist.covariance, TWIST_PLACES),
    ):
        for name, place in zip(names, places, strict=True):
            variance = float(covariance[7 * place])
            # all zero means unknown, as for sensor_msgs
            if 0.0 < variance < 1e4:
                std[name] = variance**0.5
    return OdometryReading(
        stamp_ns(message.header.stamp) / NANOSECONDS, pose.position.x, pose.position.y, heading, twist.linear.x,
        twist.linear.y, twist.angular.z, std,
    )  # fmt: skip


def odometry_message(state, frame_id, child_frame_id):
    """The nav_msgs/Odometry of a `ManoeuvreState`; heave, roll and pitch are zero, with zero variance."""
    message = Odometry()
    message.header.stamp = time_message(round(state.stamp * NANOSECONDS))
    message.header.frame_id, message.child_frame_id = frame_id, child_frame_id
    _fill_pose(message.pose.pose, state)
    twist = message.twist.twist
    twist.linear.x, twist.linear.y, twist.angular.z = state.surge, state.sway, state.yaw_rate
    for covariance, block, places in (
        (message.pose.covariance, state.pose_covariance, POSE_PLACES),
        (message.twist.covariance, state.twist_covariance, TWIST_PLACES),
    ):
        for i, row in enumerate(places):
            for j, column in enumerate(places):
                covariance[6 * row + column] = float(block[i, j])
    return message


def path_message(path, stamp, frame_id):
    """The nav_msgs/Path of states, each pose with the stamp it is for."""
    message = Path()
    message.header.stamp, message.header.frame_id = time_message(round(stamp * NANOSECONDS)), frame_id
    for state in path:
        pose = PoseStamped()
        pose.header.stamp, pose.header.frame_id = time_message(round(state.stamp * NANOSECONDS)), frame_id
        _fill_pose(pose.pose, state)
        message.poses.append(pose)
    return message


def _fill_pose(pose, state):
    pose.position.x, pose.position.y = state.x, state.y
    pose.orientation.z, pose.orientation.w = float(np.sin(state.heading / 2)), float(np.cos(state.heading / 2))
