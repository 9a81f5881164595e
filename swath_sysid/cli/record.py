"""``swath-sysid record``: write our topics from ROS to a bag."""

import sys
from argparse import Namespace
from datetime import datetime

from swath_sysid.cli.ros import ros_needed
from swath_sysid.cli.run import remappings
from swath_sysid.common.errors import DONE, InputError
from swath_sysid.formats.outputs import Output, check_outputs


def run(arguments: Namespace) -> int:
    """Record until a signal comes."""
    with ros_needed():
        from swath_sysid.nodes.record import record
    output = arguments.output or f'swath_sysid_{datetime.now():%Y-%m-%d_%H-%M-%S}.mcap'
    check_outputs([Output('--output', output, is_recording=True, endings=('mcap',))])
    time = ['-p', 'use_sim_time:=true'] if arguments.use_sim_time else []
    print(f'recording to {output} until Ctrl-C', file=sys.stderr, flush=True)
    code, counts = record(output, arguments.topic, ['swath-sysid', '--ros-args', *time, *remappings(arguments)])
    if code != DONE:
        return code
    if not any(counts.values()):
        raise InputError(
            f'nothing came, so {output} was not written: start the sensor or swath-sysid run, in this ROS_DOMAIN_ID'
        )
    counted = ', '.join(f'{topic} {count}' for topic, count in sorted(counts.items()))
    print(f'{output}: {counted}', flush=True)
    return DONE
