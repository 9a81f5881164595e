"""One schema for all texts: dataclasses, whose annotations say how the values of their fields are checked.

A check takes a value of plain data and its place, and returns what to use or raises an `InputError`. A field annotated
``Annotated[float, number(above=0.0)]`` has that check; plain annotations have their own.
"""

import difflib
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, fields, is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

from swath_sysid.common.errors import InputError
from swath_sysid.formats.input_files import LONGEST_SHOWN, shown

Built = TypeVar('Built')
Check = Callable[[Any, str], Any]  #: Of a value and its place in the file.

LONGEST_TEXT = 200


def number(lowest: float = -math.inf, highest: float = math.inf, above: float | None = None) -> Check:
    """A finite number, within limits, as float."""

    def check(value: Any, where: str) -> Any:
        # a bool is an int to Python
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{where}: '{shown(value)}' is not a number")
        if above is not None and not value > above:
            raise InputError(f'{where} must be greater than {above:g}, not {shown(value)}')
        if not lowest <= value <= highest:
            limits = f'be at most {highest:g}' if lowest == -math.inf else f'lie within {lowest:g} and {highest:g}'
            raise InputError(f'{where} must {limits}, not {shown(value)}')
        return float(value)

    return check


def text(longest: int = LONGEST_TEXT) -> Check:
    """A text on one line that is not too long."""

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, str):
            raise InputError(f"{where}: '{shown(value)}' is not text: write it in quotes")
        if len(value) > longest or not value.isprintable():
            raise InputError(f"{where}: '{shown(value)}' is not a name: at most {longest} characters on one line")
        return value

    return check


def one_of(choices: Collection[str], kind: str | None = None) -> Check:
    """One of some texts; errors may call them by their kind."""

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, str) or value not in choices:
            if kind is not None:
                raise InputError(f"{where}: there is no {kind} '{shown(value)}': choose from {', '.join(choices)}")
            raise InputError(f"{where}: '{shown(value)}' must be one of {', '.join(map(repr, choices))}")
        return value

    return check


def whole(lowest: int) -> Check:
    """A whole number from a lowest on."""

    def check(value: Any, where: str) -> Any:
        found = number(lowest)(value, where)
        if found != int(found):
            raise InputError(f'{where} must be a whole number from {lowest}, not {shown(value)}')
        return int(found)

    return check


def anything(value: Any, where: str) -> Any:
    """Whatever it is; checked elsewhere."""
    return value


def if_known(description: Check, unknown: Any = math.nan) -> Check:
    """What a description says, or null for what is not known."""
    return lambda value, where: unknown if value is None else description(value, where)


def list_of(description: Check, length: int | None = None, build: Callable = tuple) -> Check:
    """A list of like items, built to a tuple or an array."""

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, list) or length not in (None, len(value)):
            counted = '' if length is None else f' of {length} items'
            raise InputError(f"{where}: '{shown(value)}' must be a list{counted}")
        return build([description(item, f'{where}, {k}') for k, item in enumerate(value, 1)])

    return check


def one_or_more(description: Check) -> Check:
    """A list of like items, of which a single one may stand alone."""

    def check(value: Any, where: str) -> Any:
        items = value if isinstance(value, list) else [value]
        if not items or isinstance(value, dict):
            raise InputError(f"{where}: '{shown(value)}' must be a list of names")
        return list_of(description)(items, where)

    return check


def table_of(checks: Mapping[str, Check], kind: str) -> Check:
    """Values by some of the names of a kind, in the order given."""

    def check(value: Any, where: str) -> Any:
        for name in mapping(value, where):
            if name not in checks:
                raise InputError(f"{where}: there is no {kind} '{shown(name)}'; choose from {', '.join(checks)}")
        return {name: checks[name](item, f'{where}, {name}') for name, item in value.items()}

    return check


def mapping(value: Any, where: str) -> dict:
    """Anything by name; what it holds is plain data already."""
    if not isinstance(value, dict):
        raise InputError(f"{where}: '{shown(value)}' must map names to values")
    return value


def named(checks: Mapping[str, Check], required: Collection[str] = (), build: Callable[..., Any] = dict) -> Check:
    """Some of the fields of these names, built to a dict or something else."""

    def check(value: Any, where: str) -> Any:
        if not isinstance(value, dict):
            raise InputError(f"{where}: '{shown(value)}' must be names and values; fields are {', '.join(checks)}")
        for name in value:
            if name not in checks:
                close = difflib.get_close_matches(name[:LONGEST_SHOWN], checks, 1)
                meant = f" '{close[0]}' is meant?" if close else ''
                raise InputError(f"{where}: unknown field '{shown(name)}';{meant} fields are {', '.join(checks)}")
        for name in required:
            if name not in value:
                raise InputError(f"{where}: the field '{name}' is missing")
        found = {name: checks[name](item, f'{where}, {name}') for name, item in value.items()}
        return built(lambda: build(**found), where)

    return check


def record(kind: Any, **checks: Check) -> Check:
    """A dataclass, given as names and values; checks by name take the place of those that its annotations say."""
    hints = get_type_hints(kind, include_extras=True)
    known = {each.name: checks.get(each.name) or check_of(hints[each.name]) for each in fields(kind)}
    needed = [each.name for each in fields(kind) if each.default is MISSING and each.default_factory is MISSING]
    return named(known, needed, kind)


def check_of(annotation: Any) -> Check:
    """The check of what a field is annotated as."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return arguments[1]
    if origin in (Union, UnionType):
        (known,) = (each for each in arguments if each is not NoneType)
        return if_known(check_of(known), None)
    if origin is tuple:
        return list_of(check_of(arguments[0]), None if arguments[-1] is Ellipsis else len(arguments))
    if is_dataclass(annotation):
        return record(annotation)
    return {float: number(), str: text(), dict: mapping}.get(origin or annotation, anything)


def built(build: Callable[[], Built], where: str) -> Built:
    """What the core makes of it, with the place added to its errors."""
    try:
        return build()
    except InputError as error:
        raise InputError(f'{where}: {error}') from error
