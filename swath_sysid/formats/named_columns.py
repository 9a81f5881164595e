"""Tables of whatever file before their columns are known: names as written, and numbers read when asked for."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, time, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.input_files import shown

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
