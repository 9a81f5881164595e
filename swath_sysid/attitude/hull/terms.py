"""The terms of a decay model as ratios to inertia. With x = angle - trim and w = d(angle)/dt

    dw/dt = -(b0 sign w + b1 w + b2 |w| w + b3 w^3) - (r1 x + r2 x^2 + r3 x^3 + s1 sin x + s2 sin^2 x) + d

A free decay determines ratios only. Each formula takes floats or arrays: filter, search and compiled kernel share it.

A ratio times the moment of its term at amplitude a and rate w0 a, over w0^2 a, is of order one for any craft.
Search, refinement and the ranges below use these numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.motion.attitude import Value

DAMPING_TERMS = {'friction': 'b0', 'linear': 'b1', 'quadratic': 'b2', 'cubic': 'b3'}
RESTORING_TERMS = {'linear': 'r1', 'quadratic': 'r2', 'cubic': 'r3', 'sine': 's1', 'sine-squared': 's2'}
DAMPING_NAMES = tuple(DAMPING_TERMS.values())
RESTORING_NAMES = tuple(RESTORING_TERMS.values())
TERM_NAMES = DAMPING_NAMES + RESTORING_NAMES
TERM_INDEX = {name: index for index, name in enumerate(TERM_NAMES)}

_UNITS = 'rad/s^2', '1/s', '1/rad', 's/rad^2', '1/s^2', '1/(rad s^2)', '1/(rad^2 s^2)', 'rad/s^2', 'rad/s^2'
RATIO_UNITS = dict(zip(TERM_NAMES, _UNITS, strict=True))

B0, B1, B2, B3, R1, R2, R3, S1, S2 = range(9)


def damping_moment(rate: Value, ratios: Value, active: Sequence[bool], friction_rate: float) -> Value:
    """Damping moment over inertia, rad/s^2, of the sign of the rate, a float or (P,), rad/s; ratios (9,) or (9, P).

    Inactive terms are not read, except b1; ``friction_rate``, rad/s, smooths the sign of the dry friction.
    """
    slope = ratios[B1]
    if active[B2]:
        slope = slope + ratios[B2] * abs(rate)
    if active[B3]:
        slope = slope + ratios[B3] * (rate * rate)
    moment = slope * rate
    if active[B0]:
        moment = moment + ratios[B0] * np.tanh(rate / friction_rate)
    return moment


def restoring_moment(x: Value, ratios: Value, active: Sequence[bool]) -> Value:
    """Restoring moment over inertia, rad/s^2, at ``x`` rad from trim; see `damping_moment`; r1 is always read."""
    slope = ratios[R1]
    if active[R3]:
        slope = slope + ratios[R3] * (x * x)
    if active[R2]:
        slope = slope + ratios[R2] * x
    moment = slope * x
    if active[S1] or active[S2]:
        sine = np.sin(x)
        moment = moment + ratios[S1] * sine
        if active[S2]:
            moment = moment + ratios[S2] * (sine * sine)
    return moment


def damping_slope(rate: Value, ratios: Value, active: Sequence[bool], friction_rate: float) -> Value:
    """Derivative of `damping_moment` by the rate, 1/s."""
    slope = ratios[B1] + 0.0 * rate
    if active[B2]:
        slope = slope + 2.0 * ratios[B2] * abs(rate)
    if active[B3]:
        slope = slope + 3.0 * ratios[B3] * (rate * rate)
    if active[B0]:
        tanh = np.tanh(rate / friction_rate)
        slope = slope + ratios[B0] / friction_rate * (1.0 - tanh * tanh)
    return slope


def restoring_slope(x: Value, ratios: Value, active: Sequence[bool]) -> Value:
    """Derivative of `restoring_moment` by the angle, 1/s^2."""
    slope = ratios[R1] + 0.0 * x
    if active[R2]:
        slope = slope + 2.0 * ratios[R2] * x
    if active[R3]:
        slope = slope + 3.0 * ratios[R3] * (x * x)
    if active[S1]:
        slope = slope + ratios[S1] * np.cos(x)
    if active[S2]:
        slope = slope + ratios[S2] * np.sin(2.0 * x)
    return slope


def restoring_energy(x: Value, ratios: Value) -> Value:
    """Integral of `restoring_moment` from trim to ``x``, rad^2/s^2; all terms."""
    return (
        ratios[R1] * x**2 / 2
        + ratios[R2] * x**3 / 3
        + ratios[R3] * x**4 / 4
        + ratios[S1] * (1.0 - np.cos(x))
        + ratios[S2] * (x / 2 - np.sin(2 * x) / 4)
    )


def term_moments(x: np.ndarray | float, rate: np.ndarray | float, friction_rate: float) -> np.ndarray:
    """Moment over inertia of each term at ratio one, (9, N), so that ``acceleration = -ratios @ term_moments``."""
    friction, sine = np.tanh(rate / friction_rate), np.sin(x)
    return np.array([friction, rate, np.abs(rate) * rate, rate**3, x, x**2, x**3, sine, sine**2])


_RANGES = {
    'b0': (0.0, 0.5),
    'b1': (0.0, 4.0),
    **dict.fromkeys(('b2', 'b3'), (0.0, 12.0)),
    **dict.fromkeys(('r1', 's1'), (0.0, 5.0)),
    **dict.fromkeys(('r2', 's2'), (-3.0, 3.0)),
    'r3': (-3.0, 6.0),
}
#: Damping is not negative. No upper limit is meant to bind.
LOWER, UPPER = np.array([_RANGES[name] for name in TERM_NAMES]).T


@dataclass(frozen=True)
class Scales:
    """Amplitude and frequency of the records under identification."""

    amplitude: float  #: rad.
    frequency: float  #: rad/s.

    @property
    def rate(self) -> float:
        """Amplitude of the rate, rad/s."""
        return self.amplitude * self.frequency

    @property
    def ratio_units(self) -> np.ndarray:
        """The ratio of each term that is one in dimensionless form, shape (9,)."""
        a, w = self.amplitude, self.frequency
        return np.array([w * w * a, w, 1 / a, 1 / (w * a * a), w * w, w * w / a, w * w / (a * a), w * w, w * w / a])
