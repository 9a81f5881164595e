"""What the identifiers of both wings have in common: one identification at a time, in a worker process."""

from collections.abc import Awaitable, Callable, Coroutine
from functools import partial
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from swath_sysid.common.accelerator import why_slower
from swath_sysid.common.advice import counted
from swath_sysid.common.cancelling import Cancelled
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher, report_slower
from swath_sysid.nodes.kept_model import ModelFile
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.table import Values
from swath_sysid.nodes.qos import SERVICES, watched_publisher
from swath_sysid.nodes.worker import AnswerQueue, Worker, WorkerError, outcome_of
from swath_sysid.pipeline.health import IdentifierHealth, Report

BUSY = 'an identification is running: wait for it or call ~/cancel'
CANCELLED = 'the identification was cancelled'

Answer = tuple[bool, str]  #: Whether a model was published, and one line about it: what the services answer.


class IdentificationNode(Node):
    """Services ~/identify, ~/cancel and ~/rollback, ~/progress and diagnostics; a derived node calls `serve`."""

    refitter: Any  #: A `Refitter` or `ManoeuvreRefitter`.
    file: ModelFile

    def __init__(self, name: str, settings_of: Callable[[Values], Any]):
        super().__init__(name)
        self.parameters = NodeParameters(self, name, settings_of)
        self.health = IdentifierHealth()
        self._ended: Future | None = None
        self._answers = AnswerQueue(self)
        self._progress = watched_publisher(self, Float32, '~/progress', 10, self.health)

    def serve(
        self,
        warm_up: Callable[[], None],
        identify: Callable[[], Awaitable[Answer]],
        publish: Callable[[], Any],
        status: Callable[[], tuple[dict, Report]],
        when_free: Callable[[], None] = lambda: None,
        stop_waiting: Callable[[], None] = lambda: None,
    ) -> None:
        """Offer the services, with a worker that first runs ``warm_up``. ``publish`` returns the model that it
        published; ``status`` gives further values of the status of identifications, and a status of its own.
        """
        self._identify, self._publish, self._status = identify, publish, status
        self._when_free, self._stop_waiting = when_free, stop_waiting
        # an async service holds its group while it waits: in the node's own it would lock out all else
        waiting: dict[str, Any] = {'callback_group': ReentrantCallbackGroup(), 'qos_profile': SERVICES}
        self.create_service(Trigger, '~/identify', self._on_identify, **waiting)
        back = partial(self.replaced, 'back to', self.refitter.rollback, 'there is no model before this one')
        self.create_service(Trigger, '~/rollback', back, qos_profile=SERVICES)
        self.create_service(Trigger, '~/cancel', self._on_cancel, **waiting)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)
        idle_s = self.parameters['worker_idle_s']
        self.worker = Worker(warm_up, lambda: self.health.note('identification-worker-died'), idle_s)
        # why its work takes longer than it could: numba is loaded there, not here
        self.worker.submit(why_slower, (), lambda why, error: report_slower(self, self.health, why))

    def _reports(self) -> list[Report]:
        (values, report), busy = self._status(), self._ended is not None
        return [self.health.report(self.refitter.described, self.refitter.steps_back, busy, values), report]

    def destroy_node(self) -> None:
        """Also end the worker."""
        self.worker.close()
        super().destroy_node()

    def begin(self, work: Callable[[], Awaitable[Answer]]) -> None:
        """Start work that no caller waits for, unless other work runs."""
        if self.executor is not None and self._ended is None:
            self.executor.create_task(self._begun(work))

    def _begun(self, work: Callable[[], Awaitable[Answer]]) -> Coroutine[Any, Any, Answer]:
        # at once, not when the coroutine is first run
        self._ended = Future()
        return self._done(work, self._ended)

    async def _done(self, work: Callable[[], Awaitable[Answer]], ended: Future) -> Answer:
        answer = await work()
        self._ended = None
        self.health.end(*answer)
        self._diagnostics.publish()
        self.get_logger().info(answer[1])
        ended.set_result(answer)
        self._when_free()
        return answer

    async def refit(self, function: Callable, request: Any) -> Answer:
        """Have the worker refit, and publish and save a better model."""
        self.health.begin()
        outcome, error = await outcome_of(self.worker, self.executor, function, request, self._on_progress)
        if isinstance(error, WorkerError):
            self.get_logger().warning(f'{error}; if this repeats, look for a lack of memory with `dmesg`')
        if error is not None:
            return False, CANCELLED if isinstance(error, Cancelled) else str(error)
        if not self.refitter.take(outcome):
            return False, outcome.message
        return True, f'{outcome.message}{self.file.keep(self._publish())}'

    def _on_progress(self, share: float) -> None:
        self.health.progress = share
        self._progress.publish(Float32(data=float(share)))

    async def _on_identify(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # one identification answers all callers that come meanwhile
        answer = await (self._begun(self._identify) if self._ended is None else self._ended)
        await self._answers.wait()
        response.success, response.message = answer
        return response

    async def _on_cancel(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._ended is not None, 'nothing is running'
        if (ended := self._ended) is not None:
            self._stop_waiting()
            self.worker.cancel()
            await ended
            response.message = 'the identification has ended'
        return response

    def replaced(
        self, done: str, change: Callable[[], bool], refusal: str, _: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Publish the models after a change of the refitter, or answer why there was none."""
        response.success, response.message = False, refusal if self._ended is None else BUSY
        if self._ended is None and change():
            remark = f'{counted(self.refitter.steps_back, "earlier model")} kept{self.file.keep(self._publish())}'
            response.success, response.message = True, f'{done} {self.refitter.described}; {remark}'
        return response
