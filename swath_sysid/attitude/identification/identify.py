"""From measured decays to a hull model: search, refine, and state the uncertainty."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.catalogue import AUTO
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.terms import AT, LOWER, UPPER
from swath_sysid.attitude.identification.basin_likelihood import BasinFit
from swath_sysid.attitude.identification.disturbances import named
from swath_sysid.attitude.identification.fit_quality import REPEATABILITY
from swath_sysid.attitude.identification.forecast_check import OneStepObjective
from swath_sysid.attitude.identification.hull_terms import (
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
from swath_sysid.attitude.identification.problem import Problem, block_means, motion_fit, residual_covariance
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
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
from swath_sysid.common.advice import Advice
from swath_sysid.common.cancelling import Progress, ShouldCancel, stop_if
from swath_sysid.common.errors import InputError

#: Periods that the search uses: its basin of attraction narrows with every cycle. Refinement follows the rest.
SEARCH_PERIODS = 6.0
HORIZON_GROWTH = 2.5


def identify_problem(
    problem: Problem,
    settings: IdentificationSettings,
    *,
    progress: Progress | None = None,
    should_cancel: ShouldCancel | None = None,
) -> Identification:
    """Identify the decay model of one axis from decays found before; see `formats.identify_records.identify`."""
    equation = settings.chosen_equation
    space = _space(problem, equation, settings)
    report = progress or (lambda share: None)
    found, parameters = _fitted(problem, space, settings, lambda share: report(0.5 * share), should_cancel)
    report(0.75)
    if settings.equation == AUTO and settings.objective == 'simulation':
        start = motion_fit(problem, equation).unpack(parameters)
        identified = identification_of(problem, settings, found, pruned_hull(problem, *start))
    else:
        identified = refined_in_basin(identification_of(problem, settings, found, FittedHull(equation, parameters)))
    report(1.0)
    return named(identified)


def _fitted(problem: Problem, space: SearchSpace, settings: IdentificationSettings, *watched: Any):
    """The search's result, and the optimum of the objective that it or the decrement leads to. Where the decrement's
    leaves no more than noise and what repeated releases differ by, the default search has nothing to find.
    """
    equation, objective = settings.chosen_equation, _search_objective(problem, settings.chosen_equation, settings)
    guess = _linear_guess(problem, equation)
    if settings.objective == 'one-step':
        found = run_search(objective, space, settings.search, [space.from_ratios(guess)], *watched)
        return found, _exact_one_step(problem, equation, space)
    tolerance = STARTING_TOLERANCE if settings.equation == AUTO else TOLERANCE
    refined = _refined(problem, equation, space, guess, tolerance)
    noise = 1.0 + REPEATABILITY**2 * np.mean([np.var(channel) for channel in problem.weighted])
    if settings.search == SearchSettings(seed=settings.search.seed) and refined[1] ** 2 <= noise:
        found = SearchResult(space.from_ratios(guess), refined[1], 0, 0, 'explained', 'decrement')
    else:
        found = run_search(objective, space, settings.search, [space.from_ratios(guess)], *watched)
        searched = _refined(problem, equation, space, space.to_ratios(found.best[None])[0], tolerance)
        if refined[1] <= searched[1] * (1.0 + STARTING_TOLERANCE):
            found = replace(found, start='decrement')
        else:
            refined = searched
    return found, _refine_outwards(problem, equation, space, refined, tolerance, watched[-1])


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
    return named(refined_in_basin(identification_of(problem, settings, search, FittedHull(equation, parameters))))


def refined_in_basin(found: Identification) -> Identification:
    """A least-squares identification refined, where it suits, by the likelihood that includes the basin's motion. Least
    squares stays where the equation lacks a term, whose effect the likelihood would attribute to basin motion, and
    where the simulated motion diverges.
    """
    problem, equation, start = found.problem, found.model.equation, (found.model.ratios, found.states)
    if found.objective == 'one-step':
        return found
    fitted = basin_fit(problem, equation, *start) if suits_likelihood(problem) else None
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
    guess[AT.b1] = np.clip(2.0 * decrement, 0.01, 2.0)
    guess[AT.r1 if 'r1' in equation.terms else AT.s1] = 1.0
    return guess[equation.indices]


def _exact_one_step(problem: Problem, equation: Equation, space: SearchSpace):
    """The bounded least-squares optimum, and the initial states that suit it best."""
    units = problem.scales.ratio_units
    lower, upper = LOWER * units, UPPER * units
    lower[equation.indices] = space.ratio_lower * units[equation.indices]
    fit = motion_fit(problem, equation)
    return fit.refine_states(fit.pack(_one_step(problem).minimum(equation, lower, upper), problem.states))


def _refined(problem: Problem, equation: Equation, space: SearchSpace, ratios: np.ndarray, tolerance: float):
    """Least squares on the first periods, from dimensionless ratios, and the error it leaves."""
    fit = motion_fit(problem, equation, problem.until(SEARCH_PERIODS))
    start = fit.pack(full_ratios(ratios[None], equation, problem.scales)[0], problem.states)
    return fit.refine(start, space.ratio_lower, space.ratio_upper, tolerance)


def _refine_outwards(
    problem: Problem,
    equation: Equation,
    space: SearchSpace,
    refined: tuple[np.ndarray, float],
    tolerance: float,
    should_cancel: ShouldCancel | None,
):
    """From what is refined on the first periods, least squares on growing parts of the record."""
    longest, horizon = max(m.duration for m in problem.motions), SEARCH_PERIODS
    while np.isfinite(refined[1]):
        stop_if(should_cancel)
        if horizon >= longest * problem.scales.frequency / (2 * np.pi):
            return refined[0]
        horizon *= HORIZON_GROWTH
        fit = motion_fit(problem, equation, problem.until(horizon))
        refined = fit.refine(refined[0], space.ratio_lower, space.ratio_upper, tolerance)
    spans = ', '.join(f'{each.start:.1f} to {each.end:.1f} s' for each in problem.segments)
    runaway = Advice.of('runaway', axis=problem.axis, equation=equation.name, spans=spans)
    raise InputError(runaway.message, runaway.code)


def identification_of(
    problem: Problem, settings: IdentificationSettings, search: SearchResult, hull: FittedHull
) -> Identification:
    """The identification that a fitted hull gives, with its uncertainty."""
    equation, fit = hull.equation, motion_fit(problem, hull.equation)
    ratios, states = fit.unpack(hull.parameters)
    residuals, _ = fit.residuals_and_jacobian(hull.parameters)
    found = residual_covariance(problem, fit, hull.parameters)
    n, units = len(equation.terms), problem.scales.ratio_units[equation.indices]
    covariance = found.matrix[:n, :n] * np.outer(units, units)
    trim_std = float(np.sqrt(np.mean(np.diag(found.matrix)[n + 2 :: 3]))) * problem.scales.amplitude
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
        effective_samples=found.effective_samples,
        states=tuple(states),
        search=search,
        problem=problem,
        settings=settings,
        basin=hull.basin,
        posterior=hull.posterior,
    )
