"""A replay that goes no faster than its samples are forecast from."""

import time
from collections.abc import Callable

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import Imu

from swath_sysid.formats.messages import SECOND_NS, raw_stamp_ns, stamp_ns
from swath_sysid.formats.topics import NEXT_TOPIC
from swath_sysid.nodes.qos import NEWEST

AHEAD_NS = 2 * SECOND_NS  #: By which samples may be ahead of the forecasts: few enough to wait at the node.
PATIENCE = 5.0  #: s from one forecast to the next: rejected samples bring none.


class StepKeeping:
    """Holds samples of the replay back until those before them have been forecast from."""

    def __init__(self, node: Node, should_stop: Callable[[], bool]):
        self._node = node
        self._should_stop = should_stop
        self._forecast_ns = 0
        node.create_subscription(Imu, NEXT_TOPIC, self._on_forecast, NEWEST)

    def _on_forecast(self, message: Imu) -> None:
        self._forecast_ns = stamp_ns(message.header.stamp)

    def wait(self, raw: bytes) -> None:
        """Wait until the forecasts are near the stamp of a serialised sample."""
        least_ns, deadline = raw_stamp_ns(raw) - AHEAD_NS, time.monotonic() + PATIENCE
        while self._forecast_ns < least_ns and time.monotonic() < deadline and not self._should_stop():
            before = self._forecast_ns
            rclpy.spin_once(self._node, timeout_sec=0.05)
            if self._forecast_ns > before:
                deadline = time.monotonic() + PATIENCE
