"""The likelihood that knows of the basin's motion: filter, derivatives, intervals, and trials that it must stand."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import approx_fprime
from scipy.stats import norm, truncnorm

from swath_sysid.attitude.hull.catalogue import equation_named, hull_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.terms import Scales
from swath_sysid.attitude.identification.basin_likelihood import BasinLikelihood, interval
from swath_sysid.attitude.identification.innovations import BlockedRecord, Hulls, disturbance, innovations
from swath_sysid.attitude.identification.log_posterior import Evaluation, clipped_step, scoring
from swath_sysid.attitude.identification.motion_fit import InitialState
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.motion.segmentation import find_decays
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.formats.identify_records import identify


@pytest.fixture(scope='module')
def bench():
    """The benchmark, as a module: its trials are made by scipy alone."""
    return SimpleNamespace(**runpy.run_path(str(Path(__file__).resolve().parents[1] / 'benchmark' / 'basin.py')))


def motion_of(made):
    return AxisMotion(made.axis, made.time, made.angle, made.rate)


def resonators(frequency, damping, spread):
    """Drift of three resonators, each driven by frequency^2 times the next."""
    drift = np.zeros((6, 6))
    for first, power in ((0, -1), (2, 0), (4, 1)):
        own = frequency * np.exp(power * spread)
        drift[first : first + 2, first : first + 2] = [[0.0, 1.0], [-(own**2), -2 * damping * own]]
    drift[1, 2] = drift[3, 4] = frequency**2
    return drift


def test_disturbance_has_unit_variance_and_its_spectrum_that_of_three_resonators():
    frequency, damping, spread, step = 3.0, 0.2, 0.1, 0.07
    shapes = np.array([frequency, 20.0]), np.array([damping, 0.05]), np.array([spread, 0.4])
    transition, covariance = (each[0] for each in disturbance(*shapes, step))
    assert transition == pytest.approx(expm(resonators(frequency, damping, spread) * step))

    def spectrum(w):
        own = frequency * np.exp(spread * np.array([-1.0, 0.0, 1.0]))
        return 1.0 / np.prod((own**2 - w**2) ** 2 + (2 * damping * own * w) ** 2)

    total = quad(spectrum, 0, np.inf)[0]
    slope = quad(lambda w: w**2 * spectrum(w), 0, np.inf)[0]
    assert covariance[0, 0] == pytest.approx(1.0)
    assert covariance[1, 1] == pytest.approx(slope / total, rel=1e-6)
    noise = covariance - transition @ covariance @ transition.T
    assert np.linalg.eigvalsh(noise).min() > -1e-12


def linear_parts(basin, step):
    """Drift of the state but for the hull, its covariance at the start, a step's noise but for the hull's, (12, 12)."""
    level, *shape = basin[:4]
    drift, start, noise = np.zeros((3, 12, 12))
    drift[0, 1] = drift[1, 6] = 1.0
    drift[4, 4], drift[5, 5] = -1 / basin[7], -1 / basin[9]
    drift[6:, 6:] = resonators(*shape)
    start[3, 3], start[4, 4], start[5, 5] = 0.03**2, basin[6] ** 2, basin[8] ** 2
    start[6:, 6:] = level**2 * disturbance(*np.array(shape)[:, None], step)[1][0]
    f = expm(drift * step)
    noise[2, 2] = basin[10] ** 2 * step
    for block in (slice(4, 5), slice(5, 6), slice(6, 12)):
        noise[block, block] = start[block, block] - f[block, block] @ start[block, block] @ f[block, block].T
    return drift, start, noise


def plain_filter(hull, basin, step, bend, counts, readings):
    """Innovations and variances, slopes of the readings by finite differences, the motion by scipy."""
    drift, spread, noise = linear_parts(basin, step)
    mean, found = np.r_[0.1, -0.05, 0.01, np.zeros(9)], []
    damping, restoring = (np.poly1d([*(hull.terms[f'{side}{power}'] for power in (3, 2, 1)), 0.0]) for side in 'br')

    def motion(t, state, moment, slope):
        x, w = state
        return w, moment + slope * t - np.sign(w) * damping(abs(w)) - restoring(x)

    for k, (count, measured) in enumerate(zip(counts, readings.T, strict=True)):
        if k:
            last = solve_ivp(motion, (0.0, step), mean[:2], args=tuple(mean[6:8]), rtol=1e-9, atol=1e-12).y[:, -1]
            x, w = 0.5 * (mean[:2] + last)
            drift[1, :2] = -restoring.deriv()(x), -damping.deriv()(abs(w))
            f = expm(drift * step)
            mean, spread = np.r_[last, (f @ mean)[2:]], f @ spread @ f.T + noise
        stiffness, damped, moment = restoring.deriv()(mean[0]), damping.deriv()(abs(mean[1])), mean[6]
        force = motion(0.0, mean[:2], moment, 0.0)[1]

        def means(away, here=mean[:2], force=force, stiffness=stiffness, damped=damped):
            """Mean values over a block of the motion, linear about the mean."""
            force = force - stiffness * away[0] - damped * away[1]
            x, w = here + away
            return x + bend * force, w - bend * (stiffness * w + damped * force)

        read = np.zeros((2, 12))
        read[0, [2, 4]] = read[1, [3, 5]] = 1.0
        read[:, :2] = np.array([approx_fprime(np.zeros(2), lambda v, i=i: means(v)[i], 1e-6) for i in range(2)])
        e = measured - np.array(means(np.zeros(2))) - mean[[2, 3]] - mean[[4, 5]]
        s = read @ spread @ read.T + np.diag(np.where(count > 0, basin[4:6] ** 2, 1e12))
        gain = spread @ read.T @ np.linalg.inv(s)
        mean, spread = mean + gain @ e, spread - gain @ read @ spread
        share = s[0, 1] / s[0, 0]
        found.append([[e[0], e[1] - share * e[0]], [s[0, 0], s[1, 1] - share * s[0, 1]]])
    return np.array(found).transpose(1, 0, 2)


@pytest.mark.long
def test_filter_and_its_slopes_by_every_coefficient_are_those_of_a_plain_one_over_blocks():
    basin, step = np.array([0.02, 3.0, 0.3, 0.1, 2e-3, 1e-2, 3e-3, 0.4, 5e-3, 0.2, 1e-3]), 0.02
    readings, counts = 0.02 * np.random.default_rng(1).normal(size=(2, 25)), np.ones((25, 2))
    counts[7, 0] = counts[11, 1] = 0.0
    terms = {'b1': 0.8, 'b2': 2.0, 'b3': 1.5, 'r1': 9.0, 'r2': 20.0, 'r3': 50.0}
    hulls = [DecayModel.of(**terms | {name: 1.01 * terms[name]} if name else terms) for name in ('', *terms)]
    each = np.ones(len(hulls))

    def cost(found):
        e, s = found
        return 0.5 * np.sum(np.log(s) + e * e / s, axis=0)

    for bend in (0.0, 0.004):
        found = innovations(
            Hulls(np.column_stack([hull.ratios for hull in hulls]), hulls[0].equation.active, 0.01),
            np.outer(basin, each),
            np.outer([0.1, -0.05, 0.01], each),
            0.03,
            np.zeros(2),
            BlockedRecord(step, bend, *readings, counts),
        )[:, counts > 0]
        plain = np.stack([plain_filter(hull, basin, step, bend, counts, readings) for hull in hulls], axis=-1)
        plain = plain[:, counts > 0]
        assert found[1] == pytest.approx(plain[1], rel=1e-3)
        assert found[0] / np.sqrt(plain[1]) == pytest.approx(plain[0] / np.sqrt(plain[1]), abs=2e-3)
        slopes, expected = (cost(one)[1:] - cost(one)[0] for one in (found, plain))
        assert slopes == pytest.approx(expected, rel=0.01)


def problem_of(motions, states, scales):
    """What the likelihood asks of a problem."""
    return SimpleNamespace(observed=motions, states=states, scales=scales, friction_rate=1e-3)


def test_gradient_is_that_of_finite_differences(bench):
    made = bench.made_trial('swath-pitch 6', bench.SCENES['waves-0.3'], 1)
    motion = motion_of(made).between(made.release + 0.01, None)
    state = InitialState(float(motion.angle[:5].mean()), 0.0, 0.0)
    equation, scales = equation_named(bench.equation_of(made.truth)), Scales(state.x, np.sqrt(made.truth['r1']))
    likelihood = BasinLikelihood(problem_of([motion], [state], scales), equation)
    ratios = 1.2 * DecayModel.of(**made.truth).ratios
    z = likelihood.start(ratios, 0.02)
    (found,) = likelihood.evaluate([z])
    numeric = approx_fprime(z, lambda v: likelihood.evaluate([v])[0].cost, 1e-6)
    assert found.gradient == pytest.approx(numeric, rel=2e-3, abs=0.05)
    assert np.linalg.eigvalsh(found.information).min() > 0.0
    # where the motion runs away there is no fit
    wild = DecayModel.of(**made.truth | {'r1': -1e4 * made.truth['r1']})
    assert likelihood.minimise([likelihood.start(wild.ratios, 0.003)]) == []


@pytest.mark.long
def test_a_basin_may_move_as_much_as_the_craft(bench):
    """Waves of a tenth of the release need that of a hull whose damping is strong."""
    made = bench.made_trial('hydrofoil-pitch 3', bench.SCENES['waves-0.3'], 10)
    motion = motion_of(made).between(made.release + 0.01, None)
    state, frequency = InitialState(float(motion.angle[:5].mean()), 0.0, 0.0), np.sqrt(made.truth['r1'])
    problem = problem_of([motion], [state], Scales(state.x, frequency))
    likelihood = BasinLikelihood(problem, equation_named(bench.equation_of(made.truth)))
    ratios = DecayModel.of(**made.truth).ratios
    for level in (0.003, 0.3):
        _, basin, _ = likelihood.unpack(likelihood.start(ratios, level))
        assert basin[0] == pytest.approx(level * frequency**2 * state.x, rel=0.25)
    found = likelihood.described(likelihood.minimise(likelihood.starts(ratios, [state])))
    std = np.sqrt(np.diag(found.covariance))
    assert np.all(np.abs(found.ratios - ratios)[likelihood.equation.indices] < 4.0 * std)
    assert found.basin[0] > 0.05 * frequency**2 * state.x


def test_scoring_learns_a_curvature_that_is_not_expected():
    rng = np.random.default_rng(3)
    directions, _ = np.linalg.qr(rng.normal(size=(5, 5)))
    curvature = directions * [6.0, 0.3, 1.0, 1.0, 2.0] @ directions.T
    running = scoring(np.array([2.0, -1.0, 1.0, 0.5, -2.0]), np.full(5, -np.inf), np.full(5, np.inf))
    z = next(running)
    with pytest.raises(StopIteration) as end:
        for _ in range(15):
            z = running.send(Evaluation(z, 0.5 * float(z @ curvature @ z), curvature @ z, np.eye(5)))
    assert end.value.value.cost < 0.01
    # a step is held at a bound
    information = np.array([[2.0, 1.0], [1.0, 2.0]])
    step = clipped_step(np.array([0.1, 0.0]), np.array([3.0, 0.0]), information, np.zeros(2), np.full(2, np.inf))
    assert step == pytest.approx([0.0, 0.05])


@pytest.mark.parametrize('value', [0.0, 0.3, 1.5])
def test_interval_near_a_bound_begins_there_and_holds_95_percent(value):
    low, high = interval(value, 1.0, True)
    assert low == 0.0
    assert truncnorm(-value, np.inf, loc=value).cdf(high) == pytest.approx(0.95)
    for far, is_bounded in ((4.0, True), (0.0, False)):
        assert interval(far, 1.0, is_bounded) == pytest.approx(norm(far).interval(0.95))


def fit(made, equation):
    return identify([motion_of(made)], IdentificationSettings(equation))


OTHERS = [
    pytest.param(h, marks=pytest.mark.release) for h in ('swath-usv-pitch 9', 'swath-pitch 9', 'hydrofoil-pitch 5')
]


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize('hull', ['swath-roll 15', *OTHERS])
def test_intervals_hold_in_waves_at_resonance(bench, hull):
    held = []
    for seed in range(2):
        made = bench.made_trial(hull, bench.SCENES['waves-0.3'], seed)
        found = fit(made, bench.equation_of(made.truth))
        for name, truth in made.truth.items():
            low, high = found.intervals[name]
            held.append(low <= truth <= high)
            assert abs(found.model.terms[name] - truth) < 5.0 * found.std[name]
    assert np.mean(held) >= 0.8


@pytest.mark.long
@pytest.mark.slow
def test_optima_that_the_record_cannot_tell_apart_are_averaged(bench):
    """The likelier of two has r1 of 4 +- 2.5 1/s^2, the truth is 33."""
    made = bench.made_trial('hydrofoil-pitch 3', bench.SCENES['coloured'], 0)
    found = fit(made, bench.equation_of(made.truth))
    assert abs(found.model.terms['r1'] - made.truth['r1']) < 2.0 * found.std['r1']


@pytest.mark.parametrize('scene', ['white', 'wobble-trim', 'coloured', 'waves-0.3'])
@pytest.mark.parametrize('hull', ['swath-pitch 6', 'swath-roll 15', 'hydrofoil-pitch 5', 'swath-usv-pitch 9'])
def test_releases_are_found_to_30_ms(bench, scene, hull):
    made = bench.made_trial(hull, bench.SCENES[scene], 0)
    decay = find_decays(motion_of(made))[0]
    assert decay.beginning == 'released'
    assert decay.start == pytest.approx(made.release, abs=0.03)
    if (hull, scene) == ('hydrofoil-pitch 5', 'waves-0.3'):
        assert 0.8 < decay.period < 1.3


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize(
    ('hull', 'names'), [('swath-pitch 6', ('r2',)), pytest.param('swath-roll 15', ('b3', 'r2'), marks=pytest.mark.long)]
)
def test_a_term_that_the_equation_lacks_is_named_and_least_squares_stays(bench, hull, names):
    made = bench.made_trial(hull, bench.SCENES['white'], 1)
    found = fit(made, 'odd-cubic')
    assert (found.verdict.level, found.verdict.code) == ('doubtful', 'absent-term')
    assert found.absent_term.name in names
    assert found.basin is None
    assert found.r2 > 0.99
    assert fit(made, bench.equation_of(made.truth)).absent_term is None


@pytest.mark.long
@pytest.mark.slow
def test_the_likelihood_takes_waves_for_waves_and_least_squares_stays_where_it_leaves_its_period(bench):
    made = bench.made_trial('hydrofoil-pitch 3', bench.SCENES['all'], 0)
    found = fit(made, 'odd-cubic')
    assert found.basin is not None and found.model.terms['b1'] > 0.0
    assert found.model.terms['r1'] == pytest.approx(made.truth['r1'], abs=3 * found.std['r1'])
    assert found.basin.basin[1] == pytest.approx(np.sqrt(made.truth['r1']), rel=0.3)
    made = bench.made_trial('swath-roll 5', bench.SCENES['white'], 0)
    found = fit(made, 'linear')
    truth = 2 * np.pi / np.sqrt(made.truth['s1'])
    assert found.basin is None
    assert found.model.natural_period == pytest.approx(truth, rel=0.05)
    assert found.verdict.level != 'adequate'


@pytest.mark.long
@pytest.mark.slow
def test_a_hull_that_its_upright_position_throws_off_does_not_widen_the_stiffness():
    # of this record such a hull, swinging 20 deg from there, is nearly as likely
    hull = hull_named('swath-roll').model
    made = simulated_trial(hull, np.radians(8.0), 30.0, 50.0, SensorNoise(), 81)
    found = identify([made.axis('roll')], IdentificationSettings('swath-roll-3'))
    assert found.std['s1'] < 0.01
    assert abs(found.model.terms['s1'] - hull.terms['s1']) < 3.0 * found.std['s1']


@pytest.mark.release
@pytest.mark.slow
def test_many_records_have_an_uncertainty():
    """The determinant of the covariance of fifty parameters is below the smallest number."""
    hull, count = hull_named('swath-pitch').model, 18
    made = simulated_trial(hull, 0.1, 2.0, 25.0, SensorNoise(1e-5, 1e-4, 0.0), 0).axis('pitch')
    records = [made] * count, [InitialState(0.1, 0.0, 0.0)] * count
    likelihood = BasinLikelihood(problem_of(*records, Scales(0.1, hull.natural_frequency)), hull.equation)
    found = likelihood.described(likelihood.evaluate([likelihood.start(hull.ratios, 0.003)]))
    assert np.isfinite(found.covariance).all() and np.isfinite(found.trim_std)
