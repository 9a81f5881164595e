"""Spreadsheets.

Names of columns are the last row of texts above the numbers, or the last two if the second holds units; the time is a
column, or a number beside ``fs`` above; tables are sheets.
"""

import zipfile
from collections.abc import Sequence
from datetime import datetime, time, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.formats.columns import UNITS
from swath_sysid.formats.text_tables import (
    NamedColumns,
    Progress,
    Read,
    check_size,
    is_date,
    numbers_of,
    plain_name,
    with_unit,
)


def tables(path: str | Path) -> list[NamedColumns]:
    """The sheets that hold numbers under names."""
    from openpyxl import load_workbook

    with zipfile.ZipFile(path) as archive:
        check_size(path, sum(member.file_size for member in archive.infolist()))
    book = load_workbook(path, read_only=True, data_only=True)
    found = [_table(path, sheet) for sheet in book.worksheets]
    book.close()
    return [table for table in found if table is not None]


def _table(path: str | Path, sheet: Any) -> NamedColumns | None:
    above: list[tuple] = []
    for row in sheet.iter_rows(values_only=True):
        if sum(map(_is_number, row)) > sum(map(_is_text, row)):
            break
        above.append(row)
    else:
        return None
    at = next((k for k in reversed(range(len(above))) if _texts(above[k])), None)
    if at is None:
        return None
    names = [str(cell or '') for cell in above[at]]
    # a unit that is not known may belong to a column that is not read; a title has fewer cells
    filled = [sum(bool(cell) for cell in line) for line in (above[at - 1], names)]
    if at and filled[0] >= filled[1] and any(unit and plain_name(unit) in UNITS for unit in names):
        names = [with_unit(str(name or ''), unit) for name, unit in zip(above[at - 1], names, strict=False)]
    remarks = {}
    for cells in ([cell for cell in line if cell is not None] for line in above[:at]):
        key, colon, value = str(cells[0] if cells else '').lstrip('#% ').partition(':')
        remarks[key.strip().lower()] = value.strip() if colon and value.strip() else str(cells[1]) if cells[1:] else ''
    dates = frozenset(place for place, cell in enumerate(row) if is_date(cell))
    return NamedColumns(tuple(names), _reader(path, sheet.title, len(above) + 1), remarks, dates, sheet.title)


def _is_number(cell: Any) -> bool:
    return isinstance(cell, int | float | time | timedelta | datetime) or is_date(cell)


def _is_text(cell: Any) -> bool:
    return isinstance(cell, str) and not is_date(cell)


def _texts(row: Sequence[Any]) -> bool:
    cells = [cell for cell in row if cell is not None]
    return bool(cells) and all(map(_is_text, cells))


def _reader(path: str | Path, title: str, first: int) -> Read:
    def read(places: Sequence[int], progress: Progress | None) -> tuple[np.ndarray, tuple[()]]:
        from openpyxl import load_workbook

        book = load_workbook(path, read_only=True, data_only=True)
        rows = []
        for count, row in enumerate(book[title].iter_rows(min_row=first, values_only=True)):
            if any(cell is not None for cell in row):
                rows.append([row[place] if place < len(row) else None for place in places])
            if progress is not None:
                progress(min(1.0, count / (book[title].max_row or np.inf)))
        book.close()
        return np.stack([numbers_of(np.array(column, dtype=object)) for column in zip(*rows, strict=True)]), ()

    return read
