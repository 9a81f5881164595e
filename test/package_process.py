"""Processes that run the command line of this checkout."""

import os
import subprocess
import sys
import time
from pathlib import Path

from repository import ROOT

PATIENCE = 240.0
"""s, which only failing takes: beside eight busy processes a fit, which yields to all others, may take minutes."""


def wait_for(condition, what, seconds=PATIENCE, meanwhile=lambda: time.sleep(0.01)):
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, f'in {seconds} s: no {what}'
        meanwhile()
    return found


def is_alive(pid):
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except FileNotFoundError:
        return False


def environment():
    """That of this process, in which the package is found from any folder."""
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH')]))}


def command_line(*words, **options):
    """The command line at work; what it prints and what it says of errors are one text unless asked for apart."""
    given = {'stdout': subprocess.PIPE, 'stderr': subprocess.STDOUT, 'text': True, **options}
    command = [sys.executable, '-m', 'swath_sysid.cli.main', *map(str, words)]
    return subprocess.Popen(command, env=environment(), **given)
