"""Flags of settings that a parameter of a node makes too: the table of parameters says what they are."""

import math
import os
from argparse import ArgumentParser, ArgumentTypeError
from collections.abc import Callable
from typing import Any

from swath_sysid.nodes.parameters.table import NodeParameter, table_of

OF_TABLE = object()


def add_setting(
    parser: ArgumentParser, flag: str, node_name: str, name: str, default: Any = OF_TABLE, meaning: str = ''
) -> None:
    """Add a flag with type, range, unit, default and meaning of a node's parameter (the last two may be replaced)."""
    parameter = next(p for p in table_of(node_name) if p.name == name)
    if default is OF_TABLE:
        default = tuple(parameter.default) if isinstance(parameter.default, list) else parameter.default
    words = meaning or f'{parameter.meaning[0].lower()}{parameter.meaning[1:]}'
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


def add_jobs_argument(parser: ArgumentParser) -> None:
    """``--jobs``."""
    parser.add_argument(
        '--jobs', type=int, default=os.cpu_count(), metavar='N', help='processes (default: one per core)'
    )


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


def add_number(
    parser: Any, flag: str, unit: str, meaning: str, default: float | None = None, kind: Callable = finite
) -> None:
    """Add a flag that takes a number, with its default in its help; the parser may be a group of one."""
    words = meaning if default is None else f'{meaning} (default: {default})'
    parser.add_argument(flag, type=kind, default=default, metavar=unit, help=words)


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
