"""What every test shares: the real records and a quiet environment."""

import importlib
import os
import re
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from swath_sysid.attitude.motion.sensor_checks import Contradiction
from swath_sysid.cli.main import main
from swath_sysid.common.advice import Advice

# rclpy from PyPI looks for its middleware under this prefix and refuses to start without it
os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)
os.environ.setdefault('MPLBACKEND', 'Agg')

# the newest hypothesis does so by itself, Ubuntu's does not: a change is judged by the same examples as the last one
if os.environ.get('CI'):
    settings.register_profile('the same examples', derandomize=True)
    settings.load_profile('the same examples')


@pytest.fixture(scope='session')
def data_folder():
    """The folder of measured records; tests that ask for it skip where it is absent."""
    default = Path(__file__).resolve().parents[2] / 'shared' / 'data'
    folder = Path(os.environ.get('SWATH_SYSID_DATA', default))
    if not folder.is_dir():
        pytest.skip(f'no measured records at {folder}: set SWATH_SYSID_DATA to their folder')
    return folder


@pytest.fixture(scope='session')
def measured(tmp_path_factory):
    """A folder with a decay as a table, a bag file and a bag folder, and the model of it."""
    folder = tmp_path_factory.mktemp('measured')
    for name in ('trial.csv', 'trial.mcap', 'bag'):
        command = ['simulate', '--hull', 'swath-pitch', '--initial-angle-deg', '6', '--output', str(folder / name)]
        assert main(command) == 0
    assert main(['identify', str(folder / 'trial.csv'), '--output', str(folder / 'model.yaml')]) == 0
    return folder


@pytest.fixture
def benchmark_module(monkeypatch):
    """Imports a module of the folder benchmark/ by its name."""
    monkeypatch.syspath_prepend(Path(__file__).resolve().parents[1] / 'benchmark')
    return importlib.import_module


@pytest.fixture(autouse=True)
def advice_in_numbers(monkeypatch):
    """No test may see an advice that states a number which is none; what is made is looked at where it is made."""
    unknown = []

    def looked_at(made):
        def init(self, code, message, *others, **named):
            made(self, code, message, *others, **named)
            # a cell of a file may say so
            if re.search(r'(?<![\w.])[-+]?nan(?![\w.])', re.sub("'[^']*'", '', message)):
                unknown.append(f'{code}: {message}')

        return init

    for kind in (Advice, Contradiction):
        monkeypatch.setattr(kind, '__init__', looked_at(kind.__init__))
    yield
    assert unknown == []
