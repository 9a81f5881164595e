"""Names and message types of the topics, live and in bags."""

from collections.abc import Iterable
from functools import cache

IMU, ODOMETRY = 'sensor_msgs/msg/Imu', 'nav_msgs/msg/Odometry'
STRING = 'std_msgs/msg/String'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
ACCELERATION = 'geometry_msgs/msg/AccelWithCovarianceStamped'

IMU_TOPIC = 'imu/data'
WINDOW_TOPIC = 'motion/window'
DESCRIPTION_TOPIC = 'model/description'
COEFFICIENTS_TOPIC = 'model/coefficients'
NEXT_TOPIC = 'forecast/next'
HORIZON_TOPIC = 'forecast/horizon'
QUIESCENCE_TOPIC = 'forecast/quiescence'
CALM_TOPIC = 'forecast/calm'
VALID_LEAD_TOPIC = 'forecast/valid_lead'
OUTLOOK_TOPIC = 'forecast/outlook'
SEA_TOPIC = 'sea/state'
DIAGNOSTICS_TOPIC = '/diagnostics'
FRAMES_TOPIC = '/tf'
STATIC_FRAMES = '/tf_static'  #: How the topic of fixed frames ends, among them that of a sensor.
TRANSFORMS = 'tf2_msgs/msg/TFMessage'
CRAFT_FRAME = 'base_link'  #: REP 105.

LEADS = 'forecast/lead_'  #: How the topics of forecasts at one lead begin.

TYPES = {
    IMU_TOPIC: IMU,
    WINDOW_TOPIC: 'sensor_msgs/msg/PointCloud2',
    DESCRIPTION_TOPIC: STRING,
    COEFFICIENTS_TOPIC: 'std_msgs/msg/Float64MultiArray',
    NEXT_TOPIC: IMU,
    HORIZON_TOPIC: TRAJECTORY,
    QUIESCENCE_TOPIC: 'std_msgs/msg/Float32',
    CALM_TOPIC: TRAJECTORY,
    VALID_LEAD_TOPIC: 'std_msgs/msg/Float32MultiArray',
    OUTLOOK_TOPIC: 'sensor_msgs/msg/JointState',
    SEA_TOPIC: STRING,
    DIAGNOSTICS_TOPIC: 'diagnostic_msgs/msg/DiagnosticArray',
    FRAMES_TOPIC: TRANSFORMS,
}

#: The same in every namespace.
GLOBAL_TOPICS = (DIAGNOSTICS_TOPIC, FRAMES_TOPIC)

#: Transient local: a late subscriber gets the last one.
LATCHED_TOPICS = (WINDOW_TOPIC, DESCRIPTION_TOPIC, COEFFICIENTS_TOPIC, CALM_TOPIC, SEA_TOPIC)


def lead_topic(lead: float, beginning: str = LEADS) -> str:
    """Topic of the forecasts at one lead, s: that of the attitude 0.5 s ahead is ``forecast/lead_0_5s``."""
    return _at(beginning, lead)


def point_lead_topic(point: str, lead: float) -> str:
    """Topic of a named point's motion at one lead, s: ``forecast/bow/lead_2_0s``."""
    return _at(f'forecast/{point}/lead_', lead)


def point_acceleration_topic(point: str, lead: float) -> str:
    """Topic of a named point's acceleration at one lead, s: ``forecast/bow/acceleration_2_0s``."""
    return _at(f'forecast/{point}/acceleration_', lead)


def point_horizon_topic(point: str) -> str:
    """Topic of a named point's motion over the horizon: ``forecast/bow/horizon``."""
    return f'forecast/{point}/horizon'


def frame_at(frame_id: str, lead: float) -> str:
    """Name of the craft's predicted frame at a lead, s: ``base_link_in_1_0s``."""
    return _at(f'{frame_id}_in_', lead)


@cache
def _at(beginning: str, lead: float) -> str:
    return f'{beginning}{str(float(lead)).replace(".", "_")}s'


def is_within(namespace: str, topic: str) -> bool:
    """Whether a topic is one of a namespace, or the same in every one."""
    return topic in GLOBAL_TOPICS or topic.startswith(f'{namespace.rstrip("/")}/')


def type_of(topic: str) -> str:
    """Message type of a topic that a node publishes."""
    if topic in TYPES:
        return TYPES[topic]
    if topic.startswith(LEADS):
        return IMU
    if topic.endswith('/horizon'):
        return TRAJECTORY
    return ACCELERATION if '/acceleration_' in topic else ODOMETRY


def listed(topics: Iterable[str]) -> str:
    """Topics in order, with what they have in common up to the last slash said once."""
    groups: dict[str, list[str]] = {}
    for topic in sorted(topics):
        folder, _, name = topic.rpartition('/')
        groups.setdefault(f'{folder}/', []).append(name)
    return ', '.join(
        folder + (names[0] if len(names) == 1 else f'{{{", ".join(names)}}}') for folder, names in groups.items()
    )
