"""The nonlinear decay model of one axis: an equation (which terms) and its ratios."""

from dataclasses import dataclass, field, replace

import numpy as np

from swath_sysid.attitude.hull.terms import (
    DAMPING_TERMS,
    RESTORING_TERMS,
    TERM_INDEX,
    TERM_NAMES,
    damping_moment,
    damping_slope,
    restoring_moment,
    restoring_slope,
)
from swath_sysid.common.errors import InputError

DEFAULT_FRICTION_RATE = 0.01
"""rad/s; about 0.6 deg/s, small against the rates of a decay worth fitting."""


@dataclass(frozen=True)
class Equation:
    """A choice of terms, by the names of ``TERM_NAMES``.

    Raises
    ------
    InputError
        An unknown term, no restoring term, or no damping term.
    """

    name: str
    terms: tuple[str, ...]

    def __post_init__(self):
        unknown = [t for t in self.terms if t not in TERM_NAMES]
        if unknown:
            raise InputError(f"equation {self.name}: unknown term '{unknown[0]}': choose from {', '.join(TERM_NAMES)}")
        if not set(self.terms) & set(DAMPING_TERMS.values()) or not set(self.terms) & set(RESTORING_TERMS.values()):
            raise InputError(f'equation {self.name}: name at least one damping and one restoring term')
        object.__setattr__(self, 'terms', tuple(t for t in TERM_NAMES if t in self.terms))

    @property
    def indices(self):
        """Places of the terms in the vector of nine ratios."""
        return np.array([TERM_INDEX[t] for t in self.terms])

    @property
    def active(self):
        """Tuple of nine bools, in the order of ``TERM_NAMES``."""
        return tuple(name in self.terms for name in TERM_NAMES)

    def contains(self, other):
        """Whether every term of ``other`` is a term of this equation."""
        return set(other.terms) <= set(self.terms)

    def with_friction(self):
        """The same equation with dry friction added."""
        return self if 'b0' in self.terms else Equation(f'{self.name}+friction', ('b0', *self.terms))


@dataclass(frozen=True)
class DecayModel:
    """An equation with its ratios: what is believed of a hull about one axis.

    Attributes
    ----------
    equation : Equation
        The terms in use.
    ratios : ndarray, shape (9,)
        Ratios to inertia in the order of ``TERM_NAMES``; zero where a term is not in use.
    trim : float
        The angle of rest, rad.
    friction_rate : float
        Rate over which the sign of dry friction is smoothed, rad/s.
    axis : str
        ``roll`` or ``pitch``.
    """

    equation: Equation
    ratios: np.ndarray
    trim: float = 0.0
    friction_rate: float = DEFAULT_FRICTION_RATE
    axis: str = 'pitch'
    _row: tuple[float, ...] = field(init=False, repr=False, compare=False)
    _active: tuple[bool, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self):
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

    def __eq__(self, other):
        if not isinstance(other, DecayModel):
            return NotImplemented
        return (
            self.equation == other.equation
            and np.array_equal(self.ratios, other.ratios)
            and (self.trim, self.friction_rate, self.axis) == (other.trim, other.friction_rate, other.axis)
        )

    @classmethod
    def from_terms(cls, equation, values, **fields):
        """Build from the ratios of the equation's own terms, by name."""
        ratios = np.zeros(len(TERM_NAMES))
        for name, value in values.items():
            if name not in TERM_INDEX:
                raise InputError(f"there is no ratio '{name}': choose from {', '.join(TERM_NAMES)}")
            ratios[TERM_INDEX[name]] = value
        return cls(equation, ratios, **fields)

    @property
    def terms(self):
        """Name to ratio of the terms in use."""
        return {name: float(self.ratios[TERM_INDEX[name]]) for name in self.equation.terms}

    def with_trim(self, trim):
        """The same hull at another angle of rest."""
        return replace(self, trim=float(trim))

    def acceleration(self, angle, rate, excitation=0.0):
        """Angular acceleration, rad/s^2.

        Parameters
        ----------
        angle, rate : float or ndarray
            rad and rad/s.
        excitation : float or ndarray
            Exciting moment over inertia, rad/s^2; zero in still water.
        """
        damping = damping_moment(rate, self._row, self._active, self.friction_rate)
        return excitation - damping - restoring_moment(angle - self.trim, self._row, self._active)

    def jacobian(self, angle, rate):
        """Derivatives of the acceleration by angle, 1/s^2, and by rate, 1/s."""
        return (
            -restoring_slope(angle - self.trim, self._row, self._active),
            -damping_slope(rate, self._row, self._active, self.friction_rate),
        )

    @property
    def natural_frequency(self):
        """Undamped natural frequency of small motions, rad/s; NaN where upright is unstable."""
        stiffness = restoring_slope(0.0, self._row, self._active)
        return float(np.sqrt(stiffness)) if stiffness > 0.0 else float('nan')

    @property
    def natural_period(self):
        """Undamped natural period of small motions, s."""
        return 2.0 * np.pi / self.natural_frequency

    @property
    def damping_ratio(self):
        """Linear damping over critical damping, for small motions and without friction."""
        return self._row[1] / (2.0 * self.natural_frequency)
