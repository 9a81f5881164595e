"""The tables of a campaign, each for the eye (HTML) and for other programs (CSV)."""

import csv
import io
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.attitude.identification.forecast_check import LEADS, next_step
from swath_sysid.campaign.evaluation import beyond_noise, noise_statement, term_values, tied_best

LOADING_NAMES = {'draft_factor': 'draft factor', 'draft_m': 'draft [m]', 'displacement_kg': 'displacement [kg]'}
LEAD_NAMES = {0.25: 'a quarter period', 0.5: 'half a period', 1.0: 'one period'}
CHECKED_SAMPLES = 10
SCHEDULE_POINTS = 9


@dataclass(frozen=True)
class Column:
    """A column: its heading, and how a value is shown to the eye."""

    name: str
    show: Callable = str


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    name : str
        File name without ending.
    title, note : str
    columns : tuple of Column
    rows : tuple of tuple
        Raw values, as the CSV file holds them.
    marks : dict of (int, int) to str
        Row and column to ``best`` or ``beyond``.
    """

    name: str
    title: str
    note: str
    columns: tuple[Column, ...]
    rows: tuple[tuple, ...]
    marks: dict = field(default_factory=dict)


def digits(count):
    """A function that shows numbers with so many significant digits."""

    def show(value):
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return '-'
        return f'{float(f"{value:.{count}g}"):.12g}'

    return show


def percent(value):
    """A share, shown in percent."""
    return '-' if value is None or math.isnan(value) else f'{100.0 * value:.3g} %'


def table_as_csv(table):
    """Text of a CSV file, its numbers with all their digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(c.name for c in table.columns)
    writer.writerows(table.rows)
    return text.getvalue()


def trials_table(outcome):
    """Every trial of the manifest, used or not, with the reason."""
    best = {str(axis.records[index]) for axis in outcome.axes for index in axis.best.values()}
    rows = []
    for t in outcome.trials:
        if t.record is None:
            rows.append((t.name, t.entry.axis, None, None, None, None, None, None, 'no', t.reason, t.sha256))
            continue
        c, segment = t.record.condition, t.record.problem.segments[0]
        kept = 'best' if str(t.record) in best else 'yes'
        rows.append(
            (
                t.name,
                c.axis,
                c.loading,
                c.initial_angle_deg,
                t.record.repeat,
                segment.start,
                segment.end,
                segment.cycles,
                kept,
                ', '.join(a.code for a in t.advice),
                t.sha256,
            )
        )
    number = digits(4)
    columns = (
        Column('trial'),
        Column('axis'),
        Column(LOADING_NAMES[outcome.quantity], number),
        Column('initial angle [deg]', number),
        Column('repeat', _or_dash),
        Column('decay from [s]', digits(5)),
        Column('to [s]', digits(5)),
        Column('cycles', digits(3)),
        Column('used'),
        Column('remarks', _or_dash),
        Column('SHA-256', lambda value: value[:12] or '-'),
    )
    marks = {(k, 8): 'best' if row[8] == 'best' else 'beyond' for k, row in enumerate(rows) if row[8] != 'yes'}
    note = (
        'Used: the decay that was found and fitted; best: the repeat of its condition that the equations explain best.'
    )
    return Table('trials', 'Trials', note, columns, tuple(rows), marks)


def _or_dash(value):
    return '-' if value in (None, '') else str(value)


def objective_table(outcome, axis, objective):
    """Objective values by condition and equation of the best repeats, as the papers give them."""
    fits = axis.fits[objective]
    rows, marks = [], {}
    for k, (condition, index) in enumerate(axis.best.items()):
        values = [f.objective_value for f in fits[index]]
        rows.append((condition.initial_angle_deg, condition.loading, axis.records[index].repeat, *values))
        beyond = beyond_noise(fits[index])
        for column, exceeds in enumerate(beyond):
            if exceeds:
                marks[k, column + 3] = 'beyond'
        marks |= {(k, column + 3): 'best' for column in tied_best(fits[index])}
    unit = 'rad/s, one Euler step ahead' if objective == 'one-step' else 'dimensionless: residuals over noise'
    columns = (*_condition_columns(outcome), *(Column(name, digits(7)) for name in axis.names))
    note = f'{unit[0].upper()}{unit[1:]}. {noise_statement(axis.records, fits, axis.best)}'
    return Table(
        f'objective_{axis.axis}_{objective}',
        f'Objective values, {axis.axis}, {objective}',
        note,
        columns,
        tuple(rows),
        marks,
    )


def _condition_columns(outcome):
    return (
        Column('initial angle [deg]', digits(4)),
        Column(LOADING_NAMES[outcome.quantity], digits(4)),
        Column('repeat'),
    )


def fits_table(outcome):
    """Every fit of every record: the long table, for other programs."""
    rows = []
    for axis in outcome.axes:
        for objective, fits in axis.fits.items():
            for record, own in zip(axis.records, fits, strict=True):
                c = record.condition
                rows += [
                    (
                        record.name,
                        c.axis,
                        c.loading,
                        c.initial_angle_deg,
                        record.repeat,
                        objective,
                        f.equation,
                        f.objective_value,
                        f.r2,
                        f.rmse,
                        f.rate_rmse,
                        f.samples,
                        f.effective_samples,
                        f.trim,
                        f.trim_std,
                        f.generations,
                        f.evaluations,
                        f.stop,
                        ' '.join(code for code, _ in f.advice),
                    )
                    for f in own
                ]
    names = (
        'trial',
        'axis',
        LOADING_NAMES[outcome.quantity],
        'initial angle [deg]',
        'repeat',
        'objective',
        'equation',
        'objective value',
        'R2',
        'RMSE [rad]',
        'rate RMSE [rad/s]',
        'samples',
        'effective samples',
        'trim [rad]',
        'trim std [rad]',
        'generations',
        'evaluations',
        'stop',
        'warnings',
    )
    return Table('fits', 'Fits', 'Every record with every equation.', tuple(map(Column, names)), tuple(rows))


def coefficients_long_table(outcome):
    """Every ratio of every fit by the simulation objective: records, conditions, drafts."""
    rows = []
    for axis in outcome.axes:
        groups = [
            ('record', r.condition, r.repeat, own) for r, own in zip(axis.records, axis.fits['simulation'], strict=True)
        ]
        groups += [('condition', c, None, own) for c, own in axis.together.items()]
        for level, c, repeat, own in groups:
            rows += [
                (
                    level,
                    axis.axis,
                    c.loading,
                    c.initial_angle_deg,
                    repeat,
                    f.equation,
                    term,
                    value,
                    std,
                    RATIO_UNITS[term],
                )
                for f in own
                for term, (value, std) in term_values(f).items()
            ]
        rows += [
            ('draft', axis.axis, loading, None, None, f.equation, term, value, std, RATIO_UNITS[term])
            for loading, own in axis.by_draft.items()
            for f in own
            for term, (value, std) in term_values(f).items()
        ]
    names = (
        'level',
        'axis',
        LOADING_NAMES[outcome.quantity],
        'initial angle [deg]',
        'repeat',
        'equation',
        'ratio',
        'value',
        'standard deviation',
        'unit',
    )
    return Table('coefficients', 'Coefficients', 'All levels.', tuple(map(Column, names)), tuple(rows))


def ranking_table(axis):
    """Equations over the whole campaign."""
    best = axis.ranking.ranked[0].criterion
    rows = tuple(
        (r.equation, ' '.join(r.terms), r.criterion - best, r.r2, r.held_out, r.forecast, r.best_of)
        for r in axis.ranking.ranked
    )
    columns = (
        Column('equation'),
        Column('terms'),
        Column('criterion above the best', digits(4)),
        Column('smallest R2', digits(6)),
        Column('held-out error', percent),
        Column('forecast error, one period', percent),
        Column('records fitted best'),
    )
    chosen = next(k for k, r in enumerate(rows) if r[0] == axis.ranking.choice.equation)
    note = (
        'Criterion: of one set of ratios a draft for all angles and repeats; 10 more is decisively worse. Held-out: '
        'error on '
        'another repeat (or the second half of a lone one) over the standard deviation of the motion.'
    )
    return Table(f'ranking_{axis.axis}', f'Ranking, {axis.axis}', note, columns, rows, {(chosen, 0): 'best'})


def coefficient_table(outcome, axis):
    """Ratios of the chosen equation: repeats together, and all records of a draft together."""
    rows = []
    terms = tuple(term_values(axis.together[next(iter(axis.together))][axis.choice]))
    for c, fits in axis.together.items():
        rows.append((c.loading, c.initial_angle_deg, *_pairs(fits[axis.choice], terms)))
    for loading, fits in axis.by_draft.items():
        rows.append((loading, 'all', *_pairs(fits[axis.choice], terms)))
    columns = (
        Column(LOADING_NAMES[outcome.quantity], digits(4)),
        Column('initial angle [deg]', _text_or_number),
        *(
            c
            for term in terms
            for c in (Column(f'{term} [{RATIO_UNITS[term]}]', digits(5)), Column(f'{term} std', digits(2)))
        ),
    )
    note = (
        f'Of {axis.ranking.choice.equation}; the repeats of a condition fitted together, and all records of a '
        'draft together.'
    )
    return Table(f'ratios_{axis.axis}', f'Ratios to inertia, {axis.axis}', note, columns, tuple(rows))


def _text_or_number(value):
    return value if isinstance(value, str) else f'{value:.4g}'


def _pairs(fit, terms):
    values = term_values(fit)
    return [number for term in terms for number in values[term]]


def spread_table(outcome, axis):
    """How the repeats agree, beside what single fits state."""
    rows = tuple(
        (s.condition.loading, s.condition.initial_angle_deg, s.quantity, s.mean, s.spread, s.stated, s.repeats)
        for s in axis.spreads
    )
    columns = (
        Column(LOADING_NAMES[outcome.quantity], digits(4)),
        Column('initial angle [deg]', digits(4)),
        Column('quantity'),
        Column('mean', digits(5)),
        Column('spread between repeats', digits(2)),
        Column('spread stated by single fits', digits(2)),
        Column('repeats'),
    )
    note = (
        f'{spread_statement(axis)} Spread: standard deviation. Where it is much larger than stated, something other '
        'than '
        'noise differs between repeats.'
    )
    return Table(f'repeats_{axis.axis}', f'Agreement of repeats, {axis.axis}', note, columns, rows)


def spread_statement(axis):
    """One sentence on how the repeats agree in period and damping; empty where nothing was repeated."""
    by_quantity = {
        name: [s.spread / abs(s.mean) for s in axis.spreads if s.quantity == name]
        for name in ('natural_period_s', 'damping_ratio')
    }
    if not by_quantity['natural_period_s']:
        return ''
    period, damping = (float(np.median(v)) for v in by_quantity.values())
    return (
        f'Repeats agree to {100 * period:.2g} % in natural period and {100 * damping:.2g} % in equivalent damping '
        '(standard deviation, median over the conditions).'
    )


def errors_table(outcome, axis, every_equation=False):
    """Errors of next step, simulated motion and forecasts, of the choice or of every equation."""
    rows = []
    for record, own in zip(axis.records, axis.judgements, strict=True):
        c = record.condition
        for j in own if every_equation else [own[axis.choice]]:
            first = (c.initial_angle_deg, c.loading, record.repeat, *((j.equation,) if every_equation else ()))
            rows.append((*first, j.next_step, j.simulation, *j.forecasts, j.held_out))
    columns = (
        *_condition_columns(outcome),
        *((Column('equation'),) if every_equation else ()),
        Column('next step [rad/s]', digits(4)),
        Column('simulated motion', percent),
        *(Column(f'forecast {LEAD_NAMES[lead]} ahead', percent) for lead in LEADS),
        Column('simulated, held out', percent),
    )
    note = (
        'Root mean square errors; in percent: of the standard deviation of the measured motion. Forecasts start all '
        'along '
        'the record from the measured state, whose own noise they carry; the simulated motion starts once, at the '
        'release.'
    )
    if every_equation:
        return Table(f'errors_every_equation_{axis.axis}', 'Errors', note, columns, tuple(rows))
    return Table(
        f'errors_{axis.axis}', f'Errors of {axis.ranking.choice.equation}, {axis.axis}', note, columns, tuple(rows)
    )


def next_step_table(outcome, axis):
    """The papers' check: ten samples of measured and next-step rate of one record."""
    index = axis.best[_design_condition(axis)]
    record, fit = axis.records[index], axis.fits['simulation'][index][axis.choice]
    checked = next_step(fit.model.with_trim(fit.initial_states[0].trim), record.problem.motions[0])
    steady = np.convolve(np.abs(checked.measured), np.ones(CHECKED_SAMPLES), mode='valid')
    first = int(np.argmax(steady))
    rows = tuple(
        (float(t), float(m), float(p), float(abs(p - m) / abs(m)) if m else float('nan'))
        for t, m, p in zip(
            *(v[first : first + CHECKED_SAMPLES] for v in (checked.time, checked.measured, checked.predicted)),
            strict=True,
        )
    )
    columns = (
        Column('time [s]', digits(6)),
        Column('measured rate [rad/s]', digits(6)),
        Column('next-step rate [rad/s]', digits(6)),
        Column('error', percent),
    )
    c = record.condition
    note = (
        f'{c.initial_angle_deg:g} deg, {LOADING_NAMES[outcome.quantity]} {c.loading:g}, repeat {record.repeat}: '
        'where it turns '
        'fastest. Any smooth model passes this check, because the measured rate stands on both sides; the errors of '
        'simulated motion and forecasts tell more.'
    )
    return Table(f'next_step_{axis.axis}', f'Next-step check, {axis.axis}', note, columns, rows)


def _design_condition(axis):
    """The largest angle at the middle loading."""
    loadings = sorted({c.loading for c in axis.best})
    middle = loadings[len(loadings) // 2]
    return max((c for c in axis.best if c.loading == middle), key=lambda c: c.initial_angle_deg)


def schedule_table(outcome, axis):
    """The ratios of the scheduled model at its loadings and between."""
    s = axis.schedule
    between = np.unique(np.round([*s.loadings, *np.linspace(s.loadings[0], s.loadings[-1], SCHEDULE_POINTS)], 9))
    ratios, stds = s.curve(between)
    rows = tuple(
        (float(at), *(float(v) for pair in zip(r, d, strict=True) for v in pair))
        for at, r, d in zip(between, ratios, stds, strict=True)
    )
    columns = (
        Column(LOADING_NAMES[outcome.quantity], digits(5)),
        *(
            c
            for term in s.equation.terms
            for c in (Column(f'{term} [{RATIO_UNITS[term]}]', digits(5)), Column(f'{term} std', digits(2)))
        ),
    )
    note = 'Linear between the drafts that were tried; the standard deviation adds what a straight line may miss.'
    return Table(f'schedule_{axis.axis}', f'Scheduled model, {axis.axis}', note, columns, rows)
