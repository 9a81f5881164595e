"""The package may be installed with pip in any order, as it is and editable, also over what an earlier version left."""

import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from repository import ROOT

NOT_COPIED = shutil.ignore_patterns('.*', 'build', 'docs', 'install', 'log', 'out', 'test', '__pycache__', '*.egg-info')


class Environment:
    """A virtual environment that sees the libraries of this one; pip takes the package from a copy of the checkout."""

    def __init__(self, folder):
        self._folder, self.checkout = folder / 'venv', folder / 'checkout'
        shutil.copytree(ROOT, self.checkout, ignore=NOT_COPIED)
        subprocess.run([sys.executable, '-m', 'venv', '--without-pip', self._folder], check=True)
        self.packages = Path(sysconfig.get_path('purelib', 'venv', {'base': str(self._folder)}))
        (self.packages / 'of_the_tests.pth').write_text(sysconfig.get_path('purelib'))
        self.home = folder / 'home'

    def run(self, program, *words):
        # without a PYTHONPATH, which would come before what is installed
        environment = {'PATH': '/usr/bin:/bin', 'HOME': str(self.home), 'PIP_DISABLE_PIP_VERSION_CHECK': '1'}
        done = subprocess.run(
            [self._folder / 'bin' / program, *words], env=environment, cwd='/', capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout.strip()

    def pip(self, *words):
        self.run('python', '-m', 'pip', *words)

    def install(self, *words):
        self.pip('install', '-q', '--no-index', '--no-deps', '--no-build-isolation', *words)

    def place(self):
        """The folder from which the package is imported, and the command works."""
        assert self.run('swath-sysid', '--version').startswith('swath_sysid ')
        return Path(self.run('python', '-c', 'import swath_sysid.cli.main; print(swath_sysid.__file__)')).parents[1]


@pytest.mark.release
def test_any_order_of_installing_works_also_over_the_caches_of_an_earlier_version(tmp_path):
    pytest.importorskip('setuptools', '70.1')
    environment = Environment(tmp_path)
    plain, editable = environment.packages, environment.checkout
    source = str(editable)

    def orders():
        for extra in ('', '[fast]'):
            environment.install(f'{source}{extra}')
            assert environment.place() == plain
            environment.install('--editable', f'{source}{extra}')
            assert environment.place() == editable
        environment.pip('uninstall', '-qy', 'swath_sysid')
        environment.install('--editable', source)
        assert environment.place() == editable
        environment.install(source)
        assert environment.place() == plain

    orders()
    command = 'simulate --hull swath-pitch --initial-angle-deg 5 --output'.split()
    environment.run('swath-sysid', *command, str(tmp_path / 'decay.csv'))
    assert not [*plain.joinpath('swath_sysid').rglob('*.nb[ci]'), *editable.rglob('*.nb[ci]')]
    environment.pip('uninstall', '-qy', 'swath_sysid')
    assert not plain.joinpath('swath_sysid').exists()
    # numba wrote its cache there until it was given a place of its own, and pip removes only what it has installed
    left = plain / 'swath_sysid' / 'common' / '__pycache__' / 'terms.damping_moment-10.py311.nbi'
    left.parent.mkdir(parents=True)
    left.touch()
    orders()
