"""The sections of a parameter file, read without ROS as ROS does."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.schema import plain_content, text_of
from swath_sysid.nodes.parameters.table import Values

OPTION = '-p'  #: Source of what is given on the command line, to our nodes only.
WILDCARDS = {'*': '/[^/]+', '**': '(/[^/]+)*'}


@dataclass(frozen=True)
class Section:
    """Parameters as they are given to nodes of some names."""

    source: str  #: File, for messages.
    name: str  #: Full name of a node, such as ``/usv/predictor``; ``*`` is one part of it, ``**`` any number of parts.
    parameters: Values  #: By name, those of groups as ``GROUP.NAME``.

    def holds_for(self, full_name: str) -> bool:
        """Whether it is for the node of this name."""
        parts = self.name.strip('/').split('/')
        return bool(re.fullmatch(''.join(WILDCARDS.get(part, f'/{re.escape(part)}') for part in parts), full_name))


def sections_of(path: str | Path) -> list[Section]:
    """The sections of a parameter file, in its order, in which the later takes precedence."""
    content = plain_content(text_of(path, 'parameter file'), str(path), nan=True)
    if not content or not isinstance(content, dict):
        raise InputError(f'{path} is not a ROS parameter file: it needs a section for a node, with ros__parameters')
    return list(_sections(str(path), '', content))


def _sections(path: str, name: str, content: Values) -> Iterator[Section]:
    for key, value in content.items():
        inner = f'{name}/{key.strip("/")}'
        if not isinstance(value, dict) or not value:
            is_known = key == 'ros__parameters'
            what = f'the ros__parameters of {shown(name)} hold none' if is_known else f'{shown(inner)} has none'
            raise InputError(f'{path} is not a ROS parameter file: every section needs ros__parameters, and {what}')
        if key == 'ros__parameters':
            yield Section(path, name, dict(_by_name(value)))
        else:
            yield from _sections(path, inner, value)


def _by_name(group: Values, before: str = '') -> Iterator[tuple[str, Any]]:
    for name, value in group.items():
        if isinstance(value, dict):
            yield from _by_name(value, f'{before}{name}.')
        else:
            yield f'{before}{name}', value
