"""Forecasts as values."""
import math
from dataclasses import dataclass

import numpy as np

from swath_sysid.prediction.calibration import NORMAL_QUANTILES


@dataclass(frozen=True)
class AxisForecast:
    """The forecast of one axis at L leads.

    Attributes
    ----------
    angle, rate : ndarray, shape (L,)
        rad, rad/s.
    covariance : ndarray, shape (L, 2, 2)
        Of angle and rate.
    half_width : ndarray, shape (L, 3)
        Half widths of the central 50, 90 and 99 % intervals of the angle, rad.
    """

    angle: np.ndarray
    rate: np.ndarray
    covariance: np.ndarray
    half_width: np.ndarray

    @classmethod
    def normal(cls, angle, rate, covariance):
        """With the intervals of a normal distribution."""
        return cls(angle, rate, covariance, np.sqrt(covariance[:, 0, 0])[:, None] * NORMAL_QUANTILES)


@dataclass(frozen=True)
class Forecast:
    """Forecasts issued at one stamp.

    Attributes
    ----------
    stamp : float
        When issued, s; entry i is for ``stamp + leads[i]``.
    leads : ndarray, shape (L,)
        s.
    axes : dict of str to AxisForecast
        The axes that the sensor gives.
    quiescence : float
        Probability that the craft stays inside the configured limits; NaN where none are configured.
    """

    stamp: float
    leads: np.ndarray
    axes: dict[str, AxisForecast]
    quiescence: float = math.nan
