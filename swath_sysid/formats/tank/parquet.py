"""Parquet files.

Columns are those of the file; the time is a column, or a number in the metadata.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from swath_sysid.common.account import shortage
from swath_sysid.formats.table_heads import kind_of_cell
from swath_sysid.formats.text_tables import Losses, NamedColumns, Progress, check_size, numbers_in


def tables(path: str | Path) -> list[NamedColumns]:
    """The one table."""
    from pyarrow import parquet, types

    with parquet.ParquetFile(path) as file:
        schema, remarks = file.schema_arrow, file.metadata.metadata or {}
        number = file.metadata.num_rows
        check_size(path, number * len(schema.names))
        first = next(file.iter_batches(1), None)

    def read(places: Sequence[int], progress: Progress | None) -> tuple[np.ndarray, Losses]:
        names = [schema.names[place] for place in places]
        parts: list[list[np.ndarray]] = [[] for _ in names]
        with parquet.ParquetFile(path) as file:
            for group in range(file.num_row_groups):
                rows = file.read_row_group(group, columns=names)
                for name, found in zip(names, parts, strict=True):
                    found.append(rows[name].to_numpy())
                if progress is not None:
                    progress((group + 1) / file.num_row_groups)
        values, losses = numbers_in(names, [np.concatenate(found or [np.empty(0)]) for found in parts])
        return values, (*losses, *shortage(number, values.shape[1], 'its index'))

    said = {key.decode().lower(): value.decode() for key, value in remarks.items() if not key.startswith(b'ARROW')}
    dates = {place: 'date' for place, kind in enumerate(schema.types) if types.is_timestamp(kind)}
    for place, column in enumerate(first.columns if first else ()):
        kind = schema.types[place]
        if types.is_string(kind) or types.is_large_string(kind) or types.is_time(kind):
            dates[place] = kind_of_cell(column[0].as_py())
    return [NamedColumns(tuple(schema.names), read, said, dates)]
