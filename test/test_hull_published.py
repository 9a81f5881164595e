"""The published hulls are what the papers print: every coefficient retyped here with the equation it is from."""

import math

import numpy as np
import pytest

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS, hull_named
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.cli.main import main
from swath_sysid.formats.csv_trials import read_csv

PRINTED = {
    # paper A, equation 2, 6 deg at T, printed as moments; I' is not given (at most 0.1), 0.09 is assumed
    'swath-pitch': (
        'swath-pitch-2',
        0.09,
        {'b1': 0.137953966, 'b2': 0.006320314, 'r3': 8.704769096, 'r2': 1.744499553, 'r1': 0.910961951},
        0.02319572,
        (1.974927, 0.240898),
    ),
    # paper B, equation 3, 5 deg at T: I' 0.080320655, N 0.000247681 (the moment is 2N), W, x, C1 sin^2, C2 sin
    'swath-roll': (
        'swath-roll-3',
        0.080320655,
        {'b1': 2 * 0.000247681, 'b2': 0.981940173, 'b3': 2.615040557, 's2': 3.663245158, 's1': 0.498282369},
        0.007095983,
        (2.522643, 0.00123806),
    ),
    # paper C, equation (12), 3 deg at T, printed as ratios; restoring from the cube down to the first power
    'hydrofoil-pitch': (
        'hydrofoil-pitch-1',
        1.0,
        {'b1': 8.79129395, 'b2': 0.00850162, 'b3': 0.04839175, 'r3': 56.8982143, 'r2': 130.820453, 'r1': 32.953354},
        0.019560,
        (1.094536, 0.765725),
    ),
    # paper D, function 1, 5 deg at T: I' 0.0937801, N 0.0950886 (the moment is 2N), W, x, C1 cube, C2 square, C3
    'swath-usv-pitch': (
        'swath-usv-pitch-1',
        0.0937801,
        {'b1': 2 * 0.0950886, 'b2': 0.0132637, 'b3': 0.0046185, 'r3': 0.8210960, 'r2': 0.0015652, 'r1': 0.6977489},
        0.009069221,
        (2.303486, 0.371727),
    ),
}
"""Equation, inertia, moments (of paper C ratios), objective of the record in rad/s; then worked out by hand from these:
natural period, s, and damping over critical of small motions."""


@pytest.mark.parametrize('name', PRINTED)
def test_every_coefficient_is_the_printed_one(name):
    assert set(PRINTED) == set(PUBLISHED_HULLS)
    equation, inertia, printed, objective, _ = PRINTED[name]
    model, form = hull_named(name).model, hull_named(name).form
    assert model.equation.name == equation
    assert model.terms == pytest.approx({term: moment / inertia for term, moment in printed.items()}, rel=1e-12)
    assert hull_named(name).objective_value == objective
    if form is not None:
        assert (form.inertia, 2 * form.linear_damping) == pytest.approx((inertia, printed['b1']), rel=1e-12)


@pytest.mark.parametrize('name', PRINTED)
def test_a_small_release_decays_with_that_period_and_damping(name):
    """Against the closed form of the linear equation, at an amplitude where the nonlinear terms are nothing."""
    model, (period, damping) = hull_named(name).model, PRINTED[name][-1]
    assert (model.natural_period, model.damping_ratio) == pytest.approx((period, damping), rel=1e-5)
    time = np.linspace(0.0, 2.0, 400)
    angle, _ = simulate(model, 1e-7, 0.0, time)
    natural = 2 * math.pi / period
    damped = natural * math.sqrt(1 - damping**2)
    slow = np.exp(-damping * natural * time)
    expected = 1e-7 * slow * (np.cos(damped * time) + damping * natural / damped * np.sin(damped * time))
    np.testing.assert_allclose(angle, expected, atol=2e-4 * 1e-7)


@pytest.mark.parametrize('name', PRINTED)
def test_simulated_trials_have_the_error_one_step_ahead_that_the_paper_prints(name):
    """The objective as the papers write it, at the true coefficients, on a record with the study's noise."""
    hull = hull_named(name)
    found = []
    for seed in range(8):
        noise = SensorNoise(0.001, hull.rate_noise, 0.02)
        trial = simulated_trial(hull.model, math.radians(5.0), 15.0, 100.0, noise, seed)
        angle, rate = (trial.pitch, trial.pitch_rate) if hull.axis == 'pitch' else (trial.roll, trial.roll_rate)
        ahead = rate[:-1] + 0.01 * hull.model.acceleration(angle[:-1], rate[:-1])
        found.append(np.mean((ahead - rate[1:]) ** 2))
    # an error in Euler's step and the noise of the angle add a few per cent
    assert math.sqrt(np.mean(found)) == pytest.approx(PRINTED[name][3], rel=0.06)


@pytest.mark.parametrize(
    'words, noise',
    [
        (['--hull', 'swath-pitch'], 0.0164),
        (['--equation', 'swath-roll-1'], 0.00502),
        (['--equation', 'linear'], 0.0165),
        (['--hull', 'swath-roll', '--rate-noise', '0.03'], 0.03),
    ],
)
def test_simulate_takes_the_noise_of_the_study(words, noise, tmp_path):
    path = tmp_path / 'trial.csv'
    assert main(['simulate', *words, '--initial-angle-deg', '3', '--hold', '30', '--output', str(path)]) == 0
    trial = read_csv(path, None, (0.0, 0.0, 0.0))
    held = trial.time < 29.0
    for rate in (trial.roll_rate, trial.pitch_rate):
        assert np.std(rate[held]) == pytest.approx(noise, rel=0.05)
