"""The nonlinear decay model of one axis: equation and ratios, ranges, curves over amplitude, and its published form.

The undamped orbit of amplitude a lies between c - a and c + a, where the potential energies are equal (with even
restoring terms c is not the trim). By Gauss-Chebyshev quadrature over that orbit

    T = 2 int dx / w(x),   b_eq = oint D(w) dx / oint w dx,   zeta_eq = b_eq / (2 w0(a)),

for harmonic motion b1 + 8/(3 pi) b2 w0 a + 3/4 b3 w0^2 a^2 + 4 b0 / (pi w0 a).
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from swath_sysid.attitude.hull import terms
from swath_sysid.attitude.hull.terms import (
    ANGLE,
    AT,
    DAMPING_NAMES,
    FRICTION_RATE_SHARE,
    LINEAR_RESTORING,
    RATE,
    RESTORING_NAMES,
    SINE,
    TERM_NAMES,
    TERMS,
    UPPER,
    Scales,
    Term,
    damping_moment,
    restoring_energy,
    restoring_moment,
)
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, Value
from swath_sysid.common.errors import InputError, check_choice

DEFAULT_FRICTION_RATE = 0.01  #: rad/s; about 0.6 deg/s, small against the rates of a decay worth fitting.


@dataclass(frozen=True)
class Equation:
    """A choice of terms, by the names of ``TERM_NAMES``."""

    name: str
    terms: tuple[str, ...]

    def __post_init__(self) -> None:
        unknown = [t for t in self.terms if t not in TERM_NAMES]
        if unknown:
            raise InputError(f"equation {self.name}: unknown term '{unknown[0]}': choose from {', '.join(TERM_NAMES)}")
        if not set(self.terms) & set(DAMPING_NAMES) or not set(self.terms) & set(RESTORING_NAMES):
            raise InputError(f'equation {self.name}: name at least one damping and one restoring term')
        object.__setattr__(self, 'terms', tuple(t for t in TERM_NAMES if t in self.terms))

    @property
    def indices(self) -> np.ndarray:
        """Places of the terms in the vector of ratios."""
        return np.array([TERM_NAMES.index(t) for t in self.terms])

    @property
    def active(self) -> tuple[bool, ...]:
        """Flags (9,) in the order of ``TERM_NAMES``."""
        return tuple(name in self.terms for name in TERM_NAMES)

    def complete(self, values: np.ndarray) -> np.ndarray:
        """Ratios (..., 9) of all terms from those (..., n) of the equation's own."""
        ratios = np.zeros((*values.shape[:-1], len(TERM_NAMES)))
        ratios[..., self.indices] = values
        return ratios

    def contains(self, other: 'Equation') -> bool:
        """Whether every term of ``other`` is a term of this equation."""
        return set(other.terms) <= set(self.terms)

    def with_friction(self) -> 'Equation':
        """The same equation with dry friction added."""
        return self if 'b0' in self.terms else Equation(f'{self.name}+friction', ('b0', *self.terms))


def composed(terms: Collection[str]) -> Equation:
    """The equation of some terms, named by them as `equation_named` reads it."""
    sides = ([name for name in side if name in terms] for side in (DAMPING_NAMES, RESTORING_NAMES))
    return Equation('|'.join(','.join(side) for side in sides), tuple(terms))


@dataclass(frozen=True)
class DecayModel:
    """An equation with its ratios: the motion of a hull about one axis."""

    equation: Equation
    ratios: np.ndarray  #: (9,); to inertia, in the order of ``TERM_NAMES``; zero where a term is not in use.
    trim: float = 0.0  #: The angle of rest, rad.
    friction_rate: float = DEFAULT_FRICTION_RATE  #: Rate over which the sign of dry friction is smoothed, rad/s.
    axis: str = 'pitch'  #: ``roll`` or ``pitch``.
    _row: tuple[float, ...] = field(init=False, repr=False, compare=False)
    _active: tuple[bool, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        ratios = np.array(self.ratios, dtype=float)
        if ratios.shape != (len(TERM_NAMES),) or not np.isfinite(ratios).all():
            raise InputError(f'a decay model takes {len(TERM_NAMES)} finite ratios, {", ".join(TERM_NAMES)}')
        active = self.equation.active
        stray = [n for n, a, value in zip(TERM_NAMES, active, ratios, strict=True) if not a and value != 0.0]
        if stray:
            raise InputError(f"equation {self.equation.name} has no term '{stray[0]}': its ratio must be zero")
        if not self.friction_rate > 0.0:
            raise InputError('friction_rate must be greater than zero')
        ratios.flags.writeable = False
        object.__setattr__(self, 'ratios', ratios)
        object.__setattr__(self, '_row', tuple(ratios.tolist()))
        object.__setattr__(self, '_active', active)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DecayModel):
            return NotImplemented
        return (
            self.equation == other.equation
            and np.array_equal(self.ratios, other.ratios)
            and (self.trim, self.friction_rate, self.axis) == (other.trim, other.friction_rate, other.axis)
        )

    @classmethod
    def from_terms(cls, equation: Equation, values: Mapping[str, float], **fields: Any) -> 'DecayModel':
        """A model from the ratios of the equation's own terms, by name; other fields as they are."""
        ratios = np.zeros(len(TERM_NAMES))
        for name, value in values.items():
            check_choice(name, TERM_NAMES, 'ratio')
            ratios[TERM_NAMES.index(name)] = value
        return cls(equation, ratios, **fields)

    @classmethod
    def of(
        cls, trim: float = 0.0, friction_rate: float = DEFAULT_FRICTION_RATE, axis: str = 'pitch', **ratios: float
    ) -> 'DecayModel':
        """A model of the ratios that are named, as in ``DecayModel.of(b1=0.3, r1=9.0, axis='roll')``."""
        return cls.from_terms(composed(ratios), ratios, trim=trim, friction_rate=friction_rate, axis=axis)

    @property
    def terms(self) -> dict[str, float]:
        """Name to ratio of the terms in use."""
        return dict(zip(self.equation.terms, self.ratios[self.equation.indices].tolist(), strict=True))

    def with_trim(self, trim: float) -> 'DecayModel':
        """The same hull at another angle of rest."""
        return replace(self, trim=float(trim))

    def acceleration(self, angle: Value, rate: Value, excitation: Value = 0.0) -> Value:
        """Angular acceleration, rad/s^2, under an exciting moment over inertia, rad/s^2."""
        damping = terms.damping_moment(rate, self._row, self._active, self.friction_rate)
        return excitation - damping - terms.restoring_moment(angle - self.trim, self._row, self._active)

    def jacobian(self, angle: Value, rate: Value) -> tuple[Value, Value]:
        """Derivatives of the acceleration by angle (rad), 1/s^2, and by rate (rad/s), 1/s."""
        return (
            -terms.restoring_slope(angle - self.trim, self._row, self._active),
            -terms.damping_slope(rate, self._row, self._active, self.friction_rate),
        )

    @property
    def natural_frequency(self) -> float:
        """Undamped natural frequency of small motions, rad/s; NaN where upright is unstable."""
        stiffness = terms.restoring_slope(0.0, self._row, self._active)
        return float(np.sqrt(stiffness)) if stiffness > 0.0 else float('nan')

    @property
    def natural_period(self) -> float:
        """Undamped natural period of small motions, s."""
        return 2.0 * np.pi / self.natural_frequency

    @property
    def damping_ratio(self) -> float:
        """Linear damping over critical damping, for small motions and without friction."""
        return self._row[AT.b1] / (2.0 * self.natural_frequency)


PERIODS = 0.05, 1000.0  #: s; small models roll in tenths of a second, the largest ships within a minute.
AMPLITUDES = math.radians(0.05), math.pi  #: rad.
FRICTION_RATES = (1e-6, 100.0)  #: rad/s; of the smoothing of dry friction.

_LARGEST = UPPER * np.max([Scales(a, 2.0 * math.pi / t).ratio_units for a, t in product(AMPLITUDES, PERIODS)], axis=0)
#: Least and largest ratio of each term, from those of a search; b0 and b1 are not negative: damping takes energy.
RATIO_RANGES = {
    term.name: (0.0 if term.base == RATE and term.power < 2 else -largest, largest)
    for term, largest in zip(TERMS.values(), _LARGEST.tolist(), strict=True)
}


def check_physical(model: DecayModel) -> None:
    """Reject a decay model that no floating craft can have."""
    for name, ratio in model.terms.items():
        _check(f'the ratio {name}', ratio, *RATIO_RANGES[name])
    _check('the trim in rad', model.trim, -math.pi, math.pi)
    _check('friction_rate in rad/s', model.friction_rate, *FRICTION_RATES)
    by_angle, by_rate = model.jacobian(model.trim, 0.0)
    stiffest = RATIO_RANGES['b1'][1] + UPPER[AT.b0] / FRICTION_RATE_SHARE * math.sqrt(abs(by_angle))
    _check('the damping at rest, b1 + b0/friction_rate in 1/s,', -by_rate, 0.0, stiffest)
    if by_angle < 0.0:
        period = 2.0 * math.pi / math.sqrt(-by_angle)
        _check('the natural period in s', period, *PERIODS)


def _check(what: str, value: float, lowest: float, highest: float) -> None:
    if not lowest <= value <= highest:
        raise InputError(f'{what} is {value:g}, which no craft has: it must lie within {lowest:g} and {highest:g}')


QUADRATURE_NODES = 96
NEWTON_STEPS = 6  #: Each doubles the correct digits.

_ALL_TERMS = (True,) * len(TERM_NAMES)
#: Of the restoring terms that differ from side to side.
_EVEN = [place for place, term in enumerate(TERMS.values()) if term.base != RATE and term.power % 2 == 0]


@dataclass(frozen=True)
class AmplitudeCurves:
    """What a hull's oscillation looks like at each amplitude."""

    amplitude: np.ndarray  #: (A,); Half the peak-to-peak motion, rad.
    frequency: np.ndarray  #: (A,); undamped natural frequency, rad/s; NaN where there is no closed orbit.
    damping_ratio: np.ndarray  #: (A,); Equivalent linear damping over critical damping.


def amplitude_curves(ratios: np.ndarray, amplitude: np.ndarray, friction_rate: float) -> AmplitudeCurves:
    """Natural frequency and equivalent damping of ratios (9,) at amplitudes (A,) > 0, rad; friction rate in rad/s."""
    ratios = np.asarray(ratios, dtype=float)
    amplitude = np.asarray(amplitude, dtype=float)
    with np.errstate(all='ignore'):
        centre = orbit_centre(ratios, amplitude)
        theta = np.pi * (np.arange(QUADRATURE_NODES) + 0.5) / QUADRATURE_NODES
        x = centre[:, None] + amplitude[:, None] * np.cos(theta)
        height = restoring_energy(centre + amplitude, ratios)[:, None] - restoring_energy(x, ratios)
        rate = np.sqrt(2.0 * height)
        arc = amplitude[:, None] * np.sin(theta)
        period = 2.0 * np.pi * np.mean(arc / rate, axis=1)
        taken = np.mean(damping_moment(rate, ratios, _ALL_TERMS, friction_rate) * arc, axis=1)
        upper, lower = (restoring_energy(centre + side * amplitude, ratios) for side in (1.0, -1.0))
        meets = np.abs(upper - lower) <= 1e-6 * np.abs(upper + lower)
        closed = (np.abs(centre) < amplitude) & (height > 0.0).all(axis=1) & meets
        frequency = np.where(closed, 2.0 * np.pi / period, np.nan)
        damping = taken / np.mean(rate * arc, axis=1)
        return AmplitudeCurves(amplitude, frequency, damping / (2.0 * frequency))


def orbit_centre(ratios: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    """Middle of the undamped orbit of each amplitude (A,), rad from trim, by Newton's method."""
    centre = np.zeros_like(amplitude)
    if not ratios[_EVEN].any():
        return centre
    for _ in range(NEWTON_STEPS):
        upper, lower = centre + amplitude, centre - amplitude
        gap = restoring_energy(upper, ratios) - restoring_energy(lower, ratios)
        slope = restoring_moment(upper, ratios, _ALL_TERMS) - restoring_moment(lower, ratios, _ALL_TERMS)
        centre = centre - np.clip(gap / slope, -0.5 * amplitude, 0.5 * amplitude)
    return centre


@dataclass(frozen=True)
class PublishedForm:
    """Coefficients as printed: I', N, W, x, C1, C2, C3."""

    inertia: float  #: I', with added inertia, kg m^2 (the papers non-dimensionalise; any unit shared by all).
    linear_damping: float = 0.0  #: N; the linear damping moment is 2 N w.
    quadratic_damping: float = 0.0  #: W.
    cubic_damping: float = 0.0  #: x.
    c1: float = 0.0  #: Restoring: cubic, or sine-squared in sine forms.
    c2: float = 0.0  #: Quadratic, or sine (also printed D H).
    c3: float = 0.0  #: Linear (also printed D h); not in sine forms.
    friction: float = 0.0  #: Dry friction moment, ours; not in any paper.

    def __post_init__(self) -> None:
        if not self.inertia > 0.0:
            raise InputError(f"the inertia I' must be greater than zero, not {self.inertia}")


def _published_terms(equation: Equation) -> list[Term]:
    """Rows of an equation's terms, rejected if the papers have no form for it."""
    found = [TERMS[name] for name in equation.terms]
    unknown = [term.name for term in found if not term.published]
    if unknown or {ANGLE, SINE} <= {term.base for term in found}:
        what = f'has the term {unknown[0]}' if unknown else 'mixes polynomial and sine restoring'
        raise InputError(f'equation {equation.name} {what}: the papers have no form for it, use the ratios')
    return found


def from_published(equation: Equation, form: PublishedForm, axis: str, trim: float = 0.0) -> DecayModel:
    """Decay model of coefficients named as in the publication; the equation says which are read, ``trim`` is in rad."""
    found = _published_terms(equation)
    values = {term.name: getattr(form, term.published) / term.factor / form.inertia for term in found}
    return DecayModel.from_terms(equation, values, trim=trim, axis=axis)


def to_published(model: DecayModel, inertia: float) -> PublishedForm:
    """Coefficients in the published form for a given inertia, kg m^2."""
    found = _published_terms(model.equation)
    if not inertia > 0.0:
        raise InputError(f"the inertia I' must be greater than zero, not {inertia}")
    return PublishedForm(inertia, **{t.published: inertia * model.terms[t.name] * t.factor for t in found})


def inertia_from_metacentric_height(model: DecayModel, mass: float, metacentric_height: float) -> float:
    """Inertia with added inertia, kg m^2, from mass, kg, and GM of the axis, m: I' = m g GM / (r1 + s1)."""
    stiffness = sum(model.terms.get(name, 0.0) for name in LINEAR_RESTORING)
    if not (mass > 0.0 and metacentric_height > 0.0 and stiffness > 0.0):
        raise InputError('inertia from hydrostatics needs a positive mass, metacentric height and linear restoring')
    return float(mass * STANDARD_GRAVITY * metacentric_height / stiffness)
