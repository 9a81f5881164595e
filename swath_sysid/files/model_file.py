"""The model file: YAML, versioned, complete, checked on reading; one or both axes of a craft.

It is what `identify` writes, what the identifier publishes on ``model/description``, and what
the predictor and `forecast` read. A file may also hold a schedule on draft (`scheduled_to_yaml`):
its ``axes`` are then the models of the middle draft, for readers that know of no schedule.
"""

import yaml

from swath_sysid.errors import InputError
from swath_sysid.files.atomic import replacing
from swath_sysid.files.plain_fields import check_fields, number_of, text_of, yaml_content
from swath_sysid.hull.decay_model import DecayModel, Equation
from swath_sysid.hull.identified_model import IdentifiedModel
from swath_sysid.hull.scheduled_model import QUANTITIES, ScheduledModel
from swath_sysid.hull.terms import RATIO_UNITS, TERM_NAMES
from swath_sysid.motion.trial import AXES

FORMAT = 'swath_sysid decay model'
VERSION = 1
FRAME = 'body x forward, y port, z up; Euler angles yaw-pitch-roll (REP 103)'

_FILE_FIELDS = ('format', 'version', 'frame', 'axes')
_OPTIONAL_FILE_FIELDS = ('schedule',)
_SCHEDULE_FIELDS = ('quantity', 'models')
_SCHEDULED_FIELDS = ('loading', 'model')
_AXIS_FIELDS = (
    'equation', 'ratios', 'covariance', 'trim_rad', 'trim_std_rad', 'friction_rate_rad_s', 'valid_amplitude_rad',
    'metrics', 'provenance',
)  # fmt: skip
_RATIO_FIELDS = ('value', 'std', 'unit')


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
    return yaml.dump(
        content, Dumper=_PlainDumper, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True
    )


class _PlainDumper(yaml.SafeDumper):
    """Writes the middle model of a schedule out instead of referring to it."""

    def ignore_aliases(self, data):
        return True


def model_from_yaml(text, source='the model'):
    """Models of a model file's text, by axis.

    Parameters
    ----------
    text : str
    source : str
        Named in the errors.

    Returns
    -------
    dict of str to IdentifiedModel

    Raises
    ------
    InputError
        Not a model file, of another version, or with unknown, missing or wrong fields, which
        the sentence names.
    """
    content = _checked_content(text, source)
    return {axis: _axis_from_plain(plain, axis, f'{source}, {axis}') for axis, plain in content['axes'].items()}


def schedules_from_yaml(text, source='the model'):
    """The schedules of a model file's text, by axis; empty where it holds none.

    Parameters
    ----------
    text : str
    source : str
        Named in the errors.

    Returns
    -------
    dict of str to ScheduledModel

    Raises
    ------
    InputError
        As `model_from_yaml`.
    """
    content = _checked_content(text, source)
    schedule = content.get('schedule', {})
    _check_axes(schedule, 'schedule', source, empty=True)
    if schedule and set(schedule) != set(content['axes']):
        raise InputError(f"{source}: the axes of 'schedule' and of 'axes' differ; give the same in both")
    return {axis: _schedule_from_plain(item, axis, f'{source}, schedule of {axis}') for axis, item in schedule.items()}


def _schedule_from_plain(plain, axis, source):
    check_fields(plain, _SCHEDULE_FIELDS, source)
    if plain['quantity'] not in QUANTITIES:
        raise InputError(f"{source}: there is no quantity '{plain['quantity']}'; choose from {', '.join(QUANTITIES)}")
    if not isinstance(plain['models'], list):
        raise InputError(f"{source}: 'models' must be a list")
    loadings, models = [], []
    for number, item in enumerate(plain['models'], 1):
        check_fields(item, _SCHEDULED_FIELDS, f'{source}, model {number}')
        loadings.append(number_of(item['loading'], f'{source}, model {number}, loading'))
        models.append(_axis_from_plain(item['model'], axis, f'{source}, model {number}'))
    return ScheduledModel(plain['quantity'], tuple(loadings), tuple(models))


def _checked_content(text, source):
    """The plain content of a model file, its frame and the names in it checked."""
    content = yaml_content(text, source)
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise InputError(f"{source} is no model file: its field 'format' is not '{FORMAT}'")
    if content.get('version') != VERSION:
        raise InputError(
            f'{source} is a model file of version {content.get("version")}; this software reads version {VERSION}: '
            'identify again'
        )
    check_fields({k: v for k, v in content.items() if k not in _OPTIONAL_FILE_FIELDS}, _FILE_FIELDS, source)
    if content['frame'] != FRAME:
        raise InputError(f"{source}: the frame '{content['frame']}' is not understood; it must be '{FRAME}'")
    _check_axes(content['axes'], 'axes', source)
    return content


def _check_axes(mapping, name, source, empty=False):
    if not isinstance(mapping, dict) or not (mapping or empty):
        raise InputError(f"{source}: the field '{name}' holds no axis; give {' or '.join(AXES)}")
    unknown = [axis for axis in mapping if axis not in AXES]
    if unknown:
        raise InputError(f"{source}: there is no axis '{unknown[0]}'; axes are {', '.join(AXES)}")


def write_model(path, models):
    """Write a model file, whole or not at all; see `model_to_yaml`."""
    with replacing(path) as temporary:
        temporary.write_text(model_to_yaml(models), encoding='utf-8')


def write_scheduled(path, schedules):
    """Write a model file with a schedule, whole or not at all; see `scheduled_to_yaml`."""
    with replacing(path) as temporary:
        temporary.write_text(scheduled_to_yaml(schedules), encoding='utf-8')


def read_model(path):
    """Read a model file; see `model_from_yaml`.

    Raises
    ------
    InputError
        Also where the file cannot be read.
    """
    return model_from_yaml(text_of(path), str(path))


def read_schedules(path):
    """Read the schedules of a model file; see `schedules_from_yaml`.

    Raises
    ------
    InputError
        Also where the file cannot be read.
    """
    return schedules_from_yaml(text_of(path), str(path))


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


def _axis_from_plain(plain, axis, source):
    check_fields(plain, _AXIS_FIELDS, source)
    ratios = plain['ratios']
    if not isinstance(ratios, dict):
        raise InputError(f"{source}: the field 'ratios' must map names to values")
    unknown = [name for name in ratios if name not in TERM_NAMES]
    if unknown:
        raise InputError(f"{source}: there is no ratio '{unknown[0]}'; ratios are {', '.join(TERM_NAMES)}")
    for name, ratio in ratios.items():
        check_fields(ratio, _RATIO_FIELDS, f'{source}, {name}')
        if ratio['unit'] != RATIO_UNITS[name]:
            raise InputError(f"{source}, {name}: the unit '{ratio['unit']}' must be '{RATIO_UNITS[name]}'")
    amplitudes = plain['valid_amplitude_rad']
    if not isinstance(amplitudes, list) or len(amplitudes) != 2:
        raise InputError(f"{source}: 'valid_amplitude_rad' must be the smallest and the largest amplitude")
    equation = Equation(str(plain['equation']), tuple(ratios))
    values = {name: number_of(ratio['value'], f'{source}, {name}') for name, ratio in ratios.items()}
    return IdentifiedModel(
        model=DecayModel.from_terms(
            equation, values, trim=number_of(plain['trim_rad'], f'{source}, trim_rad'),
            friction_rate=number_of(plain['friction_rate_rad_s'], f'{source}, friction_rate_rad_s'), axis=axis,
        ),
        covariance=_square_table(plain['covariance'], len(ratios), f'{source}, covariance'),
        trim_std=number_of(plain['trim_std_rad'], f'{source}, trim_std_rad'),
        amplitude_range=tuple(number_of(a, f'{source}, valid_amplitude_rad') for a in amplitudes),
        metrics=plain['metrics'],
        provenance=plain['provenance'],
    )  # fmt: skip


def _square_table(rows, size, source):
    if not isinstance(rows, list) or [len(row) if isinstance(row, list) else 0 for row in rows] != [size] * size:
        raise InputError(f'{source}: {size} ratios need {size} rows of {size} numbers')
    return [[number_of(value, source) for value in row] for row in rows]
