"""The publishers of predictor."""

from collections.abc import Sequence

from rclpy.node import Node

from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.formats.forecast_output import ForecastMessages, forecast_topics
from swath_sysid.formats.topics import FRAMES_TOPIC, LATCHED_TOPICS, NEXT_TOPIC, TYPES, type_of
from swath_sysid.nodes.message_types import message_class
from swath_sysid.nodes.qos import LATCHED, NEWEST, watched_publisher
from swath_sysid.pipeline.forecast_messages import AttitudeForecast
from swath_sysid.pipeline.forecast_pipeline import PipelineStep
from swath_sysid.pipeline.health import Reasons

NO_FRAMES = (
    'frames_at_s needs the package tf2_msgs, which ROS 2 from apt has (ros-jazzy-tf2-msgs) and PyPI has not: no frames '
    'are published'
)


class ForecastPublishers:
    """Publishes the forecasts of the steps of a pipeline."""

    def __init__(
        self, node: Node, settings: ForecasterSettings, frame_id: str, health: Reasons, frames_at: Sequence[float] = ()
    ):
        if frames_at and message_class(TYPES[FRAMES_TOPIC]) is None:
            node.get_logger().error(NO_FRAMES)
            frames_at = ()
        self._messages = ForecastMessages(frame_id, frames_at)
        self._publishers = {
            topic: watched_publisher(
                node, message_class(type_of(topic)), topic, LATCHED if topic in LATCHED_TOPICS else NEWEST, health
            )
            for topic in forecast_topics(settings.leads, [point.name for point in settings.points], frames_at)
        }

    def publish_next(self, forecast: AttitudeForecast) -> None:
        """Publish the forecast one sample ahead."""
        self._publishers[NEXT_TOPIC].publish(self._messages.attitude(forecast))

    def publish(self, step: PipelineStep) -> None:
        """Publish the other forecasts."""
        for topic, raw in self._messages.of(step):
            self._publishers[topic].publish(raw)
