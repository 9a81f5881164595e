"""The node imu_buffer: keeps the last minute of motion and publishes it, asked or when a decay has ended."""

from time import perf_counter

from rclpy.node import Node
from sensor_msgs.msg import Imu, PointCloud2
from std_srvs.srv import SetBool, Trigger

from swath_sysid.attitude.motion.window import MotionTable, MotionWindow, WindowSettings
from swath_sysid.formats.messages import imu_reading, window_message
from swath_sysid.nodes import qos
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher
from swath_sysid.nodes.executor_loop import Plan, events_executor
from swath_sysid.nodes.inbox import Inbox
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.settings import window_settings
from swath_sysid.nodes.transforms import Transforms
from swath_sysid.pipeline.health import BufferHealth, Report


class ImuBuffer(Node):
    """imu/data in, motion/window out, services ~/publish_window, ~/clear and ~/record."""

    waits_for = qos.IMU_TOPIC  #: The topic without which it does nothing.

    def __init__(self) -> None:
        super().__init__('imu_buffer')
        self.parameters = NodeParameters(self, 'imu_buffer', window_settings, self._change)
        self.window = MotionWindow(self.parameters.settings)
        self.window.record(self.parameters['record_at_start'])
        self.health = BufferHealth(self.resolve_topic_name(qos.IMU_TOPIC), self.window)
        self._publisher = qos.watched_publisher(self, PointCloud2, 'motion/window', qos.LATCHED, self.health)
        self.inbox = Inbox(self, self.parameters['queue_depth'], self.health)
        self.transforms = Transforms(self, self.parameters)
        self.create_service(Trigger, '~/publish_window', self._on_publish_window)
        self.create_service(Trigger, '~/clear', self._on_clear)
        self.create_service(SetBool, '~/record', self._on_record)
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)

    def _change(self, settings: WindowSettings) -> None:
        self.window.detect_decay(settings.detect_decay)
        if settings.window != self.window.settings.window:
            self.window.resize(settings.window)
        if settings.installation != self.window.settings.installation:
            self.window.mount(settings.installation)
            # empty: the identifier forgets its decays, too
            self._publish(self.window.table())

    @property
    def is_behind(self) -> bool:
        """Whether messages wait."""
        return bool(self.inbox) and not self.transforms.hold_back(self.inbox)

    def work(self, seconds: float) -> None:
        """Handle the messages that wait, for so long."""
        until = perf_counter() + seconds
        while self.is_behind and perf_counter() < until:
            self._add(*self.inbox.popleft())

    def _add(self, message: Imu, arrival: float, clock_ns: int) -> None:
        begun = perf_counter()
        reading = imu_reading(message)
        step = self.window.add(reading, arrival)
        if step.finished is not None:
            self.health.decays += 1
            decay = step.finished.segment
            self.get_logger().info(
                f'a free decay in {step.finished.axis} has ended ({decay.cycles:.1f} cycles of {decay.period:.2f} s): '
                f'publishing its window'
            )
            self._publish(step.finished.table)
        self.health.note_frame_id(message.header.frame_id)
        self.health.note_message(reading.stamp_ns, clock_ns, begun, perf_counter())

    def _publish(self, table: MotionTable) -> None:
        self._publisher.publish(window_message(table, self.parameters['frame_id']))

    def _on_publish_window(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.window.size:
            self._publish(self.window.table())
        response.success = self.window.size > 0
        response.message = self.window.described
        if not response.success:
            response.message += f': check that the IMU publishes on {self.health.topic}'
        return response

    def _on_clear(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.window.clear()
        # empty: the identifier forgets its decays, too
        self._publish(self.window.table())
        response.success, response.message = True, self.window.described
        return response

    def _on_record(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.window.record(request.data)
        response.success, response.message = True, self.window.described
        return response

    def _reports(self) -> list[Report]:
        qos.note_publishers(self, self.inbox.subscription, self.health)
        return self.health.reports(perf_counter(), self.get_clock().now().nanoseconds)


PLAN: Plan = [(events_executor, [ImuBuffer])]
