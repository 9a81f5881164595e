"""Zip archives of tables, as phones export them.

Columns and time are those of each CSV file in it; tables are files, and that with the attitude is read.
"""

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory

import numpy as np

from swath_sysid.common.account import Loss
from swath_sysid.common.errors import InputError
from swath_sysid.formats.table_files import tables_in
from swath_sysid.formats.text_tables import Losses, NamedColumns, Progress, check_size, with_losses
from swath_sysid.formats.vocabulary import listed_names


def tables(path: str | Path) -> list[NamedColumns]:
    """Those of every file; files that are none are left out where another is one."""
    with zipfile.ZipFile(path) as archive:
        members = [each for each in archive.infolist() if each.filename.lower().endswith(('.csv', '.txt', '.tsv'))]
    check_size(path, sum(member.file_size for member in members))
    found, problems = [], {}
    for name in (member.filename for member in members):
        try:
            with _unpacked(path, name) as file:
                inner = tables_in(file)
        except InputError as error:
            problems[name] = error
            continue
        own = PurePosixPath(name).with_suffix('')
        found += [
            replace(each, name='/'.join(filter(None, (str(own), each.name))), read=partial(_read, path, name, place))
            for place, each in enumerate(inner)
        ]
    if not found:
        raise next(iter(problems.values()), InputError(f'{path} is a zip archive without a CSV file: unpack it'))
    losses = (Loss('files-left-out', said={'files': listed_names(list(problems))}),) if problems else ()
    return [with_losses(table, losses) for table in found]


@contextmanager
def _unpacked(path: str | Path, name: str) -> Iterator[Path]:
    """A file of an archive under a temporary name, which no sentence shows."""
    with TemporaryDirectory() as folder, zipfile.ZipFile(path) as archive:
        file = Path(folder, 'table.csv')
        file.write_bytes(archive.read(name))
        try:
            yield file
        except InputError as error:
            raise InputError(str(error).replace(str(file), f'{path}/{name}'), error.code) from error


def _read(
    path: str | Path, name: str, place: int, places: Sequence[int], progress: Progress | None
) -> tuple[np.ndarray, Losses]:
    with _unpacked(path, name) as file:
        return tables_in(file)[place].read(places, progress)
