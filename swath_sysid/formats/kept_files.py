"""What a file held before, kept beside it: ``NAME.1`` is the newest of ten."""

import os
import shutil
from pathlib import Path

from swath_sysid.formats.atomic import replacing

KEPT = 10


def kept_files(path: Path) -> list[Path]:
    """Those that are there, newest first."""
    return [each for each in _numbered(path) if os.path.exists(each)]


def keep_copy(path: Path) -> Path:
    """Copy a file to ``NAME.1``; earlier copies move up by one, the tenth goes. An interruption loses nothing."""
    newest = _make_room(path)
    with replacing(newest) as temporary:
        shutil.copy2(path, temporary)
    return newest


def set_aside(path: Path) -> Path:
    """Move a file to ``NAME.1``; see `keep_copy`."""
    newest = _make_room(path)
    os.replace(path, newest)
    return newest


def _numbered(path: Path) -> list[Path]:
    return [path.with_name(f'{path.name}.{number}') for number in range(1, KEPT + 1)]


def _make_room(path: Path) -> Path:
    names = _numbered(path)
    # from the first gap, which an interruption may have left, so that no file goes before it must
    free = next((number for number, name in enumerate(names) if not os.path.exists(name)), KEPT - 1)
    for number in range(free, 0, -1):
        os.replace(names[number - 1], names[number])
    return names[0]
