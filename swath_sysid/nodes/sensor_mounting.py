"""The mounting of a sensor that imu_buffer has by parameter, for what records the sensor."""

from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from sensor_msgs.msg import Imu

from swath_sysid.attitude.motion.attitude import turn_in_craft
from swath_sysid.formats.messages import transform_message
from swath_sysid.nodes.parameters.settings import installation


class SensorMounting:
    """Asks imu_buffer once, when a message has told the frame of the sensor."""

    def __init__(self, node: Node) -> None:
        self._buffer = node.create_client(GetParameters, 'imu_buffer/get_parameters')
        self._asked: Future | None = None
        self._frame_id = ''  #: Of the sensor.

    def note_frame(self, raw: Any) -> None:
        """Take a serialised message of the sensor."""
        self._frame_id = self._frame_id or deserialize_message(raw, Imu).header.frame_id

    def transform(self, stamp_ns: int) -> bytes | None:
        """A tf2_msgs/TFMessage that states it; None while it is not known, and where there is none to state."""
        if self._asked is None:
            if self._frame_id and self._buffer.service_is_ready():
                self._asked = self._buffer.call_async(
                    GetParameters.Request(names=['frame', 'mounting_deg', 'frame_id'])
                )
            return None
        if not self._asked.done():
            return None
        frame, angles, craft = map(parameter_value_to_python, self._asked.result().values)
        mount = installation({'frame': frame, 'mounting_deg': list(angles)})
        if mount.mounting is None or self._frame_id == craft:
            return None
        return transform_message(stamp_ns, craft, self._frame_id, turn_in_craft(mount))
