"""The pool of forecasts against sums written down directly, and errors that are made up, so that the best is known."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from swath_sysid.attitude.prediction import pool as constants
from swath_sysid.attitude.prediction.axis_filter import CREDIBLE, LATELY
from swath_sysid.attitude.prediction.memories import MEMORY_OF_SIZE, USUAL_PERIOD
from swath_sysid.attitude.prediction.pool import Pool, PoolState

STEP, PERIOD = 0.1, USUAL_PERIOD
LEADS = np.array([0.1, 0.5, 2.0])
QUANTILE = stats.norm.ppf(0.95)


class Learning:
    """A pool and its state."""

    def __init__(self, prior=(1.0, 1.0), axes=1, leads=LEADS, step=STEP, period=PERIOD, at_once=1):
        self.pool = Pool.of(leads, step, period, prior, at_once)
        self.state = self.pool.begin(axes)

    def take(self, reading, mean, variance=1.0, *further):
        """A row, whose readings (A,), means and variances (E, S, A) may be numbers."""
        steps, axes, candidates = self.state.score.shape
        shape = candidates, steps, axes
        whole = np.array(np.broadcast_to(mean, shape), dtype=float), np.array(np.broadcast_to(variance, shape), float)
        self.state = self.pool.take(self.state, np.zeros(axes) + reading, *whole, *further)

    def combine(self, mean, covariance=1.0, axis_of=(0,), *further):
        """Means (E, L, M) and covariances (E, L, M, M) may be of any shape that fits."""
        size, leads, candidates = len(axis_of), self.pool.leads.size, self.state.score.shape[2]
        whole = np.array(np.broadcast_to(mean, (candidates, leads, size)), dtype=float)
        spread = np.array(np.broadcast_to(covariance, (candidates, leads, size, size)), dtype=float)
        return self.pool.combine(self.state, 0, whole, spread, axis_of, *further)

    def run(self, errors, variance=1.0, count=1200, seed=0):
        """White errors of the given standard deviations (E, S, A) about readings of zero; those of the pool."""
        rng, pooled, widths = np.random.default_rng(seed), [], []
        places = self.pool.layout.place_of_lead
        for _ in range(count):
            mean = errors * rng.normal(size=errors.shape)
            self.take(0.0, mean, variance)
            axes = range(errors.shape[2])
            covariance = np.eye(errors.shape[2]) * np.broadcast_to(variance, errors.shape)[:, places, :, None]
            told = self.combine(mean[:, places], covariance, axes)
            pooled.append(told.mean)
            widths.append(told.deviation)
        return np.array(pooled), np.array(widths)


def by_hand(rows, steps, step, prior):
    """Scores, worths and conformal factors (S, E), and the pool's mean and variance at the last row: sums as written.

    Each row is a reading, means, claims (E, S) and the variance of the noise.
    """
    count, kept = len(prior), []
    score, worth, tried = np.zeros((len(steps), count)), np.ones((len(steps), count)), np.full((len(steps), count), 8.0)
    factor, recent, newest, same = np.zeros(len(steps)), np.ones(len(steps)), np.zeros(count), np.ones(len(steps))
    for number, (reading, mean, claim, noise) in enumerate(rows):
        for place, ahead in enumerate(steps):
            if number < ahead:
                continue
            means, claims, weights, centre, plain, issued, since = (each[place] for each in kept[number - ahead])
            memory = min(LATELY + 10.0 * step * ahead, MEMORY_OF_SIZE)
            scale = np.sqrt(worth[place] * claims + noise)
            log = stats.t.logpdf(reading, df=6.0, loc=means, scale=scale)
            gained = log - np.log(np.sum(weights * np.exp(log)))
            surprise = QUANTILE * (reading - centre) / np.sqrt(plain)
            changed = 0.01 * step / ahead * stats.t.pdf(surprise, 6.0, scale=10.0) / stats.t.pdf(surprise, 6.0)
            same[place] /= 1.0 + changed
            share = same[place] / since / ahead
            score[place] = (1.0 - step / memory) * score[place] / (1.0 + changed) + gained * share
            if place == 0:
                newest = (1.0 - step / 0.3) * newest + gained
            square = np.minimum((reading - means) ** 2, CREDIBLE * scale**2)
            tried[place] = np.minimum(tried[place] + share, max(MEMORY_OF_SIZE / step / ahead, 9.0))
            shown = np.maximum(square - noise, 0.0) / claims
            worth[place] = np.maximum(worth[place] + (shown - worth[place]) * share / tried[place], 0.5)
            error = (reading - centre) ** 2
            learns = share * ahead * step
            factor[place] = np.clip(factor[place] + 0.32 * learns * ((error > issued) - 0.1), -0.7, 3.0)
            recent[place] += learns / (1.0 + step) * (min(surprise**2, CREDIBLE) - recent[place])
        told = []
        for place, ahead in enumerate(steps):
            expected = worth[place] * claim[:, place] + noise
            log = np.log(prior) + 0.8 * score[place] - 0.5 * (1.0 + 2.0 / ahead) * np.log(expected)
            log += 0.3 * newest if place else 0.0
            weights = np.exp(log - log.max()) / np.exp(log - log.max()).sum()
            centre = weights @ mean[:, place]
            variance = weights @ (worth[place] * claim[:, place] + (mean[:, place] - centre) ** 2)
            plain = np.exp(factor[place]) * variance
            told.append((centre, variance, weights, plain, plain * max(recent[place], 1.0)))
        interval = [QUANTILE**2 * (np.array([each[k] for each in told]) + noise) for k in (3, 4)]
        kept.append((mean.T, claim.T, [each[2] for each in told], [each[0] for each in told], *interval, same.copy()))
    return score, worth, factor, [(each[0], each[4], each[2]) for each in told]


def made_up(seed, count=20, candidates=3, steps=3):
    rng = np.random.default_rng(seed)
    sizes = np.exp(rng.normal(size=(candidates, 1)))
    return [
        (
            rng.normal() * (40.0 if row == 15 else 1.0),
            sizes * rng.normal(size=(candidates, steps)),
            sizes**2 * np.exp(0.3 * rng.normal(size=(candidates, steps))),
            0.01,
        )
        for row in range(count)
    ]


@pytest.mark.parametrize('seed', range(4))
def test_scores_worths_and_widths_are_those_of_the_sums_with_students_density(seed):
    rows, prior = made_up(seed), np.array([1.0, 0.1, 5.0])
    learning = Learning(prior, leads=[0.1, 0.3, 0.7])
    for reading, mean, claim, noise in rows:
        learning.take(reading, mean[..., None], claim[..., None], noise)
    score, worth, factor, told = by_hand(rows, [1, 3, 7], STEP / PERIOD, prior / prior.sum())
    state = learning.state
    np.testing.assert_allclose(state.worth[:, 0], worth, rtol=1e-10)
    np.testing.assert_allclose(state.score[:, 0], score, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(state.factor[:, 0], factor, rtol=1e-12)
    _, mean, claim, noise = rows[-1]
    issued = learning.combine(mean[..., None], claim[..., None, None], (0,), noise)
    for place, (centre, variance, weights) in enumerate(told):
        np.testing.assert_allclose(state.weights[place, 0], weights, rtol=1e-9, atol=1e-14)
        assert issued.mean[place, 0] == pytest.approx(centre, rel=1e-9)
        assert issued.covariance[place, 0, 0] == pytest.approx(variance, rel=1e-9)


@settings(max_examples=10, deadline=None)
@given(st.permutations(range(4)), st.integers(0, 50))
def test_the_order_of_the_candidates_does_not_matter(order, seed):
    rows, prior = made_up(seed, 40, 4), np.array([1.0, 0.1, 5.0, 1.0])
    one, other = (Learning(each, leads=[0.1, 0.3, 0.7], at_once=0) for each in (prior, prior[order]))
    for reading, mean, claim, noise in rows:
        one.take(reading, mean[..., None], claim[..., None], noise)
        other.take(reading, mean[order][..., None], claim[order][..., None], noise)
    np.testing.assert_allclose(one.state.weights[..., order], other.state.weights, rtol=1e-7, atol=1e-12)
    _, mean, claim, noise = rows[-1]
    told = [
        each.combine(mean[places][..., None], claim[places][..., None, None], (0,), noise)
        for each, places in ((one, slice(None)), (other, order))
    ]
    np.testing.assert_allclose(told[0].mean, told[1].mean, rtol=1e-7)
    np.testing.assert_allclose(told[0].covariance, told[1].covariance, rtol=1e-7)


@pytest.mark.parametrize('others', [1, 3])
def test_a_candidate_without_a_forecast_neither_gains_nor_loses_nor_changes_the_pool(others):
    rows, without, beside = made_up(3, 60, others), Learning((1.0,) * others), Learning((1.0,) * (others + 1))
    nothing = np.full((1, 3, 1), np.nan)
    for reading, mean, claim, noise in rows:
        without.take(reading, mean[..., None], claim[..., None], noise)
        beside.take(
            reading, np.concatenate([mean[..., None], nothing]), np.concatenate([claim[..., None], nothing]), noise
        )
    assert (beside.state.score[..., -1] == 0.0).all() and (beside.state.weights[..., -1] == 0.0).all()
    for name in ('score', 'weights', 'worth'):
        np.testing.assert_allclose(getattr(beside.state, name)[..., :-1], getattr(without.state, name), rtol=1e-12)
    for name in ('factor', 'recent', 'pooled_square'):
        np.testing.assert_allclose(getattr(beside.state, name), getattr(without.state, name), rtol=1e-12)
    beside.take(0.0, np.nan)
    assert np.isnan(beside.combine(np.nan).mean).all()


def test_what_was_forecast_before_a_candidate_fell_silent_is_not_held_against_it():
    """A hull on which nothing acts says where it will swing; a hand that takes hold of it proves nothing about that."""
    learning = Learning()
    for row in range(100):
        learning.take(0.0, np.array([0.0, 0.5])[:, None, None] if row < 80 else 5.0 * np.ones((2, 1, 1)), 1.0)
        if row == 79:
            before = learning.state.score[..., 0].copy()
            learning.take(5.0, np.array([np.nan, 5.0])[:, None, None])
            now = learning.state.score[..., 0].copy()
            assert (now <= before).all() and (now > 0.8 * before).all(), 'it only forgets'


def test_the_candidate_that_errs_less_has_the_weight_at_each_lead_and_axis():
    errors = np.array([[[1.0, 3.0], [1.0, 1.0], [2.0, 1.0]], [[3.0, 1.0], [1.0, 2.0], [1.0, 1.0]]])
    learning = Learning(axes=2)
    learning.run(errors, errors**2)
    first, second = learning.state.weights.transpose(2, 0, 1)
    np.testing.assert_allclose(first + second, 1.0)
    # where they err alike, the newest errors of the shortest lead tell
    assert (first > 0.95).tolist() == [[True, False], [False, True], [False, False]]
    assert (second > 0.95).tolist() == [[False, True], [False, False], [True, True]]


@pytest.mark.parametrize('told', [0.25, 1.0, 4.0])
def test_intervals_hold_what_they_say_whatever_the_candidates_say(told):
    learning = Learning((1.0,))
    pooled, widths = learning.run(np.ones((1, 3, 1)), told, 2400)
    held = np.abs(pooled[600:]) < QUANTILE * widths[600:]
    assert held.mean(axis=(0, 2)) == pytest.approx(0.9, abs=0.03)
    assert learning.state.coverage == pytest.approx(0.9, abs=0.04)


def test_intervals_hold_what_they_say_where_errors_have_wide_tails():
    rng, learning, held = np.random.default_rng(3), Learning((1.0,)), []
    for _ in range(4000):
        mean = rng.standard_t(2.5, size=(1, 3, 1))
        held.append(np.abs(mean[0, :, 0]) < QUANTILE * learning.combine(mean).deviation[:, 0])
        learning.take(0.0, mean)
    assert np.mean(held[600:]) == pytest.approx(0.9, abs=0.02)


def test_where_candidates_differ_the_interval_holds_both():
    told = Learning().combine(np.array([-1.0, 1.0])[:, None, None], 0.01)
    assert told.mean == pytest.approx(0.0) and told.covariance == pytest.approx(1.01)


def test_one_that_claims_to_know_less_has_less_weight_before_any_error():
    told = Learning().combine(np.array([1.0, 2.0])[:, None, None], np.array([30.0, 1.0])[:, None, None, None])
    of_first = 1.0 / (1.0 + 30.0 ** (0.5 * (1.0 + 2.0 / np.array([1.0, 5.0, 20.0]))))
    assert told.mean[:, 0] == pytest.approx(2.0 - of_first)


def test_what_was_contradicted_at_the_next_row_loses_weight_at_leads_that_have_not_come_true():
    learning = Learning(leads=[0.1, 5.0])
    for row in range(8):
        learning.take(0.0, np.array([5.0 if row else 0.0, 0.0])[:, None, None], 1.0)
    assert (learning.state.score[1] == 0.0).all() and learning.state.weights[1, 0, 0] < 0.05


def test_what_was_scored_in_another_motion_counts_little_after_it_has_changed():
    learning, errors = Learning(), np.broadcast_to([[[0.01]], [[0.03]]], (2, 3, 1))
    learning.run(errors, errors**2)
    before = abs(learning.state.score).max(axis=(1, 2))
    for _ in range(1 + round(LEADS[-1] / STEP)):
        learning.take(5.0, 0.0, errors**2)
    assert (abs(learning.state.score).max(axis=(1, 2)) < 0.1 * before).all()


def test_a_new_model_may_be_nearly_as_good_as_the_best_and_another_hull_begins_anew():
    learning = Learning()
    learning.run(np.array([9.0, 1.0])[:, None, None] * np.ones((2, 3, 1)), 1.0, 300)
    assert (learning.state.worth[..., 0] > 2.0).all()
    learning.state = learning.pool.reset(learning.state, 0, slice(None))
    np.testing.assert_allclose(learning.state.score[..., 0], learning.state.score[..., 1] - 1.0)
    assert (learning.state.worth[..., 0] > 2.0).all()
    learning.state = learning.pool.reset(learning.state, 0, 0, is_other=True)
    assert (learning.state.worth[..., 0] == 1.0).all() and (learning.state.tried[..., 0] == 8.0).all()


def test_no_forecast_that_is_scored_is_wilder_than_it_may_be():
    learning = Learning((1.0,))
    learning.take(0.0, 50.0, 1e4, 0.0, 1.0, 2.0)
    assert (learning.state.kept_pooled[0, ..., 0] == 3.0).all()
    assert learning.state.kept_pooled[0, ..., 1:3] == pytest.approx(QUANTILE**2 * 4.0)


def test_errors_are_of_the_row_that_a_forecast_was_for_and_of_the_nearest_step():
    """Truth is the row's number, forecast exactly: every error is zero, through gaps too."""
    learning, row = Learning((1.0,)), 0
    steps = learning.pool.layout.steps
    for k in range(200):
        lost = {100: 37, 150: 5000}.get(k, 0)
        learning.state = learning.pool.skip(learning.state, lost)
        row += lost
        learning.take(np.nan if k % 7 == 0 else float(row), (row + steps)[None, :, None].astype(float))
        row += 1
    assert (learning.state.pooled_square == 0.0).all() and learning.state.row == row
    between = Learning((1.0,), leads=[0.02, 0.1, 0.26, 0.33, 1.0])
    assert between.pool.layout.steps.tolist() == [1, 3, 10]
    assert between.combine(np.arange(5.0)[None, :, None]).mean[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_widths_are_kept_over_a_silence():
    learning = Learning((1.0,))
    learning.run(3.0 * np.ones((1, 3, 1)), 1.0, 600)
    before = learning.combine(0.0).deviation
    learning.state = learning.pool.skip(learning.state, 10_000)
    np.testing.assert_array_equal(learning.combine(0.0).deviation, before)


@given(factor=st.floats(0.1, 10.0), seed=st.integers(0, 50))
@settings(max_examples=5, deadline=None)
def test_a_motion_stretched_in_time_is_pooled_as_before(factor, seed):
    one = Learning()
    stretched = Learning(leads=factor * LEADS, step=factor * STEP, period=factor * PERIOD)
    later = Learning()
    later.pool = later.pool.in_period(factor * STEP, factor * PERIOD)
    for each in (one, stretched, later):
        each.run(np.array([1.0, 1.3])[:, None, None] * np.ones((2, 3, 1)), 1.0, 100, seed)
    for each in (stretched, later):
        for name in PoolState._fields:
            np.testing.assert_allclose(getattr(each.state, name), getattr(one.state, name), rtol=1e-7, atol=1e-9)


def test_what_was_learnt_goes_over_to_other_rows_by_the_leads():
    learnt = Learning(axes=2)
    errors = np.array([[[1.0, 3.0], [1.0, 1.0], [2.0, 1.0]], [[3.0, 1.0], [1.0, 2.0], [1.0, 1.0]]])
    learnt.run(errors, errors**2, 600)
    for step in (0.05, 0.1, 0.2, 0.5):
        pool = Pool.of(LEADS, step, PERIOD, (1.0, 1.0))
        state = pool.carried_over(learnt.pool, learnt.state, 2)
        places = pool.layout.place_of_lead.tolist()
        first = [place for place, lead in enumerate(places) if lead not in places[:place]]
        for name in ('weights', 'score', 'worth', 'factor', 'coverage', 'square'):
            np.testing.assert_array_equal(getattr(state, name), getattr(learnt.state, name)[first])
        assert state.row == 0 and np.isnan(state.kept_mean).all()


def test_within_the_first_row_the_sooner_the_more_those_count_that_follow_every_sample():
    learning = Learning(leads=[0.01, 0.05, 0.09, 0.1, 0.5])
    learning.run(np.array([2.0, 1.0])[:, None, None] * np.ones((2, 2, 1)), 1.0, 600)
    mean = np.array([2.0, 1.0])[:, None, None]
    told = learning.combine(mean, np.array([0.1, 1.0])[:, None, None, None])
    assert told.mean[:, 0] == pytest.approx([1.99, 1.75, 1.19, 1.0, 1.0], abs=0.01)
    assert all(later > sooner for sooner, later in pairwise(told.deviation[[0, 1, 3], 0]))
    bounded = learning.combine(mean, 1e-9, (0,), 0.0, np.array([0.25]))
    assert bounded.deviation[:4] == pytest.approx(0.5, abs=0.2) and (bounded.deviation >= 0.5 - 1e-12).all()


def test_questions_change_nothing_and_targets_of_one_candidate_stay_correlated():
    learning, covariance = Learning((1.0,), axes=2), np.array([[4.0, 1.0], [1.0, 1.0]])
    np.testing.assert_allclose(learning.combine(0.0, covariance, (0, 1)).covariance, [covariance] * 3)
    learning.run(np.ones((1, 3, 2)), 1.0, 100)
    before = [np.copy(each) for each in learning.state]
    told = learning.combine(0.0, covariance, (0, 1))
    for each, then in zip(learning.state, before, strict=True):
        np.testing.assert_array_equal(each, then)
    np.testing.assert_allclose(told.covariance[:, 0, 1] / told.deviation[:, 0] / told.deviation[:, 1], 0.5)
    # what the models expect of themselves, before calibration
    np.testing.assert_allclose(told.own_deviation, [[2.0, 1.0]] * 3)


def test_the_constants_are_those_of_the_equations():
    """What `by_hand` writes as numbers."""
    assert (constants.TEMPER, constants.FREEDOM, constants.NEWEST, constants.GAIN) == (0.8, 6.0, 0.3, 0.32)
    assert math.isclose(constants._SQUARE_QUANTILE, QUANTILE**2)
