"""A manoeuvring model: the values of its parameters and their ranges, how its thrusters are driven, and a preset."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.manoeuvring.hull import terms
from swath_sysid.manoeuvring.hull.terms import IZ, NEUTRAL, NR_DOT, NV_DOT, PARAMETERS, X_G, YR_DOT, YV_DOT, M, Numbers
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


LARGEST = 1e12  #: Of any mass, inertia or derivative, SI units; the largest ships approach it.

_RANGES = {
    **dict.fromkeys(('m', 'Iz'), (1e-3, LARGEST)),
    **dict.fromkeys(('gain', 'full_input'), (1e-6, 1e9)),
    **dict.fromkeys(('exponent', 'reverse_exponent_ratio'), (0.1, 10.0)),
    **dict.fromkeys(('lag', 'delay'), (0.0, 60.0)),
    **dict.fromkeys(('deviation_B', 'deviation_C'), (-1.0, 1.0)),
    **dict.fromkeys(('sensor_x', 'sensor_y', 'x_G'), (-1e3, 1e3)),
    'reverse_ratio': (1e-3, 10.0),
    'dead_band': (0.0, 0.95),
    'balance': (-0.99, 0.99),
    'advance': (0.0, 10.0),
    'deduction': (-1.0, 0.99),
    'lever': (1e-3, 1000.0),
    'moment_factor': (-0.99, 10.0),
}

#: Least and largest value of each parameter.
PARAMETER_RANGES = {p.name: _RANGES.get(p.name, (-LARGEST, LARGEST)) for p in PARAMETERS}


def check_physical(model: ManoeuvringModel) -> None:
    """Reject a parameter outside its range, or a mass matrix of sway and yaw that is not positive definite."""
    for name, (lowest, highest) in PARAMETER_RANGES.items():
        if not lowest <= model[name] <= highest:
            raise InputError(
                f'the parameter {name} of {model[name]:g} is outside the range of real craft: it must lie within '
                f'{lowest:g} and {highest:g}'
            )
    p = model.values
    # symmetric part: what the kinetic energy has
    couplings = p[M] * p[X_G] - p[[YR_DOT, NV_DOT]]
    if not (p[M] - p[YV_DOT]) * (p[IZ] - p[NR_DOT]) > max(couplings.mean() ** 2, couplings.prod()):
        raise InputError('the masses of sway and yaw with Yr_dot, Nv_dot and x_G are not positive: reduce these')


WAMV_LENGTH = 4.88  #: m (16 feet).
WAMV_LEVER = 1.027135  #: m, half the distance between the thrusters of the simulated WAM-V 16.


def _wamv(name: str, largest: float, **derivatives: float):
    values = parameter_values(dict(m=180.0, Iz=446.0, lever=WAMV_LEVER, **derivatives))
    return ManoeuvringModel(values, name=name, length=WAMV_LENGTH, largest_input=largest)


#: VRX until 2023 and since; the largest input gives 1.7 and 1.5 m/s.
PRESETS = {
    model.name: model
    for model in (
        _wamv('wamv-vrx-old', 150.0, Xu=-51.3, Xuu=-72.4, Yv=-40.0, Nr=-400.0),
        _wamv('wamv-vrx-new', 250.0, Xu=-100.0, Xuu=-150.0, Yv=-100.0, Yvv=-100.0, Nr=-800.0, Nrr=-800.0),
    )
}


def preset(name: str) -> ManoeuvringModel:
    """The ready-made craft of that name."""
    check_choice(name, PRESETS, 'craft')
    return PRESETS[name]
