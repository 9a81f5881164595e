"""Names and message types of the topics, live and in bags."""

IMU, ODOMETRY, PATH = 'sensor_msgs/msg/Imu', 'nav_msgs/msg/Odometry', 'nav_msgs/msg/Path'
STRING = 'std_msgs/msg/String'

IMU_TOPIC = 'imu/data'
WINDOW_TOPIC = 'motion/window'
DESCRIPTION_TOPIC = 'model/description'
COEFFICIENTS_TOPIC = 'model/coefficients'
NEXT_TOPIC = 'forecast/next'
HORIZON_TOPIC = 'forecast/horizon'
QUIESCENCE_TOPIC = 'forecast/quiescence'
DIAGNOSTICS_TOPIC = '/diagnostics'
PATH_TOPIC = 'manoeuvring/forecast'

LEADS, MANOEUVRING_LEADS = 'forecast/lead_', 'manoeuvring/lead_'
"""How the topics of forecasts at one lead begin."""

TYPES = {
    IMU_TOPIC: IMU,
    WINDOW_TOPIC: 'sensor_msgs/msg/PointCloud2',
    DESCRIPTION_TOPIC: STRING,
    COEFFICIENTS_TOPIC: 'std_msgs/msg/Float64MultiArray',
    NEXT_TOPIC: IMU,
    HORIZON_TOPIC: 'trajectory_msgs/msg/JointTrajectory',
    QUIESCENCE_TOPIC: 'std_msgs/msg/Float32',
    DIAGNOSTICS_TOPIC: 'diagnostic_msgs/msg/DiagnosticArray',
    PATH_TOPIC: PATH,
}

LATCHED_TOPICS = (WINDOW_TOPIC, DESCRIPTION_TOPIC, COEFFICIENTS_TOPIC)
"""Transient local: a late subscriber gets the last one."""


def lead_topic(lead):
    """Topic of the attitude forecasts at one lead: 0.5 s is on ``forecast/lead_0_5s``.

    Parameters
    ----------
    lead : float
        s.
    """
    return _at(LEADS, lead)


def manoeuvring_lead_topic(lead):
    """Topic of the forecasts of surge, sway and yaw at one lead, s: 0.5 s is on ``manoeuvring/lead_0_5s``."""
    return _at(MANOEUVRING_LEADS, lead)


def _at(beginning, lead):
    return f'{beginning}{str(float(lead)).replace(".", "_")}s'


def type_of(topic):
    """Message type of a topic that a node publishes."""
    if topic.startswith(LEADS):
        return IMU
    return ODOMETRY if topic.startswith(MANOEUVRING_LEADS) else TYPES[topic]
