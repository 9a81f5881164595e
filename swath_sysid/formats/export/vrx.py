"""SDF for VRX's SimpleHydrodynamics: diagonal added mass, linear and quadratic damping, all positive.

The plugin's forces are ``-xDotU dU/dt - (xU + xUU |u|) u``; it computes Coriolis forces but does not apply them.
"""
from swath_sysid.common.advice import Advice
from swath_sysid.formats.export.expressible import (
    Export,
    added_mass_advice,
    effective_lever,
    elements,
    force_lines,
    losses,
    xml_comment,
)

ELEMENTS = {
    'Xu_dot': 'xDotU', 'Yv_dot': 'yDotV', 'Nr_dot': 'nDotR',
    'Xu': 'xU', 'Xuu': 'xUU', 'Yv': 'yV', 'Yvv': 'yVV', 'Nr': 'nR', 'Nrr': 'nRR',
}  # fmt: skip


def vrx(model):
    """The plugin's SDF for a manoeuvring model, as an `Export`."""
    advice = (*losses(model, ELEMENTS, "VRX's SimpleHydrodynamics"), *added_mass_advice(model))
    if any(model.current):
        advice += (Advice('current-not-exported', "VRX's SimpleHydrodynamics knows no current: that of the model, "
                          f'{model.current[0]:.3g} m/s east and {model.current[1]:.3g} m/s north, is left out'),)
    lever = effective_lever(model)
    notes = [
        f'Surge, sway and yaw of an identified craft for VRX. Set mass {model["m"]:.10g} kg and izz {model["Iz"]:.10g}',
        f'kg m2 in the inertial of the link, and the thrusters at y = {lever:.6g} m and {-lever:.6g} m.',
        'Keep zDotW, kDotP, mDotQ, zW, kP and mQ of your craft beside these; without them VRX takes its own defaults.',
        *force_lines(model), *(f'WARNING {a.message}' for a in advice),
    ]  # fmt: skip
    values = {'link_name': 'wamv/base_link', **{element: -model[name] for name, element in ELEMENTS.items()}}
    return Export(
        f'<?xml version="1.0"?>\n{xml_comment(notes)}\n'
        '<plugin filename="libSimpleHydrodynamics.so" name="vrx::SimpleHydrodynamics">\n'
        f'{elements(values, 2)}\n</plugin>\n', advice)  # fmt: skip
