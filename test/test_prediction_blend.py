"""The blend of forecasts against errors that are made up, so that the best answer is known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swath_sysid.attitude.prediction.blend import DRIVEN, FREE, YOUNG, Blend, error_weights, leave_out
from swath_sysid.attitude.prediction.hull_state import USUAL_PERIOD

STEP, PERIOD = 0.1, USUAL_PERIOD
LEADS = np.array([0.1, 0.5, 1.0])


def _blend(prior=(1.0, 1.0), axes=1):
    return Blend(LEADS, STEP, PERIOD, axes, prior)


def _take(blend, errors, count, **further):
    """Forecasts of a motion that stays zero, each candidate erring by so much every time."""
    errors = np.array(errors)[:, None, None] * np.ones((2, 3, 1))
    for _ in range(count):
        blend.take(np.zeros(1), errors, np.ones((2, 3, 1)), **further)


def _run(blend, errors, variance, seconds=120.0, seed=0):
    """White errors of the given standard deviations, shape (E, S, A); returns those of candidates and blend."""
    rng, (_, _, axes) = np.random.default_rng(seed), errors.shape
    issued, blended, spread = [], [], []
    for _ in range(round(seconds / STEP)):
        mean = errors * rng.normal(size=errors.shape)
        blend.take(np.zeros(axes), mean, np.broadcast_to(variance, errors.shape))
        covariance = np.broadcast_to(variance, errors.shape)[..., None] * np.eye(axes)
        told = blend.combine(0, mean, covariance, range(axes))
        issued.append(mean)
        blended.append(told.mean)
        spread.append(told.deviation**2)
    return np.array(issued), np.array(blended), np.array(spread)


def test_each_lead_and_axis_goes_to_the_candidate_that_errs_less_there():
    errors = np.array([[[1.0, 3.0], [1.0, 1.0], [2.0, 1.0]], [[3.0, 1.0], [1.0, 2.0], [1.0, 1.0]]])
    blend = _blend(axes=2)
    _run(blend, errors, 1.0)
    assert blend.weights.sum(axis=0) == pytest.approx(1.0)
    assert (blend.weights[0] > 0.95).tolist() == [[True, False], [False, True], [False, False]]
    assert (blend.weights[1] > 0.95).tolist() == [[False, True], [False, False], [True, False]]
    assert blend.weights[0, 1, 0] == pytest.approx(0.5, abs=0.45)


@settings(max_examples=5)
@given(ratio=st.floats(0.1, 10.0), seed=st.integers(0, 100))
def test_the_blend_is_hardly_worse_than_the_better_one(ratio, seed):
    errors = np.array([1.0, ratio])[:, None, None] * np.ones((2, 3, 1))
    issued, blended, _ = _run(_blend(), errors, 1.0, 60.0, seed)
    settled = slice(300, None)
    ours = np.sqrt((blended[settled] ** 2).mean(axis=0))
    each = np.sqrt((issued[settled] ** 2).mean(axis=0))
    assert (ours < 1.05 * each.min(axis=0)).all()


def test_the_prior_decides_between_equals_and_luck_in_the_first_errors_nothing():
    blend = _blend((1.0, 0.2))
    _take(blend, [1.0, 1.0], 50)
    assert blend.weights[0] == pytest.approx(1.0 / 1.2)
    error_weights(np.array([1e-12, 1.0]), 0.1, np.ones(2), weights := np.empty(2))
    assert weights.sum() == pytest.approx(1.0)
    blend = _blend()
    _take(blend, [1e-9, 1.0], 7)
    _take(blend, [2.0, 1.0], 100)
    assert (blend.weights[1] > 0.9).all()


def test_a_candidate_without_a_forecast_has_no_weight_and_comes_in_unproven():
    blend = _blend()
    absent = np.concatenate([np.full((1, 3, 1), np.nan), np.ones((1, 3, 1))])
    _take(blend, [math.nan, 1.0], 600)
    told = blend.combine(0, absent, np.ones((2, 3, 1, 1)), [0])
    assert told.mean == pytest.approx(1.0) and np.isfinite(told.covariance).all()
    assert (blend.weights[0] < 0.25).all()
    _take(blend, [0.5, 1.0], 300)
    assert (blend.weights[0] > 0.9).all()
    nothing = np.full((2, 3, 1), np.nan)
    blend.take(np.array([0.0]), nothing, nothing)
    assert np.isnan(blend.combine(0, nothing, nothing[..., None], [0]).mean).all()


def test_after_a_break_a_candidate_that_knows_little_has_no_weight_however_little_it_erred():
    blend = _blend()
    _take(blend, [0.1, 0.3], 600)
    mean, covariance = np.array([1.0, 2.0])[:, None, None] * np.ones((2, 3, 1)), np.full((2, 3, 1, 1), 0.09)
    covariance[0] = 4.0

    def combined(is_after_break):
        blend.is_after_break = is_after_break
        return blend.combine(0, mean, covariance, [0])

    before, after = combined(False), combined(True)
    assert before.mean == pytest.approx(1.0, abs=0.05) and after.mean == pytest.approx(2.0, abs=0.05)
    # of one that claims what it did before, nothing changes
    covariance[0] = 0.01
    before, after = combined(False), combined(True)
    assert after.mean == pytest.approx(before.mean)


def test_a_refitted_candidate_is_not_held_to_what_its_last_model_did():
    blend = _blend()
    _take(blend, [100.0, 1.0], 600)
    before = blend.mean_square[1].copy()
    for candidate in (0, 1):
        blend.renew(candidate, slice(None), [0, 1])
    assert blend.mean_square[0] == pytest.approx(1.14 * before) and blend.mean_square[1] == pytest.approx(before)


def test_what_acts_now_and_then_is_not_held_against_anybody_but_constant_surprise_is():
    """Every 20 s something acts, and all that was forecast before errs a hundred times as much as the rest."""
    blend = _blend((10.0, 1.0))
    for row in range(1200):
        before, since = 200 - row % 200, np.array([row % 200])
        errors = np.where(blend.steps[:, None] >= before, [[100.0]], [[1.0]])
        blend.take(np.zeros(1), np.stack([errors, np.ones_like(errors)]), np.ones((2, 3, 1)), foreseeable=since)
    assert blend.mean_square == pytest.approx(1.0) and (blend.weights[0] > 0.9).all()
    surprised = _blend((10.0, 1.0))
    _take(surprised, [3.0, 1.0], 1200, foreseeable=np.zeros(1, dtype=int))
    assert (surprised.weights[1] > 0.9).all()


@pytest.mark.parametrize(('told', 'settled'), [(1e-3, 1000), (0.25, 300), (1.0, 300), (4.0, 300)])
def test_intervals_hold_what_they_say_whatever_the_candidates_say(told, settled):
    errors = np.ones((1, 3, 1))
    _, blended, spread = _run(_blend((1.0,)), errors, told, 200.0)
    held = np.abs(blended[settled:]) < 1.645 * np.sqrt(spread[settled:])
    assert held.mean(axis=(0, 2)) == pytest.approx(0.9, abs=0.03)


def test_intervals_hold_what_they_say_where_errors_have_wide_tails():
    rng, blend, held = np.random.default_rng(3), _blend((1.0,)), []
    for _ in range(4000):
        mean = rng.standard_t(2.5, size=(1, 3, 1))
        deviation = blend.combine(0, mean, np.ones((1, 3, 1, 1)), [0]).deviation[:, 0]
        held.append(np.abs(mean[0, :, 0]) < 1.645 * deviation)
        blend.take(np.zeros(1), mean, np.ones((1, 3, 1)))
    assert np.mean(held[600:]) == pytest.approx(0.9, abs=0.02)


def test_what_errs_under_a_moment_does_not_widen_the_intervals_of_a_free_hull():
    blend, (mean, variance) = _blend((1.0,), axes=2), np.ones((2, 1, 3, 2))
    for _ in range(600):
        blend.take(np.zeros(2), 3.0 * mean, variance)
    assert (blend.scale > 4.0).all()
    blend.take(np.zeros(2), mean, variance, regime=np.array([DRIVEN, FREE]))
    assert (blend.scale[:, 0] > 4.0).all() and blend.scale[:, 1] == pytest.approx(1.0)


def test_a_doubt_that_was_told_hides_no_error_from_the_widths_after_it():
    """A motion doubles; while its models are contradicted they claim four times their variance, and then no longer."""
    held = {}
    for told in (1.0, 4.0):
        blend, rng = _blend((1.0,)), np.random.default_rng(8)
        for row in range(900):
            doubt, reading = (4.0 if 600 < row < 640 else 1.0), rng.normal(scale=1.0 if row < 600 else 2.0, size=1)
            variance = np.full((1, 3, 1), doubt)
            if row > 640:
                wide = blend.combine(0, np.zeros((1, 3, 1)), variance[..., None], [0]).deviation[:, 0]
                held.setdefault(told, []).append(np.abs(reading) < 1.645 * wide)
            blend.doubt = doubt if told > 1.0 else 1.0
            blend.take(reading, np.zeros((1, 3, 1)), variance)
    assert np.mean(held[4.0][:40]) > np.mean(held[1.0][:40]) + 0.1 and np.mean(held[4.0]) > 0.85


def test_before_any_motion_is_known_no_interval_is_surer_than_the_candidates_are():
    blend, mean, variance = _blend((1.0,)), np.ones((1, 3, 1)), np.ones((1, 3, 1))
    for _ in range(600):
        blend.take(np.zeros(1), 0.1 * mean, variance, regime=YOUNG)
    assert (blend.scale < 0.5).all()
    assert blend.combine(0, mean, variance[..., None], [0]).deviation == pytest.approx(1.0)
    blend.take(np.zeros(1), mean, variance)
    assert blend.scale == pytest.approx(1.0), 'nor do these errors say anything of later ones'


def test_a_moment_that_nobody_foresaw_leaves_the_widths_to_the_newest_errors():
    blend, rng = _blend((1.0,)), np.random.default_rng(6)
    mean, variance = np.ones((1, 3, 1)), np.ones((1, 3, 1))
    for row in range(600):
        blend.take(np.zeros(1), rng.normal(size=(1, 3, 1)), variance, foreseeable=0.0 if row == 300 else np.inf)
    assert blend.combine(0, 0.0 * mean, variance[..., None], [0]).deviation == pytest.approx(1.0, rel=0.4)
    for _ in range(round(PERIOD / STEP)):
        blend.take(np.zeros(1), 3.0 * mean, variance)
    told = blend.combine(0, mean, variance[..., None], [0]).deviation
    assert (told > 2.0).all() and (told < 4.0).all()


def test_errors_that_are_the_sensors_noise_for_the_most_part_leave_the_claims_alone():
    rng = np.random.default_rng(4)
    blend = _blend((1.0,))
    for _ in range(1200):
        blend.take(rng.normal(size=1), np.zeros((1, 3, 1)), np.full((1, 3, 1), 0.01), 1.0)
    assert blend.scale == pytest.approx(1.0, abs=0.15)
    told = blend.combine(0, np.zeros((1, 3, 1)), np.full((1, 3, 1, 1), 0.01), [0], 1.0)
    assert told.covariance == pytest.approx(0.01, rel=0.15)


def test_correlations_of_the_targets_survive_and_so_does_what_the_candidates_expect_of_themselves():
    covariance = np.broadcast_to([[4.0, 1.0], [1.0, 1.0]], (1, 3, 2, 2))
    combined = _blend((1.0,), axes=2).combine(0, np.zeros((1, 3, 2)), covariance, [0, 1])
    assert combined.covariance == pytest.approx(covariance[0])
    blend, rng = _blend(), np.random.default_rng(3)
    variance = np.broadcast_to(np.array([1.0, 4.0])[:, None, None], (2, 3, 1))
    for _ in range(1200):
        blend.take(np.zeros(1), 3.0 * rng.normal(size=(2, 3, 1)), variance)
    weights = blend.weights[:, blend.place_of_lead, 0]
    told = blend.combine(0, np.zeros((2, 3, 1)), variance[..., None], [0])
    assert told.own_deviation[:, 0] == pytest.approx(np.sqrt(weights.T @ [1.0, 4.0]))
    assert (told.covariance[:, 0, 0] > 1.5 * told.own_deviation[:, 0] ** 2).all()


def test_errors_are_of_the_row_that_a_forecast_was_for_and_of_the_nearest_step():
    """Truth is the row's number, forecast exactly: every error is zero, through gaps too."""
    blend, row = _blend((1.0,)), 0
    for k in range(200):
        lost = {100: 37, 150: 5000}.get(k, 0)
        if lost:
            blend.skip(lost)
        row += lost
        reading = np.array([np.nan if k % 7 == 0 else float(row)])
        blend.take(reading, (row + blend.steps)[None, :, None].astype(float), np.ones((1, 3, 1)))
        row += 1
    assert (blend.mean_square == 0.0).all() and (blend.scale < 0.5).all()
    between = Blend([0.02, 0.1, 0.26, 0.33, 1.0], STEP, PERIOD, 1, (1.0,))
    assert between.steps.tolist() == [1, 3, 10]
    told = between.combine(0, np.arange(5.0).reshape(1, 5, 1), np.ones((1, 5, 1, 1)), [0])
    assert told.mean[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


@pytest.mark.long
@given(factor=st.floats(0.1, 10.0), seed=st.integers(0, 50))
def test_a_motion_stretched_in_time_is_blended_as_before(factor, seed):
    blends = _blend(), Blend(factor * LEADS, factor * STEP, factor * PERIOD, 1, (1.0, 1.0))
    later = _blend()
    later.set_period(factor * STEP, factor * PERIOD)
    for blend in (*blends, later):
        _run(blend, np.array([1.0, 1.3])[:, None, None] * np.ones((2, 3, 1)), 1.0, 10.0, seed)
    for blend in (blends[1], later):
        for name in ('weights', 'mean_square', 'coverage', 'scale'):
            np.testing.assert_allclose(getattr(blend, name), getattr(blends[0], name), rtol=1e-9)


def test_a_level_counts_the_less_the_sooner_within_a_third_of_a_period_unless_its_errors_are_smaller():
    blend = Blend([0.1, 0.2, 0.4, 0.8, 1.6], STEP, 1.2, 1, (1.0, 2.0), level=0)
    assert (blend.weights[0] / blend.weights[1])[:, 0] == pytest.approx([2**-7, 2**-4, 0.5, 0.5, 0.5])
    blend.set_period(STEP, 2.4)
    assert (blend.weights[0] / blend.weights[1])[:, 0] == pytest.approx([2**-10, 2**-7, 2**-4, 0.5, 0.5])
    _run(blend, np.array([0.5, 1.0])[:, None, None] * np.ones((2, 5, 1)), 1.0)
    assert (blend.weights[0] > 0.9).all()


def test_what_was_learnt_of_the_errors_goes_over_to_other_rows_by_the_leads():
    learnt = _blend(axes=2)
    errors = np.array([[[1.0, 3.0], [1.0, 1.0], [2.0, 1.0]], [[3.0, 1.0], [1.0, 2.0], [1.0, 1.0]]])
    _run(learnt, errors, 1.0)
    for step in (0.05, 0.1, 0.2, 0.5):
        blend = Blend(LEADS, step, PERIOD, 2, (1.0, 1.0))
        blend.carry_over(learnt)
        # of leads that fall on one row, the first
        first = [place for place, lead in enumerate(blend.place_of_lead) if lead not in blend.place_of_lead[:place]]
        assert blend.steps[blend.place_of_lead][first] == pytest.approx(np.maximum(np.round(LEADS / step), 1)[first])
        for name in ('weights', 'mean_square', 'scale', 'coverage', 'blended_square'):
            np.testing.assert_array_equal(getattr(blend, name), getattr(learnt, name)[..., first, :])
        # and the first errors on the new rows change little of it
        before = blend.weights.copy()
        for _ in range(3):
            blend.take(np.zeros(2), errors[:, first], np.ones_like(errors[:, first]))
        np.testing.assert_allclose(blend.weights, before, atol=0.1)


@given(st.lists(st.booleans(), min_size=3, max_size=3))
def test_weights_of_those_present_add_up(present):
    leave_out(weights := np.array([0.2, 0.0, 0.8]), np.where(present, 1.0, np.nan))
    assert weights.sum() == pytest.approx(float(any(present)))
    assert (weights[~np.array(present)] == 0.0).all()


def test_within_the_first_row_the_sooner_the_more_the_first_candidate_counts():
    """Which follows every sample: its variance at once, the average's from the first row on, never less than now."""
    blend = Blend([0.01, 0.05, 0.09, 0.1, 0.5], STEP, PERIOD, 1, (1.0, 1.0))
    for _ in range(600):
        blend.take(np.zeros(1), np.array([2.0, 1.0])[:, None, None] * np.ones((2, 2, 1)), np.ones((2, 2, 1)))
    mean = np.array([2.0, 1.0])[:, None, None] * np.ones((2, 5, 1))
    told = blend.combine(0, mean, np.ones((2, 5, 1, 1)) * np.array([0.1, 1.0])[:, None, None, None], [0])
    assert told.mean[:, 0] == pytest.approx([1.99, 1.75, 1.19, 1.0, 1.0], abs=0.01)
    # errors that are always the same let the scale oscillate about them
    assert (np.diff(told.deviation[:, 0]) > -0.005).all()
    bounded = blend.combine(0, mean, np.full((2, 5, 1, 1), 1e-9), [0], least_variance=np.array([0.25]))
    assert bounded.deviation == pytest.approx(0.5)
