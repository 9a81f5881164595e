"""A forecast from the second sample on: a library of seas, each a Gaussian process in units of the motion's period.

A member is a spectrum of the angle, the level about which it varies, and white noise of angle and rate. Members are
weighted by the likelihood of the rows so far, with the size of the motion integrated out.
"""

import math
from collections import deque
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import LEAST_SIZE
from swath_sysid.attitude.prediction.rows import ROWS_A_PERIOD
from swath_sysid.attitude.prediction.state_space import cubic_weights
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

TEMPER = 0.3  #: Of the logarithm of a likelihood: no sea is quite like any member.

#: Rows ahead, of the library's own, after which a forecast is the level; a member of less relative weight is dropped.
FURTHEST, LEAST_WEIGHT = 28, 1e-3

#: Of the library's rows in a period: the nearest whole power of this ratio is near enough.
_SAME_PERIOD = 1.2


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


class Predictors(NamedTuple):
    """What M members forecast from readings, newest first: the angle or, in turn, angle and rate.

    Rates are in units of the angle, times the period over 2 pi. T values ahead are angle and rate at each node: the
    level, the row before the newest, the newest, and those ahead.
    """

    own: np.ndarray  #: (M, 2); variances of angle and rate, without noise.
    noise: np.ndarray  #: (M, 2); of theirs.
    #: (N, M, N + T); [L^-1 | L^-1 cov(readings, values ahead)] with L L' = cov(readings): of any number of readings.
    white: np.ndarray


@lru_cache(maxsize=2)
def predictors(rows: float, rated: bool) -> Predictors:
    """Of readings at so many rows a period, by Gram and Schmidt."""
    sea, kinds = seas(), 1 + rated
    readings, nodes = MAX_LAGS, FURTHEST + 3
    phase = 2.0 * np.pi / rows * np.arange(-1, readings // kinds + nodes)[:, None] * sea.frequency
    of_angle, of_rate = sea.power.T, (sea.frequency * sea.power).T
    crossed = np.sin(phase) @ of_rate
    rates = np.cos(phase) @ (sea.frequency[:, None] * of_rate)
    # by the kinds of a reading and of a later value, member, and rows between them plus one
    covariance = np.array([[np.cos(phase) @ of_angle + sea.level, -crossed], [crossed, rates]]).transpose(0, 1, 3, 2)
    own = np.stack([1.0 + sea.level, rates[1]], axis=1)
    noise = sea.noise * np.stack([np.ones_like(rates[1]), rates[1]], axis=1)
    white = np.zeros((readings, MEMBERS, readings + 2 * (1 + nodes)))
    lags, kind = np.divmod(np.arange(readings), kinds)
    for i, (lag, of) in enumerate(zip(lags, kind, strict=True)):
        row = white[i]
        row[:, i] = 1.0
        row[:, readings] = sea.level if of == 0 else 0.0
        row[:, readings + 2 :] = covariance[of, :, :, lag : lag + nodes].transpose(1, 2, 0).reshape(MEMBERS, -1)
        factor = np.einsum('imj,jm->im', white[:i, :, :i], covariance[of, kind[:i], :, lag - lags[:i] + 1])
        row -= np.einsum('im,imt->mt', factor, white[:i])
        row /= np.sqrt(own[:, of] + noise[:, of] - (factor**2).sum(axis=0))[:, None]
    return Predictors(own, noise, white)


class AxisSeas:
    """The library on the rows of one axis, of which it takes every so many: forecasts at the first ``nodes``."""

    def __init__(self, rows: float, stride: int, nodes: int, rated: bool) -> None:
        self.kinds, self._stride, self._nodes = 1 + rated, stride, nodes
        self._own, noise, self._white = predictors(rows, rated)
        self._variance = self._own + noise
        self._log = np.zeros(len(self._own))
        self._square = np.full(len(self._log), LEAST_SIZE**2)
        self._count = 2.0  # two readings at rest, which say nothing
        self.restart()

    def restart(self) -> None:
        """Forget the rows, not what they have shown."""
        self.past: deque[float] = deque(maxlen=MAX_LAGS * self._stride)
        first = self._variance[:, : self.kinds, None] * np.eye(self.kinds)
        self._issued = deque([(np.zeros(first.shape[:2]), first)] * self._stride)
        self._moments = np.repeat(self._variance.T[:, :, None], self._nodes, axis=2)
        self._moments = np.stack([self._moments[0], 0.0 * self._moments[0], self._moments[1]], axis=-1)
        self._known = 0

    def step(self, reading: list[float]) -> None:
        """Take the next reading (1,) or (2,)."""
        mean, covariance = self._issued.popleft()
        error = reading - mean
        scaled = np.linalg.solve(covariance, error[..., None])[..., 0]
        self._square += (error * scaled).sum(axis=1) / self._stride
        self._log -= 0.5 * np.linalg.slogdet(covariance)[1] / self._stride
        self._count += self.kinds / self._stride
        self.past.extendleft(reversed(reading))
        self._forecast()

    def _forecast(self):
        """Of every member, and of all of them."""
        kinds, stride = self.kinds, self._stride
        lags = -(-len(self.past) // (kinds * stride))
        readings = np.reshape(self.past, (-1, kinds))[::stride].ravel()
        ahead = self._white[: readings.size, :, MAX_LAGS : MAX_LAGS + 2 * self._nodes]
        ahead = ahead.reshape(readings.size, -1, self._nodes, 2)
        while self._known < readings.size:
            z = ahead[self._known]
            self._moments -= np.stack([z[..., 0] ** 2, z[..., 0] * z[..., 1], z[..., 1] ** 2], axis=-1)
            self._known += 1
        innovations = self._white[: readings.size, :, : readings.size] @ readings
        mean = np.einsum('im,imtk->mtk', innovations, ahead)
        both = self._moments[:, 3][:, [[0, 1], [1, 2]]]
        self._issued.append((mean[:, 3, :kinds], both[:, :kinds, :kinds]))
        size = self._square / self._count
        score = TEMPER * (self._log - 0.5 * self._count * np.log(size))
        weight = np.exp(score - score.max())
        keep = weight > LEAST_WEIGHT
        weight = weight / weight.sum()
        self.mean = np.tensordot(weight, mean, 1)
        apart = mean - self.mean
        self.covariance = np.tensordot(weight * size, self._moments, 1)[:, [[0, 1], [1, 2]]]
        self.covariance += np.einsum('m,mtp,mtq->tpq', weight, apart, apart)
        if 2 * keep.sum() < keep.size:
            self._own, self._variance, self._log, self._square, self._moments = (
                values[keep] for values in (self._own, self._variance, self._log, self._square, self._moments)
            )
            self._white = self._white[:, keep]
            self._issued = deque([(mean[keep], covariance[keep]) for mean, covariance in self._issued])


class SeaLibrary:
    """The library on the rows of every axis, as an `InnovationsFilter` of all `ATTITUDE`."""

    def __init__(self, steps: np.ndarray, step: float, period: float, horizon: float) -> None:
        self.strain = 1.0
        rows = period / step
        self._stride = max(1, round(2.0 * rows / ROWS_A_PERIOD))
        self._rows = _SAME_PERIOD ** round(math.log(rows / self._stride, _SAME_PERIOD))
        self._unit = self._rows * self._stride * step / (2.0 * math.pi)
        self._steps, self._step = np.asarray(steps, dtype=float), step
        self._furthest = min(math.ceil(horizon / step / self._stride), FURTHEST)
        self._axes: list[AxisSeas | None] = [None] * len(AXES)

    def step(self, row: np.ndarray) -> None:
        """Update with the next row (width,), NaN where missing."""
        for place in range(len(AXES)):
            angle, rate = row.item(place), row.item(place + len(AXES)) * self._unit
            axis, rated = self._axes[place], rate == rate
            if angle != angle:
                if axis is not None:
                    axis.restart()
                continue
            if axis is None or axis.kinds != 1 + rated:
                axis = self._axes[place] = AxisSeas(self._rows, self._stride, self._furthest + 4, rated)
            axis.step([angle, rate] if rated else [angle])

    def skip(self, count: int) -> None:
        """Step over ``count`` missing rows."""
        for axis in self._axes:
            if axis is not None and count:
                axis.restart()

    def forecast(self, leads: np.ndarray | None, age: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Mean (L, 4) at leads (L,), s from now, and covariance (L, 4, 4) with the sensor's noise."""
        rows = (self._steps if leads is None else (np.asarray(leads) + age) / self._step) / self._stride
        far = rows > self._furthest
        # nodes: the level, the row before the newest, the newest
        place = np.minimum(rows, self._furthest) + 2.0
        whole = np.minimum(place.astype(int), self._furthest + 1)
        part = place - whole
        around, weights = whole[:, None] + np.arange(-1, 3), cubic_weights(part)
        part = part[:, None, None]
        around[far], weights[far] = 0, 0.25
        mean, covariance = np.full((len(rows), 4), np.nan), np.zeros((len(rows), 4, 4))
        for place, axis in enumerate(self._axes):
            if axis is None or not axis.past:
                continue
            mean[:, place::2] = np.einsum('lw,lwk->lk', weights, axis.mean[around])
            both = (1.0 - part) * axis.covariance[whole] + part * axis.covariance[whole + 1]
            both[far] = axis.covariance[0]
            covariance[:, place::2, place::2] = both
        scale = np.array([1.0, 1.0, 1.0 / self._unit, 1.0 / self._unit])
        return mean * scale, covariance * np.outer(scale, scale)
