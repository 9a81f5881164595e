"""Simulation and amplitude curves against closed forms, scipy, and the uncompiled source."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from swath_sysid.attitude.hull import simulation
from swath_sysid.attitude.hull.amplitude import amplitude_curves, orbit_centre
from swath_sysid.attitude.hull.catalogue import EQUATIONS, PUBLISHED_HULLS
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.terms import TERM_NAMES, restoring_energy

ALL_TERMS = Equation('all', TERM_NAMES)


def exact(model, angle, rate, time):
    """scipy's integration at tight tolerance."""
    found = solve_ivp(
        lambda t, y: [y[1], model.acceleration(y[0], y[1])],
        (time[0], time[-1]),
        [angle, rate],
        t_eval=time,
        rtol=1e-11,
        atol=1e-13,
        method='DOP853',
    )
    return found.y


@pytest.mark.parametrize('name', PUBLISHED_HULLS)
def test_simulation_against_scipy(name):
    model = PUBLISHED_HULLS[name].model.with_trim(0.02)
    time = np.sort(np.random.default_rng(2).uniform(3.0, 18.0, 400))
    angle, rate = simulation.simulate(model, 0.08, -0.05, time)
    expected = exact(model, 0.08, -0.05, time)
    assert angle == pytest.approx(expected[0], abs=2e-6)
    assert rate == pytest.approx(expected[1], abs=1e-5)


def test_a_release_from_far_out_is_followed_as_closely():
    model = PUBLISHED_HULLS['swath-roll'].model
    time = np.linspace(0.0, 12.0, 1201)
    angle, rate = simulation.simulate(model, np.radians(15.0), 0.0, time)
    expected = exact(model, np.radians(15.0), 0.0, time)
    assert angle == pytest.approx(expected[0], abs=1e-7)
    assert rate == pytest.approx(expected[1], abs=1e-6)


def test_a_capsizing_candidate_does_not_spoil_its_neighbours():
    ratios = np.zeros((9, 2))
    ratios[4] = 9.0, 9.0
    ratios[6] = 0.0, -1e4
    with np.errstate(over='ignore', invalid='ignore'):
        angles, _, _ = simulation.runge_kutta_population(
            np.full(2, 0.2), np.zeros(2), ratios, EQUATIONS['odd-cubic'].active, 0.01, 0.05, 400
        )
    assert np.isfinite(angles[:, 0]).all()
    assert not np.isfinite(angles[:, 1]).all()


def test_natural_period_of_a_pendulum():
    ratios = np.zeros(9)
    ratios[TERM_NAMES.index('s1')] = 4.0
    amplitude = np.array([0.01, 0.5, 2.0])
    curves = amplitude_curves(ratios, amplitude, 0.01)
    assert 2 * np.pi / curves.frequency == pytest.approx(4 * ellipk(np.sin(amplitude / 2) ** 2) / 2.0, rel=1e-9)


def test_equivalent_damping_of_harmonic_motion():
    b0, b1, b2, b3, w = 0.02, 0.3, 0.4, 0.5, 3.0
    amplitude = np.array([0.05, 0.1, 0.3])
    curves = amplitude_curves(np.array([b0, b1, b2, b3, w * w, 0, 0, 0, 0]), amplitude, 1e-5)
    speed = w * amplitude
    expected = b1 + 8 / (3 * np.pi) * b2 * speed + 0.75 * b3 * speed**2 + 4 * b0 / (np.pi * speed)
    assert curves.damping_ratio == pytest.approx(expected / (2 * w), rel=1e-4)


def test_asymmetric_orbits_join_equal_energies_and_have_the_simulated_period():
    model = PUBLISHED_HULLS['swath-roll'].model
    amplitude = np.radians([1.0, 3.0])
    centre = orbit_centre(model.ratios, amplitude)
    assert restoring_energy(centre + amplitude, model.ratios) == pytest.approx(
        restoring_energy(centre - amplitude, model.ratios), rel=1e-9
    )
    free = DecayModel(model.equation, np.where(np.arange(9) < 4, 0.0, model.ratios))
    period = 2 * np.pi / amplitude_curves(model.ratios, amplitude, 0.01).frequency[1]
    angle, rate = exact(free, (centre + amplitude)[1], 0.0, np.array([0.0, period]))[:, -1]
    assert (angle, rate) == pytest.approx(((centre + amplitude)[1], 0.0), abs=1e-8)


def test_no_orbit_where_the_hull_would_capsize():
    curves = amplitude_curves(PUBLISHED_HULLS['swath-roll'].model.ratios, np.radians([6.0, 12.0]), 0.01)
    assert np.isnan([curves.frequency, curves.damping_ratio]).all()


def test_simulated_trial_is_what_an_imu_would_record():
    model = PUBLISHED_HULLS['swath-pitch'].model.with_trim(0.01)
    noise = SensorNoise(angle=0.001, rate=0.0165, acceleration=0.0)
    trial = simulated_trial(model, 0.1, duration=15.0, rate_hz=100.0, noise=noise, seed=4, hold=2.0)
    assert trial.time.size == 1700
    free = trial.time >= 2.0
    truth, truth_rate = exact(model, 0.11, 0.0, trial.time[free])
    assert np.std(trial.pitch[free] - truth) == pytest.approx(0.001, rel=0.1)
    assert np.std(trial.pitch_rate[free] - truth_rate) == pytest.approx(0.0165, rel=0.1)
    assert trial.pitch[~free].mean() == pytest.approx(0.11, abs=5e-4)
    force = np.hypot(np.hypot(trial.accel_x, trial.accel_y), trial.accel_z)
    assert force == pytest.approx(np.full(1700, 9.80665))
