"""Replaying a bag: its messages as they are, with their own stamps, and /clock."""
import heapq
import importlib
import signal
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosbags.interfaces import QosDurability
from rosgraph_msgs.msg import Clock

from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import IMU_TYPE, opened_bag
from swath_sysid.formats.output_bag import LATCHED_TOPICS
from swath_sysid.nodes.messages import time_message

CLOCK_PERIOD = 0.01
"""s of wall clock between /clock messages."""

SETTLING = 0.5
"""s from the last connection to the first message: the other side may still be making it."""

DELIVERY = 5.0
"""s at most for messages that are on their way when the bag ends."""

DISCOVERY = 3.5
"""s in which a subscription that is there is found: mostly 0.2 s, now and then three."""

DEPTH = 1000
LATCHED_DEPTH = 1
NANOSECOND = 1e-9


@dataclass(frozen=True)
class ReplaySettings:
    """How a bag is replayed.

    Attributes
    ----------
    rate : float
        Times real time.
    loop : bool
        Begin again at the end.
    clock : bool
        Publish /clock too.
    wait : float
        s; so long subscriptions are waited for before the start.
    listeners : int
        Subscriptions to the IMU to wait for, or to any topic in a bag without one; 0: those that are found.
    """

    rate: float = 1.0
    loop: bool = False
    clock: bool = False
    wait: float = 15.0
    listeners: int = 0

    def __post_init__(self) -> None:
        if not self.rate > 0.0:
            raise InputError(f'the rate must be greater than zero, not {self.rate}')
        if not self.wait >= 0.0:
            raise InputError('the time to wait must not be negative')
        if self.listeners < 0:
            raise InputError('the number of subscriptions to wait for must not be negative')


class Replay(Node):
    """Publishes the topics of a bag whose types are installed.

    Parameters
    ----------
    path : str or Path
    settings : ReplaySettings

    Raises
    ------
    InputError
        There is no such bag, or no topic of a known type in it.
    """

    def __init__(self, path: str | Path, settings: Any):
        super().__init__('replay')
        self._replaying = settings
        self._open = ExitStack()
        self.unknown_types: set[str] = set()
        self.sent = 0
        self._told = -CLOCK_PERIOD
        try:
            self._readers, self.advice = self._open.enter_context(opened_bag(path))
            self._outlets = self._announce()
        except BaseException:
            self._open.close()
            self.destroy_node()
            raise
        if not self._outlets:
            types = ', '.join(sorted(self.unknown_types)) or 'none'
            raise InputError(f'{path} holds no topic of an installed type ({types}): install their packages')
        self._time_outlet = self.create_publisher(Clock, '/clock', 10) if settings.clock else None

    @property
    def topics(self) -> tuple[str, ...]:
        """Names of what is published."""
        return tuple(sorted(self._outlets))

    def destroy_node(self) -> None:
        """Also close the bag."""
        self._open.close()
        super().destroy_node()

    def _announce(self):
        publishers = {}
        for connection in self._connections():
            kind = message_class(connection.msgtype)
            if kind is None:
                self.unknown_types.add(connection.msgtype)
            elif connection.topic != '/clock' and connection.topic not in publishers:
                publishers[connection.topic] = self.create_publisher(kind, connection.topic, _qos(connection))
        return publishers

    def _connections(self):
        return [connection for reader in self._readers for connection in reader.connections]

    def wait_for_listeners(self, should_stop: Callable[[], bool]) -> int:
        """Wait until all who are to hear the bag are connected, at most as long as was set.

        Those are as many as were set; else all that are found, once nobody else has come for as long as discovery
        takes.

        Parameters
        ----------
        should_stop : callable

        Returns
        -------
        int
            How many are, on the IMU topic, or on the most heard one in a bag without an IMU.
        """
        deadline = time.monotonic() + self._replaying.wait
        settling = SETTLING if self._replaying.listeners else DISCOVERY
        before, changed = None, time.monotonic()
        while not should_stop():
            now, connections = time.monotonic(), self._connected()
            if connections != before:
                before, changed = connections, now
            listening = self._listening()
            complete = listening >= max(self._replaying.listeners, 1) and all(c == known for c, known in connections)
            if (complete and now >= changed + settling) or now >= deadline:
                return listening
            time.sleep(0.02)
        return self._listening()

    def _connected(self):
        """For every topic, the subscriptions that are connected, and those that are known of."""
        return [(outlet.get_subscription_count(), self.count_subscribers(topic))
                for topic, outlet in self._outlets.items()]  # fmt: skip

    def _listening(self):
        imus = {c.topic for c in self._connections() if c.msgtype == IMU_TYPE} & set(self._outlets)
        return max(self._outlets[topic].get_subscription_count() for topic in imus or self._outlets)

    def play(self, should_stop: Callable[[], bool]) -> None:
        """Publish everything at its time, once or over and over.

        Parameters
        ----------
        should_stop : callable
            Asked often.
        """
        while not should_stop():
            self._play_once(should_stop)
            if not self._replaying.loop:
                return

    def wait_until_received(self) -> None:
        """Wait, at most `DELIVERY`, until reliable subscriptions have the last messages: these end with the node."""
        deadline = time.monotonic() + DELIVERY
        for outlet in self._outlets.values():
            outlet.wait_for_all_acked(Duration(seconds=max(deadline - time.monotonic(), 0.0)))

    def _play_once(self, should_stop: Callable[[], bool]) -> None:
        begun, first = 0.0, None
        for time_ns, topic, raw in self._messages():
            if first is None:
                begun, first = time.monotonic(), time_ns
            due = begun + (time_ns - first) * NANOSECOND / self._replaying.rate
            if not self._wait_until(due, begun, first, should_stop):
                return
            self._tell_time(time_ns)
            self._outlets[topic].publish(raw)
            self.sent += 1

    def _messages(self):
        """Time, topic and serialised message, in the order of recording."""
        streams = [
            ((received, number, connection.topic, bytes(raw)) for connection, received, raw in reader.messages(
                [c for c in reader.connections if c.topic in self._outlets]
            ))
            for number, reader in enumerate(self._readers)
        ]
        for received, _, topic, raw in heapq.merge(*streams, key=lambda message: message[:2]):
            yield received, topic, raw

    def _wait_until(self, due: float, begun: float, first: Any, should_stop: Callable[[], bool]):
        """Sleep, telling the time meanwhile; False: stop."""
        while not should_stop():
            now = time.monotonic()
            if now >= due:
                return True
            time.sleep(min(due - now, CLOCK_PERIOD))
            now = time.monotonic()
            if now < due:
                self._tell_time(first + round((now - begun) * self._replaying.rate / NANOSECOND))
        return False

    def _tell_time(self, time_ns: int) -> None:
        now = time.monotonic()
        if self._time_outlet is not None and now >= self._told + CLOCK_PERIOD:
            self._told = now
            self._time_outlet.publish(Clock(clock=time_message(time_ns)))


def message_class(name: str) -> type | None:
    """The class of a message type such as sensor_msgs/msg/Imu, None where its package is not installed."""
    package, _, kind = name.partition('/msg/')
    try:
        return getattr(importlib.import_module(f'{package}.msg'), kind, None)
    except ImportError:
        return None


def _qos(connection: Any):
    """Reliable, so that it connects with every subscription; latched where it was."""
    offered = connection.ext.offered_qos_profiles
    latched = any(qos.durability == QosDurability.TRANSIENT_LOCAL for qos in offered)
    # a bag written without ROS may not say so
    latched = latched or connection.topic.endswith(LATCHED_TOPICS)
    return QoSProfile(
        depth=LATCHED_DEPTH if latched else DEPTH, reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )



def replay(path: str | Path, settings: Any, tell: Callable[[str], None], args: list[str] | None = None) -> None:
    """Replay a bag until its end or a signal.

    Parameters
    ----------
    path : str or Path
    settings : ReplaySettings
    tell : callable
        Takes lines for people.
    args : list of str, optional
        As for `rclpy.init`.

    Raises
    ------
    InputError
        See `Replay`.
    """
    stop = threading.Event()
    previous = {number: signal.signal(number, lambda *_: stop.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = Replay(path, settings)
        try:
            for advice in node.advice:
                tell(f'warning [{advice.code}]: {advice.message}')
            if node.unknown_types:
                tell(f'left out, their types are not installed: {", ".join(sorted(node.unknown_types))}')
            tell(f'publishing {", ".join(node.topics)}')
            listening = node.wait_for_listeners(stop.is_set)
            expected = max(settings.listeners, 1)
            if listening < expected and not stop.is_set():
                tell(f'{listening} of {expected} listen yet: publishing all the same')
            node.play(stop.is_set)
            node.wait_until_received()
            tell(f'{node.sent} messages published')
        finally:
            node.destroy_node()
    finally:
        rclpy.try_shutdown()
        for number, handler in previous.items():
            signal.signal(number, handler)
