"""The node imu_buffer: keeps the last minute of motion and publishes it, asked or when a decay has ended."""
import sys
from time import perf_counter

from rclpy.node import Node
from sensor_msgs.msg import Imu, PointCloud2
from std_srvs.srv import SetBool, Trigger

from swath_sysid.motion.window import MotionWindow
from swath_sysid.nodes.connections import LATCHED, imu_subscription, watched_publisher
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher
from swath_sysid.nodes.health import OK, WARN, Report, StreamHealth
from swath_sysid.nodes.messages import imu_reading, window_message
from swath_sysid.nodes.parameter_tables import IMU_BUFFER, window_settings
from swath_sysid.nodes.parameters import NodeParameters
from swath_sysid.nodes.spinning import events_executor, run


class ImuBuffer(Node):
    """See DESIGN: imu/data in, motion/window out, ~/publish_window, ~/clear and ~/record."""

    def __init__(self):
        super().__init__('imu_buffer')
        self.parameters = NodeParameters(self, IMU_BUFFER, window_settings, self._change)
        self.window = MotionWindow(self.parameters.settings)
        self.window.record(self.parameters['record_at_start'])
        self.decays = 0
        self.health = StreamHealth('imu/data')
        self._publisher = watched_publisher(self, PointCloud2, 'motion/window', LATCHED, self.health)
        self._subscription = imu_subscription(self, Imu, self._on_imu, self.parameters['queue_depth'], self.health)
        self.create_service(Trigger, '~/publish_window', self._on_publish_window)
        self.create_service(Trigger, '~/clear', self._on_clear)
        self.create_service(SetBool, '~/record', self._on_record)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)

    def _change(self, settings):
        self.window.detect_decay(settings.detect_decay)

    def _on_imu(self, message):
        begun = perf_counter()
        reading = imu_reading(message)
        step = self.window.add(reading)
        if step.finished is not None:
            self.decays += 1
            decay = step.finished.segment
            self.get_logger().info(
                f'a free decay in {step.finished.axis} has ended ({decay.cycles:.1f} cycles of {decay.period:.2f} s): '
                f'publishing its window'
            )
            self._publish(step.finished.table)
        self.health.note(reading.stamp_ns, begun, perf_counter())

    def _publish(self, table):
        self._publisher.publish(window_message(table, self.parameters['frame_id']))

    def _on_publish_window(self, request, response):
        if self.window.size:
            self._publish(self.window.table())
        response.success = self.window.size > 0
        response.message = self._described() if response.success else (
            'the window is empty: check that the IMU publishes on imu/data'
        )
        return response

    def _on_clear(self, request, response):
        self.window.clear()
        response.success, response.message = True, 'the window is empty'
        return response

    def _on_record(self, request, response):
        self.window.record(request.data)
        response.success, response.message = True, self._described()
        return response

    def _described(self):
        state = 'recording' if self.window.recording else 'not recording'
        return f'{state}, {self.window.size} samples, {self.window.duration:.1f} s'

    def _reports(self):
        self.health.note_publishers(self._subscription_publishers())
        stream = self.health.report(
            'imu', perf_counter(), self.get_clock().now().nanoseconds, self.window.counts, self.window.samples
        )
        level, message = OK, self._described()
        if self.window.is_short_of_memory:
            level = WARN
            message += ': samples come faster than max_rate_hz, which makes the window shorter: raise max_rate_hz'
        values = {
            'samples': self.window.size, 'duration_s': self.window.duration, 'recording': self.window.recording,
            'decays_noticed': self.decays,
        }
        return [stream, Report('window', level, message, values)]

    def _subscription_publishers(self):
        return self.count_publishers(self._subscription.topic_name)


def main(args=None):
    """Run the node until it is told to stop."""
    return run([(events_executor, [ImuBuffer])], args)


if __name__ == '__main__':
    sys.exit(main())
