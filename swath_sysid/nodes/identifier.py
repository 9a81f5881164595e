"""The node identifier: refits the model on a window in a worker process, while it goes on answering."""

import sys
from collections import deque
from dataclasses import replace

from rclpy.executors import SingleThreadedExecutor

from swath_sysid import __version__
from swath_sysid.attitude.identification.live_decays import MOST_DECAYS
from swath_sysid.attitude.identification.refit import RefitSettings, Refitter, refit, warm_up
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
        #: Windows with a decay that has not been fitted yet.
        self._noticed: deque[MotionTable] = deque(maxlen=MOST_DECAYS)
        self._windows = WindowClient(self, self.parameters['window_service'], self.health, self._on_window)
        self.serve(warm_up)
        if self.refitter.models:
            self._models.publish(self.refitter.models)
        if self.parameters['identify_interval_s']:
            # of ROS time, which is the bag's under replay: as often in it as on board, however fast it is replayed
            self.create_timer(self.parameters['identify_interval_s'], self._identify_unasked)

    def _identify_unasked(self) -> None:
        if not self.busy:
            self.begin(lambda: self._refit_fresh(is_asked=False))

    def change(self, settings: RefitSettings) -> None:
        """Refit as set from now on."""
        self.refitter.settings = settings

    async def identify(self) -> Answer:
        """Refit all axes on a fresh window."""
        return await self._refit_fresh(is_asked=True)

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
        """Refit on the decays that were noticed meanwhile."""
        if self._noticed and self.parameters['auto_identify'] and not self.busy:
            self.begin(lambda: self._refit(is_asked=False))

    def stop_waiting(self) -> None:
        """Give up windows that wait or are waited for."""
        self._noticed.clear()
        self._windows.stop_waiting(CANCELLED)

    def _on_window(self, table: MotionTable) -> None:
        if not len(table.rows):
            # the buffer was cleared
            self._noticed.clear()
            self.refitter.forget_decays()
        elif table.noticed is not None:
            self._noticed.append(table)
            self.when_free()

    async def _refit_fresh(self, is_asked: bool) -> Answer:
        problem = await self._windows.fetch(self.parameters['window_timeout_s'])
        if problem or self._windows.newest is None:
            return False, problem
        return await self._refit(is_asked, replace(self._windows.newest, noticed=None))

    async def _refit(self, is_asked: bool, *fresh: MotionTable) -> Answer:
        origin = {'source': {'topic': WINDOW_TOPIC}, 'software': f'swath_sysid {__version__}'}
        request = self.refitter.request(*self._noticed, *fresh, is_asked=is_asked, **origin)
        self._noticed.clear()
        outcome, problem = await self.carried_out(refit, request)
        if problem or not self.refitter.take(outcome):
            return False, problem or outcome.message
        return True, outcome.message + self._models.replace(self.refitter.models)


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal comes."""
    return run([(SingleThreadedExecutor, [Identifier])], args)


if __name__ == '__main__':
    sys.exit(main())
