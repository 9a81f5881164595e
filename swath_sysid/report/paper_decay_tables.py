"""The tables of a study of free decays, printed and obtained side by side."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.campaign.papers.decay_study import COEFFICIENTS, DRAFT_FACTORS, SWARM
from swath_sysid.report.campaign_extinction import PARTICULARS
from swath_sysid.report.figures import TWO_STD
from swath_sysid.report.paper_decay_numbers import (
    GENETIC,
    HULL,
    OURS,
    checked_models,
    coefficient,
    next_step_errors,
    next_steps,
    printed_steps,
    trend_of,
)
from swath_sysid.report.tables import Column, Table, digits, sentence

if TYPE_CHECKING:
    from swath_sysid.campaign.papers.decay_study import DecayStudy, StudiedRecord

NEAR_ZERO = 'near zero'
ZERO_SHARE = 0.01  #: Of the range of a coefficient; what is less is near zero.
BY_CONSTRUCTION = 'by construction'
MUCH = 3.0  #: By this factor a coefficient is much larger than another.
ROUNDING = 1e-9  #: Ratios to inertia below this are zero, to the rounding of a search.

NAMES = PARTICULARS | {
    'speed_kn': 'speed [kn]',
    'hull_separation_m': 'hull separation [m]',
    'pod_length_m': 'pod length [m]',
    'pod_diameter_m': 'pod diameter [m]',
    'strut_length_m': 'strut length [m]',
    'level_within_deg': 'level within [deg]',
    'tank_m': 'tank [m]',
}


def particulars(study: DecayStudy) -> Table:
    """The craft and its trials."""
    p = study.publication
    angles = sorted({r.angle_deg for r in study.records})
    rows = [(NAMES[key], _plain(value)) for key, value in p.craft.items() if key in NAMES]
    rows += [
        ('released from [deg]', ', '.join(f'{a:g}' for a in angles)),
        ('at draft factors', ', '.join(f'{f:g}' for f in DRAFT_FACTORS)),
        ('repeats, the best kept', str(p.repeats)),
        ('recorded [s]', f'{p.duration_s:g}'),
    ]
    return Table('particulars', p.craft['name'], 'As printed.', (Column('what'), Column('value')), tuple(rows))


def equations(study: DecayStudy) -> Table:
    """The equations and their terms."""
    rows = tuple((e, ' '.join(equation_named(e).terms)) for e in study.publication.equations)
    note = 'b: damping over inertia, linear, quadratic, cubic; r: restoring over inertia; s: sine and sine squared.'
    return Table('equations', 'Equations', note, (Column('equation'), Column('terms')), rows)


def search_settings(study: DecayStudy) -> Table:
    """The settings of both searches."""
    preset = PRESETS[study.publication.name]
    g = preset.genetic
    only_genetic = 'crossover', 'mutation', 'final_mutation', 'genetic_factor', 'evolution_weight'
    ranges = {"I'": preset.inertia, 'N and W': preset.damping, 'x, C1, C2, C3': preset.restoring}
    rows = (
        *((name, getattr(g, name), SWARM[name]) for name in ('generations', 'population')),
        *((name.replace('_', ' '), getattr(g, name), None) for name in only_genetic),
        *((f'range of {names}', *[f'0 to {limit:g}'] * 2) for names, limit in ranges.items()),
    )
    shown = Column('genetic algorithm', _plain), Column('particle swarm', _plain)
    note = 'Genetic algorithm: as printed. Particle swarm: the same ranges, stopped when it stagnates.'
    return Table('search', 'Search', note, (Column('setting'), *shown), rows)


def _plain(value: Any):
    return '-' if value is None else f'{value:g}' if isinstance(value, float) else str(value)


def objective_values(study: DecayStudy) -> Table:
    """The least objective values, printed and obtained."""
    p = study.publication
    rows: list[tuple] = []
    marks: dict[tuple[int, int], str] = {}
    for record in study.records:
        printed = p.printed_objective[record.draft_factor, record.angle_deg]
        kinds = {
            'printed': [printed[e] for e in p.equations],
            'genetic': [record.searched[e].genetic.value for e in p.equations],
            'swarm': [record.searched[e].swarm.value for e in p.equations],
            'least possible': [record.searched[e].exact.value for e in p.equations],
        }
        for kind, values in kinds.items():
            marks |= {(len(rows), 3 + k): 'best' for k, v in enumerate(values) if v <= min(values) * (1.0 + 1e-7)}
            rows.append((f'{record.angle_deg:g} deg', f'{record.draft_factor:g} T', kind, *values))
    columns = (Column('from'), Column('at'), Column('value'), *(Column(e, digits(7)) for e in p.equations))
    note = (
        f'{sentence(p.objective.table)}, rad/s; the least of a row is marked, with all that '
        'equal it to 1e-7. Printed: with its own records; the others: with those simulated here.'
    )
    return Table('objective', 'Objective values by equation, angle and draft', note, columns, tuple(rows), marks)


def coefficients(study: DecayStudy) -> Table:
    """The coefficients of the chosen equation on one record, by each method; I' with what each search stopped at."""
    printed, inertia = study.publication.coefficients, study.inertia
    record = study.at(printed.draft_factor, printed.angle_deg)
    chosen, form = study.chosen(record), printed.published_form
    rows: list[tuple] = [("I'", form.get("I'"), None, chosen.genetic.inertia, chosen.swarm.inertia, *[None] * 4)]
    for term in equation_named(study.publication.chosen).terms:
        name, factor = COEFFICIENTS[term]
        value, std = record.ours.ratio(term)
        searched = [found.ratios[term] for found in (chosen.genetic, chosen.swarm, chosen.exact)]
        ratio = form[name] / inertia / factor if form else printed.ratios[term]
        label = f"{term} ({1.0 / factor:g} {name}/I')".replace('(1 ', '(')
        rows.append((label, form.get(name), ratio, *searched, value, TWO_STD * std, record.hull.terms[term]))
    names = 'as printed', 'printed', 'genetic', 'swarm', 'exact optimum of the objective', 'simulated motion'
    columns = (
        Column('ratio to inertia'),
        *(Column(name, _ratio_shown) for name in names),
        Column('+- 2 std', digits(2)),
        Column('the simulated hull', _ratio_shown),
    )
    stopped = ', '.join(f'{i:.4f}' for i in (chosen.genetic.inertia, *study.inertias))
    assumed = '' if "I'" in form else ' (assumed)'
    note = (
        f"{study.publication.chosen}, {printed.angle_deg:g} deg, {printed.draft_factor:g} T ({printed.table}), over I' "
        f"= {inertia:g}{assumed}. Searches with four seeds stop at I' = {stopped}, with "
        'the same objective value: the motion determines only the ratios.'
    )
    return Table('coefficients', 'Coefficients of the chosen equation', note, columns, tuple(rows))


def _ratio_shown(value: Any):
    return '0' if value is not None and abs(value) < ROUNDING else digits(6)(value)


def next_step_table(study: DecayStudy) -> Table:
    """The rate one step ahead at the times that the study prints."""
    printed, (record, models) = printed_steps(study), checked_models(study)
    _, measured, by_search = next_steps(study, record, models[0])
    by_ours, unchanged = (next_steps(study, record, ratios)[2] for ratios in models[1:])
    errors = [100.0 * np.abs(v / measured - 1.0) for v in (by_search, by_ours, unchanged)]
    rows = [(*row, *map(float, here)) for row, *here in zip(printed.rows, measured, by_search, *errors, strict=True)]
    columns = (
        Column('time [s]', digits(3)),
        *(Column(f'printed {what} [rad/s]', digits(6)) for what in ('measured', 'identified')),
        Column('printed error [%]', digits(3)),
        *(Column(f'{what} here [rad/s]', digits(6)) for what in ('simulated', 'identified')),
        *(Column(f'{what} [%]', digits(3)) for what in ('error here', 'simulated-motion model', 'no change at all')),
    )
    note = (
        f'{sentence(printed.table)}: {printed.angle_deg:g} deg, {printed.draft_factor:g} T, '
        f'{study.publication.chosen}. No change at all: the rate measured before stands for the next.'
    )
    return Table('next_step', 'Rate one step ahead', note, columns, tuple(rows))


def claims(study: DecayStudy) -> Table:
    """What the study concludes, and whether it holds here."""
    rows: list[tuple] = []
    marks: dict[tuple[int, int], str] = {}
    for claim in study.publication.claims:
        answers = CLAIMS[claim['kind']](study, claim)
        marks[len(rows), len(answers)] = verdict_mark(answers[-1])
        rows.append((claim['text'], *answers))
    names = 'the study concludes', "by the study's method here", 'by the simulated motion', 'the simulated hull'
    columns = tuple(map(Column, (*names, 'holds here')))
    note = (
        'One curve per angle or draft. A conclusion holds here where the method shows it and the hull has it. The '
        'simulated hull is the chosen equation, has the same coefficients at every angle, and follows the draft as the '
        "study concludes: a trend with the angle that the study's method shows here comes from the method, and a "
        'conclusion on the equation or the draft holds by construction, which confirms nothing.'
    )
    return Table('claims', 'Conclusions of the study, and whether they hold here', note, columns, tuple(rows), marks)


def verdict_mark(verdict: str) -> str:
    """How a verdict on a conclusion is marked."""
    return '' if verdict == BY_CONSTRUCTION else 'best' if verdict.startswith('yes') else 'beyond'


def _claim_least(study: DecayStudy, claim: dict[str, Any]):
    def least(tables: Iterable[dict[str, float]]):
        return sum(t[claim['equation']] <= min(t.values()) * (1.0 + 1e-7) for t in tables)

    printed, count = least(study.publication.printed_objective.values()), len(study.records)
    here = least({e: s.genetic.value for e, s in r.searched.items()} for r in study.records)
    return f'in {here} of {count} records; in the printed table in {printed}', '-', '-', _verdict(here, count, True)


def _claim_next_step(study: DecayStudy, claim: dict[str, Any]):
    record, models = checked_models(study)
    found = [100.0 * next_step_errors(study, record, ratios).max() for ratios in models]
    return (
        f'at most {found[0]:.3g} %; no change at all: {found[2]:.3g} %',
        f'at most {found[1]:.3g} %',
        '-',
        'yes' if found[0] <= claim['percent'] else 'no',
    )


def _claim_trend(study: DecayStudy, claim: dict[str, Any]):
    drafts = claim.get('draft_factors', DRAFT_FACTORS)
    angles = claim.get('angles_deg', sorted({r.angle_deg for r in study.records}))
    curves = [[(f, a) for a in angles] for f in drafts]
    if claim['against'] == 'draft':
        curves = [list(curve) for curve in zip(*curves, strict=True)]
    found = {}
    for by in (GENETIC, OURS, HULL):
        values = [
            [coefficient(study, study.at(*place), claim['coefficient'], by)[0] for place in curve] for curve in curves
        ]
        trends = [trend_of(v) for v in values]
        if claim['direction'] == NEAR_ZERO:
            trends = [
                NEAR_ZERO if max(map(abs, v)) < ZERO_SHARE * PRESETS[study.publication.name].damping else t
                for v, t in zip(values, trends, strict=True)
            ]
        found[by] = (sum(t == claim['direction'] for t in trends), trends)
    if claim['coefficient'] == "I'":
        return _curves(found[GENETIC]), '-', '-', 'no: any value fits alike'
    assumed = claim['against'] == 'draft'
    verdict = _verdict(min(found[GENETIC][0], found[HULL][0]), len(curves), assumed)
    return *(_curves(found[by]) for by in (GENETIC, OURS, HULL)), verdict


def _curves(found: tuple[int, list[str]]):
    holds, trends = found
    if len(trends) == 1:
        return trends[0]
    return f'{holds} of {len(trends)} curves ({", ".join(trends)})'


def _verdict(holds: int, count: int, by_construction: bool = False):
    if holds == count:
        return BY_CONSTRUCTION if by_construction else 'yes'
    return 'no' if holds == 0 else f'in {holds} of {count}'


def _claim_decays(study: DecayStudy, claim: dict[str, Any]):
    records = [study.at(factor, claim['angle_deg']) for factor in DRAFT_FACTORS]
    peaks = [
        float(np.abs(simulate(r.hull, np.radians(r.angle_deg), 0.0, r.problem.motions[0].time)[1]).max())
        for r in records
    ]
    periods = [r.hull.natural_period for r in records]
    alike = trend_of(peaks, 0.0) == claim['peak'], trend_of(periods, 0.0) == claim['period']
    peak, period = (', '.join(map(digits(3), values)) for values in (peaks, periods))
    return '-', '-', f'peak {peak} rad/s, period {period} s', _verdict(sum(alike), 2, True)


def _claim_larger(study: DecayStudy, claim: dict[str, Any]):
    def times(record: StudiedRecord, by: str):
        larger, smaller = (coefficient(study, record, claim[key], by)[0] for key in ('coefficient', 'than'))
        return larger / max(smaller, ROUNDING)

    least = [min(times(r, by) for r in study.of_draft(claim['draft_factor'])) for by in (GENETIC, OURS, HULL)]
    return *(f'at least {v:.2g} times' for v in least), 'yes' if min(least[0], least[2]) > MUCH else 'no'


CLAIMS = {
    'least': _claim_least,
    'next-step': _claim_next_step,
    'trend': _claim_trend,
    'decays': _claim_decays,
    'larger': _claim_larger,
    'remark': lambda study, claim: ('-', '-', '-', claim['why']),
}
