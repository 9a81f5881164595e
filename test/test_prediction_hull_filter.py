"""The filter on the hull against independent oracles: matrix exponentials, closed forms, simulated releases."""

import copy
import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp, trapezoid
from scipy.linalg import block_diag, expm, solve_continuous_lyapunov
from scipy.stats import multivariate_normal, norm

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.craft_simulator import CraftSettings, SensorNoise, SimulatedCraft
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import HullPosterior, IdentifiedModel
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, TERM_NAMES, TERMS
from swath_sysid.attitude.prediction import hull_filter
from swath_sysid.attitude.prediction.hull_filter import ExcitationFit, HullFilter, HullFilterSettings, HullPrior
from swath_sysid.attitude.prediction.hull_track import (
    HULL_STATES,
    RATIOS,
    STRAIN_GAIN,
    HullTrack,
    hull_step,
    predict,
)
from swath_sysid.attitude.prediction.modal_moment import ModalMoment, sum_of_moments
from swath_sysid.common.errors import InputError

NAN = math.nan
ROLL = hull_named('swath-roll').model
LINEAR = DecayModel.of(b1=0.5, r1=6.0, trim=0.01, axis='roll')
ANGLE_NOISE, RATE_NOISE = 5e-4, 3e-3
VARIANCES = ANGLE_NOISE**2, RATE_NOISE**2
OF_HULL = slice(2, HULL_STATES)


def known_to(model, trim_std, stiffness, damping):
    """The model with standard deviations of the factors common to its restoring and to its damping terms."""
    values = model.ratios[model.equation.indices]
    is_damping = model.equation.indices < 4
    parts = stiffness * values * ~is_damping, damping * values * is_damping
    return IdentifiedModel(model, sum(np.outer(part, part) for part in parts), trim_std)


EXACT_ROLL = IdentifiedModel.exactly(ROLL)


def swell():
    """Two resonances and an overdamped part, as a dense state space."""
    generator = np.array([
        [0.0, 1.0, 0.0, 0.0, 0.0], [-4.0, -0.3, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, -9.0, -0.8, 0.0],
        [0.1, 0.0, 0.0, 0.0, -1.5],
    ])  # fmt: skip
    driven = np.array([0.0, 0.1, 0.0, 0.05, 0.02])
    stationary = solve_continuous_lyapunov(generator, -np.outer(driven, driven) - 1e-6 * np.eye(5))
    return generator, np.array([1.0, 0.1, 0.5, 0.0, 0.3]), stationary


def modal(generator, output, stationary, step=0.1):
    """The same in modal form."""
    return ModalMoment.from_discrete(expm(step * generator), output, stationary, step)


def filter_of(identified, angle=0.0, rate=0.0, **settings_):
    attitude = HullFilter(HullFilterSettings(**settings_))
    attitude.set_hull(identified)
    attitude.start(angle, rate, *VARIANCES)
    return attitude


def test_the_modal_form_has_the_covariance_function_of_the_dense_one():
    coinciding = np.array([[-2.0, 1.0], [0.0, -2.0]])
    drive = solve_continuous_lyapunov(coinciding, -np.diag([0.0, 1.0]))
    for (generator, output, stationary), step, rel in (
        (swell(), 0.02, 1e-5),
        (swell(), 0.1, 1e-5),
        ((coinciding, np.array([1.0, 0.0]), drive), 0.1, 0.01),
    ):
        moment = modal(generator, output, stationary, step)
        for lag in (0.0, 0.013, 0.1, 0.5, 5.0):
            f = expm(moment.generator * lag)
            assert moment.output @ f @ moment.stationary @ moment.output == pytest.approx(
                output @ expm(generator * lag) @ stationary @ output, rel=rel, abs=rel * 1e-3
            )
            assert np.linalg.eigvalsh(moment.stationary - f @ moment.stationary @ f.T).min() > -1e-9


def test_what_alternates_from_step_to_step_is_forgotten():
    transition = np.diag([0.9, -0.5])
    moment = ModalMoment.from_discrete(transition, np.ones(2), np.eye(2), 0.1)
    assert np.isfinite(moment.stationary).all() and moment.variance == pytest.approx(2.0)
    assert np.abs(np.linalg.eigvals(expm(0.1 * moment.generator))).max() == pytest.approx(0.9)


EVERY = {'b0': 0.02, 'b1': 0.3, 'b2': 2.0, 'b3': 5.0, 'r1': 5.0, 'r2': 3.0, 'r3': -20.0, 's1': 2.0, 's2': -4.0}
GENERAL = DecayModel.from_terms(Equation('every', TERM_NAMES), EVERY, friction_rate=0.05)


@settings(max_examples=25, deadline=None)
@given(st.floats(-0.1, 0.2), st.floats(0.1, 0.3), st.floats(-1.0, 1.0))
def test_a_step_of_the_hull_solves_its_equation_and_so_do_its_slopes(angle, rate, moment):
    step = 0.005

    def exact(state):
        hull = DecayModel(GENERAL.equation, state[RATIOS:-1], state[2], GENERAL.friction_rate)

        def equation(_, y):
            return [y[1], hull.acceleration(*y) + state[-1]]

        return solve_ivp(equation, (0.0, step), state[:2], rtol=1e-10, atol=1e-12).y[:, -1]

    state = np.array([angle, rate, 0.01, *GENERAL.ratios, moment])
    hull = GENERAL.equation.active, GENERAL.friction_rate
    new_angle, new_rate, slopes = hull_step(state[:-1], moment, 0.0, step, hull)
    assert [new_angle, new_rate] == pytest.approx(exact(state), abs=1e-7)
    for j, small in enumerate(1e-5 * np.eye(state.size)):
        slope = (exact(state + small) - exact(state - small)) / 2e-5
        assert slopes[:, j] == pytest.approx(slope, abs=2e-3 * max(1.0, abs(slope).max()))


@pytest.mark.parametrize(
    'hull',
    [ROLL, *(DecayModel.of(**{name: 1.5}, r1=0.0) for name in DAMPING_NAMES if TERMS[name].power > 0)],
    ids=lambda hull: hull.equation.name,
)
@pytest.mark.parametrize('rate', [0.02, 0.1])
def test_an_uncertain_rate_is_damped_by_the_mean_of_the_damping(hull, rate):
    """Of every row of the table, and of a published hull; dry friction is left as it is."""
    step, spread = 1e-3, 0.3
    w, density = np.linspace(-3.0, 3.0, 60001), norm(rate, spread).pdf
    mean = float(trapezoid(density(w) * hull.acceleration(0.0, w), w))
    state = np.array([0.0, rate, 0.0, *hull.ratios])
    _, new_rate, slopes = hull_step(state, 0.0, spread**2, step, (hull.equation.active, hull.friction_rate))
    assert (new_rate - rate) / step == pytest.approx(mean, rel=0.03)
    # linear in the ratios, damping is their sum with their slopes
    assert slopes[1, RATIOS:-1] @ hull.ratios / step == pytest.approx(mean, rel=0.03)


def test_the_sparse_prediction_is_the_dense_one():
    """A P A' + Q, with the moment's noise acting on the hull by half."""
    moment, rng, step = modal(*swell()), np.random.default_rng(4), 0.02
    n, f, h = HULL_STATES + moment.size, expm(step * moment.generator), moment.output
    root = 0.01 * rng.normal(size=(n, n))
    mean = np.concatenate([[0.1, 0.2, 0.01], ROLL.ratios, 0.1 * rng.normal(size=moment.size)])
    covariance = root @ root.T
    hull, drift = (ROLL.equation.active, ROLL.friction_rate), np.diag(np.arange(HULL_STATES - 2.0))
    z = mean[HULL_STATES:]
    angle, rate, slopes = hull_step(mean, 0.5 * h @ (z + f @ z), covariance[1, 1], step, hull)
    a, driven = np.eye(n), np.zeros((n, moment.size))
    a[:2, :HULL_STATES], a[HULL_STATES:, HULL_STATES:] = slopes[:, :-1], f
    a[:2, HULL_STATES:] = 0.5 * np.outer(slopes[:, -1], h + h @ f)
    driven[:2], driven[HULL_STATES:] = np.outer(slopes[:, -1], 0.5 * h), np.eye(moment.size)
    wanted = a @ covariance @ a.T + driven @ (moment.stationary - f @ moment.stationary @ f.T) @ driven.T
    wanted[OF_HULL, OF_HULL] += step * drift
    wanted_mean = np.concatenate([[angle, rate], mean[OF_HULL], f @ z])
    moment_now = moment.blocks, h, moment.stationary
    durations = np.array([step, 0.0, 0.13, 1.1, 0.1])
    along = mean.copy(), covariance.copy()
    means, spreads = predict(*along, moment_now, hull, drift, durations, 0.05)
    predict(mean, covariance, moment_now, hull, drift, durations[:1], 0.05)
    assert mean == pytest.approx(wanted_mean, rel=1e-12)
    assert covariance == pytest.approx(wanted, rel=1e-9, abs=1e-14)
    # a forecast at several leads is one after the other
    for place in range(len(durations)):
        if place:
            predict(mean, covariance, moment_now, hull, drift, durations[place : place + 1], 0.05)
        assert means[place] == pytest.approx(mean[:2], rel=1e-9)
        assert spreads[place] == pytest.approx(covariance[:2, :2], rel=1e-7)


def test_what_is_considered_stays_and_goes_on_to_count():
    """Joseph's form of the update, with no gain for trim and ratios (Schmidt 1966)."""
    rng, track, n = np.random.default_rng(5), HullTrack(), HULL_STATES
    root, h, r = rng.normal(size=(n, n)), np.eye(2, n), np.diag(VARIANCES)
    p = root @ root.T
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
    gain[OF_HULL] = 0.0
    track.set_state(np.zeros(n), p)
    track.update((0.1, -0.2), VARIANCES, learns=False)
    left = np.eye(n) - gain @ h
    assert track.x == pytest.approx(gain @ [0.1, -0.2])
    assert track.P == pytest.approx(left @ p @ left.T + gain @ r @ gain.T, abs=1e-9)


def _dense_oracle(moment, step):
    """F and Q over a step for a linear hull, from one matrix exponential (Van Loan 1978)."""
    n = moment.size
    generator = np.zeros((4 + n, 4 + n))
    generator[0, 1] = 1.0
    generator[1, :3] = -6.0, -0.5, 6.0
    generator[1, 4:] = moment.output
    generator[4:, 4:] = moment.generator
    drive = np.zeros_like(generator)
    drive[4:, 4:] = -(moment.generator @ moment.stationary + moment.stationary @ moment.generator.T)
    size = 4 + n
    whole = expm(np.block([[-generator, drive], [np.zeros((size, size)), generator.T]]) * step)
    f = whole[size:, size:].T
    return f, f @ whole[:size, size:]


def test_on_a_linear_hull_it_is_the_kalman_filter_of_matrix_exponentials(monkeypatch):
    """Whether or not it is asked for forecasts in between."""
    for name, value in {
        **dict.fromkeys(('HEALTHY_STRAIN', 'CONVINCING'), math.inf),
        **dict.fromkeys(('TRIM_DRIFT', 'RATIO_DRIFT'), 0.0),
        'LEVEL_INTERVALS': (math.inf, math.inf),
        'LEVEL_TIMES': (-1.0, math.inf),
    }.items():
        monkeypatch.setattr(hull_filter, name, value)
    attitude = filter_of(known_to(LINEAR, 0.01, 1e-12, 1e-12), 0.03, gate_probability=1e-300)
    moment = attitude.moments[0]
    mean, covariance = np.array([0.03, 0.0, 0.01, 0.0, 0.0, 0.0]), np.diag([*VARIANCES, 1e-4, 0.0, 0.0, 0.0])
    covariance[4:, 4:] = moment.stationary
    rng = np.random.default_rng(1)
    steps = rng.choice([0.01, 0.013, 0.03], 300)
    motion = np.array(simulate(LINEAR, 0.03, 0.0, np.concatenate([[0.0], np.cumsum(steps)]))).T[1:]
    for step, true in zip(steps, motion, strict=True):
        f, q = _dense_oracle(moment, step)
        mean, covariance = f @ mean, f @ covariance @ f.T + q
        seen = true + rng.normal(size=2) * (ANGLE_NOISE, RATE_NOISE)
        gain = np.linalg.solve(covariance[:2, :2] + np.diag(VARIANCES), covariance[:2]).T
        mean, covariance = mean + gain @ (seen - mean[:2]), covariance - gain @ covariance[:2]
        attitude.observe(step, *seen, *VARIANCES)
        before = attitude.x.copy(), attitude.P.copy()
        attitude.ahead(0.02)
        attitude.forecast(np.array([0.1, 1.0]))
        assert np.array_equal(attitude.x, before[0]) and np.array_equal(attitude.P, before[1])
        assert attitude.x[:3] == pytest.approx(mean[:3], abs=1e-4)
    assert attitude.P[:2, :2] == pytest.approx(covariance[:2, :2], rel=0.03)


@pytest.mark.parametrize('measured', [(0.1, -0.2), (0.1, NAN), (NAN, -0.2)])
def test_an_update_is_the_gaussian_conditioned_on_what_was_measured(measured):
    """By Schur's complement of the precision matrix of state and readings."""
    rng, track, n = np.random.default_rng(7), HullTrack(), HULL_STATES + 4
    root, before = rng.normal(size=(n, n)), rng.normal(size=n)
    seen = np.flatnonzero(np.isfinite(measured))
    h, r, values = np.eye(2, n)[seen], np.diag(np.array(VARIANCES)[seen]), np.array(measured)[seen]
    p = root @ root.T
    precision = np.linalg.inv(p) + h.T @ np.linalg.inv(r) @ h
    track.set_state(before, p)
    track.update(measured, VARIANCES, learns=True)
    assert track.x == pytest.approx(before + np.linalg.solve(precision, h.T @ np.linalg.solve(r, values - h @ before)))
    assert track.P == pytest.approx(np.linalg.inv(precision), abs=1e-9)
    expected = multivariate_normal(h @ before, h @ p @ h.T + r).logpdf(values)
    assert track.log_likelihood == pytest.approx(expected) and track.likelihood == pytest.approx(math.exp(expected))
    nis = (values - h @ before) @ np.linalg.solve(h @ p @ h.T + r, values - h @ before)
    assert track.strain == pytest.approx(1.0 + STRAIN_GAIN * (nis / seen.size - 1.0))


@pytest.mark.parametrize('channels', [slice(0, 2), slice(0, 1), slice(1, 2)])
def test_a_sample_that_a_jump_of_the_moment_explains_is_no_outlier(channels):
    track, elapsed, gate = HullTrack(), 0.02, 35.0
    track.set_hull(ROLL, np.zeros((10, 10)))
    mean, covariance = np.r_[0.08, 0.02, ROLL.trim, ROLL.ratios], np.eye(HULL_STATES) * 1e-9
    track.set_state(mean, covariance)
    jump = 2.0 * (0.3 + 0.02 + abs(ROLL.acceleration(0.08, 0.02)))
    by_jump = np.array([0.5 * elapsed**2, elapsed]) * jump
    noise = covariance[:2, :2] + np.diag(VARIANCES)
    spread = (noise + np.outer(by_jump, by_jump))[channels, channels]
    away = by_jump[channels] / math.sqrt(by_jump[channels] @ np.linalg.solve(spread, by_jump[channels]))
    for size in (0.98, 1.02):
        values = np.full(2, NAN)
        step = size * math.sqrt(gate) * away
        values[channels] = mean[:2][channels] + step
        sample = tuple(values.tolist())
        assert track.nis(sample, VARIANCES) == pytest.approx(step @ np.linalg.solve(noise[channels, channels], step))
        assert track.nis(sample, VARIANCES) > gate
        after_jump = track.nis_after_jump(sample, VARIANCES, elapsed, 0.3)
        assert after_jump == pytest.approx(step @ np.linalg.solve(spread, step)) == pytest.approx(size**2 * gate)
        assert np.array_equal(track.x, mean) and np.array_equal(track.P, covariance)


def test_a_jump_is_believed_once_a_second_sample_says_the_same_and_a_wrong_one_leaves_no_mark():
    for wrong in ((0.0, 0.1), (0.03, 0.0), (0.02, 0.1)):
        spiked, without = _at_rest(), _at_rest()
        assert spiked.observe(0.04, *wrong, *VARIANCES).rejected
        without.observe(0.04, NAN, NAN, *VARIANCES)
        for attitude in (spiked, without):
            assert not attitude.observe(0.04, 0.0, 0.0, *VARIANCES).rejected
        assert np.array_equal(spiked.x, without.x) and np.array_equal(spiked.P, without.P)
        assert np.array_equal(spiked.levels, without.levels) and spiked.active.strain == without.active.strain
    released = _at_rest()
    refused = [released.observe(0.04, 0.5 * t * t, t, *VARIANCES).rejected for t in (0.04, 0.08, 0.12, 0.16)]
    assert refused == [True, False, False, False]
    assert released.x[1] == pytest.approx(0.16, rel=0.1)


def test_a_rejected_sample_is_no_sample():
    spiked, without = _at_rest(), _at_rest()
    assert spiked.observe(0.01, 0.5, 0.0, *VARIANCES).rejected
    without.observe(0.01, NAN, NAN, *VARIANCES)
    for one, other in ((spiked.free, without.free), (spiked.driven, without.driven)):
        assert np.array_equal(one.x, other.x) and np.array_equal(one.P, other.P)


@pytest.mark.parametrize('variances', [(5e-324, 5e-324), (1e-18, 100.0), (100.0, 1e-30)])
@pytest.mark.parametrize('hull', [EXACT_ROLL, None])
def test_a_sensor_that_reports_no_noise_to_speak_of_is_followed(hull, variances):
    attitude, times = HullFilter(), np.r_[np.arange(0.0, 3.0, 0.01), np.arange(12.0, 14.0, 0.01)]
    attitude.set_hull(hull)
    attitude.start(0.1, 0.0, *variances)
    motion = np.array(simulate(ROLL, 0.1, 0.0, times)).T
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        for elapsed, (angle, rate) in zip(np.diff(times), motion[1:].tolist(), strict=True):
            attitude.observe(elapsed, angle, rate, *variances)
            assert np.isfinite(attitude.x).all() and np.linalg.eigvalsh(attitude.P).min() > -1e-9
    measured = int(np.argmin(variances))
    assert attitude.x[measured] == pytest.approx(motion[-1][measured], abs=1e-4)


MEASURED = st.tuples(st.floats(0.001, 3.0), st.floats(-6.0, 6.0) | st.just(NAN), st.floats(-30.0, 30.0) | st.just(NAN))


@settings(max_examples=30, deadline=None)
@given(st.lists(MEASURED, min_size=1, max_size=40))
def test_whatever_is_measured_the_covariance_stays_one(samples):
    attitude, moment = filter_of(known_to(ROLL, 5e-4, 0.05, 0.1)), modal(*swell())
    whole = sum_of_moments([attitude.moments[0], moment], (1e-4, 1.0))
    spread = block_diag(attitude.P[:HULL_STATES, :HULL_STATES], whole.stationary)
    mean = np.r_[attitude.x[:HULL_STATES], np.zeros(whole.size)]
    attitude.set_excitation(ExcitationFit(moment, mean, spread, (1e-4, 1.0)))
    attitude.start(0.02, 0.0, *VARIANCES)
    for elapsed, angle, rate in samples:
        attitude.observe(elapsed, angle, rate, *VARIANCES)
        assert np.isfinite(attitude.x).all() and np.isfinite(attitude.P).all()
        deviation = np.sqrt(np.diag(attitude.P))
        assert np.linalg.eigvalsh(attitude.P / np.outer(deviation + 1e-30, deviation + 1e-30)).min() > -1e-6
    mean, covariance = attitude.forecast(np.array([0.1, 1.0, 5.0]))
    assert np.isfinite(mean).all() and (covariance[:, 0, 0] > 0.0).all()


def test_what_convinces_is_the_likelihood_ratio_of_two_filters(monkeypatch):
    """Free and driven hull as two filters of their own, of which neither knows of the other."""
    monkeypatch.setattr(hull_filter, 'LEVEL_INTERVALS', (math.inf, math.inf))
    attitude = filter_of(known_to(LINEAR, 5e-4, 0.001, 0.005), 0.03)
    alone = [copy.deepcopy(track) for track in (attitude.free, attitude.driven)]
    rng, ratio = np.random.default_rng(3), 0.0
    motion = np.array(simulate(LINEAR, 0.03, 0.0, np.arange(0.0, 2.0, 0.01))).T[1:]
    for seen in motion + rng.normal(size=motion.shape) * (ANGLE_NOISE, RATE_NOISE):
        likelihoods = []
        for track in alone:
            track.advance(0.01)
            spread = track.P[:2, :2] + np.diag(VARIANCES)
            likelihoods.append(multivariate_normal(track.x[:2], spread).logpdf(seen))
            track.update(tuple(seen.tolist()), VARIANCES, False)
        ratio += likelihoods[0] - likelihoods[1]
        attitude.observe(0.01, *seen.tolist(), *VARIANCES)
        if attitude.is_free:
            break
        assert ratio < hull_filter.CONVINCING
    assert attitude.is_free and ratio > hull_filter.CONVINCING


def test_another_hull_leaves_the_motion_and_gives_the_posterior_of_every_term():
    """The pruned model is for people: what pruning left out, or in, is not known for certain."""
    attitude = _at_rest()
    motion, spread = attitude.x[:2].copy(), attitude.P[:2, :2].copy()
    identified = known_to(LINEAR, 1e-3, 0.1, 0.2)
    attitude.set_hull(identified)
    prior = HullPrior.of(identified)
    assert np.array_equal(attitude.x[:2], motion) and np.array_equal(attitude.P[:2, :2], spread)
    assert attitude.x[2] == LINEAR.trim and np.array_equal(attitude.P[OF_HULL, OF_HULL], prior.covariance)
    stds = [math.sqrt(d @ prior.covariance @ d) for d in prior.directions.values()]
    assert stds == pytest.approx([0.1, 0.2], rel=0.05)
    every = Equation('general', ('b1', 'b2', 'r1', 'r3'))
    root = np.random.default_rng(6).normal(size=(4, 4)) * [[0.05], [0.3], [0.1], [4.0]]
    posterior = HullPosterior(every, np.array([0.5, 0.1, 6.0, -9.0]), root @ root.T)
    attitude.set_hull(IdentifiedModel(LINEAR, np.diag([1e-4, 1e-4]), 1e-3, posterior=posterior))
    at = RATIOS + every.indices
    assert attitude.x[2] == LINEAR.trim and attitude.x[at].tolist() == posterior.ratios.tolist()
    assert attitude.P[np.ix_(at, at)] == pytest.approx(posterior.covariance, abs=1e-2)
    assert attitude.P[2, 2] == pytest.approx(1e-6)


@pytest.mark.parametrize('size', [1e3, 1e150])
def test_a_covariance_beyond_belief_leaves_forecasts(size):
    attitude = _at_rest(500, IdentifiedModel(ROLL, size * np.eye(5), 1e-3))
    directions = attitude.prior.directions.values()
    assert max(d @ attitude.prior.covariance @ d for d in directions) == pytest.approx(1.0, rel=0.01)
    mean, covariance = attitude.forecast(np.array([0.5, 5.0]))
    assert np.abs(mean[:, 0]).max() < 0.1 and np.isfinite(covariance).all()


def test_a_hull_known_to_half_its_size_forecasts_visibly_wider_than_an_exact_one():
    half, spreads = np.diag((0.5 * ROLL.ratios[ROLL.equation.indices]) ** 2), []
    for identified in (EXACT_ROLL, IdentifiedModel(ROLL, half)):
        craft, reading = _released(1)
        attitude = filter_of(identified, *reading())
        for _ in range(round(100 * (craft.release() + 0.5))):
            attitude.observe(0.01, *reading(), *VARIANCES)
        spreads.append(np.sqrt(attitude.forecast(np.array([1.0, 2.0]))[1][:, 0, 0]))
    assert (spreads[1] > 2.0 * spreads[0]).all()


def _released(seed, model=ROLL, angle=0.087):
    noise = SensorNoise(ANGLE_NOISE, RATE_NOISE)
    craft = SimulatedCraft(CraftSettings(model, angle, noise=noise, seed=seed, hold=1.0))

    def reading():
        seen = craft.next_reading()
        return (seen.roll, seen.roll_rate) if model.axis == 'roll' else (seen.pitch, seen.pitch_rate)

    return craft, reading


@pytest.mark.long
@pytest.mark.parametrize(
    ('name', 'degrees'),
    [
        ('swath-roll', 2.0),
        ('swath-roll', 5.0),
        ('swath-pitch', 3.0),
        ('swath-usv-pitch', 5.0),
        ('hydrofoil-pitch', 2.0),
    ],
)
def test_the_first_release_is_the_hulls_alone_and_forecast_one_period_ahead(name, degrees):
    model, angle, errors, held = hull_named(name).model, math.radians(degrees), [], []
    period, times = model.natural_period, np.arange(0.0, 12.0, 0.01)
    truth = simulate(model, angle, 0.0, times)[0]
    for seed in range(3):
        craft, reading = _released(seed, model, angle)
        attitude = filter_of(IdentifiedModel.exactly(model), *reading())
        for _ in range(150):
            attitude.observe(0.01, *reading(), *VARIANCES)
        for _ in range(round(100 * (craft.release() + 0.3))):
            attitude.observe(0.01, *reading(), *VARIANCES)
        for k in range(30, 800):
            if k % 10 == 0:
                told, spread = attitude.forecast(np.array([period]))
                error = told[0, 0] - np.interp(0.01 * k + period, times, truth)
                errors.append(error / truth[:1000].std())
                held.append(abs(error) < 1.645 * math.sqrt(spread[0, 0, 0]))
            attitude.observe(0.01, *reading(), *VARIANCES)
            assert attitude.is_free or k < 50
    assert np.sqrt(np.mean(np.square(errors))) < 0.03
    assert np.mean(held) > 0.85


def test_a_hold_neither_explodes_nor_claims_to_be_known():
    rng, attitude, restarts = np.random.default_rng(1), filter_of(EXACT_ROLL), 0
    for k, value in enumerate(np.concatenate([np.zeros(500), np.full(2000, math.radians(12.0))])):
        noise = rng.normal(size=2) * (ANGLE_NOISE, RATE_NOISE)
        restarts += attitude.observe(0.01, value + noise[0], noise[1], *VARIANCES).restarted
        if k > 510 and k % 50 == 0:
            spread = np.degrees(np.sqrt(attitude.forecast(np.array([0.5, 2.5, 5.0]))[1][:, 0, 0]))
            assert np.all(spread > 0.5) and np.all(spread < 30.0)
    assert restarts == 1
    assert math.degrees(attitude.x[0]) == pytest.approx(12.0, abs=0.1)
    assert attitude.x[2] == pytest.approx(0.0, abs=2e-3)


def _at_rest(samples=300, hull=EXACT_ROLL):
    rng, attitude = np.random.default_rng(1), filter_of(hull)
    for _ in range(samples):
        attitude.observe(0.01, *(rng.normal(size=2) * (ANGLE_NOISE, RATE_NOISE)).tolist(), *VARIANCES)
    return attitude


def test_in_still_water_the_moment_vanishes_and_the_hull_alone_remains():
    attitude = _at_rest(1000)
    assert attitude.is_free and attitude.x.size == HULL_STATES
    mean, covariance = attitude.forecast(np.array([0.5, 2.5]))
    alone = simulate(ROLL, attitude.x[0] - attitude.x[2], attitude.x[1], np.array([0.0, 0.5, 2.5]))
    assert mean[:, 0] == pytest.approx(alone[0][1:] + attitude.x[2], abs=1e-4)
    assert np.all(covariance[:, 0, 0] < math.radians(0.1) ** 2)
    # a sample without values is a gap
    for _ in range(40):
        attitude.observe(0.05, NAN, NAN, *VARIANCES)
    assert attitude.forecast(np.array([0.5]))[0][0, 0] == pytest.approx(mean[1, 0], abs=1e-6)


def test_spikes_are_refused_and_a_sensor_that_insists_is_followed():
    attitude = _at_rest()
    trim = float(attitude.x[2])
    results = [attitude.observe(0.01, 0.5, 0.0, *VARIANCES)]
    assert results[0].rejected and abs(attitude.x[0]) < 1e-3
    results += [attitude.observe(0.01, 0.5, 0.0, *VARIANCES) for _ in range(4)]
    assert [result.restarted for result in results] == [False] * 4 + [True]
    assert attitude.x[0] == pytest.approx(0.5) and attitude.x[2] == trim


def test_a_moment_of_another_period_is_as_large_and_lasts_as_many_periods():
    attitude = HullFilter()
    attitude.set_hull(IdentifiedModel.exactly(hull_named('swath-roll').model))
    attitude.start(0.1, 0.0, 1e-6, 1e-6)
    for _ in range(50):
        attitude.observe(0.02, 0.1, 0.0, 1e-6, 1e-6)

    def memory():
        """One over the corner frequency, s."""
        return np.linalg.det(attitude.moments[0].generator) ** -0.5

    size, lasts, motion = attitude.levels[0] * attitude.moments[0].variance, memory(), attitude.forecast(np.zeros(1))
    for factor in (2.5, 0.4):
        attitude.set_period(factor * attitude.period)
        assert attitude.levels[0] * attitude.moments[0].variance == pytest.approx(size)
        lasts *= factor
        assert memory() == pytest.approx(lasts)
        assert lasts == pytest.approx(hull_filter.MARKOV_TIME * attitude.period)
        # what is known of the motion stays
        for found, before in zip(attitude.forecast(np.zeros(1)), motion, strict=True):
            np.testing.assert_allclose(found, before, atol=1e-12)
        assert np.linalg.eigvalsh(attitude.P).min() > -1e-12


@pytest.mark.parametrize('slower', [0.1, 1.0, 10.0])
def test_a_motion_that_is_so_many_times_slower_is_followed_alike_from_the_first_sample(slower):
    """Angles alone, eight samples a period: what is guessed of a moment before it acts belongs to the period."""
    period = 8.0 * slower
    attitude = HullFilter()
    attitude.start(0.1, NAN, *VARIANCES)
    attitude.set_period(period)
    assert attitude.levels[0] == 1.0
    for k in range(1, 200):
        time = 0.125 * period * k
        attitude.observe(0.125 * period, 0.1 * math.cos(2.0 * math.pi / period * time), NAN, *VARIANCES)
        assert abs(attitude.x[0]) < 0.15 and abs(attitude.x[1]) < 0.3 * 2.0 * math.pi / period


@pytest.mark.parametrize(('measures_angle', 'bound'), [(True, 2e-3), (False, 8e-3)])
def test_one_channel_alone_suffices(measures_angle, bound):
    craft, reading = _released(1)
    attitude = filter_of(EXACT_ROLL)
    attitude.start(0.0, 0.0, 1e-4, 1e-4)
    craft.release()
    for _ in range(1500):
        angle, rate = reading()
        attitude.observe(0.01, angle if measures_angle else NAN, NAN if measures_angle else rate, *VARIANCES)
    assert attitude.x[0] == pytest.approx(craft._state[0], abs=bound)
    assert attitude.x[1] == pytest.approx(craft._state[1], abs=5 * bound)


def test_without_a_hull_the_rate_is_constant():
    attitude = HullFilter()
    attitude.start(0.1, 0.2, *VARIANCES)
    mean, covariance = attitude.forecast(np.array([0.5, 1.0]))
    assert mean.ravel() == pytest.approx([0.2, 0.2, 0.3, 0.2])
    assert covariance[1, 0, 0] > covariance[0, 0, 0] > VARIANCES[0]
    for wrong in ({'gate_probability': 0.5}, {'gate_probability': 0.0}, {'gate_patience': 0}):
        with pytest.raises(InputError):
            HullFilterSettings(**wrong)


@pytest.mark.parametrize('lifted', [0.25, 0.5])
def test_a_craft_lifted_at_once_and_held_is_within_the_intervals_after_the_restart(lifted):
    hull, rng, restarted = HullFilter(), np.random.default_rng(0), False
    hull.set_hull(EXACT_ROLL)
    hull.start(0.0, 0.0, *VARIANCES)
    for k in range(600):
        angle = (0.0 if k < 500 else lifted) + ANGLE_NOISE * rng.normal()
        restarted |= hull.observe(0.02, angle, RATE_NOISE * rng.normal(), *VARIANCES).restarted
        if restarted:
            mean, covariance = hull.forecast(np.array([0.2, 0.5, 1.0]))
            assert (np.abs(mean[:, 0] - lifted) < 3.0 * np.sqrt(covariance[:, 0, 0])).all(), k
    assert restarted
