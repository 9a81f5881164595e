"""How far a forecast can be trusted, against closed forms, and from the forecaster to the message."""

import math
from dataclasses import replace

import numpy as np
import pytest
from records_at_sea import sea
from scipy.optimize import brentq

from swath_sysid.attitude.prediction.axis_filter import AxisFilter
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_filter import HullFilterSettings
from swath_sysid.attitude.prediction.point import Point, PointMotion
from swath_sysid.attitude.prediction.valid_lead import ErrorLimit, ValidLeads, valid_lead
from swath_sysid.common.errors import InputError
from swath_sysid.formats.messages import named_numbers_message, typestore
from swath_sysid.formats.topics import TYPES, VALID_LEAD_TOPIC
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import run_through, samples_of
from swath_sysid.pipeline.scoring import score

LEADS = 0.1 * np.arange(1, 101)


def test_the_lead_is_where_the_expected_error_passes_the_limit():
    """Of an autoregression of first order the error grows as sqrt(1 - exp(-2 t / T))."""
    growth = np.sqrt(1.0 - np.exp(-2.0 * LEADS / 4.0))
    for limit in (0.3, 0.5, 0.9):
        assert valid_lead(LEADS, growth**2, limit) == pytest.approx(-2.0 * math.log(1.0 - limit**2), abs=2e-3)
    assert valid_lead(LEADS, growth**2, 0.01) == 0.0
    assert valid_lead(LEADS, growth**2, 1.1) == LEADS[-1]
    assert math.isnan(valid_lead(LEADS, np.where(LEADS > 0.5, np.nan, growth**2), 0.5))


def test_variances_that_rounding_alone_tells_apart_have_a_lead():
    limit = 0.5
    below = limit * limit
    assert valid_lead(np.array([1.0, 2.0]), np.array([below, np.nextafter(below, 1.0)]), limit) == 2.0


def test_what_lies_beyond_the_first_passage_does_not_matter():
    """The expected error of an oscillation comes down again, and a user who trusts it until then has been misled."""

    def error(lead):
        return 0.6 * abs(math.sin(lead))

    first = brentq(lambda lead: error(lead) - 0.5, 0.0, 1.5)
    found = valid_lead(LEADS, np.array([error(lead) ** 2 for lead in LEADS]), 0.5)
    assert found == pytest.approx(first, abs=5e-3) and error(math.pi) < 0.5


def test_points_have_valid_leads_of_their_own_motion():
    axes = [AxisFilter(HullFilterSettings(), 600.0) for _ in range(2)]
    horizon, valid = LEADS, ValidLeads(ErrorLimit(0.5, 0.02), LEADS, axes, 600.0)
    mean, covariance = np.zeros((LEADS.size, 4)), np.zeros((LEADS.size, 4, 4))
    covariance[:, 0, 0] = (0.01 * horizon) ** 2
    mean[:, 1] = np.nan
    spread = np.zeros((LEADS.size, 7, 7))
    spread[:, 0, 0], spread[:, 1, 1] = (0.1 * horizon) ** 2, (0.2 * horizon) ** 2
    for time in np.arange(0.0, 600.0, 0.5):
        motion = np.zeros((LEADS.size, 3))
        motion[0, :2] = 0.7 * math.sqrt(2.0) * math.sin(time), 1.2 * math.sqrt(2.0) * math.cos(time)
        found = valid.assess(time, mean, covariance, {'bow': PointMotion((1.0, 0.0, 0.0), motion, spread)})
    assert found == valid.newest and set(found) == {'roll', 'bow.heave', 'bow.vertical_velocity'}
    assert found['roll'] == pytest.approx(2.0, abs=1e-6)
    assert found['bow.heave'] == pytest.approx(3.5, rel=0.03)
    assert found['bow.vertical_velocity'] == pytest.approx(3.0, rel=0.03)


def test_a_limit_must_be_positive():
    for share, angle in ((0.0, 0.0), (0.5, -0.1), (math.nan, 0.0)):
        with pytest.raises(InputError, match='positive share'):
            ErrorLimit(share, angle)


def test_the_message_names_its_values():
    kind = TYPES[VALID_LEAD_TOPIC]
    message = typestore().deserialize_cdr(named_numbers_message({'roll': 1.5, 'bow.heave': 0.25}), kind)
    (dimension,) = message.layout.dim
    assert (dimension.label, dimension.size, dimension.stride) == ('roll,bow.heave', 2, 2)
    assert message.data.tolist() == [1.5, 0.25]


@pytest.fixture(scope='module')
def waves():
    return sea(300.0)


def test_the_error_at_the_valid_lead_is_the_limit(waves):
    settings = ForecasterSettings(leads=(1.0,), horizon=8.0, forecast_rate=5.0, window=120.0)
    skill = score(waves, run_through(waves, settings, {}), (1.0,), 120.0, 120.0)
    for axis, scores in skill.axes.items():
        found = scores.valid_lead
        assert found.counted > 400 and found.error_over_limit == pytest.approx(1.0, abs=0.2), axis
        assert 0.0 < found.lead[1] <= found.lead[0] <= found.lead[2] <= 8.0
        # the models' own expectation is near what came, and was not made to agree
        assert scores.expected == pytest.approx(scores.nrmse['forecast'], rel=0.3)


def test_a_smaller_limit_is_passed_sooner_and_the_state_is_reported(waves):
    trial, leads = waves.between(0.0, 60.0), {}
    for limit in (ErrorLimit(), ErrorLimit(0.25), ErrorLimit(0.25, 10.0)):
        pipeline = ForecastPipeline(
            PipelineSettings(
                forecaster=replace(ForecasterSettings(), valid_error=limit, points=(Point('bow', (1, 0, 0)),))
            )
        )
        steps = [pipeline.add_sample(sample) for sample in samples_of(trial)]
        leads[limit] = next(step.horizon.valid_leads for step in reversed(steps) if step.horizon is not None)
        assert pipeline.diagnostics().valid_leads == leads[limit]
    half, quarter, anything = leads.values()
    assert quarter['roll'] < half['roll'] and anything['roll'] == 5.0
