"""``swath-sysid layout``: a layout of config/ for a namespace and another topic of the sensor."""

import re
import sys
from argparse import Namespace

from swath_sysid.cli.run import ros_name
from swath_sysid.formats.files import write_text
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.formats.topics import CRAFT_FRAME, IMU_TOPIC
from swath_sysid.share import share_folder

PROGRAMS = {'foxglove': 'foxglove_layout.json', 'plotjuggler': 'plotjuggler_layout.xml', 'rviz': 'forecast.rviz'}
OURS = re.compile(r'/(imu/data|(?:forecast|model|identifier)/\w+)')


def run(arguments: Namespace) -> int:
    """Print the layout, or write it to a file."""
    check_outputs([Output('--output', arguments.output, endings=(PROGRAMS[arguments.program].rpartition('.')[2],))])
    text = (share_folder() / 'config' / PROGRAMS[arguments.program]).read_text(encoding='utf-8')
    text = layout_for(text, arguments.namespace or '', arguments.imu_topic or IMU_TOPIC, arguments.frame_id)
    if arguments.output:
        write_text(arguments.output, text)
    else:
        sys.stdout.write(text)
    return 0


def layout_for(text: str, namespace: str, imu_topic: str, frame_id: str = CRAFT_FRAME) -> str:
    """A layout whose topics are in a namespace, but for that of the sensor where it begins with a slash."""
    namespace = ros_name('namespace', namespace.strip('/')) if namespace.strip('/') else ''
    before = f'/{namespace}' if namespace else ''
    sensor = ros_name('topic', imu_topic)

    def named(found: re.Match) -> str:
        topic = sensor if found[1] == IMU_TOPIC else found[1]
        return topic if topic.startswith('/') else f'{before}/{topic}'

    text = OURS.sub(named, text).replace('/diagnostics/', f'/diagnostics{before}/')
    text = text.replace('"hardwareIdFilter": ""', f'"hardwareIdFilter": "{namespace}"')
    return text.replace(CRAFT_FRAME, frame_id)
