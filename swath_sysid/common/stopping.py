"""The common part of searches with ask and tell, and the named reasons for which they stop."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swath_sysid.common.latin_hypercube import latin_hypercube

Progress = Callable[[float], None]  #: Is called with the share done, 0 to 1.
ShouldCancel = Callable[[], bool]  #: Is asked often whether to raise `Cancelled`.


@dataclass(frozen=True)
class SearchBudget:
    """What ends a search, and the size of its population."""

    generations: int = 300
    population: int = 80
    patience: int = 25  #: Generations without improvement before it stops; 0: never.
    tolerance: float = 1e-4  #: Relative improvement of the objective that counts as one.
    spread_tolerance: float = 1e-4  #: Spread of the population, as a share of the range, below which it has converged.


class AskAndTell:
    """A search within bounds (n,) that never calls the objective; ``first`` (k, n) joins the first generation."""

    def __init__(self, lower: ArrayLike, upper: ArrayLike, budget: SearchBudget, seed: int, first: ArrayLike) -> None:
        self._lower, self._upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        self._range = self._upper - self._lower
        self._budget = budget
        self._rng = np.random.default_rng(seed)
        self._first = np.clip(np.reshape(first, (-1, self._lower.size)), self._lower, self._upper)
        self._reference = np.inf
        self._waited = 0
        self.generation = 0
        self.evaluations = 0

    def _first_generation(self) -> np.ndarray:
        population = self._lower + latin_hypercube(self._rng, self._budget.population, self._lower.size) * self._range
        population[: len(self._first)] = self._first[: len(population)]
        return population

    def _count(self, evaluations: int, best_value: float) -> None:
        """Count one more generation, of so many evaluations, and whether its best value is an improvement."""
        self.generation += 1
        self.evaluations += evaluations
        improvement = self._budget.tolerance * abs(self._reference)
        if best_value < self._reference - improvement or not np.isfinite(self._reference):
            self._reference = best_value
            self._waited = 0
        else:
            self._waited += 1

    def _stop_reason(self, candidates: np.ndarray) -> str | None:
        """The rule that ends the search now, or None: budget, ``patience`` without improvement, or convergence."""
        if not self.generation:
            return None
        if self.generation >= self._budget.generations:
            return 'generations'
        if 0 < self._budget.patience <= self._waited:
            return 'stagnation'
        spread = (np.ptp(candidates, axis=0) / self._range).max()
        return 'convergence' if spread < self._budget.spread_tolerance else None


class Cancelled(Exception):  # noqa: N818 - an outcome, not an error
    """The caller asked to stop."""
