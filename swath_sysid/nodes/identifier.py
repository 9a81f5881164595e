"""The node identifier: refits the model on a window in a worker process, while it goes on answering."""
import sys

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from swath_sysid import __version__
from swath_sysid.attitude.identification.refit import Refitter, refit, warm_up, window_provenance
from swath_sysid.common.errors import InputError
from swath_sysid.common.stopping import Cancelled
from swath_sysid.manoeuvring.identification.refit import refit_manoeuvring
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher
from swath_sysid.nodes.executor_loop import run
from swath_sysid.nodes.health import IDENTIFICATION_WORKER_DIED, IdentifierHealth
from swath_sysid.nodes.manoeuvring_identification import ManoeuvreIdentification
from swath_sysid.nodes.model_publisher import ModelPublisher
from swath_sysid.nodes.parameter_tables import IDENTIFIER, refit_settings
from swath_sysid.nodes.parameters import NodeParameters
from swath_sysid.nodes.qos import SERVICES, watched_publisher
from swath_sysid.nodes.turns import Turns
from swath_sysid.nodes.window_client import WindowClient
from swath_sysid.nodes.worker import Worker

BUSY = 'an identification is running: wait for it or call ~/cancel'
CANCELLED = 'the identification was cancelled'
HULL, MANOEUVRES = 'hull', 'manoeuvres'


class Identifier(Node):
    """motion/window in, model/* and ~/progress out, services ~/identify, ~/cancel and ~/rollback."""

    def __init__(self):
        super().__init__('identifier')
        self.parameters = NodeParameters(self, IDENTIFIER, refit_settings, self._change)
        self.health = IdentifierHealth()
        self._models = ModelPublisher(self, self.parameters['model_path'], self.health)
        self.refitter = Refitter(self.parameters.settings, self._models.known())
        self._doing = None
        self._ended = Future()
        self._turns = Turns(self)
        self._waiting_table = None
        self._progress = watched_publisher(self, Float32, '~/progress', 10, self.health)
        self._windows = WindowClient(self, self.parameters['window_service'], self.health, self._on_window)
        # an async service holds its group while it waits: in the node's own it would lock out all else
        waiting = {'callback_group': ReentrantCallbackGroup(), 'qos_profile': SERVICES}
        self.create_service(Trigger, '~/identify', self._on_identify, **waiting)
        self.create_service(Trigger, '~/cancel', self._on_cancel, **waiting)
        self.create_service(Trigger, '~/rollback', self._on_rollback, qos_profile=SERVICES)
        self._manoeuvres = ManoeuvreIdentification(self, self.parameters, self.health)
        self.create_service(Trigger, '~/identify_manoeuvring', self._on_identify_manoeuvring, **waiting)
        self.create_service(
            Trigger, '~/rollback_manoeuvring', self._on_rollback_manoeuvring, qos_profile=SERVICES)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)
        self.worker = Worker(warm_up, lambda: self.health.note(IDENTIFICATION_WORKER_DIED))
        if self.refitter.models:
            self._models.publish(self.refitter.models)

    def destroy_node(self):
        """Also end the worker."""
        self.worker.close()
        super().destroy_node()

    def _change(self, settings):
        self.refitter.settings = settings

    def _on_window(self, table):
        if self.parameters['auto_identify'] and len(table.rows):
            self._waiting_table = table
            self._begin_waiting()

    def _begin_waiting(self):
        if self._waiting_table is not None and not self._busy:
            table, self._waiting_table = self._waiting_table, None
            self._doing = HULL
            self.executor.create_task(self._refit(table))

    @property
    def _busy(self):
        return self._doing is not None

    async def _on_identify(self, request, response):
        return await self._answered(response, HULL, self._identify)

    async def _answered(self, response, kind, work):
        """The response filled with what a work of a kind ends in, which runs once for all who ask meanwhile."""
        if self._doing == kind:
            answer = await self._ended
        elif self._busy:
            answer = False, BUSY
        else:
            self._doing = kind
            answer = await work()
        await self._turns.wait()
        response.success, response.message = answer
        return response

    async def _identify(self):
        """Refit on a fresh window; success and one line about it."""
        problem = await self._windows.fetch(self.parameters['window_timeout_s'])
        return self._end(False, problem) if problem else await self._refit(self._windows.newest)

    async def _refit(self, table):
        """Refit on a window in the worker; success and one line about it."""
        request = self.refitter.request(table, window_provenance(table, f'swath_sysid {__version__}'))
        outcome, error = await self._carried_out(refit, request)
        if error is not None:
            return self._end(False, CANCELLED if isinstance(error, Cancelled) else str(error))
        if not self.refitter.take(outcome):
            return self._end(False, outcome.message)
        return self._end(True, outcome.message + self._models.publish(self.refitter.models))

    async def _carried_out(self, function, request):
        """Have the worker do something; its result and None, or None and the error."""
        ended, executor = Future(), self.executor

        def end(outcome, error):
            ended.set_result((outcome, error))
            # without this an idle executor never comes to look
            executor.wake()

        self.health.begin()
        self.worker.submit(function, (request,), end, self._on_progress)
        return await ended

    async def _on_identify_manoeuvring(self, request, response):
        return await self._answered(response, MANOEUVRES, self._identify_manoeuvring)

    async def _identify_manoeuvring(self):
        """Refit the manoeuvring model; success and one line about it."""
        try:
            work = self._manoeuvres.request()
        except InputError as error:
            return self._end(False, str(error))
        outcome, error = await self._carried_out(refit_manoeuvring, work)
        if error is not None:
            return self._end(False, CANCELLED if isinstance(error, Cancelled) else str(error))
        return self._end(*self._manoeuvres.take(outcome))

    def _on_rollback_manoeuvring(self, request, response):
        response.success, response.message = (False, BUSY) if self._busy else self._manoeuvres.rollback()
        return response

    def _on_progress(self, share):
        self.health.progress = share
        self._progress.publish(Float32(data=float(share)))

    def _end(self, published, message):
        """Ready for the next; what the services answer."""
        self._doing = None
        self.health.end(published, message)
        self.get_logger().info(message)
        ended, self._ended = self._ended, Future()
        ended.set_result((published, message))
        self._begin_waiting()
        return published, message

    async def _on_cancel(self, request, response):
        response.success, response.message = self._busy, 'nothing is running'
        if self._busy:
            ended = self._ended
            self._waiting_table = None
            self._windows.stop_waiting(CANCELLED)
            self.worker.cancel()
            await ended
            response.message = 'the identification has ended'
        return response

    def _on_rollback(self, request, response):
        if self._busy:
            response.success, response.message = False, BUSY
        elif self.refitter.rollback():
            remark = self._models.publish(self.refitter.models)
            response.success = True
            response.message = f'back to {self.refitter.described}; {self.refitter.steps_back} more are kept{remark}'
        else:
            response.success, response.message = False, 'there is no model before this one'
        return response

    def _reports(self):
        return [self.health.report(self.refitter.described, self.refitter.steps_back, self._busy),
                self._manoeuvres.report()]  # fmt: skip


def main(args=None):
    """Run the node until it is told to stop."""
    return run([(SingleThreadedExecutor, [Identifier])], args)


if __name__ == '__main__':
    sys.exit(main())
