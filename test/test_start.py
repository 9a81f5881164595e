"""A signal while the command line imports, SIGINT ignored as in a shell's background: no traceback, its exit code."""

import signal
import subprocess
import sys
import time

import pytest
from package_process import environment

PATIENCE = 90.0


def started(*arguments):
    """A process that runs the command line as its console script does, and says when that begins."""
    program = (
        "import sys\nfrom swath_sysid.start import command_line\nprint('begun', flush=True)\nsys.exit(command_line())"
    )
    return subprocess.Popen(
        [sys.executable, '-c', program, *arguments],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )


def interrupted(process, after, number=signal.SIGINT):
    """Exit code and output of a process that gets a signal so many seconds after its first instant."""
    assert process.stdout.readline() == 'begun\n'
    time.sleep(after)
    process.send_signal(number)
    try:
        out, error = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    return process.returncode, out + error


@pytest.mark.parametrize(
    ('number', 'after'),
    [(signal.SIGINT, 0.02), (signal.SIGINT, 0.3), (signal.SIGINT, 1.0), (signal.SIGTERM, 0.1), (signal.SIGTERM, 0.6)],
)
def test_a_tool_that_is_interrupted_at_its_start_ends_with_130(number, after, tmp_path):
    process = started('campaign', str(tmp_path / 'missing.yaml'), '--output', str(tmp_path))
    code, told = interrupted(process, after, number)
    assert 'Traceback' not in told and 'Exception ignored' not in told
    # it may have come to its own end before, and said so; the interpreter's very last moments know no handlers
    assert code == 130 or (code in (2, -number) and 'cannot read the manifest' in told), told


@pytest.mark.parametrize(
    ('number', 'words'),
    [(signal.SIGINT, '--only predictor --ros-args -r __ns:=/early'), (signal.SIGTERM, '--namespace early')],
)
@pytest.mark.parametrize('after', [0.02, 0.3, 0.8])
def test_nodes_that_are_interrupted_at_their_start_end_with_0(after, number, words):
    pytest.importorskip('rclpy', reason='nodes need ROS 2')
    code, told = interrupted(started('run', *words.split()), after, number)
    assert 'Traceback' not in told and 'Exception ignored' not in told
    assert code == 0, told


def test_it_starts_what_it_is_named():
    process = started('--version')
    out, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0 and out.startswith('begun\nswath_sysid'), error
