"""Which equation to use: rank many on the same records, and choose the simplest adequate one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.identification.identify import identify_problem, refit_from
from swath_sysid.attitude.identification.problem import Problem, motion_fit
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
from swath_sysid.common.conventions import CRITERION_MARGIN, LEVELS
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import results_in_order

HELD_OUT_MARGIN = 1.1
Fit = TypeVar('Fit', bound=Any)
Ranked = TypeVar('Ranked', bound=Any)  #: A campaign ranks its own summaries of fits.


@dataclass(frozen=True)
class RankedFit:
    """One equation's fit and its rank among the others."""

    identification: Identification
    criterion: float  #: Bayesian, with the effective sample size; smaller is better.
    #: Error of the motion simulated beyond the part it was identified on, over the standard deviation of the measured
    #: motion there; infinite where the simulation ran away.
    held_out: float

    @property
    def name(self) -> str:
        """Name of the equation."""
        return self.identification.model.equation.name

    @property
    def term_count(self) -> int:
        """Number of ratios."""
        return len(self.identification.model.equation.terms)


@dataclass(frozen=True)
class Comparison:
    """Equations ranked, best criterion first, and the choice."""

    ranked: tuple[RankedFit, ...]
    choice: RankedFit  #: The simplest adequate one.
    reason: str  #: One sentence.


def compare(
    problem: Problem,
    equations: Sequence[Equation],
    settings: IdentificationSettings = IdentificationSettings(),  # noqa: B008 - frozen
    *,
    jobs: int = 1,
    progress: Callable[[int, str], None] | None = None,
) -> Comparison:
    """Fit equations, at least one and none twice, on the same records and rank them, with ``jobs`` processes. A model
    that contains another never ends with a worse objective: it is refined again from the smaller model's optimum.
    ``progress`` gets the number done and the last name. Raises `InputError` without an equation, or with one twice.
    """
    names = [e.name for e in equations]
    if not names or len(set(names)) < len(names):
        raise InputError('give at least one equation to compare, and none twice')
    tasks = [(problem, replace(settings, equation=name)) for name in names]
    fits, held_out = [], []
    for name, (fit, error) in zip(names, results_in_order(_fit_and_hold_out, tasks, jobs), strict=True):
        fits.append(fit)
        held_out.append(error)
        if progress is not None:
            progress(len(fits), name)

    def refit(fit: Identification, better: Identification):
        return refit_from(problem, fit.settings, better.model.ratios, better.states, fit.search)

    return rank(enforce_nesting(fits, refit), held_out)


def rank(fits: Sequence[Identification], held_out: Sequence[float]) -> Comparison:
    """Rank fits of the same records, with their held-out errors; choose the simplest of those with the best verdict."""
    samples = min(fits, key=lambda f: f.objective_value).effective_samples
    ranked = [RankedFit(f, information_criterion(f, samples), e) for f, e in zip(fits, held_out, strict=True)]
    ranked.sort(key=lambda fit: fit.criterion)
    best = max(LEVELS.index(f.verdict.level) for f in fits)
    usable = [r for r in ranked if LEVELS.index(r.identification.verdict.level) == best]
    choice, reason = simplest_adequate(usable)
    worse = [r.name for r in ranked if r not in usable]
    if worse and len(usable) == 1:
        reason = f'{choice.name} is the only {LEVELS[best]} equation.'
    others = f' Not {LEVELS[best]}, and not considered: {", ".join(worse)}.' if worse else ''
    return Comparison(tuple(ranked), choice, f'{reason}{others}')


def simplest_adequate(ranked: Sequence[Ranked], criterion: str = 'criterion') -> tuple[Ranked, str]:
    """The equation with the fewest terms that criterion and held-out motion do not exclude, and the reason, a sentence.
    Ranked best first, each with ``name``, ``term_count``, ``criterion`` and ``held_out``; ``criterion`` is its name.
    """
    likely = [r for r in ranked if r.criterion <= ranked[0].criterion + CRITERION_MARGIN]
    smallest = min(r.held_out for r in ranked)
    adequate = [r for r in likely if r.held_out <= HELD_OUT_MARGIN * smallest]
    choice = min(adequate or likely, key=lambda r: (r.term_count, r.criterion))
    within = f'whose {criterion} is within {CRITERION_MARGIN:g} of the best'
    if len(ranked) == 1:
        return choice, f'{choice.name} is the only equation asked for.'
    if len(likely) == 1:
        return choice, (
            f'{choice.name} is the only equation {within}: the others fit worse, or need more terms for it.'
        )
    count = len(adequate or likely)
    fewest = (
        f'has {choice.term_count} terms, the fewest of the {count} equations' if count > 1 else 'is the only equation'
    )
    words = f'{choice.name} {fewest} {within} ({ranked[0].name})'
    if adequate:
        held_out = f'is within {100 * (HELD_OUT_MARGIN - 1):.0f} % of the smallest'
        return choice, f'{words} and whose error on held-out motion {held_out}.'
    best = min(ranked, key=lambda r: r.held_out).name
    return choice, f'{words}; none of them predicts the held-out motion as well as {best}.'


def information_criterion(fit: Any, effective_samples: float) -> float:
    """Bayesian information criterion n ln(mean squared residual) + k ln n, n the effective samples."""
    n = effective_samples
    return float(2.0 * n * np.log(fit.objective_value) + len(fit.model.equation.terms) * np.log(n))


def _fit_and_hold_out(task: tuple[Problem, IdentificationSettings]):
    problem, settings = task
    return identify_problem(problem, settings), held_out_error(problem, settings)


def held_out_error(problem: Problem, settings: IdentificationSettings) -> float:
    """Identify on the first part of each record and score the simulated motion on the rest; see `RankedFit`."""
    first = first_part(problem)
    found = identify_problem(first, settings)
    whole = motion_fit(problem, found.model.equation)
    simulated = whole.simulated(whole.pack(found.model.ratios, found.states))
    error = spread = 0.0
    for motion, cut, (angle, rate) in zip(problem.motions, first.motions, simulated, strict=True):
        rest = slice(cut.size, None)
        measured, model = motion.primary[rest], (rate if motion.angle is None else angle)[rest]
        error += float(np.sum((measured - model) ** 2))
        spread += float(np.sum((measured - measured.mean()) ** 2))
    ratio = np.sqrt(error / spread)
    return float(ratio) if np.isfinite(ratio) else float('inf')


def first_part(problem: Problem) -> Problem:
    """The same problem on the first half of each record."""
    cut = tuple(m.between(None, m.time[0] + 0.5 * m.duration) for m in problem.motions)
    return replace(problem, motions=cut, observed=cut)


def enforce_nesting(fits: Sequence[Fit], refit: Callable[[Fit, Fit], Fit]) -> list[Fit]:
    """Refine again, by ``refit`` from the smaller model's optimum, any fit that a model it contains beats."""
    fits = list(fits)
    for k in sorted(range(len(fits)), key=lambda k: len(fits[k].model.equation.terms)):
        equation = fits[k].model.equation
        contained = [f for f in fits if f is not fits[k] and equation.contains(f.model.equation)]
        best = min(contained, key=lambda f: f.objective_value, default=None)
        if best is not None and best.objective_value < fits[k].objective_value:
            fits[k] = min(refit(fits[k], best), fits[k], key=lambda f: f.objective_value)
    return fits
