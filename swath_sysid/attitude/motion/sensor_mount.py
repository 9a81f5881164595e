"""The frame and mounting of an IMU, and its readings in the axes of the craft."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations, product
from math import isfinite

import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.attitude import Quaternion, Value
from swath_sysid.common.errors import InputError, check_choice

FRAMES = ('flu', 'frd')  #: Sensor axes forward-left-up in an ENU world, or forward-right-down in a NED world.


@dataclass(frozen=True)
class Installation:
    """Frame and mounting of a sensor: readings go from its frame to FLU in ENU, then through the mounting."""

    frame: str = 'flu'  #: One of `FRAMES`: what the sensor's axes and angles mean.
    #: rad: roll, pitch, yaw of the sensor's (FLU) axes as seen from the craft's.
    mounting: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        check_choice(self.frame, FRAMES, 'frame')
        if len(self.mounting) != 3 or not all(isfinite(angle) for angle in self.mounting):
            raise InputError(f'a mounting is three finite angles (roll, pitch, yaw in rad), not {self.mounting}')

    @cached_property
    def is_turned(self) -> bool:
        """Whether the sensor's axes are not the craft's."""
        return any(self.mounting)

    @cached_property
    def rotation(self) -> Quaternion:
        """The quaternion (x, y, z, w) that turns sensor vectors (FLU) into craft vectors."""
        x, y, z, w = attitude.quaternion(*self.mounting)
        return float(x), float(y), float(z), float(w)

    def vector(self, x: Value, y: Value, z: Value) -> tuple[Value, Value, Value]:
        """A rate or specific force from the sensor's axes to the craft's (FLU); floats or arrays."""
        if self.frame == 'frd':
            x, y, z = attitude.swap_body_axes(x, y, z)
        return attitude.rotate(self.rotation, x, y, z) if self.is_turned else (x, y, z)

    def orientation(self, x: Value, y: Value, z: Value, w: Value) -> tuple[Value, Value, Value, Value]:
        """The quaternion of the sensor in its world as that of the craft in ENU; floats or arrays."""
        if self.frame == 'frd':
            x, y, z, w = attitude.swap_frames(x, y, z, w)
        if self.is_turned:
            x, y, z, w = attitude.multiply((x, y, z, w), attitude.conjugate(*self.rotation))
        return x, y, z, w


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
    turned = attitude.multiply(attitude.quaternion(*further), installation.rotation)
    return in_degrees(attitude.euler_angles(*turned))
