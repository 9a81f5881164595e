"""The model file of a manoeuvring craft: YAML, versioned, checked on reading."""

from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.fields import (
    ModelFormat,
    anything,
    built,
    check_std,
    covariance,
    list_of,
    mapping,
    metrics,
    number,
    one_of,
    quantities_of,
    record,
    text,
)
from swath_sysid.manoeuvring.hull.identified_model import ForecastNoise, IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.hull.model import INPUTS, ManoeuvringModel, parameter_values
from swath_sysid.manoeuvring.hull.physical_range import check_physical
from swath_sysid.manoeuvring.hull.stability import Region
from swath_sysid.manoeuvring.hull.terms import INDEX, NEUTRAL, PARAMETERS
from swath_sysid.manoeuvring.identification.shooting import CURRENT

_SPEED = number(-100.0, 100.0)
_INPUT = number(-1e9, 1e9)
_REGION = {
    'slowest': _SPEED,
    'fastest': _SPEED,
    'largest_sway': number(0.0, 100.0),
    'largest_yaw_rate': number(0.0, 100.0),
    'least_input': _INPUT,
    'most_input': _INPUT,
    'largest_difference': number(0.0, 2e9),
}
_SPREAD, _TIME = number(0.0, 1e6), number(0.0, 1e6, above=0.0)
_FORECAST = record(
    {
        'disturbance': list_of(_SPREAD, 3),
        'disturbance_time': list_of(_TIME, 3),
        'thrust_mean': list_of(_INPUT, 2),
        'thrust_covariance': list_of(list_of(number(-1e18, 1e18), 2), 2),
        'thrust_time': _TIME,
        'sensors': list_of(_TIME, 4),
        'leads': list_of(_TIME),
        'scale': list_of(list_of(_SPREAD), 6),
    }
)


#: Content of a model file; null stands for an unknown value.
FORMAT = ModelFormat(
    'swath_sysid manoeuvring model',
    'body x forward, y port, z up; world x east, y north (REP 103)',
    'identify the craft again',
    {
        'name': text(),
        'thrust_input': one_of(INPUTS),
        'length_m': number(0.01, 1000.0),
        'largest_input': number(0.0, 1e9, above=0.0),
        'parameters': quantities_of({p.name: p.unit for p in PARAMETERS}, 'parameter'),
        'current_m_s': list_of(number(-20.0, 20.0), 2),
        'identified': list_of(one_of((*INDEX, *CURRENT))),
        'covariance': anything,
        'noise': list_of(number(0.0, 100.0), 3),
        'region': record({field.name: _REGION[field.name] for field in fields(Region)}),
        'metrics': metrics,
        'provenance': mapping,
    },
    {'forecast': _FORECAST},
    kind='manoeuvring model',
)


def manoeuvring_to_yaml(identified: IdentifiedManoeuvringModel) -> str:
    """Text of a model file, with uncertainty and provenance."""
    model = identified.model
    std = dict(zip(identified.names, np.sqrt(np.diag(identified.covariance)).tolist(), strict=True))
    parameters = {
        p.name: {'value': float(model[p.name]), 'std': std.get(p.name), 'unit': p.unit}
        for p in PARAMETERS
        if p.name in identified.names or model[p.name] != NEUTRAL[INDEX[p.name]]
    }
    noise = {} if identified.forecast is None else asdict(identified.forecast)
    forecast = {name: np.asarray(values, dtype=float).tolist() for name, values in noise.items()}
    return FORMAT.text(
        name=model.name,
        thrust_input=model.thrust_input,
        length_m=float(model.length),
        largest_input=float(model.largest_input),
        parameters=parameters,
        current_m_s=[float(c) for c in model.current],
        identified=list(identified.names),
        covariance=np.asarray(identified.covariance, dtype=float).tolist(),
        noise=[float(n) for n in identified.noise],
        region={name: float(value) for name, value in asdict(identified.region).items()},
        metrics=identified.metrics,
        provenance=identified.provenance,
        **({'forecast': forecast} if forecast else {}),
    )


def manoeuvring_from_yaml(text: str, source: str = 'the model') -> IdentifiedManoeuvringModel:
    """The model of a model file's text; see `swath_sysid.formats.model_file.description_from_yaml`."""
    content = FORMAT.content(text, source)
    names = tuple(content['identified'])
    if len(set(names)) < len(names):
        raise InputError(f'{source}, identified: a name is given twice: leave one out')
    region = Region(**content['region'])
    if not (region.slowest <= region.fastest and region.least_input <= region.most_input):
        raise InputError(f'{source}, region: slowest and least_input must not exceed fastest and most_input')
    # YAML has no empty table, only an empty list
    matrix = covariance(content['covariance'], names, f'{source}, covariance')
    # the current has no std of its own in the file
    stated = {name: content['parameters'][name]['std'] for name in names if name in content['parameters']}
    check_std(stated, np.diag(matrix)[[names.index(name) for name in stated]], source)
    return IdentifiedManoeuvringModel(
        built(lambda: _model_of(content), source),
        names,
        matrix,
        np.array(content['noise']),
        region,
        content['metrics'],
        content['provenance'],
        _forecast_of(content.get('forecast'), f'{source}, forecast'),
    )


def _forecast_of(content: dict | None, where: str) -> ForecastNoise | None:
    if content is None:
        return None
    leads = content['leads']
    if not leads or np.any(np.diff(leads) <= 0.0) or any(len(row) != len(leads) for row in content['scale']):
        raise InputError(f'{where}: the leads must rise, and every row of scale hold one number a lead')
    arrays: dict[str, Any] = {name: np.array(values, dtype=float) for name, values in content.items()}
    return ForecastNoise(**{**arrays, 'thrust_time': content['thrust_time']})


def _model_of(content: dict) -> ManoeuvringModel:
    values = {name: plain['value'] for name, plain in content['parameters'].items()}
    model = ManoeuvringModel(
        parameter_values(values),
        thrust_input=content['thrust_input'],
        name=content['name'],
        length=content['length_m'],
        largest_input=content['largest_input'],
        current=tuple(content['current_m_s']),
    )
    check_physical(model)
    return model


def write_manoeuvring_model(path: str | Path, identified: IdentifiedManoeuvringModel) -> None:
    """Write a model file; see `swath_sysid.formats.model_file.write_model`."""
    FORMAT.write(path, manoeuvring_to_yaml(identified), manoeuvring_from_yaml)


def read_manoeuvring_model(path: str | Path) -> IdentifiedManoeuvringModel:
    """Read a model file of a manoeuvring craft.

    Args:
        path: Of a file that ``swath-sysid manoeuvre identify`` wrote.

    Returns:
        The model, its uncertainty, and where it is valid.

    Raises:
        InputError: The file cannot be read, is no model file or one of another version, or has unknown, missing or
            wrong fields; the sentence names the field.

    Example:
        >>> read_manoeuvring_model('wamv.yaml').model.terms
        ('m', 'Iz', 'Xu', 'Xuu', 'Yv', 'Nr', 'lever')
    """
    return FORMAT.read(path, manoeuvring_from_yaml)
