"""Variables and structs, as MATLAB saves them: the tables in them."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from swath_sysid.formats.table_heads import kind_of_cell
from swath_sysid.formats.text_tables import DATED, NamedColumns, by_length, of_arrays


def nested_tables(
    content: Mapping[str, Any],
    name: str = '',
    remarks: Mapping[str, str] | None = None,
    shared: Mapping[int, Mapping[str, np.ndarray]] | None = None,
) -> list[NamedColumns]:
    """A table for the vectors of each length in each struct. Numbers and texts hold for the structs below too, and so
    does a vector without another of its length (a time).
    """
    remarks = {**(remarks or {}), **{key.lower(): str(value) for key, value in content.items() if np.isscalar(value)}}
    groups = by_length(vector for key, value in content.items() for vector in _vectors(key, value))
    lengths = {len(next(iter(group.values()))): group for group in groups}
    tables = [of_arrays({**(shared or {}).get(n, {}), **group}, remarks, name) for n, group in lengths.items()]
    single = {n: group for n, group in lengths.items() if len(group) == 1}
    for key, value in content.items():
        several = isinstance(value, list | np.ndarray) and any(isinstance(item, dict) for item in value)
        inner = {f'{key}({k})': item for k, item in enumerate(value, 1)} if several else {key: value}
        for below, struct in inner.items():
            if isinstance(struct, dict):
                tables += nested_tables(struct, f'{name}.{below}'.lstrip('.'), remarks, single)
    return tables


def _vectors(key: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """A vector by its name; the signals of a matrix as MATLAB writes them, ``data(:,2)``."""
    if not isinstance(value, np.ndarray) or value.ndim > 2 or value.size < 2:
        return
    if value.ndim == 1 and kind_of_cell(value[0]) in (*DATED, 'number') and isinstance(value[0], str):
        yield key, value
    if value.dtype.kind not in 'biuf':
        return
    if 1 in value.shape or value.ndim == 1:
        yield key, value.ravel().astype(float)
        return
    signals = value if value.shape[0] < value.shape[1] else value.T
    for place, signal in enumerate(signals, 1):
        yield f'{key}(:,{place})', signal.astype(float)
