"""``swath-sysid forecast``: how well a record is forecast, beside what a forecast must beat."""

import math
import shlex
import time
from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Column, Table

from swath_sysid.attitude.motion.sensor_checks import refuse_contradictions
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.motion.vertical import even_stretches
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.outlook import ErrorLimit
from swath_sysid.attitude.prediction.point import ATTITUDE, Point
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.cli.main import build_parser
from swath_sysid.cli.progress import print_result, progress_of, show_advice
from swath_sysid.cli.sources import check_model_and_plot, columns_of, read_models, read_record
from swath_sysid.common.errors import InputError
from swath_sysid.evaluation import scoring
from swath_sysid.evaluation.report.forecast_figure import forecast_figure
from swath_sysid.evaluation.report.skill import LABELS, POINT_UNITS, cell, conclusion_of, methods_of, skill_as_data
from swath_sysid.formats.upstream_channels import read_upstream
from swath_sysid.pipeline.record_run import run_through
from swath_sysid.report.figures import save_figure
from swath_sysid.report.fit_summary import short_name
from swath_sysid.share import share_folder

SEA_RECORD = 'records/morro_buoy.csv'
SEA_OPTIONS = ('--leads', '0.5,1,2,3', '--warmup', '180')


def run(arguments: Namespace) -> int:
    """Run the predictor through the record and print its skill."""
    skill = scored(arguments)
    if arguments.json:
        print_result(True, skill_as_data(skill), (), conclusion_of(skill))
        return 0
    if not arguments.quiet:
        _print_skill(skill, short_name(arguments.record), arguments.all)
    print('\n'.join(conclusion_of(skill)))
    return 0


def scored(arguments: Namespace) -> scoring.Skill:
    """The skill of the predictor on the record, with its warnings shown and its picture written."""
    check_model_and_plot(arguments, [arguments.record, arguments.model])
    trial = read_record(arguments.record, arguments)
    refuse_contradictions(trial, arguments.axis)
    if trial.time.size < 3:
        raise InputError(f'{arguments.record} holds too few samples to forecast: give a longer record')
    upstream = read_upstream(arguments.record, arguments.upstream, topic=arguments.topic, columns=columns_of(arguments))
    models = read_models(arguments.model, trial) if arguments.model else {}
    if arguments.axis is not None and getattr(trial, arguments.axis) is None:
        raise InputError(
            f'{arguments.record} holds no {arguments.axis} angle: choose another axis, or assign the column of '
            f'{arguments.axis}',
            'axis-absent',
        )
    points = _with_sensor(arguments.points)
    if points:
        even_stretches(trial)
    warmup = scoring.usual_warmup(trial) if arguments.warmup is None else arguments.warmup
    scoring.check_scorable(trial, warmup, arguments.leads[-1], arguments.until)
    angles, rates = (given or (math.inf, math.inf) for given in (arguments.quiet_deg, arguments.quiet_rate_deg_s))
    base = ForecasterSettings()
    quiet_for = arguments.quiet_for or base.horizon
    asked = arguments.quiet_probability
    quiet = QuiescenceLimits(angles[0], angles[1], rates[0], rates[1], quiet_for, probability=asked)
    limits = scoring.usual_limits(trial, quiet, warmup, AXES if arguments.axis is None else (arguments.axis,))
    settings = replace(
        base,
        leads=arguments.leads,
        window=arguments.window,
        quiescence=None if limits is None else quiet,
        points=points,
        # windows of calm are announced as long before they begin as the longest lead
        horizon=max(base.horizon, quiet_for + arguments.leads[-1]),
        valid_error=ErrorLimit(arguments.valid_error),
    )
    with progress_of('forecasting') as progress:
        run_made = run_through(
            trial,
            settings,
            models,
            clock=time.perf_counter,
            progress=progress,
            limits_from=None if limits is None else (float(trial.time[0]) + warmup, limits),
            points_ahead=False,
            upstream=upstream,
        )
    skill = scoring.score(trial, run_made, arguments.leads, warmup, arguments.window, arguments.until, points=points)
    if arguments.axis is not None:
        skill = replace(skill, axes={arguments.axis: skill.axes[arguments.axis]})
    skill = replace(skill, advice=tuple(dict.fromkeys((*trial.advice, *skill.advice))))
    show_advice(skill.advice)
    if arguments.plot:
        save_figure(forecast_figure(trial, run_made, skill), arguments.plot)
    return skill


def _print_skill(skill: Any, name: str, everything: bool) -> None:
    console = Console()
    for axis, scores in skill.axes.items():
        table = _table_of_leads(skill, f'{name}, {axis}')
        (_add_every_score if everything else _add_best)(table, scores)
        console.print(table)
        if everything:
            _print_valid_lead(axis, scores.valid_lead)
    for point, kinds in skill.points.items():
        _print_point(console, skill, point, kinds)
    _print_quiescence(console, skill, everything)
    if everything:
        print(
            f'processing: {1e3 * skill.step_time["median"]:.2f} ms per sample (median), '
            f'{1e3 * skill.refit_time["median"]:.0f} ms per refit (longest {1e3 * skill.refit_time["most"]:.0f} ms)'
        )


def _add_best(table: Table, scores: Any) -> None:
    """The forecast beside the best other method."""
    table.add_row('forecast', *map(cell, scores.nrmse[scoring.FORECAST]), style='bold')
    table.add_row('best other method', *(cell(scores.nrmse[best][k]) for k, best in enumerate(scores.best)))
    table.add_row('', *(LABELS[best] for best in scores.best), style='dim')
    table.add_row('90 % coverage, %', *_percentages(scores.coverage[:, 1]), style='dim')


def _add_every_score(table: Table, scores: Any) -> None:
    _add_methods(table, scores.nrmse)
    if np.isfinite(scores.expected).any():
        table.add_row('its own expectation', *map(cell, scores.expected))
    table.add_row('forecast / best other', *map(cell, scores.ratio), style='bold')
    for column, level in enumerate((50, 90, 99)):
        table.add_row(f'{level} % coverage, %', *_percentages(scores.coverage[:, column]), style='dim')
    table.add_row('scored', *map(str, scores.counted), style='dim')
    if scores.unmeasured.any():
        table.add_row('not measured', *map(str, scores.unmeasured), style='dim')
    if np.nan_to_num(scores.gap_share).any():
        table.add_section()
        table.add_row(f'{scoring.AFTER_GAP:g} s after gaps, %', *_percentages(scores.gap_share))
        for method, values in scores.gap_nrmse.items():
            table.add_row(f'  {LABELS[method]}', *map(cell, values))


def _print_valid_lead(axis: str, found: Any) -> None:
    if not np.isfinite(found.lead[0]):
        return
    median, low, high = found.lead
    if high == 0.0:
        print(f'valid lead of {axis}: none, as it hardly moves or nothing of its motion can be forecast')
        return
    if found.beyond_horizon == 1.0:
        print(f'valid lead of {axis}: the whole horizon of {high:.2g} s or more')
        return
    beyond = f', the horizon or more for {found.beyond_horizon:.0%}' * (found.beyond_horizon > 0.0)
    measured = f'; the error measured there is {found.error_over_expected:.2f} times the expected' * (found.counted > 0)
    print(
        f'valid lead of {axis}: {median:.2g} s in the median, {low:.2g} to {high:.2g} s for 80 % of the forecasts'
        f'{beyond}{measured}'
    )


def _print_point(console: Console, skill: Any, point: str, kinds: Any) -> None:
    table = _table_of_leads(skill, point)
    for kind, scores in kinds.items():
        table.add_section()
        words, unit = kind.replace('_', ' '), POINT_UNITS[kind].replace('_', '/').replace('s2', 's²')
        table.add_row(f'{words}, {scores.deviation:.3g} {unit}')
        _add_methods(table, scores.nrmse)
        table.add_row('90 % coverage, %', *_percentages(scores.coverage[:, 1]), style='dim')
        table.add_row('scored', *map(str, scores.counted), style='dim')
        absent = scores.replaced_share[scoring.FORECAST]
        if np.nan_to_num(absent).any():
            table.add_row('not learnt yet, %', *_percentages(absent), style='dim')
    console.print(table)


def _table_of_leads(skill: Any, name: str) -> Table:
    span = f'from {skill.warmup:g} to {skill.until:.0f} s'
    table = Table(title=f'{name}: RMSE / standard deviation {span}', title_justify='left')
    table.add_column('lead, s')
    for lead in skill.leads:
        table.add_column(f'{lead:g}', justify='right')
    return table


def _add_methods(table: Table, nrmse: dict[str, Any]) -> None:
    for label, names in methods_of(nrmse):
        table.add_row(label, *map(cell, nrmse[names[0]]), style='bold' if scoring.FORECAST in names else '')


def _print_quiescence(console: Any, skill: Any, with_decisions: bool) -> None:
    limits, found = skill.quiescence_limits, skill.quiescence
    if limits is None or found is None:
        return
    bounds = ', '.join(
        f'{name.replace("_", " ")} {math.degrees(limit):.2f} {"deg/s" if "rate" in name else "deg"}'
        for name in ATTITUDE
        if math.isfinite(limit := getattr(limits, name))
    )
    if not found.brier_of_climate > 0.0:
        why = 'no outcome of a forecast probability is known'
        if found.count.any():
            kept = np.nanmax(found.observed) == 1.0
            why = f'the craft never {"left the limits" if kept else "kept the limits for so long"}'
        print(f'quiet for {limits.duration:g} s ({bounds}): not scored, since {why}')
        return
    print(
        f'quiet for {limits.duration:g} s ({bounds}): Brier score {found.brier:.3f} '
        f'(climatology: {found.brier_of_climate:.3f})'
    )
    if with_decisions and skill.decisions is not None and skill.decisions.base_rate > 0.0:
        _print_decisions(console, skill.decisions)


def _print_decisions(console: Console, found: Any) -> None:
    table = Table(title=f'decisions to go, base rate {100.0 * found.base_rate:.0f} %', title_justify='left')
    for name in ('go when', 'F1', 'precision, %', 'recall, %', 'false alarms / min'):
        table.add_column(name, justify='left' if name == 'go when' else 'right')
    for name, rule in found.rules.items():
        table.add_row(name, cell(rule.f1), *_percentages((rule.precision, rule.recall)), cell(rule.false_alarms, 1))
    console.print(table)
    counts = ', '.join(f'{start:g} s: {count}' for start, count in zip(found.edges, found.lead_times, strict=False))
    print(f'windows of calm by how long before they were announced: {counts}, not announced: {found.unannounced}')


def _percentages(shares: Any):
    return (cell(100.0 * share, 1) for share in shares)


def _with_sensor(points: list[Point]) -> tuple[Point, ...]:
    """The points asked for after the sensor; none where none are."""
    names = [point.name for point in points]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f'the point {twice[0]} is given twice: name each point once')
    if any(point.name == scoring.SENSOR.name and point != scoring.SENSOR for point in points):
        raise InputError(f"'{scoring.SENSOR.name}' names the sensor's own position, 0,0,0: give the point another name")
    return (scoring.SENSOR, *(point for point in points if point != scoring.SENSOR)) if points else ()


def forecast_sea(output: Path) -> None:
    """Forecast a measured sea with the command for users' own records."""
    words = ['forecast', str(share_folder() / SEA_RECORD), *SEA_OPTIONS, '--plot', str(output / 'sea.png')]
    print(
        f'Motion of a moored buoy at sea, forecast from past samples only:\n\n    swath-sysid {shlex.join(words)}\n',
        flush=True,
    )
    skill = scored(build_parser(words[0]).parse_args(words))
    Console().print(_table_of_sea(skill))
    print(f'{output / "sea.png"}: these forecasts beside the measured motion; the command prints every method\n')


def _table_of_sea(skill: scoring.Skill) -> Table:
    """The forecast beside the best of the usual ones."""
    table = Table(
        'error / motion (1: as bad as the mean)', *(Column(f'{lead:g} s', justify='right') for lead in skill.leads)
    )
    for axis, scores in skill.axes.items():
        best = [scores.nrmse[name][k] for k, name in enumerate(scores.best)]
        table.add_row(f'{axis}: forecast', *map(cell, scores.nrmse[scoring.FORECAST]), style='bold')
        table.add_row(f'{axis}: best of {len(scores.nrmse) - 1} usual methods', *map(cell, best))
        inside = (cell(100.0 * share, 0) for share in scores.coverage[:, 1])
        table.add_row(f'{axis}: inside the 90 % interval, %', *inside, style='dim', end_section=True)
    return table
