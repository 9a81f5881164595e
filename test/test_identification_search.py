"""The searches: they find known minima, stay in bounds, repeat from their seed and stop by named rules."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from swath_sysid.attitude.hull.catalogue import EQUATIONS, PUBLISHED_HULLS
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.terms import TERM_NAMES, Scales, term_moments
from swath_sysid.attitude.identification.fit_quality import known_together
from swath_sysid.attitude.identification.forecast_check import OneStepObjective
from swath_sysid.attitude.identification.motion_fit import InitialState, MotionFit, Noise
from swath_sysid.attitude.identification.search import (
    PRESETS,
    SearchSettings,
    dimensionless_space,
    published_space,
    run_search,
)
from swath_sysid.common.cancelling import Cancelled
from swath_sysid.common.covariance import sandwich_covariance
from swath_sysid.common.errors import InputError
from swath_sysid.common.optimisers import OPTIMISERS
from swath_sysid.common.signals import autocovariance, correlated, weighting_noise

EQUATION = EQUATIONS['odd-cubic']


def rotated_valley(candidates, at):
    """A quadratic bowl ten times longer than wide, across the axes."""
    rotation = np.linalg.qr(np.random.default_rng(7).normal(size=(at.size, at.size)))[0]
    return (((candidates - at) @ rotation * np.geomspace(1, 10, at.size)) ** 2).sum(axis=1)


def run(search, objective):
    while not search.should_stop():
        search.tell(objective(search.ask()))
    return search


@pytest.mark.parametrize('kind', OPTIMISERS.values())
def test_finds_the_global_one_of_many_minima(kind):
    def rastrigin(c):
        return 30 + (c**2 - 10 * np.cos(2 * np.pi * c)).sum(axis=1)

    search = run(kind(np.full(3, -4.0), np.full(3, 5.0), kind.Settings(generations=400, patience=0), seed=2), rastrigin)
    assert search.best == pytest.approx(np.zeros(3), abs=1e-3)


@pytest.mark.parametrize('kind', OPTIMISERS.values())
@given(seed=st.integers(0, 10_000), size=st.integers(1, 8), noise=st.booleans())
@settings(max_examples=25, deadline=None)
def test_candidates_stay_within_bounds_whatever_it_is_told(kind, seed, size, noise):
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-5, 0, size)
    upper = lower + rng.uniform(1e-3, 5, size)
    search = kind(lower, upper, kind.Settings(generations=12, population=20), seed, first=[upper + 1.0])
    while not search.should_stop():
        candidates = search.ask()
        assert ((candidates >= lower) & (candidates <= upper)).all()
        values = rng.choice([0.0, 1.0, np.nan, np.inf], len(candidates)) if noise else candidates.sum(axis=1)
        search.tell(values)
    assert search.generation <= 12
    assert ((search.best >= lower) & (search.best <= upper)).all()


@pytest.mark.parametrize('kind', OPTIMISERS.values())
def test_best_never_gets_worse_and_the_seed_repeats_the_run(kind):
    histories = []
    for _ in range(2):
        search = kind(-np.ones(4), np.ones(4), kind.Settings(generations=40, patience=0), seed=5)
        history = []
        while not search.should_stop():
            search.tell(rotated_valley(search.ask(), np.zeros(4)))
            history.append(search.best_value)
        assert (np.diff(history) <= 0).all()
        histories.append(history)
    assert histories[0] == histories[1]


@pytest.mark.parametrize('kind', OPTIMISERS.values())
def test_stop_rules_by_name(kind):
    def stop(objective, **changes):
        return run(kind(-np.ones(2), np.ones(2), kind.Settings(**changes), seed=1), objective).should_stop()

    assert stop(lambda c: -np.arange(len(c)), generations=5) == 'generations'
    assert stop(lambda c: np.ones(len(c)), patience=6, spread_tolerance=0.0) == 'stagnation'
    assert stop(lambda c: (c**2).sum(axis=1), patience=0, spread_tolerance=1e-3) == 'convergence'


@pytest.mark.parametrize('algorithm', OPTIMISERS)
def test_run_search_reports_progress_and_can_be_cancelled(algorithm):
    space = dimensionless_space(EQUATION)
    target = 0.5 * (space.lower + space.upper)
    shares = []
    found = run_search(
        lambda r: rotated_valley(r, target), space, SearchSettings(algorithm, generations=150), progress=shares.append
    )
    assert found.best == pytest.approx(target, abs=0.05)
    assert shares == sorted(shares)
    assert found.evaluations > found.generations > 10
    with pytest.raises(Cancelled):
        run_search(lambda r: rotated_valley(r, target), space, SearchSettings(algorithm), should_cancel=lambda: True)


def test_presets_carry_the_published_parameters_and_variables():
    pitch, foil, usv = (PRESETS[n].genetic for n in ('swath-pitch', 'hydrofoil-pitch', 'swath-usv-pitch'))
    assert (pitch.generations, pitch.population, pitch.crossover, pitch.mutation) == (2000, 200, 0.8, 0.15)
    assert (pitch.genetic_factor, pitch.evolution_weight) == (0.05, 0.9)
    assert (foil.mutation, foil.final_mutation, foil.genetic_factor) == (0.01, 0.0001, 0.1)
    assert (usv.population, usv.crossover) == (400, 0.7)
    model = PUBLISHED_HULLS['swath-roll'].model
    scales = Scales(0.09, 2.5)
    space = published_space(model.equation, PRESETS['swath-roll'], scales)
    dimensionless = model.ratios[model.equation.indices] / scales.ratio_units[model.equation.indices]
    candidate = space.from_ratios(dimensionless)
    assert ((candidate >= space.lower) & (candidate <= space.upper)).all()
    assert space.to_ratios(candidate[None])[0] == pytest.approx(dimensionless)
    with pytest.raises(InputError, match='none for friction'):
        published_space(model.equation.with_friction(), PRESETS['swath-roll'], scales)


@pytest.mark.parametrize(
    ('choice', 'words'),
    [
        ({'algorithm': 'sa'}, "no search algorithm 'sa'"),
        ({'preset': 'nobody'}, "no preset 'nobody'"),
        ({'algorithm': 'pso', 'preset': 'swath-roll'}, 'genetic algorithm'),
        ({'generations': 0}, 'generations must be a whole number from 1 to 100000, not 0'),
        ({'population': 10**12}, 'population must be a whole number'),
        ({'seed': None}, 'seed must be a whole number from 0'),
    ],
)
def test_bad_settings_are_named(choice, words):
    with pytest.raises(InputError, match=words):
        SearchSettings(**choice)


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


def test_one_step_objective_is_the_published_sum_and_takes_no_step_over_a_gap():
    motion = decay(samples=300)
    uneven = motion.only(np.arange(300) % 3 != 1)
    ratios = np.random.default_rng(2).uniform(0, 5, (4, len(TERM_NAMES)))
    for record in (motion, uneven):
        found = OneStepObjective.of([record], [0.01], FRICTION_RATE)(ratios)
        assert found == pytest.approx([direct_one_step(record, r, 0.01) for r in ratios], rel=1e-10)
    motion, ratios = decay(samples=400), HULL.ratios[None]
    first, second, whole = (
        OneStepObjective.of([motion.only(np.r_[s])], [0.0], FRICTION_RATE)
        for s in (np.s_[0:150], np.s_[250:400], np.s_[0:150, 250:400])
    )
    assert whole.samples == first.samples + second.samples
    pooled = np.sqrt((first(ratios) ** 2 * first.samples + second(ratios) ** 2 * second.samples) / whole.samples)
    assert whole(ratios) == pytest.approx(pooled)


@pytest.mark.parametrize('name', ['swath-pitch-1', 'odd-cubic+friction'])
def test_one_step_minimum_is_scipys_on_the_whole_record(name):
    motion, equation = decay(), EQUATIONS[name]
    objective = OneStepObjective.of([motion], [0.0], FRICTION_RATE)
    ratios = objective.minimum(equation, np.zeros(len(TERM_NAMES)), np.full(len(TERM_NAMES), 1e4))
    moments = term_moments(motion.angle[:-1], motion.rate[:-1], FRICTION_RATE)[equation.indices]
    rows = (moments * np.diff(motion.time)).T
    expected = lsq_linear(rows, -np.diff(motion.rate), (0, np.inf), tol=1e-14)
    error = np.sqrt(np.mean((rows @ expected.x + np.diff(motion.rate)) ** 2))
    assert objective(ratios[None])[0] == pytest.approx(error, rel=1e-9)


def test_simulation_objective_at_the_truth_is_the_noise():
    fit = MotionFit([decay()], HULL.equation, SCALES, Noise(0.001, 0.0165), FRICTION_RATE)
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
    parameters = fit.pack(DecayModel.of(**HULL.terms | {'b0': 0.02, 'b3': 0.1}).ratios, states)
    _, jacobians = fit.residuals_and_jacobian(parameters)
    found = np.concatenate(jacobians)
    for k in range(parameters.size):
        step = np.zeros(parameters.size)
        step[k] = 1e-4
        sides = [np.concatenate(fit.residuals_and_jacobian(parameters + s * step)[0]) for s in (1, -1)]
        numeric = (sides[0] - sides[1]) / 2e-4
        assert found[:, k] == pytest.approx(numeric, abs=2e-3 * max(1.0, np.abs(numeric).max()))


def test_autocovariance_and_its_product_with_a_sensitivity():
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
    rng = np.random.default_rng(2)
    sensitivity, covariance = rng.normal(size=(60, 3)), np.array([2.0, 1.0, 0.3])
    toeplitz = sum(covariance[k] * (np.eye(60, k=k) + (np.eye(60, k=-k) if k else 0)) for k in range(3))
    assert correlated(sensitivity, covariance) == pytest.approx(toeplitz @ sensitivity)


def test_sandwich_covariance_of_a_regression_with_coloured_noise():
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


@pytest.mark.long
def test_sandwich_covariance_of_noise_that_the_fit_absorbs():
    rng = np.random.default_rng(4)
    t = np.arange(1500)
    along = t / t.size
    columns = np.column_stack([along**k * wave for k in range(3) for wave in (np.cos(0.3 * t), np.sin(0.3 * t))])
    own = np.exp(-t / 1000) * np.cos(0.3 * t)
    resonator = np.linalg.cholesky(own[np.abs(t[:, None] - t)] + 1e-9 * np.eye(t.size))
    for slow, covered, covered_by_brief in ((2.0, (0.8, 0.97), (0.3, 0.6)), (0.0, (0.92, 0.985), (0.92, 0.985))):
        inside = []
        for _ in range(100):
            noise = slow * resonator @ rng.normal(size=t.size) + 0.3 * rng.normal(size=t.size)
            slope = np.linalg.lstsq(columns, noise, rcond=None)[0]
            found = [sandwich_covariance([columns @ slope - noise], [columns], 10, kinds) for kinds in ([own], [])]
            inside.append([np.abs(slope) < 1.96 * np.sqrt(np.diag(each.matrix)) for each in found])
        lasting, brief = np.mean(inside, axis=(0, 2))
        assert covered[0] < lasting < covered[1]
        assert covered_by_brief[0] < brief < covered_by_brief[1]


def test_terms_that_cannot_be_told_apart_are_named():
    covariance = np.array([[1.0, -0.97, 0.0], [-0.97, 1.0, 0.1], [0.0, 0.1, 1.0]])
    assert known_together(['b1', 'b2', 'r1'], covariance) == (('b1', 'b2'),)
    # damping and restoring are each known by themselves
    assert known_together(['b1', 'r1', 'r2'], covariance) == ()
