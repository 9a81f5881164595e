"""A forecast from the second sample on: a library of seas, each a Gaussian process in units of the motion's period.

A member is a spectrum of the angle, the level about which it varies, and white noise of angle and rate. Members are
weighted by the likelihood of the rows so far, with the size of the motion integrated out.
"""

import math
from collections import deque
from collections.abc import Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import LEAST_SIZE
from swath_sysid.attitude.prediction.rows import ROWS_A_PERIOD
from swath_sysid.attitude.prediction.state_space import CONTRADICTED, STRAIN_TIME, cubic_weights
from swath_sysid.attitude.prediction.variate_analysis import MAX_LAGS

MEMBERS = 256

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

LIFETIME = 12.0  #: Periods after which all members begin again; half as long after that these take over.

TEMPER = 0.3  #: Of the logarithm of a likelihood: no sea is quite like any member.

#: Rows ahead, of the library's own, after which a forecast is the level; a member of less relative weight is dropped.
FURTHEST, LEAST_WEIGHT = 28, 1e-3

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
    (N, M, N + T) is [L^-1 | L^-1 cov(readings, values ahead)], of which the first rows are those of fewer readings.
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
        self.own = np.stack(
            [1.0 + sea.level, rates[1]], axis=1
        )  #: (M, 2); variances of angle and rate, and of readings.
        self.read = self.own + sea.noise * np.stack([np.ones(MEMBERS), rates[1]], axis=1)
        self.white = np.zeros((MAX_LAGS, MEMBERS, MAX_LAGS + 2 * (1 + self._nodes)))
        self._known = 0

    def whiten(self, count: int) -> None:
        """Make the first rows of ``white`` known, by Gram and Schmidt."""
        lags, kinds = np.divmod(np.arange(MAX_LAGS), self._kinds)
        for i in range(self._known, count):
            lag, kind, row = lags[i], kinds[i], self.white[i]
            covariance, before = self._covariance[kind], self.white[:i]
            row[:, i] = 1.0
            row[:, MAX_LAGS] = self._level[kind]
            row[:, MAX_LAGS + 2 :] = covariance[lag : lag + self._nodes].transpose(1, 0, 2).reshape(MEMBERS, -1)
            factor = np.einsum('imj,jm->im', before[:, :, :i], covariance[lag - lags[:i] + 1, :, kinds[:i]])
            row -= np.einsum('im,imt->mt', factor, before)
            row /= np.sqrt(self.read[:, kind] - (factor**2).sum(axis=0))[:, None]
        self._known = max(self._known, count)


@lru_cache(maxsize=2)
def predictors(rows: float, rated: bool) -> Predictors:
    """For so many rows a period, the same ones for every axis."""
    return Predictors(rows, rated)


class AxisSeas:
    """The library on the rows of one axis, of which every ``stride``-th counts: forecasts at the first ``nodes``.

    ``mean`` (nodes, 2) and ``covariance`` (nodes, 2, 2) are of readings.
    """

    def __init__(self, rows: float, stride: int, nodes: int, rated: bool) -> None:
        self.rated, self._stride, self._nodes = rated, stride, nodes
        self._a_row = 1.0 / (rows * stride)
        self.age, self.strain = 0.0, 1.0  #: Periods of rows; errors over what was expected of them.
        self._predictors = predictors(rows, rated)
        self._alive, self._copied = np.arange(MEMBERS), 0
        self._read, self._white = self._predictors.read, self._predictors.white
        self._log = np.zeros(MEMBERS)
        self._square = np.full(MEMBERS, LEAST_SIZE**2)
        self._count = 2.0  # as of two readings at rest
        self.restart()

    def restart(self) -> None:
        """Forget the rows, not what they have shown."""
        self.past: deque[list[float]] = deque(maxlen=MAX_LAGS // (1 + self.rated) * self._stride)
        angle, rate = self._read.T[:, :, None]
        # of angle, of both and of rate, at the nodes
        self._moments = np.stack([angle, 0.0 * angle, rate], axis=-1).repeat(self._nodes, axis=1)
        self._used = 0
        self._issued = deque([(np.zeros((len(angle), 2)), self._moments[:, 0].copy())] * self._stride)

    def step(self, reading: list[float]) -> None:
        """Take the next row: angle or angle and rate."""
        self._score(reading)
        self.past.appendleft(reading)
        readings = np.concatenate(list(self.past)[:: self._stride])
        count = readings.size
        self._grow(count)
        white = self._white[:count]
        ahead = white[:, :, MAX_LAGS : MAX_LAGS + 2 * self._nodes]
        mean = np.einsum('im,imt->mt', white[:, :, :count] @ readings, ahead).reshape(-1, self._nodes, 2)
        self._issued.append((mean[:, 3], self._moments[:, 3].copy()))
        size = np.maximum(self._square / self._count, LEAST_SIZE**2)
        score = TEMPER * (self._log - 0.5 * self._count * np.log(size))
        weight = np.exp(score - score.max())
        keep = weight > LEAST_WEIGHT
        weight /= weight.sum()
        self.mean = np.tensordot(weight, mean, 1)
        apart = mean - self.mean
        self.covariance = np.tensordot(weight * size, self._moments, 1)[:, [[0, 1], [1, 2]]]
        self.covariance += np.einsum('m,mtp,mtq->tpq', weight, apart, apart)
        if 2 * keep.sum() < keep.size:
            self._keep(keep)

    def _score(self, reading: Sequence[float]):
        """Compare a row with what was forecast for it a stride ago; rows of all strides count as one."""
        mean, (angle, crossed, rate) = (values.T for values in self._issued.popleft())
        error, size = reading[0] - mean[0], self._square / self._count
        square, log = error**2 / angle, np.log(angle)
        if self.rated:
            left = rate - crossed**2 / angle
            square += (reading[1] - mean[1] - crossed / angle * error) ** 2 / left
            log += np.log(left)
        # by the member that explains it best; one row alone may be wrong
        least = float((square / np.maximum(size, LEAST_SIZE**2)).min()) / len(reading)
        self.age += self._a_row
        self.strain += min(1.0, self._a_row / STRAIN_TIME) * (min(least, _LARGEST) - self.strain)
        self._square += square / self._stride
        self._log -= 0.5 * log / self._stride
        self._count += len(reading) / self._stride

    def _grow(self, count: int):
        """Forecast from so many readings."""
        self._predictors.whiten(count)
        if self._white is not self._predictors.white:
            self._white[self._copied : count] = self._predictors.white[self._copied : count, self._alive]
        self._copied = max(self._copied, count)
        for z in self._white[self._used : count, :, MAX_LAGS : MAX_LAGS + 2 * self._nodes]:
            angle, rate = z[:, ::2], z[:, 1::2]
            self._moments -= np.stack([angle * angle, angle * rate, rate * rate], axis=-1)
        self._used = count

    def _keep(self, keep: np.ndarray):
        """Drop the other members."""
        for name in ('_alive', '_read', '_log', '_square', '_moments'):
            setattr(self, name, getattr(self, name)[keep])
        self._white = self._white[:, keep]
        self._issued = deque([(mean[keep], moments[keep]) for mean, moments in self._issued])


class SeaLibrary:
    """The library on the rows of every axis, as an `InnovationsFilter` of all `ATTITUDE`."""

    def __init__(self, steps: np.ndarray, step: float, period: float, horizon: float) -> None:
        rows = period / step
        self._stride = max(1, round(2.0 * rows / ROWS_A_PERIOD))
        self._rows = _SAME_PERIOD ** round(math.log(rows / self._stride, _SAME_PERIOD))
        self._unit = self._rows * self._stride * step / (2.0 * math.pi)
        self._steps, self._step = np.asarray(steps, dtype=float), step
        self._furthest = min(math.ceil(horizon / step / self._stride), FURTHEST)
        self._axes: list[AxisSeas | None] = [None] * len(AXES)
        self._following = list(self._axes)
        self._anew: list[int] = []

    def step(self, row: np.ndarray) -> None:
        """Update with the next row (width,), NaN where missing."""
        for place, axis in enumerate(self._axes):
            angle, rate = row.item(place), row.item(place + len(AXES)) * self._unit
            rated = rate == rate
            if angle != angle:
                if axis is not None:
                    axis.restart()
                continue
            if axis is None or axis.rated != rated:
                axis = self._axes[place] = self._begun(rated)
            reading, before = [angle, rate] if rated else [angle], list(axis.past)[:1]
            axis.step(reading)
            self._renew(place, axis, reading)
            if axis.strain > CONTRADICTED:
                # another motion, of which the newest rows are all that is known
                axis = self._axes[place] = self._begun(rated)
                self._anew.append(place)
                for each in (*before, reading):
                    axis.step(each)

    def _renew(self, place: int, axis: AxisSeas, reading: list[float]):
        """Seas that were dropped come back: others begin in time, and take over when they know enough."""
        following = self._following[place]
        if following is None or following.rated != axis.rated or following.age > axis.age:
            following = self._following[place] = self._begun(axis.rated) if axis.age > LIFETIME else None
        if following is not None:
            following.step(reading)
            if following.age > 0.5 * LIFETIME:
                self._axes[place], self._following[place] = following, None

    def _begun(self, rated: bool):
        return AxisSeas(self._rows, self._stride, self._furthest + 4, rated)

    def begun_anew(self) -> list[int]:
        """Axes whose motion was another one at the newest row."""
        anew, self._anew = self._anew, []
        return anew

    def strain(self, place: int) -> float:
        """Errors over what was expected of them, squared, of the newest rows of an axis."""
        axis = self._axes[place]
        return 1.0 if axis is None else axis.strain

    def skip(self, count: int) -> None:
        """Step over ``count`` missing rows."""
        for axis in (*self._axes, *self._following):
            if axis is not None and count:
                axis.restart()

    def forecast(self, leads: np.ndarray | None, age: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Mean (L, 4) at leads (L,), s from now, and covariance (L, 4, 4) with the sensor's noise."""
        rows = (self._steps if leads is None else (np.asarray(leads) + age) / self._step) / self._stride
        near = np.minimum(rows, self._furthest)
        # nodes: the level, the row before the newest, the newest
        whole = np.minimum(near.astype(int), self._furthest - 1)
        part = near - whole
        around, weights = whole[:, None] + np.arange(1, 5), cubic_weights(part)
        part, far = part[:, None, None], rows > self._furthest
        mean, covariance = np.full((len(rows), 4), math.nan), np.zeros((len(rows), 4, 4))
        for place, axis in enumerate(self._axes):
            if axis is None or not axis.past:
                continue
            mean[:, place::2] = np.einsum('lw,lwk->lk', weights, axis.mean[around])
            both = (1.0 - part) * axis.covariance[whole + 2] + part * axis.covariance[whole + 3]
            mean[far, place::2], both[far] = axis.mean[0], axis.covariance[0]
            covariance[:, place::2, place::2] = both
        unit = np.array([1.0, 1.0, 1.0 / self._unit, 1.0 / self._unit])
        return mean * unit, covariance * np.outer(unit, unit)
