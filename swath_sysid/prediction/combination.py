"""Several forecasts made one: convex weights by lead, learnt from past errors.

Bates and Granger (1969): with C the covariance of the experts' errors, the best convex weights
minimise w' C w.  C is an exponentially forgetting average, and the weights follow it by
exponentiated gradient (Kivinen and Warmuth 1997), which keeps them positive and of sum one.
The mean is one of the experts, so that no lead is forecast worse than by the mean for long.
"""
import numpy as np

_LEAST_WEIGHT = 1e-6
_STEP = 0.5
_LARGEST_SLOPE = 12.0
_EARLY, _EARLY_ROUNDS = 20.0, 20


class Combiner:
    """Weights of E experts for A axes at L leads.

    Errors are given over the motion's present size, so that what is learnt in one sea serves in another.

    Parameters
    ----------
    axes, leads, experts : int
    memory : float
        s; errors are forgotten with this time constant.
    trust : ndarray, shape (L,)
        s of errors that an expert's nominal variance counts for.
    """

    def __init__(self, axes, leads, experts, memory, trust):
        self._memory = memory
        self._trust = np.asarray(trust, dtype=float)[:, None]
        self._sum = np.zeros((axes, leads, experts, experts))
        self._time = np.zeros((axes, leads, experts, experts))
        self.weights = np.zeros((axes, leads, experts))
        self._diagonal = np.arange(experts)

    def forget(self):
        """Start anew."""
        self._sum[:] = self._time[:] = self.weights[:] = 0.0

    def forget_expert(self, axis, expert):
        """Forget what was learnt of one expert (its model has changed)."""
        for table in (self._sum, self._time):
            table[axis, :, expert, :] = table[axis, :, :, expert] = 0.0
        self.weights[axis, :, expert] = 0.0

    def learn(self, errors, elapsed):
        """Take in errors that have become known.

        Parameters
        ----------
        errors : ndarray, shape (A, L, E)
            NaN where unknown.
        elapsed : float
            s since the last call.
        """
        known = np.isfinite(errors)
        errors = np.where(known, errors, 0.0)
        weight = (known[..., :, None] & known[..., None, :]) * elapsed
        keep = 1.0 - np.minimum(weight / self._memory, 1.0)
        self._sum *= keep
        self._sum += weight * (errors[..., :, None] * errors[..., None, :])
        self._time *= keep
        self._time += weight

    def follow(self, nominal):
        """Move the weights towards the best.

        Parameters
        ----------
        nominal : ndarray, shape (A, L, E)
            Variance of each expert's error as it would be expected without any experience; NaN:
            the expert has no forecast now.

        Returns
        -------
        weights : ndarray, shape (A, L, E)
            Zero where there is no forecast.
        variance : ndarray, shape (A, L)
            Of the combined error, in the errors' unit.
        """
        present = np.isfinite(nominal)
        covariance = self._sum.copy()
        covariance[..., self._diagonal, self._diagonal] += self._trust * np.where(present, nominal, 0.0)
        covariance /= self._time + self._trust[..., None]
        weights = self.weights
        new = present & (weights <= 0.0)
        # little is known, so that each error counts for much
        rounds = _EARLY_ROUNDS if self._time.max() < _EARLY else 2
        if new.any():
            count = np.maximum(present.sum(axis=2, keepdims=True), 1)
            weights = np.where(new, 1.0 / count, weights)
            rounds = 40
        weights = _normalised(weights * present)
        for _ in range(rounds):
            slope = (covariance @ weights[..., None])[..., 0]
            level = (weights * slope).sum(axis=2, keepdims=True)
            relative = slope / np.maximum(level, 1e-30) - 1.0
            np.clip(relative, -_LARGEST_SLOPE, _LARGEST_SLOPE, out=relative)
            weights = _normalised(np.maximum(weights * np.exp(-_STEP * relative), _LEAST_WEIGHT) * present)
        self.weights = weights
        return weights, (weights * (covariance @ weights[..., None])[..., 0]).sum(axis=2)


def _normalised(weights):
    return weights / np.maximum(weights.sum(axis=2, keepdims=True), 1e-30)
