"""Ranges that the parameters of every real twin-thruster craft keep within."""

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.terms import IZ, NR_DOT, NV_DOT, PARAMETERS, X_G, YR_DOT, YV_DOT, M

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
