"""A forecast from the second sample on: a library of seas, each a Gaussian process in units of the motion's period.

A member is a spectrum of the angle, the level about which it varies, and white noise of angle and rate. Members are
weighted by the likelihood of the rows so far, with the size of the motion integrated out.
"""

import math
from collections import deque
from functools import cache, lru_cache
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.memories import LEAST_SIZE, LIFETIME, NIS_MEMORY
from swath_sysid.attitude.prediction.rows import ROWS_A_PERIOD
from swath_sysid.attitude.prediction.state_space import CONTRADICTED, cubic_weights
from swath_sysid.attitude.prediction.variate_analysis import MAX_LAGS
from swath_sysid.common.accelerator import accelerated
from swath_sysid.common.conventions import NEGLIGIBLE

MEMBERS = 256

_WHITENING = Lock()  # predictors are shared by forecasters, which may be in several threads

#: Of a member, log-uniform: peak period over the motion's (by the cube of the logarithm: most are near the middle),
#: damping of the two peaks, their steepness, period and power of the second over those of the first, noise of angle and
#: rate and the level over the motion's standard deviation.
RANGES = (
    (0.125, 8.0),
    (0.05, 0.7),
    (0.05, 0.7),
    (1.5, 4.0),
    (0.4, 2.5),
    (0.03, 1.0),
    (0.002, 0.1),
    (0.002, 0.1),
    (0.1, 30.0),
)

TEMPER = 0.3  #: Of the logarithm of a likelihood: no sea is quite like any member.

FURTHEST = 28  #: Rows ahead, of the library's own, after which a forecast is the level.

_SAME_PERIOD = 1.2  #: Ratio between the numbers of rows in a period for which there are predictors.
_LARGEST = 4.0 * CONTRADICTED


class Seas(NamedTuple):
    """M members."""

    frequency: np.ndarray  #: (F,); cycles in a period.
    power: np.ndarray  #: (M, F); of unit sum.
    noise: np.ndarray  #: (M, 2); variances of the noise of angle and rate, over theirs.
    level: np.ndarray  #: (M,); variance.


@cache
def seas() -> Seas:
    """The members; their parameters fill the ranges evenly, by multiples of a generalised golden ratio."""
    low, high = np.array(RANGES).T
    ratio = np.real(np.roots([1.0, *np.zeros(low.size - 1), -1.0, -1.0])).max()
    part = np.arange(1, MEMBERS + 1)[:, None] * ratio ** -np.arange(1.0, low.size + 1.0) % 1.0
    part[:, 0] = 0.5 + 0.5 * (2.0 * part[:, 0] - 1.0) ** 3
    period, first, second, steepness, apart, share, *noise, level = (low * (high / low) ** part).T[:, :, None]
    frequency = np.linspace(0.03, 7.0, 250)

    def peak(period: np.ndarray, damping: np.ndarray) -> np.ndarray:
        x = (frequency * period) ** 2
        power = x / ((1.0 - x) ** 2 + 4.0 * damping**2 * x) ** steepness
        return power / power.sum(axis=1, keepdims=True)

    power = (peak(period, first) + share * peak(period * apart, second)) / (1.0 + share)
    return Seas(frequency, power, np.hstack(noise) ** 2, level[:, 0] ** 2)


class Predictors:
    """What the members forecast from readings, newest first: the angle or, in turn, angle and rate.

    Rates are in units of the angle, times the period over 2 pi. Values ahead are angle and rate at each node: the
    level, the row before the newest, the newest, and those ahead. With L L' the covariance of the readings, ``white``
    (M, N, N + T) is [L^-1 | L^-1 cov(readings, values ahead)], of which the first rows are those of fewer readings.
    """

    def __init__(self, rows: float, rated: bool) -> None:
        sea, self._kinds, self._nodes = seas(), 1 + rated, FURTHEST + 3
        phase = 2.0 * np.pi / rows * np.arange(-1, MAX_LAGS // self._kinds + self._nodes)[:, None] * sea.frequency
        of_rate = (sea.frequency * sea.power).T
        angles, crossed = np.cos(phase) @ sea.power.T, np.sin(phase) @ of_rate
        rates = np.cos(phase) @ (sea.frequency[:, None] * of_rate)
        # by the kind of a reading, the rows to a later value plus one, member, and the value's kind
        self._covariance = np.array([[angles + sea.level, -crossed], [crossed, rates]]).transpose(0, 2, 3, 1)
        self._level = np.stack([sea.level, np.zeros(MEMBERS)])
        own = np.stack([1.0 + sea.level, rates[1]], axis=1)
        self.read = own + sea.noise * np.stack([np.ones(MEMBERS), rates[1]], axis=1)  #: (M, 2); variances of readings.
        self.white = np.zeros((MEMBERS, MAX_LAGS, MAX_LAGS + 2 * (1 + self._nodes)))
        self._known = 0

    def whiten(self, count: int) -> None:
        """Make the first rows of ``white`` known, by Gram and Schmidt."""
        if count > self._known:
            with _WHITENING:
                self._whiten(count)

    def _whiten(self, count: int) -> None:
        lags, kinds = np.divmod(np.arange(MAX_LAGS), self._kinds)
        for i in range(self._known, count):
            lag, kind, row = lags[i], kinds[i], self.white[:, i]
            covariance, before = self._covariance[kind], self.white[:, :i]
            row[:, i] = 1.0
            row[:, MAX_LAGS] = self._level[kind]
            row[:, MAX_LAGS + 2 :] = covariance[lag : lag + self._nodes].transpose(1, 0, 2).reshape(MEMBERS, -1)
            factor = (before[:, :, :i] @ covariance[lag - lags[:i] + 1, :, kinds[:i]].T[:, :, None])[:, :, 0]
            row -= (factor[:, None] @ before)[:, 0]
            row /= np.sqrt(self.read[:, kind] - (factor**2).sum(axis=1))[:, None]
        self._known = max(self._known, count)


@lru_cache(maxsize=2)
def predictors(rows: float, rated: bool) -> Predictors:
    """For so many rows a period, the same ones for every axis."""
    return Predictors(rows, rated)


class AxisSeas:
    """The library on the rows of one axis, of which every ``stride``-th counts: forecasts at the first ``nodes``."""

    def __init__(self, rows: float, stride: int, nodes: int, rated: bool) -> None:
        self.rated, self._stride, self._nodes = rated, stride, nodes
        # rows of all strides count as one
        self._share, self._a_row = 1.0 / stride, 1.0 / (rows * stride)
        self.age, self.nis = 0.0, 1.0  #: Periods of rows; errors over what was expected of them.
        self._predictors = predictors(rows, rated)
        self._alive, self._copied = np.arange(MEMBERS), 0
        self._read, self._white = self._predictors.read, self._predictors.white
        #: (M, 2); squares of errors over their variances for a size of one, and log likelihood but for its size.
        self._told = np.tile([LEAST_SIZE**2, 0.0], (MEMBERS, 1))
        self._count = 2.0  # as of two readings at rest
        self.reset()

    def reset(self) -> None:
        """Forget the rows, not what they have shown."""
        self.count = 0  #: Rows that there are.
        self.past = np.zeros((MAX_LAGS // (1 + self.rated) * self._stride, 1 + self.rated))  #: Newest first.
        angle, rate = self._read.T[:, :, None]
        # of angle, of both and of rate, at the nodes
        self._moments = np.stack([angle, 0.0 * angle, rate], axis=-1).repeat(self._nodes, axis=1)
        self._used = 0
        self._mixture: Any = None
        self._issued = deque([(np.zeros((len(angle), 2)), self._moments[:, 0].copy())] * self._stride)

    def take(self, reading: list[float]) -> None:
        """Take the next row: angle or angle and rate."""
        least, weight, size = weighed(np.array(reading), *self._issued.popleft(), self._told, self._count, self._share)
        self.age += self._a_row
        self.nis += min(1.0, self._a_row / NIS_MEMORY) * (min(least, _LARGEST) - self.nis)
        self._count += len(reading) * self._share
        self.past[1:] = self.past[:-1]
        self.past[0] = reading
        self.count = min(self.count + 1, len(self.past))
        readings = self.past[: self.count : self._stride].ravel()
        self._grow(readings.size)
        innovations = (self._white[:, : readings.size, : readings.size] @ readings)[:, None]
        ahead = self._white[:, : readings.size, MAX_LAGS : MAX_LAGS + 2 * self._nodes]
        self._issued.append(((innovations @ ahead[:, :, 6:8])[:, 0], self._moments[:, 3].copy()))
        keep = weight > NEGLIGIBLE
        self._members = weight / weight.sum(), size, innovations, ahead, self._moments
        self._mixture = None
        if 2 * np.count_nonzero(keep) < keep.size:
            self._keep(keep)

    def mixture(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (nodes, 2) and covariance (nodes, 4), row by row, of readings, after the newest row."""
        if self._mixture is None:
            weight, size, innovations, ahead, moments = self._members
            means = (innovations @ ahead)[:, 0]
            mean = weight @ means
            apart = np.sqrt(weight)[:, None] * (means - mean)
            within = ((weight * size) @ moments.reshape(weight.size, -1)).reshape(-1, 3)[:, [0, 1, 1, 2]]
            between = apart.reshape(weight.size, -1, 2).transpose(1, 2, 0)
            self._mixture = mean.reshape(-1, 2), within + (between @ between.transpose(0, 2, 1)).reshape(-1, 4)
        return self._mixture

    def _grow(self, count: int):
        """Forecast from so many readings."""
        if count == self._used:
            return
        self._predictors.whiten(count)
        if self._white is not self._predictors.white:
            self._white[:, self._copied : count] = self._predictors.white[self._alive, self._copied : count]
        self._copied = max(self._copied, count)
        z = self._white[:, self._used : count, MAX_LAGS : MAX_LAGS + 2 * self._nodes]
        angle, rate = z[:, :, ::2], z[:, :, 1::2]
        self._moments = self._moments - np.stack([angle * angle, angle * rate, rate * rate], axis=-1).sum(axis=1)
        self._used = count

    def _keep(self, keep: np.ndarray):
        """Drop the other members."""
        for name in ('_alive', '_read', '_told', '_moments', '_white'):
            setattr(self, name, getattr(self, name)[keep])
        self._issued = deque([(mean[keep], moments[keep]) for mean, moments in self._issued])


@accelerated
def weighed(
    reading: np.ndarray, mean: np.ndarray, moments: np.ndarray, told: np.ndarray, count: float, share: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """Compare a reading, angle or angle and rate, with each member's forecast of it, mean (M, 2) and moments (M, 3).

    By how much the member that explains it best is off, one row alone may be wrong, weights (M,) over the largest, and
    sizes (M,) of the motion. ``told`` (M, 2) goes on by a ``share`` of it, ``count`` are the readings before.
    """
    least, best, after = math.inf, -math.inf, count + reading.size * share
    weight, size = np.empty(len(mean)), np.empty(len(mean))
    for member in range(len(mean)):
        variance, crossed, of_rate = moments[member, 0], moments[member, 1], moments[member, 2]
        error = reading[0] - mean[member, 0]
        square = error * error / variance
        if reading.size > 1:
            slope = crossed / variance
            left = of_rate - slope * crossed
            square += (reading[1] - mean[member, 1] - slope * error) ** 2 / left
            variance *= left
        least = min(least, square / max(told[member, 0] / count, LEAST_SIZE**2) / reading.size)
        told[member, 0] += share * square
        told[member, 1] -= 0.5 * share * math.log(variance)
        size[member] = max(told[member, 0] / after, LEAST_SIZE**2)
        weight[member] = TEMPER * (told[member, 1] - 0.5 * after * math.log(size[member]))
        best = max(best, weight[member])
    for member in range(len(mean)):
        weight[member] = math.exp(weight[member] - best)
    return least, weight, size


class SeaLibrary:
    """The library on the rows of every axis: a candidate for all of `ATTITUDE`."""

    def __init__(self, step: float, period: float, horizon: float) -> None:
        rows = period / step
        self._stride = max(1, round(2.0 * rows / ROWS_A_PERIOD))
        self._rows = _SAME_PERIOD ** round(math.log(rows / self._stride, _SAME_PERIOD))
        self._unit = self._rows * self._stride * step / (2.0 * math.pi)
        self._furthest = min(math.ceil(horizon / step / self._stride), FURTHEST)
        self._units = np.array([1.0, 1.0 / self._unit])
        self._square_units = np.outer(self._units, self._units).ravel()
        self._axes: list[AxisSeas | None] = [None] * len(AXES)
        self._following = list(self._axes)
        self._anew: list[int] = []

    def take(self, row: np.ndarray) -> None:
        """Update with the next row (width,), NaN where missing."""
        for place, axis in enumerate(self._axes):
            angle, rate = row.item(place), row.item(place + len(AXES)) * self._unit
            rated = rate == rate
            if angle != angle:
                if axis is not None:
                    axis.reset()
                continue
            if axis is None or axis.rated != rated:
                axis = self._axes[place] = self._begun(rated)
            reading, before = [angle, rate] if rated else [angle], axis.past[: min(axis.count, 1)].tolist()
            axis.take(reading)
            self._renew(place, axis, reading)
            if axis.nis > CONTRADICTED:
                # another motion, of which the newest rows are all that is known
                axis = self._axes[place] = self._begun(rated)
                self._anew.append(place)
                for each in (*before, reading):
                    axis.take(each)

    def _renew(self, place: int, axis: AxisSeas, reading: list[float]):
        """Seas that were dropped come back: others begin in time, and take over when they know enough."""
        following = self._following[place]
        if following is None or following.rated != axis.rated or following.age > axis.age:
            following = self._following[place] = self._begun(axis.rated) if axis.age > LIFETIME else None
        if following is not None:
            following.take(reading)
            if following.age > 0.5 * LIFETIME:
                self._axes[place], self._following[place] = following, None

    def _begun(self, rated: bool):
        return AxisSeas(self._rows, self._stride, self._furthest + 4, rated)

    def begun_anew(self) -> list[int]:
        """Axes whose motion was another one at the newest row."""
        anew, self._anew = self._anew, []
        return anew

    @property
    def widening(self) -> np.ndarray:
        """By axis: what the newest rows contradict claims so much more."""
        return np.array(2 * [1.0 if axis is None else max(axis.nis, 1.0) for axis in self._axes])

    def predict(self, count: int) -> None:
        """Go on over ``count`` missing rows."""
        for axis in (*self._axes, *self._following):
            if axis is not None and count:
                axis.reset()

    def ahead(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (L, 4) so many rows (L,) ahead, and covariance (L, 4, 4) with the sensor's noise."""
        of_mean, of_covariance = _weights_between(np.asarray(rows, dtype=float).tobytes(), self._stride, self._furthest)
        mean, covariance = np.full((len(of_mean), 4), math.nan), np.zeros((len(of_mean), 4, 4))
        for place, axis in enumerate(self._axes):
            if axis is not None and axis.count:
                means, spreads = axis.mixture()
                mean[:, place::2] = of_mean @ means * self._units
                covariance[:, place::2, place::2] = (of_covariance @ spreads * self._square_units).reshape(-1, 2, 2)
        return mean, covariance


@lru_cache(maxsize=32)
def _weights_between(rows: bytes, stride: int, furthest: int) -> np.ndarray:
    """Weights (L, nodes) of means, cubic, and covariances, linear, so many rows (L,) ahead; the level beyond.

    Of numbers as they lie in memory: the same leads are asked for again and again.
    """
    strides = np.frombuffer(rows) / stride
    near = np.minimum(strides, furthest)
    # nodes: the level, the row before the newest, the newest
    whole = np.minimum(near.astype(int), furthest - 1)
    part, places = (near - whole)[:, None], np.arange(near.size)[:, None]
    weights = np.zeros((2, near.size, furthest + 4))
    weights[0, places, whole[:, None] + np.arange(1, 5)] = cubic_weights(part[:, 0])
    weights[1, places, whole[:, None] + np.arange(2, 4)] = np.hstack([1.0 - part, part])
    weights[:, strides > furthest] = np.arange(furthest + 4) == 0
    return weights
