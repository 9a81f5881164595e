"""How far ahead a forecast can be trusted: the longest lead up to which its expected error stays below a limit."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import AxisFilter, MotionSize
from swath_sysid.attitude.prediction.point import PointMotion
from swath_sysid.attitude.prediction.quiescence import AT_A_POINT, quantity_at
from swath_sysid.common.errors import InputError


@dataclass(frozen=True)
class ErrorLimit:
    """Largest expected error of a forecast that is trusted."""

    share: float = 0.5  #: Of the standard deviation of the motion.
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
    """The longest lead, s, up to which errors of these variances (L,) at increasing leads (L,) stay below the limit.

    Linear between leads; zero where the first exceeds the limit, the last where none does, NaN where one up to there is
    unknown.
    """
    is_below = variance <= limit * limit
    first = int(is_below.argmin())
    if is_below[first]:
        return float(leads[-1])
    if math.isnan(variance[first]):
        return math.nan
    if first == 0:
        return 0.0
    low, high = np.sqrt(variance[first - 1 : first + 1]).tolist()
    start, end = leads[first - 1 : first + 1].tolist()
    # variances that differ may have one root
    return start + (limit - low) / (high - low) * (end - start) if low < high else end


class ValidLeads:
    """The valid lead of each axis and of the vertical motion of each point, over a horizon (H,), s."""

    def __init__(self, limit: ErrorLimit, horizon: np.ndarray, axes: Sequence[AxisFilter], memory: float) -> None:
        self.limit = limit
        self.newest: dict[str, float] = {}  #: s, by axis, and by `quantity_at` a point.
        self._horizon, self._axes, self._memory = horizon, axes, memory
        self._sizes: dict[str, tuple[MotionSize, ...]] = {}
        self._time = 0.0

    def assess(
        self, time: float, mean: np.ndarray, covariance: np.ndarray, points: Mapping[str, PointMotion]
    ) -> dict[str, float]:
        """Valid leads, s, of the attitude's forecast (H, 4) with covariance (H, 4, 4) and of the points' motion."""
        elapsed, self._time = time - self._time, time
        known = {name: k for k, name in enumerate(AXES) if math.isfinite(mean[0, k])}
        self.newest = {
            name: valid_lead(self._horizon, covariance[:, k, k], self.limit.of_angle(self._axes[k].size.deviation))
            for name, k in known.items()
        }
        for name, motion in points.items():
            sizes = self._sizes.setdefault(name, tuple(MotionSize(self._memory) for _ in AT_A_POINT))
            for k, (kind, size) in enumerate(zip(AT_A_POINT, sizes, strict=True)):
                size.follow(float(motion.mean[0, k]), 0.0, elapsed)
                limit = self.limit.share * size.deviation
                self.newest[quantity_at(name, kind)] = valid_lead(self._horizon, motion.covariance[:, k, k], limit)
        return self.newest
