"""Ranges outside of which a decay model is a mistake."""

import math

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.common.errors import InputError

SHORTEST_PERIOD = 0.05
LONGEST_PERIOD = 1000.0  #: s; small models roll in tenths of a second, the largest ships within a minute.

_SMALLEST_AMPLITUDE = math.radians(0.05)
_FASTEST = 2.0 * math.pi / SHORTEST_PERIOD
_SLOWEST = 2.0 * math.pi / LONGEST_PERIOD

LARGEST_DAMPING = 4.0 * _FASTEST  #: 1/s at rest, friction included: twice critical at the shortest period.
FRICTION_RATES = (1e-6, 100.0)  #: rad/s; of the smoothing of dry friction.


def _either_way(size: float) -> tuple[float, float]:
    return -size, size


# a nonlinear term of 12 times the linear restoring moment is more than any hull has, as in the search
#: Least and largest ratio of each term; b0 and b1 are not negative: damping takes energy.
RATIO_RANGES = {
    'b0': (0.0, 0.5 * math.pi * _FASTEST**2),
    'b1': (0.0, LARGEST_DAMPING),
    'b2': _either_way(12.0 / _SMALLEST_AMPLITUDE),
    'b3': _either_way(12.0 / (_SLOWEST * _SMALLEST_AMPLITUDE**2)),
    'r1': _either_way(5.0 * _FASTEST**2),
    'r2': _either_way(3.0 * _FASTEST**2 / _SMALLEST_AMPLITUDE),
    'r3': _either_way(6.0 * (_FASTEST / _SMALLEST_AMPLITUDE) ** 2),
    's1': _either_way(5.0 * _FASTEST**2),
    's2': _either_way(3.0 * _FASTEST**2 / _SMALLEST_AMPLITUDE),
}


def check_physical(model: DecayModel) -> None:
    """Reject a decay model that no floating craft can have."""
    for name, ratio in model.terms.items():
        _check(f'the ratio {name}', ratio, *RATIO_RANGES[name])
    _check('the trim in rad', model.trim, -math.pi, math.pi)
    _check('friction_rate in rad/s', model.friction_rate, *FRICTION_RATES)
    by_angle, by_rate = model.jacobian(model.trim, 0.0)
    _check('the damping at rest, b1 + b0/friction_rate in 1/s,', -by_rate, 0.0, LARGEST_DAMPING)
    if by_angle < 0.0:
        period = 2.0 * math.pi / math.sqrt(-by_angle)
        _check('the natural period in s', period, SHORTEST_PERIOD, LONGEST_PERIOD)


def _check(what: str, value: float, lowest: float, highest: float) -> None:
    if not lowest <= value <= highest:
        raise InputError(f'{what} is {value:g}, which no craft has: it must lie within {lowest:g} and {highest:g}')
