"""Plain data from a YAML text that anyone may have written.

Size, depth and number of values are limited before anything is built. Aliases, tags, directives and repeated names
are rejected; dates stay text.
"""

import os
import re
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import yaml

from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import finite_or_none
from swath_sysid.formats.input_files import LONGEST_SHOWN, shown

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


def plain_content(text: str, source: str) -> Any:
    """Plain data of any YAML text, whose source the errors name; names are texts, numbers finite."""
    _check_text(text, source)
    try:
        events = _checked(yaml.parse(text, Loader=_PARSER), source)
        root = next(events, None)
        content = None if root is None else _value(root, events, (source,))
        if next(events, None) is not None:
            raise InputError(f'{source}: a second document begins: give one alone')
        return content
    except yaml.YAMLError as error:
        # what is missing at the end is missing in the last line
        last = max(1, len(text.splitlines()))
        line = min(getattr(getattr(error, 'problem_mark', None), 'line', 0) + 1, last)
        what = getattr(error, 'problem', None) or 'it holds characters that no text has'
        raise InputError(f'{source}, line {line} is not YAML ({what}): check indentation, colons and quotes') from error


def _value(event: yaml.Event, events: Iterator[yaml.Event], path: tuple[str, ...]) -> Any:
    """The value that begins with an event; the path is that of names to it, behind the source."""
    # recursion is safe here: the depth is limited
    if isinstance(event, yaml.ScalarEvent):
        return _scalar_value(event, path)
    if isinstance(event, yaml.SequenceStartEvent):
        items: list[Any] = []
        while not isinstance(item := next(events), yaml.CollectionEndEvent):
            items.append(_value(item, events, (*path, str(len(items) + 1))))
        return items
    found: dict[str, Any] = {}
    while not isinstance(item := next(events), yaml.CollectionEndEvent):
        name = _scalar_value(item, path) if isinstance(item, yaml.ScalarEvent) else None
        if not isinstance(name, str):
            raise InputError(f'{_place(path)}: names must be texts')
        if name in found:
            raise InputError(f"{_place(path)}: '{shown(name)}' is given twice: leave one out")
        found[name] = _value(next(events), events, (*path, name))
    return found


def _place(path: tuple[str, ...]) -> str:
    source, *names = path
    return source + ''.join(f', {shown(name)}' for name in names)[-LONGEST_SHOWN:]


def _scalar_value(event: yaml.ScalarEvent, path: tuple[str, ...]) -> str | int | float | bool | None:
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
                raise InputError(f'{source}: nested more than {DEEPEST} deep: this is not a file of this software')
            yield event
