"""The parameters of the nodes, declared once: name, default, range, unit and meaning; and what they turn into.

Nothing here needs ROS: the same tables make the nodes' declarations, the configuration file, the
documentation, and the settings of the cores.
"""
from dataclasses import dataclass
from math import inf, radians

import yaml

from swath_sysid.attitude.identification.identify import OBJECTIVES, IdentificationSettings
from swath_sysid.attitude.identification.refit import RefitSettings
from swath_sysid.attitude.identification.search import ALGORITHMS, SearchSettings
from swath_sysid.attitude.motion.sensor_mount import FRAMES, Installation
from swath_sysid.attitude.motion.stamps import StampSettings
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.motion.window import WindowSettings
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_filter import HullFilterSettings
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.common.errors import InputError
from swath_sysid.formats.untrusted_yaml import plain_content, shown, text_of
from swath_sysid.manoeuvring.motion.window import AUTO, THRUST_INPUTS
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreOutlookSettings
from swath_sysid.manoeuvring.prediction.predictor import ManoeuvreFilterSettings
from swath_sysid.pipeline.forecast_pipeline import PipelineSettings


@dataclass(frozen=True)
class NodeParameter:
    """One parameter of a node.

    Attributes
    ----------
    name : str
        With its unit, where it has one that is not plain from the meaning.
    default : bool, int, float, str or list
        Its type is the parameter's.
    meaning : str
    unit : str
    lowest, highest : int, float or None
        Bounds, both included; of every element where the parameter is a list.
    choices : tuple of str
        Of the value, or of every element.
    read_only : bool
        Set at the start only.
    """

    name: str
    default: object
    meaning: str
    unit: str = ''
    lowest: float | None = None
    highest: float | None = None
    choices: tuple[str, ...] = ()
    read_only: bool = False

    @property
    def range_text(self):
        """The allowed values, for people."""
        if self.choices:
            return ', '.join(self.choices)
        if self.lowest is None:
            return ''
        return f'{_number(self.lowest)} to {_number(self.highest)}'

    def check(self, value):
        """Raise `InputError` unless the value is allowed."""
        for element in value if isinstance(value, list | tuple) else [value]:
            if self.choices and element not in self.choices:
                raise InputError(f"the parameter {self.name} cannot be '{element}': choose from {self.range_text}")
            if self.lowest is not None and not self.lowest <= element <= self.highest:
                raise InputError(
                    f'the parameter {self.name} cannot be {element}: give {self.range_text} {self.unit}'.rstrip()
                )


def _number(value):
    return str(value) if isinstance(value, int) else f'{value:g}'


SENSOR = (
    NodeParameter(
        'frame', 'flu',
        'Axes of the sensor: forward-left-up in an ENU world (REP 103), or forward-right-down in a NED world',
        choices=FRAMES, read_only=True,
    ),
    NodeParameter(
        'mounting_deg', [0.0, 0.0, 0.0],
        "Roll, pitch, yaw of the sensor's (FLU) axes as seen from the craft's", 'deg', -180.0, 180.0, read_only=True,
    ),
    NodeParameter('frame_id', 'base_link', 'frame_id of what is published: the axes of the craft', read_only=True),
    NodeParameter(
        'gap_limit_s', 1.0, 'After a longer silence (and five sample intervals) the sensor begins anew', 's',
        0.05, 60.0, read_only=True,
    ),
    NodeParameter(
        'backward_jump_s', 1.0, 'A stamp further back is a clock that was set back (a bag that looped); a nearer one '
        'is late and left out', 's', 0.05, 60.0, read_only=True,
    ),
    NodeParameter(
        'queue_depth', 1000, 'IMU messages that may wait while the node is busy', 'messages', 1, 100000, read_only=True,
    ),
)
"""What imu_buffer and predictor must agree on."""

DIAGNOSTICS = (
    NodeParameter('diagnostics_period_s', 1.0, 'Time between diagnostics (wall clock)', 's', 0.1, 60.0, read_only=True),
)

IMU_BUFFER = (
    *SENSOR,
    NodeParameter('window_s', 60.0, 'Length of the motion window', 's', 1.0, 3600.0, read_only=True),
    NodeParameter(
        'max_rate_hz', 1000.0, 'Memory is taken for so many samples a second; faster ones shorten the window', 'Hz',
        1.0, 10000.0, read_only=True,
    ),
    NodeParameter('record_at_start', True, 'Fill the window from the start (else after ~/record)', read_only=True),
    NodeParameter('auto_detect_decay', True, 'Publish the window by itself when a free decay has ended'),
    NodeParameter(
        'smallest_decay_deg', 1.0, 'A decay of a smaller first amplitude is not published by itself', 'deg', 0.05, 45.0,
        read_only=True,
    ),
    *DIAGNOSTICS,
)

MANOEUVRES = (
    NodeParameter(
        'manoeuvre_window_s', 900.0, 'Length of the window of odometry and thrust that ~/identify_manoeuvring fits',
        's', 60.0, 7200.0, read_only=True,
    ),
    NodeParameter(
        'manoeuvre_thrust_input', AUTO, 'What the thruster topics carry: N or commands of -1 to 1',
        choices=THRUST_INPUTS,
    ),
    NodeParameter(
        'manoeuvre_stop_after_s', 0.0, 'Without a command for so long the thrust is zero; 0: the last one holds', 's',
        0.0, 60.0, read_only=True,
    ),
    NodeParameter('manoeuvre_mass_kg', 0.0, 'Mass of the craft, cargo included; 0: not known', 'kg', 0.0, 1e6),
    NodeParameter(
        'manoeuvre_lever_m', 0.0, 'Half the distance between the thrusters; 0: that of a WAM-V 16', 'm', 0.0, 100.0,
    ),
    NodeParameter(
        'manoeuvre_model_path', '', 'Model file of the manoeuvring model, read at the start if it exists and replaced '
        'whenever the model changes; empty: none', read_only=True,
    ),
)
"""Of the identifier, for twin-thruster craft."""

IDENTIFIER = (
    NodeParameter('axes', list(AXES), 'Axes to identify', choices=AXES),
    NodeParameter(
        'equation', 'odd-cubic',
        'Equation to fit: a name of the catalogue, or damping|restoring terms as in linear,quadratic|linear,cubic',
    ),
    NodeParameter('objective', 'simulation', 'What the fit minimises', choices=OBJECTIVES),
    NodeParameter('search', 'ga', 'Search algorithm', choices=ALGORITHMS),
    NodeParameter('generations', 0, "Generations of the search; 0: the algorithm's default", '', 0, 100000),
    NodeParameter('population', 0, "Candidates a generation; 0: the algorithm's default", '', 0, 100000),
    NodeParameter('seed', 1, 'Seed of the search', '', 0, 2**31 - 1),
    NodeParameter(
        'least_improvement', 0.001, 'A refit is believed if its residuals on the window are smaller than the current '
        "model's by this part", '', 0.0, 0.9,
    ),
    NodeParameter('auto_identify', True, 'Refit whenever a window arrives'),
    NodeParameter(
        'window_service', 'imu_buffer/publish_window', 'Service that makes the buffer publish its window',
        read_only=True,
    ),
    NodeParameter('window_timeout_s', 2.0, 'How long ~/identify waits for the window', 's', 0.1, 60.0),
    NodeParameter(
        'model_path', '', 'Model file, read at the start if it exists and replaced whenever the model changes; '
        'empty: none', read_only=True,
    ),
    *MANOEUVRES,
    *DIAGNOSTICS,
)

PREDICTOR = (
    *SENSOR,
    NodeParameter(
        'leads_s', list(ForecasterSettings().leads), 'Leads with a topic of their own, increasing', 's', 0.01, 120.0,
        read_only=True,
    ),
    NodeParameter('horizon_s', 5.0, 'Length of forecast/horizon', 's', 0.1, 120.0, read_only=True),
    NodeParameter('horizon_step_s', 0.1, 'Step of forecast/horizon', 's', 0.005, 10.0, read_only=True),
    NodeParameter(
        'forecast_rate_hz', 10.0, 'Forecasts at the leads and over the horizon a second (forecast/next comes with '
        'every sample)', 'Hz', 0.1, 1000.0, read_only=True,
    ),
    NodeParameter(
        'waves_window_s', ForecasterSettings().window, 'The past that the waves are learnt from', 's', 10.0, 3600.0,
        read_only=True,
    ),
    NodeParameter(
        'waves_first_fit_s', ForecasterSettings().first_refit, 'The least past that the waves are learnt from (more: '
        'later, but not from a craft that is handled)', 's', 2.0, 3600.0, read_only=True,
    ),
    NodeParameter(
        'waves_refit_interval_s', ForecasterSettings().refit_interval, 'Least time between fits of the waves, which '
        'run in the background', 's', 1.0, 600.0, read_only=True,
    ),
    *(
        NodeParameter(
            f'quiet_{axis}_deg', 3.0, f'Largest {axis} either way of a quiet craft, for the probability on '
            'forecast/quiescence; 0: does not matter', 'deg', 0.0, 180.0,
        ) for axis in AXES
    ),
    *(
        NodeParameter(
            f'quiet_{axis}_rate_deg_s', 0.0, f'Largest {axis} rate either way of a quiet craft; 0: does not matter',
            'deg/s', 0.0, 1000.0,
        ) for axis in AXES
    ),
    NodeParameter(
        'quiet_for_s', 0.0, 'For so long from now the craft is to stay quiet, at most horizon_s; 0: horizon_s', 's',
        0.0, 120.0, read_only=True,
    ),
    NodeParameter(
        'loading', 0.0, 'Draft or displacement the craft floats at, in the unit its model is scheduled on; '
        '0: as told on craft/loading, or not known', '', 0.0, 1e9,
    ),
    NodeParameter(
        'gate_probability', HullFilterSettings().gate_probability,
        'A true measurement is taken for an outlier with this probability', '', 1e-30, 0.01, read_only=True,
    ),
    NodeParameter(
        'gate_patience', HullFilterSettings().gate_patience,
        'After so many rejected samples in a row the sensor is believed again', 'samples', 1, 1000, read_only=True,
    ),
    *DIAGNOSTICS,
)

MANOEUVRE_PREDICTOR = (
    NodeParameter('model_file', '', 'Model file of manoeuvre identify; empty: wait for manoeuvring/model',
                  read_only=True),
    NodeParameter('leads_s', [1.0, 5.0, 10.0], 'Leads with a topic of their own, rising', 's', 0.1, 120.0,
                  read_only=True),
    NodeParameter('horizon_s', 20.0, 'Length of the path ahead', 's', 1.0, 120.0, read_only=True),
    NodeParameter('horizon_step_s', 0.5, 'Time between poses of the path', 's', 0.1, 10.0, read_only=True),
    NodeParameter('forecast_rate_hz', 5.0, 'Forecasts a second, at most', 'Hz', 0.1, 50.0, read_only=True),
    NodeParameter('gap_limit_s', 5.0, 'After a longer silence of the odometry the filter begins anew', 's', 0.5, 60.0,
                  read_only=True),
    NodeParameter('backward_jump_s', 1.0, 'A stamp further back is a clock that was set back', 's', 0.05, 60.0,
                  read_only=True),
    NodeParameter('stop_after_s', 0.0, 'Without a command for so long the thrust is zero; 0: the last one holds', 's',
                  0.0, 60.0, read_only=True),
    NodeParameter('speed_noise_m_s', 0.05, 'Noise of the speeds, where the odometry does not tell it', 'm/s', 1e-4, 5.0,
                  read_only=True),
    NodeParameter('yaw_rate_noise_rad_s', 0.01, 'Noise of the yaw rate, where the sensor does not tell it', 'rad/s',
                  1e-5, 1.0, read_only=True),
    NodeParameter('heading_noise_rad', 0.01, 'Noise of the heading, where the odometry does not tell it', 'rad', 1e-5,
                  1.0, read_only=True),
    NodeParameter('position_noise_m', 0.5, 'Noise of the position, where the odometry does not tell it', 'm', 1e-3,
                  100.0, read_only=True),
    *DIAGNOSTICS,
)  # fmt: skip

TABLES = {'imu_buffer': IMU_BUFFER, 'identifier': IDENTIFIER, 'predictor': PREDICTOR}
"""Node name to its parameters, of the nodes that run together."""

ALL_TABLES = {**TABLES, 'manoeuvring_predictor': MANOEUVRE_PREDICTOR}
"""Node name to its parameters, of every node."""


def defaults(table):
    """Name to default value of a node's parameters."""
    return {parameter.name: parameter.default for parameter in table}


def check(table, values):
    """Raise `InputError` unless every value is allowed."""
    for parameter in table:
        parameter.check(values[parameter.name])


def installation(values):
    """How the sensor sits in the craft."""
    if len(values['mounting_deg']) != 3:
        raise InputError('the parameter mounting_deg takes three angles (roll, pitch, yaw), as in [0.0, 0.0, 90.0]')
    return Installation(values['frame'], tuple(radians(angle) for angle in values['mounting_deg']))


def window_settings(values):
    """Settings of imu_buffer's core.

    Parameters
    ----------
    values : dict
        Value of every parameter in `IMU_BUFFER`.

    Returns
    -------
    WindowSettings

    Raises
    ------
    InputError
    """
    check(IMU_BUFFER, values)
    return WindowSettings(
        window=values['window_s'],
        max_rate=values['max_rate_hz'],
        detect_decay=values['auto_detect_decay'],
        smallest_decay=radians(values['smallest_decay_deg']),
        installation=installation(values),
        stamps=StampSettings(values['backward_jump_s'], values['gap_limit_s']),
    )


def refit_settings(values):
    """Settings of identifier's core; see `window_settings`."""
    check(IDENTIFIER, values)
    identification = IdentificationSettings(
        equation=values['equation'] or None,
        objective=values['objective'],
        search=SearchSettings(
            algorithm=values['search'],
            generations=values['generations'] or None,
            population=values['population'] or None,
            seed=values['seed'],
        ),
    )
    equation = identification.chosen_equation
    if not equation.terms:
        raise InputError(f'the equation {equation.name} has no terms: name another')
    return RefitSettings(tuple(values['axes']), identification, values['least_improvement'])


def pipeline_settings(values):
    """Settings of predictor's core; see `window_settings`."""
    check(PREDICTOR, values)
    return PipelineSettings(
        installation=installation(values),
        stamps=StampSettings(values['backward_jump_s'], values['gap_limit_s']),
        forecaster=ForecasterSettings(
            hull=HullFilterSettings(
                gate_probability=values['gate_probability'], gate_patience=values['gate_patience']
            ),
            leads=tuple(values['leads_s']),
            horizon=values['horizon_s'],
            horizon_step=values['horizon_step_s'],
            forecast_rate=values['forecast_rate_hz'],
            window=values['waves_window_s'],
            refit_interval=values['waves_refit_interval_s'],
            first_refit=values['waves_first_fit_s'],
            quiescence=quiescence_limits(values),
        ),
    )


def quiescence_limits(values):
    """What predictor takes for a quiet craft; see `window_settings`."""
    def limit(name):
        return radians(values[name]) or inf

    return QuiescenceLimits(
        *(limit(f'quiet_{axis}_deg') for axis in AXES),
        *(limit(f'quiet_{axis}_rate_deg_s') for axis in AXES),
        duration=values['quiet_for_s'] or values['horizon_s'],
    )


def manoeuvring_pipeline_settings(values):
    """Settings of manoeuvring_predictor's core; see `window_settings`."""
    check(MANOEUVRE_PREDICTOR, values)
    noise = ManoeuvreFilterSettings(
        speed_noise=values['speed_noise_m_s'], yaw_rate_noise=values['yaw_rate_noise_rad_s'],
        heading_noise=values['heading_noise_rad'], position_noise=values['position_noise_m'],
    )  # fmt: skip
    return ManoeuvreOutlookSettings(
        tuple(values['leads_s']), values['horizon_s'], values['horizon_step_s'], values['forecast_rate_hz'],
        values['gap_limit_s'], values['backward_jump_s'], values['stop_after_s'], noise,
    )  # fmt: skip


def values_from_file(path, node_name):
    """The values of a node's parameters as a ROS parameter file sets them, without ROS.

    Parameters
    ----------
    path : str or Path or None
        None: the defaults.
    node_name : str
        A key of `ALL_TABLES`. The sections ``/**``, ``NAME``, ``/NAME`` and ``/**/NAME`` of the file apply, in
        its order.

    Returns
    -------
    dict of str to value
        Of every parameter of the node.

    Raises
    ------
    InputError
        The file cannot be read, is no parameter file, or sets a parameter that does not exist or
        is of another type.
    """
    values = defaults(ALL_TABLES[node_name])
    if path is None:
        return values
    applying = ('/**', node_name, f'/{node_name}', f'/**/{node_name}')
    for section, content in _sections(path).items():
        if section in applying:
            for name, value in content.items():
                if name in values:
                    values[name] = _of_type(values[name], value, name, path)
                elif section != '/**' and name != 'use_sim_time':
                    raise InputError(f'{path}: {node_name} has no parameter {shown(name)}; it has {", ".join(values)}')
    return values


def _sections(path):
    content = plain_content(text_of(path, 'parameter file'), str(path))
    sections = content if isinstance(content, dict) else {}
    if not sections or any(not isinstance(s, dict) or 'ros__parameters' not in s for s in sections.values()):
        raise InputError(f'{path} is no ROS parameter file: every section needs ros__parameters')
    found = {name: section['ros__parameters'] or {} for name, section in sections.items()}
    wrong = [name for name, parameters in found.items() if not isinstance(parameters, dict)]
    if wrong:
        raise InputError(f'{path}: the ros__parameters of {shown(wrong[0])} must map names to values')
    return found


def _of_type(default, value, name, path):
    kind = type(default[0]) if isinstance(default, list) else type(default)
    elements = value if isinstance(value, list) else [value]
    if isinstance(value, list) != isinstance(default, list) or any(type(e) is not kind for e in elements):
        example = ', as in 1.0 instead of 1' if kind is float else ''
        raise InputError(f'{path}: the parameter {name} must be of the type of {default}{example}, not {shown(value)}')
    return value


def configuration_file():
    """Text of the parameter file with every default, section by node."""
    lines = ['# Every parameter of the nodes with its default; made by swath_sysid.nodes.parameter_tables.']
    for node_name, table in ALL_TABLES.items():
        lines += ['', f'/**/{node_name}:', '  ros__parameters:']
        for parameter in table:
            allowed = f' ({parameter.range_text}{f" {parameter.unit}" if parameter.unit else ""})'
            lines.append(f'    # {parameter.meaning}{allowed if parameter.range_text else ""}')
            lines.append(f'    {parameter.name}: {_yaml_value(parameter.default)}')
    return '\n'.join(lines) + '\n'


def markdown_table(node_name):
    """The parameters of a node as a Markdown table.

    Parameters
    ----------
    node_name : str

    Returns
    -------
    str
    """
    lines = ['| Parameter | Default | Range | Unit | Meaning |', '|---|---|---|---|---|']
    for p in ALL_TABLES[node_name]:
        fixed = '' if not p.read_only else ' (set at the start)'
        meaning = f'{p.meaning}{fixed}'.replace('|', '\\|')
        lines.append(f'| `{p.name}` | `{_yaml_value(p.default)}` | {p.range_text} | {p.unit} | {meaning} |')
    return '\n'.join(lines) + '\n'


def _yaml_value(value):
    if isinstance(value, float):
        # YAML 1.1 reads a float by its dot
        text = repr(value)
        return text if '.' in text else text.replace('e', '.0e')
    return yaml.safe_dump(value, default_flow_style=True).replace('\n...', '').strip()
