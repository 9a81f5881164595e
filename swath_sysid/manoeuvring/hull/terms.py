"""The catalogue of manoeuvring parameters, the accelerations they cause, and the prime system (SNAME 1950).

Body axes x forward, y to port, z up: surge u and sway v through the water, m/s, yaw rate r, rad/s,
positive to port. The origin is where the hull is symmetric, the centre of gravity x_G ahead of it, and Iz is about the
origin (Yasukawa and Yoshimura 2015). The derivatives of a laterally symmetric craft are the same numbers in axes with
y to starboard and z down. The sensor's parameters act in `measurement`.

The equations of motion are those of the MMG kind of PAPERS E, with further terms of the same make:

    (m - Xu_dot) du/dt - m (v + x_G r) r                     = X(u, v, r) + X_thrust
    (m - Yv_dot) dv/dt + (m x_G - Yr_dot) dr/dt + m u r      = Y(u, v, r)
    (Iz - Nr_dot) dr/dt + (m x_G - Nv_dot) dv/dt + m x_G u r = N(u, v, r) + N_thrust
    X_thrust = (1 - deduction) (1 - advance u) (T_starboard + T_port)
    N_thrust = (1 + moment_factor) lever (1 - advance u) (T_starboard - T_port)

Units: length L, speed U, mass rho L^3 / 2, thus force rho L^2 U^2 / 2 and moment rho L^3 U^2 / 2.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from swath_sysid.common.accelerator import accelerated
from swath_sysid.common.errors import InputError

Numbers = float | np.ndarray  #: A number, or an array that broadcasts with the other arguments.

INERTIA, DAMPING, CROSS, OFFSET = 'inertia', 'damping', 'cross', 'offset'
THRUST, SENSOR = 'thrust', 'sensor'

HULL = (INERTIA, DAMPING, CROSS, OFFSET)  #: Kinds with prime units.


@dataclass(frozen=True)
class Parameter:
    """One parameter of a manoeuvring model."""

    name: str
    kind: str  #: ``inertia``, ``damping``, ``cross``, ``offset``, ``thrust`` or ``sensor``.
    row: str  #: The equation that it is part of: ``X``, ``Y``, ``N``, or empty for thrust and sensor.
    factors: str  #: Factors u, v, r, or time derivatives U, V, R: ``uu``, ``vr``, ``R``.
    unit: str
    neutral: float  #: Value when unused.
    separated_by: str  #: The manoeuvre that separates it from correlated parameters.


_STEPS = 'thrust steps up and down on a straight course'
_SPEEDS = 'steady straight runs at several speeds, the slowest to the fastest'
_ZIGZAG = 'zig-zags with quick changes of the thrust difference'
_TURNS = 'steady turns at several thrust differences'
_TURNS_AT_SPEEDS = 'turns with the same thrust difference at several speeds'
_REVERSE = 'runs and turns with one and with both thrusters in reverse'
_COMMANDS = 'steady runs at many commands, small ones among them'
_COURSES = 'straight runs on courses all around the compass'

PARAMETERS = (
    Parameter('m', INERTIA, 'X', '', 'kg', 1.0, _STEPS),
    Parameter('Iz', INERTIA, 'N', '', 'kg m2', 1.0, _ZIGZAG),
    Parameter('Xu_dot', INERTIA, 'X', 'U', 'kg', 0.0, _STEPS),
    Parameter('Yv_dot', INERTIA, 'Y', 'V', 'kg', 0.0, _ZIGZAG),
    Parameter('Yr_dot', INERTIA, 'Y', 'R', 'kg m', 0.0, _ZIGZAG),
    Parameter('Nv_dot', INERTIA, 'N', 'V', 'kg m', 0.0, _ZIGZAG),
    Parameter('Nr_dot', INERTIA, 'N', 'R', 'kg m2', 0.0, _ZIGZAG),
    Parameter('x_G', INERTIA, 'N', '', 'm', 0.0, _ZIGZAG),
    Parameter('Xu', DAMPING, 'X', 'u', 'N s/m', 0.0, _SPEEDS),
    Parameter('Xuu', DAMPING, 'X', 'uu', 'N s2/m2', 0.0, _SPEEDS),
    Parameter('Xuuu', DAMPING, 'X', 'uuu', 'N s3/m3', 0.0, _SPEEDS),
    Parameter('Xvr', CROSS, 'X', 'vr', 'kg', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Xvv', CROSS, 'X', 'vv', 'N s2/m2', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Xrr', CROSS, 'X', 'rr', 'N s2', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Yv', DAMPING, 'Y', 'v', 'N s/m', 0.0, _TURNS),
    Parameter('Yvv', DAMPING, 'Y', 'vv', 'N s2/m2', 0.0, _TURNS),
    Parameter('Yvvv', DAMPING, 'Y', 'vvv', 'N s3/m3', 0.0, _TURNS),
    Parameter('Yvr', DAMPING, 'Y', 'vr', 'N s2/m', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Yr', CROSS, 'Y', 'r', 'N s', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Yur', CROSS, 'Y', 'ur', 'kg', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Yuv', CROSS, 'Y', 'uv', 'N s2/m2', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Nr', DAMPING, 'N', 'r', 'N m s', 0.0, _TURNS),
    Parameter('Nrr', DAMPING, 'N', 'rr', 'N m s2', 0.0, _TURNS),
    Parameter('Nrrr', DAMPING, 'N', 'rrr', 'N m s3', 0.0, _TURNS),
    Parameter('Nvr', DAMPING, 'N', 'vr', 'N s2', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Nur', DAMPING, 'N', 'ur', 'N s2', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Nuur', DAMPING, 'N', 'uur', 'N s3/m', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Nv', CROSS, 'N', 'v', 'N s', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Nvvv', CROSS, 'N', 'vvv', 'N s3/m2', 0.0, _TURNS_AT_SPEEDS),
    Parameter('Nuv', CROSS, 'N', 'uv', 'kg', 0.0, _TURNS_AT_SPEEDS),
    Parameter('X0', OFFSET, 'X', '', 'N', 0.0, _SPEEDS),
    Parameter('N0', OFFSET, 'N', '', 'N m', 0.0, 'runs in both directions, to port and to starboard'),
    Parameter('gain', THRUST, '', '', 'N', 1.0, _STEPS),
    Parameter('reverse_ratio', THRUST, '', '', '-', 1.0, _REVERSE),
    Parameter('dead_band', THRUST, '', '', '-', 0.0, _COMMANDS),
    Parameter('exponent', THRUST, '', '', '-', 1.0, _COMMANDS),
    Parameter('balance', THRUST, '', '', '-', 0.0, 'turns with equal thrust differences to port and to starboard'),
    Parameter('advance', THRUST, '', '', 's/m', 0.0, _SPEEDS),
    Parameter('lag', THRUST, '', '', 's', 0.0, _ZIGZAG),
    Parameter('delay', THRUST, '', '', 's', 0.0, _ZIGZAG),
    Parameter('deduction', THRUST, '', '', '-', 0.0, 'a bollard pull test'),
    Parameter('lever', THRUST, '', '', 'm', 1.0, 'measuring it'),
    Parameter('moment_factor', THRUST, '', '', '-', 0.0, 'a bollard pull test'),
    Parameter('full_input', THRUST, '', '', '-', 1.0, 'knowing it'),
    Parameter('reverse_exponent_ratio', THRUST, '', '', '-', 1.0, _REVERSE),
    Parameter('deviation_B', SENSOR, '', '', 'rad', 0.0, _COURSES),
    Parameter('deviation_C', SENSOR, '', '', 'rad', 0.0, _COURSES),
    Parameter('sensor_x', SENSOR, '', '', 'm', 0.0, _TURNS),
    Parameter('sensor_y', SENSOR, '', '', 'm', 0.0, _TURNS),
)
NAMES = tuple(p.name for p in PARAMETERS)
INDEX = {name: i for i, name in enumerate(NAMES)}
NEUTRAL = np.array([p.neutral for p in PARAMETERS])

M, IZ, XU_DOT, YV_DOT, YR_DOT, NV_DOT, NR_DOT, X_G = range(8)
XU, XUU, XUUU, XVR, XVV, XRR = range(8, 14)
YV, YVV, YVVV, YVR, YR, YUR, YUV = range(14, 21)
NR, NRR, NRRR, NVR, NUR, NUUR, NV, NVVV, NUV = range(21, 30)
X0, N0 = range(30, 32)
GAIN, REVERSE_RATIO, DEAD_BAND, EXPONENT, BALANCE, ADVANCE, LAG, DELAY = range(32, 40)
DEDUCTION, LEVER, MOMENT_FACTOR, FULL_INPUT, REVERSE_EXPONENT_RATIO = range(40, 45)
DEVIATION_B, DEVIATION_C, SENSOR_X, SENSOR_Y = range(45, len(NAMES))


@accelerated
def surge_force(u: Numbers, v: Numbers, r: Numbers, p: np.ndarray) -> Numbers:
    """X of the hull, N, with parameters (n, P) or (n,), with a row of which u, v and r broadcast."""
    return (
        p[XU] * u
        + p[XUU] * np.abs(u) * u
        + p[XUUU] * u * u * u
        + p[XVR] * v * r
        + p[XVV] * v * v
        + p[XRR] * r * r
        + p[X0]
    )


@accelerated
def sway_force(u: Numbers, v: Numbers, r: Numbers, p: np.ndarray) -> Numbers:
    """Y of the hull, N; see `surge_force`. Yuv multiplies abs(u) v, so that it damps ahead and astern."""
    return (
        p[YV] * v
        + p[YVV] * np.abs(v) * v
        + p[YVVV] * v * v * v
        + p[YVR] * np.abs(r) * v
        + p[YR] * r
        + p[YUR] * u * r
        + p[YUV] * np.abs(u) * v
    )


@accelerated
def yaw_moment(u: Numbers, v: Numbers, r: Numbers, p: np.ndarray) -> Numbers:
    """N of the hull, N m; see `surge_force`. Nur multiplies abs(u) r and Nvr abs(v) r, so that they always damp."""
    return (
        p[NR] * r
        + p[NRR] * np.abs(r) * r
        + p[NRRR] * r * r * r
        + p[NVR] * np.abs(v) * r
        + p[NUR] * np.abs(u) * r
        + p[NUUR] * u * u * r
        + p[NV] * v
        + p[NVVV] * v * v * v
        + p[NUV] * u * v
        + p[N0]
    )


@accelerated
def accelerations(
    u: Numbers, v: Numbers, r: Numbers, port: Numbers, starboard: Numbers, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """du/dt, dv/dt, dr/dt, m/s^2 and rad/s^2, shape (P,), of P craft with parameters (n, P) under acting thrusts, N."""
    left, moment = 1.0 - p[ADVANCE] * u, p[M] * p[X_G]
    x = surge_force(u, v, r, p) + p[M] * v * r + (1.0 - p[DEDUCTION]) * left * (starboard + port) + moment * r * r
    y = sway_force(u, v, r, p) - p[M] * u * r
    lever = (1.0 + p[MOMENT_FACTOR]) * p[LEVER]
    n = yaw_moment(u, v, r, p) + lever * left * (starboard - port) - moment * u * r
    sway_mass, yaw_inertia = p[M] - p[YV_DOT], p[IZ] - p[NR_DOT]
    sway_by_yaw, yaw_by_sway = moment - p[YR_DOT], moment - p[NV_DOT]
    determinant = sway_mass * yaw_inertia - sway_by_yaw * yaw_by_sway
    return (
        x / (p[M] - p[XU_DOT]),
        (yaw_inertia * y - sway_by_yaw * n) / determinant,
        (sway_mass * n - yaw_by_sway * y) / determinant,
    )


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
