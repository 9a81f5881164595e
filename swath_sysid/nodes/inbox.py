"""The messages of the sensor that wait until their node handles them, between two rounds of callbacks."""

from collections import deque
from time import perf_counter
from typing import NamedTuple

from rclpy.node import Node
from sensor_msgs.msg import Imu

from swath_sysid.formats.messages import stamp_ns
from swath_sysid.nodes import qos
from swath_sysid.pipeline.health import StreamHealth
from swath_sysid.pipeline.pacing import Pace

PASSED_OVER_NS = 100_000_000  #: A sample that is older than the newest one by more only feeds the filters.


class Arrival(NamedTuple):
    """A message and when it came."""

    message: Imu
    time: float  #: s; see `qos.arrival_time`.
    clock_ns: int  #: Of the node's clock.


class Inbox(deque[Arrival]):
    """The queue of a subscription to the sensor; of more than ``depth`` messages the oldest are lost, and counted."""

    def __init__(self, node: Node, depth: int, health: StreamHealth) -> None:
        super().__init__(maxlen=depth)
        self._node, self._health = node, health
        self.subscription = qos.imu_subscription(node, Imu, self.put, depth, health)

    def put(self, message: Imu) -> None:
        """Take a message that has come, and those that have come after it: the callback."""
        arrival, clock_ns = qos.arrival_time(self._node), self._node.get_clock().now().nanoseconds
        for each in (message, *qos.waiting(self.subscription)):
            if len(self) == self.maxlen:
                self._health.note_left_out()
            self.append(Arrival(each, arrival, clock_ns))


class PacedInbox(Inbox):
    """An inbox that leaves out messages, evenly, while they come faster than they can be handled."""

    def __init__(self, node: Node, depth: int, health: StreamHealth, uses_all: bool = False) -> None:
        super().__init__(node, depth, health)
        self.pace, self._uses_all = Pace(), uses_all

    @property
    def oldest_ns(self) -> int:
        """Stamp of the message that has waited longest."""
        return stamp_ns(self[0].message.header.stamp)

    def take(self) -> tuple[Arrival, bool, bool]:
        """The oldest message, whether to use it, and whether much newer ones wait behind it."""
        if self._uses_all:
            return self.popleft(), True, False
        is_used, begin_ns = self.pace.is_used(len(self), perf_counter()), self.oldest_ns
        arrival = self.popleft()
        if not is_used:
            self._health.note_left_out()
        newest = self[self.pace.left - 1] if self.pace.left else arrival
        return arrival, is_used, stamp_ns(newest.message.header.stamp) - begin_ns > PASSED_OVER_NS
