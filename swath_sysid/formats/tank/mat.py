"""MATLAB files of version 5."""

import math
import os
import subprocess
import sys
from pathlib import Path

from scipy.io import loadmat, whosmat

from swath_sysid.formats.named_columns import NamedColumns, check_size
from swath_sysid.formats.tank.nested import nested_tables

FIRST_TAG = slice(128, 132)  #: Bytes of a file: the kind of its first element, after the header.
COMPRESSED = 15  #: The kind of an element with a checksum.
LOAD = 'import sys; from scipy.io import loadmat; loadmat(sys.argv[1], appendmat=False)'


def tables(path: str | Path) -> list[NamedColumns]:
    """The tables in variables and structs."""
    check_size(path, sum(math.prod(shape) for _, shape, _ in whosmat(path, appendmat=False)))
    _check_tags(path)
    content = loadmat(path, appendmat=False, simplify_cells=True)
    return nested_tables({key: value for key, value in content.items() if not key.startswith('__')})


def _check_tags(path: str | Path):
    """Without a checksum, a wrong tag in a struct may end the process that loads it: let that be another one."""
    with open(path, 'rb') as file:
        tag = file.read(FIRST_TAG.stop)[FIRST_TAG]
    if COMPRESSED not in (int.from_bytes(tag, 'little'), int.from_bytes(tag, 'big')):
        loaded = subprocess.run([sys.executable, '-c', LOAD, os.fspath(path)], capture_output=True, check=False)
        if loaded.returncode < 0:
            raise ValueError('SciPy crashes over a tag in it')
