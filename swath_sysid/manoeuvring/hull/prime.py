"""The prime system: derivatives without dimensions (SNAME 1950).

Units: length L, speed U, mass rho L^3 / 2, thus force rho L^2 U^2 / 2 and moment rho L^3 U^2 / 2.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.terms import HULL, INDEX, INERTIA, PARAMETERS, Parameter

SEA_WATER = 1025.0  #: kg/m^3.


def unit_of(parameter: Parameter, mass: float, radius: float, motion: Mapping[str, float], response: float) -> float:
    """Size of a derivative that is one for a mass, kg, a radius of inertia, m, motions by ``u``, ``v``, ``r``, and a
    time, s, within which the loads change them.
    """
    if parameter.kind == INERTIA:
        return {'kg': mass, 'kg m': mass * radius, 'kg m2': mass * radius**2, 'm': radius}[parameter.unit]
    load = (mass * radius**2 * motion['r'] if parameter.row == 'N' else mass * motion['u']) / response
    for factor in parameter.factors:
        load /= motion[factor]
    return load


@dataclass(frozen=True)
class PrimeUnits:
    """Length, speed and density that make derivatives non-dimensional."""

    length: float  #: Of the hulls, m.
    speed: float  #: m/s.
    density: float = SEA_WATER  #: kg/m^3.

    def __post_init__(self):
        if not (self.length > 0.0 and self.speed > 0.0 and self.density > 0.0):
            raise InputError('length, speed and density of the prime system must be positive: give positive numbers')

    def unit(self, name: str) -> float:
        """Dimensional size of a derivative whose prime value is one."""
        parameter = PARAMETERS[INDEX[name]] if name in INDEX else None
        if parameter is None or parameter.kind not in HULL:
            raise InputError(f"'{name}' is not a derivative of the prime system: give one such as Xuu or Nr")
        motion = {'u': self.speed, 'v': self.speed, 'r': self.speed / self.length}
        return unit_of(parameter, 0.5 * self.density * self.length**3, self.length, motion, self.length / self.speed)

    def to_prime(self, name: str, value: float) -> float:
        """Prime value of a dimensional derivative."""
        return value / self.unit(name)

    def from_prime(self, name: str, prime: float) -> float:
        """Dimensional value of a prime derivative."""
        return prime * self.unit(name)
