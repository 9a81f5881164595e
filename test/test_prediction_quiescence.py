"""The probability of staying quiet, how it came true, and how far a forecast can be trusted, against closed forms."""

import math

import numpy as np
import pytest
from bag_messages import STORE
from records_at_sea import sea

from swath_sysid.attitude.prediction.axis_filter import AxisFilter
from swath_sysid.attitude.prediction.forecast import Forecast
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_filter import HullFilterSettings
from swath_sysid.attitude.prediction.outlook import ErrorLimit, ValidLeads, valid_lead
from swath_sysid.attitude.prediction.point import Point, PointMotion
from swath_sysid.attitude.prediction.quiescence import PointLimits, Quiescence, QuiescenceLimits, ReliabilityRecord
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import named_numbers_message
from swath_sysid.formats.topics import TYPES, VALID_LEAD_TOPIC
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import samples_of

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


def test_quiet_is_no_more_certain_than_the_forecasts_that_came_true_allow():
    quiet = Quiescence(QuiescenceLimits(pitch=1.0, duration=1.0), LEADS)
    assert quiet.assess(0.0, STILL, DEVIATION, ONES)[0] == 0.5
    told = [quiet.assess(0.0, STILL, DEVIATION, ONES)[0]]
    for k in range(1, 12):
        quiet.learn(float(k), lambda stamps: np.zeros((stamps.size, 4)))
        told.append(quiet.assess(float(k), STILL, DEVIATION, ONES)[0])
    assert told == pytest.approx([(k + 0.5) / (k + 1.0) for k in range(12)])
    quiet.set_limits(QuiescenceLimits(pitch=0.02, duration=1.0))
    assert quiet.assess(12.0, STILL, DEVIATION, ONES)[0] == pytest.approx(0.683, abs=1e-3)


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
    deviation[4, 2] = 0.4
    assert quiet.assess(0.0, STILL, deviation, ONES)[0] == pytest.approx(math.erf(0.5 / math.sqrt(2.0)))
    quiet, motion = Quiescence(QuiescenceLimits(roll=0.1, duration=1.0), LEADS), STILL.copy()
    motion[:, [1, 3]] = math.nan
    assert quiet.assess(0.0, motion, DEVIATION, ONES)[0] == 0.5
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


# -- valid leads, from closed forms to the message

FINE = 0.1 * np.arange(1, 101)


@pytest.mark.parametrize('power', [0.3, 0.5, 1.0, 2.0])
def test_within_the_lead_a_tenth_of_the_errors_at_most_exceed_the_limit(power):
    spread, limit, rng = FINE**power, 2.0, np.random.default_rng(1)
    found = valid_lead(FINE, spread**2, limit)
    errors = np.abs(spread * rng.normal(size=(4000, FINE.size)))
    share = np.mean(errors[:, found >= FINE] > limit)
    assert share <= 0.11 and found <= limit ** (1.0 / power) + 1e-9
    assert share > 0.085 or found == pytest.approx(limit ** (1.0 / power), abs=2e-3)


def test_the_lead_ends_where_the_expected_error_first_passes_the_limit():
    assert valid_lead(FINE, FINE**2, 0.01) == 0.0
    assert valid_lead(FINE, FINE**2, 100.0) == FINE[-1]
    assert math.isnan(valid_lead(FINE, np.where(FINE > 0.5, np.nan, FINE**2), 0.7))
    # the expected error of an oscillation comes down again, and a user who trusts it until then has been misled
    found = valid_lead(FINE, (0.6 * np.sin(FINE)) ** 2, 0.5)
    assert 0.7 < found <= math.asin(0.5 / 0.6) + 5e-3


def test_the_limit_of_the_expected_error_is_positive():
    for share, angle in ((0.0, 0.0), (0.5, -0.1), (math.nan, 0.0)):
        with pytest.raises(InputError, match='positive share'):
            ErrorLimit(share, angle)


def test_points_have_valid_leads_of_their_own_motion():
    axes, count = [AxisFilter(HullFilterSettings(), 600.0) for _ in range(2)], FINE.size
    valid = ValidLeads(ErrorLimit(0.5, 0.02), axes, 600.0)
    mean, covariance, spread = np.zeros((count, 4)), np.zeros((count, 4, 4)), np.zeros((count, 7, 7))
    covariance[:, 0, 0], mean[:, 1] = (0.01 * FINE) ** 2, np.nan
    spread[:, 0, 0], spread[:, 1, 1] = (0.1 * FINE) ** 2, (0.2 * FINE) ** 2
    for time in np.arange(0.0, 600.0, 0.5):
        motion = np.zeros((count, 3))
        motion[0, :2] = 0.7 * math.sqrt(2.0) * math.sin(time), 1.2 * math.sqrt(2.0) * math.cos(time)
        bow = PointMotion((1.0, 0.0, 0.0), motion, spread)
        valid.follow(time, {'bow': bow})
    found = valid.of(Forecast(0, FINE, mean, covariance, points={'bow': bow}))
    assert set(found) == {'roll', 'bow.heave', 'bow.vertical_velocity'}
    # an error that grows with the lead exceeds the limit in 9 of 100 forecasts up to there
    assert found['roll'] == pytest.approx(2.0, abs=1e-6)
    assert found['bow.heave'] == pytest.approx(3.5, rel=0.03)
    assert found['bow.vertical_velocity'] == pytest.approx(3.0, rel=0.03)


def test_the_message_names_its_values():
    raw = named_numbers_message({'roll': 1.5, 'bow.heave': 0.25})
    message = STORE.deserialize_cdr(raw, TYPES[VALID_LEAD_TOPIC])
    (dimension,) = message.layout.dim
    assert (dimension.label, dimension.size, dimension.stride) == ('roll,bow.heave', 2, 2)
    assert message.data.tolist() == [1.5, 0.25]


@pytest.mark.long
def test_a_smaller_limit_is_passed_sooner_and_the_state_is_reported():
    leads = []
    for limit in (ErrorLimit(), ErrorLimit(0.25), ErrorLimit(0.25, 10.0)):
        settings = ForecasterSettings(valid_error=limit, points=(Point('bow', (1, 0, 0)),))
        pipeline = ForecastPipeline(PipelineSettings(forecaster=settings))
        steps = [pipeline.add_sample(sample) for sample in samples_of(sea(300.0).between(0.0, 60.0))]
        leads.append(next(step.outlook.valid_leads for step in reversed(steps) if step.outlook is not None))
        assert pipeline.diagnostics().valid_leads == leads[-1]
    half, quarter, anything = leads
    assert quarter['roll'] < half['roll'] and anything['roll'] == 5.0
