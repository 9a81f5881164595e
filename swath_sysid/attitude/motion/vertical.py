"""Vertical motion from an IMU: acceleration in the world, and heave and vertical velocity about their means."""

from itertools import accumulate

import numpy as np
from scipy import fft

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, Value, up_in_body

BAND_HZ = (0.04, 1.5)  #: Of heave and vertical velocity: slower motion drowns in the drift of twice integrated noise.
EDGE = 30.0  #: s at either end of a stretch where its zero-phase integrals are not valid.
ACCELERATION, VELOCITY, HEAVE = range(3)  #: How often the vertical acceleration is integrated.
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
