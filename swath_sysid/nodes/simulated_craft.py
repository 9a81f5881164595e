"""The node simulated_craft: a published hull with an IMU, for trying everything without hardware."""

import argparse
import math
import sys
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.simulated_craft import CraftSettings, SimulatedCraft
from swath_sysid.attitude.hull.simulated_trial import SensorNoise
from swath_sysid.attitude.motion.attitude import body_rates, quaternion
from swath_sysid.formats.messages import SECOND_NS
from swath_sysid.formats.topics import IMU_TOPIC
from swath_sysid.nodes.executor_loop import events_executor, run
from swath_sysid.nodes.message_types import time_message

#: What a small attitude sensor shows at rest at 100 Hz; the published trials were noisier, up to five times.
MEMS_NOISE = SensorNoise(angle=0.0005, rate=0.003, acceleration=0.02)

LARGEST_LAG = 0.5  #: s; a machine that pauses for longer loses samples, as a sensor's driver would.


class SimulatedCraftNode(Node):
    """Publishes imu/data at an even rate; ~/release lifts the craft and lets it go."""

    def __init__(self, settings: CraftSettings):
        super().__init__('simulated_craft')
        self._craft = SimulatedCraft(settings)
        self._period_ns = round(SECOND_NS / settings.rate_hz)
        self._outlet = self.create_publisher(Imu, IMU_TOPIC, qos_profile_sensor_data)
        self._message = self._empty_message(settings.noise)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._next_ns = self._steady.now().nanoseconds
        # stamps are even, from one reading of the clock: a sensor's own oscillator is that even
        self._offset_ns = self.get_clock().now().nanoseconds - self._next_ns
        self.create_service(Trigger, '~/release', self._on_release)
        self.create_timer(self._period_ns / SECOND_NS, self._publish_due, clock=self._steady)

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
        return response


def start(args: list[str] | None = None) -> int:
    """Run a published hull until a signal comes; returns the exit code."""
    parser = argparse.ArgumentParser(prog='simulated_craft')
    parser.add_argument('--hull', required=True)
    parser.add_argument('--angle-deg', type=float, required=True)
    parser.add_argument('--seed', type=int, default=1)
    arguments, others = parser.parse_known_args(args)

    def make_node() -> SimulatedCraftNode:
        model, angle = hull_named(arguments.hull).model, math.radians(arguments.angle_deg)
        return SimulatedCraftNode(CraftSettings(model, angle, noise=MEMS_NOISE, seed=arguments.seed))

    return run([(events_executor, [make_node])], ['simulated_craft', *others])


if __name__ == '__main__':
    sys.exit(start())
