"""IMU samples and hull models in, forecasts out, as plain numbers: the same for the live node and all offline runs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import NamedTuple

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY
from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.intake import (
    INTAKE_REASONS,
    NANOSECOND,
    ConvertedReading,
    CraftSample,
    ImuReading,
    Intake,
)
from swath_sysid.attitude.motion.sensor_mount import Installation
from swath_sysid.attitude.motion.stamps import JUMPED_BACK, STAMP_REASONS, StampSettings
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecast import Forecast
from swath_sysid.attitude.prediction.forecaster import (
    FORECASTER_REASONS,
    Forecaster,
    ForecasterDiagnostics,
    ForecasterSettings,
)
from swath_sysid.attitude.prediction.sea_fit import SeaFit, SeaRequest
from swath_sysid.attitude.prediction.sea_state import SeaReport
from swath_sysid.pipeline.forecast_messages import (
    AttitudeForecast,
    HorizonForecast,
    PointForecast,
    attitude_forecast,
    attitudes_at_leads,
    horizon_forecast,
    points_at_leads,
)
from swath_sysid.pipeline.validity import ModelValidity

PIPELINE_REASONS = (*STAMP_REASONS, *INTAKE_REASONS, *FORECASTER_REASONS)  #: Everything that is counted.

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


class PipelineStep(NamedTuple):
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
        return () if self.forecast is None else attitudes_at_leads(self.forecast, self.stamp_ns, *self.heading)

    def trajectory(self) -> HorizonForecast | None:
        """The values over the horizon; None unless due."""
        return None if self.horizon is None else horizon_forecast(self.horizon, self.stamp_ns)

    def points(self) -> list[PointForecast]:
        """For the topics of named points: list of `PointForecast`; empty unless due and learnt."""
        return [] if self.forecast is None else points_at_leads(self.forecast, self.stamp_ns)

    @property
    def quiescence(self) -> float | None:
        """The probability of keeping the limits; None where none is known, or it is not due."""
        return self.horizon.quiescence if self.horizon is not None and isfinite(self.horizon.quiescence) else None


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
        self._models = dict.fromkeys(AXES)
        self.validity = ModelValidity()
        self._first_ns: int | None = None
        self.newest_ns = 0  #: Stamp of the newest message; 0 before any.
        self._yaw = self._yaw_rate = 0.0

    def set_models(self, models: Mapping[str, IdentifiedModel]) -> None:
        """Swap the hulls by axis under the running filters; an axis without one is forecast without a hull."""
        for axis in AXES:
            model = models.get(axis)
            if model != self._models[axis]:
                self._models[axis] = model
                self.forecaster.set_model(axis, model)
                self.validity.set_model(axis, model)

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
        self.validity.add(sample.stamp, {'roll': sample.roll, 'pitch': sample.pitch})
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
        return PipelineStep(
            reasons + observed.reasons,
            True,
            following,
            observed.forecast,
            observed.horizon,
            observed.sea_request,
            stamp_ns,
            (self._yaw, self._yaw_rate),
            observed.sea,
        )

    def diagnostics(self) -> ForecasterDiagnostics:
        """The running state; see `Forecaster.diagnostics`."""
        state = self.forecaster.diagnostics()
        return replace(state, advice=state.advice + self.validity.advice())


def warm_up() -> None:
    """Forecasts of a hull at rest, so that the first samples find everything loaded and compiled."""
    pipeline = ForecastPipeline()
    pipeline.set_models({'roll': IdentifiedModel.exactly(hull_named('swath-roll').model)})
    at_rest = CraftSample(0, *(0.0,) * 6, STANDARD_GRAVITY, *(1e-6,) * 4)
    for number in range(3):
        pipeline.add_sample(at_rest._replace(stamp_ns=number * 10_000_000))
