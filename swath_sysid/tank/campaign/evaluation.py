"""The tasks of a campaign, pure functions of plain arguments that any process may run, and what follows from them.

`fit_one` searches one record with one equation, `settle` refits where a search failed, `fit_together` fits common
ratios to several records, `judge` scores the fits of a record. Where the manifest names no equation, `fit_one` of the
general hull on all records of a draft jointly precedes them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.hull.catalogue import composed
from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.identification.forecast_check import forecast_errors, next_step, simulation_error
from swath_sysid.attitude.identification.identify import identify_problem, refit_from
from swath_sysid.attitude.identification.problem import Problem, motion_fit, problem_of
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
from swath_sysid.attitude.identification.search import SearchResult
from swath_sysid.attitude.identification.selection import (
    enforce_nesting,
    held_out_error,
    information_criterion,
    simplest_adequate,
)
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import ADEQUATE, CONFIDENCE, CRITERION_MARGIN, percent
from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import as_plain

TIE = 1e-7  #: Relative difference of objective values below which they are equal.


@dataclass(frozen=True, order=True)
class Condition:
    """What the repeats of a trial have in common; its loading is the same quantity throughout a campaign."""

    axis: str
    loading: float
    initial_angle_deg: float
    speed_m_s: float = 0.0

    def __str__(self) -> str:
        under_way = f', {self.speed_m_s:g} m/s' if self.speed_m_s else ''
        return f'{self.axis} {self.initial_angle_deg:g} deg at {self.loading:g}{under_way}'

    @property
    def series(self) -> str:
        """Name of what is ranked and scheduled by itself: the axis, under way with its speed."""
        return f'{self.axis}_{self.speed_m_s:g}m_s' if self.speed_m_s else self.axis


@dataclass(frozen=True)
class TankRecord:
    """One trial, ready to be fitted; its problem holds this record alone."""

    name: str
    condition: Condition
    repeat: int
    motion: AxisMotion  #: The whole record.
    problem: Problem

    def __str__(self) -> str:
        return f'{self.condition}, repeat {self.repeat}'


def joint_problem(records: Sequence[TankRecord]) -> Problem:
    """One problem of several records of one axis, side by side."""
    if len(records) == 1:
        return records[0].problem
    return problem_of([r.motion for r in records], tuple(s for r in records for s in r.problem.segments))


def fit_one(problem: Problem, settings: IdentificationSettings) -> dict:
    """Identify one equation on one record, as plain data; see `identify_problem`."""
    return identify_problem(problem, settings).plain()


def settle(problem: Problem, fits: Sequence[Identification]) -> list[dict]:
    """Fits of one problem with every equation, each refined from that of a contained equation where it is worse."""

    def refit(fit: Identification, better: Identification) -> Identification:
        tried = replace(fit.search, best=np.empty(0), value=float('nan'), stop='refined')
        return refit_from(problem, fit.settings, better.model.ratios, better.states, tried)

    return [fit.plain() for fit in enforce_nesting(fits, refit)]


def fit_together(problem: Problem, starts: Sequence[Identification]) -> dict:
    """Fit common ratios to several records, each with its own initial state, from their single fits of one equation:
    at the optimum of the record with the largest motion, which shows the most of every term. As plain data.
    """
    largest = max(starts, key=lambda start: start.amplitude_range[1])
    states = [state for start in starts for state in start.states]
    search = SearchResult(np.empty(0), float('nan'), 0, 0, 'refined')
    return refit_from(problem, largest.settings, largest.model.ratios, states, search).plain()


@dataclass(frozen=True)
class FitJudgement:
    """How well one fit of a record does what a model is for."""

    equation: str
    next_step: float  #: Root mean square error of the rate one sample ahead, rad/s.
    simulation: float  #: Error of the simulated motion over the standard deviation of the measured one.
    forecasts: tuple[float, ...]  #: The same a quarter, a half and one period ahead; NaN where the record is too short.
    held_out: float  #: The same on another repeat, or on the second half of the record by a model of the first.


def judge(fits: Sequence[Identification], other: Problem | None) -> list[dict]:
    """A `FitJudgement` of each fit of one record, as plain data, also on another repeat of its condition."""
    return [as_plain(_judged(fit, other)) for fit in fits]


def _judged(fit: Identification, other: Problem | None) -> FitJudgement:
    problem, state = fit.problem, fit.states[0]
    motion, model = problem.motions[0], fit.model.with_trim(state.trim)
    return FitJudgement(
        equation=model.equation.name,
        next_step=float(np.sqrt(np.mean(next_step(model, motion).error ** 2))),
        simulation=simulation_error(model, state, motion),
        forecasts=forecast_errors(model, motion, problem.segments[0].period),
        held_out=held_out_error(problem, fit.settings) if other is None else _on_other(fit, other),
    )


def _on_other(found: Identification, other: Problem) -> float:
    """Error of the simulated motion on another record, whose initial state is fitted and nothing else."""
    fit = motion_fit(other, found.model.equation)
    _, (state,) = fit.unpack(fit.refine_states(fit.pack(found.model.ratios, other.states)))
    return simulation_error(found.model.with_trim(state.trim), state, other.motions[0])


def best_repeats(records: Sequence[TankRecord], fits: Sequence[Sequence[Identification]]) -> dict[Condition, int]:
    """Index of the best repeat of each condition: the one with the largest median R^2 over the equations."""
    best: dict[Condition, tuple[float, int]] = {}
    for index, record in enumerate(records):
        share = float(np.median([f.r2 for f in fits[index]]))
        held = best.get(record.condition)
        if held is None or share > held[0]:
            best[record.condition] = (share, index)
    return {condition: index for condition, (_, index) in sorted(best.items())}


def tied_best(fits: Sequence[Identification]) -> tuple[int, ...]:
    """Places of the fits with the best objective value, and of those as good; tuple of int."""
    least = min(f.objective_value for f in fits)
    return tuple(k for k, f in enumerate(fits) if f.objective_value <= least * (1.0 + TIE))


def beyond_noise(fits: Sequence[Identification]) -> tuple[bool, ...]:
    """Which equations fit one record worse than the best by more than noise explains. The likelihood ratio n ln(F^2 /
    F_best^2), n effective samples, is compared with the 95 % quantile of chi squared.
    """
    from scipy.stats import chi2

    best = min(fits, key=lambda f: f.objective_value)
    found = []
    for fit in fits:
        ratio = 2.0 * best.effective_samples * np.log(fit.objective_value / best.objective_value)
        freedom = max(1, len(best.model.terms) - len(fit.model.terms))
        found.append(bool(ratio > chi2.ppf(CONFIDENCE, freedom)))
    return tuple(found)


@dataclass(frozen=True)
class RankedEquation:
    """How one equation does in the whole campaign."""

    equation: Equation
    criterion: float  #: Sum over the drafts of the Bayesian information criterion of the joint fits.
    r2: float  #: Smallest of the joint fits' R^2.
    held_out: float  #: Root mean square over the records.
    forecast: float  #: One period ahead, root mean square over the records.
    best_of: int  #: Records that it fits best; of equal fits, the smallest equation counts.

    @property
    def name(self) -> str:
        """Name of the equation."""
        return self.equation.name

    @property
    def term_count(self) -> int:
        """Number of ratios."""
        return len(self.equation.terms)


@dataclass(frozen=True)
class Ranking:
    """Equations over the whole campaign, best criterion first."""

    axis: str
    ranked: tuple[RankedEquation, ...]
    choice: RankedEquation  #: The simplest adequate one.
    reason: str
    findings: tuple[Advice, ...]  #: What a comparison says of friction, and the verdicts.


def rank_campaign(
    axis: str,
    by_draft: Sequence[Sequence[Identification]],
    by_record: Sequence[Sequence[Identification]],
    judgements: Sequence[Sequence[FitJudgement]],
) -> Ranking:
    """Rank the equations of one axis over a whole campaign."""
    if not by_draft or not by_draft[0]:
        raise InputError(f'no equation could be fitted to any {axis} record')
    best_of = [min((len(fits[k].model.terms), k) for k in tied_best(fits))[1] for fits in by_record]
    ranked = []
    samples = [min(fits, key=lambda f: f.objective_value).effective_samples for fits in by_draft]
    for k, first in enumerate(by_draft[0]):
        ranked.append(
            RankedEquation(
                equation=first.model.equation,
                criterion=sum(information_criterion(fits[k], n) for fits, n in zip(by_draft, samples, strict=True)),
                r2=min(fits[k].r2 for fits in by_draft),
                held_out=_root_mean_square([j[k].held_out for j in judgements]),
                forecast=_root_mean_square([j[k].forecasts[-1] for j in judgements]),
                best_of=best_of.count(k),
            )
        )
    ranked.sort(key=lambda r: r.criterion)
    choice, reason = simplest_adequate(ranked, 'criterion, with one set of ratios for all releases of a draft,')
    return Ranking(axis, tuple(ranked), choice, reason, _findings(ranked, by_draft))


def common_equation(pruned: Iterable[Identification], with_friction: bool) -> str:
    """The composition of every term that the records of any draft show together."""
    shown = {term for fit in pruned for term in fit.model.terms}
    return composed(shown - ({'b0'} if not with_friction else set())).name


def with_open_choice(fits: Sequence[Identification], pruned: Identification) -> tuple[Identification, ...]:
    """The joint fit of a draft, only as certain as the choice of its terms, ``pruned`` for it alone, leaves it."""
    (fit,) = fits
    is_alike = pruned.model.equation.terms == fit.model.equation.terms
    return (pruned if is_alike else replace(fit, posterior=pruned.posterior),)


def with_verdicts(
    ranking: Ranking, by_draft: dict[float, Identification], by_record: dict[str, Identification]
) -> Ranking:
    """The ranking with the verdicts of fits of the chosen equation."""
    findings = [
        Advice(fit.verdict.code, f'the fit of all records at {place:g} is {fit.verdict}')
        for place, fit in by_draft.items()
    ]
    others = [record for record, fit in by_record.items() if fit.verdict.level != ADEQUATE]
    if others:
        names = '; '.join(others[:3]) + ('; ...' if len(others) > 3 else '')
        findings.append(Advice.of('record-not-adequate', number=len(others), records=len(by_record), names=names))
    return replace(ranking, findings=(*ranking.findings, *findings))


def _root_mean_square(values: Iterable[float]) -> float:
    known = [value * value for value in values if value == value]
    return float(np.sqrt(np.mean(known))) if known else float('nan')


def _findings(ranked: Sequence[RankedEquation], by_draft: Sequence[Sequence[Identification]]) -> tuple[Advice, ...]:
    by_terms = {frozenset(r.equation.terms): r for r in ranked}
    found = []
    for item in ranked:
        without = by_terms.get(frozenset(item.equation.terms) - {'b0'})
        if 'b0' not in item.equation.terms or without is None:
            continue
        gain = without.criterion - item.criterion
        if gain > CRITERION_MARGIN:
            found.append(
                Advice.of(
                    'friction-necessary',
                    equation=without.name,
                    gain=gain,
                    criterion_margin=CRITERION_MARGIN,
                    effect=_damping_without(without, item, by_draft),
                )
            )
        elif gain < 0:
            found.append(Advice.of('no-friction', equation=without.name, gain=-gain))
    return tuple(found)


def _damping_without(
    without: RankedEquation, item: RankedEquation, by_draft: Sequence[Sequence[Identification]]
) -> str:
    """What leaving friction out does to the quadratic damping."""
    if 'b2' not in without.equation.terms:
        return ''
    values = []
    for fits in by_draft:
        named = {f.model.equation.name: f for f in fits}
        values.append(tuple(named[each.name].ratio('b2')[0] for each in (without, item)))
    before, after = np.mean(values, axis=0)
    return f', and without it the quadratic damping comes out as {before:.3g} instead of {after:.3g} 1/rad'


@dataclass(frozen=True)
class Spread:
    """How repeats of one condition agree on one quantity."""

    condition: Condition
    quantity: str  #: ``natural_period_s``, ``damping_ratio`` or a ratio's name.
    mean: float
    spread: float  #: Standard deviation over the repeats, with n - 1.
    stated: float  #: Root mean square of the standard deviations of the single fits; NaN where they have none.
    repeats: int


def spread_of_repeats(condition: Condition, fits: Sequence[Identification]) -> tuple[Spread, ...]:
    """Spread between the fits of one equation to two or more repeats of one condition."""
    low, high = max(f.amplitude_range[0] for f in fits), min(f.amplitude_range[1] for f in fits)
    at = [f.bands.at(float(np.sqrt(low * high))) for f in fits]
    columns = {
        'natural_period_s': [(period, std) for period, _, std, _ in at],
        'damping_ratio': [(damping, std) for _, damping, _, std in at],
        **{term: [f.ratio(term) for f in fits] for term in fits[0].model.terms},
    }
    found = []
    for quantity, pairs in columns.items():
        values, stds = np.array(pairs).T
        stated = float(np.sqrt(np.mean(stds**2)))
        found.append(Spread(condition, quantity, float(values.mean()), float(values.std(ddof=1)), stated, len(fits)))
    return tuple(found)


def noise_statement(
    records: Sequence[TankRecord], fits: Sequence[Sequence[Identification]], best: dict[Condition, int]
) -> str:
    """One sentence on whether the differences between equations, by one objective, exceed the noise."""
    beyond = total = 0
    ranges, between = [], []
    for condition, index in best.items():
        values = np.array([f.objective_value for f in fits[index]])
        ranges.append(values.max() / values.min() - 1.0)
        exceeds = beyond_noise(fits[index])
        beyond += sum(exceeds)
        total += len(exceeds) - 1
        same = [min(f.objective_value for f in fits[k]) for k, r in enumerate(records) if r.condition == condition]
        if len(same) > 1:
            between.append(np.std(same, ddof=1) / np.mean(same))
    words = [
        f'Within a condition the objective values of the equations differ by {percent(np.median(ranges), 2)} (median; '
        f'largest {percent(max(ranges), 2)})'
    ]
    if between:
        words.append(f'between repeats of one condition by {percent(np.median(between), 2)} (standard deviation)')
    verdict = (
        'no difference exceeds the noise: these values do not distinguish the equations'
        if beyond == 0
        else f'{beyond} of {total} differences from the best exceed the noise (95 %); they are marked'
    )
    return ', '.join(words) + f'; {verdict}.'
