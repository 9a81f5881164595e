"""How far a forecast can be trusted, against closed forms, and from the forecaster to the message."""

import math

import numpy as np
import pytest
from bag_messages import STORE
from records_at_sea import sea

from swath_sysid.attitude.prediction.axis_filter import AxisFilter
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_filter import HullFilterSettings
from swath_sysid.attitude.prediction.point import Point, PointMotion
from swath_sysid.attitude.prediction.valid_lead import ErrorLimit, ValidLeads, valid_lead
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import named_numbers_message
from swath_sysid.formats.topics import TYPES, VALID_LEAD_TOPIC
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import run_through, samples_of
from swath_sysid.pipeline.scoring import score

LEADS = 0.1 * np.arange(1, 101)


def test_the_lead_is_where_the_expected_error_first_passes_the_limit():
    """Of an autoregression of first order the error grows as sqrt(1 - exp(-2 t / T))."""
    growth = np.sqrt(1.0 - np.exp(-2.0 * LEADS / 4.0))
    for limit in (0.3, 0.5, 0.9):
        assert valid_lead(LEADS, growth**2, limit) == pytest.approx(-2.0 * math.log(1.0 - limit**2), abs=2e-3)
    assert valid_lead(LEADS, growth**2, 0.01) == 0.0
    assert valid_lead(LEADS, growth**2, 1.1) == LEADS[-1]
    assert math.isnan(valid_lead(LEADS, np.where(LEADS > 0.5, np.nan, growth**2), 0.5))
    # the expected error of an oscillation comes down again, and a user who trusts it until then has been misled
    found = valid_lead(LEADS, (0.6 * np.sin(LEADS)) ** 2, 0.5)
    assert found == pytest.approx(math.asin(0.5 / 0.6), abs=5e-3)
    # variances that rounding alone tells apart
    assert valid_lead(np.array([1.0, 2.0]), np.array([0.25, np.nextafter(0.25, 1.0)]), 0.5) == 2.0
    for share, angle in ((0.0, 0.0), (0.5, -0.1), (math.nan, 0.0)):
        with pytest.raises(InputError, match='positive share'):
            ErrorLimit(share, angle)


def test_points_have_valid_leads_of_their_own_motion():
    axes, count = [AxisFilter(HullFilterSettings(), 600.0) for _ in range(2)], LEADS.size
    valid = ValidLeads(ErrorLimit(0.5, 0.02), LEADS, axes, 600.0)
    mean, covariance, spread = np.zeros((count, 4)), np.zeros((count, 4, 4)), np.zeros((count, 7, 7))
    covariance[:, 0, 0], mean[:, 1] = (0.01 * LEADS) ** 2, np.nan
    spread[:, 0, 0], spread[:, 1, 1] = (0.1 * LEADS) ** 2, (0.2 * LEADS) ** 2
    for time in np.arange(0.0, 600.0, 0.5):
        motion = np.zeros((count, 3))
        motion[0, :2] = 0.7 * math.sqrt(2.0) * math.sin(time), 1.2 * math.sqrt(2.0) * math.cos(time)
        found = valid.assess(time, mean, covariance, {'bow': PointMotion((1.0, 0.0, 0.0), motion, spread)})
    assert found == valid.newest and set(found) == {'roll', 'bow.heave', 'bow.vertical_velocity'}
    assert found['roll'] == pytest.approx(2.0, abs=1e-6)
    assert found['bow.heave'] == pytest.approx(3.5, rel=0.03)
    assert found['bow.vertical_velocity'] == pytest.approx(3.0, rel=0.03)


def test_the_message_names_its_values():
    raw = named_numbers_message({'roll': 1.5, 'bow.heave': 0.25})
    message = STORE.deserialize_cdr(raw, TYPES[VALID_LEAD_TOPIC])
    (dimension,) = message.layout.dim
    assert (dimension.label, dimension.size, dimension.stride) == ('roll,bow.heave', 2, 2)
    assert message.data.tolist() == [1.5, 0.25]


def test_the_error_at_the_valid_lead_is_the_limit():
    settings, waves = ForecasterSettings(leads=(1.0,), horizon=8.0, forecast_rate=5.0, window=120.0), sea(300.0)
    skill = score(waves, run_through(waves, settings, {}), (1.0,), 120.0, 120.0)
    for axis, scores in skill.axes.items():
        found = scores.valid_lead
        assert found.counted > 400 and found.error_over_limit == pytest.approx(1.0, abs=0.2), axis
        assert 0.0 < found.lead[1] <= found.lead[0] <= found.lead[2] <= 8.0
        # the models' own expectation is near what came, and was not made to agree
        assert scores.expected == pytest.approx(scores.nrmse['forecast'], rel=0.3)


def test_a_smaller_limit_is_passed_sooner_and_the_state_is_reported():
    leads = []
    for limit in (ErrorLimit(), ErrorLimit(0.25), ErrorLimit(0.25, 10.0)):
        settings = ForecasterSettings(valid_error=limit, points=(Point('bow', (1, 0, 0)),))
        pipeline = ForecastPipeline(PipelineSettings(forecaster=settings))
        steps = [pipeline.add_sample(sample) for sample in samples_of(sea(300.0).between(0.0, 60.0))]
        leads.append(next(step.horizon.valid_leads for step in reversed(steps) if step.horizon is not None))
        assert pipeline.diagnostics().valid_leads == leads[-1]
    half, quarter, anything = leads
    assert quarter['roll'] < half['roll'] and anything['roll'] == 5.0
