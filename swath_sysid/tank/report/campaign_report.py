"""The report of a campaign: a page, the same tables as CSV, the figures as SVG, and the model file."""

import html
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy
import scipy

from swath_sysid import __version__
from swath_sysid.common.conventions import ADEQUATE
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import write_text
from swath_sysid.formats.model_file import write_scheduled
from swath_sysid.report.html_page import Drawing, bullets, figures, page, page_style, paragraph, table_as_html
from swath_sysid.report.tables import Table, table_as_csv
from swath_sysid.tank.campaign.evaluation import noise_statement, out_of_order
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.report.campaign_extinction import conditions_table, extinction_drawings, extinction_tables
from swath_sysid.tank.report.campaign_figures import campaign_drawings
from swath_sysid.tank.report.campaign_tables import (
    coefficient_table,
    coefficients_long_table,
    errors_table,
    fits_table,
    next_step_table,
    objective_table,
    ranking_table,
    schedule_table,
    spread_statement,
    spread_table,
    trials_table,
    verdict_table,
)

PAGE, MODEL = 'report.html', 'model.yaml'
TABLES, FIGURES = 'tables', 'figures'
REPORTED = (PAGE, MODEL, TABLES, FIGURES)  #: What a report writes into its folder.


def write_report(outcome: CampaignOutcome, folder: str | Path, wall_s: float) -> Path:
    """Write page, tables, figures and models of a campaign, which took ``wall_s``, into a folder; returns the page."""
    folder = Path(folder)
    try:
        for name in (TABLES, FIGURES):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f'cannot make the folder {folder}: {error.strerror}; choose another') from error
    with page_style():
        drawings = [campaign_drawings(outcome, axis) for axis in outcome.axes]
        for axis, drawn in zip(outcome.axes, drawings, strict=True):
            drawn['damping'] += extinction_drawings(outcome, axis)
        for drawing in (each for kinds in drawings for items in kinds.values() for each in items):
            write_text(folder / FIGURES / f'{drawing.name}.svg', drawing.svg)
    tables = [_axis_tables(outcome, axis) for axis in outcome.axes]
    sections = [
        ('short', 'In short', _in_short(outcome)),
        ('conditions', 'Conditions', [table_as_html(conditions_table(outcome))]),
    ]
    for axis, found, drawn in zip(outcome.axes, tables, drawings, strict=True):
        of_axis = '' if len(outcome.axes) == 1 else f', {axis.axis}'
        sections += [
            (f'{axis.axis}-{anchor}', f'{name}{of_axis}', parts)
            for anchor, name, parts in _axis_sections(axis, found, drawn)
        ]
    sections += [
        ('trials', 'Trials', [table_as_html(trials_table(outcome))]),
        ('warnings', 'Warnings', _warnings(outcome)),
        ('made', 'How this was made', _how_made(outcome, wall_s)),
    ]
    for table in campaign_tables(outcome):
        write_text(folder / TABLES / f'{table.name}.csv', table_as_csv(table))
    speeds = sorted({axis.speed_m_s for axis in outcome.axes})
    for speed in speeds:
        models = {axis.motion: axis.schedule for axis in outcome.axes if axis.speed_m_s == speed}
        write_scheduled(folder / (MODEL if speed == speeds[0] else f'model_{speed:g}m_s.yaml'), models)
    write_text(folder / PAGE, page(f'Campaign: {outcome.manifest.title}', sections))
    return folder / PAGE


def campaign_tables(outcome: CampaignOutcome) -> list[Table]:
    """Every `Table` of a `CampaignOutcome`, as `write_report` writes them."""
    tables = [conditions_table(outcome), trials_table(outcome), fits_table(outcome), coefficients_long_table(outcome)]
    for axis in outcome.axes:
        tables += _axis_tables(outcome, axis).values()
        if axis.is_compared:
            tables.append(errors_table(outcome, axis, every_equation=True))
    return tables


def _axis_tables(outcome: CampaignOutcome, axis: AxisOutcome):
    """The tables that the page shows of one axis, by name."""
    compared = {objective: objective_table(outcome, axis, objective) for objective in axis.fits}
    tables = {
        **({'ranking': ranking_table(axis), **compared} if axis.is_compared else {'verdicts': verdict_table(axis)}),
        'ratios': coefficient_table(outcome, axis),
        'repeats': spread_table(outcome, axis),
        'errors': errors_table(outcome, axis),
        'next_step': next_step_table(outcome, axis),
        **extinction_tables(outcome, axis),
    }
    if len(axis.schedule.loadings) > 1:
        tables['schedule'] = schedule_table(outcome, axis)
    return tables


def _in_short(outcome: CampaignOutcome):
    used = sum(t.record is not None for t in outcome.trials)
    parts = [paragraph(f'{outcome.manifest.craft.name}: {used} of {len(outcome.trials)} trials used.')]
    for axis in outcome.axes:
        parts.append(
            f'<div class="choice"><p><strong>{axis.axis.capitalize()}.</strong> '
            f'{html.escape(axis.ranking.reason)}</p></div>'
        )
        lines = [f'{a.message}.' for a in axis.ranking.findings]
        lines += [spread_statement(axis)] if axis.spreads else []
        if axis.is_compared:
            lines += [
                f'{objective.capitalize()} objective: {noise_statement(axis.records, fits, axis.best)}'
                for objective, fits in axis.fits.items()
            ]
            lines.append(_order_statement(axis))
        parts.append(bullets(lines))
    return parts


def _order_statement(axis: AxisOutcome):
    groups = [*(f for fits in axis.fits.values() for f in fits), *axis.together.values(), *axis.by_draft.values()]
    wrong = [pair for fits in groups for pair in out_of_order(fits)]
    if wrong:
        return (
            f'In {len(wrong)} cases an equation fits worse than one it contains ({wrong[0][0]}, {wrong[0][1]}): '
            'the search had not converged.'
        )
    return f'No equation fits worse than one that it contains, in any of {len(groups)} rows: the searches converged.'


def _axis_sections(axis: AxisOutcome, found: dict[str, Table], drawings: dict[str, list[Drawing]]):
    """Anchor, name and parts of every section of an axis."""
    best = {axis.records[k].name for k in axis.best.values()}
    peaks = found['peaks']
    note = f'{peaks.note} Of the best repeats; those of every record are in {TABLES}/{peaks.name}.csv.'
    shown_peaks = replace(peaks, note=note, rows=tuple(row for row in peaks.rows if row[0] in best))
    tables = {name: table_as_html(table) for name, table in (found | {'peaks': shown_peaks}).items()}
    shown = {kind: figures(items) for kind, items in drawings.items()}
    extinction = [tables[name] for name in ('damping', 'extinction', 'peaks')]
    related = 'Ratios whose correlation is beyond 0.95 cannot be distinguished: use them together only.'
    equations = 'verdicts', 'Verdicts', [tables.get('verdicts', '')]
    if axis.is_compared:
        marks = 'Marked green: the best of a row. Red: worse than the best by more than noise explains.'
        compared = [tables[objective] for objective in axis.fits]
        equations = 'equations', 'Which equation', [tables['ranking'], paragraph(marks, 'note'), *compared]
    return (
        equations,
        ('decays', 'Decays', [shown['decays']]),
        ('ratios', 'Coefficients', [shown['against_angle'], tables['ratios'], tables['repeats']]),
        ('draft', 'Against draft', [shown['against_draft'], tables.get('schedule', '')]),
        ('damping', 'Period, damping and extinction', [shown['damping'], *extinction]),
        ('errors', 'Next step, simulation, forecast', [tables['errors'], tables['next_step']]),
        ('records', 'Every record', [shown['records']]),
        ('correlations', 'Correlations', [paragraph(related, 'note'), shown['correlations']]),
    )


def _warnings(outcome: CampaignOutcome):
    left_out = [f'{t.name}: {t.reason}' for t in outcome.trials if t.record is None]
    lines = [
        f'{axis.axis.capitalize()}, all records at {loading:g}: {verdict}.'
        for axis in outcome.axes
        for loading, fits in axis.by_draft.items()
        if (verdict := fits[axis.choice].verdict).level != ADEQUATE
    ]
    lines += [f'Manifest, {fault}' for fault in outcome.manifest.faults]
    lines += [f'Left out: {line}' for line in left_out]
    lines += [f'Failed: {line}' for line in outcome.failures]
    gathered: dict[str, list[str]] = {}
    for t in outcome.trials:
        for advice in t.advice:
            gathered.setdefault(advice.message, []).append(t.name)
    # a warning may begin with the name of a term or of a file, whose case is its own
    lines += [f'{", ".join(dict.fromkeys(names))}: {message}.' for message, names in gathered.items()]
    return [bullets(lines) or paragraph('None.')]


def _how_made(outcome: CampaignOutcome, wall_s: float):
    search = outcome.manifest.search
    lines = [
        f'swath_sysid {__version__}, numpy {numpy.__version__}, scipy {scipy.__version__}, matplotlib '
        f'{matplotlib.__version__}.',
        f'Search {search.algorithm}, preset {search.preset or "none"}, generations '
        f'{search.generations or "as usual"}, population '
        f'{search.population or "as usual"}, seed {search.seed}; objectives {", ".join(outcome.manifest.objectives)}.',
        f'This run took {wall_s:.1f} s for {outcome.computed} tasks; {outcome.kept} were known from before. All '
        f'tasks together took {outcome.cpu_s:.1f} s of processor time.',
        'The hashes of the trials are in the table of trials; the complete numbers are in the folder tables, the '
        'figures in figures, '
        'the model in model.yaml, that of each further speed in a file of its own.',
    ]
    return [bullets(lines)]
