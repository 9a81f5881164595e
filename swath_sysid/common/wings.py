"""Wings: folders of the package with a `wing.py`, whose ``WING`` hands them in to the rooms of the core.

The core names no wing: one that is deleted is missed by nobody but its users.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

PACKAGE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Wing:
    """What a wing hands in. Its verbs, parameters and sentences are in tables beside its `wing.py`: ``flags.yaml``,
    ``parameters.yaml`` and ``sentences.yaml``; verbs are modules of its room ``cli``. References are
    ``MODULE FUNCTION`` below the package, and are loaded only when they are asked for.
    """

    name: str  #: Its folder.
    order: int  #: Among the wings, where their verbs and nodes are listed.
    nodes: Mapping[str, str] = field(default_factory=dict)  #: Name of a node to its module.
    other_nodes: Sequence[str] = ()  #: Those that its verbs start, as ``config/sros2_policy.xml`` names them.
    topics: Mapping[str, str] = field(default_factory=dict)  #: Published topics, or how their names begin, to types.
    other_types: Mapping[str, str] = field(default_factory=dict)  #: Types of subscribed topics and services.
    model_parameters: Mapping[str, str] = field(default_factory=dict)  #: Node to its parameter that names a model file.
    read_model: str = ''  #: Takes the path of such a file; raises `InputError`.
    papers: Mapping[str, str] = field(default_factory=dict)  #: Study to what repeats it: its page, and its data.
    warm_up: str = ''  #: Runs what takes long to load and to compile.
    plays_bag: str = ''  #: Takes the arguments of ``play-through``; see `manoeuvring.cli.play_bag`.
    tables_of_fit: str = ''  #: Takes the arguments of ``identify``; returns what makes tables of the result.
    runs_beside: str = ''  #: Takes the arguments of ``run``; returns the contexts of what runs beside its nodes.
    shown_in_demo: str = ''  #: Takes a folder; prints what ``demo`` shows before its release, with its pictures there.
    trials_shown: str = ''  #: Takes a manifest; returns the rows and the sentences that the page shows.


@cache
def wings() -> tuple[Wing, ...]:
    """The wings that are here, in their order."""
    names = sorted(path.parent.name for path in PACKAGE.glob('*/wing.py'))
    found = [import_module(f'swath_sysid.{name}.wing').WING for name in names]
    return tuple(sorted(found, key=lambda wing: wing.order))


def handed_in(what: str) -> dict[str, str]:
    """A mapping of that name of all wings in one."""
    return {key: value for wing in wings() for key, value in getattr(wing, what).items()}


def offered(what: str) -> list[Any]:
    """What the wings' references of that name stand for."""
    return [named(reference) for wing in wings() if (reference := getattr(wing, what))]


def named(reference: str) -> Any:
    """What ``MODULE NAME NAME`` stands for, in a module of this package."""
    module, *names = reference.split()
    found = import_module(f'swath_sysid.{module}')
    for name in names:
        found = getattr(found, name)
    return found


def yaml_table(path: Path) -> dict[str, Any]:
    """The content of one of the package's own tables."""
    return yaml.load(path.read_text(encoding='utf-8'), getattr(yaml, 'CSafeLoader', yaml.SafeLoader))


def tables_of_wings(file_name: str) -> Iterator[tuple[Wing, dict[str, Any]]]:
    """Each wing that has a table of that name, with the table."""
    for wing in wings():
        path = PACKAGE / wing.name / file_name
        if path.is_file():
            yield wing, yaml_table(path)
