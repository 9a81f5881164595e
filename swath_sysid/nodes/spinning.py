"""Starting, spinning and stopping nodes: Ctrl-C and SIGTERM, once or twice, end a process cleanly."""
import signal
import sys
import threading

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from swath_sysid.errors import InputError

WAKE_PERIOD = 0.1
"""s; so often a spinning thread looks whether it is to stop. Costs 0.1 % of a core."""


def events_executor(context=None):
    """The executor with the least delay: IMU at 1000 Hz takes a quarter of a core less than with the standard one.

    It serves no ``async def`` services.
    """
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def run(plan, args=None):
    """Start nodes, spin them until a signal comes, and stop them.

    Parameters
    ----------
    plan : sequence of (callable, sequence of callable)
        Makers of executors, each with the makers of the nodes that it runs. The first executor spins
        in the main thread, the others each in a thread of its own.
    args : list of str, optional
        As for `rclpy.init`; by default those of the process.

    Returns
    -------
    int
        Exit code.
    """
    stop = threading.Event()
    previous = {s: signal.signal(s, lambda *_: stop.set()) for s in (signal.SIGINT, signal.SIGTERM)}
    # rclpy's own handlers raise KeyboardInterrupt, at a second Ctrl-C in the midst of destroying nodes
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    nodes = []
    try:
        executors = [_started(make_executor, makers, nodes) for make_executor, makers in plan]
        _spin_all(executors, stop)
        return 0
    except (InputError, InvalidParameterTypeException, InvalidParameterValueException) as error:
        print(f'swath_sysid: {error}', file=sys.stderr)
        return 2
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
        for number, handler in previous.items():
            signal.signal(number, handler)


def _started(make_executor, makers, nodes):
    executor = make_executor()
    for make_node in makers:
        node = make_node()
        nodes.append(node)
        executor.add_node(node)
    return executor


def _spin_all(executors, stop):
    failures = []

    def guarded(executor):
        try:
            _spin(executor, stop)
        except BaseException as error:  # raised again in the main thread
            failures.append(error)
            stop.set()

    threads = [threading.Thread(target=guarded, args=(executor,), daemon=True) for executor in executors[1:]]
    for thread in threads:
        thread.start()
    try:
        _spin(executors[0], stop)
    finally:
        stop.set()
        for thread in threads:
            thread.join()
        for executor in executors:
            executor.shutdown()
    if failures:
        raise failures[0]


def _spin(executor, stop):
    try:
        while not stop.is_set() and rclpy.ok():
            executor.spin_once(timeout_sec=WAKE_PERIOD)
    except ExternalShutdownException:
        # someone shut the context down: as good as a signal
        return
