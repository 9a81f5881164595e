"""HDF5 files, among them MATLAB files of version 7.3 and netCDF-4.

Columns and time are found as in MATLAB files of version 5, with the attribute ``units``; groups and compounds are
structs, each of which is read once, and links that lead nowhere are left out.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.common.account import Loss
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import shown
from swath_sysid.formats.tank.nested import nested_tables
from swath_sysid.formats.text_tables import NamedColumns, check_size, with_losses
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
        unwritten: list[Loss] = []
        found = nested_tables(_content(content, unwritten))
    losses = (*unwritten, *(Loss('dangling-links', said={'links': listed_names(lost)}) for _ in lost[:1]))
    return [with_losses(table, losses) for table in found]


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


def _content(tree: dict[str, Any], lost: list[Loss]) -> dict[str, Any]:
    import h5py

    content: dict[str, Any] = {}
    for name, item in tree.items():
        if isinstance(item, dict):
            content[name] = _content(item, lost)
        elif not hasattr(item, 'dtype'):
            continue
        elif item.dtype.names:
            content[name] = {field: np.squeeze(item[field]) for field in item.dtype.names}
        elif h5py.check_string_dtype(item.dtype) and item.ndim == 1:
            content[_named(name, item)] = item.asstr(errors='replace')[()]
        elif item.dtype.kind in 'biuf' and 'MATLAB_empty' not in item.attrs:
            values = np.squeeze(_written(name, item, lost)).T
            if item.attrs.get('MATLAB_class') == b'char':
                content[name] = ''.join(map(chr, values.ravel()))
            else:
                content[_named(name, item)] = _unpacked(values, item) if values.ndim else values.item()
    return content


def _written(name: str, item: Any, lost: list[Loss]) -> np.ndarray:
    """The values of a dataset, NaN in chunks that were never written, which would pass for measured zeros."""
    values = item[()]
    if item.is_virtual or item.external or not values.size:
        return values
    there = np.full(values.shape, item.chunks is None and item.id.get_storage_size() > 0)
    chunks = item.id.get_num_chunks() if item.chunks else 0
    if item.chunks and chunks == math.prod(
        -(-size // step) for size, step in zip(values.shape, item.chunks, strict=True)
    ):
        return values
    for place in range(chunks):
        begin = item.id.get_chunk_info(place).chunk_offset
        there[tuple(slice(at, at + step) for at, step in zip(begin, item.chunks, strict=True))] = True
    missing = int(np.count_nonzero(~there))
    if not missing:
        return values
    lost.append(Loss('unwritten-values', missing, values.size, f'values of {shown(name)}'))
    return np.where(there, values, np.nan)


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
