"""The node predictor: attitude one sample ahead, at the leads and over the horizon, with covariance."""

from collections.abc import Iterable
from dataclasses import replace
from time import perf_counter

from rclpy.node import Node

from swath_sysid.attitude.motion.intake import ImuReading
from swath_sysid.attitude.prediction.forecast import nothing
from swath_sysid.formats.messages import imu_reading, stamp_ns
from swath_sysid.formats.topics import NEXT_TOPIC
from swath_sysid.nodes import qos
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher
from swath_sysid.nodes.executor_loop import Plan, events_executor
from swath_sysid.nodes.forecast_publishers import forecast_publishers
from swath_sysid.nodes.inbox import PacedInbox
from swath_sysid.nodes.kept_sea import KeptSea
from swath_sysid.nodes.kernels import KernelLoading
from swath_sysid.nodes.models_in_use import ModelsInUse
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.settings import pipeline_settings
from swath_sysid.nodes.sea_fitting import SeaFitting
from swath_sysid.nodes.transforms import Transforms
from swath_sysid.nodes.upstream_topics import Upstream
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings, warm_up
from swath_sysid.pipeline.health import Report


class Predictor(Node):
    """imu/data, model/description, craft/loading and upstream channels in, forecast/* out."""

    waits_for = qos.IMU_TOPIC  #: The topic without which it does nothing.

    def __init__(self) -> None:
        super().__init__('predictor')
        self.parameters = NodeParameters(self, 'predictor', pipeline_settings, self._on_parameters)
        in_step, depth = self.parameters['in_step'], self.parameters['queue_depth']
        self.upstream = Upstream(self, self.parameters['upstream'], depth)
        self.pipeline = ForecastPipeline(self.upstream.settings(self.parameters.settings))
        self.health = PredictorHealth(self.resolve_topic_name(qos.IMU_TOPIC), self.pipeline)
        self._sea_file = KeptSea(self, self.parameters['sea_memory'], self.pipeline, self.health)
        self._kernels = KernelLoading(warm_up, self, self.health)
        self.sea = SeaFitting(self.pipeline, self.health, self.get_logger(), in_step)
        self._messages, self._publisher_of, self._wanted = forecast_publishers(self, self.parameters, self.health)
        self.transforms = Transforms(self, self.parameters)
        self.models = ModelsInUse(self, self.parameters, self.pipeline, self.health, self.transforms)
        self.upstream.listen(self.pipeline, self.health)
        self.inbox = PacedInbox(self, depth, self.health, in_step)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)

    def destroy_node(self) -> None:
        """Also end the workers and the intake, and keep what was learnt of the sea."""
        self._kernels.close()
        self.sea.close()
        self.models.intake.close()
        self._sea_file.keep()
        super().destroy_node()

    @property
    def is_behind(self) -> bool:
        """Whether samples wait."""
        return bool(self.inbox) and not self.transforms.hold_back(self.inbox)

    def work(self, seconds: float) -> None:
        """Handle the samples that wait, for so long: forecast from each or, where others wait behind it, from the
        newest only; if they come faster than they can be handled, some are left out.
        """
        if self.models.intake.endings and self.models.use_new():
            self._diagnostics.publish()  # a user who has just seen the model must not read that there is none
        until = perf_counter() + seconds
        while self.is_behind and (begun := perf_counter()) < until:
            if self.sea.is_fitting and not self.sea.hands_over(self.inbox.oldest_ns, until - begun):
                return
            (message, arrival, clock_ns), is_used, is_passed_over = self.inbox.take()
            if not is_used:
                self.pipeline.leave_out(stamp_ns(message.header.stamp), arrival)
                continue
            reading = imu_reading(message)
            self._add(reading, arrival, is_passed_over)
            self.health.note_frame_id(message.header.frame_id)
            self.health.note_message(reading.stamp_ns, clock_ns, begun, perf_counter())
            self.inbox.pace.note(perf_counter())

    def _add(self, reading: ImuReading, arrival: float, is_passed_over: bool) -> None:
        step = self.pipeline.begin(self.pipeline.intake.take(reading, arrival))
        if not is_passed_over:
            self._publish(self._messages.next_of(step))
        step = self.pipeline.finish(step, nothing if is_passed_over else self._wanted)
        self._publish(self._messages.sea_of(step))
        if step.sea_request is not None:
            self.sea.submit(step.sea_request, reading.stamp_ns)
        if is_passed_over:
            self.health.note('passed-over')
            return
        self.health.published += step.next is not None
        self.health.note_forecast(qos.arrival_time(self) - arrival, self.inbox.pace.stride)
        self._publish(self._messages.of(step))

    def _publish(self, messages: Iterable[tuple[str, bytes]]) -> None:
        for topic, raw in messages:
            self._publisher_of[topic].publish(raw)

    def _on_parameters(self, settings: PipelineSettings) -> None:
        before, settings = self.pipeline.settings, self.upstream.settings(settings)
        others = [replace(each, forecaster=replace(each.forecaster, quiescence=None)) for each in (before, settings)]
        if others[0] != others[1]:
            self._reset(settings)
        self.pipeline.forecaster.set_quiescence(settings.forecaster.quiescence)
        self.models.load()

    def _reset(self, settings: PipelineSettings) -> None:
        """Forecast for other leads, or of a sensor that is mounted otherwise."""
        self.sea.drop()
        self.pipeline.reset(settings)
        found = forecast_publishers(self, self.parameters, self.health, self._publisher_of)
        self._messages, self._publisher_of, self._wanted = found
        if self.pipeline.used:  # else nothing has begun
            self.get_logger().info('forecasts begin anew, and learn the waves again, with the changed parameters')

    def _reports(self) -> list[Report]:
        self.models.use_new()  # also while the sensor is silent
        qos.note_publishers(self, self.inbox.subscription, self.health)
        self.health.note_predictors(self.count_publishers(self._publisher_of[NEXT_TOPIC].topic_name))
        return [*self.health.reports(perf_counter(), self.get_clock().now().nanoseconds), *self.upstream.reports()]


PLAN: Plan = [(events_executor, [Predictor])]
