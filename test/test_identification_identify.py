"""Identification end to end: truth found on simulated decays, measured figures on real records."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import multivariate_normal, norm

from swath_sysid.attitude.hull.catalogue import (
    EQUATIONS,
    GENERAL_HULL,
    PUBLISHED_HULLS,
    composed,
    equation_named,
    equations_of_axis,
    published_alike,
)
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.identification.identify import IdentificationSettings, identify
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.pruning import log_evidence, prune
from swath_sysid.attitude.identification.scoring import LogPosterior
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.identification.selection import compare, first_part, held_out_error, information_criterion
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.errors import InputError
from swath_sysid.common.stopping import Cancelled
from swath_sysid.formats.reading import read_trial

HULL = PUBLISHED_HULLS['swath-pitch'].model


def decay(seed=1, model=HULL, angle_deg=6.0, duration=15.0, **options):
    noise = options.pop('noise', SensorNoise())
    return simulated_trial(model, np.radians(angle_deg), duration, 100.0, noise, seed, **options).axis(model.axis)


def settings(equation='swath-pitch-2', **options):
    search = SearchSettings(**options.pop('search', {}))
    return IdentificationSettings(equation, search=search, **options)


@pytest.fixture(scope='module')
def plain():
    """One decay of the published hull, identified with the published equation."""
    return identify([decay()], settings())


@pytest.mark.long
@pytest.mark.slow
def test_truth_of_the_published_pitch_hull_within_its_uncertainty():
    errors, scores = [], []
    for seed in range(10):
        found = identify([decay(seed)], settings())
        errors.append([found.model.terms[n] / HULL.terms[n] - 1 for n in ('b1', 'r1')])
        scores.append([(found.model.terms[n] - HULL.terms[n]) / found.std[n] for n in HULL.equation.terms])
    assert np.abs(errors).max(axis=0) == pytest.approx([0.0, 0.0], abs=0.05)
    assert np.abs(errors)[:, 1].max() <= 0.01
    assert np.abs(scores).max() <= 3.0
    assert 0.85 <= np.mean(np.abs(scores) < 1.96) <= 1.0


def test_one_step_objective_is_told_to_be_biased():
    found = identify([decay()], settings(objective='one-step'))
    assert found.model.terms['b1'] > 4 * HULL.terms['b1']
    assert 'one-step-biased' in {a.code for a in found.advice}
    assert found.objective_value == pytest.approx(0.0225, abs=0.001)
    assert found.search.value == pytest.approx(found.objective_value, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize('search', [{'algorithm': 'ga', 'seed': 8}, {'algorithm': 'pso'}])
def test_every_search_and_seed_ends_in_the_same_minimum(search, plain):
    other = identify([decay()], settings(search=search))
    assert other.objective_value == pytest.approx(plain.objective_value, rel=1e-8)
    assert other.model.ratios == pytest.approx(plain.model.ratios, rel=1e-3, abs=1e-3)


def test_preset_searches_the_published_ranges():
    found = identify([decay()], settings(search={'preset': 'swath-pitch', 'generations': 150}))
    assert found.model.terms['b1'] == pytest.approx(HULL.terms['b1'], rel=0.05)
    assert (found.model.ratios >= 0).all()


@pytest.mark.parametrize('channel', ['angle', 'rate'])
def test_one_channel_is_enough(channel):
    motion = decay()
    kept = {'angle': None, 'rate': None, channel: getattr(motion, channel)}
    found = identify([AxisMotion('pitch', motion.time, **kept)], settings('swath-pitch-9'))
    assert found.model.natural_period == pytest.approx(HULL.natural_period, rel=0.03)
    assert found.damping_ratio == pytest.approx(0.24, rel=0.1)
    assert np.isnan(found.trim_std) == (channel == 'rate')
    assert (found.rmse is None) == (channel == 'rate')


@pytest.mark.slow
def test_joint_fit_shares_ratios_and_keeps_trims_apart(plain):
    motions = [decay(seed, HULL.with_trim(trim)) for seed, trim in ((1, 0.01), (2, -0.02), (3, 0.0))]
    found = identify(motions, settings())
    assert [r.state.trim for r in found.records] == pytest.approx([0.01, -0.02, 0.0], abs=3e-4)
    assert found.std['b1'] < 0.7 * plain.std['b1']
    assert found.model.terms['b1'] == pytest.approx(HULL.terms['b1'], abs=3 * found.std['b1'])


def test_simulated_motion_of_the_result_is_that_of_the_model(plain):
    (record,) = plain.records
    angle, rate = simulate(plain.model, record.state.x + plain.model.trim, record.state.rate, record.motion.time)
    assert record.angle == pytest.approx(angle, abs=1e-6)
    assert record.rate == pytest.approx(rate, abs=1e-5)
    assert plain.r2 == pytest.approx(1 - np.var(record.residual) / np.var(record.motion.angle), abs=1e-4)
    low, high = plain.amplitude_range
    assert 0 < low < high == pytest.approx(np.radians(6), rel=0.1)


def test_progress_and_cancelling():
    shares = []
    identify([decay()], settings(), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    with pytest.raises(Cancelled):
        identify([decay()], settings(), should_cancel=lambda: len(shares) > 0)


def assert_no_containing_equation_fits_worse(found):
    fits = [r.identification for r in found.ranked]
    pairs = [(a, b) for a in fits for b in fits if a is not b and a.model.equation.contains(b.model.equation)]
    assert len(pairs) > 20
    for larger, smaller in pairs:
        assert larger.objective_value <= smaller.objective_value * (1 + 1e-9)


def test_a_containing_equation_never_fits_worse():
    chosen = settings(objective='one-step', search={'generations': 40, 'population': 30})
    assert_no_containing_equation_fits_worse(compare(prepare([decay(3)]), equations_of_axis('pitch'), chosen))


@pytest.mark.long
@pytest.mark.slow
def test_comparison_chooses_the_simplest_adequate_equation():
    true = HULL.from_terms(EQUATIONS['swath-pitch-6'], {'b1': 0.6, 'r1': 10.0, 'r2': 25.0})
    problem = prepare([decay(model=true, noise=SensorNoise(3e-4, 0.004))])
    found = compare(problem, [equation for name, equation in EQUATIONS.items() if name.startswith('swath-pitch')])
    assert_no_containing_equation_fits_worse(found)
    assert found.choice.name == 'swath-pitch-6'
    assert 'swath-pitch-6' in found.reason
    criteria = [r.criterion for r in found.ranked]
    assert criteria == sorted(criteria)
    fit = found.ranked[0].identification
    assert information_criterion(fit, 1000.0) == pytest.approx(
        2000 * np.log(fit.objective_value) + len(fit.model.terms) * np.log(1000.0)
    )


def test_held_out_motion_judges_only_what_was_not_fitted():
    problem = prepare([decay(noise=SensorNoise(1e-4, 1e-3))])
    half = first_part(problem)
    assert half.motions[0].time[-1] <= problem.motions[0].time[0] + 0.5 * problem.motions[0].duration
    assert held_out_error(problem, settings()) < 0.1 < held_out_error(problem, settings('swath-pitch-9'))


def test_bad_choices_are_named():
    with pytest.raises(InputError, match='at least one trial'):
        identify([])
    with pytest.raises(InputError, match='different axes'):
        identify([decay(), decay(model=PUBLISHED_HULLS['swath-roll'].model, angle_deg=3.0)])
    with pytest.raises(InputError, match="no objective 'f'"):
        settings(objective='f')
    with pytest.raises(InputError, match='before the end'):
        settings(start=5.0, end=1.0)
    with pytest.raises(InputError, match='none twice'):
        compare(prepare([decay()]), [EQUATIONS['linear']] * 2)


class TestRealRecords:
    """Measured: KVLCC2 roll decays and FOSWEC pitch decays."""

    def test_kvlcc2_at_speed(self, data_folder):
        motion = read_trial(data_folder / 'decay/kvlcc2/run3_15kn.csv').axis('roll')
        found = identify([motion])
        (record,) = found.records
        assert 24 <= record.segment.start <= 30
        assert record.segment.end < 78
        assert found.r2 >= 0.9999
        assert 2.54 <= found.model.natural_period <= 2.55

    @pytest.mark.slow
    def test_kvlcc2_at_rest_from_any_seed(self, data_folder):
        motion = read_trial(data_folder / 'decay/kvlcc2/run2_0kn.csv').axis('roll')
        found = [identify([motion], settings('odd-cubic', search={'seed': seed})) for seed in range(3)]
        assert min(f.r2 for f in found) >= 0.9995
        assert np.ptp([f.r2 for f in found]) < 1e-9
        assert found[0].records[0].segment.duration > 160
        assert identify([motion], settings('linear')).r2 == pytest.approx(0.993, abs=0.001)

    @pytest.mark.slow
    def test_foswec_jointly_needs_friction(self, data_folder):
        motions = [read_trial(p).axis('pitch') for p in sorted((data_folder / 'decay/foswec').glob('*.csv'))]
        assert len(motions) == 9
        rig = identify(motions, settings('odd-cubic+friction'))
        bare = identify(motions, settings('odd-cubic'))
        assert rig.r2 >= 0.998 > bare.r2
        assert min(rig.model.terms[n] for n in ('b0', 'b1', 'b2')) > 0
        assert rig.model.terms['b2'] > 3 * rig.std['b2']


class Regression(LogPosterior):
    """A linear regression: its evidence is known in closed form."""

    def __init__(self, equation, truth, samples=40):
        rng = np.random.default_rng(1)
        n = len(equation.terms)
        super().__init__(equation, np.zeros(n), np.full(n, 2.0), [name.startswith('b') for name in equation.terms])
        self.slopes = rng.normal(size=(samples, n))
        self.values = self.slopes @ truth + rng.normal(size=samples)

    def likelihoods(self, points):
        for z in points:
            e = self.slopes @ z - self.values
            yield 0.5 * e @ e, self.slopes.T @ e, self.slopes.T @ self.slopes

    def optimum(self):
        n = len(self.equation.terms)
        (found,) = self.search_each([np.zeros(n)], [np.zeros(n, dtype=bool)])
        return found


def test_evidence_is_the_marginal_likelihood_of_a_regression():
    case = Regression(composed(('b1', 'r1', 'r2', 'r3')), np.array([5.0, 3.0, 0.2, 0.0]))
    complete = case.optimum()
    kept = np.array([True, True, True, False])
    held = replace(
        complete, z=np.append(np.linalg.solve(complete.information[:3, :3], case.slopes[:, :3].T @ case.values), 0)
    )
    (without,) = case.evaluate([held.z])
    found = log_evidence(case, complete, np.ones(4, dtype=bool)) - log_evidence(case, without, kept)

    def exact(columns):
        covariance = np.eye(40) + 4.0 * case.slopes[:, columns] @ case.slopes[:, columns].T
        return multivariate_normal(np.zeros(40), covariance).logpdf(case.values)

    # what the linear terms' own priors add is the same in both
    assert found == pytest.approx(exact([0, 1, 2, 3]) - exact([0, 1, 2]), abs=0.01)


def test_evidence_of_damping_counts_what_takes_energy_only():
    case = Regression(composed(('b1', 'b2', 'r1')), np.array([5.0, 0.1, 3.0]))
    best = case.optimum()
    (without,) = case.evaluate([np.append(np.linalg.solve(*_of([0, 2], case)), 0.0)[[0, 2, 1]]])
    found = log_evidence(case, best, np.ones(3, dtype=bool)) - log_evidence(
        case, without, np.array([True, False, True])
    )

    def profile(b2):
        rest = np.linalg.solve(
            best.information[::2, ::2], case.slopes[:, ::2].T @ (case.values - b2 * case.slopes[:, 1])
        )
        (at,) = case.evaluate([np.array([rest[0], b2, rest[1]])])
        return np.exp(without.cost - at.cost + 0.5 * b2**2 / 4.0) * 2.0 * norm(0.0, 2.0).pdf(b2)

    assert found == pytest.approx(np.log(quad(profile, 0.0, 5.0)[0]), abs=0.01)


def _of(places, case):
    block = case.evaluate([np.zeros(3)])[0].information[np.ix_(places, places)]
    return block, case.slopes[:, places].T @ case.values


def test_terms_that_are_not_there_go_and_the_others_stay():
    truth = dict.fromkeys(GENERAL_HULL.terms, 0.0) | {'b1': 5.0, 'b3': 2.0, 'r1': 3.0, 'r2': -1.5}
    case = Regression(GENERAL_HULL, np.array(list(truth.values())))
    pruned = prune(case, case.optimum())
    assert [n for n, kept in zip(GENERAL_HULL.terms, pruned.kept, strict=True) if kept] == ['b1', 'b3', 'r1', 'r2']


@pytest.mark.parametrize('name', ['swath-roll', 'hydrofoil-pitch'])
def test_the_next_release_of_a_published_hull_is_reproduced(name):
    hull = PUBLISHED_HULLS[name]
    trial = simulated_trial(hull.model, np.radians(6.0), 20.0, 100.0, SensorNoise(rate=hull.rate_noise), 1, hold=1.0)
    found = identify([trial.axis(hull.axis)])
    time, start = np.arange(0.0, 12.0, 0.02), np.radians(5.0)
    truth = simulate(hull.model, start, 0.0, time)[0]
    error = simulate(found.model.with_trim(0.0), start, 0.0, time)[0] - truth
    assert np.sqrt(np.mean(error**2)) < 0.03 * truth.std()
    assert found.posterior.equation == GENERAL_HULL
    assert set(found.model.terms) < set(GENERAL_HULL.terms)
    assert equation_named(found.model.equation.name).terms == found.model.equation.terms
    assert found.identified_model({}).posterior == found.posterior


def test_friction_is_found_where_only_angles_were_measured_and_left_out_where_there_is_none():
    equation = EQUATIONS['odd-cubic+friction']
    for friction in (0.03, 0.0):
        ratios = {'b0': friction, 'b1': 0.5, 'b2': 0.0, 'r1': 10.0, 'r3': 0.0}
        rig = PUBLISHED_HULLS['swath-pitch'].model.from_terms(equation, ratios, friction_rate=0.006)
        motion = simulated_trial(rig, np.radians(6.0), 15.0, 100.0, SensorNoise(5e-4, 0.004), 1, 1.0).axis('pitch')
        found = identify([replace(motion, rate=None)])
        assert ('b0' in found.model.terms) == (friction > 0.0)
        assert found.model.terms.get('b0', 0.0) == pytest.approx(friction, abs=0.005)
        assert found.basin is None and found.posterior is not None


def test_names():
    assert published_alike(composed(('b1', 'b2', 'r1', 'r2', 'r3')), 'pitch') == ('swath-pitch-2',)
    # a tanker's roll is no hydrofoil's pitch
    assert published_alike(composed(('b1', 'b2', 'b3', 'r1', 'r3')), 'roll') == ()
    with pytest.raises(InputError, match='without a name'):
        IdentificationSettings('')
    with pytest.raises(InputError, match="no equation 'automatic'"):
        IdentificationSettings('automatic')
