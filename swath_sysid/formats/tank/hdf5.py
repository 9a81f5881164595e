"""HDF5 files, among them MATLAB files of version 7.3: groups are structs."""

from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.formats.named_columns import NamedColumns, check_size
from swath_sysid.formats.tank.nested import nested_tables


def tables(path: str | Path) -> list[NamedColumns]:
    """The tables in variables and structs."""
    import h5py

    with h5py.File(path, 'r') as file:
        return nested_tables(_content(path, file))


def _content(path: str | Path, group: Any) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for name, item in group.items():
        if name.startswith('#'):
            continue  # MATLAB's own
        if hasattr(item, 'items'):
            content[name] = _content(path, item)
        elif item.dtype.kind in 'biuf' and 'MATLAB_empty' not in item.attrs:
            check_size(path, item.size)
            values = np.squeeze(item[()]).T
            if item.attrs.get('MATLAB_class') == b'char':
                content[name] = ''.join(map(chr, values.ravel()))
            else:
                content[name] = values if values.ndim else values.item()
    return content
