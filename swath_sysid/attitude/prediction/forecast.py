"""Forecasts as values."""

import math
from dataclasses import dataclass, field

import numpy as np

from swath_sysid.attitude.prediction.point import PointMotion
from swath_sysid.attitude.prediction.quiescence import CalmWindow

LEVELS = np.array([0.5, 0.9, 0.99])  #: Of the central intervals that every forecast gives.

#: Their half widths over the standard deviation.
NORMAL_QUANTILES = np.array([0.6744897501960817, 1.6448536269514722, 2.5758293035489004])


@dataclass(frozen=True)
class AxisForecast:
    """The forecast of one axis at L leads."""

    angle: np.ndarray  #: (L,); rad.
    rate: np.ndarray  #: (L,); rad/s.
    covariance: np.ndarray  #: (L, 2, 2); Of angle and rate.
    #: (L,), or None; rad: what the learnt models expect the measured angle to differ by, before calibration.
    own_deviation: np.ndarray | None = None

    @property
    def half_width(self) -> np.ndarray:
        """Half widths (L, 3) of the central 50, 90 and 99 % intervals of the angle, rad, by a normal distribution."""
        return np.sqrt(self.covariance[:, 0, 0])[:, None] * NORMAL_QUANTILES


@dataclass(frozen=True)
class Forecast:
    """Forecasts issued at one stamp."""

    stamp: float  #: When issued, s; entry i is for ``stamp + leads[i]``.
    leads: np.ndarray  #: (L,); s.
    axes: dict[str, AxisForecast]  #: The axes that the sensor measures.
    #: (L, 2A, 2A), or None; joint covariance of the angles of ``axes``, then of their rates.
    covariance: np.ndarray | None = None
    #: Probability that the craft stays inside the configured limits; NaN where none are configured.
    quiescence: float = math.nan
    #: Next window inside the limits; None: not within the horizon, or not known.
    calm: CalmWindow | None = None
    #: Vertical motion at the configured points; empty until it is learnt.
    points: dict[str, PointMotion] = field(default_factory=dict)
    #: s, by axis and by heave and vertical velocity of each point: see `ErrorLimit`.
    valid_leads: dict[str, float] = field(default_factory=dict)
