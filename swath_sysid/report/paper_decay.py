"""The page of a study of free decays: its tables and figures in its order, printed and obtained side by side."""

import math

import numpy as np

from swath_sysid.attitude.hull.amplitude import amplitude_curves
from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.campaign.papers.decay_study import COEFFICIENTS, DecayStudy
from swath_sysid.campaign.papers.publication import citation
from swath_sysid.common.rounding import percent
from swath_sysid.report.figures import TWO_STD
from swath_sysid.report.html_page import bullets, page, page_style, paragraph, table_as_html
from swath_sysid.report.paper_decay_claims import claims
from swath_sysid.report.paper_decay_figures import drawn
from swath_sysid.report.paper_decay_tables import (
    coefficients,
    equations,
    next_step_table,
    objective_values,
    particulars,
    search_settings,
)


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
    contained = sum(
        big != small and equation_named(big).contains(equation_named(small))
        for big in p.equations
        for small in p.equations
    )
    beyond = max(s.genetic.value / s.exact.value - 1.0 for r in records for s in r.searched.values())
    inside = [
        abs(value - r.hull.terms[term]) <= TWO_STD * std
        for r in records
        for term, (value, std) in ((t, r.ours.ratio(t)) for t in r.ours.model.terms)
        if std > 0.0
    ]
    printed = [min(values.values()) for values in p.printed_objective.values()]
    ratio = np.median(np.array([study.chosen(r).genetic.value for r in records]) / printed)
    repeats = 'one repeat' if p.repeats == 1 else f'the best of {p.repeats}'
    return [
        f'{len(records)} simulated records, each {repeats}, {len(p.equations)} equations: searched with the ranges and '
        'the budget of the study by genetic algorithm and by particle swarm, and fitted by the simulated motion; '
        f'{wall_s:.0f} s.',
        f'The objective values come out at {ratio:.2f} of the printed ones (median): they are the noise of the rate, '
        'one step ahead, whatever the equation.',
        f'In the printed table an equation is worse than one that it contains in {len(p.out_of_order)} of '
        f'{contained * len(records)} comparisons, which no converged search can be. Here the genetic search ends '
        f'within {percent(max(beyond, 1e-6), 1)} of the exact optimum, found by bounded least squares, everywhere.',
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
            f'{", ".join(sorted(weak, key=list(COEFFICIENTS).index))}: known to worse than half of its value on at '
            'least one record; a printed trend of such a coefficient is not a finding.'
        )
    return lines
