"""Times of ROS messages."""

from builtin_interfaces.msg import Time

from swath_sysid.formats.messages import SECOND_NS


def time_message(nanoseconds: int) -> Time:
    """A builtin_interfaces/Time of nanoseconds."""
    seconds, rest = divmod(int(nanoseconds), SECOND_NS)
    return Time(sec=seconds, nanosec=rest)
