"""The weighted average of forecasts at each lead by measured errors, with its calibrated spread."""

from collections.abc import Sequence

import numpy as np

from swath_sysid.attitude.prediction.axis_filter import CREDIBLE, MEMORY_OF_SIZE
from swath_sysid.attitude.prediction.forecast import MISSES, NORMAL_QUANTILES, Forecast

# s, and as many leads; errors are forgotten with this time constant: those at short leads are many
_MEMORY, _MEMORY_LEADS = 4.7, 10.0
# weights go with the mean square error to this power: 3 % less error is nearly twice the weight
_POWER = 12.0
# s of errors that the candidates' common level, and their own variances, count for: luck in the first decides nothing
_TRUST = 1.6
#: A candidate without a forecast is taken to err as much more (mean square) than the blend: it must prove itself.
UNPROVEN = 1.14
# log variance a s of misses beyond the tenth that a 90 % interval allows: a normal error's coverage settles in 60 s
_TAIL_GAIN = 0.32
#: The variance of the candidates is at least this share of what they claim.
MIN_SHARE = 1e-3
# of the time of each lead, over the memory of the variances: what happens more often than that is no surprise, and a
# candidate that is surprised all the time is judged by half of its errors
_MAX_EXCUSED = 0.5

_QUANTILE = NORMAL_QUANTILES.item(1)

#: What errors say of one regime says nothing of another: under waves, on a hull on which nothing acts, and before any
#: motion is known.
DRIVEN, FREE, YOUNG = range(3)


class Blend:
    """Weights (E, S, A) of E candidates and a variance scale (S, A) of A axes, learnt from past errors.

    Leads (L,), s, are scored at ``steps`` (S,), the nearest rows of ``step``, s. ``prior`` weights the candidates where
    errors do not distinguish them: 60 s hold few independent errors at long leads. ``mean_square`` (E, S, A),
    ``blended_square`` and 90 % ``coverage`` (S, A) are running averages.
    """

    def __init__(self, leads: np.ndarray, step: float, period: float, axes: int, prior: Sequence[float]) -> None:
        self._leads = np.asarray(leads)
        whole = np.maximum(np.round(self._leads / step), 1).astype(int)
        self.steps, self.place_of_lead = np.unique(whole, return_inverse=True)
        self._of_row = np.minimum(self._leads / step, 1.0)[:, None] ** 2
        self._prior = np.asarray(prior, dtype=float)[:, None, None]
        candidates, steps = self._prior.shape[0], self.steps.size
        self._places, self._axes = np.arange(steps), np.arange(axes)
        self.set_period(step, period)
        self._row = 0
        # of each row, by step: the blend, its variance, half its interval squared by the scale and as issued, the
        # size of the motion, and what each candidate forecast
        rows = int(self.steps[-1]) + 1
        self._issued = np.full((rows, 5 + candidates, steps, axes), np.nan)
        self.mean_square = np.zeros((candidates, steps, axes))
        self._time = np.zeros((steps, axes))
        self._excused = np.zeros((steps, axes))
        self._regime = np.zeros((rows, axes), dtype=int)
        self._is_young = np.zeros(axes, dtype=bool)
        # time, ratio, tail and scale of each regime
        self._spread = np.ones((4, 3, steps, axes))
        self._spread[::2] = 0.0
        self.scale = self._widened = self._spread[3, 0]
        # of the newest errors, squared over what was expected of them: while a motion grows, all forecasts are too sure
        self._recent = np.ones((3, steps, axes))
        self.blended_square = np.zeros((steps, axes))
        self.coverage = np.full((steps, axes), 1.0 - MISSES)
        self.weights = np.broadcast_to(self._prior / self._prior.sum(), self.mean_square.shape)
        #: Whether candidates are taken to err by no less than their variance: their past errors do not apply.
        self.is_after_break = False

    def set_period(self, step: float, period: float) -> None:
        """Count memories in a period of the motion; a row is a step, both s."""
        self._step = step / period
        memory = np.minimum(_MEMORY + _MEMORY_LEADS * self._step * self.steps, MEMORY_OF_SIZE)
        self._keep = (1.0 - self._step / memory)[:, None]

    def take(
        self,
        reading: np.ndarray,
        mean: np.ndarray,
        variance: np.ndarray,
        noise_variance: float | np.ndarray = 0.0,
        foreseeable: np.ndarray | float = np.inf,
        regime: np.ndarray | int = DRIVEN,
        size: np.ndarray | float = 1.0,
    ) -> None:
        """Score the forecasts that this row's angles (A,), NaN where missing, make known, and keep those issued at it.

        Mean and variance (E, S, A), of the true angle, are NaN without a forecast; readings have the noise on top.
        ``foreseeable`` (A,) counts rows since an unforeseen moment acted: errors of earlier forecasts are not used
        unless that happens all the time. ``regime`` (A,) is that of each axis. ``size`` (A,) is that of the motion now:
        what an error says of the next ones is relative to it, where the motion has grown.
        """
        rows = self._issued.shape[0]
        then, now = (self._row - self.steps) % rows, self._row % rows
        average, of_average, usual, interval, size_then, *means = self._issued[then, :, self._places].transpose(1, 0, 2)
        errors, blended = reading - means, reading - average
        judged = np.isfinite(blended) & np.isfinite(interval)
        gain = self._step / (MEMORY_OF_SIZE + self._step) * judged
        square = np.where(judged, blended, 0.0) ** 2
        self.blended_square += gain * (square - self.blended_square)
        self.coverage += gain * ((square <= interval) - self.coverage)
        excused = (self.steps[:, None] > foreseeable) & (self._excused < _MAX_EXCUSED)
        self._excused += self._step / MEMORY_OF_SIZE * (excused - self._excused)
        blended[excused] = np.nan
        judged &= ~excused
        then_in = self._regime[then], self._places[:, None], self._axes
        surprise = _QUANTILE**2 * np.where(judged, blended, 0.0) ** 2 / np.where(judged, usual, 1.0)
        # over a period
        surprise = np.minimum(surprise, CREDIBLE)
        self._recent[then_in] += self._step / (1.0 + self._step) * judged * (surprise - self._recent[then_in])
        # waves that grow may double within a lead
        growth = np.maximum(0.5 * size / np.where(judged, size_then, size), 1.0) ** 2
        self._learn(errors, blended, of_average, interval, noise_variance, then_in, growth)
        self._regime[now], self._is_young = regime, np.broadcast_to(regime == YOUNG, self._is_young.shape)
        now_in = self._regime[now], self._places[:, None], self._axes
        self.scale = self._spread[(3, *now_in)]
        # while the newest errors are larger than were expected
        self._widened = self.scale * np.maximum(self._recent[now_in], 1.0)
        own = self._weights(self._places, self._axes, variance + noise_variance)
        weights = present_weights(own, np.isfinite(mean))
        variance = _weighted(weights, variance)
        usual, issued = (_QUANTILE**2 * (scale * variance + noise_variance) for scale in (self.scale, self._widened))
        sizes = np.broadcast_to(size, variance.shape)
        self._issued[now] = [_weighted(weights, mean), variance, usual, issued, sizes, *mean]
        self._row += 1

    def carry_over(self, other: 'Blend') -> None:
        """Begin with what another one, of the same leads on other rows, has learnt of the errors."""
        same = other.place_of_lead[np.unique(self.place_of_lead, return_index=True)[1]]
        self.mean_square, self.weights = other.mean_square[:, same].copy(), other.weights[:, same]
        self._spread = other._spread[:, :, same].copy()
        for name in ('_time', '_excused', 'blended_square', 'coverage'):
            setattr(self, name, getattr(other, name)[same].copy())
        self.scale = self._widened = self._spread[3, 0]

    def renew(self, candidate: int, axis: int | slice, among: Sequence[int]) -> None:
        """Reset the errors of a candidate that has a new model, for an axis or all, to those of an untried one.

        It may then be nearly as good as the best of those ``among`` which it belongs.
        """
        square = self.mean_square[..., axis]
        square[candidate] = np.minimum(square[candidate], UNPROVEN * square[among].min(axis=0))

    def skip(self, count: int) -> None:
        """Pass over ``count`` rows without readings or forecasts."""
        for _ in range(min(count, self._issued.shape[0])):
            now = self._row % self._issued.shape[0]
            self._issued[now] = np.nan
            self._row += 1
        self._row += max(count - self._issued.shape[0], 0)

    def _learn(
        self,
        errors: np.ndarray,
        blended: np.ndarray,
        variance: np.ndarray,
        interval: np.ndarray,
        noise_variance: float | np.ndarray,
        then_in: tuple,
        growth: np.ndarray,
    ):
        known = np.isfinite(blended)
        if not known.any():
            return
        square = blended**2
        self._time, gain = self._aged(self._time, known, self._keep, self._step)
        squares = np.where(np.isfinite(errors), errors**2, UNPROVEN * square)
        self.mean_square += gain * np.where(known, squares - self.mean_square, 0.0)
        # errors that are the sensor's noise for the most part say as little of the rest as their scatter has it
        shown = (variance / (variance + noise_variance)) ** 2
        time, mean_ratio, tail, _ = self._spread[(slice(None), *then_in)]
        time, gain = self._aged(time, known, 1.0 - self._step / MEMORY_OF_SIZE, shown * self._step)
        # ratio by ratio: a mean of variances would keep the largest for minutes
        credible = CREDIBLE * np.maximum(variance + noise_variance, interval / _QUANTILE**2)
        ratio = (np.minimum(square, credible) - noise_variance) / (growth * variance)
        mean_ratio += gain * np.where(known, ratio - mean_ratio, 0.0)
        # with wide tails the mean square is more than the 90 % interval needs
        # a new array: of a view np.exp may take another path, by where its result happens to lie in memory
        tail = tail + _TAIL_GAIN * self._step * np.where(known, shown * ((square > interval) - MISSES), 0.0)
        scale = np.exp(tail) * (_TRUST + time * np.maximum(mean_ratio, MIN_SHARE)) / (_TRUST + time)
        self._spread[(slice(None), *then_in)] = time, mean_ratio, tail, scale
        self.weights = error_weights(self.mean_square, self._time, self._prior)

    def _weights(self, steps: np.ndarray, axes: np.ndarray, variance: np.ndarray) -> np.ndarray:
        """Weights (E, L, M) at steps (L,) for targets of axes (M,), of which the candidates claim a variance."""
        if self.is_after_break:
            square = np.maximum(self.mean_square[:, steps], np.nan_to_num(variance[..., : self._axes.size]))
            return error_weights(square, self._time[steps], self._prior)[..., np.ravel(axes)]
        return self.weights[:, steps[:, None], np.atleast_2d(axes)]

    @staticmethod
    def _aged(time: np.ndarray, known: np.ndarray, keep: float | np.ndarray, added: float | np.ndarray) -> tuple:
        """Time that an average covers after one more row, and the weight of that row."""
        time = np.where(known, keep * time + added, time)
        return time, np.where(known, added / np.maximum(time, 1e-12), 0.0)

    def combine(
        self,
        stamp_ns: int,
        mean: np.ndarray,
        covariance: np.ndarray,
        axis_of: Sequence[int],
        noise_variance: float | np.ndarray = 0.0,
        least_variance: float | np.ndarray = 0.0,
    ) -> Forecast:
        """Weighted average of the true motion at the leads, from the candidates' forecasts issued at this stamp.

        The candidates' means (E, L, M) and covariances (E, L, M, M) are of the true motion, NaN without a forecast;
        ``axis_of`` is each target's axis, the angles come first; no variance is less than ``least_variance``. Within
        the first row the errors are not known: the sooner, the more the first candidate counts, which follows every
        sample.
        """
        places = self.place_of_lead[:, None], np.asarray(axis_of)[None]
        claimed = np.diagonal(covariance, axis1=2, axis2=3) + noise_variance
        weights, scale = self._weights(self.place_of_lead, places[1], claimed), self._widened[places]
        # no surer than the candidates are, before errors of this motion are known
        scale = np.where(self._is_young[places[1]] | self.is_after_break, np.maximum(scale, 1.0), scale)
        if self._of_row[0] < 1.0:
            weights = self._of_row * weights
            weights[0] += 1.0 - self._of_row
            scale = scale**self._of_row
        weights = present_weights(weights, np.isfinite(mean))
        root = np.sqrt(weights)
        blended = _weighted(root[..., :, None] * root[..., None, :], covariance)
        variance = np.diagonal(blended, axis1=1, axis2=2)
        # targets that no candidate forecasts together are independent
        blended = np.where(np.isnan(blended) & np.isfinite(variance[:, :, None] + variance[:, None, :]), 0.0, blended)
        factor = np.sqrt(np.maximum(scale * variance, least_variance) / variance)
        covariance = blended * factor[:, :, None] * factor[:, None, :]
        own = np.sqrt(variance + noise_variance)
        return Forecast(stamp_ns, self._leads, _weighted(weights, mean), covariance, own_deviation=own)


def error_weights(mean_square: np.ndarray, time: np.ndarray, prior: np.ndarray) -> np.ndarray:
    """Weights (E, S, A) from mean square errors, drawn to their geometric mean with few seconds of experience (S, A).

    ``prior`` (E, 1, 1) are the weights at equal errors.
    """
    square = np.maximum(mean_square, 1e-300)
    common = np.exp(np.log(square).sum(axis=0) / len(square))
    drawn = (time * square / common + _TRUST) / (time + _TRUST)
    weights = prior * (drawn.min(axis=0) / drawn) ** _POWER
    return weights / weights.sum(axis=0)


def present_weights(weights: np.ndarray, present: np.ndarray) -> np.ndarray:
    """Weights (E, ...) of the present candidates, zero for the others, normalised over the first dimension."""
    weights = np.maximum(weights, 1e-12) * present
    return weights / np.maximum(weights.sum(axis=0), 1e-12)


def _weighted(weights: np.ndarray, values: np.ndarray):
    """Weighted sum over the first dimension; NaN where all weights are zero."""
    are_there = weights > 0.0
    total = np.where(are_there, weights * values, 0.0).sum(axis=0)
    return np.where(are_there.any(axis=0), total, np.nan)
