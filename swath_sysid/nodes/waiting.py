"""Coroutines of a node that wait for the end of a worker, and for their place in the queue of answers."""

from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from swath_sysid.nodes.executor_loop import LOOK_PERIOD
from swath_sysid.nodes.worker import OnProgress, Worker


async def outcome_of(
    worker: Worker, executor: Any, function: Callable, request: Any, on_progress: OnProgress
) -> tuple[Any, Exception | None]:
    """Have a worker do something, and wait for its end in a coroutine of an executor of rclpy; see `Worker.submit`."""
    ended = Future()

    def end(outcome: Any, error: Exception | None) -> None:
        ended.set_result((outcome, error))
        # without this an idle executor never comes to look
        executor.wake()

    worker.submit(function, (request,), end, on_progress)
    return await ended


class AnswerQueue:
    """Lets coroutines of a node continue one at a time: a client keeps ten of the replies to all clients, and a burst
    of fifty pushes its own out.
    """

    def __init__(self, node: Node):
        self._waiting: deque[Future] = deque()
        self._timer = node.create_timer(LOOK_PERIOD, self._next, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()

    async def wait(self) -> None:
        """Continue at once, unless another coroutine has just done so; then wait in the queue."""
        if self._timer.is_canceled():
            self._timer.reset()
            return
        place = Future()
        self._waiting.append(place)
        await place

    def _next(self) -> None:
        if self._waiting:
            self._waiting.popleft().set_result(None)
        else:
            self._timer.cancel()
