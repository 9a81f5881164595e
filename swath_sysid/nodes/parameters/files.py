"""Parameter files: read without ROS, with what earlier versions wrote; and written, as is the documentation."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from swath_sysid.common.errors import InputError
from swath_sysid.formats.untrusted_yaml import plain_content, shown, text_of
from swath_sysid.nodes.parameters.parameter import Table, Values, defaults

ATTITUDE_NODES = ('imu_buffer', 'identifier', 'predictor')
NODES = (*ATTITUDE_NODES, 'manoeuvring_identifier', 'manoeuvring_predictor')

MOVED_PREFIX = 'manoeuvre_'  #: Parameters of identifier that begin so are those of manoeuvring_identifier, without it.

FORMER_NODES = {'manoeuvring_predictor': 'manoeuvre_predictor'}


def table_of(node_name: str) -> Table:
    """The parameters of a node, one of `NODES`."""
    return import_module(f'swath_sysid.nodes.parameters.{node_name}').TABLE


def _further(node_name: str, values: Values) -> Table:
    further = getattr(import_module(f'swath_sysid.nodes.parameters.{node_name}'), 'further', None)
    return () if further is None else further(values)


def _applying(node_name: str) -> tuple[str, ...]:
    """The sections of a parameter file that hold for a node."""
    return '/**', node_name, f'/{node_name}', f'/**/{node_name}'


def _has_moved(node_name: str, name: str) -> bool:
    return node_name == 'identifier' and name.startswith(MOVED_PREFIX)


def _moved_parameters(path: str | Path | None, node_name: str) -> dict[str, Values]:
    """What a parameter file sets of a node under the names of an earlier version.

    Section of the node as it is called now, to names and values as they are called now.
    """
    former = FORMER_NODES.get(node_name, 'identifier' if node_name == 'manoeuvring_identifier' else None)
    if path is None or former is None:
        return {}
    known = {parameter.name for parameter in table_of(node_name)}
    prefix = MOVED_PREFIX if former == 'identifier' else ''
    found = {
        section.replace(former, node_name): {
            name.removeprefix(prefix): value
            for name, value in content.items()
            if name.startswith(prefix) and name.removeprefix(prefix) in known
        }
        for section, content in _sections(path).items()
        if section in _applying(former)[1:]
    }
    return {section: content for section, content in found.items() if content}


def with_moved_parameters(arguments: Sequence[str], node_name: str) -> tuple[list[str], list[str]]:
    """Arguments of a node, its program first, with what its parameter files set under earlier names before all else.

    Beside them a warning for each file that should be brought up to date.
    """
    overrides, warnings = [], []
    for option, path in zip(arguments, arguments[1:], strict=False):
        if option != '--params-file':
            continue
        try:
            moved = _moved_parameters(path, node_name)
        except InputError:
            # ROS, which takes more forms of the file, says what it makes of it
            continue
        for content in moved.values():
            overrides += [word for name, value in content.items() for word in ('-p', f'{name}:={_yaml_value(value)}')]
            warnings.append(
                f'{path} sets {", ".join(content)} in the section of an earlier version: move that to /**/{node_name}'
                + (f', without {MOVED_PREFIX}' if node_name not in FORMER_NODES else '')
            )
    return [*arguments[:1], *(['--ros-args', *overrides, '--'] if overrides else []), *arguments[1:]], warnings


def values_from_file(path: str | Path | None, node_name: str) -> Values:
    """The values of a node's parameters as a ROS parameter file sets them, without ROS; without a file the defaults.

    The sections ``/**``, ``NAME``, ``/NAME`` and ``/**/NAME`` of the file apply, in its order.

    Raises:
        InputError: The file cannot be read, is not a parameter file, or sets a parameter that does not exist or is of
            another type.
    """
    values = defaults(table_of(node_name))
    if path is None:
        return values
    for section, content in [*_moved_parameters(path, node_name).items(), *_sections(path).items()]:
        if section in _applying(node_name):
            content = {**content}
            for name in [name for name in values if name in content]:
                values[name] = _of_type(values[name], content.pop(name), name, path)
            # parameters that exist only with the values of others
            values = {**defaults(_further(node_name, values)), **values}
            for name, value in content.items():
                if name in values:
                    values[name] = _of_type(values[name], value, name, path)
                elif section != '/**' and name != 'use_sim_time' and not _has_moved(node_name, name):
                    raise InputError(f'{path}: {node_name} has no parameter {shown(name)}; it has {", ".join(values)}')
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


def _of_type(default: Any, value: Any, name: str, path: str | Path) -> Any:
    kind = type(default[0]) if isinstance(default, list) else type(default)
    elements = value if isinstance(value, list) else [value]
    if isinstance(value, list) != isinstance(default, list) or any(type(e) is not kind for e in elements):
        example = ', as in 1.0 instead of 1' if kind is float else ''
        raise InputError(f'{path}: the parameter {name} must be of the type of {default}{example}, not {shown(value)}')
    return value


def configuration_file() -> str:
    """Text of the parameter file with every default, section by node."""
    lines = ['# Every parameter of the nodes with its default; made by swath_sysid.nodes.parameters.files.']
    for node_name in NODES:
        lines += ['', f'/**/{node_name}:', '  ros__parameters:']
        for parameter in table_of(node_name):
            allowed = f' ({parameter.range_text}{f" {parameter.unit}" if parameter.unit else ""})'
            lines.append(f'    # {parameter.meaning}{allowed if parameter.range_text else ""}')
            lines.append(f'    {parameter.name}: {_yaml_value(parameter.default)}')
    return '\n'.join(lines) + '\n'


def markdown_table(node_name: str) -> str:
    """The parameters of a node, as the parameter file names it, as a Markdown table."""
    lines = ['| Parameter | Default | Range | Unit | Meaning |', '|---|---|---|---|---|']
    for p in table_of(node_name):
        fixed = '' if not p.read_only else ' (set at the start)'
        meaning = f'{p.meaning}{fixed}'.replace('|', '\\|')
        lines.append(f'| `{p.name}` | `{_yaml_value(p.default)}` | {p.range_text} | {p.unit} | {meaning} |')
    return '\n'.join(lines) + '\n'


def _yaml_value(value: Any) -> str:
    if isinstance(value, float):
        # YAML 1.1 reads a float by its dot
        text = repr(value)
        return text if '.' in text else text.replace('e', '.0e')
    return yaml.safe_dump(value, default_flow_style=True).replace('\n...', '').strip()
