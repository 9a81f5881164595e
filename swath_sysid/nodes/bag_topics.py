"""Topics on their way to and from bags: the class of a message type, and the QoS."""

import importlib

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

DEPTH = 1000


def message_class(name: str) -> type | None:
    """The class of a message type such as sensor_msgs/msg/Imu, None where its package is not installed."""
    package, _, kind = name.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), kind, None)
    except ImportError:
        return None


def bag_qos(is_latched: bool, is_reliable: bool = True, depth: int = DEPTH) -> QoSProfile:
    """A long queue, so that nothing is lost; a reliable publisher connects with every subscription."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
    )
