"""The node simulated_craft: a published hull with an IMU, for trying everything without hardware."""

import math
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from swath_sysid.attitude.hull.craft_simulator import SensorNoise, SimulatedCraft
from swath_sysid.attitude.motion.attitude import body_rates, quaternion
from swath_sysid.common.accelerator import answer_at_once
from swath_sysid.formats.messages import SECOND_NS
from swath_sysid.formats.topics import IMU_TOPIC
from swath_sysid.nodes.executor_loop import Plan, events_executor
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.settings import craft_settings
from swath_sysid.nodes.qos import time_message

LARGEST_LAG = 0.5  #: s; a machine that pauses for longer loses samples, as a sensor's driver would.


class SimulatedCraftNode(Node):
    """Publishes imu/data at an even rate; ~/release lifts the craft and lets it go."""

    def __init__(self) -> None:
        super().__init__('simulated_craft')
        answer_at_once()  # its step is short: loading numba would take longer than it saves
        parameters = NodeParameters(self, 'simulated_craft', craft_settings)
        settings = parameters.settings
        self._craft = SimulatedCraft(settings)
        self._period_ns = round(SECOND_NS / settings.rate_hz)
        self._outlet = self.create_publisher(Imu, IMU_TOPIC, qos_profile_sensor_data)
        self._message = self._empty_message(settings.noise)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._next_ns = self._steady.now().nanoseconds
        # stamps are even, from one reading of the clock: a sensor's own oscillator is that even
        self._offset_ns = self.get_clock().now().nanoseconds - self._next_ns
        service = self.create_service(Trigger, '~/release', self._on_release)
        self.create_timer(self._period_ns / SECOND_NS, self._publish_due, clock=self._steady)
        self._release_words = f'pushed to {math.degrees(settings.angle):g} deg and released'
        self.get_logger().info(
            f'{parameters["hull"]} measured at {settings.rate_hz:g} Hz on {self._outlet.topic_name}; '
            f'{self._release_words} whenever {service.service_name} is called'
        )

    @staticmethod
    def _empty_message(noise: SensorNoise) -> Imu:
        message = Imu()
        message.header.frame_id = 'base_link'
        for name, spread in (
            ('orientation', noise.angle),
            ('angular_velocity', noise.rate),
            ('linear_acceleration', noise.acceleration),
        ):
            getattr(message, f'{name}_covariance')[::4] = [spread * spread] * 3
        return message

    def _publish_due(self) -> None:
        now_ns = self._steady.now().nanoseconds
        late = now_ns - self._next_ns
        if late > LARGEST_LAG * SECOND_NS:
            self._next_ns += late - late % self._period_ns
        while self._next_ns <= now_ns:
            self._publish(self._next_ns + self._offset_ns)
            self._next_ns += self._period_ns

    def _publish(self, stamp_ns: int) -> None:
        reading, message = self._craft.next_reading(), self._message
        message.header.stamp = time_message(stamp_ns)
        turn, rates, force = message.orientation, message.angular_velocity, message.linear_acceleration
        turn.x, turn.y, turn.z, turn.w = map(float, quaternion(reading.roll, reading.pitch, 0.0))
        rates.x, rates.y, rates.z = map(
            float, body_rates(reading.roll, reading.pitch, reading.roll_rate, reading.pitch_rate, 0.0)
        )
        force.x, force.y, force.z = reading.force
        self._outlet.publish(message)

    def _on_release(self, request: Any, response: Any):
        lets_go = self._next_ns + self._offset_ns + round(self._craft.release() * SECOND_NS)
        response.success, response.message = True, str(lets_go)
        self.get_logger().info(self._release_words)
        return response


PLAN: Plan = [(events_executor, [SimulatedCraftNode])]
