"""Sensors whose axes are turned by right angles: the turns, as mountings, and what mends them."""
from itertools import permutations, product

import numpy as np

from swath_sysid.attitude.motion import attitude


def _turns():
    """The 24 rotations that bring axes onto axes, the plainest first."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.zeros((3, 3))
        turn[range(3), order] = signs
        if np.linalg.det(turn) > 0.0:
            found.append(turn)
    return sorted(found, key=lambda turn: (-np.trace(turn), -turn[2, 2], -turn[0, 0]))


TURNS = tuple(_turns())
"""Each turns vectors in the sensor's axes into the craft's."""


def angles_of(turn):
    """Roll, pitch and yaw of a rotation that brings axes onto axes."""
    pitch = float(np.arcsin(np.clip(-turn[2, 0], -1.0, 1.0)))
    if abs(turn[2, 0]) > 0.5:
        return 0.0, pitch, float(np.arctan2(-turn[0, 1], turn[1, 1]))
    return float(np.arctan2(turn[2, 1], turn[2, 2])), pitch, float(np.arctan2(turn[1, 0], turn[0, 0]))


def nearest_quarter(angle):
    """The nearest multiple of 90 deg where it is within 10 deg, else the angle to a degree, rad."""
    degrees = float(np.degrees(angle))
    quarter = 90.0 * round(degrees / 90.0)
    return float(np.radians(quarter if abs(degrees - quarter) <= 10.0 else round(degrees)))


def composed(further, installation):
    """The mounting of a sensor that sits turned by a further rotation beside what its mounting says."""
    turned = attitude.multiply(attitude.quaternion(*further), installation.rotation)
    return tuple(float(angle) for angle in attitude.euler_angles(*turned))


def in_degrees(mounting):
    """A mounting in whole degrees, of which -180 is 180."""
    degrees = [round(float(np.degrees(angle))) for angle in mounting]
    return [180 if angle == -180 else angle for angle in degrees]


def turn_and_cure(turn, installation):
    """What vectors turned against the orientation are, and what mends them."""
    return (
        f'rates and accelerations are turned by {in_degrees(turn)} deg (roll, pitch, yaw) against the orientation; let '
        f'the driver give all of them in the axes of the sensor and set mounting_deg to '
        f'{in_degrees(composed(turn, installation))}, or all in those of the craft with mounting_deg [0, 0, 0]'
    )
