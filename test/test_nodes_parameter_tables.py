"""The parameters: declared once, checked, and the same in table, file and settings."""

from importlib.util import find_spec
from math import radians
from pathlib import Path

import pytest
from repository import ROOT, are_those

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.identification.refit import RefitSettings
from swath_sysid.attitude.identification.result import OBJECTIVES
from swath_sysid.attitude.motion.attitude import FRAMES
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.motion.window import WindowSettings
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.common.errors import InputError
from swath_sysid.common.optimisers import OPTIMISERS
from swath_sysid.common.wings import handed_in
from swath_sysid.nodes.parameters.parameter_files import configuration_file, values_from_file, values_of
from swath_sysid.nodes.parameters.sections import sections_of
from swath_sysid.nodes.parameters.settings import craft_settings, pipeline_settings, refit_settings, window_settings
from swath_sysid.nodes.parameters.table import NODES, defaults, node_module, parameters_of, table_of
from swath_sysid.pipeline.forecast_pipeline import PipelineSettings

SETTINGS_OF = {
    'imu_buffer': window_settings,
    'identifier': refit_settings,
    'predictor': pipeline_settings,
    'simulated_craft': craft_settings,
}


def changed(node, **values):
    return {**defaults(node, values), **values}


def choices_of(nodes):
    return {(node, p.name): tuple(p.choices) for node in nodes for p in table_of(node) if p.choices}


def test_every_node_has_its_settings_whose_defaults_are_those_of_the_cores():
    assert {*SETTINGS_OF, *handed_in('nodes')} == set(NODES)
    assert window_settings(defaults('imu_buffer')) == WindowSettings()
    settings = pipeline_settings(defaults('predictor'))
    limits = QuiescenceLimits(roll=radians(3.0), pitch=radians(3.0), duration=settings.forecaster.horizon)
    assert settings == PipelineSettings(forecaster=ForecasterSettings(quiescence=limits))
    assert refit_settings(defaults('identifier')) == RefitSettings()


def test_choices_are_those_of_the_cores():
    assert choices_of(SETTINGS_OF) == {
        ('imu_buffer', 'frame'): FRAMES,
        ('predictor', 'frame'): FRAMES,
        ('identifier', 'axes'): AXES,
        ('identifier', 'objective'): OBJECTIVES,
        ('identifier', 'search'): tuple(OPTIMISERS),
        ('simulated_craft', 'hull'): tuple(PUBLISHED_HULLS),
    }


@pytest.mark.parametrize(
    ('node', 'name', 'value'),
    [
        ('imu_buffer', 'frame', 'ned'),
        ('imu_buffer', 'window_s', 0.0),
        ('imu_buffer', 'mounting_deg', [0.0, 0.0, float('nan')]),
        ('identifier', 'axes', ['roll', 'yaw']),
        ('identifier', 'equation', 'swath-pitch-10'),
        ('identifier', 'objective', 'best'),
        ('identifier', 'population', 3),
        ('predictor', 'leads_s', [1.0, 0.5]),
        ('predictor', 'horizon_s', 1e6),
        ('predictor', 'forecast_rate_hz', 0.0),
        ('predictor', 'gate_patience', 0),
        ('simulated_craft', 'hull', 'titanic'),
        ('simulated_craft', 'angle_deg', -10.0),
    ],
)
def test_what_makes_no_sense_is_refused_by_a_sentence(node, name, value):
    with pytest.raises(InputError) as refused:
        SETTINGS_OF[node](changed(node, **{name: value}))
    assert name.split('_')[0].rstrip('s') in str(refused.value)
    with pytest.raises(InputError, match='lengthen the horizon'):
        pipeline_settings(changed('predictor', quiet_for_s=7.0))


def test_values_reach_the_settings_in_their_units():
    window = window_settings(changed('imu_buffer', mounting_deg=[0.0, 10.0, 90.0]))
    assert window.installation.mounting == (0.0, radians(10.0), radians(90.0))
    refit = refit_settings(changed('identifier', equation='linear|linear', generations=7, axes=['pitch']))
    assert refit.identification.search.generations == 7 and refit.axes == ('pitch',)
    assert refit.identification.chosen_equation.terms == ('b1', 'r1')
    assert pipeline_settings(changed('predictor', leads_s=[2.5])).forecaster.leads == (2.5,)


def assert_every_parameter_matters(node, settings, others, beside=None):
    """No option does nothing: a changed value changes the settings, or the node reads it by name."""
    rooms = {Path(find_spec(module).origin).parent for module in (node_module(node), 'swath_sysid.nodes')}
    source = ''.join(path.read_text() for room in rooms for path in room.glob('*.py'))
    for parameter in parameters_of(node):
        companions = (beside or {}).get(parameter.name, {})
        before = settings(changed(node, **companions))
        default, other = parameter.default, others.get(parameter.name, 'another')
        if isinstance(default, bool):
            other = not default
        elif isinstance(default, int | float) and parameter.name not in others:
            is_share = 1e-3 <= default < 1
            other = type(default)(default / 2 if is_share else min(2 * default + 10, max(parameter.range)))
        after = settings(changed(node, **{**companions, parameter.name: other}))
        assert after != before or f"parameters['{parameter.name}']" in source, parameter.name


def test_every_parameter_matters():
    others = dict(frame='frd', axes=['roll'], equation='swath-pitch-1', objective='one-step', search='pso')
    others |= dict(mounting_deg=[0.0, 0.0, 90.0], leads_s=[0.7], quiet_for_s=3.0, frames_at_s=[1.0], points=['bow'])
    others |= dict(hull='swath-pitch', angle_deg=3.0)
    at_bow = {'points': ['bow'], 'points.bow': [1.0, 0.0, 0.0]}
    beside = {'quiet_heave_m': at_bow, 'quiet_vertical_velocity_m_s': at_bow, 'points': at_bow | {'points': []}}
    for node, settings in SETTINGS_OF.items():
        assert_every_parameter_matters(node, settings, others, beside)


def test_the_configuration_file_holds_the_defaults():
    path = ROOT / 'config' / 'swath_sysid.yaml'
    assert are_those(path.read_text(encoding='utf-8').split('\n\n'), configuration_file().split('\n\n')), (
        'write it anew: python -c "from swath_sysid.nodes.parameters.parameter_files import configuration_file; '
        "print(configuration_file(), end='')\" > config/swath_sysid.yaml"
    )
    for node in NODES:
        assert repr(values_from_file(path, node)) == repr(defaults(node))  # a NaN equals nothing


def test_sections_of_a_parameter_file_apply_in_order(tmp_path):
    path = tmp_path / 'parameters.yaml'
    path.write_text(
        '/**: {ros__parameters: {frame: frd, use_sim_time: true, of_another_node: 1}}\n'
        'predictor: {ros__parameters: {leads_s: [2.0], frame: flu}}\n'
        '/imu_buffer: {ros__parameters: {window_s: 30.0}}\n'
    )
    assert values_from_file(path, 'predictor') == changed('predictor', frame='flu', leads_s=[2.0])
    assert values_from_file(path, 'imu_buffer') == changed('imu_buffer', frame='frd', window_s=30.0)
    assert values_from_file(None, 'identifier') == defaults('identifier')


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        (
            'predictor: {ros__parameters: {leads: [1.0]}}',
            r'has no parameter leads \(did you mean leads_s\?\); it has frame',
        ),
        ('predictor: {ros__parameters: {points: [Bow]}}', "cannot hold 'Bow'"),
        ('predictor: {ros__parameters: {mounting_deg: [15, -10.5, 90]}}', r'as in \[15.0, -10.5\]'),
        ('predictor: {ros__parameters: {in_step: 1}}', 'must be of the type of False'),
        ('predcitor: {ros__parameters: {leads_s: [1.0]}}', 'no node predcitor: did you mean predictor'),
        ('/usv/predcitor: {ros__parameters: {leads: [1.0]}}', 'no node predcitor: did you mean predictor'),
        ('/**: {ros__parameters: {horizn_s: 5.0}}', 'a parameter horizn_s: did you mean horizon_s'),
        ('usv: {"*": {ros__parameters: {horizn_s: 5.0}}}\n/usv/predictor: {ros__parameters: {frame: frd}}', 'horizn_s'),
        ('/usv/predictor: {ros__parameters: {lead_s: [1.0]}}', 'did you mean leads_s'),
        ('controller_server: {ros__parameters: {rate: 5.0}}', 'no section for any of these nodes, only for others'),
        ('/a/predictor: {ros__parameters: {frame: frd}}\n/b/predictor: {ros__parameters: {}}', 'ros__parameters of /b'),
        ('/a/predictor: {ros__parameters: {frame: frd}}\n/b/predictor: {ros__parameters: {frame: frd}}', '/a and /b'),
        ('predictor: {ros__parameters: {leads_s: 1.0}}', 'must be of the type of'),
        ('predictor: {leads_s: [1.0]}', 'is not a ROS parameter file'),
        ('', 'is not a ROS parameter file'),
        ('a: [', 'is not YAML'),
    ],
)
def test_a_wrong_parameter_file_is_refused_by_a_sentence(tmp_path, text, sentence):
    path = tmp_path / 'parameters.yaml'
    path.write_text(text)
    with pytest.raises(InputError, match=sentence):
        values_from_file(path, 'predictor')
    with pytest.raises(InputError, match='cannot read'):
        values_from_file(tmp_path / 'missing.yaml', 'predictor')


#: As files of whole stacks hold them, with nodes and names that resemble ours.
OF_OTHERS = """
/**: {ros__parameters: {use_sim_time: true, robot_base_frame: base_link, publish_rate: 10, model: {path: a}}}
imu_filter: {ros__parameters: {stateless: false, gain: 0.1}}
/usv/predictor_2: {ros__parameters: {leads_s: [1.0]}}
identified: {ros__parameters: {topic: /a}}
/nav/predictor: {ros__parameters: {model: mpc, steps: 5}}
ekf_node: {ros__parameters: {frequency: 30.0, odom0_config: [true, false], process: {noise: {q: [1.0, 2.0]}}}}
controller_server: {ros__parameters: {FollowPath: {plugin: mppi, horizon: 3}}}
"""


def test_what_a_file_holds_for_other_nodes_is_left_alone(tmp_path):
    path = tmp_path / 'stack.yaml'
    path.write_text(
        OF_OTHERS + '/predictor: {ros__parameters: {leads_s: [2], mounting_deg: [15, -10, 90], horizon_s: 6}}\n'
    )
    found = values_from_file(path, 'predictor')
    assert found == changed('predictor', leads_s=[2.0], mounting_deg=[15.0, -10.0, 90.0], horizon_s=6.0)
    assert all(type(angle) is float for angle in (*found['mounting_deg'], found['horizon_s']))
    assert values_from_file(path, 'imu_buffer') == defaults('imu_buffer')


@pytest.mark.dds
@pytest.mark.parametrize(
    'text',
    [
        'predictor: {ros__parameters: {horizon_s: 1.5}}',
        '/**: {ros__parameters: {horizon_s: 1.5, frame: frd}}\n/*/predictor: {ros__parameters: {horizon_s: 2.5}}\n'
        '/**/predictor: {ros__parameters: {gate_patience: 7}}',
        'usv: {predictor: {ros__parameters: {horizon_s: 1.5}}}\n/usv/a/predictor: {ros__parameters: {horizon_s: 3.5}}',
        '/usv/predictor: {ros__parameters: {horizon_s: 1.5}}\n/**: {ros__parameters: {horizon_s: 2.5}}',
        '/*: {ros__parameters: {horizon_s: 1.5}}\nusv: {"*": {ros__parameters: {gate_patience: 7}}, "**": '
        '{ros__parameters: {frame: frd}}}',
        '/**/predictor: {ros__parameters: {points: [bow]}}\n/**: {ros__parameters: {points: {bow: [1.0, 0.0, 0.0]}}}',
    ],
)
def test_a_file_is_read_as_ros_reads_it(tmp_path, text):
    rclpy = pytest.importorskip('rclpy')
    path = tmp_path / 'parameters.yaml'
    path.write_text(text)
    for namespace in ('', '/usv', '/usv/a'):
        context = rclpy.Context()
        rclpy.init(context=context, args=['--ros-args', '--params-file', str(path), '-r', f'__ns:={namespace or "/"}'])
        node = rclpy.create_node('predictor', context=context)
        given = {name: parameter.value for name, parameter in node._parameter_overrides.items()}
        node.destroy_node()
        context.shutdown()
        expected = {**defaults('predictor', given), **{n: list(v) if n[:2] == 'po' else v for n, v in given.items()}}
        assert values_of(sections_of(path), 'predictor', f'{namespace}/predictor') == expected


def test_the_parameters_for_small_computers_are_known_and_cost_less():
    path = ROOT / 'config' / 'small.yaml'
    values = {node: values_from_file(path, node) for node in NODES}
    for node in ('imu_buffer', 'identifier', 'predictor'):
        SETTINGS_OF[node](values[node])
    small, usual = values['predictor'], defaults('predictor')
    assert small['forecast_rate_hz'] < usual['forecast_rate_hz']
    assert small['waves_refit_interval_periods'] > usual['waves_refit_interval_periods']
    assert values['imu_buffer']['max_rate_hz'] < defaults('imu_buffer')['max_rate_hz']
