"""Natural units, ranges and regularisation of the parameters."""

import math
from dataclasses import dataclass

import numpy as np

from swath_sysid.manoeuvring.hull import terms
from swath_sysid.manoeuvring.hull.model import PARAMETER_RANGES
from swath_sysid.manoeuvring.motion.polarity import USUAL_DEVIATION

RESPONSE = 3.0  #: s, time within which a craft responds to its thrusters.
SWAY_SHARE = 0.3  #: Sway in natural units, as a share of the speed.

#: By parameter or kind: range, and standard deviation of the regularisation, in natural units. No craft gains energy
#: from its motion, is lighter than half its mass, or is without linear damping. Xu_dot also takes up a wrong thrust
#: scale, which is reported.
_RANGES = {
    **dict.fromkeys(('m', 'Iz', 'gain'), (0.01, 100.0, np.inf)),
    'Xu_dot': (-5.0, 0.6, 1.0),
    'Yv_dot': (-2.0, 0.3, 1.0),
    'Nr_dot': (-3.0, 0.6, 1.0),
    **dict.fromkeys(('Xu', 'Yv', 'Nr'), (-50.0, -0.01, 10.0)),
    terms.INERTIA: (-0.5, 0.5, 0.2),
    terms.DAMPING: (-50.0, 0.0, 10.0),
    **dict.fromkeys((terms.CROSS, terms.OFFSET), (-50.0, 50.0, 10.0)),
}

#: The same regularisation of thrusters and sensors, but in their own units.
_SPREADS = {
    **dict.fromkeys(('exponent', 'reverse_ratio'), 0.7),
    **dict.fromkeys(('balance', 'dead_band', 'reverse_exponent_ratio'), 0.3),
    **dict.fromkeys(('deviation_B', 'deviation_C'), USUAL_DEVIATION),
}


@dataclass(frozen=True)
class UnitScales:
    """Largest motion and mass of a craft."""

    speed: float  #: m/s.
    yaw_rate: float  #: rad/s.
    mass: float  #: kg.
    inertia: float  #: kg m^2.

    def unit(self, name: str) -> float:
        """The size of a parameter that is one in natural units."""
        parameter = terms.PARAMETERS[terms.INDEX[name]]
        if name == 'gain':
            return self.mass * self.speed / RESPONSE
        if name == 'advance':
            return 1.0 / self.speed
        if name.startswith('deviation'):
            return 0.1
        if parameter.kind in (terms.THRUST, terms.SENSOR):
            return 1.0
        motion = {'u': self.speed, 'v': SWAY_SHARE * self.speed, 'r': self.yaw_rate}
        return terms.unit_of(parameter, self.mass, math.sqrt(self.inertia / self.mass), motion, RESPONSE)

    def limits(self, name: str) -> tuple[float, float, float]:
        """Range of a parameter, and standard deviation of its regularisation; infinite for none."""
        kind = terms.PARAMETERS[terms.INDEX[name]].kind
        if name not in _RANGES and kind not in _RANGES:
            low, high = PARAMETER_RANGES[name]
            return low, min(high, 0.6 / self.speed) if name == 'advance' else high, _SPREADS.get(name, 2.0)
        unit = self.unit(name)
        low, high, spread = _RANGES.get(name) or _RANGES[kind]
        return low * unit, high * unit, spread * unit
