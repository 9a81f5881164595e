"""The vertical motion of a whole record by zero-phase filters, the reference for scores of its forecasts."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion.trial import CHANNELS, Trial
from swath_sysid.attitude.motion.vertical import (
    ACCELERATION,
    EDGE,
    HEAVE,
    VELOCITY,
    vertical_acceleration,
    zero_phase_integral,
)
from swath_sysid.attitude.prediction.point import Point, point_motion
from swath_sysid.attitude.prediction.quiescence import quantity_at
from swath_sysid.common.errors import InputError
from swath_sysid.pipeline.baselines import Record

_BRIDGED = 1.0  #: s; a shorter gap is bridged linearly, a longer one ends a stretch.
_WITH_RATES = ('heave', 'heave_rate', 'vertical_velocity', 'vertical_velocity_rate', 'vertical_acceleration')
WITHOUT_RATES = ('roll', 'pitch', 'accel_x', 'accel_y', 'accel_z')


class Stretch(NamedTuple):
    """A part of a record without long gaps, at even steps of the sensor's interval."""

    time: np.ndarray  #: (N,); s.
    step: float  #: s.
    channels: dict[str, np.ndarray]  #: dict of str to (N,)

    @property
    def acceleration(self) -> np.ndarray:
        """Vertical, m/s^2, shape (N,)."""
        roll, pitch, *force = (self.channels[name] for name in WITHOUT_RATES)
        return vertical_acceleration(roll, pitch, np.stack(force, axis=1))


def even_stretches(trial: Trial, names: Sequence[str] = CHANNELS) -> list[Stretch]:
    """The stretches of a record in which all of some channels were measured, at even steps."""
    name = trial.source or 'the record'
    absent = [channel for channel in names if channel not in trial.channels]
    if absent:
        unused = ' (a measured heave is not used)' if 'heave' in trial.channels else ''
        raise InputError(
            f'{name} holds no {absent[0]}: vertical motion needs {", ".join(names)}{unused}, so record the '
            'accelerations and the attitude of the same IMU'
        )
    complete = np.isfinite([trial.channels[channel] for channel in names]).all(axis=0)
    time = trial.time[complete]
    if time.size < 2:
        raise InputError(f'{name} holds no two samples with all of {", ".join(names)}: check the sensor')
    step = float(np.median(np.diff(time)))
    parts = np.split(np.arange(time.size), np.flatnonzero(np.diff(time) > max(_BRIDGED, 1.5 * step)) + 1)
    stretches = []
    for part in parts:
        begin, end = time[part[[0, -1]]]
        # of the same interval as the samples, which are near their places
        grid = np.linspace(begin, end, round((end - begin) / step) + 1)
        even = {channel: np.interp(grid, time[part], trial.channels[channel][complete][part]) for channel in names}
        stretches.append(Stretch(grid, float((end - begin) / max(grid.size - 1, 1)), even))
    return stretches


def vertical_record(trial: Trial, points: Sequence[Point]) -> Record:
    """Heave, vertical velocity and acceleration at points by zero-phase integrals of the whole record and lever arms.

    Channels are named by `quantity_at`, derivatives with ``_rate`` after it; NaN within `EDGE` of the ends of a
    stretch.
    """
    parts = [_at_points(part, points) for part in even_stretches(trial) if part.time[-1] - part.time[0] > 2.0 * EDGE]
    if not parts:
        raise InputError(
            f'{trial.source or "the record"} holds no {2.0 * EDGE:.0f} s without a gap: vertical motion is known '
            f'{EDGE:.0f} s from the ends only'
        )
    time, values = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Record(time, values, tuple(quantity_at(point.name, kind) for point in points for kind in _WITH_RATES))


def _at_points(stretch: Stretch, points: Sequence[Point]):
    """Times and, for each point, heave, twice velocity and twice acceleration."""
    acceleration, channels = stretch.acceleration, stretch.channels
    vertical = [zero_phase_integral(acceleration, stretch.step, times) for times in (HEAVE, VELOCITY, ACCELERATION)]
    turning = [zero_phase_integral(channels[f'{axis}_rate'], stretch.step, -1) for axis in ('roll', 'pitch')]
    attitude = [channels[name] for name in ('roll', 'pitch', 'roll_rate', 'pitch_rate')]
    motion = np.stack([*vertical, *turning, *attitude], axis=1)
    mean = channels['roll'].mean(), channels['pitch'].mean()
    inner = slice(round(EDGE / stretch.step), -round(EDGE / stretch.step))
    each = [point_motion(point.place, mean, motion[inner]).mean for point in points]
    return stretch.time[inner], np.hstack([of[:, [0, 1, 1, 2, 2]] for of in each])
