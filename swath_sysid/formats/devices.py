"""Several devices in one table: in rows, as databases export them, or in columns that their names divide."""

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice, pairwise
from pathlib import Path

import numpy as np

from swath_sysid.attitude.motion.cleaning import MIN_ROWS
from swath_sysid.common.account import Loss
from swath_sysid.formats.cells import numbers_of
from swath_sysid.formats.clocks import clocks_of
from swath_sysid.formats.table_heads import ROWS_OF_SAMPLE, kind_of_cell
from swath_sysid.formats.text_tables import (
    Devices,
    Losses,
    NamedColumns,
    Progress,
    TableHead,
    check_size,
    of_arrays,
    read_long_head,
    rows_of,
)
from swath_sysid.formats.vocabulary import (
    DEVICE_NAMES,
    FIELD_NAMES,
    MOTION_QUANTITIES,
    TIME_NAMES,
    VALUE_NAMES,
    matched,
    plain_name,
    plain_names,
    readings_of,
    with_unit,
)

LABELLED = re.compile(r'([^{}]+)\{(.*)\}')  #: As Prometheus writes a series: ``roll_deg{device="a"}``.
#: Between the name of a device and that of a reading, but not within the brackets of a unit.
BETWEEN = re.compile(r'[/.](?![^\[(]*[\])])')
MOST_DEVICES = 20  #: In one table; a column with more numbers its rows.
NUMBERED = re.compile(r'[ ._]?\d+$')  #: What a program appends to a name that is there already.


def is_motion(name: str) -> bool:
    """Whether a name as written is that of a motion."""
    return bool(matched([plain_name(name)], MOTION_QUANTITIES))


def by_device(table: NamedColumns) -> list[NamedColumns]:
    """A table for each device that a column names, that names of columns begin with, or that has a time of its own."""
    if several := _by_label(table):
        return several
    if plain_names(table.names) != list(map(plain_name, table.names)):
        return [table]  # of a program that is known
    split = _by_time(table) or [_device_and_reading(name) for name in table.names]
    devices = dict.fromkeys(device for device, name in split if device and is_motion(name))
    if not devices or any(is_motion(name) for device, name in split if not device):
        return [table]
    return [_of_device(table, split, device, devices.keys() - {device}) for device in devices]


def _by_label(table: NamedColumns) -> list[NamedColumns]:
    """A table for each device that a column names in rows with motion; none where it names one."""
    motions = [at for at, name in enumerate(table.names) if is_motion(name)]
    at = next((at for at, name in enumerate(table.names) if motions and plain_name(name) in DEVICE_NAMES), None)
    if at is None:
        return []
    (numbers, *values), losses = table.read([at, *motions], None)
    numbers = np.where(np.isfinite(values).any(axis=0), numbers, np.nan)
    names = next((each.names for each in losses if isinstance(each, Devices)), ())
    several = [number for number in range(len(names)) if np.count_nonzero(numbers == number) >= MIN_ROWS]

    def rows_of_device(number: int, places: Sequence[int], progress: Progress | None) -> tuple[np.ndarray, Losses]:
        values, lost = table.read(places, progress)
        return values[:, numbers == number], lost

    found = [
        replace(table, name='/'.join(filter(None, (table.name, names[number]))), read=partial(rows_of_device, number))
        for number in several
    ]
    return found if 1 < len(found) < MOST_DEVICES else []


def _by_time(table: NamedColumns) -> list[tuple[str, str]]:
    """Device and reading of each column, where columns of motion follow several times that differ; else nothing."""
    names, bare = table.names, [NUMBERED.sub('', name) for name in table.names]
    times = [at for at, name in enumerate(bare) if any(stem in TIME_NAMES for stem, _ in readings_of(plain_name(name)))]
    times = [at for at in times if plain_name(bare[at]) == plain_name(bare[times[0]])]
    blocks = [range(*ends) for ends in pairwise([*times, len(names)])]
    if len(times) < 2 or not all(any(is_motion(bare[at]) for at in block) for block in blocks):
        return []
    first, *others = table.read(times, None)[0]
    if all(np.array_equal(first, other, equal_nan=True) for other in others):
        return []
    split = [('', name) for name in names]
    for number, block in enumerate(blocks, 1):
        device = names[block[0]] + f' ({number})' * (names.count(names[block[0]]) > 1)
        for at in block:
            split[at] = device, names[at] if is_motion(names[at]) else bare[at]
    return split


def _device_and_reading(name: str) -> tuple[str, str]:
    if labelled := LABELLED.fullmatch(name):
        return labelled[2], labelled[1]
    places = (0, *(mark.end() for mark in BETWEEN.finditer(name)))
    at = next((at for at in places if is_motion(name[at:])), 0)
    return name[: max(at - 1, 0)], name[at:]


def _of_device(table: NamedColumns, split: Sequence[tuple[str, str]], device: str, others: set[str]) -> NamedColumns:
    own = [place for place, (prefix, _) in enumerate(split) if prefix not in others]
    return replace(
        table,
        names=tuple(split[k][1] if split[k][0] == device else table.names[k] for k in own),
        read=lambda places, progress: table.read([own[place] for place in places], progress),
        kinds={at: table.kinds[place] for at, place in enumerate(own) if place in table.kinds},
        name='/'.join(filter(None, (table.name, device.strip('/')))),
    )


def long_form(path: str | Path) -> list[NamedColumns]:
    """The tables, one for each device, of a text with one value in each row and its name beside it; empty if it is
    none. The values of a device are in the order of their times.
    """
    head = read_long_head(path)
    if head is None:
        return []
    plain = [plain_name(name) for name in head.names]
    sample = list(islice((cells for cells in rows_of(path, head) if _is_whole(cells, head)), ROWS_OF_SAMPLE))
    value = next(place for place, name in enumerate(plain) if name in VALUE_NAMES)
    kinds = [[kind_of_cell(cells[place]) for cells in sample] for place in range(len(plain))]
    texts = [place for place, column in enumerate(kinds) if 'text' in column and place != value]
    fields = [place for place in texts if any(is_motion(cells[place]) for cells in sample)]
    fields += [plain.index(name) for name in FIELD_NAMES if name in plain and plain.index(name) in texts]
    if not fields or kinds[value].count('text') > 0.5 * len(sample):
        return []
    check_size(path, os.path.getsize(path))
    return list(_pivoted(path, head, value, fields[0], texts))


def _is_whole(cells: Sequence[str], head: TableHead) -> bool:
    """Whether a row is of the width of the header, which it does not repeat."""
    return len(cells) == len(head.names) and tuple(cells) != head.names


def _pivoted(path: str | Path, head: TableHead, value: int, field: int, texts: Sequence[int]) -> Iterator[NamedColumns]:
    every = list(enumerate(rows_of(path, head), head.first_line))
    lines = [line for line, cells in every if _is_whole(cells, head)]
    rows = [cells for _, cells in every if _is_whole(cells, head)]
    short = [line for line, cells in every if len(cells) != len(head.names)]
    losses = tuple(Loss('rows-of-other-width', len(short), said={'line': line}) for line in short[:1])
    unit = next((place for place in texts if plain_name(head.names[place]) in ('unit', 'units')), None)
    names = [with_unit(cells[field], cells[unit]) if unit is not None else cells[field] for cells in rows]
    tags = [place for place in texts if place not in (field, unit)]
    tags = [tag for tag in tags if MIN_ROWS * len({cells[tag] for cells in rows}) <= len(rows)]
    # what every name has one of tells no devices apart
    tags = [tag for tag in tags if len({(n, c[tag]) for n, c in zip(names, rows, strict=True)}) > len(set(names))]
    devices: dict[str, list[int]] = {}
    for at, cells in enumerate(rows):
        devices.setdefault('/'.join(cells[tag] for tag in tags), []).append(at)
    shared = [place for place in range(len(head.names)) if place not in (value, *texts)]
    numbers = {head.names[place]: numbers_of([cells[place] for cells in rows]) for place in shared}
    for device, own in devices.items():
        fields = tuple(dict.fromkeys(names[at] for at in own))
        check_size(path, len(fields) * len(own))
        columns = {name: values[own] for name, values in numbers.items()}
        kinds = {at: head.kinds[place] for at, place in enumerate(shared) if place in head.kinds}
        timed = replace(of_arrays(columns, {}, ''), kinds=kinds)
        clock = next(iter(clocks_of([plain_name(name) for name in timed.names], timed)), ())
        order = np.lexsort([columns[column.name] for column in reversed(clock)] or [np.arange(len(own))])
        place_of = {name: place for place, name in enumerate(fields)}
        block = np.full((len(fields), len(own)), None, dtype=object)
        block[[place_of[names[at]] for at in own], np.arange(len(own))] = [rows[at][value] for at in own]
        columns |= dict(zip(fields, block, strict=True))
        columns = {name: cells[order] for name, cells in columns.items()}
        yield replace(
            of_arrays(columns, head.remarks, device, losses, [lines[own[at]] for at in order]),
            kinds=kinds,
            place=', '.join(filter(None, (head.place, f"one value a row, named by '{head.names[field]}'"))),
        )
