"""The node identifier: refits the model on a window in a worker process, while it goes on answering."""

import sys

from rclpy.executors import SingleThreadedExecutor

from swath_sysid import __version__
from swath_sysid.attitude.identification.refit import RefitSettings, Refitter, refit, warm_up, window_provenance
from swath_sysid.attitude.motion.window import MotionTable
from swath_sysid.formats.topics import WINDOW_TOPIC
from swath_sysid.nodes.executor_loop import run
from swath_sysid.nodes.identification import CANCELLED, Answer, IdentificationNode
from swath_sysid.nodes.model_publisher import ModelPublisher
from swath_sysid.nodes.parameters.identifier import refit_settings
from swath_sysid.nodes.window_client import WindowClient
from swath_sysid.pipeline.health import Report, stability_report
from swath_sysid.pipeline.validity import verdict_values


class Identifier(IdentificationNode):
    """motion/window in, model/* and ~/progress out, services ~/identify, ~/cancel and ~/rollback."""

    waits_for = WINDOW_TOPIC  #: The topic without which it does nothing.

    def __init__(self) -> None:
        super().__init__('identifier', refit_settings)
        self._models = ModelPublisher(self, self.parameters['model_path'], self.health)
        self.refitter = Refitter(self.parameters.settings, self._models.known(), self._models.history())
        self._waiting_table: MotionTable | None = None
        self._windows = WindowClient(self, self.parameters['window_service'], self.health, self._on_window)
        self.serve(warm_up)
        if self.refitter.models:
            self._models.publish(self.refitter.models)
        if self.parameters['identify_interval_s']:
            # of ROS time, which is the bag's under replay: as often in it as on board, however fast it is replayed
            self.create_timer(self.parameters['identify_interval_s'], self._identify_unasked)

    def _identify_unasked(self) -> None:
        if not self.busy:
            self.begin(self.identify)

    def change(self, settings: RefitSettings) -> None:
        """Refit as set from now on."""
        self.refitter.settings = settings

    async def identify(self) -> Answer:
        """Refit on a fresh window."""
        problem = await self._windows.fetch(self.parameters['window_timeout_s'])
        if problem or self._windows.newest is None:
            return False, problem
        return await self._refit(self._windows.newest)

    def rollback(self) -> Answer:
        """Return to the model before."""
        if not self.refitter.rollback():
            return False, 'there is no model before this one'
        remark = self._models.replace(self.refitter.models)
        return True, f'back to {self.refitter.described}; {self.refitter.steps_back} more are kept{remark}'

    def reports(self) -> list[Report]:
        """The status of now."""
        return [
            self.health.report(
                self.refitter.described, self.refitter.steps_back, self.busy, verdict_values(self.refitter.models)
            ),
            stability_report(self.refitter.stability),
        ]

    def when_free(self) -> None:
        """Refit on a window that came meanwhile."""
        if self._waiting_table is not None and not self.busy:
            table, self._waiting_table = self._waiting_table, None
            self.begin(lambda: self._refit(table))

    def stop_waiting(self) -> None:
        """Give up windows that wait or are waited for."""
        self._waiting_table = None
        self._windows.stop_waiting(CANCELLED)

    def _on_window(self, table: MotionTable) -> None:
        if self.parameters['auto_identify'] and len(table.rows):
            self._waiting_table = table
            self.when_free()

    async def _refit(self, table: MotionTable) -> Answer:
        provenance = window_provenance(table, {'topic': WINDOW_TOPIC}, f'swath_sysid {__version__}')
        request = self.refitter.request(table, provenance)
        outcome, problem = await self.carried_out(refit, request)
        if problem or not self.refitter.take(outcome):
            return False, problem or outcome.message
        return True, outcome.message + self._models.replace(self.refitter.models)


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal comes."""
    return run([(SingleThreadedExecutor, [Identifier])], args)


if __name__ == '__main__':
    sys.exit(main())
