"""What the predictor publishes: the messages of its forecasts, and a publisher of each topic."""

from collections.abc import Callable, Mapping

from rclpy.node import Node
from rclpy.publisher import Publisher

from swath_sysid.attitude.prediction.forecast import Wanted
from swath_sysid.formats.forecast_output import ForecastMessages, forecast_topics, wanted_for
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
    node: Node, parameters: NodeParameters, health: PredictorHealth, before: Mapping[str, Publisher] | None = None
) -> tuple[ForecastMessages, dict[str, Publisher], Callable[[], Wanted]]:
    """The messages of forecasts, their publishers by topic, and what those that somebody subscribes to are made of.

    Of the publishers from ``before`` a change of the parameters, those of topics that are left stay.
    """
    frames = frames_at(parameters['frames_at_s'])
    if frames and message_class(TYPES[FRAMES_TOPIC]) is None:
        node.get_logger().error(NO_FRAMES)
        frames = ()
    settings, found, left = parameters.settings.forecaster, {}, dict(before or {})
    published = settings.leads, [point.name for point in settings.points], frames
    for topic in forecast_topics(*published):
        qos = LATCHED if topic in LATCHED_TOPICS else NEWEST
        known = left.pop(topic, None)
        found[topic] = known or watched_publisher(node, message_class(type_of(topic)), topic, qos, health)
    for publisher in left.values():
        node.destroy_publisher(publisher)

    def is_heard(topic: str) -> bool:
        return found[topic].get_subscription_count() > 0

    def wanted() -> Wanted:
        return wanted_for(set(filter(is_heard, found)), *published)

    return ForecastMessages(parameters['frame_id'], frames, is_heard), found, wanted
