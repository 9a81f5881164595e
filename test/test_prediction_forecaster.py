"""The forecaster behind the pipeline: sensors of any rate, gaps, clocks that are set, models that are not exact."""

import copy
import math

import numpy as np
import pytest

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.simulated_craft import CraftSettings, SimulatedCraft
from swath_sysid.attitude.hull.simulated_trial import SensorNoise
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.prediction.bank import CANDIDATES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings

ANGLE_NOISE, RATE_NOISE = 5e-4, 3e-3
LEADS = (0.1, 0.5, 1.0, 2.0)
SETTINGS = ForecasterSettings(leads=LEADS, horizon=2.0, horizon_step=0.5, forecast_rate=5.0, refit_interval=15.0)
NOT_MEASURED = math.nan


class Sea:
    """Roll, pitch and their rates as sums of sines, so that the truth is known at any time."""

    def __init__(self, seed=0, components=80):
        rng = np.random.default_rng(seed)
        self.frequency = np.sort(rng.uniform(1.2, 4.0, components))
        spectrum = self.frequency**-5 * np.exp(-1.25 * (1.9 / self.frequency) ** 4)
        amplitude = np.sqrt(2.0 * spectrum / spectrum.sum())
        self.amplitude = np.radians([[2.0], [1.0]]) * amplitude
        self.phase = rng.uniform(0.0, 2.0 * math.pi, (2, components))

    def angles(self, time):
        """Roll and pitch, shape (2, N)."""
        turn, axes = np.multiply.outer(time, self.frequency), zip(self.amplitude, self.phase, strict=True)
        return np.array([np.cos(turn + phase) @ size for size, phase in axes])

    def rates(self, time):
        """Their derivatives, shape (2, N)."""
        turn, axes = np.multiply.outer(time, self.frequency), zip(self.amplitude, self.phase, strict=True)
        return np.array([-np.sin(turn + phase) @ (size * self.frequency) for size, phase in axes])

    def samples(self, time, stamps=None, seed=1):
        """What a sensor gives at these times, its clock showing ``stamps``."""
        rng = np.random.default_rng(seed)
        angles = self.angles(time) + rng.normal(0.0, ANGLE_NOISE, (2, time.size))
        rates = self.rates(time) + rng.normal(0.0, RATE_NOISE, (2, time.size))
        rows = np.vstack([angles, rates]).T.tolist()
        noise = (ANGLE_NOISE**2,) * 2 + (RATE_NOISE**2,) * 2
        nanoseconds = np.round((time if stamps is None else stamps) * 1e9).astype(np.int64).tolist()
        return [
            CraftSample(stamp, *row, *(NOT_MEASURED,) * 3, *noise) for stamp, row in zip(nanoseconds, rows, strict=True)
        ]


SEA = Sea()


def run(samples, settings=SETTINGS, models=None, late_by=0, pipeline=None):
    """A pipeline after the samples, and the step that each led to; fits come ``late_by`` samples late."""
    if pipeline is None:
        pipeline = ForecastPipeline(PipelineSettings(forecaster=settings))
        pipeline.set_models(models or {})
    steps, waiting = [], []
    for number, sample in enumerate(samples):
        steps.append(pipeline.add_sample(sample))
        if steps[-1].sea_request is not None:
            waiting.append((number + late_by, fit_sea(steps[-1].sea_request)))
        if waiting and waiting[0][0] <= number:
            pipeline.install(waiting.pop(0)[1])
    return pipeline, steps


def error(steps, time, first, last, axis='roll'):
    """Root mean square error at `LEADS` of the forecasts issued at true times from first to last."""
    issued = [
        (now, step.forecast.axes[axis].angle)
        for now, step in zip(time, steps, strict=True)
        if step.forecast is not None and first <= now < last
    ]
    assert issued, 'none was issued'
    due = np.array([now for now, _ in issued])[:, None] + np.array(LEADS)
    truth = SEA.angles(due)[('roll', 'pitch').index(axis)]
    return np.sqrt(np.mean((np.array([angle for _, angle in issued]) - truth) ** 2, axis=0))


def clock(rate, duration):
    return np.arange(round(rate * duration)) / rate


UNTOUCHED = 60.0
"""s at the beginning that every test of a disturbance shares."""

EPOCH = 4e7


@pytest.fixture(scope='module')
def beginning():
    """A pipeline after the first minute at 10 Hz, and its steps; run copies of it."""
    return run(SEA.samples(clock(10.0, 120.0), EPOCH + clock(10.0, 120.0))[: round(10.0 * UNTOUCHED)])


def run_on(beginning, samples):
    """The steps of the beginning and of what follows it."""
    pipeline, steps = beginning
    return steps + run(samples, pipeline=copy.deepcopy(pipeline))[1]


@pytest.fixture(scope='module')
def steady(beginning):
    """Two minutes at 10 Hz, of which nothing is lost."""
    time = clock(10.0, 120.0)
    return time, run_on(beginning, SEA.samples(time, EPOCH + time)[round(10.0 * UNTOUCHED) :])


def test_jitter_of_the_stamps_costs_little(steady):
    time, steps = steady
    jitter = time[:900] + np.random.default_rng(2).uniform(-0.02, 0.02, 900)
    _, jittered = run(SEA.samples(jitter))
    a, b = error(jittered, jitter, 50.0, 90.0), error(steps, time, 50.0, 90.0)
    assert (a[1:] < 1.5 * b[1:]).all()


@pytest.mark.parametrize('lost', [5, 20])
def test_after_lost_samples_the_forecast_is_that_of_a_whole_record(beginning, steady, lost):
    time, whole = steady
    numbers = np.arange(time.size)
    kept = (numbers % 100 >= lost) | (time < UNTOUCHED)
    samples = [sample for sample, is_kept in zip(SEA.samples(time, EPOCH + time), kept, strict=True) if is_kept]
    steps = run_on(beginning, samples[round(10.0 * UNTOUCHED) :])
    after = [(first, first + 4.0) for first in time[numbers % 100 == lost] if UNTOUCHED <= first < 115.0]
    squares = np.array(
        [
            [error(run_steps, times, *span) ** 2 for run_steps, times in ((steps, time[kept]), (whole, time))]
            for span in after
        ]
    ).mean(axis=0)
    ratio = np.sqrt(squares[0] / squares[1])
    assert len(after) >= 3 and (ratio[1:] < 1.3).all(), ratio


@pytest.mark.parametrize('shift', [20.0, 31536000.0, -1000.0])
def test_half_a_minute_after_the_clock_was_set_the_forecast_is_as_good_as_before(beginning, steady, shift):
    time, undisturbed = steady
    first = round(10.0 * UNTOUCHED)
    steps = run_on(beginning, SEA.samples(time, EPOCH + shift + time)[first:])
    after, without = (error(given, time, 90.0, 120.0)[2] for given in (steps, undisturbed))
    before = error(steps, time, 30.0, 60.0)[2]
    assert after < 1.3 * before and after < 1.3 * without
    issued = [now for now, step in zip(time, steps, strict=True) if step.forecast is not None]
    assert np.diff(issued).max() < 0.8, 'forecasts go on'


def test_diagnostics_say_so_until_the_waves_are_learnt():
    pipeline, codes = ForecastPipeline(PipelineSettings(forecaster=SETTINGS)), []
    for sample in SEA.samples(clock(10.0, 20.0)):
        step = pipeline.add_sample(sample)
        if step.sea_request is not None:
            pipeline.install(fit_sea(step.sea_request))
        diagnostics = pipeline.diagnostics()
        codes.append({note.code for note in diagnostics.advice})
        assert diagnostics.has_waves == ('no-waves' not in codes[-1])
        assert ('no-model' in codes[-1]) and diagnostics.has_model == {'roll': False, 'pitch': False}
    without = ['no-waves' in found for found in codes]
    assert without[0] and not without[-1] and without == sorted(without, reverse=True)
    # the first request, and the time that a fit has
    assert without.index(False) >= 10.0 * (SETTINGS.first_refit + SETTINGS.refit_delay)
    assert diagnostics.nrmse.shape == diagnostics.coverage.shape == (2, len(LEADS))
    assert diagnostics.weights.shape == diagnostics.candidate_nrmse.shape == (len(CANDIDATES), 2, len(LEADS))
    np.testing.assert_allclose(np.nansum(diagnostics.weights, axis=0), 1.0, atol=1e-9)


@pytest.mark.parametrize('models', [{}, {'roll': IdentifiedModel.exactly(hull_named('swath-roll').model)}])
def test_the_joint_covariance_holds_that_of_each_axis_and_is_one(steady, models):
    if models:
        _, steps = run(SEA.samples(clock(10.0, 25.0)), models=models)
    else:
        _, steps = steady
    forecasts = [forecast for step in steps if step.forecast for forecast in (step.forecast, step.horizon)]
    assert len(forecasts) > 150
    for forecast in forecasts:
        axes = list(forecast.axes.values())
        joint = forecast.covariance
        assert joint.shape == (forecast.leads.size, 2 * len(axes), 2 * len(axes))
        np.testing.assert_allclose(joint, joint.transpose(0, 2, 1), rtol=1e-9, atol=1e-15)
        for place, ahead in enumerate(axes):
            pair = [place, place + len(axes)]
            np.testing.assert_array_equal(joint[:, pair][:, :, pair], ahead.covariance)
            np.testing.assert_allclose(ahead.half_width[:, 1], 1.6448536 * np.sqrt(joint[:, place, place]), rtol=1e-6)
        scale = np.sqrt(np.diagonal(joint, axis1=1, axis2=2))
        assert (scale > 0.0).all()
        assert np.linalg.eigvalsh(joint / (scale[:, :, None] * scale[:, None, :])).min() > -1e-9


def test_leads_and_horizon_agree_where_they_meet(steady):
    _, steps = steady
    for step in steps:
        if step.forecast is not None:
            leads, horizon = step.forecast, step.horizon
            for lead in (0.5, 1.0, 2.0):
                i, j = (int(np.argmin(abs(part.leads - lead))) for part in (leads, horizon))
                for axis in leads.axes:
                    assert leads.axes[axis].angle[i] == horizon.axes[axis].angle[j]


def test_a_fit_within_its_delay_changes_nothing_and_a_late_one_is_used_from_then_on():
    """Live, the background takes a while; offline it takes none."""
    time = clock(10.0, 45.0)
    samples = SEA.samples(time)
    (_, on_time), (_, within), (pipeline, late) = (run(samples, late_by=number) for number in (0, 4, 30))
    asked = next(k for k, step in enumerate(on_time) if step.sea_request is not None)
    delay = round(10.0 * SETTINGS.refit_delay)
    angles = [
        [step.forecast and step.forecast.axes['roll'].angle.tolist() for step in steps]
        for steps in (on_time, within, late)
    ]
    assert angles[0] == angles[1]
    same = [one == other for one, other in zip(angles[0], angles[2], strict=True)]
    assert all(same[: asked + delay]) and not all(same[: asked + 30]) and pipeline.diagnostics().has_waves
    assert (error(late, time, 30.0, 45.0) < 1.5 * error(on_time, time, 30.0, 45.0) + 1e-3).all()


@pytest.mark.parametrize('rates', [(10.0, 100.0), (50.0, 10.0)])
def test_a_sensor_that_changes_its_rate_is_followed(rates):
    time = np.concatenate([clock(rates[0], 20.0), 20.0 + clock(rates[1], 40.0)])
    pipeline, steps = run(SEA.samples(time))
    assert pipeline.diagnostics().sample_interval == pytest.approx(1.0 / rates[1], rel=1e-3)
    relative = error(steps, time, 35.0, 60.0) / SEA.angles(time)[0].std()
    assert (relative[:3] < (0.05, 0.2, 0.4)).all(), relative


def test_an_axis_without_angle_is_forecast_from_its_rate():
    """The restoring moment of the hull makes the angle known; without a hull its rate is."""
    hull = IdentifiedModel.exactly(hull_named('swath-roll').model)
    time = clock(10.0, 50.0)
    samples = [sample._replace(roll=math.nan) for sample in SEA.samples(time)]
    _, steps = run(samples, models={'roll': hull})
    issued = [
        (now, step.forecast.axes['roll'])
        for now, step in zip(time, steps, strict=True)
        if step.forecast is not None and now > 30.0
    ]
    assert len(issued) > 90
    rates = np.array([ahead.rate[:3] for _, ahead in issued])
    truth = SEA.rates(np.array([now for now, _ in issued])[:, None] + np.array(LEADS[:3]))[0]
    relative = np.sqrt(np.mean((rates - truth) ** 2, axis=0)) / SEA.rates(time)[0].std()
    assert (relative < (0.15, 0.5, 1.0)).all(), relative
    assert all(np.isfinite(ahead.angle).all() and (ahead.half_width > 0.0).all() for _, ahead in issued)


# -- calm water

HULLS = {'swath-roll': 0.0050, 'swath-pitch': 0.0164}
"""With the noise of the rate that each study shows, rad/s."""


def sample_of(craft, now):
    """The next sample of a simulated craft, whose sensor reports its noise."""
    reading, noise = craft.next_reading(), craft.settings.noise
    return CraftSample(
        round(now * 1e9),
        reading.roll,
        reading.pitch,
        reading.roll_rate,
        reading.pitch_rate,
        *reading.force,
        *(noise.angle**2,) * 2,
        *(noise.rate**2,) * 2,
        yaw_rate=0.0,
    )


def calm(craft, identified, settings, spans):
    """Of a craft let go after each span, s, but the last: when it is free, true angles, and what was issued."""
    pipeline = ForecastPipeline(PipelineSettings(forecaster=settings))
    axis, rate = identified.model.axis, craft.settings.rate_hz
    pipeline.set_models({axis: identified})
    free, truth, issued = [], [], []
    for span in spans:
        if truth:
            free.append(len(truth) / rate + craft.release())
        for _ in range(int(span * rate)):
            now = len(truth) / rate
            step = pipeline.add_sample(sample_of(craft, now))
            truth.append(craft._state[0])
            if step.sea_request is not None:
                pipeline.install(fit_sea(step.sea_request))
            if step.forecast is not None:
                issued.append((now, step.forecast.axes[axis]))
    return free, np.array(truth), issued


@pytest.mark.parametrize('name', ['swath-pitch', pytest.param('swath-roll', marks=pytest.mark.slow)])
def test_a_released_hull_is_forecast_one_period_ahead_at_its_first_release_too(name):
    model = hull_named(name).model
    craft = SimulatedCraft(CraftSettings(model, math.radians(6.0), seed=0, noise=SensorNoise(rate=HULLS[name])))
    period, fall = round(model.natural_period, 2), craft.settings.lift + craft.settings.hold + 14.0
    settings = ForecasterSettings(leads=(0.5, period), horizon=max(5.0, period))
    free, truth, issued = calm(craft, IdentifiedModel.exactly(model), settings, (1.5, fall, fall))
    time = np.arange(truth.size) / craft.settings.rate_hz
    assert len(free) == 2
    for begin in free:
        counted = [(now, ahead) for now, ahead in issued if begin + 0.3 <= now <= begin + 10.0 - period]
        due = np.array([now for now, _ in counted]) + period
        errors = np.array([ahead.angle[1] for _, ahead in counted]) - np.interp(due, time, truth)
        moving = (time >= begin) & (time <= begin + 10.0)
        assert np.sqrt(np.mean(errors**2)) < 0.06 * truth[moving].std()
        assert np.mean(abs(errors) <= [ahead.half_width[1, 1] for _, ahead in counted]) > 0.7


def test_a_hull_known_to_half_its_size_forecasts_visibly_wider_than_an_exact_one():
    model = hull_named('swath-roll').model
    covariance = np.diag((0.5 * model.ratios[model.equation.indices]) ** 2)
    widths = []
    for identified in (IdentifiedModel.exactly(model), IdentifiedModel(model, covariance)):
        craft = SimulatedCraft(CraftSettings(model, math.radians(6.0), seed=1))
        spans = 10.0, craft.settings.lift + craft.settings.hold + 5.0
        (free,), _, issued = calm(craft, identified, SETTINGS, spans)
        widths.append(np.mean([ahead.half_width[2:, 1] for now, ahead in issued if now > free + 0.5], axis=0))
    assert (widths[1] > 2.0 * widths[0]).all(), widths
