"""The tasks of a campaign, pure functions of plain arguments that any process may run, and what follows from them.

`fit_one` searches one record with one equation, `settle` refits where a search failed, `fit_together` fits common
ratios to several records, `judge` scores the fits of a record. Where the manifest names no equation, `fit_one` of the
general hull on all records of a draft jointly precedes them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Self

import numpy as np

from swath_sysid.attitude.hull.catalogue import composed, told
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import HullPosterior, IdentifiedModel
from swath_sysid.attitude.hull.scheduled_model import ScheduledModel
from swath_sysid.attitude.hull.terms import TERM_INDEX
from swath_sysid.attitude.identification.fit_quality import ADEQUATE, Verdict
from swath_sysid.attitude.identification.forecast_check import forecast_errors, next_step, simulation_error
from swath_sysid.attitude.identification.identify import (
    Identification,
    IdentificationSettings,
    fit_metrics,
    identify_problem,
    refit_from,
)
from swath_sysid.attitude.identification.motion_fit import InitialState, Noise
from swath_sysid.attitude.identification.problem import FRICTION_RATE_SHARE, Problem, motion_fit
from swath_sysid.attitude.identification.scaling import Scales
from swath_sysid.attitude.identification.search import SearchResult
from swath_sysid.attitude.identification.selection import (
    CRITERION_MARGIN,
    enforce_nesting,
    held_out_error,
    information_criterion,
    simplest_adequate,
)
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.noise import weighting_noise

CONFIDENCE = 0.95
ORDER_TOLERANCE = 1e-9
SHOWN_RECORDS = 3
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
class Record:
    """One trial, ready to be fitted; its problem holds this record alone."""

    name: str
    condition: Condition
    repeat: int
    problem: Problem

    def __str__(self) -> str:
        return f'{self.condition}, repeat {self.repeat}'


@dataclass(frozen=True)
class _Plain:
    """A dataclass that is kept as lists, numbers and texts, exact to the last bit when read back."""

    @classmethod
    def from_plain(cls, plain: dict) -> Self:
        """From what `plain` gave, also after a way through JSON."""
        return cls(**{f.name: _tupled(plain[f.name]) for f in fields(cls)})

    def plain(self) -> dict:
        """Lists, numbers and texts."""
        return asdict(self)


@dataclass(frozen=True)
class FitSummary(_Plain):
    """What is kept of an identification, as plain numbers; rad and rad/s."""

    equation: str
    axis: str
    terms: tuple
    objective: str
    ratios: tuple
    std: tuple
    covariance: tuple
    trim: float
    trim_std: float
    friction_rate: float
    amplitude_range: tuple
    states: tuple  #: Initial angle from trim, rate and trim of each record.
    objective_value: float
    r2: float
    rmse: float | None  #: rad; None where not measured.
    rate_rmse: float | None  #: rad/s; None where not measured.
    samples: int
    effective_samples: float
    amplitude: tuple  #: rad; of the curves below.
    frequency: tuple
    frequency_std: tuple
    damping_ratio: tuple
    damping_ratio_std: tuple
    generations: int
    evaluations: int
    stop: str
    seed: int
    advice: tuple  #: Code and message.
    verdict: tuple  #: The values of a `Verdict`.
    absent_term: str  #: That the equation lacks and the motion shows most; empty where there is none.
    posterior: tuple  #: Terms, ratios and covariance of a `HullPosterior`; empty where the equation was named.

    @classmethod
    def of(cls, identification: Identification) -> Self:
        """Summary of an `Identification`."""
        found, model, curves = identification, identification.model, identification.bands.curves
        return cls(
            equation=model.equation.name,
            axis=model.axis,
            terms=model.equation.terms,
            ratios=_floats(model.terms.values()),
            std=_floats(found.std.values()),
            covariance=tuple(_floats(row) for row in found.covariance),
            trim=float(model.trim),
            trim_std=float(found.trim_std),
            friction_rate=float(model.friction_rate),
            amplitude_range=_floats(found.amplitude_range),
            states=tuple((r.state.x, r.state.rate, r.state.trim) for r in found.records),
            objective=found.objective,
            objective_value=float(found.objective_value),
            r2=float(found.r2),
            rmse=found.rmse,
            rate_rmse=found.rate_rmse,
            samples=int(found.samples),
            effective_samples=float(found.effective_samples),
            amplitude=_floats(curves.amplitude),
            frequency=_floats(curves.frequency),
            frequency_std=_floats(found.bands.frequency_std),
            damping_ratio=_floats(curves.damping_ratio),
            damping_ratio_std=_floats(found.bands.damping_ratio_std),
            generations=int(found.search.generations),
            evaluations=int(found.search.evaluations),
            stop=str(found.search.stop),
            seed=int(found.settings.search.seed),
            advice=tuple((a.code, a.message) for a in found.advice),
            verdict=tuple(asdict(found.verdict).values()),
            absent_term='' if found.absent_term is None else found.absent_term.name,
            posterior=_plain_posterior(found.posterior),
        )

    @property
    def model(self) -> DecayModel:
        """The decay model."""
        values = dict(zip(self.terms, self.ratios, strict=True))
        return DecayModel.from_terms(
            Equation(self.equation, self.terms),
            values,
            trim=self.trim,
            friction_rate=self.friction_rate,
            axis=self.axis,
        )

    @property
    def initial_states(self) -> tuple[InitialState, ...]:
        """Of each record."""
        return tuple(InitialState(*s) for s in self.states)

    @property
    def judged(self) -> Verdict:
        """Whether the fit can be used."""
        return Verdict(*self.verdict)

    def ratio(self, term: str) -> tuple[float, float]:
        """Value and standard deviation of one ratio."""
        index = self.terms.index(term)
        return self.ratios[index], self.std[index]

    def identified_model(self, provenance: dict) -> IdentifiedModel:
        """The content of a model file."""
        how = {'search_stop': self.stop, 'seed': self.seed, 'advice': [code for code, _ in self.advice]}
        return IdentifiedModel(
            self.model,
            np.array(self.covariance),
            self.trim_std,
            self.amplitude_range,
            {**fit_metrics(self), **self.judged.metrics},
            {**provenance, **how},
            self._hull_posterior(),
        )

    def _hull_posterior(self) -> HullPosterior | None:
        if not self.posterior:
            return None
        terms, ratios, covariance = self.posterior
        return HullPosterior(composed(terms), np.array(ratios), np.array(covariance))


def _plain_posterior(posterior: HullPosterior | None):
    if posterior is None:
        return ()
    return posterior.equation.terms, _floats(posterior.ratios), tuple(map(_floats, posterior.covariance))


def _floats(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(v) for v in values)


def _tupled(value: Any) -> Any:
    return tuple(_tupled(v) for v in value) if isinstance(value, list | tuple) else value


def joined(problems: Sequence[Problem]) -> Problem:
    """One problem of several of one axis, their records side by side."""
    if len(problems) == 1:
        return problems[0]
    motions = tuple(m for p in problems for m in p.motions)
    segments = tuple(s for p in problems for s in p.segments)
    frequency = float(np.median([p.scales.frequency for p in problems for _ in p.segments]))
    scales = Scales(max(p.scales.amplitude for p in problems), frequency)
    noise = Noise(
        angle=weighting_noise([m.angle for m in motions if m.angle is not None] or [np.zeros(1)]),
        rate=weighting_noise([m.rate for m in motions if m.rate is not None] or [np.zeros(1)]),
    )
    return Problem(
        axis=problems[0].axis,
        motions=motions,
        segments=segments,
        observed=tuple(m for p in problems for m in p.observed),
        states=tuple(s for p in problems for s in p.states),
        scales=scales,
        noise=noise,
        friction_rate=FRICTION_RATE_SHARE * scales.rate,
        advice=tuple(dict.fromkeys(a for p in problems for a in p.advice)),
    )


def fit_one(problem: Problem, settings: IdentificationSettings) -> FitSummary:
    """Identify one equation on one record; see `identify_problem`."""
    return FitSummary.of(identify_problem(problem, settings))


def settle(
    problem: Problem, settings: IdentificationSettings, summaries: Sequence[FitSummary]
) -> tuple[FitSummary, ...]:
    """Fits of one problem with every equation, none worse than a fit whose equation it contains.

    A search that ended worse is refined again from the smaller equation's optimum.
    """

    def refit(fit: FitSummary, better: FitSummary) -> FitSummary:
        return _refit(problem, settings, fit.equation, better.model.ratios, better.initial_states, fit)

    return tuple(enforce_nesting(summaries, refit))


def out_of_order(summaries: Sequence[FitSummary]) -> tuple[tuple[str, str], ...]:
    """Pairs of equation names, containing and contained, of which the containing one fits worse."""
    return tuple(
        (big.equation, small.equation)
        for big in summaries
        for small in summaries
        if set(small.terms) < set(big.terms) and big.objective_value > small.objective_value * (1.0 + ORDER_TOLERANCE)
    )


def fit_together(
    problem: Problem, settings: IdentificationSettings, equation: str, starts: Sequence[FitSummary]
) -> FitSummary:
    """Fit common ratios to several records, each with its own initial state; ``starts`` are their single fits in order.

    Refinement starts at the optimum of the record with the largest motion, which shows the most of every term.
    """
    states = tuple(s for start in starts for s in start.initial_states)
    largest = max(starts, key=lambda start: start.amplitude_range[1])
    return _refit(problem, settings, equation, largest.model.ratios, states, None)


def _refit(
    problem: Problem,
    settings: IdentificationSettings,
    equation: str,
    ratios: np.ndarray,
    states: Sequence[InitialState],
    summary: FitSummary | None,
) -> FitSummary:
    """Refinement from given ratios and states, as a summary; it keeps the search of ``summary``."""
    chosen = replace(settings, equation=equation)
    tried = (0, 0) if summary is None else (summary.generations, summary.evaluations)
    search = SearchResult(np.empty(0), float('nan'), *tried, 'refined')
    return FitSummary.of(refit_from(problem, chosen, chosen.chosen_equation, ratios, states, search))


@dataclass(frozen=True)
class Judgement(_Plain):
    """How well one fit of a record does what a model is for."""

    equation: str
    next_step: float  #: Root mean square error of the rate one sample ahead, rad/s.
    simulation: float  #: Error of the simulated motion over the standard deviation of the measured one.
    forecasts: tuple  #: The same a quarter, a half and one period ahead; NaN where the record is too short.
    held_out: float  #: The same on another repeat, or on the second half of the record by a model of the first.


def judge(
    problem: Problem, settings: IdentificationSettings, summaries: Sequence[FitSummary], other: Problem | None
) -> tuple[Judgement, ...]:
    """Judge the fits of one record, with another repeat of the same condition where there is one."""
    return tuple(_judged(problem, settings, summary, other) for summary in summaries)


def _judged(
    problem: Problem, settings: IdentificationSettings, summary: FitSummary, other: Problem | None
) -> Judgement:
    motion, segment = problem.motions[0], problem.segments[0]
    state = summary.initial_states[0]
    model = summary.model.with_trim(state.trim)
    checked = next_step(model, motion)
    chosen = replace(settings, equation=summary.equation)
    return Judgement(
        equation=summary.equation,
        next_step=float(np.sqrt(np.mean(checked.error**2))),
        simulation=simulation_error(model, state, motion),
        forecasts=forecast_errors(model, motion, segment.period),
        held_out=held_out_error(problem, chosen) if other is None else _on_other(summary, other),
    )


def _on_other(summary: FitSummary, other: Problem) -> float:
    """Error of the simulated motion on another record, whose initial state is fitted and nothing else."""
    fit = motion_fit(other, summary.model.equation)
    parameters = fit.refine_states(fit.pack(summary.model.ratios, other.states))
    _, states = fit.unpack(parameters)
    return simulation_error(summary.model.with_trim(states[0].trim), states[0], other.motions[0])


def best_repeats(records: Sequence[Record], fits: Sequence[Sequence[FitSummary]]) -> dict[Condition, int]:
    """Index of the best repeat of each condition: the one with the largest median R^2 over the equations."""
    best: dict[Condition, tuple[float, int]] = {}
    for index, record in enumerate(records):
        share = float(np.median([f.r2 for f in fits[index]]))
        held = best.get(record.condition)
        if held is None or share > held[0]:
            best[record.condition] = (share, index)
    return {condition: index for condition, (_, index) in sorted(best.items())}


def tied_best(summaries: Sequence[FitSummary]) -> tuple[int, ...]:
    """Places of the fits with the best objective value, and of those as good; tuple of int."""
    least = min(f.objective_value for f in summaries)
    return tuple(k for k, f in enumerate(summaries) if f.objective_value <= least * (1.0 + TIE))


def beyond_noise(summaries: Sequence[FitSummary]) -> tuple[bool, ...]:
    """Which equations fit one record worse than the best by more than noise explains.

    The likelihood ratio n ln(F^2 / F_best^2), n effective samples, is compared with the 95 % quantile of chi squared.
    """
    from scipy.stats import chi2

    best = min(summaries, key=lambda f: f.objective_value)
    found = []
    for fit in summaries:
        ratio = 2.0 * best.effective_samples * np.log(fit.objective_value / best.objective_value)
        freedom = max(1, len(best.terms) - len(fit.terms))
        found.append(bool(ratio > chi2.ppf(CONFIDENCE, freedom)))
    return tuple(found)


@dataclass(frozen=True)
class RankedEquation:
    """How one equation does in the whole campaign."""

    equation: str
    terms: tuple
    criterion: float  #: Sum over the drafts of the Bayesian information criterion of the joint fits.
    r2: float  #: Smallest of the joint fits' R^2.
    held_out: float  #: Root mean square over the records.
    forecast: float  #: One period ahead, root mean square over the records.
    best_of: int  #: Records that it fits best; of equal fits, the smallest equation counts.

    @property
    def name(self) -> str:
        """Name of the equation."""
        return self.equation

    @property
    def term_count(self) -> int:
        """Number of ratios."""
        return len(self.terms)


@dataclass(frozen=True)
class Ranking:
    """Equations over the whole campaign, best criterion first."""

    axis: str
    ranked: tuple
    choice: RankedEquation  #: The simplest adequate one.
    reason: str
    findings: tuple  #: What the comparison says of friction; of one equation alone, the verdicts.


def rank_campaign(
    axis: str,
    by_draft: Sequence[Sequence[FitSummary]],
    by_record: Sequence[Sequence[FitSummary]],
    judgements: Sequence[Sequence[Judgement]],
) -> Ranking:
    """Rank the equations of one axis over a whole campaign."""
    if not by_draft or not by_draft[0]:
        raise InputError(f'no equation could be fitted to any {axis} record')
    best_of = [min((len(fits[k].terms), k) for k in tied_best(fits))[1] for fits in by_record]
    ranked = []
    samples = [min(fits, key=lambda f: f.objective_value).effective_samples for fits in by_draft]
    for k, first in enumerate(by_draft[0]):
        ranked.append(
            RankedEquation(
                equation=first.equation,
                terms=first.terms,
                criterion=sum(information_criterion(fits[k], n) for fits, n in zip(by_draft, samples, strict=True)),
                r2=min(fits[k].r2 for fits in by_draft),
                held_out=_root_mean_square([j[k].held_out for j in judgements]),
                forecast=_root_mean_square([j[k].forecasts[-1] for j in judgements]),
                best_of=best_of.count(k),
            )
        )
    ranked.sort(key=lambda r: r.criterion)
    choice, reason = simplest_adequate(ranked, 'criterion, with one set of ratios a draft for all angles and repeats,')
    return Ranking(axis, tuple(ranked), choice, reason, _findings(ranked, by_draft))


def common_equation(pruned: Iterable[FitSummary], with_friction: bool) -> str:
    """The composition of every term that the records of any draft show together."""
    shown = {term for fit in pruned for term in fit.terms}
    return composed(sorted(shown - ({'b0'} if not with_friction else set()), key=TERM_INDEX.__getitem__)).name


def with_open_choice(fits: Sequence[FitSummary], pruned: FitSummary) -> tuple[FitSummary, ...]:
    """The joint fit of a draft, only as certain as the choice of its terms leaves it.

    Args:
        fits: Of the one equation of all drafts.
        pruned: Of the hull that the draft's own records show.
    """
    (fit,) = fits
    return (pruned if pruned.terms == fit.terms else replace(fit, posterior=pruned.posterior),)


def told_alone(
    ranking: Ranking, by_draft: dict[float, FitSummary], by_record: dict[str, FitSummary], was_named: bool
) -> Ranking:
    """What there is to say of one equation, which nothing was compared with: its verdicts."""
    first = next(iter(by_draft.values()))
    name = told(first.model.equation, first.axis)
    reason = ranking.reason if was_named else f'{name}: the terms of the general hull that the records of a draft show.'
    findings = [
        Advice(fit.judged.code, f'the fit of all records at {place:g} is {fit.judged}')
        for place, fit in by_draft.items()
    ]
    others = [record for record, fit in by_record.items() if fit.judged.level != ADEQUATE]
    if others:
        shown = f'{"; ".join(others[:SHOWN_RECORDS])}{"; ..." if len(others) > SHOWN_RECORDS else ""}'
        words = (
            f'{len(others)} of {len(by_record)} records by themselves are not adequate ({shown}): see their verdicts'
        )
        findings.append(Advice('record-not-adequate', words))
    return replace(ranking, reason=reason, findings=tuple(findings))


def _root_mean_square(values: Iterable[float]) -> float:
    known = [value * value for value in values if value == value]
    return float(np.sqrt(np.mean(known))) if known else float('nan')


def _findings(ranked: Sequence[RankedEquation], by_draft: Sequence[Sequence[FitSummary]]) -> tuple[Advice, ...]:
    by_terms = {frozenset(r.terms): r for r in ranked}
    found = []
    for item in ranked:
        without = by_terms.get(frozenset(item.terms) - {'b0'})
        if 'b0' not in item.terms or without is None:
            continue
        gain = without.criterion - item.criterion
        if gain > CRITERION_MARGIN:
            found.append(
                Advice.of(
                    'friction-necessary',
                    equation=without.equation,
                    gain=gain,
                    criterion_margin=CRITERION_MARGIN,
                    effect=_damping_without(without, item, by_draft),
                )
            )
        elif gain < 0:
            found.append(Advice.of('no-friction', equation=without.equation, gain=-gain))
    return tuple(found)


def _damping_without(without: RankedEquation, item: RankedEquation, by_draft: Sequence[Sequence[FitSummary]]) -> str:
    """What leaving friction out does to the quadratic damping."""
    if 'b2' not in without.terms:
        return ''
    values = []
    for fits in by_draft:
        named = {f.equation: f for f in fits}
        values.append((named[without.equation].ratio('b2')[0], named[item.equation].ratio('b2')[0]))
    before, after = np.mean(values, axis=0)
    return f', and without it the quadratic damping comes out as {before:.3g} instead of {after:.3g} 1/rad'


def schedule_of(
    by_draft: Sequence[Sequence[FitSummary]],
    equation: str,
    loadings: Iterable[float],
    quantity: str,
    provenances: Sequence[dict],
) -> ScheduledModel:
    """The model scheduled on draft, of one equation's joint fits of each draft, the loadings increasing."""
    chosen = [next(f for f in fits if f.equation == equation) for fits in by_draft]
    models = tuple(fit.identified_model(p) for fit, p in zip(chosen, provenances, strict=True))
    return ScheduledModel(quantity, tuple(loadings), models)


@dataclass(frozen=True)
class Spread:
    """How repeats of one condition agree on one quantity."""

    condition: Condition
    quantity: str  #: ``natural_period_s``, ``damping_ratio`` or a ratio's name.
    mean: float
    spread: float  #: Standard deviation over the repeats, with n - 1.
    stated: float  #: Root mean square of the standard deviations of the single fits; NaN where they have none.
    repeats: int


def spread_of_repeats(condition: Condition, fits: Sequence[FitSummary]) -> tuple[Spread, ...]:
    """Spread between the fits of one equation to two or more repeats of one condition."""
    low = max(f.amplitude[0] for f in fits)
    high = min(f.amplitude[-1] for f in fits)
    at = np.sqrt(low * high)
    columns = {
        'natural_period_s': [_curve(f, 'frequency', at, inverse=True) for f in fits],
        'damping_ratio': [_curve(f, 'damping_ratio', at) for f in fits],
        **{term: [f.ratio(term) for f in fits] for term in fits[0].terms},
    }
    found = []
    for quantity, pairs in columns.items():
        values, stds = np.array(pairs).T
        stated = float(np.sqrt(np.mean(stds**2)))
        found.append(Spread(condition, quantity, float(values.mean()), float(values.std(ddof=1)), stated, len(fits)))
    return tuple(found)


def _curve(fit: FitSummary, name: str, amplitude: float, inverse: bool = False) -> tuple[float, float]:
    """Value and standard deviation of a curve at an amplitude; of its period where asked for."""
    value = float(np.interp(amplitude, fit.amplitude, getattr(fit, name)))
    std = float(np.interp(amplitude, fit.amplitude, getattr(fit, f'{name}_std')))
    if inverse:
        return 2.0 * np.pi / value, 2.0 * np.pi / value**2 * std
    return value, std


def noise_statement(records: Sequence[Record], fits: Sequence[Sequence[FitSummary]], best: dict[Condition, int]) -> str:
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
        f'Within a condition the objective values of the equations differ by {_percent(np.median(ranges))} (median; '
        f'largest {_percent(max(ranges))})'
    ]
    if between:
        words.append(f'between repeats of one condition by {_percent(np.median(between))} (standard deviation)')
    verdict = (
        'no difference exceeds the noise: these values do not distinguish the equations'
        if beyond == 0
        else f'{beyond} of {total} differences from the best exceed the noise (95 %); they are marked'
    )
    return ', '.join(words) + f'; {verdict}.'


def _percent(share: Any) -> str:
    """With two digits, never as a power of ten."""
    return f'{float(f"{100.0 * share:.2g}"):.12g} %'


def term_values(summary: FitSummary) -> dict[str, tuple[float, float]]:
    """Name to value and standard deviation, in the order of the terms of all models."""
    return {term: summary.ratio(term) for term in sorted(summary.terms, key=TERM_INDEX.__getitem__)}
