"""Fossen's form ``M dnu/dt + C(nu) nu + D(nu) nu = tau`` as a Python module or a MATLAB function, each of its own.

Axes are Fossen's: x forward, y starboard, z down, yaw rate positive to starboard (Fossen 2021, 2.1). Against x forward,
y port, z up the derivatives of a symmetric craft keep their numbers; N0, the lever's sign and pitch change theirs.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from importlib import resources

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.terms import ANGLE, RATE, SINE, TERM_NAMES, TERMS
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.formats.export.expressible import Export, losses
from swath_sysid.manoeuvring.formats.export.gazebo import inertia_of
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.terms import NAMES, PARAMETERS, SENSOR

PYTHON, MATLAB = 'python', 'matlab'
LANGUAGES = (PYTHON, MATLAB)
EXPRESSIBLE = frozenset(NAMES) - {'lag', 'delay'}
UNITS = {p.name: p.unit for p in PARAMETERS}

#: Entries as expressions valid in both languages.
MATRICES = {
    'M': (('m - Xu_dot', '0', '0'), ('0', 'm - Yv_dot', 'm * x_G - Yr_dot'), ('0', 'm * x_G - Nv_dot', 'Iz - Nr_dot')),
    'C': (('0', '0', '-m * (v + x_G * r)'), ('0', '0', 'm * u'), ('m * (v + x_G * r)', '-m * u', '0')),
    'D': (
        ('-Xu - Xuu * abs(u) - Xuuu * u * u', '-Xvv * v', '-Xvr * v - Xrr * r'),
        ('0', '-Yv - Yvv * abs(v) - Yvvv * v * v - Yvr * abs(r) - Yuv * abs(u)', '-Yr - Yur * u'),
        (
            '0',
            '-Nv - Nvvv * v * v - Nuv * u',
            '-Nr - Nrr * abs(r) - Nrrr * r * r - Nvr * abs(v) - Nur * abs(u) - Nuur * u * u',
        ),
    ),
    'tau': (
        ('(1 - deduction) * (1 - advance * u) * (left + right) + X0',),
        ('0',),
        ('(1 + moment_factor) * lever * (1 - advance * u) * (left - right) + N0',),
    ),
}

_PYTHON_AXIS = '''
{axis}_inertia = {inertia}  # kg m2, with added inertia


def {axis}_damping(w):
    """D(w), N m."""
    return {damping}


def {axis}_restoring(angle):
    """G, N m."""
    return {restoring}
'''

_MATLAB_AXIS = """s.{axis}_inertia = {inertia};
s.{axis}_damping = @(w) {damping};
s.{axis}_restoring = @(angle) {restoring};
"""
_BY_LANGUAGE = {PYTHON: (_PYTHON_AXIS, 'np.sin', 'np.tanh'), MATLAB: (_MATLAB_AXIS, 'sin', 'tanh')}


def _python_matrix(rows: Iterable[Sequence[str]]) -> str:
    return 'np.array([\n' + ''.join(f'    [{", ".join(row)}],\n' for row in rows) + '])'


def _matlab_matrix(rows: Iterable[Sequence[str]]) -> str:
    return '[\n' + '\n'.join('    ' + ', '.join(f'({entry})' for entry in row) for row in rows) + '\n]'


def fossen(model: ManoeuvringModel, language: str = PYTHON, function: str = 'craft') -> Export:
    """A manoeuvring model as the matrices M, C and D and the thrust, in Fossen's axes (x forward, y starboard, z down).

    Args:
        model: As identified.
        language: ``python``, a module, or ``matlab``, a function.
        function: Name of the MATLAB function, which is that of its file.

    Returns:
        The text, and advice on what the form cannot express.

    Example:
        >>> export = fossen(read_manoeuvring_model('wamv.yaml').model)
        >>> 'import numpy as np' in export.text
        True
    """
    advice = losses(model, EXPRESSIBLE, "Fossen's form")
    east, north = model.current
    head = [
        'Surge, sway and yaw of an identified craft: nu = (u, v, r), body x forward, y starboard, z down.',
        f'Inputs: {model.thrust_input} of the port and starboard thrusters, at most {model.largest_input:.10g}.',
        f'Current: V_c = {math.hypot(east, north):.6g} m/s, beta_c = {math.atan2(east, north):.6g} rad from north '
        'to east.',
        *(f'WARNING {a.message}' for a in advice),
    ]
    values = {p.name: model[p.name] for p in PARAMETERS if p.kind != SENSOR and p.name in EXPRESSIBLE}
    values['N0'] = 0.0 - model['N0']
    mark, end = ('#', ' ') if language == PYTHON else ('%', ';')
    numbers = '\n'.join(f'{name} = {value!r}{end} {mark} {UNITS[name]}' for name, value in values.items())
    if language == PYTHON:
        rows = {n: _python_matrix(r).replace('\n', '\n' + ' ' * 4 * (n != 'M')) for n, r in MATRICES.items()}
        text = _commented(head, '#') + _template(language).format(numbers=numbers, **rows)
    else:
        rows = {name: _matlab_matrix(entries) for name, entries in MATRICES.items()}
        name = _matlab_name(function)
        text = _template(language).format(function=name, head=_commented(head, '%').rstrip(), numbers=numbers, **rows)
    return Export(text, advice)


def fossen_attitude(
    models: Mapping[str, IdentifiedModel],
    inertias: Mapping[str, float],
    language: str = PYTHON,
    function: str = 'craft',
) -> Export:
    """Inertia, damping and restoring of decay models by axis; see `fossen` and `gazebo_attitude`."""
    head = [
        'Roll and pitch of an identified craft: I dw/dt + D(w) + G(x) = exciting moment, N m.',
        'Body x forward, y starboard, z down: pitch is positive bow up. Angles in rad, rates in rad/s.',
        'Friction is smoothed over a rate, as it was identified.',
    ]
    axis_text, sine, tanh = _BY_LANGUAGE[language]
    parts = []
    for axis, identified in models.items():
        inertia, model = inertia_of(axis, inertias), identified.model
        side = -1.0 if axis == 'pitch' else 1.0
        moments = dict(zip(TERM_NAMES, (inertia * model.ratios).tolist(), strict=True))
        x = f'(angle - {side * float(model.trim)!r})'
        parts.append(
            axis_text.format(
                axis=axis,
                inertia=repr(inertia),
                damping=f'{moments["b0"]!r} * {tanh}(w / {model.friction_rate!r}) + {_powers(RATE, "w", moments)}',
                restoring=f'{_powers(ANGLE, x, moments, side)} + {_powers(SINE, sine + x, moments, side)}',
            )
        )
    if language == PYTHON:
        return Export(_commented(head, '#') + 'import numpy as np\n' + ''.join(parts), ())
    what = '% s holds inertia, kg m2, and handles of damping and restoring, N m, of each axis.\n'
    first = f'function s = {_matlab_name(function)}()\n{_commented(head, "%")}{what}'
    return Export(first + ''.join(parts) + 'end\n', ())


def _powers(base: int, variable: str, moments: Mapping[str, float], side: float = 1.0) -> str:
    """Sum of the moments of a base's powers; restoring of even powers changes its sign with the side."""
    size, total = f'abs({variable})' if base == RATE else variable, []
    for term in TERMS.values():
        if term.base == base and term.power > 0:
            even = 1 - term.power % 2
            factors = [repr(side**even * moments[term.name]), *[size] * even, *[variable] * (term.power - 1 - even)]
            total.append(' * '.join(factors))
    return f'({" + ".join(total)}) * {variable}'


def _template(language: str) -> str:
    return resources.files(__package__).joinpath(f'fossen_{language}.txt').read_text(encoding='utf-8')


def _commented(lines: Iterable[str], mark: str) -> str:
    return ''.join(f'{mark} {line}\n' for line in lines)


def _matlab_name(name: str) -> str:
    if not (name.isascii() and name.isidentifier() and name[0] != '_'):
        raise InputError(
            f"MATLAB allows no function name '{name}', which is that of the file: begin its name with "
            'a letter, then letters, digits and underscores',
            'no-function-name',
        )
    return name
