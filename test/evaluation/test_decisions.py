"""Calm windows as decisions, against counts by hand and in loops that share nothing with the code."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.quiescence import CalmWindow, QuiescenceLimits
from swath_sysid.evaluation.decisions import (
    CALM_NOW,
    CLIMATOLOGY,
    FORECAST,
    lead_times,
    samples_inside,
    score_decisions,
    score_rule,
    stays_inside,
)

TIME = 0.1 * np.arange(6000)
DURATION = 2.0


def counted(stamps, go, came, duration):
    """F1, precision, recall, actions and false alarms a minute, one decision after the other."""
    outcome = {pair: 0 for pair in itertools.product((True, False), repeat=2)}
    busy, actions, failures = None, 0, 0
    for stamp, goes, right in zip(stamps.tolist(), go.tolist(), came.tolist(), strict=True):
        outcome[goes, right] += 1
        if goes and (busy is None or stamp >= busy):
            busy, actions = stamp + duration, actions + 1
            failures += 0 if right else 1
    precision = outcome[True, True] / (outcome[True, True] + outcome[True, False])
    recall = outcome[True, True] / (outcome[True, True] + outcome[False, True])
    f1 = 2.0 / (1.0 / precision + 1.0 / recall)
    return f1, precision, recall, actions, failures / ((stamps[-1] - stamps[0]) / 60.0)


def test_a_rule_is_counted():
    for seed in range(3):
        rng, stamps = np.random.default_rng(seed), TIME[::5]
        came = rng.random(stamps.size) < 0.3
        go = rng.random(stamps.size) < np.where(came, 0.7, 0.2)
        found, expected = score_rule(stamps, go, came, DURATION), counted(stamps, go, came, DURATION)
        assert (found.f1, found.precision, found.recall, found.actions, found.false_alarms) == pytest.approx(expected)
    none = np.zeros(10, dtype=bool)
    silent = score_rule(TIME[:10], none, ~none, DURATION)
    assert silent.f1 == silent.recall == silent.actions == silent.false_alarms == 0.0 and math.isnan(silent.precision)
    rough = score_rule(TIME[:10], ~none, none, DURATION)
    assert rough.f1 == rough.precision == 0.0 and math.isnan(rough.recall) and rough.false_alarms > 0.0


def test_the_craft_stays_inside_until_a_sample_is_outside():
    rng = np.random.default_rng(4)
    inside = (rng.random(TIME.size) < 0.97).astype(float)
    inside[300] = np.nan
    found = stays_inside(TIME, inside, TIME, DURATION)
    for k in range(TIME.size):
        after = inside[k + 1 : k + 21]
        if after.size < 20 or np.isnan(after).any():
            assert math.isnan(found[k])
        else:
            assert found[k] == after.min()


def test_a_window_was_announced_from_the_forecast_that_first_held_it():
    stamps = np.arange(20.0)
    quiet = np.isin(stamps, [5.0, 6.0, 12.0, 17.0]).astype(float)
    # of windows from 5 to 8, 12 to 14 and 17 to 19: the first known 3 s ahead, the second withdrawn, the third never
    windows = [None] * 20
    for k in (2, 3, 4, 5):
        windows[k] = CalmWindow(5.0 - k, 8.0 - k, 0.9)
    windows[9] = CalmWindow(3.0, 5.0, 0.9)
    windows[11] = windows[12] = CalmWindow(0.5, 2.5, 0.9)
    assert lead_times(stamps, windows, quiet, 2.0).tolist() == pytest.approx([3.0, 1.0, math.nan], nan_ok=True)


def test_a_forecast_that_knows_beats_the_rules_that_do_not():
    """A beating roll: quiet where both waves cancel; one forecast knows the future, the other only the base rate."""
    roll = 0.1 * (np.sin(2.0 * TIME) + np.sin(2.2 * TIME))
    trial, limits = Trial(TIME, roll=roll), QuiescenceLimits(roll=0.1, duration=DURATION)
    stamps = TIME[:-200:5]
    quiet = stays_inside(TIME, samples_inside(trial, limits), stamps, DURATION)
    base = quiet.mean()

    def scored_with(probability):
        outlooks = [SimpleNamespace(quiescence=p, calm=None) for p in probability]
        horizon = SimpleNamespace(leads=np.array([0.1, 5.0]))
        pairs = zip(stamps.tolist(), outlooks, strict=True)
        steps = [SimpleNamespace(stamp=t, horizon=horizon, outlook=o) for t, o in pairs]
        return score_decisions(trial, steps, limits)

    oracle = scored_with(quiet)
    assert oracle.base_rate == pytest.approx(base) and oracle.counted == stamps.size
    assert oracle.rules[FORECAST].f1 == 1.0 and oracle.rules[FORECAST].false_alarms == 0.0
    # of a rule that always goes the precision is the base rate and the recall one
    assert oracle.rules[CLIMATOLOGY].f1 == pytest.approx(2.0 * base / (1.0 + base))
    assert base < oracle.rules[CALM_NOW].precision < 1.0 and oracle.rules[CALM_NOW].false_alarms > 0.0
    assert oracle.lead_times.sum() == 0 and oracle.unannounced > 5
    assert scored_with(np.full(stamps.size, base)).rules[FORECAST].f1 == 0.0
    assert scored_with(np.full(stamps.size, np.nan)) is None
    assert np.isnan(samples_inside(trial, QuiescenceLimits(roll_rate=0.1))).all()
