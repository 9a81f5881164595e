"""Tables in text files: named columns of numbers, read when asked for, whatever separates them, however damaged."""

import io
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from swath_sysid.common.account import Loss
from swath_sysid.common.conventions import LOST_SHARE
from swath_sysid.common.errors import InputError
from swath_sysid.formats.cells import (
    DAY_FIRST,
    GROUPED,
    MISSING,
    known_number,
    marks_of,
    numbers_of,
    order_of_dates,
    plain_text,
    seconds_of_text,
)
from swath_sysid.formats.files import BLOCK_BYTES, replacing, shown
from swath_sysid.formats.table_heads import ROWS_OF_SAMPLE, Located, balance, kind_of_cell, locate
from swath_sysid.formats.vocabulary import DEVICE_NAMES, INTERVALS, RATES, UNIT_IN_BRACKETS, VALUE_NAMES, plain_name

LARGEST_UNPACKED = 1 << 28  #: Numbers, or bytes of text, in one packed file, whatever its own size.

Progress = Callable[[float], None]  #: Takes the share done, 0 to 1.
Losses = tuple[Loss, ...]
Labels = dict[str, int]  #: Numbers of the devices that a column names.
#: From the places of columns to their values, (columns, N), and what is lost of them; dates become seconds since 1970.
Read = Callable[[Sequence[int], Progress | None], tuple[np.ndarray, Losses]]


@dataclass(frozen=True)
class Devices(Loss):
    """The devices that a column names, in the order of their numbers; nothing is lost with them."""

    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class NamedColumns:
    """A table of a file: that of a text, a sheet, a group of channels, or the vectors of a struct."""

    names: tuple[str, ...]  #: As written.
    read: Read
    remarks: dict[str, str] = field(default_factory=dict)  #: What the file says beside it, keys in lower case.
    kinds: Mapping[int, str] = field(
        default_factory=dict
    )  #: ``date``, ``day`` or ``clock`` of columns, by place from 0.
    name: str = ''  #: Of the sheet, group or struct.
    place: str = ''  #: Where it was found and how it is written, where that is unusual.


def of_arrays(
    columns: Mapping[str, np.ndarray],
    remarks: Mapping[str, str],
    name: str,
    losses: Losses = (),
    lines: Sequence[int] = range(1, LARGEST_UNPACKED),
) -> NamedColumns:
    """A table of vectors in memory, each (N,), of numbers or of texts that hold some, which stand in those lines."""
    names, arrays = tuple(columns), list(columns.values())

    def read(places: Sequence[int], _: Progress | None) -> tuple[np.ndarray, Losses]:
        values, found = numbers_in([names[k] for k in places], [arrays[k] for k in places], lines)
        return values, (*found, *losses)

    kinds = {k: kind_of_cell(each[0]) for k, each in enumerate(arrays) if each.dtype.kind in 'OUS'}
    return NamedColumns(names, read, dict(remarks), {k: kind for k, kind in kinds.items() if kind in DATED}, name)


def with_losses(table: NamedColumns, losses: Losses) -> NamedColumns:
    """A table whose reading has further losses."""

    def read(places: Sequence[int], progress: Progress | None) -> tuple[np.ndarray, Losses]:
        values, found = table.read(places, progress)
        return values, (*found, *losses)

    return replace(table, read=read)


def damage(said: str, **where: object) -> Losses:
    """What a library says of the parts of a file that it passes over; nothing where it is silent."""
    return (Loss('damaged-bag', said={'reason': said, **where}),) if said.strip() else ()


def numbers_in(
    names: Sequence[str], columns: Sequence[Any], lines: Sequence[int] = range(1, LARGEST_UNPACKED)
) -> tuple[np.ndarray, Losses]:
    """Columns of cells of any kind as numbers, and the texts among them, by the lines of the rows."""
    labels: Labels = {}
    is_label = [plain_name(name) in DEVICE_NAMES for name in names]
    values = np.stack(
        [
            [labelled(labels, cell) for cell in cells] if label else numbers_of(cells)
            for label, cells in zip(is_label, columns, strict=True)
        ]
    )
    losses = [*labels_of(labels)]
    for name, cells, row in zip(names, columns, values, strict=True):
        if np.asarray(cells).dtype.kind in 'OUS':
            texts = [at for at in np.flatnonzero(np.isnan(row)).tolist() if kind_of_cell(cells[at]) == 'text']
            known = int(np.count_nonzero(np.isfinite(row)))
            losses += [texts_lost(name, len(texts), known, lines[at], str(cells[at])) for at in texts[:1]]
    return values, tuple(losses)


def labelled(labels: Labels, cell: Any) -> float:
    """The number of the device that a cell names, from zero."""
    return labels.setdefault(str(cell).strip(), len(labels))


def labels_of(labels: Labels) -> Losses:
    """The names of the devices, if a column names any."""
    return (Devices('devices', of=1, names=tuple(labels)),) if labels else ()


def texts_lost(name: str, number: int, known: int, line: int, cell: str) -> Loss:
    """How many cells of a column are not numbers, how many are, and the line and text of the first that is not."""
    said = {'cell': shown(cell), 'line': line, 'column': shown(name)}
    return Loss('text-in-numbers', number, number + known, f"cells of '{shown(name)}'", said)


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


DATED = ('date', 'day', 'clock')  #: Kinds of cells that tell a time.
COMMENT_MARKS = ('#', '//', '%')  #: A line that begins with one of these is a comment.
UTF16_MARKS = {b'\xff\xfe': 'utf-16-le', b'\xfe\xff': 'utf-16-be'}

TEXT_BYTES = bytes((*b'\t\n\v\f\r', *range(0x20, 0x100)))  #: Bytes that a text may hold.

BREAK = re.compile(r'[\r\n]+')
OPEN = re.compile(rb'(^(\xef\xbb\xbf)?|[,;\t|])"[^"]*[\r\n]$')  #: A quote that its line does not end.
QUOTED = re.compile(r'"([^"\n]*)"')
WIDE, BEFORE_UNIT = re.compile(r'\s\s+|\t'), re.compile(r'\s+(?=[\[(])')  #: Beside names of several words.
#: Signs and blanks as word processors write them, in UTF-8 or a code page of one byte.
OTHER_MARKS = (
    (re.compile(rb'\xe2\x88\x92|\xe2\x80\x93|(?<![\x80-\xff])\x96(?=[\d.,])'), b'-'),
    (re.compile(rb'\xc2\xa0|\xe2\x80\xaf|(?<![\x80-\xff])\xa0'), b' '),
    (re.compile(rb'\xe2\x80\x99'), b"'"),
)

Readers = dict[int | str, Callable[[str], float]]  #: Of the cells of columns, by their places.


@dataclass(frozen=True)
class TableHead:
    """What precedes the numbers of a table, and how they are written."""

    names: tuple[str, ...]  #: As written, with units of a line of their own.
    remarks: dict[str, str]  #: ``key: value`` of the comment lines, keys in lower case.
    delimiter: str | None  #: None: any white space.
    decimal_comma: bool  #: Whether numbers are written 0,5 rather than 0.5.
    first_line: int  #: The number of the first line of data, from 1.
    offset: int  #: Where it begins, bytes.
    kinds: Mapping[int, str] = field(default_factory=dict)  #: Those of `NamedColumns`.
    thousands: str = ''  #: What stands between groups of three digits.
    path: str = ''
    names_line: int = 1  #: From 1.

    @property
    def place(self) -> str:
        """Where the table is and how it is written, unless it is a CSV file from its first line on."""
        marks = {';': 'semicolons', '\t': 'tabs', '|': 'bars', None: 'blanks'}
        said = [f'names in line {self.names_line}'] * (self.names_line > 1)
        said += [f'{marks[self.delimiter]} between columns' for _ in marks.keys() & {self.delimiter}]
        return ', '.join([*said, *['decimal commas'] * self.decimal_comma])


def read_head(path: str | Path) -> TableHead:
    """What precedes the numbers: the table is where the most numbers are; the names are above it, or in the last
    comments (as numpy.savetxt writes them).
    """
    with _opened(path) as file:
        head = file.read(BLOCK_BYTES)
    if not head.strip(b'\0 \t\r\n'):
        raise InputError(f'{path} is empty: record or export it again')
    if head.translate(None, TEXT_BYTES + b'\0') or b'\0' in head[:64]:
        raise InputError(f'{path} is not a text file in UTF-8 or UTF-16: give a CSV, an MTi text export or a bag')
    raw = _lines(head)
    lines = [BREAK.sub(' ', _text(line).strip(' \r\n\0')) for line in raw]
    if all(not line or _is_comment(line) for line in lines):
        raise InputError(f'{path} holds only comments: give a file with a line of column names and lines of numbers')
    found, delimiter, rows = _located(lines)
    offset = sum(map(len, raw[: found.first]))
    if offset == BLOCK_BYTES:
        raise InputError(f'{path} has a first line longer than {BLOCK_BYTES} bytes: write one row per sample')
    names, kinds = _with_clocks(found.names, [row for row in rows[found.first :] if any(row)])
    if not any(re.search(r'[^\W\d_]', name) for name in names):
        raise no_names(path, rows[found.first] if found.first < len(rows) else names)
    _refuse_extra_cells(path, lines[found.first :][:ROWS_OF_SAMPLE], names, delimiter)
    above = [line for at, line in enumerate(lines[: found.first]) if line and at not in found.used]
    decimal_comma, thousands = (False, '') if delimiter == ',' else _marks_in(lines[found.first :], delimiter)
    return TableHead(
        names=names,
        remarks=_remarks(above),
        delimiter=delimiter,
        decimal_comma=decimal_comma,
        first_line=1 + sum(len(line.splitlines()) for line in raw[: found.first]),
        offset=offset,
        kinds=kinds,
        thousands=thousands,
        path=str(path),
        names_line=found.used[0] + 1 if found.used else 1,
    )


def no_names(path: str | Path, cells: Sequence[str]) -> InputError:
    """Why a table without names is not read."""
    return InputError(
        f"{path} has no line of column names: put one above the numbers, such as 'time_s,roll_deg'; its first row is "
        f'{shown(", ".join(cells))}'
    )


def _lines(head: bytes) -> list[bytes]:
    """Lines with their ends; a break between the quotes around a name ends none."""
    lines: list[bytes] = []
    for line in head.splitlines(keepends=True):
        if 0 < len(lines) < ROWS_OF_SAMPLE and OPEN.search(lines[-1]) and len(lines[-1]) < ROWS_OF_SAMPLE:
            lines[-1] += line
        else:
            lines.append(line)
    return lines


def read_long_head(path: str | Path) -> TableHead | None:
    """What precedes the rows of a table with one value in each, by the name of that column; None of other tables."""
    with _opened(path) as file:
        raw = file.read(BLOCK_BYTES >> 5).splitlines(keepends=True)
    lines = [_text(line).strip(' \r\n\0') for line in raw]
    for at, line in enumerate(lines[:-1]):
        for mark in (';', '\t', '|', ','):
            names = tuple(_split(line, mark))
            if len(names) < 3 or sum(plain_name(name) in VALUE_NAMES for name in names) != 1:
                continue
            rows = [cells for each in lines[at + 1 :] if len(cells := _split(each, mark)) == len(names)]
            if len(rows) < 2:
                continue
            kinds = _with_clocks(names, [cells for cells in rows if tuple(cells) != names])[1]
            marks = (False, '') if mark == ',' else _marks_in(lines[at + 1 :], mark)
            offset = sum(map(len, raw[: at + 1]))
            return TableHead(names, {}, mark, marks[0], at + 2, offset, kinds, marks[1], str(path), at + 1)
    return None


def read_columns(
    path: str | Path, head: TableHead, indices: Sequence[int], progress: Progress | None = None
) -> tuple[np.ndarray, Losses]:
    """Columns by their places from 0, shape (len(indices), N), with NaN for text and in short rows, and what is lost.
    Dates become seconds since 1970; one without a zone counts as UTC.
    """
    order, dated = DAY_FIRST, [index for index in indices if index in head.kinds]
    if any(head.kinds[index] != 'clock' for index in dated):
        order = order_of_dates(' '.join(cells[at] for at in dated if at < len(cells)) for cells in rows_of(path, head))
    with _opened(path) as file:
        parser = BlockParser(head, tuple(indices), order)
        size = file.seek(0, io.SEEK_END)
        file.seek(head.offset)
        while block := file.read(BLOCK_BYTES):
            rest = file.readline(BLOCK_BYTES)
            if len(rest) == BLOCK_BYTES and rest.strip(b'\0'):
                raise InputError(f'{path} has a line longer than {BLOCK_BYTES} bytes: write one row per sample')
            parser.parse(block + rest)
            if progress is not None:
                progress(file.tell() / size)
    return parser.columns(), parser.losses()


def rows_of(path: str | Path, head: TableHead) -> Iterator[list[str]]:
    """The cells of each row, as text with decimal points."""
    parser = BlockParser(head, ())
    with _opened(path) as file:
        file.seek(head.offset)
        while block := file.read(BLOCK_BYTES):
            for line in parser.plain(block + file.readline(BLOCK_BYTES)).split('\n'):
                if line.strip() and not _is_comment(line):
                    yield _split(line, head.delimiter)


def write_table(path: str | Path, remarks: Mapping[str, Any], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of shape (N,) that `read_columns` restores exactly; remarks that are None are left out."""
    values = [np.asarray(column, dtype=float) for column in columns.values()]
    with replacing(path) as temporary, open(temporary, 'w', encoding='utf-8') as file:
        file.writelines(f'# {key}: {value}\n' for key, value in remarks.items() if value is not None)
        file.write(','.join(columns) + '\n')
        file.writelines(','.join(map(float.__repr__, row)) + '\n' for row in zip(*values, strict=True))


class BlockParser:
    """Parses a table block by block: fast where it is clean, cell by cell where it is not."""

    def __init__(self, head: TableHead, indices: Sequence[int], order: str = DAY_FIRST) -> None:
        self.head = head
        self.indices = indices
        seconds = partial(seconds_of_text, order=order)
        self.labels: Labels = {}
        self.converters: Readers = {index: seconds for index in indices if index in head.kinds}
        self.converters |= {
            index: partial(labelled, self.labels) for index in indices if plain_name(head.names[index]) in DEVICE_NAMES
        }
        self.readers: Readers = {index: self.converters.get(index, known_number) for index in indices}
        self.blocks = [np.empty((len(indices), 0))]
        self.line = head.first_line
        self.widest = 0  #: Cells of a row, as most have them or as there are names.
        self.wide: list[tuple[int, int]] = []  #: Row from 0 and line of those with more cells.
        self.text_cells: dict[int, list[tuple[int, str]]] = {}  #: Line and cell, by place.
        self.short: list[int] = []  #: Lines.
        self.zeros = 0

    def parse(self, block: bytes) -> None:
        if b'\0' in block:
            self.zeros += block.count(b'\0')
            # with the line that was being written
            block = b'\n'.join(b'' if b'\0' in line else line for line in block.split(b'\n'))
        lines = self.plain(block).split('\n')
        widths = [len(line.split(self.head.delimiter)) for line in lines]
        self.widest = self.widest or max(len(self.head.names), Counter(widths).most_common(1)[0][0])
        try:
            rows = self._parse_fast(lines) if max(widths) <= self.widest else self._parse_cells(lines)
        except ValueError:
            rows = self._parse_cells(lines)
        self.blocks.append(rows.T)
        self.line += len(lines) - (not lines[-1])

    def columns(self) -> np.ndarray:
        values = np.concatenate(self.blocks, axis=1)
        return np.delete(values, [row for row, _ in self._joined()], axis=1)

    def losses(self) -> Losses:
        """What is not in the columns."""
        losses = [*labels_of(self.labels)]
        for index, cells in sorted(self.text_cells.items(), key=lambda each: each[1]):
            place = self.indices.index(index)
            known = sum(int(np.count_nonzero(np.isfinite(block[place]))) for block in self.blocks)
            losses.append(texts_lost(self.head.names[index], len(cells), known, *cells[0]))
        for code, lines in (('rows-of-other-width', [line for _, line in self._joined()]), ('short-rows', self.short)):
            losses += [Loss(code, len(lines), said={'line': line}) for line in lines[:1]]
        return (*losses, *[Loss('zero-bytes', self.zeros)] * (self.zeros > 0))

    def _joined(self) -> list[tuple[int, int]]:
        """The rows with more cells than others, as of two lines in one; where they are no exception, none."""
        is_rare = len(self.wide) <= LOST_SHARE * sum(block.shape[1] for block in self.blocks)
        return self.wide if is_rare else []

    def plain(self, block: bytes) -> str:
        """A block as text, its numbers with decimal points."""
        if not block.isascii():
            for form, mark in OTHER_MARKS:
                block = form.sub(mark, block)
        text = block.decode('latin-1')
        if '\r' in text:
            text = text.replace('\r\n', '\n').replace('\r', '\n')
        if '"' in text:
            if between := self.head.delimiter:
                text = QUOTED.sub(lambda cell: cell[1].replace(between, '.'), text)
            text = text.replace('"', '')
        return plain_text(text, self.head.decimal_comma, self.head.thousands)

    def _parse_fast(self, lines: list[str]) -> np.ndarray:
        if not any(map(str.strip, lines)):
            return np.empty((0, len(self.indices)))
        return np.loadtxt(
            lines,
            delimiter=self.head.delimiter,
            usecols=self.indices,
            converters=self.converters or None,
            comments=None,
            ndmin=2,
            encoding='utf-8',
        )

    def _parse_cells(self, lines: Sequence[str]) -> np.ndarray:
        rows: list[list[float]] = []
        needed, read = max(self.indices) + 1, sum(block.shape[1] for block in self.blocks)
        for number, line in enumerate(lines, self.line):
            cells = line.split(self.head.delimiter)
            is_comment = line.lstrip().startswith(COMMENT_MARKS) and cells[0].strip().lower() not in MISSING
            if not line.strip() or is_comment:
                continue
            width = len(cells)
            cells += [''] * (needed - width)
            own = [cells[index].strip() for index in self.indices]
            if self._is_header(own, number):
                continue
            values, texts = [], []
            for index, cell in zip(self.indices, own, strict=True):
                try:
                    values.append(self.readers[index](cell))
                except ValueError:
                    values.append(np.nan)
                    texts.append((index, cell))
            if texts and texts[0][1] == own[0] and (len(texts) > 1 or width < needed):
                values = [np.nan] * len(own)  # without a time and in a form of its own: of another device
            else:
                for index, cell in texts:
                    self.text_cells.setdefault(index, []).append((number, cell))
                if width < needed and any(own):
                    self.short.append(number)
                elif width > self.widest:
                    self.wide.append((read + len(rows), number))
            rows.append(values)
        return np.array(rows, dtype=float).reshape(-1, len(self.indices))

    def _is_header(self, cells: Sequence[str], line: int) -> bool:
        """Whether a row repeats the names; where they stand at other places the table is refused."""
        names = [UNIT_IN_BRACKETS.sub('', name) for name in self.head.names]
        said = [UNIT_IN_BRACKETS.sub('', cell) for cell in cells]
        if sum(name in names for name in said) < 2:
            return False
        if said != [names[index] for index in self.indices]:
            raise InputError(f'{self.head.path} has other columns from line {line} on: split it there')
        return True


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


def _located(lines: Sequence[str]) -> tuple[Located, str | None, list[list[str]]]:
    """The table in the first lines of a file, the mark between its columns, and the cells of the lines."""
    for size in (BLOCK_BYTES >> 5, BLOCK_BYTES):
        ends = accumulate(len(line) + 1 for line in lines)
        sample = [line for line, end in zip(lines, ends, strict=True) if end <= size] or list(lines[:2])
        delimiter = _delimiter_of_numbers(sample)
        rows = [[] if _is_comment(line) else _cells(line, delimiter) for line in sample]
        comments = [_cells(_without_mark(line), delimiter) if _is_comment(line) else None for line in sample]
        found = locate(rows, comments)
        if found is not None and delimiter is None and len(found.names) not in (widths := _widths(rows[found.first])):
            # names of several words, or with a unit behind a blank
            for at, line in enumerate(sample[: found.first]):
                ways = (WIDE.split(line), BEFORE_UNIT.sub('', line).split())
                rows[at] = next((cells for cells in ways if len(cells) in widths), rows[at])
            found = locate(rows, comments)
        if found is not None and found.names:
            return found, delimiter, rows
    at = next(at for at, line in enumerate(lines) if line and not _is_comment(line))
    if found is not None and found.first == at:
        return found, delimiter, rows
    names = tuple(_cells(lines[at], _delimiter(lines[at])))
    return Located(names, at + 1, (at,)), _delimiter(lines[at]), []


def _widths(row: Sequence[str]) -> set[int]:
    """How many names a row may have: one for a date and its clock time, if a blank separates these."""
    kinds = [kind_of_cell(cell) for cell in row]
    return {len(row), len(row) - (('day', 'clock') in pairwise(kinds))}


def _delimiter_of_numbers(lines: Sequence[str]) -> str | None:
    """The mark that leaves the most values and the fewest texts in the last lines."""
    last = [line for line in lines if line.strip(' ;\t|,') and not _is_comment(line)][-ROWS_OF_SAMPLE // 8 :]
    balances = {mark: [_balance(line, mark) for line in last] for mark in (';', '\t', '|', ',', None)}
    clean = {mark: [values > 1 and not texts for values, texts in found] for mark, found in balances.items() if mark}
    sure = next((mark for mark, lines in clean.items() if sum(lines) > 0.9 * len(lines)), None)
    gains = {mark: [(values - texts, values) for values, texts in found] for mark, found in balances.items()}
    return sure or max(
        gains, key=lambda mark: [sum(each) for each in zip(*(g for g in gains[mark] if g[0] >= 0), strict=True)]
    )


def _balance(line: str, mark: str | None) -> tuple[int, int]:
    """How many cells hold a value, and how many a text; of a comma between columns no blank separates digits."""
    cells = _split(line, mark)
    return balance([cell.replace(' ', '_') if mark == ',' and ':' not in cell else cell for cell in cells])


def _split(line: str, mark: str | None) -> list[str]:
    if mark == ',' and '"' in line:
        line = QUOTED.sub(lambda cell: cell[1].replace(',', '.'), line)
    return [cell.strip().strip('"\'').strip() for cell in line.split(mark)]


def _cells(line: str, delimiter: str | None) -> list[str]:
    """The cells of a line; names may be separated by another mark than numbers."""
    cells, other = _split(line, delimiter), _delimiter(line)
    values, texts = balance(cells)
    if texts > values and other not in (None, delimiter):
        return max(cells, _split(line, other), key=len)
    return cells


def _with_clocks(names: tuple[str, ...], rows: Sequence[Sequence[str]]) -> tuple[tuple[str, ...], dict[int, str]]:
    """The names, with one for a clock time that a blank separates from its date, and the columns of dates and times."""
    kinds: dict[int, str] = {}
    for row in rows[:ROWS_OF_SAMPLE]:
        for place, cell in enumerate(row):
            if (kind := kind_of_cell(cell)) in DATED:
                kinds.setdefault(place, kind)
    width = len(rows[0]) if rows else 0
    for place, kind in sorted(kinds.items()):
        if kind == 'day' and kinds.get(place + 1) == 'clock' and len(names) == width - 1:
            names = (*names[: place + 1], 'time of day', *names[place + 1 :])
    return names, kinds


def _refuse_extra_cells(path: str | Path, rows: Sequence[str], names: Sequence[str], delimiter: str | None) -> None:
    """Refuse rows with more cells than names: decimal commas between commas, or columns without a name."""
    if delimiter != ',':
        return
    counts = [len(QUOTED.sub('0', row).rstrip(', \t').split(',')) for row in rows if row and not _is_comment(row)]
    most = int(np.median(counts)) if counts else 0
    if most > len(names):
        raise InputError(
            f'{path} has {len(names)} column names and {most} cells a row: if its numbers have decimal '
            f'commas, export it with semicolons between them; else name every column'
        )


def _marks_in(rows: Sequence[str], delimiter: str | None) -> tuple[bool, str]:
    """How the numbers of rows are written; see `marks_of`."""
    lines = [line for line in rows if ',' in line or GROUPED.search(line)]
    return marks_of([cell for line in lines for cell in _split(line, delimiter) if kind_of_cell(cell) == 'number'])


def _text(raw: bytes) -> str:
    try:
        return raw.decode('utf-8').removeprefix('\ufeff')
    except UnicodeDecodeError:
        return raw.decode('latin-1')


def _is_comment(line: str) -> bool:
    return line.startswith(COMMENT_MARKS)


def _without_mark(line: str) -> str:
    for mark in COMMENT_MARKS:
        if line.startswith(mark):
            return line[len(mark) :].strip()
    return line


def _delimiter(line: str) -> str | None:
    return next((mark for mark in (';', '\t', ',') if mark in line), None)


def _remarks(lines: Iterable[str]) -> dict[str, str]:
    """What comments say, and other lines of the sample rate."""
    remarks = {}
    for line in lines:
        mark = ':' if ':' in line else _delimiter(line) or '='
        key, _, value = _without_mark(line).partition(mark)
        if mark == ':' and _is_comment(line) or value and plain_name(key) in (*RATES, *INTERVALS):
            remarks[key.strip(' "').lower()] = value.strip(' "\t;,')
    return remarks
