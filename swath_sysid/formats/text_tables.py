"""Tables in text files: named columns of numbers, read when asked for, whatever separates them, however damaged."""

import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, time, timedelta
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import BLOCK_BYTES, replacing, shown

LARGEST_UNPACKED = 1 << 28  #: Numbers, or bytes of text, in one packed file, whatever its own size.

#: ISO 8601, with or without a zone.
ISO_TIME = re.compile(r'"?\d{4}-?\d\d-?\d\d[T ]\d\d:?\d\d(:?\d\d([.,]\d+)?)?(Z|[+-]\d\d(:?\d\d)?)?"?', re.I)

#: How a missing value may be written, beside nan.
MISSING = frozenset(('', '-', '--', 'na', 'n/a', '#n/a', 'null', 'none', 'nat', '?'))

Progress = Callable[[float], None]  #: Takes the share done, 0 to 1.
#: From the places of columns to their values, (columns, N), and advice; dates become seconds since 1970.
Read = Callable[[Sequence[int], Progress | None], tuple[np.ndarray, tuple[Advice, ...]]]


@dataclass(frozen=True)
class NamedColumns:
    """A table of a file: that of a text, a sheet, a group of channels, or the vectors of a struct."""

    names: tuple[str, ...]  #: As written.
    read: Read
    remarks: dict[str, str] = field(default_factory=dict)  #: What the file says beside it, keys in lower case.
    dates: frozenset[int] = frozenset()  #: Places, from 0, of columns of dates with times.
    name: str = ''  #: Of the sheet, group or struct.


def plain_name(name: str) -> str:
    """``Roll rate [deg/s]`` as ``roll_rate_deg_s``."""
    plain = name.lower().replace('°', 'deg').replace('²', '2').replace('µ', 'u').replace('^', '')
    plain = re.sub('[^a-z0-9]+', '_', plain).strip('_')
    return re.sub('_(per|p)_', '_', plain)


def with_unit(name: str, unit: str) -> str:
    """``Roll [deg]``, unless the name says its unit already."""
    known = not plain_name(unit) or f'_{plain_name(name)}'.endswith(f'_{plain_name(unit)}')
    return name if known else f'{name} [{unit}]'


def listed_names(names: Sequence[str]) -> str:
    """The names of columns, fit for one line of a message."""
    listed = ', '.join(shown(name) for name in names[:12])
    return f'{listed} and {len(names) - 12} more' if len(names) > 12 else listed


def known_number(cell: str) -> float:
    """A number, NaN where it is missing."""
    return np.nan if cell.strip().lower() in MISSING else float(cell)


def seconds_of_text(cell: str) -> float:
    """Seconds since 1970 of a date, with or without a zone (UTC then); a number stays."""
    try:
        return known_number(cell)
    except ValueError:
        return _since_1970(datetime.fromisoformat(cell.strip()))


def is_date(cell: Any) -> bool:
    """Whether a cell holds a date with its time."""
    return isinstance(cell, datetime) or isinstance(cell, str) and bool(ISO_TIME.fullmatch(cell.strip()))


def numbers_of(values: Any) -> np.ndarray:
    """Values of any kind as float64, dates as seconds since 1970; NaN for anything else."""
    array = np.asarray(values)
    if array.dtype.kind in 'Mm':
        whole = array.astype(f'{array.dtype.kind}8[ns]').astype(np.int64) / 1e9
        return np.where(np.isnat(array), np.nan, whole)
    if array.dtype.kind in 'biuf':
        return array.astype(float)
    return np.array([_number_of(cell) for cell in array.tolist()], dtype=float)


def of_arrays(columns: Mapping[str, np.ndarray], remarks: Mapping[str, str], name: str) -> NamedColumns:
    """A table of vectors in memory, each (N,)."""
    arrays = list(columns.values())
    return NamedColumns(
        tuple(columns), lambda places, _: (np.stack([arrays[k] for k in places]), ()), dict(remarks), name=name
    )


def check_size(path: str | Path, unpacked: int) -> None:
    """Refuse a file that would unpack to more than a memory holds."""
    if unpacked > LARGEST_UNPACKED:
        raise InputError(
            f'{path} unpacks to {unpacked:.3g} numbers or bytes, more than {LARGEST_UNPACKED:.3g}: save the motion '
            'alone, or cut it'
        )


def by_length(columns: Iterable[tuple[str, np.ndarray]]) -> list[dict[str, np.ndarray]]:
    """Columns of one length together."""
    groups: dict[int, dict[str, np.ndarray]] = {}
    for name, values in columns:
        groups.setdefault(len(values), {})[name] = values
    return list(groups.values())


def _since_1970(moment: datetime) -> float:
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _number_of(cell: Any) -> float:
    try:
        if isinstance(cell, datetime):
            return _since_1970(cell)
        if isinstance(cell, time):
            cell = datetime.combine(datetime.min, cell) - datetime.min
        if isinstance(cell, timedelta):
            return cell.total_seconds()
        return seconds_of_text(cell) if isinstance(cell, str) else float(cell)
    except (TypeError, ValueError):
        return np.nan


COMMENT_MARKS = ('#', '//', '%')  #: A line that begins with one of these is a comment.
UTF16_MARKS = {b'\xff\xfe': 'utf-16-le', b'\xfe\xff': 'utf-16-be'}

TEXT_BYTES = bytes((*b'\t\n\v\f\r', *range(0x20, 0x100)))  #: Bytes that a text may hold.

QUOTED = re.compile(r'"([^"\n]*)"')

Readers = dict[int | str, Callable[[str], float]]  #: Of the cells of columns, by their places.


@dataclass(frozen=True)
class TableHead:
    """What precedes the numbers of a table, and how they are written."""

    names: tuple[str, ...]  #: As written.
    remarks: dict[str, str]  #: ``key: value`` of the comment lines, keys in lower case.
    delimiter: str | None  #: None: any white space.
    decimal_comma: bool  #: Whether numbers are written 0,5 rather than 0.5.
    first_line: int  #: The number of the first line of data, from 1.
    offset: int  #: Where it begins, bytes.
    dates: frozenset[int] = frozenset()  #: Places, from 0, of columns of dates with times.


def read_head(path: str | Path) -> TableHead:
    """What precedes the numbers: names on the first line, or on the last comment (as numpy.savetxt writes them)."""
    with _opened(path) as file:
        head = file.read(BLOCK_BYTES)
    if not head.strip():
        raise InputError(f'{path} is empty: record or export it again')
    if head.translate(None, TEXT_BYTES):
        raise InputError(f'{path} is not a text file in UTF-8 or UTF-16: give a CSV, an MTi text export or a bag')
    lines = head.splitlines(keepends=True)
    first = next((at for at, line in enumerate(lines) if line.strip() and not _is_comment(line)), None)
    if first is None:
        raise InputError(f'{path} holds only comments: give a file with a line of column names and lines of numbers')
    comments = [_text(line).strip() for line in lines[:first] if line.strip()]
    line, names_line = _text(lines[first]).strip(), ''
    if not _is_numbers(line):
        names_line, first = line, first + 1
        line = _text(lines[first]).strip() if first < len(lines) else ''
    elif comments:
        names_line = _without_mark(comments.pop())
    offset = sum(map(len, lines[:first]))
    if offset == BLOCK_BYTES:
        raise InputError(f'{path} has a first line longer than {BLOCK_BYTES} bytes: write one row per sample')
    names = tuple(name.strip().strip('"\'').strip() for name in names_line.split(_delimiter(names_line)))
    if not any(re.search('[A-Za-z]', name) for name in names):
        raise InputError(f"{path} has no line of column names: put one above the numbers, such as 'time_s,roll_deg'")
    delimiter = _delimiter_of_numbers(line, _delimiter(names_line))
    sample = _text(head[offset:])
    _refuse_extra_cells(path, sample, names, delimiter)
    return TableHead(
        names=names,
        remarks=_remarks(comments),
        delimiter=delimiter,
        decimal_comma=delimiter != ',' and _has_decimal_commas(sample, delimiter),
        first_line=first + 1,
        offset=offset,
        dates=frozenset(place for place, cell in enumerate(line.split(delimiter)) if ISO_TIME.fullmatch(cell.strip())),
    )


def read_columns(
    path: str | Path, head: TableHead, indices: Sequence[int], progress: Progress | None = None
) -> tuple[np.ndarray, tuple[Advice, ...]]:
    """Columns by their places from 0, shape (len(indices), N), and advice on text and short rows, which become NaN.
    Dates become seconds since 1970; one without a zone counts as UTC.
    """
    parser = BlockParser(head, tuple(indices))
    with _opened(path) as file:
        size = file.seek(0, io.SEEK_END)
        file.seek(head.offset)
        while block := file.read(BLOCK_BYTES):
            rest = file.readline(BLOCK_BYTES)
            if len(rest) == BLOCK_BYTES:
                raise InputError(f'{path} has a line longer than {BLOCK_BYTES} bytes: write one row per sample')
            parser.parse(block + rest)
            if progress is not None:
                progress(file.tell() / size)
    return parser.columns(), parser.advice()


def write_table(path: str | Path, remarks: Mapping[str, Any], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of shape (N,) that `read_columns` restores exactly; remarks that are None are left out."""
    values = [np.asarray(column, dtype=float) for column in columns.values()]
    with replacing(path) as temporary, open(temporary, 'w', encoding='utf-8') as file:
        file.writelines(f'# {key}: {value}\n' for key, value in remarks.items() if value is not None)
        file.write(','.join(columns) + '\n')
        file.writelines(','.join(map(float.__repr__, row)) + '\n' for row in zip(*values, strict=True))


class BlockParser:
    """Parses a table block by block: fast where it is clean, cell by cell where it is not."""

    def __init__(self, head: TableHead, indices: Sequence[int]) -> None:
        self.head = head
        self.indices = indices
        self.dates: Readers = {index: seconds_of_text for index in indices if index in head.dates}
        self.readers: Readers = {index: self.dates.get(index, known_number) for index in indices}
        self.blocks = [np.empty((len(indices), 0))]
        self.line = head.first_line
        self.text_cells = 0
        self.first_text: tuple[int, str, str] | None = None
        self.short_rows = 0
        self.first_short: int | None = None

    def parse(self, block: bytes) -> None:
        lines = self._plain(block).split('\n')
        try:
            rows = self._parse_fast(lines)
        except ValueError:
            rows = self._parse_cells(lines)
        self.blocks.append(rows.T)
        self.line += len(lines) - (not lines[-1])

    def columns(self) -> np.ndarray:
        return np.concatenate(self.blocks, axis=1)

    def advice(self) -> tuple[Advice, ...]:
        advice = []
        if self.first_text is not None:
            line, column, cell = self.first_text
            advice.append(
                Advice.of('text-in-numbers', number=self.text_cells, cell=shown(cell), line=line, column=shown(column))
            )
        if self.short_rows:
            advice.append(Advice.of('short-rows', number=self.short_rows, line=self.first_short))
        return tuple(advice)

    def _plain(self, block: bytes) -> str:
        text = block.decode('latin-1')
        if '\r' in text:
            text = text.replace('\r\n', '\n').replace('\r', '\n')
        if '"' in text:
            if self.head.delimiter == ',':
                text = QUOTED.sub(lambda cell: cell[1].replace(',', '.'), text)
            text = text.replace('"', '')
        return text.replace(',', '.') if self.head.decimal_comma else text

    def _parse_fast(self, lines: list[str]) -> np.ndarray:
        if not any(map(str.strip, lines)):
            return np.empty((0, len(self.indices)))
        return np.loadtxt(
            lines,
            delimiter=self.head.delimiter,
            usecols=self.indices,
            converters=self.dates or None,
            comments=None,
            ndmin=2,
            encoding='utf-8',
        )

    def _parse_cells(self, lines: Sequence[str]) -> np.ndarray:
        rows = []
        needed = max(self.indices) + 1
        for number, line in enumerate(lines, self.line):
            cells = line.split(self.head.delimiter)
            is_comment = line.lstrip().startswith(COMMENT_MARKS) and cells[0].strip().lower() not in MISSING
            if not line.strip() or is_comment:
                continue
            if len(cells) < needed:
                self.short_rows += 1
                self.first_short = self.first_short or number
                cells += [''] * (needed - len(cells))
            rows.append([self._number(cells[index], number, index) for index in self.indices])
        return np.array(rows, dtype=float).reshape(-1, len(self.indices))

    def _number(self, cell: str, line: int, index: int) -> float:
        try:
            return self.readers[index](cell)
        except ValueError:
            self.text_cells += 1
            self.first_text = self.first_text or (line, self.head.names[index], cell.strip())
            return np.nan


def _opened(path: str | Path) -> BinaryIO:
    """A file of text as UTF-8, whatever it was written in."""
    file = open(path, 'rb')  # noqa: SIM115 - handed on
    start = file.read(64)
    marked = (name for mark, name in UTF16_MARKS.items() if start.startswith(mark))
    encoding = next(marked, _encoding_without_mark(start))
    file.seek(0)
    if encoding is None:
        return file
    with file:
        raw = file.read(LARGEST_UNPACKED + 1)
    if len(raw) > LARGEST_UNPACKED:
        raise InputError(f'{path} is a long text in UTF-16: save it in UTF-8')
    try:
        return io.BytesIO(raw.decode(encoding).removeprefix('\ufeff').encode('utf-8'))
    except (UnicodeDecodeError, UnicodeEncodeError) as error:
        raise InputError(f'{path} is damaged UTF-16 ({error.reason}): save it again, in UTF-8') from error


def _encoding_without_mark(start: bytes) -> str | None:
    """UTF-16 that nothing announces: every other byte of Latin text is zero."""
    if len(start) < 8 or start.count(0) < 0.4 * len(start):
        return None
    if not any(start[0::2]) or not any(start[1::2]):
        return 'utf-16-be' if not any(start[0::2]) else 'utf-16-le'
    return None


def _refuse_extra_cells(path: str | Path, sample: str, names: Sequence[str], delimiter: str | None) -> None:
    """Refuse rows with more cells than names: decimal commas between commas, or columns without a name."""
    if delimiter != ',':
        return
    rows = [line for line in sample.splitlines() if line.strip() and not line.startswith(COMMENT_MARKS)]
    counts = [len(QUOTED.sub('0', row).rstrip(', \t').split(',')) for row in rows]
    most = int(np.median(counts)) if counts else 0
    if most > len(names):
        raise InputError(
            f'{path} has {len(names)} column names and {most} cells a row: if its numbers have decimal '
            f'commas, export it with semicolons between them; else name every column'
        )


def _has_decimal_commas(sample: str, delimiter: str | None) -> bool:
    """Whether a cell holds a comma and none a comma beside a point, as numbers with thousands marked do."""
    cells = [cell for line in sample.splitlines() for cell in line.split(delimiter) if ',' in cell]
    return bool(cells) and not any('.' in cell for cell in cells)


def _text(raw: bytes) -> str:
    try:
        return raw.decode('utf-8-sig')
    except UnicodeDecodeError:
        return raw.decode('latin-1')


def _is_comment(raw: bytes) -> bool:
    return _text(raw).strip().startswith(COMMENT_MARKS)


def _without_mark(line: str) -> str:
    for mark in COMMENT_MARKS:
        if line.startswith(mark):
            return line[len(mark) :].strip()
    return line


def _is_numbers(line: str) -> bool:
    cells = [cell for cell in re.split(r'[;\t ]|,', line.replace('"', '')) if cell]
    return all(re.fullmatch(r'[-+]?[\d.]+([eE][-+]?\d+)?|[-+]?nan|[-+]?inf', cell, re.IGNORECASE) for cell in cells)


def _delimiter(line: str) -> str | None:
    return next((mark for mark in (';', '\t', ',') if mark in line), None)


def _delimiter_of_numbers(line: str, delimiter_of_names: str | None) -> str | None:
    """The delimiter of the names, unless the numbers below use another one."""
    present = line.split(delimiter_of_names)
    return delimiter_of_names if len(present) > 1 or not line else _delimiter(line)


def _remarks(comments: Iterable[str]) -> dict[str, str]:
    pairs = (_without_mark(line).partition(':') for line in comments)
    return {key.strip().lower(): value.strip() for key, colon, value in pairs if colon}
