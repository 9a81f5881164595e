"""Message classes by their names, and stamps."""

import importlib

from builtin_interfaces.msg import Time

from swath_sysid.formats.messages import SECOND_NS


def message_class(name: str) -> type | None:
    """The class of a message type such as sensor_msgs/msg/Imu, None where its package is not installed."""
    package, _, kind = name.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), kind, None)
    except ImportError:
        return None


def time_message(nanoseconds: int) -> Time:
    """A builtin_interfaces/Time of nanoseconds."""
    seconds, rest = divmod(int(nanoseconds), SECOND_NS)
    return Time(sec=seconds, nanosec=rest)
