"""SDF for VRX's SimpleHydrodynamics: diagonal added mass, linear and quadratic damping, all positive.

The plugin's forces are ``-xDotU a_x - (xU + xUU |u|) u``. Its acceleration is that of the link in the world, turned
into body axes: ``a_x = du/dt - v r``, ``a_y = dv/dt + u r``. So its added mass brings Xvr = -Xu_dot and Yur = Yv_dot
with it. It computes further Coriolis forces but does not apply them.
"""

from swath_sysid.common.advice import Advice
from swath_sysid.manoeuvring.formats.export import expressible
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel

ELEMENTS = {
    'Xu_dot': 'xDotU',
    'Yv_dot': 'yDotV',
    'Nr_dot': 'nDotR',
    'Xu': 'xU',
    'Xuu': 'xUU',
    'Yv': 'yV',
    'Yvv': 'yVV',
    'Nr': 'nR',
    'Nrr': 'nRR',
}


def vrx(model: ManoeuvringModel) -> expressible.Export:
    """A manoeuvring model as SDF of the plugin SimpleHydrodynamics of VRX.

    Args:
        model: As identified.

    Returns:
        The text, and advice on what the plugin cannot express, with how far standard tests differ because of it.

    Example:
        >>> export = vrx(read_manoeuvring_model('wamv.yaml').model)
        >>> '<xUU>' in export.text
        True
    """
    implied = {'Xvr': -model['Xu_dot'], 'Yur': model['Yv_dot']}
    advice = expressible.losses(model, ELEMENTS, "VRX's SimpleHydrodynamics", **implied)
    advice += expressible.added_mass_advice(model)
    if any(model.current):
        advice += (Advice.of('current-not-exported', east=model.current[0], north=model.current[1]),)
    reduced, _ = expressible.expressed(model, ELEMENTS, **implied)
    lever = expressible.effective_lever(model)
    notes = [
        'Surge, sway and yaw of an identified craft for VRX: put the plugin in place of the one in',
        'wamv_gazebo/urdf/dynamics/wamv_gazebo_dynamics_plugin.xacro, under <gazebo>.',
        f'All links together are to have mass {model["m"]:.10g} kg and izz {model["Iz"]:.10g} kg m2 about their common',
        f'centre, and the thrusters to be at y = {lever:.6g} m and {-lever:.6g} m.',
        'Keep zW, kP, kPP, mQ and mQQ of your craft beside these; without them VRX takes its own defaults.',
        *expressible.force_lines(model),
        *(f'WARNING {a.message}' for a in advice),
    ]
    values = {'link_name': 'wamv/base_link', **{element: -reduced[name] for name, element in ELEMENTS.items()}}
    return expressible.Export(
        f'<?xml version="1.0"?>\n{expressible.xml_comment(notes)}\n'
        '<plugin filename="libSimpleHydrodynamics.so" name="vrx::SimpleHydrodynamics">\n'
        f'{expressible.elements(values, 2)}\n</plugin>\n',
        advice,
    )
