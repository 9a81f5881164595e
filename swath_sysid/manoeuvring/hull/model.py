"""A manoeuvring model: the values of its parameters, how its thrusters are driven, and the current."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.manoeuvring.hull import terms
from swath_sysid.manoeuvring.hull.terms import NEUTRAL, Numbers
from swath_sysid.manoeuvring.motion.trial import FORCE, INPUTS

#: Step of numerical derivatives, in the unit: the best of central differences.
DIFFERENCE = float(np.cbrt(np.finfo(float).eps))


@dataclass(frozen=True)
class ManoeuvringModel:
    """A craft in surge, sway and yaw under two thrusters."""

    values: np.ndarray  #: (n,); In the order of `terms.NAMES`; unused parameters have their neutral value.
    thrust_input: str = FORCE  #: Each thruster takes a ``force``, N, or a ``command``, -1 to 1.
    name: str = ''
    length: float = 4.88  #: Of the hulls, m, for the prime system and the standard tests.
    largest_input: float = 1.0  #: Largest thrust (N) or command ahead.
    current: tuple[float, float] = (0.0, 0.0)  #: East and north, m/s.

    def __post_init__(self):
        check_choice(self.thrust_input, INPUTS, 'thrust input')
        values = np.asarray(self.values, dtype=float)
        if values.shape != NEUTRAL.shape or not np.all(np.isfinite(values)):
            raise InputError(
                f'a manoeuvring model needs {len(terms.NAMES)} finite values: give each parameter a number'
            )
        if self['m'] - self['Xu_dot'] <= 0 or self['m'] - self['Yv_dot'] <= 0 or self['Iz'] - self['Nr_dot'] <= 0:
            raise InputError('mass and inertia, added mass included, must be positive: added mass is negative or zero')

    def __getitem__(self, name: str):
        return float(self.values[terms.INDEX[name]])

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the parameters that differ from neutral, in catalogue order."""
        return tuple(n for n, used in zip(terms.NAMES, self.values != NEUTRAL, strict=True) if used)

    def with_values(self, **values: float) -> 'ManoeuvringModel':
        """The model with some parameters changed."""
        return replace(self, values=parameter_values(values, self.values))

    def accelerations(
        self, u: Numbers, v: Numbers, r: Numbers, port: Numbers, starboard: Numbers
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """du/dt, dv/dt, dr/dt under acting thrusts in N; scalars or arrays of shape (P,)."""
        return terms.accelerations(u, v, r, port, starboard, self.values)

    def jacobian(self, u: float, v: float, r: float, port: Numbers = 0.0, starboard: Numbers = 0.0) -> np.ndarray:
        """Derivatives of the accelerations by u, v and r, shape (3, 3), by central differences."""
        return jacobians(self.values[:, None], np.array([[u], [v], [r]]), port, starboard)[0]


def parameter_values(values: Mapping[str, float], base: np.ndarray = NEUTRAL) -> np.ndarray:
    """A full parameter vector, shape (n,), from some values by name."""
    for name in values:
        check_choice(name, terms.NAMES, 'manoeuvring parameter')
    full = np.array(base, dtype=float)
    for name, value in values.items():
        full[terms.INDEX[name]] = value
    return full


def jacobians(p: np.ndarray, states: np.ndarray, port: Numbers = 0.0, starboard: Numbers = 0.0) -> np.ndarray:
    """Derivatives of the accelerations by u, v and r, (C, 3, 3), of craft with parameters (n, C) in states (3, C)."""
    sides = []
    for step in (DIFFERENCE, -DIFFERENCE):
        moved = (states + step * move[:, None] for move in np.eye(3))
        sides.append(np.array([terms.accelerations(u, v, r, port, starboard, p) for u, v, r in moved]))
    return (sides[0] - sides[1]).transpose(2, 1, 0) / (2.0 * DIFFERENCE)
