"""Fossen's form ``M dnu/dt + C(nu) nu + D(nu) nu = tau`` as a Python module of its own, for numpy."""
from swath_sysid.formats.export.expressible import Export, losses
from swath_sysid.formats.export.gazebo import inertia_of
from swath_sysid.manoeuvring.hull.terms import NAMES, PARAMETERS, SENSOR

EXPRESSIBLE = frozenset(NAMES) - {'lag', 'delay'}

_EQUATIONS = '''
M = np.array([
    [m - Xu_dot, 0.0, 0.0],
    [0.0, m - Yv_dot, -Yr_dot],
    [0.0, -Nv_dot, Iz - Nr_dot],
])


def C(nu):
    """Coriolis and centripetal matrix of the rigid body; that of added mass is in Xvr, Yur and Nuv of D."""
    u, v, _ = nu
    return np.array([[0.0, 0.0, -m * v], [0.0, 0.0, m * u], [m * v, -m * u, 0.0]])


def D(nu):
    """Damping matrix."""
    u, v, r = nu
    return -np.array([
        [Xu + Xuu * abs(u) + Xuuu * u**2, Xvv * v, Xvr * v + Xrr * r],
        [0.0, Yv + Yvv * abs(v) + Yvvv * v**2 + Yuv * abs(u), Yr + Yur * u],
        [0.0, Nv + Nvvv * v**2 + Nuv * u, Nr + Nrr * abs(r) + Nrrr * r**2 + Nur * abs(u) + Nuur * u**2],
    ])


def thrust(c):
    """Force of one thruster under an input, N."""
    beyond = max(abs(c) / full_input - dead_band, 0.0) / (1.0 - dead_band)
    if c < 0.0:
        return -reverse_ratio * gain * full_input * beyond ** (exponent * reverse_exponent_ratio)
    return gain * full_input * beyond**exponent


def tau(port, starboard, u):
    """Forces of the thrusters and constant ones, N, N, N m."""
    left, right = (1.0 - balance) * thrust(port), (1.0 + balance) * thrust(starboard)
    slip = 1.0 - advance * u
    return np.array([
        (1.0 - deduction) * slip * (left + right) + X0,
        0.0,
        (1.0 + moment_factor) * lever * slip * (right - left) + N0,
    ])


def acceleration(nu, port, starboard):
    """Derivative of nu = (u, v, r) through the water under inputs."""
    return np.linalg.solve(M, tau(port, starboard, nu[0]) - (C(nu) + D(nu)) @ nu)
'''


def fossen(model):
    """Python text of a manoeuvring model, as an `Export`."""
    advice = losses(model, EXPRESSIBLE, "Fossen's form")
    head = ['"""Surge, sway and yaw of an identified craft: nu = (u, v, r), body x forward, y port, z up.', '',
            f'Inputs: {model.thrust_input}, at most {model.largest_input:.10g}. '
            f'Current {model.current[0]:.6g} m/s east, {model.current[1]:.6g} m/s north.',
            '"""', *(f'# WARNING {a.message}' for a in advice), 'import numpy as np', '']  # fmt: skip
    numbers = [f'{p.name} = {model[p.name]!r}  # {p.unit}' for p in PARAMETERS
               if p.kind != SENSOR and p.name in EXPRESSIBLE]  # fmt: skip
    return Export('\n'.join([*head, *numbers]) + '\n' + _EQUATIONS, advice)


def fossen_attitude(models, inertias):
    """Python text of decay models: inertia, damping and restoring of each axis; see `gazebo_attitude`."""
    parts = ['"""Roll and pitch of an identified craft: I dw/dt + D(w) w + g(x) = exciting moment, N m.',
             '', 'Angles in rad, rates in rad/s. Friction is smoothed over friction_rate as it was identified.',
             '"""', 'import numpy as np']  # fmt: skip
    for axis, identified in models.items():
        inertia, model = inertia_of(axis, inertias), identified.model
        b, r = ([float(inertia * value) for value in values] for values in (model.ratios[:4], model.ratios[4:]))
        parts.append(f'''
{axis}_inertia = {inertia!r}  # kg m2, with added inertia


def {axis}_damping(w):
    """D(w) w, N m."""
    return {b[0]!r} * np.tanh(w / {model.friction_rate!r}) + ({b[1]!r} + {b[2]!r} * abs(w) + {b[3]!r} * w**2) * w


def {axis}_restoring(angle):
    """g, N m."""
    x = angle - {float(model.trim)!r}
    return {r[0]!r} * x + {r[1]!r} * x**2 + {r[2]!r} * x**3 + {r[3]!r} * np.sin(x) + {r[4]!r} * np.sin(x)**2
''')
    return Export('\n'.join(parts), ())
