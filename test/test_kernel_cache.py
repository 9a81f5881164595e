"""Compiled kernels are kept in the user's cache, and whatever befalls it they are compiled again, with one sentence."""

import json
import os
import resource
import subprocess
import sys

import numpy as np
import pytest
from repository import ROOT

from swath_sysid import __version__
from swath_sysid.attitude.hull import terms
from swath_sysid.attitude.prediction import hull_track
from swath_sysid.cli.main import main
from swath_sysid.common.accelerator import accelerated

numba = pytest.importorskip('numba')
SIMULATION = """
import json
import numpy as np
from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.common.accelerator import why_slower
angle, _ = simulate(hull_named('swath-pitch').model, 0.1, 0.0, np.linspace(0.0, 5.0, 50))
print(json.dumps([angle[-1], (why := why_slower()) and why.message]))
"""


def simulated(limit=None, **environment):
    """The last angle, and why that took longer than it could; with at most ``limit`` bytes a file."""
    own = {name: value for name, value in os.environ.items() if name not in ('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME')}
    path = os.pathsep.join([str(ROOT), os.environ.get('PYTHONPATH', '')])
    done = subprocess.run(
        [sys.executable, '-c', SIMULATION],
        env={**own, 'PYTHONPATH': path, **environment},
        capture_output=True,
        text=True,
        preexec_fn=limit and (lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))),
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def files(folder, ending):
    return sorted(folder.rglob(f'*.{ending}'))


@pytest.mark.long
def test_kernels_are_kept_by_version_in_the_users_cache_or_where_numba_is_told_to(tmp_path):
    of_user, told = tmp_path / 'home', tmp_path / 'told'
    angle, why = simulated(HOME=str(of_user))
    stored = files(of_user / '.cache' / 'swath_sysid' / __version__, 'nbc')
    assert why is None and len(stored) > 3
    times = [path.stat().st_mtime_ns for path in stored]
    assert simulated(XDG_CACHE_HOME=str(of_user / '.cache')) == [angle, None]
    assert [path.stat().st_mtime_ns for path in stored] == times
    assert simulated(NUMBA_CACHE_DIR=str(told), HOME=str(of_user)) == [angle, None]
    assert len(files(told, 'nbc')) == len(stored)


@pytest.mark.long
def test_without_a_folder_or_space_for_them_kernels_are_compiled_each_time(tmp_path):
    angle, why = simulated(HOME=os.devnull)
    assert f'({os.devnull}/.cache/swath_sysid/{__version__}: Not a directory)' in why
    again, why = simulated(limit=4000, XDG_CACHE_HOME=str(tmp_path))
    assert again == angle and ': File too large)' in why and 'free disk space' in why
    assert files(tmp_path, 'nbc') == []


def doubled(x):
    return x + x


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A function that has a kernel double numbers of two types: the results, and what its cache reported."""
    from swath_sysid.common.kernel_cache import KernelCache

    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path))

    def results():
        reports = []
        dispatcher = numba.njit(doubled)
        dispatcher._cache = KernelCache(doubled, reports.append)
        return (
            dispatcher(2),
            dispatcher(0.25),
            [report.removeprefix(f'{tmp_path}/swath_sysid/{__version__}: ') for report in reports],
        )

    return results


def zeroed_within(path):
    """As a power cut leaves it where some pages were not written."""
    content = bytearray(path.read_bytes())
    content[2000:4000] = bytes(2000)
    path.write_bytes(content)


@pytest.mark.parametrize(
    ('ending', 'damage'),
    [
        ('nbi', lambda path: os.truncate(path, 0)),
        ('nbi', lambda path: os.truncate(path, 90)),
        ('nbc', lambda path: os.truncate(path, 0)),
        ('nbc', lambda path: os.truncate(path, 5000)),
        ('nbc', zeroed_within),
        # as two processes that store at once may leave it
        ('nbc', lambda path: path.write_bytes(files(path.parent, 'nbc')[0].read_bytes())),
    ],
    ids=['empty index', 'half an index', 'empty code', 'half the code', 'gaps in the code', 'code for another type'],
)
def test_a_damaged_cache_is_reported_and_mended(run, tmp_path, ending, damage):
    assert run() == run() == (4, 0.5, [])
    damaged = files(tmp_path, ending)
    for path in damaged:
        damage(path)
    *results, reports = run()
    assert results == [4, 0.5] and len(damaged) > 0
    assert reports and all(report.startswith('a file is damaged, ') for report in reports)
    assert run() == (4, 0.5, [])


def test_a_cache_that_is_filled_and_cannot_be_written_is_used(run, tmp_path, monkeypatch):
    assert run() == (4, 0.5, [])

    def refuse(*_, **__):
        raise PermissionError(13, 'Permission denied')

    monkeypatch.setattr('tempfile.TemporaryFile', refuse)
    assert run() == (4, 0.5, [])
    for path in files(tmp_path, 'nbi'):
        path.unlink()
    assert run() == (4, 0.5, ['Permission denied'] * 2)


def test_kernels_are_compiled_again_after_a_change_of_what_they_use_from_another_module(monkeypatch):
    from swath_sysid.common.kernel_cache import content_of

    function = hull_track.predict.__wrapped__

    def content():
        return content_of(function.__code__, function.__globals__)

    before = content()
    assert before == content()
    monkeypatch.setattr(terms, 'AT', terms.AT._replace(r2=terms.AT.r3))
    assert content() != before


def test_an_interrupt_while_a_kernel_returns_its_arrays_stays_one():
    kernel = accelerated(lambda x: (2.0 * x, 3.0 * x))
    kernel(np.ones(2))
    interrupted = []

    def interrupt(frame, event, _):
        if event == 'call' and frame.f_code.co_name == '_numba_unpickle' and not interrupted:
            interrupted.append(frame)
            raise KeyboardInterrupt

    sys.setprofile(interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            kernel(np.ones(3))
    finally:
        sys.setprofile(None)
    assert interrupted


AT_ONCE = """
import json, os, sys
from swath_sysid.common.accelerator import accelerated, answer_at_once, compile_kernels, load_kernels

@accelerated
def doubled(x):
    return x + x

def use():
    assert doubled(2.5) == 5.0

told = []
answer_at_once()
use()
told.append('numba' in sys.modules)
told.append(load_kernels(use))
use()
answer_at_once(False)
shares = []
compile_kernels([use], shares.append)
told.append(shares[-1])
answer_at_once()
told.append(load_kernels(use))
use()
told.append(len(doubled._dispatcher.overloads))
print(json.dumps(told))
"""


@pytest.mark.long
def test_a_process_that_answers_at_once_runs_kernels_uncompiled_until_the_cache_has_them(tmp_path):
    environment = {**os.environ, 'NUMBA_CACHE_DIR': str(tmp_path)}
    done = subprocess.run([sys.executable, '-c', AT_ONCE], env=environment, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [False, False, 1.0, True, 1]


def test_what_cannot_be_compiled_is_one_sentence_and_exit_code_2(monkeypatch, capsys):
    monkeypatch.setattr(numba.config, 'CACHE_DIR', os.devnull)
    assert main(['compile', '--quiet']) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1 and 'make it writable, or set NUMBA_CACHE_DIR' in said
