"""ROS from its start to its end in a process, with signals that end it cleanly."""

import re
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.signals import SignalHandlerOptions

from swath_sysid.common.errors import InputError


@contextmanager
def ros_session(args: list[str] | None = None) -> Iterator[threading.Event]:
    """ROS from its start to its end; Ctrl-C and SIGTERM set the event."""
    stop, signalled = threading.Event(), threading.Event()

    def on_signal(*_: object) -> None:
        signalled.set()
        stop.set()

    previous = {number: signal.signal(number, on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        _initialise(args)
        yield stop
    finally:
        rclpy.try_shutdown()
        for number, handler in previous.items():
            # after a signal the process is about to end, and another Ctrl-C must not hurt it, even in its last moments
            signal.signal(number, signal.SIG_IGN if signalled.is_set() else handler)


def _initialise(args: list[str] | None) -> None:
    """Start rclpy without its signal handlers, which raise KeyboardInterrupt while nodes are destroyed."""
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        # the C library's message ends with places in its source
        reason = re.sub(r'\s*, at \S+:\d+', '', str(error)).removeprefix('failed to initialize rcl: ')
        if 'initialize logging' in reason:
            raise InputError(f'ROS cannot be started ({reason}): set ROS_LOG_DIR to a writable folder') from error
        if rule := re.search(r"remap rule: '-r (.+?)'\. ", reason):
            raise InputError(
                f"ROS rejects '-r {rule[1]}': give NAME:=NAME, where a name has letters, digits and underscores "
                f'between slashes and begins with no digit'
            ) from error
        raise InputError(f'ROS cannot be started with these arguments: {reason}') from error
