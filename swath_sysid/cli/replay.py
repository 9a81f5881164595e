"""``swath-sysid replay``: publish the topics of a bag over ROS."""

import sys
from argparse import ArgumentParser, Namespace

from swath_sysid.cli.sources import finite
from swath_sysid.common.errors import InputError


def add_arguments(parser: ArgumentParser) -> None:
    """The bag, and how fast it is replayed."""
    parser.add_argument('bag', metavar='BAG', help='rosbag2 bag: folder, .mcap or .db3')
    parser.add_argument('--rate', type=finite, default=1.0, metavar='R', help='times real time (default: %(default)s)')
    parser.add_argument('--loop', action='store_true', help='begin again at the end, until Ctrl-C')
    parser.add_argument('--clock', action='store_true', help='publish /clock, for nodes with use_sim_time')
    parser.add_argument(
        '--wait-for', type=int, default=0, metavar='N',
        help='begin when so many subscribe to the IMU, 2 for imu_buffer and predictor (default: when all that are '
        'found are connected and discovery has had its 3.5 s)',
    )
    parser.add_argument(
        '--wait', type=finite, default=15.0, metavar='S',
        help='so long the start waits for them at most (default: %(default)s)',
    )  # fmt: skip


def run(arguments: Namespace) -> int:
    """Replay until the end or a signal."""
    try:
        from swath_sysid.nodes.replay import ReplaySettings, replay
    except ImportError as error:
        raise InputError(
            f'rclpy is not installed ({error}): pip install swath_sysid[ros], or source a ROS 2 installation'
        ) from error
    settings = ReplaySettings(arguments.rate, arguments.loop, arguments.clock, arguments.wait, arguments.wait_for)
    replay(arguments.bag, settings, lambda line: print(line, file=sys.stderr, flush=True), ['swath-sysid'])
    return 0
