"""A bag as it is published again: its topics, its serialised messages in the order of recording, and their times."""

import heapq
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.interfaces import QosDurability

from swath_sysid.attitude.motion.intake import NANOSECOND
from swath_sysid.common.account import Loss
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import intact_messages
from swath_sysid.formats.output_bag import is_output
from swath_sysid.formats.topics import IMU, LATCHED_TOPICS


@dataclass(frozen=True)
class ReplaySettings:
    """How a bag is replayed."""

    rate: float = 1.0  #: Times real time.
    loop: bool = False  #: Begin again at the end.
    clock: bool = False  #: Publish /clock too.
    wait: float = 15.0  #: s; the longest wait for subscriptions before the start.
    listeners: int = 0  #: Subscriptions (to the IMU, if the bag has one) to wait for; 0: those that are found.
    in_step: bool = False  #: Stay near the stamp of the newest ``forecast/next``.
    topics: tuple[str, ...] = ()  #: To publish; none: all but those that the nodes publish themselves.

    def __post_init__(self) -> None:
        if not self.rate > 0.0:
            raise InputError(f'the rate must be greater than zero, not {self.rate}')
        if not self.wait >= 0.0:
            raise InputError('the time to wait must not be negative')
        if self.listeners < 0:
            raise InputError('the number of subscriptions to wait for must not be negative')


@dataclass(frozen=True)
class RecordedTopic:
    """A topic of a bag, by its message type; of a latched one a late subscriber gets the last message."""

    kind: str
    is_latched: bool

    @property
    def is_imu(self) -> bool:
        """Whether it holds IMU messages."""
        return self.kind == IMU


def recorded_topics(readers: Sequence[Any]) -> dict[str, RecordedTopic]:
    """The topics of a bag, opened by `opened_bag`, by name, but /clock."""
    found: dict[str, RecordedTopic] = {}
    for connection in (connection for reader in readers for connection in reader.connections):
        offered = connection.ext.offered_qos_profiles
        latched = any(qos.durability == QosDurability.TRANSIENT_LOCAL for qos in offered)
        # a bag written without ROS may not record it
        latched = latched or connection.topic.endswith(LATCHED_TOPICS)
        found.setdefault(connection.topic, RecordedTopic(connection.msgtype, latched))
    found.pop('/clock', None)
    return found


def chosen_topics(recorded: Mapping[str, RecordedTopic], asked: Sequence[str]) -> dict[str, RecordedTopic]:
    """The topics asked for, else those that the nodes do not publish themselves."""
    names = {topic.strip('/') for topic in asked}
    chosen = {
        topic: each
        for topic, each in recorded.items()
        if (topic.strip('/') in names if names else not is_output(topic, each.kind))
    }
    held = f'it holds {", ".join(recorded) or "none"}'
    if unknown := names - {topic.strip('/') for topic in chosen}:
        raise InputError(f'the bag has no topic /{min(unknown)}: {held}')
    if not chosen:
        raise InputError(
            f'the bag has no topic that the nodes do not publish themselves: choose one; {held}', 'outputs-only'
        )
    return chosen


def merged_messages(
    path: str | Path, readers: Sequence[Any], topics: Collection[str], losses: list[Loss]
) -> Iterator[tuple[int, str, bytes]]:
    """The messages of some topics in the order of recording: time of reception, ns, topic, serialised message. What
    cannot be read joins the losses.
    """

    def stream(number: int) -> Iterator[tuple[int, int, str, bytes]]:
        for connection, received, raw in intact_messages(path, [readers[number]], topics, losses):
            yield received, number, connection.topic, bytes(raw)

    streams = [stream(number) for number in range(len(readers))]
    for received, _, topic, raw in heapq.merge(*streams, key=lambda message: message[:2]):
        yield received, topic, raw


@dataclass(frozen=True)
class Timeline:
    """Bag time, ns, against wall time, s: ``first_ns`` is published at ``begun``, the rest at that rate."""

    begun: float
    first_ns: int
    rate: float

    def wall_time(self, time_ns: int) -> float:
        """When a message is due, s."""
        return self.begun + (time_ns - self.first_ns) * NANOSECOND / self.rate

    def bag_time(self, now: float) -> int:
        """Bag time, ns, at a wall time."""
        return self.first_ns + round((now - self.begun) * self.rate / NANOSECOND)
