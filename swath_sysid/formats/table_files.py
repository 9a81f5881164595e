"""The tables in a file, whatever format it has."""

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.registry import FOREIGN, TANK, TANK_ENDINGS, TankFormat
from swath_sysid.formats.text_tables import NamedColumns, Progress, Read, read_columns, read_head


def kind_of(path: str | Path) -> TankFormat | None:
    """The format of a file by its first bytes, None for a text; foreign files are refused."""
    with open(path, 'rb') as file:
        start = file.read(16)
    for kind in TANK:
        if start.startswith(kind.start) and (not kind.member or _is_archive_of(path, kind)):
            return kind
    for magic, what in FOREIGN.items():
        if start.startswith(magic):
            raise InputError(f'{path} is {what}')
    return None


def tables_in(path: str | Path) -> list[NamedColumns]:
    """Every table of a file, whose numbers are read when they are asked for."""
    kind = kind_of(path)
    if kind is None:
        head = read_head(path)
        return [NamedColumns(head.names, partial(read_columns, path, head), head.remarks, head.dates)]
    with _guarded(path, kind):
        tables = import_module(f'swath_sysid.formats.tank.{kind.module}').tables(path)
    if not tables:
        raise InputError(f'{path} is {kind.what} without columns of numbers: save a vector or column for each signal')
    return [replace(table, read=partial(_read, path, kind, table.read)) for table in tables]


@contextmanager
def known_by_name(path: str | Path) -> Iterator[None]:
    """Around the reading of a file: that a text has the name of another format explains why it is no table."""
    try:
        yield
    except InputError as error:
        if Path(path).suffix.lower() in TANK_ENDINGS and kind_of(path) is None:
            raise InputError(
                f'{path} is named {Path(path).suffix} but is no such file, and no record as text either: copy or '
                'export it again'
            ) from error
        raise


def _read(
    path: str | Path, kind: TankFormat, read: Read, places: Sequence[int], progress: Progress | None
) -> tuple[np.ndarray, tuple[Advice, ...]]:
    with _guarded(path, kind):
        return read(places, progress)


@contextmanager
def _guarded(path: str | Path, kind: TankFormat) -> Iterator[None]:
    """Whatever a library raises over a file becomes one sentence."""
    try:
        yield
    except InputError:
        raise
    except ImportError as error:
        raise InputError(
            f'{path} is {kind.what}, and {kind.library}, which reads it, is not installed: pip install {kind.library}'
        ) from error
    except Exception as error:  # libraries raise anything over a damaged file
        raise InputError(f'{path} is {kind.what} that is damaged ({shown(error)}): copy or export it again') from error


def _is_archive_of(path: str | Path, kind: TankFormat) -> bool:
    if Path(path).suffix.lower() == kind.ending:
        return True
    try:
        with zipfile.ZipFile(path) as archive:
            return kind.member in archive.namelist()
    except zipfile.BadZipFile:
        return False
