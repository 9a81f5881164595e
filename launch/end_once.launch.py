"""Included by the other launch files: a node that rejects a parameter ends the launch; to respawn it cures nothing."""

from typing import Any

from launch.actions import RegisterEventHandler, Shutdown
from launch.event_handlers import OnProcessExit

from launch import LaunchDescription


def end_if_rejected(event: Any, _: Any) -> Shutdown | None:
    """The end of the launch where the exit code, 2, says that a node cannot run with what it was given."""
    return Shutdown(reason=f'{event.process_name} rejected what it was given') if event.returncode == 2 else None


def generate_launch_description() -> LaunchDescription:
    """Only the handler."""
    return LaunchDescription([RegisterEventHandler(OnProcessExit(on_exit=end_if_rejected))])
