"""Optimisers with ask and tell, by name: genetic algorithm, particle swarm.

The genetic algorithm's recombination places a child on the line through its parents, up to 0.6 of their distance
beyond each: the blend crossover of Eshelman and Schaffer, along the line so that correlated variables stay correlated.
Mutation is scaled by the spread of the population, so that the search sharpens as it converges.

The particle swarm has the constriction form of Clerc and Kennedy (2002) and the whole swarm as neighbourhood.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


def latin_hypercube(rng: np.random.Generator, count: int, dimensions: int) -> np.ndarray:
    """Points in the unit cube, (count, dimensions), one in each of ``count`` slices of every coordinate, as scipy's.
    McKay, Beckman and Conover, Technometrics 21 (1979), 239-245.
    """
    (rng,) = rng.spawn(1)
    within = rng.uniform(size=(count, dimensions))
    slices = np.tile(np.arange(1, count + 1), (dimensions, 1))
    for row in slices:
        rng.shuffle(row)
    return (slices.T - within) / count


@dataclass(frozen=True)
class SearchBudget:
    """What ends a search, and the size of its population."""

    generations: int = 300
    population: int = 80
    patience: int = 25  #: Generations without improvement before it stops; 0: never.
    tolerance: float = 1e-4  #: Relative improvement of the objective that counts as one.
    spread_tolerance: float = 1e-4  #: Spread of the population, as a share of the range, below which it has converged.


class AskAndTell(ABC):
    """A minimisation within bounds (n,) that never calls the objective; ``first`` (k, n) joins the first generation."""

    Settings: type[SearchBudget] = SearchBudget
    _settings: SearchBudget

    def __init__(
        self, lower: ArrayLike, upper: ArrayLike, settings: SearchBudget, seed: int, first: ArrayLike = ()
    ) -> None:
        self._lower, self._upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        self._range = self._upper - self._lower
        self._settings = settings
        self._rng = np.random.default_rng(seed)
        self._first = np.clip(np.reshape(first, (-1, self._lower.size)), self._lower, self._upper)
        self._asked = self._population = np.empty((0, self._lower.size))
        self._values = np.empty(0)  #: (P,); of the population, which holds the best candidate so far.
        self._reference = np.inf
        self._waited = 0
        self.generation = 0
        self.evaluations = 0

    @property
    def best(self) -> np.ndarray:
        """The best candidate so far, shape (n,)."""
        return self._population[np.argmin(self._values)]

    @property
    def best_value(self) -> float:
        """Its objective value."""
        return float(self._values.min())

    def ask(self) -> np.ndarray:
        """Candidates of the next generation, shape (P, n)."""
        self._asked = self._next_generation() if self.generation else self._first_generation()
        return self._asked.copy()

    def tell(self, values: np.ndarray) -> None:
        """Objective values of the candidates asked for, shape (P,); not finite counts as worst."""
        self._learn(np.where(np.isfinite(values), values, np.inf))
        self.generation += 1
        self.evaluations += len(self._asked)
        improvement = self._settings.tolerance * abs(self._reference)
        if self.best_value < self._reference - improvement or not np.isfinite(self._reference):
            self._reference = self.best_value
            self._waited = 0
        else:
            self._waited += 1

    def should_stop(self) -> str | None:
        """Name of the rule that stops the search, or None: ``generations``, ``stagnation`` or ``convergence``."""
        if not self.generation:
            return None
        if self.generation >= self._settings.generations:
            return 'generations'
        if 0 < self._settings.patience <= self._waited:
            return 'stagnation'
        spread = (np.ptp(self._population, axis=0) / self._range).max()
        return 'convergence' if spread < self._settings.spread_tolerance else None

    def _first_generation(self) -> np.ndarray:
        population = self._lower + latin_hypercube(self._rng, self._settings.population, self._lower.size) * self._range
        population[: len(self._first)] = self._first[: len(population)]
        return population

    @abstractmethod
    def _next_generation(self) -> np.ndarray:
        """Candidates (P, n) of each generation but the first."""

    @abstractmethod
    def _learn(self, values: np.ndarray) -> None:
        """Update the population from the values (P,) of the candidates asked for."""


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
    """Genetic algorithm; its population is sorted, the best first."""

    Settings = GeneticSettings
    _settings: GeneticSettings

    @property
    def _elite(self) -> int:
        return max(1, round(self._settings.genetic_factor * self._settings.population))

    def _learn(self, values: np.ndarray) -> None:
        kept = self._elite if self.generation else 0
        population = np.concatenate([self._population[:kept], self._asked])
        values = np.concatenate([self._values[:kept], values])
        order = np.argsort(values, kind='stable')[: self._settings.population]
        self._population, self._values = population[order], values[order]

    def _next_generation(self) -> np.ndarray:
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


PULL = 4.1  #: To a particle's own best place and to the swarm's together, by that paper.


def constriction(pull: float) -> float:
    """By what velocity and pull are multiplied, so that the swarm converges."""
    return 2.0 / (pull - 2.0 + (pull * (pull - 4.0)) ** 0.5)


@dataclass(frozen=True)
class SwarmSettings(SearchBudget):
    """Parameters of the swarm."""

    fastest: float = 0.3  #: Greatest velocity as a share of the range.


class ParticleSwarm(AskAndTell):
    """Particle swarm; its population holds the best place of each particle."""

    Settings = SwarmSettings
    _settings: SwarmSettings

    def _learn(self, values: np.ndarray) -> None:
        if not self.generation:
            self._population, self._values = self._asked.copy(), values
            self._velocity = self._rng.uniform(-0.1, 0.1, self._asked.shape) * self._range
        better = values < self._values
        self._population[better] = self._asked[better]
        self._values[better] = values[better]

    def _next_generation(self) -> np.ndarray:
        place = self._asked
        own, swarm = 0.5 * PULL * self._rng.random((2, *place.shape))
        velocity = constriction(PULL) * (
            self._velocity + own * (self._population - place) + swarm * (self.best - place)
        )
        fastest = self._settings.fastest * self._range
        self._velocity = np.clip(velocity, -fastest, fastest)
        place = place + self._velocity
        self._velocity[(place < self._lower) | (place > self._upper)] *= -0.5
        return np.clip(place, self._lower, self._upper)


OPTIMISERS: dict[str, type[AskAndTell]] = {'ga': GeneticSearch, 'pso': ParticleSwarm}
