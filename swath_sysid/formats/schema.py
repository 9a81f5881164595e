"""One schema for texts that anyone may have written: plain data of YAML, and dataclasses that say what is checked.

Size, depth and number of values are limited before anything is built. Aliases, tags, directives and repeated names
are rejected; dates stay text.

A check takes a value of plain data and its place, and returns what to use or raises an `InputError`. A field annotated
``Annotated[float, number(above=0.0)]`` has that check; plain annotations have their own.
"""

import difflib
import math
import os
import re
import stat
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import yaml

from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import finite_or_none
from swath_sysid.formats.files import LONGEST_SHOWN, as_utf_8, shown

LARGEST_TEXT = 256 * 1024  #: Bytes. A model of both axes scheduled on five drafts has about 32,000.
DEEPEST = 20  #: Lists and mappings inside each other; the deepest that is written here has nine.
MAX_VALUES = 8_000  #: A model of both axes scheduled on five drafts has about 2,200; that many are read within 25 ms.
LONGEST_NUMBER = 40  #: Characters; a float has at most 24, and nothing that is counted here has 39 digits.


_PARSER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
_NULLS = {'', '~', 'null', 'Null', 'NULL'}
# those of YAML 1.1, as ROS parameter files use them
_TRUE = {'true', 'True', 'TRUE', 'yes', 'Yes', 'YES', 'on', 'On', 'ON'}
_FALSE = {'false', 'False', 'FALSE', 'no', 'No', 'NO', 'off', 'Off', 'OFF'}
_INTEGER = re.compile(r'[-+]?[0-9]+')
_FLOAT = re.compile(r'[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?')
_NOT_FINITE = re.compile(r'[-+]?\.(?:inf|Inf|INF|nan|NaN|NAN)')
_LIKE_A_NUMBER = re.compile(r'[-+]?\.?[0-9][-+.0-9eE]*')
_DIRECTIVE = re.compile(r'^%', re.MULTILINE)


def text_of(path: str | Path, what: str = 'model file') -> str:
    """Text of a file, of which the errors say what it should be."""
    try:
        # before it is opened: a pipe would wait for ever
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            kind = 'a folder' if stat.S_ISDIR(status.st_mode) else 'a special file'
            raise InputError(f'{path} is {kind}, not a {what}: give the name of the file')
        with open(path, 'rb') as file:
            content = file.read(LARGEST_TEXT + 1)
    except OSError as error:
        raise InputError(f'cannot read the {what} {path}: {error.strerror}') from error
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f'cannot read the {what} {shown(repr(str(path)))}: no file has such a name') from error
    if len(content) > LARGEST_TEXT:
        raise InputError(f'{path} is not a {what}: it is larger than {LARGEST_TEXT // 1024} kB')
    try:
        return content.decode('utf-8')
    except UnicodeDecodeError as error:
        raise InputError(f'{path} is not a {what}: it is not text in UTF-8') from error


def plain_content(text: str, source: str, nan: bool = False) -> Any:
    """Plain data of any YAML text, whose source the errors name; names are texts, numbers finite or, if asked, NaN."""
    _check_text(text, source)
    try:
        events = _checked(yaml.parse(text, Loader=_PARSER), source)
        root = next(events, None)
        content = None if root is None else _value(root, events, (source,), nan)
        if next(events, None) is not None:
            raise InputError(f'{source}: a second document begins: give one alone')
        return content
    except yaml.YAMLError as error:
        # what is missing at the end is missing in the last line
        last = max(1, len(text.splitlines()))
        line = min(getattr(getattr(error, 'problem_mark', None), 'line', 0) + 1, last)
        what = getattr(error, 'problem', None) or 'it holds characters that no text has'
        if 'nesting depth' in what:
            # since PyYAML 6.0.4 the library itself refuses what is much deeper
            raise _too_deep(source) from error
        raise InputError(f'{source}, line {line} is not YAML ({what}): check indentation, colons and quotes') from error


def _too_deep(source: str) -> InputError:
    return InputError(f'{source}: nested more than {DEEPEST} deep: this is not a file of this software')


def _value(event: yaml.Event, events: Iterator[yaml.Event], path: tuple[str, ...], nan: bool) -> Any:
    """The value that begins with an event; the path is that of names to it, behind the source."""
    # recursion is safe here: the depth is limited
    if isinstance(event, yaml.ScalarEvent):
        return _scalar_value(event, path, nan)
    if isinstance(event, yaml.SequenceStartEvent):
        items: list[Any] = []
        while not isinstance(item := next(events), yaml.CollectionEndEvent):
            items.append(_value(item, events, (*path, str(len(items) + 1)), nan))
        return items
    found: dict[str, Any] = {}
    while not isinstance(item := next(events), yaml.CollectionEndEvent):
        name = _scalar_value(item, path) if isinstance(item, yaml.ScalarEvent) else None
        if not isinstance(name, str):
            raise InputError(f'{_place(path)}: names must be texts')
        if name in found:
            raise InputError(f"{_place(path)}: '{shown(name)}' is given twice: leave one out")
        found[name] = _value(next(events), events, (*path, name), nan)
    return found


def _place(path: tuple[str, ...]) -> str:
    source, *names = path
    return source + ''.join(f', {shown(name)}' for name in names)[-LONGEST_SHOWN:]


def _scalar_value(event: yaml.ScalarEvent, path: tuple[str, ...], nan: bool = False) -> str | int | float | bool | None:
    """The value of a scalar: text, finite number, bool, or None."""
    text = event.value
    if event.style not in (None, ''):
        return text
    if text in _NULLS:
        return None
    if text in _TRUE or text in _FALSE:
        return text in _TRUE
    if len(text) > LONGEST_NUMBER:
        if _LIKE_A_NUMBER.fullmatch(text):
            raise InputError(f'{_place(path)}: {shown(text)} has {len(text)} characters: {LONGEST_NUMBER} are enough')
        return text
    if _INTEGER.fullmatch(text):
        return int(text)
    if nan and text.lower() == '.nan':
        return float('nan')
    if _NOT_FINITE.fullmatch(text):
        raise InputError(f'{_place(path)}: {text} is not a finite number: write null for what is not known')
    if not _FLOAT.fullmatch(text):
        return text
    value = float(text)
    if value in (float('inf'), -float('inf')):
        raise InputError(f'{_place(path)}: {text} is not a finite number: it is too large')
    return value


def dumped(content: Any) -> str:
    """YAML text without anchors that `plain_content` reads back; numbers that are not finite become null."""
    return yaml.dump(finite_or_none(content), Dumper=_PlainDumper, sort_keys=False, default_flow_style=None, width=120)


class _PlainDumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        return True


_PlainDumper.add_representer(str, lambda dumper, text: dumper.represent_scalar('tag:yaml.org,2002:str', as_utf_8(text)))
# texts that would be read back as numbers are quoted, also those that YAML 1.1 takes for texts, such as 1e5
_PlainDumper.add_implicit_resolver('tag:yaml.org,2002:float', _LIKE_A_NUMBER, list('-+.0123456789'))


def _check_text(text: str, source: str) -> None:
    try:
        size = len(text.encode('utf-8'))
    except UnicodeEncodeError as error:
        raise InputError(f'{source} is not YAML: it holds characters that no text has') from error
    if size > LARGEST_TEXT:
        raise InputError(f'{source} is larger than {LARGEST_TEXT // 1024} kB: this is not a file of this software')
    # a text of nothing but %TAG costs the parser seconds
    if _DIRECTIVE.search(text):
        raise InputError(f'{source}: directives (lines that begin with %) are not understood: leave them out')


def _checked(events: Iterable[yaml.Event], source: str) -> Iterator[yaml.Event]:
    """The events of values, refused where there are too many, too deep, or of a kind that is not understood."""
    values = depth = 0
    for event in events:
        if isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
            yield event
        elif isinstance(event, yaml.NodeEvent):
            values += 1
            depth += isinstance(event, yaml.CollectionStartEvent)
            tag = getattr(event, 'tag', None)
            if event.anchor is not None:
                raise InputError(f'{source}: anchors (&) and aliases (*) are not understood: write the values out')
            if tag is not None:
                raise InputError(f'{source}: the tag {shown(tag)} is not understood: leave it out')
            if values > MAX_VALUES:
                raise InputError(f'{source}: more than {MAX_VALUES} values: this is not a file of this software')
            if depth > DEEPEST:
                raise _too_deep(source)
            yield event


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
