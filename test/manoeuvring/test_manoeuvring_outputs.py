"""Outputs of the wing are looked at before any work, and what is loaded by what: see the core's tests of both."""

import pytest
from test_files_outputs import refusing
from test_light import HEAVY, loaded_by

from swath_sysid.cli.main import main

SIMULATE = 'manoeuvre simulate --hull wamv-vrx-old --test'


@pytest.fixture
def measured(measured):
    if not (measured / 'run.csv').exists():
        assert main([*SIMULATE.split(), 'turning-circle', '--output', str(measured / 'run.csv')]) == 0
    return measured


test_harmful_outputs_are_refused_and_nothing_changes = refusing(
    [
        'manoeuvre identify {0}/run.csv --output {0}/run.csv',
        'manoeuvre identify {0}/run.csv --plot {0}/trial.csv',
        f'{SIMULATE} turning-circle --output a.csv --plot a.csv',
        f'{SIMULATE} programme --output {{0}}/trial.csv',
        'manoeuvre play-through {0}/trial.mcap --output {0}/trial.mcap',
    ]
)


@pytest.mark.parametrize('node', ['identifier', 'predictor'])
def test_a_node_loads_no_more_of_the_core_than_it_runs(node):
    pytest.importorskip('rclpy')
    loaded = loaded_by(f'swath_sysid.manoeuvring.nodes.{node}')
    rooms = ('swath_sysid.attitude.identification.', 'swath_sysid.attitude.prediction.forecaster.')
    assert {name for name in loaded if f'{name}.'.startswith(rooms)} == loaded & HEAVY == set()


def test_filterpy_is_loaded_by_what_forecasts_and_by_nothing_else():
    assert 'filterpy' not in loaded_by('swath_sysid.manoeuvring.identification.refit as work; work.warm_up()')
    assert 'filterpy' not in loaded_by('swath_sysid.manoeuvring.cli.manoeuvre')
    assert 'filterpy' in loaded_by('swath_sysid.manoeuvring.prediction.predictor')
