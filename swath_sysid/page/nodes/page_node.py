"""The node of the page: subscribes to the topics of the other nodes."""

import struct
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

from swath_sysid.common.errors import InputError
from swath_sysid.formats import topics
from swath_sysid.formats.messages import imu_reading, raw_stamp_ns, trajectory_values
from swath_sysid.formats.model_file import model_from_yaml
from swath_sysid.formats.sea_state_yaml import sea_from_yaml
from swath_sysid.nodes.diagnostics import EachOnce
from swath_sysid.nodes.executor_loop import LOOK_PERIOD
from swath_sysid.nodes.parameters.settings import installation, quiescence_limits
from swath_sysid.nodes.qos import LATCHED, NEWEST
from swath_sysid.page.live_record import ANOTHERS, READ, LiveRecord, calm_of, horizon_of, probability_of
from swath_sysid.page.nodes.page_intake import coming_from, keeping, values_of
from swath_sysid.page.nodes.page_requests import PageRequests
from swath_sysid.page.state import SELDOM
from swath_sysid.pipeline.health import Report

SENSOR = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)  #: Lossy: it slows nobody else.
NEWEST_LOSSY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)  #: No publisher waits for a page.
MAX_VALUES, LONGEST = 200, 1000  #: Of a status, and letters of each of its texts.

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
        self.sensor = self.resolve_topic_name(topics.IMU_TOPIC)
        self._report = EachOnce(report)
        self._requests = PageRequests(self, report, self._note_kept)
        self.press = self._requests.press
        self.namespace = self.get_namespace().strip('/')
        self._point: tuple[str, Any] = '', None
        self.create_subscription(Imu, topics.IMU_TOPIC, self._on_imu, SENSOR, raw=True)
        self.create_subscription(JointTrajectory, topics.HORIZON_TOPIC, self._on_horizon, NEWEST_LOSSY)
        self.create_subscription(String, topics.DESCRIPTION_TOPIC, self._on_description, LATCHED)
        self.create_subscription(String, topics.SEA_TOPIC, self._on_sea, LATCHED)
        self.create_subscription(JointTrajectory, topics.CALM_TOPIC, self._on_calm, LATCHED)
        self.create_subscription(Float32, topics.QUIESCENCE_TOPIC, self._on_quiescence, NEWEST)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(LOOK_PERIOD, self._requests.carry_out, clock=steady)
        self.create_timer(SELDOM, self._ask_predictor, clock=steady)

    def take(self, source: str, take: Callable, *content: Any) -> None:
        """Take what came from a topic or node; of what cannot be shown, each kind is reported once."""
        problem = ''
        try:
            take(*content)
        except InputError as error:
            problem = str(error)
        with self.lock:
            self.record.unreadable.pop(source, '')
            if problem:
                self.record.unreadable[source] = problem
        if problem:
            # readers of texts name the topic themselves
            self._report(problem if problem.startswith(source) else f'{source}: {problem}')

    def _note_kept(self, is_kept: bool) -> None:
        with self.lock:
            self.record.is_kept = is_kept

    def _ask_predictor(self) -> None:
        self._requests.get_parameters('predictor', ASKED, self._on_parameters)
        with self.lock:
            self.record.can_push = self._requests.can_push()

    @coming_from('predictor')
    def _on_parameters(self, *found: Any) -> None:
        values = values_of('predictor', ASKED, found)
        with self.lock:
            self.record.install(installation(values))
            self.record.limits = quiescence_limits(values)
        name, before = self._point
        point = next(filter(None, values['points']), '')
        if point != name:
            if before is not None:
                self.destroy_subscription(before)
            topic = topics.point_horizon_topic(point)
            take = partial(self.take, topic, self._on_heave, f'heave of {point}')
            new = self.create_subscription(JointTrajectory, topic, take, NEWEST_LOSSY) if point else None
            self._point = point, new

    @coming_from(topics.IMU_TOPIC)
    def _on_imu(self, raw: bytes) -> None:
        try:
            with self.lock:
                if self.record.is_due(raw_stamp_ns(raw), monotonic()):
                    self.record.add_reading(imu_reading(deserialize_message(raw, Imu)))
        except (struct.error, RuntimeError) as error:
            raise InputError(f'the bytes are no sensor_msgs/Imu: {ANOTHERS}') from error

    @coming_from(topics.HORIZON_TOPIC)
    def _on_horizon(self, message: JointTrajectory) -> None:
        horizon = horizon_of(*trajectory_values(message))
        with self.lock:
            self.record.add_horizon(horizon)

    def _on_heave(self, name: str, message: JointTrajectory) -> None:
        horizon = horizon_of(*trajectory_values(message), ('heave',))
        with self.lock:
            self.record.add_horizon(horizon, name)

    @coming_from(topics.DESCRIPTION_TOPIC)
    def _on_description(self, message: String) -> None:
        models = model_from_yaml(message.data, topics.DESCRIPTION_TOPIC) if message.data else {}
        with self.lock:
            self.description = message.data
            self.record.set_models(models)

    _on_sea = keeping('sea', topics.SEA_TOPIC, lambda message: sea_from_yaml(message.data))
    _on_calm = keeping('calm', topics.CALM_TOPIC, lambda message: calm_of(*trajectory_values(message)))
    _on_quiescence = keeping('quiescence', topics.QUIESCENCE_TOPIC, lambda message: probability_of(message.data))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        with self.lock:
            for status in message.status:
                name = status.name.removeprefix(f'{self.namespace}/')
                if status.hardware_id == self.namespace and name in READ:
                    values = {each.key[:LONGEST]: each.value[:LONGEST] for each in status.values[:MAX_VALUES]}
                    report = Report(name, status.level[0], status.message[:LONGEST], values)
                    self.record.add_status(report, monotonic())
