"""The 18 published decay equations, the published hulls, and equations of our own.

``swath-pitch`` is the nine-equation study of the pitch of a SWATH, ``swath-roll`` that of its roll, ``hydrofoil-pitch``
that of a planing hydrofoil craft, ``swath-usv-pitch`` that of a SWATH-USV, whose equations 2 and 3 are our reading of
"one power, quadratic, cube and sinusoid".
"""

import math
from dataclasses import dataclass

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation, PublishedForm, composed, from_published
from swath_sysid.attitude.hull.terms import DAMPING_TERMS, RESTORING_TERMS, TERMS
from swath_sysid.common.errors import InputError, check_choice

_TERMS = {
    'swath-pitch': [f'{b} {r}' for r in ('r1 r2 r3', 'r1 r2', 'r1') for b in ('b1 b2 b3', 'b1 b2', 'b1')],
    'swath-roll': [f'b1 b2 b3 {r}' for r in ('r1 r2 r3', 'r1', 's1 s2')],
    'hydrofoil-pitch': [f'b1 b2 b3 {r}' for r in ('r1 r2 r3', 's1', 'r1 r3')],
    'swath-usv-pitch': [f'b1 b2 b3 {r}' for r in ('r1 r2 r3', 'r1', 's1 s2')],
}
PUBLISHED_EQUATIONS = {
    f'{study}-{number}': Equation(f'{study}-{number}', tuple(terms.split()))
    for study, equations in _TERMS.items()
    for number, terms in enumerate(equations, 1)
}

OWN_EQUATIONS = {
    equation.name: equation
    for equation in (
        Equation('linear', ('b1', 'r1')),
        Equation('odd-cubic', ('b1', 'b2', 'r1', 'r3')),
        Equation('odd-cubic+friction', ('b0', 'b1', 'b2', 'r1', 'r3')),
    )
}

EQUATIONS = PUBLISHED_EQUATIONS | OWN_EQUATIONS

AUTO = 'auto'  #: In place of a name: the general hull, pruned to the terms that a record shows.
#: Every smooth term; at angles of release a sine cannot be distinguished from these.
GENERAL_HULL = composed([term.name for term in TERMS.values() if term.is_general])

_AXIS_EQUATIONS = {axis: tuple(n for n in PUBLISHED_EQUATIONS if axis in n) for axis in ('pitch', 'roll')}


def equation_named(name: str) -> Equation:
    """The equation of a catalogue name, with ``+friction`` for dry friction, or composed from term names.

    A composition (damping | restoring) is ``b1,b2|r1,r3`` or, in words, ``linear,quadratic|linear,cubic``.
    """
    if name in EQUATIONS:
        return EQUATIONS[name]
    if name.endswith('+friction'):
        return equation_named(name.removesuffix('+friction')).with_friction()
    if name.count('|') == 1:
        damping, restoring = (
            [words.get(term.strip(), term.strip()) for term in side.split(',')]
            for side, words in zip(name.split('|'), (DAMPING_TERMS, RESTORING_TERMS), strict=True)
        )
        return Equation(name, (*damping, *restoring))
    raise InputError(
        f"there is no equation '{name}': choose from {', '.join(EQUATIONS)}, add '+friction' to one, "
        "or compose one as 'damping|restoring', for example 'linear,quadratic|linear,cubic'"
    )


def published_alike(equation: Equation, axis: str) -> tuple[str, ...]:
    """Names of the published equations of an axis that have the terms of an equation of another name."""
    alike = (n for n in _AXIS_EQUATIONS[axis] if EQUATIONS[n].terms == equation.terms)
    return () if equation.name in EQUATIONS else tuple(alike)


def title_of(equation: Equation, axis: str) -> str:
    """Its name, and beside a composition the published equations that have its terms."""
    alike = published_alike(equation, axis)
    return f'{equation.name} (the terms of {" and ".join(alike)})' if alike else equation.name


def equations_of_axis(axis: str) -> tuple[Equation, ...]:
    """The equations compared by default for ``roll`` or ``pitch``, one for each set of terms."""
    distinct: dict[tuple[str, ...], Equation] = {}
    for name in (*OWN_EQUATIONS, *_AXIS_EQUATIONS[axis]):
        distinct.setdefault(EQUATIONS[name].terms, EQUATIONS[name])
    return tuple(distinct.values())


@dataclass(frozen=True)
class PublishedHull:
    """A hull whose coefficients were published."""

    name: str
    axis: str
    description: str
    model: DecayModel  #: The ratios, trim zero.
    form: PublishedForm | None  #: The coefficients as printed, where they were printed in that form.
    objective_value: float  #: As printed: root mean square error of the rate one step ahead, rad/s.

    @property
    def rate_noise(self) -> float:
        """White noise of the rate in that record, rad/s: the printed error is of a difference of two rates."""
        return self.objective_value / math.sqrt(2.0)


def _from_form(
    name: str, axis: str, equation: str, description: str, form: PublishedForm, objective_value: float
) -> PublishedHull:
    model = from_published(EQUATIONS[equation], form, axis)
    return PublishedHull(name, axis, description, model, form, objective_value)


# printed from the cube down: 56.8982143 stands on the cube, 32.953354 on the first power
_HYDROFOIL = {'b1': 8.79129395, 'b2': 0.00850162, 'b3': 0.04839175}
_HYDROFOIL |= {'r1': 32.953354, 'r2': 130.820453, 'r3': 56.8982143}

#: The numbers of a form are I', N, W, x, C1, C2, C3; the last number is the objective's printed value.
PUBLISHED_HULLS = {
    hull.name: hull
    for hull in (
        _from_form(
            'swath-pitch',
            'pitch',
            'swath-pitch-2',
            'SWATH model, L 1.26 m, 30 kg, pitch from 6 deg at design draft; inertia not published, 0.09 assumed',
            PublishedForm(0.09, 0.137953966 / 2, 0.006320314, 0.0, 8.704769096, 1.744499553, 0.910961951),
            0.02319572,
        ),
        _from_form(
            'swath-roll',
            'roll',
            'swath-roll-3',
            'SWATH model, L 1.26 m, 60 kg, roll from 5 deg at design draft',
            PublishedForm(0.080320655, 0.000247681, 0.981940173, 2.615040557, 3.663245158, 0.498282369),
            0.007095983,
        ),
        PublishedHull(
            'hydrofoil-pitch',
            'pitch',
            'planing hydrofoil craft, L 1.50 m, 34.55 kg, pitch from 3 deg at design draft',
            DecayModel.from_terms(EQUATIONS['hydrofoil-pitch-1'], _HYDROFOIL, axis='pitch'),
            None,
            0.019560,
        ),
        _from_form(
            'swath-usv-pitch',
            'pitch',
            'swath-usv-pitch-1',
            'SWATH-USV model, L 1.2 m, 35 kg, pitch from 5 deg at design draft',
            PublishedForm(0.0937801, 0.0950886, 0.0132637, 0.0046185, 0.8210960, 0.0015652, 0.6977489),
            0.009069221,
        ),
    )
}


def hull_named(name: str) -> PublishedHull:
    """A hull whose coefficients were published, by name.

    Args:
        name: ``swath-pitch`` (nine-equation study of the pitch of a SWATH), ``swath-roll`` (roll of a SWATH),
            ``hydrofoil-pitch`` (planing hydrofoil craft) or ``swath-usv-pitch`` (SWATH-USV).

    Returns:
        Its model, the coefficients as printed, and the sensor noise of the study's records.

    Raises:
        InputError: There is no such hull; the sentence lists them.

    Example:
        >>> hull = hull_named('swath-roll')
        >>> hull.axis, round(hull.model.natural_period, 2)
        ('roll', 2.52)
    """
    check_choice(name, PUBLISHED_HULLS, 'hull')
    return PUBLISHED_HULLS[name]


def hull_of_family(equation_name: str) -> PublishedHull | None:
    """The published hull of the study of an equation such as ``swath-roll-3+friction``, or None."""
    return PUBLISHED_HULLS.get(equation_name.removesuffix('+friction').rpartition('-')[0])
