"""A recording of the topics of the contract, as one mcap file that is whole at any time."""

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rosbags.rosbag2 import StoragePlugin, Writer

from swath_sysid.common.errors import InputError
from swath_sysid.formats.mcap_checksums import add_checksums
from swath_sysid.formats.messages import typestore
from swath_sysid.formats.output_bag import offered_qos
from swath_sysid.formats.topics import PATH_TOPIC, QUIESCENCE_TOPIC, TYPES, type_of

#: Topic, under whatever namespace, to type.
OURS = {topic.lstrip('/'): kind for topic, kind in TYPES.items() if topic != PATH_TOPIC} | {
    'identifier/progress': TYPES[QUIESCENCE_TOPIC]
}


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
        for taken in (self.path, self._folder):
            if taken.exists():
                raise InputError(f'{taken} exists already: choose another name, or remove it first')
        self._store = typestore()
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


def is_ours(topic: str, kinds: Sequence[str]) -> bool:
    """Whether a topic, of one message type alone, is one of the contract, in any namespace."""
    if len(kinds) != 1:
        return False
    name = f'/{topic.strip("/")}'
    _, is_forecast, rest = name.rpartition('/forecast/')
    if is_forecast:
        return kinds[0] == type_of(f'forecast/{rest}')
    return any(name.endswith(f'/{ours}') and kinds[0] == kind for ours, kind in OURS.items())
