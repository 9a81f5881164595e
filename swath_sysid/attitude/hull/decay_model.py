"""The nonlinear decay model of one axis: an equation (which terms) and its ratios."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from swath_sysid.attitude.hull import terms
from swath_sysid.attitude.hull.terms import DAMPING_TERMS, RESTORING_TERMS, TERM_INDEX, TERM_NAMES
from swath_sysid.attitude.motion.attitude import Value
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
        if not set(self.terms) & set(DAMPING_TERMS.values()) or not set(self.terms) & set(RESTORING_TERMS.values()):
            raise InputError(f'equation {self.name}: name at least one damping and one restoring term')
        object.__setattr__(self, 'terms', tuple(t for t in TERM_NAMES if t in self.terms))

    @property
    def indices(self) -> np.ndarray:
        """Places of the terms in the vector of nine ratios."""
        return np.array([TERM_INDEX[t] for t in self.terms])

    @property
    def active(self) -> tuple[bool, ...]:
        """Nine flags, in the order of ``TERM_NAMES``."""
        return tuple(name in self.terms for name in TERM_NAMES)

    def contains(self, other: 'Equation') -> bool:
        """Whether every term of ``other`` is a term of this equation."""
        return set(other.terms) <= set(self.terms)

    def with_friction(self) -> 'Equation':
        """The same equation with dry friction added."""
        return self if 'b0' in self.terms else Equation(f'{self.name}+friction', ('b0', *self.terms))


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
            ratios[TERM_INDEX[name]] = value
        return cls(equation, ratios, **fields)

    @property
    def terms(self) -> dict[str, float]:
        """Name to ratio of the terms in use."""
        return {name: float(self.ratios[TERM_INDEX[name]]) for name in self.equation.terms}

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
        return self._row[1] / (2.0 * self.natural_frequency)
