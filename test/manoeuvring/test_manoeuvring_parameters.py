"""Parameters and launch file of the manoeuvring nodes: see the core's tests of both."""

import pytest
from test_nodes_launch import assert_arguments_are_described_and_used, assert_nodes_start_once, remapped
from test_nodes_parameter_tables import assert_every_parameter_matters, choices_of

from swath_sysid.manoeuvring.motion.window import THRUST_INPUTS
from swath_sysid.manoeuvring.nodes.settings import manoeuvring_pipeline_settings, manoeuvring_settings
from swath_sysid.manoeuvring.wing import WING

SETTINGS_OF = {'manoeuvring_identifier': manoeuvring_settings, 'manoeuvring_predictor': manoeuvring_pipeline_settings}


def test_choices_are_those_of_the_wing():
    assert choices_of(WING.nodes) == {('manoeuvring_identifier', 'thrust_input'): THRUST_INPUTS}


@pytest.mark.parametrize('node', WING.nodes)
def test_every_parameter_matters(node):
    assert_every_parameter_matters(node, SETTINGS_OF[node], {'thrust_input': 'force', 'leads_s': [0.7]})


def test_the_launch_file_starts_the_nodes_with_described_arguments_and_remapped_topics():
    assert_arguments_are_described_and_used(
        'manoeuvring',
        'namespace model_file use_sim_time odometry_topic imu_topic port_topic starboard_topic forecast_rate_hz '
        'stop_after_s identify model_path mass_kg lever_m',
    )
    assert_nodes_start_once('manoeuvring', WING.nodes)
    thrusters = {'odometry', 'thrusters/left/thrust', 'thrusters/right/thrust'}
    assert remapped('manoeuvring') == {
        'manoeuvring_predictor': {'imu/data'} | thrusters,
        'manoeuvring_identifier': thrusters,
    }
