"""OpenFAST binary outputs.

Columns are channels with their units, such as ``PtfmRoll`` in deg; the time is that of the file.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from swath_sysid.common.account import shortage
from swath_sysid.common.errors import InputError
from swath_sysid.formats.text_tables import NamedColumns, check_size, of_arrays
from swath_sysid.formats.vocabulary import with_unit

#: What the first number says: packed with times, packed, not packed, packed with names of any length.
WITH_TIMES, UNPACKED, LONG_NAMES = np.arange(5)[[1, 3, 4]]


def tables(path: str | Path) -> list[NamedColumns]:
    """The one table; see ``ReadFASTbinary`` of the OpenFAST tools."""
    with open(path, 'rb') as file:
        (kind,) = _numbers(file, '<i2')
        length = int(_numbers(file, '<i2')[0]) if kind == LONG_NAMES else 10
        channels, rows = (int(number) for number in _numbers(file, '<i4', 2))
        if not 1 <= kind <= LONG_NAMES or min(length, channels, rows) < 1:
            raise InputError(f'{path} is named .outb but is no binary output of OpenFAST: copy or export it again')
        check_size(path, (1 + channels) * rows)
        first, second = _numbers(file, '<f8', 2)
        scale, offset = np.ones((1, channels)), np.zeros((1, channels))
        if kind != UNPACKED:
            scale, offset = _numbers(file, '<f4', 2 * channels).reshape(2, 1, channels).astype(float)
        file.seek(int(_numbers(file, '<i4')[0]), 1)
        names, units = (_texts(file, 1 + channels, length) for _ in range(2))
        # packed times have a scale and an offset, others a start and an interval
        is_packed = kind == WITH_TIMES
        stamps = (_numbers(file, '<i4', rows) - second) / first if is_packed else np.empty(0)
        number = np.dtype('<f8' if kind == UNPACKED else '<i2')
        raw = file.read()
    # those that are there, whatever the header counts
    there = len(raw) // (channels * number.itemsize)
    packed = np.frombuffer(raw, number, there * channels).reshape(there, channels)
    time = first + second * np.arange(there)
    if is_packed:
        time = np.r_[stamps, np.full(there, np.nan)][:there]
    with np.errstate(all='ignore'):  # of a damaged file
        values = np.vstack([time, ((packed - offset) / scale).T])
    columns = {with_unit(name, unit): row for name, unit, row in zip(names, units, values, strict=True)}
    return [of_arrays(columns, {}, '', shortage(rows, there, 'its header'))]


def _numbers(file: BinaryIO, kind: str, number: int = 1) -> np.ndarray:
    raw = file.read(number * np.dtype(kind).itemsize)
    return np.frombuffer(raw, kind, number)


def _texts(file: BinaryIO, number: int, length: int) -> Sequence[str]:
    return [file.read(length).decode('latin-1').strip() for _ in range(number)]
