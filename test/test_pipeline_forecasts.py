"""The forecast pipeline, of readings as the predictor publishes it and of whole records, as plain numbers."""

import math

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
from swath_sysid.attitude.prediction.hull_track import LARGEST_ANGLE_VARIANCE
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.pipeline.forecast_pipeline import NOT_GIVEN as NOT_PUBLISHED
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import run_through

RATE = 50.0
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


def pitch_of(forecast):
    return Rotation.from_quat(forecast.orientation).as_euler('ZYX')[1]


def test_stamps_are_exact_and_all_values_are_floats(decay):
    """ROS checks no types: a numpy.float32 or an int would go out as garbage."""
    assert decay[0].next is None
    assert [step.next.stamp_ns - EPOCH_NS for step in decay[1:]] == [20_000_000 * k for k in range(2, len(decay) + 1)]
    assert all(bool(step.attitudes()) == (step.horizon is not None) for step in decay)
    step = next(step for step in decay[500:] if step.forecast)
    now = EPOCH_NS + decay.index(step) * 20_000_000
    attitudes, table = [message for _, message in step.attitudes()], step.trajectory()
    assert [message.stamp_ns - now for message in attitudes] == [500_000_000, 1_000_000_000]
    for message in (step.next, *attitudes):
        assert type(message.stamp_ns) is int
        assert {type(value) for part in message[1:] for value in part} == {float}
    assert table.stamp_ns == now and table.leads_ns == tuple(100_000_000 * k for k in range(1, 21))
    assert table.positions.dtype == float and {type(lead) for lead in table.leads_ns} == {int}
    assert table.columns == ('roll', 'roll_std', 'pitch', 'pitch_std')
    assert table.positions.shape == table.velocities.shape == (20, 4)
    assert (table.positions[:, [1, 3]] > 0.0).all()


def test_orientation_rates_and_their_variances_are_of_body_axes(decay):
    step = next(step for step in decay[600:] if step.forecast)
    message = step.attitudes()[0][1]
    yaw, pitch, roll = Rotation.from_quat(message.orientation).as_euler('ZYX')
    forecast = step.forecast.axes
    assert (yaw, pitch, roll) == pytest.approx((0.3, forecast['pitch'].angle[0], forecast['roll'].angle[0]), abs=1e-3)
    assert message.rates[1] == pytest.approx(forecast['pitch'].rate[0], rel=1e-3)
    covariance = np.reshape(message.orientation_covariance, (3, 3))
    assert covariance[1, 1] == forecast['pitch'].covariance[0, 0, 0]
    assert covariance[0, 0] == forecast['roll'].covariance[0, 0, 0]
    assert covariance[2, 2] == LARGEST_ANGLE_VARIANCE and np.count_nonzero(covariance) == 3
    assert np.reshape(message.rates_covariance, (3, 3))[1, 1] == forecast['pitch'].covariance[0, 1, 1]


def test_without_angles_and_rates_nothing_is_forecast():
    nothing = {'orientation_covariance': NOT_GIVEN, 'rates_covariance': NOT_GIVEN}
    pipeline, steps = play(reading(EPOCH_NS + k * 20_000_000, **nothing) for k in range(20))
    assert all(step.next is None and not step.used for step in steps)
    assert pipeline.counts['no-orientation'] == len(steps) and NOT_PUBLISHED[0] == -1.0


def test_before_a_model_constant_rate_with_growing_variance_and_after_it_the_hull():
    readings = list(decay_stream(RATE, 20.0, release=8.0))
    pipeline, before = play(readings[:500])
    step = next(step for step in reversed(before) if step.forecast)
    (_, half), (_, one) = step.attitudes()
    assert one.orientation_covariance[4] > half.orientation_covariance[4] > 0.0
    state = pitch_of(before[-1].next)
    pipeline.set_models({'pitch': craft()})
    assert pitch_of(pipeline.add(readings[500]).next) == pytest.approx(state, abs=0.05), 'the state goes on'
    assert pipeline.diagnostics().has_model == {'roll': False, 'pitch': True}
    pipeline.set_models({})
    assert pipeline.diagnostics().has_model == {'roll': False, 'pitch': False}


def test_the_epoch_does_not_matter():
    """The same motion in 1970 and in 2023: a double resolves 0.2 us of the time since 1970."""
    late, early = (play(decay_stream(RATE, 5.0, first_ns=first))[1] for first in (EPOCH_NS, 10**9))
    for one, other in zip(late, early, strict=True):
        assert (one.next is None) == (other.next is None)
        if one.next is not None:
            assert one.next[1:] == other.next[1:]


def test_the_next_attitude_goes_out_before_the_leads_are_worked_out():
    pipeline, order = ForecastPipeline(), []
    issue = pipeline.forecaster._issue
    pipeline.forecaster._issue = lambda *given: (order.append('leads'), issue(*given))[1]
    for k in range(50):
        step = pipeline.add(reading(EPOCH_NS + 10_000_000 * k, 0.1, 0.02), order.append)
        assert step.next is None or step.next in order
        if step.forecast:
            assert order[-2:] == [step.next, 'leads']
    assert order.count('leads') > 3


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
            np.array_equal(getattr(part.axes[axis], name), getattr(counterpart.axes[axis], name))
            for part, counterpart in ((one.forecast, two.forecast), (one.horizon, two.horizon))
            for axis in part.axes
            for name in ('angle', 'rate', 'covariance', 'half_width')
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
    assert len(run.steps) > 250 and all(list(step.forecast.axes) == ['roll'] for step in run.steps)
    still = np.zeros(trial.time.size)
    run = run_through(Trial(trial.time, roll=still, roll_rate=still), RECORD_SETTINGS)
    assert max(abs(step.forecast.axes['roll'].angle).max() for step in run.steps) < 1e-6
    assert all(np.isfinite(step.forecast.axes['roll'].half_width).all() for step in run.steps)


def test_limits_of_quiescence_are_taken_up_at_their_stamp():
    wide, narrow = (QuiescenceLimits(math.radians(size), math.radians(size), duration=2.0) for size in (60.0, 0.2))
    settings = ForecasterSettings(leads=(0.5,), horizon=2.0, horizon_step=0.1, quiescence=wide)
    run = run_through(sea(30.0), settings, limits_from=(20.0, narrow))
    before, after = (
        [step.horizon.quiescence for step in run.steps if span[0] <= step.stamp < span[1]]
        for span in ((10.0, 20.0), (20.0, 30.0))
    )
    assert run.quiescence_limits == narrow and run.reliability is not None
    assert np.nanmin(before) > 0.9 and np.nanmax(after) < 0.5
