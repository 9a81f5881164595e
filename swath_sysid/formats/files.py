"""Files that are read and written: what the system refuses, in one sentence, and no half of one for any reader."""

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from swath_sysid.common.conventions import LONGEST
from swath_sysid.common.errors import InputError

LONGEST_SHOWN = 80
BLOCK_BYTES = 1 << 20  #: How much of a file is read at once; a longer line is not a row of a table.


def existing(path: str | Path, named: str = '') -> Path:
    """The path of a file or folder that is there; the error may name it otherwise."""
    # not Path.exists, which raises an error for a name that is too long
    if not os.path.exists(path):
        raise InputError(f'file not found: {named or path}')
    return Path(path)


@contextmanager
def reading(path: str | Path) -> Iterator[None]:
    """Around the reading of a file: what the system refuses becomes an `InputError`."""
    try:
        yield
    except OSError as error:
        raise InputError(f'cannot read {path}: {error.strerror}') from error


def as_utf_8(text: str) -> str:
    """A text that may hold a file name; bytes that are not valid UTF-8 are written as ``\\xe9``."""
    return re.sub('[\udc80-\udcff]', lambda found: f'\\x{ord(found[0]) - 0xDC00:02x}', text)


def shown(value: object) -> str:
    """A value or a text from a file as a message shows it: printable, on one line, at most 80 characters."""
    text = ' '.join(str(value)[: 4 * LONGEST_SHOWN].split())
    text = ''.join(letter if letter.isprintable() else '?' for letter in text)
    return text if len(text) <= LONGEST_SHOWN else f'{text[: LONGEST_SHOWN - 3]}...'


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary name to write a file or folder under, which takes its final name at the end. If the block raises,
    what was at `path` stays. A symbolic link stays one: its target is replaced.
    """
    try:
        path = Path(os.path.realpath(refuse_no_file(path)))
    except ValueError as error:
        raise InputError(f'a file cannot have this name ({error}): choose another') from error
    if path.is_symlink():
        raise InputError(f'{path} is a symbolic link that leads back to itself: choose another name')
    try:
        workshop = Path(tempfile.mkdtemp(prefix='.writing-', dir=path.parent))
    except OSError as error:
        raise InputError(f'cannot write {path}: {error.strerror} ({path.parent}); choose a writable folder') from error
    try:
        temporary = workshop / path.name
        yield temporary
        if temporary.is_file():
            # a rename may outlive a power cut that the content does not
            with open(temporary, 'rb+') as file:
                os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f'cannot write {path}: {error.strerror or error}; choose another place') from error
    finally:
        shutil.rmtree(workshop, ignore_errors=True)


def refuse_no_file(path: str | Path, option: str = '') -> str | Path:
    """The path, unless it names no file, a folder, a device or a pipe."""
    shown = f'{option} {path}'.strip()
    if os.path.isdir(path):
        raise InputError(f'{shown} is a folder that exists already: choose another name, or remove it first')
    if not Path(path).name or str(path).endswith(os.sep):
        raise InputError(f"{option} '{path}' names no file: give one".strip())
    if os.path.exists(path) and not os.path.isfile(path):
        raise InputError(f'{shown} is a device, a pipe or a socket: give the name of a file')
    return path


def write_text(path: str | Path, text: str) -> None:
    """Write a text file in UTF-8, whole or not at all; see `replacing`."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding='utf-8')


def kept_files(path: Path) -> list[Path]:
    """Those that are there, newest first."""
    return [each for each in _numbered(path) if os.path.exists(each)]


def keep_copy(path: Path) -> Path:
    """Copy a file to ``NAME.1``; earlier copies move up by one, the oldest goes. An interruption loses nothing."""
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
    return [path.with_name(f'{path.name}.{number}') for number in range(1, LONGEST + 1)]


def _make_room(path: Path) -> Path:
    names = _numbered(path)
    # from the first gap, which an interruption may have left, so that no file goes before it must
    free = next((number for number, name in enumerate(names) if not os.path.exists(name)), LONGEST - 1)
    for number in range(free, 0, -1):
        os.replace(names[number - 1], names[number])
    return names[0]
