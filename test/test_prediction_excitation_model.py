"""The sea's moment, learnt from angle and rate: spectra of known seas, closed forms, the filter with and without it."""

import math

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from scipy.signal import lfilter

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.simulation import motion_step
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.prediction import excitation_model as excitation
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.hull_filter import ExcitationRequest, HullFilter, HullPrior
from swath_sysid.attitude.prediction.hull_track import HULL_STATES
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings

HULL = hull_named('swath-roll').model
EXACT = IdentifiedModel.exactly(HULL)
KNOWN = HULL, HullPrior.of(EXACT), False, True
NOISE = 5e-4, 3e-3
STEP, PERIOD, SAMPLES, COUNT = 0.1, USUAL_PERIOD, 10, 30_000
PEAK, WIDTH, SIZE = 2.2, 0.25, 0.06
LEADS = (0.5, 1.0, 2.0)


def _density(frequency):
    """Two-sided, of a narrow sea of the given size."""
    bump = np.exp(-0.5 * ((frequency - PEAK) / WIDTH) ** 2) / (math.sqrt(2.0 * math.pi) * WIDTH)
    return math.pi * SIZE**2 * bump


@pytest.fixture(scope='module')
def sea():
    """True angle and rate and the sensor's, at 100 Hz, of the hull in a sea of known spectrum."""
    rng = np.random.default_rng(3)
    edges = np.linspace(1.0, 4.0, 301)
    frequency = edges[:-1] + rng.uniform(size=300) * np.diff(edges)
    amplitude = np.sqrt(2.0 * _density(frequency) / math.pi * np.diff(edges))
    phase = rng.uniform(0.0, 2.0 * math.pi, 300)
    time = 0.01 * (np.arange(42_000) + 0.5)
    moment = sum(a * np.cos(w * time + p) for a, w, p in zip(amplitude, frequency, phase, strict=True))
    row, true, state = tuple(HULL.ratios.tolist()), np.empty((time.size, 2)), (0.0, 0.0)
    for k, held in enumerate(moment.tolist()):
        true[k] = state
        _, *state = motion_step(*state, held, 0.01, row, HULL.equation.active, HULL.friction_rate)
    return true, true + rng.normal(size=true.shape) * NOISE


VARIANCES = NOISE[0] ** 2, NOISE[1] ** 2


def _blocks(seen):
    return seen.reshape(-1, SAMPLES, 2).mean(axis=1)


def _request(seen, hull=KNOWN):
    motion, noise = _blocks(seen).T.copy(), [v / SAMPLES for v in VARIANCES]
    return ExcitationRequest(*hull, STEP, PERIOD, *motion, np.isfinite(motion[0]), *noise, SAMPLES)


def _fed(seen):
    attitude = HullFilter()
    attitude.set_hull(EXACT)
    attitude.start(*seen[0].tolist(), *VARIANCES)
    for sample in seen[1:].tolist():
        attitude.observe(0.01, *sample, *VARIANCES)
    return attitude


@pytest.mark.long
def test_the_moment_is_found_through_the_nonlinear_hull_and_reduced(sea):
    request = _request(sea[1][:30_000])
    found, fit = excitation.moment_spectrum(request), excitation.fit_excitation(request)
    total = np.sum(found.density * np.gradient(found.frequency)) / math.pi
    assert total == pytest.approx(SIZE**2, rel=0.15)
    assert np.average(found.frequency, weights=found.density) == pytest.approx(PEAK, abs=0.1)
    assert np.all(found.density[found.frequency > 5.0] < 0.05 * _density(PEAK))
    w, moment = np.linspace(0.2, 6.0, 400), fit.moment
    # the autocovariance is h exp(A t) Pi h', whose transform is 2 Re h (i w - A)^-1 Pi h'
    resolvents = (np.linalg.inv(1j * f * np.eye(moment.size) - moment.generator) for f in w)
    density = [(moment.output @ resolvent @ moment.stationary @ moment.output).real for resolvent in resolvents]
    assert moment.variance == pytest.approx(SIZE**2, rel=0.2)
    assert np.average(w, weights=density) == pytest.approx(PEAK, abs=0.15)
    assert fit.mean.size == HULL_STATES + 2 + moment.size and moment.size <= 22
    assert excitation.fit_excitation(_request(sea[1][:2000])) is None
    request.angle[100] = math.nan
    assert excitation.fit_excitation(request) is None


def _errors_of_roll(sea, every, begin, end):
    """Root mean square, rad, at `LEADS` of forecasts issued from begin to end, s, from every so many of the samples."""
    true, seen = sea
    settings = ForecasterSettings(LEADS, horizon=2.0, horizon_step=1.0, forecast_rate=2.0)
    pipeline, errors = ForecastPipeline(PipelineSettings(forecaster=settings)), []
    pipeline.set_models({'roll': EXACT})
    ahead = np.round(100.0 * np.array(LEADS)).astype(int)
    channels = 'roll', 'roll_rate', 'roll_variance', 'roll_rate_variance'
    for k in range(0, round(100.0 * end), every):
        sample = dict.fromkeys(CraftSample._fields, math.nan) | {'stamp_ns': 10_000_000 * k}
        sample |= zip(channels, [*seen[k].tolist(), *VARIANCES], strict=True)
        step = pipeline.add_sample(CraftSample(**sample))
        if step.sea_request is not None:
            pipeline.install(fit_sea(step.sea_request))
        if step.forecast is not None and k >= 100.0 * begin:
            errors.append(step.forecast.angle('roll') - true[k + ahead, 0])
    return np.sqrt(np.mean(np.square(errors), axis=0))


@pytest.mark.release
def test_on_a_known_hull_a_quicker_sensor_is_no_worse(sea):
    """Whose rows are means of samples, and whose fits are asked for between two rows."""
    slow, quick = (_errors_of_roll(sea, every, 60.0, 160.0) for every in (10, 2))
    assert (quick < slow).all(), (quick, slow)


@pytest.mark.release
def test_forecasts_with_the_learnt_moment_are_better_and_know_how_good_they_are(sea):
    true, seen = sea
    fit, nrmse, coverage = excitation.fit_excitation(_request(seen[:COUNT])), [], []
    for is_learnt in (True, False):
        attitude, errors, held = _fed(seen[COUNT - 200 : COUNT]), [], []
        if is_learnt:
            # the last block's middle lies half a step before the last sample
            attitude.set_excitation(fit, 0.5 * STEP)
        for k in range(COUNT, len(seen)):
            attitude.observe(0.01, *seen[k].tolist(), *VARIANCES)
            if k % SAMPLES == 0 and k + 100 < len(true):
                mean, spread = attitude.forecast(np.array([1.0]))
                errors.append(mean[0, 0] - true[k + 100, 0])
                held.append(abs(errors[-1]) < 1.645 * math.sqrt(spread[0, 0, 0]))
        nrmse.append(math.sqrt(np.mean(np.square(errors))) / true[:, 0].std())
        coverage.append(np.mean(held))
        assert attitude.advice() == ()
    assert nrmse[0] < 0.2 and nrmse[0] < 0.6 * nrmse[1]
    assert 0.8 < coverage[0] < 0.97


@pytest.mark.long
def test_a_fit_taken_up_late_is_the_one_taken_up_at_once(sea):
    _, seen = sea
    fit, leads = excitation.fit_excitation(_request(seen[:COUNT], (*KNOWN[:2], True, True))), np.array([0.5, 2.0])
    late, prompt = _fed(seen[COUNT - 300 : COUNT + 100]), _fed(seen[COUNT - 300 : COUNT])
    late.set_excitation(fit, 1.05)
    prompt.set_excitation(fit, 0.05)
    for sample in seen[COUNT : COUNT + 100].tolist():
        prompt.observe(0.01, *sample, *VARIANCES)
    assert late.forecast(leads)[0] == pytest.approx(prompt.forecast(leads)[0], abs=2e-4)


@pytest.mark.long
def test_any_hull_stands_in_for_one_that_is_not_known():
    rng, blocks = np.random.default_rng(4), 2600
    frequency, phase = 2.0 * rng.normal(1.0, 0.15, 80), rng.uniform(0.0, 2.0 * math.pi, 80)
    turns = np.outer(0.01 * np.arange(SAMPLES * blocks + 100), frequency) + phase
    true = 0.01 * np.column_stack([np.cos(turns).sum(axis=1), -np.sin(turns) @ frequency])
    seen, variances = true + rng.normal(size=true.shape) * NOISE, [variance / SAMPLES for variance in VARIANCES]
    measured, misses = seen[:-100].reshape(-1, SAMPLES, 2).mean(axis=1).tolist(), {}
    for period in (PERIOD, 0.5 * PERIOD, None):
        attitude, errors = HullFilter(), []
        attitude.set_period(period or PERIOD)
        attitude.start(*measured[0], *variances)
        for k, block in enumerate(measured[1:], 2):
            attitude.observe(STEP, *block, *variances)
            if k == 1800 and period:
                request = _request(seen[: SAMPLES * k], attitude.learnt_hull())
                attitude.set_excitation(excitation.fit_excitation(request))
            if k > 1800:
                # 0.545 s after the middle of the newest block
                errors.append(attitude.forecast(np.array([0.545]))[0][0, 0] - true[SAMPLES * k + 49, 0])
        misses[period] = np.std(errors) / NOISE[0]
    assert max(misses[PERIOD], misses[0.5 * PERIOD]) < 0.3 * misses[None]


def test_a_craft_that_does_not_move_at_all_has_a_moment_of_no_size():
    fit = excitation.fit_excitation(_request(np.zeros((SAMPLES * 400, 2)), HullFilter().learnt_hull()))
    assert np.isfinite(fit.mean).all() and np.isfinite(fit.covariance).all()
    assert fit.mean[:2] == pytest.approx([0.0, 0.0]) and fit.moment.variance < 1e-4


def test_a_hull_that_becomes_known_forgets_the_one_that_stood_in(sea):
    _, seen = sea
    attitude, blocks = HullFilter(), _blocks(seen).tolist()
    attitude.start(*blocks[0], *VARIANCES)
    for block in blocks[1:1500]:
        attitude.observe(STEP, *block, *VARIANCES)
    attitude.set_excitation(excitation.fit_excitation(_request(seen[:15_000], attitude.learnt_hull())))
    stood_in = attitude.model
    motion = attitude.x[:2].copy()
    attitude.set_hull(EXACT)
    assert stood_in is not None and attitude.model.equation == HULL.equation
    assert len(attitude.moments) == 1 and attitude.x[:2] == pytest.approx(motion)
    for block in blocks[1500:1600]:
        attitude.observe(STEP, *block, *VARIANCES)
    assert abs(attitude.x[0] - seen[15_999, 0]) < 5.0 * NOISE[0]


def test_the_autoregression_of_an_autoregression_is_itself():
    covariance = np.array([0.9**k for k in range(7)])
    coefficients, noise = excitation.autoregression(covariance)
    assert coefficients == pytest.approx([0.9, 0, 0, 0, 0, 0], abs=1e-6)
    assert noise == pytest.approx(1.0 - 0.81, rel=1e-5)
    impulse = lfilter([1.0], [1.0, *-coefficients], np.eye(1, 400)[0])
    assert noise * np.sum(impulse**2) == pytest.approx(1.0, rel=1e-5)


def test_the_steady_covariance_solves_riccatis_equation():
    rng = np.random.default_rng(1)
    a = 0.9 * np.linalg.qr(rng.normal(size=(6, 6)))[0]
    q, noise = np.diag(rng.uniform(0.1, 1.0, 6)), (0.2, 0.5)
    c = np.eye(2, 6)
    expected = solve_discrete_are(a.T, c.T, q, np.diag(noise))
    updated = expected - expected @ c.T @ np.linalg.solve(c @ expected @ c.T + np.diag(noise), c @ expected)
    assert excitation._filtered_covariance(a, q, noise) == pytest.approx(updated, abs=1e-9)


@pytest.mark.long
@pytest.mark.parametrize('factor', [0.7, pytest.param(1.3, marks=pytest.mark.long)])
def test_a_hull_30_percent_off_in_stiffness_is_named(sea, factor):
    _, seen = sea
    terms = {name: value * (factor if name.startswith('s') else 1.0) for name, value in HULL.terms.items()}
    attitude, blocks = HullFilter(), _blocks(seen).tolist()
    attitude.set_hull(IdentifiedModel.exactly(HULL.from_terms(HULL.equation, terms, axis='roll')))
    variances = [variance / SAMPLES for variance in VARIANCES]
    attitude.start(*blocks[0], *variances)
    for k, block in enumerate(blocks[1:], 2):
        attitude.observe(STEP, *block, *variances)
        if k in (1201, 1801, 2401, 3001, 3601):
            attitude.set_excitation(excitation.fit_excitation(_request(seen[: SAMPLES * k], attitude.learnt_hull())))
    assert 'model-contradicted' in {advice.code for advice in attitude.advice()}


@pytest.mark.parametrize('count', [900, 901])
def test_the_autocovariance_is_the_spectrums_cosine_transform(count):
    frequency = 2.0 * math.pi * np.fft.rfftfreq(count, STEP)[1:]
    frequency = frequency[frequency < 20.0]
    covariance = excitation.autocovariance(excitation.Spectrum(frequency, _density(frequency)), STEP, 121)
    lags = STEP * np.arange(121)
    wanted = np.cos(np.outer(lags, frequency)) @ _density(frequency) * frequency[0] / math.pi
    assert covariance == pytest.approx(wanted, abs=1e-12 * wanted[0])
    # that of a normal bump is a cosine within a normal envelope
    closed = SIZE**2 * np.exp(-0.5 * (WIDTH * lags) ** 2) * np.cos(PEAK * lags)
    assert covariance == pytest.approx(closed, abs=1e-6 * closed[0])
