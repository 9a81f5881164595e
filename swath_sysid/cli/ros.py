"""ROS where a verb needs it."""

from collections.abc import Iterator
from contextlib import contextmanager

from swath_sysid.common.errors import InputError


@contextmanager
def ros_needed(without: str = '') -> Iterator[None]:
    """Around imports of ROS: `InputError` where it is not installed, with what the verb does ``without`` it."""
    try:
        yield
    except ImportError as error:
        raise InputError(
            f'rclpy is not installed ({error}): pip install "swath_sysid[ros]", or source a ROS 2 installation'
            + (without and f'; {without}')
        ) from error
