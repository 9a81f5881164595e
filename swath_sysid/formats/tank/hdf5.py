"""HDF5 files, among them MATLAB files of version 7.3 and netCDF-4.

Columns and time are found as in MATLAB files of version 5, with the attribute ``units``; groups and compounds are
structs, each of which is read once, and links that lead nowhere are left out.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.tank.nested import nested_tables
from swath_sysid.formats.text_tables import NamedColumns, check_size, with_advice
from swath_sysid.formats.vocabulary import is_unit, listed_names, with_unit


def tables(path: str | Path) -> list[NamedColumns]:
    """The tables in variables and structs."""
    import h5py

    try:
        file = h5py.File(path, 'r')
    except OSError as error:
        if 'lock' in str(error) or 'already open' in str(error):
            raise InputError(
                f'{path} is open in another program ({shown(error)}): close it there, or, if that program crashed, run '
                'h5clear -s on a copy'
            ) from error
        raise
    with file:
        lost: list[str] = []
        content = _tree(file, set(), lost)
        check_size(path, sum(item.size or 0 for item in _datasets(content)))
        found = nested_tables(_content(content))
    if not lost:
        return found
    advice = (Advice.of('dangling-links', links=listed_names(lost)),)
    return [with_advice(table, advice) for table in found]


def _tree(group: Any, seen: set[Any], lost: list[str]) -> dict[str, Any]:
    """The datasets below a group by their names; a group that several links lead to is there once."""
    import h5py

    seen.add(h5py.h5o.get_info(group.id).addr)
    content: dict[str, Any] = {}
    for name in group:
        item = None if name.startswith('#') else group.get(name)  # MATLAB's own
        if item is None:
            lost += [] if name.startswith('#') else [f'{group.name.rstrip("/")}/{name}']
        elif not hasattr(item, 'items'):
            content[name] = item
        elif h5py.h5o.get_info(item.id).addr not in seen:
            content[name] = _tree(item, seen, lost)
    return content


def _datasets(content: dict[str, Any]) -> Iterator[Any]:
    for item in content.values():
        yield from _datasets(item) if isinstance(item, dict) else [item]


def _content(tree: dict[str, Any]) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for name, item in tree.items():
        if isinstance(item, dict):
            content[name] = _content(item)
        elif not hasattr(item, 'dtype'):
            continue
        elif item.dtype.names:
            content[name] = {field: np.squeeze(item[field]) for field in item.dtype.names}
        elif item.dtype.kind in 'biuf' and 'MATLAB_empty' not in item.attrs:
            values = np.squeeze(item[()]).T
            if item.attrs.get('MATLAB_class') == b'char':
                content[name] = ''.join(map(chr, values.ravel()))
            else:
                content[_named(name, item)] = _unpacked(values, item) if values.ndim else values.item()
    return content


def _named(name: str, item: Any) -> str:
    """The name with the unit that an attribute states; a time of netCDF counts from a date."""
    unit = item.attrs.get('units', '')
    unit = (unit.decode('utf-8', 'replace') if isinstance(unit, bytes) else str(unit)).partition(' since ')[0]
    return with_unit(name, unit) if is_unit(unit) else name


def _unpacked(values: np.ndarray, item: Any) -> np.ndarray:
    """Values as netCDF packs them: missing ones, a factor and an offset are attributes."""
    packed = {key: item.attrs[key] for key in ('_FillValue', 'scale_factor', 'add_offset') if key in item.attrs}
    if not packed:
        return values
    known = np.where(values == np.squeeze(packed.get('_FillValue', np.nan)), np.nan, values)
    return known * np.squeeze(packed.get('scale_factor', 1.0)) + np.squeeze(packed.get('add_offset', 0.0))
