"""The publishers of predictor."""

from collections.abc import Sequence

from geometry_msgs.msg import AccelWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32, String
from trajectory_msgs.msg import JointTrajectory

from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.formats.forecast_output import ForecastMessages, forecast_topics
from swath_sysid.formats.topics import FRAMES_TOPIC, LATCHED_TOPICS, NEXT_TOPIC, TYPES, type_of
from swath_sysid.nodes.qos import LATCHED, NEWEST, watched_publisher
from swath_sysid.pipeline.forecast_messages import AttitudeForecast
from swath_sysid.pipeline.forecast_pipeline import PipelineStep
from swath_sysid.pipeline.health import Reasons

_KINDS = {
    '/'.join((kind.__module__.split('.')[0], 'msg', kind.__name__)): kind
    for kind in (AccelWithCovarianceStamped, Float32, Imu, JointTrajectory, Odometry, String)
}


NO_FRAMES = (
    'frames_at_s needs the package tf2_msgs, which ROS 2 from apt has (ros-jazzy-tf2-msgs) and PyPI has not: no frames '
    'are published'
)


def frames_message() -> type | None:
    """tf2_msgs/TFMessage, where it is installed."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        return None
    return TFMessage


class ForecastPublishers:
    """Publishes the forecasts of the steps of a pipeline."""

    def __init__(
        self, node: Node, settings: ForecasterSettings, frame_id: str, health: Reasons, frames_at: Sequence[float] = ()
    ):
        kinds = dict(_KINDS)
        if frames_at:
            kind = frames_message()
            if kind is None:
                node.get_logger().error(NO_FRAMES)
                frames_at = ()
            else:
                kinds[TYPES[FRAMES_TOPIC]] = kind
        self._messages = ForecastMessages(frame_id, frames_at)
        self._publishers = {
            topic: watched_publisher(
                node, kinds[type_of(topic)], topic, LATCHED if topic in LATCHED_TOPICS else NEWEST, health
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
