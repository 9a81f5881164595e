"""LabVIEW measurement files: text with a header for the file and one for each segment.

Columns are channels with their ``Y_Unit_Label``; the time is ``X_Value``, or follows from ``Delta_X``; segments that
continue in time are one table, others are ``segment 1``, ``segment 2``, ...
"""

import os
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from swath_sysid.common.account import shortage
from swath_sysid.common.errors import InputError
from swath_sysid.formats.cells import seconds_of_text
from swath_sysid.formats.text_tables import BlockParser, Losses, NamedColumns, Progress, TableHead, check_size
from swath_sysid.formats.vocabulary import with_unit

END_OF_HEADER = re.compile(r'^\*\*\*End_of_Header\*\*\*.*\n', re.MULTILINE)
NEXT_HEADER = re.compile(r'^Channels[\t,]', re.MULTILINE)
SPECIAL = re.compile(r'^\*\*\*Start_Special\*\*\*.*?^\*\*\*End_Special\*\*\*.*?\n', re.MULTILINE | re.DOTALL)
ABSCISSA, TIME = 'X_Value', 'time [s]'

Fields = Mapping[str, Sequence[str]]  #: Of a header: the values by their key, a value for each channel.


class Body(NamedTuple):
    """The numbers of a segment."""

    start: float  #: s.
    shift: float  #: Of its column of times, s.
    interval: float  #: s; 0 where a column holds the time.
    samples: int  #: As its header counts them; 0 where it does not.
    numbers: str


def tables(path: str | Path) -> list[NamedColumns]:
    """The segments; one that goes on in time from another with the same channels is joined to it."""
    check_size(path, os.path.getsize(path))
    text = SPECIAL.sub('', Path(path).read_text('latin-1').replace('\r\n', '\n'))
    first, *parts = END_OF_HEADER.split(text)
    mark = ',' if re.search('^Separator[\t,]Comma', first, re.MULTILINE) else '\t'
    stated = _fields(first, mark)
    starts = [*(NEXT_HEADER.search(part) for part in parts[:-1]), None]
    if len(parts) < 2 or not all(starts[:-1]):
        raise InputError(f'{path} is cut off, or has no header of its channels: export it again')
    cuts = [len(part) if start is None else start.start() for start, part in zip(starts, parts, strict=True)]
    headers = [_fields(part[cut:], mark) for part, cut in zip(parts, cuts, strict=True)]
    joined: list[tuple[tuple[str, ...], list[Body]]] = []
    ending, zero = np.inf, None
    for header, (part, cut) in zip(headers, list(zip(parts, cuts, strict=True))[1:], strict=False):
        line, _, numbers = part[:cut].partition('\n')
        fields = {**stated, **header}
        names, interval = _names(path, line.rstrip('\n').split(mark), fields)
        zero = zero or (_first(header, 'X0'), _stamp(fields))
        offset = _first(header, 'X0') - zero[0]
        # where its own start is that of the first segment, the stamp of its header tells them apart
        start = zero[0] + (offset or _stamp(fields) - zero[1])
        if not (joined and start > ending and joined[-1][0] == names):
            joined.append((names, []))
        shift, samples = start - _first(header, 'X0'), int(_first(header, 'Samples'))
        joined[-1][1].append(Body(start, shift, interval, samples, numbers))
        ending = start + (numbers.count('\n') - 1.5) * interval
    comma = stated.get('Decimal_Separator', ['.'])[0] == ','
    return [
        NamedColumns(
            names,
            partial(_read, TableHead(names, {}, mark, comma, 1, 0, path=str(path)), bodies),
            name=f'segment {place}',
        )
        for place, (names, bodies) in enumerate(joined, 1)
    ]


def _first(fields: Fields, key: str) -> float:
    try:
        return float(fields.get(key, ['0'])[0].replace(',', '.'))
    except ValueError:
        return 0.0


def _stamp(fields: Fields) -> float:
    """The start of a segment by its header, s since 1970; 0 where it states none."""
    try:
        return sum(seconds_of_text(fields[key][0].strip()[:15].replace(',', '.')) for key in ('Date', 'Time'))
    except (KeyError, ValueError):
        return 0.0


def _fields(header: str, mark: str) -> dict[str, list[str]]:
    rows = (line.rstrip().split(mark) for line in header.splitlines())
    return {key.strip(): values for key, *values in rows if values}


def _names(path: str | Path, names: Sequence[str], fields: Fields) -> tuple[tuple[str, ...], float]:
    """The columns of a segment with their units, and its interval where no column holds the time, else 0."""
    if ABSCISSA not in names:
        raise InputError(f'{path} has no line of channel names with {ABSCISSA}: export it again, with headers')
    if fields.get('X_Columns', ['One'])[0] == 'Multi' and any(
        len(set(fields.get(key, ()))) > 1 for key in ('X0', 'Delta_X', 'Samples')
    ):
        raise InputError(f'{path} samples its channels at different times: save channels of one rate in a file')
    units = iter(fields.get('Y_Unit_Label', ()))
    known = [name if name == ABSCISSA else with_unit(name, next(units, '')) for name in names]
    if fields.get('X_Dimension', ['Time'])[0] == 'Time':
        known[known.index(ABSCISSA)] = TIME
    return tuple(known), _first(fields, 'Delta_X') if fields.get('X_Columns', ['One'])[0] == 'No' else 0.0


def _read(
    head: TableHead, bodies: Sequence[Body], places: Sequence[int], progress: Progress | None
) -> tuple[np.ndarray, Losses]:
    parser = BlockParser(head, places)
    for body in bodies:
        parser.parse(body.numbers.encode('latin-1'))
    if TIME in head.names and (place := head.names.index(TIME)) in places:
        for body, block in zip(bodies, parser.blocks[1:], strict=True):
            row = block[places.index(place)]
            row[:] = body.start + body.interval * np.arange(row.size) if body.interval else row + body.shift
    values = parser.columns()
    return values, (*parser.losses(), *shortage(sum(body.samples for body in bodies), values.shape[1], 'its header'))
