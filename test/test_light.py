"""What is loaded by what: nothing heavy before it is needed, and numba that cannot be used is done without."""

import functools
import json
import math
import os
import subprocess
import sys

import pytest
from repository import ROOT

from swath_sysid.common.wings import wings

HEAVY = {'filterpy', 'matplotlib', 'numba', 'rich', 'rosbags', 'scipy.signal', 'scipy.stats'}


@functools.cache
def loaded_by(modules):
    """The names of all modules that importing some leaves loaded, in a process of its own."""
    code = f'import sys, {modules}; print(*sys.modules)'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def strangers_of(module, *rooms):
    """What a module loads of these rooms, and of wings beyond what they hand in."""
    beginnings = tuple(f'swath_sysid.{room}.' for room in (*rooms, *(wing.name for wing in wings())))
    loaded = loaded_by(module) - loaded_by('swath_sysid.common.wings as work; work.wings()')
    return {name for name in loaded if f'{name}.'.startswith(beginnings)}


@pytest.mark.long
def test_verbs_begin_without_what_they_may_not_need_and_a_fit_without_wings():
    verbs = ('identify', 'compare', 'inspect', 'simulate', 'run', 'record', 'replay')
    assert loaded_by(', '.join(f'swath_sysid.cli.{verb}' for verb in verbs)) & HEAVY == set()
    assert strangers_of('swath_sysid.cli.identify') == set()
    # the help loads no library but the reader of the table of flags
    assert loaded_by('swath_sysid.cli.main') & (HEAVY | {'numpy', 'scipy'}) == set()


@pytest.mark.parametrize(
    ('node', 'foreign'),
    [
        ('imu_buffer', ('attitude.identification', 'attitude.prediction.forecaster')),
        ('identifier', ('attitude.prediction.forecaster',)),
        ('predictor', ('attitude.identification',)),
        ('all_in_one', ()),
    ],
)
def test_a_node_loads_no_more_of_the_core_than_it_runs(node, foreign):
    pytest.importorskip('rclpy')
    module = f'swath_sysid.nodes.{node}'
    assert strangers_of(module, *foreign) == set()
    assert loaded_by(module) & (HEAVY | {'scipy.optimize'}) == set()


@pytest.mark.long
def test_filterpy_is_loaded_by_what_forecasts_and_by_nothing_else():
    for module in ('attitude.prediction.sea_fit', 'attitude.identification.refit'):
        assert 'filterpy' not in loaded_by(f'swath_sysid.{module} as work; work.warm_up()')
    loaded = loaded_by('swath_sysid.pipeline.forecast_pipeline as work; work.warm_up()')
    assert 'filterpy' in loaded and 'scipy.stats' not in loaded


@pytest.mark.long
def test_filterpy_has_its_statistics_when_it_asks_for_them():
    code = 'from swath_sysid.common.filterpy_filter import ExtendedKalmanFilter as EKF; import numpy as np, sys; '
    code += 'f = EKF(1, 1); f.R *= 3; f.update(np.full((1, 1), 0.5), lambda x: np.ones((1, 1)), lambda x: x); '
    code += 'print("scipy.stats" in sys.modules, f.log_likelihood); from filterpy.stats import gaussian'
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    early, found = done.stdout.split()
    # of a normal distribution of variance 1 + 3
    assert early == 'False' and float(found) == pytest.approx(-0.5 * (0.5**2 / 4.0 + math.log(8.0 * math.pi)))


@pytest.mark.long
@pytest.mark.parametrize('module', ['attitude.prediction.sea_fit', 'attitude.identification.refit'])
def test_the_workers_learn_without_libraries_of_which_they_need_a_line(module):
    unneeded = {'scipy.signal', 'scipy.integrate', 'scipy.stats'}
    assert loaded_by(f'swath_sysid.{module} as work; work.warm_up()') & unneeded == set()


FIT = """
import json, sys
import swath_sysid.attitude.identification.refit
from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.common.accelerator import has_numba, why_slower
import numpy as np
early = 'numba' in sys.modules
angle, _ = simulate(hull_named('swath-pitch').model, 0.1, 0.0, np.linspace(0.0, 5.0, 50))
why = why_slower()
print(json.dumps([early, has_numba(), why and [why.code, why.message], angle[-1]]))
"""


def found(environment, *paths):
    path = os.pathsep.join([*map(str, paths), str(ROOT), os.environ.get('PYTHONPATH', '')])
    given = {name: value for name, value in os.environ.items() if name != 'NUMBA_DISABLE_JIT'}
    done = subprocess.run(
        [sys.executable, '-c', FIT], env={**given, 'PYTHONPATH': path, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.long
def test_numba_that_cannot_be_loaded_or_is_not_wanted_is_named_and_done_without(tmp_path):
    early, usable, disabled, plain = found({'NUMBA_DISABLE_JIT': '1'})
    assert not early and not usable
    (tmp_path / 'numba.py').write_text('raise ImportError("Numba needs NumPy 2.2\\nor less")')
    early, usable, why, angle = found({}, tmp_path)
    assert not early and not usable and angle == plain
    assert why[0] == 'numba-fails' and '(Numba needs NumPy 2.2 or less)' in why[1]
    pytest.importorskip('numba')
    assert disabled[0] == 'numba-disabled' and 'unset it' in disabled[1]
    early, usable, why, angle = found({})
    assert not early and usable and why is None and angle == pytest.approx(plain, rel=1e-9)
