"""Topics and services of the nodes: the names that the security policy allows, with their types."""

from collections.abc import Iterator
from xml.etree import ElementTree

from swath_sysid.common.wings import handed_in
from swath_sysid.formats.topics import LEADS, TYPES, type_of
from swath_sysid.nodes.parameters.table import NODES
from swath_sysid.share import share_folder

OWN_TRIGGERS = 'clear publish_window identify cancel rollback undo_rollback release'.split()
#: Types of what the nodes do not publish themselves, and of services.
OTHER_TYPES = {
    'craft/loading': 'std_msgs/msg/Float64',
    '~/progress': 'std_msgs/msg/Float32',
    '~/record': 'std_srvs/srv/SetBool',
    **dict.fromkeys((*(f'~/{name}' for name in OWN_TRIGGERS), 'imu_buffer/publish_window'), 'std_srvs/srv/Trigger'),
    **handed_in('other_types'),
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
                if (kind := _type_of(name)) and node in (*NODES, 'page'):
                    yield f'{node:<22} {does:<14} {name.replace("~", node):<36} {kind}'


def _type_of(name: str) -> str:
    if name in TYPES or name.startswith(LEADS):
        return type_of(name)
    published = next((kind for beginning, kind in handed_in('topics').items() if name.startswith(beginning)), '')
    return published or OTHER_TYPES.get(name, '')
