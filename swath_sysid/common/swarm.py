"""Particle swarm optimisation with ask and tell: it never calls the objective.

The constriction form of Clerc and Kennedy (2002), whole-swarm neighbourhood.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from swath_sysid.common.stopping import AskAndTell, SearchBudget

PULL = 4.1  #: To a particle's own best place and to the swarm's together, by that paper.


def constriction(pull: float) -> float:
    """By what velocity and pull are multiplied, so that the swarm converges."""
    return 2.0 / (pull - 2.0 + (pull * (pull - 4.0)) ** 0.5)


@dataclass(frozen=True)
class SwarmSettings(SearchBudget):
    """Parameters of the swarm."""

    fastest: float = 0.3  #: Greatest velocity as a share of the range.


class ParticleSwarm(AskAndTell):
    """Minimise by particle swarm within bounds; the same use as `GeneticSearch`."""

    def __init__(
        self, lower: ArrayLike, upper: ArrayLike, settings: SwarmSettings, seed: int, first: ArrayLike = ()
    ) -> None:
        super().__init__(lower, upper, settings, seed, first)
        self._fastest = settings.fastest * self._range
        self._place = self._first_generation()
        self._velocity = self._rng.uniform(-0.1, 0.1, self._place.shape) * self._range
        self._own_best = self._place.copy()
        self._own_value = np.full(settings.population, np.inf)

    @property
    def best(self) -> np.ndarray:
        """The best candidate so far, shape (n,)."""
        return self._own_best[np.argmin(self._own_value)]

    @property
    def best_value(self) -> float:
        """Its objective value."""
        return float(self._own_value.min())

    def ask(self) -> np.ndarray:
        """Places of the particles, shape (P, n)."""
        if self.generation:
            self._move()
        return self._place.copy()

    def tell(self, values: np.ndarray) -> None:
        """Objective values of the places asked for, shape (P,); not finite counts as worst."""
        values = np.where(np.isfinite(values), values, np.inf)
        better = values < self._own_value
        self._own_best[better] = self._place[better]
        self._own_value[better] = values[better]
        self._count(len(values), self.best_value)

    def should_stop(self) -> str | None:
        """Name of the rule that stops the search, or None: ``generations``, ``stagnation`` or ``convergence``."""
        return self._stop_reason(self._own_best)

    def _move(self) -> None:
        own, swarm = 0.5 * PULL * self._rng.random((2, *self._place.shape))
        self._velocity = constriction(PULL) * (
            self._velocity + own * (self._own_best - self._place) + swarm * (self.best - self._place)
        )
        self._velocity = np.clip(self._velocity, -self._fastest, self._fastest)
        self._place = self._place + self._velocity
        outside = (self._place < self._lower) | (self._place > self._upper)
        self._velocity[outside] *= -0.5
        self._place = np.clip(self._place, self._lower, self._upper)
