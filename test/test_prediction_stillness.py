"""In still water the hull alone forecasts, at once; in a resonant sea it does not."""
import math

import numpy as np
import pytest

from swath_sysid.hull.catalogue import hull_named
from swath_sysid.hull.simulation import simulate
from swath_sysid.prediction.ekf import runge_kutta_step
from swath_sysid.prediction.forecaster import CLAIM
from swath_sysid.prediction.predictor import ImuSample, Predictor, PredictorSettings
from swath_sysid.prediction.stillness import Stillness
from swath_sysid.prediction.waves import fit_waves

HANDLING, HOLD = 1.5, 1.0


def handled(model, angles, free=12.0, dt=0.01, start=3.0):
    """A craft that is lifted, held and let go again and again: times, angles, rates, times of letting go."""
    angle, rate, releases = [np.zeros(round(start / dt))], [np.zeros(round(start / dt))], []
    before = 0.0
    for target in angles:
        share = 0.5 - 0.5 * np.cos(np.pi * np.arange(round(HANDLING / dt)) * dt / HANDLING)
        lift = before + (target - before) * share
        angle += [lift, np.full(round(HOLD / dt), target)]
        rate += [np.gradient(lift, dt), np.zeros(round(HOLD / dt))]
        releases.append(sum(map(len, angle)) * dt)
        free_angle, free_rate = simulate(model, target, 0.0, np.arange(0.0, free, dt))
        angle.append(free_angle)
        rate.append(free_rate)
        before = free_angle[-1]
    angle, rate = np.concatenate(angle), np.concatenate(rate)
    return np.arange(angle.size) * dt, angle, rate, releases


def forecasts(model, time, angle, rate, seed, leads, noise=(0.0005, 0.003)):
    """Stamps, angles and 90 % half widths (N, L) from a predictor that knows the hull, and the predictor."""
    rng = np.random.default_rng(seed)
    seen = angle + rng.normal(0.0, noise[0], angle.size), rate + rng.normal(0.0, noise[1], rate.size)
    predictor, told = Predictor(PredictorSettings(leads=leads)), []
    predictor.set_model(model.axis, model)
    for stamp, a, w in np.column_stack([time, *seen]).tolist():
        sample = {model.axis: a, f'{model.axis}_rate': w}
        step = predictor.observe(ImuSample(
            stamp, **sample, roll_variance=noise[0] ** 2, pitch_variance=noise[0] ** 2,
            roll_rate_variance=noise[1] ** 2, pitch_rate_variance=noise[1] ** 2,
        ))  # fmt: skip
        if step.refit is not None:
            predictor.install(fit_waves(step.refit))
        if step.forecast is not None:
            ahead = step.forecast.axes[model.axis]
            told.append((stamp, ahead.angle, ahead.half_width[:, 1]))
    return np.array([t[0] for t in told]), np.array([t[1] for t in told]), np.array([t[2] for t in told]), predictor


@pytest.mark.parametrize('hull, degrees', [('swath-roll', 5.0), ('swath-pitch', 4.0)])
def test_a_craft_let_go_again_is_forecast_by_its_hull_from_the_first_moment(hull, degrees):
    model = hull_named(hull).model
    period = round(model.natural_period, 2)
    leads = 0.5, 1.0, period
    time, angle, rate, releases = handled(model, [math.radians(degrees)] * 2)
    stamps, told, width, _ = forecasts(model, time, angle, rate, 1, leads)
    for release in releases[1:]:
        moving = np.std(angle[(time >= release) & (time < release + 10.0)])
        for place, lead in enumerate(leads):
            scored = (stamps >= release + 0.3) & (stamps + lead < release + 10.0)
            missed = told[scored, place] - np.interp(stamps[scored] + lead, time, angle)
            assert np.sqrt(np.mean(missed**2)) < (0.1 if lead == period else 0.2) * moving
            assert np.mean(np.abs(missed) <= width[scored, place]) > 0.8
            assert np.median(width[scored, place]) < 0.35 * moving


def test_a_resonant_sea_is_not_taken_for_still_water():
    model = hull_named('swath-roll').model
    own = 2.0 * math.pi / model.natural_period
    rng = np.random.default_rng(2)
    frequency = rng.uniform(0.8 * own, 1.2 * own, 60)
    amplitude, phase = 0.02 * np.sqrt(2.0 / 60), rng.uniform(0.0, 2.0 * math.pi, 60)
    time, state, rows = np.arange(0.0, 150.0, 0.01), (0.0, 0.0), []
    for now in time.tolist():
        rows.append(state)
        moment = float((amplitude * np.cos(frequency * (now + 0.005) + phase)).sum())
        state = runge_kutta_step(model.acceleration, *state, moment, 0.01)
    angle, rate = np.array(rows, dtype=float).T
    stamps, told, _, predictor = forecasts(model, time, angle, rate, 3, (1.0, 2.5))
    scored = stamps > 60.0
    believed = predictor.diagnostics()
    error = told[scored, 1][:-25] - np.interp(stamps[scored][:-25] + 2.5, time, angle)
    assert np.sqrt(np.mean(error**2)) < 0.6 * angle[time > 60.0].std()
    assert believed.weights[0, 1, 2] < 0.9


def claimed(levels, interval=0.1):
    """What is claimed after each of the disturbances, the errors told being as small as can be."""
    stillness, claims = Stillness(np.array([1.0]), 300.0, 0.3), []
    for k, level in enumerate(levels):
        stillness.follow(k * interval, interval if k else 0.0, level, 1e-6, 1.0, 2.5)
        claims.append(stillness.claims(np.array([1e-9]), np.array([1.0]))[0])
    return np.array(claims)


def test_stillness_is_claimed_as_soon_as_a_moment_has_vanished_and_not_when_it_passes_through_zero():
    held = claimed([0.0] * 30 + [1.0] * 20 + [0.0] * 10)
    assert held[:30].min() > 0.9 and held[32:50].max() < 0.01 and held[54:].min() > 0.99
    swaying = claimed(np.sin(2.0 * math.pi / 2.5 * 0.1 * np.arange(600)))
    assert swaying[100:].max() < 0.5


def test_a_claim_that_does_not_come_true_is_withdrawn():
    stillness = Stillness(np.array([1.0, 2.0]), 300.0, 0.3)
    for k in range(200):
        stillness.follow(0.1 * k, 0.1, 0.01, 1e-6, 1e-4, 2.5)
        stillness.learn(
            np.ones(2), np.full(2, 0.1 * k), *np.ones((3, 2)), np.array([1.0, 0.1]), np.array([0.1, 1.0]),
            np.array([2.0, 2.0]), 0.1,
        )  # fmt: skip
    assert stillness.trust[0] < 0.01 and stillness.trust[1] == 1.0
    assert stillness.scale == pytest.approx([4.0, 4.0], rel=0.2)


def test_what_hands_did_says_nothing_of_still_water():
    stillness = Stillness(np.array([1.0]), 300.0, 0.3)
    for k in range(50):
        stillness.follow(0.1 * k, 0.1, 0.01, 1e-6, 1e-4, 2.5)
    issued = stillness.mean_level
    stillness.follow(5.0, 0.1, 1.0, 1e-6, 1.0, 2.5)
    stillness.learn(
        np.ones(1), np.array([4.5]), np.array([1e-4]), np.array([issued]), np.ones(1), np.ones(1), np.full(1, 0.1),
        np.ones(1), 0.1,
    )
    assert stillness.trust[0] == 1.0


@pytest.mark.parametrize('other', [None, hull_named('swath-roll').model.with_trim(0.01)])
def test_another_hull_amid_claims_of_still_water_is_taken_up(other):
    model = hull_named('swath-roll').model
    time, angle, rate, _ = handled(model, [math.radians(4.0)] * 2)
    predictor, claimed = Predictor(), 0
    predictor.set_model('roll', model)
    for k, (stamp, a, w) in enumerate(np.column_stack([time, angle, rate]).tolist()):
        if k and k % 301 == 0:
            issued = predictor._forecaster._issued
            claimed += sum(bool((i.table[0, :, CLAIM] > 0.0).any()) for i in issued)
            predictor.set_model('roll', other)
            assert all((i.table[0, :, CLAIM] == 0.0).all() for i in issued)
            predictor.set_model('roll', model)
        step = predictor.observe(ImuSample(stamp, roll=a, roll_rate=w))
        assert step.used
    assert claimed > 0
