"""Between ROS messages and plain values: what the nodes use of `swath_sysid.formats.messages`."""
from builtin_interfaces.msg import Time

from swath_sysid.formats.messages import (  # noqa: F401 - handed on
    SECOND_NS,
    ImuMessage,
    coefficients_message,
    horizon_message,
    imu_reading,
    stamp_ns,
    window_message,
    window_table,
)

NANOSECONDS, AttitudeMessage = SECOND_NS, ImuMessage


def time_message(nanoseconds):
    """A builtin_interfaces/Time of nanoseconds."""
    seconds, rest = divmod(int(nanoseconds), NANOSECONDS)
    return Time(sec=seconds, nanosec=rest)
