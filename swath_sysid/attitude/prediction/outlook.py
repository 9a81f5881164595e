"""Vertical motion at the points of a craft, and the calm of the craft and its points."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import LEAST_SIZE, AxisFilter
from swath_sysid.attitude.prediction.point import ATTITUDE, Point, PointMotion, point_motion
from swath_sysid.attitude.prediction.quiescence import (
    AT_A_POINT,
    CalmWindow,
    Quiescence,
    QuiescenceLimits,
    quantity_at,
)
from swath_sysid.attitude.prediction.rows import CHANNELS, History, RowClock
from swath_sysid.attitude.prediction.state_space import InnovationsFilter
from swath_sysid.attitude.prediction.vertical import FORCE, VerticalFit, VerticalForecaster, VerticalRequest
from swath_sysid.common.row_buffer import RowBuffer

_VERTICAL = [CHANNELS.index(name) for name in (*AXES, *FORCE)]


class PointForecaster:
    """Vertical motion at points of the craft, about its trim; nothing without points."""

    def __init__(self, points: Sequence[Point], axes: Sequence[AxisFilter], rows: int) -> None:
        self.points, self._axes = points, axes
        self.vertical: VerticalForecaster | None = None
        # heave and vertical velocity at the rows, as they were then: what windows of calm are judged by
        self._nowcasts = RowBuffer(rows if points else 1, 2)

    @property
    def trim(self) -> tuple[float, float]:
        """Roll and pitch about which the craft moves, rad."""
        roll, pitch = self._axes
        return roll.size.mean, pitch.size.mean

    def begin(self, step: float, ahead: int) -> None:
        """Start with rows of another step, s, up to so many of them ahead."""
        if self.points:
            self.vertical = VerticalForecaster(step, ahead)
            self._nowcasts.clear()

    def install(self, fit: VerticalFit | None, newest: int, waves: InnovationsFilter) -> None:
        """Use a fit, made with the waves' filter; ``newest`` is the number of the newest row."""
        if self.vertical is not None:
            self.vertical.install(fit, newest, waves)

    def request(self, clock: RowClock, newest: int) -> VerticalRequest | None:
        """What a fit of the vertical motion needs to know, at the newest row of this number."""
        if self.vertical is None:
            return None
        # the accelerations of smoothed rows lag behind the attitude, which the hull filters give
        delay = (0.5 * clock.samples - 1.0) * clock.interval if clock.is_smoothed else 0.0
        return VerticalRequest(self.vertical.ahead, delay, newest)

    def step(self, row: np.ndarray, waves: InnovationsFilter | None) -> None:
        """Take the next row of `CHANNELS`, which the waves' filter has taken already."""
        if self.vertical is not None:
            self.vertical.take(row[_VERTICAL], waves)
            self._nowcasts.append(self.vertical.now)

    def skip(self, count: int, waves: InnovationsFilter | None) -> None:
        """Step over missing rows."""
        if self.vertical is not None:
            self.vertical.skip(count, waves)
            self._nowcasts.skip(count)

    def forecast(
        self, leads: np.ndarray, age: float, mean: np.ndarray, covariance: np.ndarray
    ) -> dict[str, PointMotion]:
        """Motion at each point at leads (L,), s, given the attitude's forecast (L, 4) and its covariance (L, 4, 4)."""
        vertical = None if self.vertical is None else self.vertical.forecast(leads, age, mean, covariance)
        if vertical is None:
            return {}
        motion = np.hstack([vertical.mean, mean])
        return {point.name: point_motion(point.place, self.trim, motion, vertical.covariance) for point in self.points}

    def at_rows(self, behind: np.ndarray, attitude: np.ndarray) -> list[np.ndarray]:
        """Heave and vertical velocity (N, 2) of each point, so many rows ago, with the attitude (N, 4) of then."""
        if not self.points:
            return []
        motion = np.hstack([self._nowcasts.at(self._nowcasts.newest - behind), np.zeros((behind.size, 3)), attitude])
        return [point_motion(point.place, self.trim, motion).mean[:, :2] for point in self.points]


class CalmForecaster:
    """Probability of staying inside limits over the horizon (H,), s, and the next window of calm."""

    def __init__(
        self, limits: QuiescenceLimits, horizon: np.ndarray, axes: Sequence[AxisFilter], points: PointForecaster
    ) -> None:
        at_points = [quantity_at(point.name, kind) for point in points.points for kind in AT_A_POINT]
        self.quiescence = Quiescence(limits, horizon, (*ATTITUDE, *at_points))
        self._axes, self._points = axes, points

    def assess(
        self,
        time: float,
        mean: np.ndarray,
        covariance: np.ndarray,
        points: Mapping[str, PointMotion],
        history: History,
        step: float,
        since_row: float,
    ) -> tuple[float, CalmWindow | None]:
        """As `Quiescence.assess`, of the attitude's forecast (H, 4) and the points' motion."""
        motion, variance = [mean], [np.diagonal(covariance, axis1=1, axis2=2)]
        unknown = np.full((len(mean), len(AT_A_POINT)), math.nan)
        for point in self._points.points:
            ahead = points.get(point.name)
            motion.append(unknown if ahead is None else ahead.mean[:, : len(AT_A_POINT)])
            spread = unknown if ahead is None else np.diagonal(ahead.covariance, axis1=1, axis2=2)
            variance.append(spread[:, : len(AT_A_POINT)])
        whole = np.hstack(motion)
        of_row = time - since_row

        def what_came(times: np.ndarray) -> np.ndarray:
            """Limited quantities at these times: measured, and for points as they were known then."""
            behind = (of_row - times) / step
            attitude = history.measured.at(history.newest - behind)
            return np.hstack([attitude, *self._points.at_rows(behind, attitude)])

        self.quiescence.learn(time, what_came)
        activity = 2 * [axis.size.activity for axis in self._axes]
        activity += [max(abs(value), LEAST_SIZE) for value in whole[0, len(ATTITUDE) :].tolist()]
        trim = np.array([*self._points.trim, *[0.0] * (whole.shape[1] - len(AXES))])
        return self.quiescence.assess(time, whole, np.sqrt(np.hstack(variance)), np.array(activity), trim)
