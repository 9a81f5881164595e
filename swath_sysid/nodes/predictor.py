"""The node predictor: attitude one sample ahead, at the leads and over the horizon, with covariance."""
import sys
from collections import deque
from time import perf_counter

from rclpy.node import Node
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32, Float64, String
from trajectory_msgs.msg import JointTrajectory

from swath_sysid.errors import InputError
from swath_sysid.files.model_file import description_from_yaml
from swath_sysid.hull.scheduled_model import models_at
from swath_sysid.nodes.connections import (
    IMU_TOPIC,
    LATCHED,
    NEWEST,
    imu_subscription,
    waiting,
    watched_publisher,
    watched_subscription,
)
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher
from swath_sysid.nodes.health import (
    BAD_LOADING,
    LATE_FIT,
    LOADING_ADVICE,
    NOT_FITTED,
    PASSED_OVER,
    WAVE_WORKER_DIED,
    PredictorHealth,
)
from swath_sysid.nodes.messages import NANOSECONDS, AttitudeMessage, horizon_message, imu_reading
from swath_sysid.nodes.model_intake import ModelIntake
from swath_sysid.nodes.parameter_tables import PREDICTOR, outlook_settings
from swath_sysid.nodes.parameters import NodeParameters
from swath_sysid.nodes.spinning import events_executor, run
from swath_sysid.nodes.worker import Worker
from swath_sysid.prediction.outlook import (
    HORIZON_TOPIC,
    NEXT_TOPIC,
    QUIESCENCE_TOPIC,
    Outlook,
    lead_topic,
    warm_up,
)
from swath_sysid.prediction.waves import fit_waves

PASSED_OVER_NS = 100_000_000
"""A sample that is older than the newest one waiting by more feeds the filters, but its forecasts come too late."""


class Predictor(Node):
    """imu/data, model/description and craft/loading in, forecast/* out."""

    def __init__(self):
        super().__init__('predictor')
        self.parameters = NodeParameters(self, PREDICTOR, outlook_settings, self._on_parameters)
        self.outlook = Outlook(self.parameters.settings)
        self.health = PredictorHealth(self.resolve_topic_name(IMU_TOPIC), self.outlook)
        self._message = AttitudeMessage(self.parameters['frame_id'])
        self._next = watched_publisher(self, Imu, NEXT_TOPIC, NEWEST, self.health)
        self._leads = {
            lead: watched_publisher(self, Imu, lead_topic(lead), NEWEST, self.health)
            for lead in self.parameters['leads_s']
        }
        self._horizon = watched_publisher(self, JointTrajectory, HORIZON_TOPIC, NEWEST, self.health)
        self._quiescence = watched_publisher(self, Float32, QUIESCENCE_TOPIC, NEWEST, self.health)
        self._described = {}, {}
        self._told_loading = None
        self._intake = ModelIntake(described, self._refuse_model)
        watched_subscription(
            self, String, 'model/description', lambda message: self._intake.submit(message.data), LATCHED, self.health
        )
        watched_subscription(self, Float64, 'craft/loading', self._on_loading, NEWEST, self.health)
        self._subscription = imu_subscription(self, Imu, self._on_imu, self.parameters['queue_depth'], self.health)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)
        self._fits = deque()
        self._fitting = False
        self._fit_due_ns = self._newest_ns = 0
        self.worker = Worker(warm_up, lambda: self.health.note(WAVE_WORKER_DIED))

    def destroy_node(self):
        """Also end the worker and the intake."""
        self.worker.close()
        self._intake.close()
        super().destroy_node()

    def _on_imu(self, message):
        """Forecast from a sample, or where others wait behind it, from the newest ones only."""
        self._take_models()
        messages = [message, *waiting(self._subscription, self.parameters['queue_depth'])]
        readings = [imu_reading(each) for each in messages]
        forecast_from = readings[-1].stamp_ns - PASSED_OVER_NS
        for each, reading in zip(messages, readings, strict=True):
            begun = perf_counter()
            self._add(reading, reading.stamp_ns < forecast_from)
            self.health.note_frame_id(each.header.frame_id)
            self.health.note_message(reading.stamp_ns, begun, perf_counter())

    def _add(self, reading, is_passed_over):
        while self._fits:
            self._install(*self._fits.popleft())
        step = self.outlook.add(reading, None if is_passed_over else self._publish_next)
        self._newest_ns = reading.stamp_ns
        if step.waves is not None and self._fitting:
            self.health.note(LATE_FIT)
        elif step.waves is not None:
            self._fitting = True
            self._fit_due_ns = reading.stamp_ns + round(self.outlook.settings.predictor.refit_delay * NANOSECONDS)
            # the end comes in the worker's thread: a deque hands it over to this one
            self.worker.submit(fit_waves, (step.waves,), lambda *ending: self._fits.append(ending))
        if is_passed_over:
            self.health.note(PASSED_OVER)
            return
        for lead, forecast in step.leads:
            self._leads[lead].publish(self._message.filled(forecast))
        if step.horizon is not None:
            self._horizon.publish(horizon_message(step.horizon, self.parameters['frame_id']))
        if step.quiescence is not None:
            self._quiescence.publish(Float32(data=step.quiescence))

    def _publish_next(self, forecast):
        self._next.publish(self._message.filled(forecast))

    def _install(self, fit, error):
        self._fitting = False
        if error is None:
            if self._newest_ns >= self._fit_due_ns:
                self.health.note(LATE_FIT)
            self.health.settle('waves')
            self.outlook.install(fit)
        else:
            self.health.note(NOT_FITTED, 'waves')
            self.get_logger().error(f'the waves were not fitted, {error}')

    def _take_models(self):
        """Use what came on model/description, once it is read."""
        for description in self._intake.taken():
            self._described = description
            self._load()
            self.health.note_model(perf_counter())
            known = ', '.join(f'{axis} {held.model.equation.name}' for axis, held in description[0].items()) or 'none'
            self.get_logger().info(f'new model: {known}')

    def _refuse_model(self, sentence):
        self.health.note_refused_model(sentence)
        self.get_logger().error(f'{sentence}; the model before it stays')

    def _on_loading(self, message):
        before, self._told_loading = self._told_loading, message.data
        try:
            self._load()
        except InputError as error:
            self._told_loading = before
            self.health.note(BAD_LOADING, 'loading')
            self.get_logger().error(f'{error}; the loading before it stays')

    def _on_parameters(self, settings):
        self.outlook.predictor.set_quiescence(settings.predictor.quiescence)
        self._load()

    def _load(self):
        """Hand on the models at the present loading; the filters keep their state."""
        models, advice = models_at(*self._described, self.parameters['loading'] or self._told_loading)
        self.outlook.set_models(models)
        self.health.settle('loading')
        for item in advice:
            self.health.note(LOADING_ADVICE, 'loading')
            self.get_logger().warning(item.message)

    def _reports(self):
        # also while the sensor is silent
        self._take_models()
        self.health.note_publishers(self.count_publishers(self._subscription.topic_name))
        return self.health.reports(perf_counter(), self.get_clock().now().nanoseconds)


def described(text):
    """Models and schedules of a message on model/description; an empty one takes the models away."""
    return description_from_yaml(text, 'model/description') if text else ({}, {})


def main(args=None):
    """Run the node until it is told to stop."""
    return run([(events_executor, [Predictor])], args)


if __name__ == '__main__':
    sys.exit(main())
