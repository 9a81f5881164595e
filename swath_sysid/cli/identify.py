"""``swath-sysid identify``: from decay records, or a record in waves, to a hull model."""

import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence

from swath_sysid.attitude.hull.catalogue import AUTO
from swath_sysid.attitude.identification.at_sea import identify_at_sea
from swath_sysid.attitude.identification.fit_quality import REJECTED, Verdict
from swath_sysid.attitude.identification.identify import IdentificationSettings, identify_problem
from swath_sysid.attitude.identification.problem import Problem, decays_or_waves, prepare
from swath_sysid.attitude.identification.sea_motion import heave_of
from swath_sysid.attitude.identification.search import PRESETS, SearchSettings
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.cli.progress import add_json_argument, print_result, progress_of, show_advice
from swath_sysid.cli.settings_flags import add_setting
from swath_sysid.cli.sources import EXIT_POOR_FIT, add_source_arguments, motions_of, trials_of, write_fit
from swath_sysid.cli.tank_arguments import add_tank_arguments, particulars_of, type_b_of
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import finite_or_none
from swath_sysid.report.at_sea_figure import at_sea_figure
from swath_sysid.report.extinction_tables import tank_tables
from swath_sysid.report.fit_figure import fit_figure
from swath_sysid.report.fit_summary import at_sea_as_data, at_sea_in_words, fit_as_data, fit_in_words, warnings_as_data
from swath_sysid.report.tables import table_as_data, table_in_words


def add_arguments(parser: ArgumentParser) -> None:
    """Records, model, search, output."""
    add_source_arguments(parser)
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument(
        '--at-sea',
        action='store_true',
        help='treat the record as motion in waves, and identify natural period and equivalent linear damping (default: '
        'if it has no free decay and oscillates from start to end)',
    )
    kind.add_argument(
        '--decay',
        action='store_true',
        help='do not look for motion in waves: a record without a free decay is an error',
    )
    parser.add_argument(
        '--equation',
        metavar='NAME',
        help="a published equation or a composition like b1,b2|r1,r3, either with +friction; 'auto' (the default): one "
        'general hull, with dry friction where angle or rate was not measured, pruned to the terms for which the '
        'records give evidence',
    )
    add_search_arguments(parser)
    add_tank_arguments(parser)
    parser.add_argument('--output', metavar='MODEL.yaml', help='write the model file')
    parser.add_argument('--plot', metavar='FILE.png', help='write the picture of the fit')
    add_force_argument(parser)


def add_force_argument(parser: ArgumentParser) -> None:
    """``--force``, and what the exit codes mean; shared with compare."""
    parser.add_argument('--force', action='store_true', help='write the model even if the fit is rejected')
    parser.epilog = (
        'Exit code 0: done; 1: the fit was printed but rejected, so no model was written (--force writes it); 2: the '
        'input cannot be used, and one sentence says why.'
    )


def add_search_arguments(parser: ArgumentParser) -> None:
    """Objective and search; shared with compare."""
    for name in ('objective', 'search', 'generations', 'population', 'seed'):
        add_setting(parser, f'--{name}', 'identifier', name)
    parser.add_argument('--preset', choices=tuple(PRESETS), help='search settings and ranges of a paper')
    add_json_argument(parser)


def settings_of(arguments: Namespace, equation: str = AUTO) -> IdentificationSettings:
    """Identification settings of the command line."""
    search = SearchSettings(
        arguments.search, arguments.preset, arguments.generations or None, arguments.population or None, arguments.seed
    )
    return IdentificationSettings(equation, arguments.objective, search, arguments.start, arguments.end)


def run(arguments: Namespace) -> int:
    """Identify, print, and write what was asked for."""
    began = time.perf_counter()
    particulars, type_b = particulars_of(arguments), type_b_of(arguments)
    settings = settings_of(arguments, AUTO if arguments.equation is None else arguments.equation)
    trials, read_advice, axis = trials_of(arguments)
    problem = _problem_of(arguments, motions_of(trials, axis))
    if problem is None:
        return _run_at_sea(arguments, trials, axis, read_advice, began)
    with progress_of('identify') as progress:
        found = identify_problem(problem, settings, progress=progress)
    inertia = particulars.inertia_of(found.model)
    tables = tank_tables(found, particulars, type_b) if arguments.extinction else []
    written = write_fit(arguments, found, fit_figure, is_to_be_written(arguments, found.verdict))
    # the lines of the result begin with the verdict
    show_advice((*found.advice, *found.verdict.warnings) if arguments.json else found.advice)
    data = fit_as_data(found, time.perf_counter() - began, inertia)
    data |= {table.name: table_as_data(table) for table in tables}
    data |= warnings_as_data((*read_advice, *found.advice, *found.verdict.warnings))
    lines = [*fit_in_words(found, inertia), *(line for t in tables for line in ('', *table_in_words(t))), *written]
    print_result(arguments.json, finite_or_none(data), lines)
    return exit_code_of(arguments, found.verdict)


def is_to_be_written(arguments: Namespace, verdict: Verdict) -> bool:
    """Whether a fit is good enough for a model file, or one was asked for nevertheless; shared with compare."""
    return arguments.force or verdict.level != REJECTED


def exit_code_of(arguments: Namespace, verdict: Verdict) -> int:
    """The exit code, and a word where the model was not written; shared with compare."""
    if is_to_be_written(arguments, verdict):
        return 0
    if arguments.output:
        print(f'{arguments.output} was not written; --force writes it nevertheless', file=sys.stderr)
    return EXIT_POOR_FIT


def _problem_of(arguments: Namespace, motions: Sequence[AxisMotion]) -> Problem | None:
    """The free decays of the records, or None where they are to be taken for motion in waves."""
    if arguments.at_sea:
        return None
    # bounds or an equation imply a decay
    given = (arguments.start, arguments.end, arguments.equation)
    if arguments.decay or given != (None, None, None):
        return prepare(motions, arguments.start, arguments.end)
    return decays_or_waves(motions)


def _run_at_sea(arguments: Namespace, trials: Sequence[Trial], axis: str, read_advice: Sequence[Advice], began: float):
    """Identify from motion in waves, print, and write what was asked for."""
    if len(trials) > 1:
        raise InputError('motion in waves is identified from one record at a time: give one, the longest')
    refused = [name for name in ('equation', 'inertia', 'mass', 'extinction') if getattr(arguments, name)]
    if refused:
        raise InputError(
            f'--{refused[0]} cannot be used with motion in waves, which gives only an equivalent linear hull: leave it '
            'out, or give the record of a free decay'
        )
    with progress_of('identify at sea') as progress:
        found = identify_at_sea(
            trials[0].axis(axis),
            heave_of(trials[0]),
            arguments.start,
            arguments.end,
            searched=not arguments.at_sea,
            progress=progress,
        )
    written = write_fit(arguments, found, at_sea_figure, found.is_usable)
    show_advice(found.advice)
    data = {**at_sea_as_data(found, time.perf_counter() - began), **warnings_as_data((*read_advice, *found.advice))}
    print_result(arguments.json, data, [*at_sea_in_words(found), *written])
    if arguments.output and not found.is_usable:
        raise InputError(
            f'{arguments.output} was not written, as these waves do not determine the hull: record longer, on another '
            'heading or in another sea, or record a free decay in still water'
        )
    return 0
