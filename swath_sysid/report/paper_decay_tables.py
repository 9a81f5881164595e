"""The tables of a study of free decays, printed and obtained side by side."""

from typing import Any

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.campaign.evaluation import TIE
from swath_sysid.campaign.papers.decay_study import COEFFICIENTS, DRAFT_FACTORS, SWARM, DecayStudy
from swath_sysid.common.rounding import digits
from swath_sysid.report.campaign_extinction import PARTICULARS
from swath_sysid.report.figures import TWO_STD
from swath_sysid.report.paper_decay_claims import GENETIC, OURS, ROUNDING, UNCHANGED, steps_ahead
from swath_sysid.report.tables import Column, Table, columns_of

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
            marks |= {(len(rows), 3 + k): 'best' for k, v in enumerate(values) if v <= min(values) * (1.0 + TIE)}
            rows.append((f'{record.angle_deg:g} deg', f'{record.draft_factor:g} T', kind, *values))
    columns = (Column('from'), Column('at'), Column('value'), *(Column(e, digits(7)) for e in p.equations))
    note = (
        f'rad/s; the least of a row is marked, with all that equal it to {TIE:g}. Printed ({p.objective.table}): with '
        'its own records; the others: with those simulated here.'
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


def next_step_table(study: DecayStudy) -> Table | None:
    """The rate one step ahead at the times that the study prints."""
    printed, here = study.publication.next_step, steps_ahead(study)
    if printed is None or here is None:
        return None
    found = [here.simulated, here.predicted[GENETIC], *(100.0 * here.error(by) for by in (GENETIC, OURS, UNCHANGED))]
    rows = [(*row, *map(float, values)) for row, *values in zip(printed.rows, *found, strict=True)]
    columns = columns_of(
        {
            'time [s]': digits(3),
            'printed measured [rad/s]': digits(6),
            'printed identified [rad/s]': digits(6),
            'printed error [%]': digits(3),
            'simulated here [rad/s]': digits(6),
            'identified here [rad/s]': digits(6),
            'error here [%]': digits(3),
            'simulated-motion model [%]': digits(3),
            'no change at all [%]': digits(3),
        }
    )
    note = (
        f'Printed in {printed.table}: {printed.angle_deg:g} deg, {printed.draft_factor:g} T, '
        f'{study.publication.chosen}. No change at all: the rate simulated before stands for the next.'
    )
    return Table('next_step', 'Rate one step ahead', note, columns, tuple(rows))
