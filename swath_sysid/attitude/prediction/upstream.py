"""Waves that are measured upstream: scalar series beside the IMU, and a state space of them and the craft's motion.

The past that the water needs is longer than that of the craft's own motion, so this state space has coarser rows.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from swath_sysid.attitude.motion.stamps import GAP_INTERVALS
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.rows import OF_MEANS, resampled
from swath_sysid.attitude.prediction.state_space import RIDGE, InnovationsFilter
from swath_sysid.attitude.prediction.variate_analysis import ROWS_A_COEFFICIENT, identify, lag_gram, useful_channels
from swath_sysid.common.errors import InputError
from swath_sysid.common.row_buffer import RowBuffer

UPSTREAM, NEW_UPSTREAM = 'upstream', 'upstream-new'  #: State spaces of the whole past, and of its end.

LONGEST_PAST = 9.4  #: Periods; waves take as long over some wavelengths.
MOST_POINTS = 300  #: Of a series that wait for their row.
_MOST_LAGGED = 300  #: Lags times channels: the time of a fit goes with its cube.
_STATES = 60  #: Of one model: waves on their way take more than a craft's motion does.
_LONGEST_HELD = 2.0  #: s; a series that repeats one value for longer is stuck.
_IN_TIME = 0.98  #: Share of the values that a model waits for.


def without(channel: str) -> str:
    """The candidate that all upstream channels but one are a part of."""
    return f'without-{channel}'


def candidates_of(channels: Sequence[str]) -> tuple[str, ...]:
    """The candidates of upstream channels; with several, each is left out once, which shows what it is worth."""
    return (*((NEW_UPSTREAM, UPSTREAM) if channels else ()), *map(without, channels if len(channels) > 1 else ()))


class _Series:
    """The samples of one series, no more than one for each row: a quicker sensor's are averaged."""

    def __init__(self) -> None:
        self.points: deque[tuple[float, float]] = deque(maxlen=MOST_POINTS)  #: Stamp, s, and value.
        self.interval = math.nan  #: s between points.
        self.next = 0  #: Number of the first row without its value.
        self._last = self._changed = -math.inf
        self._value = math.nan
        self._block: list[tuple[float, float]] = []

    def take(self, stamp: float, value: float, step: float) -> None:
        """Take a sample; one that is missing, late or repeated for too long counts as lost."""
        if not (stamp > self._last and math.isfinite(value)):
            return
        elapsed, self._last = stamp - self._last, stamp
        if value != self._value:
            self._value, self._changed = value, stamp
        if stamp - self._changed > _LONGEST_HELD:
            self._block.clear()
            return
        self._block.append((stamp, value))
        begin = self.points[-1][0] if self.points else -math.inf
        if stamp + 0.5 * elapsed >= begin + step:
            count = len(self._block)
            self._add(sum(s for s, _ in self._block) / count, sum(v for _, v in self._block) / count)

    def _add(self, stamp: float, value: float):
        self._block.clear()
        if self.points:
            elapsed = stamp - self.points[-1][0]
            usual = self.interval if self.interval == self.interval else elapsed
            self.interval = usual + 0.1 * (min(elapsed, GAP_INTERVALS * usual) - usual)
        self.points.append((stamp, value))

    def at(self, stamp: float) -> float | None:
        """The value at a stamp, s, no earlier than that asked for before; NaN where lost, None where not known yet."""
        points = self.points
        while len(points) > 1 and points[1][0] < stamp:
            points.popleft()
        if not points or stamp < points[0][0]:
            return math.nan if points else None
        if len(points) < 2:
            return points[0][1] if stamp == points[0][0] else None
        (before, first), (after, second) = points[0], points[1]
        if after - before > GAP_INTERVALS * self.interval:
            return math.nan
        return first + (stamp - before) / (after - before) * (second - first)


class PastRows(RowBuffer):
    """The newest rows of the craft and, in their last columns, of named series: a row's values may come after it."""

    def __init__(self, names: Sequence[str], capacity: int) -> None:
        if len(set(names)) < len(names):
            raise InputError(f'an upstream channel is given twice ({", ".join(names)}): name each once')
        self.names = tuple(names)
        self.delays = [0] * len(names)  #: Rows that a model waits for each series.
        self._step = math.nan
        self._series = {name: _Series() for name in names}
        # stamp, values, and rows that the values came late
        self._unknown = [math.nan] * (1 + 2 * len(names))
        super().__init__(capacity, OF_MEANS.stop + len(self._unknown))

    @property
    def _values(self) -> slice:
        return slice(OF_MEANS.stop + 1, OF_MEANS.stop + 1 + len(self.names))

    def lay_out(self, step: float, ratio: float) -> None:
        """Go on with rows of another step, s, so many times that of before."""
        self._step, past, newest = step, self.last().copy(), self.newest
        self.clear()
        if len(past):
            past = resampled(past, ratio)
            past[:, self._values.stop :] /= ratio
        for row in past:
            self.append(row)
        for series in self._series.values():
            series.next = self.newest + 1 - round((newest + 1 - series.next) / ratio) if len(past) else 0

    def take(self, name: str, stamp: float, value: float) -> None:
        """Take a sample of a series, stamped in s on the clock of the rows."""
        if name not in self._series:
            raise InputError(
                f"'{name}' is not an upstream channel: the settings have {', '.join(self.names) or 'none'}"
            )
        if self._step == self._step:
            self._series[name].take(stamp, value, self._step)

    def add(self, row: Sequence[float], stamp: float, steps: int = 1) -> None:
        """Add the craft's row of a stamp, s, which is so many steps after the one before, and those between."""
        self.skip(steps - 1)
        self.append([*row, *self._unknown])
        rows, place = self.last(), OF_MEANS.stop
        since = rows[-steps:]
        since[:, place] = stamp - self._step * np.arange(len(since))[::-1]
        first, count = self.newest + 1 - len(rows), len(self.names)
        for column, series in enumerate(self._series.values(), place + 1):
            for number in range(max(series.next, first), self.newest + 1):
                value = series.at(rows.item(number - first, place))
                if value is None:
                    break
                rows[number - first, column], rows[number - first, column + count] = value, self.newest - number
                series.next = number + 1

    def break_off(self, count: int) -> None:
        """Add rows of which nothing is known, and forget the samples of the series before them."""
        self.skip(count)
        self._series = {name: _Series() for name in self.names}
        for series in self._series.values():
            series.next = self.newest + 1

    def forget(self, count: int) -> None:
        """Take the newest values of the series for lost."""
        self.last(count)[:, self._values] = math.nan

    def beside(self, number: int, delays: Sequence[int]) -> list[float]:
        """Values of the series at a row, each of as many rows before."""
        rows = self.last()
        places = [number - self.newest - 1 - delay for delay in delays]
        return [
            rows.item(p, column) if -len(rows) <= p < 0 else math.nan
            for column, p in enumerate(places, self._values.start)
        ]

    def request(self, count: int, shown: int, horizon: float) -> 'UpstreamRequest | None':
        """What a fit of the newest ``count`` rows needs to know; the delays are those of the newest ``shown``."""
        if not self.names:
            return None
        for place, late in enumerate(self.last(shown)[:, self._values.stop :].T):
            if np.isfinite(late).any():
                self.delays[place] = math.ceil(np.nanquantile(late, _IN_TIME))
        values = self.last(count)[:, self._values].copy()
        return UpstreamRequest(self.names, values, tuple(self.delays), self.newest, horizon)


@dataclass(frozen=True)
class UpstreamRequest:
    """The past of the upstream channels, beside that of the craft's."""

    names: tuple[str, ...]
    values: np.ndarray  #: (N, U); oldest first; NaN where missing.
    delays: tuple[int, ...]  #: Rows, of each channel.
    newest: int  #: Number of the newest row.
    horizon: float  #: s; the longest lead and age.


@dataclass(frozen=True)
class UpstreamFit:
    """A filter that has followed the rows up to one, and which rows it reads."""

    space: InnovationsFilter
    every: int  #: Of the craft's rows, by number.
    delays: tuple[int, ...]  #: Rows, of each upstream channel.
    newest: int  #: Number of the row up to which it has stepped.


def fit_upstream(own: np.ndarray, step: float, period: float, asked: UpstreamRequest) -> dict[str, UpstreamFit]:
    """State spaces of the whole past and of its end, from rows of `ATTITUDE` (N, 4), ``step`` s apart.

    None where the upstream channels are missing for the most part, or the past is too short.
    """
    names = (*ATTITUDE, *asked.names)
    rows = np.column_stack([own, *map(_delayed, asked.values.T, asked.delays)])
    seen = np.flatnonzero(np.isfinite(rows[:, len(ATTITUDE) :]).any(axis=1))
    rows = rows[seen[0] :] if seen.size else rows[:0]
    width = len(useful_channels(rows))
    # the state holds all that is on its way, so the past reaches back to where the longest lead's wave comes from
    longest = LONGEST_PAST * period
    past = min(needed_past(rows, step, 0.5 * asked.horizon, longest) + 0.5 * asked.horizon, longest)
    every = _rows_between_lags(past, width, step)
    lags, newest = round(past / (every * step)), asked.newest % every
    coarse = rows[::-1][newest::every][::-1]
    shortest = round((ROWS_A_COEFFICIENT * width + 2.0) * lags)
    fits = {}
    for name in candidates_of(asked.names):
        part = coarse[-shortest:].copy() if name == NEW_UPSTREAM else coarse.copy()
        part[:, [without(each) == name for each in names]] = math.nan
        model = identify(part, names, every * step, period, lags, _STATES) if lags else None
        if model is not None and set(model.channels) & set(asked.names):
            space = InnovationsFilter(model, ATTITUDE, asked.horizon + every * step)
            space.seed(coarse[-2 * lags :])
            fits[name] = UpstreamFit(space, every, asked.delays, asked.newest - newest)
    return fits


def _rows_between_lags(past: float, width: int, step: float):
    """How many rows apart the lags of a past, s, of so many channels have to be."""
    return max(1, math.ceil(past * width / (_MOST_LAGGED * step)))


def _delayed(values: np.ndarray, rows: int) -> np.ndarray:
    return np.concatenate([np.full(rows, math.nan), values])[: values.size]


def needed_past(rows: np.ndarray, step: float, lead: float, longest: float) -> float:
    """The past, s, from which the first two channels of rows (N, C) are best forecast so many s ahead.

    By nested regressions, all of which one Cholesky factor of the lags' Gram matrix holds; each lag must lower the
    error by more than its coefficients cost (Akaike 1969), where forecasts less than a lead apart count as one. Zero
    where the rows do not suffice.
    """
    places = useful_channels(rows)
    every = _rows_between_lags(longest, len(places), step)
    ahead = max(1, round(lead / (every * step)))
    coarse = rows[::every, places]
    coarse = (coarse - np.nanmean(coarse, axis=0)) / np.nanstd(coarse, axis=0) if places else coarse
    width, lags = max(len(places), 1), round(longest / (every * step))
    lags = min(lags, len(coarse) // (3 * width) - ahead)
    targets = [k for k, place in enumerate(places) if place < len(AXES)]
    if lags < 1 or not targets:
        return 0.0
    gram, count = lag_gram(coarse, ahead + lags)
    if count < 2 * lags * width:
        return 0.0
    gram = gram / count + RIDGE * np.eye(len(gram))
    past = slice(ahead * width, None)
    explained = solve_triangular(cholesky(gram[past, past], lower=True), gram[past, targets], lower=True) ** 2
    left = gram[targets, targets] - np.cumsum(explained.reshape(lags, width, -1).sum(axis=1), axis=0)
    price = 2.0 * width * ahead / count * np.arange(1, lags + 1)
    return (1 + int(np.argmin(np.log(left).sum(axis=1) + len(targets) * price))) * every * step
