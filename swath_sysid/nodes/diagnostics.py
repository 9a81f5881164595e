"""Publishing on /diagnostics: at steady times, whatever the clock of the craft does."""

from collections import defaultdict
from collections.abc import Callable
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from swath_sysid.common.advice import Advice
from swath_sysid.formats.messages import diagnostics_message
from swath_sysid.pipeline.health import OK, WARN, Changes, Report

MOST_TOLD = 100  #: Sentences; in a flood of others the diagnostics show the newest.


class EachOnce:
    """Says each sentence once, however often a message is rejected for it."""

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._said: set[str] = set()

    def __call__(self, sentence: str) -> None:
        if sentence not in self._said and len(self._said) < MOST_TOLD:
            self._said.add(sentence)
            self._say(sentence)


class DiagnosticsPublisher:
    """Publishes the reports of a node every ``period`` s, and logs what changes for the worse or the better."""

    def __init__(self, node: Node, period: float, reports: Callable[[], list[Report]]):
        self._node = node
        self._reports = reports
        self._changes: defaultdict[str, Changes] = defaultdict(Changes)
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # a timer of ROS time stalls when a bag loops
        self._timer = node.create_timer(period, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self) -> None:
        """Publish what the node reports now."""
        reports = self._reports()
        name = self._node.get_fully_qualified_name()[1:]
        self._publisher.publish(
            diagnostics_message(
                self._node.get_clock().now().nanoseconds,
                [report.status_of(name) for report in reports],
                self._node.get_namespace().strip('/'),
            )
        )
        for report in reports:
            if self._changes[report.name].is_news(report.level, monotonic(), report.codes):
                self._log(report)

    def _log(self, report: Report) -> None:
        logger = self._node.get_logger()
        if report.level == OK:
            logger.info(f'{report.name}: {report.message}')
        elif report.level == WARN:
            logger.warning(f'{report.name}: {report.message}')
        else:
            logger.error(f'{report.name}: {report.message}')


def report_slower(node: Node, health: Any, why: Advice | None) -> None:
    """Log why fits take longer than they could, if so, and have a node's `health` report it."""
    if why is not None:
        health.slower_because = why.message
        if why.code == 'numba-disabled':
            node.get_logger().info(why.message)
        else:
            node.get_logger().warning(why.message)
