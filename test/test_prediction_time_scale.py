"""The period of a motion against sines whose period is known, and when another one is taken."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swath_sysid.attitude.prediction.hull_state import USUAL_PERIOD
from swath_sysid.attitude.prediction.time_scale import TimeScale, period_of

STEP, SIZE = 0.1, 0.1
NOISE = 0.01, 0.03
SILENCE = np.zeros(2), np.zeros(2)


def swing(period, periods=40, step=STEP, sizes=(SIZE, 0.0)):
    """Angles and rates (N, 2) of sines over whole periods of the motion about each axis."""
    w, time = 2.0 * math.pi / period, step * np.arange(round(periods * period / step))
    turn = w * time[:, None] + np.array([0.3, 1.1])
    return np.array(sizes) * np.sin(turn), np.array(sizes) * w * np.cos(turn)


def unmeasured(angles):
    return np.full_like(angles, math.nan)


@pytest.mark.parametrize('period', [0.8, 3.2, 15.0])
def test_the_period_of_a_sine_is_its_period(period):
    assert period_of(*swing(period), STEP, *SILENCE) == pytest.approx(period, rel=2e-3)
    # a difference over a step is the mean of the rate over it, which has less of the sine by sin(x) / x
    angles, _ = swing(period)
    half_turn = math.pi * STEP / period
    found = period_of(angles, unmeasured(angles), STEP, *SILENCE)
    assert found == pytest.approx(period * half_turn / math.sin(half_turn), rel=5e-3)


@pytest.mark.parametrize('has_rates', [True, False])
def test_noise_of_known_size_is_taken_off(has_rates):
    rng, period = np.random.default_rng(1), 4.0
    angles, rates = swing(period, 1500, sizes=(0.03, 0.03))
    # a difference doubles the noise of angles, over the square of a step
    angle_noise = NOISE[0] if has_rates else 1e-3
    angles = angles + rng.normal(0.0, angle_noise, angles.shape)
    rates = rates + rng.normal(0.0, NOISE[1], rates.shape) if has_rates else unmeasured(angles)
    variances = np.full(2, angle_noise**2), np.full(2, NOISE[1] ** 2)
    assert period_of(angles, rates, STEP, *variances) == pytest.approx(period, rel=0.02)
    # what would be found otherwise
    assert abs(period_of(angles, rates, STEP, *SILENCE) / period - 1.0) > 0.04


def test_what_is_missing_is_left_out_and_one_that_is_not_measured_does_not_count():
    rng, (angles, rates) = np.random.default_rng(2), swing(3.0, 100, sizes=(SIZE, 0.5 * SIZE))
    for values in (angles, rates):
        values[rng.uniform(size=values.shape) < 0.2] = math.nan
    assert period_of(angles, rates, STEP, *SILENCE) == pytest.approx(3.0, rel=0.02)
    angles[:, 0] = math.nan
    assert period_of(angles, rates, STEP, *SILENCE) == pytest.approx(3.0, rel=0.02)
    angles[2:, 1] = math.nan
    assert math.isnan(period_of(angles, rates, STEP, *SILENCE)), 'two samples are no motion'


@pytest.mark.parametrize('sizes', [(1.0, 1.0), (2.0, 1.0), (0.1, 1.0)])
def test_two_axes_count_as_their_motion_is_large(sizes):
    """The root of the mean square of the frequencies, weighted by the variances of the angles."""
    periods = np.array([2.0, 6.0])
    both = [swing(period, 120.0 / period, sizes=sizes) for period in periods]
    angles, rates = (np.column_stack([one[:, 0], other[:, 1]]) for one, other in zip(*both, strict=True))
    square = np.square(sizes)
    wanted = 1.0 / math.sqrt(square @ periods**-2 / square.sum())
    assert period_of(angles, rates, STEP, *SILENCE) == pytest.approx(wanted, rel=2e-3)


@given(factor=st.floats(0.05, 20.0), seed=st.integers(0, 100), has_rates=st.booleans())
def test_motion_stretched_in_time_has_a_period_stretched_as_much(factor, seed, has_rates):
    rng = np.random.default_rng(seed)
    angles, rates = rng.normal(size=(2, 100, 2))
    if not has_rates:
        rates = unmeasured(rates)
    noise, of_rate = np.full(2, 0.01), np.full(2, 0.02)
    found = period_of(angles, rates, STEP, noise, of_rate)
    stretched = period_of(angles, rates / factor, factor * STEP, noise, of_rate / factor**2)
    assert stretched == pytest.approx(factor * found, rel=1e-9)


def test_a_craft_at_rest_has_no_period():
    rng = np.random.default_rng(3)
    variances = np.full(2, NOISE[0] ** 2), np.full(2, NOISE[1] ** 2)
    for _ in range(20):
        angles, rates = (rng.normal(0.0, noise, (300, 2)) for noise in NOISE)
        assert math.isnan(period_of(angles, rates, STEP, *variances))
        assert math.isnan(period_of(angles, unmeasured(rates), STEP, *variances))
    for angles in (np.zeros((0, 2)), np.zeros((300, 2)), np.full((300, 2), math.nan)):
        assert math.isnan(period_of(angles, angles, STEP, *SILENCE))


def looks(scale, found, until, step=0.01):
    """Ages, s, at which it looked and whether it took what was found."""
    looked = []
    for age in np.arange(1, round(until / step) + 1) * step:
        if scale.is_due(age):
            looked.append((age, scale.follow(found(age) if callable(found) else found, age)))
    return looked


def test_it_looks_at_a_quarter_a_half_one_and_two_periods_and_then_every_four():
    scale = TimeScale()
    ages, taken = zip(*looks(scale, USUAL_PERIOD, 40.0), strict=True)
    assert not any(taken) and scale.period == USUAL_PERIOD
    assert np.array(ages) / USUAL_PERIOD == pytest.approx([0.25, 0.5, 1.0, 2.0, 6.0, 10.0], abs=0.01)


@pytest.mark.parametrize('period', [0.5, 10.0])
def test_a_period_that_is_far_off_is_taken_at_once_and_looked_at_again_by_its_own_measure(period):
    scale = TimeScale()
    ages, taken = zip(*looks(scale, period, 16.0 * max(period, USUAL_PERIOD)), strict=True)
    assert taken[0] and not any(taken[1:]) and scale.period == period
    assert np.diff(ages)[-1] == pytest.approx(4.0 * period, abs=0.02)


def test_another_period_must_differ_by_more_the_longer_the_motion_is_known():
    """By 15 % at first, 5 % once four periods are known, and 40 % of a sea that is known for long."""
    for ratio, early, settled, late in (
        (1.04, False, False, False),
        (1.1, False, True, False),
        (1.3, True, True, False),
        (1.5, True, True, True),
    ):
        for other in (ratio * USUAL_PERIOD, USUAL_PERIOD / ratio):
            taken = []
            for begin in (0.0, 3.9, 15.0):
                scale = TimeScale()
                before = USUAL_PERIOD * begin
                found = looks(scale, lambda age, other=other, begun=before: other if age > begun else math.nan, 70.0)
                taken.append(next(took for age, took in found if age > before))
                assert scale.period == (other if any(took for _, took in found) else USUAL_PERIOD)
            assert taken == [early, settled, late], ratio


def test_nothing_found_changes_nothing_and_the_past_looked_at_is_thirty_periods():
    scale = TimeScale()
    assert not any(taken for _, taken in looks(scale, math.nan, 30.0)) and scale.period == USUAL_PERIOD
    assert scale.past(7.0) == 7.0 and scale.past(1e4) == pytest.approx(30.0 * USUAL_PERIOD)
