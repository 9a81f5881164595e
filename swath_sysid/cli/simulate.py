"""``swath-sysid simulate``: a trial with known truth."""

import math
from argparse import Namespace
from pathlib import Path

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS, equation_named, hull_named, hull_of_family
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation, check_physical
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.cli.progress import print_result
from swath_sysid.cli.sources import assignment
from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_file import read_model
from swath_sysid.formats.outputs import Output, check_outputs

NO_NOISE = SensorNoise(0.0, 0.0, 0.0)


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


def run(arguments: Namespace) -> int:
    """Write the trial."""
    # a folder may be named after a number, as in run.5
    is_file = Path(arguments.output).suffix[1:].isalpha()
    endings = ('csv', 'mcap', 'db3') if is_file else ()
    check_outputs([Output('--output', arguments.output, is_recording=True, endings=endings)], [arguments.model])
    model = hull_of(arguments).with_trim(math.radians(arguments.trim_deg))
    studied = hull_named(arguments.hull) if arguments.hull else hull_of_family(arguments.equation or '')
    usual = SensorNoise.rate if studied is None else studied.rate_noise
    rate_noise = usual if arguments.rate_noise is None else arguments.rate_noise
    noise = SensorNoise(arguments.angle_noise, rate_noise, arguments.accel_noise)
    trial = simulated_trial(
        model,
        math.radians(arguments.initial_angle_deg),
        arguments.duration,
        arguments.rate,
        NO_NOISE if arguments.noise == 'none' else noise,
        arguments.seed,
        arguments.hold,
    )
    if arguments.output.endswith('.csv'):
        from swath_sysid.formats.csv_trials import write_csv as write
    else:
        from swath_sysid.formats.bags import write_imu_bag as write
    write(arguments.output, trial)
    ratios = ', '.join(f'{name} {value:.6g}' for name, value in model.terms.items())
    print_result(
        arguments.json,
        {
            'file': arguments.output,
            'samples': trial.time.size,
            'axis': model.axis,
            'equation': model.equation.name,
            'ratios': model.terms,
        },
        [f'{arguments.output}: {trial.time.size} samples of {model.axis}, {model.equation.name}, true ratios {ratios}'],
    )
    return 0
