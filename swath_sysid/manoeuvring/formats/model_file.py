"""The model file of a manoeuvring craft: YAML, versioned, checked on reading."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_format import ModelFormat, Stated, covariance, metrics, stated_of
from swath_sysid.formats.schema import Check, built, list_of, number, one_of, record, text_of
from swath_sysid.manoeuvring.hull.identified_model import ForecastNoise, IdentifiedManoeuvringModel, Region
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel, check_physical, parameter_values
from swath_sysid.manoeuvring.hull.terms import INDEX, NEUTRAL, PARAMETERS
from swath_sysid.manoeuvring.identification.shooting import CURRENT
from swath_sysid.manoeuvring.motion.trial import INPUTS

UNITS = {p.name: p.unit for p in PARAMETERS}
_SPEED, _INPUT = number(-100.0, 100.0), number(-1e9, 1e9)
_SPREAD, _TIME = number(0.0, 1e6), number(0.0, 1e6, above=0.0)


def _array(check: Check, *shape: int | None) -> Check:
    """An array of like numbers; None stands for any length."""
    for length in reversed(shape):
        check = list_of(check, length, np.array)
    return check


_REGION = record(
    Region,
    **dict.fromkeys(('slowest', 'fastest'), _SPEED),
    **dict.fromkeys(('largest_sway', 'largest_yaw_rate'), number(0.0, 100.0)),
    **dict.fromkeys(('least_input', 'most_input'), _INPUT),
    largest_difference=number(0.0, 2e9),
)
_FORECAST = record(
    ForecastNoise,
    disturbance=_array(_SPREAD, 3),
    disturbance_time=_array(_TIME, 3),
    thrust_mean=_array(_INPUT, 2),
    thrust_covariance=_array(number(-1e18, 1e18), 2, 2),
    thrust_time=_TIME,
    sensors=_array(_TIME, 4),
    leads=_array(_TIME, None),
    scale=list_of(_array(_SPREAD, None), 6),
)


@dataclass(frozen=True)
class _File:
    """Content of a model file; null stands for an unknown value."""

    name: str
    thrust_input: Annotated[str, one_of(INPUTS)]
    length_m: Annotated[float, number(0.01, 1000.0)]
    largest_input: Annotated[float, number(0.0, 1e9, above=0.0)]
    parameters: Annotated[dict[str, Stated], stated_of(UNITS, 'parameter')]
    current_m_s: Annotated[tuple[float, float], list_of(number(-20.0, 20.0), 2)]
    identified: Annotated[tuple[str, ...], list_of(one_of((*INDEX, *CURRENT)))]
    covariance: Any
    noise: Annotated[np.ndarray, _array(number(0.0, 100.0), 3)]
    region: Annotated[Region, _REGION]
    metrics: Annotated[dict, metrics]
    provenance: dict
    forecast: Annotated[ForecastNoise | None, _FORECAST] = None


FORMAT = ModelFormat(
    'swath_sysid manoeuvring model',
    'body x forward, y port, z up; world x east, y north (REP 103)',
    _File,
    'identify the craft again',
    kind='manoeuvring model',
)


def manoeuvring_to_yaml(identified: IdentifiedManoeuvringModel) -> str:
    """Text of a model file, with uncertainty and provenance."""
    model = identified.model
    std = dict(zip(identified.names, np.sqrt(np.diag(identified.covariance)).tolist(), strict=True))
    parameters = {
        name: Stated(float(model[name]), std.get(name, np.nan), unit)
        for name, unit in UNITS.items()
        if name in identified.names or model[name] != NEUTRAL[INDEX[name]]
    }
    return FORMAT.text(
        _File(
            name=model.name,
            thrust_input=model.thrust_input,
            length_m=model.length,
            largest_input=model.largest_input,
            parameters=parameters,
            current_m_s=model.current,
            identified=identified.names,
            covariance=identified.covariance,
            noise=identified.noise,
            region=identified.region,
            metrics=identified.metrics,
            provenance=identified.provenance,
            forecast=identified.forecast,
        )
    )


def manoeuvring_from_yaml(text: str, source: str = 'the model') -> IdentifiedManoeuvringModel:
    """The model of a model file's text; see `swath_sysid.formats.model_file.description_from_yaml`."""
    content = FORMAT.content(text, source)
    names, region, forecast = content.identified, content.region, content.forecast
    if len(set(names)) < len(names):
        raise InputError(f'{source}, identified: a name is given twice: leave one out')
    if not (region.slowest <= region.fastest and region.least_input <= region.most_input):
        raise InputError(f'{source}, region: slowest and least_input must not exceed fastest and most_input')
    if forecast is not None:
        leads = forecast.leads
        if not leads.size or np.any(np.diff(leads) <= 0.0) or any(row.size != leads.size for row in forecast.scale):
            raise InputError(f'{source}, forecast: the leads must rise, and every row of scale hold one number a lead')
        forecast = replace(forecast, scale=np.array(forecast.scale))
    return IdentifiedManoeuvringModel(
        built(lambda: _model_of(content), source),
        names,
        covariance(content.covariance, names, content.parameters, source),
        content.noise,
        region,
        content.metrics,
        content.provenance,
        forecast,
    )


def _model_of(content: _File) -> ManoeuvringModel:
    model = ManoeuvringModel(
        parameter_values({name: stated.value for name, stated in content.parameters.items()}),
        thrust_input=content.thrust_input,
        name=content.name,
        length=content.length_m,
        largest_input=content.largest_input,
        current=content.current_m_s,
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
    return manoeuvring_from_yaml(text_of(path), str(path))
