"""Parameters for FMUs: SSV 1.0 (System Structure Parameter Values) of the SSP standard, for co-simulation."""

import re
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import quoteattr

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.formats.export.expressible import Export
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.hull.terms import PARAMETERS

NAMESPACE = 'http://ssp-standard.org/SSP1/'
Row = tuple[str, float, float | None, str]  #: Name, value, standard deviation, unit.

NEWTON = {'kg': 1, 'm': 1, 's': -2}


def ssv(identified: IdentifiedManoeuvringModel) -> Export:
    """Every parameter of a manoeuvring model with unit and standard deviation, as an `Export`."""
    model = identified.model
    std = dict(zip(identified.names, np.sqrt(np.diag(identified.covariance)).tolist(), strict=True))
    rows: list[Row] = [(p.name, model[p.name], std.get(p.name), p.unit) for p in PARAMETERS]
    rows += [
        (f'current_{name}', value, std.get(f'current_{name}'), 'm/s')
        for name, value in zip(('east', 'north'), model.current, strict=True)
    ]
    rows += [('largest_input', model.largest_input, None, '-' if model.thrust_input == 'command' else 'N')]
    return _parameter_set(
        model.name or 'craft',
        'Surge, sway and yaw of an identified craft in SI units; body x '
        f'forward, y port, z up, world x east, y north; inputs: {model.thrust_input}',
        rows,
    )


def ssv_attitude(models: Mapping[str, IdentifiedModel]) -> Export:
    """Every ratio of decay models with unit and standard deviation, as an `Export`; no inertia is needed."""
    rows: list[Row] = []
    for axis, identified in models.items():
        model = identified.model
        rows += [
            (f'{axis}.{name}', value, identified.std[name], RATIO_UNITS[name]) for name, value in model.terms.items()
        ]
        rows += [
            (f'{axis}.trim', model.trim, identified.trim_std, 'rad'),
            (f'{axis}.friction_rate', model.friction_rate, None, 'rad/s'),
        ]
    return _parameter_set(
        'decay',
        'Roll and pitch of an identified craft, ratios to the inertia, roll positive to '
        'starboard, pitch bow down: dw/dt = -(b0 sign w + b1 w + b2 |w| w + b3 w^3) - (r1 x + r2 x^2 '
        '+ r3 x^3 + s1 sin x + s2 sin^2 x), x = angle - trim',
        rows,
    )


def _parameter_set(name: str, description: str, rows: Sequence[Row]) -> Export:
    parameters, units = [], dict.fromkeys(unit for *_, unit in rows)
    for parameter, value, std, unit in rows:
        known = std is not None and np.isfinite(std)
        deviation = f'identified, standard deviation {std:.4g}' if known else 'not identified, or without a deviation'
        parameters.append(
            f'    <ssv:Parameter name={quoteattr(parameter)} description="{deviation}">'
            f'<ssv:Real value="{float(value)!r}" unit={quoteattr(unit)}/></ssv:Parameter>'
        )
    bases = [
        f'    <ssc:Unit name={quoteattr(unit)}><ssc:BaseUnit'
        + ''.join(f' {base}="{power}"' for base, power in _base_units(unit).items())
        + '/></ssc:Unit>'
        for unit in units
    ]
    return Export(
        '\n'.join(
            [
                '<?xml version="1.0" encoding="UTF-8"?>',
                f'<ssv:ParameterSet version="1.0" xmlns:ssv="{NAMESPACE}SystemStructureParameterValues"',
                f'    xmlns:ssc="{NAMESPACE}SystemStructureCommon" name={quoteattr(name)}',
                f'    description={quoteattr(description)}>',
                '  <ssv:Parameters>',
                *parameters,
                '  </ssv:Parameters>',
                '  <ssv:Units>',
                *bases,
                '  </ssv:Units>',
                '</ssv:ParameterSet>',
                '',
            ]
        ),
        (),
    )


def _base_units(unit: str) -> dict[str, int]:
    """Base units to powers of a unit such as ``N s2/m2`` or ``1/(rad s^2)``."""
    powers: dict[str, int] = {}
    above, _, below = unit.partition('/')
    for side, sign in ((above, 1), (below, -1)):
        for symbol, power in re.findall(r'(N|kg|rad|m|s)\^?(\d*)', side):
            for base, exponent in (NEWTON if symbol == 'N' else {symbol: 1}).items():
                powers[base] = powers.get(base, 0) + sign * exponent * int(power or 1)
    return {base: power for base, power in powers.items() if power}
