"""The recent past of the sensor, read back on any even grid of times before now."""
import numpy as np

_GAP_FACTOR = 2.5


class History:
    """Rows of samples by time: fixed memory, newest last.

    Parameters
    ----------
    duration : float
        s to keep.
    finest : float
        s; rows closer together than this replace each other, so that memory has a bound.
    channels : int
    """

    def __init__(self, duration, finest, channels):
        self._duration = duration
        self._finest = finest
        capacity = int(np.ceil(duration / finest)) + 2
        # twice the room: rows move only once in a capacity, and a view of the past is always contiguous
        # filled, so that the memory is taken now and not sample by sample
        self._time = np.full(2 * capacity, np.nan)
        self._rows = np.full((2 * capacity, channels), np.nan)
        self._capacity = capacity
        self.clear()

    def clear(self):
        """Forget everything."""
        self._start = self._end = 0

    def __len__(self):
        return self._end - self._start

    @property
    def time(self):
        """Stamps, shape (N,), a view."""
        return self._time[self._start:self._end]

    @property
    def rows(self):
        """Samples, shape (N, C), a view."""
        return self._rows[self._start:self._end]

    def append(self, stamp, row):
        """Add a sample later than all before it.

        Parameters
        ----------
        stamp : float
            s.
        row : sequence of float, length C
        """
        end = self._end
        if end - self._start > 1 and stamp - self._time[end - 2] < self._finest:
            end -= 1  # the newest row stays the newest: the one before it was closer than the finest spacing
        elif end == self._time.size:
            kept = min(end - self._start, self._capacity)
            self._time[:kept] = self._time[end - kept:end]
            self._rows[:kept] = self._rows[end - kept:end]
            self._start, end = 0, kept
        self._time[end] = stamp
        self._rows[end] = row
        self._end = end + 1
        if self._end - self._start > self._capacity:
            self._start += 1

    def back(self, step, count, interval):
        """The channels at now, now - step, ... , now - (count - 1) step.

        Linear between samples. NaN where the history does not reach, or where the samples on
        either side are further apart than a gap allows.

        Parameters
        ----------
        step : float
            s.
        count : int
        interval : float
            The sensor's usual interval, s.

        Returns
        -------
        ndarray, shape (count, C)
            Newest first.
        """
        time, rows = self.time, self.rows
        wanted = time[-1] - step * np.arange(count)
        after = np.searchsorted(time, wanted - 1e-6 * interval)
        before = np.maximum(after - 1, 0)
        after = np.minimum(after, time.size - 1)
        width = time[after] - time[before]
        fraction = np.ones(count)
        inner = width > 0.0
        fraction[inner] = np.clip((wanted[inner] - time[before[inner]]) / width[inner], 0.0, 1.0)
        fraction = fraction[:, None]
        # where a sample lies on the grid (fraction one) a NaN on its other side must not spread
        result = np.where(fraction >= 1.0 - 1e-3, rows[after], (1.0 - fraction) * rows[before] + fraction * rows[after])
        usual = max(interval, self._finest)
        bad = (wanted < time[0] - 0.1 * usual) | ((width > _GAP_FACTOR * usual) & (fraction[:, 0] < 1.0 - 1e-3))
        result[bad] = np.nan
        return result

    def at(self, stamps, tolerance):
        """All channels at stamps in the past, linear between samples.

        Parameters
        ----------
        stamps : ndarray, shape (N,)
            s.
        tolerance : float
            s; NaN where no sample is as near as this.

        Returns
        -------
        ndarray, shape (N, C)
        """
        time, rows = self.time, self.rows
        after = np.searchsorted(time, stamps - 1e-9)
        before = np.clip(after - 1, 0, time.size - 1)
        after = np.minimum(after, time.size - 1)
        nearest = np.minimum(np.abs(time[after] - stamps), np.abs(time[before] - stamps))
        width = time[after] - time[before]
        fraction = np.where(width > 0.0, (stamps - time[before]) / np.where(width > 0.0, width, 1.0), 1.0)[:, None]
        near = np.where(fraction < 0.5, rows[before], rows[after])
        between = (1.0 - fraction) * rows[before] + fraction * rows[after]
        result = np.where((fraction > 0.999) | (fraction < 0.001), near, between)
        result[nearest > tolerance] = np.nan
        return result
