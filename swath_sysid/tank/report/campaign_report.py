"""The report of a campaign: a page, the same tables as CSV, the figures as SVG, and the model file."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.common.conventions import TWO_STD
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import write_text
from swath_sysid.formats.model_file import write_scheduled
from swath_sysid.report import figures as plots
from swath_sysid.report.html_page import Drawing, bullets, figures, page, page_style, paragraph, table_as_html
from swath_sysid.report.tables import Table, table_as_csv
from swath_sysid.tank.campaign.evaluation import Condition, noise_statement
from swath_sysid.tank.campaign.manifest import LOADING_NAMES, loading_in_words
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.report import campaign_tables
from swath_sysid.tank.report.campaign_results import results_table
from swath_sysid.tank.report.campaign_tables import colour_of, style_of
from swath_sysid.tank.report.client_pages import cover, method, result_drawings
from swath_sysid.tank.report.extinction_tables import conditions_table, extinction_drawings, extinction_tables


def campaign_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> dict[str, list[Drawing]]:
    """Section name to the list of `Drawing` of one axis of a `CampaignOutcome`."""
    return {
        'decays': list(decay_drawings(outcome, axis)),
        'against_angle': list(against_angle(outcome, axis)),
        'against_draft': list(against_draft(outcome, axis)),
        'damping': list(extinction_drawings(outcome, axis)),
        'records': list(record_drawings(outcome, axis)),
    }


def decay_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Decays of all drafts, one figure for each angle; of a single draft, all angles in one figure."""
    several = len({c.loading for c in axis.best}) > 1
    groups: dict[tuple[float, str], list] = {}
    for condition, index in axis.best.items():
        motion = axis.records[index].problem.motions[0]
        measured, label = plots.measured_channel(motion)
        angle = condition.initial_angle_deg if several else 0.0
        groups.setdefault((angle, label), []).append((condition, motion.time, measured))
    for (angle, label), members in sorted(groups.items()):
        title, suffix = (f'from {angle:g} deg', f'{angle:g}deg') if several else ('all angles', 'all')
        figure, axes = plots.panel(title=title, xlabel='time since release [s]', ylabel=label)
        for condition, time, measured in members:
            name = _loading(outcome, condition) if several else f'{condition.initial_angle_deg:g} deg'
            style = style_of(axis, condition.initial_angle_deg)['linestyle']
            colour = colour_of(axis, condition.loading)
            axes.plot(time - time[0], np.degrees(measured), style, color=colour, linewidth=1.1, label=name)
        plots.legend_below(axes, 3)
        suffix += '_rate' if 'rate' in label else ''
        yield Drawing(f'decays_{axis.axis}_{suffix}', f'Recorded decays {title}, best repeats', figure)


def _loading(outcome: CampaignOutcome, condition: Condition):
    return loading_in_words(outcome.quantity, condition.loading)


def against_angle(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Each ratio against initial angle, a curve a draft, with the single repeats behind."""
    loadings = sorted({c.loading for c in axis.together})
    for term in axis.schedule.equation.terms:
        figure, axes = _ratio_panel(term, 'initial angle [deg]')
        for loading in loadings:
            colour = colour_of(axis, loading)
            members = sorted(c for c in axis.together if c.loading == loading)
            label = _loading(outcome, members[0])
            _ratios(axes, axis, term, members, 'initial_angle_deg', label, color=colour, linewidth=1.2)
            single = [
                (r.condition.initial_angle_deg, fits[axis.choice].ratio(term)[0])
                for r, fits in zip(axis.records, axis.fits['simulation'], strict=True)
                if r.condition.loading == loading
            ]
            axes.plot(*np.transpose(single), 'X', color=colour)
        _finish_ratio(axes)
        caption = (
            f'{term} against initial angle: repeats together with two standard deviations; crosses: single repeats'
        )
        yield Drawing(f'{term}_against_angle_{axis.axis}', caption, figure)


def _ratios(
    axes: plots.Axes,
    axis: AxisOutcome,
    term: str,
    conditions: Sequence[Condition],
    against: str,
    label: str,
    **style: Any,
):
    """A ratio of the joint fits with two standard deviations, against what the conditions differ in."""
    value, std = np.array([axis.together[c][axis.choice].ratio(term) for c in conditions]).T
    style = {'marker': 'o', 'markersize': 4, 'capsize': 3, 'label': label, **style}
    axes.errorbar([getattr(c, against) for c in conditions], value, TWO_STD * std, **style)


def _ratio_panel(term: str, below: str):
    return plots.panel(xlabel=below, ylabel=f'{term} [{RATIO_UNITS[term]}]')


def _finish_ratio(axes: plots.Axes):
    low, high = axes.get_ylim()
    if low < 0 < high and low > -0.2 * high:
        axes.axhline(0.0, color=plots.MEASURED, linewidth=0.6)
    plots.legend_below(axes)


def against_draft(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Each ratio against loading: one curve for each angle, and the scheduled model with its band."""
    schedule, quantity = axis.schedule, LOADING_NAMES[outcome.quantity]
    if len(schedule.loadings) < 2:
        return
    angles = sorted({c.initial_angle_deg for c in axis.together})
    fine = np.linspace(schedule.loadings[0], schedule.loadings[-1], 101)
    for term, value, std in zip(schedule.equation.terms, *(part.T for part in schedule.curve(fine)), strict=True):
        figure, axes = _ratio_panel(term, quantity)
        plots.two_std_band(axes, fine, value, std, color=plots.MEASURED, alpha=0.15)
        axes.plot(fine, value, color=plots.MEASURED, linewidth=1.6, label='all angles: the schedule')
        for angle in angles:
            members = sorted(c for c in axis.together if c.initial_angle_deg == angle)
            style = {'color': plots.MEASURED, 'linewidth': 0.9, **style_of(axis, angle)}
            _ratios(axes, axis, term, members, 'loading', f'{angle:g} deg', **style)
        _finish_ratio(axes)
        caption = f'{term} against {quantity}, two standard deviations'
        yield Drawing(f'{term}_against_draft_{axis.axis}', caption, figure)


def record_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Every record with the identified motion and the residual."""
    for record, fits in zip(axis.records, axis.fits['simulation'], strict=True):
        fit, motion = fits[axis.choice], record.problem.motions[0]
        state = fit.states[0]
        angle, rate = simulate(fit.model.with_trim(state.trim), state.x + state.trim, state.rate, motion.time)
        figure = plots.new_figure()
        above, below = map(plots.quiet, figure.subplots(2, 1, sharex=True, height_ratios=(3, 1)))
        plots.draw_fit(above, below, motion, angle, rate)
        figure.legend(*above.get_legend_handles_labels(), loc='outside lower center', ncols=2, frameon=False)
        c = record.condition
        title = f'{c.initial_angle_deg:g} deg, {_loading(outcome, c)}, repeat {record.repeat}'
        above.set_title(title, fontsize='small')
        name = f'record_{axis.axis}_{c.initial_angle_deg:g}deg_{c.loading:g}_repeat{record.repeat}'
        best = ' (best repeat)' if axis.records[axis.best[c]] is record else ''
        yield Drawing(
            name, f'{record.name}{best}: R² {fit.r2:.5f}, which counts the noise of the sensor as unexplained', figure
        )


PAGE, MODEL = 'report.html', 'model.yaml'
TABLES, FIGURES = 'tables', 'figures'
REPORTED = (PAGE, MODEL, TABLES, FIGURES)  #: What a report writes into its folder.


def write_report(outcome: CampaignOutcome, folder: str | Path, with_annex: bool = False) -> Path:
    """Write page, tables, figures and models of a campaign into a folder; returns the page, for the client two sheets,
    and on demand an annex with the rest.
    """
    folder = Path(folder)
    try:
        for name in (TABLES, FIGURES):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'cannot make the folder {folder}: {error.strerror}; choose another') from error
    sections = [('result', 'Result', cover(outcome)), ('method', 'Method, uncertainty and limits', method(outcome))]
    with page_style():
        drawings = [campaign_drawings(outcome, axis) for axis in outcome.axes]
        results = list(result_drawings(outcome))
        for drawing in (*results, *(each for kinds in drawings for items in kinds.values() for each in items)):
            write_text(folder / FIGURES / f'{drawing.name}.svg', drawing.svg)
    for axis, drawn in zip(outcome.axes, drawings, strict=True) if with_annex else ():
        of_axis = '' if len(outcome.axes) == 1 else f', {axis.axis}'
        sections += [
            (f'{axis.axis}-{anchor}', f'{name}{of_axis}', parts)
            for anchor, name, parts in _axis_sections(axis, _axis_tables(outcome, axis), drawn)
        ]
    if with_annex:
        trials = [table_as_html(campaign_tables.trials_table(outcome)), *_warnings(outcome)]
        sections.append(('trials', 'Trials and warnings', trials))
    for table in every_table(outcome):
        write_text(folder / TABLES / f'{table.name}.csv', table_as_csv(table))
    speeds = sorted({axis.speed_m_s for axis in outcome.axes})
    for speed in speeds:
        models = {axis.motion: axis.schedule for axis in outcome.axes if axis.speed_m_s == speed}
        write_scheduled(folder / (MODEL if speed == speeds[0] else f'model_{speed:g}m_s.yaml'), models)
    write_text(folder / PAGE, page(outcome.manifest.title, sections, unfolded=2))
    return folder / PAGE


def every_table(outcome: CampaignOutcome) -> list[Table]:
    """Every `Table` of a `CampaignOutcome`, as `write_report` writes them."""
    tables = [
        results_table(outcome),
        conditions_table(outcome),
        campaign_tables.trials_table(outcome),
        campaign_tables.fits_table(outcome),
        campaign_tables.coefficients_long_table(outcome),
    ]
    for axis in outcome.axes:
        tables += _axis_tables(outcome, axis).values()
        if axis.is_compared:
            tables.append(campaign_tables.errors_table(outcome, axis, every_equation=True))
    return tables


def _axis_tables(outcome: CampaignOutcome, axis: AxisOutcome):
    """The tables that the page shows of one axis, by name."""
    compared = {objective: campaign_tables.objective_table(outcome, axis, objective) for objective in axis.fits}
    tables = {
        **(
            {'ranking': campaign_tables.ranking_table(axis), **compared}
            if axis.is_compared
            else {'verdicts': campaign_tables.verdict_table(axis)}
        ),
        'ratios': campaign_tables.coefficient_table(outcome, axis),
        'repeats': campaign_tables.spread_table(outcome, axis),
        'sides': campaign_tables.sides_table(outcome, axis),
        'errors': campaign_tables.errors_table(outcome, axis),
        'correlations': campaign_tables.correlation_table(outcome, axis),
        **extinction_tables(outcome, axis),
    }
    if len(axis.schedule.loadings) > 1:
        tables['schedule'] = campaign_tables.schedule_table(outcome, axis)
    return tables


def _findings(axis: AxisOutcome):
    lines = [f'{a.message}.' for a in axis.ranking.findings]
    if axis.is_compared:
        lines += [
            f'{objective.capitalize()} objective: {noise_statement(axis.records, fits, axis.best)}'
            for objective, fits in axis.fits.items()
        ]
    return [f'<div class="choice">{paragraph(axis.ranking.reason)}</div>', bullets(lines)]


def _axis_sections(axis: AxisOutcome, found: dict[str, Table], drawings: dict[str, list[Drawing]]):
    """Anchor, name and parts of every section of an axis."""
    tables = {name: table_as_html(table) for name, table in found.items()}
    shown = {kind: figures(items) for kind, items in drawings.items()}
    equations = 'verdicts', 'Verdicts', [*_findings(axis), tables.get('verdicts', '')]
    if axis.is_compared:
        marks = 'Marked green: the best of a row. Red: worse than the best by more than noise explains.'
        compared = [tables[objective] for objective in axis.fits]
        equations = (
            'equations',
            'Which equation',
            [*_findings(axis), tables['ranking'], paragraph(marks, 'note'), *compared],
        )
    return (
        equations,
        ('decays', 'Decays', [shown['decays']]),
        ('ratios', 'Coefficients', [shown['against_angle'], tables['ratios'], tables['repeats'], tables['sides']]),
        ('draft', 'Against draft', [shown['against_draft'], tables.get('schedule', '')]),
        ('damping', 'Period, damping and extinction', [shown['damping'], tables['damping'], tables['extinction']]),
        ('errors', 'Simulation and forecast', [tables['errors']]),
        ('records', 'Every record', [shown['records']]),
        ('correlations', 'Correlations', [tables['correlations']]),
    )


def _warnings(outcome: CampaignOutcome):
    lines = []
    gathered: dict[str, list[str]] = {}
    for t in outcome.trials:
        for advice in t.advice:
            gathered.setdefault(advice.message, []).append(t.name)
    # a warning may begin with the name of a term or of a file, whose case is its own
    lines += [f'{", ".join(dict.fromkeys(names))}: {message}.' for message, names in gathered.items()]
    return [bullets(lines) or paragraph('None.')]
