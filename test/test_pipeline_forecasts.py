"""The forecast pipeline, of readings as the predictor publishes it and of whole records, as plain numbers."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
from imu_stream import EPOCH_NS, NOT_GIVEN, decay_stream, reading
from records_at_sea import sea, swell
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.hull.catalogue import EQUATIONS
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecast import Wanted, nothing
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_state import LARGEST_ANGLE_VARIANCE
from swath_sysid.attitude.prediction.point import Point, PointMotion
from swath_sysid.attitude.prediction.quiescence import PointLimits, QuiescenceLimits
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.formats.forecast_output import ForecastMessages, forecast_topics, wanted_for
from swath_sysid.formats.messages import imu_reading, stamp_ns, typestore
from swath_sysid.formats.topics import CALM_TOPIC, NEXT_TOPIC, SEA_TOPIC, type_of
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import followed, run_through, samples_of

RATE, SENT = 50.0, ForecastMessages('craft')
SETTINGS = PipelineSettings(forecaster=ForecasterSettings(leads=(0.5, 1.0), horizon=2.0, forecast_rate=10.0))


def craft(period=2.6, damping=0.08):
    w = 2 * np.pi / period
    model = DecayModel.from_terms(EQUATIONS['swath-pitch-9'], {'b1': 2 * damping * w, 'r1': w * w})
    return IdentifiedModel.exactly(model)


def play(readings, models=None, settings=SETTINGS):
    pipeline = ForecastPipeline(settings)
    pipeline.set_models(models or {})
    return pipeline, list(followed(pipeline, readings))


@pytest.fixture(scope='module')
def decay():
    return play(decay_stream(RATE, 20.0, release=0.0, damping=0.03), {'pitch': craft(damping=0.03)})[1]


def messages_of(step):
    """What the predictor publishes of a step, by topic."""
    return {t: typestore().deserialize_cdr(raw, type_of(t)) for t, raw in SENT.all_of(step)}


@pytest.mark.long
def test_stamps_are_exact(decay):
    assert decay[0].next is None and decay[1].next.leads == pytest.approx([0.02])
    assert [step.next.stamp_ns - EPOCH_NS for step in decay[1:]] == [20_000_000 * k for k in range(1, len(decay))]
    assert all((step.forecast is None) == (step.horizon is None) == (step.outlook is None) for step in decay)
    step = next(step for step in decay[500:] if step.forecast)
    found, names = messages_of(step), ('next', 'lead_0_5s', 'lead_1_0s', 'horizon')
    stamps = [stamp_ns(found[f'forecast/{name}'].header.stamp) - step.sample.stamp_ns for name in names]
    assert stamps == [20_000_000, 500_000_000, 1_000_000_000, 0]


@pytest.mark.long
def test_orientation_rates_and_their_variances_are_of_body_axes(decay):
    step = next(step for step in decay[600:] if step.forecast)
    message, forecast = imu_reading(messages_of(step)['forecast/lead_0_5s']), step.forecast.at(0.5)
    ((roll, pitch, _, pitch_rate),), variance = forecast.mean, np.diag(forecast.covariance[0])
    assert Rotation.from_quat(message.orientation).as_euler('ZYX') == pytest.approx([0.3, pitch, roll], abs=1e-3)
    assert message.rates[1] == pytest.approx(pitch_rate, rel=1e-3)
    about = np.diag([*variance[:2], LARGEST_ANGLE_VARIANCE])
    assert np.array_equal(np.reshape(message.orientation_covariance, (3, 3)), about)
    assert message.rates_covariance[4] == variance[3]


@pytest.mark.parametrize(
    ('trial', 'points'),
    [
        pytest.param(sea(40.0), (), marks=pytest.mark.long),
        pytest.param(swell(200.0)[0], ('sensor', 'bow'), marks=pytest.mark.release),
    ],
    ids=['craft', 'points'],
)
def test_who_comes_later_gets_the_forecast_of_who_was_there_from_the_start(trial, points):
    """Whoever listens, the same is learnt; for nobody, nothing is worked out but what is learnt from."""
    late = trial.time.size - 50
    points = tuple(Point(name, (2.5 * place, 0.0, 0.0)) for place, name in enumerate(points))
    at_points = tuple(PointLimits(point.name, vertical_velocity=0.9) for point in points)
    limits = QuiescenceLimits(roll=0.2, duration=1.0, points=at_points)
    how = ForecasterSettings((0.05, 0.5, 1.0), 2.0, 0.1, 5.0, points=points, quiescence=limits)
    asked = {'everything': Wanted(), 'nothing': nothing(), 'a lead': Wanted(0.5, False, True, False, False)}
    pipelines = {name: ForecastPipeline(PipelineSettings(forecaster=how)) for name in asked}
    seldom = 0
    for number, sample in enumerate(samples_of(trial)):
        steps = {}
        for name, pipeline in pipelines.items():
            wanted = asked[name] if number < late else Wanted()
            step = pipeline.finish(pipeline.begin(pipeline.intake.place(sample)), lambda wanted=wanted: wanted)
            if number == 200:
                pipeline.set_models({'roll': craft(4.0)})
            if step.sea_request is not None:
                pipeline.install(fit_sea(step.sea_request))
            steps[name] = step._replace(sea_request=None)
        every, none, lead = steps.values()
        if number >= late:
            assert_same(none, every)
            assert_same(lead, every)
        elif every.forecast is not None:
            seldom += none.horizon is None
            assert none.forecast is None
            assert_same(lead.forecast, every.forecast.chosen(slice(2)))
    assert set(every.forecast.points) == {point.name for point in points} and 0.0 < every.outlook.quiescence < 1.0
    assert seldom > 0.1 * late
    of_every, *of_others = (each.forecaster.quiescence_reliability() for each in pipelines.values())
    assert of_every.count.sum() > 20
    for each in of_others:
        assert_same(each, of_every)


@pytest.mark.long
def test_every_message_leaves_to_who_subscribes_to_it_and_all_of_them_to_who_does_to_all():
    frames, limits = (1.0,), QuiescenceLimits(roll=0.2, duration=1.0)
    pipeline = ForecastPipeline(PipelineSettings(forecaster=replace(SETTINGS.forecaster, quiescence=limits)))
    *before, last = samples_of(sea(20.0))
    for sample in before:
        pipeline.add_sample(sample)
    published = (0.5, 1.0), (), frames

    def sent_to(heard):
        others = copy.deepcopy(pipeline)
        step = others.finish(others.begin(others.intake.place(last)), lambda: wanted_for(heard, *published))
        return dict(ForecastMessages('craft', frames, heard.__contains__).of(step))

    # one sample ahead and the sea have their own way
    topics = set(forecast_topics(*published)) - {NEXT_TOPIC, SEA_TOPIC}
    whole = sent_to(topics)
    assert wanted_for(topics, *published) == Wanted(1.0) and set(whole) == topics and len(topics) == 8
    for topic in ('', *topics):
        # a later subscriber gets the last window of calm
        sent = {name: raw for name, raw in sent_to({topic}).items() if name in (topic, CALM_TOPIC)}
        assert sent_to({topic}) == sent == {name: whole[name] for name in sent} and set(sent) >= {topic} & topics


def test_points_that_somebody_subscribes_to_are_worked_out_as_far_ahead_as_that():
    published = (0.5, 1.0), ('bow',), ()
    for topic, wanted in {
        'forecast/bow/lead_1_0s': (1.0, False, True),
        'forecast/bow/acceleration_0_5s': (0.5, False, True),
        'forecast/bow/horizon': (0.0, True, True),
        'forecast/lead_0_5s': (0.5, False, False),
    }.items():
        assert topic in forecast_topics(*published)
        assert wanted_for({topic}, *published) == Wanted(*wanted, False, False)


@pytest.mark.long
def test_who_asks_for_the_diagnostics_is_told_the_valid_leads():
    told = []
    for wanted in (Wanted(), nothing()):
        pipeline = ForecastPipeline(SETTINGS)
        for sample in samples_of(sea(20.0)):
            pipeline.finish(pipeline.begin(pipeline.intake.place(sample)), lambda wanted=wanted: wanted)
        told.append(pipeline.diagnostics().valid_leads)
    assert set(told[0]) == {'roll', 'pitch'} and told[0] == told[1]


def assert_same(found, expected, but=()):
    """Two values, whatever is in them, but for rounding."""
    if hasattr(expected, '__dataclass_fields__'):
        found, expected = vars(found), vars(expected)
    if isinstance(expected, dict):
        assert set(found) == set(expected)
        for name in set(expected) - set(but):
            assert_same(found[name], expected[name])
    elif isinstance(expected, tuple):
        for each, other in zip(found, expected, strict=True):
            assert_same(each, other)
    elif isinstance(expected, np.ndarray | float):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    else:
        assert found == expected


def test_without_angles_and_rates_nothing_is_forecast():
    no_motion = {'orientation_covariance': NOT_GIVEN, 'rates_covariance': NOT_GIVEN}
    pipeline, steps = play(reading(EPOCH_NS + k * 20_000_000, **no_motion) for k in range(20))
    assert all(step.next is None and not step.used for step in steps)
    assert pipeline.counts['no-orientation'] == len(steps)


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.long
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


@pytest.mark.long
def test_a_record_of_one_axis_and_a_record_that_is_still():
    trial = sea(30.0)
    run = run_through(Trial(trial.time, roll=trial.roll), RECORD_SETTINGS)
    assert len(run.steps) > 250 and all(step.forecast.axes == ('roll',) for step in run.steps)
    still = np.zeros(trial.time.size)
    run = run_through(Trial(trial.time, roll=still, roll_rate=still), RECORD_SETTINGS)
    assert max(abs(step.forecast.angle('roll')).max() for step in run.steps) < 1e-6
    assert all(np.isfinite(step.forecast.half_width('roll')).all() for step in run.steps)


@pytest.mark.long
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
