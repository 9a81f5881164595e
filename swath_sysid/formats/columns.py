"""The columns of tables, for both wings: names with units to readings in SI units."""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.input_files import reading, shown
from swath_sysid.formats.tables import Progress, TableHead, listed_names, read_columns, read_head

#: Units as the names of columns end in them, with their size in SI.
UNITS = {
    **{'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9},
    **{'rad': 1.0, 'deg': np.pi / 180, 'rad_s': 1.0, 'deg_s': np.pi / 180, 'dps': np.pi / 180},
    **{'m': 1.0, 'm_s': 1.0, 'km_h': 1.0 / 3.6, 'kn': 1852.0 / 3600.0, 'm_s2': 1.0, 'g': 9.80665, 'n': 1.0, '': 1.0},
}
TIME, ANGLE, RATE, SPEED = ('s', 'ms', 'us', 'ns'), ('rad', 'deg'), ('rad_s', 'deg_s', 'dps'), ('m_s', 'km_h', 'kn')
SAMPLES = 'samples'  #: The unit of a time column that numbers the samples; a comment line says how many a second.

TIME_NAMES = ('time', 't', 'stamp', 'timestamp', 'header_stamp')
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


@dataclass(frozen=True)
class Column:
    """A column that is read: what it holds, its position and its unit."""

    reading: str
    name: str  #: As written.
    index: int
    unit: str

    @property
    def scale(self) -> float:
        """Its unit in SI."""
        return UNITS.get(self.unit, 1.0)


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
            raise InputError(
                f"{self.path} says '{key}: {shown(str(said))}', which is not a number: correct that line"
            ) from error

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
        rate = self.remark('sample_rate_hz') if self.columns[0].unit == SAMPLES else 1.0
        if rate is None or not 0.0 < rate < np.inf:
            raise InputError(
                f"{self.path} numbers its samples and says 'sample_rate_hz: {rate}', which must be greater than zero: "
                "put a line '# sample_rate_hz: 100' above the columns"
            )
        return sum(further, time) / rate

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
                    'contradict each other: leave out the one that is wrong'
                )
        del found['time']
        return found


def read_table(
    path: str | Path,
    quantities: Iterable[Quantity],
    lacking: Callable[[set[str]], str],
    progress: Progress | None = None,
) -> Table:
    """Read the known columns of a text file; ``lacking`` says of the readings found what is missing, if anything."""
    with reading(path):
        head = read_head(path)
        plain = [plain_name(name) for name in head.names]
        columns, unitless = _find_columns(path, head, plain, quantities)
        if missing := lacking({column.reading for column in columns}):
            if unitless:
                raise InputError(f"{path} has a column '{shown(unitless[0])}' without a unit: {UNIT_ADVICE}")
            raise InputError(f'{path} has no {missing}; found {listed_names(head.names)}: name the columns so')
        values, advice = read_columns(path, head, [column.index for column in columns], progress)
    if unitless:
        advice += (Advice.of('unit-missing', columns=listed_names(unitless), unit_advice=UNIT_ADVICE),)
    if meant := _likely_meant(head, plain, columns, quantities):
        advice += (Advice.of('columns-misspelt', pairs=meant),)
    return Table(path, head.remarks, columns, values, advice)


def plain_name(name: str) -> str:
    """``Roll rate [deg/s]`` as ``roll_rate_deg_s``."""
    plain = name.lower().replace('°', 'deg').replace('²', '2').replace('µ', 'u').replace('^', '')
    plain = re.sub('[^a-z0-9]+', '_', plain).strip('_')
    return re.sub('_(per|p)_', '_', plain)


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


def _find_columns(
    path: str | Path, head: TableHead, plain: Sequence[str], quantities: Iterable[Quantity]
) -> tuple[tuple[Column, ...], list[str]]:
    """The columns to read, those of the time first, and the names of those that lack a unit."""
    known = _names(quantities)
    bare = {name for _, names, units in quantities for name in names if '' not in units}
    columns = _time_columns(plain, head)
    if not columns:
        unitless = next((head.names[k] for k, name in enumerate(plain) if name in TIME_NAMES), None)
        if unitless is not None:
            raise InputError(
                f"{path} has a column '{shown(unitless)}' without a unit: call it time_s, time_ms, time_us or time_ns"
            )
        raise InputError(
            f'{path} has no time column: looked for time_s, time_ms, time_us, time_ns (or t_, stamp_, timestamp_), or '
            f'time with dates such as 2026-05-01T12:00:00.25Z; found {listed_names(head.names)}: name the columns so'
        )
    columns += [
        Column(known[name][0], head.names[k], k, known[name][1]) for k, name in enumerate(plain) if name in known
    ]
    read = [plain[column.index] for column in columns]
    twice = next((column.name for k, column in enumerate(columns) if read[k] in read[:k]), None)
    if twice is not None:
        raise InputError(f"{path} has two columns '{shown(twice)}': leave one out, or rename it")
    return tuple(columns), [head.names[k] for k, name in enumerate(plain) if name in bare]


def _time_columns(plain: Sequence[str], head: TableHead) -> list[Column]:
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
    head: TableHead, plain: Sequence[str], columns: Sequence[Column], quantities: Iterable[Quantity]
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


def _first_finite(values: np.ndarray) -> float:
    finite = np.flatnonzero(np.isfinite(values))
    return values[finite[0]] if finite.size else 0.0
