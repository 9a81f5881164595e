"""HDF5 files, among them MATLAB files of version 7.3.

Columns and time are found as in MATLAB files of version 5; groups and compounds are
structs.
"""

from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.formats.tank.nested import nested_tables
from swath_sysid.formats.text_tables import NamedColumns, check_size


def tables(path: str | Path) -> list[NamedColumns]:
    """The tables in variables and structs."""
    import h5py

    with h5py.File(path, 'r') as file:
        check_size(path, _size(file))
        return nested_tables(_content(file))


def _size(item: Any) -> int:
    """Numbers in a dataset, or below a group by each of its links."""
    return sum(map(_size, item.values())) if hasattr(item, 'items') else item.size or 0


def _content(group: Any) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for name, item in group.items():
        if name.startswith('#'):
            continue  # MATLAB's own
        if hasattr(item, 'items'):
            content[name] = _content(item)
        elif item.dtype.names:
            content[name] = {field: np.squeeze(item[field]) for field in item.dtype.names}
        elif item.dtype.kind in 'biuf' and 'MATLAB_empty' not in item.attrs:
            values = np.squeeze(item[()]).T
            if item.attrs.get('MATLAB_class') == b'char':
                content[name] = ''.join(map(chr, values.ravel()))
            else:
                content[name] = values if values.ndim else values.item()
    return content
