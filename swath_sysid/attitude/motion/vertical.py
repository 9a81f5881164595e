"""Vertical motion from what an IMU measures: acceleration in the world, heave and vertical velocity from it.

Gravity is removed by the orientation.  What is integrated is known above a lowest frequency only, so heave and velocity
are about their mean: the level about which the craft heaves.
"""
import numpy as np
from scipy import fft
from scipy.signal import lfilter

GRAVITY = 9.80665
"""m/s^2."""

BAND_HZ = (0.04, 1.5)
"""Of heave and vertical velocity: slower motion drowns in the drift of twice integrated noise."""

EDGE = 30.0
"""s at either end of a stretch where its zero-phase integrals are not yet what a longer stretch would give."""

HEAVE, VELOCITY, ACCELERATION = 2, 1, 0
"""How often the vertical acceleration is integrated."""

_LEAKS = ((4.0,), (12.0,), (4.0, 6.0))
"""s; time constants of the leaky integrals, one after another."""


def vertical_direction(roll, pitch):
    """The world's vertical in the craft's axes: the third row of its rotation matrix.

    Parameters
    ----------
    roll, pitch : float or ndarray
        rad.

    Returns
    -------
    ndarray, shape (..., 3)
    """
    roll, pitch = np.broadcast_arrays(roll, pitch)
    return np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)], axis=-1)


def vertical_acceleration(roll, pitch, specific_force):
    """Acceleration along the world's vertical, upwards, without gravity.

    Parameters
    ----------
    roll, pitch : float or ndarray
        rad.
    specific_force : ndarray, shape (..., 3)
        In the craft's axes, m/s^2.

    Returns
    -------
    ndarray
        m/s^2.
    """
    return np.sum(vertical_direction(roll, pitch) * specific_force, axis=-1) - GRAVITY


def zero_phase_integral(signal, step, times, delay=0.0):
    """Integrated so many times over `BAND_HZ`, with no phase error: it looks both ways, so it is for the past only.

    Parameters
    ----------
    signal : ndarray, shape (N,)
        At even steps; finite.
    step : float
        s.
    times : int
        Negative: differentiated.
    delay : float
        s by which the signal lags behind the motion.

    Returns
    -------
    ndarray, shape (N,)
        Right from `EDGE` on and up to `EDGE` before the end.
    """
    size = fft.next_fast_len(signal.size, real=True)
    frequency = fft.rfftfreq(size, step)
    inside = (frequency >= BAND_HZ[0]) & (frequency <= BAND_HZ[1])
    s = 2j * np.pi * frequency[inside]
    spectrum = np.zeros(frequency.size, dtype=complex)
    spectrum[inside] = fft.rfft(signal - signal.mean(), size)[inside] * np.exp(s * delay) / s**times
    return fft.irfft(spectrum, size)[:signal.size]


class LeakyIntegrals:
    """Causal integrals of the vertical acceleration that forget: what is known now of velocity and heave.

    Parameters
    ----------
    step : float
        s between rows.
    """

    COUNT = len(_LEAKS)

    def __init__(self, step):
        self._step = step
        self._kept = [[np.exp(-step / constant) for constant in chain] for chain in _LEAKS]
        self.restart()

    def restart(self):
        """From rest."""
        self._states = [[0.0] * len(chain) for chain in _LEAKS]

    def take(self, acceleration):
        """One row more.

        Parameters
        ----------
        acceleration : float
            m/s^2; NaN is held to be zero.
        """
        new = acceleration if acceleration == acceleration else 0.0
        for kept, states in zip(self._kept, self._states, strict=True):
            value = new
            for place, factor in enumerate(kept):
                value = states[place] = factor * states[place] + self._step * value

    @property
    def values(self):
        """Shape (3,): m/s, m/s and m."""
        return np.array([states[-1] for states in self._states])

    def of(self, acceleration):
        """The integrals of a whole stretch from rest, shape (N, 3).

        Parameters
        ----------
        acceleration : ndarray, shape (N,)
        """
        columns = []
        for kept in self._kept:
            value = acceleration
            for factor in kept:
                value = lfilter([self._step], [1.0, -factor], value)
            columns.append(value)
        return np.stack(columns, axis=1)
