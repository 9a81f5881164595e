"""The table of parameters (parameters.yaml), which declares, checks and documents them and writes config/."""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

from swath_sysid.common.advice import did_you_mean
from swath_sysid.common.errors import InputError
from swath_sysid.common.wings import handed_in, named, tables_of_wings, yaml_table

Values = dict[str, Any]
Table = tuple['NodeParameter', ...]

POSITION = 'points.'  #: Begins the name of the parameter that holds the position of a point.
EXAMPLE = ' (m forward, to port and up from the sensor), as in [2.5, 0.0, 0.0]'

ATTITUDE_NODES = ('imu_buffer', 'identifier', 'predictor')
NODES = (*ATTITUDE_NODES, *handed_in('nodes'), 'simulated_craft')
#: Parameters that every node of ROS has, of none of which it warns.
OF_ROS = re.compile(r'use_sim_time$|start_type_description_service$|qos_overrides\.')
AS = 'as '  #: Begins, in place of a parameter's fields, the node that has the same parameter.


@dataclass(frozen=True)
class NodeParameter:
    """One parameter of a node; its fields are documented at the top of parameters.yaml."""

    name: str
    default: Any
    meaning: str
    unit: str = ''
    range: Collection[float] = ()
    choices: Collection[str] = ()
    read_only: bool = False

    @property
    def allowed(self) -> str:
        """The allowed values, for people."""
        if self.choices:
            return ', '.join(self.choices)
        return ' to '.join(str(bound) if isinstance(bound, int) else f'{bound:g}' for bound in self.range)

    def problem(self, value: Any) -> str:
        """What is wrong with a value; empty where it is allowed."""
        if repr(value) == repr(self.default):  # also NaN, which is in no range
            return ''
        for element in value if isinstance(value, list | tuple) else [value]:
            if self.choices and element not in self.choices:
                return f"cannot be '{element}': choose from {self.allowed}"
            if self.range and not min(self.range) <= element <= max(self.range):
                return f'cannot be {element:g}: give {self.allowed} {self.unit}'.rstrip()
        return ''


def node_module(node_name: str) -> str:
    """The module of a node, or of any other of the room ``nodes``, by its name."""
    return f'swath_sysid.{handed_in("nodes").get(node_name, f"nodes.{node_name}")}'


@cache
def table_of(node_name: str) -> Table:
    """The parameters of a node, one of `NODES`; those of named points as ``points.NAME``."""
    sections = _sections()
    return tuple(
        _parameter(name, fields)
        for nodes, parameters in sections.items()
        if node_name in nodes.split(', ')
        for name, fields in parameters.items()
    )


@cache
def _sections() -> dict[str, dict[str, Any]]:
    core = yaml_table(Path(__file__).with_name('parameters.yaml'))
    return core | {nodes: table for _, wing in tables_of_wings('parameters.yaml') for nodes, table in wing.items()}


def _parameter(name: str, fields: dict | str) -> NodeParameter:
    if isinstance(fields, str):
        return next(p for p in table_of(fields.removeprefix(AS)) if p.name == name)
    choices = fields.get('choices', ())
    return NodeParameter(name, **{**fields, 'choices': tuple(named(choices)) if isinstance(choices, str) else choices})


@cache
def every_name() -> frozenset[str]:
    """The parameters of all nodes: one file often serves them all."""
    return frozenset(parameter.name for node in NODES for parameter in table_of(node))


def meant(word: str, known: Iterable[str]) -> str:
    """Which known name a word can only mean; empty where it may well be a name of another package."""
    # groups, but for that of the positions, are of other packages
    return '' if '.' in word else next(iter(get_close_matches(word, sorted(known), 1, 0.8)), '')


def parameters_of(node_name: str, values: Values | None = None) -> Table:
    """What a node declares for these values, with the parameters of each point that they name."""
    table = []
    for parameter in table_of(node_name):
        group, dot, _ = parameter.name.partition('.')
        names = _names(group, values or {}) if dot else ()
        table += [replace(parameter, name=f'{group}.{name}') for name in names] if dot else [parameter]
    return tuple(table)


def _names(group: str, values: Values) -> list[str]:
    names = [name for name in values.get(group, ()) if name]
    for name in names:
        if not re.fullmatch(r'[a-z][a-z0-9_]*', name) or names.count(name) > 1:
            raise InputError(
                f"the parameter {group} cannot hold '{name}': give each point its own name of lower-case letters, "
                'digits and underscores'
            )
    return names


def check_points(values: Values, given: Iterable[str]) -> None:
    """Raise `InputError` unless each named point has its position among the parameters of the names ``given``, and each
    position its point: a point without one would be at the sensor, unnoticed.
    """
    if 'points' not in values:
        return
    named = _names('points', values)
    placed = [name.removeprefix(POSITION) for name in given if name.startswith(POSITION)]
    strays = {name.lower(): name for name in placed if name not in named}
    for name in named:
        if name not in placed:
            near = get_close_matches(name, strays, 1)
            cure = f'points.{strays[near[0]]} is given; did you mean' if near else 'add the parameter'
            raise InputError(f'the point {name} has no position: {cure} points.{name}' + ('?' if near else EXAMPLE))
    for stray in strays.values():
        meant = did_you_mean(stray, named)
        raise InputError(f'points.{stray} is the position of no point{meant}: add {stray} to points, or remove it')


def defaults(node_name: str, values: Values | None = None) -> Values:
    """Name to default value of a node's parameters, see `parameters_of`."""
    return {parameter.name: parameter.default for parameter in parameters_of(node_name, values)}


def check(node_name: str, values: Values) -> None:
    """Raise `InputError` unless every value is allowed."""
    for parameter in parameters_of(node_name, values):
        if problem := parameter.problem(values[parameter.name]):
            raise InputError(f'the parameter {parameter.name} {problem}')
