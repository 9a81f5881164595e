"""Natural units, ranges and regularisation of the parameters."""

from dataclasses import dataclass

import numpy as np

from swath_sysid.manoeuvring.hull.terms import CROSS, DAMPING, INDEX, INERTIA, OFFSET, PARAMETERS, SENSOR, THRUST
from swath_sysid.manoeuvring.motion.compass import USUAL_DEVIATION

RESPONSE = 3.0  #: s, time within which a craft responds to its thrusters.
SWAY_SHARE = 0.3  #: Sway in natural units, as a share of the speed.
WIDE = 50.0  #: Largest value of a term in its natural unit.
MIN_DAMPING = 0.01  #: Least linear damping in its natural unit, so that small motions decay.

_RANGES = {
    'reverse_ratio': (0.05, 2.0),
    'dead_band': (0.0, 0.6),
    'exponent': (0.4, 3.0),
    'balance': (-0.5, 0.5),
    'advance': (0.0, 0.5),
    'lag': (0.0, 3.0),
    'delay': (0.0, 2.0),
    'deduction': (0.0, 0.9),
    'lever': (0.01, 100.0),
    'moment_factor': (-0.9, 3.0),
    'reverse_exponent_ratio': (0.5, 2.0),
    'deviation_B': (-0.5, 0.5),
    'deviation_C': (-0.5, 0.5),
    'sensor_x': (-20.0, 20.0),
    'sensor_y': (-20.0, 20.0),
}


#: Range of the added masses as shares of mass and inertia. That of surge also takes up a wrong thrust scale, which is
#: reported.
_ADDED = {'Xu_dot': (-5.0, 0.6), 'Yv_dot': (-2.0, 0.3), 'Nr_dot': (-3.0, 0.6)}


#: Powers of mass and yaw inertia with the dimension of an inertia parameter.
_POWERS = {'kg': (1.0, 0.0), 'kg m': (0.5, 0.5), 'kg m2': (0.0, 1.0), 'm': (-0.5, 0.5)}


@dataclass(frozen=True)
class Scales:
    """Largest motion and mass of a craft."""

    speed: float  #: m/s.
    yaw_rate: float  #: rad/s.
    mass: float  #: kg.
    inertia: float  #: kg m^2.

    def unit(self, name: str) -> float:
        """The size of a parameter that is one in natural units."""
        parameter = PARAMETERS[INDEX[name]]
        if parameter.kind == INERTIA:
            of_mass, of_inertia = _POWERS[parameter.unit]
            return self.mass**of_mass * self.inertia**of_inertia
        if name == 'gain':
            return self.mass * self.speed / RESPONSE
        if name == 'advance':
            return 1.0 / self.speed
        if name.startswith('deviation'):
            return 0.1
        if parameter.kind in (THRUST, SENSOR):
            return 1.0
        load = self.inertia * self.yaw_rate if parameter.row == 'N' else self.mass * self.speed
        load /= RESPONSE
        sizes = {'u': self.speed, 'v': SWAY_SHARE * self.speed, 'r': self.yaw_rate}
        for factor in parameter.factors:
            load /= sizes[factor]
        return load

    def bounds(self, name: str) -> tuple[float, float]:
        """Range of a parameter: no craft gains energy from its motion or is lighter than half its mass."""
        parameter, unit = PARAMETERS[INDEX[name]], self.unit(name)
        if name in ('m', 'Iz', 'gain'):
            return 0.01 * unit, 100.0 * unit
        if name in _ADDED:
            low, high = _ADDED[name]
            return low * unit, high * unit
        if parameter.kind == INERTIA:
            return -0.5 * unit, 0.5 * unit
        if name in ('Xu', 'Yv', 'Nr'):
            return -WIDE * unit, -MIN_DAMPING * unit
        if parameter.kind == DAMPING:
            return -WIDE * unit, 0.0
        if parameter.kind in (CROSS, OFFSET):
            return -WIDE * unit, WIDE * unit
        low, high = _RANGES[name]
        if name == 'advance':
            high = min(high, 0.6 / self.speed)
        return low, high

    def prior(self, name: str) -> float:
        """Standard deviation of the regularisation of a parameter; infinite for none."""
        kind = PARAMETERS[INDEX[name]].kind
        if name in ('m', 'Iz', 'gain'):
            return np.inf
        if kind == INERTIA:
            return self.unit(name) if name in _ADDED else 0.2 * self.unit(name)
        if kind in (THRUST, SENSOR):
            return {
                'exponent': 0.7,
                'balance': 0.3,
                'reverse_ratio': 0.7,
                'dead_band': 0.3,
                'deviation_B': USUAL_DEVIATION,
                'deviation_C': USUAL_DEVIATION,
                'reverse_exponent_ratio': 0.3,
            }.get(name, 2.0)
        return 10.0 * self.unit(name)
