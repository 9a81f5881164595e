"""The windows of imu_buffer as the identifier gets them: published, or asked for by a service."""

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger

from swath_sysid.attitude.motion.window import MotionTable
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import window_table
from swath_sysid.formats.topics import WINDOW_TOPIC
from swath_sysid.nodes.diagnostics import EachOnce
from swath_sysid.nodes.qos import LATCHED, watched_subscription
from swath_sysid.pipeline.health import IdentifierHealth


class WindowClient:
    """Receives windows, and requests one from the buffer by a service. ``on_window`` takes the `MotionTable` of every
    window that `fetch` did not ask for.
    """

    def __init__(self, node: Node, service: str, health: IdentifierHealth, on_window: Callable[[MotionTable], None]):
        self.newest: MotionTable | None = None
        self._refused = ''  # why the last window was, if it was
        self._log = EachOnce(node.get_logger().error)
        self._node = node
        self._health = health
        self._on_window = on_window
        self._awaited: Future | None = None
        self._client = node.create_client(Trigger, service)
        watched_subscription(node, PointCloud2, WINDOW_TOPIC, self._receive, LATCHED, health)

    async def fetch(self, timeout: float) -> str:
        """Have the buffer publish its window and wait for it, s; the problem, if `newest` is not the best there is."""
        if not self._client.service_is_ready():
            if self._refused or self.newest is not None:
                return self._refused
            return f'there is no window: start imu_buffer (its service is {self._client.service_name})'
        self._awaited = Future()
        timer = self._node.create_timer(timeout, self._give_up, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._client.call_async(Trigger.Request()).add_done_callback(self._on_answer)
        problem = await self._awaited
        self._node.destroy_timer(timer)
        return problem

    def stop_waiting(self, problem: str) -> bool:
        """End a `fetch` that waits, if there is one."""
        if self._awaited is not None and not self._awaited.done():
            self._awaited.set_result(problem)
            return True
        return False

    def _receive(self, message: Any) -> None:
        try:
            self.newest, self._refused = window_table(message), ''
        except InputError as error:
            self._health.note('bad-window')
            self._refused = str(error)
            self._log(self._refused)
            self.stop_waiting(self._refused)
            return
        if not self.stop_waiting(''):
            self._on_window(self.newest)

    def _give_up(self) -> None:
        self.stop_waiting('no window arrived within window_timeout_s: check that imu_buffer publishes motion/window')

    def _on_answer(self, future: Future) -> None:
        if not future.result().success:
            self.stop_waiting(future.result().message or f'{self._client.service_name} has no window')
