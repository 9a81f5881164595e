"""The model file: YAML, versioned, complete, checked on reading; one or both axes of a craft.

It is what `identify` writes, what the identifier publishes on ``model/description``, and what
the predictor and `forecast` read. A file may also hold a schedule on draft (`scheduled_to_yaml`):
its ``axes`` are then the models of the middle draft, for readers that know of no schedule.
"""

import math

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.physical_range import check_physical
from swath_sysid.attitude.hull.scheduled_model import QUANTITIES, ScheduledModel
from swath_sysid.attitude.hull.terms import RATIO_UNITS, TERM_NAMES
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing
from swath_sysid.formats.fields import (
    check_std,
    covariance,
    if_known,
    list_of,
    mapping,
    metrics,
    number,
    one_of,
    record,
    table_of,
    text,
)
from swath_sysid.formats.untrusted_yaml import dumped, plain_content, shown, text_of

FORMAT = 'swath_sysid decay model'
VERSION = 1
FRAME = 'body x forward, y port, z up; Euler angles yaw-pitch-roll (REP 103)'

def _anything(value, where):
    return value


_ANGLE = number(-math.pi, math.pi)
_AMPLITUDE = number(0.0, math.pi)
_AXIS = record({
    'equation': text(),
    'ratios': table_of(TERM_NAMES, 'ratio', {
        name: record({'value': number(), 'std': if_known(number(lowest=0.0)), 'unit': one_of((unit,))})
        for name, unit in RATIO_UNITS.items()
    }),
    'covariance': _anything,
    'trim_rad': _ANGLE,
    'trim_std_rad': if_known(number(lowest=0.0)),
    'friction_rate_rad_s': number(above=0.0),
    'valid_amplitude_rad': list_of(if_known(_AMPLITUDE, math.inf), 2),
    'metrics': metrics,
    'provenance': mapping,
})  # fmt: skip
_SCHEDULE = record({
    'quantity': one_of(QUANTITIES), 'models': list_of(record({'loading': number(above=0.0), 'model': _AXIS})),
})  # fmt: skip
_FILE = record(
    {'format': one_of((FORMAT,)), 'version': _anything, 'frame': one_of((FRAME,)),
     'axes': table_of(AXES, 'axis', _AXIS)},
    optional={'schedule': table_of(AXES, 'axis', _SCHEDULE)},
)  # fmt: skip
"""What a model file holds; null stands for what is not known."""


def model_to_yaml(models):
    """Text of a model file.

    Parameters
    ----------
    models : mapping of str to IdentifiedModel
        Axis to model.

    Returns
    -------
    str
    """
    return _dumped(models)


def scheduled_to_yaml(schedules):
    """Text of a model file with a schedule.

    Parameters
    ----------
    schedules : mapping of str to ScheduledModel
        Axis to schedule.

    Returns
    -------
    str
    """
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
    return _dumped({axis: schedule.reference for axis, schedule in schedules.items()}, schedule=plain)


def _dumped(models, **more):
    axes = {axis: _axis_to_plain(identified) for axis, identified in models.items()}
    content = {'format': FORMAT, 'version': VERSION, 'frame': FRAME, 'axes': axes, **more}
    return dumped(content)


def model_from_yaml(text, source='the model'):
    """Models of a model file's text, by axis; see `description_from_yaml`."""
    return description_from_yaml(text, source)[0]


def schedules_from_yaml(text, source='the model'):
    """The schedules of a model file's text, by axis; see `description_from_yaml`."""
    return description_from_yaml(text, source)[1]


def description_from_yaml(text, source='the model'):
    """Models and schedules of a model file's text, whoever wrote it.

    Parameters
    ----------
    text : str
        Any text whatever.
    source : str
        Named in the errors.

    Returns
    -------
    models : dict of str to IdentifiedModel
        By axis.
    schedules : dict of str to ScheduledModel
        By axis; empty where the text holds none.

    Raises
    ------
    InputError
        Not a model file, of another version, with unknown, missing or wrong fields, or of a hull
        that no craft has; the sentence names the field.
    """
    content = plain_content(text, source)
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise InputError(f"{source} is no model file: its field 'format' is not '{FORMAT}'")
    version = content.get('version')
    # to Python True is 1
    if version != VERSION or not isinstance(version, int) or isinstance(version, bool):
        raise InputError(
            f'{source} is a model file of version {shown(version)}; this software reads version {VERSION}: '
            'identify again'
        )
    content = _FILE(content, source)
    axes, schedule = content['axes'], content.get('schedule', {})
    if not axes:
        raise InputError(f"{source}: the field 'axes' holds no axis; give {' or '.join(AXES)}")
    if schedule and set(schedule) != set(axes):
        raise InputError(f"{source}: the axes of 'schedule' and of 'axes' differ; give the same in both")
    models = {axis: _identified(plain, axis, f'{source}, {axis}') for axis, plain in axes.items()}
    return models, {axis: _scheduled(item, axis, f'{source}, schedule of {axis}') for axis, item in schedule.items()}


def _scheduled(plain, axis, where):
    models = [
        _identified(item['model'], axis, f'{where}, model {number}') for number, item in enumerate(plain['models'], 1)
    ]
    return _built(
        lambda: ScheduledModel(plain['quantity'], tuple(item['loading'] for item in plain['models']), tuple(models)),
        where,
    )


def _identified(plain, axis, where):
    ratios = plain['ratios']
    smallest, largest = plain['valid_amplitude_rad']
    if not smallest <= largest:
        raise InputError(f'{where}, valid_amplitude_rad: give the smallest and the largest amplitude, in this order')
    model = _built(lambda: _model_of(plain, axis), where)
    # the model has its terms in their own order, the rows of the file are in the file's
    matrix = covariance(plain['covariance'], tuple(ratios), f'{where}, covariance')
    check_std({name: ratio['std'] for name, ratio in ratios.items()}, np.diag(matrix), where)
    order = [tuple(ratios).index(name) for name in model.equation.terms]
    return IdentifiedModel(
        model, matrix[np.ix_(order, order)], plain['trim_std_rad'], (smallest, largest), plain['metrics'],
        plain['provenance'],
    )  # fmt: skip


def _model_of(plain, axis):
    ratios = plain['ratios']
    model = DecayModel.from_terms(
        Equation(plain['equation'], tuple(ratios)), {name: ratio['value'] for name, ratio in ratios.items()},
        trim=plain['trim_rad'], friction_rate=plain['friction_rate_rad_s'], axis=axis,
    )  # fmt: skip
    check_physical(model)
    return model


def _built(build, where):
    """What the core makes of it; its errors do not know where it stands."""
    try:
        return build()
    except InputError as error:
        raise InputError(f'{where}: {error}') from error


def write_model(path, models):
    """Write a model file, whole or not at all; see `model_to_yaml`.

    Raises
    ------
    InputError
        It cannot be written, or would be refused by its readers.
    """
    _write(path, model_to_yaml(models))


def write_scheduled(path, schedules):
    """Write a model file with a schedule, as `write_model`; see `scheduled_to_yaml`."""
    _write(path, scheduled_to_yaml(schedules))


def _write(path, text):
    description_from_yaml(text, f'{path} is not written: what it would hold')
    with replacing(path) as temporary:
        temporary.write_text(text, encoding='utf-8')


def read_description(path):
    """Read models and schedules of a model file; see `description_from_yaml`.

    Raises
    ------
    InputError
        Also where the file cannot be read.
    """
    return description_from_yaml(text_of(path), str(path))


def read_model(path):
    """Read the models of a model file; see `read_description`."""
    return read_description(path)[0]


def read_schedules(path):
    """Read the schedules of a model file; see `read_description`."""
    return read_description(path)[1]


def _axis_to_plain(identified):
    model = identified.model
    return {
        'equation': model.equation.name,
        'ratios': {
            name: {'value': value, 'std': identified.std[name], 'unit': RATIO_UNITS[name]}
            for name, value in model.terms.items()
        },
        'covariance': identified.covariance.tolist(),
        'trim_rad': float(model.trim),
        'trim_std_rad': float(identified.trim_std),
        'friction_rate_rad_s': float(model.friction_rate),
        'valid_amplitude_rad': [float(a) for a in identified.amplitude_range],
        'metrics': identified.metrics,
        'provenance': identified.provenance,
    }
