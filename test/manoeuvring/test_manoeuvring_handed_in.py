"""What the wing hands in, held to what the tests of the core ask: outputs, texts, parameters, public names."""

import re

import hostile_models as hostile
import pytest
import yaml
from hostile_manoeuvring_models import manoeuvring_text, manoeuvring_texts
from hypothesis import given
from test_files_outputs import refusing
from test_light import HEAVY, loaded_by
from test_nodes_launch import assert_arguments_are_described_and_used, assert_nodes_start_once, remapped
from test_nodes_parameter_tables import assert_every_parameter_matters, choices_of
from test_public_api import NAMES, running_examples

from swath_sysid.attitude.motion.attitude import FRAMES
from swath_sysid.cli.main import main
from swath_sysid.formats.schema import plain_content
from swath_sysid.manoeuvring.formats.csv import write_manoeuvring_csv
from swath_sysid.manoeuvring.formats.model_file import manoeuvring_from_yaml, manoeuvring_to_yaml
from swath_sysid.manoeuvring.hull.model import preset
from swath_sysid.manoeuvring.hull.standard_tests import RunNoise, trial_programme, with_noise
from swath_sysid.manoeuvring.motion.window import THRUST_INPUTS
from swath_sysid.manoeuvring.nodes.settings import manoeuvring_pipeline_settings, manoeuvring_settings
from swath_sysid.manoeuvring.wing import WING
from swath_sysid.nodes.parameters.settings import installation

SIMULATE = 'manoeuvre simulate --hull wamv-vrx-old --test'
SETTINGS_OF = {
    'manoeuvring_identifier': manoeuvring_settings,
    'manoeuvring_predictor': lambda values: (manoeuvring_pipeline_settings(values), installation(values)),
}
HOSTILE = manoeuvring_texts()


@pytest.fixture
def measured(measured):
    if not (measured / 'run.csv').exists():
        assert main([*SIMULATE.split(), 'turning-circle', '--output', str(measured / 'run.csv')]) == 0
    return measured


HARMFUL = [
    'manoeuvre identify {0}/run.csv --output {0}/run.csv',
    'manoeuvre identify {0}/run.csv --plot {0}/trial.csv',
    f'{SIMULATE} turning-circle --output a.csv --plot a.csv',
    f'{SIMULATE} programme --output {{0}}/trial.csv',
    'manoeuvre play-through {0}/trial.mcap --output {0}/trial.mcap',
]
test_harmful_outputs_are_refused_and_nothing_changes = refusing(HARMFUL)


@pytest.mark.parametrize('name', HOSTILE)
def test_hostile_texts_are_refused_by_the_field(name):
    text, words = HOSTILE[name]
    assert re.search(words, hostile.refusal(manoeuvring_from_yaml, text))


def test_a_deep_file_is_refused(tmp_path, capsys):
    hostile.assert_a_deep_file_is_refused(
        'manoeuvre simulate --test programme --model {0}/file.yaml --output {0}/out', tmp_path, capsys
    )


@pytest.mark.long
@hostile.EVERY_TEXT
@given(hostile.texts_like(manoeuvring_text()))
def test_a_text_is_a_model_or_one_sentence(text):
    hostile.assert_a_model_or_one_sentence(text, manoeuvring_from_yaml, manoeuvring_to_yaml)


def test_pure_python_reads_a_model_as_the_library_does(monkeypatch):
    by_library = plain_content(manoeuvring_text(), 'it')
    monkeypatch.setattr('swath_sysid.formats.schema._PARSER', yaml.SafeLoader)
    assert plain_content(manoeuvring_text(), 'it') == by_library


@pytest.mark.long
@pytest.mark.parametrize('node', ['identifier', 'predictor'])
def test_a_node_loads_no_more_of_the_core_than_it_runs(node):
    pytest.importorskip('rclpy')
    loaded = loaded_by(f'swath_sysid.manoeuvring.nodes.{node}')
    rooms = ('swath_sysid.attitude.identification.', 'swath_sysid.attitude.prediction.forecaster.')
    assert {name for name in loaded if f'{name}.'.startswith(rooms)} == loaded & HEAVY == set()


@pytest.mark.long
def test_filterpy_is_loaded_by_what_forecasts_and_by_nothing_else():
    assert 'filterpy' not in loaded_by('swath_sysid.manoeuvring.identification.refit as work; work.warm_up()')
    assert 'filterpy' not in loaded_by('swath_sysid.manoeuvring.cli.manoeuvre')
    assert 'filterpy' in loaded_by('swath_sysid.manoeuvring.prediction.predictor')


def test_choices_are_those_of_the_wing():
    assert choices_of(WING.nodes) == {
        ('manoeuvring_identifier', 'thrust_input'): THRUST_INPUTS,
        ('manoeuvring_predictor', 'frame'): FRAMES,
    }


@pytest.mark.parametrize('node', WING.nodes)
def test_every_parameter_matters(node):
    others = {'thrust_input': 'force', 'leads_s': [0.7], 'frame': 'frd', 'mounting_deg': [0.0, 0.0, 90.0]}
    assert_every_parameter_matters(node, SETTINGS_OF[node], others)


def test_the_launch_file_starts_the_nodes_with_described_arguments_and_remapped_topics():
    arguments = 'namespace model_file use_sim_time odometry_topic imu_topic port_topic starboard_topic '
    arguments += 'forecast_rate_hz stop_after_s identify model_path mass_kg lever_m'
    assert_arguments_are_described_and_used('manoeuvring', arguments)
    assert_nodes_start_once('manoeuvring', WING.nodes)
    heard = {'odometry', 'thrusters/left/thrust', 'thrusters/right/thrust'}
    expected = {'manoeuvring_predictor': {'imu/data', *heard}, 'manoeuvring_identifier': heard}
    assert remapped('manoeuvring') == expected


@pytest.fixture(scope='module')
def folder_of_examples(tmp_path_factory):
    folder = tmp_path_factory.mktemp('examples')
    (folder / 'runs').mkdir()
    craft = preset('wamv-vrx-new')
    for seed, name in enumerate(('zigzag_20', 'mixed')):
        manoeuvre = with_noise(trial_programme(craft)[name], RunNoise(), seed)
        write_manoeuvring_csv(folder / 'runs' / f'{name}.csv', manoeuvre, craft)
    (folder / 'wamv.yaml').write_text(manoeuvring_text(), encoding='utf-8')
    return folder


test_every_public_name_has_an_example_that_runs = running_examples(NAMES['manoeuvring'])
