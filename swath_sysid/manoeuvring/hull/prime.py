"""The prime system: derivatives without dimensions (SNAME 1950).

Units: length L, speed U, mass rho L^3 / 2, thus force rho L^2 U^2 / 2 and moment rho L^3 U^2 / 2.
"""

from dataclasses import dataclass

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.terms import HULL, INDEX, INERTIA, PARAMETERS

SEA_WATER = 1025.0  #: kg/m^3.


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
        length, speed = self.length, self.speed
        mass = 0.5 * self.density * length**3
        if parameter.kind == INERTIA:
            return {'kg': mass, 'kg m': mass * length, 'kg m2': mass * length**2, 'm': length}[parameter.unit]
        load = mass * speed**2 / length * (length if parameter.row == 'N' else 1.0)
        sizes = {'u': speed, 'v': speed, 'r': speed / length}
        for factor in parameter.factors:
            load /= sizes[factor]
        return load

    def to_prime(self, name: str, value: float) -> float:
        """Prime value of a dimensional derivative."""
        return value / self.unit(name)

    def from_prime(self, name: str, prime: float) -> float:
        """Dimensional value of a prime derivative."""
        return prime * self.unit(name)
