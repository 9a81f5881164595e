"""The node manoeuvring_predictor: where a twin-thruster craft will be, with covariance."""
import sys
from time import perf_counter

import numpy as np
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64, Float64MultiArray, String

from swath_sysid.common.errors import InputError
from swath_sysid.formats.manoeuvring_model_file import manoeuvring_from_yaml, read_manoeuvring_model
from swath_sysid.formats.topics import IMU_TOPIC, PATH_TOPIC, manoeuvring_lead_topic
from swath_sysid.manoeuvring.prediction.pipeline import NOT_FINITE, REASONS, ManoeuvreOutlook
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher
from swath_sysid.nodes.executor_loop import events_executor, run
from swath_sysid.nodes.health import ERROR, OK, WARN, Report
from swath_sysid.nodes.manoeuvring_messages import odometry_message, odometry_reading, path_message
from swath_sysid.nodes.messages import NANOSECONDS, stamp_ns
from swath_sysid.nodes.model_intake import ModelIntake
from swath_sysid.nodes.parameter_tables import MANOEUVRE_PREDICTOR, manoeuvring_pipeline_settings
from swath_sysid.nodes.parameters import NodeParameters
from swath_sysid.nodes.qos import LATCHED, NEWEST

SILENT_AFTER = 2.0
CLOCKS_APART = 1.0
"""s between the node's clock and the stamps of the odometry, beyond which thrust is stamped like the odometry."""

class ManoeuvrePredictor(Node):
    """odometry, imu/data and the thrusters in, manoeuvring/* out."""

    def __init__(self):
        super().__init__('manoeuvring_predictor')
        self.parameters = NodeParameters(self, MANOEUVRE_PREDICTOR, manoeuvring_pipeline_settings)
        self.outlook = ManoeuvreOutlook(self.parameters.settings)
        self._bad_models = 0
        self._refusal = ''
        self._received = 0
        self._arrival = None
        self._stamp = None
        self._frames = ('odom', 'base_link')
        self._told = dict(self.outlook.counts)
        self._path = self.create_publisher(Path, PATH_TOPIC, NEWEST)
        self._leads = [
            self.create_publisher(Odometry, manoeuvring_lead_topic(lead), NEWEST)
            for lead in self.parameters.settings.leads
        ]
        sensor = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._intake = ModelIntake(lambda text: manoeuvring_from_yaml(text, 'manoeuvring/model'), self._refuse)
        self._kept = [
            self.create_subscription(Odometry, 'odometry', self._on_odometry, sensor),
            self.create_subscription(Imu, IMU_TOPIC, self._on_imu, sensor),
            self.create_subscription(Float64, 'thrusters/left/thrust', lambda m: self._on_thrust('port', m), sensor),
            self.create_subscription(
                Float64, 'thrusters/right/thrust', lambda m: self._on_thrust('starboard', m), sensor),
            self.create_subscription(Float64MultiArray, 'manoeuvring/future_thrust', self._on_future, 10),
            self.create_subscription(
                String, 'manoeuvring/model', lambda message: self._intake.submit(message.data), LATCHED),
        ]
        self._read_file(self.parameters['model_file'])
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)

    def destroy_node(self):
        """Also end the intake."""
        self._intake.close()
        super().destroy_node()

    def _on_odometry(self, message):
        self._take_models()
        self._received += 1
        self._arrival = perf_counter()
        reading = odometry_reading(message)
        self._stamp = reading.stamp
        self._frames = (message.header.frame_id or 'odom', message.child_frame_id or 'base_link')
        step = self.outlook.add_odometry(reading)
        for publisher, state in zip(self._leads, step.leads, strict=False):
            publisher.publish(odometry_message(state, *self._frames))
        if step.path:
            self._path.publish(path_message(step.path, reading.stamp, self._frames[0]))

    def _on_imu(self, message):
        variance = float(message.angular_velocity_covariance[8])
        if message.angular_velocity_covariance[0] != -1.0:
            self.outlook.add_yaw_rate(
                stamp_ns(message.header.stamp) / NANOSECONDS, message.angular_velocity.z,
                variance**0.5 if 0.0 < variance < 1.0 else None,
            )  # fmt: skip

    def _on_thrust(self, side, message):
        self.outlook.add_thrust(self._now(), side, message.data)

    def _on_future(self, message):
        """Rows of lead, port, starboard; none: hold the last."""
        values = list(message.data)
        if len(values) % 3 or not np.all(np.isfinite(values)):
            self.outlook.counts[NOT_FINITE] += 1
            return
        self.outlook.supply(zip(values[::3], values[1::3], values[2::3], strict=True))

    def _read_file(self, path):
        """Begin with the model of a file; one that cannot be used leaves the craft its steady motion."""
        try:
            if path:
                self._use(read_manoeuvring_model(path))
        except InputError as error:
            self._refuse(str(error))

    def _take_models(self):
        """Use what came on manoeuvring/model, once it is read."""
        for identified in self._intake.taken():
            self._use(identified)

    def _use(self, identified):
        self.outlook.set_model(identified)
        self._refusal = ''
        self.get_logger().info(f'new model: {", ".join(identified.names)}')

    def _refuse(self, sentence):
        self._bad_models += 1
        self._refusal = sentence
        self.get_logger().error(f'{sentence}; the model before it stays')

    def _now(self):
        """Stamp for a message without one: the node's clock, unless that is not the clock of the odometry."""
        now = self.get_clock().now().nanoseconds / NANOSECONDS
        if self._stamp is None or abs(now - self._stamp) < CLOCKS_APART:
            return now
        return self._stamp + min(perf_counter() - self._arrival, CLOCKS_APART)

    def _reports(self):
        # also while the odometry is silent
        self._take_models()
        counts = self.outlook.counts
        fresh = {reason: count - self._told[reason] for reason, count in counts.items() if count > self._told[reason]}
        self._told = dict(counts)
        level, text = OK, 'forecasting with the identified model'
        if not self.outlook.has_model:
            level = WARN
            text = 'no model yet, steady motion is taken: give model_file, or publish one on manoeuvring/model'
        if self._refusal:
            level, text = WARN, f'{self._refusal}; the model before it stays'
        if fresh:
            worst = max(fresh, key=fresh.get)
            level, text = WARN, f'{worst} ({fresh[worst]} times lately): {REASONS[worst]}'
        silence = None if self._arrival is None else perf_counter() - self._arrival
        if silence is None or silence > SILENT_AFTER:
            topic = self._kept[0].topic_name
            level, text = ERROR, f'no odometry on {topic}: check that it is published there, or remap the topic'
        values = {
            'received': self._received, 'bad_models': self._bad_models, 'refused_model': self._refusal, **counts,
        }  # fmt: skip
        return [Report('manoeuvre', level, text, values)]


def main(args=None):
    """Run the node until it is told to stop."""
    return run([(events_executor, [ManoeuvrePredictor])], args)


if __name__ == '__main__':
    sys.exit(main())
