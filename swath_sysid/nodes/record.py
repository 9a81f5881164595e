"""Recording: every topic of ours and of our nodes, wherever in the graph it appears, to one mcap file."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from swath_sysid.common.errors import InputError
from swath_sysid.formats.output_bag import Recording, is_ours
from swath_sysid.formats.topics import is_within
from swath_sysid.nodes.executor_loop import LOOK_PERIOD, OF_ROS, events_executor, run
from swath_sysid.nodes.parameters.table import NODES
from swath_sysid.nodes.qos import BAG_DEPTH, IMU_TOPIC, IMU_TYPE, bag_qos, message_class
from swath_sysid.pipeline.health import DISCOVERY

SAVE_PERIOD = 1.0  #: s of messages that a loss of power costs at most.
#: Messages of a latched topic that wait while the disk is slow: ten a second at most, and texts whose memory stays.
LATCHED_DEPTH = 50


class RecorderNode(Node):
    """Subscribes, in its namespace, to our topics and to what our nodes use under whatever name, and to others."""

    def __init__(self, recording: Recording, others: Sequence[str] = ()):
        super().__init__('record')
        self._recording = recording
        self.failures: list[InputError] = []
        self._others = {f'/{topic.strip("/")}' for topic in others}
        self._sensors = {self.resolve_topic_name(IMU_TOPIC)}
        self._subscribed: dict[str, Any] = {}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._look()
        self.create_timer(LOOK_PERIOD, self._look, clock=steady)
        self.create_timer(SAVE_PERIOD, partial(self._attempt, recording.save), clock=steady)
        self._first_report = self.create_timer(DISCOVERY, self._report, clock=steady)

    def destroy_node(self) -> None:
        """Also say again what did not come."""
        self._warn_of_silence()
        super().destroy_node()

    def _look(self) -> None:
        before = set(self._subscribed)
        wanted = self._used_by_nodes()
        for topic, kinds in self.get_topic_names_and_types():
            here = is_within(self.get_namespace(), topic) and is_ours(topic, kinds)
            if here or topic in self._others and len(kinds) == 1:
                wanted.setdefault(topic, kinds[0])
        for topic in wanted.keys() - before:
            publishers = [p for p in self.get_publishers_info_by_topic(topic) if p.topic_type == wanted[topic]]
            if publishers and message_class(wanted[topic]) is not None:
                self._subscribe(topic, wanted[topic], [publisher.qos_profile for publisher in publishers])
        if added := sorted(self._subscribed.keys() - before):
            self.get_logger().info(f'recording {", ".join(added)}')

    def _used_by_nodes(self) -> dict[str, str]:
        """What our nodes in this namespace subscribe to and publish, with types; their sensors are noted."""
        heard: dict[str, str] = {}
        published: dict[str, str] = {}
        for name, namespace in self.get_node_names_and_namespaces():
            if name in NODES and is_within(self.get_namespace(), f'{namespace.rstrip("/")}/{name}'):
                with suppress(NodeNameNonExistentError):  # it has just ended
                    for found, names_and_types in (
                        (heard, self.get_subscriber_names_and_types_by_node(name, namespace)),
                        (published, self.get_publisher_names_and_types_by_node(name, namespace)),
                    ):
                        found |= {topic: kinds[0] for topic, kinds in names_and_types if topic not in OF_ROS}
        self._sensors = {topic for topic, kind in heard.items() if kind == IMU_TYPE} or self._sensors
        return heard | published

    def _report(self) -> None:
        """Once, when everything that is there has been found."""
        self._first_report.cancel()
        self._warn_of_silence()

    def _warn_of_silence(self) -> None:
        silent = {t for t in self._sensors | self._others if not self._recording.counts.get(t)}
        if silent:
            names = [f'{t}{"" if t in self._subscribed else " (nobody publishes it)"}' for t in sorted(silent)]
            self.get_logger().warning(
                f'no message on {" and ".join(names)}: start what publishes it, or name the topic of the sensor with '
                '--topic'
            )

    def _write(self, write: Callable[[int, bytes], None], raw: Any) -> None:
        self._attempt(partial(write, self.get_clock().now().nanoseconds, raw))

    def _attempt(self, action: Callable[[], None]) -> None:
        """End the recording, without the executor's own account of an error, when the disk takes no more."""
        try:
            action()
        except InputError as error:
            self.failures.append(error)
            self.context.try_shutdown()

    def _subscribe(self, topic: str, kind: str, offered: Sequence[QoSProfile]) -> None:
        """With the strictest QoS that every publisher offers."""
        latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
        write = self._recording.add_topic(topic, kind, latched, reliable)
        qos = bag_qos(latched, reliable, LATCHED_DEPTH if latched else BAG_DEPTH)
        self._subscribed[topic] = self.create_subscription(
            message_class(kind), topic, partial(self._write, write), qos, raw=True
        )


def record(path: str | Path, others: Sequence[str] = (), args: list[str] | None = None) -> tuple[int, dict[str, int]]:
    """Record to ``NAME.mcap`` until a signal comes: the exit code and the number of messages by topic."""
    recording = Recording(path)
    made: list[RecorderNode] = []

    def make() -> RecorderNode:
        made.append(RecorderNode(recording, others))
        return made[-1]

    try:
        code = run([(events_executor, [make])], args)
    finally:
        recording.close()
    for failure in (failure for node in made for failure in node.failures):
        raise failure
    return code, recording.counts
