"""Corrections of a sensor's mounting: the right-angled rotations, and mountings in whole degrees."""

from collections.abc import Sequence
from itertools import permutations, product

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation, euler_angles, multiply, quaternion


def _turns() -> list[np.ndarray]:
    """The 24 right-angled rotations, the smallest first."""
    signed = (
        np.array(signs)[:, None] * np.eye(3)[list(order)]
        for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3))
    )
    found = [turn for turn in signed if np.linalg.det(turn) > 0.0]
    return sorted(found, key=lambda turn: (-np.trace(turn), -turn[2, 2], -turn[0, 0]))


TURNS = tuple(_turns())  #: Each turns vectors in the sensor's axes into the craft's.


def angles_of(turn: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw, rad, of a rotation that brings axes onto axes, shape (3, 3)."""
    pitch = float(np.arcsin(np.clip(-turn[2, 0], -1.0, 1.0)))
    if abs(turn[2, 0]) > 0.5:
        return 0.0, pitch, float(np.arctan2(-turn[0, 1], turn[1, 1]))
    return float(np.arctan2(turn[2, 1], turn[2, 2])), pitch, float(np.arctan2(turn[1, 0], turn[0, 0]))


def nearest_quarter(angle: float) -> float:
    """The nearest multiple of 90 deg where it is within 10 deg, else the angle to a degree, rad."""
    degrees = float(np.degrees(angle))
    quarter = 90.0 * round(degrees / 90.0)
    return float(np.radians(quarter if abs(degrees - quarter) <= 10.0 else round(degrees)))


def in_degrees(mounting: Sequence[float]) -> list[int]:
    """A mounting in whole degrees, of which -180 is 180."""
    degrees = [round(float(np.degrees(angle))) for angle in mounting]
    return [180 if angle == -180 else angle for angle in degrees]


def mounting_after(further: Sequence[float], installation: Installation) -> list[int]:
    """The mounting, deg, of a sensor with a further rotation, rad, after its stated mounting."""
    turned = multiply(quaternion(*further), installation.rotation)
    return in_degrees(euler_angles(*turned))
