"""The node of the page: subscribes to the topics of the other nodes."""

from collections.abc import Callable
from functools import partial
from threading import Lock
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32, String
from trajectory_msgs.msg import JointTrajectory

from swath_sysid.attitude.motion.intake import NANOSECOND
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import imu_reading, raw_stamp_ns, trajectory_values
from swath_sysid.formats.model_file import model_from_yaml
from swath_sysid.formats.sea_state_yaml import sea_from_yaml
from swath_sysid.formats.topics import (
    CALM_TOPIC,
    DESCRIPTION_TOPIC,
    HORIZON_TOPIC,
    IMU_TOPIC,
    QUIESCENCE_TOPIC,
    SEA_TOPIC,
    point_horizon_topic,
)
from swath_sysid.nodes.executor_loop import LOOK_PERIOD
from swath_sysid.nodes.page_requests import PageRequests
from swath_sysid.nodes.parameters.settings import installation, quiescence_limits
from swath_sysid.nodes.qos import LATCHED, NEWEST
from swath_sysid.page.live_record import LiveRecord, horizon_of
from swath_sysid.page.state import SELDOM
from swath_sysid.pipeline.health import Report

SENSOR = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)  #: Lossy: it slows nobody else.
NEWEST_LOSSY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)  #: No publisher waits for a page.

#: The predictor's parameters that the page shows.
ASKED = (
    'frame mounting_deg points horizon_s quiet_for_s quiet_roll_deg quiet_pitch_deg quiet_roll_rate_deg_s '
    'quiet_pitch_rate_deg_s quiet_heave_m quiet_vertical_velocity_m_s quiet_about_trim quiet_probability'
).split()


class PageNode(Node):
    """Keeps a `LiveRecord` up to date, and carries out requests in the thread that spins it."""

    def __init__(self, report: Callable[[str], None]):
        super().__init__('page')
        self.lock = Lock()
        self.record = LiveRecord()
        self.description = ''
        self.sensor = self.resolve_topic_name(IMU_TOPIC)
        self._report = report
        self._requests = PageRequests(self, report, self._note_kept)
        self.press = self._requests.press
        self._prefix = self.get_namespace().strip('/')
        self._points: set[str] = set()
        self.create_subscription(Imu, IMU_TOPIC, self._on_imu, SENSOR, raw=True)
        self.create_subscription(JointTrajectory, HORIZON_TOPIC, self._on_horizon, NEWEST_LOSSY)
        self.create_subscription(String, DESCRIPTION_TOPIC, self._on_description, LATCHED)
        self.create_subscription(String, SEA_TOPIC, self._on_sea, LATCHED)
        self.create_subscription(JointTrajectory, CALM_TOPIC, self._on_calm, LATCHED)
        self.create_subscription(Float32, QUIESCENCE_TOPIC, self._on_quiescence, NEWEST)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._requests.carry_out, clock=steady)
        self.create_timer(SELDOM, self._ask_predictor, clock=steady)

    def _note_kept(self, is_kept: bool) -> None:
        with self.lock:
            self.record.is_kept = is_kept

    def _ask_predictor(self) -> None:
        self._requests.get_parameters('predictor', ASKED, self._on_parameters)
        with self.lock:
            self.record.can_push = self._requests.can_push()

    def _on_parameters(self, *found: Any) -> None:
        values = dict(zip(ASKED, found, strict=True))
        with self.lock:
            self.record.install(installation({'frame': values['frame'], 'mounting_deg': list(values['mounting_deg'])}))
            self.record.limits = quiescence_limits(values)
        for point in {point for point in values['points'] if point} - self._points:
            self._points.add(point)
            self.create_subscription(
                JointTrajectory,
                point_horizon_topic(point),
                partial(self._on_horizon, name=f'heave of {point}'),
                NEWEST_LOSSY,
            )

    def _on_imu(self, raw: bytes) -> None:
        with self.lock:
            if self.record.is_due(raw_stamp_ns(raw), monotonic()):
                self.record.add_reading(imu_reading(deserialize_message(raw, Imu)))

    def _on_horizon(self, message: JointTrajectory, name: str = '') -> None:
        with self.lock:
            self.record.add_horizon(horizon_of(*trajectory_values(message)), name)

    def _on_description(self, message: String) -> None:
        try:
            models = model_from_yaml(message.data, DESCRIPTION_TOPIC) if message.data else {}
        except InputError as error:
            self._report(str(error))
            return
        with self.lock:
            self.description = message.data
            self.record.set_models(models)

    def _on_sea(self, message: String) -> None:
        try:
            sea = sea_from_yaml(message.data)
        except InputError as error:
            self._report(str(error))
            return
        with self.lock:
            self.record.sea = sea

    def _on_calm(self, message: JointTrajectory) -> None:
        stamp, times, _, probabilities = trajectory_values(message)
        calm = [NANOSECOND * (stamp + time) for time in times]
        with self.lock:
            self.record.calm = (calm[0], calm[-1], probabilities[0]) if calm else None

    def _on_quiescence(self, message: Float32) -> None:
        with self.lock:
            self.record.quiescence = message.data

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        with self.lock:
            for status in message.status:
                if status.hardware_id == self._prefix:
                    name = status.name.removeprefix(f'{self._prefix}/')
                    values = {each.key: each.value for each in status.values}
                    self.record.add_status(Report(name, status.level[0], status.message, values), monotonic())
