"""``swath-sysid identify``: from decay records, or a record in waves, to a hull model."""

import sys
import time
from argparse import Namespace
from collections.abc import Sequence

from swath_sysid.attitude.hull.catalogue import AUTO
from swath_sysid.attitude.hull.decay_model import DecayModel, inertia_from_metacentric_height
from swath_sysid.attitude.identification.identify import identify_problem
from swath_sysid.attitude.identification.problem import Problem, decays_or_waves, prepare
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.cli.progress import print_result, progress_of, show_advice
from swath_sysid.cli.sources import decays_of_other_axes, read_models, trials_of, write_fit
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import REJECTED
from swath_sysid.common.errors import DONE, PARTLY_DONE, InputError
from swath_sysid.common.wings import offered
from swath_sysid.formats.identify_records import identify_at_sea
from swath_sysid.report.fit_figure import at_sea_figure, fit_figure
from swath_sysid.report.fit_summary import (
    at_sea_as_data,
    at_sea_in_words,
    conclusion_of,
    fit_as_data,
    fit_in_words,
    warnings_as_data,
)
from swath_sysid.report.tables import shortened, table_as_data, table_in_words


def settings_of(arguments: Namespace, equation: str = AUTO) -> IdentificationSettings:
    """Identification settings of the command line."""
    search = SearchSettings(
        arguments.search, arguments.preset, arguments.generations or None, arguments.population or None, arguments.seed
    )
    return IdentificationSettings(equation, arguments.objective, search, arguments.start, arguments.end)


def check_inertia(arguments: Namespace) -> None:
    """Raise `InputError` unless the inertia is given once, or not at all."""
    check_positive(arguments, ('mass', 'metacentric_height', 'inertia'))
    mass, height = arguments.mass is not None, arguments.metacentric_height is not None
    if arguments.inertia is not None and height:
        raise InputError('give --inertia, or --mass with --metacentric-height, not both: each sets the inertia')
    if height and not mass or mass and not height and arguments.inertia is None:
        raise InputError('give both --mass and --metacentric-height, or neither')


def check_positive(arguments: Namespace, names: Sequence[str]) -> None:
    """Raise `InputError` where one of the flags of these names is given and not greater than zero."""
    for name in names:
        value = getattr(arguments, name)
        if value is not None and not value > 0.0:
            raise InputError(f'--{name.replace("_", "-")} must be greater than zero, not {value:g}')


def inertia_of(arguments: Namespace, model: DecayModel) -> float | None:
    """I' as given, or from hydrostatics and the model's stiffness; None where neither is known, kg m^2."""
    if arguments.inertia is not None or arguments.mass is None:
        return arguments.inertia
    return inertia_from_metacentric_height(model, arguments.mass, arguments.metacentric_height)


def run(arguments: Namespace) -> int:
    """Identify, print, and write what was asked for."""
    began = time.perf_counter()
    check_inertia(arguments)
    tables_of = [offer(arguments) for offer in offered('tables_of_fit')]
    settings = settings_of(arguments, AUTO if arguments.equation is None else arguments.equation)
    trials, read_advice, axis = trials_of(arguments)
    problem = _problem_of(arguments, [trial.axis(axis) for trial in trials])
    if problem is None:
        return _run_at_sea(arguments, trials, axis, read_advice, began)
    if arguments.model:
        raise InputError('--model is for motion in waves: leave it out, or add --at-sea')
    others = () if arguments.axis else decays_of_other_axes(trials, problem)
    with progress_of('identify') as progress:
        found = identify_problem(problem, settings, progress=progress)
    inertia = inertia_of(arguments, found.model)
    tables = [table for of in tables_of for table in of(found)]
    written = write_fit(arguments, found, fit_figure, is_to_be_written(arguments, found.verdict.level))
    # the lines of the result begin with the verdict
    shown = (*others, *found.advice)
    show_advice((*shown, *found.verdict.warnings) if arguments.json else shown)
    data = fit_as_data(found, time.perf_counter() - began, inertia)
    data |= {table.name: table_as_data(table) for table in tables}
    data |= warnings_as_data((*read_advice, *shown, *found.verdict.warnings))
    shown_tables = [table if arguments.all else shortened(table) for table in tables]
    lines = [
        *fit_in_words(found, inertia),
        *written,
        *(line for t in shown_tables for line in ('', *table_in_words(t))),
    ]
    print_result(arguments.json, data, lines, conclusion_of(found))
    return exit_code_of(arguments, found.verdict.level)


def is_to_be_written(arguments: Namespace, level: str) -> bool:
    """Whether a verdict's level allows a model file, or one was asked for nevertheless; shared with other verbs."""
    return arguments.force or level != REJECTED


def exit_code_of(arguments: Namespace, level: str) -> int:
    """The exit code, and a word where the model was not written; shared with other verbs."""
    is_poor = not is_to_be_written(arguments, level)
    if is_poor and arguments.output:
        print(f'{arguments.output} was not written; --force writes it nevertheless', file=sys.stderr)
    return PARTLY_DONE if is_poor else DONE


def _problem_of(arguments: Namespace, motions: Sequence[AxisMotion]) -> Problem | None:
    """The free decays of the records, or None where they are to be taken for motion in waves."""
    if arguments.at_sea:
        return None
    # bounds or an equation imply a decay
    given = (arguments.start, arguments.end, arguments.equation)
    if arguments.decay or given != (None, None, None):
        return prepare(motions, arguments.start, arguments.end, arguments.decay)
    return decays_or_waves(motions)


def _run_at_sea(arguments: Namespace, trials: Sequence[Trial], axis: str, read_advice: Sequence[Advice], began: float):
    """Identify from motion in waves, print, and write what was asked for."""
    refused = [name for name in ('equation', 'inertia', 'mass', 'extinction') if getattr(arguments, name, None)]
    if refused:
        raise InputError(
            f'--{refused[0]} cannot be used with motion in waves, which gives only an equivalent linear hull: leave it '
            'out, or give the record of a free decay'
        )
    known = read_models(arguments.model, trials[0]).get(axis) if arguments.model else None
    if arguments.model and known is None:
        raise InputError(f'{arguments.model} has no {axis} model: give one that has, or leave it out')
    with progress_of('identify at sea') as progress:
        used = [trial.between(arguments.start, arguments.end) for trial in trials]
        found = identify_at_sea(used, axis=axis, model=known, progress=progress)
    is_poor = bool(arguments.output) and not (arguments.force or found.is_usable)
    written = write_fit(arguments, found, at_sea_figure, not is_poor)
    show_advice(found.advice)
    data = {**at_sea_as_data(found, time.perf_counter() - began), **warnings_as_data((*read_advice, *found.advice))}
    print_result(arguments.json, data, [*at_sea_in_words(found), *written])
    if is_poor:
        print(
            f'{arguments.output} was not written, as these waves do not determine the hull: record longer, on another '
            'heading or in another sea, or record a free decay in still water; --force writes it nevertheless',
            file=sys.stderr,
        )
    return PARTLY_DONE if is_poor else DONE
