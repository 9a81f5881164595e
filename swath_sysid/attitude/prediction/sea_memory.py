"""What a craft has learnt of the sea, kept: a candidate from the first row on wherever its rows begin anew."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import LinAlgError, block_diag, solve_discrete_are, solve_discrete_lyapunov

from swath_sysid.attitude.prediction.state_space import InnovationsModel
from swath_sysid.attitude.prediction.variate_analysis import spectral_radius

MEMORY = 'memory'  #: The candidate.
#: Variance of each channel's level about the remembered one, over the channel's own: trim and biases are the day's.
LEVEL_VARIANCE = 1.0
#: Relative difference of two steps between rows that are taken for the same.
SAME_STEP = 0.01


@dataclass(frozen=True)
class SeaMemory:
    """The waves that a past has taught, for `ForecastPipeline.remember`."""

    period: float  #: Of the motion, s.
    periods: float  #: Of that past.
    waves: InnovationsModel

    def candidate(self, step: float) -> InnovationsModel | None:
        """The state space on rows so many s apart, with the level of each channel as a further state that stays.

        y = C x + level + e. None where these rows show too little of it.
        """
        m = self.waves if abs(step / self.waves.step - 1.0) < SAME_STEP else at_step(self.waves, step)
        if m is None:
            return None
        level = np.eye(len(m.channels))
        return replace(
            m,
            step=step,
            a=block_diag(m.a, level),
            k=np.vstack([m.k, np.zeros_like(level)]),
            c=np.hstack([m.c, level]),
            prior=block_diag(m.prior, LEVEL_VARIANCE * level),
            from_lags=None,
        )


def at_step(model: InnovationsModel, step: float) -> InnovationsModel | None:
    """The innovations form of the same channels on rows another step, s, apart; None where there is none.

    It has the covariances that the model's own show at these lags: with r the ratio of the steps, N = A P0 C' + K S and
    P0 = A P0 A' + K S K', cov(y[t+k], y[t]) = C A^(r k - 1) N. So A^r and A^(r-1) N take the parts of A and N, and what
    is not known of the state solves the Riccati equation of its prediction (Van Overschee and De Moor 1996, chapter 3).
    """
    m, ratio = model, step / model.step
    eigenvalues, vectors = np.linalg.eig(m.a)

    def power(exponent: float) -> np.ndarray:
        with np.errstate(all='ignore'):  # a state that ends at once has none below one
            powers = eigenvalues.astype(complex) ** exponent
        return np.linalg.solve(vectors.T, (vectors * powers).T).T.real

    try:
        prior = solve_discrete_lyapunov(m.a, m.k @ m.s @ m.k.T)
        a, n = power(ratio), power(ratio - 1.0) @ (m.a @ prior @ m.c.T + m.k @ m.s)
        driven, shared = prior - a @ prior @ a.T, n - a @ prior @ m.c.T
        size, joint = len(a), np.block([[driven, shared], [shared.T, m.s]])
        values, axes = np.linalg.eigh(joint)
        # between the lags that the model knows, covariances need not be those of any motion
        joint = (axes * np.maximum(values, 0.0)) @ axes.T
        driven, shared, own = joint[:size, :size], joint[:size, size:], joint[size:, size:]
        unknown = solve_discrete_are(a.T, m.c.T, driven, own, s=shared)
        s = m.c @ unknown @ m.c.T + own
        k = np.linalg.solve(s, (a @ unknown @ m.c.T + shared).T).T
    except LinAlgError:
        return None
    is_usable = np.linalg.eigvalsh(s)[0] > 0.0 and max(map(spectral_radius, (a, a - k @ m.c))) < 1.0
    return replace(m, step=step, a=a, k=k, s=0.5 * (s + s.T), prior=prior, from_lags=None) if is_usable else None
