"""The node manoeuvring_predictor: where a twin-thruster craft will be, with covariance."""

import math
from collections.abc import Callable
from itertools import zip_longest
from time import perf_counter
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64, Float64MultiArray, String

from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import SECOND_NS, stamp_ns
from swath_sysid.formats.topics import lead_topic
from swath_sysid.manoeuvring.formats.messages import odometry_message, odometry_reading, path_message
from swath_sysid.manoeuvring.formats.model_file import manoeuvring_from_yaml, read_manoeuvring_model
from swath_sysid.manoeuvring.formats.topics import LEADS, PATH_TOPIC
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.nodes.settings import manoeuvring_pipeline_settings
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreOutlook, ManoeuvringHealth
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher, EachOnce
from swath_sysid.nodes.executor_loop import Plan, events_executor
from swath_sysid.nodes.inbox import Arrival
from swath_sysid.nodes.model_intake import ModelIntake
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.settings import installation
from swath_sysid.nodes.qos import IMU_TOPIC, LATCHED, NEWEST, SENSOR, THRUSTERS
from swath_sysid.nodes.transforms import Transforms
from swath_sysid.pipeline.health import LARGEST_STAMP_AGE, Report


class ManoeuvringPredictor(Node):
    """odometry, imu/data and the thrusters in, manoeuvring/* out."""

    waits_for = 'odometry'  #: The topic without which it does nothing.

    def __init__(self) -> None:
        super().__init__('manoeuvring_predictor')
        self._log_error = EachOnce(self.get_logger().error)
        self.parameters = NodeParameters(self, 'manoeuvring_predictor', manoeuvring_pipeline_settings, self._mount)
        self._mount()
        self.transforms = Transforms(self, self.parameters)
        self.pipeline = ManoeuvreOutlook(self.parameters.settings)
        self.health = ManoeuvringHealth(self.resolve_topic_name('odometry'), self.pipeline)
        self._arrival = 0.0
        self._stamp: float | None = None
        self._frames = ('odom', 'base_link')
        self._path = self.create_publisher(Path, PATH_TOPIC, NEWEST)
        self._leads = [
            self.create_publisher(Odometry, lead_topic(lead, LEADS), NEWEST) for lead in self.parameters.settings.leads
        ]
        self._intake = ModelIntake(lambda text: manoeuvring_from_yaml(text, 'manoeuvring/model'), self._refuse)
        self.create_subscription(Odometry, 'odometry', self._on_odometry, SENSOR)
        self.create_subscription(Imu, IMU_TOPIC, self._on_imu, SENSOR)
        for side, topic in THRUSTERS.items():
            self.create_subscription(Float64, topic, self._thrust_callback(side), SENSOR)
        self.create_subscription(Float64MultiArray, 'manoeuvring/future_thrust', self._on_future, 10)
        self.create_subscription(String, 'manoeuvring/model', self._on_model, LATCHED)
        self._read_file(self.parameters['model_file'])
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)

    def destroy_node(self) -> None:
        """Also end the intake."""
        self._intake.close()
        super().destroy_node()

    def _on_odometry(self, message: Odometry) -> None:
        self._use_new_models()
        self._arrival = perf_counter()
        self.health.note_message(self._arrival)
        reading = odometry_reading(message)
        self._stamp = reading.stamp
        self._frames = (message.header.frame_id or 'odom', message.child_frame_id or 'base_link')
        step = self.pipeline.add_odometry(reading)
        for publisher, state in zip(self._leads, step.leads, strict=False):
            publisher.publish(odometry_message(state, *self._frames))
        if step.path:
            self._path.publish(path_message(step.path, reading.stamp, self._frames[0]))

    def _mount(self, *_: Any) -> None:
        self._installation = installation(self.parameters.values)
        self._upward = self._installation.vector(*np.eye(3))[2]

    def _on_imu(self, message: Imu) -> None:
        # until its mounting is known, the odometry alone tells the yaw rate
        is_awaited = self.transforms.hold_back([Arrival(message, 0.0, 0)])
        if message.angular_velocity_covariance[0] != -1.0 and not is_awaited:
            with np.errstate(invalid='ignore'):  # of a covariance that is not finite
                variance = self._upward @ np.reshape(message.angular_velocity_covariance, (3, 3)) @ self._upward
            std = variance**0.5 if 0.0 < variance < 1.0 else None
            rate = message.angular_velocity
            yaw_rate = self._installation.vector(rate.x, rate.y, rate.z)[2]
            self.pipeline.add_yaw_rate(stamp_ns(message.header.stamp) / SECOND_NS, yaw_rate, std)

    def _thrust_callback(self, side: str) -> Callable[[Float64], None]:
        return lambda message: self.pipeline.add_thrust(self._now(), side, message.data)

    def _on_model(self, message: String) -> None:
        self._intake.submit(message.data)

    def _on_future(self, message: Float64MultiArray) -> None:
        """Rows of lead, port, starboard; none: hold the last."""
        values = list(message.data)
        # a row that is cut counts as one that is not finite
        self.pipeline.supply(zip_longest(values[::3], values[1::3], values[2::3], fillvalue=math.nan))

    def _read_file(self, path: str) -> None:
        """Begin with the model of a file; one that cannot be used leaves the craft its steady motion."""
        try:
            if path:
                self._use(read_manoeuvring_model(path))
        except InputError as error:
            self._refuse(str(error))

    def _use_new_models(self) -> None:
        """Use what came on manoeuvring/model, once it is read."""
        for identified in self._intake.finished():
            self._use(identified)

    def _use(self, identified: IdentifiedManoeuvringModel) -> None:
        self.pipeline.set_model(identified)
        self.health.note_model()
        self.get_logger().info(f'new model: {", ".join(identified.names)}')

    def _refuse(self, sentence: str) -> None:
        self.health.note_refused_model(sentence)
        self._log_error(f'{sentence}; the previous model stays')

    def _now(self) -> float:
        """Stamp for a message without one: the node's clock, unless that is not the clock of the odometry."""
        now = self.get_clock().now().nanoseconds / SECOND_NS
        if self._stamp is None or abs(now - self._stamp) < LARGEST_STAMP_AGE:
            return now
        return self._stamp + min(perf_counter() - self._arrival, LARGEST_STAMP_AGE)

    def _reports(self) -> list[Report]:
        # also while the odometry is silent
        self._use_new_models()
        return self.health.reports(perf_counter())


PLAN: Plan = [(events_executor, [ManoeuvringPredictor])]
