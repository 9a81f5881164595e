"""Recording: every topic of ours, wherever in the graph it appears, to one mcap file."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from swath_sysid.formats.output_bag import Recording, is_ours
from swath_sysid.formats.topics import is_within
from swath_sysid.nodes.executor_loop import LOOK_PERIOD, events_executor, run
from swath_sysid.nodes.qos import bag_qos, message_class

SAVE_PERIOD = 1.0  #: s of messages that a loss of power costs at most.


class Record(Node):
    """Subscribes to our topics in its namespace as they appear, and to others, and hands their messages on."""

    def __init__(self, recording: Recording, others: Sequence[str] = ()):
        super().__init__('record')
        self._recording = recording
        self._others = {f'/{topic.strip("/")}' for topic in others}
        self._subscribed: dict[str, Any] = {}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._look()
        self.create_timer(LOOK_PERIOD, self._look, clock=steady)
        self.create_timer(SAVE_PERIOD, recording.save, clock=steady)

    def _look(self) -> None:
        before = set(self._subscribed)
        for topic, kinds in self.get_topic_names_and_types():
            here = is_within(self.get_namespace(), topic)
            asked = topic in self._others and len(kinds) == 1 and message_class(kinds[0]) is not None
            if topic not in self._subscribed and (asked or here and is_ours(topic, kinds)):
                publishers = self.get_publishers_info_by_topic(topic)
                if publishers:
                    self._subscribe(topic, kinds[0], [publisher.qos_profile for publisher in publishers])
        if added := sorted(self._subscribed.keys() - before):
            self.get_logger().info(f'recording {", ".join(added)}')

    def _write(self, write: Callable[[int, bytes], None], raw: Any) -> None:
        write(self.get_clock().now().nanoseconds, raw)

    def _subscribe(self, topic: str, kind: str, offered: Sequence[QoSProfile]) -> None:
        """With the strictest QoS that every publisher offers."""
        latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
        write = self._recording.add_topic(topic, kind, latched, reliable)
        self._subscribed[topic] = self.create_subscription(
            message_class(kind), topic, partial(self._write, write), bag_qos(latched, reliable), raw=True
        )


def record(path: str | Path, others: Sequence[str] = (), args: list[str] | None = None) -> tuple[int, dict[str, int]]:
    """Record to ``NAME.mcap`` until a signal comes: the exit code and the number of messages by topic."""
    recording = Recording(path)
    try:
        code = run([(events_executor, [lambda: Record(recording, others)])], args)
    finally:
        recording.close()
    return code, recording.counts
