"""Conversion between ratios to inertia and the coefficients as the papers print them.

b1 = 2N/I', b2 = W/I', b3 = x/I', r1 = C3/I' (or Dh/I'), r2 = C2/I', r3 = C1/I',
s1 = C2/I' (or DH/I'), s2 = C1/I' in the sine forms.
"""

from dataclasses import dataclass

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.terms import R1, S1
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.common.errors import InputError


@dataclass(frozen=True)
class PublishedForm:
    """Coefficients as printed: I', N, W, x, C1, C2, C3."""

    inertia: float  #: I', with added inertia, kg m^2 (the papers non-dimensionalise; any unit shared by all).
    linear_damping: float = 0.0  #: N; the linear damping moment is 2 N w.
    quadratic_damping: float = 0.0  #: W.
    cubic_damping: float = 0.0  #: x.
    c1: float = 0.0  #: Restoring: cubic, or sine-squared in sine forms.
    c2: float = 0.0  #: Quadratic, or sine (also printed D H).
    c3: float = 0.0  #: Linear (also printed D h); not in sine forms.
    friction: float = 0.0  #: Dry friction moment, ours; not in any paper.

    def __post_init__(self) -> None:
        if not self.inertia > 0.0:
            raise InputError(f"the inertia I' must be greater than zero, not {self.inertia}")


def _is_sine_form(equation: Equation) -> bool:
    polynomial = {'r1', 'r2', 'r3'} & set(equation.terms)
    sine = {'s1', 's2'} & set(equation.terms)
    if polynomial and sine:
        raise InputError(
            f'equation {equation.name} mixes polynomial and sine restoring: the papers have no form for it, '
            'use the ratios'
        )
    return bool(sine)


def from_published(equation: Equation, form: PublishedForm, axis: str, trim: float = 0.0) -> DecayModel:
    """Decay model of coefficients named as in the publication; the equation says which are read, ``trim`` is in rad."""
    moments = {
        'b0': form.friction,
        'b1': 2.0 * form.linear_damping,
        'b2': form.quadratic_damping,
        'b3': form.cubic_damping,
    }
    if _is_sine_form(equation):
        moments |= {'s1': form.c2, 's2': form.c1}
    else:
        moments |= {'r1': form.c3, 'r2': form.c2, 'r3': form.c1}
    values = {name: moments[name] / form.inertia for name in equation.terms}
    return DecayModel.from_terms(equation, values, trim=trim, axis=axis)


def to_published(model: DecayModel, inertia: float) -> PublishedForm:
    """Coefficients in the published form for a given inertia, kg m^2."""
    sine_form = _is_sine_form(model.equation)
    if not inertia > 0.0:
        raise InputError(f"the inertia I' must be greater than zero, not {inertia}")
    moment = {name: inertia * ratio for name, ratio in model.terms.items()}
    return PublishedForm(
        inertia=inertia,
        linear_damping=moment.get('b1', 0.0) / 2.0,
        quadratic_damping=moment.get('b2', 0.0),
        cubic_damping=moment.get('b3', 0.0),
        c1=moment.get('s2' if sine_form else 'r3', 0.0),
        c2=moment.get('s1' if sine_form else 'r2', 0.0),
        c3=0.0 if sine_form else moment.get('r1', 0.0),
        friction=moment.get('b0', 0.0),
    )


def inertia_from_metacentric_height(model: DecayModel, mass: float, metacentric_height: float) -> float:
    """Inertia with added inertia, kg m^2, from mass, kg, and GM of the axis, m: I' = m g GM / (r1 + s1)."""
    stiffness = model.ratios[R1] + model.ratios[S1]
    if not (mass > 0.0 and metacentric_height > 0.0 and stiffness > 0.0):
        raise InputError('inertia from hydrostatics needs a positive mass, metacentric height and linear restoring')
    return float(mass * STANDARD_GRAVITY * metacentric_height / stiffness)
