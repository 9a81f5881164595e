"""Writing rosbag2 bags without ROS: of what sensors send, and of what the nodes publish."""
import os
from contextlib import contextmanager
from pathlib import Path
from struct import Struct
from typing import Any

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter

from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing
from swath_sysid.formats.forecast_output import ForecastMessages
from swath_sysid.formats.mcap_checksums import add_checksums
from swath_sysid.formats.messages import (
    coefficients_message,
    diagnostics_message,
    text_message,
    typestore,
    window_message,
)
from swath_sysid.formats.model_file import model_to_yaml
from swath_sysid.formats.topics import (
    COEFFICIENTS_TOPIC,
    DESCRIPTION_TOPIC,
    DIAGNOSTICS_TOPIC,
    IMU_TOPIC,
    LATCHED_TOPICS,
    NEXT_TOPIC,
    WINDOW_TOPIC,
    type_of,
)

STORAGES = {'.mcap': StoragePlugin.MCAP, '.db3': StoragePlugin.SQLITE3}
FOR_EVER = QosTime(9223372036, 854775807)

_CHUNK_BYTES = 1 << 20
_MESSAGE = Struct('<BQHIQQ')
"""An mcap record with a message: code, length, channel, sequence number, log time and publish time before its data."""
_MESSAGE_CODE, _BEFORE_DATA = 0x05, _MESSAGE.size - 9


class _McapStorage(McapWriter):
    """That of rosbags, but that a message takes two writes and not eight."""

    def write(self, connection, timestamp, data):
        """Write a message at a time, ns."""
        self.message_start_time = min(timestamp, self.message_start_time)
        self.message_end_time = max(timestamp, self.message_end_time)
        self.channel_stats[connection.id] += 1
        chunk, file = self.chunk, self.chunk.bio
        chunk.message_start_time = min(timestamp, chunk.message_start_time)
        chunk.message_end_time = max(timestamp, chunk.message_end_time)
        chunk.msgs[connection.id].append((timestamp, file.tell()))
        size = _BEFORE_DATA + len(data)
        file.write(_MESSAGE.pack(_MESSAGE_CODE, size, connection.id, 0, timestamp, timestamp))
        file.write(data)
        if file.tell() > _CHUNK_BYTES:
            self.close_chunk()


class BagWriter(Writer):
    """That of rosbags, quicker with a message: it is not asked of every one whether its connection is known."""

    STORAGE_PLUGINS = {**Writer.STORAGE_PLUGINS, StoragePlugin.MCAP: _McapStorage}

    def write(self, connection, timestamp, data):
        """Write a message at a time, ns, on a connection that this writer made."""
        storage: Any = self.storage
        storage.write(connection, timestamp, data)
        self.counts[connection.id] += 1
        self.min_timestamp = min(timestamp, self.min_timestamp)
        self.max_timestamp = max(timestamp, self.max_timestamp)


@contextmanager
def writing_bag(path):
    """A rosbag2 bag being written, which takes its final name at the end; nothing is left if the block raises.

    Parameters
    ----------
    path : str or Path
        ``NAME.mcap`` or ``NAME.db3`` for a single file, else a bag folder (mcap).

    Yields
    ------
    callable
        Adds a message: topic, type, time, ns, and bytes; and, for a new topic, the QoS offered.

    Raises
    ------
    InputError
        Something stands at `path` that may not be replaced, or it cannot be written.
    """
    path = Path(path)
    kind = path.suffix if path.suffix in STORAGES else None
    with replacing(path) as temporary:
        folder = temporary.with_suffix('') if kind else temporary
        with BagWriter(folder, version=9, storage_plugin=STORAGES[kind or '.mcap']) as writer:
            connections = {}

            def add(topic, msgtype, time_ns, raw, qos=()):
                if topic not in connections:
                    connections[topic] = writer.add_connection(
                        topic, msgtype, typestore=typestore(), offered_qos_profiles=list(qos))
                writer.write(connections[topic], time_ns, raw)

            yield add
        if kind != '.db3':
            add_checksums(folder / f'{folder.name}.mcap')
        if kind:
            os.replace(folder / f'{folder.name}{kind}', temporary)


@contextmanager
def writing_output_bag(path, *, frame_id='base_link', frames_at=()):
    """An `OutputBag` that takes its final name at the end; see `writing_bag`.

    Parameters
    ----------
    path : str or Path
        ``NAME.mcap``.
    frame_id : str
        Of all messages of attitude with a header.
    frames_at : sequence of float
        See `ForecastMessages`.

    Yields
    ------
    OutputBag

    Raises
    ------
    InputError
        The name does not end in .mcap, or the file cannot be written.
    """
    if not str(path).endswith('.mcap'):
        raise InputError(f"the messages are written as mcap: give an output name that ends in .mcap, not '{path}'")
    with writing_bag(path) as add:
        yield OutputBag(add, ForecastMessages(frame_id, frames_at))


class OutputBag:
    """What the nodes publish, as messages of a bag being written; see `writing_output_bag`."""

    def __init__(self, add, forecasts):
        self._add = add
        self._forecasts = forecasts
        self._described = {}
        self.counts: dict[str, int] = {}

    def add(self, topic, time_ns, raw):
        """A serialised message on a topic of the nodes."""
        if topic not in self.counts:
            qos = offered_qos(topic in LATCHED_TOPICS, topic != IMU_TOPIC)
            self._described[topic] = f'/{topic.lstrip("/")}', type_of(topic), [qos]
            self.counts[topic] = 0
        name, msgtype, qos = self._described[topic]
        self._add(name, msgtype, time_ns, raw, qos)
        self.counts[topic] += 1

    def add_played(self, played):
        """Everything that one step of a play-through published.

        Parameters
        ----------
        played : Played
            In the order of publishing.
        """
        time_ns, step = played.stamp_ns, played.step
        if played.models is not None:
            self.add_models(time_ns, played.models)
        if step.next is not None:
            self.add(NEXT_TOPIC, time_ns, self._forecasts.attitude(step.next))
        for topic, raw in self._forecasts.of(step):
            self.add(topic, time_ns, raw)
        if played.window is not None:
            self.add(WINDOW_TOPIC, time_ns, window_message(played.window, self._forecasts.frame_id))

    def add_imu(self, time_ns, values):
        """The IMU message itself, of 37 numbers in the order of the message definition."""
        self.add(IMU_TOPIC, time_ns, self._forecasts.imu.of_values(time_ns, values))

    def add_models(self, time_ns, models):
        """Models by axis, as ``model/description`` and ``model/coefficients``."""
        self.add(DESCRIPTION_TOPIC, time_ns, text_message(model_to_yaml(models)))
        self.add(COEFFICIENTS_TOPIC, time_ns, coefficients_message(models))

    def add_diagnostics(self, time_ns, statuses):
        """Statuses as `diagnostics_message` takes them."""
        self.add(DIAGNOSTICS_TOPIC, time_ns, diagnostics_message(time_ns, statuses))


def offered_qos(latched, reliable) -> Qos:
    """What a bag says of the publisher of a topic: transient local if latched, best effort if not reliable."""
    return Qos(
        QosHistory.KEEP_LAST, 1 if latched else 10,
        QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        FOR_EVER, FOR_EVER, QosLiveliness.AUTOMATIC, FOR_EVER, False,
    )  # fmt: skip
