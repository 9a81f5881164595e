"""The searches: they find known minima, stay in bounds, repeat from their seed and stop by named rules."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swath_sysid.attitude.hull.catalogue import EQUATIONS, PUBLISHED_HULLS
from swath_sysid.attitude.hull.scaling import Scales
from swath_sysid.attitude.identification.search import (
    ALGORITHMS,
    PRESETS,
    SearchSettings,
    dimensionless_space,
    published_space,
    run_search,
)
from swath_sysid.common.errors import InputError
from swath_sysid.common.genetic import GeneticSearch, GeneticSettings
from swath_sysid.common.stopping import Cancelled
from swath_sysid.common.swarm import ParticleSwarm, SwarmSettings

SEARCHES = [(GeneticSearch, GeneticSettings), (ParticleSwarm, SwarmSettings)]
EQUATION = EQUATIONS['odd-cubic']


def rotated_valley(candidates, at):
    """A quadratic bowl ten times longer than wide, across the axes."""
    rotation = np.linalg.qr(np.random.default_rng(7).normal(size=(at.size, at.size)))[0]
    return (((candidates - at) @ rotation * np.geomspace(1, 10, at.size)) ** 2).sum(axis=1)


def run(search, objective):
    while not search.should_stop():
        search.tell(objective(search.ask()))
    return search


@pytest.mark.parametrize(('kind', 'options'), SEARCHES)
def test_finds_the_bottom_of_a_rotated_valley(kind, options):
    at = np.array([0.3, -0.4, 0.6, 0.1, -0.7])
    settings_ = options(generations=600, patience=0, spread_tolerance=1e-9)
    search = run(kind(-np.ones(5), np.ones(5), settings_, seed=1), lambda c: rotated_valley(c, at))
    assert search.best == pytest.approx(at, abs=1e-4)


@pytest.mark.parametrize(('kind', 'options'), SEARCHES)
def test_finds_the_global_one_of_many_minima(kind, options):
    def rastrigin(c):
        return 30 + (c**2 - 10 * np.cos(2 * np.pi * c)).sum(axis=1)

    search = run(kind(np.full(3, -4.0), np.full(3, 5.0), options(generations=400, patience=0), seed=2), rastrigin)
    assert search.best == pytest.approx(np.zeros(3), abs=1e-3)


@pytest.mark.parametrize(('kind', 'options'), SEARCHES)
@given(seed=st.integers(0, 10_000), size=st.integers(1, 8), noise=st.booleans())
@settings(max_examples=25, deadline=None)
def test_candidates_stay_within_bounds_whatever_it_is_told(kind, options, seed, size, noise):
    rng = np.random.default_rng(seed)
    lower = rng.uniform(-5, 0, size)
    upper = lower + rng.uniform(1e-3, 5, size)
    search = kind(lower, upper, options(generations=12, population=20), seed, first=[upper + 1.0])
    while not search.should_stop():
        candidates = search.ask()
        assert ((candidates >= lower) & (candidates <= upper)).all()
        values = rng.choice([0.0, 1.0, np.nan, np.inf], len(candidates)) if noise else candidates.sum(axis=1)
        search.tell(values)
    assert search.generation <= 12
    assert ((search.best >= lower) & (search.best <= upper)).all()


@pytest.mark.parametrize(('kind', 'options'), SEARCHES)
def test_best_never_gets_worse_and_the_seed_repeats_the_run(kind, options):
    histories = []
    for _ in range(2):
        search = kind(-np.ones(4), np.ones(4), options(generations=40, patience=0), seed=5)
        history = []
        while not search.should_stop():
            search.tell(rotated_valley(search.ask(), np.zeros(4)))
            history.append(search.best_value)
        assert (np.diff(history) <= 0).all()
        histories.append(history)
    assert histories[0] == histories[1]


@pytest.mark.parametrize(('kind', 'options'), SEARCHES)
def test_stop_rules_by_name(kind, options):
    def stop(objective, **changes):
        return run(kind(-np.ones(2), np.ones(2), options(**changes), seed=1), objective).should_stop()

    assert stop(lambda c: -np.arange(len(c)), generations=5) == 'generations'
    assert stop(lambda c: np.ones(len(c)), patience=6, spread_tolerance=0.0) == 'stagnation'
    assert stop(lambda c: (c**2).sum(axis=1), patience=0, spread_tolerance=1e-3) == 'convergence'


def test_elite_is_inherited_and_not_evaluated_again():
    options = GeneticSettings(population=40, genetic_factor=0.1, generations=10, patience=0)
    search = GeneticSearch([0.0], [1.0], options, seed=1)
    sizes = []
    while not search.should_stop():
        candidates = search.ask()
        sizes.append(len(candidates))
        search.tell(candidates[:, 0])
    assert sizes == [40] + [36] * 9
    assert search.evaluations == sum(sizes)


@pytest.mark.parametrize('algorithm', ALGORITHMS)
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


def test_a_first_guess_is_looked_at():
    space = dimensionless_space(EQUATION)
    guess = np.array([0.123, 0.456, 0.789, 0.5])

    def needle(ratios):
        return np.where(np.abs(ratios - guess).max(axis=1) < 1e-9, 0.0, 1.0)

    for algorithm in ALGORITHMS:
        assert run_search(needle, space, SearchSettings(algorithm, generations=3), first=[guess]).value == 0.0


def test_presets_carry_the_published_parameters():
    assert PRESETS['swath-pitch'].genetic == PRESETS['swath-roll'].genetic
    pitch, foil, usv = (PRESETS[n].genetic for n in ('swath-pitch', 'hydrofoil-pitch', 'swath-usv-pitch'))
    assert (pitch.generations, pitch.population, pitch.crossover, pitch.mutation) == (2000, 200, 0.8, 0.15)
    assert (pitch.genetic_factor, pitch.evolution_weight) == (0.05, 0.9)
    assert (foil.mutation, foil.final_mutation, foil.genetic_factor) == (0.01, 0.0001, 0.1)
    assert (usv.population, usv.crossover) == (400, 0.7)


def test_published_variables_map_to_ratios_and_back():
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
        ({'generations': True}, 'generations must be a whole number'),
        ({'population': 3}, 'population must be a whole number from 8'),
        ({'population': 10**12}, 'population must be a whole number'),
        ({'seed': None}, 'seed must be a whole number from 0'),
    ],
)
def test_bad_settings_are_named(choice, words):
    with pytest.raises(InputError, match=words):
        SearchSettings(**choice)
