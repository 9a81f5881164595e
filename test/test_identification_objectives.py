"""The two objectives and the noise model, against direct evaluation, scipy and known truth."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from swath_sysid.attitude.hull.catalogue import EQUATIONS, PUBLISHED_HULLS
from swath_sysid.attitude.hull.scaling import Scales
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.terms import term_moments
from swath_sysid.attitude.identification.motion_fit import InitialState, MotionFit, Noise
from swath_sysid.attitude.identification.one_step import OneStepObjective
from swath_sysid.attitude.identification.uncertainty import known_together
from swath_sysid.common.covariance import correlation, sandwich_covariance
from swath_sysid.common.noise import autocovariance, correlated_information, weighting_noise

HULL = PUBLISHED_HULLS['swath-pitch'].model
SCALES = Scales(0.1, 3.2)
FRICTION_RATE = 0.006


def decay(seed=1, samples=1500, noise=SensorNoise()):  # noqa: B008 - frozen
    trial = simulated_trial(HULL, np.radians(6), samples / 100, 100.0, noise, seed)
    return trial.axis('pitch')


def direct_one_step(motion, ratios, trim):
    """F as the papers write it, sample by sample."""
    errors = []
    for k in range(motion.size - 1):
        moments = term_moments(motion.angle[k : k + 1] - trim, motion.rate[k : k + 1], FRICTION_RATE)
        dt = motion.time[k + 1] - motion.time[k]
        errors.append(motion.rate[k] - dt * float(ratios @ moments[:, 0]) - motion.rate[k + 1])
    return np.sqrt(np.mean(np.square(errors)))


def test_one_step_objective_is_the_published_sum():
    motion = decay(samples=300)
    uneven = motion.only(np.arange(300) % 3 != 1)
    ratios = np.random.default_rng(2).uniform(0, 5, (4, 9))
    for record in (motion, uneven):
        found = OneStepObjective.of([record], [0.01], FRICTION_RATE)(ratios)
        assert found == pytest.approx([direct_one_step(record, r, 0.01) for r in ratios], rel=1e-10)


def test_one_step_objective_takes_no_step_over_a_gap():
    motion = decay(samples=400)
    holed = motion.only(np.r_[0:150, 250:400])
    ratios = HULL.ratios[None]
    first, second = (
        OneStepObjective.of([motion.only(s)], [0.0], FRICTION_RATE) for s in (slice(0, 150), slice(250, 400))
    )
    whole = OneStepObjective.of([holed], [0.0], FRICTION_RATE)
    assert whole.samples == first.samples + second.samples
    pooled = np.sqrt((first(ratios) ** 2 * first.samples + second(ratios) ** 2 * second.samples) / whole.samples)
    assert whole(ratios) == pytest.approx(pooled)


@pytest.mark.parametrize('name', ['swath-pitch-1', 'odd-cubic+friction'])
def test_one_step_minimum_is_scipys_on_the_whole_record(name):
    motion, equation = decay(), EQUATIONS[name]
    objective = OneStepObjective.of([motion], [0.0], FRICTION_RATE)
    ratios = objective.minimum(equation, np.zeros(9), np.full(9, 1e4))
    moments = term_moments(motion.angle[:-1], motion.rate[:-1], FRICTION_RATE)[equation.indices]
    rows = (moments * np.diff(motion.time)).T
    expected = lsq_linear(rows, -np.diff(motion.rate), (0, np.inf), tol=1e-14)
    error = np.sqrt(np.mean((rows @ expected.x + np.diff(motion.rate)) ** 2))
    assert objective(ratios[None])[0] == pytest.approx(error, rel=1e-9)


def fit_of(motion, name='swath-pitch-2', **options):
    return MotionFit([motion], EQUATIONS[name], SCALES, Noise(0.001, 0.0165), FRICTION_RATE, **options)


def test_simulation_objective_at_the_truth_is_the_noise():
    fit = fit_of(decay())
    state = InitialState(np.radians(6), 0.0, 0.0)
    truth = HULL.ratios[fit._terms] / fit._units
    assert fit.objective_of_population(truth[None], [state])[0] == pytest.approx(1.0, abs=0.03)
    residuals, _ = fit.residuals_and_jacobian(fit.pack(HULL.ratios, [state]))
    population = fit.objective_of_population(truth[None] * [[1.0], [1.2]], [state])
    assert np.sqrt(np.mean(np.concatenate(residuals) ** 2)) == pytest.approx(population[0], rel=1e-12)
    assert population[1] > 2.0


def test_jacobian_of_the_simulation_objective_against_central_differences():
    motions = [decay(1, 300), decay(2, 200)]
    fit = MotionFit(motions, EQUATIONS['swath-pitch-1'].with_friction(), SCALES, Noise(0.001, 0.0165), FRICTION_RATE)
    states = [InitialState(0.1, 0.05, 0.002), InitialState(0.09, -0.02, -0.001)]
    parameters = fit.pack(HULL.ratios + np.r_[0.02, 0, 0, 0.1, np.zeros(5)], states)
    _, jacobians = fit.residuals_and_jacobian(parameters)
    found = np.concatenate(jacobians)
    for k in range(parameters.size):
        step = np.zeros(parameters.size)
        step[k] = 1e-4
        sides = [np.concatenate(fit.residuals_and_jacobian(parameters + s * step)[0]) for s in (1, -1)]
        numeric = (sides[0] - sides[1]) / 2e-4
        assert found[:, k] == pytest.approx(numeric, abs=2e-3 * max(1.0, np.abs(numeric).max()))


def test_refinement_finds_the_truth_of_a_clean_record_with_its_trim():
    trial = simulated_trial(HULL.with_trim(0.01), 0.1, 12.0, 100.0, SensorNoise(0, 0, 0), seed=1)
    fit = fit_of(trial.axis('pitch'))
    start = fit.pack(HULL.ratios * 1.1, [InitialState(0.09, 0.05, 0.0)])
    parameters, objective, _ = fit.refine(start, np.full(5, -10.0), np.full(5, 10.0))
    ratios, (state,) = fit.unpack(parameters)
    assert ratios == pytest.approx(HULL.ratios, rel=1e-4, abs=1e-5)
    assert (state.x, state.rate, state.trim) == pytest.approx((0.1, 0.0, 0.01), abs=1e-6)
    assert objective < 1e-3


def test_autocovariance_of_white_and_of_coloured_noise():
    rng = np.random.default_rng(1)
    white = rng.normal(size=4000)
    assert autocovariance(white, 20).size <= 3
    assert weighting_noise([np.zeros(50)]) == 1.0
    coloured = np.zeros(40000)
    shocks = rng.normal(size=40000)
    for k in range(1, coloured.size):
        coloured[k] = 0.9 * coloured[k - 1] + shocks[k]
    covariance = autocovariance(coloured, 30)
    assert covariance[0] == pytest.approx(1 / (1 - 0.81), rel=0.1)
    assert covariance.size > 40
    assert covariance[0] + 2 * covariance[1:].sum() == pytest.approx(1 / (1 - 0.9) ** 2, rel=0.25)


def test_correlated_information_is_the_toeplitz_product():
    rng = np.random.default_rng(2)
    sensitivity, covariance = rng.normal(size=(60, 3)), np.array([2.0, 1.0, 0.3])
    toeplitz = sum(covariance[k] * (np.eye(60, k=k) + (np.eye(60, k=-k) if k else 0)) for k in range(3))
    assert correlated_information(sensitivity, covariance) == pytest.approx(sensitivity.T @ toeplitz @ sensitivity)


def test_sandwich_covariance_of_a_regression_with_coloured_noise():
    """The standard deviation it gives is that of the estimates over many realisations."""
    rng = np.random.default_rng(3)
    t = np.arange(1500)
    columns = np.column_stack([np.sin(0.05 * t), np.cos(0.021 * t), np.zeros(1500)])
    estimates, given = [], []
    for _ in range(150):
        noise = np.convolve(rng.normal(size=1500 + 30), np.ones(31) / np.sqrt(31), mode='valid')
        slope = np.linalg.lstsq(columns[:, :2], noise, rcond=None)[0]
        residual = columns[:, :2] @ slope - noise
        covariance = sandwich_covariance([residual], [columns], 30)
        estimates.append(slope)
        given.append(np.sqrt(np.diag(covariance.matrix)[:2]))
        assert np.isnan(covariance.matrix[2]).all()
    assert np.mean(given, axis=0) == pytest.approx(np.std(estimates, axis=0), rel=0.25)
    white = sandwich_covariance([rng.normal(size=1500)], [columns], 30)
    assert white.effective_samples == pytest.approx(1500, rel=0.3)


def test_terms_that_cannot_be_told_apart_are_named():
    covariance = np.array([[1.0, -0.97, 0.0], [-0.97, 1.0, 0.1], [0.0, 0.1, 1.0]])
    assert known_together(['b1', 'b2', 'r1'], covariance) == (('b1', 'b2'),)
    # damping and restoring are each known by themselves
    assert known_together(['b1', 'r1', 'r2'], covariance) == ()
    assert correlation(np.zeros((2, 2))) == pytest.approx(np.eye(2))
