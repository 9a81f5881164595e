"""The table of verbs and flags (flags.yaml), and what it makes of the command line."""

import math
import os
import re
from argparse import ArgumentParser, ArgumentTypeError, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

from swath_sysid.common.wings import named, tables_of_wings, yaml_table
from swath_sysid.nodes.parameters.table import NodeParameter, table_of

SHARED = 'shared'
WINGS = 'wings'  #: Where verbs, or flags of a verb, of wings have their place.
CORES = os.cpu_count()  #: A default in the table.


@cache
def table_of_verbs() -> dict[str, dict[str, Any]]:
    """What the tables say, by verb, of the core and of the wings; what verbs share is under ``shared``."""
    core = yaml_table(Path(__file__).with_suffix('.yaml'))
    tables = [(wing, table.pop(SHARED, {}), table) for wing, table in tables_of_wings('flags.yaml')]
    of_wings = {
        verb: {**entry, 'room': f'{wing.name}.cli'}
        for wing, _, table in tables
        for verb, entry in table.items()
        if 'summary' in entry
    }
    place = list(core).index(WINGS)
    core.pop(WINGS)
    verbs = dict([*list(core.items())[:place], *of_wings.items(), *list(core.items())[place:]])
    for _, shared, table in tables:
        verbs[SHARED] |= shared
        for verb, entry in table.items():
            if verb in verbs and 'summary' not in entry:  # else one of its own, or of an absent wing
                verbs[verb]['flags'] |= entry['flags']
    return verbs


def examples_of(verb: str) -> str:
    """The examples as the help shows them."""
    return '\n'.join(['examples:', *(f'  swath-sysid {line}' for line in table_of_verbs()[verb]['examples'])])


def add_arguments(parser: ArgumentParser, verb: str) -> None:
    """The flags and sub-verbs of a verb."""
    entry = table_of_verbs()[verb]
    if tasks := entry.get('tasks'):
        parsers = parser.add_subparsers(dest='task', metavar='TASK', required=True)
        for name, task in tasks.items():
            _fill(parsers.add_parser(name, help=task['summary']), task)
    else:
        _fill(parser, entry)


def _fill(parser: ArgumentParser, entry: Mapping[str, Any]) -> None:
    # argparse would take the value -15,10,90 for a flag
    parser._negative_number_matcher = re.compile(r'-[\d.][-\d.,eE]*$')
    parser.epilog = named(entry['epilog_from'])() if 'epilog_from' in entry else entry.get('epilog', '')
    if parser.epilog and '\n' in parser.epilog:
        parser.formatter_class = RawDescriptionHelpFormatter
    _add_flags(parser, entry['flags'])


def _add_flags(parser: Any, flags: Mapping[str, Any]) -> None:
    """Flags to a parser or to a group of one."""
    for words, given in flags.items():
        if words in table_of_verbs()[SHARED]:
            _add_flags(parser, table_of_verbs()[SHARED][words])
        elif words == WINGS:
            _add_flags(parser, given or {})
        elif words in ('either', 'one of'):
            _add_flags(parser.add_mutually_exclusive_group(required=words == 'one of'), given)
        elif words.startswith('group '):
            _add_flags(parser.add_argument_group(words.removeprefix('group ')), given)
        else:
            entry = dict(given) if isinstance(given, dict) else {'help': given}
            flag, *units = words.split()
            for name in ('default', 'choices'):
                if ' ' in str(entry.get(name, '')) and isinstance(entry[name], str):
                    entry[name] = tuple(named(entry[name])) if name == 'choices' else named(entry[name])
            (_add_setting if 'setting' in entry else _add_flag)(parser, flag, units, **entry)


def _add_flag(
    parser: Any, flag: str, units: Sequence[str], help: str | None = None, type: str = '', **entry: Any
) -> None:
    """A flag, or an argument by its place; the units stand for its values in the help."""
    if names := entry.pop('names', None):
        found = named(names)
        found = [each.name for each in fields(found)] if is_dataclass(found) else found
        is_list = isinstance(found, Iterable) and not isinstance(found, str)
        help = str(help).format(names=', '.join(found) if is_list else found)
    if entry.get('default') is not None and type in ('number', 'count'):
        help = f'{help} (default: {entry["default"]})'
    if type:
        entry['type'] = TYPES[type]
    if entry.pop('repeat', False):
        entry |= {'action': 'append', 'default': []}
    if units:
        entry |= {'metavar': units[0]} if len(units) == 1 else {'metavar': tuple(units), 'nargs': len(units)}
    elif flag.startswith('-') and 'choices' not in entry:
        entry['action'] = 'store_true'
    parser.add_argument(flag, help=help, **entry)


def _add_setting(parser: Any, flag: str, _: Sequence[str], setting: str, help: str = '', **entry: Any) -> None:
    """A flag with type, range, unit, default and meaning of a node's parameter (the last two may be replaced)."""
    node_name, name = setting.split()
    parameter = next(p for p in table_of(node_name) if p.name == name)
    usual = tuple(parameter.default) if isinstance(parameter.default, list) else parameter.default
    default = entry.get('default', usual)
    words = help or f'{parameter.meaning[0].lower()}{parameter.meaning[1:]}'
    bounds = f'{parameter.allowed} {parameter.unit}'.rstrip() if parameter.range else ''
    if default is not None:
        each_of = default if isinstance(default, list | tuple) else (default,)
        shown = ','.join(each if isinstance(each, str) else f'{each:g}' for each in each_of)
        bounds = f'{bounds}; default: {shown}' if bounds else f'default: {shown}'
    words = f'{words} ({bounds})' if bounds else words
    if parameter.choices:
        parser.add_argument(flag, choices=tuple(parameter.choices), default=default, help=words)
    else:
        unit = 'N' if isinstance(parameter.default, int) else parameter.unit.upper() or 'VALUE'
        metavar = f'{unit},...' if isinstance(parameter.default, list) else unit
        parser.add_argument(flag, type=_converter(parameter), default=default, metavar=metavar, help=words)


def _converter(parameter: NodeParameter) -> Callable[[str], Any]:
    """From a text of the command line to a checked value; a list in its order, each value once."""

    def value(text: str) -> Any:
        kind = type(parameter.default)
        try:
            found = tuple(sorted(set(numbers(text)))) if kind is list else int(text) if kind is int else finite(text)
        except ValueError as error:
            raise ArgumentTypeError(f"'{text}' is not a {'whole ' if kind is int else ''}number") from error
        problem = parameter.problem(found)
        if problem:
            raise ArgumentTypeError(problem)
        return found

    return value


def finite(text: str) -> float:
    """A number for argparse that is neither NaN nor infinite."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f'{text} is not finite')
    return value


def not_negative(text: str) -> float:
    """A finite number for argparse that is not below zero."""
    value = finite(text)
    if value < 0.0:
        raise ArgumentTypeError('must not be negative')
    return value


def numbers(text: str) -> tuple[float, ...]:
    """Finite numbers for argparse, separated by commas."""
    try:
        return tuple(finite(part) for part in text.split(','))
    except ValueError as error:
        raise ArgumentTypeError(f"'{text}' is not a list of numbers separated by commas") from error


def positive(text: str) -> float:
    """A finite number for argparse above zero."""
    value = finite(text)
    if value <= 0.0:
        raise ArgumentTypeError('must be positive')
    return value


def _limits(text: str) -> tuple[float, ...]:
    """Two angles, deg, as rad; infinite for zero, which is no limit."""
    parts = numbers(text)
    if len(parts) != 2 or min(parts) < 0.0:
        raise ArgumentTypeError('give two values that are not negative: ROLL,PITCH')
    return tuple(math.radians(part) or math.inf for part in parts)


def _mounting(text: str) -> tuple[float, ...]:
    """Roll, pitch and yaw, deg, as rad."""
    angles = numbers(text.strip('[]'))
    if len(angles) != 3 or max(map(abs, angles)) > 180.0:
        raise ArgumentTypeError('give three angles of -180 to 180 deg: ROLL,PITCH,YAW, as in 15,-10,90')
    return tuple(map(math.radians, angles))


def _point(text: str) -> Any:
    name, colon, place = text.partition(':')
    if not (colon and name.isidentifier()):
        raise ArgumentTypeError(f"'{text}' is not a point: write NAME:x,y,z with a name of letters, digits and _")
    coordinates = numbers(place)
    if len(coordinates) != 3:
        raise ArgumentTypeError(f"'{text}' is not a point: give three coordinates in m, NAME:x,y,z")
    from swath_sysid.attitude.prediction.point import Point  # numpy, which the help does without

    return Point(name, coordinates)


#: Of the values of flags, as the table names them.
TYPES: dict[str, Callable[[str], Any]] = {
    'number': finite,
    'real': float,
    'count': int,
    'whole': int,
    'positive': positive,
    'not_negative': not_negative,
    'limits': _limits,
    'mounting': _mounting,
    'point': _point,
}
