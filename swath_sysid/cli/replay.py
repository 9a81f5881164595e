"""``swath-sysid replay``: publish the topics of a bag over ROS."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING

from swath_sysid.cli.progress import show_advice
from swath_sysid.cli.ros_needed import ros_needed
from swath_sysid.cli.settings_flags import add_number

if TYPE_CHECKING:
    from swath_sysid.nodes.replay import Replay


def add_arguments(parser: ArgumentParser) -> None:
    """The bag, and how fast it is replayed."""
    parser.add_argument('bag', metavar='BAG', help='rosbag2 bag: folder, .mcap or .db3')
    add_number(parser, '--rate', 'R', 'speed, as a multiple of real time', 1.0)
    parser.add_argument('--loop', action='store_true', help='start again at the end, until Ctrl-C')
    parser.add_argument('--clock', action='store_true', help='publish /clock, for nodes with use_sim_time')
    parser.add_argument(
        '--wait-for',
        type=int,
        default=0,
        metavar='N',
        help='start when the IMU has this many subscribers, 2 for imu_buffer and predictor (default: when '
        'all known subscribers are connected and none has appeared for 3.5 s)',
    )
    add_number(parser, '--wait', 'S', 'longest wait for subscribers', 15.0)
    parser.add_argument(
        '--in-step',
        action='store_true',
        help='never overtake a predictor started with `-p in_step:=true`; with a large --rate the replay is as fast as '
        'the predictor, with the same results',
    )


def run(arguments: Namespace) -> int:
    """Replay until the end or a signal."""
    with ros_needed():
        from swath_sysid.nodes.executor_loop import ros_session
        from swath_sysid.nodes.replay import Replay
    from swath_sysid.formats.bag_replay import ReplaySettings

    settings = ReplaySettings(
        arguments.rate, arguments.loop, arguments.clock, arguments.wait, arguments.wait_for, arguments.in_step
    )
    with ros_session() as stop:
        _play(Replay(arguments.bag, settings, stop.is_set), max(settings.listeners, 1), stop.is_set)
    return 0


def _play(node: 'Replay', expected: int, should_stop: Callable[[], bool]) -> None:
    def show(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    try:
        show_advice(node.advice)
        if node.unknown_types:
            show(f'left out, because their types are not installed: {", ".join(sorted(node.unknown_types))}')
        show(f'publishing {", ".join(sorted(node.outlets))}')
        listening = node.wait_for_listeners()
        if listening < expected and not should_stop():
            show(f'only {listening} of {expected} subscribers are connected: publishing anyway')
        node.play()
        if not should_stop():
            node.wait_until_received()
        show(f'{node.sent} messages published')
    finally:
        node.destroy_node()
