"""What is loaded by what: nothing heavy before it is needed, nothing of the other wing."""

import functools
import subprocess
import sys

import pytest

HEAVY = {'filterpy', 'matplotlib', 'numba', 'rich', 'rosbags', 'scipy.signal', 'scipy.stats'}


@functools.cache
def loaded_by(modules):
    """The names of all modules that importing some leaves loaded, in a process of its own."""
    code = f'import sys, {modules}; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_verbs_begin_without_what_they_may_not_need_and_a_fit_without_campaigns():
    verbs = ('identify', 'compare', 'inspect', 'simulate', 'scale', 'run', 'record', 'replay')
    assert loaded_by(', '.join(f'swath_sysid.cli.{verb}' for verb in verbs)) & HEAVY == set()
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
    for node in ('all_in_one', 'imu_buffer'):
        assert loaded_by(f'swath_sysid.nodes.{node}') & (HEAVY | {'scipy.optimize'}) == set(), node


@pytest.mark.parametrize('module', ['attitude.prediction.sea_fit', 'attitude.identification.refit'])
def test_the_workers_learn_without_scipy_signal(module):
    """It takes 20 MB, in each."""
    assert 'scipy.signal' not in loaded_by(f'swath_sysid.{module} as work; work.warm_up()')
