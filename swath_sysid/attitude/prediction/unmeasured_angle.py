"""An angle that a sensor does not give: its rate alone leads away, by its bias, from where a craft comes back to."""

import math

from swath_sysid.attitude.prediction.hull_state import USUAL_PERIOD

GYRO_BIAS_STD = 0.03  #: rad/s; of an inexpensive gyroscope.
LEVEL_STD = 0.05  #: rad; of a craft's trim and a sensor's mounting.
_MEMORY = 19.0  #: Periods that a rate is averaged over: its bias changes with the temperature.
_LEAST_SIZE = 1e-4  #: rad


class UnmeasuredAngle:
    """The mean of a rate, which is its bias where the craft comes back, and the level about which the angle is.

    Over a time, the mean of a rate is the difference of two angles over that time.
    """

    def __init__(self, window: float) -> None:
        """With the periods of the past that forecasts are learnt from."""
        self.period = USUAL_PERIOD  #: s; of the motion.
        self.bias, self.bias_variance = 0.0, GYRO_BIAS_STD**2  #: rad/s and its square.
        self.level, self.level_variance = 0.0, LEVEL_STD**2  #: rad and its square.
        self._window, self._since = window, math.inf
        self._angle_time = self._rate_time = self._mean_rate = self._mean_square = 0.0

    @property
    def is_missing(self) -> bool:
        """Whether the angle has not been measured for a radian of the motion."""
        return self._since > self.period / math.tau

    @property
    def is_unknown(self) -> bool:
        """Whether it has not been in all the past that forecasts are learnt from."""
        return self._since > self._window * self.period

    def take(self, angle: float, rate: float, elapsed: float) -> None:
        """Add angle, rad, and rate, rad/s, NaN where not measured, after the elapsed s."""
        memory = _MEMORY * self.period
        self._since += elapsed
        if angle == angle:
            self._since = self.level_variance = 0.0
            self._angle_time = min(self._angle_time + elapsed, memory)
            self.level += (elapsed / self._angle_time if self._angle_time else 1.0) * (angle - self.level)
        if rate == rate and elapsed > 0.0:
            # a silence counts for no more than its end tells
            told = min(elapsed, self.period / math.tau)
            self._rate_time = min(self._rate_time + told, memory)
            gain = told / self._rate_time
            self._mean_rate += gain * (rate - self._mean_rate)
            self._mean_square += gain * (rate * rate - self._mean_square)
            of_motion = 2.0 * self._size_squared / self._rate_time**2
            share = GYRO_BIAS_STD**2 / (GYRO_BIAS_STD**2 + of_motion)
            self.bias, self.bias_variance = share * self._mean_rate, share * of_motion

    def rate_noise(self, elapsed: float) -> float:
        """Variance, (rad/s)^2, of white noise that leads the angle as far in a period as the bias may."""
        return self.bias_variance * self.period / elapsed

    def angle_noise(self, elapsed: float) -> float:
        """Variance, rad^2, of white noise with which the level tells as much in a period as one look at it does."""
        return self._size_squared * self.period / elapsed

    @property
    def _size_squared(self):
        """Of the angle's motion, by its rate."""
        return max(self._mean_square * (self.period / math.tau) ** 2, _LEAST_SIZE**2)
