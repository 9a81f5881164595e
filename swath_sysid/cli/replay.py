"""``swath-sysid replay``: publish the topics of a bag over ROS."""

import sys
from argparse import Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING

from swath_sysid.cli.progress import show_advice
from swath_sysid.cli.ros import ros_needed
from swath_sysid.cli.run import remappings

if TYPE_CHECKING:
    from swath_sysid.formats.bag_replay import ReplaySettings
    from swath_sysid.nodes.replay import Replay


def run(arguments: Namespace) -> int:
    """Replay until the end or a signal."""
    with ros_needed():
        from swath_sysid.nodes.replay import Replay
        from swath_sysid.nodes.ros_session import ros_session
    from swath_sysid.formats.bag_replay import ReplaySettings

    settings = ReplaySettings(
        arguments.rate,
        arguments.loop,
        arguments.clock,
        arguments.wait,
        arguments.wait_for,
        arguments.in_step,
        tuple(arguments.topic),
    )
    with ros_session(['swath-sysid', '--ros-args', *remappings(arguments)]) as stop:
        _play(Replay(arguments.bag, settings, stop.is_set), settings, stop.is_set)
    return 0


def _play(node: 'Replay', settings: 'ReplaySettings', should_stop: Callable[[], bool]) -> None:
    def show(line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    try:
        show_advice(node.advice)
        at_start = len(node.advice)
        if node.left_out and not settings.topics:
            show(f'left out, because the nodes publish them themselves: {", ".join(node.left_out)} (--topic chooses)')
        if node.unknown_types:
            show(f'left out, because their types are not installed: {", ".join(sorted(node.unknown_types))}')
        show(f'publishing {", ".join(sorted(outlet.topic_name for outlet in node.outlets.values()))}')
        listening, expected = node.wait_for_listeners(), max(settings.listeners, 1)
        if listening < expected and not should_stop():
            show(f'only {listening} of {expected} subscribers are connected: publishing anyway')
        node.play()
        if not should_stop():
            node.wait_until_received()
        show_advice(dict.fromkeys(node.advice[at_start:]))
        show(f'{node.sent} messages published')
    finally:
        node.destroy_node()
