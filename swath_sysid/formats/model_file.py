"""The model file: YAML, versioned, checked when it is read or written; one or both axes of a craft.

`identify` writes it, the identifier publishes it on ``model/description``. It may also hold a schedule on draft; its
``axes`` are then the models of the middle draft, for readers without schedules.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import HullPosterior, IdentifiedModel
from swath_sysid.attitude.hull.physical_range import check_physical
from swath_sysid.attitude.hull.scheduled_model import QUANTITIES, ScheduledModel
from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.errors import InputError
from swath_sysid.formats.fields import (
    ModelFormat,
    anything,
    built,
    check_std,
    covariance,
    if_known,
    list_of,
    mapping,
    metrics,
    number,
    one_of,
    quantities_of,
    record,
    table_of,
    text,
)

_AXIS = record(
    {
        'equation': text(),
        'ratios': quantities_of(RATIO_UNITS, 'ratio'),
        'covariance': anything,
        'trim_rad': number(-math.pi, math.pi),
        'trim_std_rad': if_known(number(lowest=0.0)),
        'friction_rate_rad_s': number(above=0.0),
        'valid_amplitude_rad': list_of(if_known(number(0.0, math.pi), math.inf), 2),
        'metrics': metrics,
        'provenance': mapping,
    },
    {'posterior': record({'ratios': quantities_of(RATIO_UNITS, 'ratio'), 'covariance': anything})},
)
_SCHEDULE = record(
    {
        'quantity': one_of(QUANTITIES),
        'models': list_of(record({'loading': number(above=0.0), 'model': _AXIS})),
    }
)
#: What a model file holds; null stands for what is not known.
FORMAT = ModelFormat(
    'swath_sysid decay model',
    'body x forward, y port, z up; Euler angles yaw-pitch-roll (REP 103)',
    'identify again',
    {'axes': table_of(AXES, 'axis', _AXIS)},
    {'schedule': table_of(AXES, 'axis', _SCHEDULE)},
)


def model_to_yaml(models: Mapping[str, IdentifiedModel], **more: Any) -> str:
    """Text of a model file that holds models by axis, and more fields."""
    return FORMAT.text(axes={axis: _axis_to_plain(identified) for axis, identified in models.items()}, **more)


def scheduled_to_yaml(schedules: Mapping[str, ScheduledModel]) -> str:
    """Text of a model file that holds schedules by axis, and their middle models for readers without schedules."""
    plain = {
        axis: {
            'quantity': schedule.quantity,
            'models': [
                {'loading': loading, 'model': _axis_to_plain(identified)}
                for loading, identified in zip(schedule.loadings, schedule.models, strict=True)
            ],
        }
        for axis, schedule in schedules.items()
    }
    return model_to_yaml({axis: schedule.reference for axis, schedule in schedules.items()}, schedule=plain)


def model_from_yaml(text: str, source: str = 'the model') -> dict[str, IdentifiedModel]:
    """Models of a model file's text, by axis; see `description_from_yaml`."""
    return description_from_yaml(text, source)[0]


def description_from_yaml(
    text: str, source: str = 'the model'
) -> tuple[dict[str, IdentifiedModel], dict[str, ScheduledModel]]:
    """Models and schedules (empty where there are none) by axis of any text; errors name the source and the field."""
    content = FORMAT.content(text, source)
    axes, schedule = content['axes'], content.get('schedule', {})
    if not axes:
        raise InputError(f"{source}: the field 'axes' holds no axis; give {' or '.join(AXES)}")
    if schedule and set(schedule) != set(axes):
        raise InputError(f"{source}: the axes of 'schedule' and of 'axes' differ; give the same in both")
    models = {axis: _identified(plain, axis, f'{source}, {axis}') for axis, plain in axes.items()}
    return models, {axis: _scheduled(item, axis, f'{source}, schedule of {axis}') for axis, item in schedule.items()}


def _scheduled(plain: dict, axis: str, where: str) -> ScheduledModel:
    models = [
        _identified(item['model'], axis, f'{where}, model {number}') for number, item in enumerate(plain['models'], 1)
    ]
    return built(
        lambda: ScheduledModel(plain['quantity'], tuple(item['loading'] for item in plain['models']), tuple(models)),
        where,
    )


def _identified(plain: dict, axis: str, where: str) -> IdentifiedModel:
    smallest, largest = plain['valid_amplitude_rad']
    if not smallest <= largest:
        raise InputError(f'{where}, valid_amplitude_rad: give the smallest and the largest amplitude, in this order')
    model = built(lambda: _model_of(plain, axis), where)
    return IdentifiedModel(
        model,
        _covariance(plain, model.equation, where),
        plain['trim_std_rad'],
        (smallest, largest),
        plain['metrics'],
        plain['provenance'],
        _posterior(plain['posterior'], f'{where}, posterior') if 'posterior' in plain else None,
    )


def _covariance(plain: dict, equation: Equation, where: str) -> np.ndarray:
    """Rows in the file's order, to the order of the equation's terms."""
    ratios = plain['ratios']
    matrix = covariance(plain['covariance'], tuple(ratios), f'{where}, covariance')
    check_std({name: ratio['std'] for name, ratio in ratios.items()}, np.diag(matrix), where)
    order = [tuple(ratios).index(name) for name in equation.terms]
    return matrix[np.ix_(order, order)]


def _posterior(plain: dict, where: str) -> HullPosterior:
    equation = built(lambda: Equation('posterior', tuple(plain['ratios'])), where)
    ratios = [plain['ratios'][name]['value'] for name in equation.terms]
    return HullPosterior(equation, np.array(ratios), _covariance(plain, equation, where))


def _model_of(plain: dict, axis: str) -> DecayModel:
    ratios = plain['ratios']
    model = DecayModel.from_terms(
        Equation(plain['equation'], tuple(ratios)),
        {name: ratio['value'] for name, ratio in ratios.items()},
        trim=plain['trim_rad'],
        friction_rate=plain['friction_rate_rad_s'],
        axis=axis,
    )
    check_physical(model)
    return model


def write_model(path: str | Path, models: Mapping[str, IdentifiedModel]) -> None:
    """Write a model file (YAML), whole or not at all.

    Args:
        path: Of the file; one that exists is replaced.
        models: By axis, ``roll`` and ``pitch``.

    Raises:
        InputError: It cannot be written, or would be rejected by its readers.

    Example:
        >>> found = identify([read_trial(records / 'kvlcc2_roll_decay.csv').axis('roll')])
        >>> write_model('tanker.yaml', {'roll': found.identified_model({'source': 'tutorial'})})
    """
    FORMAT.write(path, model_to_yaml(models), description_from_yaml)


def write_scheduled(path: str | Path, schedules: Mapping[str, ScheduledModel]) -> None:
    """Write a model file with a schedule, as `write_model`; see `scheduled_to_yaml`."""
    FORMAT.write(path, scheduled_to_yaml(schedules), description_from_yaml)


def read_description(path: str | Path) -> tuple[dict[str, IdentifiedModel], dict[str, ScheduledModel]]:
    """Read models and schedules of a model file; see `description_from_yaml`."""
    return FORMAT.read(path, description_from_yaml)


def read_model(path: str | Path) -> dict[str, IdentifiedModel]:
    """Read the models of a model file.

    Args:
        path: Of a file that `write_model` or ``swath-sysid identify`` wrote.

    Returns:
        By axis, ``roll`` and ``pitch``; of a schedule on draft, those of the middle draft.

    Raises:
        InputError: The file cannot be read, is no model file or one of another version, has unknown, missing or wrong
            fields, or describes a hull that no craft has; the sentence names the field.

    Example:
        >>> write_model('craft.yaml', {'roll': IdentifiedModel.exactly(hull_named('swath-roll').model)})
        >>> read_model('craft.yaml')['roll'].model == hull_named('swath-roll').model
        True
    """
    return read_description(path)[0]


def ratios_as_data(identified: Any) -> dict[str, dict]:
    """Value, standard deviation and unit of each ratio, of whatever has a model and its deviations."""
    return {
        name: {'value': value, 'std': identified.std[name], 'unit': RATIO_UNITS[name]}
        for name, value in identified.model.terms.items()
    }


def _axis_to_plain(identified: Any) -> dict:
    model = identified.model
    return {
        'equation': model.equation.name,
        'ratios': ratios_as_data(identified),
        'covariance': identified.covariance.tolist(),
        'trim_rad': float(model.trim),
        'trim_std_rad': float(identified.trim_std),
        'friction_rate_rad_s': float(model.friction_rate),
        'valid_amplitude_rad': [float(a) for a in identified.amplitude_range],
        'metrics': identified.metrics,
        'provenance': identified.provenance,
        **_posterior_to_plain(identified.posterior),
    }


def _posterior_to_plain(posterior: HullPosterior | None) -> dict[str, dict]:
    if posterior is None:
        return {}
    names, std = posterior.equation.terms, np.sqrt(np.diag(posterior.covariance)).tolist()
    ratios = {
        name: {'value': float(value), 'std': spread, 'unit': RATIO_UNITS[name]}
        for name, value, spread in zip(names, posterior.ratios, std, strict=True)
    }
    return {'posterior': {'ratios': ratios, 'covariance': posterior.covariance.tolist()}}
