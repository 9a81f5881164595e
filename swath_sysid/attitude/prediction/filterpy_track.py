"""`HullTrack` carried by filterpy's extended Kalman filter, where numba is absent."""

import math

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from swath_sysid.attitude.prediction import hull_step
from swath_sysid.attitude.prediction.hull_filter import OF_HULL, HullTrack, Pair
from swath_sysid.attitude.prediction.hull_step import HULL_STATES
from swath_sysid.attitude.prediction.modal_moment import ModalMoment


class FilterpyTrack(HullTrack, ExtendedKalmanFilter):
    """``x`` and ``P`` are filterpy's, and so are ``predict``, after `linearise`, and ``update``."""

    def __init__(self) -> None:
        ExtendedKalmanFilter.__init__(self, dim_x=HULL_STATES, dim_z=2)
        HullTrack.__init__(self)

    def set_state(self, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Replace the state, of whatever size."""
        super().set_state(mean, covariance)
        self.dim_x = self.x.size
        self._I = np.eye(self.dim_x)

    def _predict_to(self, durations: np.ndarray):
        means, spreads = np.empty((durations.size, 2)), np.empty((durations.size, 2, 2))
        for k, duration in enumerate(durations.tolist()):
            if duration > 0.0:
                self._predict(duration)
            means[k], spreads[k] = self.x[:2], self.P[:2, :2]
        return means, spreads

    def _predict(self, duration: float):
        count = max(1, math.ceil(duration / self.longest - 1e-6))
        for _ in range(count):
            self.linearise(duration / count)
            self.predict()
            hull_step.limit(self.P)

    def linearise(self, step: float) -> None:
        """Set F, Q and the end of the mean for filterpy's own ``predict``.

        Args:
            step: s, short against the hull's period.
        """
        blocks, h, at_rest = self.moment
        f = ModalMoment(blocks, h, at_rest).transition(step)
        now = self.x[HULL_STATES:]
        mean_output = 0.5 * (h + h @ f)
        angle, rate, trim, stiffness, damping = self.x[:HULL_STATES].tolist()
        angle, rate, to_angle, to_rate = hull_step.hull_step(
            angle, rate, trim, stiffness, damping, float(mean_output @ now), float(self.P[1, 1]), step, self.hull
        )
        self._then = np.concatenate([[angle, rate], self.x[OF_HULL], f @ now])
        slopes = np.array([to_angle, to_rate])
        self.F = np.eye(self.dim_x)
        self.F[:2, :HULL_STATES] = slopes[:, :5]
        self.F[:2, HULL_STATES:] = np.outer(slopes[:, 5], mean_output)
        self.F[HULL_STATES:, HULL_STATES:] = f
        # what drives the moment in the step acts on the hull by half
        driven = np.zeros((self.dim_x, h.size))
        driven[:2], driven[HULL_STATES:] = np.outer(slopes[:, 5], 0.5 * h), np.eye(h.size)
        self.Q = driven @ (at_rest - f @ at_rest @ f.T) @ driven.T
        self.Q[OF_HULL, OF_HULL] += step * np.diag([self.drifts[0], self.drifts[1], self.drifts[1]])

    def predict_x(self, u: float = 0) -> None:
        """filterpy's hook: the mean over the step of the nonlinear hull that `linearise` has set."""
        self.x = self._then

    def take_in(self, values: Pair, variances: Pair, learns: bool) -> None:
        """As that of `HullTrack`."""
        considered = self.x[OF_HULL].copy(), self.P[OF_HULL, OF_HULL].copy()
        places = [k for k, value in enumerate(values) if value == value]
        rows = np.eye(self.dim_x)[places]
        self.update(
            np.array(values)[places], lambda x: rows, lambda x: rows @ x, R=np.diag(np.array(variances)[places])
        )
        if not learns:
            self.x[OF_HULL], self.P[OF_HULL, OF_HULL] = considered
