"""The messages of the sensor that wait until their node handles them, between two rounds of callbacks."""

from collections import deque
from typing import NamedTuple

from rclpy.node import Node
from sensor_msgs.msg import Imu

from swath_sysid.nodes import qos
from swath_sysid.pipeline.health import StreamHealth


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
