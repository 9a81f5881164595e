"""MATLAB files of version 5."""

import math
from pathlib import Path

from scipy.io import loadmat, whosmat

from swath_sysid.formats.named_columns import NamedColumns, check_size
from swath_sysid.formats.tank.nested import nested_tables


def tables(path: str | Path) -> list[NamedColumns]:
    """The tables in variables and structs."""
    check_size(path, sum(math.prod(shape) for _, shape, _ in whosmat(path, appendmat=False)))
    content = loadmat(path, appendmat=False, simplify_cells=True)
    return nested_tables({key: value for key, value in content.items() if not key.startswith('__')})
