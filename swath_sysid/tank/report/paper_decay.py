"""The page of a study of free decays: its tables and figures in its order, printed and obtained side by side."""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.decay_model import amplitude_curves
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import TERM_NAMES, TERMS
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.common.conventions import ROUNDING, TWO_STD, digits, percent
from swath_sysid.report.figures import LINE_STYLES, MEASURED, MODEL, RESIDUAL, SERIES, Axes, legend_below, panel
from swath_sysid.report.html_page import Drawing, bullets, figures, page, page_style, paragraph, table_as_html
from swath_sysid.report.published import PARTICULARS, citation
from swath_sysid.report.tables import Column, Table, columns_of
from swath_sysid.tank.campaign.evaluation import TIE
from swath_sysid.tank.papers.decay_study import DecayStudy
from swath_sysid.tank.report.paper_decay_claims import (
    BY,
    GENETIC,
    HULL,
    OURS,
    UNCHANGED,
    claims,
    coefficient,
    coefficient_names,
    steps_ahead,
)

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
        ('at draft factors', ', '.join(f'{f:g}' for f in p.draft_factors)),
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
        *((name, *[getattr(g, name)] * 2) for name in ('generations', 'population')),
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
        f'rad/s; the least of a row is marked, and what equals it. Printed ({p.objective.table}): with '
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
        name, factor = TERMS[term].symbol, TERMS[term].factor
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


def drawn(study: DecayStudy, kind: str) -> str:
    """The figures of one kind; nothing where the study has none."""
    return figures(
        [
            replace(drawing, caption=f'As figure {spec["number"]}: {drawing.caption}')
            for spec in study.publication.figures
            if spec['kind'] == kind
            for drawing in FIGURES[kind](study, spec)
        ]
    )


def _decays(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    figure, axes = panel(xlabel='time since release [s]', ylabel=f'{study.publication.axis} rate [rad/s]')
    for factor in study.publication.draft_factors:
        motion = study.at(factor, spec['angle_deg']).problem.motions[0]
        axes.plot(motion.time - motion.time[0], np.asarray(motion.rate), linewidth=0.9, label=f'{factor:g} T simulated')
    legend_below(axes)
    caption = f'simulated rates at three drafts, released from {spec["angle_deg"]:g} deg'
    yield Drawing('decays', caption, figure)


def _motion(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    record = study.at(spec['draft_factor'], spec['angle_deg'])
    motion, state = record.problem.motions[0], record.ours.states[0]
    searched = record.hull.from_terms(
        equation_named(study.publication.chosen), study.chosen(record).genetic.ratios, axis=motion.axis
    )
    time = motion.time - motion.time[0]
    for quantity, unit in (('angle', '[deg]'), ('rate', 'rate [deg/s]')):
        figure, axes = panel(xlabel='time since release [s]', ylabel=f'{motion.axis} {unit}')
        recorded = np.degrees(getattr(motion, quantity))
        axes.plot(time, recorded, color=MEASURED, linewidth=0.7, alpha=0.7, label='simulated record')
        for model, by, colour, style in ((searched, GENETIC, MODEL, '--'), (record.ours.model, OURS, RESIDUAL, '-')):
            own = simulate(model.with_trim(state.trim), state.x + state.trim, state.rate, motion.time)
            label = f'model by {BY[by]}'
            axes.plot(time, np.degrees(own[quantity == 'rate']), style, color=colour, label=label)
        legend_below(axes, columns=1)
        place = f'{record.angle_deg:g} deg at {record.draft_factor:g} T'
        yield Drawing(f'motion_{quantity}', f'{quantity}, simulated record and identified models, {place}', figure)


def _objective_by_equation(study: DecayStudy, _spec: dict[str, Any]) -> Iterator[Drawing]:
    p = study.publication
    places = np.arange(1, len(p.equations) + 1)
    for angle in sorted({r.angle_deg for r in study.records}):
        figure, axes = panel(title=f'from {angle:g} deg', xlabel='equation', ylabel='objective [rad/s]')
        for colour, factor in zip(SERIES, study.publication.draft_factors, strict=False):
            printed = list(p.printed_objective[factor, angle].values())
            here = [study.at(factor, angle).searched[e].genetic.value for e in p.equations]
            style: dict[str, Any] = {'color': colour, 'markersize': 4}
            hollow: dict[str, Any] = {'markerfacecolor': 'none', 'linewidth': 0.9, 'label': f'{factor:g} T printed'}
            axes.plot(places, printed, 'o--', **hollow, **style)
            axes.plot(places, here, 'o-', linewidth=1.2, label=f'{factor:g} T simulated', **style)
        axes.set_xticks(places)
        legend_below(axes)
        yield Drawing(f'objective_{angle:g}', f'objective value by equation, {angle:g} deg', figure)


def _against_angle(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    for name, (by, words) in product(spec['coefficients'], BY.items()):
        if name == "I'" and by == OURS:
            continue
        figure, axes = panel(title=f'{name} by {words}', xlabel='initial angle [deg]', ylabel=name)
        curves = zip(SERIES, study.publication.draft_factors, strict=False)
        shown = np.concatenate([_one_curve(axes, study, name, by, factor, colour) for colour, factor in curves])
        margin = 0.12 * float(np.ptp(shown)) or 0.1
        axes.set_ylim(shown.min() - margin, shown.max() + margin)
        legend_below(axes)
        given = '' if name == "I'" else f"; I' {study.inertia:g} given; dotted: the simulated hull"
        intervals = '; two standard deviations' if by == OURS else ''
        caption = f'{name} against initial angle, a curve a draft, by {words} on simulated records{given}{intervals}'
        yield Drawing(f'{name}_{by}'.replace("'", ''), caption, figure)


def _one_curve(axes: Axes, study: DecayStudy, name: str, by: str, factor: float, colour: str):
    """Draw the curve of one draft with that of the hull; the values that the figure has to show."""
    records = study.of_draft(factor)
    angles = [r.angle_deg for r in records]
    values, stds = np.array([coefficient(study, r, name, by) for r in records]).T
    hull = np.array([coefficient(study, r, name, HULL)[0] for r in records])
    style: dict[str, Any] = {'color': colour, 'marker': 'o', 'markersize': 4, 'linewidth': 1.2, 'capsize': 3}
    axes.errorbar(angles, values, TWO_STD * stds if by == OURS else None, label=f'{factor:g} T simulated', **style)
    axes.plot(angles, hull, ':', color=colour, linewidth=1.2)
    # what is not known at all must not hide the rest
    known = ~(stds > 2.0 * np.nanmax(np.abs([*hull, 0.0])))
    return np.concatenate([hull[np.isfinite(hull)], values[known], [0.0]])


def _all_coefficients(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    factor = spec['draft_factor']
    records = study.of_draft(factor)
    for by, words in BY.items():
        figure, axes = panel(title=f'{factor:g} T simulated, by {words}', xlabel='initial angle [deg]')
        styles = product(LINE_STYLES, SERIES)
        for name, (style, colour) in zip(["I'", *coefficient_names(study)], styles, strict=False):
            values = [coefficient(study, r, name, by)[0] for r in records]
            if np.isfinite(values).any():
                line = axes.plot([r.angle_deg for r in records], values, style, color=colour, linewidth=1.1)
                line[0].set(marker='o', markersize=4, label=name)
        axes.set_yscale('symlog', linthresh=1e-3)
        axes.legend(frameon=False, ncols=1, loc='center left', bbox_to_anchor=(1.0, 0.5))
        caption = f"all coefficients at {factor:g} T against initial angle, by {words}; I' {study.inertia:g} given"
        yield Drawing(f'coefficients_{factor:g}_{by}', caption, figure)


FIGURES = {
    'decays': _decays,
    'motion': _motion,
    'objective': _objective_by_equation,
    'against-angle': _against_angle,
    'coefficients': _all_coefficients,
}


def decay_page(study: DecayStudy, wall_s: float) -> str:
    """HTML of a `DecayStudy`; ``wall_s`` is how long carrying it out again took."""
    p, ahead = study.publication, next_step_table(study)
    with page_style():
        sections = [
            ('short', 'In short', [paragraph(citation(p.paper, p.authors)), bullets(_in_short(study, wall_s))]),
            ('trials', 'Model and trials', [table_as_html(particulars(study)), paragraph(_simulated(study), 'note')]),
            (
                'method',
                'Equations and search',
                [table_as_html(equations(study)), table_as_html(search_settings(study))],
            ),
            ('decays', 'Decays', [drawn(study, 'decays')]),
            ('objective', 'Objective values', [table_as_html(objective_values(study)), drawn(study, 'objective')]),
            ('chosen', 'The chosen equation', [table_as_html(coefficients(study))]),
            ('motion', 'Simulated record and identified motion', [drawn(study, 'motion')]),
            ('next-step', 'One step ahead', [table_as_html(ahead)] if ahead else []),
            ('angle', 'Coefficients', [drawn(study, 'against-angle'), drawn(study, 'coefficients')]),
            ('conclusions', 'Conclusions', [table_as_html(claims(study))]),
            ('limits', 'What cannot come out, and why', [bullets(_limits(study))]),
        ]
    return page(f'{p.title}: the study and its repetition', sections)


def _in_short(study: DecayStudy, wall_s: float):
    p, records = study.publication, study.records
    beyond = max(s.genetic.value / s.exact.value - 1.0 for r in records for s in r.searched.values())
    inside = [
        abs(value - r.hull.terms[term]) <= TWO_STD * std
        for r in records
        for term, (value, std) in ((t, r.ours.ratio(t)) for t in r.ours.model.terms)
        if std > 0.0
    ]
    printed = [min(values.values()) for values in p.printed_objective.values()]
    ratio = np.median(np.array([study.chosen(r).genetic.value for r in records]) / printed)
    repeats = 'one repeat' if p.repeats == 1 else f'the best of {p.repeats} repeats'
    return [
        f'{len(records)} simulated records, each {repeats}, and {len(p.equations)} equations: searched with the ranges '
        'and the budget of the study by genetic algorithm and by particle swarm, and fitted by the simulated motion; '
        f'{wall_s:.0f} s.',
        f'The objective values come out at {ratio:.2f} of the printed ones (median): they are the noise of the rate, '
        'one step ahead, whatever the equation.',
        f'The genetic search ends within {percent(max(beyond, 1e-6), 1)} of the exact optimum, found by bounded least '
        'squares, everywhere.',
        f'The simulated motion brings back the hull: {sum(inside)} of {len(inside)} ratios within two standard '
        f'deviations. The objective of the study does not: {_bias(study)}.',
    ]


def _bias(study: DecayStudy):
    # not of single terms: some printed ones are almost nothing
    shares = []
    for r in study.records:
        found = r.hull.from_terms(equation_named(study.publication.chosen), study.chosen(r).exact.ratios)
        released = np.radians([r.angle_deg])
        here, there = (amplitude_curves(m.ratios, released, r.hull.friction_rate) for m in (found, r.hull))
        shares.append(float(here.damping_ratio[0] / there.damping_ratio[0]))
    times = f'{np.nanmedian(shares):.3g}'
    return f'its equivalent damping at the release angle is {times} times that of the hull (median of the records)'


def _simulated(study: DecayStudy):
    powers = ', '.join(f'{term} as the power {power:g}' for term, power in study.publication.draft_powers.items())
    return (
        'The measured records were not published, so every record here is simulated: the printed hull with the same '
        'ratios at every angle, 100 Hz, white noise of the rate (the printed objective value of each record over the '
        'square root of two) and of the angle (0.001 rad). How the hull follows the draft is assumed to agree with the '
        f'conclusions of the study: {powers} of the draft.'
    )


def _limits(study: DecayStudy):
    p, pairs = study.publication, study.publication.out_of_order
    lines = [
        "I' and every coefficient multiplied by one number give the same motion, so that I' cannot come out of a free "
        "decay, nor N, W, x and C1 to C3 without it: only their ratios to I' can. The printed I' is where the search "
        'happened to stop.',
        'Under noise the objective has its least value at the wrong hull, because the rate stands on both sides of it. '
        'The smaller the angle, the larger this is against the motion, which makes coefficients seem to depend on it.',
    ]
    if pairs:
        draft, angle, big, small = pairs[0]
        values = p.printed_objective[draft, angle]
        lines.append(
            f'Printed values that are not optima: for example at {angle:g} deg and {draft:g} T, {big} with '
            f'{values[big]:.9g} rad/s although it contains {small} with {values[small]:.9g}. Such pairs: {len(pairs)}. '
            'Those digits come from the search, not from the hull.'
        )
    spread = np.median([max(v.values()) / min(v.values()) - 1.0 for v in p.printed_objective.values()])
    chance = np.median([1.0 / math.sqrt(2.0 * r.problem.motions[0].size) for r in study.records])
    lines.append(
        f'Within a record the printed values of all equations differ by {percent(spread, 2)} (median); the noise alone '
        f'moves a value by {percent(chance, 2)} between repeats. Which equation is least is decided by noise where '
        'they are closer than that.'
    )
    weak = {t for r in study.records for t in r.ours.model.terms if r.ours.std[t] > 0.5 * abs(r.hull.terms[t])}
    if weak:
        lines.append(
            f'{", ".join(sorted(weak, key=TERM_NAMES.index))}: known to worse than half of its value on at '
            'least one record; a printed trend of such a coefficient is not a finding.'
        )
    return lines
