"""The node manoeuvre_predictor: where a twin-thruster craft will be, with covariance."""
import sys
from time import perf_counter

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64, Float64MultiArray, String

from swath_sysid.errors import InputError
from swath_sysid.files.manoeuvring_model_file import manoeuvring_from_yaml, read_manoeuvring_model
from swath_sysid.nodes.connections import LATCHED, NEWEST
from swath_sysid.nodes.diagnostics import DiagnosticsPublisher
from swath_sysid.nodes.health import ERROR, OK, WARN, Report
from swath_sysid.nodes.messages import NANOSECONDS, stamp_ns, time_message
from swath_sysid.nodes.parameter_tables import NodeParameter
from swath_sysid.nodes.parameters import NodeParameters
from swath_sysid.nodes.spinning import events_executor, run
from swath_sysid.prediction.manoeuvring import ManoeuvreFilterSettings
from swath_sysid.prediction.manoeuvring_outlook import (
    NOT_FINITE,
    PATH_TOPIC,
    REASONS,
    ManoeuvreOutlook,
    ManoeuvreOutlookSettings,
    OdometryReading,
    manoeuvre_lead_topic,
)

SILENT_AFTER = 2.0
CLOCKS_APART = 1.0
"""s between the node's clock and the stamps of the odometry, beyond which thrust is stamped like the odometry."""

POSE_PLACES, TWIST_PLACES = (0, 1, 5), (0, 1, 5)
"""Rows of x, y, yaw in a covariance of six."""

PARAMETERS = (
    NodeParameter('model_file', '', 'Model file of manoeuvre identify; empty: wait for manoeuvre/model',
                  read_only=True),
    NodeParameter('leads_s', [1.0, 5.0, 10.0], 'Leads with a topic of their own, rising', 's', 0.1, 120.0,
                  read_only=True),
    NodeParameter('horizon_s', 20.0, 'Length of the path ahead', 's', 1.0, 120.0, read_only=True),
    NodeParameter('horizon_step_s', 0.5, 'Time between poses of the path', 's', 0.1, 10.0, read_only=True),
    NodeParameter('forecast_rate_hz', 5.0, 'Forecasts a second, at most', 'Hz', 0.1, 50.0, read_only=True),
    NodeParameter('gap_limit_s', 5.0, 'After a longer silence of the odometry the filter begins anew', 's', 0.5, 60.0,
                  read_only=True),
    NodeParameter('backward_jump_s', 1.0, 'A stamp further back is a clock that was set back', 's', 0.05, 60.0,
                  read_only=True),
    NodeParameter('stop_after_s', 0.0, 'Without a command for so long the thrust is zero; 0: the last one holds', 's',
                  0.0, 60.0, read_only=True),
    NodeParameter('speed_noise_m_s', 0.05, 'Noise of the speeds, where the odometry does not tell it', 'm/s', 1e-4, 5.0,
                  read_only=True),
    NodeParameter('yaw_rate_noise_rad_s', 0.01, 'Noise of the yaw rate, where the sensor does not tell it', 'rad/s',
                  1e-5, 1.0, read_only=True),
    NodeParameter('heading_noise_rad', 0.01, 'Noise of the heading, where the odometry does not tell it', 'rad', 1e-5,
                  1.0, read_only=True),
    NodeParameter('position_noise_m', 0.5, 'Noise of the position, where the odometry does not tell it', 'm', 1e-3,
                  100.0, read_only=True),
    NodeParameter('diagnostics_period_s', 1.0, 'Time between diagnostics (wall clock)', 's', 0.1, 60.0, read_only=True),
)  # fmt: skip


def settings_of(values):
    """The settings of the core from the parameters by name."""
    for parameter in PARAMETERS:
        parameter.check(values[parameter.name])
    noise = ManoeuvreFilterSettings(
        speed_noise=values['speed_noise_m_s'], yaw_rate_noise=values['yaw_rate_noise_rad_s'],
        heading_noise=values['heading_noise_rad'], position_noise=values['position_noise_m'],
    )  # fmt: skip
    return ManoeuvreOutlookSettings(
        tuple(values['leads_s']), values['horizon_s'], values['horizon_step_s'], values['forecast_rate_hz'],
        values['gap_limit_s'], values['backward_jump_s'], values['stop_after_s'], noise,
    )  # fmt: skip


def odometry_reading(message):
    """The plain values of a nav_msgs/Odometry."""
    pose, twist = message.pose.pose, message.twist.twist
    q = pose.orientation
    heading = float(np.arctan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z)))
    std = {}
    for names, covariance, places in (
        (('x', 'y', 'heading'), message.pose.covariance, POSE_PLACES),
        (('surge', 'sway', 'yaw_rate'), message.twist.covariance, TWIST_PLACES),
    ):
        for name, place in zip(names, places, strict=True):
            variance = float(covariance[7 * place])
            # all zero means unknown, as for sensor_msgs
            if 0.0 < variance < 1e4:
                std[name] = variance**0.5
    return OdometryReading(
        stamp_ns(message.header.stamp) / NANOSECONDS, pose.position.x, pose.position.y, heading, twist.linear.x,
        twist.linear.y, twist.angular.z, std,
    )  # fmt: skip


def odometry_message(state, frame_id, child_frame_id):
    """The nav_msgs/Odometry of a `ManoeuvreState`; heave, roll and pitch are zero, with zero variance."""
    message = Odometry()
    message.header.stamp = time_message(round(state.stamp * NANOSECONDS))
    message.header.frame_id, message.child_frame_id = frame_id, child_frame_id
    _fill_pose(message.pose.pose, state)
    twist = message.twist.twist
    twist.linear.x, twist.linear.y, twist.angular.z = state.surge, state.sway, state.yaw_rate
    for covariance, block, places in (
        (message.pose.covariance, state.pose_covariance, POSE_PLACES),
        (message.twist.covariance, state.twist_covariance, TWIST_PLACES),
    ):
        for i, row in enumerate(places):
            for j, column in enumerate(places):
                covariance[6 * row + column] = float(block[i, j])
    return message


def path_message(path, stamp, frame_id):
    """The nav_msgs/Path of states, each pose with the stamp it is for."""
    message = Path()
    message.header.stamp, message.header.frame_id = time_message(round(stamp * NANOSECONDS)), frame_id
    for state in path:
        pose = PoseStamped()
        pose.header.stamp, pose.header.frame_id = time_message(round(state.stamp * NANOSECONDS)), frame_id
        _fill_pose(pose.pose, state)
        message.poses.append(pose)
    return message


def _fill_pose(pose, state):
    pose.position.x, pose.position.y = state.x, state.y
    pose.orientation.z, pose.orientation.w = float(np.sin(state.heading / 2)), float(np.cos(state.heading / 2))


class ManoeuvrePredictor(Node):
    """odometry, imu/data and the thrusters in, manoeuvre/* out."""

    def __init__(self):
        super().__init__('manoeuvre_predictor')
        self.parameters = NodeParameters(self, PARAMETERS, settings_of)
        path = self.parameters['model_file']
        self.outlook = ManoeuvreOutlook(self.parameters.settings, read_manoeuvring_model(path) if path else None)
        self._bad_models = 0
        self._received = 0
        self._arrival = None
        self._stamp = None
        self._frames = ('odom', 'base_link')
        self._told = dict(self.outlook.counts)
        self._path = self.create_publisher(Path, PATH_TOPIC, NEWEST)
        self._leads = [
            self.create_publisher(Odometry, manoeuvre_lead_topic(lead), NEWEST)
            for lead in self.parameters.settings.leads
        ]
        sensor = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._kept = [
            self.create_subscription(Odometry, 'odometry', self._on_odometry, sensor),
            self.create_subscription(Imu, 'imu/data', self._on_imu, sensor),
            self.create_subscription(Float64, 'thrusters/left/thrust', lambda m: self._on_thrust('port', m), sensor),
            self.create_subscription(
                Float64, 'thrusters/right/thrust', lambda m: self._on_thrust('starboard', m), sensor),
            self.create_subscription(Float64MultiArray, 'manoeuvre/future_thrust', self._on_future, 10),
            self.create_subscription(String, 'manoeuvre/model', self._on_model, LATCHED),
        ]
        self._diagnostics = DiagnosticsPublisher(self, self.parameters['diagnostics_period_s'], self._reports)

    def _on_odometry(self, message):
        self._received += 1
        self._arrival = perf_counter()
        reading = odometry_reading(message)
        self._stamp = reading.stamp
        self._frames = (message.header.frame_id or 'odom', message.child_frame_id or 'base_link')
        step = self.outlook.add_odometry(reading)
        for publisher, state in zip(self._leads, step.leads, strict=False):
            publisher.publish(odometry_message(state, *self._frames))
        if step.path:
            self._path.publish(path_message(step.path, reading.stamp, self._frames[0]))

    def _on_imu(self, message):
        variance = float(message.angular_velocity_covariance[8])
        if message.angular_velocity_covariance[0] != -1.0:
            self.outlook.add_yaw_rate(
                stamp_ns(message.header.stamp) / NANOSECONDS, message.angular_velocity.z,
                variance**0.5 if 0.0 < variance < 1.0 else None,
            )  # fmt: skip

    def _on_thrust(self, side, message):
        self.outlook.add_thrust(self._now(), side, message.data)

    def _on_future(self, message):
        """Rows of lead, port, starboard; none: hold the last."""
        values = list(message.data)
        if len(values) % 3 or not np.all(np.isfinite(values)):
            self.outlook.counts[NOT_FINITE] += 1
            return
        self.outlook.supply(zip(values[::3], values[1::3], values[2::3], strict=True))

    def _on_model(self, message):
        try:
            identified = manoeuvring_from_yaml(message.data, 'manoeuvre/model')
        except InputError as error:
            self._bad_models += 1
            self.get_logger().error(f'{error}; the model before it stays')
            return
        self.outlook.set_model(identified)
        self.get_logger().info(f'new model: {", ".join(identified.names)}')

    def _now(self):
        """Stamp for a message without one: the node's clock, unless that is not the clock of the odometry."""
        now = self.get_clock().now().nanoseconds / NANOSECONDS
        if self._stamp is None or abs(now - self._stamp) < CLOCKS_APART:
            return now
        return self._stamp + min(perf_counter() - self._arrival, CLOCKS_APART)

    def _reports(self):
        counts = self.outlook.counts
        fresh = {reason: count - self._told[reason] for reason, count in counts.items() if count > self._told[reason]}
        self._told = dict(counts)
        level, text = OK, 'forecasting with the identified model'
        if not self.outlook.has_model:
            level = WARN
            text = 'no model yet, steady motion is taken: give model_file, or publish one on manoeuvre/model'
        if fresh:
            worst = max(fresh, key=fresh.get)
            level, text = WARN, f'{worst} ({fresh[worst]} times lately): {REASONS[worst]}'
        silence = None if self._arrival is None else perf_counter() - self._arrival
        if silence is None or silence > SILENT_AFTER:
            level, text = ERROR, 'no odometry: check that it is published, or remap the topic odometry'
        values = {'received': self._received, 'bad_models': self._bad_models, **counts}
        return [Report('manoeuvre', level, text, values)]


def main(args=None):
    """Run the node until it is told to stop."""
    return run([(events_executor, [ManoeuvrePredictor])], args)


if __name__ == '__main__':
    sys.exit(main())
