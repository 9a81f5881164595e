"""The node identifier: refits the model on a window in a worker process, while it goes on answering."""

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from swath_sysid import __version__
from swath_sysid.attitude.identification.live_decays import MOST_DECAYS
from swath_sysid.attitude.identification.refit import Refitter, refit, warm_up
from swath_sysid.attitude.motion.window import MotionTable
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import coefficients_message, window_table
from swath_sysid.formats.model_file import model_to_yaml, read_model, write_model
from swath_sysid.formats.topics import COEFFICIENTS_TOPIC, DESCRIPTION_TOPIC, WINDOW_TOPIC
from swath_sysid.nodes.diagnostics import EachOnce
from swath_sysid.nodes.executor_loop import Plan
from swath_sysid.nodes.identification import CANCELLED, Answer, IdentificationNode
from swath_sysid.nodes.kept_model import ModelFile
from swath_sysid.nodes.parameters.settings import installation, refit_settings
from swath_sysid.nodes.qos import LATCHED, SERVICES, watched_publisher, watched_subscription
from swath_sysid.pipeline.health import IdentifierHealth, Report, stability_report, verdict_values


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
        watched_subscription(node, PointCloud2, 'motion/window', self._receive, LATCHED, health)

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


class Identifier(IdentificationNode):
    """motion/window in, model/* and ~/progress out, services ~/identify, ~/cancel, ~/rollback and ~/undo_rollback."""

    waits_for = WINDOW_TOPIC  #: The topic without which it does nothing.

    def __init__(self) -> None:
        super().__init__('identifier', refit_settings)
        self.file = ModelFile(self.parameters['model_path'], read_model, model_to_yaml, write_model, self.health)
        self._description = watched_publisher(self, String, DESCRIPTION_TOPIC, LATCHED, self.health)
        self._coefficients = watched_publisher(self, Float64MultiArray, COEFFICIENTS_TOPIC, LATCHED, self.health)
        self.refitter = Refitter(self.parameters.settings, self.file.read() or {}, self.file.history())
        self._noticed: deque[MotionTable] = deque(maxlen=MOST_DECAYS)  #: With a decay that has not been fitted yet.
        self._windows = WindowClient(self, self.parameters['window_service'], self.health, self._on_window)
        self.serve(warm_up, self._refit_fresh, self._publish_models, self._further, self._refit_noticed, self._give_up)
        undone = 'the rollback is undone: again', self.refitter.undo_rollback, 'there is no rollback to undo'
        forward = partial(self.replaced, *undone)
        self.create_service(Trigger, '~/undo_rollback', forward, qos_profile=SERVICES)
        if self.refitter.models:
            self._publish_models()
        if interval := self.parameters['identify_interval_s']:
            # of ROS time, which is the bag's under replay: as often in it as on board, however fast it is replayed
            self.create_timer(interval, partial(self.begin, partial(self._refit_fresh, is_asked=False)))

    def _further(self) -> tuple[dict, Report]:
        values = {'rollbacks_undone': self.refitter.steps_forward, **verdict_values(self.refitter.models)}
        return values, stability_report(self.refitter.stability)

    def _refit_noticed(self) -> None:
        if self._noticed and self.parameters['auto_identify']:
            self.begin(partial(self._refit, is_asked=False))

    def _give_up(self) -> None:
        self._noticed.clear()
        self._windows.stop_waiting(CANCELLED)

    def _on_window(self, table: MotionTable) -> None:
        if not len(table.rows):  # the buffer was cleared
            self._noticed.clear()
            self.refitter.forget_decays()
        elif table.noticed is not None:
            self._noticed.append(table)
            self._refit_noticed()

    async def _refit_fresh(self, is_asked: bool = True) -> Answer:
        problem = await self._windows.fetch(self.parameters['window_timeout_s'])
        if problem or self._windows.newest is None:
            return False, problem
        return await self._refit(is_asked, replace(self._windows.newest, noticed=None))

    async def _refit(self, is_asked: bool, *fresh: MotionTable) -> Answer:
        origin = {'source': {'topic': WINDOW_TOPIC}, 'software': f'swath_sysid {__version__}'}
        self.refitter.settings = self.parameters.settings
        # a window has the axes of the craft, and does not tell the sensor's
        mount = installation({'mounting_deg': self.parameters['mounting_deg']})
        tables = [replace(each, installation=mount) for each in (*self._noticed, *fresh)]
        request = self.refitter.request(*tables, is_asked=is_asked, **origin)
        self._noticed.clear()
        return await self.refit(refit, request)

    def _publish_models(self) -> dict:
        models = self.refitter.models
        self._description.publish(String(data=model_to_yaml(models) if models else ''))
        self._coefficients.publish(coefficients_message(models))
        return models


PLAN: Plan = [(SingleThreadedExecutor, [Identifier])]
