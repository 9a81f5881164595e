"""Attitude: quaternions (x, y, z, w), Euler angles (REP-103, rad) and their rates (rad/s), frames and mountings.

Every function takes floats or arrays that broadcast, and returns the like. Floats are evaluated with `math`, ten times
as fast as numpy. Formulas: [1] T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, Wiley, 2011.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations, product
from math import isfinite
from typing import Any

import numpy as np

from swath_sysid.common.conventions import ROUNDING
from swath_sysid.common.errors import InputError, check_choice

UNIT_TOLERANCE = 0.1  #: How far the squared norm of a measured quaternion may be from one.
STANDARD_GRAVITY = 9.80665  #: m/s^2.
FRAMES = ('flu', 'frd')  #: Sensor axes forward-left-up in an ENU world, or forward-right-down in a NED world.

Value = Any  #: A float, or an ndarray that broadcasts with the others.

Quaternion = tuple[Value, Value, Value, Value]  #: x, y, z, w.


class _Arrays:
    """What the formulas need, for arrays."""

    sin, cos, arctan2, hypot = np.sin, np.cos, np.arctan2, np.hypot

    @staticmethod
    def where(condition: Value, here: Value, elsewhere: Value) -> Value:
        return np.asarray(np.where(condition, here, elsewhere))[()]


class _Floats:
    """The same for floats."""

    sin, cos, arctan2, hypot = math.sin, math.cos, math.atan2, math.hypot

    @staticmethod
    def where(condition: bool, here: float, elsewhere: float) -> float:
        return here if condition else elsewhere


def _for_angles(first: Value, second: Value, third: Value = 0.0) -> type[_Arrays] | type[_Floats]:
    # the functions of math raise where those of numpy return NaN
    if type(first) is type(second) is type(third) is float and isfinite(first + second + third):
        return _Floats
    return _Arrays


def is_orientation(x: Value, y: Value, z: Value, w: Value) -> Value:
    """Whether a measured quaternion is valid: finite, its squared norm within `UNIT_TOLERANCE` of one."""
    if type(x) is float and type(w) is float:
        return _is_unit(x, y, z, w)
    with np.errstate(over='ignore', invalid='ignore'):
        return _is_unit(x, y, z, w)


def _is_unit(x: Value, y: Value, z: Value, w: Value) -> Value:
    return abs(x * x + y * y + z * z + w * w - 1) <= UNIT_TOLERANCE


def euler_angles(x: Value, y: Value, z: Value, w: Value) -> tuple[Value, Value, Value]:
    """Roll, pitch and yaw of a quaternion, NaN where it is invalid; roll is zero where the x axis is vertical. [1],
    section 2.2.2, but with pitch by arctangent, which stays accurate near the vertical and needs no unit norm.
    """
    if type(x) is type(y) is type(z) is type(w) is float:
        return _euler_angles(_Floats, x, y, z, w) if _is_unit(x, y, z, w) else (math.nan, math.nan, math.nan)
    with np.errstate(over='ignore', invalid='ignore'):
        return _euler_angles(_Arrays, x, y, z, np.where(_is_unit(x, y, z, w), w, np.nan)[()])


def _euler_angles(
    f: type[_Arrays] | type[_Floats], x: Value, y: Value, z: Value, w: Value
) -> tuple[Value, Value, Value]:
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    forward_east, forward_north = ww + xx - yy - zz, 2 * (x * y + z * w)
    left_east, left_north = 2 * (x * y - z * w), ww - xx + yy - zz
    roll, pitch = _tilt_angles(f, 2 * (x * z - y * w), 2 * (y * z + x * w), ww - xx - yy + zz)
    vertical = f.hypot(forward_east, forward_north) < ROUNDING
    yaw = f.where(vertical, f.arctan2(-left_east, left_north), f.arctan2(forward_north, forward_east))
    return f.where(vertical, 0.0, roll), pitch, yaw


def tilt_angles(up_x: Value, up_y: Value, up_z: Value) -> tuple[Value, Value]:
    """Roll and pitch of the world's upward direction, of any length, seen in body axes (FLU): [1], section 2.2.1."""
    return _tilt_angles(_Arrays, up_x, up_y, up_z)


def _tilt_angles(f: type[_Arrays] | type[_Floats], up_x: Value, up_y: Value, up_z: Value) -> tuple[Value, Value]:
    return f.arctan2(up_y, up_z), f.arctan2(-up_x, f.hypot(up_y, up_z))


def up_in_body(roll: Value, pitch: Value) -> tuple[Value, Value, Value]:
    """The world's upward unit vector in body axes (FLU), the inverse of `tilt_angles`."""
    return -np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)


def quaternion(roll: Value, pitch: Value, yaw: Value) -> Quaternion:
    """The quaternion of roll, pitch and yaw: [1], section 2.2.2 (unit quaternions from Euler angles)."""
    f = _for_angles(roll, pitch, yaw)
    sin_roll, cos_roll = f.sin(roll / 2), f.cos(roll / 2)
    sin_pitch, cos_pitch = f.sin(pitch / 2), f.cos(pitch / 2)
    sin_yaw, cos_yaw = f.sin(yaw / 2), f.cos(yaw / 2)
    return (
        sin_roll * cos_pitch * cos_yaw - cos_roll * sin_pitch * sin_yaw,
        cos_roll * sin_pitch * cos_yaw + sin_roll * cos_pitch * sin_yaw,
        cos_roll * cos_pitch * sin_yaw - sin_roll * sin_pitch * cos_yaw,
        cos_roll * cos_pitch * cos_yaw + sin_roll * sin_pitch * sin_yaw,
    )


def euler_rates(roll: Value, pitch: Value, rate_x: Value, rate_y: Value, rate_z: Value) -> tuple[Value, Value, Value]:
    """Rates of roll, pitch and yaw of body rates, NaN where the x axis is vertical: [1], section 2.2.1."""
    f = _for_angles(roll, pitch)
    sin_roll, cos_roll, cos_pitch = f.sin(roll), f.cos(roll), f.cos(pitch)
    cos_pitch = f.where(abs(cos_pitch) < ROUNDING, math.nan, cos_pitch)
    yaw_rate = (rate_y * sin_roll + rate_z * cos_roll) / cos_pitch
    return rate_x + yaw_rate * f.sin(pitch), rate_y * cos_roll - rate_z * sin_roll, yaw_rate


def body_rates(
    roll: Value, pitch: Value, roll_rate: Value, pitch_rate: Value, yaw_rate: Value
) -> tuple[Value, Value, Value]:
    """Body rates of Euler rates, the inverse of `euler_rates`: [1], section 2.2.1."""
    f = _for_angles(roll, pitch)
    sin_roll, cos_roll, cos_pitch = f.sin(roll), f.cos(roll), f.cos(pitch)
    return (
        roll_rate - yaw_rate * f.sin(pitch),
        pitch_rate * cos_roll + yaw_rate * sin_roll * cos_pitch,
        -pitch_rate * sin_roll + yaw_rate * cos_roll * cos_pitch,
    )


def swap_body_axes(x: Value, y: Value, z: Value) -> tuple[Value, Value, Value]:
    """A body vector from FRD (forward, right, down) to FLU (forward, left, up), or back: half a turn about x."""
    return x, -y, -z


def swap_frames(x: Value, y: Value, z: Value, w: Value) -> Quaternion:
    """An orientation from FRD in NED to FLU in ENU (REP-103), or back. The product ``n q f`` with ``n = (1, 1, 0, 0) /
    sqrt(2)`` and ``f = (1, 0, 0, 0)``. Roll stays, pitch changes its sign, yaw becomes pi/2 - yaw.
    """
    half = math.sqrt(0.5)
    return half * (x + y), half * (x - y), half * (w - z), half * (w + z)


def multiply(first: Quaternion, second: Quaternion) -> Quaternion:
    """The quaternion product ``first second``, the rotation `second`, then `first`: [1], section 2.2.2."""
    (ax, ay, az, aw), (bx, by, bz, bw) = first, second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(x: Value, y: Value, z: Value, w: Value) -> Quaternion:
    """The inverse of a unit quaternion."""
    return -x, -y, -z, w


def rotate(rotation: Quaternion, x: Value, y: Value, z: Value) -> tuple[Value, Value, Value]:
    """A vector turned by a unit quaternion (u, w): ``v + 2 w (u x v) + 2 u x (u x v)``; [1], section 2.2.2."""
    ux, uy, uz, w = rotation
    cx, cy, cz = 2 * (uy * z - uz * y), 2 * (uz * x - ux * z), 2 * (ux * y - uy * x)
    return (x + w * cx + uy * cz - uz * cy, y + w * cy + uz * cx - ux * cz, z + w * cz + ux * cy - uy * cx)


@dataclass(frozen=True)
class Installation:
    """Frame and mounting of a sensor: readings go from its frame to FLU in ENU, then through the mounting."""

    frame: str = 'flu'  #: One of `FRAMES`: what the sensor's axes and angles mean.
    #: rad: roll, pitch, yaw of the sensor's (FLU) axes as seen from the craft's; None: not stated.
    mounting: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        check_choice(self.frame, FRAMES, 'frame')
        if self.mounting is not None and (len(self.mounting) != 3 or not all(map(isfinite, self.mounting))):
            raise InputError(f'a mounting is three finite angles (roll, pitch, yaw in rad), not {self.mounting}')

    @property
    def angles(self) -> tuple[float, float, float]:
        """The mounting, rad; that of a sensor along the craft's axes where none is stated."""
        return self.mounting or (0.0, 0.0, 0.0)

    @property
    def described(self) -> str:
        """The stated mounting in degrees, as the flags take it."""
        angles = self.mounting and in_degrees(self.mounting, 4)
        return ','.join(f'{angle:g}' for angle in angles) if angles else 'not stated'

    @cached_property
    def is_turned(self) -> bool:
        """Whether the sensor's axes are not the craft's."""
        return any(self.angles)

    @cached_property
    def rotation(self) -> Quaternion:
        """The quaternion (x, y, z, w) that turns sensor vectors (FLU) into craft vectors."""
        x, y, z, w = quaternion(*self.angles)
        return float(x), float(y), float(z), float(w)

    def vector(self, x: Value, y: Value, z: Value) -> tuple[Value, Value, Value]:
        """A rate or specific force from the sensor's axes to the craft's (FLU); floats or arrays."""
        if self.frame == 'frd':
            x, y, z = swap_body_axes(x, y, z)
        return rotate(self.rotation, x, y, z) if self.is_turned else (x, y, z)

    def orientation(self, x: Value, y: Value, z: Value, w: Value) -> Quaternion:
        """The quaternion of the sensor in its world as that of the craft in ENU; floats or arrays."""
        if self.frame == 'frd':
            x, y, z, w = swap_frames(x, y, z, w)
        if self.is_turned:
            x, y, z, w = multiply((x, y, z, w), conjugate(*self.rotation))
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


def in_degrees(mounting: Sequence[float], digits: int | None = None) -> list[float]:
    """A mounting in degrees, whole ones or with so many digits behind the point, of which -180 is 180."""
    degrees = [round(float(np.degrees(angle)), digits) for angle in mounting]
    return [180 if angle == -180 else int(angle) if angle == int(angle) else angle for angle in degrees]


def mounting_after(further: Sequence[float], installation: Installation, digits: int | None = None) -> list[float]:
    """The mounting, deg, of a sensor with a further rotation, rad, after its stated mounting."""
    turned = multiply(quaternion(*further), installation.rotation)
    return in_degrees(euler_angles(*turned), digits)


def angle_between(one: Sequence[float], other: Sequence[float]) -> float:
    """The angle, rad, by which two mountings differ, about whatever axis."""
    w = multiply(quaternion(*one), conjugate(*quaternion(*other)))[3]
    return 2.0 * float(np.arccos(min(abs(float(w)), 1.0)))


#: Parent and orientation in it, a quaternion (x, y, z, w), of each frame, as transforms (TF) state them.
FrameTree = Mapping[str, tuple[str, Quaternion]]


def mounting_in(tree: FrameTree, sensor: str, craft: str, frame: str = 'flu') -> tuple[float, float, float] | None:
    """The mounting, rad, of a sensor's frame in a craft's, also one with a prefix (``boat1/base_link``).

    None where the tree does not connect the two, or several frames of that name with the sensor. An ``frd`` sensor has
    its frame's x axis forward and z axis down, so one that names the craft's frame states nothing.
    """
    if frame != 'flu' and sensor.rpartition('/')[2] == craft:
        return None
    root, placed = _in_root(tree, sensor)
    origins = [_in_root(tree, name) for name in {*tree, root} if name == craft or name.endswith(f'/{craft}')]
    turns = [multiply(conjugate(*turn), placed) for end, turn in origins if end == root not in tree]
    if not sensor or len(turns) != 1:
        return None
    found = turns[0] if frame == 'flu' else multiply(turns[0], quaternion(np.pi, 0.0, 0.0))
    roll, pitch, yaw = map(float, euler_angles(*found))
    return roll, pitch, yaw


def turn_in_craft(installation: Installation) -> Quaternion:
    """The orientation of a sensor's frame in the craft's, as a transform states it: the inverse of `mounting_in`."""
    turn = installation.rotation
    return turn if installation.frame == 'flu' else multiply(turn, quaternion(np.pi, 0.0, 0.0))


def _in_root(tree: FrameTree, name: str) -> tuple[str, Quaternion]:
    """The root above a frame, and the orientation of the frame in it."""
    turn: Quaternion = (0.0, 0.0, 0.0, 1.0)
    for _ in range(len(tree)):  # frames in a circle have no root
        if name not in tree:
            break
        name, above = tree[name]
        turn = multiply(above, turn)
    return name, turn
