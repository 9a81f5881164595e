"""SDF for gz-sim (Garden and later): the Hydrodynamics and Thruster plugins.

The plugin's forces are ``sum (xU + xUabsV |v| + xUV v) u`` and ``xDotU dU/dt``, derivatives with Fossen's signs
(damping negative). Its Coriolis forces of added mass are switched off: the equations of `manoeuvring.hull.terms`
have them in Xvr, Yur and Nuv.

The plugin applies its added mass by the acceleration of the step before, which diverges where added mass outgrows mass.
Such a craft has it in the link's ``fluid_added_mass``, which DART integrates with the mass, and DART's own Coriolis
forces of it are taken off the plugin's derivatives.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.signal import find_peaks

from swath_sysid.attitude.hull.craft_simulator import release_angle
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import RESTORING_NAMES
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.formats.export import expressible
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.thrust import thrust_curve

ADDED_MASS = {'Xu_dot': 'xDotU', 'Yv_dot': 'yDotV', 'Yr_dot': 'yDotR', 'Nv_dot': 'nDotV', 'Nr_dot': 'nDotR'}
FLUID_ADDED_MASS = {'Xu_dot': 'xx', 'Yv_dot': 'yy', 'Yr_dot': 'yr', 'Nr_dot': 'rr'}
ELEMENTS = {
    **ADDED_MASS,
    'Xu': 'xU',
    'Xuu': 'xUabsU',
    'Xvr': 'xVR',
    'Xvv': 'xVV',
    'Xrr': 'xRR',
    'Yv': 'yV',
    'Yvv': 'yVabsV',
    'Yr': 'yR',
    'Yur': 'yUR',
    'Yuv': 'yVabsU',
    'Yvr': 'yVabsR',
    'Nr': 'nR',
    'Nrr': 'nRabsR',
    'Nur': 'nRabsU',
    'Nvr': 'nRabsV',
    'Nv': 'nV',
    'Nuv': 'nUV',
}
EXPRESSIBLE = {*ELEMENTS, 'x_G'}
AXES = {'roll': ('k', 'P', 'ixx'), 'pitch': ('m', 'Q', 'iyy')}
EXPRESSED_TERMS = ('b1', 'b2', 'r1')
CRESTS = 3  #: Compared crests after the release.


def gazebo(model: ManoeuvringModel) -> expressible.Export:
    """A manoeuvring model as SDF of the plugins Hydrodynamics and Thruster of gz-sim, Garden or later.

    Args:
        model: As identified.

    Returns:
        The text, and advice on what gz-sim cannot express, with how far standard tests differ because of it.

    Example:
        >>> export = gazebo(read_manoeuvring_model('wamv.yaml').model)
        >>> 'gz::sim::systems::Hydrodynamics' in export.text
        True
    """
    advice = expressible.losses(model, EXPRESSIBLE, "gz-sim's Hydrodynamics")
    # what a centre of gravity ahead of the frame adds has the form of added mass with its Coriolis forces
    moment = model['m'] * model['x_G']
    model = model.with_values(
        x_G=0.0, Yr_dot=model['Yr_dot'] - moment, Nv_dot=model['Nv_dot'] - moment, Xrr=model['Xrr'] + moment
    )
    within_link = expressible.added_mass_diverges(model) and model['Yr_dot'] == model['Nv_dot']
    advice += () if within_link else expressible.added_mass_advice(model)
    reduced, _ = expressible.expressed(model, ELEMENTS)
    derivatives = {element: reduced[name] for name, element in ELEMENTS.items()} | {'nUR': -moment}
    inertial = {'mass': model['m']}
    if within_link:
        inertial['fluid_added_mass'] = {element: -model[name] for name, element in FLUID_ADDED_MASS.items()}
        derivatives = _without_coriolis_of_the_link(derivatives)
    lever = expressible.effective_lever(model)
    notes = [
        'Surge, sway and yaw of an identified craft for gz-sim Garden or later, body x forward, y port, z up.',
        'Merge link inertia and plugins into your model; buoyancy keeps heave, roll and pitch. ixx and iyy are not',
        'known: put your own. The frame of base_link and its centre of mass are to lie at the origin of the model:',
        'what a centre of gravity ahead of it (x_G) does is in the derivatives.',
        *(['Added mass is within the link: use DART, the default physics.'] if within_link else []),
        f'The joints port_joint and starboard_joint turn propellers about x at y = {lever:.6g} m and {-lever:.6g} m;',
        'send forces to /model/NAME/joint/port_joint/cmd_thrust and .../starboard_joint/cmd_thrust. propeller_diameter',
        'and thrust_coefficient set only how fast the propellers are seen to turn: put your own.',
        *expressible.force_lines(model),
        *(f'WARNING {a.message}' for a in advice),
    ]
    thrusters = [_thruster(reduced, f'{side}_joint', share) for side, share in (('port', -1.0), ('starboard', 1.0))]
    text = _sdf(
        model.name or 'craft',
        notes,
        inertial,
        {'izz': model['Iz']},
        [_hydrodynamics(derivatives, model.current), *thrusters],
    )
    return expressible.Export(text, advice)


def _without_coriolis_of_the_link(derivatives: Mapping[str, float]) -> dict[str, float]:
    """Derivatives of the plugin with added mass in the link, for which DART adds ``-C_A(nu) nu`` itself (Fossen 2021,
    3.3).
    """
    x, y, cross = derivatives['xDotU'], derivatives['yDotV'], derivatives['yDotR']
    return {name: value for name, value in derivatives.items() if name not in ADDED_MASS.values()} | {
        'xVR': derivatives['xVR'] + y,
        'xRR': derivatives['xRR'] + cross,
        'yUR': derivatives['yUR'] - x,
        'nUV': derivatives['nUV'] + x - y,
        'nUR': derivatives['nUR'] - cross,
    }


def _hydrodynamics(derivatives: Mapping[str, float], current: tuple[float, float] = (0.0, 0.0)) -> str:
    """The plugin; zeros, its default, are left out."""
    values: dict[str, Any] = {'link_name': 'base_link', 'disable_coriolis': 'true'}
    values |= {name: value for name, value in derivatives.items() if value}
    if any(current):
        values['default_current'] = f'{current[0]:.6g} {current[1]:.6g} 0'
    return _plugin('gz-sim-hydrodynamics-system', 'gz::sim::systems::Hydrodynamics', values)


def _thruster(model: ManoeuvringModel, joint: str, side: float) -> str:
    """The plugin with velocity control: its PID control would roll the craft by the torque of the propeller."""
    limits = thrust_curve(np.array([model.largest_input, -model.largest_input]), model.values)
    most, least = (1.0 - model['deduction']) * (1.0 + side * model['balance']) * limits
    return _plugin(
        'gz-sim-thruster-system',
        'gz::sim::systems::Thruster',
        {'joint_name': joint, 'velocity_control': 'true', 'max_thrust_cmd': most, 'min_thrust_cmd': least},
    )


def _plugin(file: str, name: str, values: Mapping[str, Any]) -> str:
    return f'    <plugin filename="{file}" name="{name}">\n{expressible.elements(values, 6)}\n    </plugin>'


def _sdf(
    name: str, notes: Iterable[str], inertial: Mapping[str, Any], moments: dict[str, float], plugins: Iterable[str]
) -> str:
    """SDF of one link; unknown moments of inertia are set to the largest known one, which SDF accepts."""
    all_moments = dict.fromkeys(('ixx', 'iyy', 'izz'), max(moments.values())) | moments
    products = dict.fromkeys(('ixy', 'ixz', 'iyz'), 0.0)
    link = expressible.elements({**inertial, 'inertia': all_moments | products}, 8)
    head = f'<?xml version="1.0"?>\n{expressible.xml_comment(notes)}'
    body = '\n'.join(plugins)
    return (
        f'{head}\n<sdf version="1.10">\n  <model name={quoteattr(name)}>\n'
        f'    <link name="base_link">\n      <inertial>\n{link}\n      </inertial>\n    </link>\n{body}\n'
        '  </model>\n</sdf>\n'
    )


def gazebo_attitude(models: Mapping[str, IdentifiedModel], inertias: Mapping[str, float]) -> expressible.Export:
    """SDF of roll and pitch damping of decay models by axis, with their inertias, added inertia included, kg m^2."""
    derivatives: dict[str, float] = {}
    moments, notes, advice = {}, [], []
    for axis, identified in models.items():
        model, inertia = identified.model, inertia_of(axis, inertias)
        moment, rate, diagonal = AXES[axis]
        derivatives |= {
            f'{moment}{rate}': -inertia * model.terms.get('b1', 0.0),
            f'{moment}{rate}abs{rate}': -inertia * model.terms.get('b2', 0.0),
        }
        moments[diagonal] = inertia
        restoring = ', '.join(f'{n} {inertia * v:.6g}' for n, v in model.terms.items() if n in RESTORING_NAMES)
        notes.append(
            f'{axis}: restoring moment over x = angle - {model.trim:.6g} rad, N m: {restoring} '
            '(r1 x + r2 x^2 + r3 x^3 + s1 sin x + s2 sin^2 x)'
        )
        advice += _attitude_losses(axis, identified, inertia)
    notes = [
        'Roll and pitch damping of an identified craft for gz-sim Garden or later.',
        'Merge link inertia and plugin into your model, mass too. The inertias hold the added inertia; those of',
        'axes without a model are placeholders.',
        *notes,
        *(f'WARNING {a.message}' for a in advice),
    ]
    return expressible.Export(_sdf('craft', notes, {}, moments, [_hydrodynamics(derivatives)]), tuple(advice))


def inertia_of(axis: str, inertias: Mapping[str, float]) -> float:
    """Inertia of an axis, kg m^2; InputError without one."""
    if axis not in inertias:
        raise InputError(
            f'a decay shows only ratios to the inertia: give the inertia of {axis} in kg m^2, with added inertia',
            'no-inertia',
        )
    return inertias[axis]


def gazebo_decay(model: DecayModel) -> DecayModel:
    """A decay model limited to gz-sim's terms: linear and quadratic damping, and linear restoring by buoyancy."""
    kept = {name: model.terms.get(name, 0.0) for name in EXPRESSED_TERMS} | {'r1': model.natural_frequency**2}
    return DecayModel.of(model.trim, model.friction_rate, model.axis, **kept)


def _attitude_losses(axis: str, identified: IdentifiedModel, inertia: float) -> list[Advice]:
    """Advice on restoring, which the shape of the hull must provide, and on a decay without unsupported terms."""
    model = identified.model
    if not np.isfinite(model.natural_frequency):
        return [Advice.of('restoring-not-exported: unstable', axis=axis)]
    found = [
        Advice.of(
            'restoring-not-exported',
            axis=axis,
            stiffness=inertia * model.natural_frequency**2,
            natural_period=model.natural_period,
        )
    ]
    dropped = {name: value for name, value in model.terms.items() if value and name not in EXPRESSED_TERMS}
    if dropped:
        largest = identified.amplitude_range[1]
        angle = largest if 0.0 < largest < float('inf') else release_angle(model)
        whole, part = crest(model, angle), crest(gazebo_decay(model), angle)
        named = ', '.join(f'{n} = {v:.4g}' for n, v in dropped.items())
        found.append(
            Advice.of(
                'terms-dropped: decay',
                axis=axis,
                named=named,
                angle=math.degrees(angle),
                crests=CRESTS,
                time=expressible.change('time_s', whole[0], part[0]),
                height=expressible.change('height_deg', math.degrees(whole[1]), math.degrees(part[1])),
            )
        )
    return found


def crest(model: DecayModel, angle: float) -> tuple[float, float]:
    """Time, s, and height above trim, rad, of the last compared crest of a decay from rest; NaN without one."""
    time = np.linspace(0.0, 2.0 * CRESTS * model.natural_period, 4001)
    motion = simulate(model, model.trim + angle, 0.0, time)[0] - model.trim
    places = find_peaks(motion)[0]
    if places.size < CRESTS:
        return float('nan'), float('nan')
    return float(time[places[CRESTS - 1]]), float(motion[places[CRESTS - 1]])
