"""Named reasons for which a search stops."""

from typing import Protocol

import numpy as np


class StopRules(Protocol):
    """The settings of a search that end it; see `stop_reason`."""

    @property
    def generations(self) -> int:
        """Budget."""

    @property
    def spread_tolerance(self) -> float:
        """Share of the search range."""


class Stagnation:
    """Counts for how many generations the best value has not improved by a relative amount.

    After ``generations`` of them patience is over; 0: never.
    """

    def __init__(self, generations: int, tolerance: float) -> None:
        self._patience = generations
        self._tolerance = tolerance
        self._reference = np.inf
        self._waited = 0

    def note(self, best_value: float) -> None:
        """Take the best value of one more generation."""
        if best_value < self._reference - self._tolerance * abs(self._reference) or not np.isfinite(self._reference):
            self._reference = best_value
            self._waited = 0
        else:
            self._waited += 1

    @property
    def exhausted(self) -> bool:
        """Whether patience is over."""
        return self._patience > 0 and self._waited >= self._patience


def stop_reason(generation: int, settings: StopRules, stagnation: Stagnation, spread: float) -> str | None:
    """Name of the rule that ends the search now, or None.

    ``generations``: the budget is spent. ``stagnation``: the best value has not improved for
    ``settings.patience`` generations. ``convergence``: the population has drawn together to
    ``settings.spread_tolerance`` of the search range in every variable.
    """
    if generation >= settings.generations:
        return 'generations'
    if stagnation.exhausted:
        return 'stagnation'
    if spread < settings.spread_tolerance:
        return 'convergence'
    return None


class Cancelled(Exception):  # noqa: N818 - an outcome, not an error
    """The caller asked to stop."""
