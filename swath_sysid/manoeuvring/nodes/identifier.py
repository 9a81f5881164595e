"""The node manoeuvring_identifier: fits the model of a twin-thruster craft to how it was driven, when asked."""

from collections.abc import Callable

from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64, String

from swath_sysid import __version__
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.formats.messages import odometry_reading
from swath_sysid.manoeuvring.formats.model_file import (
    manoeuvring_to_yaml,
    read_manoeuvring_model,
    write_manoeuvring_model,
)
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.identification.refit import (
    ManoeuvreRefitRequest,
    ManoeuvreRefitter,
    refit_manoeuvring,
    warm_up,
)
from swath_sysid.manoeuvring.motion.window import ManoeuvringWindow
from swath_sysid.manoeuvring.nodes.settings import manoeuvring_settings
from swath_sysid.nodes.executor_loop import Plan
from swath_sysid.nodes.identification import Answer, IdentificationNode
from swath_sysid.nodes.kept_model import ModelFile
from swath_sysid.nodes.qos import LATCHED, SENSOR, THRUSTERS, watched_publisher, watched_subscription
from swath_sysid.pipeline.health import OK, Report, verdict_values


class ManoeuvringIdentifier(IdentificationNode):
    """odometry and thrusters in, manoeuvring/model and ~/progress out, services as those of identifier."""

    waits_for = 'odometry'  #: The topic without which it does nothing.

    def __init__(self) -> None:
        super().__init__('manoeuvring_identifier', manoeuvring_settings)
        path = self.parameters['model_path']
        self.file = ModelFile(path, read_manoeuvring_model, manoeuvring_to_yaml, write_manoeuvring_model, self.health)
        self.refitter = ManoeuvreRefitter(self.file.read(), self.file.history())
        self.window = ManoeuvringWindow(self.parameters['window_s'], self.parameters['stop_after_s'])
        self._publisher = watched_publisher(self, String, 'manoeuvring/model', LATCHED, self.health)
        watched_subscription(self, Odometry, 'odometry', self._on_odometry, SENSOR, self.health)
        for side, topic in THRUSTERS.items():
            watched_subscription(self, Float64, topic, self._thrust_callback(side), SENSOR, self.health)
        self.serve(warm_up, self._refit_window, self._publish_model, self._further)
        self._publish_model()

    async def _refit_window(self) -> Answer:
        try:
            request = self._request()
        except InputError as error:
            return False, str(error)
        return await self.refit(refit_manoeuvring, request)

    def _further(self) -> tuple[dict, Report]:
        size = self.window.size
        values = {'rows': size, 'model': self.refitter.described, **self.window.counts}
        kept = Report('manoeuvres', OK, f'{size} rows of odometry and thrust kept', values)
        return verdict_values({'manoeuvring': self.refitter.model}), kept

    def _request(self) -> ManoeuvreRefitRequest:
        trial = self.window.trial(self.parameters['thrust_input'], 'odometry')
        provenance = {
            'software': f'swath_sysid {__version__}',
            'sources': [{'topic': 'odometry', 'first_stamp_s': float(trial.time[0]), 'rows': int(trial.time.size)}],
        }
        return ManoeuvreRefitRequest(
            trial, self.refitter.model, self.parameters.settings, self.parameters['least_improvement'], provenance
        )

    def _publish_model(self) -> IdentifiedManoeuvringModel | None:
        if (model := self.refitter.model) is not None:
            self._publisher.publish(String(data=manoeuvring_to_yaml(model)))
        return model

    def _on_odometry(self, message: Odometry) -> None:
        reading = odometry_reading(message)
        self.window.add_motion(
            reading.stamp, reading.surge, reading.sway, reading.yaw_rate, reading.heading, reading.x, reading.y
        )

    def _thrust_callback(self, side: str) -> Callable[[Float64], None]:
        return lambda message: self.window.add_thrust(side, message.data)


PLAN: Plan = [(SingleThreadedExecutor, [ManoeuvringIdentifier])]
