"""Ranges outside of which a decay model is a mistake."""

import math
from itertools import product

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.scaling import UPPER, Scales
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.common.errors import InputError

PERIODS = 0.05, 1000.0  #: s; small models roll in tenths of a second, the largest ships within a minute.
AMPLITUDES = math.radians(0.05), math.pi  #: rad.
FRICTION_RATES = (1e-6, 100.0)  #: rad/s; of the smoothing of dry friction.

_LARGEST = UPPER * np.max([Scales(a, 2.0 * math.pi / t).ratio_units for a, t in product(AMPLITUDES, PERIODS)], axis=0)
#: Least and largest ratio of each term, from those of a search; b0 and b1 are not negative: damping takes energy.
RATIO_RANGES = {
    name: (0.0 if name in ('b0', 'b1') else -largest, largest)
    for name, largest in zip(TERM_NAMES, _LARGEST.tolist(), strict=True)
}


def check_physical(model: DecayModel) -> None:
    """Reject a decay model that no floating craft can have."""
    for name, ratio in model.terms.items():
        _check(f'the ratio {name}', ratio, *RATIO_RANGES[name])
    _check('the trim in rad', model.trim, -math.pi, math.pi)
    _check('friction_rate in rad/s', model.friction_rate, *FRICTION_RATES)
    by_angle, by_rate = model.jacobian(model.trim, 0.0)
    _check('the damping at rest, b1 + b0/friction_rate in 1/s,', -by_rate, *RATIO_RANGES['b1'])
    if by_angle < 0.0:
        period = 2.0 * math.pi / math.sqrt(-by_angle)
        _check('the natural period in s', period, *PERIODS)


def _check(what: str, value: float, lowest: float, highest: float) -> None:
    if not lowest <= value <= highest:
        raise InputError(f'{what} is {value:g}, which no craft has: it must lie within {lowest:g} and {highest:g}')
