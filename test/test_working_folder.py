"""No process of ours runs a file of the working folder, which may hold a download called signal.py."""

import os
import re
import signal
import subprocess
import sys
from importlib.metadata import packages_distributions
from importlib.util import find_spec

import pytest
from package_process import environment, wait_for
from repository import ABSENT, ROOT

#: As the console script, and then what children of every kind do.
COMMAND = 'import sys\nfrom swath_sysid.start import command_line\n'
CHILDREN = """
import time
from swath_sysid.cli.main import VERBS, module_of
from swath_sysid.common.processes import WorkerProcess, results_in_order
if __name__ == '__main__':
    for verb in VERBS:
        module_of(verb)
    # more processes than tasks that this one can have done before they start
    assert list(results_in_order(time.sleep, [1.0] * 6, 3)) == [None] * 6
    worker = WorkerProcess(time.time, time.monotonic)
    assert worker.run((abs, (-3,), False), lambda: False) == 3
    worker.end()
"""


@pytest.fixture
def trap(tmp_path):
    """A folder with a file for each module there is, which leaves its name behind when it is imported."""
    folder = tmp_path / 'downloads'
    folder.mkdir()
    code = f"import os\nos.write(os.open({str(folder / 'run')!r}, os.O_WRONLY | os.O_CREAT | os.O_APPEND), b'%s ')\n"
    names = {*sys.stdlib_module_names, *packages_distributions(), 'swath_sysid'} - {'re', *sys.builtin_module_names}
    for name in filter(str.isidentifier, names):
        (folder / f'{name}.py').write_text(code % name)
    return folder


def command(folder, code, *words):
    path = folder.parent / 'swath-sysid'
    path.write_text(code)
    return [sys.executable, path, *words]


def run_of(folder):
    marks = folder / 'run'
    return marks.read_text() if marks.exists() else ''


def test_a_module_of_the_working_folder_would_leave_its_name(trap):
    # a command that ran in this process has set it for its children
    unsafe = {name: value for name, value in environment().items() if name != 'PYTHONSAFEPATH'}
    subprocess.run([sys.executable, '-c', 'import signal'], cwd=trap, env=unsafe, check=True)
    assert 'signal' in run_of(trap)


@pytest.mark.long
def test_verbs_and_worker_processes_import_nothing_from_the_working_folder(trap):
    done = subprocess.run(
        command(trap, COMMAND + CHILDREN), cwd=trap, env=environment(), capture_output=True, text=True
    )
    assert (done.returncode, run_of(trap)) == (0, ''), done.stderr


def test_an_empty_entry_of_pythonpath_is_left_out_and_others_stay(tmp_path):
    (tmp_path / 'named').mkdir()
    (tmp_path / 'named' / 'of_the_user.py').touch()
    (tmp_path / 'numpy.py').write_text('raise SystemExit(7)')
    code = COMMAND + 'import numpy, of_the_user, os\nprint(os.environ["PYTHONPATH"])\n'
    path = os.pathsep.join([environment()['PYTHONPATH'], str(tmp_path / 'named')])
    done = subprocess.run(
        command(tmp_path / 'named', code),
        cwd=tmp_path,
        env=environment() | {'PYTHONPATH': f'{os.pathsep}{path}{os.pathsep}'},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (0, f'{path}\n'), done.stderr


@pytest.mark.long
@pytest.mark.dds
def test_nodes_the_craft_and_the_page_import_nothing_from_the_working_folder(trap):
    pytest.importorskip('rclpy')
    log = trap.parent / 'log'
    page = ('--page', '--port', '0') if find_spec('nicegui') and not ABSENT else ()
    words = ('run', '--simulate', 'swath-roll', *page)
    with open(log, 'w') as text:
        nodes = subprocess.Popen(
            command(trap, COMMAND + 'sys.exit(command_line())\n', *words),
            cwd=trap,
            env=environment(),
            stdout=text,
            stderr=text,
        )
    try:
        wait_for(lambda: {'ready:', '[simulated_craft]:'} <= set(log.read_text().split()), 'nodes and craft')
    finally:
        nodes.send_signal(signal.SIGINT)
        assert nodes.wait(60.0) == 0, log.read_text()
    assert run_of(trap) == '', log.read_text()


def test_every_child_that_python_runs_is_started_with_the_safe_path():
    for path in [*(ROOT / 'swath_sysid').rglob('*.py'), *(ROOT / 'examples').glob('*.py')]:
        for words in re.findall(r'sys\.executable,([^\]]*)', path.read_text(encoding='utf-8')):
            assert words.strip().startswith(("'-P'", '*LOAD')), path
