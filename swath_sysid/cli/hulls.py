"""Arguments that name a hull: published, from a model file, or an equation with given ratios."""

from argparse import Namespace

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS, equation_named, hull_named, hull_of_family
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation, check_physical
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.cli.sources import assignment
from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_file import read_model


def hull_of(arguments: Namespace) -> DecayModel:
    """The decay model that the arguments name."""
    if arguments.ratio and (arguments.hull or arguments.model):
        raise InputError('--ratio goes with --equation: a published hull or a model file has its own ratios')
    if arguments.hull is not None:
        return hull_named(arguments.hull).model
    if arguments.model is not None:
        path, axis = arguments.model, arguments.axis
        models = read_model(path)
        if axis is None and len(models) > 1:
            raise InputError(f'{path} holds {" and ".join(models)}: choose one with --axis')
        axis = axis or next(iter(models))
        if axis not in models:
            raise InputError(f'{path} holds no {axis} model, only {", ".join(models)}')
        return models[axis].model
    equation = equation_named(arguments.equation)
    values = dict(assignment(text, 'r1=10.1') for text in arguments.ratio)
    if not values:
        return published_ratios_for(equation, arguments.axis)
    axis = arguments.axis or ('roll' if 'roll' in equation.name else 'pitch')
    missing = [t for t in equation.terms if t not in values]
    if missing:
        raise InputError(f'{equation.name} has terms {", ".join(equation.terms)}: give --ratio {missing[0]}=VALUE too')
    model = DecayModel.from_terms(equation, values, axis=axis)
    check_physical(model)
    return model


def published_ratios_for(equation: Equation, axis: str | None = None) -> DecayModel:
    """An equation with the ratios of the published hull of its family, linear restoring for a sine that it lacks."""
    by_axis = {'roll': 'swath-roll', 'pitch': 'swath-pitch'}
    hull = hull_of_family(equation.name)
    if hull is None:
        hull = PUBLISHED_HULLS[by_axis[axis or ('roll' if 'roll' in equation.name else 'pitch')]]
    model = hull.model
    known = dict(zip(TERM_NAMES, model.ratios.tolist(), strict=True))
    polynomial = {'r1': known['r1'] or known['s1'], 'r2': known['r2'] or known['s2']}
    sine = {'s1': known['s1'] or known['r1'], 's2': known['s2'] or known['r2']}
    known |= sine if not {'r1', 'r2', 'r3'} & set(equation.terms) else polynomial
    values = {t: known[t] for t in equation.terms}
    return DecayModel.from_terms(equation, values, axis=axis or model.axis)
