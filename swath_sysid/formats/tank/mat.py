"""MATLAB files of version 5.

Columns are vectors, and the signals of a matrix as ``data(:,1)``, ``data(:,2)``, ...; the time is a vector, or a number
``fs``, ``sample_rate``, ``rate_hz`` or ``dt``; tables are structs, such as ``run1``.
"""

import math
import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

from scipy.io import loadmat, whosmat

from swath_sysid.formats.tank.nested import nested_tables
from swath_sysid.formats.text_tables import NamedColumns, check_size

HEADER = struct.Struct('116s8sH2s')  #: Text, place of the subsystem's data, version, byte order.
COMPRESSED = 15  #: The kind of an element that has a checksum.
#: Run without the working folder among the places of modules: it may hold anything.
LOAD = '-P', '-c', 'import sys; from scipy.io import loadmat; loadmat(sys.argv[1], appendmat=False)'
CRASHES = {-signal.SIGSEGV, -signal.SIGBUS, -signal.SIGABRT}


def tables(path: str | Path) -> list[NamedColumns]:
    """The tables in variables and structs."""
    check_size(path, sum(math.prod(shape) for _, shape, _ in whosmat(path, appendmat=False)))
    if not _has_checksums(path):
        _load_elsewhere(path)
    content = loadmat(path, appendmat=False, simplify_cells=True)
    return nested_tables({key: value for key, value in content.items() if not key.startswith('__')})


def _has_checksums(path: str | Path) -> bool:
    """Whether every element is compressed."""
    with open(path, 'rb') as file:
        is_little = file.read(HEADER.size).endswith(b'IM')
        while len(tag := file.read(8)) == 8:
            kind, size = (int.from_bytes(part, 'little' if is_little else 'big') for part in (tag[:4], tag[4:]))
            if kind != COMPRESSED:
                return False
            file.seek(size, os.SEEK_CUR)
    return True


def _load_elsewhere(path: str | Path):
    """Load a file in another process first, which a wrong tag in a struct may end."""
    loaded = subprocess.run([sys.executable, *LOAD, os.fspath(path)], capture_output=True, check=False)
    if loaded.returncode in CRASHES:
        raise ValueError('SciPy crashes over a tag in it')
