"""The forecast as a value: the craft's motion at some leads, with its covariance."""

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.point import ATTITUDE, PointMotion

LEVELS = np.array([0.5, 0.9, 0.99])  #: Of the central intervals that every forecast gives.
MISSES = 1.0 - LEVELS.item(1)  #: Share of the errors that the 90 % interval leaves out.

#: Their half widths over the standard deviation.
NORMAL_QUANTILES = np.array([0.6744897501960817, 1.6448536269514722, 2.5758293035489004])


class Wanted(NamedTuple):
    """What is worked out of a forecast that is due; what is learnt does not depend on it."""

    lead: float = math.inf  #: s; the leads up to this one.
    horizon: bool = True
    points: bool = True  #: At the leads and over the horizon.
    valid_leads: bool = True
    calm: bool = True  #: The probability of quiet and the next window of calm.


def nothing() -> Wanted:
    """None of it: the sample only feeds the filters."""
    return Wanted(0.0, *4 * (False,))


@dataclass(frozen=True)
class Forecast:
    """The motion at L leads, as expected at one stamp."""

    stamp_ns: int  #: When issued, by the sensor's clock; entry i is for ``leads[i]`` later.
    leads: np.ndarray  #: (L,); s.
    mean: np.ndarray  #: (L, 4); roll, pitch and their rates, rad and rad/s; NaN for an axis that is not measured.
    covariance: np.ndarray  #: (L, 4, 4); Of these, NaN likewise.
    heading: tuple[float, float] = (0.0, 0.0)  #: Yaw, rad, and yaw rate, rad/s, as last measured: they are held.
    #: Vertical motion at the configured points; empty until it is learnt.
    points: dict[str, PointMotion] = field(default_factory=dict)
    #: (L, 4), or None; what the learnt models expect the measured motion to differ by, before calibration.
    own_deviation: np.ndarray | None = None

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes that the sensor measures."""
        return tuple([axis for axis, angle in zip(AXES, self.mean[0].tolist(), strict=False) if angle == angle])

    def angle(self, axis: str) -> np.ndarray:
        """Roll or pitch (L,), rad."""
        return self.mean[:, ATTITUDE.index(axis)]

    def rate(self, axis: str) -> np.ndarray:
        """Its rate (L,), rad/s."""
        return self.mean[:, ATTITUDE.index(f'{axis}_rate')]

    @cached_property
    def deviation(self) -> np.ndarray:
        """Standard deviations (L, 4) of ``mean``."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    def half_width(self, axis: str) -> np.ndarray:
        """Half widths (L, 3) of the central 50, 90 and 99 % intervals of the angle, rad, by a normal distribution."""
        return self.deviation[:, ATTITUDE.index(axis), None] * NORMAL_QUANTILES

    def at(self, lead: float) -> 'Forecast':
        """The forecast at one of its leads, s: the nearest."""
        place = int(np.abs(self.leads - lead).argmin())
        return self.chosen(slice(place, place + 1))

    def chosen(self, places: Any) -> 'Forecast':
        """The forecast at some of its leads, by their places."""
        own = None if self.own_deviation is None else self.own_deviation[places]
        points = {name: motion.chosen(places) for name, motion in self.points.items()}
        motion = self.leads[places], self.mean[places], self.covariance[places]
        return Forecast(self.stamp_ns, *motion, self.heading, points, own)

    def scaled(self, factor: float) -> 'Forecast':
        """The forecast with every covariance this many times as large."""
        points = {name: replace(each, covariance=factor * each.covariance) for name, each in self.points.items()}
        return replace(self, covariance=factor * self.covariance, points=points)
