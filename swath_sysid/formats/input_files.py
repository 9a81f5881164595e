"""Files that are read: whether they are there, and what the system refuses, each in one sentence."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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


def shown(value: object) -> str:
    """A value or a text from a file as a message shows it: printable, on one line, at most 80 characters."""
    text = ' '.join(str(value)[: 4 * LONGEST_SHOWN].split())
    text = ''.join(letter if letter.isprintable() else '?' for letter in text)
    return text if len(text) <= LONGEST_SHOWN else f'{text[: LONGEST_SHOWN - 3]}...'
