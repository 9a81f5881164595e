"""One pool of candidates by predictive likelihood: whom to believe, and how wide, at each lead and axis.

At a lead of h rows candidate i forecasts N(m_i, k_i v_i): v_i is the variance that it claims, k_i what its claims have
been worth. The reading y has a noise of variance r.

    density    p_i: Student's t of y about m_i with scale^2 k_i v_i + r: an outlier costs its logarithm
    score      L_i <- (1 - f) L_i + (log p_i - log sum_j w_j p_j)/h: errors h rows ahead are correlated over h rows
    newest     N_i <- (1 - g) N_i + (log p_i - log sum_j w_j p_j) at the shortest lead: what has just been contradicted
    weight     w_i ~ prior_i exp(TEMPER L_i + NEWEST N_i) (k_i v_i + r)^-(PEAK + ROW_PEAK/h)/2: what a claim promises
    worth      k_i <- k_i + (z_i - k_i)/n_i, z_i the squared error without noise over v_i
    change     s <- s/(1 + o), L_i <- L_i/(1 + o), o the odds that the motion has changed: CHANGES step/h to one, times
               the density of the pool's error were it CHANGED times as large over that as it is; what is learnt from
               an error counts s now over s when it was forecast: the motion is as probably still that of then
    total      m = sum w m_i,  V = sum w k_i v_i + sum w (m_i - m)^2: disagreement is doubt (law of total variance)
    conformal  c <- c + GAIN step (miss - MISSES) (Gibbs and Candes 2021); issued: V exp(c) max(q, 1), q the newest
               squared errors over V exp(c)

A candidate that has no forecast neither gains nor loses, and is not held to what it forecast before it fell silent.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.prediction.axis_filter import CREDIBLE, LATELY
from swath_sysid.attitude.prediction.forecast import MISSES, NORMAL_QUANTILES, Forecast
from swath_sysid.attitude.prediction.memories import LEAST_SIZE, MEMORY_OF_SIZE
from swath_sysid.common.accelerator import accelerated
from swath_sysid.common.conventions import NEGLIGIBLE

#: Leads, beside `LATELY` periods, over which scores are remembered: errors at short leads are many.
MEMORY_LEADS = 10.0
FREEDOM = 6.0  #: Degrees of freedom of the density.
TEMPER = 0.8  #: Power of the likelihood: candidates are none of them true, and their errors are not independent.
NEWEST, NEWEST_MEMORY = 0.3, 0.3  #: Share of the shortest lead's newest log ratios, and periods that they last.
#: Powers of the density that a candidate claims for its mean: at every lead, and over the rows of the lead.
PEAK, ROW_PEAK = 1.0, 2.0
LEAST_WORTH = 0.5  #: Claims that were too wide are believed to this much.
FIRST_ERRORS = 8.0  #: Independent errors that a claim counts for before it is tried.
UNTRIED = 1.0  #: Log score that a candidate with a new model may lie behind the best.
CHANGES, CHANGED = 0.01, 10.0  #: Of the motion, a period, and how many times larger the errors are then.
GAIN = 0.32  #: Log variance a period of misses: coverage settles in a minute or so.
LEAST_FACTOR, LARGEST_FACTOR = -0.7, 3.0  #: Log; of the conformal factor.

_SQUARE_QUANTILE = NORMAL_QUANTILES.item(1) ** 2  # of the 90 % interval
_LEAST_VARIANCE = NEGLIGIBLE * LEAST_SIZE**2
_TINY = 1e-300


class PoolState(NamedTuple):
    """What is known of E candidates at S steps of A axes, and what was forecast at the newest R rows.

    The arrays change in place, by the functions of `Pool` alone.
    """

    row: int  #: Number of rows so far.
    same: np.ndarray  #: (S, A); log of the probability s that the motion has not changed since the first row.
    score: np.ndarray  #: (S, A, E); log.
    newest: np.ndarray  #: (A, E); log.
    worth: np.ndarray  #: (S, A, E)
    tried: np.ndarray  #: (S, A, E); independent errors that ``worth`` is an average of.
    weights: np.ndarray  #: (S, A, E); at the newest row.
    factor: np.ndarray  #: (S, A); conformal, log.
    recent: np.ndarray  #: (S, A); newest squared errors over what was expected of them.
    square: np.ndarray  #: (S, A, E); running mean of squared errors, to be told.
    pooled_square: np.ndarray  #: (S, A); that of the pool.
    coverage: np.ndarray  #: (S, A); of the 90 % intervals.
    kept_mean: np.ndarray  #: (R, S, A, E); NaN without a forecast.
    kept_claim: np.ndarray  #: (R, S, A, E); variance.
    kept_weights: np.ndarray  #: (R, S, A, E)
    kept_pooled: np.ndarray  #: (R, S, A, 4); mean, half the interval squared before ``recent`` and as issued, ``same``.


class Layout(NamedTuple):
    """Of the leads on the rows."""

    steps: np.ndarray  #: (S,); rows ahead.
    place_of_lead: np.ndarray  #: (L,); among the steps.
    of_row: np.ndarray  #: (L,); the sooner a lead is within the first row, the less.
    log_prior: np.ndarray  #: (E,)
    at_once: int  #: So many candidates, the first, follow every sample, which rows do not.
    step: float  #: Periods.


class Row(NamedTuple):
    """A row, and what is forecast at it."""

    reading: np.ndarray  #: (A,); NaN where missing.
    mean: np.ndarray  #: (S, A, E); NaN without a forecast.
    claim: np.ndarray  #: (S, A, E); variances.
    noise: np.ndarray  #: (A,); variance.
    centre: np.ndarray  #: (A,)
    largest: np.ndarray  #: (A,); distance from it and standard deviation that no forecast exceeds.


class Ahead(NamedTuple):
    """What is forecast at the leads."""

    mean: np.ndarray  #: (E, L, M)
    covariance: np.ndarray  #: (E, L, M, M)
    axis_of: np.ndarray  #: (M,)
    noise: np.ndarray  #: (M,); variance.
    least: np.ndarray  #: (M,); variance.


@dataclass(frozen=True)
class Pool:
    """Pools E candidates at leads (L,), s, which are scored at the nearest rows."""

    leads: np.ndarray
    layout: Layout

    @classmethod
    def of(
        cls, leads: Sequence[float] | np.ndarray, step: float, period: float, prior: Sequence[float], at_once: int = 1
    ) -> 'Pool':
        """On rows of a step, s, of a motion of a period, s; ``prior`` (E,) weights the candidates before any error."""
        leads = np.asarray(leads, dtype=float)
        steps, places = np.unique(np.maximum(np.round(leads / step), 1).astype(int), return_inverse=True)
        of_row = np.minimum(leads / step, 1.0) ** 2
        log_prior = np.log(np.array(prior, dtype=float) / sum(prior))
        return cls(leads, Layout(steps, places, of_row, log_prior, at_once, step / period))

    def in_period(self, step: float, period: float) -> 'Pool':
        """The same, of a motion of another period; both s."""
        return replace(self, layout=self.layout._replace(step=step / period))

    def begin(self, axes: int) -> PoolState:
        """Nothing is known yet."""
        steps, candidates = self.layout.steps.size, self.layout.log_prior.size
        shape, rows = (steps, axes, candidates), int(self.layout.steps[-1]) + 1
        return PoolState(
            row=0,
            same=np.zeros(shape[:2]),
            score=np.zeros(shape),
            newest=np.zeros(shape[1:]),
            worth=np.ones(shape),
            tried=np.full(shape, FIRST_ERRORS),
            weights=np.zeros(shape) + np.exp(self.layout.log_prior),
            factor=np.zeros(shape[:2]),
            recent=np.ones(shape[:2]),
            square=np.zeros(shape),
            pooled_square=np.zeros(shape[:2]),
            coverage=np.full(shape[:2], 1.0 - MISSES),
            kept_mean=np.full((rows, *shape), np.nan),
            kept_claim=np.full((rows, *shape), np.nan),
            kept_weights=np.full((rows, *shape), np.nan),
            kept_pooled=np.full((rows, *shape[:2], 4), np.nan),
        )

    def take(
        self,
        state: PoolState,
        reading: np.ndarray,
        mean: np.ndarray,
        variance: np.ndarray,
        noise: float | np.ndarray = 0.0,
        centre: float | np.ndarray = 0.0,
        largest: float | np.ndarray = math.inf,
    ) -> PoolState:
        """Learn from this row's angles (A,), NaN where missing, and keep what is forecast at it.

        Mean and variance (E, S, A), of the true angle, are NaN without a forecast; readings have the noise (A,),
        variance, on top. No forecast is further from the ``centre`` (A,), or wider, than the ``largest`` (A,).
        """
        of_axes = (np.zeros(reading.size) + each for each in (reading, noise, centre, largest))
        told = (np.ascontiguousarray(each.transpose(1, 2, 0)) for each in (mean, variance))
        measured, *further = of_axes
        take_row(state, self.layout, Row(measured, *told, *further), state.row)
        return state._replace(row=state.row + 1)

    def skip(self, state: PoolState, count: int) -> PoolState:
        """Pass over ``count`` rows without readings or forecasts."""
        rows = len(state.kept_mean)
        for row in range(state.row, state.row + min(count, rows)):
            state.kept_mean[row % rows] = state.kept_pooled[row % rows] = np.nan
        return state._replace(row=state.row + count)

    def reset(self, state: PoolState, candidate: int, axis: int | slice, *, is_other: bool = False) -> PoolState:
        """A candidate has a new model, for an axis or all: it may be nearly as good as the best.

        What the claims of one before were worth says little of those of a model that ``is_other``.
        """
        score = state.score[:, axis]
        score[..., candidate] = np.maximum(score[..., candidate], score.max(axis=-1) - UNTRIED)
        if is_other:
            state.tried[:, axis, candidate] = FIRST_ERRORS
            state.worth[:, axis, candidate] = 1.0
        return state

    def carried_over(self, other: 'Pool', state: PoolState, axes: int) -> PoolState:
        """Begin with what another pool, of the same leads on other rows, has learnt."""
        same = other.layout.place_of_lead[np.unique(self.layout.place_of_lead, return_index=True)[1]]
        begun = self.begin(axes)
        of_steps = {
            name: getattr(state, name)[same].copy()
            for name in PoolState._fields[1:]
            if name != 'newest' and not name.startswith('kept')
        }
        return begun._replace(newest=state.newest.copy(), **of_steps)

    def combine(
        self,
        state: PoolState,
        stamp_ns: int,
        mean: np.ndarray,
        covariance: np.ndarray,
        axis_of: Sequence[int],
        noise_variance: float | np.ndarray = 0.0,
        least_variance: float | np.ndarray = 0.0,
    ) -> Forecast:
        """The true motion at the first L leads, from the candidates' forecasts of this stamp; the state stays.

        The candidates' means (E, L, M) and covariances (E, L, M, M) are of the true motion, NaN without a forecast;
        ``axis_of`` is each target's axis, the angles come first; no variance is less than ``least_variance``. Within
        the first row the errors are not known: the sooner, the more those count that follow every sample.
        """
        of_targets = (np.zeros(mean.shape[2]) + each for each in (noise_variance, least_variance))
        given = (np.array(each, order='C') for each in (mean, covariance, axis_of))
        pooled, spread, deviation = combined(state, self.layout, Ahead._make((*given, *of_targets)))
        return Forecast(stamp_ns, self.leads[: mean.shape[1]], pooled, spread, own_deviation=deviation)


@accelerated
def take_row(state: PoolState, layout: Layout, row: Row, number: int) -> None:
    """As `Pool.take`, of the row of this number."""
    rows, (steps, axes, candidates) = len(state.kept_mean), row.mean.shape
    fall_silent(state, row)
    ratio, log = np.empty(candidates), np.empty(candidates)
    for place in range(steps):
        then = (number - layout.steps[place]) % rows
        for axis in range(axes):
            if math.isfinite(row.reading[axis]) and math.isfinite(state.kept_pooled[then, place, axis, 0]):
                learn(state, layout, row, (then, place, axis), ratio)
    now = number % rows
    for place in range(steps):
        for axis in range(axes):
            weights, noise = state.weights[place, axis], row.noise[axis]
            mean, claim, worth = row.mean[place, axis], row.claim[place, axis], state.worth[place, axis]
            weigh(state, layout, (place, axis), mean, claim, noise, log, weights)
            centre, variance = total(weights, mean, claim, worth)
            centre = min(max(centre, row.centre[axis] - row.largest[axis]), row.centre[axis] + row.largest[axis])
            plain = min(math.exp(state.factor[place, axis]) * variance, row.largest[axis] ** 2)
            issued = min(plain * max(state.recent[place, axis], 1.0), row.largest[axis] ** 2)
            for candidate in range(candidates):
                state.kept_mean[now, place, axis, candidate] = mean[candidate]
                state.kept_claim[now, place, axis, candidate] = claim[candidate]
                state.kept_weights[now, place, axis, candidate] = weights[candidate]
            kept = state.kept_pooled[now, place, axis]
            kept[0], kept[1], kept[2], kept[3] = (
                centre,
                _SQUARE_QUANTILE * (plain + noise),
                _SQUARE_QUANTILE * (issued + noise),
                state.same[place, axis],
            )


@accelerated
def fall_silent(state: PoolState, row: Row) -> None:
    """A candidate that has no forecast any more is not held to those before: what they were made of has ended."""
    rows, (steps, axes, candidates) = len(state.kept_mean), row.mean.shape
    for axis in range(axes):
        for candidate in range(candidates):
            if state.weights[0, axis, candidate] > 0.0 and not math.isfinite(row.mean[0, axis, candidate]):
                for then in range(rows):
                    for place in range(steps):
                        state.kept_mean[then, place, axis, candidate] = math.nan


@accelerated
def log_density(square: float, variance: float) -> float:
    """Log of Student's t with `FREEDOM`, but for its constant, at a squared error from a scale squared."""
    return -0.5 * math.log(variance) - 0.5 * (FREEDOM + 1.0) * math.log1p(square / (FREEDOM * variance))


@accelerated
def learn(state: PoolState, layout: Layout, row: Row, at: tuple[int, int, int], ratio: np.ndarray) -> None:
    """Learn from a row what was forecast for it then, at a place and axis; ``ratio`` (E,) is room for log ratios."""
    then, place, axis = at
    step, share, noise, reading = layout.step, 1.0 / layout.steps[place], row.noise[axis], row.reading[axis]
    memory = min(LATELY + MEMORY_LEADS * step * layout.steps[place], MEMORY_OF_SIZE)
    keep, keep_newest = max(1.0 - step / memory, 0.0), max(1.0 - step / NEWEST_MEMORY, 0.0)
    gain = step / (MEMORY_OF_SIZE + step)
    past = state.kept_pooled[then, place, axis]
    square = (reading - past[0]) ** 2
    surprise = _SQUARE_QUANTILE * square / past[1]
    odds = CHANGES * step * share * math.exp(log_density(surprise, CHANGED**2) - log_density(surprise, 1.0))
    state.same[place, axis] -= math.log1p(odds)
    # what was forecast in another motion tells little of what is forecast now
    is_same, most = math.exp(state.same[place, axis] - past[3]), max(MEMORY_OF_SIZE / step * share, FIRST_ERRORS + 1.0)
    share *= is_same
    means, claims = state.kept_mean[then, place, axis], state.kept_claim[then, place, axis]
    best = -math.inf
    for candidate in range(len(means)):
        own, ratio[candidate] = square, math.nan
        if math.isfinite(means[candidate]):
            own, claim = (reading - means[candidate]) ** 2, max(claims[candidate], _LEAST_VARIANCE)
            expected = state.worth[place, axis, candidate] * claim + noise
            ratio[candidate] = log_density(own, expected)
            best = max(best, ratio[candidate])
            shown = max(min(own, CREDIBLE * expected) - noise, 0.0) / claim
            state.tried[place, axis, candidate] = tried = min(state.tried[place, axis, candidate] + share, most)
            worth = state.worth[place, axis, candidate]
            state.worth[place, axis, candidate] = max(worth + share / tried * (shown - worth), LEAST_WORTH)
        state.square[place, axis, candidate] += (1.0 - keep) * (own - state.square[place, axis, candidate])
    pooled, weight = 0.0, 0.0
    for candidate in range(len(means)):
        if math.isfinite(ratio[candidate]):
            own_weight = max(state.kept_weights[then, place, axis, candidate], _TINY)
            pooled, weight = pooled + own_weight * math.exp(ratio[candidate] - best), weight + own_weight
    if weight > 0.0:
        pooled = best + math.log(max(pooled / weight, _TINY))
    for candidate in range(len(means)):
        gained = ratio[candidate] - pooled if math.isfinite(ratio[candidate]) else 0.0
        state.score[place, axis, candidate] *= keep / (1.0 + odds)
        state.score[place, axis, candidate] += share * gained
        if place == 0:
            state.newest[axis, candidate] = keep_newest * state.newest[axis, candidate] + gained
    is_missed = 1.0 if square > past[2] else 0.0
    factor = state.factor[place, axis] + is_same * GAIN * step * (is_missed - MISSES)
    state.factor[place, axis] = min(max(factor, LEAST_FACTOR), LARGEST_FACTOR)
    # over a period
    state.recent[place, axis] += is_same * step / (1.0 + step) * (min(surprise, CREDIBLE) - state.recent[place, axis])
    state.pooled_square[place, axis] += (1.0 - keep) * (square - state.pooled_square[place, axis])
    state.coverage[place, axis] += gain * (1.0 - is_missed - state.coverage[place, axis])


@accelerated
def weigh(
    state: PoolState,
    layout: Layout,
    at: tuple[int, int],
    mean: np.ndarray,
    claim: np.ndarray,
    noise: float,
    log: np.ndarray,
    weights: np.ndarray,
) -> None:
    """Weights (E,) at a place and axis of candidates that forecast mean (E,) and claim (E,); ``log`` (E,) is room."""
    place, axis = at
    peak, best = 0.5 * (PEAK + ROW_PEAK / layout.steps[place]), -math.inf
    newest = NEWEST if place else 0.0  # which the scores of the shortest lead hold
    for candidate in range(len(mean)):
        log[candidate] = -math.inf
        if math.isfinite(mean[candidate]):
            expected = state.worth[place, axis, candidate] * max(claim[candidate], _LEAST_VARIANCE) + noise
            log[candidate] = layout.log_prior[candidate] - peak * math.log(expected)
            log[candidate] += TEMPER * state.score[place, axis, candidate] + newest * state.newest[axis, candidate]
            best = max(best, log[candidate])
    whole = 0.0
    for candidate in range(len(mean)):
        weights[candidate] = math.exp(log[candidate] - best) if math.isfinite(log[candidate]) else 0.0
        whole += weights[candidate]
    for candidate in range(len(mean)):
        weights[candidate] /= max(whole, _TINY)


@accelerated
def total(weights: np.ndarray, mean: np.ndarray, claim: np.ndarray, worth: np.ndarray) -> tuple[float, float]:
    """Mean and variance of what candidates forecast, by the law of total variance; NaN where all weights are zero."""
    centre, variance, is_there = 0.0, 0.0, False
    for candidate in range(len(weights)):
        if weights[candidate] > 0.0:
            centre, is_there = centre + weights[candidate] * mean[candidate], True
    for candidate in range(len(weights)):
        if weights[candidate] > 0.0:
            apart = mean[candidate] - centre
            own = worth[candidate] * max(claim[candidate], _LEAST_VARIANCE)
            variance += weights[candidate] * (own + apart * apart)
    return (centre, variance) if is_there else (math.nan, math.nan)


@accelerated
def combined(state: PoolState, layout: Layout, ahead: Ahead) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (L, M), covariance (L, M, M) and deviation before calibration (L, M), as of `Pool.combine`."""
    candidates, leads, targets = ahead.mean.shape
    axes = state.weights.shape[1]
    mean, own, covariance = np.empty((leads, targets)), np.empty((leads, targets)), np.empty((leads, targets, targets))
    of_axis, scale, factor, log = np.empty((axes, candidates)), np.empty(axes), np.empty(targets), np.empty(candidates)
    # square roots, each taken once: pairs of targets need their products
    weight, worth = np.empty((targets, candidates)), np.empty((targets, candidates))
    for lead in range(leads):
        place, of_row = layout.place_of_lead[lead], layout.of_row[lead]
        for axis in range(axes):
            claim = np.ascontiguousarray(ahead.covariance[:, lead, axis, axis])
            angles = np.ascontiguousarray(ahead.mean[:, lead, axis])
            weigh(state, layout, (place, axis), angles, claim, ahead.noise[axis], log, of_axis[axis])
            scale[axis] = math.exp(state.factor[place, axis]) * max(state.recent[place, axis], 1.0)
            if of_row < 1.0:
                scale[axis] **= of_row
                for candidate in range(candidates):
                    of_axis[axis, candidate] *= of_row
                    if candidate < layout.at_once and math.isfinite(angles[candidate]):
                        of_axis[axis, candidate] += 1.0 - of_row
        for target in range(targets):
            axis = ahead.axis_of[target]
            whole, centre, claimed = 0.0, 0.0, 0.0
            for candidate in range(candidates):
                if math.isfinite(ahead.mean[candidate, lead, target]):
                    whole += of_axis[axis, candidate]
            for candidate in range(candidates):
                weight[target, candidate] = worth[target, candidate] = 0.0
                if math.isfinite(ahead.mean[candidate, lead, target]) and of_axis[axis, candidate] > 0.0:
                    own_weight = of_axis[axis, candidate] / max(whole, _TINY)
                    centre += own_weight * ahead.mean[candidate, lead, target]
                    claimed += own_weight * ahead.covariance[candidate, lead, target, target]
                    weight[target, candidate] = math.sqrt(own_weight)
                    worth[target, candidate] = math.sqrt(worth_of_row(state.worth[place, axis, candidate], of_row))
            mean[lead, target] = centre if whole > 0.0 else math.nan
            own[lead, target] = math.sqrt(claimed + ahead.noise[target]) if whole > 0.0 else math.nan
            for other in range(target + 1):
                both = shared(ahead, (lead, target, other), weight, worth, mean[lead])
                covariance[lead, target, other] = both
            variance = covariance[lead, target, target]
            factor[target] = math.sqrt(max(scale[axis] * variance, ahead.least[target]) / variance)
        for one in range(targets):
            for other in range(one + 1):
                both = covariance[lead, one, other]
                if both != both and factor[one] == factor[one] and factor[other] == factor[other]:
                    both = 0.0  # targets that no candidate forecasts together are independent
                covariance[lead, one, other] = covariance[lead, other, one] = both * factor[one] * factor[other]
    return mean, covariance, own


@accelerated
def shared(ahead: Ahead, of: tuple[int, int, int], weight: np.ndarray, worth: np.ndarray, mean: np.ndarray) -> float:
    """Covariance, at a lead, of two targets of means (M,) by the law of total covariance; NaN where no candidate
    forecasts both. ``weight`` and ``worth`` (M, E) are square roots.
    """
    lead, one, other = of
    both, is_there = 0.0, False
    for candidate in range(len(ahead.mean)):
        pair = weight[one, candidate] * weight[other, candidate]
        if pair > 0.0:
            is_there = True
            apart = ahead.mean[candidate, lead, one] - mean[one]
            apart *= ahead.mean[candidate, lead, other] - mean[other]
            spread = ahead.covariance[candidate, lead, one, other]
            if one == other:
                spread = max(spread, _LEAST_VARIANCE)
            both += pair * (worth[one, candidate] * worth[other, candidate] * spread + apart)
    return both if is_there else math.nan


@accelerated
def worth_of_row(worth: float, of_row: float) -> float:
    """Within the first row claims have not been tried: the sooner, the more they are believed."""
    return worth**of_row if of_row < 1.0 else worth
