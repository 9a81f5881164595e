"""Parameter files: read without ROS; config/swath_sysid.yaml written."""

from pathlib import Path
from typing import Any

import yaml

from swath_sysid.common.advice import did_you_mean
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.schema import plain_content, text_of
from swath_sysid.nodes.parameters.table import NODES, POSITION, Values, check_points, defaults, parameters_of


def values_from_file(path: str | Path | None, node_name: str) -> Values:
    """A node's parameters as a ROS parameter file sets them (``/**``, ``NAME``, ``/NAME``, ``/**/NAME``)."""
    values = defaults(node_name)
    given: dict[str, tuple[str, Any]] = {}  # with the section that sets it
    for section, content in _sections(path).items() if path is not None else ():
        if section in ('/**', node_name, f'/{node_name}', f'/**/{node_name}'):
            given |= {name: (section, value) for name, value in content.items()}
    # the parameters of points exist only once `points` names them
    for name, (section, value) in sorted(given.items(), key=lambda item: item[0] not in values):
        if name in values:
            values[name] = _of_type(values[name], value, name, path)
            values = {**defaults(node_name, values), **values}
        elif section != '/**' and name != 'use_sim_time' and not ('points' in values and name.startswith(POSITION)):
            meant = did_you_mean(name, values)
            raise InputError(f'{path}: {node_name} has no parameter {shown(name)}{meant}; it has {", ".join(values)}')
    try:
        check_points(values, given)
    except InputError as error:
        raise InputError(f'{path}: {error}') from error
    return values


def _sections(path: str | Path) -> dict[str, dict]:
    content = plain_content(text_of(path, 'parameter file'), str(path))
    sections = content if isinstance(content, dict) else {}
    if not sections or any(not isinstance(s, dict) or 'ros__parameters' not in s for s in sections.values()):
        raise InputError(f'{path} is not a ROS parameter file: every section needs ros__parameters')
    found = {name: section['ros__parameters'] or {} for name, section in sections.items()}
    wrong = [name for name, parameters in found.items() if not isinstance(parameters, dict)]
    if wrong:
        raise InputError(f'{path}: the ros__parameters of {shown(wrong[0])} must map names to values')
    return found


def _of_type(default: Any, value: Any, name: str, path: str | Path | None) -> Any:
    kind = type(default[0]) if isinstance(default, list) else type(default)
    elements = value if isinstance(value, list) else [value]
    if isinstance(value, list) != isinstance(default, list) or any(type(e) is not kind for e in elements):
        example = ', as in 1.0 instead of 1' if kind is float else ''
        raise InputError(f'{path}: the parameter {name} must be of the type of {default}{example}, not {shown(value)}')
    return value


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
