"""Topics and services of the nodes: the names that the security policy allows, with their types."""

from collections.abc import Iterator
from xml.etree import ElementTree

from swath_sysid.formats.topics import LEADS, MANOEUVRING_LEADS, ODOMETRY, STRING, TYPES, type_of
from swath_sysid.share import share_folder

TRIGGER, FLOAT = 'std_srvs/srv/Trigger', 'std_msgs/msg/Float64'
#: Types of what the nodes do not publish themselves, and of services.
OTHER_TYPES = {
    **{'odometry': ODOMETRY, 'manoeuvring/model': STRING, 'craft/loading': FLOAT, '~/progress': 'std_msgs/msg/Float32'},
    **{'thrusters/left/thrust': FLOAT, 'thrusters/right/thrust': FLOAT},
    'manoeuvring/future_thrust': 'std_msgs/msg/Float64MultiArray',
    **dict.fromkeys(
        (
            '~/clear',
            '~/publish_window',
            '~/identify',
            '~/cancel',
            '~/rollback',
            '~/undo_rollback',
            '~/release',
            'imu_buffer/publish_window',
        ),
        TRIGGER,
    ),
    '~/record': 'std_srvs/srv/SetBool',
}
DIRECTIONS = {'publish': 'publishes', 'subscribe': 'subscribes to', 'reply': 'serves', 'request': 'calls'}


def interface_lines() -> Iterator[str]:
    """A line for each topic and service of each node, without those that every ROS node has."""
    policy = ElementTree.parse(share_folder() / 'config' / 'sros2_policy.xml')
    for profile in policy.iter('profile'):
        node = profile.get('node', '')
        for group in (*profile.iter('topics'), *profile.iter('services')):
            (does,) = (words for key, words in DIRECTIONS.items() if group.get(key))
            for name in (str(item.text) for item in group):
                if kind := _type_of(name):
                    yield f'{node:<22} {does:<14} {name.replace("~", node):<36} {kind}'


def _type_of(name: str) -> str:
    known = {**TYPES, **OTHER_TYPES}.get(name, '')
    if name.startswith((LEADS, MANOEUVRING_LEADS)):
        return type_of(name)
    return known
