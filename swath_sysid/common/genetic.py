"""A real-coded genetic algorithm with ask and tell: it never calls the objective.

Recombination places a child on the line through its parents, up to 0.6 of their distance beyond each: the blend
crossover of Eshelman and Schaffer, along the line so that correlated variables stay correlated. Mutation is scaled by
the spread of the population, so that the search sharpens as it converges.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swath_sysid.common.stopping import AskAndTell, SearchBudget

BLEND = 0.6


@dataclass(frozen=True)
class GeneticSettings(SearchBudget):
    """Parameters of the genetic algorithm; the papers name them without definition."""

    crossover: float = 0.8  #: Probability that a pair of parents is recombined, else the first is copied.
    mutation: float = 0.15  #: Probability that a variable of a child is disturbed.
    genetic_factor: float = 0.05  #: Share of the population that is inherited unchanged (elitism).
    evolution_weight: float = 0.9  #: Probability that the better of two wins the tournament for parenthood.
    final_mutation: float | None = None  #: If given, mutation falls geometrically to this over the budget.


class GeneticSearch(AskAndTell):
    """Minimise by genetic algorithm within bounds; see `AskAndTell`."""

    def __init__(
        self, lower: ArrayLike, upper: ArrayLike, settings: GeneticSettings, seed: int, first: ArrayLike = ()
    ) -> None:
        super().__init__(lower, upper, settings, seed, first)
        self._settings = settings
        self._elite = max(1, round(settings.genetic_factor * settings.population))
        self._asked = np.empty((0, self._lower.size))
        self._population = np.empty((0, self._lower.size))
        self._values = np.empty(0)

    @property
    def best(self) -> np.ndarray:
        """The best candidate so far, shape (n,)."""
        return self._population[0]

    @property
    def best_value(self) -> float:
        """Its objective value."""
        return float(self._values[0])

    def ask(self) -> np.ndarray:
        """Candidates of the next generation, shape (P, n)."""
        self._asked = self._children() if self.generation else self._first_generation()
        return self._asked

    def tell(self, values: np.ndarray) -> None:
        """Objective values of the candidates asked for, shape (P,); not finite counts as worst."""
        values = np.where(np.isfinite(values), values, np.inf)
        kept = self._elite if self.generation else 0
        population = np.concatenate([self._population[:kept], self._asked])
        values = np.concatenate([self._values[:kept], values])
        order = np.argsort(values, kind='stable')[: self._settings.population]
        self._population, self._values = population[order], values[order]
        self._count(len(self._asked), self._values[0])

    def should_stop(self) -> str | None:
        """Name of the rule that stops the search, or None: ``generations``, ``stagnation`` or ``convergence``."""
        return self._stop_reason(self._population)

    def _children(self) -> np.ndarray:
        count = self._settings.population - self._elite
        first, second = self._parents(count), self._parents(count)
        children = np.where(
            self._rng.random((count, 1)) < self._settings.crossover,
            first + self._rng.uniform(-BLEND, 1.0 + BLEND, (count, 1)) * (second - first),
            first,
        )
        start, end = self._settings.mutation, self._settings.final_mutation
        share = self.generation / self._settings.generations
        disturbed = self._rng.random(children.shape) < (start if end is None else start * (end / start) ** share)
        # normal steps of the population's own spread
        steps = self._rng.normal(size=(count, self._lower.size)) * self._population.std(axis=0)
        children += np.where(disturbed, steps, 0.0)
        return self._reflected(children)

    def _parents(self, count: int) -> np.ndarray:
        """Binary tournaments, won by the better with probability ``evolution_weight``."""
        pair = np.sort(self._rng.integers(0, len(self._population), (2, count)), axis=0)
        better_wins = self._rng.random(count) < self._settings.evolution_weight
        return self._population[np.where(better_wins, pair[0], pair[1])]

    def _reflected(self, children: np.ndarray) -> np.ndarray:
        """Bring children that left the range back in by reflection at its bounds."""
        children = np.where(children < self._lower, 2 * self._lower - children, children)
        children = np.where(children > self._upper, 2 * self._upper - children, children)
        return np.clip(children, self._lower, self._upper)
