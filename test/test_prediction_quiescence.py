"""The probability of staying quiet, and how it came true, against closed forms."""
import math

import numpy as np
import pytest

from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.quiescence import Quiescence, QuiescenceLimits, ReliabilityRecord
from swath_sysid.common.errors import InputError

LEADS = np.arange(1, 11) * 0.1
ONES = np.ones(2)


def test_reliability_of_true_probabilities_is_the_diagonal():
    rng = np.random.default_rng(7)
    record = ReliabilityRecord()
    told = rng.uniform(size=20000)
    happened = rng.uniform(size=told.size) < told
    for probability, outcome in zip(told, happened, strict=True):
        record.add(probability, outcome)
    diagram = record.diagram()
    assert np.allclose(diagram.told, diagram.happened, atol=0.04)
    assert diagram.count.sum() == told.size
    assert diagram.brier == pytest.approx(np.mean((told - happened) ** 2))
    assert diagram.brier_of_climate == pytest.approx(np.var(happened))


def test_a_diagram_without_outcomes_is_unknown():
    diagram = ReliabilityRecord().diagram()
    assert diagram.count.sum() == 0 and math.isnan(diagram.brier) and np.isnan(diagram.told).all()


def test_quiescence_counts_the_members_that_stay_inside():
    rng = np.random.default_rng(8)
    quiet = Quiescence(QuiescenceLimits(roll=0.1, duration=1.0), LEADS)
    motion, deviation = np.zeros((10, 2, 2)), np.full((10, 2, 2), 0.02)
    for k in range(400):
        quiet.learn(float(k), lambda stamps: np.full((stamps.size, 2, 2), 0.08 * rng.normal()))
        told = quiet.probability(float(k), motion, deviation, ONES)
    assert told == pytest.approx(math.erf(0.1 / 0.08 / math.sqrt(2.0)), abs=0.08)


def test_errors_count_in_the_size_of_the_motion():
    rng = np.random.default_rng(9)
    quiet = Quiescence(QuiescenceLimits(pitch=0.1, duration=1.0), LEADS)
    motion, deviation = np.zeros((10, 2, 2)), np.full((10, 2, 2), 0.02)
    for k in range(400):
        quiet.learn(float(k), lambda stamps: np.full((stamps.size, 2, 2), 0.02 * rng.normal()))
        told = quiet.probability(float(k), motion, deviation, ONES)
    assert told > 0.99
    for k in range(400, 900):
        unchanged = quiet.probability(float(k), motion, deviation, np.array([8.0, 1.0]))
    assert unchanged == told
    for k in range(900, 1400):
        rough = quiet.probability(float(k), motion, deviation, np.array([1.0, 8.0]))
    assert rough == pytest.approx(math.erf(0.1 / 0.16 / math.sqrt(2.0)), abs=0.1)


def test_older_forecasts_count_less_while_little_is_known():
    rng = np.random.default_rng(11)
    quiet = Quiescence(QuiescenceLimits(roll=0.1, duration=1.0), LEADS)
    motion, deviation = np.zeros((10, 2, 2)), np.full((10, 2, 2), 0.02)
    for k in range(120):
        spread = 0.5 if k < 50 else 0.01
        quiet.learn(float(k), lambda stamps, s=spread: np.full((stamps.size, 2, 2), s * rng.normal()))
        told = quiet.probability(float(k), motion, deviation, ONES)
    assert told > 0.98


def test_before_any_experience_the_worst_lead_decides():
    quiet = Quiescence(QuiescenceLimits(roll_rate=0.2, duration=1.0), LEADS)
    deviation = np.full((10, 2, 2), 0.1)
    deviation[4, 0, 1] = 0.2
    assert quiet.probability(0.0, np.zeros((10, 2, 2)), deviation, ONES) == pytest.approx(
        math.erf(1.0 / math.sqrt(2.0))
    )


def test_a_limited_axis_that_is_not_measured_leaves_the_probability_unknown():
    quiet = Quiescence(QuiescenceLimits(roll=0.1, duration=1.0), LEADS)
    motion = np.zeros((10, 2, 2))
    motion[:, 1] = math.nan
    assert quiet.probability(0.0, motion, np.full((10, 2, 2), 0.02), ONES) > 0.99
    motion[:, 0] = math.nan
    assert math.isnan(quiet.probability(1.0, motion, np.full((10, 2, 2), 0.02), ONES))


def test_other_limits_are_served_by_what_was_learnt():
    rng = np.random.default_rng(10)
    quiet = Quiescence(QuiescenceLimits(duration=1.0), LEADS)
    motion, deviation = np.zeros((10, 2, 2)), np.full((10, 2, 2), 0.02)
    for k in range(400):
        quiet.learn(float(k), lambda stamps: np.full((stamps.size, 2, 2), 0.08 * rng.normal()))
        assert math.isnan(quiet.probability(float(k), motion, deviation, ONES))
    quiet.set_limits(QuiescenceLimits(roll=0.1, duration=1.0))
    told = quiet.probability(400.0, motion, deviation, ONES)
    assert told == pytest.approx(math.erf(0.1 / 0.08 / math.sqrt(2.0)), abs=0.08)


def test_impossible_limits_are_refused():
    for duration in (9.0, 0.05):
        with pytest.raises(InputError, match='horizon'):
            ForecasterSettings(quiescence=QuiescenceLimits(duration=duration))
    with pytest.raises(InputError, match='roll'):
        QuiescenceLimits(roll=-1.0)
