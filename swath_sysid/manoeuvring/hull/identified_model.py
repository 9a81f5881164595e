"""A manoeuvring model with what is known of it: uncertainty, validity, provenance."""

from dataclasses import dataclass, field

import numpy as np

from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.stability import Region


@dataclass(frozen=True)
class ForecastNoise:
    """What forecasts of a craft are uncertain by, measured on the runs that it was identified on."""

    #: (3,); Standard deviation of the slowly varying accelerations that the model leaves in surge, sway, m/s^2, and
    #: yaw, rad/s^2.
    disturbance: np.ndarray
    disturbance_time: np.ndarray  #: (3,); Their correlation times, s.
    thrust_mean: np.ndarray  #: (2,); Of port and starboard on those runs, N.
    thrust_covariance: np.ndarray  #: (2, 2); About that mean, N^2.
    thrust_time: float  #: For which thrusts are held on average, s.
    sensors: np.ndarray  #: (4,); Of speeds, yaw rate, heading, position; m/s, rad/s, rad, m.
    leads: np.ndarray = field(default_factory=lambda: np.array([1.0]))  #: (L,); s.
    #: (6, L); By which the standard deviations of surge, sway, yaw rate, heading, x and y are multiplied at these
    #: leads, so that the intervals hold what they say.
    scale: np.ndarray = field(default_factory=lambda: np.ones((6, 1)))

    def scale_at(self, lead: float) -> np.ndarray:
        """Shape (6,), linear between the leads and held beyond them."""
        return np.array([np.interp(lead, self.leads, row) for row in self.scale])


@dataclass(frozen=True)
class IdentifiedManoeuvringModel:
    """What a model file of manoeuvring holds."""

    model: ManoeuvringModel
    names: tuple[str, ...]  #: Identified numbers, current included, in the order of the covariance.
    covariance: np.ndarray  #: (n, n)
    noise: np.ndarray  #: (3,); Standard deviation of what the model left of surge, sway, m/s, and yaw rate, rad/s.
    region: Region  #: Motion and inputs that it was identified at.
    metrics: dict = field(default_factory=dict)
    provenance: dict = field(default_factory=dict)
    forecast: ForecastNoise | None = None  #: None: not measured; forecasts fall back on `noise`.
