"""The node predictor: attitude one sample ahead, at the leads and over the horizon, with covariance."""
import sys
from time import perf_counter

from rclpy.node import Node
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from swath_sysid.errors import InputError
from swath_sysid.files.model_file import model_from_yaml
from swath_sysid.motion.trial import AXES
from swath_sysid.nodes.connections import (
    LATCHED,
    NEWEST,
    imu_subscription,
    watched_publisher,
    watched_subscription,
)
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher
from swath_sysid.nodes.health import BAD_MODEL, OK, WARN, Report, StreamHealth
from swath_sysid.nodes.messages import AttitudeMessage, horizon_message, imu_reading
from swath_sysid.nodes.parameter_tables import PREDICTOR, outlook_settings
from swath_sysid.nodes.parameters import NodeParameters
from swath_sysid.nodes.spinning import events_executor, run
from swath_sysid.prediction.outlook import HORIZON_TOPIC, NEXT_TOPIC, Outlook, lead_topic


class Predictor(Node):
    """See DESIGN: imu/data and model/description in, forecast/* out."""

    def __init__(self):
        super().__init__('predictor')
        self.parameters = NodeParameters(self, PREDICTOR, outlook_settings)
        self.outlook = Outlook(self.parameters.settings)
        self.health = StreamHealth('imu/data')
        self.bad_models = 0
        self._model_arrival = None
        self._message = AttitudeMessage(self.parameters['frame_id'])
        self._next = watched_publisher(self, Imu, NEXT_TOPIC, NEWEST, self.health)
        self._leads = {
            lead: watched_publisher(self, Imu, lead_topic(lead), NEWEST, self.health)
            for lead in self.parameters['leads_s']
        }
        self._horizon = watched_publisher(self, JointTrajectory, HORIZON_TOPIC, NEWEST, self.health)
        watched_subscription(self, String, 'model/description', self._on_model, LATCHED, self.health)
        self._subscription = imu_subscription(self, Imu, self._on_imu, self.parameters['queue_depth'], self.health)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)

    def _on_imu(self, message):
        begun = perf_counter()
        reading = imu_reading(message)
        step = self.outlook.add(reading)
        if step.next is not None:
            self._next.publish(self._message.filled(step.next))
        for lead, forecast in step.leads:
            self._leads[lead].publish(self._message.filled(forecast))
        if step.horizon is not None:
            self._horizon.publish(horizon_message(step.horizon, self.parameters['frame_id']))
        self.health.note(reading.stamp_ns, begun, perf_counter())

    def _on_model(self, message):
        try:
            models = model_from_yaml(message.data, 'model/description') if message.data else {}
        except InputError as error:
            self.bad_models += 1
            self.get_logger().error(f'{error}; the model before it stays')
            return
        self.outlook.set_models(models)
        self._model_arrival = perf_counter()
        known = ', '.join(f'{axis} {held.model.equation.name}' for axis, held in models.items()) or 'none'
        self.get_logger().info(f'new model: {known}')

    def _reports(self):
        now = perf_counter()
        self.health.note_publishers(self.count_publishers(self._subscription.topic_name))
        state = self.outlook.predictor.diagnostics()
        counts = {**state.counts}
        for reason, count in self.outlook.counts.items():
            counts[reason] = counts.get(reason, 0) + count
        stream = self.health.report('imu', now, self.get_clock().now().nanoseconds, counts, self.outlook.used)
        level, message = OK, 'forecasting with the identified model'
        if self.bad_models:
            level, message = WARN, 'a model description could not be read; the model before it stays'
        if state.advice:
            level, message = WARN, '; '.join(advice.message for advice in state.advice)
        values = {
            **{f'model_{axis}': state.has_model[axis] for axis in AXES},
            'model_age_s': 'no model' if self._model_arrival is None else now - self._model_arrival,
            **{f'nis_ratio_{axis}': ratio for axis, ratio in state.nis_ratio.items()},
            BAD_MODEL: self.bad_models,
        }
        return [stream, Report('forecast', level, message, values)]


def main(args=None):
    """Run the node until it is told to stop."""
    return run([(events_executor, [Predictor])], args)


if __name__ == '__main__':
    sys.exit(main())
