"""Terms that an export format supports, and the effect of the others on standard tests."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.standard_tests import run_test
from swath_sysid.manoeuvring.hull.terms import NAMES, PARAMETERS, SENSOR, THRUST

INERTIAL = ('m', 'Iz')
#: Of the thrusters, applied by the sender of forces in N.
SENDERS = tuple(p.name for p in PARAMETERS if p.kind == THRUST and p.name not in ('advance', 'lag', 'delay'))

COMPARED = {
    'turning-circle': ('approach_speed_m_s', 'steady_diameter_m', 'tactical_diameter_m', 'steady_yaw_rate_deg_s'),
    'zigzag': ('first_overshoot_deg', 'period_s'),
}


#: Terms that are others times the speed ahead: the first times the speed, the second times its square.
SUBSTITUTES = {'Xuuu': ('Xuu', 'Xu'), 'Nuur': ('Nur', 'Nr'), 'Nur': ('Nr',), 'Yuv': ('Yv',)}


@dataclass(frozen=True)
class Export:
    """Text of a file, and warnings about missing terms."""

    text: str
    advice: tuple[Advice, ...]


def expressed(
    model: ManoeuvringModel, expressible: Collection[str], **implied: float
) -> tuple[ManoeuvringModel, tuple[str, ...]]:
    """The model with hull terms limited to the ``expressible`` ones and with ``implied`` values, and the names of the
    changed terms. A term with a power of the speed ahead is replaced by a supported one with a lower power, for the
    same force at the approach speed of the turning circle.
    """
    kept = {*expressible, *INERTIAL, *SENDERS}
    neutral = {p.name: p.neutral for p in PARAMETERS if p.kind != SENSOR and p.name not in kept}
    reduced = model.with_values(**neutral | implied)
    changed = tuple(name for name in NAMES if reduced[name] != model[name])
    replaced = {
        name: next((power, other) for power, other in enumerate(others, start=1) if other in kept)
        for name, others in SUBSTITUTES.items()
        if name in changed and kept.intersection(others)
    }
    if replaced:
        speed = approach_speed(model)
        for name, (power, other) in replaced.items():
            reduced = reduced.with_values(**{other: reduced[other] + model[name] * speed**power})
    return reduced, changed


def approach_speed(model: ManoeuvringModel) -> float:
    """Speed ahead at which terms are replaced, m/s."""
    return float(run_test('turning-circle', model).numbers['approach_speed_m_s'])


def losses(model: ManoeuvringModel, expressible: Collection[str], target: str, **implied: float) -> tuple[Advice, ...]:
    """Advice on the terms that an export changes, with standard tests of the craft before and after."""
    reduced, changed = expressed(model, expressible, **implied)
    if not changed:
        return ()
    named = ', '.join(
        f'{name} = {model[name]:.4g}' + (f' (there {reduced[name]:.4g})' if name in implied else '') for name in changed
    )
    substitutes = [
        f'{name} = {reduced[name]:.4g} instead of {model[name]:.4g}'
        for name in NAMES
        if name not in changed and reduced[name] != model[name]
    ]
    instead = f' ({", ".join(substitutes)} stands in at {approach_speed(model):.3g} m/s)' if substitutes else ''
    found = [Advice.of('terms-dropped', target=target, named=named, instead=instead)]
    for test, names in COMPARED.items():
        whole, part = run_test(test, model).numbers, run_test(test, reduced).numbers
        changes = '; '.join(change(name, whole[name], part[name]) for name in names)
        found.append(Advice.of('tests-differ', test=test, changes=changes))
    return tuple(found)


def change(name: str, whole: float, part: float) -> str:
    """A number before and after export, in words."""
    if not (np.isfinite(whole) and np.isfinite(part)):
        return f'{name} {whole:.4g} and {part:.4g}, not reached by both'
    share = f' ({(part - whole) / abs(whole):+.1%})' if whole else ''
    return f'{name} {whole:.4g} and {part:.4g}{share}'


def added_mass_diverges(model: ManoeuvringModel) -> bool:
    """Whether added mass applied with the acceleration of the previous step exceeds the mass of the craft."""
    own = np.diag([model['m'], model['m'], model['Iz']])
    added = np.array(
        [[model['Xu_dot'], 0.0, 0.0], [0.0, model['Yv_dot'], model['Yr_dot']], [0.0, model['Nv_dot'], model['Nr_dot']]]
    )
    return bool(np.max(np.abs(np.linalg.eigvals(np.linalg.solve(own, added)))) >= 1.0)


def added_mass_advice(model: ManoeuvringModel) -> tuple[Advice, ...]:
    """Advice where the plugins' explicit added mass would diverge."""
    return (Advice.of('added-mass-diverges'),) if added_mass_diverges(model) else ()


def force_lines(model: ManoeuvringModel) -> list[str]:
    """Sentences on the forces to send to the thrusters."""
    lines = [
        f'input: {model.thrust_input}, at most {model.largest_input:.6g}; send each thruster the force in N of',
        '(1 - deduction) (1 -+ balance, port - and starboard +) curve(input), with curve(c) = gain full_input',
        '((|c| / full_input - dead_band) / (1 - dead_band))^exponent; astern the force is multiplied by',
        '-reverse_ratio and the exponent by reverse_exponent_ratio',
    ]
    return [*lines, *(f'{name}: {model[name]:.8g}' for name in SENDERS)]


def effective_lever(model: ManoeuvringModel) -> float:
    """Arm of the sent forces, m: deduction acts on the force ahead only, the moment factor on yaw only."""
    return model['lever'] * (1.0 + model['moment_factor']) / (1.0 - model['deduction'])


def xml_comment(lines: Iterable[str]) -> str:
    """Lines as one XML comment; two hyphens in a row are not allowed within."""
    body = '\n'.join(f'  {line}' for line in lines)
    while '--' in body:
        body = body.replace('--', '- -')
    return f'<!--\n{body}\n-->'


def elements(values: Mapping[str, Any], indent: int) -> str:
    """``<name>value</name>`` on each line; nested mappings as nested elements."""
    margin = ' ' * indent
    return '\n'.join(
        f'{margin}<{name}>\n{elements(value, indent + 2)}\n{margin}</{name}>'
        if isinstance(value, dict)
        else f'{margin}<{name}>{escape(_plain(value))}</{name}>'
        for name, value in values.items()
    )


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else f'{value + 0.0:.10g}'
