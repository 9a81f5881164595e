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
import warnings
from pathlib import Path

from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatlabOpaque, MatReadWarning

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.tank.nested import nested_tables
from swath_sysid.formats.text_tables import NamedColumns, check_size, damage, with_losses

HEADER = struct.Struct('116s8sH2s')  #: Text, place of the subsystem's data, version, byte order.
COMPRESSED = 15  #: The kind of an element that has a checksum.
#: Run without the working folder among the places of modules: it may hold anything.
LOAD = '-P', '-c', 'import sys; from scipy.io import loadmat; loadmat(sys.argv[1], appendmat=False)'
#: What to type in MATLAB, by the class of the object.
SAVING = {
    'timeseries': "as in time_s = {name}.Time; roll_deg = {name}.Data; save('numbers.mat', 'time_s', 'roll_deg')",
    'table': "as in numbers = table2struct({name}, 'ToScalar', true); save('numbers.mat', 'numbers')",
    'timetable': "as in writetimetable({name}, 'numbers.csv')",
    '': 'as vectors with a time, for example time_s and roll_deg',
}
CRASHES = {-signal.SIGSEGV, -signal.SIGBUS, -signal.SIGABRT}


def tables(path: str | Path) -> list[NamedColumns]:
    """The tables in variables and structs."""
    try:
        check_size(path, sum(math.prod(shape) for _, shape, _ in whosmat(path, appendmat=False)))
    except TypeError:  # SciPy's, over objects of MATLAB's classes, whose shape is not stated
        check_size(path, os.path.getsize(path))
    if not _has_checksums(path):
        _load_elsewhere(path)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter('always', MatReadWarning)
        content = loadmat(path, appendmat=False, simplify_cells=True)
    unread = damage(shown(', '.join(str(each.message) for each in said if each.category is MatReadWarning)))
    found = [
        with_losses(table, unread)
        for table in nested_tables({key: value for key, value in content.items() if not key.startswith('__')})
    ]
    objects = [value for value in content.values() if isinstance(value, MatlabOpaque)]
    if objects and not found:
        name, _, kind, *_ = (str(part.decode() if isinstance(part, bytes) else part) for part in objects[0].ravel()[0])
        raise InputError(
            f'{path} holds objects that only MATLAB can read (such as {shown(name)}, a {shown(kind)}): save their '
            f'numbers there, {SAVING.get(kind, SAVING[""]).format(name=shown(name))}'
        )
    return found


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
