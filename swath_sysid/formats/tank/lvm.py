"""LabVIEW measurement files: text with a header for the file and one for each segment.

Columns are channels with their ``Y_Unit_Label``; the time is ``X_Value``, or ``Delta_X``; tables are ``segment 1``,
``segment 2``, ...
"""

import os
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.text_tables import BlockParser, NamedColumns, Progress, TableHead, check_size
from swath_sysid.formats.vocabulary import with_unit

END_OF_HEADER = re.compile(r'^\*\*\*End_of_Header\*\*\*.*\n', re.MULTILINE)
NEXT_HEADER = re.compile(r'^Channels[\t,]', re.MULTILINE)
SPECIAL = re.compile(r'^\*\*\*Start_Special\*\*\*.*?^\*\*\*End_Special\*\*\*.*?\n', re.MULTILINE | re.DOTALL)
ABSCISSA = 'X_Value'

Fields = Mapping[str, Sequence[str]]  #: Of a header: the values by their key, a value for each channel.


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
    joined: list[tuple[tuple[str, ...], dict[str, str], list[str]]] = []
    origin = np.inf
    for header, (part, cut) in zip(headers, list(zip(parts, cuts, strict=True))[1:], strict=False):
        line, _, numbers = part[:cut].partition('\n')
        names, remarks = _names(path, line.rstrip('\n').split(mark), {**stated, **header})
        start = float(header.get('X0', ['0'])[0].replace(',', '.'))
        if joined and start > origin and not remarks and joined[-1][0] == names:
            joined[-1][2].append(numbers)
        else:
            joined.append((names, remarks, [numbers]))
        origin = start
    comma = stated.get('Decimal_Separator', ['.'])[0] == ','
    return [
        NamedColumns(
            names, partial(_read, TableHead(names, {}, mark, comma, 1, 0), bodies), remarks, name=f'segment {place}'
        )
        for place, (names, remarks, bodies) in enumerate(joined, 1)
    ]


def _fields(header: str, mark: str) -> dict[str, list[str]]:
    rows = (line.rstrip().split(mark) for line in header.splitlines())
    return {key.strip(): values for key, *values in rows if values}


def _names(path: str | Path, names: Sequence[str], fields: Fields) -> tuple[tuple[str, ...], dict[str, str]]:
    """The columns of a segment with their units, and its interval where no column holds the time."""
    if ABSCISSA not in names:
        raise InputError(f'{path} has no line of channel names with {ABSCISSA}: export it again, with headers')
    if fields.get('X_Columns', ['One'])[0] == 'Multi' and any(
        len(set(fields.get(key, ()))) > 1 for key in ('X0', 'Delta_X', 'Samples')
    ):
        raise InputError(f'{path} samples its channels at different times: save channels of one rate in a file')
    units = iter(fields.get('Y_Unit_Label', ()))
    known = [name if name == ABSCISSA else with_unit(name, next(units, '')) for name in names]
    if fields.get('X_Columns', ['One'])[0] == 'No':
        return tuple(known), {'dt': fields.get('Delta_X', [''])[0].replace(',', '.')}
    place = known.index(ABSCISSA)
    if fields.get('X_Dimension', ['Time'])[0] == 'Time':
        known[place] = 'time [s]'
    return tuple(known), {}


def _read(
    head: TableHead, bodies: Sequence[str], places: Sequence[int], progress: Progress | None
) -> tuple[np.ndarray, tuple[Advice, ...]]:
    parser = BlockParser(head, places)
    for body in bodies:
        parser.parse(body.encode('latin-1'))
    return parser.columns(), parser.advice()
