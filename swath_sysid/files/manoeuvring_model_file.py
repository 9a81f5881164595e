"""The model file of a manoeuvring craft: YAML, versioned, checked on reading."""

from dataclasses import asdict, fields

import numpy as np
import yaml

from swath_sysid.errors import InputError
from swath_sysid.files.atomic import replacing
from swath_sysid.files.plain_fields import check_fields, text_of, yaml_content
from swath_sysid.hull.manoeuvring.identified_model import IdentifiedManoeuvringModel
from swath_sysid.hull.manoeuvring.model import ManoeuvringModel, parameter_values
from swath_sysid.hull.manoeuvring.stability import Region
from swath_sysid.hull.manoeuvring.terms import INDEX, NEUTRAL, PARAMETERS

FORMAT = 'swath_sysid manoeuvring model'
VERSION = 1
FRAME = 'body x forward, y port, z up; world x east, y north (REP 103)'

_FIELDS = (
    'format', 'version', 'frame', 'name', 'thrust_input', 'length_m', 'largest_input', 'parameters', 'current_m_s',
    'identified', 'covariance', 'noise', 'region', 'metrics', 'provenance',
)  # fmt: skip
_PARAMETER_FIELDS = ('value', 'std', 'unit')


def manoeuvring_to_yaml(identified):
    """Text of a model file.

    Parameters
    ----------
    identified : IdentifiedManoeuvringModel

    Returns
    -------
    str
    """
    model = identified.model
    std = dict(zip(identified.names, np.sqrt(np.diag(identified.covariance)).tolist(), strict=True))
    parameters = {
        p.name: {'value': float(model[p.name]), 'std': std.get(p.name), 'unit': p.unit}
        for p in PARAMETERS
        if p.name in identified.names or model[p.name] != NEUTRAL[INDEX[p.name]]
    }
    content = {
        'format': FORMAT, 'version': VERSION, 'frame': FRAME, 'name': model.name, 'thrust_input': model.thrust_input,
        'length_m': float(model.length), 'largest_input': float(model.largest_input), 'parameters': parameters,
        'current_m_s': [float(c) for c in model.current], 'identified': list(identified.names),
        'covariance': np.asarray(identified.covariance, dtype=float).tolist(),
        'noise': [float(n) for n in identified.noise],
        'region': {name: float(value) for name, value in asdict(identified.region).items()},
        'metrics': identified.metrics, 'provenance': identified.provenance,
    }  # fmt: skip
    return yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)


def manoeuvring_from_yaml(text, source='the model'):
    """The model of a model file's text.

    Parameters
    ----------
    text : str
    source : str
        Named in the errors.

    Returns
    -------
    IdentifiedManoeuvringModel

    Raises
    ------
    InputError
        Not such a file, of another version, or with unknown, missing or wrong fields.
    """
    content = yaml_content(text, source)
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise InputError(f"{source} is no manoeuvring model (its format is not '{FORMAT}'): write one with manoeuvre "
                         f'identify --output')  # fmt: skip
    if content.get('version') != VERSION:
        raise InputError(f'{source} has version {content.get("version")}, this software reads {VERSION}: identify anew')
    check_fields(content, _FIELDS, source)
    if content['frame'] != FRAME:
        raise InputError(f"{source}: the frame '{content['frame']}' is not understood; it must be '{FRAME}'")
    parameters = content['parameters']
    if not isinstance(parameters, dict):
        raise InputError(f"{source}: 'parameters' must map names to values")
    values = {}
    for name, plain in parameters.items():
        if name not in INDEX:
            raise InputError(f"{source}: there is no parameter '{name}'")
        check_fields(plain, _PARAMETER_FIELDS, f'{source}, {name}')
        values[name] = _numbers(plain['value'], (), f'{source}, {name}')
    names = tuple(content['identified'])
    check_fields(content['region'], [f.name for f in fields(Region)], f'{source}, region')
    model = ManoeuvringModel(
        parameter_values(values), thrust_input=content['thrust_input'], name=str(content['name']),
        length=float(_numbers(content['length_m'], (), source)),
        largest_input=float(_numbers(content['largest_input'], (), source)),
        current=tuple(_numbers(content['current_m_s'], (2,), source).tolist()),
    )  # fmt: skip
    region = Region(**{k: float(_numbers(v, (), f'{source}, region')) for k, v in content['region'].items()})
    # YAML knows no empty table, only an empty list
    covariance = content['covariance'] or np.zeros((0, 0))
    return IdentifiedManoeuvringModel(
        model, names, _numbers(covariance, (len(names), len(names)), f'{source}, covariance'),
        _numbers(content['noise'], (3,), f'{source}, noise'), region, content['metrics'], content['provenance'],
    )  # fmt: skip


def write_manoeuvring_model(path, identified):
    """Write a model file whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_text(manoeuvring_to_yaml(identified), encoding='utf-8')


def read_manoeuvring_model(path):
    """Read a model file; see `manoeuvring_from_yaml`."""
    return manoeuvring_from_yaml(text_of(path), str(path))


def _numbers(value, shape, source):
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f'{source}: {value!r} is no number') from error
    if found.shape != shape:
        raise InputError(f'{source}: expected numbers of shape {shape}, found {found.shape}')
    return found
