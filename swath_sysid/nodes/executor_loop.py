"""Starting, spinning and stopping nodes: Ctrl-C and SIGTERM, once or twice, end a process cleanly.

A node with `is_behind` and `work` only queues messages in its callbacks, and works in slices between them: so timers,
services, signals and the other nodes get their turn also while messages come faster than they are handled.
"""

import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import rclpy
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

from swath_sysid.common.errors import DONE, NOTHING_DONE, InputError
from swath_sysid.common.wings import named
from swath_sysid.formats.topics import listed
from swath_sysid.nodes.ros_session import ros_session

#: Makers of executors, each with what makes the nodes that it runs: a class, or ``MODULE CLASS`` of this package, which
#: is imported when its turn comes. Of nodes that work between callbacks, the first has precedence.
Plan = Sequence[tuple[Callable[[], Executor], Sequence[Callable[[], Node] | str]]]

OF_ROS = {'/clock', '/parameter_events', '/rosout'}  #: Topics of every node.

LOOK_PERIOD = 0.1  #: s between looks for what calls nobody: signals, new topics, requests of the page.
WOKEN_PERIOD = 5.0  #: s; for the other threads, which are woken to stop: waking costs 0.06 % of a core per Hz.
WORK_SLICE = 0.05  #: s that a node works before callbacks get their turn; it ends the sample that it has begun.
#: s for which another thread may keep the samples waiting, each time; Python's own 5 ms add up to most of the time.
SWITCH_INTERVAL = 0.0005


def events_executor(context: rclpy.Context | None = None) -> Executor:
    """The executor with the least delay (IMU at 1000 Hz takes a quarter of a core less); no ``async def`` services."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def run(plan: Plan, args: list[str] | None = None) -> int:
    """Start nodes, spin them until a signal comes (the first executor in this thread), and stop them: the exit code."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    try:
        with ros_session(args) as stop:
            return _run_until(stop, plan)
    except (InputError, InvalidParameterTypeException, InvalidParameterValueException) as error:
        print(f'swath_sysid: {error}', file=sys.stderr)
        return NOTHING_DONE


def _run_until(stop: threading.Event, plan: Plan) -> int:
    executors: list[Executor] = []
    nodes: list[Node] = []
    try:
        for make_executor, makers in plan:
            executors.append(make_executor())
            for maker in makers:
                if stop.is_set():
                    return DONE
                nodes.append(named(maker)() if isinstance(maker, str) else maker())
                executors[-1].add_node(nodes[-1])
        _log_ready(nodes)
        _spin_all(executors, [node for node in nodes if hasattr(node, 'work')], stop)
        return DONE
    finally:
        for executor in executors:
            executor.shutdown()
        for node in nodes:
            node.destroy_node()


def _log_ready(nodes: Sequence[Node]) -> None:
    """Which nodes run, what has to come first, and on which topics; for nodes that wait for something."""
    first = dict.fromkeys(node.resolve_topic_name(node.waits_for) for node in nodes if hasattr(node, 'waits_for'))
    made = {publisher.topic_name for node in nodes for publisher in node.publishers} - OF_ROS
    inputs = {subscription.topic_name for node in nodes for subscription in node.subscriptions} - made - OF_ROS
    if first:
        log, awaited = nodes[0].get_logger(), [topic for topic in first if topic not in made]
        names = ', '.join(node.get_name() for node in nodes)
        log.info(f'ready: {names}; waiting for the first message on {" and ".join(awaited)}')
        log.info(f'subscribed to {listed(inputs)}')
        log.info(f'publishing {listed(made)}')


def _spin_all(executors: list[Executor], working: list[Any], stop: threading.Event) -> None:
    failures: list[BaseException] = []

    def guarded(executor: Executor) -> None:
        try:
            _spin(executor, stop, WOKEN_PERIOD)
        except BaseException as error:  # raised again in the main thread
            failures.append(error)
            stop.set()

    threads = [threading.Thread(target=guarded, args=(executor,), daemon=True) for executor in executors[1:]]
    for thread in threads:
        thread.start()
    try:
        _spin(executors[0], stop, LOOK_PERIOD, working)
    finally:
        stop.set()
        for executor in executors[1:]:
            executor.wake()
        for thread in threads:
            thread.join()
    if failures:
        raise failures[0]


def _spin(executor: Executor, stop: threading.Event, period: float, working: Sequence[Any] = ()) -> None:
    # that someone shuts the context down is as good as a signal
    with suppress(ExternalShutdownException):
        while not stop.is_set() and rclpy.ok():
            turn(executor, working, period)


def turn(executor: Executor, working: Sequence[Any], period: float) -> None:
    """Wait for a callback, s, unless a node is behind; then a slice of the work of each node that is."""
    executor.spin_once(timeout_sec=0.0 if any(node.is_behind for node in working) else period)
    if any(node.is_behind for node in working):
        # the callbacks of all that has come by now; a new future each time, as it keeps its callbacks
        executor.spin_until_future_complete(Future(), timeout_sec=0.0)
        for node in working:
            node.work(WORK_SLICE)
