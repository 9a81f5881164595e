"""One after the other: answers to many callers that a client can follow."""
from collections import deque

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

PERIOD = 0.1
"""s. A client receives the replies to all clients of its service and keeps ten: a burst of fifty pushes its own out."""


class Turns:
    """Lets coroutines of a node go on one at a time."""

    def __init__(self, node: Node):
        self._waiting: deque[Future] = deque()
        self._timer = node.create_timer(PERIOD, self._next, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()

    async def wait(self) -> None:
        """Go on when it is this one's turn: at once, unless another one went on just before."""
        if self._timer.is_canceled():
            self._timer.reset()
            return
        turn = Future()
        self._waiting.append(turn)
        await turn

    def _next(self) -> None:
        if self._waiting:
            self._waiting.popleft().set_result(None)
        else:
            self._timer.cancel()
