"""Parameters from files and the command line, checked; config/swath_sysid.yaml written."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from swath_sysid.common.advice import did_you_mean
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.nodes.parameters.sections import OPTION, Section, sections_of
from swath_sysid.nodes.parameters.table import (
    NODES,
    OF_ROS,
    POSITION,
    Values,
    check_points,
    defaults,
    every_name,
    meant,
    parameters_of,
    table_of,
)


def check_sections(sections: Sequence[Section], full_names: Mapping[str, str]) -> None:
    """Raise `InputError` for what is nearly one of our nodes or parameters, and for a file
    without anything for our nodes, which have these full names. What is for other nodes is left alone.
    """
    for section in sections:
        if nodes := [node for node, name in full_names.items() if section.holds_for(name)]:
            _check_names(section, nodes)
        else:
            _check_node(section)
    ours = {section.source for section in sections if any(map(section.holds_for, full_names.values()))}
    for section in sections:
        if section.source not in ours and section.source != OPTION:
            raise InputError(
                f'{section.source} has no section for any of these nodes, only for others such as '
                f'{shown(section.name)}: name one /** or {next(iter(full_names.values()))}'
            )


def _check_names(section: Section, nodes: Sequence[str]) -> None:
    is_for_all = section.name.endswith('*')
    known = every_name() if is_for_all else dict.fromkeys(p.name for node in nodes for p in table_of(node))
    for name in section.parameters:
        if name in known or OF_ROS.match(name) or (name.startswith(POSITION) and 'points' in known):
            continue
        near = meant(name, known)
        if not is_for_all:
            raise InputError(
                f'{section.source}: {nodes[0]} has no parameter {shown(name)}{did_you_mean(name, known)}; it has '
                + ', '.join(known)
            )
        # a section for all nodes may be for those of other packages as well
        if near or section.source == OPTION:
            hint = f': did you mean {near}?' if near else '; config/swath_sysid.yaml lists all'
            raise InputError(f'{section.source}: no node has a parameter {shown(name)}{hint}')


def _check_node(section: Section) -> None:
    # a second node may be a number more
    node = section.name.rpartition('/')[2].rstrip('_0123456789')
    own = meant(node, NODES)
    # a node of another package may have a similar name, but not similar parameters
    if own and own != node and any(meant(name, {p.name for p in table_of(own)}) for name in section.parameters):
        raise InputError(f'{section.source}: there is no node {shown(node)}: did you mean {own}?')


def values_of(sections: Iterable[Section], node_name: str, full_name: str) -> Values:
    """A node's parameters as the sections set them."""
    values = defaults(node_name)
    given = {
        name: (section.source, value)
        for section in sections
        if section.holds_for(full_name)
        for name, value in section.parameters.items()
    }
    # the parameters of points exist only once `points` names them
    for name, (source, value) in sorted(given.items(), key=lambda item: item[0] not in values):
        if name in values:
            values[name] = _of_type(values[name], value, name, source)
            values = {**defaults(node_name, values), **values}
    try:
        check_points(values, given)
    except InputError as error:
        raise InputError(f'{", ".join(dict.fromkeys(source for source, _ in given.values()))}: {error}') from error
    return values


def values_from_file(path: str | Path | None, node_name: str) -> Values:
    """A node's parameters as a ROS parameter file sets them, in the namespace that it names."""
    sections = [] if path is None else sections_of(path)
    namespace = _namespace_of(sections)
    full_names = {node: f'{namespace}/{node}' for node in NODES}
    check_sections(sections, full_names)
    return values_of(sections, node_name, full_names[node_name])


def _namespace_of(sections: Sequence[Section]) -> str:
    split = [section.name.rpartition('/')[::2] for section in sections]
    found = sorted({namespace for namespace, node in split if node in NODES and '*' not in namespace})
    if len(found) > 1 and '' not in found:
        raise InputError(
            f'{sections[0].source} has parameters for nodes in {" and ".join(found)}: leave those of a single craft'
        )
    return '' if '' in found or not found else found[0]


def _of_type(default: Any, value: Any, name: str, source: str) -> Any:
    kind = type(default[0]) if isinstance(default, list) else type(default)
    elements = value if isinstance(value, list) else [value]
    kinds = {type(element) for element in elements}
    # a list of ints and floats is none to ROS
    if isinstance(value, list) != isinstance(default, list) or not (kinds <= {kind} or (kind, kinds) == (float, {int})):
        example = ', as in [15.0, -10.5]' if kinds == {int, float} else ''
        raise InputError(
            f'{source}: the parameter {name} must be of the type of {default}{example}, not {shown(value)}'
        )
    return [kind(element) for element in elements] if isinstance(value, list) else kind(value)


def configuration_file() -> str:
    """Text of config/swath_sysid.yaml: every parameter with its default, section by node."""
    lines = [
        '# Every parameter of the nodes with its default; written from swath_sysid/nodes/parameters/parameters.yaml.'
    ]
    for node_name in NODES:
        lines += ['', f'/**/{node_name}:', '  ros__parameters:']
        for parameter in parameters_of(node_name):
            allowed = f' ({f"{parameter.allowed} {parameter.unit}".rstrip()})' if parameter.allowed else ''
            lines.append(f'    # {parameter.meaning}{allowed}')
            lines.append(f'    {parameter.name}: {yaml_value(parameter.default)}')
    return '\n'.join(lines) + '\n'


def yaml_value(value: Any) -> str:
    """A value as a parameter file holds it."""
    return yaml.safe_dump(value, default_flow_style=True).replace('\n...', '').strip()
