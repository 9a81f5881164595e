"""Motion at a point: against rigid-body kinematics by rotation matrices, and against Monte Carlo."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from swath_sysid.attitude.prediction.point import point_motion

PLACES = [(0.0, 0.0, 0.0), (2.5, 0.0, 0.0), (0.0, -1.2, 0.4), (3.0, 1.0, -2.0)]


def heights(place, times):
    """Height of a point of a craft that heaves, rolls and pitches by much, from scipy's rotations."""
    roll, pitch = 0.4 * np.sin(1.3 * times + 0.2), 0.3 * np.sin(0.9 * times - 1.0)
    heave = 0.8 * np.sin(0.7 * times)
    turned = Rotation.from_euler('ZYX', np.stack([0.0 * roll, pitch, roll], axis=1)).apply(place)
    return heave + turned[:, 2], np.stack(
        [
            heave,
            0.56 * np.cos(0.7 * times),
            -0.392 * np.sin(0.7 * times),
            -0.4 * 1.69 * np.sin(1.3 * times + 0.2),
            -0.3 * 0.81 * np.sin(0.9 * times - 1.0),
            roll,
            pitch,
            0.52 * np.cos(1.3 * times + 0.2),
            0.27 * np.cos(0.9 * times - 1.0),
        ],
        axis=1,
    )


@pytest.mark.parametrize('place', PLACES)
def test_the_lever_arm_is_that_of_a_rigid_body(place):
    times = np.linspace(0.0, 10.0, 41)
    step = 1e-3
    around = np.array([-3, -2, -1, 0, 1, 2, 3]) * step
    found = point_motion(place, (0.05, -0.02), heights(place, times)[1], np.zeros((times.size, 9, 9))).mean
    level = Rotation.from_euler('ZYX', (0.0, -0.02, 0.05)).apply(place)[2]
    height = np.stack([heights(place, times + shift)[0] for shift in around])
    np.testing.assert_allclose(found[:, 0], height[3] - level, atol=1e-12)
    velocity = np.array([-1, 9, -45, 0, 45, -9, 1]) @ height / (60.0 * step)
    np.testing.assert_allclose(found[:, 1], velocity, atol=1e-9)
    acceleration = np.array([2, -27, 270, -490, 270, -27, 2]) @ height / (180.0 * step**2)
    np.testing.assert_allclose(found[:, 2], acceleration, atol=3e-8)


def test_the_covariance_is_that_of_draws():
    rng = np.random.default_rng(5)
    mean = np.array([[0.3, -0.2, 0.1, 0.05, -0.1, 0.10, -0.06, 0.12, 0.08]])
    root = rng.normal(size=(9, 9)) * np.array([0.2, 0.2, 0.3, 0.05, 0.05, 0.02, 0.02, 0.03, 0.03])[:, None]
    draws = mean + rng.normal(size=(10_000, 9)) @ root.T
    place = (2.5, 0.8, -0.6)
    found = point_motion(place, (0.0, 0.0), mean, (root @ root.T)[None]).covariance[0]
    drawn = np.cov(point_motion(place, (0.0, 0.0), draws, np.zeros((10_000, 9, 9))).mean.T, draws[:, 5:].T)
    size = np.sqrt(np.diag(found))
    np.testing.assert_allclose(drawn / np.outer(size, size), found / np.outer(size, size), atol=0.03)
