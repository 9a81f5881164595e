"""What the identifiers of both wings have in common: one identification at a time, in a worker process."""

from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from swath_sysid.common.accelerator import why_uncompiled
from swath_sysid.common.stopping import Cancelled
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher, report_uncompiled
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.table import Values
from swath_sysid.nodes.qos import SERVICES, watched_publisher
from swath_sysid.nodes.waiting import AnswerQueue, outcome_of
from swath_sysid.nodes.worker import Worker, WorkerError
from swath_sysid.pipeline.health import IDENTIFICATION_WORKER_DIED, IdentifierHealth, Report

BUSY = 'an identification is running: wait for it or call ~/cancel'
CANCELLED = 'the identification was cancelled'

Answer = tuple[bool, str]  #: Whether a model was published, and one line about it: what the services answer.


class IdentificationNode(Node):
    """Services ~/identify, ~/cancel and ~/rollback, ~/progress and diagnostics.

    A derived node makes what its overrides need, and then calls `serve`.
    """

    refitter: Any  #: A `Refitter` or `ManoeuvreRefitter`.

    def __init__(self, name: str, settings_of: Callable[[Values], Any]):
        super().__init__(name)
        self.parameters = NodeParameters(self, name, settings_of)
        self.health = IdentifierHealth()
        self._ended: Future | None = None
        self._has_checked = False
        self._answers = AnswerQueue(self)
        self._progress = watched_publisher(self, Float32, '~/progress', 10, self.health)

    def serve(self, warm_up: Callable[[], None]) -> None:
        """Make the worker, which first runs ``warm_up()``, and offer the services."""
        # an async service holds its group while it waits: in the node's own it would lock out all else
        waiting: dict[str, Any] = {'callback_group': ReentrantCallbackGroup(), 'qos_profile': SERVICES}
        self.create_service(Trigger, '~/identify', self._on_identify, **waiting)
        self.create_service(Trigger, '~/rollback', self._on_rollback, qos_profile=SERVICES)
        self.create_service(Trigger, '~/cancel', self._on_cancel, **waiting)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self.reports)
        self.worker = Worker(
            warm_up, lambda: self.health.note(IDENTIFICATION_WORKER_DIED), self.parameters['worker_idle_s']
        )
        if not self.parameters['worker_idle_s']:
            self._check_compilation()

    async def identify(self) -> Answer:
        """Identify on the newest motion; to be overridden."""
        raise NotImplementedError

    def replace_model(self) -> str:
        """Publish the model of the refitter and save it, and remark where the previous one is; to be overridden."""
        raise NotImplementedError

    def reports(self) -> list[Report]:
        """The statuses of now; to be overridden."""
        raise NotImplementedError

    def when_free(self) -> None:
        """An identification or its cancelling has ended; may be overridden."""

    def stop_waiting(self) -> None:
        """What is waited for before the worker begins is given up; may be overridden."""

    def destroy_node(self) -> None:
        """Also end the worker."""
        self.worker.close()
        super().destroy_node()

    @property
    def busy(self) -> bool:
        """Whether an identification is under way."""
        return self._ended is not None

    def begin(self, work: Callable[[], Awaitable[Answer]]) -> None:
        """Start work that no caller waits for; not while other work runs."""
        if self.executor is not None:
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
        self.when_free()
        return answer

    async def run_in_worker(self, function: Callable, request: Any) -> tuple[Any, str]:
        """Have the worker do something: its result and an empty sentence, or None and what went wrong."""
        self._check_compilation()
        self.health.begin()
        outcome, error = await outcome_of(self.worker, self.executor, function, request, self._on_progress)
        if error is None:
            return outcome, ''
        if isinstance(error, WorkerError):
            self.get_logger().warning(f'{error}; if this repeats, look for a lack of memory with `dmesg`')
        return None, CANCELLED if isinstance(error, Cancelled) else str(error)

    def _check_compilation(self) -> None:
        """Have the worker report, once, why its work takes longer than it could: numba is loaded there, not here."""
        if not self._has_checked:
            self._has_checked = True
            self.worker.submit(why_uncompiled, (), lambda why, error: report_uncompiled(self, self.health, why))

    def _on_progress(self, share: float) -> None:
        self.health.progress = share
        self._progress.publish(Float32(data=float(share)))

    async def _on_identify(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # one identification answers all callers that come meanwhile
        answer = await (self._begun(self.identify) if self._ended is None else self._ended)
        await self._answers.wait()
        response.success, response.message = answer
        return response

    async def _on_cancel(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self.busy, 'nothing is running'
        if (ended := self._ended) is not None:
            self.stop_waiting()
            self.worker.cancel()
            await ended
            response.message = 'the identification has ended'
        return response

    def _on_rollback(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self.replaced(self.refitter.rollback, 'there is no model before this one', response)

    def replaced(self, change: Callable[[], bool], refusal: str, response: Trigger.Response) -> Trigger.Response:
        """Publish the models after a change of the refitter, or answer why there was none."""
        response.success, response.message = False, BUSY if self.busy else refusal
        if not self.busy and change():
            remark = f'{self.refitter.steps_back} more are kept{self.replace_model()}'
            response.success, response.message = True, f'back to {self.refitter.described}; {remark}'
        return response
