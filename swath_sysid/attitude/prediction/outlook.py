"""Vertical motion at the points of a craft, the calm of craft and points, and how far ahead forecasts are trusted."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import AxisFilter, MotionSize
from swath_sysid.attitude.prediction.forecast import MISSES, Forecast
from swath_sysid.attitude.prediction.memories import LEAST_SIZE
from swath_sysid.attitude.prediction.point import ATTITUDE, Point, PointMotion, point_motion
from swath_sysid.attitude.prediction.quiescence import AT_A_POINT, CalmWindow, Quiescence, QuiescenceLimits, quantity_at
from swath_sysid.attitude.prediction.rows import OF_SAMPLE
from swath_sysid.attitude.prediction.vertical_forecast import VerticalForecaster
from swath_sysid.common.errors import InputError
from swath_sysid.common.row_buffer import RowBuffer


@dataclass(frozen=True)
class Outlook:
    """What follows from the forecast over the horizon."""

    #: Probability that the craft stays inside the configured limits; NaN where none are configured.
    quiescence: float
    calm: CalmWindow | None  #: Next window inside the limits; None: not within the horizon, or not known.
    valid_leads: dict[str, float]  #: s, by axis and by heave and vertical velocity of each point: see `ErrorLimit`.


class PointForecaster:
    """Vertical motion at points of the craft, about its trim; nothing without points."""

    def __init__(self, points: Sequence[Point], axes: Sequence[AxisFilter]) -> None:
        self.points, self._axes = points, axes
        self.vertical: VerticalForecaster | None = None  #: None without points, and before any rows.

    @property
    def trim(self) -> tuple[float, float]:
        """Roll and pitch about which the craft moves, rad."""
        roll, pitch = self._axes
        return roll.size.mean, pitch.size.mean

    def begin(self, step: float, period: float, ahead: int) -> None:
        """Start with rows of another step for a motion of another period, s, up to so many of them ahead."""
        if self.points:
            self.vertical = VerticalForecaster(step, period, ahead)

    def forecast(self, attitude: Forecast, age: float) -> dict[str, PointMotion]:
        """Motion at each point at the leads of the attitude's forecast, ``age`` s after the newest row."""
        if self.vertical is None:
            return {}
        found = self.vertical.forecast(attitude.leads, age, attitude.mean, attitude.covariance)
        return (
            {} if found is None else {point.name: point_motion(point.place, self.trim, *found) for point in self.points}
        )

    def at_rows(self, behind: np.ndarray, attitude: np.ndarray) -> list[np.ndarray]:
        """Heave and vertical velocity (N, 2) of each point, so many rows ago, with the attitude (N, 4) of then."""
        if self.vertical is None:
            return []
        motion = np.hstack([self.vertical.nowcasts(behind), np.zeros((behind.size, 3)), attitude])
        return [point_motion(point.place, self.trim, motion).mean[:, :2] for point in self.points]


class CalmForecaster:
    """Probability of staying inside limits over the horizon (H,), s, and the next window of calm."""

    def __init__(
        self, limits: QuiescenceLimits, horizon: np.ndarray, axes: Sequence[AxisFilter], points: PointForecaster
    ) -> None:
        at_points = [quantity_at(point.name, kind) for point in points.points for kind in AT_A_POINT]
        self.quiescence = Quiescence(limits, horizon, (*ATTITUDE, *at_points))
        self._axes, self._points = axes, points

    def learn(self, time: float, rows: RowBuffer, step: float, since_row: float) -> bool:
        """Learn from what has come since; whether the whole forecast of now is needed to learn from later."""
        of_row = time - since_row

        def what_came(times: np.ndarray) -> np.ndarray:
            """Limited quantities at these times: measured, and for points as they were known then."""
            behind = np.maximum((of_row - times) / step, 0.0)
            attitude = rows.at(rows.newest - behind)[:, OF_SAMPLE]
            return np.hstack([attitude, *self._points.at_rows(behind, attitude)])

        # what came after the newest row is not known yet
        self.quiescence.learn(of_row, what_came)
        return self.quiescence.is_due(time, self._axes[0].size.period)

    def follow(self, time: float, now: Mapping[str, PointMotion]) -> None:
        """Follow the size of the motion, of points as at the first lead, where no more is asked for."""
        sizes = self._sizes(self._at_points(now, 1)[0][0].tolist())
        self.quiescence.follow(time, *sizes, self._axes[0].size.period)

    def assess(self, time: float, ahead: Forecast) -> tuple[float, CalmWindow | None]:
        """As `Quiescence.assess`, of the forecast over the horizon."""
        motion, spread = self._at_points(ahead.points, ahead.leads.size)
        whole, deviation = np.hstack([ahead.mean, motion]), np.hstack([ahead.deviation, spread])
        activity, reach = self._sizes(motion[0].tolist())
        trim = np.concatenate([self._points.trim, np.zeros(whole.shape[1] - len(AXES))])
        return self.quiescence.assess(time, whole, deviation, activity, trim, reach, self._axes[0].size.period)

    def _at_points(self, motions: Mapping[str, PointMotion], leads: int) -> tuple[np.ndarray, np.ndarray]:
        """What is limited at the points at so many leads (L, V) and its deviations, NaN where it is not known."""
        count = len(AT_A_POINT)
        found = np.full((2, leads, count * len(self._points.points)), math.nan)
        for place, point in enumerate(self._points.points):
            if point.name in motions:
                of_point, motion = slice(place * count, (place + 1) * count), motions[point.name]
                found[0, :, of_point] = motion.mean[:, :count]
                found[1, :, of_point] = np.sqrt(np.diagonal(motion.covariance, axis1=1, axis2=2)[:, :count])
        return found[0], found[1]

    def _sizes(self, at_points: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """How much each limited quantity moves (V,), and how far it has reached; of points by their values now."""
        activity = 2 * [axis.size.activity for axis in self._axes]
        activity += [max(abs(value), LEAST_SIZE) for value in at_points]
        turned = [max(axis.size.reach.amplitude, LEAST_SIZE) for axis in self._axes]
        reach = [*turned, *[2.0 * math.pi / self._axes[0].size.period * each for each in turned]]
        return np.array(activity), np.array(reach + [math.nan] * len(at_points))


@dataclass(frozen=True)
class ErrorLimit:
    """Largest expected error of a forecast that is trusted, which a tenth of the errors may exceed."""

    share: float = 0.5  #: Of the standard deviation of the motion over the last periods.
    angle: float = 0.0  #: rad; of roll and pitch, in place of the share; 0: the share.

    def __post_init__(self):
        if not self.share > 0.0 or not self.angle >= 0.0:
            raise InputError(
                f'the limit of the expected error must be a positive share ({self.share:g}) and an angle that is not '
                f'negative ({self.angle:g} rad)'
            )

    def of_angle(self, size: float) -> float:
        """The limit of a roll or pitch of this standard deviation, rad."""
        return self.angle or self.share * size


def valid_lead(leads: np.ndarray, variance: np.ndarray, limit: float) -> float:
    """The longest lead, s, up to which errors of these variances (L,) at even leads (L,) stay below the limit.

    Their standard deviation does, and so do nine in ten of the errors up to there, of a normal distribution. Linear
    between leads; zero where the first is beyond, the last where none is, NaN where one up to there is unknown.
    """
    deviation = np.sqrt(variance) / limit
    beyond = 2.0 * ndtr(-1.0 / np.maximum(deviation, 1e-9))
    up_to = (beyond.cumsum() - 0.5 * beyond) / np.arange(1, leads.size + 1)
    excess = np.maximum(deviation, up_to / MISSES)
    is_within = excess <= 1.0
    first = int(is_within.argmin())
    if is_within[first]:
        return float(leads[-1])
    if math.isnan(variance[first]):
        return math.nan
    if first == 0:
        return 0.0
    low, high = excess[first - 1 : first + 1].tolist()
    start, end = leads[first - 1 : first + 1].tolist()
    return start + (1.0 - low) / (high - low) * (end - start)


class ValidLeads:
    """The valid lead of each axis and of the vertical motion of each point, over the horizon."""

    def __init__(self, limit: ErrorLimit, axes: Sequence[AxisFilter], memory: float) -> None:
        self._limit, self._axes, self._memory = limit, axes, memory
        self._sizes: dict[str, tuple[MotionSize, ...]] = {}
        self._time = 0.0

    def follow(self, time: float, now: Mapping[str, PointMotion]) -> None:
        """Follow the sizes of the points' motion up to now, s, by what is forecast at the first lead."""
        elapsed, self._time = time - self._time, time
        for name, motion in now.items():
            for size, value in zip(self._sizes_at(name), motion.mean[0].tolist(), strict=False):
                size.period = self._axes[0].size.period
                size.follow(value, 0.0, elapsed)

    def of(self, ahead: Forecast) -> dict[str, float]:
        """s, of the forecast over the horizon, by axis, and by `quantity_at` a point."""
        found = {}
        for name in ahead.axes:
            k = AXES.index(name)
            limit = self._limit.of_angle(self._axes[k].size.present)
            found[name] = valid_lead(ahead.leads, ahead.covariance[:, k, k], limit)
        for name, motion in ahead.points.items():
            for k, (kind, size) in enumerate(zip(AT_A_POINT, self._sizes_at(name), strict=True)):
                limit = self._limit.share * size.present
                found[quantity_at(name, kind)] = valid_lead(ahead.leads, motion.covariance[:, k, k], limit)
        return found

    def _sizes_at(self, name: str) -> tuple[MotionSize, ...]:
        return self._sizes.setdefault(name, tuple(MotionSize(self._memory) for _ in AT_A_POINT))
