"""The attitude filter against independent oracles."""
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from swath_sysid.accelerator import HAS_NUMBA
from swath_sysid.errors import InputError
from swath_sysid.hull.catalogue import equation_named, hull_named
from swath_sysid.hull.decay_model import DecayModel
from swath_sysid.hull.simulation import simulate
from swath_sysid.prediction.ekf import AttitudeFilter, FilterSettings, process_noise, runge_kutta_step, transition
from swath_sysid.prediction.sensor_noise import NoiseMeter, NoiseSettings

NAN = math.nan
LINEAR = DecayModel.from_terms(equation_named('linear'), {'b1': 0.5, 'r1': 6.0}, trim=0.01, axis='roll')
ROLL = hull_named('swath-roll').model


def _measure(seed, hull=ROLL, angle=0.08, duration=20.0, dt=0.01, angle_noise=0.001, rate_noise=0.004):
    time = np.arange(0.0, duration, dt)
    angles, rates = simulate(hull, angle, 0.0, time)
    rng = np.random.default_rng(seed)
    return time, angles, rates, angles + rng.normal(0, angle_noise, time.size), rates + rng.normal(
        0, rate_noise, time.size)


def _run(attitude, time, angles, rates, angle_noise=0.001, rate_noise=0.004):
    attitude.start(time[0], angles[0], rates[0], angle_noise**2, rate_noise**2)
    estimates = [attitude.estimate()]
    for k in range(1, time.size):
        attitude.advance(time[k] - time[k - 1])
        estimates.append(attitude.correct(float(angles[k]), float(rates[k]), angle_noise**2, rate_noise**2))
    return estimates


def _continuous(by_angle, by_rate, tau):
    return np.array([
        [0.0, 1.0, 0.0, 0.0],
        [by_angle, by_rate, -by_angle, 1.0],
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, -1.0 / tau],
    ])


def test_a_step_of_the_mean_is_the_solution_of_the_nonlinear_equation():
    angle, rate = runge_kutta_step(ROLL.acceleration, 0.08, -0.2, 0.1, 0.02)
    exact = solve_ivp(
        lambda t, y: [y[1], ROLL.acceleration(y[0], y[1]) + 0.1], (0.0, 0.02), [0.08, -0.2], rtol=1e-11, atol=1e-13
    ).y[:, -1]
    assert np.allclose([angle, rate], exact, atol=1e-7)


@given(st.floats(-60.0, 10.0), st.floats(-9.0, 0.0), st.floats(0.2, 5.0))
def test_the_transition_is_the_matrix_exponential(by_angle, by_rate, tau):
    step = 0.2 / max(math.sqrt(abs(by_angle)), abs(by_rate), 1.0 / tau)
    error = transition(by_angle, by_rate, step, tau) - expm(_continuous(by_angle, by_rate, tau) * step)
    # the disturbance is held within the step: its column is right to the order of step / tau
    assert np.abs(error[:, :3]).max() < 2e-3
    assert np.abs(error[:, 3]).max() <= 0.2 * step


def test_the_process_noise_is_the_integral_of_the_spread_disturbance():
    tau, step, steps = 5.0, 0.05, 400
    system, spread = _continuous(0.0, 0.0, tau), np.zeros((4, 4))
    source = np.diag([0.0, 0.0, 0.0, 2.0 * 0.3 / tau])
    for k in range(steps):
        small = expm(system * (k + 0.5) * step / steps)
        spread += small @ source @ small.T * step / steps
    assert np.allclose(process_noise(0.3, tau, 0.0, step), spread, rtol=0.02, atol=1e-12)


def test_on_a_linear_hull_it_is_the_kalman_filter():
    time, _, _, angles, rates = _measure(1, LINEAR)
    fixed = FilterSettings(adaptation_time=1e12, disturbance_time=5.0, gate_probability=1e-30, trim_time=1e-9)
    attitude = AttitudeFilter(fixed, LINEAR)
    estimates = _run(attitude, time, angles, rates)
    oracle = KalmanFilter(dim_x=4, dim_z=2)
    oracle.x = np.array([angles[0] - 0.01, rates[0], 0.0, 0.0])
    oracle.P = np.diag([1e-6, 1.6e-5, fixed.trim_std**2, fixed.disturbance_initial**2])
    oracle.F = expm(_continuous(-6.0, -0.5, 5.0) * 0.01)
    oracle.Q = process_noise(fixed.disturbance_initial**2, 5.0, fixed.trim_drift, 0.01)
    oracle.H, oracle.R = np.eye(2, 4), np.diag([1e-6, 1.6e-5])
    for k in range(1, time.size):
        oracle.predict()
        oracle.update(np.array([angles[k] - 0.01, rates[k]]))
        assert estimates[k].angle == pytest.approx(oracle.x[0] + 0.01, abs=1e-5)
        assert estimates[k].rate == pytest.approx(oracle.x[1], abs=1e-4)
    assert np.allclose(attitude.P, oracle.P, rtol=1e-2, atol=1e-7)


SINE = DecayModel.from_terms(
    equation_named('swath-roll-3').with_friction(),
    {'b0': 0.02, 'b1': 0.4, 'b2': 1.5, 'b3': 0.3, 's1': 6.0, 's2': -0.8}, trim=-0.02, axis='roll',
)  # fmt: skip


def _by_filterpy(oracle, duration, longest_step):
    count = max(1, math.ceil(duration / longest_step))
    for _ in range(count):
        oracle.linearise(duration / count)
        ExtendedKalmanFilter.predict(oracle)


def _taken_in_by_filterpy(oracle, angle, rate, angle_variance, rate_variance):
    places = [k for k, value in enumerate((angle, rate)) if value == value]
    values, noise = np.array([angle, rate])[places], np.diag([angle_variance, rate_variance])[np.ix_(places, places)]
    matrix = np.eye(4)[places]
    ExtendedKalmanFilter.update(oracle, values, lambda x: matrix, lambda x: matrix @ x, R=noise)


def _assert_same(attitude, oracle, covariance):
    """To 1e-12 of the deviations that the state could have."""
    deviation = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(attitude.x - oracle.x) <= 1e-12 * np.maximum(deviation, np.abs(oracle.x)))
    assert np.all(np.abs(attitude.P - oracle.P) <= 1e-12 * deviation * deviation[:, None])


@pytest.mark.parametrize('hull', [None, LINEAR, ROLL, SINE])
@pytest.mark.parametrize('missing', ['', 'angle', 'rate', 'now and then'])
def test_the_closed_form_is_the_predict_and_update_of_filterpy(hull, missing):
    """Every step starts from the same state, so that rounding does not add up."""
    rng = np.random.default_rng(12)
    unlimited = FilterSettings(gate_probability=1e-300, trim_time=1e-9, disturbance_most=0.5)
    attitude, oracle = AttitudeFilter(unlimited, hull), AttitudeFilter(unlimited, hull)
    attitude.start(0.0, 0.08, -0.1, 1e-6, 1.6e-5)
    for k in range(300):
        oracle.import_state(attitude.export_state())
        duration = float(rng.choice([0.01, 0.013, 0.25]))
        attitude.advance(duration)
        _by_filterpy(oracle, duration, attitude._hull[-1])
        _assert_same(attitude, oracle, oracle.P)
        variances = 10.0 ** rng.uniform(-7.0, -3.0, 2)
        values = oracle.x[:2] + rng.normal(size=2) * np.sqrt(np.diag(oracle.P)[:2] + variances)
        values[0] = NAN if missing == 'angle' or (missing and k % 3 == 1) else values[0]
        values[1] = NAN if missing == 'rate' or (missing and k % 4 == 1) else values[1]
        if not np.isnan(values).all():
            prior = attitude.P
            oracle.import_state(attitude.export_state())
            given = *values.tolist(), *variances.tolist()
            assert not attitude.correct(*given).rejected
            _taken_in_by_filterpy(oracle, *given)
            _assert_same(attitude, oracle, prior)


def test_a_sample_at_once_is_its_three_parts():
    time, _, _, angles, rates = _measure(13)
    angles[700] += 0.5
    angles[900:950] += 0.5
    rates[1000:1010] = NAN
    parts, whole = AttitudeFilter(FilterSettings(), ROLL), AttitudeFilter(FilterSettings(), ROLL)
    for attitude in (parts, whole):
        attitude.start(time[0], angles[0], rates[0], 1e-6, 1e-5)
    for k in range(1, 1500):
        lead = 0.01 if k % 5 else 0.0101
        given = float(angles[k]), float(rates[k]), 1e-6, 1e-5
        stamp = whole.stamp + 0.01
        parts.advance(stamp - parts.stamp)
        parts.stamp = stamp
        one, other = parts.correct(*given), whole.observe(stamp, *given, lead)
        assert str(one) == str(other)
        assert parts.moments_ahead(lead) == whole.moments_ahead(lead)
    assert parts.export_state() == whole.export_state()


def test_what_was_foreseen_is_void_when_the_state_is_changed_by_hand():
    attitude = AttitudeFilter(FilterSettings(), ROLL)
    attitude.start(0.0, 0.1, 0.0, 1e-6, 1e-5)
    before = attitude.ahead(0.01)
    attitude.x[0] = 0.2
    assert attitude.ahead(0.01)[0] == pytest.approx(before[0] + 0.1, abs=1e-3)
    attitude.P[1, 1] = 0.04
    assert attitude.ahead(0.01)[2][1, 1] > 0.03 > before[2][1, 1]


@pytest.mark.skipif(not HAS_NUMBA, reason='numba is not installed: there is only one version to run')
def test_without_numba_the_numbers_are_the_same():
    program = (
        'import sys; sys.path[:0] = sys.argv[1:]\n'
        'from test_prediction_ekf import AttitudeFilter, FilterSettings, SINE, _measure, _run\n'
        'time, _, _, angles, rates = _measure(14, SINE, duration=5.0)\n'
        'attitude = AttitudeFilter(FilterSettings(), SINE)\n'
        '_run(attitude, time, angles, rates)\n'
        'print(*attitude.x, *attitude.P.ravel(), attitude.disturbance_variance, attitude.nis_ratio)\n'
    )
    told = [
        subprocess.run(
            [sys.executable, '-c', program, *sys.path], env={**os.environ, 'NUMBA_DISABLE_JIT': off}, check=True,
            capture_output=True, text=True,
        ).stdout for off in '01'
    ]  # fmt: skip
    compiled, plain = (np.array(line.split(), dtype=float) for line in told)
    assert compiled.size == 22
    np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-15)


def test_it_is_better_than_the_sensor_and_its_covariance_is_true():
    normalised, better = [], []
    for seed in range(8):
        time, true_angles, true_rates, angles, rates = _measure(seed)
        estimates = _run(AttitudeFilter(FilterSettings(), ROLL), time, angles, rates)[500:]
        errors = np.array([[e.angle, e.rate] for e in estimates]) - np.c_[true_angles, true_rates][500:]
        better.append(errors.std(axis=0) / [0.001, 0.004])
        normalised += [e @ np.linalg.solve(s.covariance, e) for e, s in zip(errors, estimates, strict=True)]
    assert np.all(np.mean(better, axis=0) < 0.5)
    assert 1.0 < np.mean(normalised) < 4.0  # two degrees of freedom


def test_rates_alone_make_the_angle_observable():
    time, true_angles, _, angles, rates = _measure(3, angle_noise=0.0)
    attitude = AttitudeFilter(FilterSettings(), ROLL)
    estimates = _run(attitude, time, np.full(time.size, NAN), rates)
    error = np.array([e.angle for e in estimates[-500:]]) - true_angles[-500:]
    assert np.abs(error).max() < 0.01
    assert estimates[-1].covariance[0, 0] < 0.05**2


def test_angles_alone_give_the_rate():
    time, _, true_rates, angles, _ = _measure(4)
    estimates = _run(AttitudeFilter(FilterSettings(), ROLL), time, angles, np.full(time.size, NAN))
    error = np.array([e.rate for e in estimates[500:]]) - true_rates[500:]
    assert error.std() < 0.01


def test_the_gate_rejects_an_outlier_and_says_so():
    time, _, _, angles, rates = _measure(5)
    angles[700] += 0.5
    estimates = _run(AttitudeFilter(FilterSettings(), ROLL), time, angles, rates)
    assert [k for k, e in enumerate(estimates) if e.rejected] == [700]
    assert estimates[700].nis > 50.0
    assert abs(estimates[700].angle - estimates[699].angle) < 0.01


def test_a_sensor_that_stays_elsewhere_is_believed_in_the_end():
    time, _, _, angles, rates = _measure(6)
    angles[700:] += 0.5
    estimates = _run(AttitudeFilter(FilterSettings(), ROLL), time, angles, rates)
    restarted = [e for e in estimates if e.restarted]
    assert len(restarted) == 1
    assert restarted[0].advice[0].code == 'gate-restarted'
    assert sum(e.rejected for e in estimates) == FilterSettings().gate_patience - 1
    assert estimates[720].angle == pytest.approx(angles[720], abs=0.01)


def test_without_a_hull_the_rate_is_constant_and_the_covariance_grows():
    time, _, _, angles, rates = _measure(7)
    attitude = AttitudeFilter(FilterSettings())
    _run(attitude, time, angles, rates)
    attitude.x[3] = 0.0
    angle, rate, covariance = attitude.ahead(1.0)
    assert rate == pytest.approx(attitude.x[1])
    assert angle == pytest.approx(attitude.x[0] + attitude.x[1])
    assert covariance[0, 0] > attitude.ahead(0.5)[2][0, 0] > attitude.P[0, 0]


def test_a_new_hull_goes_on_from_the_same_motion():
    time, _, _, angles, rates = _measure(8)
    attitude = AttitudeFilter(FilterSettings())
    _run(attitude, time[:300], angles[:300], rates[:300])
    before = attitude.estimate()
    attitude.set_model(ROLL)
    after = attitude.estimate()
    assert (after.angle, after.rate) == (before.angle, before.rate)
    assert after.disturbance + ROLL.acceleration(after.angle, after.rate) == pytest.approx(before.disturbance)
    attitude.set_model(None)
    assert attitude.estimate().disturbance == pytest.approx(before.disturbance)


def test_looking_ahead_changes_nothing():
    time, _, _, angles, rates = _measure(9)
    plain, curious = AttitudeFilter(FilterSettings(), ROLL), AttitudeFilter(FilterSettings(), ROLL)
    for attitude in (plain, curious):
        attitude.start(time[0], angles[0], rates[0], 1e-6, 1e-5)
    for k in range(1, 300):
        curious.ahead(0.01 if k % 3 else 0.37)
        for attitude in (plain, curious):
            attitude.advance(0.01)
            attitude.correct(float(angles[k]), float(rates[k]), 1e-6, 1e-5)
    assert plain.export_state() == curious.export_state()


def test_an_exported_state_goes_on_as_if_nothing_had_been():
    time, _, _, angles, rates = _measure(10)
    first, second = AttitudeFilter(FilterSettings(), ROLL), AttitudeFilter(FilterSettings(), ROLL)
    _run(first, time[:400], angles[:400], rates[:400])
    second.import_state(first.export_state())
    for attitude in (first, second):
        attitude.advance(0.01)
        attitude.correct(float(angles[400]), float(rates[400]), 1e-6, 1e-5)
    assert first.export_state() == second.export_state()


def test_the_disturbance_fades_in_still_water_and_grows_in_waves():
    time, _, _, angles, rates = _measure(11, duration=60.0)
    attitude = AttitudeFilter(FilterSettings(), ROLL)
    _run(attitude, time, angles, rates)
    still = math.sqrt(attitude.disturbance_variance)
    rng = np.random.default_rng(0)
    angle, rate = 0.0, 0.0
    for k in range(6000):
        moment = 0.2 * math.sin(2.0 * k * 0.01) + 0.1 * math.sin(2.9 * k * 0.01)
        angle, rate = runge_kutta_step(ROLL.acceleration, angle, rate, moment, 0.01)
        attitude.advance(0.01)
        attitude.correct(angle + rng.normal(0, 0.001), rate + rng.normal(0, 0.004), 1e-6, 1.6e-5)
    waves = math.sqrt(attitude.disturbance_variance)
    assert still < 0.02
    assert 0.08 < waves < 0.5
    assert attitude.estimate().disturbance == pytest.approx(moment, abs=0.15)


def _perhaps(largest):
    return st.one_of(st.just(NAN), st.floats(-largest, largest))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(1e-4, 2.0), _perhaps(3.0), _perhaps(30.0)), min_size=1, max_size=60))
def test_no_sequence_of_samples_breaks_the_covariance(samples):
    attitude = AttitudeFilter(FilterSettings(), ROLL)
    attitude.start(0.0, 0.0, 0.0, 1e-6, 1e-6)
    for step, angle, rate in samples:
        attitude.advance(step)
        estimate = attitude.correct(angle, rate, 1e-6, 1e-6)
        assert np.isfinite(attitude.x).all()
        assert np.linalg.eigvalsh(attitude.P).min() > -1e-9 * np.abs(attitude.P).max()
        assert np.isfinite(estimate.covariance).all()


def test_a_setting_that_makes_no_sense_is_refused():
    with pytest.raises(InputError, match='trim_drift'):
        FilterSettings(trim_drift=-1.0)
    with pytest.raises(InputError, match='least'):
        NoiseSettings(initial=1.0)


@pytest.mark.parametrize('deviation', [3e-4, 3e-3])
def test_the_noise_meter_finds_white_noise_under_motion(deviation):
    meter = NoiseMeter(NoiseSettings())
    time = np.arange(5000) * 0.01
    values = 0.1 * np.sin(2.5 * time) + np.random.default_rng(2).normal(0, deviation, time.size)
    for value in values.tolist():
        meter.take(value)
    assert math.sqrt(meter.variance) == pytest.approx(deviation, rel=0.15)


def test_the_noise_meter_survives_glitches_and_silence():
    meter = NoiseMeter(NoiseSettings())
    values = np.random.default_rng(3).normal(0, 1e-3, 4000)
    values[::200] += 5.0
    for value in values.tolist():
        meter.take(value)
    assert math.sqrt(meter.variance) < 2e-3
    silent = NoiseMeter(NoiseSettings())
    for _ in range(10_000):
        silent.take(0.0)
    assert math.sqrt(silent.variance) == NoiseSettings().least


def test_a_hand_on_the_craft_is_not_taken_for_ballast():
    """Held at 6 deg for two seconds: the moment is a disturbance, and the trim stays where it was identified."""
    attitude = AttitudeFilter(FilterSettings(), LINEAR)
    held = LINEAR.trim + math.radians(6.0)
    time = np.arange(200) / 100.0
    _run(attitude, time, np.full(200, held), np.zeros(200))
    assert attitude.x[2] == pytest.approx(LINEAR.trim, abs=math.radians(0.2))
    assert attitude.x[3] == pytest.approx(-LINEAR.acceleration(held, 0.0), rel=0.1)
