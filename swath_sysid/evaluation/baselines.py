"""What forecasts are scored against: baselines from the past alone, and the vertical motion of a whole record."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.constants import day
from scipy.signal import welch

from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.motion.vertical import (
    ACCELERATION,
    EDGE,
    HEAVE,
    VELOCITY,
    Stretch,
    even_stretches,
    zero_phase_integral,
)
from swath_sysid.attitude.prediction.point import Point, point_motion
from swath_sysid.attitude.prediction.quiescence import quantity_at
from swath_sysid.common.errors import InputError

#: Order of each regression, given enough past; ``ar`` reads its own angle, ``var`` every channel.
REGRESSIONS = {'ar_40': 40, 'var_40': 40, 'var_60': 60}

SIMPLE = ('persistence', 'constant_rate', 'mean')
BASELINES = (*SIMPLE, *REGRESSIONS)

ORDERS = (60, 40, 20, 10, 5, 2, 1)
REFIT_INTERVAL = 3.0  #: Periods of the motion.
ROWS_A_PERIOD = 30.0  #: A slower sensor gives one row per sample.
EVEN = 1.5  #: Usual intervals between two samples from which one was lost.
#: Periods that show the period, looked for in so many samples and in a longer past by this factor, and so on.
FIRST_PERIODS, FEWEST_SAMPLES, LONGER = 2.0, 8, 1.25
RIDGE = 1e-8  #: Of the coefficients, over the variance of each channel.
ROWS_A_COEFFICIENT = 8.0
LONGEST_SEGMENT = 1024  #: Samples that a spectrum is made of.
LONGEST_PAUSE = day  #: s; a longer one within a record is an error of its stamps.
ON_A_SAMPLE = 0.02  #: Usual intervals from a sample within which a time is the sample's.


@dataclass(frozen=True)
class Record:
    """A trial read at any time."""

    time: np.ndarray  #: (N,); s.
    values: np.ndarray  #: (N, M); NaN where missing.
    names: tuple[str, ...]  #: Channels.

    @classmethod
    def of(cls, trial: Trial) -> Self:
        """Every channel of a trial."""
        return cls(trial.time, np.column_stack(list(trial.channels.values())), tuple(trial.channels))

    @cached_property
    def interval(self) -> float:
        """The sensor's usual interval as its samples keep it, s: the nearest round figure would drift from them."""
        intervals = np.diff(self.time)
        even = np.abs(intervals - np.median(intervals)) < 0.5 * np.median(intervals)
        return float(intervals[even].mean())

    @cached_property
    def first_periods(self) -> tuple[float, float]:
        """Period of the motion, s, by the first periods of the record, and the time when it is known."""
        begin, end = float(self.time[0]), float(self.time[-1])
        now = begin + FEWEST_SAMPLES * self.interval
        while now < end and now - begin < FIRST_PERIODS * self._period_until(now):
            now = begin + LONGER * (now - begin)
        return self._period_until(min(now, end)), now

    def _period_until(self, end: float) -> float:
        """Period of the motion, s: one over the mean frequency of the spectra of the angles up to a time."""
        grid = np.arange(self.time[0], end, self.interval)
        power = frequency = 0.0
        for place in (self.names.index(axis) for axis in AXES if axis in self.names):
            known = np.isfinite(self.values[:, place])
            if known.any():
                angle = np.interp(grid, self.time[known], self.values[known, place])
                f, density = welch(angle, 1.0 / self.interval, nperseg=min(LONGEST_SEGMENT, angle.size))
                power, frequency = power + density[1:].sum(), frequency + (f * density)[1:].sum()
        return power / frequency if frequency else self.interval * ROWS_A_PERIOD

    def column(self, name: str) -> Any:
        """One channel, or None."""
        return self.values[:, self.names.index(name)] if name in self.names else None

    def at(self, wanted: np.ndarray, places: Sequence[int] | None = None) -> np.ndarray:
        """The channels (some, by place) at times (...), s, linear between samples; NaN where one is missing."""
        values = self.values if places is None else self.values[:, list(places)]
        near = ON_A_SAMPLE * self.interval
        after = np.clip(np.searchsorted(self.time, wanted - near), 1, self.time.size - 1)
        before = after - 1
        width = self.time[after] - self.time[before]
        fraction = ((wanted - self.time[before]) / width)[..., None]
        result = (1.0 - fraction) * values[before] + fraction * values[after]
        result[(width > EVEN * self.interval) | (fraction[..., 0] < 0.0) | (fraction[..., 0] > 1.0)] = np.nan
        for neighbour in (before, after):
            on = np.abs(wanted - self.time[neighbour]) <= near
            result[on] = values[neighbour[on]]
        return result

    def after_gap(self, name: str, stamps: np.ndarray, duration: float) -> np.ndarray:
        """Whether each stamp lies within a gap of a channel or within `duration`, s, after it; the start is no gap."""
        measured = self.time[np.isfinite(self.column(name))]
        gaps = np.flatnonzero(np.diff(measured) > EVEN * self.interval)
        last, first = np.append(measured[gaps], np.inf), np.append(-np.inf, measured[gaps + 1])
        ended = np.searchsorted(first, stamps, side='right') - 1
        return (stamps - first[ended] <= duration) | (stamps > last[ended])


def baseline_forecasts(
    record: Record, axes: Sequence[str], stamps: np.ndarray, leads: np.ndarray, window: float
) -> dict[str, dict[str, np.ndarray]]:
    """Forecasts (N, L) of `BASELINES` by axis, issued at stamps (N,), s, from the last ``window`` s, for leads (L,),
    s. The vector regressions read all channels of the record; NaN where there is no forecast.
    """
    pauses = np.diff(record.time)
    if pauses.size and pauses.max() > LONGEST_PAUSE:
        # the regressions read an even grid over the whole record
        raise InputError(
            f'the stamps jump by {pauses.max():.3g} s after t = {record.time[np.argmax(pauses)]:.6g} s, too far to be '
            'scored across: cut the record there'
        )
    every = [k for k, name in enumerate(record.names)]
    result = {axis: simple_forecasts(record, axis, stamps, leads, window) for axis in axes}
    targets = [record.names.index(axis) for axis in axes]
    for name, order in REGRESSIONS.items():
        groups = [[target] for target in targets] if name.startswith('ar') else [targets]
        for group in groups:
            channels = group if name.startswith('ar') else every
            ahead = running_regression(record, channels, group, order, stamps, leads, window)
            for k, target in enumerate(group):
                result[record.names[target]][name] = ahead[:, :, k]
    return result


def simple_forecasts(
    record: Record, name: str, stamps: np.ndarray, leads: np.ndarray, window: float
) -> dict[str, np.ndarray]:
    """Persistence, constant rate and the mean of the past (`SIMPLE`), arguments as in `baseline_forecasts`. The rate
    is the channel with ``_rate`` after its name or, without one, that between the newest two values.
    """
    measured = np.isfinite(record.column(name))
    time, angle = record.time[measured], record.column(name)[measured]
    none = np.full((stamps.size, leads.size), np.nan)
    if not time.size:
        return dict.fromkeys(SIMPLE, none)
    newest = np.searchsorted(time, stamps, side='right') - 1
    rate = record.column(f'{name}_rate')
    if rate is None:
        rate = np.diff(angle, prepend=np.nan) / np.diff(time, prepend=np.nan)
    else:
        rate = rate[measured]
    total = np.append(0.0, np.cumsum(angle))
    oldest = np.searchsorted(time, stamps - window)
    mean = (total[newest + 1] - total[oldest]) / np.maximum(newest + 1 - oldest, 1)
    known = (newest >= 0)[:, None]
    found = angle[newest][:, None], angle[newest][:, None] + rate[newest][:, None] * leads, mean[:, None]
    return {name: np.where(known, values, none) for name, values in zip(SIMPLE, found, strict=True)}


def running_regression(
    record: Record,
    channels: Sequence[int],
    targets: Sequence[int],
    order: int,
    stamps: np.ndarray,
    leads: np.ndarray,
    window: float,
) -> np.ndarray:
    """A vector autoregression by ridge least squares, refitted as time goes on: forecasts (N, T, L) of T targets. It
    reads those channels that move and are mostly known; stamps, leads and window as in `baseline_forecasts`. NaN before
    the first fit and where a lag is missing.
    """
    # forty lags reach more than a period back, whatever the sensor's rate
    period, known = record.first_periods
    step = record.interval * max(1, round(period / (ROWS_A_PERIOD * record.interval)))
    start = float(record.time[0])
    grid = record.at(start + step * np.arange(int((record.time[-1] - start) / step) + 1))
    anchors = record.time[np.maximum(np.searchsorted(record.time, stamps, side='right') - 1, 0)]
    result = np.full((stamps.size, leads.size, len(targets)), np.nan)
    sums = None
    between = REFIT_INTERVAL * period
    refits = start + between * np.arange(1, int((record.time[-1] - start) / between) + 1)
    for refit in refits[refits >= known]:
        now = slice(*np.searchsorted(stamps, (refit, refit + between)))
        # a row of the grid may read the sample after it, which must have come by then
        end = int((refit - start - EVEN * record.interval) / step) + 1
        begin = max(0, end - int(window / step))
        useful = tuple(channel for channel in channels if _moves(grid[begin:end, channel]))
        fewest = ROWS_A_COEFFICIENT * len(useful)
        supported = next((o for o in ORDERS if o <= order and end - begin - o >= fewest * o), None)
        if now.start == now.stop or not set(targets) <= set(useful) or supported is None:
            continue
        if sums is None or (sums.channels, sums.order) != (useful, supported):
            sums = _RunningSums(grid, useful, supported, begin, end)
        sums.slide(begin, end)
        if sums.count < supported * len(useful):
            continue
        places = [useful.index(target) for target in targets]
        constant, coefficients = sums.solve()
        constant, matrix = _ahead(constant, coefficients, places, leads / step)
        lags = record.at(anchors[now, None] - step * np.arange(supported), useful)
        lags = ((lags - sums.centre) / sums.scale).reshape(lags.shape[0], -1)
        ahead = (lags @ matrix.reshape(-1, lags.shape[1]).T).reshape(-1, *constant.shape) + constant
        result[now] = ahead * sums.scale[places] + sums.centre[places]
    return result


def _moves(values: np.ndarray):
    """Whether a channel (N,) is present most of the time and varies."""
    known = values[np.isfinite(values)]
    return 2 * known.size > values.size and known.std() > RIDGE


class _RunningSums:
    """Sums of products of a constant, a row and the rows before it, over a window that slides along a grid. Empty at
    first, in the standard deviations of the rows from `begin` to `end`.
    """

    def __init__(self, grid: np.ndarray, channels: tuple[int, ...], order: int, begin: int, end: int) -> None:
        self.channels, self.order, self.count, self.span = channels, order, 0, (begin, begin)
        values = grid[:, channels]
        self.centre, self.scale = np.nanmean(values[begin:end], axis=0), np.nanstd(values[begin:end], axis=0)
        self.values = (values - self.centre) / self.scale
        self.gram = np.zeros((1 + (order + 1) * len(channels),) * 2)

    def slide(self, begin: int, end: int) -> None:
        """Make the window that of the rows from `begin` to `end`."""
        self._add(max(self.span[1], self.span[0] + self.order), end, 1)
        self._add(self.span[0] + self.order, begin + self.order, -1)
        self.span = begin, end

    def _add(self, first: int, last: int, sign: int):
        """Add or take away the rows from `first` to `last`, each with those before it; incomplete ones do not count."""
        if last <= first:
            return
        windows = np.lib.stride_tricks.sliding_window_view(
            self.values[first - self.order : last], self.order + 1, axis=0
        )
        rows = windows[:, :, ::-1].transpose(0, 2, 1).reshape(last - first, -1)
        rows = rows[np.isfinite(rows).all(axis=1)]
        rows = np.column_stack([np.ones(rows.shape[0]), rows])
        self.gram += sign * (rows.T @ rows)
        self.count += sign * rows.shape[0]

    def solve(self) -> tuple[np.ndarray, np.ndarray]:
        """Constant, shape (M,), and coefficients, shape (M p, M), of the next row."""
        width = len(self.channels)
        past = np.r_[0, 1 + width : self.gram.shape[0]]
        ridge = np.full(past.size, RIDGE * max(self.count, 1))
        coefficients = np.linalg.solve(self.gram[np.ix_(past, past)] + np.diag(ridge), self.gram[past, 1 : 1 + width])
        return coefficients[0], coefficients[1:]


def _ahead(constant: np.ndarray, coefficients: np.ndarray, targets: Sequence[int], steps: np.ndarray):
    """Constant, shape (L, T), and matrix, shape (L, T, M p), from the lags to the targets so many steps ahead."""
    width = constant.size
    row = np.zeros((len(targets), coefficients.shape[0]))
    row[np.arange(len(targets)), targets] = 1.0
    found, constants = [row], [np.zeros(len(targets))]
    for _ in range(int(np.ceil(steps[-1] - 1e-6))):
        # one step of the companion matrix: the newest block is replaced by its regression, the rest shifts
        newest = found[-1][:, :width]
        following = newest @ coefficients.T
        following[:, :-width] += found[-1][:, width:]
        constants.append(constants[-1] + newest @ constant)
        found.append(following)
    rows, constant_of = np.array(found), np.array(constants)
    below = np.minimum(np.floor(steps + 1e-6).astype(int), len(rows) - 1)
    above = np.minimum(below + 1, len(rows) - 1)
    share = np.where(steps - below > 1e-6, steps - below, 0.0)[:, None]
    matrix = (1.0 - share[:, :, None]) * rows[below] + share[:, :, None] * rows[above]
    return (1.0 - share) * constant_of[below] + share * constant_of[above], matrix


_WITH_RATES = ('heave', 'heave_rate', 'vertical_velocity', 'vertical_velocity_rate', 'vertical_acceleration')


def vertical_record(trial: Trial, points: Sequence[Point]) -> Record:
    """Heave, vertical velocity and acceleration at points by zero-phase integrals of the whole record and lever arms.
    Channels are named by `quantity_at`, derivatives with ``_rate`` after it; NaN within `EDGE` of the ends of a
    stretch.
    """
    parts = [_at_points(part, points) for part in even_stretches(trial) if part.time[-1] - part.time[0] > 2.0 * EDGE]
    if not parts:
        raise InputError(
            f'{trial.source or "the record"} holds no {2.0 * EDGE:.0f} s without a gap: vertical motion is known '
            f'{EDGE:.0f} s from the ends only'
        )
    time, values = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Record(time, values, tuple(quantity_at(point.name, kind) for point in points for kind in _WITH_RATES))


def _at_points(stretch: Stretch, points: Sequence[Point]):
    """Times and, for each point, heave, twice velocity and twice acceleration."""
    acceleration, channels = stretch.acceleration, stretch.channels
    vertical = [zero_phase_integral(acceleration, stretch.step, times) for times in (HEAVE, VELOCITY, ACCELERATION)]
    turning = [zero_phase_integral(channels[f'{axis}_rate'], stretch.step, -1) for axis in ('roll', 'pitch')]
    attitude = [channels[name] for name in ('roll', 'pitch', 'roll_rate', 'pitch_rate')]
    motion = np.stack([*vertical, *turning, *attitude], axis=1)
    mean = channels['roll'].mean(), channels['pitch'].mean()
    inner = slice(round(EDGE / stretch.step), -round(EDGE / stretch.step))
    each = [point_motion(point.place, mean, motion[inner]).mean for point in points]
    return stretch.time[inner], np.hstack([of[:, [0, 1, 1, 2, 2]] for of in each])
