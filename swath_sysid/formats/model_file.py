"""The model file: YAML, versioned, checked when it is read or written; one or both axes of a craft.

`identify` writes it, the identifier publishes it on ``model/description``. It may also hold a schedule on draft; its
``axes`` are then the models of the middle draft, for readers without schedules.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation, check_physical
from swath_sysid.attitude.hull.identified_model import QUANTITIES, HullPosterior, IdentifiedModel, ScheduledModel
from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_format import ModelFormat, Stated, covariance, metrics, stated_of
from swath_sysid.formats.schema import built, if_known, list_of, number, one_of, record, table_of, text_of


@dataclass(frozen=True)
class _Ratios:
    """Ratios to the inertia with their covariance, in the order of the file."""

    equation: str
    ratios: Annotated[dict[str, Stated], stated_of(RATIO_UNITS, 'ratio')]
    covariance: Any

    @classmethod
    def of(cls, equation: Equation, values: Sequence[float], matrix: np.ndarray, **more: Any) -> Self:
        each = zip(equation.terms, values, np.sqrt(np.diag(matrix)).tolist(), strict=True)
        ratios = {name: Stated(float(value), std, RATIO_UNITS[name]) for name, value, std in each}
        return cls(equation.name, ratios, matrix.tolist(), **more)

    def known(self, where: str) -> tuple[Equation, np.ndarray, np.ndarray]:
        """The equation, its ratios, and their covariance, both in the order of its terms."""
        equation = built(lambda: Equation(self.equation, tuple(self.ratios)), where)
        matrix = covariance(self.covariance, tuple(self.ratios), self.ratios, where)
        order = [tuple(self.ratios).index(term) for term in equation.terms]
        return equation, np.array([self.ratios[term].value for term in equation.terms]), matrix[np.ix_(order, order)]


@dataclass(frozen=True)
class _Axis(_Ratios):
    """The model of one axis; null stands for what is not known."""

    trim_rad: Annotated[float, number(-math.pi, math.pi)]
    trim_std_rad: Annotated[float, if_known(number(lowest=0.0))]
    friction_rate_rad_s: Annotated[float, number(above=0.0)]
    valid_amplitude_rad: Annotated[tuple[float, float], list_of(if_known(number(0.0, math.pi), math.inf), 2)]
    metrics: Annotated[dict, metrics]
    provenance: dict
    posterior: _Ratios | None = None


@dataclass(frozen=True)
class _AtLoading:
    loading: Annotated[float, number(above=0.0)]
    model: _Axis


@dataclass(frozen=True)
class _Schedule:
    quantity: Annotated[str, one_of(QUANTITIES)]
    models: tuple[_AtLoading, ...]


@dataclass(frozen=True)
class _File:
    axes: Annotated[dict[str, _Axis], table_of(dict.fromkeys(AXES, record(_Axis)), 'axis')]
    schedule: Annotated[dict[str, _Schedule] | None, table_of(dict.fromkeys(AXES, record(_Schedule)), 'axis')] = None


FORMAT = ModelFormat(
    'swath_sysid decay model',
    'body x forward, y port, z up; Euler angles yaw-pitch-roll (REP 103)',
    _File,
    'identify again',
)


def model_to_yaml(models: Mapping[str, IdentifiedModel]) -> str:
    """Text of a model file that holds models by axis."""
    return FORMAT.text(_File({axis: _axis_of(identified) for axis, identified in models.items()}))


def scheduled_to_yaml(schedules: Mapping[str, ScheduledModel]) -> str:
    """Text of a model file that holds schedules by axis, and their middle models for readers without schedules."""
    models = {axis: _axis_of(schedule.reference) for axis, schedule in schedules.items()}
    plain = {
        axis: _Schedule(each.quantity, tuple(map(_AtLoading, each.loadings, map(_axis_of, each.models))))
        for axis, each in schedules.items()
    }
    return FORMAT.text(_File(models, plain))


def model_from_yaml(text: str, source: str = 'the model') -> dict[str, IdentifiedModel]:
    """Models of a model file's text, by axis; see `description_from_yaml`."""
    return description_from_yaml(text, source)[0]


def description_from_yaml(
    text: str, source: str = 'the model'
) -> tuple[dict[str, IdentifiedModel], dict[str, ScheduledModel]]:
    """Models and schedules (empty where there are none) by axis of any text; errors name the source and the field."""
    content = FORMAT.content(text, source)
    if not content.axes:
        raise InputError(f"{source}: the field 'axes' holds no axis; give {' or '.join(AXES)}")
    if content.schedule and set(content.schedule) != set(content.axes):
        raise InputError(f"{source}: the axes of 'schedule' and of 'axes' differ; give the same in both")
    models = {axis: _identified(plain, axis, f'{source}, {axis}') for axis, plain in content.axes.items()}
    return models, {
        axis: _scheduled(item, axis, f'{source}, schedule of {axis}') for axis, item in (content.schedule or {}).items()
    }


def _scheduled(plain: _Schedule, axis: str, where: str) -> ScheduledModel:
    models = [_identified(item.model, axis, f'{where}, model {k}') for k, item in enumerate(plain.models, 1)]
    loadings = tuple(item.loading for item in plain.models)
    return built(lambda: ScheduledModel(plain.quantity, loadings, tuple(models)), where)


def _identified(plain: _Axis, axis: str, where: str) -> IdentifiedModel:
    smallest, largest = plain.valid_amplitude_rad
    if not smallest <= largest:
        raise InputError(f'{where}, valid_amplitude_rad: give the smallest and the largest amplitude, in this order')
    equation, ratios, matrix = plain.known(where)
    values = dict(zip(equation.terms, ratios.tolist(), strict=True))
    model = DecayModel.from_terms(
        equation, values, trim=plain.trim_rad, friction_rate=plain.friction_rate_rad_s, axis=axis
    )
    built(lambda: check_physical(model), where)
    posterior = None if plain.posterior is None else HullPosterior(*plain.posterior.known(f'{where}, posterior'))
    return IdentifiedModel(
        model, matrix, plain.trim_std_rad, (smallest, largest), plain.metrics, plain.provenance, posterior
    )


def _axis_of(identified: IdentifiedModel) -> _Axis:
    model, posterior = identified.model, identified.posterior
    return _Axis.of(
        model.equation,
        list(model.terms.values()),
        identified.covariance,
        trim_rad=float(model.trim),
        trim_std_rad=float(identified.trim_std),
        friction_rate_rad_s=float(model.friction_rate),
        valid_amplitude_rad=identified.amplitude_range,
        metrics=identified.metrics,
        provenance=identified.provenance,
        posterior=posterior and _Ratios.of(posterior.equation, posterior.ratios.tolist(), posterior.covariance),
    )


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
    return description_from_yaml(text_of(path), str(path))


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
