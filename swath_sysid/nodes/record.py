"""Recording: every topic of ours, wherever in the graph it appears, to one mcap file."""
import os
import shutil
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from swath_sysid.common.errors import InputError
from swath_sysid.formats.mcap_checksums import add_checksums
from swath_sysid.formats.output_bag import offered_qos
from swath_sysid.formats.topics import IMU, LEADS, PATH_TOPIC, QUIESCENCE_TOPIC, TYPES
from swath_sysid.nodes.executor_loop import events_executor, run
from swath_sysid.nodes.replay import message_class

OURS = {topic.lstrip('/'): kind for topic, kind in TYPES.items() if topic != PATH_TOPIC} | {
    'identifier/progress': TYPES[QUIESCENCE_TOPIC]}
"""Topic, under whatever namespace, to type."""

LOOK_PERIOD = 0.1
"""s between looks for new topics."""

SAVE_PERIOD = 1.0
"""s of messages that a loss of power costs at most."""

DEPTH = 1000


class Recording:
    """One mcap file that is being written; whole in itself once a second, and named at the end.

    While it grows it lies in the folder ``NAME.recording``, which stays, readable, if the process is killed.

    Parameters
    ----------
    path : str or Path
        ``NAME.mcap``.

    Raises
    ------
    InputError
        The name does not end in .mcap, something has it already, or the folder cannot be written to.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        if self.path.suffix != '.mcap':
            raise InputError(f"recordings are mcap: give an output name that ends in .mcap, not '{path}'")
        self._folder = self.path.with_suffix('.recording')
        if not self.path.parent.is_dir():
            raise InputError(f'cannot write {path}: there is no folder {self.path.parent}; choose one that exists')
        for taken in (self.path, self._folder):
            if taken.exists():
                raise InputError(f'{taken} exists already: choose another name, or remove it first')
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._writer = Writer(self._folder, version=9, storage_plugin=StoragePlugin.MCAP)
        try:
            self._writer.open()
        except OSError as error:
            raise InputError(f'cannot write {path}: {error.strerror}; choose another folder') from error
        self.counts: dict[str, int] = {}

    def add_topic(self, topic: str, kind: str, latched: bool, reliable: bool) -> Callable[[int, bytes], None]:
        """Begin with a topic; returns a function that takes time, ns, and serialised message."""
        connection = self._writer.add_connection(
            topic, kind, typestore=self._store, offered_qos_profiles=[offered_qos(latched, reliable)]
        )
        self.counts[topic] = 0

        def write(time_ns: int, raw: bytes) -> None:
            self._writer.write(connection, time_ns, raw)
            self.counts[topic] += 1

        return write

    def save(self) -> None:
        """Bring what has come to the disk, as a whole chunk."""
        storage: Any = self._writer.storage
        if storage.chunk.bio.tell():
            storage.close_chunk()
            storage.bio.flush()
            os.fsync(storage.bio.fileno())

    def close(self) -> None:
        """Finish the file and give it its name."""
        self._writer.close()
        add_checksums(self._folder / f'{self._folder.name}.mcap')
        os.replace(self._folder / f'{self._folder.name}.mcap', self.path)
        shutil.rmtree(self._folder)


class Record(Node):
    """Subscribes to every topic of ours as it appears, and hands its messages on as they are.

    Parameters
    ----------
    recording : Recording
    others : sequence of str
        Further topics, by their full names.
    """

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
        for topic, kinds in self.get_topic_names_and_types():
            if topic not in self._subscribed and self._is_wanted(topic, kinds):
                publishers = self.get_publishers_info_by_topic(topic)
                if publishers:
                    self._subscribe(topic, kinds[0], [publisher.qos_profile for publisher in publishers])

    def _is_wanted(self, topic: str, kinds: Sequence[str]):
        asked = topic in self._others and len(kinds) == 1 and message_class(kinds[0]) is not None
        return asked or is_ours(topic, kinds)

    def _write(self, write: Callable[[int, bytes], None], raw: Any) -> None:
        write(self.get_clock().now().nanoseconds, raw)

    def _subscribe(self, topic: str, kind: str, offered: Sequence[QoSProfile]) -> None:
        """With the strictest QoS that every publisher offers."""
        latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
        write = self._recording.add_topic(topic, kind, latched, reliable)
        self._subscribed[topic] = self.create_subscription(
            message_class(kind), topic, partial(self._write, write),
            QoSProfile(
                depth=DEPTH,
                reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
                durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
            ),
            raw=True,
        )
        self.get_logger().info(f'recording {topic}')


def is_ours(topic: str, kinds: Sequence[str]) -> bool:
    """Whether a topic is one of the contract, in any namespace.

    Parameters
    ----------
    topic : str
    kinds : sequence of str
        Its message types; a topic of several is nobody's.
    """
    if len(kinds) != 1:
        return False
    name = f'/{topic.strip("/")}'
    _, found, _ = name.rpartition(f'/{LEADS}')
    if found:
        return kinds[0] == IMU
    return any(name.endswith(f'/{ours}') and kinds[0] == kind for ours, kind in OURS.items())


def record(path: str | Path, others: Sequence[str] = (), args: list[str] | None = None) -> tuple[int, dict[str, int]]:
    """Record until a signal comes.

    Parameters
    ----------
    path : str or Path
        ``NAME.mcap``.
    others : sequence of str
        Further topics.
    args : list of str, optional
        As for `rclpy.init`.

    Returns
    -------
    code : int
        Exit code.
    counts : dict of str to int
        Messages by topic.

    Raises
    ------
    InputError
        See `Recording`.
    """
    recording = Recording(path)
    try:
        code = run([(events_executor, [lambda: Record(recording, others)])], args)
    finally:
        recording.close()
    return code, recording.counts
