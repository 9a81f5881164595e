"""Identification and refits of manoeuvring models: truth found, nonsense flagged, nothing unstable."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from manoeuvring_runs import MODEL, OLD, codes, runs_of, trial_of
from scipy.optimize import approx_fprime, least_squares, lsq_linear

from swath_sysid.common.cancelling import Cancelled
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import check_stability
from swath_sysid.manoeuvring.hull.simulation import simulate
from swath_sysid.manoeuvring.hull.standard_tests import RunNoise, run_test, trial_programme, with_noise
from swath_sysid.manoeuvring.identification import held_out
from swath_sysid.manoeuvring.identification.assembly import assemble, moving_runs, seen_region
from swath_sysid.manoeuvring.identification.identify import identify_manoeuvring, split
from swath_sysid.manoeuvring.identification.least_squares import minimise
from swath_sysid.manoeuvring.identification.refit import (
    ManoeuvreRefitOutcome,
    ManoeuvreRefitter,
    pieces,
    refit_manoeuvring,
)
from swath_sysid.manoeuvring.identification.refit import ManoeuvreRefitRequest as Request
from swath_sysid.manoeuvring.identification.selection import shooting_of
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings, cut
from swath_sysid.manoeuvring.identification.shooting import jacobian, residuals
from swath_sysid.manoeuvring.identification.validation import score
from swath_sysid.manoeuvring.motion.intake import prepare, prepare_runs
from swath_sysid.manoeuvring.motion.trial import COMMAND, FORCE
from swath_sysid.manoeuvring.motion.window import ManoeuvringWindow

pytestmark = pytest.mark.slow

QUICK = dict(mass=180.0, generations=4, population=12)


@pytest.fixture(scope='module')
def force_runs():
    return runs_of()


def inside(found, model, names=None):
    for name, d in found.derivatives.items():
        if not d.flags or name in (names or ()):
            assert abs(d.value - model[name]) < 3.5 * d.std, name


def diameters(model, truth):
    measured = run_test('turning-circle', replace(model, largest_input=truth.largest_input, current=(0.0, 0.0))).numbers
    expected = run_test('turning-circle', truth).numbers
    return [measured[n] / expected[n] for n in ('steady_diameter_m', 'tactical_diameter_m')]


@pytest.mark.release
def test_truth_is_found_with_honest_uncertainty(force_runs):
    found = identify_manoeuvring(force_runs, ManoeuvringSettings(**QUICK))
    inside(found, OLD, ('Xu', 'Xuu'))
    for name in ('Xu', 'Xuu', 'Nr'):
        assert found.derivatives[name].value == pytest.approx(OLD[name], rel=0.1)
    assert found.stability.stable
    assert diameters(found.model, OLD) == pytest.approx([1, 1], abs=0.05)
    # all runs are used, and the scores are those of a fit to two thirds of them, on the others
    assert len(found.identified_on) == len(force_runs)
    tested, unseen = split(force_runs)
    alone = identify_manoeuvring(tested, ManoeuvringSettings(**QUICK), unseen)
    assert [run.source for run in found.validated_on] == [run.source for run in unseen]
    assert found.validation == alone.validation
    assert found.validated_model['Xuu'] == alone.model['Xuu'] != found.model['Xuu']
    assert found.derivatives['Xuu'].std < alone.derivatives['Xuu'].std
    assert found.validation.diverged == 0
    assert found.validation.r2['yaw_rate'] > 0.99
    assert found.validation.position_error[20.0] < 1.0
    prime = found.derivatives['Xuu'].prime
    assert prime == pytest.approx(found.derivatives['Xuu'].value / (0.5 * 1025 * 4.88**2))


@pytest.mark.release
def test_commands_curve_and_lag():
    model = OLD.with_values(gain=150.0, dead_band=0.08, lag=0.3, reverse_ratio=0.7)
    model = replace(model, thrust_input=COMMAND, largest_input=1.0)
    runs = runs_of(model, 2, ['speed_up', 'turns_fast', 'zigzag_20', 'reverse', 'mixed'])
    found = identify_manoeuvring(runs, ManoeuvringSettings(**QUICK))
    inside(found, model, ('gain', 'lag', 'dead_band', 'reverse_ratio'))
    assert found.derivatives['lag'].value == pytest.approx(0.3, abs=0.05)
    assert found.derivatives['dead_band'].value == pytest.approx(0.08, abs=0.01)
    assert 'surge-inertia-assumed' in codes(found)
    assert diameters(found.model, model) == pytest.approx([1, 1], abs=0.05)


@pytest.mark.long
@pytest.mark.parametrize('drift_spread', [0.0, 0.05])
def test_forward_model_is_what_is_differentiated(force_runs, drift_spread):
    """The Jacobian with eliminated initial states and drifts against differences of the minimum over them."""
    problem = replace(assemble(force_runs[5:7], ManoeuvringSettings(**QUICK)), drift_spread=drift_spread)
    names = ('Xu', 'Nr', 'lag', 'gain', 'current_east')
    shooting = replace(shooting_of(problem, 20.0), unknowns=problem.unknowns(names))
    values = np.array([-55.0, -380.0, 0.2, 1.02, 0.05])

    def solved(v, hidden, rounds=6):
        for _ in range(rounds):
            r, hidden = residuals(shooting, v, hidden)
        return r, hidden

    residual, hidden = solved(values, shooting.hidden)
    gradient = jacobian(shooting, values, hidden).T @ residual

    def cost(v):
        r, _ = solved(v, hidden)
        return 0.5 * float(r @ r)

    expected = approx_fprime(values, cost, 1e-4 * np.abs(values))
    assert np.allclose(gradient, expected, rtol=0.05, atol=0.02 * np.max(np.abs(expected)) * 1e-2)
    assert np.any(hidden.drift != 0.0) == bool(drift_spread)


@pytest.mark.parametrize('bound', [-np.inf, -1.9])
def test_values_without_a_run_against_fits_without_it(bound, monkeypatch):
    """Exact for a linear problem: the least squares of the others and of the demand of stability, bounds kept."""
    rng = np.random.default_rng(3)
    sizes, truth = (30, 50, 40), np.array([1.0, -2.0, 0.5])
    matrices = [rng.standard_normal((n, 3)) for n in sizes]
    targets = [m @ truth + 0.3 * rng.standard_normal(len(m)) for m in matrices]
    spread = np.array([np.inf, 2.0, np.inf])
    demand, demanded = np.array([[4.0, 0.0, 4.0]]), np.array([4.0])
    lower = np.array([-np.inf, bound, -np.inf])

    def solved(keep):
        rows = [*(matrices[k] for k in keep), demand, np.diag(1.0 / spread)]
        right = np.concatenate([*(targets[k] for k in keep), demanded, np.zeros(3)])
        found = lsq_linear(np.concatenate(rows), right, (lower, np.inf), tol=1e-14)
        return np.where(found.active_mask < 0, lower, found.x)

    best = solved(range(3))
    units = np.array([1.0, 10.0, 0.1])
    unknowns = SimpleNamespace(units=units, spread=spread, lower=lower, upper=np.full(3, np.inf))
    monkeypatch.setattr(held_out, 'instability_slopes', lambda shooting, values: demand)
    expected = [solved([j for j in range(3) if j != k]) for k in range(3)]
    parts = [(m @ best - y, m) for m, y in zip(matrices, targets, strict=True)]
    shooting = SimpleNamespace(unknowns=unknowns)
    told = held_out.information_at(shooting, best, parts)

    def misfits(c):
        # what the regularisation adds to the misfit of the other two
        shared = np.sum((demand @ c - demanded) ** 2) + np.sum((c / spread) ** 2)
        return [np.sum((m @ c - y) ** 2) + 0.5 * shared for m, y in zip(matrices, targets, strict=True)]

    def free_runs(_, candidates):
        return np.array([misfits(c) for c in candidates])

    monkeypatch.setattr(held_out, 'free_run_costs', free_runs)
    assert np.allclose(held_out.values_without_each_part(shooting, best, told), expected, rtol=1e-6)
    # a full step under which even the other runs run away is too long
    monkeypatch.setattr(
        held_out,
        'free_run_costs',
        lambda _, candidates: np.repeat(1e6 * np.sum((candidates - best) ** 2, axis=1)[:, None], 3, axis=1),
    )
    found = held_out.values_without_each_part(shooting, best, told)
    assert np.max(np.abs(found - best)) < 0.1 * np.max(np.abs(np.array(expected) - best))


@pytest.mark.long
def test_what_one_run_alone_determines_has_no_scatter_between_runs(force_runs):
    """Only the mixed run turns: without it yaw is not known at all, which says nothing of how well the run tells it."""
    runs = {run.source: run for run in force_runs}
    few = [runs[name] for name in ('speed_up', 'speed_down', 'mixed')]
    found = identify_manoeuvring(few, ManoeuvringSettings(mass=180.0, generations=0), ())
    inside(found, OLD)
    for name in ('Iz', 'Nr'):
        assert found.derivatives[name].std < 0.1 * abs(found.derivatives[name].value)
        assert 'uncertain' not in found.derivatives[name].flags


@pytest.mark.long
def test_a_straight_run_validates_no_turns(force_runs):
    """Its sway and yaw are sensor noise, which no model explains and any may claim to; a model that turns is told."""
    runs = {run.source: run for run in force_runs}
    settings = ManoeuvringSettings(mass=180.0, terms=('Xu', 'Xuu', 'Yv', 'Nr'), generations=0)
    found = identify_manoeuvring([runs['turns_fast'], runs['mixed']], settings, [runs['speed_up']])
    assert found.validation.r2['surge'] > 0.9
    assert np.isnan([found.validation.r2[name] for name in ('sway', 'yaw_rate')]).all()
    assert (found.verdict.level, found.verdict.code) == ('doubtful', 'not-validated')
    assert 'sway and yaw rate' in found.verdict.sentence
    turning = identify_manoeuvring([runs['turns_fast'], runs['speed_up']], settings, [runs['mixed']])
    assert turning.verdict.code != 'not-validated'
    away = replace(settings, fixed={'N0': 40.0})
    found = identify_manoeuvring([runs['turns_fast'], runs['mixed']], away, [runs['speed_up']])
    assert found.validation.r2['yaw_rate'] < 0


def test_values_on_which_runs_differ_have_their_scatter(monkeypatch):
    """Of four equally long runs the scatter is the jackknife's, whatever the noise of each is thought to be."""
    monkeypatch.setattr(held_out, 'instability_slopes', lambda shooting, values: np.zeros((1, 1)))
    levels, free = np.array([1.0, -1.0, 3.0, -3.0]), np.array([np.inf])
    unknowns = SimpleNamespace(units=np.ones(1), spread=free, lower=-free, upper=free)
    parts = [(np.full(50, -level), np.ones((50, 1))) for level in levels]
    told = held_out.information_at(SimpleNamespace(unknowns=unknowns), np.zeros(1), parts)
    found = held_out.covariance_over_runs(told, np.full((1, 1), 1e-9))
    assert found == pytest.approx(np.sum((levels / 3.0) ** 2), rel=1e-6)


@pytest.mark.release
def test_a_craft_that_hardly_keeps_its_course_gets_a_stable_model():
    craft = OLD.with_values(Nuv=-200.0, Nrr=-1000.0, Yv=-120.0, Yv_dot=-60.0)
    assert check_stability(craft, seen_region(runs_of(OLD, 1, ['mixed']))).largest_growth > 0.0
    runs = runs_of(craft, 6, ['speed_up', 'turns_fast', 'zigzag_10', 'zigzag_20', 'mixed'])
    found = identify_manoeuvring(runs[:4], ManoeuvringSettings(**QUICK), runs[4:])
    assert found.stability.stable
    assert found.stability.largest_growth < 0.0
    assert found.validation.diverged == 0
    assert found.validation.r2['yaw_rate'] > 0.9


def test_least_squares_against_scipy():
    rng = np.random.default_rng(5)
    t = np.linspace(0, 4, 200)
    y = 2.0 * np.exp(-0.7 * t) + 0.3 + 0.01 * rng.normal(size=t.size)

    def misses(x):
        return x[0] * np.exp(-x[1] * t) + x[2] - y

    def slopes(x):
        e = np.exp(-x[1] * t)
        return np.stack([e, -x[0] * t * e, np.ones_like(t)], axis=1)

    for upper in (np.full(3, 10.0), np.array([10.0, 0.6, 10.0])):
        lower = np.zeros(3)
        ours = minimise(
            lambda x, _: (misses(x), None), lambda x, _: slopes(x), np.full(3, 0.5), lower, upper, None, 60, 1e-12
        )
        theirs = least_squares(misses, np.full(3, 0.5), slopes, bounds=(lower, upper), xtol=1e-14, ftol=1e-14)
        assert ours.cost == pytest.approx(theirs.cost, rel=1e-6)
        assert np.allclose(ours.x, theirs.x, atol=1e-4)


def test_windows_do_not_cross_gaps(force_runs):
    run = force_runs[0]
    driven = np.ones(run.time.size, dtype=bool)
    driven[300:330] = False
    windows = cut([replace(run, driven=driven)])
    ends = windows.start + windows.steps
    assert np.all((ends < 300) | (windows.start >= 350))
    assert windows.start[0] == 20
    with pytest.raises(InputError, match='no run holds'):
        cut([replace(run, driven=np.zeros_like(driven))])


def test_the_diverging_model_is_counted_and_the_split_keeps_the_extremes(force_runs):
    assert score(OLD.with_values(Nr=-1.0, Nv=-300.0), force_runs[4:6]).diverged > 0
    kept, held_out = split(force_runs)
    assert len(held_out) == 3
    assert seen_region(kept).fastest == pytest.approx(seen_region(force_runs).fastest, rel=0.05)


@pytest.mark.long
def test_anchored_runs_are_left_out_or_refused(force_runs):
    still = with_noise(simulate(OLD, np.zeros(600), np.zeros(600), 0.1), RunNoise(), 1)
    anchored = prepare_runs([trial_of(still, 'anchored')])
    found = identify_manoeuvring([*force_runs[4:7], *anchored], ManoeuvringSettings(**QUICK), validation=())
    assert 'at-anchor' in codes(found)
    assert len(found.identified_on) == 3
    with pytest.raises(InputError, match='at anchor'):
        identify_manoeuvring(anchored, ManoeuvringSettings(**QUICK))


def test_constant_thrust_flags_every_surge_derivative():
    steady = simulate(OLD, np.full(1200, 60.0), np.full(1200, 60.0), 0.1)
    runs = prepare_runs([trial_of(with_noise(steady, RunNoise(), 1), 'steady')])
    found = identify_manoeuvring(runs, ManoeuvringSettings(**QUICK))
    assert {'constant-thrust', 'no-turn'} <= codes(found)
    assert all('constant-thrust' in d.flags for d in found.derivatives.values())
    assert not {'Nr', 'Iz', 'Yv', 'Yv_dot'} & set(found.derivatives)
    assert {'Nr', 'Iz', 'Yv'} <= set(found.fixed) and found.stability.stable


@pytest.mark.release
def test_wrong_scale_of_thrust_is_noticed(force_runs):
    doubled = [replace(run, port=3 * run.port, starboard=3 * run.starboard) for run in force_runs[:6]]
    found = identify_manoeuvring(doubled, ManoeuvringSettings(**QUICK), validation=())
    assert 'strange-inertia' in codes(found)


@pytest.mark.long
def test_what_is_given_stays_given(force_runs):
    given = dict(terms=('Xu', 'Xuu', 'Nr', 'Yv', 'Nr_dot'), fixed={'Xu_dot': -5.0, 'Yv_dot': 0.0})
    settings = ManoeuvringSettings(**QUICK, **given, inertia=400.0, lever=1.0)
    found = identify_manoeuvring(force_runs[3:], settings, validation=())
    assert set(found.derivatives) == {'Xu', 'Xuu', 'Nr', 'Yv', 'Nr_dot'}
    assert found.model['Xu_dot'] == -5.0
    assert found.model['Iz'] == 400.0
    ratio = 1.0 / 1.027135
    assert found.model['Nr'] == pytest.approx(-400.0 * ratio, rel=0.02)
    assert 400.0 - found.model['Nr_dot'] == pytest.approx(446.0 * ratio, rel=0.03)


@pytest.mark.release
def test_same_seed_same_numbers_and_cancel(force_runs):
    settings = ManoeuvringSettings(**QUICK)
    first, second = (identify_manoeuvring(force_runs[4:6], settings) for _ in range(2))
    assert np.array_equal(first.values, second.values)
    told = []
    with pytest.raises(Cancelled):
        identify_manoeuvring(force_runs[4:6], settings, progress=told.append, should_cancel=lambda: len(told) > 2)
    assert all(0 <= share <= 1 for share in told)


def test_wrong_settings_and_mixed_inputs_are_refused(force_runs):
    wrong = dict(mass=-1.0, terms=('Zw',), current='strong', generations=-1, population=3, lever=float('nan'))
    for name, value in wrong.items():
        with pytest.raises(InputError):
            ManoeuvringSettings(**{name: value})
    with pytest.raises(InputError, match='separately'):
        identify_manoeuvring([force_runs[0], replace(force_runs[1], thrust_input=COMMAND)], validation=())
    with pytest.raises(InputError, match='no run'):
        identify_manoeuvring([])


@pytest.mark.release
def test_each_run_has_its_own_current():
    truth = 3 * [(0.2, 0.1), (-0.15, 0.12)]
    runs = runs_of(OLD, 3, ['speed_up', 'turns_slow', 'turns_fast', 'zigzag_10', 'zigzag_20', 'mixed'], truth)
    found = identify_manoeuvring(runs[:4], ManoeuvringSettings(**QUICK), runs[4:])
    assert found.has_currents_by_run
    assert 'current-by-run' in codes(found)
    assert np.allclose(found.currents, truth[:4], atol=0.05)
    inside(found, OLD)
    assert score(found.model, runs[4:], currents=truth[4:]).r2['surge'] > 0.97
    assert found.validation.r2 == score(found.model, runs[4:]).r2
    plain = identify_manoeuvring(runs[:4], ManoeuvringSettings(**QUICK, current='none'), runs[4:])
    assert not plain.has_currents_by_run
    assert plain.validation.r2['surge'] < found.validation.r2['surge']


@pytest.fixture(scope='module')
def window():
    """One that saw three runs one after the other."""
    window, start = ManoeuvringWindow(), 0.0
    for k, name in enumerate(('speed_up', 'turns_fast', 'zigzag_20')):
        m = with_noise(trial_programme(OLD)[name], RunNoise(), 10 + k)
        columns = (m.time + start, m.surge, m.sway, m.yaw_rate, m.heading, m.x, m.y)
        for port, starboard, *motion in zip(m.port, m.starboard, *columns, strict=True):
            thrusts(window, port, starboard)
            window.add_motion(*motion)
        start += m.time[-1] + 10.0
    return window


def thrusts(window, port, starboard):
    window.add_thrust('port', port)
    window.add_thrust('starboard', starboard)


@pytest.fixture(scope='module')
def outcome(window):
    return refit_manoeuvring(Request(window.trial(), None, ManoeuvringSettings(mass=180.0, generations=0)))


@pytest.mark.long
def test_the_window_keeps_what_came_and_its_pieces_do_not_span_gaps(window):
    trial, first = window.trial(), trial_programme(OLD)['speed_up']
    assert (trial.thrust_input, trial.frame, trial.time.size) == (FORCE, 'enu', window.size)
    assert np.array_equal(trial.port[: first.time.size], first.port)
    run = prepare(trial)
    parts = pieces(run)
    assert len(parts) >= 4
    for part in parts:
        known = np.flatnonzero(np.isfinite(part.surge))
        assert np.max(np.diff(known)) * part.step < 2.1
        assert part.smooth.shape == (3, part.time.size)
    with pytest.raises(InputError, match='too short'):
        pieces(replace(run, time=run.time[:300]))


@pytest.mark.parametrize(
    'gains, helps',
    [
        (8 * (0.35,), True),
        (8 * (0.25,), False),  # a quarter percent is nothing
        (4 * (12.1, -7.9), True),
        (4 * (11.5, -8.5), False),  # less than half a standard error
        ((100.0, *7 * (-2.0,)), False),  # one run cannot outvote all others
    ],
)
def test_terms_help_where_runs_held_out_gain_beyond_their_scatter(gains, helps):
    before = np.full(8, 100.0)
    assert held_out.helps(before - gains, before) == helps


@pytest.mark.parametrize(
    'speed, rate, moves', [(0.14, 0.0, False), (0.16, 0.0, True), (0.0, 0.018, False), (0.0, 0.022, True)]
)
def test_a_craft_at_anchor_neither_moves_nor_turns(speed, rate, moves):
    still = SimpleNamespace(smooth=np.zeros((3, 9)), port=np.ones(9), starboard=np.ones(9), source='still')
    run = SimpleNamespace(**{**vars(still), 'smooth': np.full((3, 9), [[speed], [0.0], [rate]])})
    try:
        assert moving_runs([run])[0] == (run,) and moves
    except InputError:
        assert not moves


def test_the_last_twenty_models_can_be_returned_to_and_the_oldest_motion_gives_way():
    assert ManoeuvreRefitter(None, range(30)).steps_back == 20
    window = ManoeuvringWindow(duration=60.0)
    thrusts(window, 0.5, 0.4)
    for k in range(20000):
        window.add_motion(0.01 * k, 1.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    trial = window.trial()
    assert trial.thrust_input == COMMAND
    assert trial.time[-1] - trial.time[0] == pytest.approx(60.0, abs=0.2)
    assert 1150 <= window.size <= 1200
    thrusts(window, 1.2, 0.4)
    window.add_motion(201.0, 1.0, 0.0, 0.1, 0.0, 0.0, 0.0)
    assert window.trial().thrust_input == FORCE


def test_what_is_wrong_is_counted_and_left_out():
    window = ManoeuvringWindow(stop_after=0.5)
    with pytest.raises(InputError, match='port and starboard'):
        window.trial()
    window.add_motion(0.0, 1, 0, 0, 0, 0, 0)
    window.add_thrust('port', float('nan'))
    thrusts(window, 50.0, 40.0)
    with pytest.raises(InputError, match='odometry'):
        window.trial()
    for stamp in (0.0, 0.1, 0.1, 0.05, 0.2):
        window.add_motion(stamp, 1, 0, 0.1, 0, 0, 0)
    window.add_motion(0.3, float('inf'), 0, 0, 0, 0, 0)
    window.add_motion(0.3, 1, 0, 0, 0, 1e30, 0)
    window.add_motion(1.0, 1, 0, 0.1, 0, 0, 0)
    assert window.counts == {'not-finite': 2, 'absurd-value': 1, 'late': 2, 'jumped-back': 0, 'no-thrust': 1}
    assert window.trial().port.tolist() == [50.0, 50.0, 50.0, 0.0]
    window.add_motion(-50.0, 1, 0, 0.1, 0, 0, 0)
    assert window.counts['jumped-back'] == 1
    assert window.size == 1


@pytest.mark.long
def test_a_refit_finds_the_craft(outcome):
    assert outcome.model is not None, outcome.message
    assert outcome.model.model['Xuu'] == pytest.approx(OLD['Xuu'], rel=0.2)
    assert outcome.model.model['Nr'] == pytest.approx(OLD['Nr'], rel=0.1)
    assert outcome.model.metrics['held_out']
    assert np.isnan(outcome.current_misfit)


def test_there_is_a_way_back():
    outcome, refitter = ManoeuvreRefitOutcome(MODEL, ''), ManoeuvreRefitter()
    assert not refitter.rollback()
    assert refitter.take(outcome)
    assert not refitter.rollback()
    assert refitter.take(replace(outcome, model=replace(MODEL, metrics={})))
    assert refitter.rollback()
    assert refitter.model is MODEL
    assert not refitter.take(replace(outcome, model=None))


@pytest.mark.release
def test_only_a_better_model_replaces_the_current_one(window, outcome):
    good = outcome.model
    settings = ManoeuvringSettings(**QUICK)
    again = refit_manoeuvring(Request(window.trial(), good, settings))
    assert again.model is None
    assert 'as well' in again.message
    wrong = replace(good, model=good.model.with_values(Xuu=-150.0, Nr=-800.0))
    better = refit_manoeuvring(Request(window.trial(), wrong, settings))
    assert better.model is not None
    assert better.misfit < 0.8 * better.current_misfit
