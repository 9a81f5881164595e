"""The recent past of the motion in rows at even steps: what the sea is learnt from and forecasts are scored by."""
import numpy as np


class History:
    """Rows by number, newest last, in memory that does not grow.

    Parameters
    ----------
    capacity : int
        Rows kept.
    channels : int
    """

    def __init__(self, capacity, channels):
        # twice the room: rows move only once in a capacity, and the past is always contiguous
        # filled, so that the memory is taken now and not row by row
        self._rows = np.full((2 * capacity, channels), np.nan)
        self._capacity = capacity
        self.clear()

    def clear(self):
        """Forget everything; rows are numbered from zero again."""
        self._first = self._end = self._number = 0

    def __len__(self):
        return self._end - self._first

    @property
    def newest(self):
        """Number of the newest row; -1 before the first."""
        return self._number - 1

    def append(self, row):
        """Add a row.

        Parameters
        ----------
        row : sequence of float, length C
            NaN where nothing is known.
        """
        if self._end == len(self._rows):
            self._rows[:self._capacity] = self._rows[self._end - self._capacity:]
            self._first, self._end = 0, self._capacity
        self._rows[self._end] = row
        self._end += 1
        self._number += 1
        if self._end - self._first > self._capacity:
            self._first += 1

    def skip(self, count):
        """Add rows of which nothing is known."""
        unknown = np.full(self._rows.shape[1], np.nan)
        for _ in range(min(count, self._capacity)):
            self.append(unknown)
        self._number += max(0, count - self._capacity)

    def last(self, count):
        """The newest rows, oldest first.

        Returns
        -------
        ndarray, shape (min(count, len(self)), C)
            A view: copy what is to be kept.
        """
        return self._rows[max(self._first, self._end - count):self._end]

    def at(self, numbers):
        """Rows by number, linear between two.

        Parameters
        ----------
        numbers : ndarray, shape (N,)
            Need not be whole.

        Returns
        -------
        ndarray, shape (N, C)
            NaN where a row is missing or no longer kept.
        """
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
