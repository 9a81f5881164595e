"""Writing rosbag2 bags without ROS: of sensors, of the nodes' output, and a recording that is whole at any time."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer

from swath_sysid.common.errors import InputError
from swath_sysid.common.wings import handed_in
from swath_sysid.formats import messages, topics
from swath_sysid.formats.files import replacing
from swath_sysid.formats.forecast_output import ForecastMessages
from swath_sysid.formats.mcap_checksums import add_checksums, cut_off
from swath_sysid.formats.messages import typestore
from swath_sysid.formats.model_file import model_to_yaml
from swath_sysid.formats.topics import QUIESCENCE_TOPIC, TYPES, type_of

if TYPE_CHECKING:
    import numpy as np

    from swath_sysid.pipeline.play_through import Played


STORAGES = {'.mcap': StoragePlugin.MCAP, '.db3': StoragePlugin.SQLITE3}
FOR_EVER = QosTime(9223372036, 854775807)


@contextmanager
def writing_bag(path: str | Path) -> Iterator[Callable]:
    """A function that adds topic, type, time in ns, bytes and QoS to a new bag, which takes its final name at the end.
    ``NAME.mcap`` or ``NAME.db3`` is a single file, any other path a bag folder.
    """
    path = Path(path)
    kind = path.suffix if path.suffix in STORAGES else None
    with replacing(path) as temporary:
        folder = temporary.with_suffix('') if kind else temporary
        with Writer(folder, version=9, storage_plugin=STORAGES[kind or '.mcap']) as writer:
            connections = {}

            def add(topic: str, msgtype: str, time_ns: int, raw: bytes, qos: Sequence[Qos] = ()) -> None:
                if topic not in connections:
                    connections[topic] = writer.add_connection(
                        topic, msgtype, typestore=messages.typestore(), offered_qos_profiles=list(qos)
                    )
                writer.write(connections[topic], time_ns, raw)

            yield add
        if kind != '.db3':
            add_checksums(folder / f'{folder.name}.mcap')
        if kind:
            os.replace(folder / f'{folder.name}{kind}', temporary)


@contextmanager
def writing_output_bag(
    path: str | Path, *, frame_id: str = 'base_link', frames_at: Sequence[float] = ()
) -> Iterator[OutputBag]:
    """An `OutputBag`, ``NAME.mcap``, that takes its final name at the end."""
    if not str(path).endswith('.mcap'):
        raise InputError(f"the messages are written as mcap: give an output name that ends in .mcap, not '{path}'")
    with writing_bag(path) as add:
        yield OutputBag(add, ForecastMessages(frame_id, frames_at))


class OutputBag:
    """What the nodes publish, as messages of a bag being written; see `writing_output_bag`."""

    def __init__(self, add: Callable, forecasts: ForecastMessages) -> None:
        self._add = add
        self._forecasts = forecasts
        self._described: dict[str, tuple[str, str, list[Qos]]] = {}
        self.counts: dict[str, int] = {}

    def add(self, topic: str, time_ns: int, raw: bytes, kind: str = '') -> None:
        """A serialised message on a topic of the nodes, or on another of a given type."""
        if topic not in self.counts:
            qos = [offered_qos(topic in topics.LATCHED_TOPICS, topic != topics.IMU_TOPIC)]
            self._described[topic] = f'/{topic.lstrip("/")}', kind or topics.type_of(topic), qos
            self.counts[topic] = 0
        name, msgtype, qos = self._described[topic]
        self._add(name, msgtype, time_ns, raw, qos)
        self.counts[topic] += 1

    def add_played(self, played: Played) -> None:
        """Everything that one step of a play-through, a `Played`, published, in that order."""
        time_ns, step = played.stamp_ns, played.step
        if played.models is not None:
            self.add(topics.DESCRIPTION_TOPIC, time_ns, messages.text_message(model_to_yaml(played.models)))
            self.add(topics.COEFFICIENTS_TOPIC, time_ns, messages.coefficients_message(played.models))
        for topic, raw in self._forecasts.all_of(step):
            self.add(topic, time_ns, raw)
        if played.window is not None:
            self.add(topics.WINDOW_TOPIC, time_ns, messages.window_message(played.window, self._forecasts.frame_id))

    def add_imu(self, time_ns: int, values: np.ndarray) -> None:
        """The IMU message itself, of 37 numbers in the order of the message definition."""
        self.add(topics.IMU_TOPIC, time_ns, self._forecasts.imu.of_values(time_ns, values))

    def add_diagnostics(self, time_ns: int, statuses: Iterable[tuple[int, str, str, Mapping[str, str]]]) -> None:
        """Statuses as `diagnostics_message` takes them."""
        self.add(topics.DIAGNOSTICS_TOPIC, time_ns, messages.diagnostics_message(time_ns, statuses))


def offered_qos(latched: bool, reliable: bool) -> Qos:
    """What a bag says of the publisher of a topic: transient local if latched, best effort if not reliable."""
    reliability = QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT
    durability, depth = (QosDurability.TRANSIENT_LOCAL, 1) if latched else (QosDurability.VOLATILE, 10)
    end = FOR_EVER, FOR_EVER, QosLiveliness.AUTOMATIC, FOR_EVER, False
    return Qos(QosHistory.KEEP_LAST, depth, reliability, durability, *end)


#: Topic, under whatever namespace, to type.
OURS = {topic.lstrip('/'): kind for topic, kind in TYPES.items()} | {'identifier/progress': TYPES[QUIESCENCE_TOPIC]}


class Recording:
    """One mcap file, ``NAME.mcap``, that is complete on disk once a second and takes its name at the end. While it
    grows it is in the folder ``NAME.recording``, which stays readable if the process is killed.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        if self.path.suffix != '.mcap':
            raise InputError(f"recordings are mcap: give an output name that ends in .mcap, not '{path}'")
        self._folder = self.path.with_suffix('.recording')
        if not self.path.parent.is_dir():
            raise InputError(f'cannot write {path}: there is no folder {self.path.parent}; choose one that exists')
        if self.path.exists():
            raise InputError(f'{path} exists already: choose another name, or remove it first')
        if self._folder.exists():
            raise InputError(
                f'{self._folder} holds what a recording that was killed had written, and can be read as a bag: move it '
                'away, or choose another name'
            )
        self._writer: Writer | None = None
        self._saved: list[tuple[int, int]] = []  # of the last two: size of the file, time of its newest message, ns
        self.counts: dict[str, int] = {}

    def add_topic(self, topic: str, kind: str, latched: bool, reliable: bool) -> Callable[[int, bytes], None]:
        """Begin with a topic; returns a function that takes time, ns, and serialised message."""
        if self._writer is None:
            self._writer = Writer(self._folder, version=9, storage_plugin=StoragePlugin.MCAP)
            try:
                self._writer.open()
            except OSError as error:
                raise InputError(f'cannot write {self.path}: {error.strerror}; choose another folder') from error
        writer = self._writer
        connection = writer.add_connection(
            topic, kind, typestore=typestore(), offered_qos_profiles=[offered_qos(latched, reliable)]
        )
        self.counts[topic] = 0

        def write(time_ns: int, raw: bytes) -> None:
            try:
                writer.write(connection, time_ns, raw)
            except OSError as error:
                raise self._cut_short(error) from error
            self.counts[topic] += 1

        return write

    def save(self) -> None:
        """Bring what has come to the disk, as a whole chunk."""
        storage: Any = self._writer and self._writer.storage
        if storage and storage.chunk.bio.tell():
            try:
                storage.close_chunk()
                storage.bio.flush()
                os.fsync(storage.bio.fileno())
            except OSError as error:
                raise self._cut_short(error) from error
            self._saved = [*self._saved[-1:], (storage.bio.tell(), storage.message_end_time)]

    def close(self) -> None:
        """Finish the file and give it its name; without a message there is none."""
        if self._writer is None:
            return
        try:
            self._writer.close()
            add_checksums(self._file)
            self._finish()
        except OSError as error:
            raise self._cut_short(error) from error

    @property
    def _file(self) -> Path:
        return self._folder / f'{self._folder.name}.mcap'

    def _finish(self) -> None:
        if any(self.counts.values()):
            os.replace(self._file, self.path)
        shutil.rmtree(self._folder)
        self._writer = None

    def _cut_short(self, error: OSError) -> InputError:
        """Finish what was saved before the disk took no more: what to say then."""
        storage: Any = self._writer and self._writer.storage
        self._writer = None
        with suppress(OSError):  # what it still holds does not fit
            storage.bio.close()
        told = f'the recording {self.path} ended, because the disk takes no more ({error.strerror})'
        # to end a file takes less than the last part of it
        for size, end_ns in reversed(self._saved):
            with suppress(OSError):
                cut_off(self._file, size)
                self._finish()
                reach = (end_ns - storage.message_start_time) / messages.SECOND_NS
                return InputError(f'{told}: {self.path} is whole and holds the first {reach:.0f} s. Free some space')
        left = f'{self._folder} can be read as a bag' if self._saved else 'nothing was saved; choose another folder'
        return InputError(f'{told}: {left}')


def is_ours(topic: str, kinds: Sequence[str]) -> bool:
    """Whether a topic, of one message type alone, is one of the contract, in any namespace."""
    if len(kinds) != 1:
        return False
    name = f'/{topic.strip("/")}'
    _, is_forecast, rest = name.rpartition('/forecast/')
    if is_forecast:
        return kinds[0] == type_of(f'forecast/{rest}')
    return any(name.endswith(f'/{ours}') and kinds[0] == kind for ours, kind in OURS.items())


def is_output(topic: str, kind: str) -> bool:
    """Whether a topic, in whatever namespace, is one that the nodes publish."""
    name = f'/{topic.strip("/")}'
    of_wings = any(f'/{beginning}' in name for beginning in handed_in('topics'))
    return of_wings or is_ours(topic, [kind]) and not name.endswith(f'/{topics.IMU_TOPIC}')
