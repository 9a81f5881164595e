"""``swath-sysid compare``: fit many equations and choose the simplest adequate one."""

import sys
import time
from argparse import Namespace

from swath_sysid.attitude.hull.catalogue import equation_named, equations_of_axis
from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.identification.identify import identify_problem
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.selection import Comparison, compare
from swath_sysid.attitude.motion.trial import axis_in_words
from swath_sysid.cli import identify
from swath_sysid.cli.progress import print_result, progress_of, show_advice
from swath_sysid.cli.sources import trials_of, write_fit
from swath_sysid.report.fit_figure import fit_figure
from swath_sysid.report.fit_summary import comparison_as_data, warnings_as_data

OF_IDENTIFY = (
    'These are the equations of the catalogue and the one that identify finds without --equation: a general hull, of '
    'which it keeps the terms that the records show.'
)


def run(arguments: Namespace) -> int:
    """Compare, print the ranking, and write what was asked for."""
    began = time.perf_counter()
    settings = identify.settings_of(arguments)
    trials, read_advice, axis = trials_of(arguments)
    problem = prepare([trial.axis(axis) for trial in trials], settings.start, settings.end)
    if arguments.equations is None:
        equations = with_identified(equations_of_axis(axis), identify_problem(problem, settings).model.equation)
    else:
        # a comma may be within a composition, which has a bar
        names = arguments.equations.split(';' if '|' in arguments.equations else ',')
        equations = tuple(equation_named(name.strip()) for name in names if name.strip())
    with progress_of('compare') as progress:
        found = compare(
            problem,
            equations,
            settings,
            jobs=arguments.jobs,
            progress=lambda done, name: progress(done / len(equations), name),
        )
    choice = found.choice.identification
    written = write_fit(arguments, choice, fit_figure, identify.is_to_be_written(arguments, choice.verdict.level))
    show_advice(choice.advice)
    if arguments.json:
        data = comparison_as_data(found, time.perf_counter() - began)
        advice = (*read_advice, *choice.advice, *choice.verdict.warnings)
        print_result(True, {**data, **warnings_as_data(advice)}, ())
    else:
        if not arguments.quiet:
            _print_ranking(found)
        lines = [OF_IDENTIFY] if arguments.equations is None else []
        said = f'The fit of {axis_in_words(axis, trials[0].installation)} is {choice.verdict}'
        print_result(False, {}, [*lines, *written], [f'Choice: {found.reason}', said])
    return identify.exit_code_of(arguments, choice.verdict.level)


def with_identified(equations: tuple[Equation, ...], identified: Equation) -> tuple[Equation, ...]:
    """Equations, and the one that `identify` finds where none has its terms."""
    is_listed = any(each.terms == identified.terms for each in equations)
    return equations if is_listed else (*equations, identified)


def _print_ranking(comparison: Comparison) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    scores = 'R2', 'objective', 'criterion', 'held-out error'
    table = Table(*map(escape, ('equation', 'terms', *scores, 'period [s]', 'damping ratio', 'verdict')))
    best = comparison.ranked[0].criterion
    for ranked in comparison.ranked:
        fit = ranked.identification
        table.add_row(
            ranked.name,
            ' '.join(fit.model.equation.terms),
            f'{fit.r2:.6f}',
            f'{fit.objective_value:.6g}',
            f'+{ranked.criterion - best:.1f}',
            f'{ranked.held_out:.4f}',
            f'{fit.model.natural_period:.4f}',
            f'{fit.damping_ratio:.4f}',
            fit.verdict.level,
            style='bold' if ranked is comparison.choice else None,
        )
    Console(file=sys.stdout, width=None if sys.stdout.isatty() else 120).print(table)
