"""An angle that a sensor does not give: its rate alone leads away, by its bias, from where a craft comes back to."""

import math
from collections.abc import Sequence

from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, tilt_angles
from swath_sysid.attitude.motion.sensor_checks import GRAVITY_TOLERANCE
from swath_sysid.attitude.prediction.memories import LEAST_SIZE, MEMORY_OF_SIZE, NOW, USUAL_PERIOD

#: rad/s, and rad/s/sqrt(s): the bias of an inexpensive gyroscope, and its random walk.
GYRO_BIAS_STD, GYRO_BIAS_WALK = 0.03, 1e-4
ANGLE_STD = 0.005  #: rad; of a measured angle while the craft moves: its filter's lag, mostly.
LEVEL_STD = 0.05  #: rad; of a craft's trim and a sensor's mounting.
FORCE_STD = 0.02  #: rad; of the direction of a mean force, by the bias of inexpensive accelerometers.
_SLOWER = 2.0  #: Times as slow as the motion is what a mean still shows of it: groups of waves, a mooring.


class RunningMean:
    """Mean and mean square over the last periods of what a craft that comes back goes through.

    Over a time, the mean of a rate is the difference of two angles over that time.
    """

    def __init__(self) -> None:
        self.mean = self.square = 0.0
        self.time = 0.0  #: s; that they are of.

    def take(self, value: float, elapsed: float, period: float) -> None:
        """Add a value after the elapsed s, in a motion of a period, s."""
        # a silence counts for no more than its end tells
        told = min(elapsed, period / math.tau)
        self.time = min(self.time + told, MEMORY_OF_SIZE * period)
        gain = told / self.time
        self.mean += gain * (value - self.mean)
        self.square += gain * (value * value - self.square)

    def variance(self, period: float) -> float:
        """Of the mean, by the motion."""
        return 2.0 * (_SLOWER * self.swing(period) / self.time) ** 2

    def swing(self, period: float) -> float:
        """Standard deviation of what this is the rate of, in a motion of a period, s."""
        return max(math.sqrt(self.square) * period / math.tau, LEAST_SIZE)


class Gravity:
    """Roll and pitch of the mean specific force, in the craft's axes."""

    def __init__(self) -> None:
        self._means = [RunningMean() for _ in range(3)]

    def take(self, force: Sequence[float], elapsed: float, period: float) -> None:
        """Add a force (3,), m/s^2, NaN where not measured, after the elapsed s, in a motion of a period, s."""
        if elapsed > 0.0 and math.isfinite(sum(force)):
            for mean, value in zip(self._means, force, strict=True):
                mean.take(value, elapsed, period)

    def levels(self, period: float) -> list[tuple[float, float]]:
        """Angle, rad, and its variance, of roll and pitch, in a motion of a period, s; none where this is not known."""
        force = [mean.mean for mean in self._means]
        size = math.hypot(*force)
        if self._means[0].time < NOW * period or abs(size / STANDARD_GRAVITY - 1.0) > GRAVITY_TOLERANCE:
            return []
        x, y, _ = (mean.variance(period) / size**2 for mean in self._means)
        roll, pitch = tilt_angles(*force)
        return [(float(roll), FORCE_STD**2 + y), (float(pitch), FORCE_STD**2 + x)]


class UnmeasuredAngle:
    """The mean of a rate, which is its bias where the craft comes back, and the level about which the angle is."""

    def __init__(self, window: float) -> None:
        """With the periods of the past that forecasts are learnt from."""
        self.period = USUAL_PERIOD  #: s; of the motion.
        self.bias, self.bias_variance = 0.0, GYRO_BIAS_STD**2  #: rad/s and its square.
        self.level, self.level_variance = 0.0, LEVEL_STD**2  #: rad and its square.
        self._window, self._since = window, math.inf
        self._is_absent, self._newest = True, math.nan
        self._before = math.nan
        self._angle_time, self._rate, self._departure = 0.0, RunningMean(), RunningMean()

    def know_level(self, level: float, variance: float) -> None:
        """Take what gravity tells of the level, rad, and its variance, where the angle has never told it."""
        if self.level_variance:
            share = LEVEL_STD**2 / (LEVEL_STD**2 + variance)
            self.level, self.level_variance = share * level, share * variance

    @property
    def is_missing(self) -> bool:
        """Whether the angle has not been measured for a radian of the motion."""
        return self._is_absent and self._since > self.period / math.tau

    @property
    def is_unknown(self) -> bool:
        """Whether it has not been in all the past that forecasts are learnt from."""
        return self._is_absent and self._since > self._window * self.period

    def take(self, angle: float, rate: float, elapsed: float) -> None:
        """Add angle, rad, and rate, rad/s, NaN where not measured, after the elapsed s."""
        self._since += elapsed
        self._is_absent = angle != angle
        if angle == angle:
            # one that has never changed may not have been filled in
            if self._newest == self._newest != angle:
                self._since = self.level_variance = 0.0
            self._newest = angle
            self._angle_time = min(self._angle_time + elapsed, MEMORY_OF_SIZE * self.period)
            self.level += (elapsed / self._angle_time if self._angle_time else 1.0) * (angle - self.level)
        if rate == rate and elapsed > 0.0:
            self._rate.take(rate, elapsed, self.period)
            slope = (angle - self._before) / elapsed
            if slope == slope:
                self._departure.take(rate - slope, elapsed, self.period)
            mean, variance = self._rate.mean, self._rate.variance(self.period)
            if of_angles := self._departure.time:
                known = 2.0 * (ANGLE_STD / of_angles) ** 2 + GYRO_BIAS_WALK**2 * (of_angles + self._since)
                if known < variance:
                    mean, variance = self._departure.mean, known
            share = GYRO_BIAS_STD**2 / (GYRO_BIAS_STD**2 + variance)
            self.bias, self.bias_variance = share * mean, share * variance
        self._before = angle

    def rate_noise(self, elapsed: float, comes_back: bool) -> float:
        """Variance, (rad/s)^2, of white noise that leads the angle as far as the bias may.

        In a period, where a hull ``comes_back`` by then; else in the time that the level takes to lead it back.
        """
        swing = self._rate.swing(self.period)
        lasts = self.period if comes_back else (swing**2 * self.period / self.bias_variance) ** (1.0 / 3.0)
        return self.bias_variance * lasts / elapsed

    def angle_noise(self, elapsed: float) -> float:
        """Variance, rad^2, of white noise with which the level tells as much in a period as one look at it does."""
        return self._rate.swing(self.period) ** 2 * self.period / elapsed
