"""Angle and rate of an axis, of which one may repeat its value while the other one tells that the craft moves."""

import math

from swath_sysid.attitude.motion.sensor_checks import MIN_TURN
from swath_sysid.common.conventions import THREE_STD

ALIKE = 1e-8  #: rad, rad/s; a smaller change is that of rounding.


class _Repeats:
    """How long a channel has repeated its value."""

    def __init__(self) -> None:
        self.value = math.nan
        self.seconds = 0.0  #: Since it was first told.
        self.step = float(MIN_TURN)  #: The smallest change so far: what the channel resolves; no sensor is coarser.
        self.is_stuck = False

    def take(self, value: float, elapsed: float) -> bool:
        """Add a value after the elapsed s; whether it is new."""
        change = abs(value - self.value)
        if change <= ALIKE:
            self.seconds += elapsed
            return False
        if change == change:
            self.step = min(self.step, change)
        self.value, self.seconds, self.is_stuck = value, 0.0, False
        return True

    def judge(self, departure: float, variance: float, resolved: float, until_new: bool) -> None:
        """Take it for stuck, until a new value or as long, where what it hides is no chance and more than it resolves.

        ``variance`` is that of the departure by chance.
        """
        hides = departure * departure > resolved * resolved + THREE_STD * THREE_STD * variance
        self.is_stuck = hides or (until_new and self.is_stuck)


class StuckChannels:
    """Leaves out a repeated angle that the rate has led away from, and a repeated rate that the angle contradicts.

    Where both repeat themselves, neither tells anything.
    """

    def __init__(self) -> None:
        self._angle, self._rate = _Repeats(), _Repeats()
        self._turned = self._untold = 0.0  # rad since the angle was new, and s since the rate was
        self._angle_then = math.nan

    def seconds(self) -> float:
        """How long one of them has repeated itself, and is left out; zero where none is."""
        return max(each.seconds if each.is_stuck else 0.0 for each in (self._angle, self._rate))

    def take(
        self,
        angle: float,
        rate: float,
        noise: tuple[float, float],
        bias: tuple[float, float],
        elapsed: float,
    ) -> tuple[float, float]:
        """Angle, rad, and rate, rad/s, NaN where stuck, after the elapsed s.

        With the variances of their white noise, and the rate's bias with its variance.
        """
        of_angle, of_rate = noise
        has_new_angle, has_new_rate = self._angle.take(angle, elapsed), self._rate.take(rate, elapsed)
        if has_new_angle:
            self._turned = self._untold = 0.0
        else:
            self._untold += elapsed
            if has_new_rate and rate == rate:
                self._turned += self._untold * (rate - bias[0])
                self._untold = 0.0
                seconds = self._angle.seconds
                doubt = 2.0 * of_angle + seconds * (bias[1] * seconds + of_rate * elapsed)
                self._angle.judge(self._turned, doubt, self._angle.step, until_new=True)
        if has_new_rate:
            self._angle_then = angle
        elif has_new_angle:
            seconds = self._rate.seconds
            departure = angle - self._angle_then - rate * seconds
            doubt = 2.0 * of_angle + (bias[1] + of_rate) * seconds * seconds
            # a single wrong angle departs from any rate
            self._rate.judge(departure, doubt, self._rate.step * seconds, until_new=False)
        return math.nan if self._angle.is_stuck else angle, math.nan if self._rate.is_stuck else rate
