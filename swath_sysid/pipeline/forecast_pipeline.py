"""IMU samples and hull models in, forecasts out, as plain numbers: the same for the live node and all offline runs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion import attitude
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, Installation
from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.intake import (
    INTAKE_REASONS,
    NANOSECOND,
    NOT_MEASURED,
    ConvertedReading,
    CraftSample,
    ImuReading,
    Intake,
)
from swath_sysid.attitude.motion.stamps import JUMPED_BACK, STAMP_REASONS, StampSettings
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.blend import Forecast
from swath_sysid.attitude.prediction.forecaster import (
    FORECASTER_REASONS,
    Forecaster,
    ForecasterDiagnostics,
    ForecasterSettings,
)
from swath_sysid.attitude.prediction.hull_state import LARGEST_ANGLE_VARIANCE, LARGEST_RATE_VARIANCE
from swath_sysid.attitude.prediction.sea_fit import SeaFit, SeaRequest
from swath_sysid.attitude.prediction.sea_state import SeaReport

PIPELINE_REASONS = (*STAMP_REASONS, *INTAKE_REASONS, *FORECASTER_REASONS)  #: Everything that is counted.

NOT_GIVEN = (NOT_MEASURED, *8 * (0.0,))  #: Covariance that a sensor_msgs/Imu does not give.
UNKNOWN_PLACE_VARIANCE = 100.0  #: m^2 (and per s^2 and s^4); the horizontal motion is not forecast.

_NOTHING_KNOWN = 0.0, 0.0, LARGEST_ANGLE_VARIANCE, 0.0, LARGEST_RATE_VARIANCE
_NOTHING_KNOWN_OF_POSE = np.diag([UNKNOWN_PLACE_VARIANCE] * 2 + [0.0] * 3 + [LARGEST_ANGLE_VARIANCE])
_NOTHING_KNOWN_OF_TWIST = np.diag([UNKNOWN_PLACE_VARIANCE] * 3 + [0.0] * 2 + [LARGEST_RATE_VARIANCE])
_HEAVE_AND_ATTITUDE = np.ix_((0, 3, 4), (0, 3, 4))


class AttitudeForecast(NamedTuple):
    """What a sensor_msgs/Imu of a forecast says, in the axes of the craft (FLU in ENU)."""

    stamp_ns: int  #: The time it is for.
    orientation: tuple[float, ...]  #: Quaternion x, y, z, w.
    orientation_covariance: tuple[float, ...]
    rates: tuple[float, ...]  #: Body rates, rad/s.
    rates_covariance: tuple[float, ...]


@dataclass(frozen=True)
class HorizonForecast:
    """What a trajectory_msgs/JointTrajectory of a forecast says."""

    stamp_ns: int  #: When issued.
    columns: tuple[str, ...]  #: ``roll``, ``roll_std``, ... of the axes that the sensor measures.
    leads_ns: tuple[int, ...]  #: From the stamp.
    positions: np.ndarray  #: (L, columns); Angle and its standard deviation, rad.
    velocities: np.ndarray  #: (L, columns); Euler rate and its standard deviation, rad/s.


class PointForecast(NamedTuple):
    """What the messages of a point at one lead say: in a level frame that moves with the craft's mean."""

    name: str
    lead: float  #: s.
    stamp_ns: int  #: The time it is for.
    position: tuple[float, ...]  #: m from the sensor's mean place; z from the point's mean level.
    orientation: tuple[float, ...]  #: Quaternion x, y, z, w.
    pose_covariance: np.ndarray  #: (6, 6); Of x, y, z and the rotations about them.
    linear: tuple[float, ...]  #: In the axes of the craft then, m/s.
    angular: tuple[float, ...]  #: rad/s.
    twist_covariance: np.ndarray  #: (6, 6)
    acceleration: float  #: Upwards, m/s^2.
    acceleration_variance: float


OnNext = Callable[[AttitudeForecast], None]


@dataclass(frozen=True)
class PipelineSettings:
    """Sensor mounting, stamp handling and forecast settings.

    Example:
        >>> PipelineSettings(forecaster=ForecasterSettings(horizon=8.0)).forecaster.horizon
        8.0
    """

    installation: Installation = field(default_factory=Installation)
    stamps: StampSettings = field(default_factory=StampSettings)
    forecaster: ForecasterSettings = field(default_factory=ForecasterSettings)


@dataclass(frozen=True)
class PipelineStep:
    """The results of one sample."""

    reasons: tuple[str, ...] = ()  #: From `PIPELINE_REASONS`: what was counted.
    used: bool = False
    next: AttitudeForecast | None = None  #: One sample ahead.
    forecast: Forecast | None = None  #: At the leads, when due; its stamp is s from the first sample.
    horizon: Forecast | None = None  #: Over the horizon, when due; its stamp is s from the first sample.
    #: To be fitted by `fit_sea`, in the background or at once; the result is for `ForecastPipeline.install`.
    sea_request: SeaRequest | None = None
    stamp_ns: int = 0  #: Of the sample; 0 where it was left out.
    heading: tuple[float, float] = (0.0, 0.0)  #: Held yaw and yaw rate, rad and rad/s.
    sea: SeaReport | None = None  #: Of the sea state, once a minute.

    def attitudes(self) -> tuple[tuple[float, AttitudeForecast], ...]:
        """For the topics of the leads: tuple of (lead, AttitudeForecast); empty unless due."""
        if self.forecast is None:
            return ()
        moments = {
            axis: np.column_stack([ahead.angle, ahead.rate, *ahead.covariance.reshape(-1, 4).T[[0, 1, 3]]]).tolist()
            for axis, ahead in self.forecast.axes.items()
        }
        leads, heading = self.forecast.leads.tolist(), self.heading
        return tuple(
            (lead, attitude_forecast(self.stamp_ns, lead, {axis: rows[k] for axis, rows in moments.items()}, *heading))
            for k, lead in enumerate(leads)
        )

    def trajectory(self) -> HorizonForecast | None:
        """The values over the horizon; None unless due."""
        if self.horizon is None:
            return None
        leads, axes = self.horizon.leads, self.horizon.axes
        positions, velocities = np.empty((2, leads.size, 2 * len(axes)))
        for place, ahead in enumerate(axes.values()):
            positions[:, 2 * place], velocities[:, 2 * place] = ahead.angle, ahead.rate
            np.sqrt(ahead.covariance[:, 0, 0], out=positions[:, 2 * place + 1])
            np.sqrt(ahead.covariance[:, 1, 1], out=velocities[:, 2 * place + 1])
        columns = tuple([f'{axis}{kind}' for axis in axes for kind in ('', '_std')])
        leads_ns = tuple(np.round(leads / NANOSECOND).astype(np.int64).tolist())
        return HorizonForecast(self.stamp_ns, columns, leads_ns, positions, velocities)

    def points(self) -> list[PointForecast]:
        """For the topics of named points: list of `PointForecast`; empty unless due and learnt."""
        if self.forecast is None or not self.forecast.points:
            return []
        roll, pitch = self.forecast.axes['roll'], self.forecast.axes['pitch']
        attitudes = np.column_stack([roll.angle, pitch.angle, roll.rate, pitch.rate]).tolist()
        return [
            _point_forecast(name, lead, self.stamp_ns, at, motion.place, motion.mean[k].tolist(), motion.covariance[k])
            for name, motion in self.forecast.points.items()
            for k, (lead, at) in enumerate(zip(self.forecast.leads.tolist(), attitudes, strict=True))
        ]

    @property
    def quiescence(self) -> float | None:
        """The probability of keeping the limits; None where none is known, or it is not due."""
        return self.horizon.quiescence if self.horizon is not None and isfinite(self.horizon.quiescence) else None


def attitude_forecast(
    stamp_ns: int, lead: float, axes: Mapping[str, Sequence[float]], yaw: float, yaw_rate: float
) -> AttitudeForecast:
    """The forecast at one lead, s, as an attitude, with a held heading, rad, and its rate, rad/s. By measured axis:
    angle, rate, angle variance, covariance of both, rate variance.
    """
    roll, roll_rate, roll_variance, _, roll_rate_variance = axes.get('roll', _NOTHING_KNOWN)
    pitch, pitch_rate, pitch_variance, _, pitch_rate_variance = axes.get('pitch', _NOTHING_KNOWN)
    return AttitudeForecast(
        stamp_ns + round(lead / NANOSECOND),
        attitude.quaternion(roll, pitch, yaw),
        _diagonal(roll_variance, pitch_variance, LARGEST_ANGLE_VARIANCE) if axes else NOT_GIVEN,
        attitude.body_rates(roll, pitch, roll_rate, pitch_rate, yaw_rate),
        _diagonal(roll_rate_variance, pitch_rate_variance, LARGEST_RATE_VARIANCE) if axes else NOT_GIVEN,
    )


def _diagonal(about_x: float, about_y: float, about_z: float):
    return (about_x, 0.0, 0.0, 0.0, about_y, 0.0, 0.0, 0.0, about_z)


def _point_forecast(
    name: str,
    lead: float,
    stamp_ns: int,
    at: Sequence[float],
    place: Sequence[float],
    motion: Sequence[float],
    covariance: np.ndarray,
):
    heave, velocity, acceleration = motion
    roll, pitch, roll_rate, pitch_rate = at
    orientation = attitude.quaternion(roll, pitch, 0.0)
    back = attitude.conjugate(*orientation)
    angular = attitude.body_rates(roll, pitch, roll_rate, pitch_rate, 0.0)
    level = attitude.rotate(orientation, *place)
    across = attitude.rotate(orientation, *_cross(angular, place))
    linear = attitude.rotate(back, across[0], across[1], velocity)
    pose = _NOTHING_KNOWN_OF_POSE.copy()
    pose[2:5, 2:5] = covariance[_HEAVE_AND_ATTITUDE]
    # the same either way but along the world's vertical, here in the axes of the craft
    up = np.array(attitude.rotate(back, 0.0, 0.0, 1.0))
    twist = _NOTHING_KNOWN_OF_TWIST.copy()
    twist[:3, :3] += (covariance[1, 1] - UNKNOWN_PLACE_VARIANCE) * (up[:, None] * up)
    twist[3:5, 3:5] = covariance[5:, 5:]
    twist[:3, 3:5] = up[:, None] * covariance[1, 5:]
    twist[3:5, :3] = twist[:3, 3:5].T
    return PointForecast(
        name,
        lead,
        stamp_ns + round(lead / NANOSECOND),
        (*level[:2], heave),
        orientation,
        pose,
        linear,
        angular,
        twist,
        acceleration,
        float(covariance[2, 2]),
    )


def _cross(a: Sequence[float], b: Sequence[float]):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


class ForecastPipeline:
    """Forecasts from the messages of one sensor.

    Pure and causal: time is the stamps; the same messages, models and fits give the same forecasts. What a step asks
    to learn of the sea (``sea_request``) is fitted by `fit_sea` and given to `install`.

    Args:
        settings: By default those of `PipelineSettings`.
        intake: That of the settings, where another core shares it.

    Example:
        >>> trial = read_trial(records / 'morro_buoy.csv').between(0.0, 20.0)
        >>> pipeline = ForecastPipeline()
        >>> for sample in samples_of(trial):
        ...     step = pipeline.add_sample(sample)
        ...     if step.sea_request is not None:
        ...         pipeline.install(fit_sea(step.sea_request))
        >>> step.forecast.leads.tolist()
        [0.1, 0.5, 1.0, 2.0, 3.0, 5.0]
        >>> roll = step.forecast.axes['roll']
        >>> roll.angle.shape, roll.half_width.shape  # 50, 90 and 99 % intervals
        ((6,), (6, 3))
    """

    def __init__(self, settings: PipelineSettings | None = None, intake: Intake | None = None) -> None:
        self.settings = settings or PipelineSettings()
        self.forecaster = Forecaster(self.settings.forecaster)
        self.installation = InstallationCheck(self.settings.installation)
        self.counts = dict.fromkeys(PIPELINE_REASONS, 0)
        self.used = 0
        self._intake = intake or Intake(self.settings.installation, self.settings.stamps)
        self.models: dict[str, IdentifiedModel | None] = dict.fromkeys(AXES)  #: By axis.
        self._first_ns: int | None = None
        self.newest_ns = 0  #: Stamp of the newest message; 0 before any.
        self._yaw = self._yaw_rate = 0.0

    def set_models(self, models: Mapping[str, IdentifiedModel]) -> None:
        """Swap the hulls by axis under the running filters; an axis without one is forecast without a hull."""
        for axis in AXES:
            model = models.get(axis)
            if model != self.models[axis]:
                self.models[axis] = model
                self.forecaster.set_model(axis, model)

    def install(self, fit: SeaFit) -> None:
        """Take over the fit that a step asked for; it is used from its request's stamp plus the refit delay on."""
        self.forecaster.install(fit)

    def add(self, reading: ImuReading, on_next: OnNext | None = None) -> PipelineStep:
        """Take one IMU message.

        Args:
            reading: The message.
            on_next: Called with the step's ``next`` as soon as it is known: the leads take longer.
        """
        return self.add_converted(self._intake.take(reading), on_next)

    def add_sample(self, sample: CraftSample, on_next: OnNext | None = None) -> PipelineStep:
        """Take one sample of the craft's motion, as a record holds it; see `add`."""
        return self.add_converted(self._intake.place(sample), on_next)

    def add_upstream(self, name: str, stamp_ns: int | None, value: float) -> None:
        """Take one sample of an upstream channel; those before the first IMU message are left out.

        Args:
            name: One of the settings' ``forecaster.upstream``.
            stamp_ns: On the clock of the IMU's stamps, and the sample may come late; None: that of the newest message.
            value: In any unit; NaN counts as lost.

        Raises:
            InputError: The settings have no channel of this name.
        """
        stamp_ns = self.newest_ns if stamp_ns is None else stamp_ns
        first_ns = stamp_ns if self._first_ns is None else self._first_ns
        self.forecaster.observe_upstream(name, (stamp_ns - first_ns) * NANOSECOND, value)

    def add_converted(self, converted: ConvertedReading, on_next: OnNext | None = None) -> PipelineStep:
        """Add one converted message or sample; see `add`."""
        sample, reasons = converted
        for reason in reasons:
            self.counts[reason] += 1
        if sample is None:
            return PipelineStep(reasons)
        self.installation.add(sample)
        stamp_ns, elapsed = sample.stamp_ns, None
        if self._first_ns is None:
            self._first_ns = stamp_ns
        elif JUMPED_BACK not in reasons:
            elapsed = (stamp_ns - self.newest_ns) * NANOSECOND
        self.newest_ns = stamp_ns
        # the heading is not forecast: the last one measured is held
        if sample.yaw == sample.yaw:
            self._yaw = sample.yaw
        if sample.yaw_rate == sample.yaw_rate:
            self._yaw_rate = sample.yaw_rate
        following = None

        def publish_next(lead: float, axes: dict) -> None:
            nonlocal following
            following = attitude_forecast(stamp_ns, lead, axes, self._yaw, self._yaw_rate)
            if on_next is not None:
                on_next(following)

        # seconds since the epoch would resolve 0.2 us only
        observed = self.forecaster.observe(sample, (stamp_ns - self._first_ns) * NANOSECOND, elapsed, publish_next)
        for reason in observed.reasons:
            self.counts[reason] += 1
        self.used += 1
        forecasts = observed.forecast, observed.horizon, observed.sea_request
        heading = self._yaw, self._yaw_rate
        return PipelineStep(reasons + observed.reasons, True, following, *forecasts, stamp_ns, heading, observed.sea)

    def diagnostics(self) -> ForecasterDiagnostics:
        """The running state; see `Forecaster.diagnostics`."""
        return self.forecaster.diagnostics()


def warm_up() -> None:
    """Forecasts of a hull at rest, so that the first samples find everything loaded and compiled."""
    pipeline = ForecastPipeline()
    pipeline.set_models({'roll': IdentifiedModel.exactly(hull_named('swath-roll').model)})
    at_rest = CraftSample(0, *(0.0,) * 6, STANDARD_GRAVITY, *(1e-6,) * 4)
    for number in range(3):
        pipeline.add_sample(at_rest._replace(stamp_ns=number * 10_000_000))
