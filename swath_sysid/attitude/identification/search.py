"""The global search: which variables, which algorithm, until when."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import LOWER, TERMS, UPPER, Scales
from swath_sysid.common.cancelling import Progress, ShouldCancel, stop_if
from swath_sysid.common.errors import InputError, check_choice
from swath_sysid.common.optimisers import OPTIMISERS, GeneticSettings, SearchBudget


@dataclass(frozen=True)
class Preset:
    """Search settings of one of the papers, its ranges in the published variables."""

    name: str
    genetic: GeneticSettings
    inertia: float = 0.1  #: Upper end of the range of I'; all lower ends are 0.
    damping: float = 1.0  #: Of N and W.
    restoring: float = 10.0  #: Of x and C1 to C3.


_PUBLISHED_BUDGET = GeneticSettings(generations=2000, population=200, patience=0, spread_tolerance=0.0)
PRESETS = {
    preset.name: preset
    for preset in (
        Preset('swath-pitch', _PUBLISHED_BUDGET),
        Preset('swath-roll', _PUBLISHED_BUDGET),
        Preset('hydrofoil-pitch', replace(_PUBLISHED_BUDGET, mutation=0.01, final_mutation=0.0001, genetic_factor=0.1)),
        Preset('swath-usv-pitch', replace(_PUBLISHED_BUDGET, population=400, crossover=0.7)),
    )
}


@dataclass(frozen=True)
class SearchSpace:
    """Box of search variables and their map to dimensionless ratios."""

    lower: np.ndarray  #: (n,)
    upper: np.ndarray  #: (n,)
    to_ratios: Callable  #: Candidates (P, n) to dimensionless ratios (P, terms).
    from_ratios: Callable  #: Dimensionless ratios (terms,) to a candidate, for a first guess.
    ratio_lower: np.ndarray  #: (terms,); lower bounds of the refinement, dimensionless.
    ratio_upper: np.ndarray  #: (terms,); upper bounds of the refinement, dimensionless.


def dimensionless_space(equation: Equation) -> SearchSpace:
    """The default: the ratios themselves, dimensionless."""
    lower, upper = LOWER[equation.indices], UPPER[equation.indices]
    return SearchSpace(lower, upper, lambda c: c, lambda r: r, lower, upper)


def published_space(equation: Equation, preset: Preset, scales: Scales) -> SearchSpace:
    """The published variables I', N, W, x, C1, C2, C3, in the published ranges, the inertia included. Raises
    `InputError` for an equation with a term that no paper has, such as friction.
    """
    terms = [TERMS[name] for name in equation.terms]
    unknown = [term.word for term in terms if not term.symbol]
    if unknown:
        raise InputError(
            f'the published ranges have none for {unknown[0]}: leave the preset out or choose an equation without'
        )
    width = np.array([(preset.damping if t.symbol in 'NW' else preset.restoring) / t.factor for t in terms])
    units = scales.ratio_units[equation.indices]
    smallest = 1e-6 * preset.inertia

    def to_ratios(candidates: np.ndarray):
        return candidates[:, 1:] / candidates[:, :1] / units

    def from_ratios(ratios: np.ndarray):
        coefficients = ratios * units
        inertia = min(preset.inertia, float(np.min(width / np.maximum(coefficients, 1e-12))))
        return np.concatenate([[inertia], coefficients * inertia])

    return SearchSpace(
        lower=np.concatenate([[smallest], np.zeros(width.size)]),
        upper=np.concatenate([[preset.inertia], width]),
        to_ratios=to_ratios,
        from_ratios=from_ratios,
        ratio_lower=np.zeros(width.size),
        ratio_upper=UPPER[equation.indices],
    )


#: Least and largest values of search settings.
WHOLE_NUMBERS = {'generations': (1, 100_000), 'population': (8, 100_000), 'seed': (0, 2**31 - 1)}


@dataclass(frozen=True)
class SearchSettings:
    """Which algorithm with which budget."""

    algorithm: str = 'ga'  #: A name in `OPTIMISERS`.
    preset: str | None = None  #: A name in ``PRESETS``: its parameters, and the published variables and ranges.
    generations: int | None = None  #: Overrides the preset's or the algorithm's default.
    population: int | None = None  #: Likewise.
    seed: int = 1  #: Ranges are in `WHOLE_NUMBERS`.

    def __post_init__(self):
        check_choice(self.algorithm, OPTIMISERS, 'search algorithm')
        if self.preset is not None:
            check_choice(self.preset, PRESETS, 'preset')
        if self.preset is not None and self.algorithm != 'ga':
            raise InputError('the presets are settings of the genetic algorithm: leave the search at ga')
        for name, (lowest, highest) in WHOLE_NUMBERS.items():
            value = getattr(self, name)
            if value is None and name != 'seed':
                continue
            # to Python True is 1
            if isinstance(value, bool) or not isinstance(value, Integral) or not lowest <= int(value) <= highest:
                raise InputError(f'{name} must be a whole number from {lowest} to {highest}, not {value}')

    @property
    def budget(self) -> SearchBudget:
        """That of the preset or the algorithm, with the overrides of generations and population."""
        default = PRESETS[self.preset].genetic if self.preset else OPTIMISERS[self.algorithm].Settings()
        given = {k: v for k in ('generations', 'population') if (v := getattr(self, k)) is not None}
        return replace(default, **given)


@dataclass(frozen=True)
class SearchResult:
    """The best candidate of a search."""

    best: np.ndarray  #: (n,); In the variables of the search space.
    value: float
    generations: int
    evaluations: int
    stop: str  #: Name of the rule that ended it; ``explained`` where it was not needed.
    start: str = 'search'  #: ``search`` or ``decrement``: from which of both the refinement came to the optimum.


def run_search(
    objective: Callable[[np.ndarray], np.ndarray],
    space: SearchSpace,
    settings: SearchSettings,
    first: ArrayLike = (),
    progress: Progress | None = None,
    should_cancel: ShouldCancel | None = None,
) -> SearchResult:
    """Minimise an objective, dimensionless ratios (P, terms) to values (P,), over a space. ``first`` (k, n) are
    candidates to start with. ``progress`` gets the share of the budget spent and ``should_cancel`` is asked after each
    generation; raises `Cancelled`.
    """
    budget = settings.budget
    search = OPTIMISERS[settings.algorithm](space.lower, space.upper, budget, settings.seed, first)
    while not search.should_stop():
        search.tell(objective(space.to_ratios(search.ask())))
        if progress is not None:
            progress(min(1.0, search.generation / budget.generations))
        stop_if(should_cancel)
    return SearchResult(
        search.best.copy(), search.best_value, search.generation, search.evaluations, search.should_stop() or ''
    )


def full_ratios(dimensionless: np.ndarray, equation: Equation, scales: Scales) -> np.ndarray:
    """Dimensionless ratios of an equation's terms, (P, terms), to ratios of all terms, (P, 9)."""
    return equation.complete(dimensionless * scales.ratio_units[equation.indices])
