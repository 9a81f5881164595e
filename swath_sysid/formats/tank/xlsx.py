"""Spreadsheets.

Names of columns are the last row of texts above the numbers, or the last two if the second holds units; the time is a
column, or a number beside ``fs`` above; formulas whose values were not stored are computed from the numbers of their
row; tables are sheets.
"""

import ast
import io
import math
import operator
import re
import zipfile
from collections.abc import Callable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.schema import LONGEST_TEXT
from swath_sysid.formats.table_heads import ROWS_OF_SAMPLE, Located, Row, kind_of_cell, locate
from swath_sysid.formats.text_tables import (
    DATED,
    Losses,
    NamedColumns,
    Progress,
    Read,
    check_size,
    no_names,
    numbers_in,
)

OPERATIONS: dict[type, Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
FUNCTIONS: dict[str, Callable[..., float]] = {
    'PI': lambda: math.pi,
    **{
        name.upper(): getattr(math, name)
        for name in ('degrees', 'radians', 'sqrt', 'sin', 'cos', 'tan', 'asin', 'atan')
    },
}
STRICT, TRANSITIONAL = rb'http://purl\.oclc\.org/ooxml/(\w+)/', rb'http://schemas.openxmlformats.org/\1/2006/'


def tables(path: str | Path) -> list[NamedColumns]:
    """The sheets that hold numbers under names."""
    with zipfile.ZipFile(path) as archive:
        check_size(path, sum(member.file_size for member in archive.infolist()))
    book = _transitional(path)
    found = [_table(path, book, title) for title in _titles(book)]
    return [table for table in found if table is not None]


def first_rows(path: str | Path) -> list[Row]:
    """The first rows of all sheets."""
    book = _transitional(path)
    return [row for title in _titles(book) for row in islice(_rows(book, title, (True,)), ROWS_OF_SAMPLE)]


Book = str | Path | io.BytesIO  #: As openpyxl opens it, more than once at a time.


def _titles(book: Book) -> list[str]:
    from openpyxl import load_workbook

    opened = load_workbook(book, read_only=True)
    titles = [sheet.title for sheet in opened.worksheets]
    opened.close()
    return titles


def _transitional(path: str | Path) -> Book:
    """The file, or, if it is in strict Open XML, a copy with the names of the form that openpyxl reads."""
    with zipfile.ZipFile(path) as archive:
        if not re.search(STRICT, archive.read('xl/workbook.xml')):
            return path
        copy = io.BytesIO()
        with zipfile.ZipFile(copy, 'w') as written:
            for name in archive.namelist():
                written.writestr(name, re.sub(STRICT, TRANSITIONAL, archive.read(name)))
    return copy


def _table(path: str | Path, book: Book, title: str) -> NamedColumns | None:
    written = islice(_rows(book, title, (False,)), ROWS_OF_SAMPLE)
    books = (True, False) if any(map(_is_formula, chain.from_iterable(written))) else (True,)
    above = list(islice(_rows(book, title, books), ROWS_OF_SAMPLE))
    width = max(map(len, above), default=0)
    above = [(*row, *[None] * (width - len(row))) for row in above]
    found = locate(above)
    if found is None:
        return None
    if not found.names:
        raise no_names(path, [str(cell) for cell in above[found.first] if cell is not None])
    remarks = {}
    for cells in (
        [cell for cell in above[at] if cell is not None] for at in range(found.first) if at not in found.used
    ):
        key, colon, value = str(cells[0] if cells else '').lstrip('#% ').partition(':')
        remarks[key.strip().lower()] = value.strip() if colon and value.strip() else str(cells[1]) if cells[1:] else ''
    kinds = {place: kind_of_cell(cell) for place, cell in enumerate(above[found.first])}
    kinds = {place: kind for place, kind in kinds.items() if kind in DATED}
    place = f'names in row {found.used[0] + 1}' if found.used[0] else ''
    return NamedColumns(found.names, _reader(path, book, title, found, books), remarks, kinds, title, place)


def _rows(source: Book, title: str, books: Sequence[bool]) -> Iterator[Row]:
    """The rows of a sheet: the values that are stored, what was written, or both in one."""
    from openpyxl import load_workbook

    opened = [load_workbook(source, read_only=True, data_only=stored) for stored in books]
    try:
        for book in opened:
            # many exporters write a wrong dimension, by which rows and columns would be cut
            book[title].reset_dimensions()
        for first, *others in zip(*(book[title].iter_rows(values_only=True) for book in opened), strict=True):
            for row in others:
                first = [
                    _computed(cell, row) if known is None else known for known, cell in zip(first, row, strict=True)
                ]
            yield first
    finally:
        for book in opened:
            book.close()


def _is_formula(cell: Any) -> bool:
    return isinstance(cell, str) and cell.startswith('=')


def _computed(cell: Any, row: Row) -> Any:
    """The value of a formula of numbers and cells of its row; None where it holds anything else."""
    if not _is_formula(cell):
        return cell
    try:
        return float(_value(ast.parse(cell[1:LONGEST_TEXT].replace('^', '**').replace('$', ''), mode='eval').body, row))
    except (ArithmeticError, KeyError, IndexError, RecursionError, SyntaxError, TypeError, ValueError):
        return None


def _value(node: ast.AST, row: Row) -> float:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.UnaryOp(op=sign, operand=part):
            return OPERATIONS[type(sign)](_value(part, row))
        case ast.BinOp(left=left, op=sign, right=right):
            return OPERATIONS[type(sign)](_value(left, row), _value(right, row))
        case ast.Call(func=ast.Name(id=name), args=parts):
            return FUNCTIONS[name.upper()](*(_value(part, row) for part in parts))
        case ast.Name(id=name):
            letters = name.rstrip('0123456789').upper()
            place = sum(26**power * (ord(letter) - 64) for power, letter in enumerate(reversed(letters))) - 1
            return float(_computed(row[place], row))
    raise ValueError


def _reader(path: str | Path, book: Book, title: str, found: Located, books: Sequence[bool]) -> Read:
    def read(places: Sequence[int], progress: Progress | None) -> tuple[np.ndarray, Losses]:
        rows, lines = [], []
        for line, row in enumerate(islice(_rows(book, title, books), found.first, None), found.first + 1):
            if any(cell is not None for cell in row):
                rows.append([row[place] if place < len(row) else None for place in places])
                lines.append(line)
            if progress is not None:
                progress(len(rows) / (len(rows) + ROWS_OF_SAMPLE))
        names = [found.names[place] for place in places]
        values, losses = numbers_in(names, [np.array(cells, dtype=object) for cells in zip(*rows, strict=True)], lines)
        empty = next((place for place, row in zip(places, values, strict=True) if not np.isfinite(row).any()), None)
        if empty is not None and len(books) > 1:
            raise InputError(
                f"{path}: the formulas of '{shown(found.names[empty])}' have no stored values: open the file in a "
                'spreadsheet program and save it there'
            )
        return values, losses

    return read
