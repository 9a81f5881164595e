"""SDF for gz-sim (Garden and later): the Hydrodynamics and Thruster plugins.

The plugin's forces are ``sum (xU + xUabsV |v| + xUV v) u`` and ``xDotU dU/dt``, derivatives with Fossen's signs
(damping negative). Its Coriolis forces of added mass are switched off: the equations of `manoeuvring.hull.terms`
have them in Xvr, Yur and Nuv.
"""
import math
from xml.sax.saxutils import quoteattr

import numpy as np

from swath_sysid.attitude.hull.amplitude import amplitude_curves
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.export.expressible import (
    Export,
    added_mass_advice,
    effective_lever,
    elements,
    expressed,
    force_lines,
    losses,
    xml_comment,
)
from swath_sysid.manoeuvring.hull.thrust import thrust_curve

ELEMENTS = {
    'Xu_dot': 'xDotU', 'Yv_dot': 'yDotV', 'Yr_dot': 'yDotR', 'Nv_dot': 'nDotV', 'Nr_dot': 'nDotR',
    'Xu': 'xU', 'Xuu': 'xUabsU', 'Xvr': 'xVR', 'Xvv': 'xVV', 'Xrr': 'xRR',
    'Yv': 'yV', 'Yvv': 'yVabsV', 'Yr': 'yR', 'Yur': 'yUR', 'Yuv': 'yVabsU',
    'Nr': 'nR', 'Nrr': 'nRabsR', 'Nur': 'nRabsU', 'Nv': 'nV', 'Nuv': 'nUV',
}  # fmt: skip
AXES = {'roll': ('k', 'P', 'ixx'), 'pitch': ('m', 'Q', 'iyy')}
EXPRESSED_DAMPING = ('b1', 'b2')
TYPICAL_AMPLITUDE = math.radians(5.0)
"""Of a decay whose file does not say how far it went."""


def gazebo(model):
    """SDF of a manoeuvring model.

    Parameters
    ----------
    model : ManoeuvringModel

    Returns
    -------
    Export
    """
    advice = (*losses(model, ELEMENTS, "gz-sim's Hydrodynamics"), *added_mass_advice(model))
    reduced, _ = expressed(model, ELEMENTS)
    plugin = {'link_name': 'base_link', 'disable_coriolis': 'true'}
    plugin |= {element: reduced[name] for name, element in ELEMENTS.items()}
    plugin['default_current'] = f'{model.current[0]:.6g} {model.current[1]:.6g} 0'
    lever = effective_lever(model)
    notes = [
        'Surge, sway and yaw of an identified craft for gz-sim Garden or later, body x forward, y port, z up.',
        'Merge link inertia and plugins into your model; buoyancy keeps heave, roll and pitch.',
        f'The joints port_joint and starboard_joint turn propellers about x at y = {lever:.6g} m and {-lever:.6g} m.',
        *force_lines(model), *(f'WARNING {a.message}' for a in advice),
    ]  # fmt: skip
    mass, izz = f'<mass>{model["m"]:.10g}</mass>', f'<inertia><izz>{model["Iz"]:.10g}</izz></inertia>'
    inertial = f'      <inertial>{mass}{izz}</inertial>'
    thrusters = [_thruster(reduced, f'{side}_joint', share) for side, share in (('port', -1.0), ('starboard', 1.0))]
    return Export(_sdf(model.name or 'craft', notes, inertial, [_hydrodynamics(plugin), *thrusters]), advice)


def _hydrodynamics(values):
    return ('    <plugin filename="gz-sim-hydrodynamics-system" name="gz::sim::systems::Hydrodynamics">\n'
            f'{elements(values, 6)}\n    </plugin>')  # fmt: skip


def _thruster(model, joint, side):
    limits = thrust_curve(np.array([model.largest_input, -model.largest_input]), model.values)
    most, least = (1.0 - model['deduction']) * (1.0 + side * model['balance']) * limits
    values = {'joint_name': joint, 'max_thrust_cmd': most, 'min_thrust_cmd': least}
    return ('    <plugin filename="gz-sim-thruster-system" name="gz::sim::systems::Thruster">\n'
            f'{elements(values, 6)}\n    </plugin>')  # fmt: skip


def _sdf(name, notes, inertial, plugins):
    body = '\n'.join(plugins)
    return (f'<?xml version="1.0"?>\n{xml_comment(notes)}\n<sdf version="1.9">\n  <model name={quoteattr(name)}>\n'
            f'    <link name="base_link">\n{inertial}\n    </link>\n{body}\n  </model>\n</sdf>\n')  # fmt: skip


def gazebo_attitude(models, inertias):
    """SDF of the roll and pitch damping of decay models.

    Parameters
    ----------
    models : mapping of str to IdentifiedModel
    inertias : mapping of str to float
        Axis to inertia with added inertia, kg m^2.

    Returns
    -------
    Export

    Raises
    ------
    InputError
        An axis has no inertia.
    """
    plugin, moments, notes, advice = {'link_name': 'base_link', 'disable_coriolis': 'true'}, {}, [], []
    for axis, identified in models.items():
        inertia, terms = inertia_of(axis, inertias), identified.model.terms
        moment, rate, diagonal = AXES[axis]
        plugin |= {f'{moment}{rate}': -inertia * terms.get('b1', 0.0),
                   f'{moment}{rate}abs{rate}': -inertia * terms.get('b2', 0.0)}  # fmt: skip
        moments[diagonal] = inertia
        restoring = ', '.join(f'{n} {inertia * v:.6g}' for n, v in terms.items() if n[0] in 'rs')
        notes.append(f'{axis}: restoring moment over x = angle - {identified.model.trim:.6g} rad, N m: {restoring} '
                     '(r1 x + r2 x^2 + r3 x^3 + s1 sin x + s2 sin^2 x)')  # fmt: skip
        advice += [Advice('restoring-not-exported', f'{axis}: gz-sim takes restoring from the Buoyancy plugin and the '
                          'shape of the hull: see that it gives a natural period of '
                          f'{identified.model.natural_period:.4g} s'),
                   *_damping_lost(axis, identified)]  # fmt: skip
    notes = ['Roll and pitch damping of an identified craft for gz-sim Garden or later.',
             'The inertias of the link hold the added inertia.', *notes,
             *(f'WARNING {a.message}' for a in advice)]  # fmt: skip
    inertial = f'      <inertial><inertia>\n{elements(moments, 8)}\n      </inertia></inertial>'
    return Export(_sdf('craft', notes, inertial, [_hydrodynamics(plugin)]), tuple(advice))


def inertia_of(axis, inertias):
    """Inertia of an axis, kg m^2; InputError where there is none."""
    if axis not in inertias:
        raise InputError(f'a decay shows only ratios to the inertia: give --inertia {axis}=KG_M2, added inertia in it')
    return inertias[axis]


def _damping_lost(axis, identified):
    """Advice on friction and cubic damping, with their share of the equivalent linear damping."""
    model = identified.model
    dropped = {n: v for n, v in model.terms.items() if n[0] == 'b' and n not in EXPRESSED_DAMPING and v}
    if not dropped:
        return []
    largest = identified.amplitude_range[1]
    amplitude = np.array([largest if np.isfinite(largest) and largest > 0.0 else TYPICAL_AMPLITUDE])
    kept = model.ratios.copy()
    kept[[0, 3]] = 0.0
    whole, part = (
        float(amplitude_curves(ratios, amplitude, model.friction_rate).damping_ratio[0])
        for ratios in (model.ratios, kept)
    )
    named = ', '.join(f'{n} = {v:.4g}' for n, v in dropped.items())
    return [Advice('terms-dropped', f"{axis}: gz-sim's Hydrodynamics cannot express {named}: at "
                   f'{np.degrees(amplitude[0]):.3g} deg the equivalent damping ratio is {part:.4g} instead of '
                   f'{whole:.4g}')]
