"""From measured decays to a hull model: search, refine, and state the uncertainty."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Self, get_type_hints

import numpy as np

from swath_sysid.attitude.hull.catalogue import AUTO, GENERAL_HULL, equation_named
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.identified_model import HullPosterior, IdentifiedModel
from swath_sysid.attitude.hull.scaling import LOWER, UPPER
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, TERM_INDEX
from swath_sysid.attitude.identification.basin_likelihood import BasinFit, interval
from swath_sysid.attitude.identification.fit_quality import Verdict, judge
from swath_sysid.attitude.identification.hull_terms import (
    AbsentTerm,
    FittedHull,
    absent_by_residuals,
    basin_fit,
    pruned_hull,
    suits_likelihood,
)
from swath_sysid.attitude.identification.motion_fit import (
    SEARCH_STEPS_PER_PERIOD,
    STARTING_TOLERANCE,
    TOLERANCE,
    InitialState,
)
from swath_sysid.attitude.identification.one_step import OneStepObjective
from swath_sysid.attitude.identification.problem import Problem, block_means, motion_fit, prepare
from swath_sysid.attitude.identification.search import (
    PRESETS,
    SearchResult,
    SearchSettings,
    SearchSpace,
    dimensionless_space,
    full_ratios,
    published_space,
    run_search,
)
from swath_sysid.attitude.identification.uncertainty import AmplitudeBands, amplitude_bands
from swath_sysid.attitude.motion.segmentation import DecaySegment
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.covariance import sandwich_covariance
from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.common.plain import as_plain, from_plain
from swath_sysid.common.stopping import Cancelled, Progress, ShouldCancel

OBJECTIVES = ('simulation', 'one-step')

#: Periods that the search uses: its basin of attraction narrows with every cycle. Refinement follows the rest.
SEARCH_PERIODS = 6.0
HORIZON_GROWTH = 2.5
CURVE_POINTS = 40


@dataclass(frozen=True)
class IdentificationSettings:
    """What to fit and how.

    Raises:
        InputError: There is no such equation or objective, or the bounds are in the wrong order.

    Example:
        >>> settings = IdentificationSettings(equation='odd-cubic', start=5.0, end=60.0)
        >>> settings.chosen_equation.terms
        ('b1', 'b2', 'r1', 'r3')
    """

    #: A name that `equation_named` takes; ``auto``: the general hull, pruned to the terms that the records show.
    equation: str = AUTO
    objective: str = 'simulation'  #: ``simulation`` or ``one-step``.
    search: SearchSettings = field(default_factory=SearchSettings)
    start: float | None = None  #: Of the decay in the record's time, s; None: it is found.
    end: float | None = None  #: Of the decay in the record's time, s; None: it is found.

    def __post_init__(self):
        check_choice(self.objective, OBJECTIVES, 'objective')
        if not self.equation:
            raise InputError(f"an equation without a name cannot be fitted: leave it out, or give '{AUTO}' or a name")
        if self.equation != AUTO:
            equation_named(self.equation)
        if self.start is not None and self.end is not None and not self.start < self.end:
            raise InputError('the start must lie before the end')

    @property
    def chosen_equation(self) -> Equation:
        """The equation to search with: every smooth term where none is named."""
        return GENERAL_HULL if self.equation == AUTO else equation_named(self.equation)


@dataclass(frozen=True)
class RecordFit:
    """Measured and simulated motion of one record."""

    motion: AxisMotion  #: The free decay.
    segment: DecaySegment
    state: InitialState
    angle: np.ndarray  #: (N,); Simulated, rad.
    rate: np.ndarray  #: (N,); Simulated, rad/s.

    @property
    def residual(self) -> np.ndarray:
        """Measured less simulated: of the angle, or of the rate where no angle was measured."""
        return self.motion.primary - (self.rate if self.motion.angle is None else self.angle)


@dataclass(frozen=True)
class Identification:
    """An identified model and what must be known to use it.

    Example:
        >>> found = identify([read_trial(records / 'kvlcc2_roll_decay.csv').axis('roll')])
        >>> f'{found.damping_ratio:.4f} of critical, R2 {found.r2:.3f}'
        '0.0050 of critical, R2 1.000'
        >>> fit = found.records[0]  # measured and simulated motion of the first record
        >>> fit.angle.shape == fit.motion.time.shape
        True
    """

    model: DecayModel
    covariance: np.ndarray  #: (n, n); Of the ratios of the model's terms, in their order.
    trim_std: float  #: rad; NaN where no angle was measured.
    states: tuple[InitialState, ...]  #: Of each record.
    #: Root mean square of the weighted residuals (simulation), or F in rad/s (one-step), at its own optimum.
    objective_value: float
    effective_samples: float  #: Independent samples that would leave the same uncertainty.
    search: SearchResult
    problem: Problem
    settings: IdentificationSettings
    basin: BasinFit | None = None  #: Fit of the likelihood; None where the ratios are those of least squares.
    absent_term: AbsentTerm | None = None  #: That the equation lacks and the motion shows most.
    posterior: HullPosterior | None = None  #: Of every term, those pruned included; None where the equation was named.

    @classmethod
    def restored(cls, plain: dict, problem: Problem, settings: IdentificationSettings) -> Self:
        """From what `plain` gave, with the problem that was solved."""
        hints = get_type_hints(cls)
        kept = {name: from_plain(hints[name], plain[name]) for name in KEPT}
        return cls(problem=problem, settings=settings, **kept)

    def plain(self) -> dict:
        """All that the problem and the settings do not give again: lists, numbers and texts."""
        return {name: as_plain(getattr(self, name)) for name in KEPT}

    @cached_property
    def records(self) -> tuple[RecordFit, ...]:
        """Measured and simulated motion of each record."""
        fit = motion_fit(self.problem, self.model.equation)
        simulated = fit.simulated(fit.pack(self.model.ratios, self.states))
        measured = zip(self.problem.motions, self.problem.segments, self.states, simulated, strict=True)
        return tuple(RecordFit(motion, segment, state, *motions) for motion, segment, state, motions in measured)

    @property
    def objective(self) -> str:
        """``simulation`` or ``one-step``."""
        return self.settings.objective

    @property
    def advice(self) -> tuple[Advice, ...]:
        """What the quality gates and the choice of the objective say."""
        # which damping terms few cycles show has been decided where the hull was pruned
        decided = () if self.posterior is None else ('too-few-cycles',)
        found = tuple(each for each in self.problem.advice if each.code not in decided)
        return (*found, Advice.of('one-step-biased')) if self.objective == 'one-step' else found

    @cached_property
    def bands(self) -> AmplitudeBands:
        """Over the amplitudes seen."""
        amplitude = np.geomspace(*self.amplitude_range, CURVE_POINTS)
        return amplitude_bands(self.model, self.covariance, amplitude, self.posterior)

    @property
    def r2(self) -> float:
        """Share of the variance of the measured motion that the simulated one explains, of each about its own mean."""
        error = sum(float(np.sum(r.residual**2)) for r in self.records)
        return 1.0 - error / sum(float(np.sum((r.motion.primary - r.motion.primary.mean()) ** 2)) for r in self.records)

    @property
    def rmse(self) -> float | None:
        """Of the angle, rad; None where not measured."""
        return _rms([r.motion.angle - r.angle for r in self.records if r.motion.angle is not None])

    @property
    def rate_rmse(self) -> float | None:
        """Of the rate, rad/s; None where not measured."""
        return _rms([r.motion.rate - r.rate for r in self.records if r.motion.rate is not None])

    @property
    def std(self) -> dict[str, float]:
        """Name to standard deviation of the ratios in use."""
        return dict(zip(self.model.equation.terms, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """95 % of each ratio in use; of a damping ratio that the record does not tell from zero, from zero up."""
        terms, std = self.model.terms, self.std
        return {name: interval(terms[name], std[name], name in DAMPING_NAMES) for name in terms}

    @property
    def samples(self) -> int:
        """Measured values, angles and rates."""
        return sum(m.size for each in self.problem.motions for m in (each.angle, each.rate) if m is not None)

    def ratio(self, term: str) -> tuple[float, float]:
        """Value and standard deviation of one ratio in use."""
        return self.model.terms[term], self.std[term]

    @cached_property
    def verdict(self) -> Verdict:
        """Whether the fit can be used."""
        return judge(self)

    @property
    def amplitude_range(self) -> tuple[float, float]:
        """Smallest and largest amplitude seen, rad: where the model is valid."""
        return self.problem.amplitudes_seen

    @property
    def reference_amplitude(self) -> float:
        """Geometric mean of the amplitudes seen, rad."""
        return float(np.sqrt(np.prod(self.amplitude_range)))

    @property
    def damping_ratio(self) -> float:
        """Equivalent damping over critical damping at the reference amplitude."""
        curves = self.bands.curves
        return float(np.interp(self.reference_amplitude, curves.amplitude, curves.damping_ratio))

    def identified_model(self, provenance: dict) -> IdentifiedModel:
        """The content of a model file; ``provenance`` is the caller's record of files, hashes and software version."""
        search = self.settings.search
        how = {
            'segments_s': [[float(r.segment.start), float(r.segment.end)] for r in self.records],
            'search': search.algorithm,
            'preset': search.preset,
            'seed': search.seed,
            'generations': self.search.generations,
            'evaluations': self.search.evaluations,
            'stop': self.search.stop,
            'advice': [a.code for a in self.advice],
        }
        metrics = {
            'r2': self.r2,
            'rmse_rad': self.rmse,
            'rate_rmse_rad_s': self.rate_rmse,
            'objective': self.objective,
            'objective_value': self.objective_value,
            'samples': self.samples,
            'effective_samples': self.effective_samples,
            **self.verdict.metrics,
        }
        return IdentifiedModel(
            self.model,
            self.covariance,
            self.trim_std,
            self.amplitude_range,
            metrics,
            {**provenance, **how},
            self.posterior,
        )


#: What an `Identification` holds beside its problem and settings.
KEPT = tuple(each.name for each in fields(Identification) if each.name not in ('problem', 'settings', 'basin'))


def identify(
    motions: Sequence[AxisMotion],
    settings: IdentificationSettings = IdentificationSettings(),
    *,  # noqa: B008 - frozen
    progress: Progress | None = None,
    should_cancel: ShouldCancel | None = None,
) -> Identification:
    """Identify the decay model of one axis from one or several records.

    A genetic search finds the start, and least squares on the simulated motion refines it; where the equation has the
    terms that the motion shows, a likelihood that knows of the basin's own motion refines it further.

    Args:
        motions: Whole records, all of one axis: the free decay in each is found, unless the settings give its bounds.
        settings: What to fit and how.
        progress: Called with 0 to 1.
        should_cancel: Asked often; True raises `Cancelled`.

    Returns:
        The model with its uncertainty; its ``verdict`` tells whether it can be used.

    Raises:
        InputError: The records cannot be used; the sentence says why.
        Cancelled: ``should_cancel`` returned True.

    Example:
        >>> found = identify([read_trial(records / 'kvlcc2_roll_decay.csv').axis('roll')])
        >>> f'{found.model.natural_period:.2f} s, {found.verdict.level}'
        '2.55 s, adequate'
    """
    problem = prepare(motions, settings.start, settings.end)
    return identify_problem(problem, settings, progress=progress, should_cancel=should_cancel)


def identify_problem(
    problem: Problem,
    settings: IdentificationSettings,
    *,
    progress: Progress | None = None,
    should_cancel: ShouldCancel | None = None,
) -> Identification:
    """As `identify`, on decays found before."""
    equation = settings.chosen_equation
    space = _space(problem, equation, settings)
    report = progress or (lambda share: None)
    found = run_search(
        _search_objective(problem, equation, settings),
        space,
        settings.search,
        first=[space.from_ratios(_linear_guess(problem, equation))],
        progress=lambda share: report(0.5 * share),
        should_cancel=should_cancel,
    )
    best = space.to_ratios(found.best[None])[0]
    if settings.objective == 'one-step':
        parameters = _exact_one_step(problem, equation, space)
    else:
        tolerance = STARTING_TOLERANCE if settings.equation == AUTO else TOLERANCE
        parameters = _refine_outwards(problem, equation, space, best, tolerance, should_cancel)
    report(0.75)
    if settings.equation == AUTO and settings.objective == 'simulation':
        start = motion_fit(problem, equation).unpack(parameters)
        identified = identification_of(problem, settings, found, pruned_hull(problem, *start))
    else:
        identified = refined_in_basin(identification_of(problem, settings, found, FittedHull(equation, parameters)))
    report(1.0)
    return identified


def refit_from(
    problem: Problem,
    settings: IdentificationSettings,
    ratios: np.ndarray,
    states: Sequence[InitialState],
    search: SearchResult,
) -> Identification:
    """Refine the chosen equation on whole records from given ratios (9,) and states."""
    equation = settings.chosen_equation
    fit = motion_fit(problem, equation)
    space = _space(problem, equation, settings)
    parameters, _ = fit.refine(fit.pack(ratios, states), space.ratio_lower, space.ratio_upper)
    return refined_in_basin(identification_of(problem, settings, search, FittedHull(equation, parameters)))


def refined_in_basin(found: Identification) -> Identification:
    """A least-squares identification refined, where it suits, by the likelihood that includes the basin's motion.

    Least squares stays where the equation lacks a term, whose effect the likelihood would attribute to basin motion,
    and where the simulated motion diverges.
    """
    problem, equation, start = found.problem, found.model.equation, (found.model.ratios, found.states)
    if found.objective == 'one-step':
        return found
    fitted = basin_fit(problem, equation, *start) if suits_likelihood(problem, equation) else None
    if not isinstance(fitted, BasinFit):
        return replace(found, absent_term=fitted or absent_by_residuals(problem, equation, *start))
    parameters = motion_fit(problem, equation).settled(fitted.ratios, found.states)
    if parameters is None:
        return found
    refined = identification_of(problem, found.settings, found.search, FittedHull(equation, parameters, fitted))
    return replace(refined, objective_value=found.objective_value)


def _space(problem: Problem, equation: Equation, settings: IdentificationSettings):
    preset = settings.search.preset
    return published_space(equation, PRESETS[preset], problem.scales) if preset else dimensionless_space(equation)


def _search_objective(problem: Problem, equation: Equation, settings: IdentificationSettings):
    """The objective of dimensionless ratios (P, n), values (P,)."""
    if settings.objective == 'one-step':
        one_step = _one_step(problem)
        return lambda ratios: one_step(full_ratios(ratios, equation, problem.scales))
    period = 2 * np.pi / problem.scales.frequency
    blocks = tuple(block_means(m, period, SEARCH_STEPS_PER_PERIOD) for m in problem.until(SEARCH_PERIODS))
    fit = motion_fit(problem, equation, blocks, steps_per_period=SEARCH_STEPS_PER_PERIOD)
    return lambda ratios: fit.objective_of_population(ratios, problem.states)


def _one_step(problem: Problem):
    return OneStepObjective.of(problem.motions, [s.trim for s in problem.states], problem.friction_rate)


def _linear_guess(problem: Problem, equation: Equation):
    """Dimensionless ratios of the linear oscillator that the segments' decrement implies."""
    decrement = np.median(
        [np.log(s.initial_amplitude / s.final_amplitude) / (2.0 * np.pi * max(s.cycles, 0.5)) for s in problem.segments]
    )
    guess = np.zeros(len(LOWER))
    guess[TERM_INDEX['b1']] = np.clip(2.0 * decrement, 0.01, 2.0)
    guess[TERM_INDEX['r1' if 'r1' in equation.terms else 's1']] = 1.0
    return guess[equation.indices]


def _exact_one_step(problem: Problem, equation: Equation, space: SearchSpace):
    """The bounded least-squares optimum, and the initial states that suit it best."""
    units = problem.scales.ratio_units
    lower, upper = LOWER * units, UPPER * units
    lower[equation.indices] = space.ratio_lower * units[equation.indices]
    fit = motion_fit(problem, equation)
    return fit.refine_states(fit.pack(_one_step(problem).minimum(equation, lower, upper), problem.states))


def _refine_outwards(
    problem: Problem,
    equation: Equation,
    space: SearchSpace,
    best: np.ndarray,
    tolerance: float,
    should_cancel: ShouldCancel | None,
):
    """Least squares on the first periods, then on growing parts of the record."""
    longest = max(m.duration for m in problem.motions) * problem.scales.frequency / (2 * np.pi)
    bounds, horizon = (space.ratio_lower, space.ratio_upper), SEARCH_PERIODS
    states = motion_fit(problem, equation).pack(np.zeros(len(LOWER)), problem.states)[best.size :]
    starts = [np.r_[ratios, states] for ratios in (best, np.clip(_linear_guess(problem, equation), *bounds))]
    while True:
        fit = motion_fit(problem, equation, problem.until(horizon) if horizon < longest else None)
        starts = [min((fit.refine(start, *bounds, tolerance) for start in starts), key=lambda tried: tried[1])[0]]
        if should_cancel is not None and should_cancel():
            raise Cancelled
        if horizon >= longest:
            return starts[0]
        horizon *= HORIZON_GROWTH


def identification_of(
    problem: Problem, settings: IdentificationSettings, search: SearchResult, hull: FittedHull
) -> Identification:
    """The identification that a fitted hull gives, with its uncertainty."""
    equation, fit = hull.equation, motion_fit(problem, hull.equation)
    ratios, states = fit.unpack(hull.parameters)
    residuals, jacobians = fit.residuals_and_jacobian(hull.parameters)
    sandwich = sandwich_covariance(residuals, jacobians, problem.shortest_memory)
    n, units = len(equation.terms), problem.scales.ratio_units[equation.indices]
    covariance = sandwich.matrix[:n, :n] * np.outer(units, units)
    trim_std = float(np.sqrt(np.mean(np.diag(sandwich.matrix)[n + 2 :: 3]))) * problem.scales.amplitude
    if hull.basin is not None:
        covariance = hull.basin.covariance
        trim_std = hull.basin.trim_std if problem.motions[0].angle is not None else float('nan')
    if hull.posterior is not None:
        covariance = hull.posterior.about(equation, ratios)
    objective_value = float(np.sqrt(np.mean(np.concatenate(residuals) ** 2)))
    if settings.objective == 'one-step':
        objective_value = float(_one_step(problem)(ratios[None])[0])
    trim = float(np.mean([s.trim for s in states]))
    return Identification(
        model=DecayModel(equation, ratios, trim, problem.friction_rate, problem.axis),
        covariance=covariance,
        trim_std=trim_std,
        objective_value=objective_value,
        effective_samples=sandwich.effective_samples,
        states=tuple(states),
        search=search,
        problem=problem,
        settings=settings,
        basin=hull.basin,
        posterior=hull.posterior,
    )


def _rms(parts: Sequence[np.ndarray]):
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else None
