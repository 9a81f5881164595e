"""Vertical acceleration, its integrals without phase error, and its leaky ones."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.vertical import (
    EDGE,
    HEAVE,
    VELOCITY,
    LeakyIntegrals,
    vertical_acceleration,
    zero_phase_integral,
)

STEP = 0.1
TIME = np.arange(0.0, 600.0, STEP)
INNER = slice(round(EDGE / STEP), -round(EDGE / STEP))


def test_gravity_is_removed_by_the_orientation():
    rng = np.random.default_rng(3)
    roll, pitch, yaw = rng.uniform(-1.2, 1.2, (3, 50))
    world = rng.normal(size=(50, 3))
    craft_to_world = Rotation.from_euler('ZYX', np.stack([yaw, pitch, roll], axis=1))
    force = craft_to_world.inv().apply(world + [0.0, 0.0, STANDARD_GRAVITY])
    np.testing.assert_allclose(vertical_acceleration(roll, pitch, force), world[:, 2], atol=1e-12)


@pytest.mark.parametrize('delay', [0.0, 0.07])
@pytest.mark.parametrize('frequency', [0.06, 0.2, 1.0])
def test_a_sine_is_integrated_without_phase_error(frequency, delay):
    w = 2.0 * np.pi * frequency
    signal = -(w**2) * np.sin(w * (TIME - delay))
    expected = np.sin(w * TIME), w * np.cos(w * TIME), -(w**3) * np.cos(w * TIME)
    for times, motion in zip((HEAVE, VELOCITY, -1), expected, strict=True):
        found = zero_phase_integral(signal, STEP, times, delay)
        np.testing.assert_allclose(found[INNER], motion[INNER], atol=0.03 * np.abs(motion).max())


def test_drift_and_a_bias_are_not_motion():
    found = zero_phase_integral(0.3 + 0.1 * np.sin(2.0 * np.pi * 0.002 * TIME), STEP, HEAVE)
    assert np.abs(found[INNER]).max() < 0.2


def test_leaky_integrals_of_a_stretch_are_those_row_by_row_and_a_missing_row_is_no_motion():
    acceleration = np.random.default_rng(1).normal(size=300)
    integrals = LeakyIntegrals(STEP)
    for value in acceleration:
        integrals.take(float(value))
    np.testing.assert_allclose(integrals.values, LeakyIntegrals(STEP).of(acceleration)[-1], rtol=1e-12)
    integrals.take(np.nan)
    assert np.isfinite(integrals.values).all()


def test_a_leaky_integral_of_a_step_levels_off_at_its_time_constant():
    integrals = LeakyIntegrals(0.004)
    for _ in range(50_000):
        integrals.take(1.0)
    np.testing.assert_allclose(integrals.values, (1.5, 4.0, 12.0, 9.0, 24.0), rtol=3e-3)
