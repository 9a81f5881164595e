"""The node identifier: refits the model on a window in a worker process, while it goes on answering."""

from collections import deque
from dataclasses import replace
from functools import partial

from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from swath_sysid import __version__
from swath_sysid.attitude.identification.live_decays import MOST_DECAYS
from swath_sysid.attitude.identification.refit import Refitter, refit, warm_up
from swath_sysid.attitude.motion.window import MotionTable
from swath_sysid.formats.messages import coefficients_message
from swath_sysid.formats.model_file import model_to_yaml, read_model, write_model
from swath_sysid.formats.topics import COEFFICIENTS_TOPIC, DESCRIPTION_TOPIC, WINDOW_TOPIC
from swath_sysid.nodes.executor_loop import Plan
from swath_sysid.nodes.identification import CANCELLED, Answer, IdentificationNode
from swath_sysid.nodes.kept_model import ModelFile
from swath_sysid.nodes.parameters.settings import refit_settings
from swath_sysid.nodes.qos import LATCHED, SERVICES, watched_publisher
from swath_sysid.nodes.window_client import WindowClient
from swath_sysid.pipeline.health import Report, stability_report, verdict_values


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
        request = self.refitter.request(*self._noticed, *fresh, is_asked=is_asked, **origin)
        self._noticed.clear()
        return await self.refit(refit, request)

    def _publish_models(self) -> dict:
        models = self.refitter.models
        self._description.publish(String(data=model_to_yaml(models) if models else ''))
        self._coefficients.publish(coefficients_message(models))
        return models


PLAN: Plan = [(SingleThreadedExecutor, [Identifier])]
