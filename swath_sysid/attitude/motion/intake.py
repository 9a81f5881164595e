"""Conversion of IMU messages, as plain numbers, to samples of the craft's motion."""

from collections.abc import Sequence
from math import inf, isfinite, nan, radians
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.cleaning import limit_of
from swath_sysid.attitude.motion.sensor_checks import BlankOrientation, RepeatedMessages
from swath_sysid.attitude.motion.stamps import BURSTS, NANOSECOND, Bursts, StampOrder, StampSettings
from swath_sysid.common.conditions import codes_in
from swath_sysid.common.conventions import LATEST_STAMP_NS

NOT_FINITE = 'not-finite'
ABSURD = 'absurd-value'
BAD_QUATERNION = 'bad-quaternion'
NO_ORIENTATION = 'no-orientation'
NO_RATES = 'no-rates'
UNKNOWN_COVARIANCE = 'unknown-covariance'
ABSURD_COVARIANCE = 'absurd-covariance'
NEAR_VERTICAL = 'near-vertical'
BLANK_ORIENTATION = 'blank-orientation'
EMPTY = 'nothing-usable'
FROZEN = 'sensor-frozen'
INTAKE_REASONS = codes_in('intake')  #: Everything that is counted.

NOT_MEASURED = -1.0  #: First element of a covariance whose quantity the sensor does not measure (sensor_msgs/Imu).

_UNKNOWN = (nan, nan)
_NOT_MEASURED = (nan, nan, nan)
_LARGEST_RATE, _LARGEST_ACCELERATION = limit_of('roll_rate'), limit_of('accel_x')

#: A sensor with a larger variance measures nothing, or its covariance is not in rad^2 and rad^2/s^2.
LARGEST_ANGLE_VARIANCE, LARGEST_RATE_VARIANCE = limit_of('roll') ** 2, _LARGEST_RATE**2

LARGEST_PITCH = radians(80.0)  #: Beyond it roll and yaw can hardly be separated.


class ImuReading(NamedTuple):
    """An IMU message as plain numbers, in the axes of the sensor; see sensor_msgs/Imu.

    Example:
        A sensor that reports no covariances, at rest and level:

        >>> unknown = [0.0] * 9
        >>> reading = ImuReading(0, (0, 0, 0, 1), unknown, (0, 0, 0), unknown, (0, 0, 9.81), unknown)
        >>> ForecastPipeline().add(reading).used
        True
    """

    stamp_ns: int  #: header.stamp.
    orientation: Sequence[float]  #: Quaternion x, y, z, w.
    #: rad^2, by rows; -1 in the first place: no orientation; all zero: unknown.
    orientation_covariance: Sequence[float]
    rates: Sequence[float]  #: Angular velocity x, y, z, rad/s.
    rates_covariance: Sequence[float]  #: rad^2/s^2, likewise.
    force: Sequence[float]  #: Specific force x, y, z, m/s^2.
    force_covariance: Sequence[float]  #: m^2/s^4, likewise.


class CraftSample(NamedTuple):
    """The motion of the craft at one stamp. NaN marks what is not measured or not known."""

    stamp_ns: int
    roll: float  #: rad.
    pitch: float
    roll_rate: float  #: Euler rate, rad/s.
    pitch_rate: float
    accel_x: float  #: Specific force in the craft's axes, m/s^2.
    accel_y: float
    accel_z: float
    roll_variance: float  #: rad^2.
    pitch_variance: float
    roll_rate_variance: float  #: rad^2/s^2.
    pitch_rate_variance: float
    yaw: float = nan  #: rad.
    yaw_rate: float = nan  #: rad/s.
    heave: float = nan  #: m, upwards; known from records only.
    roll_gyro: float = nan  #: Of the body, rad/s, before the attitude is mixed in; known live only.
    pitch_gyro: float = nan

    @property
    def stamp(self) -> float:
        """The stamp in seconds."""
        return self.stamp_ns * NANOSECOND

    @property
    def motion(self) -> tuple[float, ...]:
        """Angles, rates and accelerations: the seven channels in the order of a window."""
        return self[1:8]


class ConvertedReading(NamedTuple):
    """The conversion of one message."""

    sample: CraftSample | None  #: None: nothing in it can be used.
    reasons: tuple[str, ...]  #: From `INTAKE_REASONS`: what is to be counted.


def convert(reading: ImuReading, installation: Installation) -> ConvertedReading:
    """Convert one IMU message; what cannot be used is NaN, and without an orientation body rates are Euler rates."""
    stamp_ns, orientation, angle_covariance, body_rates, rate_covariance, specific_force, force_covariance = reading
    reasons: list[str] = []
    quaternion = _orientation(orientation, angle_covariance, reasons)
    rates = _vector(body_rates, rate_covariance, _LARGEST_RATE, reasons)
    if rate_covariance[0] == NOT_MEASURED:
        reasons.append(NO_RATES)
    force = _vector(specific_force, force_covariance, _LARGEST_ACCELERATION, reasons)
    if quaternion is None and rates is None:
        return ConvertedReading(None, (*reasons, EMPTY))
    angle_variances = rate_variances = _UNKNOWN
    roll = pitch = yaw = roll_rate = pitch_rate = yaw_rate = x = y = nan
    if quaternion is not None:
        roll, pitch, yaw = attitude.euler_angles(*installation.orientation(*quaternion))
        if abs(pitch) > LARGEST_PITCH:
            return ConvertedReading(None, (*reasons, NEAR_VERTICAL))
        angle_variances = _variances(angle_covariance, installation, LARGEST_ANGLE_VARIANCE, reasons)
    if rates is not None:
        x, y, _ = roll_rate, pitch_rate, yaw_rate = installation.vector(*rates)
        if quaternion is not None:
            roll_rate, pitch_rate, yaw_rate = attitude.euler_rates(roll, pitch, roll_rate, pitch_rate, yaw_rate)
        rate_variances = _variances(rate_covariance, installation, LARGEST_RATE_VARIANCE, reasons)
    forces: tuple[float, float, float] = _NOT_MEASURED if force is None else installation.vector(*force)
    if (quaternion is not None and angle_variances is _UNKNOWN) or (rates is not None and rate_variances is _UNKNOWN):
        reasons.append(UNKNOWN_COVARIANCE)
    variances = *angle_variances, *rate_variances
    sample = CraftSample(stamp_ns, roll, pitch, roll_rate, pitch_rate, *forces, *variances, yaw, yaw_rate, nan, x, y)
    return ConvertedReading(sample, tuple(reasons))


def _orientation(
    quaternion: Sequence[float], covariance: Sequence[float], reasons: list[str]
) -> Sequence[float] | None:
    """The quaternion, None where it is invalid or not measured."""
    if covariance[0] == NOT_MEASURED:
        reasons.append(NO_ORIENTATION)
    elif attitude.is_orientation(*quaternion):
        return quaternion
    else:
        _note(BAD_QUATERNION if all(map(isfinite, quaternion)) else NOT_FINITE, reasons)
    return None


def _vector(
    values: Sequence[float], covariance: Sequence[float], largest: float, reasons: list[str]
) -> Sequence[float] | None:
    """A rate or a force, None where it is not measured or cannot be true."""
    if covariance[0] == NOT_MEASURED:
        return None
    x, y, z = values
    if -largest <= x <= largest and -largest <= y <= largest and -largest <= z <= largest:
        return values
    _note(ABSURD if all(map(isfinite, values)) else NOT_FINITE, reasons)
    return None


def _note(reason: str, reasons: list[str]) -> None:
    if reason not in reasons:
        reasons.append(reason)


def _variances(
    covariance: Sequence[float], installation: Installation, largest: float, reasons: list[str]
) -> tuple[float, float]:
    """Variances about the craft's x and y axes; `_UNKNOWN` where they are not reported, or cannot be."""
    about_x, about_y = covariance[0], covariance[4]
    if not (0.0 < about_x < inf and 0.0 < about_y < inf):
        return _UNKNOWN
    if about_x > largest or about_y > largest:
        _note(ABSURD_COVARIANCE, reasons)
        return _UNKNOWN
    if installation.is_turned:
        sensor = np.reshape(covariance, (3, 3))
        turn = np.array(installation.vector(*np.eye(3)))
        about_x, about_y, _ = np.diag(turn @ sensor @ turn.T).tolist()
        if not (0.0 < about_x < inf and 0.0 < about_y < inf):
            return _UNKNOWN
    return about_x, about_y


class Intake:
    """Orders the messages of one sensor and converts them to the motion of the craft."""

    def __init__(self, installation: Installation, stamps: StampSettings) -> None:
        self._installation = installation
        self._stamps = stamps
        self._order = StampOrder(stamps)
        self._bursts = Bursts()
        self._repeated = RepeatedMessages()
        self._blank = BlankOrientation()

    @property
    def interval(self) -> float | None:
        """Typical time between samples, s; None before the second."""
        return self._order.interval

    def take(self, reading: ImuReading, arrival: float = nan) -> ConvertedReading:
        """Convert the next message, which came at a time of a steady clock, s; also reasons of `STAMP_REASONS`."""
        if reading.stamp_ns > LATEST_STAMP_NS:
            return ConvertedReading(None, (ABSURD,))
        # to all that follows, a sensor that repeats itself is silent
        if self._repeated.add(reading.stamp_ns, reading.orientation, (*reading.rates, *reading.force)):
            return ConvertedReading(None, (FROZEN,))
        spread_ns, has_begun = self._bursts.place(reading.stamp_ns, (*reading.orientation, *reading.rates))
        if has_begun:
            self._order = StampOrder(self._stamps)
        placed, reasons, stamp_ns = self._order.place(spread_ns, arrival)
        reasons += (BURSTS,) * has_begun
        if not placed:
            return ConvertedReading(None, reasons)
        if stamp_ns != reading.stamp_ns:
            reading = reading._replace(stamp_ns=stamp_ns)
        is_given = reading.orientation_covariance[0] != NOT_MEASURED
        if is_given and self._blank.add(reading.orientation, reading.rates, self._order.interval or 0.0):
            reading = reading._replace(orientation_covariance=(NOT_MEASURED, *reading.orientation_covariance[1:]))
            reasons += (BLANK_ORIENTATION,)
        converted = convert(reading, self._installation)
        return ConvertedReading(converted.sample, reasons + converted.reasons) if reasons else converted

    def leave_out(self, stamp_ns: int, arrival: float) -> None:
        """Keep count of the stamp of a message that is not used; see `take`."""
        if stamp_ns <= LATEST_STAMP_NS:
            self._order.place(stamp_ns, arrival)

    def place(self, sample: CraftSample) -> ConvertedReading:
        """Place the next sample of a record, which was cleaned and turned as a whole; reasons of `STAMP_REASONS`."""
        _, roll, pitch, *others = sample[:8]
        if self._repeated.add(sample.stamp_ns, (roll, pitch, sample.yaw), (*others, sample.yaw_rate)):
            return ConvertedReading(None, (FROZEN,))
        placed, reasons, stamp_ns = self._order.place(sample.stamp_ns)
        if placed and all(value != value for value in sample[1:5]):
            return ConvertedReading(None, (*reasons, EMPTY))
        return ConvertedReading(sample._replace(stamp_ns=stamp_ns) if placed else None, reasons)
