"""Processes that run the command line of this checkout."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def environment():
    """That of this process, in which the package is found from any folder."""
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, [str(ROOT), os.environ.get('PYTHONPATH')]))}


def command_line(*words, **options):
    """The command line at work; what it prints and what it says of errors are one text unless asked for apart."""
    given = {'stdout': subprocess.PIPE, 'stderr': subprocess.STDOUT, 'text': True, **options}
    command = [sys.executable, '-m', 'swath_sysid.cli.main', *map(str, words)]
    return subprocess.Popen(command, env=environment(), **given)
