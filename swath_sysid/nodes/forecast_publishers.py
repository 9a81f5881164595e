"""What the predictor publishes: the messages of its forecasts, and a publisher of each topic."""

from collections.abc import Mapping
from functools import partial

from rclpy.node import Node
from rclpy.publisher import Publisher

from swath_sysid.formats.forecast_output import ForecastMessages, forecast_topics
from swath_sysid.formats.topics import FRAMES_TOPIC, LATCHED_TOPICS, TYPES, type_of
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.settings import frames_at
from swath_sysid.nodes.qos import LATCHED, NEWEST, message_class, watched_publisher
from swath_sysid.pipeline.forecast_health import PredictorHealth

NO_FRAMES = (
    'frames_at_s needs the package tf2_msgs, which ROS 2 from apt has (ros-jazzy-tf2-msgs) and PyPI has not: no frames '
    'are published'
)


def forecast_publishers(
    node: Node, parameters: NodeParameters, health: PredictorHealth
) -> tuple[ForecastMessages, dict[str, Publisher]]:
    """The messages of forecasts that somebody subscribes to, and their publishers by topic."""
    frames = frames_at(parameters['frames_at_s'])
    if frames and message_class(TYPES[FRAMES_TOPIC]) is None:
        node.get_logger().error(NO_FRAMES)
        frames = ()
    settings, found = parameters.settings.forecaster, {}
    for topic in forecast_topics(settings.leads, [point.name for point in settings.points], frames):
        qos = LATCHED if topic in LATCHED_TOPICS else NEWEST
        found[topic] = watched_publisher(node, message_class(type_of(topic)), topic, qos, health)
    return ForecastMessages(parameters['frame_id'], frames, partial(_is_heard, found)), found


def _is_heard(publishers: Mapping[str, Publisher], topic: str) -> bool:
    """Whether somebody gets its next message, or may come to get the last one."""
    return topic in LATCHED_TOPICS or publishers[topic].get_subscription_count() > 0
