"""The tables in a file, whatever format it has."""

import re
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import repeat
from pathlib import Path
from struct import Struct

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.cells import OPEN_DATES
from swath_sysid.formats.devices import by_device, long_form
from swath_sysid.formats.files import LONGEST_SHOWN, shown
from swath_sysid.formats.registry import FOREIGN, TANK, TANK_ENDINGS, TankFormat
from swath_sysid.formats.table_heads import Row
from swath_sysid.formats.text_tables import Losses, NamedColumns, Progress, Read, read_columns, read_head

#: A sentence, with the time at which a logger received it.
NMEA = re.compile(rb'^[^$!,\0\n]*[\s,;]?[$!][A-Z]{4,5},', re.MULTILINE)
MATLAB_4, MATLAB_4_BIG = Struct('<5i'), Struct('>5i')


def kind_of(path: str | Path) -> TankFormat | None:
    """The format of a file by its first bytes, None for a text; foreign files are refused."""
    with open(path, 'rb') as file:
        start = file.read(4 * LONGEST_SHOWN)
    if len(start) >= MATLAB_4.size and any(map(_is_matlab_4, (MATLAB_4, MATLAB_4_BIG), repeat(start))):
        return TANK[0]
    for kind in TANK:
        if not start.startswith(kind.start) or kind.start.startswith(b'PK') and not _is_archive_of(path, kind):
            continue
        is_nmea = kind.module == 'nmea' and NMEA.search(start)
        if kind.start or is_nmea or Path(path).suffix.lower() == kind.ending:
            return kind
    for magic, what in FOREIGN.items():
        if start.startswith(magic):
            raise InputError(f'{path} is {what}')
    return None


def tables_in(path: str | Path) -> list[NamedColumns]:
    """Every table of a file, whose numbers are read when they are asked for."""
    kind = kind_of(path)
    if kind is None:
        tables, what = long_form(path), 'a text table'
        if not tables:
            head = read_head(path)
            read = partial(read_columns, path, head)
            tables = [NamedColumns(head.names, read, head.remarks, head.kinds, place=head.place)]
    else:
        what = kind.what
        with _guarded(path, kind):
            tables = import_module(f'swath_sysid.formats.tank.{kind.module}').tables(path)
        if not tables:
            raise InputError(f'{path} is {what} without columns of numbers: save a vector or column for each signal')
        tables = [replace(table, read=partial(_read, path, kind, table.read)) for table in tables]
    tables = [replace(table, place=', '.join(filter(None, (what, table.place)))) for table in tables]
    return [each for table in tables for each in by_device(table)]


def first_rows(path: str | Path) -> list[Row]:
    """The first rows of the sheets of a spreadsheet, those above its tables among them; none of other files."""
    kind = kind_of(path)
    if kind is None or kind.module != 'xlsx':
        return []
    with _guarded(path, kind):
        return import_module('swath_sysid.formats.tank.xlsx').first_rows(path)


def _is_matlab_4(header: Struct, start: bytes) -> bool:
    """Whether a file begins as a variable of MATLAB version 4, which has no magic."""
    kind, rows, columns, imaginary, name = header.unpack_from(start)
    return 0 <= kind < 5000 and kind % 1000 < 60 and min(rows, columns) > 0 and imaginary in (0, 1) and 1 < name < 64


@contextmanager
def known_by_name(path: str | Path) -> Iterator[None]:
    """Around the reading of a file: that a text has the name of another format explains why it is no table."""
    try:
        yield
    except InputError as error:
        if error.code == OPEN_DATES:
            raise InputError(f'{path}: {error}', OPEN_DATES) from error
        if Path(path).suffix.lower() in TANK_ENDINGS and kind_of(path) is None:
            raise InputError(
                f'{path} is named {Path(path).suffix} but is no such file, and no record as text either: copy or '
                'export it again'
            ) from error
        raise


def _read(
    path: str | Path, kind: TankFormat, read: Read, places: Sequence[int], progress: Progress | None
) -> tuple[np.ndarray, Losses]:
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
            return bool(kind.member) and kind.member in archive.namelist()
    except zipfile.BadZipFile:
        return False
