"""What the columns of tables may be called: columns.yaml, and how a name as written is matched with it."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from swath_sysid.common.wings import yaml_table
from swath_sysid.formats.cells import plain_letters
from swath_sysid.formats.files import shown


class Quantity(NamedTuple):
    """A reading, the names of its column without the unit, and its units, that of SI first."""

    reading: str
    names: Sequence[str]
    units: Sequence[str]
    also: Sequence[str] = ()  #: Names that count where no column has one of the others.


def _quantities(section: str) -> tuple[Quantity, ...]:
    found = []
    for reading, said in _TABLE[section].items():
        for part in said.get('parts', ' '):
            names, also = ([name.replace('*', part) for name in said.get(key, ())] for key in ('names', 'also'))
            found.append(Quantity(reading.replace('*', part), names, _TABLE['kinds'][said['kind']], also))
    return tuple(found)


_TABLE: dict[str, Any] = yaml_table(Path(__file__).with_name('columns.yaml'))
UNITS: dict[str, float] = {unit: said['size'] for unit, said in _TABLE['units'].items()}  #: With their size in SI.
TIME: Sequence[str] = _TABLE['kinds']['time']  #: Units of a time.
SAMPLES = 'samples'  #: The unit of a time column that numbers the samples; a comment line says how many a second.
_SPELT = {spelt: unit for unit, said in _TABLE['units'].items() for spelt in (unit, *said['also'])} | {SAMPLES: SAMPLES}
LONGEST_UNIT = max(spelt.count('_') + 1 for spelt in _SPELT)
TIME_NAMES, FURTHER_TIMES = _TABLE['time']['names'], _TABLE['time']['also']
DATE_NAMES, WEEK_NAMES = _TABLE['date'], _TABLE['week']
FIELD_NAMES, VALUE_NAMES = _TABLE['fields'], _TABLE['values']  #: Of tables with one value in each row.
DEVICE_NAMES = _TABLE['devices']  #: Of tables with rows of several devices.
#: Of a number beside the columns that stands in for a time, per second and in seconds.
RATES, INTERVALS = _TABLE['rates'], _TABLE['intervals']
SPANS: dict[str, float] = _TABLE['spans']  #: Of clocks, s.
TURNS: Sequence[float] = _TABLE['turns']  #: s after which counters start again.
MOTION_QUANTITIES, MANOEUVRE_QUANTITIES = _quantities('motion'), _quantities('manoeuvre')

UNIT_IN_BRACKETS = re.compile(r'\s*[\[(](.*)[\])]$')
#: How a date or a clock time is written, where a unit would stand: ``hh:mm:ss.ms``.
_PATTERN = re.compile(r'(?=[^\[(]*(h:|:m|yy|jj|aa))[hmsdyjaftnu:./\- ]+', re.IGNORECASE)


def plain_name(name: str) -> str:
    """``Roll rate [deg/s]`` as ``roll_rate_deg_s``, ``Time [hh:mm:ss]`` as ``time``."""
    if (unit := UNIT_IN_BRACKETS.search(name)) and _PATTERN.fullmatch(unit[1]):
        name = name[: unit.start()]
    name = name.lower().replace('°', 'deg').replace('º', 'deg').replace('²', '2').replace('µ', 'u').replace('^', '')
    plain = re.sub('[^a-z0-9]+', '_', plain_letters(name)).strip('_')
    return re.sub('_(per|p)_', '_', plain)


def plain_names(names: Sequence[str], file: str | Path = '') -> list[str]:
    """The plain names of a table; of one that a program in columns.yaml exports, what they mean."""
    plain = [plain_name(name) for name in names]
    for said in _TABLE['exports']:
        for word in said.get('for', ' '):
            has, without, are = ([n.replace('*', word) for n in said.get(key, ())] for key in ('has', 'without', 'are'))
            if set(has) <= set(plain) and not set(without) & set(plain) and said.get('file', '') in str(file).lower():
                meant = dict(zip(are, said['are'].values(), strict=True))
                return [meant.get(name, name) for name in plain]
    return plain


def with_unit(name: str, unit: str) -> str:
    """``Roll [deg]``, unless the name says its unit already."""
    plain = plain_name(unit)
    known = not plain or bool(_PATTERN.fullmatch(unit)) or f'_{plain_name(name)}'.endswith(f'_{plain}')
    return name if known else f'{name} [{unit.strip("[]() ")}]'


def is_unit(cell: str) -> bool:
    """Whether a cell below a name says its unit."""
    return unit_of(cell) is not None or bool(_PATTERN.fullmatch(cell.strip('[]() ')))


def unit_of(said: str) -> str | None:
    """A unit however it is written; None where it is not known."""
    plain = plain_name(said)
    return _SPELT.get(plain) if plain else None


def listed_names(names: Sequence[str]) -> str:
    """The names of columns, fit for one line of a message."""
    listed = ', '.join(shown(name) for name in names[:12])
    return f'{listed} and {len(names) - 12} more' if len(names) > 12 else listed


def readings_of(name: str) -> Iterator[tuple[str, str]]:
    """The ways to read a plain name: its stem without `_`, and its unit (empty: none)."""
    yield name.replace('_', ''), ''
    words = name.split('_')
    for at in range(max(1, len(words) - LONGEST_UNIT), len(words)):
        unit = _SPELT.get('_'.join(words[at:]))
        if unit is not None:
            yield ''.join(words[:at]), unit


def spelt_names(quantities: Iterable[Quantity], also: bool = False) -> dict[str, Quantity]:
    """Every name without `_` that a column of some quantities may have."""
    return {name.replace('_', ''): each for each in quantities for name in (each.also if also else each.names)}


def matched(plain: Sequence[str], quantities: Iterable[Quantity]) -> Mapping[int, tuple[str, str | None]]:
    """Reading and unit (None: none is stated) of those columns that hold a quantity, by their places."""
    found: dict[int, tuple[str, str | None]] = {}
    for also in (False, True):
        known, there = spelt_names(quantities, also), {reading for reading, _ in found.values()}
        for place, name in enumerate(plain):
            for stem, unit in readings_of(name) if place not in found else ():
                quantity = known.get(stem)
                if quantity is not None and quantity.reading not in there and (unit in quantity.units or not unit):
                    found[place] = quantity.reading, unit if unit in quantity.units else None
                    break
    return found


_KNOWN = {
    name.replace('_', '')
    for names in (TIME_NAMES, FURTHER_TIMES, DATE_NAMES, WEEK_NAMES, *(
        (*each.names, *each.also) for each in (*MOTION_QUANTITIES, *MANOEUVRE_QUANTITIES)
    ))
    for name in names
}  # fmt: skip


def is_known(name: str) -> bool:
    """Whether a name as written may be that of a column."""
    return any(stem in _KNOWN for stem, _ in readings_of(plain_name(name)))
