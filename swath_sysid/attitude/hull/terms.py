"""The table of the terms of a decay model, as ratios to inertia. With x = angle - trim and w = d(angle)/dt

    dw/dt = -(b0 sign w + b1 w + b2 |w| w + b3 w^3) - (r1 x + r2 x^2 + r3 x^3 + s1 sin x + s2 sin^2 x) + d

A free decay determines ratios only. A term is a row of ``TERMS`` and its lines in the two kernels of its side, a moment
and its slope; all else follows from the row. Each kernel takes floats or arrays: filter and search share it.

A ratio times the moment of its term at amplitude a and rate w0 a, over w0^2 a, is of order one for any craft.
Search, refinement and the ranges in the table use these numbers.
"""

import math
from collections import namedtuple
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from swath_sysid.attitude.motion.attitude import Value

RATE, ANGLE, SINE = range(3)  #: What a power is of: the rate, the angle from trim or its sine.


class Term(NamedTuple):
    """A row of the table."""

    name: str  #: Of the ratio.
    word: str  #: Its name among the terms of its side.
    base: int  #: ``RATE``, which makes it damping, ``ANGLE`` or ``SINE``.
    power: int  #: Of the base; that of a rate has the rate's sign.
    unit: str  #: Of the ratio.
    range: tuple[float, float]  #: Of the dimensionless ratio in a search. No upper limit is meant to bind.
    is_general: bool = False  #: A term of the general hull, and looked for where a named equation lacks it.
    published: str = ''  #: Field of the published form; empty: no paper has the term.
    symbol: str = ''  #: The same as printed; empty: no paper has the term.
    factor: float = 1.0  #: Of the published coefficient on ratio times inertia.

    @property
    def time_power(self) -> int:
        """Power of the time unit in the ratio, for Froude scaling."""
        return self.power - 2 if self.base == RATE else -2


TERMS = {
    term.name: term
    for term in (
        Term('b0', 'friction', RATE, 0, 'rad/s^2', (0.0, 0.5), False, 'friction'),
        Term('b1', 'linear', RATE, 1, '1/s', (0.0, 4.0), True, 'linear_damping', 'N', 0.5),
        Term('b2', 'quadratic', RATE, 2, '1/rad', (0.0, 12.0), True, 'quadratic_damping', 'W'),
        Term('b3', 'cubic', RATE, 3, 's/rad^2', (0.0, 12.0), True, 'cubic_damping', 'x'),
        Term('r1', 'linear', ANGLE, 1, '1/s^2', (0.0, 5.0), True, 'c3', 'C3'),
        Term('r2', 'quadratic', ANGLE, 2, '1/(rad s^2)', (-3.0, 3.0), True, 'c2', 'C2'),
        Term('r3', 'cubic', ANGLE, 3, '1/(rad^2 s^2)', (-3.0, 6.0), True, 'c1', 'C1'),
        Term('s1', 'sine', SINE, 1, 'rad/s^2', (0.0, 5.0), False, 'c2', 'C2'),
        Term('s2', 'sine-squared', SINE, 2, 'rad/s^2', (-3.0, 3.0), False, 'c1', 'C1'),
    )
}
TERM_NAMES = tuple(TERMS)
DAMPING_TERMS = {term.word: term.name for term in TERMS.values() if term.base == RATE}
RESTORING_TERMS = {term.word: term.name for term in TERMS.values() if term.base != RATE}
DAMPING_NAMES, RESTORING_NAMES = tuple(DAMPING_TERMS.values()), tuple(RESTORING_TERMS.values())
LINEAR_RESTORING = tuple(name for name in RESTORING_NAMES if TERMS[name].power == 1)
RATIO_UNITS = {term.name: term.unit for term in TERMS.values()}
LOWER, UPPER = np.array([term.range for term in TERMS.values()]).T  #: (9,) each; of the dimensionless ratios.

#: Places of the terms by name, as in ``ratios[AT.b2]``, which are constants to the compiler.
AT: Any = namedtuple('At', TERM_NAMES)(*range(len(TERMS)))


_DAMPING = len(DAMPING_NAMES)
_BASES, _POWERS = (tuple(getattr(term, column) for term in TERMS.values()) for column in ('base', 'power'))
#: c of `mean_damping_slopes`.
_SPREADS = tuple(
    (2.0 ** ((p + 1) / 2) * math.gamma(p / 2 + 1) / math.sqrt(math.pi)) ** (2.0 / (p - 1)) if p > 1 else 0.0
    for p in _POWERS[:_DAMPING]
)


def damping_moment(rate: Value, ratios: Value, active: Sequence[bool], friction_rate: float) -> Value:
    """Damping moment over inertia, rad/s^2, of the sign of the rate, a float or (P,), rad/s; ratios (9,) or (9, P).
    Inactive terms are not read, except b1; ``friction_rate``, rad/s, smooths the sign of the dry friction.
    """
    slope = ratios[AT.b1]
    if active[AT.b2]:
        slope = slope + ratios[AT.b2] * abs(rate)
    if active[AT.b3]:
        slope = slope + ratios[AT.b3] * (rate * rate)
    moment = slope * rate
    if active[AT.b0]:
        moment = moment + ratios[AT.b0] * np.tanh(rate / friction_rate)
    return moment


def damping_slope(rate: Value, ratios: Value, active: Sequence[bool], friction_rate: float) -> Value:
    """Derivative of `damping_moment` by the rate, 1/s."""
    slope = ratios[AT.b1] + 0.0 * rate
    if active[AT.b2]:
        slope = slope + 2.0 * ratios[AT.b2] * abs(rate)
    if active[AT.b3]:
        slope = slope + 3.0 * ratios[AT.b3] * (rate * rate)
    if active[AT.b0]:
        tanh = np.tanh(rate / friction_rate)
        slope = slope + ratios[AT.b0] / friction_rate * (1.0 - tanh * tanh)
    return slope


def mean_damping_slopes(rate: float, variance: float) -> np.ndarray:
    """What the spread of a normal rate, rad/s, adds to the mean of each damping term at ratio one, over the mean rate.

    E[|w|^(p-1) w] is near m (m^2 + c v)^((p-1)/2), with the slope at m = 0 of the exact mean (Roberts and Spanos 1990,
    Random Vibration and Statistical Linearization); exact for p = 1 and 3. Dry friction is left as it is.
    """
    added = np.zeros(_DAMPING)
    for k in range(_DAMPING):
        if _POWERS[k] > 1:
            half = 0.5 * (_POWERS[k] - 1)
            added[k] = (rate * rate + _SPREADS[k] * variance) ** half - abs(rate) ** (_POWERS[k] - 1)
    return added


def restoring_moment(x: Value, ratios: Value, active: Sequence[bool]) -> Value:
    """Restoring moment over inertia, rad/s^2, at ``x`` rad from trim; see `damping_moment`; r1 is always read."""
    slope = ratios[AT.r1]
    if active[AT.r3]:
        slope = slope + ratios[AT.r3] * (x * x)
    if active[AT.r2]:
        slope = slope + ratios[AT.r2] * x
    moment = slope * x
    if active[AT.s1] or active[AT.s2]:
        sine = np.sin(x)
        moment = moment + ratios[AT.s1] * sine
        if active[AT.s2]:
            moment = moment + ratios[AT.s2] * (sine * sine)
    return moment


def restoring_slope(x: Value, ratios: Value, active: Sequence[bool]) -> Value:
    """Derivative of `restoring_moment` by the angle, 1/s^2."""
    slope = ratios[AT.r1] + 0.0 * x
    if active[AT.r2]:
        slope = slope + 2.0 * ratios[AT.r2] * x
    if active[AT.r3]:
        slope = slope + 3.0 * ratios[AT.r3] * (x * x)
    if active[AT.s1]:
        slope = slope + ratios[AT.s1] * np.cos(x)
    if active[AT.s2]:
        slope = slope + ratios[AT.s2] * np.sin(2.0 * x)
    return slope


def restoring_energy(x: Value, ratios: Value) -> Value:
    """Integral of `restoring_moment` from trim to ``x``, rad^2/s^2; all terms."""
    powers = [(k, term.power + 1) for k, term in enumerate(TERMS.values()) if term.base == ANGLE]
    total = sum(ratios[k] * x**power / power for k, power in powers)
    return total + ratios[AT.s1] * (1.0 - np.cos(x)) + ratios[AT.s2] * (x / 2 - np.sin(2 * x) / 4)


def term_moments(x: Value, rate: Value, friction_rate: float) -> np.ndarray:
    """Moment over inertia of each term at ratio one, (9, N), so that ``acceleration = -ratios @ term_moments``."""
    bases = rate, x, np.sin(x)
    moments = np.array([bases[_BASES[k]] ** _POWERS[k] for k in range(len(_POWERS))])
    for k in range(_DAMPING):
        moments[k] = np.copysign(moments[k], rate)
    moments[AT.b0] = np.tanh(rate / friction_rate)
    return moments


#: Dry friction is smoothed over this share of the greatest rate, narrow enough not to bias the loss of the last swings.
FRICTION_RATE_SHARE = 0.005


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
    def friction_rate(self) -> float:
        """Over which dry friction is smoothed, rad/s."""
        return FRICTION_RATE_SHARE * self.rate

    @property
    def ratio_units(self) -> np.ndarray:
        """The ratio of each term that is one in dimensionless form, shape (9,)."""

        a, w = [self.amplitude], [self.frequency]
        above = [math.prod(w * -term.time_power + a * (1 - term.power)) for term in TERMS.values()]
        below = [math.prod(w * term.time_power + a * (term.power - 1)) for term in TERMS.values()]
        return np.array(above) / np.array(below)
