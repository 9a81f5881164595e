"""Results of long work, kept one by one so that work that was stopped goes on where it was."""

import fcntl
import hashlib
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import write_text

LEFTOVERS = '.writing-*'
LOCK = '.lock'


def key_of(*parts: Any) -> str:
    """Key of a result: the SHA-256, hexadecimal, of all plain data that it depends on."""
    text = json.dumps(parts, sort_keys=True, separators=(',', ':'), allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()


class ResultStore:
    """A folder of results by key; each is written whole or not at all, whenever the process is killed."""

    def __init__(self, folder: str | Path) -> None:
        self._folder = Path(folder)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f'cannot make the folder {folder}: {error.strerror}; choose another') from error

    @contextmanager
    def locked(self) -> Iterator[Self]:
        """Hold the store for one process; what a killed one left half-written is cleared away."""
        with open(self._folder / LOCK, 'w') as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise InputError(
                    f'another campaign is writing to {self._folder.parent}: wait for it, or choose another folder',
                    'store-in-use',
                ) from error
            for leftover in self._folder.rglob(LEFTOVERS):
                shutil.rmtree(leftover, ignore_errors=True)
            yield self

    def get(self, key: str) -> Any:
        """The result of a key, or None; one that cannot be read counts as not there."""
        try:
            return json.loads(self._path(key).read_text(encoding='utf-8'))
        except (FileNotFoundError, json.JSONDecodeError, UnicodeDecodeError):
            return None
        except OSError as error:
            raise InputError(f'cannot read {self._path(key)}: {error.strerror}; check the disk') from error

    def put(self, key: str, result: Any) -> None:
        """Keep a result: plain data, which comes back bit by bit the same."""
        path = self._path(key)
        path.parent.mkdir(exist_ok=True)
        write_text(path, json.dumps(result, allow_nan=True))

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f'{key}.json'
