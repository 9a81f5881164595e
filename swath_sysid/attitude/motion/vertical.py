"""Vertical motion from an IMU: acceleration in the world, and heave and vertical velocity about their means."""

from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from scipy import fft

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, Value, up_in_body
from swath_sysid.attitude.motion.trial import CHANNELS, Trial
from swath_sysid.common.errors import InputError

BAND_HZ = (0.04, 1.5)  #: Of heave and vertical velocity: slower motion drowns in the drift of twice integrated noise.
EDGE = 30.0  #: s at either end of a stretch where its zero-phase integrals are not valid.
ACCELERATION, VELOCITY, HEAVE = range(3)  #: How often the vertical acceleration is integrated.
_BRIDGED = 1.0  #: s; a shorter gap is bridged linearly, a longer one ends a stretch.
WITHOUT_RATES = ('roll', 'pitch', 'accel_x', 'accel_y', 'accel_z')
_LEAKS = ((1.5,), (4.0,), (12.0,), (3.0, 3.0), (4.0, 6.0))  #: s; chained time constants.


def vertical_acceleration(roll: Value, pitch: Value, specific_force: np.ndarray) -> Value:
    """Acceleration upwards without gravity, m/s^2, from attitude, rad, and specific force (3,) or (N, 3), m/s^2."""
    upwards = sum(up * force for up, force in zip(up_in_body(roll, pitch), specific_force.T, strict=True))
    return upwards - STANDARD_GRAVITY


def zero_phase_integral(signal: np.ndarray, step: float, times: int, delay: float = 0.0) -> np.ndarray:
    """A signal (N,) at even steps, s, integrated ``times`` times over `BAND_HZ` without phase error. Negative times
    differentiate; a ``delay`` of the signal, s, is undone. Valid from `EDGE` to `EDGE` before the end.
    """
    size = fft.next_fast_len(signal.size, real=True)
    frequency = fft.rfftfreq(size, step)
    inside = (frequency >= BAND_HZ[0]) & (frequency <= BAND_HZ[1])
    s = 2j * np.pi * frequency[inside]
    spectrum = np.zeros(frequency.size, dtype=complex)
    spectrum[inside] = fft.rfft(signal - signal.mean(), size)[inside] * np.exp(s * delay) / s**times
    return fft.irfft(spectrum, size)[: signal.size]


class LeakyIntegrals:
    """Causal leaky integrals of the vertical acceleration, given every ``step`` s: velocity and heave as known now."""

    COUNT = len(_LEAKS)

    def __init__(self, step: float) -> None:
        self._step = step
        self._kept = [[np.exp(-step / constant) for constant in chain] for chain in _LEAKS]
        self.restart()

    def restart(self) -> None:
        """From rest."""
        self._states = [[0.0] * len(chain) for chain in _LEAKS]

    def take(self, acceleration: float) -> None:
        """Add an acceleration, m/s^2; NaN counts as zero."""
        new = acceleration if acceleration == acceleration else 0.0
        for kept, states in zip(self._kept, self._states, strict=True):
            value = new
            for place, factor in enumerate(kept):
                value = states[place] = factor * states[place] + self._step * value

    @property
    def values(self) -> np.ndarray:
        """Shape (COUNT,): m/s or, integrated twice, m."""
        return np.array([states[-1] for states in self._states])

    def of(self, acceleration: np.ndarray) -> np.ndarray:
        """The integrals, shape (N, COUNT), of a whole stretch of finite accelerations, m/s^2, from rest."""
        columns = []
        for kept in self._kept:
            value = acceleration
            for factor in kept:
                value = _leaky_sum(self._step * value, factor)
            columns.append(value)
        return np.stack(columns, axis=1)


def _leaky_sum(values: np.ndarray, kept: float) -> np.ndarray:
    """As scipy.signal.lfilter([1], [1, -kept], values), which takes 20 MB to load."""
    return np.array([*accumulate(values.tolist(), lambda before, new: kept * before + new)])


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
