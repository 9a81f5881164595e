"""Trials: the measured motion of a craft, whatever file or topic it came from."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.common.advice import Advice
from swath_sysid.common.door import checked
from swath_sysid.common.errors import InputError, check_choice

AXES = ('roll', 'pitch')


def about_sensor(axis: str, installation: Installation | None) -> str:
    """The axis of a sensor whose mounting is not stated, for people; empty where it is stated or there is none."""
    if installation is None or installation.mounting is not None:
        return ''
    return f'about the {"xy"[AXES.index(axis)]} axis of the sensor, whose mounting is not stated'


def axis_in_words(axis: str, installation: Installation | None, name: str = '') -> str:
    """An axis, or its name; where the mounting of its sensor is not stated, with the axis of the sensor it is about."""
    about = about_sensor(axis, installation)
    return f'{name or axis} ({about})' if about else name or axis


#: What an IMU measures of roll and pitch: the columns of a published window, in this order.
CHANNELS = ('roll', 'pitch', 'roll_rate', 'pitch_rate', 'accel_x', 'accel_y', 'accel_z')
FURTHER_CHANNELS = ('yaw_rate', 'heave')  #: In some records: more of the wave, for a forecast.


@dataclass(frozen=True)
class AxisMotion:
    """The motion about one axis, roll or pitch, every sample finite; its source is for messages."""

    axis: str
    time: np.ndarray  #: (N,); Seconds, strictly increasing, not necessarily even.
    angle: np.ndarray | None  #: (N,); rad; None where the sensor gave none.
    rate: np.ndarray | None  #: (N,); Euler rate, rad/s; None where the sensor gave none.
    source: str = ''
    usable_share: float = 1.0  #: Of the recorded rows, those with a time of their own.
    lag: float = 0.0  #: By which the rate came later than the angle, s, and was moved; negative for the angle.
    installation: Installation | None = None  #: As of the `Trial`.
    heading: np.ndarray | None = None  #: (K, 2); of the whole record: s, and rad from the start; None: not measured.

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.time.size

    @property
    def duration(self) -> float:
        """Seconds from the first to the last sample."""
        return float(self.time[-1] - self.time[0])

    @property
    def sample_interval(self) -> float:
        """Median time between samples, s."""
        return float(np.median(np.diff(self.time)))

    @property
    def primary(self) -> np.ndarray:
        """What a simulated motion is held against, shape (N,): the angle or, where none was measured, the rate."""
        values = self.rate if self.angle is None else self.angle
        assert values is not None, 'one of the two was measured'
        return values

    def between(self, start: float | None, end: float | None) -> 'AxisMotion':
        """The samples with ``start <= time <= end`` (either may be None)."""
        return self.only(_within(self.time, start, end))

    def only(self, keep: np.ndarray | slice) -> 'AxisMotion':
        """The samples selected by a mask or a slice."""
        return replace(
            self,
            time=self.time[keep],
            angle=None if self.angle is None else self.angle[keep],
            rate=None if self.rate is None else self.rate[keep],
        )


def _within(time: np.ndarray, start: float | None, end: float | None) -> np.ndarray:
    return (time >= (-np.inf if start is None else start)) & (time <= (np.inf if end is None else end))


@checked
@dataclass(frozen=True)
class Trial:
    """One recorded trial.

    All channels are arrays of shape (N,) in SI units, or None where not measured. NaN
    marks a missing value. Angles and rates are Euler angles and their time derivatives
    (body axes x forward, y port, z up; the yaw rate is positive to port); accelerations are
    specific force in body axes, so that a craft at rest reads about +9.81 m/s^2 on z; heave is
    positive up.

    Example:
        A trial is read from a file, or made from arrays:

        >>> time = np.arange(0.0, 10.0, 0.02)
        >>> trial = Trial(time, roll=0.1 * np.exp(-0.1 * time) * np.cos(2.0 * time))
        >>> trial.axes
        ('roll',)
        >>> trial.between(2.0, 4.0).time.size
        101
        >>> trial.axis('roll').duration
        9.98
    """

    time: np.ndarray  #: (N,); Seconds, strictly increasing.
    roll: np.ndarray | None = None
    pitch: np.ndarray | None = None
    roll_rate: np.ndarray | None = None
    pitch_rate: np.ndarray | None = None
    accel_x: np.ndarray | None = None
    accel_y: np.ndarray | None = None
    accel_z: np.ndarray | None = None
    yaw_rate: np.ndarray | None = None
    heave: np.ndarray | None = None
    source: str = ''  #: The file (or topic) the trial was read from.
    draft: float | None = None  #: m.
    initial_angle: float | None = None  #: rad.
    advice: tuple[Advice, ...] = ()  #: What the reader had to repair or leave out.
    usable_share: float = 1.0  #: Of the recorded rows, those with a time of their own.
    understood: tuple[str, ...] = ()  #: What reader took it, and what it read as what; a line for each channel.
    #: Of the sensor in whose axes the motion was measured; None where a table names the craft's axes itself.
    installation: Installation | None = None

    def __post_init__(self) -> None:
        for name in ('time', *CHANNELS, *FURTHER_CHANNELS):
            values = getattr(self, name)
            if isinstance(values, list | tuple):
                object.__setattr__(self, name, np.array(values, dtype=float))
        sizes = {name: values.shape for name, values in self.channels.items() if values.shape != self.time.shape}
        for name, shape in sizes.items():
            raise InputError(f'Trial: {name} has the shape {shape}, and time {self.time.shape}: give a value each')

    @property
    def channels(self) -> dict[str, np.ndarray]:
        """Name to array of every channel that was measured."""
        names = (*CHANNELS, *FURTHER_CHANNELS)
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of which an angle or a rate was measured."""
        return tuple(a for a in AXES if a in self.channels or f'{a}_rate' in self.channels)

    @property
    def heading(self) -> np.ndarray | None:
        """Time, s, and heading from the first sample on, rad, to port, (N, 2); with the drift of a gyro's bias."""
        if self.yaw_rate is None:
            return None
        return np.column_stack([self.time, np.cumsum(np.nan_to_num(self.yaw_rate) * np.gradient(self.time))])

    @checked
    def axis(self, name: str) -> AxisMotion:
        """The motion about one axis, without the samples in which a value is missing.

        Raises:
            InputError: The trial holds neither angle nor rate of that axis, or no finite sample of it.
        """
        check_choice(name, AXES, 'axis')
        measured = [c for c in (getattr(self, name), getattr(self, f'{name}_rate')) if c is not None]
        if not measured:
            held = ', '.join(self.axes) or 'none'
            raise InputError(
                f'{self.source or "the trial"} holds no {name} motion (axes in it: {held}): choose another axis, or '
                f'assign the column of {name}',
                'axis-absent',
            )
        finite = np.all(np.isfinite(measured), axis=0)
        if not finite.any():
            raise InputError(f'{self.source or "the trial"} holds no finite sample of {name}')
        angle, rate = getattr(self, name), getattr(self, f'{name}_rate')
        where = self.source, self.usable_share
        motion = AxisMotion(name, self.time, angle, rate, *where, 0.0, self.installation, self.heading)
        return motion.only(finite)

    @checked
    def between(self, start: float | None, end: float | None) -> 'Trial':
        """The samples with ``start <= time <= end`` (either may be None)."""
        keep = _within(self.time, start, end)
        kept: dict[str, Any] = {name: values[keep] for name, values in self.channels.items()}
        return replace(self, time=self.time[keep], **kept)
