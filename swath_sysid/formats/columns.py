"""The columns of tables, for both wings: names with units to readings in SI units."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from difflib import get_close_matches
from functools import partial
from pathlib import Path

import numpy as np

from swath_sysid.common.account import Loss, described, in_words
from swath_sysid.common.advice import Advice, did_you_mean
from swath_sysid.common.errors import InputError
from swath_sysid.formats.clocks import Clock, Clocks, Column, chosen, clock_of, clocks_of, with_unit_by_size
from swath_sysid.formats.files import reading, shown
from swath_sysid.formats.table_files import known_by_name, tables_in
from swath_sysid.formats.text_tables import NamedColumns, Progress
from swath_sysid.formats.vocabulary import (
    FURTHER_TIMES,
    INTERVALS,
    RATES,
    SAMPLES,
    SPANS,
    TIME,
    TIME_NAMES,
    UNIT_IN_BRACKETS,
    Quantity,
    listed_names,
    matched,
    plain_name,
    plain_names,
    readings_of,
    spelt_names,
    unit_of,
)

SIMILAR = 0.85  #: Likeness, from 0 to 1, of a name that may be a slip of the pen.
SAME_SHARE, SAME_AT_LEAST = 0.02, 1e-3  #: Difference of two columns of one quantity, as share or in SI, by rounding.

LATEST = 4.0e9  #: s since 1970, of a date that a record may have.
UNIT_ADVICE = 'add it to the name, as in roll_deg, gyro_x_rad_s or accel_z_m_s2'

ATTITUDE = {'roll', 'pitch', 'quaternion_w'}
DEVICE = 'device'  #: Among the assigned columns: the name of the table of one device.
UNKNOWN = 'columns-unknown'  #: Code of the errors that an assignment of columns mends.

#: From a table's columns and values, (columns, N), to unit and reason of those without one that leave no doubt of it.
Judge = Callable[[Clock, Sequence[Column], np.ndarray], Mapping[int, tuple[str, str]]]
Lacking = Callable[[set[str]], str]  #: What is missing beside the readings found.


@dataclass(frozen=True)
class _Match:
    """A table that has what is needed."""

    table: NamedColumns
    plain: Sequence[str]
    clocks: Clocks
    columns: tuple[Column, ...]  #: Without those of the time; some without a unit.

    def has_units(self, lacking: Lacking) -> bool:
        """Whether it has what is needed with units."""
        return any(clock[-1].unit for clock in self.clocks) and not lacking({c.reading for c in self.columns if c.unit})

    def has_attitude(self) -> bool:
        """Whether it has an angle, and not only rates."""
        return not ATTITUDE.isdisjoint(column.reading for column in self.columns if column.unit is not None)

    def by_other_names(self, quantities: Iterable[Quantity]) -> bool:
        """Whether a column is read that no first choice of a name tells."""
        known = spelt_names(quantities)
        meant, places = plain_names(self.table.names, self.table.name), [column.index or 0 for column in self.columns]
        # as written, unless it was assigned
        names = (plain_name(self.table.names[k]) if self.plain[k] == meant[k] else self.plain[k] for k in places)
        return any(known.keys().isdisjoint(stem for stem, _ in readings_of(name)) for name in names)


@dataclass(frozen=True)
class Table:
    """The columns of a file that are known, its time, and what was found amiss."""

    path: str | Path
    remarks: dict[str, str]
    clock: Clock
    columns: tuple[Column, ...]
    values: np.ndarray  #: (columns, N), as written.
    advice: tuple[Advice, ...]
    place: str = ''  #: The reader, and how the table is written.

    def remark(self, key: str) -> float | None:
        """The number in a comment line, None where there is none."""
        said = self.remarks.get(key)
        try:
            return float(re.sub(r'\s*(hz|s)$', '', said.replace(',', '.'), flags=re.IGNORECASE)) if said else None
        except ValueError as error:
            raise InputError(f"{self.path} says '{key}: {shown(str(said))}' instead of a number: correct it") from error

    def time(self) -> np.ndarray:
        """Seconds, from the first sample where the column counts from an epoch."""
        return self.clock.time / (self._rate() if self.clock.columns[0].unit == SAMPLES else 1.0)

    def _rate(self) -> float:
        """Samples a second, as the file says beside its columns."""
        key = _rate_key(self.remarks) or RATES[0]
        said = self.remark(key)
        if said is None or not 0.0 < said < np.inf:
            raise InputError(
                f"{self.path} numbers its samples and says '{key}: {said}', which must be greater than zero: state "
                "the rate, in a CSV file by a line '# sample_rate_hz: 100' above the columns"
            )
        return 1.0 / said if plain_name(key) in INTERVALS else said

    def in_words(self) -> list[str]:
        """The reader and the start, and what each column was read as."""
        start, time = self.clock.start, self.time()
        is_date = SPANS['epoch'] < start < LATEST
        since = f'{datetime.fromtimestamp(start, UTC):%Y-%m-%d %H:%M:%S}' if is_date else f'{start:.6g} s'
        channels = [f'{c.in_words}: {described(time, row)}' for c, row in zip(self.columns, self.values, strict=True)]
        return [f'{self.place}, {self.clock.in_words} from {since}', *channels]

    def readings(self) -> dict[str, np.ndarray]:
        """Reading to values in SI units, of the first column of each; columns that contradict it are refused."""
        found, first = {}, {}
        for column, row in zip(self.columns, self.values, strict=True):
            row = row if column.scale == 1.0 else row * column.scale
            if column.reading not in found:
                found[column.reading], first[column.reading] = row, column.name
            elif column.reading not in ('yaw', 'heading') and not agree(found[column.reading], row):
                raise InputError(
                    f"{self.path}: its columns '{shown(first[column.reading])}' and '{shown(column.name)}' "
                    'contradict each other: leave out the wrong one'
                )
        return found


def read_table(
    path: str | Path,
    quantities: Iterable[Quantity],
    lacking: Lacking,
    progress: Progress | None = None,
    assigned: Mapping[str, str] | None = None,
    judge: Judge | None = None,
    tables: Sequence[NamedColumns] = (),
) -> Table:
    """Read the known columns of a file from its one table that has them, or of the tables given; ``assigned`` gives
    columns by the quantity that they hold, as in ``{'roll': 'Phi:deg'}``.
    """
    with reading(path), known_by_name(path):
        matches, problems, assigned = [], [], dict(assigned or {})
        tables = _of_device(path, tables or tables_in(path), assigned.pop(DEVICE, None))
        tables = sorted(tables, key=lambda table: -len(table.names))  # for the sentence: the widest first
        for table in tables:
            try:
                matches.append(_matched(path, table, quantities, lacking, assigned))
            except InputError as error:
                problems.append(error)
        for is_better in (partial(_Match.has_units, lacking=lacking), _Match.has_attitude):
            better = [match for match in matches if is_better(match)]
            matches = better if len(better) == 1 else matches
        if len(matches) != 1:
            raise _choice_is_open(path, tables, matches, problems)
        (match,) = matches
        times = [column for columns in match.clocks for column in columns]
        columns = [*times, *match.columns]
        values, losses = match.table.read([column.index for column in columns if column.index is not None], progress)
        advice = in_words([*losses, *_left_out(match, quantities, tables)], path)
    if times[0].index is None:
        values = np.vstack([np.arange(values.shape[1]), values])
    clock, clock_advice = _clock(path, match, values)
    values = values[len(times) :]
    judged = judge(clock, match.columns, values) if judge else {}
    known = [replace(c, unit=judged[place][0]) if place in judged else c for place, c in enumerate(match.columns)]
    _refuse_lacking(path, match, known, quantities, lacking, values)
    unitless = [column.name for column in known if column.unit is None]
    read = [place for place, column in enumerate(known) if column.unit is not None]
    advice += clock_advice
    for place, (unit, reason) in judged.items():
        advice += (Advice.of('unit-judged', name=shown(known[place].name), unit=unit, reason=reason),)
    if unitless:
        advice += (Advice.of('unit-missing', columns=listed_names(unitless), unit_advice=UNIT_ADVICE),)
    if meant := _likely_meant(match, quantities):
        advice += (Advice.of('columns-misspelt', pairs=meant),)
    columns = [known[place] for place in read]
    if match.by_other_names(quantities):
        listed = ', '.join([clock.in_words, *(column.in_words for column in columns)])
        advice += (Advice.of('columns-understood', columns=listed),)
    values = values if len(read) == len(values) else values[read]
    return Table(path, match.table.remarks, clock, tuple(columns), values, advice, match.table.place)


def _left_out(match: _Match, quantities: Iterable[Quantity], tables: Sequence[NamedColumns]) -> list[Loss]:
    """The columns of other tables that hold what this one does not."""
    read = {column.reading for column in match.columns}
    names = [
        f'{table.name}/{table.names[place]}'.lstrip('/')
        for table in tables
        for place, (reading, _) in matched(plain_names(table.names, table.name), quantities).items()
        if table is not match.table and reading not in read
    ]
    return [Loss('columns-left-out', said={'columns': listed_names(names)})] if names else []


def _of_device(path: str | Path, tables: Sequence[NamedColumns], device: str | None) -> Sequence[NamedColumns]:
    """The tables of a device, by its name; all where none is chosen."""
    chosen = [table for table in tables if device in (None, table.name)]
    if not chosen:
        names = [table.name for table in tables]
        raise InputError(
            f"{path} holds no device or table '{shown(str(device))}'{did_you_mean(str(device), names)}: "
            + (f'choose from {listed_names(names)}' if any(names) else 'it holds one, without a name: leave it out')
        )
    return chosen


def _clock(path: str | Path, match: _Match, values: np.ndarray) -> tuple[Clock, tuple[Advice, ...]]:
    """The best time of a table, of which the first rows of values are the candidates."""
    clocks, at = [], 0
    for columns in match.clocks:
        rows = values[at : at + len(columns)]
        known = [with_unit_by_size(column, row) for column, row in zip(columns, rows, strict=True)]
        at += len(columns)
        if all(column.unit is not None for column in known):
            clocks.append(clock_of(known, list(rows)))
    if not clocks:
        name = shown(match.clocks[0][0].name)
        raise InputError(
            f"{path} has a column '{name}' without a unit: call it time_s, time_ms, time_us or time_ns, "
            f"or assign it, as in 'time={name}:s'",
            UNKNOWN,
        )
    return chosen(clocks)


def agree(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two columns say the same, as far as rounding and a few broken packets allow."""
    apart = np.abs(one - other)
    known = np.isfinite(apart)
    if not known.any():
        return True
    size = np.percentile(np.abs(one[known] - np.median(one[known])), 95)
    return float(np.percentile(apart[known], 90)) <= max(SAME_SHARE * float(size), SAME_AT_LEAST)


def _with_unit(name: str, unit: str) -> str:
    return f'{name}_{unit}' if unit else name


def _names(quantities: Iterable[Quantity]) -> dict[str, tuple[str, str]]:
    """Every name that a column should have, to its reading and unit."""
    return {
        _with_unit(name, unit): (each.reading, unit)
        for each in quantities
        for name in each.names
        for unit in each.units
    }


def _matched(
    path: str | Path,
    table: NamedColumns,
    quantities: Iterable[Quantity],
    lacking: Lacking,
    assigned: Mapping[str, str],
) -> _Match:
    """The columns to read of a table that has what is needed."""
    plain = _with_assigned(path, table, quantities, assigned)
    clocks = clocks_of(plain, table)
    if not clocks:
        key = _rate_key(table.remarks)
        if key is None:
            raise InputError(
                f'{path} has no time column: looked for time_s, time_ms, time_us, time_ns (or t_, stamp_, timestamp_), '
                f'time with dates such as 2026-05-01T12:00:00.25Z, or a number {RATES[0]} or fs; found '
                f'{listed_names(table.names)}: name the columns so, or assign them, as in '
                f"'time={_nearest(TIME_NAMES, table.names)}:s'",
                UNKNOWN,
            )
        clocks = [(Column('time', key, None, SAMPLES),)]
    columns = [
        Column(known, table.names[k], k, unit) for k, (known, unit) in sorted(matched(plain, quantities).items())
    ]
    match = _Match(table, plain, clocks, tuple(columns))
    read = {column.index for column in (*columns, *(each for clock in clocks for each in clock))}
    twice = next((at for at in sorted(k for k in read if k is not None) if plain.count(plain[at]) > 1), None)
    if twice is not None:
        raise InputError(f"{path} has two columns '{shown(table.names[twice])}': leave one out, or rename it")
    _refuse_lacking(path, match, columns, quantities, lacking)
    return match


def _refuse_lacking(
    path: str | Path,
    match: _Match,
    columns: Sequence[Column],
    quantities: Iterable[Quantity],
    lacking: Lacking,
    values: np.ndarray | None = None,
) -> None:
    """Refuse a table without what is needed; as long as its values are unknown, columns without a unit may hold it."""
    readings = {column.reading for column in columns if values is None or column.unit is not None}
    missing = lacking(readings)
    if not missing:
        return
    unitless = [(at, column) for at, column in enumerate(columns) if column.unit is None]
    if unitless and values is not None:
        order = [each.reading for each in quantities]
        at, column = min(unitless, key=lambda each: order.index(each[1].reading))
        units = next(each.units for each in quantities if each.reading == column.reading)
        name, largest = shown(column.name), np.nanmax(np.abs(values[at]), initial=0.0)
        unit, meant = (
            ('cdeg', ' for hundredths of a degree') if largest > 180.0 and 'cdeg' in units else (units[-1], '')
        )
        raise InputError(
            f"{path} has a column '{name}' without a unit, with values up to {largest:.4g}: {UNIT_ADVICE}, or assign "
            f"it, as in '{column.reading}={name}:{unit}'{meant}",
            UNKNOWN,
        )
    meant = _likely_meant(match, quantities)
    listed = listed_names(match.table.names) + (f' ({meant})' if meant else '')
    first = next(iter(quantities))
    if not first.units[-1]:
        raise InputError(f'{path} has no {missing}; found {listed}: choose one of these')
    example = f"'{first.reading}={_nearest(first.names, match.table.names)}:{first.units[-1]}'"
    raise InputError(
        f'{path} has no {missing}; found {listed}: name the columns so, or assign them, as in {example}', UNKNOWN
    )


def _nearest(known: Iterable[str], names: Sequence[str]) -> str:
    """The name in a file that is nearest to one of those known; NAME where none is."""
    plain = {plain_name(name): name for name in names}
    near = [found for each in known for found in get_close_matches(each, plain, 1)]
    return shown(plain[near[0]]) if near else 'NAME'


def _choice_is_open(
    path: str | Path, tables: Sequence[NamedColumns], matches: Sequence[_Match], problems: Sequence[InputError]
) -> InputError:
    """Why not one table of a file is the one to read."""
    if matches:
        table, columns = matches[0].table, matches[0].columns
        column = next((column for column in columns if column.unit), columns[0])
        listed = listed_names([match.table.name for match in matches])
        return InputError(
            f'{path} holds {len(matches)} tables that can be read ({listed}): choose one by its name, or by '
            f"assigning a column of it, as in '{column.reading}={table.name}/{column.name}:{column.unit or 'UNIT'}'",
            'several-devices',
        )
    if len(tables) == 1:
        return problems[0]
    listed = listed_names([f'{table.name}/{name}'.lstrip('/') for table in tables for name in table.names])
    return InputError(f'{path} holds {len(tables)} tables, {listed}; of the first: {problems[0]}', UNKNOWN)


def _with_assigned(
    path: str | Path, table: NamedColumns, quantities: Iterable[Quantity], assigned: Mapping[str, str]
) -> list[str]:
    """The plain names, where the caller assigns a quantity those that say so; no other column holds it then."""
    plain = plain_names(table.names, Path(path) / table.name)
    known = {
        name: each
        for each in (Quantity('time', TIME_NAMES, (*TIME, SAMPLES, ''), FURTHER_TIMES), *quantities)
        for name in (each.reading, *each.names, *each.also)
    }
    for said, source in assigned.items():
        place, unit = _assigned_place(path, table, source)
        quantity = known.get(plain_name(said))
        if quantity is None:
            listed = ', '.join(('time', *(each.reading for each in quantities)))
            raise InputError(f"there is no quantity '{shown(said)}'{did_you_mean(said, known)}: choose from {listed}")
        unit = unit_of(unit) or plain_name(unit)
        if unit not in quantity.units:
            ends = ' or '.join(dict.fromkeys((f':{quantity.units[0]}', f':{[u for u in quantity.units if u][-1]}')))
            raise InputError(f"'{shown(said)}={shown(source)}' states no unit of {said}: end it with {ends}")
        if quantity.reading == 'time':
            others = [column.index for clock in clocks_of(plain, table) for column in clock]
        else:
            others = [at for at, (reading, _) in matched(plain, quantities).items() if reading == quantity.reading]
        plain = ['' if at in others else name for at, name in enumerate(plain)]
        plain[place] = _with_unit(quantity.names[0], unit)
    return plain


def _assigned_place(path: str | Path, table: NamedColumns, source: str) -> tuple[int, str]:
    """Place of the column ``name:unit``, and its unit; one that the column's own name states may be left out."""
    name, colon, unit = source.rpartition(':')
    bare = [UNIT_IN_BRACKETS.sub(lambda stated: stated[0] * (unit_of(stated[1]) is None), each) for each in table.names]
    for wanted, given in ((source, ''), (name, unit))[: 1 + len(colon)]:
        for names in (table.names, bare):
            places = [
                place
                for place, each in enumerate(names)
                if wanted in (each, f'{table.name}/{each}', f'{table.name}.{each}')
            ]
            if len(places) > 1:
                raise InputError(
                    f"{path} has {len(places)} columns '{shown(wanted)}': rename those that are not meant", UNKNOWN
                )
            for place in places:
                return place, given or table.names[place].removeprefix(bare[place])
    name = name or source
    meant, listed = did_you_mean(name, map(shown, table.names)), listed_names(table.names)
    raise InputError(f"{path} has no column '{shown(name)}'{meant}: assign one of {listed}", UNKNOWN)


def _likely_meant(match: _Match, quantities: Iterable[Quantity]) -> str:
    """Names that are not read and near to the name of a reading that is not there, with that name."""
    there = {column.reading for column in match.columns}
    missing = [name for name, (known, _) in _names(quantities).items() if known not in there]
    read = {column.index for column in (*match.columns, *(column for clock in match.clocks for column in clock))}
    pairs = []
    for place, name in enumerate(match.plain):
        near = [] if place in read else get_close_matches(name, missing, 1, SIMILAR)
        pairs += [f"'{shown(match.table.names[place])}': did you mean {near[0]}?" for near in [near] if near]
    return ', '.join(pairs[:3])


def _rate_key(remarks: Mapping[str, str]) -> str | None:
    """What says the sample rate or interval."""
    return next((key for key in remarks if plain_name(key) in (*RATES, *INTERVALS)), None)
