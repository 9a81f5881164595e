"""A manoeuvring model with what is known of it: uncertainty, validity, provenance."""

from dataclasses import dataclass, field

import numpy as np

from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.stability import Region


@dataclass(frozen=True)
class ForecastNoise:
    """What forecasts of a craft are uncertain by, measured on the runs that it was identified on.

    Attributes
    ----------
    disturbance : ndarray, shape (3,)
        Standard deviation of the slowly varying accelerations that the model leaves in surge, sway, m/s^2, and yaw,
        rad/s^2.
    disturbance_time : ndarray, shape (3,)
        Their correlation times, s.
    thrust_mean : ndarray, shape (2,)
        Of port and starboard on those runs, N.
    thrust_covariance : ndarray, shape (2, 2)
        About that mean, N^2.
    thrust_time : float
        For which thrusts are held on average, s.
    sensors : ndarray, shape (4,)
        Of speeds, yaw rate, heading, position; m/s, rad/s, rad, m.
    leads : ndarray, shape (L,)
        s.
    scale : ndarray, shape (6, L)
        By which the standard deviations of surge, sway, yaw rate, heading, x and y are multiplied at these leads, so
        that the intervals hold what they say.
    """

    disturbance: np.ndarray
    disturbance_time: np.ndarray
    thrust_mean: np.ndarray
    thrust_covariance: np.ndarray
    thrust_time: float
    sensors: np.ndarray
    leads: np.ndarray = field(default_factory=lambda: np.array([1.0]))
    scale: np.ndarray = field(default_factory=lambda: np.ones((6, 1)))

    def scale_at(self, lead: float) -> np.ndarray:
        """Shape (6,), linear between the leads and held beyond them."""
        return np.array([np.interp(lead, self.leads, row) for row in self.scale])


@dataclass(frozen=True)
class IdentifiedManoeuvringModel:
    """What a model file of manoeuvring holds.

    Attributes
    ----------
    names : tuple of str
        Identified numbers, current included, in the order of the covariance.
    covariance : ndarray, shape (n, n)
    noise : ndarray, shape (3,)
        Standard deviation of what the model left of surge, sway, m/s, and yaw rate, rad/s.
    region : Region
        Motion and inputs that it was identified at.
    forecast : ForecastNoise or None
        None: not measured; forecasts fall back on `noise`.
    """

    model: ManoeuvringModel
    names: tuple[str, ...]
    covariance: np.ndarray
    noise: np.ndarray
    region: Region
    metrics: dict = field(default_factory=dict)
    provenance: dict = field(default_factory=dict)
    forecast: ForecastNoise | None = None
