"""What a craft has learnt of the sea, kept: a candidate from the first row on wherever its rows begin anew."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from swath_sysid.attitude.prediction.state_space import InnovationsModel

MEMORY = 'memory'  #: The candidate.
#: Variance of each channel's level about the remembered one, over the channel's own: trim and biases are the day's.
LEVEL_VARIANCE = 1.0
#: Relative difference of the steps between rows up to which the rows are those that the memory was learnt on.
SAME_ROWS = 0.01


@dataclass(frozen=True)
class SeaMemory:
    """The waves that a past has taught, for `ForecastPipeline.remember`."""

    period: float  #: Of the motion, s.
    periods: float  #: Of that past.
    waves: InnovationsModel

    def is_for(self, step: float) -> bool:
        """Whether it was learnt on rows so many s apart."""
        return abs(step / self.waves.step - 1.0) < SAME_ROWS

    def candidate(self, step: float) -> InnovationsModel:
        """The state space with the level of each channel as a further state that stays: y = C x + level + e."""
        m, count = self.waves, len(self.waves.channels)
        level = np.eye(count)
        return replace(
            m,
            step=step,
            a=block_diag(m.a, level),
            k=np.vstack([m.k, np.zeros((count, count))]),
            c=np.hstack([m.c, level]),
            prior=block_diag(m.prior, LEVEL_VARIANCE * level),
            from_lags=None,
        )
