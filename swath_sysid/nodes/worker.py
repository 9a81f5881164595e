"""The worker beside a node, its long work in a process of its own; and coroutines that wait for it and for answers."""

import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from swath_sysid.common.cancelling import Cancelled
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import WorkerError, WorkerProcess
from swath_sysid.nodes.executor_loop import LOOK_PERIOD

IDLE_PERIOD = 0.5
OnEnd = Callable[[Any, Exception | None], None]
OnProgress = Callable[[float], None]


class _Job:
    def __init__(self, work: tuple, on_progress: OnProgress | None, on_end: OnEnd):
        self.work = work
        self.on_progress = on_progress
        self.on_end = on_end
        self.cancelled = threading.Event()


class Worker:
    """Runs one function after the other in a process of its own; ``on_death`` is called from the worker's thread.
    After ``longest_idle`` s without work, also at the start, the process is ended until the next; 0: never.
    """

    def __init__(
        self, warm_up: Callable[[], None], on_death: Callable[[], None] | None = None, longest_idle: float = 0.0
    ):
        self._on_death = on_death
        self._longest_idle = longest_idle
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._unfinished: list[_Job] = []
        self._closing = threading.Event()
        self._process = WorkerProcess(warm_up, time.monotonic)
        self._thread = threading.Thread(target=self._serve, name='worker', daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Process id of the worker now."""
        return self._process.pid

    def submit(
        self, function: Callable, arguments: tuple, on_end: OnEnd, on_progress: OnProgress | None = None
    ) -> None:
        """Run ``function(*arguments)``; with ``on_progress`` it also gets ``progress=`` and ``should_cancel=``.
        ``on_end`` is called from the worker's thread with the result and None, or None and the error.
        """
        job = _Job((function, arguments, on_progress is not None), on_progress, on_end)
        self._unfinished.append(job)
        self._jobs.put(job)

    def cancel(self) -> None:
        """Have all work submitted end with `Cancelled`, what runs now within half a second."""
        for job in tuple(self._unfinished):
            job.cancelled.set()

    def close(self) -> None:
        """End the process; what runs ends with `Cancelled`."""
        self._closing.set()
        self._jobs.put(None)
        self._thread.join()
        self._process.end()

    def _serve(self) -> None:
        worked = time.monotonic()
        while not self._closing.is_set():
            try:
                job = self._jobs.get(timeout=IDLE_PERIOD)
            except queue.Empty:
                if self._process.died_idle():
                    self._revive()
                elif self._longest_idle and time.monotonic() - worked > self._longest_idle:
                    self._process.rest()
                continue
            if job is not None:
                result, error = self._do(job)
                worked = time.monotonic()
                self._unfinished.remove(job)
                job.on_end(result, error)

    def _do(self, job: _Job) -> tuple[Any, Exception | None]:
        try:
            stops = (job.cancelled, self._closing)
            return self._process.run(job.work, lambda: any(s.is_set() for s in stops), job.on_progress), None
        except (InputError, Cancelled, WorkerError) as error:
            return None, error
        except (EOFError, OSError):
            return None, self._revive()

    def _revive(self) -> WorkerError:
        """Start another process in place of one that died; the error that reports it."""
        try:
            how = self._process.restart()
        except OSError as error:
            return WorkerError(f'the worker process ended and cannot be restarted ({error.strerror})')
        if self._on_death is not None:
            self._on_death()
        return WorkerError(f'the worker process ended {how} and was restarted: try again')


async def outcome_of(
    worker: Worker, executor: Any, function: Callable, request: Any, on_progress: OnProgress
) -> tuple[Any, Exception | None]:
    """Have a worker do something, and wait for its end in a coroutine of an executor of rclpy; see `Worker.submit`."""
    ended = Future()

    def end(outcome: Any, error: Exception | None) -> None:
        ended.set_result((outcome, error))
        executor.wake()  # without this an idle executor never comes to look

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
