"""The node of the demonstration that listens: to the sensor, the forecasts, the model and the diagnostics."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from std_srvs.srv import Trigger

from swath_sysid.attitude.motion.attitude import euler_angles
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import imu_reading
from swath_sysid.formats.model_file import model_from_yaml
from swath_sysid.formats.topics import DESCRIPTION_TOPIC, IMU_TOPIC, NEXT_TOPIC, lead_topic
from swath_sysid.nodes.qos import LATCHED, bag_qos
from swath_sysid.pipeline.demonstration import attitude_at


@dataclass
class Received:
    """What has come so far."""

    readings: deque = field(default_factory=deque)
    angles: deque = field(default_factory=deque)  #: Stamp, ns, and measured angle about the axis, rad.
    forecasts: dict = field(default_factory=dict)  #: Lead to stamps they are for, ns, angle and deviation, rad.
    nexts: int = 0  #: Forecasts one sample ahead.
    models: dict = field(default_factory=dict)
    model_ns: int | None = None  #: Stamp of the sensor when the first model came.
    versions: int = 0  #: Models that came.
    diagnostics: dict = field(default_factory=dict)  #: Name to level and message.


class Listener(Node):
    """Subscribes to everything that the demonstration shows."""

    def __init__(self, axis: str, leads: Sequence[float]):
        super().__init__('demo')
        self._axis = axis
        self.received = Received(forecasts={lead: deque() for lead in leads})
        everything = bag_qos(is_latched=False)
        self.create_subscription(Imu, IMU_TOPIC, self._on_imu, qos_profile_sensor_data)
        self.create_subscription(Imu, NEXT_TOPIC, self._on_next, everything)
        for lead in leads:
            self.create_subscription(Imu, lead_topic(lead), self._forecast_callback(lead), everything)
        self.create_subscription(String, DESCRIPTION_TOPIC, self._on_model, LATCHED)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, everything)
        self._release = self.create_client(Trigger, 'simulated_craft/release')

    def is_ready(self) -> bool:
        """Whether the craft, the forecasts and the identifier all publish."""
        received = self.received
        nodes = {name.partition(':')[0] for name in received.diagnostics}
        streams = (received.angles, received.nexts, *received.forecasts.values())
        return all(streams) and {'imu_buffer', 'identifier'} <= nodes and self._release.service_is_ready()

    def release(self) -> Any:
        """Have the craft lifted and let go; a future of the service's response, whose message is the stamp (ns)."""
        return self._release.call_async(Trigger.Request())

    def forget(self) -> None:
        """Keep the newest of each only."""
        for kept in (self.received.readings, self.received.angles, *self.received.forecasts.values()):
            while len(kept) > 1:
                kept.popleft()

    def _on_imu(self, message: Any) -> None:
        reading = imu_reading(message)
        self.received.readings.append(reading)
        angle = float(euler_angles(*reading.orientation)[AXES.index(self._axis)])
        self.received.angles.append((reading.stamp_ns, angle))

    def _on_next(self, message: Any) -> None:
        self.received.nexts += 1

    def _forecast_callback(self, lead: float):
        kept = self.received.forecasts[lead]

        def receive(message: Any) -> None:
            # a forecast is an Imu: its stamp is the time it is for
            forecast = imu_reading(message)
            kept.append((forecast.stamp_ns, *attitude_at(forecast, self._axis)))

        return receive

    def _on_model(self, message: Any) -> None:
        try:
            models = model_from_yaml(message.data, DESCRIPTION_TOPIC) if message.data else {}
        except InputError as error:
            self.get_logger().error(str(error))
            return
        received = self.received
        received.models = models
        received.versions += 1
        if self._axis in models and received.model_ns is None and received.angles:
            received.model_ns = received.angles[-1][0]

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            self.received.diagnostics[status.name] = ord(status.level), status.message
