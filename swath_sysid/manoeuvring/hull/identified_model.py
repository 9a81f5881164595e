"""A manoeuvring model with its uncertainty, validity and provenance."""

from dataclasses import dataclass, field

import numpy as np

from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.stability import Region


@dataclass(frozen=True)
class ForecastNoise:
    """Uncertainties of forecasts, measured on the runs of the identification."""

    disturbance: np.ndarray  #: (3,); Standard deviations of the slow residual accelerations, m/s^2, m/s^2, rad/s^2.
    disturbance_time: np.ndarray  #: (3,); Their correlation times, s.
    thrust_mean: np.ndarray  #: (2,); Of port and starboard on those runs, N.
    thrust_covariance: np.ndarray  #: (2, 2); About that mean, N^2.
    thrust_time: float  #: Mean time for which thrusts are held, s.
    sensors: np.ndarray  #: (4,); Of speeds, yaw rate, heading, position; m/s, rad/s, rad, m.
    leads: np.ndarray = field(default_factory=lambda: np.array([1.0]))  #: (L,); s.
    #: (6, L); Factors on the standard deviations of surge, sway, yaw rate, heading, x and y, for calibrated intervals;
    #: linear between the leads and constant beyond them.
    scale: np.ndarray = field(default_factory=lambda: np.ones((6, 1)))


@dataclass(frozen=True)
class IdentifiedManoeuvringModel:
    """Content of a manoeuvring model file."""

    model: ManoeuvringModel
    names: tuple[str, ...]  #: Identified parameters, current included, in the order of the covariance.
    covariance: np.ndarray  #: (n, n)
    noise: np.ndarray  #: (3,); Residual standard deviation of surge, sway, m/s, and yaw rate, rad/s.
    region: Region  #: Range of motion and inputs in the runs.
    metrics: dict = field(default_factory=dict)
    provenance: dict = field(default_factory=dict)
    forecast: ForecastNoise | None = None  #: None: not measured; forecasts use `noise`.
