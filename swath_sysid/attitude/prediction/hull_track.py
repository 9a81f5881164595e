"""One extended Kalman filter of a hull under a moment."""

import math
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.prediction import hull_step
from swath_sysid.attitude.prediction.hull_step import HULL_STATES, RATIOS, TRIM
from swath_sysid.attitude.prediction.sensor_noise import STRAIN_GAIN

Pair = tuple[float, float]  #: Of the angle and of the rate.

OF_HULL = slice(TRIM, HULL_STATES)  #: Trim and ratios.
NO_MOMENT = np.empty((0, 3)), np.empty(0), np.empty((0, 0))
LONGEST_STEP = 0.05  #: s.


class HullTrack:
    """State and covariance, moved on by `hull_step`; each call passes the elapsed time.

    ``x`` (n,) and ``P`` (n, n) are mean and covariance, ``moment`` is `ModalMoment`'s blocks, output and stationary
    covariance, ``strain`` the running mean of squared innovations over their expectation; one is healthy.
    """

    def __init__(self) -> None:
        self.moment = NO_MOMENT
        self.strain = 1.0
        self.set_state(np.zeros(HULL_STATES), np.eye(HULL_STATES))
        self.set_hull(None, np.zeros((HULL_STATES - TRIM,) * 2))

    def set_hull(self, model: DecayModel | None, drift: np.ndarray) -> None:
        """Swap the equation; None: a constant rate that the moment drives. ``drift`` as `hull_step.predict` has it."""
        self.hull, self.drift, self.longest = ((False,) * (HULL_STATES - RATIOS), 1.0), drift, LONGEST_STEP
        if model is not None:
            self.hull = model.equation.active, float(model.friction_rate)
            by_angle, by_rate = model.jacobian(model.trim, 0.0)
            fastest = max(math.sqrt(abs(by_angle)), abs(by_rate))
            self.longest = 0.25 / max(fastest, 0.25 / LONGEST_STEP)
        self.foreseen: Any = None

    def set_state(self, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Replace the state, of whatever size."""
        self.x, self.P = np.array(mean), np.array(covariance)
        self.foreseen = None

    def set_part(self, places: slice, mean: Any, covariance: np.ndarray) -> None:
        """Replace some states and make them independent of the others."""
        self.x[places] = mean
        self.P[places] = self.P[:, places] = 0.0
        self.P[places, places] = covariance
        self.foreseen = None

    def advance(self, duration: float) -> None:
        """Predict over a duration, s."""
        foreseen, self.foreseen = self.foreseen, None
        if foreseen is not None and abs(foreseen[0] - duration) < 1e-6:
            _, self.x, self.P = foreseen
        elif duration > 0.0:
            self.predict(duration)

    def ahead(self, lead: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance one lead after the present state, which stays as it is."""
        if self.foreseen is None or self.foreseen[0] != lead:
            now = self.x.copy(), self.P.copy()
            self.predict(lead)
            self.foreseen = lead, self.x, self.P
            self.x, self.P = now
        return self.foreseen[1:]

    def forecast(self, leads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean, (L, 2), and covariance, (L, 2, 2), of angle and rate at increasing leads, s."""
        durations = np.diff(np.asarray(leads, dtype=float), prepend=0.0)
        return hull_step.predict_to(self.x, self.P, self.moment, self.hull, self.drift, durations, self.longest)

    def predict(self, duration: float) -> None:
        """Move the state on by a duration, s, longer than zero."""
        hull_step.predict(self.x, self.P, self.moment, self.hull, self.drift, duration, self.longest)

    def innovation(self, elapsed: float, values: Pair, variances: Pair, min_jump: float) -> tuple:
        """As `hull_step.innovation`; updates the strain."""
        found = hull_step.innovation(self.x, self.P, self.moment[1], self.hull, elapsed, values, variances, min_jump)
        if found[0] > 0:
            self.strain += STRAIN_GAIN * (found[1] / found[0] - self.strain)
        return found

    def update(self, values: Pair, variances: Pair, learns: bool) -> None:
        """As `hull_step.update`."""
        hull_step.update(self.x, self.P, values, variances, learns)
