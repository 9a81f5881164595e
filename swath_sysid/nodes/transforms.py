"""The mounting of the sensor by /tf_static, where no parameter states it."""

from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from swath_sysid.formats.messages import frame_tree
from swath_sysid.formats.topics import CRAFT_FRAME, STATIC_FRAMES, TRANSFORMS
from swath_sysid.nodes.inbox import Arrival
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.parameters.settings import installation
from swath_sysid.nodes.qos import message_class
from swath_sysid.pipeline.awaited_mounting import AwaitedMounting

#: Of one static broadcaster each message is the last; a craft has fewer broadcasters.
ALL_BROADCASTERS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NO_TRANSFORMS = (
    'set mounting_deg: /tf_static cannot be read without the package tf2_msgs, which ROS 2 from apt has '
    '(ros-jazzy-tf2-msgs) and PyPI has not'
)


class Transforms:
    """Tells the parameters of a node the mounting; the samples of its inbox wait for that."""

    def __init__(self, node: Node, parameters: NodeParameters) -> None:
        self._parameters, self._log = parameters, node.get_logger()
        stated = installation(parameters.values)
        self._awaited: AwaitedMounting | None = None
        if wait := parameters['mounting_wait_s'] if stated.mounting is None else 0.0:
            kind, craft = message_class(TRANSFORMS), parameters.values.get('frame_id', CRAFT_FRAME)
            self._cure = NO_TRANSFORMS
            if kind is not None:
                topic = node.resolve_topic_name(STATIC_FRAMES)
                self._cure = f'no transform on {topic} connects them: publish it, or set mounting_deg'
                node.create_subscription(kind, STATIC_FRAMES, self.take, ALL_BROADCASTERS)
            self._awaited = AwaitedMounting(stated.frame, craft, wait if kind is not None else 0.0)
        self._is_waiting = self._awaited is not None

    def take(self, message: Any) -> None:
        """Take a tf2_msgs/TFMessage, or whatever has its fields: the callback."""
        if self._awaited is not None and self._awaited.hear(frame_tree(message)):
            self._tell(self._awaited)

    def hold_back(self, inbox: Sequence[Arrival]) -> bool:
        """Whether the samples of an inbox still wait for the mounting."""
        if self._is_waiting and self._awaited is not None and inbox:
            now = perf_counter()
            if self._awaited.see(inbox[0].message.header.frame_id, now):
                self._tell(self._awaited)
            if self._awaited.is_over(now):
                self._is_waiting = False
                if self._awaited.mounting is None:
                    self._log.info(f'{self._awaited.described}; {self._cure}')
                    self._parameters.mount(None)
        return self._is_waiting

    @property
    def are_awaited(self) -> bool:
        """Whether the mounting may still come before the first sample is used."""
        return self._is_waiting

    def _tell(self, found: AwaitedMounting) -> None:
        self._log.info(found.described)
        self._is_waiting = False
        self._parameters.mount(np.degrees(np.array(found.mounting)).tolist())
