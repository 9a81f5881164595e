"""What is compared in a study of free decays: coefficients, rates one step ahead, and its conclusions."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import TERMS
from swath_sysid.attitude.identification.forecast_check import next_step
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.common.conventions import ROUNDING, digits, percent
from swath_sysid.report.published import BY_CONSTRUCTION, verdict_mark
from swath_sysid.report.tables import Column, Table
from swath_sysid.tank.campaign.evaluation import TIE
from swath_sysid.tank.papers.decay_study import DecayStudy, StudiedRecord

STEADY = 0.2  #: A curve that changes by less than this share of its largest value hardly changes.
ZERO_SHARE = 0.01  #: Of the range of a coefficient; what is less is near zero.
MUCH = 3.0  #: By this factor a coefficient is much larger than another.

NEAR_ZERO, CONSTANT = 'near zero', 'steady'
GENETIC, OURS, HULL, UNCHANGED = 'genetic', 'ours', 'hull', 'unchanged'
BY = {GENETIC: "the study's method", OURS: 'the simulated motion'}


def coefficient(study: DecayStudy, record: StudiedRecord, name: str, by: str) -> tuple[float, float]:
    """Value and standard deviation of N, W, x, C1 to C3 with the study's inertia, or of I' of its search; NaN: none."""
    nothing = float('nan'), float('nan')
    if name == "I'":
        return (study.chosen(record).genetic.inertia, float('nan')) if by == GENETIC else nothing
    values = {GENETIC: study.chosen(record).genetic.ratios, OURS: record.ours.model.terms, HULL: record.hull.terms}[by]
    for term, value in values.items():
        if TERMS[term].symbol == name:
            scale, std = study.inertia * TERMS[term].factor, record.ours.std[term] if by == OURS else float('nan')
            return scale * value, scale * std
    return nothing


def coefficient_names(study: DecayStudy) -> list[str]:
    """Names of the coefficients of the chosen equation, as the study orders them."""
    used = {TERMS[t].symbol for t in equation_named(study.publication.chosen).terms}
    return [name for name in ('N', 'W', 'x', 'C1', 'C2', 'C3') if name in used]


def trend_of(values: ArrayLike, steady: float = STEADY) -> str:
    """How a curve runs: ``falls``, ``rises then falls``, ``mixed``; ``steady`` within a share of its largest value."""
    values = np.asarray(values, dtype=float)
    if np.ptp(values) <= steady * np.abs(values).max():
        return CONSTANT
    ways = ['rises' if step > 0.0 else 'falls' for step in np.diff(values) if step]
    turns = [way for k, way in enumerate(ways) if way != ways[k - 1] or k == 0]
    return ' then '.join(turns) if len(turns) <= 2 else 'mixed'


@dataclass(frozen=True)
class StepsAhead:
    """The rate one step ahead at the times that the study prints; each shape (N,)."""

    simulated: np.ndarray  #: rad/s.
    predicted: dict[str, np.ndarray]  #: By method, rad/s; ``UNCHANGED``: the rate of the sample before.

    def error(self, by: str) -> np.ndarray:
        """Relative, without its sign."""
        return np.abs(self.predicted[by] / self.simulated - 1.0)


def steps_ahead(study: DecayStudy) -> StepsAhead | None:
    """The printed check one step ahead, carried out again; None where the study prints none."""
    printed = study.publication.next_step
    if printed is None:
        return None
    record = study.at(printed.draft_factor, printed.angle_deg)
    motion, trim = record.problem.motions[0], record.problem.states[0].trim
    equation, ratios = (
        equation_named(study.publication.chosen),
        {GENETIC: study.chosen(record).genetic.ratios, OURS: record.ours.model.terms},
    )
    found = {by: next_step(record.hull.from_terms(equation, each, trim=trim), motion) for by, each in ratios.items()}
    since = found[OURS].time - motion.time[0]
    at = [int(np.argmin(np.abs(since - row[0]))) for row in printed.rows]
    predicted = {by: each.predicted[at] for by, each in found.items()}
    return StepsAhead(found[OURS].measured[at], predicted | {UNCHANGED: np.asarray(motion.rate)[at]})


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
        'simulated hull is the chosen equation with the printed coefficients, the same at every angle, and follows the '
        "draft as the study concludes. A trend with the angle that the study's method shows here therefore comes from "
        'the method, and what the simulated hull has been given holds by construction, which confirms nothing.'
    )
    return Table('claims', '', note, columns, tuple(rows), marks)


def _claim_least(study: DecayStudy, claim: dict[str, Any]):
    def least(tables: Iterable[dict[str, float]]):
        return sum(t[claim['equation']] <= min(t.values()) * (1.0 + TIE) for t in tables)

    printed, count = least(study.publication.printed_objective.values()), len(study.records)
    here = least({e: s.genetic.value for e, s in r.searched.items()} for r in study.records)
    return f'in {here} of {count} records; in the printed table in {printed}', '', '', _verdict(here, count, True)


def _claim_next_step(study: DecayStudy, claim: dict[str, Any]):
    found = steps_ahead(study)
    assert found is not None, 'a study that prints no check concludes nothing of it'
    most = {by: float(found.error(by).max()) for by in (GENETIC, OURS, UNCHANGED)}
    verdict = 'no' if most[GENETIC] > claim['percent'] / 100.0 else 'yes'
    by_method = f'at most {percent(most[GENETIC])}; no change at all: {percent(most[UNCHANGED])}'
    return by_method, f'at most {percent(most[OURS])}', '', verdict


def _claim_trend(study: DecayStudy, claim: dict[str, Any]):
    drafts = claim.get('draft_factors', study.publication.draft_factors)
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
        return _curves(found[GENETIC]), '', '', 'no: any value fits alike'
    # the simulated hull follows the draft as concluded, and is the same at every angle
    assumed = claim['against'] == 'draft' or claim['direction'] in (CONSTANT, NEAR_ZERO)
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
    records = [study.at(factor, claim['angle_deg']) for factor in study.publication.draft_factors]
    peaks = [
        float(np.abs(simulate(r.hull, np.radians(r.angle_deg), 0.0, r.problem.motions[0].time)[1]).max())
        for r in records
    ]
    periods = [r.hull.natural_period for r in records]
    alike = trend_of(peaks, 0.0) == claim['peak'], trend_of(periods, 0.0) == claim['period']
    peak, period = (', '.join(map(digits(3), values)) for values in (peaks, periods))
    return '', '', f'peak {peak} rad/s, period {period} s', _verdict(sum(alike), 2, True)


def _claim_larger(study: DecayStudy, claim: dict[str, Any]):
    def times(record: StudiedRecord, by: str):
        larger, smaller = (coefficient(study, record, claim[key], by)[0] for key in ('coefficient', 'than'))
        return larger / max(smaller, ROUNDING)

    least = [min(times(r, by) for r in study.of_draft(claim['draft_factor'])) for by in (GENETIC, OURS, HULL)]
    return *(f'at least {v:.3g} times' for v in least), BY_CONSTRUCTION if min(least[0], least[2]) > MUCH else 'no'


CLAIMS = {
    'least': _claim_least,
    'next-step': _claim_next_step,
    'trend': _claim_trend,
    'decays': _claim_decays,
    'larger': _claim_larger,
    'remark': lambda study, claim: ('', '', '', claim['why']),
}
