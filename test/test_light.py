"""What is loaded by what: nothing heavy before it is needed, nothing of the other wing."""

import subprocess
import sys

import pytest

HEAVY = {'filterpy', 'matplotlib', 'numba', 'rich', 'rosbags', 'scipy.signal', 'scipy.stats'}


def loaded_by(module):
    """The names of all modules that importing one leaves loaded, in a process of its own."""
    code = f'import sys, {module}; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize('verb', ['identify', 'compare', 'inspect', 'simulate', 'scale', 'run', 'record', 'replay'])
def test_a_verb_begins_without_what_it_may_not_need(verb):
    assert loaded_by(f'swath_sysid.cli.{verb}') & HEAVY == set()


def test_a_fit_loads_nothing_of_a_campaign():
    assert {name for name in loaded_by('swath_sysid.cli.identify') if name.startswith('swath_sysid.campaign')} == set()


def test_the_help_loads_no_library():
    assert loaded_by('swath_sysid.cli.main') & (HEAVY | {'numpy', 'scipy', 'yaml'}) == set()


@pytest.mark.parametrize(
    ('node', 'foreign'),
    [
        ('imu_buffer', ('attitude.identification', 'attitude.prediction.forecaster', 'manoeuvring')),
        ('identifier', ('attitude.prediction.forecaster', 'manoeuvring')),
        ('predictor', ('attitude.identification', 'manoeuvring')),
        ('all_in_one', ('manoeuvring',)),
        ('manoeuvring_identifier', ('attitude.identification', 'attitude.prediction.forecaster')),
        ('manoeuvring_predictor', ('attitude.identification', 'attitude.prediction.forecaster')),
    ],
)
def test_a_node_loads_no_more_of_the_core_than_it_runs(node, foreign):
    pytest.importorskip('rclpy')
    loaded = loaded_by(f'swath_sysid.nodes.{node}')
    strange = {name for name in loaded for room in foreign if f'{name}.'.startswith(f'swath_sysid.{room}.')}
    assert strange == set()


def test_the_nodes_load_only_what_small_computers_have_memory_for():
    """scipy.stats, which filterpy imports, takes 30 MB in every process."""
    pytest.importorskip('rclpy')
    assert loaded_by('swath_sysid.nodes.all_in_one') & (HEAVY | {'scipy.optimize'}) == set()


@pytest.mark.parametrize('module', ['attitude.prediction.sea_fit', 'attitude.identification.refit'])
def test_the_workers_learn_without_scipy_signal(module):
    """It takes 20 MB, in each."""
    assert 'scipy.signal' not in loaded_by(f'swath_sysid.{module} as work; work.warm_up()')


def test_the_buffer_computes_without_the_large_libraries():
    pytest.importorskip('rclpy')
    # not scipy.linalg, which some versions of scipy.special load by themselves
    heavy = HEAVY | {'scipy.optimize'}
    assert loaded_by('swath_sysid.nodes.imu_buffer') & heavy == set()
