"""The probability of staying quiet, and how it came true, against closed forms."""

import math

import numpy as np
import pytest

from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.quiescence import PointLimits, Quiescence, QuiescenceLimits, ReliabilityRecord
from swath_sysid.common.errors import InputError

LEADS = np.arange(1, 11) * 0.1
ONES = np.ones(4)


def test_reliability_of_true_probabilities_is_the_diagonal():
    rng = np.random.default_rng(7)
    record = ReliabilityRecord()
    unknown = record.diagram()
    assert unknown.count.sum() == 0 and math.isnan(unknown.brier) and np.isnan(unknown.forecast).all()
    told = rng.uniform(size=20000)
    happened = rng.uniform(size=told.size) < told
    for probability, outcome in zip(told, happened, strict=True):
        record.add(probability, outcome)
    diagram = record.diagram()
    assert np.allclose(diagram.forecast, diagram.observed, atol=0.04)
    assert diagram.count.sum() == told.size
    assert diagram.brier == pytest.approx(np.mean((told - happened) ** 2))
    assert diagram.brier_of_climate == pytest.approx(np.var(happened))


STILL, DEVIATION = np.zeros((10, 4)), np.full((10, 4), 0.02)


def told_after(quiet, seconds, spread_at, seed):
    """The probability after forecasts of no motion that erred so much each second."""
    rng = np.random.default_rng(seed)
    for k in range(seconds):
        quiet.learn(float(k), lambda stamps, k=k: np.full((stamps.size, 4), spread_at(k) * rng.normal()))
        told, _ = quiet.assess(float(k), STILL, DEVIATION, ONES)
    return told


def test_errors_count_in_the_size_of_the_motion():
    quiet = Quiescence(QuiescenceLimits(pitch=0.1, duration=1.0), LEADS)
    told = told_after(quiet, 400, lambda k: 0.02, 9)
    assert told > 0.99
    for k in range(400, 900):
        unchanged, _ = quiet.assess(float(k), STILL, DEVIATION, np.array([8.0, 1.0, 8.0, 1.0]))
    assert unchanged == told
    for k in range(900, 1400):
        rough, _ = quiet.assess(float(k), STILL, DEVIATION, np.array([1.0, 8.0, 1.0, 8.0]))
    assert rough == pytest.approx(math.erf(0.1 / 0.16 / math.sqrt(2.0)), abs=0.1)
    # older forecasts count less while little is known
    quiet = Quiescence(QuiescenceLimits(roll=0.1, duration=1.0), LEADS)
    assert told_after(quiet, 120, lambda k: 0.5 if k < 50 else 0.01, 11) > 0.98


def test_before_any_experience_the_worst_lead_decides_and_what_is_not_measured_is_unknown():
    quiet, deviation = Quiescence(QuiescenceLimits(roll_rate=0.2, duration=1.0), LEADS), np.full((10, 4), 0.1)
    deviation[4, 2] = 0.2
    assert quiet.assess(0.0, STILL, deviation, ONES)[0] == pytest.approx(math.erf(1.0 / math.sqrt(2.0)))
    quiet, motion = Quiescence(QuiescenceLimits(roll=0.1, duration=1.0), LEADS), STILL.copy()
    motion[:, [1, 3]] = math.nan
    assert quiet.assess(0.0, motion, DEVIATION, ONES)[0] > 0.99
    motion[:, [0, 2]] = math.nan
    assert math.isnan(quiet.assess(1.0, motion, DEVIATION, ONES)[0])


def test_other_limits_are_served_by_what_was_learnt():
    quiet = Quiescence(QuiescenceLimits(duration=1.0), LEADS)
    assert math.isnan(told_after(quiet, 400, lambda k: 0.08, 10))
    quiet.set_limits(QuiescenceLimits(roll=0.1, duration=1.0))
    told, _ = quiet.assess(400.0, STILL, DEVIATION, ONES)
    assert told == pytest.approx(math.erf(0.1 / 0.08 / math.sqrt(2.0)), abs=0.08)


def test_impossible_limits_are_refused():
    for duration in (9.0, 0.05):
        with pytest.raises(InputError, match='horizon'):
            ForecasterSettings(quiescence=QuiescenceLimits(duration=duration))
    for limits, name in (({'roll': -1.0}, 'roll'), ({'points': (PointLimits('bow', heave=0.0),)}, r'bow\.heave')):
        with pytest.raises(InputError, match=name):
            QuiescenceLimits(**limits)


def learned(limits, spread, leads, quantities=('roll', 'pitch', 'roll_rate', 'pitch_rate')):
    """A running probability whose forecasts of zero have erred by ``spread`` from lead to lead, shape (H,)."""
    rng = np.random.default_rng(12)
    quiet = Quiescence(limits, leads, quantities)
    shape = leads.size, len(quantities)
    for k in range(400):
        quiet.learn(float(k), lambda stamps: spread[:, None] * rng.normal(size=shape[1]))
        quiet.assess(float(k), np.zeros(shape), np.full(shape, 0.02), np.ones(shape[1]))
    return quiet


def test_a_window_of_calm_begins_when_the_motion_dies_down_and_ends_when_it_returns():
    leads, deviation, motion = np.arange(1, 51) * 0.1, np.full((50, 4), 0.02), np.zeros((50, 4))
    quiet = learned(QuiescenceLimits(roll=0.1, duration=1.0), np.full(50, 0.01), leads)
    motion[:, 0] = np.where((leads > 1.45) & (leads < 4.05), 0.0, 0.3)
    _, window = quiet.assess(401.0, motion, deviation, ONES)
    assert (window.begin, window.end) == (pytest.approx(1.5), pytest.approx(4.0))
    assert window.probability > 0.99
    motion[25:] = 0.3
    assert quiet.assess(402.0, motion, deviation, ONES)[1].end == pytest.approx(2.5)
    motion[24:] = 0.3
    assert quiet.assess(403.0, motion, deviation, ONES)[1] is None
    # one error a member, which grows along the horizon: inside up to the lead where it passes the limit
    quiet = learned(QuiescenceLimits(roll=0.1, duration=1.0, probability=0.9), 0.05 * leads, leads)
    _, window = quiet.assess(401.0, np.zeros((50, 4)), deviation, ONES)
    assert window.begin == 0.0 and window.end == pytest.approx(0.1 / (0.05 * 1.645), rel=0.2)
    assert window.probability == pytest.approx(0.9, abs=0.05)


def test_limits_about_the_trim_and_of_a_point():
    motion, trim = STILL.copy(), np.array([0.0, 0.2, 0.0, 0.0])
    motion[:, 1] = 0.2
    for about_trim in (False, True):
        quiet = learned(QuiescenceLimits(pitch=0.05, duration=1.0, about_trim=about_trim), np.full(10, 0.01), LEADS)
        assert (quiet.assess(401.0, motion, DEVIATION, ONES, trim)[0] > 0.9) is about_trim
    quantities = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'bow.heave', 'bow.vertical_velocity')
    limits = QuiescenceLimits(duration=1.0, points=(PointLimits('bow', vertical_velocity=0.5),))
    quiet, motion = learned(limits, np.full(10, 0.01), LEADS, quantities), np.zeros((10, 6))
    motion[:, 4] = 9.0
    assert quiet.assess(401.0, motion, np.full((10, 6), 0.02), np.ones(6))[0] > 0.99
    motion[:, 5] = 0.6
    assert quiet.assess(402.0, motion, np.full((10, 6), 0.02), np.ones(6))[0] < 0.01
