"""A ring buffer: rows of numbers, the newest last, in memory that does not grow."""

from collections.abc import Iterable
from struct import pack_into

import numpy as np


class RowBuffer:
    """The newest rows, as many as the capacity, contiguous and by number."""

    def __init__(self, capacity: int, columns: int) -> None:
        # twice the room keeps the past contiguous with few moves; filled, so that memory is reserved now
        self._rows = np.full((2 * capacity, columns), np.nan)
        self._format = f'{columns}d'
        self.capacity = capacity
        self.clear()

    def clear(self) -> None:
        """Forget everything; rows are numbered from zero again."""
        self._first = self._end = self._number = 0

    def __len__(self) -> int:
        return self._end - self._first

    @property
    def newest(self) -> int:
        """Number of the newest row; -1 before the first."""
        return self._number - 1

    def append(self, row: Iterable[float]) -> None:
        """Add a row, of as many numbers as there are columns; NaN where nothing is known."""
        if self._end == len(self._rows):
            self._rows[: self.capacity] = self._rows[self._end - self.capacity :]
            self._first, self._end = max(self._first - (self._end - self.capacity), 0), self.capacity
        # four times as fast as the assignment of a row
        pack_into(self._format, self._rows.data, self._rows.strides[0] * self._end, *row)
        self._end += 1
        self._number += 1
        if self._end - self._first > self.capacity:
            self._first += 1

    def skip(self, count: int) -> None:
        """Add rows of which nothing is known."""
        unknown = [np.nan] * self._rows.shape[1]
        for _ in range(min(count, self.capacity)):
            self.append(unknown)
        self._number += max(0, count - self.capacity)

    def drop_below(self, limit: float) -> None:
        """Forget the oldest rows while their first column is below a limit."""
        while self._first < self._end and self._rows.item(self._first, 0) < limit:
            self._first += 1

    def last(self, count: int | None = None) -> np.ndarray:
        """The newest rows, oldest first, shape (min(count, len(self)), C): a view, so copy what is to be kept."""
        first = self._first if count is None else max(self._first, self._end - count)
        return self._rows[first : self._end]

    def at(self, numbers: np.ndarray) -> np.ndarray:
        """Rows by fractional number, linear between two, (N,) and (N, C); NaN where one is missing."""
        before = np.floor(numbers + 1e-6).astype(int)
        share = np.maximum(numbers - before, 0.0)
        share[share < 1e-3] = 0.0
        after = before + (share > 0.0)
        offset = self._end - self._number
        first, second = before + offset, after + offset
        known = (first >= self._first) & (second < self._end)
        first, second = np.where(known, first, 0), np.where(known, second, 0)
        rows = self._rows[first] + share[:, None] * (self._rows[second] - self._rows[first])
        rows[~known] = np.nan
        return rows
