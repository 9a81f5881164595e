"""Reflections, second oscillations and drifting stiffness in simulated decays, by integrators of the tests' own."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from swath_sysid.attitude.identification.disturbances import Leftover, linear_response, named
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.formats.identify_records import identify

PERIOD, DAMPING_RATIO, RELEASE, CYCLES, PER_PERIOD = 2.5, 0.03, 0.15, 10, 24
FREQUENCY = 2.0 * np.pi / PERIOD
LINEAR = 2.0 * DAMPING_RATIO * FREQUENCY
TIME = np.arange(0.0, CYCLES * PERIOD, PERIOD / PER_PERIOD)


def with_reflection(gain, delay):
    """Runge-Kutta steps of a hull whose rate returns as a moment, a multiple of the damping's, after a delay, s."""
    step, late = PERIOD / 240, round(delay / PERIOD * 240)
    state = np.zeros((CYCLES * 240 + 1, 2))
    state[0, 0] = RELEASE

    def slope(at, returned):
        return np.array([at[1], -(FREQUENCY**2) * at[0] - LINEAR * at[1] + gain * LINEAR * returned])

    for k in range(len(state) - 1):
        back = [state[k + more - late, 1] if k + more >= late else 0.0 for more in (0, 1)]
        first = slope(state[k], back[0])
        second = slope(state[k] + 0.5 * step * first, np.mean(back))
        third = slope(state[k] + 0.5 * step * second, np.mean(back))
        last = slope(state[k] + step * third, back[1])
        state[k + 1] = state[k] + step / 6.0 * (first + 2.0 * second + 2.0 * third + last)
    return state[: TIME.size * 10 : 10].T


def solved(slope, start):
    return solve_ivp(slope, (0.0, TIME[-1]), start, t_eval=TIME, rtol=1e-8, atol=1e-11).y[:2]


def with_second_mode(ratio, coupling):
    """A mode of a multiple of the hull's frequency, coupled by a share of the stiffness, and held at the release."""
    own, shared = (ratio * FREQUENCY) ** 2, coupling * FREQUENCY**2

    def slope(_, y):
        return [
            y[1],
            -(FREQUENCY**2) * y[0] - LINEAR * y[1] - shared * y[2],
            y[3],
            -own * y[2] - LINEAR * y[3] - shared * y[0],
        ]

    return solved(slope, [RELEASE, 0.0, -shared / own * RELEASE, 0.0])


def with_stiffness(stiffness):
    """A stiffness over the linear one, of time and angle."""
    return solved(lambda t, y: [y[1], -(FREQUENCY**2) * stiffness(t, y[0]) * y[0] - LINEAR * y[1]], [RELEASE, 0.0])


def fitted(angle, rate=None, pace=1.0, sign=1.0, noise=2e-4):
    """The fit of a released decay, ``pace`` times as fast, mirrored by ``sign``; the rate alone where it is no None."""
    random = np.random.default_rng(4)
    held = np.arange(-2.0 * PERIOD, 0.0, PERIOD / PER_PERIOD)
    time = np.concatenate([held, TIME]) / pace
    angles = np.concatenate([np.full(held.size, RELEASE), angle])
    angles = sign * angles + noise * random.normal(size=time.size)
    if rate is None:
        motion = AxisMotion('roll', time, angles, None)
    else:
        rates = sign * pace * np.concatenate([np.zeros(held.size), rate])
        motion = AxisMotion('roll', time, None, rates + noise * FREQUENCY * pace * random.normal(size=time.size))
    return identify([motion], IdentificationSettings(equation='odd-cubic'))


@pytest.mark.parametrize(('pace', 'sign', 'only_rate'), [(1.0, 1.0, False), (10.0, -1.0, False), (0.5, 1.0, True)])
def test_a_wave_that_returns_is_named_and_what_it_hides_of_the_damping_is_covered(pace, sign, only_rate):
    angle, rate = with_reflection(0.3, 2.0 * PERIOD)
    found = fitted(angle, rate if only_rate else None, pace, sign)
    left = Leftover(found)
    cause = left.told()
    assert found.disturbance.code == 'returning-wave' and found.disturbance in found.advice
    assert cause.place * pace == pytest.approx(2.0 * PERIOD, rel=0.03)
    assert left.sizes_of(cause) == pytest.approx(0.3 * LINEAR * pace, rel=0.1)
    _, damping, _, std = found.bands.at(found.reference_amplitude)
    bare = replace(found, covariance=found.covariance - left.hidden_by(cause, found.model.equation))
    missed = abs(damping - DAMPING_RATIO)
    assert 1.9 * bare.bands.at(found.reference_amplitude)[3] < missed < 1.96 * std < 6.0 * missed


@pytest.mark.parametrize(('ratio', 'coupling'), [(1.2, 0.1), (0.8, 0.1)])
def test_a_second_mode_is_named_with_its_period(ratio, coupling):
    found = fitted(with_second_mode(ratio, coupling)[0])
    stiffness = FREQUENCY**2 * np.array([[1.0, coupling], [coupling, ratio**2]])
    modes = 2.0 * np.pi / np.sqrt(np.linalg.eigvalsh(stiffness))
    assert found.disturbance.code == 'second-oscillation'
    assert Leftover(found).told().place == pytest.approx(modes[np.argmax(np.abs(modes - PERIOD))], rel=0.03)


@pytest.mark.parametrize('change', [0.05, -0.05])
def test_a_stiffness_that_drifts_is_named_with_its_change(change):
    found = fitted(with_stiffness(lambda t, _: 1.0 + change * t / TIME[-1])[0], noise=5e-5)
    left = Leftover(found)
    assert found.disturbance.code == 'drifting-stiffness'
    assert left.sizes_of(left.told()) == pytest.approx(change, rel=0.1)


@pytest.mark.parametrize(
    'stiffness',
    [
        lambda t, x: 1.0,
        lambda t, x: 1.0 + 0.5 * max(0.0, abs(x) - 0.05) / max(abs(x), 1e-9),
        lambda t, x: 1.0 - 400.0 * x**4,
    ],
    ids=['clean', 'kinked', 'fifth-order'],
)
def test_a_hull_alone_is_not_disturbed(stiffness):
    found = fitted(with_stiffness(stiffness)[0])
    assert found.disturbance is None and named(found) is found


def test_what_a_named_disturbance_leaves_unexplained_accuses_no_unit():
    """A mode so strong that the fit is poor: the verdict says what it is."""
    verdict = fitted(with_second_mode(0.8, 0.15)[0]).verdict
    assert verdict.level != 'adequate' and 'units' not in verdict.sentence


def test_the_linear_response_is_that_of_the_oscillator():
    time = np.arange(0.0, 12.0 * PERIOD, PERIOD / PER_PERIOD)
    moment = np.column_stack([np.cos(0.8 * FREQUENCY * time), np.sin(1.1 * FREQUENCY * time)])
    steady = np.full(time.size, FREQUENCY**2), np.full(time.size, LINEAR)
    angle, rate = linear_response(*steady, time[1], moment)
    for k, drive in enumerate((lambda t: np.cos(0.8 * FREQUENCY * t), lambda t: np.sin(1.1 * FREQUENCY * t))):
        slope = lambda t, y, drive=drive: [y[1], drive(t) - FREQUENCY**2 * y[0] - LINEAR * y[1]]  # noqa: E731
        exact = solve_ivp(slope, (0.0, time[-1]), [0.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-12).y
        assert np.abs(angle[:, k] - exact[0]).max() < 0.03 * np.abs(exact[0]).max()
        assert np.abs(rate[:, k] - exact[1]).max() < 0.03 * np.abs(exact[1]).max()
