"""The columns of tables, for both wings: names with units to readings in SI units."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from scipy import constants

from swath_sysid.common.advice import Advice, did_you_mean
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import reading, shown
from swath_sysid.formats.table_files import known_by_name, tables_in
from swath_sysid.formats.text_tables import NamedColumns, Progress, listed_names, plain_name

#: Units as the names of columns end in them, with their size in SI.
UNITS = {
    **{'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9},
    **{'rad': 1.0, 'deg': np.pi / 180, 'rad_s': 1.0, 'deg_s': np.pi / 180, 'dps': np.pi / 180},
    **{
        'm': 1.0,
        'm_s': 1.0,
        'km_h': constants.kmh,
        'kn': constants.knot,
        'm_s2': 1.0,
        'g': constants.g,
        'n': 1.0,
        '': 1.0,
    },
}
TIME, ANGLE, RATE, SPEED = ('s', 'ms', 'us', 'ns'), ('rad', 'deg'), ('rad_s', 'deg_s', 'dps'), ('m_s', 'km_h', 'kn')
SAMPLES = 'samples'  #: The unit of a time column that numbers the samples; a comment line says how many a second.

TIME_NAMES = ('time', 't', 'stamp', 'timestamp', 'header_stamp')
#: Of a number beside the columns that stands in for a time, per second and in seconds.
RATES, INTERVALS = ('sample_rate_hz', 'sample_rate', 'rate_hz', 'fs', 'fs_hz'), ('dt', 'dt_s')
DATE_NAMES = (*TIME_NAMES, 'date', 'datetime', 'date_time', 'utc', 'time_utc', 'utc_time')  #: Of dates, without a unit.

#: A reading, the names of its column without the unit, and its units.
Quantity = tuple[str, Sequence[str], Sequence[str]]
MOTION_QUANTITIES: tuple[Quantity, ...] = (
    *((angle, (angle, f'{angle}_angle'), ANGLE) for angle in ('roll', 'pitch', 'yaw')),
    ('heading', ('heading',), ANGLE),
    *((f'{angle}_rate', (f'{angle}_rate',), RATE) for angle in ('roll', 'pitch', 'yaw')),
    ('heave', ('heave',), ('m',)),
    *((f'gyro_{part}', (f'gyro_{part}', f'gyr_{part}', f'angular_velocity_{part}'), RATE) for part in 'xyz'),
    *(
        (f'accel_{part}', (f'accel_{part}', f'acc_{part}', f'linear_acceleration_{part}'), ('m_s2', 'g'))
        for part in 'xyz'
    ),
    *((f'quaternion_{part}', (f'quaternion_{part}', f'orientation_{part}', f'q{part}'), ('',)) for part in 'xyzw'),
)
MANOEUVRE_QUANTITIES: tuple[Quantity, ...] = (
    *(
        (f'{side}_{kind}', (f'{side}_{kind}', f'{other}_{kind}', f'{kind}_{side}', f'{kind}_{other}'), (unit,))
        for kind, unit in (('thrust', 'n'), ('command', ''), ('pwm', 'us'))
        for side, other in (('port', 'left'), ('starboard', 'right'))
    ),
    ('surge', ('surge', 'u', 'surge_speed'), SPEED),
    ('sway', ('sway', 'v', 'sway_speed'), SPEED),
    ('yaw_rate', ('yaw_rate', 'r'), RATE),
    ('heading', ('heading', 'yaw', 'psi'), ANGLE),
    *((name, (name,), ('m',)) for name in ('x', 'y', 'east', 'north')),
)

EPOCH_SECONDS = 1e8  #: A time that begins beyond this counts from an epoch.
SIMILAR = 0.85  #: Likeness, from 0 to 1, of a name that may be a slip of the pen.
SAME_SHARE, SAME_AT_LEAST = 0.02, 1e-3  #: Difference of two columns of one quantity, as share or in SI, by rounding.

UNIT_ADVICE = 'add it to the name, as in roll_deg, gyro_x_rad_s or accel_z_m_s2'


UNKNOWN = 'columns-unknown'  #: Code of the errors that an assignment of columns mends.


@dataclass(frozen=True)
class Column:
    """A column that is read: what it holds, its position and its unit."""

    reading: str
    name: str  #: As written.
    index: int | None  #: None of a time that only a sample rate gives.
    unit: str

    @property
    def scale(self) -> float:
        """Its unit in SI."""
        return UNITS.get(self.unit, 1.0)


#: A table that has what is needed: its plain names, its columns to read, and the names of those that lack a unit.
_Match = tuple[NamedColumns, Sequence[str], tuple[Column, ...], list[str]]


@dataclass(frozen=True)
class Table:
    """The columns of a file that are known, the time first, and what was found amiss."""

    path: str | Path
    remarks: dict[str, str]
    columns: tuple[Column, ...]
    values: np.ndarray  #: (columns, N), as written.
    advice: tuple[Advice, ...]

    def remark(self, key: str) -> float | None:
        """The number in a comment line, None where there is none."""
        said = self.remarks.get(key)
        try:
            return float(said.replace(',', '.')) if said else None
        except ValueError as error:
            raise InputError(f"{self.path} says '{key}: {shown(str(said))}' instead of a number: correct it") from error

    @property
    def start(self) -> float:
        """The first time, s, from whatever it counts."""
        return _first_finite(self.values[0]) * self.columns[0].scale

    def time(self) -> np.ndarray:
        """Seconds, from the first sample where the column counts from an epoch."""
        parts = [
            row if column.scale == 1.0 else row * column.scale
            for column, row in zip(self.columns, self.values, strict=True)
            if column.reading == 'time'
        ]
        time, further = parts[0], parts[1:]
        if abs(self.start) > EPOCH_SECONDS:
            # subtracted before the nanoseconds are added: a double resolves an epoch to 0.2 us only
            time = sum(further, time - self.start)
            return time - _first_finite(time)
        rate = self._rate() if self.columns[0].unit == SAMPLES else 1.0
        return sum(further, time) / rate

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

    def readings(self) -> dict[str, np.ndarray]:
        """Reading to values in SI units, of the first column of each; columns that contradict it are refused."""
        found, first = {}, {}
        for column, row in zip(self.columns, self.values, strict=True):
            row = row if column.scale == 1.0 else row * column.scale
            if column.reading not in found:
                found[column.reading], first[column.reading] = row, column.name
            elif column.reading not in ('time', 'yaw', 'heading') and not agree(found[column.reading], row):
                raise InputError(
                    f"{self.path}: its columns '{shown(first[column.reading])}' and '{shown(column.name)}' "
                    'contradict each other: leave out the wrong one'
                )
        del found['time']
        return found


def read_table(
    path: str | Path,
    quantities: Iterable[Quantity],
    lacking: Callable[[set[str]], str],
    progress: Progress | None = None,
    assigned: Mapping[str, str] | None = None,
) -> Table:
    """Read the known columns of a file from its one table that has them. ``lacking`` says what is missing beside the
    readings found, ``assigned`` gives columns by the quantity that they hold, as in ``{'roll': 'Phi:deg'}``.
    """
    with reading(path), known_by_name(path):
        matches, problems = [], []
        tables = sorted(tables_in(path), key=lambda table: -len(table.names))  # for the sentence: the widest first
        for table in tables:
            try:
                matches.append(_matched(path, table, quantities, lacking, assigned or {}))
            except InputError as error:
                problems.append(error)
        if len(matches) != 1:
            raise _choice_is_open(path, tables, matches, problems)
        table, plain, columns, unitless = matches[0]
        values, advice = table.read([column.index for column in columns if column.index is not None], progress)
    if columns[0].index is None:
        values = np.vstack([np.arange(values.shape[1]), values])
    if unitless:
        advice += (Advice.of('unit-missing', columns=listed_names(unitless), unit_advice=UNIT_ADVICE),)
    if meant := _likely_meant(table, plain, columns, quantities):
        advice += (Advice.of('columns-misspelt', pairs=meant),)
    return Table(path, table.remarks, columns, values, advice)


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
    """Every name that a column may have, to its reading and unit."""
    return {
        _with_unit(name, unit): (known, unit) for known, names, units in quantities for name in names for unit in units
    }


def _matched(
    path: str | Path,
    table: NamedColumns,
    quantities: Iterable[Quantity],
    lacking: Callable[[set[str]], str],
    assigned: Mapping[str, str],
) -> _Match:
    """The columns to read of a table that has what is needed."""
    plain = _with_assigned(path, table, quantities, assigned)
    columns, unitless = _find_columns(path, table, plain, quantities)
    missing = lacking({column.reading for column in columns})
    if missing and unitless:
        quantity = plain_name(unitless[0])
        unit = next(units[-1] for _, names, units in quantities if quantity in names)
        example = f"'{quantity}={shown(unitless[0])}:{unit}'"
        raise InputError(
            f"{path} has a column '{shown(unitless[0])}' without a unit: {UNIT_ADVICE}, or assign it, as in {example}",
            UNKNOWN,
        )
    if missing:
        meant = _likely_meant(table, plain, columns, quantities)
        listed = listed_names(table.names) + (f' ({meant})' if meant else '')
        (quantity, _, units), *_ = quantities
        if not units[-1]:
            raise InputError(f'{path} has no {missing}; found {listed}: choose one of these')
        name = next((each for k, each in enumerate(table.names) if k not in {c.index for c in columns}), 'NAME')
        example = f"'{quantity}={shown(name)}:{units[-1]}'"
        raise InputError(
            f'{path} has no {missing}; found {listed}: name the columns so, or assign them, as in {example}', UNKNOWN
        )
    return table, plain, columns, unitless


def _choice_is_open(
    path: str | Path, tables: Sequence[NamedColumns], matches: Sequence[_Match], problems: Sequence[InputError]
) -> InputError:
    """Why not one table of a file is the one to read."""
    if matches:
        table, column = matches[0][0], matches[0][2][-1]
        listed = listed_names([match[0].name for match in matches])
        return InputError(
            f'{path} holds {len(matches)} tables that can be read ({listed}): choose one by assigning a column of it, '
            f"as in '{column.reading}={table.name}/{column.name}:{column.unit}'",
            UNKNOWN,
        )
    if len(tables) == 1:
        return problems[0]
    listed = listed_names([f'{table.name}/{name}'.lstrip('/') for table in tables for name in table.names])
    return InputError(f'{path} holds {len(tables)} tables, {listed}; of the first: {problems[0]}', UNKNOWN)


def _with_assigned(
    path: str | Path, table: NamedColumns, quantities: Iterable[Quantity], assigned: Mapping[str, str]
) -> list[str]:
    """The plain names, where the caller assigns a quantity those that say so; no other column holds it then."""
    plain = [plain_name(name) for name in table.names]
    known = _names(quantities)
    known |= {name: ('time', '') for name in (*DATE_NAMES, *(_with_unit(n, u) for n in TIME_NAMES for u in TIME))}
    units = {name: allowed for _, names, allowed in quantities for name in names} | dict.fromkeys(TIME_NAMES, TIME)
    for quantity, source in assigned.items():
        place, unit = _assigned_place(path, table, source)
        wanted = _with_unit(plain_name(quantity), plain_name(unit))
        if wanted not in known and plain_name(quantity) in units:
            ends = ' or '.join(f':{each}' for each in units[plain_name(quantity)])
            raise InputError(f"'{shown(quantity)}={shown(source)}' states no unit of {quantity}: end it with {ends}")
        if wanted not in known:
            listed = ', '.join(('time', *(reading for reading, _, _ in quantities)))
            meant = did_you_mean(quantity, units)
            raise InputError(f"there is no quantity '{shown(quantity)}'{meant}: choose from {listed}")
        plain = ['' if known.get(each, ('',))[0] == known[wanted][0] else each for each in plain]
        plain[place] = wanted
    return plain


def _assigned_place(path: str | Path, table: NamedColumns, source: str) -> tuple[int, str]:
    """Place of the column ``name:unit``, and its unit; one that the column's own name states may be left out."""
    name, colon, unit = source.rpartition(':')
    bare = [
        re.sub(r'\s*[\[(](.*)[\])]$', lambda stated: stated[0] * (plain_name(stated[1]) not in UNITS), each)
        for each in table.names
    ]
    for wanted, given in ((source, ''), (name, unit))[: 1 + len(colon)]:
        for names in (table.names, bare):
            for place, each in enumerate(names):
                if wanted in (each, f'{table.name}/{each}', f'{table.name}.{each}'):
                    return place, given or table.names[place].removeprefix(bare[place])
    name = name or source
    meant, listed = did_you_mean(name, map(shown, table.names)), listed_names(table.names)
    raise InputError(f"{path} has no column '{shown(name)}'{meant}: assign one of {listed}", UNKNOWN)


def _find_columns(
    path: str | Path, head: NamedColumns, plain: Sequence[str], quantities: Iterable[Quantity]
) -> tuple[tuple[Column, ...], list[str]]:
    """The columns to read, those of the time first, and the names of those that lack a unit."""
    known = _names(quantities)
    bare = {name for _, names, units in quantities for name in names if '' not in units}
    columns = _time_columns(plain, head)
    if not columns:
        unitless = next((head.names[k] for k, name in enumerate(plain) if name in TIME_NAMES), None)
        if unitless is not None:
            raise InputError(
                f"{path} has a column '{shown(unitless)}' without a unit: call it time_s, time_ms, time_us or time_ns, "
                f"or assign it, as in 'time={shown(unitless)}:s'",
                UNKNOWN,
            )
        key = _rate_key(head.remarks)
        if key is None:
            raise InputError(
                f'{path} has no time column: looked for time_s, time_ms, time_us, time_ns (or t_, stamp_, timestamp_), '
                f'time with dates such as 2026-05-01T12:00:00.25Z, or a number {RATES[0]} or fs; found '
                f'{listed_names(head.names)}: name the columns so, or assign them, as in '
                f"'time={shown(head.names[0])}:s'",
                UNKNOWN,
            )
        columns = [Column('time', key, None, SAMPLES)]
    columns += [
        Column(known[name][0], head.names[k], k, known[name][1]) for k, name in enumerate(plain) if name in known
    ]
    read = [column.name if column.index is None else plain[column.index] for column in columns]
    twice = next((column.name for k, column in enumerate(columns) if read[k] in read[:k]), None)
    if twice is not None:
        raise InputError(f"{path} has two columns '{shown(twice)}': leave one out, or rename it")
    return tuple(columns), [head.names[k] for k, name in enumerate(plain) if name in bare]


def _time_columns(plain: Sequence[str], head: NamedColumns) -> list[Column]:
    """The column (or the two columns, seconds and nanoseconds) of the time, by the first of its names that is there."""
    with_units = [(_with_unit(name, unit), unit) for name in TIME_NAMES for unit in (*TIME, SAMPLES)]
    dated = {*DATE_NAMES, *(name for name, _ in with_units)}
    for place in sorted(head.dates):
        if place < len(plain) and plain[place] in dated:
            return [Column('time', head.names[place], place, 's')]
    for name, unit in with_units:
        if name in plain:
            return [Column('time', head.names[k], k, unit) for k, each in enumerate(plain) if each == name]
    for prefix in ('', *(f'{name}_' for name in TIME_NAMES)):
        parts = {f'{prefix}sec': 's', f'{prefix}nanosec': 'ns'}
        if parts.keys() <= set(plain):
            places = [(plain.index(name), unit) for name, unit in parts.items()]
            return [Column('time', head.names[k], k, unit) for k, unit in places]
    return []


def _likely_meant(
    head: NamedColumns, plain: Sequence[str], columns: Sequence[Column], quantities: Iterable[Quantity]
) -> str:
    """Names that are not read and near to the name of a reading that is not there, with that name."""
    there = {column.reading for column in columns}
    missing = [name for name, (known, _) in _names(quantities).items() if known not in there]
    read = {column.index for column in columns}
    pairs = []
    for place, name in enumerate(plain):
        near = [] if place in read else get_close_matches(name, missing, 1, SIMILAR)
        pairs += [f"'{shown(head.names[place])}': did you mean {near[0]}?" for near in [near] if near]
    return ', '.join(pairs[:3])


def _rate_key(remarks: Mapping[str, str]) -> str | None:
    """What says the sample rate or interval."""
    return next((key for key in remarks if plain_name(key) in (*RATES, *INTERVALS)), None)


def _first_finite(values: np.ndarray) -> float:
    finite = np.flatnonzero(np.isfinite(values))
    return values[finite[0]] if finite.size else 0.0
