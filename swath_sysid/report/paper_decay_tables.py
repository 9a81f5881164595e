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
from swath_sysid.report.tables import Column, Table, digits

if TYPE_CHECKING:
    from swath_sysid.campaign.papers.decay_study import DecayStudy, StudiedRecord

NEAR_ZERO = 'near zero'
ZERO_SHARE = 0.01  #: Of the range of a coefficient; what is less is near zero.
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
    rows = (
        ('generations', g.generations, SWARM['generations']),
        ('population', g.population, SWARM['population']),
        ('crossover', g.crossover, None),
        ('mutation', g.mutation, None),
        ('last mutation', g.final_mutation, None),
        ('genetic factor', g.genetic_factor, None),
        ('evolution weight', g.evolution_weight, None),
        ("range of I'", f'0 to {preset.inertia:g}', f'0 to {preset.inertia:g}'),
        ('range of N and W', f'0 to {preset.damping:g}', f'0 to {preset.damping:g}'),
        ('range of x, C1, C2, C3', f'0 to {preset.restoring:g}', f'0 to {preset.restoring:g}'),
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
        f'{p.objective.table[0].upper()}{p.objective.table[1:]}, rad/s; the least of a row is marked, with all that '
        'equal it to 1e-7. Printed: with its own records; the others: with those simulated here.'
    )
    return Table('objective', 'Objective values by equation, angle and draft', note, columns, tuple(rows), marks)


def coefficients(study: DecayStudy) -> Table:
    """The coefficients of the chosen equation on one record, by each method."""
    printed = study.publication.coefficients
    record = study.at(printed.draft_factor, printed.angle_deg)
    inertia = study.inertia
    rows = []
    chosen = study.chosen(record)
    for term in equation_named(study.publication.chosen).terms:
        name, factor = COEFFICIENTS[term]
        form = printed.published_form
        given = form[name] / inertia / factor if form else printed.ratios[term]
        value, std = record.ours.ratio(term)
        rows.append(
            (
                f'{term} ({_in_words(name, factor)})',
                given,
                chosen.genetic.ratios[term],
                chosen.swarm.ratios[term],
                chosen.exact.ratios[term],
                value,
                TWO_STD * std,
                record.hull.terms[term],
            )
        )
    names = 'printed', 'genetic', 'swarm', 'exact optimum of the objective', 'simulated motion'
    columns = (
        Column('ratio to inertia'),
        *(Column(name, _ratio_shown) for name in names),
        Column('+- 2 std', digits(2)),
        Column('the simulated hull', _ratio_shown),
    )
    assumed = '' if "I'" in printed.published_form else ' (assumed)'
    stopped = ', '.join(f'{i:.4f}' for i in (chosen.genetic.inertia, *study.inertias))
    note = (
        f"{study.publication.chosen}, {printed.angle_deg:g} deg, {printed.draft_factor:g} T ({printed.table}), over I' "
        f"= {inertia:g}{assumed}. Searches with four seeds stop at I' = "
        f'{stopped}, with the same objective value: the motion determines only the ratios.'
    )
    return Table('coefficients', 'Coefficients of the chosen equation', note, columns, tuple(rows))


def printed_form(study: DecayStudy) -> Table | None:
    """The same coefficients as the study prints them, with an inertia; None where it prints ratios alone."""
    printed = study.publication.coefficients
    if not printed.published_form:
        return None
    record, inertia = study.at(printed.draft_factor, printed.angle_deg), study.inertia
    form, searches = printed.published_form, (study.chosen(record).genetic, study.chosen(record).swarm)
    rows: list[tuple] = [("I'", form.get("I'"), *(s.inertia for s in searches), None, None)]
    for term in equation_named(study.publication.chosen).terms:
        name, factor = COEFFICIENTS[term]
        value, std = record.ours.ratio(term)
        rows.append(
            (
                name,
                form[name],
                *(s.ratios[term] * s.inertia * factor for s in searches),
                value * inertia * factor,
                TWO_STD * std * inertia * factor,
            )
        )
    names = 'printed', 'genetic', 'swarm', 'simulated motion'
    columns = Column('coefficient'), *(Column(name, _ratio_shown) for name in names), Column('+- 2 std', digits(2))
    note = (
        f"{printed.table[0].upper()}{printed.table[1:]}. The searches with the I' at which each happened to stop, the "
        f"simulated motion with I' = {inertia:g} given."
    )
    return Table('printed_form', 'Coefficients as printed', note, columns, tuple(rows))


def _ratio_shown(value: Any):
    return '0' if value is not None and abs(value) < ROUNDING else digits(6)(value)


def _in_words(name: str, factor: float):
    return f"{1.0 / factor:g} {name}/I'" if factor != 1.0 else f"{name}/I'"


def next_step_table(study: DecayStudy) -> Table:
    """The rate one step ahead at the times that the study prints."""
    printed, (record, models) = printed_steps(study), checked_models(study)
    _, measured, by_search = next_steps(study, record, models[0])
    by_ours, unchanged = (next_steps(study, record, ratios)[2] for ratios in models[1:])
    rows = []
    for k, (t, was, identified, error) in enumerate(printed.rows):
        rows.append(
            (
                t,
                was,
                identified,
                error,
                float(measured[k]),
                float(by_search[k]),
                *(100.0 * abs(float(v[k] - measured[k]) / float(measured[k])) for v in (by_search, by_ours, unchanged)),
            )
        )
    percent = digits(3)
    columns = (
        Column('time [s]', digits(3)),
        Column('printed measured [rad/s]', digits(6)),
        Column('printed identified [rad/s]', digits(6)),
        Column('printed error [%]', percent),
        Column('measured here [rad/s]', digits(6)),
        Column('identified here [rad/s]', digits(6)),
        Column('error here [%]', percent),
        Column('simulated-motion model [%]', percent),
        Column('no change at all [%]', percent),
    )
    note = (
        f'{printed.table[0].upper()}{printed.table[1:]}: {printed.angle_deg:g} deg, {printed.draft_factor:g} T, '
        f'{study.publication.chosen}. No change at all: the rate measured before stands for the next.'
    )
    return Table('next_step', 'Rate one step ahead', note, columns, tuple(rows))


def claims(study: DecayStudy) -> Table:
    """What the study concludes, and whether it holds here."""
    rows: list[tuple] = []
    marks: dict[tuple[int, int], str] = {}
    for claim in study.publication.claims:
        answers = CLAIMS[claim['kind']](study, claim)
        marks[len(rows), len(answers)] = 'best' if answers[-1].startswith('yes') else 'beyond'
        rows.append((claim['text'], *answers))
    columns = (
        Column('the study concludes'),
        Column("by the study's method here"),
        Column('by the simulated motion'),
        Column('the simulated hull'),
        Column('holds here'),
    )
    note = (
        'Curves: an angle or a draft each. The simulated hull has the same coefficients at every angle: a trend with '
        "the angle that the study's method shows here comes from the method. A conclusion holds here where the method "
        'shows it and the hull has it. How the hull follows the draft is assumed, so as the study concludes; whether '
        'the methods show it is the question.'
    )
    return Table('claims', 'Conclusions of the study, and whether they hold here', note, columns, tuple(rows), marks)


def _claim_least(study: DecayStudy, claim: dict[str, Any]):
    def share(tables: Iterable[dict[str, float]]):
        least = [t[claim['equation']] <= min(t.values()) * (1.0 + 1e-7) for t in tables]
        return sum(least), len(least)

    printed, count = share(study.publication.printed_objective.values())
    here, _ = share([{e: s.genetic.value for e, s in r.searched.items()} for r in study.records])
    return f'in {here} of {count} records; in the printed table in {printed}', '-', '-', _verdict(here, count)


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
    verdict = _verdict(min(found[GENETIC][0], found[HULL][0]), len(curves))
    return *(_curves(found[by]) for by in (GENETIC, OURS, HULL)), verdict


def _curves(found: tuple[int, list[str]]):
    holds, trends = found
    if len(trends) == 1:
        return trends[0]
    return f'{holds} of {len(trends)} curves ({", ".join(trends)})'


def _verdict(holds: int, count: int):
    return 'yes' if holds == count else 'no' if holds == 0 else f'in {holds} of {count}'


def _claim_decays(study: DecayStudy, claim: dict[str, Any]):
    records = [study.at(factor, claim['angle_deg']) for factor in DRAFT_FACTORS]
    peaks = [
        float(np.abs(simulate(r.hull, np.radians(r.angle_deg), 0.0, r.problem.motions[0].time)[1]).max())
        for r in records
    ]
    periods = [r.hull.natural_period for r in records]
    alike = [trend_of(peaks, 0.0) == claim['peak'], trend_of(periods, 0.0) == claim['period']]
    shown = f'peak {_listed(peaks)} rad/s, period {_listed(periods)} s'
    return '-', '-', shown, ('yes' if all(alike) else 'in part' if any(alike) else 'no') + ', as assumed'


def _listed(values: Iterable[float]):
    return ', '.join(digits(3)(v) for v in values)


def _claim_larger(study: DecayStudy, claim: dict[str, Any]):
    def times(record: StudiedRecord, by: str):
        larger, smaller = (coefficient(study, record, claim[key], by)[0] for key in ('coefficient', 'than'))
        return larger / max(smaller, ROUNDING)

    records = [r for r in study.records if r.draft_factor == claim['draft_factor']]
    least = [min(times(r, by) for r in records) for by in (GENETIC, OURS, HULL)]
    return *(f'at least {v:.2g} times' for v in least), 'yes' if min(least[0], least[2]) > MUCH else 'no'


def _claim_remark(study: DecayStudy, claim: dict[str, Any]):
    return '-', '-', '-', claim['why']


CLAIMS = {
    'least': _claim_least,
    'next-step': _claim_next_step,
    'trend': _claim_trend,
    'decays': _claim_decays,
    'larger': _claim_larger,
    'remark': _claim_remark,
}
