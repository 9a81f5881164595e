"""Turning points of a free decay, each from a parabola through the samples around it.

Amplitude a: half a double amplitude; decrement: what a half-cycle loses of it; Bertin's N = decrement / a^2.
"""

from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.identification.forecast_check import with_angle_and_rate
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.turning_points import find_turning_points

#: Periods to each side of a turning point that its parabola covers; lowers every amplitude by 0.05 %.
PEAK_WINDOW = 0.1


@dataclass(frozen=True)
class Peaks:
    """Turning points of one decay, shape (M,): times, s, and measured angles, rad."""

    time: np.ndarray
    angle: np.ndarray

    @property
    def amplitude(self) -> np.ndarray:
        """Half of each double amplitude, rad, shape (M - 1,)."""
        return 0.5 * np.abs(np.diff(self.angle))

    @property
    def mean_amplitude(self) -> np.ndarray:
        """Mean of the amplitudes before and after a turning point, rad, shape (M - 2,)."""
        return 0.5 * (self.amplitude[:-1] + self.amplitude[1:])

    @property
    def decrement(self) -> np.ndarray:
        """Loss of amplitude per half-cycle, rad, shape (M - 2,)."""
        return self.amplitude[:-1] - self.amplitude[1:]

    @property
    def period(self) -> np.ndarray:
        """From each turning point to the next but one, s, shape (M - 2,)."""
        return self.time[2:] - self.time[:-2]

    @property
    def logarithmic_decrement(self) -> np.ndarray:
        """Of a whole cycle, shape (M - 2,)."""
        return 2.0 * np.log(self.amplitude[:-1] / self.amplitude[1:])

    @property
    def bertin(self) -> np.ndarray:
        """Bertin's N of each half cycle, 1/rad, shape (M - 2,)."""
        return self.decrement / self.mean_amplitude**2

    @property
    def decrement_covariance(self) -> np.ndarray:
        """Covariance of the decrements per unit variance of a turning point, shape (M - 2, M - 2)."""
        count = self.decrement.size
        return 0.5 * np.eye(count) - 0.25 * (np.eye(count, k=2) + np.eye(count, k=-2))


def measured_peaks(motion: AxisMotion, period: float) -> Peaks:
    """Turning points of a decay of the given period, s, each from a parabola through the samples around it. Where no
    angle was measured the angle is the integral of the rate.
    """
    angle, _ = with_angle_and_rate(motion)
    rough = find_turning_points(motion, period)
    # between the turning points of its rate the angle turns
    times = rough.time if motion.angle is not None else 0.5 * (rough.time[1:] + rough.time[:-1])
    found = [_vertex(motion.time, angle, at, PEAK_WINDOW * period) for at in times]
    return Peaks(*np.array([vertex for vertex in found if vertex is not None]).reshape(-1, 2).T)


def _vertex(time: np.ndarray, angle: np.ndarray, at: float, reach: float):
    near = np.abs(time - at) <= reach
    # a parabola at the rim of the record would be extrapolated
    if near.sum() < 5 or time[near][0] > at - 0.5 * reach or time[near][-1] < at + 0.5 * reach:
        return None
    curvature, slope, level = np.polyfit(time[near] - at, angle[near], 2)
    shift = np.clip(-0.5 * slope / curvature, -reach, reach) if curvature else 0.0
    return at + shift, level + 0.5 * slope * shift
