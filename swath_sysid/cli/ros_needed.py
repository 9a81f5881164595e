"""ROS in verbs: one sentence if it is not installed, and a session that Ctrl-C ends in order."""

import signal
import threading
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
            f'rclpy is not installed ({error}): pip install swath_sysid[ros], or source a ROS 2 installation'
            + (without and f'; {without}')
        ) from error


@contextmanager
def ros_session() -> Iterator[threading.Event]:
    """Between start and end of rclpy; Ctrl-C and SIGTERM set the event, as rclpy turns them into errors of its own."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    stop = threading.Event()
    previous = {number: signal.signal(number, lambda *_: stop.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    rclpy.init(args=['swath-sysid'], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield stop
    finally:
        rclpy.try_shutdown()
        for number, handler in previous.items():
            signal.signal(number, handler)
