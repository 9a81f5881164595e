"""What is pooled: candidates, which follow the rows one by one and forecast from each; a state space is one on rows."""

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from swath_sysid.attitude.prediction.hull_filter import HEALTHY_STRAIN
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.rows import CHANNELS
from swath_sysid.attitude.prediction.state_space import InnovationsFilter

_MISSING = np.full(len(CHANNELS), math.nan)


class Candidate(Protocol):
    """Forecasts of roll, pitch and their rates from the rows so far: even steps of the motion, some 32 a period.

    Whatever has these four can be pooled with the package's own, by how likely each makes what comes.

    Example:
        >>> class Held:
        ...     widening = 1.0
        ...     def take(self, row):
        ...         self.newest = row[:4]
        ...     def predict(self, count):
        ...         self.newest = np.full(4, np.nan)
        ...     def ahead(self, rows):
        ...         return np.tile(self.newest, (rows.size, 1)), 0.001 * rows[:, None, None] * np.eye(4)
        >>> settings = ForecasterSettings(candidates={'held': lambda step, period: Held()})
        >>> pipeline = ForecastPipeline(PipelineSettings(forecaster=settings))
        >>> for sample in samples_of(read_trial(records / 'morro_buoy.csv').between(0.0, 20.0)):
        ...     step = pipeline.add_sample(sample)
        >>> found = pipeline.diagnostics()
        >>> found.candidates[-1], found.weights[-1].shape  # by axis and lead
        ('held', (2, 6))
    """

    @property
    def widening(self) -> float | np.ndarray:
        """Factor of the variances, one or for each of `ATTITUDE`, by which the newest errors exceed the claim."""

    def take(self, row: np.ndarray) -> None:
        """Follow the next row of `CHANNELS`, NaN where missing."""

    def predict(self, count: int) -> None:
        """Go on over so many rows without a reading."""

    def ahead(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (L, 4) and covariance (L, 4, 4) of readings of `ATTITUDE` so many rows (L,) after the newest, in parts
        of a row too; NaN without a forecast. It changes nothing.
        """


class OnRows:
    """A state space as a candidate, on every so many of the rows by their number: a longer past at the same cost.

    ``beside`` gives what else it reads of a row of a number, after `ATTITUDE`.
    """

    def __init__(
        self,
        space: InnovationsFilter,
        every: int = 1,
        newest: int = 0,
        beside: Callable[[int], list[float]] | None = None,
    ) -> None:
        self.space, self._every, self._newest, self._beside = space, every, newest, beside

    @property
    def widening(self) -> float:
        """What the newest rows contradict claims so much more."""
        return max(self.space.nis / HEALTHY_STRAIN, 1.0)

    def take(self, row: np.ndarray) -> None:
        """Follow the next row, if it is one of those that are used."""
        self._newest += 1
        if self._newest % self._every == 0:
            if self._beside is not None:
                row = np.concatenate([row[: len(ATTITUDE)], self._beside(self._newest)])
            self.space.take(row)

    def predict(self, count: int) -> None:
        """Go on over missing rows; what is read beside them may be there."""
        for _ in range(count):
            self.take(_MISSING)

    def ahead(self, rows: np.ndarray, doubt: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """As of `InnovationsFilter`, from the newest row."""
        return self.space.ahead((rows + self._newest % self._every) / self._every, doubt)
