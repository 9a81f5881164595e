"""The node predictor: attitude one sample ahead, at the leads and over the horizon, with covariance."""

from collections.abc import Iterable
from time import perf_counter

from rclpy.node import Node
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64, String

from swath_sysid.attitude.hull.identified_model import models_at
from swath_sysid.attitude.motion.intake import ImuReading
from swath_sysid.attitude.prediction.forecast import nothing
from swath_sysid.common.accelerator import why_slower
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import imu_reading
from swath_sysid.formats.model_file import description_from_yaml
from swath_sysid.formats.topics import DESCRIPTION_TOPIC, NEXT_TOPIC
from swath_sysid.nodes import qos
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher, report_slower
from swath_sysid.nodes.executor_loop import Plan, events_executor
from swath_sysid.nodes.forecast_publishers import forecast_publishers
from swath_sysid.nodes.model_intake import ModelIntake
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.settings import pipeline_settings
from swath_sysid.nodes.sea_fitting import SeaFitting
from swath_sysid.nodes.upstream_topics import Upstream
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings, warm_up
from swath_sysid.pipeline.health import BAD_LOADING, LOADING_ADVICE, PASSED_OVER, Report

PASSED_OVER_NS = 100_000_000  #: A sample that is older than the newest one by more only feeds the filters.


class Predictor(Node):
    """imu/data, model/description, craft/loading and upstream channels in, forecast/* out."""

    waits_for = qos.IMU_TOPIC  #: The topic without which it does nothing.

    def __init__(self) -> None:
        super().__init__('predictor')
        self.get_logger().info('loading the filters, which takes seconds, or up to a minute after an installation')
        warm_up()  # which loads numba now, not amid the first samples
        self.parameters = NodeParameters(self, 'predictor', pipeline_settings, self._on_parameters)
        self._depth, self._is_in_step = self.parameters['queue_depth'], self.parameters['in_step']
        self.upstream = Upstream(self, self.parameters['upstream'], self._depth)
        self.pipeline = ForecastPipeline(self.upstream.settings(self.parameters.settings))
        self.health = PredictorHealth(self.resolve_topic_name(qos.IMU_TOPIC), self.pipeline)
        report_slower(self, self.health, why_slower())
        self.sea = SeaFitting(self.pipeline, self.health, self.get_logger(), self._is_in_step)
        self._messages, self._publisher_of, self._wanted = forecast_publishers(self, self.parameters, self.health)
        self._described: tuple[dict, dict] = {}, {}
        self._published_loading: float | None = None
        # an empty text takes the models away
        self._intake = ModelIntake(
            lambda text: description_from_yaml(text, DESCRIPTION_TOPIC) if text else ({}, {}), self._refuse_model
        )
        qos.watched_subscription(
            self, String, DESCRIPTION_TOPIC, lambda message: self._intake.submit(message.data), qos.LATCHED, self.health
        )
        qos.watched_subscription(self, Float64, 'craft/loading', self._on_loading, qos.NEWEST, self.health)
        self.upstream.listen(self.pipeline, self.health)
        self._subscription = qos.imu_subscription(self, Imu, self._on_imu, self._depth, self.health)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)

    def destroy_node(self) -> None:
        """Also end the worker and the intake."""
        self.sea.close()
        self._intake.close()
        super().destroy_node()

    def _on_imu(self, message: Imu) -> None:
        """Forecast from a sample or, where others wait behind it, from the newest only."""
        if self._intake.endings and self._use_new_models():
            self._diagnostics.publish()  # a user who has just seen the model must not read that there is none
        clock_ns = self.get_clock().now().nanoseconds
        if self.upstream.sources:
            self.upstream.take_waiting()
        messages = [message, *qos.waiting(self._subscription, self._depth)]
        readings = [imu_reading(each) for each in messages]
        for each, reading in zip(messages, readings, strict=True):
            begun = perf_counter()
            self._add(reading, reading.stamp_ns < readings[0 if self._is_in_step else -1].stamp_ns - PASSED_OVER_NS)
            self.health.note_frame_id(each.header.frame_id)
            self.health.note_message(reading.stamp_ns, clock_ns, begun, perf_counter())

    def _add(self, reading: ImuReading, is_passed_over: bool) -> None:
        if self.sea.is_fitting:
            self.sea.hand_over(reading.stamp_ns)
        step = self.pipeline.begin(self.pipeline.intake.take(reading, qos.arrival_time(self)))
        if not is_passed_over:
            self._publish(self._messages.next_of(step))
        step = self.pipeline.finish(step, nothing if is_passed_over else self._wanted)
        self._publish(self._messages.sea_of(step))
        if step.sea_request is not None:
            self.sea.submit(step.sea_request, reading.stamp_ns)
        if is_passed_over:
            self.health.note(PASSED_OVER)
            return
        self.health.published += step.next is not None
        self._publish(self._messages.of(step))

    def _publish(self, messages: Iterable[tuple[str, bytes]]) -> None:
        for topic, raw in messages:
            self._publisher_of[topic].publish(raw)

    def _use_new_models(self) -> bool:
        """Use what came on model/description, once it is read; whether something came."""
        before = self._described
        for description in self._intake.finished():
            self._described = description
            self._load()
            self.health.note_model(perf_counter())
            known = [f'{axis} {held.model.equation.name}' for axis, held in description[0].items()]
            self.get_logger().info(f'new model: {", ".join(known) or "none"}')
        return self._described is not before

    def _refuse_model(self, sentence: str) -> None:
        self.health.note_refused_model(sentence)
        self.get_logger().error(f'{sentence}; the previous model stays')

    def _on_loading(self, message: Float64) -> None:
        before, self._published_loading = self._published_loading, message.data
        try:
            self._load()
        except InputError as error:
            self._published_loading = before
            self.health.note(BAD_LOADING, 'loading')
            self.get_logger().error(f'{error}; the previous loading stays')

    def _on_parameters(self, settings: PipelineSettings) -> None:
        self.pipeline.forecaster.set_quiescence(settings.forecaster.quiescence)
        self._load()

    def _load(self) -> None:
        """Hand on the models at the present loading; the filters keep their state."""
        models, advice = models_at(*self._described, self.parameters['loading'] or self._published_loading)
        self.pipeline.set_models(models)
        self.health.settle('loading')
        for item in advice:
            self.health.note(LOADING_ADVICE, 'loading')
            self.get_logger().warning(item.message)

    def _reports(self) -> list[Report]:
        self._use_new_models()  # also while the sensor is silent
        qos.note_publishers(self, self._subscription, self.health)
        self.health.note_predictors(self.count_publishers(self._publisher_of[NEXT_TOPIC].topic_name))
        return [*self.health.reports(perf_counter(), self.get_clock().now().nanoseconds), *self.upstream.reports()]


PLAN: Plan = [(events_executor, [Predictor])]
