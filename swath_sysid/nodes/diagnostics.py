"""Publishing on /diagnostics: at steady times, whatever the clock of the craft does."""
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks

from swath_sysid.nodes.health import OK, WARN

LEVELS = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR)


class DiagnosticsPublisher:
    """Publishes what a node reports, every period, and logs what changes for the worse or the better.

    Parameters
    ----------
    node : rclpy.node.Node
    period : float
        s.
    reports : callable
        Returns the `Report` list of now.
    """

    def __init__(self, node, period, reports):
        self._node = node
        self._reports = reports
        self._levels = {}
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        # a timer of ROS time stalls when a bag loops
        self._timer = node.create_timer(period, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def publish(self):
        """Publish what the node reports now."""
        reports = self._reports()
        message = DiagnosticArray(status=[status_message(report, self._node) for report in reports])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
        for report in reports:
            if self._levels.get(report.name, OK) != report.level:
                self._log(report)
            self._levels[report.name] = report.level

    def _log(self, report):
        logger = self._node.get_logger()
        if report.level == OK:
            logger.info(f'{report.name}: {report.message}')
        elif report.level == WARN:
            logger.warning(f'{report.name}: {report.message}')
        else:
            logger.error(f'{report.name}: {report.message}')


def status_message(report, node):
    """The diagnostic_msgs/DiagnosticStatus of a `Report`."""
    level, name, message, values = report.told_by(node.get_fully_qualified_name()[1:])
    return DiagnosticStatus(
        level=LEVELS[level],
        name=name,
        message=message,
        hardware_id=node.get_namespace().strip('/'),
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )


def subscription_events(on_mismatch):
    """Event callbacks that tell of publishers with incompatible QoS."""
    return SubscriptionEventCallbacks(incompatible_qos=lambda event: on_mismatch())


def publisher_events(on_mismatch):
    """Event callbacks that tell of subscriptions with incompatible QoS."""
    return PublisherEventCallbacks(incompatible_qos=lambda event: on_mismatch())
