"""The weighted average of forecasts at each lead by measured errors, with its calibrated spread."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.prediction.axis_filter import CREDIBLE, LATELY
from swath_sysid.attitude.prediction.forecast import MISSES, NORMAL_QUANTILES, Forecast
from swath_sysid.attitude.prediction.hull_state import MEMORY_OF_SIZE
from swath_sysid.common.accelerator import accelerated
from swath_sysid.common.conventions import NEGLIGIBLE

# leads, and `LATELY`, with which time constant errors are forgotten: those at short leads are many
_MEMORY_LEADS = 10.0
# weights go with the mean square error to this power: 3 % less error is nearly twice the weight
_POWER = 12
# s of errors that the candidates' common level, and their own variances, count for: luck in the first decides nothing
_TRUST = 1.6
#: A candidate without a forecast is taken to err as much more (mean square) than the blend: it must prove itself.
UNPROVEN = 1.14
# log variance a s of misses beyond the tenth that a 90 % interval allows: a normal error's coverage settles in 60 s
_TAIL_GAIN = 0.32
# of the time of each lead, over the memory of the variances: what happens more often than that is no surprise, and a
# candidate that is surprised all the time is judged by half of its errors
_MAX_EXCUSED = 0.5
# ahead from which the level counts in full: sooner, it knows nothing of what the present motion tells
_LEVEL_PERIODS = 1.0 / 3.0

_QUANTILE = NORMAL_QUANTILES.item(1)

#: What errors say of one regime says nothing of another: under waves, on a hull on which nothing acts, and before any
#: motion is known.
DRIVEN, FREE, YOUNG = range(3)


class Errors(NamedTuple):
    """What E candidates and their blend were wrong by, at S steps, of A axes; all change in place."""

    mean_square: np.ndarray  #: (E, S, A); running average.
    weights: np.ndarray  #: (E, S, A)
    blended_square: np.ndarray  #: (S, A); running average of the blend's.
    coverage: np.ndarray  #: (S, A); of the 90 % intervals.
    time: np.ndarray  #: (S, A); that ``mean_square`` is an average of.
    excused: np.ndarray  #: (S, A); share of the time.
    spread: np.ndarray  #: (4, 3, S, A); time, ratio, tail and scale of each regime.
    #: (2, S, A); of the newest errors, of free hulls apart, squared over what was expected of them: while a motion
    #: grows, all forecasts are too sure.
    recent: np.ndarray
    scale: np.ndarray  #: (S, A); of the variances, now.
    widened: np.ndarray  #: (S, A); while the newest errors are larger than were expected.


class Kept(NamedTuple):
    """What was forecast at the newest R rows, until it comes true."""

    #: (R, S, A, 5 + E); by step: the blend, its variance, half its interval squared by the scale and as issued, the
    #: size of the motion, and what each candidate forecast.
    issued: np.ndarray
    regime: np.ndarray  #: (R, A)


class Layout(NamedTuple):
    """Of the leads on the rows."""

    steps: np.ndarray  #: (S,); rows ahead.
    place_of_lead: np.ndarray  #: (L,); among the steps.
    of_row: np.ndarray  #: (L,); the sooner a lead is within the first row, the less.
    prior: np.ndarray  #: (E, S)
    keep: np.ndarray  #: (S,); share of an error that is left a row later.
    step: float  #: Periods.


class Row(NamedTuple):
    """A row, and what is forecast at it."""

    mean: np.ndarray  #: (E, S, A)
    variance: np.ndarray  #: (E, S, A)
    reading: np.ndarray  #: (A,)
    noise: np.ndarray  #: (A,); variance.
    foreseeable: np.ndarray  #: (A,); rows.
    size: np.ndarray  #: (A,)
    regime: np.ndarray  #: (A,)
    doubt: float


class Ahead(NamedTuple):
    """What is forecast at the leads."""

    mean: np.ndarray  #: (E, L, M)
    covariance: np.ndarray  #: (E, L, M, M)
    axis_of: np.ndarray  #: (M,)
    noise: np.ndarray  #: (M,); variance.
    least: np.ndarray  #: (M,); variance.
    regime: np.ndarray  #: (A,)


class Blend:
    """Weights (E, S, A) of E candidates and a variance scale (S, A) of A axes, learnt from past errors.

    Leads (L,), s, are scored at ``steps`` (S,), the nearest rows of ``step``, s. ``prior`` weights the candidates where
    errors do not distinguish them: 60 s hold few independent errors at long leads. The ``level`` is the place of one
    that knows nothing of how the motion is now. ``mean_square`` (E, S, A), ``blended_square`` and 90 % ``coverage``
    (S, A) are running averages.
    """

    def __init__(
        self,
        leads: np.ndarray,
        step: float,
        period: float,
        axes: int,
        prior: Sequence[float],
        level: int | None = None,
    ) -> None:
        self._leads = np.asarray(leads)
        whole = np.maximum(np.round(self._leads / step), 1).astype(int)
        self.steps, self.place_of_lead = np.unique(whole, return_inverse=True)
        candidates, steps = len(prior), self.steps.size
        of_row = np.minimum(self._leads / step, 1.0) ** 2
        self._prior, self._level = np.array(prior, dtype=float), level
        self._layout = Layout(
            self.steps, self.place_of_lead, of_row, np.empty((candidates, steps)), np.ones(steps), 1.0
        )
        self._row, self._regime = 0, np.zeros(axes, dtype=int)
        rows = int(self.steps[-1]) + 1
        self._kept = Kept(np.full((rows, steps, axes, 5 + candidates), np.nan), np.zeros((rows, axes), dtype=int))
        shape = steps, axes
        spread = np.ones((4, 3, *shape))
        spread[::2] = 0.0
        self._errors = Errors(
            np.zeros((candidates, *shape)),
            np.zeros((candidates, *shape)),
            np.zeros(shape),
            np.full(shape, 1.0 - MISSES),
            np.zeros(shape),
            np.zeros(shape),
            spread,
            np.ones((2, *shape)),
            np.ones(shape),
            np.ones(shape),
        )
        self.mean_square, self.weights, self.blended_square, self.coverage, *_, self.scale, _ = self._errors
        self.set_period(step, period)
        #: Whether candidates are taken to err by no less than their variance: their past errors do not apply.
        self.is_after_break = False
        #: How many times as large as what they have learnt the candidates' variances are. The newest errors are held
        #: against that: while a motion changes, they tell how much it has.
        self.doubt = 1.0

    def set_period(self, step: float, period: float) -> None:
        """Count memories in a period of the motion; a row is a step, both s."""
        relative = step / period
        memory = np.minimum(LATELY + _MEMORY_LEADS * relative * self.steps, MEMORY_OF_SIZE)
        prior = np.tile(self._prior[:, None], self.steps.size)
        if self._level is not None:
            prior[self._level] *= np.minimum(relative * self.steps / _LEVEL_PERIODS, 1.0) ** 3
        unknown = self._errors.time == 0.0
        self.weights[:, unknown] = (prior / prior.sum(axis=0))[:, unknown.nonzero()[0]]
        self._layout = self._layout._replace(prior=prior, step=relative, keep=1.0 - relative / memory)

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
        self._regime = np.zeros(reading.size, dtype=int) + regime
        of_axes = (np.zeros(reading.size) + each for each in (reading, noise_variance, foreseeable, size))
        ahead = (np.array(each, order='C') for each in (mean, variance))
        row = Row._make((*ahead, *of_axes, self._regime, self.doubt))
        take_row(self._errors, self._kept, self._layout, row, self._row, self.is_after_break)
        self._row += 1

    def carry_over(self, other: 'Blend') -> None:
        """Begin with what another one, of the same leads on other rows, has learnt of the errors."""
        same = other.place_of_lead[np.unique(self.place_of_lead, return_index=True)[1]]
        for name in ('mean_square', 'weights', 'time', 'excused', 'blended_square', 'coverage', 'spread'):
            getattr(self._errors, name)[:] = getattr(other._errors, name)[..., same, :]
        self._errors.scale[:] = self._errors.widened[:] = self._errors.spread[3, 0]

    def renew(self, candidate: int, axis: int | slice, among: Sequence[int]) -> None:
        """Reset the errors of a candidate that has a new model, for an axis or all, to those of an untried one.

        It may then be nearly as good as the best of those ``among`` which it belongs.
        """
        square = self.mean_square[..., axis]
        square[candidate] = np.minimum(square[candidate], UNPROVEN * square[among].min(axis=0))

    def skip(self, count: int) -> None:
        """Pass over ``count`` rows without readings or forecasts."""
        for _ in range(min(count, len(self._kept.issued))):
            self._kept.issued[self._row % len(self._kept.issued)] = np.nan
            self._row += 1
        self._row += max(count - len(self._kept.issued), 0)

    def combine(
        self,
        stamp_ns: int,
        mean: np.ndarray,
        covariance: np.ndarray,
        axis_of: Sequence[int],
        noise_variance: float | np.ndarray = 0.0,
        least_variance: float | np.ndarray = 0.0,
    ) -> Forecast:
        """Weighted average of the true motion at the first L leads, from the candidates' forecasts of this stamp.

        The candidates' means (E, L, M) and covariances (E, L, M, M) are of the true motion, NaN without a forecast;
        ``axis_of`` is each target's axis, the angles come first; no variance is less than ``least_variance``. Within
        the first row the errors are not known: the sooner, the more the first candidate counts, which follows every
        sample.
        """
        of_targets = (np.zeros(mean.shape[2]) + each for each in (noise_variance, least_variance))
        given = (np.array(each, order='C') for each in (mean, covariance, axis_of))
        ahead = Ahead._make((*given, *of_targets, self._regime))
        blended, spread, deviation = combined(self._errors, self._layout, ahead, self.is_after_break)
        return Forecast(stamp_ns, self._leads[: mean.shape[1]], blended, spread, own_deviation=deviation)


@accelerated
def take_row(errors: Errors, kept: Kept, layout: Layout, row: Row, number: int, is_after_break: bool) -> None:
    """As `Blend.take`, of the row of this number."""
    rows, (candidates, steps, axes) = len(kept.issued), row.mean.shape
    is_any_known = False
    for place in range(steps):
        then = (number - layout.steps[place]) % rows
        for axis in range(axes):
            past, regime = kept.issued[then, place, axis], kept.regime[then, axis]
            if learn(errors, layout, row, past, (regime, place, axis)):
                is_any_known = True
    now = number % rows
    weights, square = np.empty(candidates), np.empty(candidates)
    for axis in range(axes):
        kept.regime[now, axis] = regime = row.regime[axis]
        for place in range(steps):
            mean, variances = row.mean[:, place, axis], row.variance[:, place, axis]
            time, prior, noise = errors.time[place, axis], layout.prior[:, place], row.noise[axis]
            recall(errors.mean_square, errors.weights, place, axis, square, weights)
            if is_any_known:
                error_weights(square, time, prior, weights)
                for candidate in range(candidates):
                    errors.weights[candidate, place, axis] = weights[candidate]
            errors.scale[place, axis] = scale = errors.spread[3, regime, place, axis]
            errors.widened[place, axis] = widened = scale * max(errors.recent[int(regime == FREE), place, axis], 1.0)
            if is_after_break:
                no_less(square, variances, noise)
                error_weights(square, time, prior, weights)
            leave_out(weights, mean)
            issued, variance = kept.issued[now, place, axis], weighted(weights, variances)
            issued[0], issued[1] = weighted(weights, mean), variance
            issued[2] = _QUANTILE**2 * (scale * variance / row.doubt + noise)
            issued[3] = _QUANTILE**2 * (widened * variance + noise)
            issued[4] = row.size[axis]
            for candidate in range(candidates):
                issued[5 + candidate] = mean[candidate]


@accelerated
def recall(known: np.ndarray, used: np.ndarray, place: int, axis: int, square: np.ndarray, weights: np.ndarray) -> None:
    """Copy mean square errors (E,) and weights (E,) of a place and axis."""
    for candidate in range(len(square)):
        square[candidate], weights[candidate] = known[candidate, place, axis], used[candidate, place, axis]


@accelerated
def learn(errors: Errors, layout: Layout, row: Row, past: np.ndarray, at: tuple[int, int, int]) -> bool:
    """Learn from a row what was forecast for it (5 + E,), in a regime at a place and axis; whether that is known."""
    regime, place, axis = at
    step, size, interval = layout.step, row.size[axis], past[3]
    blended = row.reading[axis] - past[0]
    square, is_known = blended * blended, math.isfinite(blended)
    is_judged = is_known and math.isfinite(interval)
    if is_judged:
        gain = step / (MEMORY_OF_SIZE + step)
        errors.blended_square[place, axis] += gain * (square - errors.blended_square[place, axis])
        errors.coverage[place, axis] += gain * ((square <= interval) - errors.coverage[place, axis])
    excused = errors.excused[place, axis]
    is_excused = layout.steps[place] > row.foreseeable[axis] and excused < _MAX_EXCUSED
    errors.excused[place, axis] += step / MEMORY_OF_SIZE * (is_excused - excused)
    if is_excused or not is_known:
        return False
    growth = 1.0
    if is_judged:
        surprise = min(_QUANTILE**2 * square / past[2], CREDIBLE)
        # over a period
        recent = errors.recent[int(regime == FREE), place, axis]
        errors.recent[int(regime == FREE), place, axis] += step / (1.0 + step) * (surprise - recent)
        # waves that grow may double within a lead
        growth = max(0.5 * size / past[4], 1.0) ** 2
    errors.time[place, axis] = time = layout.keep[place] * errors.time[place, axis] + step
    for candidate in range(len(errors.mean_square)):
        error = row.reading[axis] - past[5 + candidate]
        own = error * error if math.isfinite(error) else UNPROVEN * square
        before = errors.mean_square[candidate, place, axis]
        errors.mean_square[candidate, place, axis] += step / max(time, 1e-12) * (own - before)
    follow_spread(errors.spread[:, regime, place, axis], square, past, row.noise[axis], (growth, step))
    return True


@accelerated
def follow_spread(spread: np.ndarray, square: float, past: np.ndarray, noise: float, pace: tuple[float, float]) -> None:
    """Learn time, ratio, tail and scale (4,) from a squared error, while the motion has grown, at a step."""
    growth, step = pace
    variance, interval = past[1], past[3]
    # errors that are the sensor's noise for the most part say as little of the rest as their scatter has it
    shown = (variance / (variance + noise)) ** 2
    time = (1.0 - step / MEMORY_OF_SIZE) * spread[0] + shown * step
    # ratio by ratio: a mean of variances would keep the largest for minutes
    credible = CREDIBLE * max(variance + noise, interval / _QUANTILE**2)
    ratio = (min(square, credible) - noise) / (growth * variance)
    mean_ratio = spread[1] + shown * step / max(time, 1e-12) * (ratio - spread[1])
    # with wide tails the mean square is more than the 90 % interval needs
    tail = spread[2] + _TAIL_GAIN * step * shown * ((square > interval) - MISSES)
    scale = math.exp(tail) * (_TRUST + time * max(mean_ratio, NEGLIGIBLE)) / (_TRUST + time)
    spread[0], spread[1], spread[2], spread[3] = time, mean_ratio, tail, scale


@accelerated
def error_weights(mean_square: np.ndarray, time: float, prior: np.ndarray, weights: np.ndarray) -> None:
    """Weights (E,) from mean square errors (E,), drawn to their geometric mean with few seconds of experience.

    ``prior`` (E,) are the weights at equal errors.
    """
    log = 0.0
    for square in mean_square:
        log += math.log(max(square, 1e-300))
    common, least, total = math.exp(log / len(mean_square)), math.inf, 0.0
    for place in range(len(mean_square)):
        drawn = (time * max(mean_square[place], 1e-300) / common + _TRUST) / (time + _TRUST)
        weights[place], least = drawn, min(least, drawn)
    for place in range(len(mean_square)):
        weights[place] = prior[place] * (least / weights[place]) ** _POWER
        total += weights[place]
    for place in range(len(mean_square)):
        weights[place] /= total


@accelerated
def no_less(square: np.ndarray, variance: np.ndarray, noise: float) -> None:
    """Raise square errors (E,) to the variances (E,) that the candidates claim."""
    for place in range(len(square)):
        claimed = variance[place] + noise
        square[place] = max(square[place], claimed if math.isfinite(claimed) else 0.0)


@accelerated
def leave_out(weights: np.ndarray, forecast: np.ndarray) -> None:
    """Let those without a forecast (E,) have no weight (E,), and the others all of it."""
    total = 0.0
    for place in range(len(weights)):
        weights[place] = max(weights[place], 1e-12) if math.isfinite(forecast[place]) else 0.0
        total += weights[place]
    for place in range(len(weights)):
        weights[place] /= max(total, 1e-12)


@accelerated
def weighted(weights: np.ndarray, values: np.ndarray) -> float:
    """Weighted sum; NaN where all weights are zero."""
    total, is_there = 0.0, False
    for place in range(len(weights)):
        if weights[place] > 0.0:
            total, is_there = total + weights[place] * values[place], True
    return total if is_there else math.nan


@accelerated
def combined(
    errors: Errors, layout: Layout, ahead: Ahead, is_after_break: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (L, M), covariance (L, M, M) and deviation before calibration (L, M), as of `Blend.combine`."""
    candidates, leads, targets = ahead.mean.shape
    mean, own, covariance = np.empty((leads, targets)), np.empty((leads, targets)), np.empty((leads, targets, targets))
    weights, factor = np.empty((targets, candidates)), np.empty(targets)
    square, pair = np.empty(candidates), np.empty(candidates)
    for lead in range(leads):
        place, of_row = layout.place_of_lead[lead], layout.of_row[lead]
        for target in range(targets):
            axis, of_target = ahead.axis_of[target], weights[target]
            scale = errors.widened[place, axis]
            recall(errors.mean_square, errors.weights, place, axis, square, of_target)
            if is_after_break:
                no_less(square, ahead.covariance[:, lead, axis, axis], ahead.noise[axis])
                error_weights(square, errors.time[place, axis], layout.prior[:, place], of_target)
            # no surer than the candidates are, before errors of this motion are known
            if is_after_break or ahead.regime[axis] == YOUNG:
                scale = max(scale, 1.0)
            if of_row < 1.0:
                for candidate in range(candidates):
                    of_target[candidate] *= of_row
                of_target[0] += 1.0 - of_row
                scale = scale**of_row
            leave_out(of_target, ahead.mean[:, lead, target])
            mean[lead, target] = weighted(of_target, ahead.mean[:, lead, target])
            variance = weighted(of_target, ahead.covariance[:, lead, target, target])
            own[lead, target] = math.sqrt(variance + ahead.noise[target])
            factor[target] = math.sqrt(max(scale * variance, ahead.least[target]) / variance)
        for one in range(targets):
            for other in range(one + 1):
                for candidate in range(candidates):
                    pair[candidate] = math.sqrt(weights[one, candidate] * weights[other, candidate])
                both = weighted(pair, ahead.covariance[:, lead, one, other])
                if both != both and factor[one] == factor[one] and factor[other] == factor[other]:
                    both = 0.0  # targets that no candidate forecasts together are independent
                covariance[lead, one, other] = covariance[lead, other, one] = both * factor[one] * factor[other]
    return mean, covariance, own
