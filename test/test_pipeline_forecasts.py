"""The forecast pipeline, of readings as the predictor publishes it and of whole records, as plain numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from imu_stream import EPOCH_NS, NOT_GIVEN, decay_stream, reading
from records_at_sea import sea
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_state import LARGEST_ANGLE_VARIANCE
from swath_sysid.attitude.prediction.point import PointMotion
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.formats.forecast_output import ForecastMessages
from swath_sysid.formats.messages import imu_reading, stamp_ns, typestore
from swath_sysid.formats.topics import type_of
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import run_through

RATE, SENT = 50.0, ForecastMessages('craft')
SETTINGS = PipelineSettings(forecaster=ForecasterSettings(leads=(0.5, 1.0), horizon=2.0, forecast_rate=10.0))


def craft(period=2.6, damping=0.08):
    w = 2 * np.pi / period
    model = DecayModel.from_terms(EQUATIONS['swath-pitch-9'], {'b1': 2 * damping * w, 'r1': w * w})
    return IdentifiedModel.exactly(model)


def play(readings, models=None, settings=SETTINGS):
    pipeline = ForecastPipeline(settings)
    pipeline.set_models(models or {})
    steps = []
    for one in readings:
        steps.append(pipeline.add(one))
        if steps[-1].sea_request is not None:
            pipeline.install(fit_sea(steps[-1].sea_request))
    return pipeline, steps


@pytest.fixture(scope='module')
def decay():
    return play(decay_stream(RATE, 20.0, release=0.0, damping=0.03), {'pitch': craft(damping=0.03)})[1]


def messages_of(step):
    """What the predictor publishes of a step, by topic."""
    return {t: typestore().deserialize_cdr(raw, type_of(t)) for t, raw in SENT.all_of(step)}


def test_stamps_are_exact(decay):
    assert decay[0].next is None and decay[1].next.leads == pytest.approx([0.02])
    assert [step.next.stamp_ns - EPOCH_NS for step in decay[1:]] == [20_000_000 * k for k in range(1, len(decay))]
    assert all((step.forecast is None) == (step.horizon is None) == (step.outlook is None) for step in decay)
    step = next(step for step in decay[500:] if step.forecast)
    found, names = messages_of(step), ('next', 'lead_0_5s', 'lead_1_0s', 'horizon')
    stamps = [stamp_ns(found[f'forecast/{name}'].header.stamp) - step.sample.stamp_ns for name in names]
    assert stamps == [20_000_000, 500_000_000, 1_000_000_000, 0]


def test_orientation_rates_and_their_variances_are_of_body_axes(decay):
    step = next(step for step in decay[600:] if step.forecast)
    message, forecast = imu_reading(messages_of(step)['forecast/lead_0_5s']), step.forecast.at(0.5)
    ((roll, pitch, _, pitch_rate),), variance = forecast.mean, np.diag(forecast.covariance[0])
    assert Rotation.from_quat(message.orientation).as_euler('ZYX') == pytest.approx([0.3, pitch, roll], abs=1e-3)
    assert message.rates[1] == pytest.approx(pitch_rate, rel=1e-3)
    about = np.diag([*variance[:2], LARGEST_ANGLE_VARIANCE])
    assert np.array_equal(np.reshape(message.orientation_covariance, (3, 3)), about)
    assert message.rates_covariance[4] == variance[3]


def test_without_angles_and_rates_nothing_is_forecast():
    nothing = {'orientation_covariance': NOT_GIVEN, 'rates_covariance': NOT_GIVEN}
    pipeline, steps = play(reading(EPOCH_NS + k * 20_000_000, **nothing) for k in range(20))
    assert all(step.next is None and not step.used for step in steps)
    assert pipeline.counts['no-orientation'] == len(steps)


def test_before_a_model_constant_rate_with_growing_variance_and_after_it_the_hull():
    readings = list(decay_stream(RATE, 20.0, release=8.0))
    pipeline, before = play(readings[:500])
    step = next(step for step in reversed(before) if step.forecast)
    half, one = step.forecast.deviation[:, 1]
    assert one > half > 0.0
    state = before[-1].next.angle('pitch')
    pipeline.set_models({'pitch': craft()})
    assert pipeline.add(readings[500]).next.angle('pitch') == pytest.approx(state, abs=0.05), 'the state goes on'
    assert pipeline.diagnostics().has_model == {'roll': False, 'pitch': True}
    pipeline.set_models({})
    assert pipeline.diagnostics().has_model == {'roll': False, 'pitch': False}


def test_the_epoch_does_not_matter():
    """The same motion in 1970 and in 2023: a double resolves 0.2 us of the time since 1970."""
    late, early = (play(decay_stream(RATE, 5.0, first_ns=first))[1] for first in (EPOCH_NS, 10**9))
    for one, other in zip(late, early, strict=True):
        assert (one.next is None) == (other.next is None)
        if one.next is not None:
            assert np.array_equal(one.next.mean, other.next.mean)
            assert np.array_equal(one.next.covariance, other.next.covariance)


def test_the_next_attitude_is_known_before_the_leads_are_worked_out():
    pipeline, order = ForecastPipeline(), []
    issue = pipeline.forecaster._issue
    pipeline.forecaster._issue = lambda *given: (order.append('leads'), issue(*given))[1]
    for k in range(50):
        begun = pipeline.begin(pipeline.intake.take(reading(EPOCH_NS + 10_000_000 * k, 0.1, 0.02)))
        order.append('next' if begun.next else 'nothing')
        if pipeline.finish(begun).forecast:
            assert order[-2:] == ['next', 'leads']
    assert order.count('leads') > 3 and order.count('next') == 49


def test_one_factor_scales_every_covariance(decay):
    following, forecast = next((step.next, step.forecast) for step in decay[500:] if step.forecast)
    bow = PointMotion((1.0, 0.0, 0.0), np.ones((2, 3)), np.tile(np.eye(7), (2, 1, 1)))
    for each in (following, replace(forecast, points={'bow': bow})):
        scaled = each.scaled(4.0)
        np.testing.assert_array_equal(scaled.mean, each.mean)
        np.testing.assert_allclose(scaled.half_width('roll'), 2.0 * each.half_width('roll'))
        assert all((motion.covariance == 4.0 * bow.covariance).all() for motion in scaled.points.values())


# -- a record run through the pipeline

RECORD_SETTINGS = ForecasterSettings(leads=(0.5, 1.0), horizon=2.0, horizon_step=0.5)


def test_what_is_to_come_changes_no_forecast_before():
    trial, others, changed_from = sea(30.0), sea(30.0, seed=7), 22.0
    is_later = trial.time > changed_from
    columns = {name: np.where(is_later, 3.0 * others.channels[name], own) for name, own in trial.channels.items()}
    alike = []
    steps = (run_through(each, RECORD_SETTINGS).steps for each in (trial, Trial(trial.time, **columns)))
    for one, two in zip(*steps, strict=True):
        assert one.stamp == two.stamp
        same = all(
            np.array_equal(getattr(part, name), getattr(counterpart, name))
            for part, counterpart in ((one.forecast, two.forecast), (one.horizon, two.horizon))
            for name in ('mean', 'covariance')
        )
        assert same == (one.stamp <= changed_from), one.stamp
        alike.append(same)
    assert sum(alike) > 200


@pytest.mark.parametrize(('rate', 'asked', 'every'), [(10.0, 5.0, 0.2), (50.0, 10.0, 0.1), (10.0, 100.0, 0.1)])
def test_forecasts_come_at_the_rate_asked_for_but_never_between_samples(rate, asked, every):
    settings = ForecasterSettings(leads=(0.5,), horizon=0.5, forecast_rate=asked)
    run = run_through(sea(15.0, 1.0 / rate), settings)
    np.testing.assert_allclose(np.diff([step.stamp for step in run.steps]), every, atol=1e-9)


def test_a_record_of_one_axis_and_a_record_that_is_still():
    trial = sea(30.0)
    run = run_through(Trial(trial.time, roll=trial.roll), RECORD_SETTINGS)
    assert len(run.steps) > 250 and all(step.forecast.axes == ('roll',) for step in run.steps)
    still = np.zeros(trial.time.size)
    run = run_through(Trial(trial.time, roll=still, roll_rate=still), RECORD_SETTINGS)
    assert max(abs(step.forecast.angle('roll')).max() for step in run.steps) < 1e-6
    assert all(np.isfinite(step.forecast.half_width('roll')).all() for step in run.steps)


def test_limits_of_quiescence_are_taken_up_at_their_stamp():
    wide, narrow = (QuiescenceLimits(math.radians(size), math.radians(size), duration=2.0) for size in (60.0, 0.2))
    settings = ForecasterSettings(leads=(0.5,), horizon=2.0, horizon_step=0.1, quiescence=wide)
    run = run_through(sea(30.0), settings, limits_from=(20.0, narrow))
    before, after = (
        [step.outlook.quiescence for step in run.steps if span[0] <= step.stamp < span[1]]
        for span in ((10.0, 20.0), (20.0, 30.0))
    )
    assert run.quiescence_limits == narrow and run.reliability is not None
    assert np.nanmin(before) > 0.9 and np.nanmax(after) < 0.5
