"""The tables of a campaign."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.attitude.identification.fit_quality import NOT_SEPARABLE
from swath_sysid.attitude.identification.forecast_check import LEADS
from swath_sysid.common.conventions import ADEQUATE, DOUBTFUL, REJECTED, TWO_STD, digits, percent
from swath_sysid.common.covariance import correlation
from swath_sysid.report.figures import LINE_STYLES
from swath_sysid.report.tables import Column, Table, columns_of
from swath_sysid.tank.campaign.evaluation import Condition, TankRecord, beyond_noise, tied_best
from swath_sysid.tank.campaign.manifest import LOADING_NAMES
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.campaign.trials import TrialOutcome

VERDICT_MARKS = {ADEQUATE: 'best', DOUBTFUL: 'caution', REJECTED: 'beyond'}
LEAD_NAMES = ('a quarter period', 'half a period', 'one period')  #: Of `LEADS`.
QUANTITIES = {'natural_period_s': 'natural period [s]', 'damping_ratio': 'equivalent damping ratio'}


#: A colour is a draft in every figure; the record is ink, the model red and the residual blue.
DRAFT_COLOURS = '#1b7f79', '#c77d0a', '#7b4fa3', '#8c6d46', '#b0548f', '#5b7c2f'


def colour_of(axis: AxisOutcome, loading: float) -> str:
    """The colour of a draft."""
    place = sorted({c.loading for c in axis.best}).index(loading)
    return DRAFT_COLOURS[place % len(DRAFT_COLOURS)]


def style_of(axis: AxisOutcome, angle_deg: float) -> dict[str, str]:
    """Line and marker of an initial angle."""
    place = sorted({abs(c.initial_angle_deg) for c in axis.best}).index(abs(angle_deg))
    return {'linestyle': LINE_STYLES[place % len(LINE_STYLES)], 'marker': 'os^DvP'[place % 6]}


def trials_table(outcome: CampaignOutcome) -> Table:
    """Every trial of the manifest, used or not, with the reason."""
    best = {str(axis.records[index]) for axis in outcome.axes for index in axis.best.values()}

    def of_record(value: Callable[[TankRecord], Any]):
        return lambda t: None if t.record is None else value(t.record)

    def used(t: TrialOutcome):
        return 'no' if t.record is None else 'best' if str(t.record) in best else 'yes'

    def segment(name: str):
        return of_record(lambda r: getattr(r.problem.segments[0], name))

    speed = [('speed [m/s]', of_record(lambda r: r.condition.speed_m_s), digits(4))]
    if not any(t.entry.speed_m_s for t in outcome.trials):
        speed = []
    table = Table.of(
        'trials',
        '',
        'Used: the decay that was found and fitted; best: the repeat of its condition that the equations explain best.',
        outcome.trials,
        ('trial', lambda t: t.name),
        ('axis', lambda t: t.entry.axis),
        (LOADING_NAMES[outcome.quantity], of_record(lambda r: r.condition.loading), digits(4)),
        ('initial angle [deg]', of_record(lambda r: r.condition.initial_angle_deg), digits(4)),
        *speed,
        ('repeat', of_record(lambda r: r.repeat)),
        ('decay from [s]', segment('start'), digits(5)),
        ('to [s]', segment('end'), digits(5)),
        ('cycles', segment('cycles'), digits(3)),
        ('used', used),
        ('remarks', lambda t: t.reason if t.record is None else ', '.join(a.code for a in t.advice)),
        ('SHA-256', lambda t: t.sha256, lambda value: value[:12]),
    )
    place = [column.name for column in table.columns].index('used')
    marks = {'best': 'best', 'no': 'beyond'}
    table.marks.update({(k, place): marks[row[place]] for k, row in enumerate(table.rows) if row[place] in marks})
    return table


def _condition_columns(
    outcome: CampaignOutcome, condition: Callable[[Any], Condition] = lambda item: item[0].condition
):
    """Angle, loading and repeat; by default of items that begin with a record."""
    return (
        ('initial angle [deg]', lambda item: condition(item).initial_angle_deg, digits(4)),
        (LOADING_NAMES[outcome.quantity], lambda item: condition(item).loading, digits(4)),
        ('repeat', lambda item: item[0].repeat),
    )


def objective_table(outcome: CampaignOutcome, axis: AxisOutcome, objective: str) -> Table:
    """Objective values by condition and equation of the best repeats, as the papers give them."""
    fits = axis.fits[objective]
    best = [(axis.records[index], fits[index]) for index in axis.best.values()]
    unit = 'rad/s, one Euler step ahead' if objective == 'one-step' else 'Dimensionless: residuals over noise'
    table = Table.of(
        f'objective_{axis.axis}_{objective}',
        f'Objective values, {axis.axis}, {objective}',
        f'{unit}.',
        best,
        *_condition_columns(outcome),
        *((name, lambda item, k=k: item[1][k].objective_value, digits(7)) for k, name in enumerate(axis.names)),
    )
    first = len(table.columns) - len(axis.names)
    for k, (_, own) in enumerate(best):
        table.marks.update({(k, first + j): 'beyond' for j, exceeds in enumerate(beyond_noise(own)) if exceeds})
        table.marks.update({(k, first + j): 'best' for j in tied_best(own)})
    return table


def fits_table(outcome: CampaignOutcome) -> Table:
    """Every fit of every record: the long table, for other programs."""
    items = [
        (record, objective, fit)
        for axis in outcome.axes
        for objective, fits in axis.fits.items()
        for record, own in zip(axis.records, fits, strict=True)
        for fit in own
    ]

    def of_fit(*names: tuple[str, str]):
        return ((heading, lambda item, of=attrgetter(name): of(item[2])) for heading, name in names)

    angle, loading, repeat = (column[:2] for column in _condition_columns(outcome))
    return Table.of(
        'fits',
        'Fits',
        'Every record with every equation.',
        items,
        ('trial', lambda item: item[0].name),
        ('axis', lambda item: item[0].condition.axis),
        loading,
        angle,
        repeat,
        ('objective', lambda item: item[1]),
        *of_fit(
            ('equation', 'model.equation.name'),
            ('objective value', 'objective_value'),
            ('R2', 'r2'),
            ('RMSE [rad]', 'rmse'),
            ('rate RMSE [rad/s]', 'rate_rmse'),
            ('samples', 'samples'),
            ('effective samples', 'effective_samples'),
            ('trim [rad]', 'model.trim'),
            ('trim std [rad]', 'trim_std'),
        ),
        ('warnings', lambda item: ' '.join(a.code for a in item[2].advice)),
    )


def coefficients_long_table(outcome: CampaignOutcome) -> Table:
    """Every ratio of every fit by the simulation objective: records, conditions, drafts."""
    rows = []
    for axis in outcome.axes:
        records = zip(axis.records, axis.fits['simulation'], strict=True)
        groups: list[tuple] = [
            ('record', r.condition.loading, r.condition.initial_angle_deg, r.repeat, own) for r, own in records
        ]
        groups += [('condition', c.loading, c.initial_angle_deg, None, own) for c, own in axis.together.items()]
        groups += [('draft', loading, None, None, own) for loading, own in axis.by_draft.items()]
        rows += [
            (level, axis.axis, *where, fit.model.equation.name, term, *fit.ratio(term), RATIO_UNITS[term])
            for level, *where, own in groups
            for fit in own
            for term in fit.model.terms
        ]
    names = f'level,axis,{LOADING_NAMES[outcome.quantity]},initial angle [deg],repeat,equation,ratio,value'.split(',')
    columns = tuple(map(Column, (*names, 'standard deviation', 'unit')))
    return Table('coefficients', 'Coefficients', 'All levels.', columns, tuple(rows))


def ranking_table(axis: AxisOutcome) -> Table:
    """Equations over the whole campaign."""
    best = axis.ranking.ranked[0].criterion
    table = Table.of(
        f'ranking_{axis.axis}',
        f'Ranking, {axis.axis}',
        'Criterion: with one set of ratios for all releases of a draft; 10 above the best is decisively worse. '
        'Held-out: '
        'error on another repeat (or the second half of a lone one) over the standard deviation of the motion.',
        axis.ranking.ranked,
        ('equation', lambda r: r.name),
        ('terms', lambda r: ' '.join(r.equation.terms)),
        ('criterion above the best', lambda r: r.criterion - best, digits(4)),
        ('smallest R2', lambda r: r.r2, digits(6)),
        ('held-out error', lambda r: r.held_out, percent),
        ('forecast error, one period', lambda r: r.forecast, percent),
        ('records fitted best', lambda r: r.best_of),
    )
    table.marks[axis.ranking.ranked.index(axis.ranking.choice), 0] = 'best'
    return table


def verdict_table(axis: AxisOutcome) -> Table:
    """What each fit of the one equation is good for: of all records of a draft together, and of each record."""
    items = [
        *((f'all at {loading:g}', fit) for loading, (fit,) in axis.by_draft.items()),
        *((record.name, fit) for record, (fit,) in zip(axis.records, axis.fits['simulation'], strict=True)),
    ]
    table = Table.of(
        f'verdicts_{axis.axis}',
        '',
        f'Of {axis.ranking.choice.name}, by all records of a draft together and by each record separately. If all '
        'together are adequate and a single record is not, this record differs from the others: look at its residual. '
        'Error of the next decay: of its forecast, in percent of its motion, to the worse side; to the side of the '
        'records where the other one is above 10 %.',
        items,
        ('fit of', lambda item: item[0]),
        ('verdict', lambda item: item[1].verdict.level),
        ('error of the next decay', lambda item: item[1].verdict.motion_error, percent),
        ('why', lambda item: item[1].verdict.sentence),
    )
    table.marks.update({(k, 1): VERDICT_MARKS[fit.verdict.level] for k, (_, fit) in enumerate(items)})
    return table


def _ratio_columns(terms: Iterable[str], pair: Callable[[Any, str], tuple[float, float]]):
    """Value and standard deviation of each term, which `pair` gives of an item and a term."""
    return (
        column
        for term in terms
        for column in (
            (f'{term} [{RATIO_UNITS[term]}]', lambda item, term=term: pair(item, term)[0], digits(5)),
            (f'{term} std', lambda item, term=term: pair(item, term)[1], digits(2)),
        )
    )


def coefficient_table(outcome: CampaignOutcome, axis: AxisOutcome) -> Table:
    """Ratios of the chosen equation: repeats together, and all records of a draft together."""
    items = [
        *((c.loading, c.initial_angle_deg, fits[axis.choice]) for c, fits in axis.together.items()),
        *((loading, 'all', fits[axis.choice]) for loading, fits in axis.by_draft.items()),
    ]
    return Table.of(
        f'ratios_{axis.axis}',
        f'Ratios to inertia, {axis.axis}',
        f'Of {axis.ranking.choice.name}; the repeats of a condition fitted together, and all records of a draft '
        f'together.',
        items,
        (LOADING_NAMES[outcome.quantity], lambda item: item[0], digits(4)),
        ('initial angle [deg]', lambda item: item[1], lambda value: str(value) if value == 'all' else f'{value:.4g}'),
        *_ratio_columns(items[0][2].model.terms, lambda item, term: item[2].ratio(term)),
    )


def correlation_table(outcome: CampaignOutcome, axis: AxisOutcome) -> Table:
    """Correlations of the ratios of the chosen equation, all records of a draft together."""
    fits = {loading: own[axis.choice] for loading, own in axis.by_draft.items()}
    terms = axis.schedule.equation.terms
    items = [(at, *pair) for at, fit in fits.items() for pair in zip(terms, correlation(fit.covariance), strict=True)]
    table = Table.of(
        f'correlation_{axis.axis}',
        '',
        'All records of a draft together. Red: ratios that the records do not separate (beyond 0.95); use them '
        'together only.',
        items,
        (LOADING_NAMES[outcome.quantity], lambda item: item[0], digits(4)),
        ('ratio', lambda item: item[1]),
        *((term, lambda item, k=k: float(item[2][k]), '{:.2f}'.format) for k, term in enumerate(terms)),
    )
    for k, (_, term, row) in enumerate(items):
        linked = np.flatnonzero(np.abs(row) > NOT_SEPARABLE).tolist()
        table.marks.update({(k, 2 + j): 'beyond' for j in linked if terms[j] != term})
    return table


def spread_table(outcome: CampaignOutcome, axis: AxisOutcome) -> Table:
    """How the repeats agree, beside what single fits state."""
    angle, loading, _ = _condition_columns(outcome, lambda s: s.condition)
    return Table.of(
        f'repeats_{axis.axis}',
        f'Agreement of repeats, {axis.axis}',
        'Spread: standard deviation. Where it is much larger than stated, something other than noise differs between '
        'repeats.',
        axis.spreads,
        loading,
        angle,
        ('quantity', lambda s: s.quantity, lambda name: QUANTITIES.get(name, name)),
        ('mean', lambda s: s.mean, digits(5)),
        ('spread between repeats', lambda s: s.spread, digits(2)),
        ('spread stated by single fits', lambda s: s.stated, digits(2)),
        ('repeats', lambda s: s.repeats),
    )


def spread_statement(axis: AxisOutcome) -> str:
    """One sentence on how the repeats agree in period and damping; empty where nothing was repeated."""
    shares = [
        percent(float(np.median([s.spread / abs(s.mean) for s in axis.spreads if s.quantity == name])), 2)
        for name in ('natural_period_s', 'damping_ratio')
        if axis.spreads
    ]
    if not shares:
        return ''
    return (
        f'Repeats agree to {shares[0]} in natural period and {shares[1]} in equivalent damping (standard deviation, '
        'median over the conditions).'
    )


def sides_table(outcome: CampaignOutcome, axis: AxisOutcome) -> Table:
    """Releases from one angle to both sides, compared: not repeats of each other."""
    rows: list[tuple] = []
    marks = {}
    for one, fits in axis.together.items():
        other = axis.together.get(replace(one, initial_angle_deg=-one.initial_angle_deg))
        if one.initial_angle_deg <= 0.0 or other is None:
            continue
        pair = fits[axis.choice], other[axis.choice]
        low, high = max(f.amplitude_range[0] for f in pair), min(f.amplitude_range[1] for f in pair)
        first, second = (f.bands.at(float(np.sqrt(low * high))) for f in pair)
        for place, quantity in enumerate(QUANTITIES.values()):
            apart = second[place] - first[place]
            spread = TWO_STD * float(np.hypot(first[place + 2], second[place + 2]))
            marks.update({(len(rows), 5): 'beyond'} if abs(apart) > spread else {})
            rows.append((one.loading, one.initial_angle_deg, quantity, first[place], second[place], apart, spread))
    columns = columns_of(
        {
            LOADING_NAMES[outcome.quantity]: digits(4),
            'initial angle [deg]': lambda angle: f'±{angle:.4g}',
            'quantity': str,
            'released to +': digits(5),
            'released to -': digits(5),
            'difference': digits(3),
            'U (k = 2)': digits(2),
        }
    )
    note = 'At the geometric mean of the amplitudes that both cover. Red: a difference beyond its uncertainty.'
    return Table(f'sides_{axis.axis}', f'Releases to both sides, {axis.axis}', note, columns, tuple(rows), marks)


def sides_statement(outcome: CampaignOutcome, axis: AxisOutcome) -> str:
    """One sentence on how releases to both sides agree; empty where all are to one side."""
    table = sides_table(outcome, axis)
    if not table.rows:
        return ''
    shares = [
        percent(max(abs(row[5] / row[3]) for row in table.rows if row[2] == name), 2) for name in QUANTITIES.values()
    ]
    is_alike = 'within' if not table.marks else 'in part beyond'
    return (
        f'Releases from the same angle to both sides differ by at most {shares[0]} in natural period and {shares[1]} '
        f'in equivalent damping, {is_alike} their uncertainty.'
    )


def errors_table(outcome: CampaignOutcome, axis: AxisOutcome, every_equation: bool = False) -> Table:
    """Errors of next step, simulated motion and forecasts, of the choice or of every equation."""
    items = [
        (record, judged)
        for record, own in zip(axis.records, axis.judgements, strict=True)
        for judged in (own if every_equation else [own[axis.choice]])
    ]
    return Table.of(
        f'errors_every_equation_{axis.axis}' if every_equation else f'errors_{axis.axis}',
        'Errors' if every_equation else f'Errors of {axis.ranking.choice.name}, {axis.axis}',
        'Root mean square errors, which contain the noise of the sensor; in percent: of the standard deviation of the '
        'measured motion. Forecasts start all '
        'along the record from the measured state, whose own noise they carry; the simulated motion starts once, at '
        'the release.',
        items,
        *_condition_columns(outcome),
        *([('equation', lambda item: item[1].equation)] if every_equation else []),
        ('next step [rad/s]', lambda item: item[1].next_step, digits(4)),
        ('simulated motion', lambda item: item[1].simulation, percent),
        *(
            (f'forecast {name} ahead', lambda item, k=k: item[1].forecasts[k], percent)
            for k, (_, name) in enumerate(zip(LEADS, LEAD_NAMES, strict=True))
        ),
        ('simulated, held out', lambda item: item[1].held_out, percent),
    )


def schedule_table(outcome: CampaignOutcome, axis: AxisOutcome) -> Table:
    """The ratios of the scheduled model at its loadings and halfway between."""
    s = axis.schedule
    shown = np.sort([*s.loadings, *(0.5 * (a + b) for a, b in pairwise(s.loadings))])
    ratios, stds = (values.tolist() for values in s.curve(shown))
    places = {term: k for k, term in enumerate(s.equation.terms)}
    return Table.of(
        f'schedule_{axis.axis}',
        f'Scheduled model, {axis.axis}',
        'Linear between the drafts that were tried; the standard deviation adds what a straight line may miss.',
        list(zip(shown.tolist(), ratios, stds, strict=True)),
        (LOADING_NAMES[outcome.quantity], lambda item: item[0], digits(5)),
        *_ratio_columns(places, lambda item, term: (item[1][places[term]], item[2][places[term]])),
    )
