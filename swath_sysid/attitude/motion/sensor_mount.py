"""The frame and mounting of an IMU, and its readings in the axes of the craft."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.attitude import Quaternion, Value
from swath_sysid.common.errors import InputError, check_choice

FRAMES = ('flu', 'frd')  #: Sensor axes forward-left-up in an ENU world, or forward-right-down in a NED world.


@dataclass(frozen=True)
class Installation:
    """The frame and mounting of a sensor.

    Its readings are first brought from its frame to FLU in ENU, then turned by the mounting.

    Raises:
        InputError: There is no such frame, or the mounting is not three finite angles.
    """

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
        """A rate or specific force in the sensor's axes, in those of the craft (FLU); floats or arrays alike."""
        if self.frame == 'frd':
            x, y, z = attitude.swap_body_axes(x, y, z)
        return attitude.rotate(self.rotation, x, y, z) if self.is_turned else (x, y, z)

    def orientation(self, x: Value, y: Value, z: Value, w: Value) -> tuple[Value, Value, Value, Value]:
        """The quaternion of the sensor in its world, as that of the craft in ENU; floats or arrays alike."""
        if self.frame == 'frd':
            x, y, z, w = attitude.swap_frames(x, y, z, w)
        if self.is_turned:
            x, y, z, w = attitude.multiply((x, y, z, w), attitude.conjugate(*self.rotation))
        return x, y, z, w
