"""IMU samples and hull models in, forecasts out, as plain numbers: the same for the live node and all offline runs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion import intake
from swath_sysid.attitude.motion.attitude import STANDARD_GRAVITY, Installation
from swath_sysid.attitude.motion.installation_watch import InstallationCheck
from swath_sysid.attitude.motion.stamps import (
    BURSTS,
    GAP,
    JUMPED_BACK,
    LONG_GAP,
    LOST,
    OUT_OF_ORDER,
    STEPPED,
    StampSettings,
)
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecast import Wanted
from swath_sysid.attitude.prediction.forecaster import (
    Forecaster,
    ForecasterDiagnostics,
    ForecasterSettings,
    ForecastStep,
)
from swath_sysid.attitude.prediction.sea_fit import SeaFit
from swath_sysid.attitude.prediction.sea_memory import SeaMemory
from swath_sysid.common.conditions import codes_in
from swath_sysid.common.door import checked
from swath_sysid.common.errors import InputError

#: Everything that is counted.
PIPELINE_REASONS = codes_in('stamps', 'losses', 'intake', 'filters')


@checked
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


@checked
class ForecastPipeline:
    """Forecasts from the messages of one sensor.

    Pure and causal: time is the stamps; the same messages, models and fits give the same forecasts. What a step asks
    to learn of the sea (``sea_request``) is fitted by `fit_sea` and given to `install`.

    Args:
        settings: By default those of `PipelineSettings`.

    Example:
        >>> trial = read_trial(records / 'morro_buoy.csv').between(0.0, 20.0)
        >>> pipeline = ForecastPipeline()
        >>> for sample in samples_of(trial):
        ...     step = pipeline.add_sample(sample)
        ...     if step.sea_request is not None:
        ...         pipeline.install(fit_sea(step.sea_request))
        >>> step.forecast.leads.tolist()
        [0.1, 0.5, 1.0, 2.0, 3.0, 5.0]
        >>> step.forecast.angle('roll').shape, step.forecast.half_width('roll').shape  # 50, 90 and 99 % intervals
        ((6,), (6, 3))
    """

    def __init__(self, settings: PipelineSettings | None = None) -> None:
        self.settings = settings or PipelineSettings()
        self.forecaster = Forecaster(self.settings.forecaster)
        self.installation = InstallationCheck(self.settings.installation)
        self.counts = dict.fromkeys(PIPELINE_REASONS, 0)
        self.used = 0
        self.intake = intake.Intake(self.settings.installation, self.settings.stamps)
        self.models: dict[str, IdentifiedModel | None] = dict.fromkeys(AXES)  #: By axis.
        self._remembered: SeaMemory | None = None
        self._first_ns: int | None = None
        self._since_used = self._left_out = 0
        self.newest_ns = 0  #: Stamp of the newest message; 0 before any.

    @checked
    def set_models(self, models: Mapping[str, IdentifiedModel]) -> None:
        """Swap the hulls by axis under the running filters; an axis without one is forecast without a hull."""
        for axis in AXES:
            model = models.get(axis)
            if model != self.models[axis]:
                self.models[axis] = model
                self.forecaster.set_model(axis, model)

    @checked
    def remember(self, memory: SeaMemory | None) -> None:
        """Forecast from the first sample on as what an earlier start has learnt of the sea; one of another craft or sea
        is dropped as soon as its forecasts are worse.
        """
        self._remembered = self.forecaster.memory = memory

    @property
    def memory(self) -> SeaMemory | None:
        """What is known of the sea, for `remember` at the next start; None before enough is."""
        return self.forecaster.memory

    @checked
    def install(self, fit: SeaFit) -> None:
        """Take over the fit that a step asked for; it is used from its request's stamp plus the refit delay on."""
        self.forecaster.install(fit)

    def add(self, reading: intake.ImuReading) -> ForecastStep:
        """Take one IMU message."""
        _refuse_other(reading, intake.ImuReading)
        return self.finish(self.begin(self.intake.take(reading)))

    def add_sample(self, sample: intake.CraftSample) -> ForecastStep:
        """Take one sample of the craft's motion, as a record holds it."""
        _refuse_other(sample, intake.CraftSample)
        return self.finish(self.begin(self.intake.place(sample)))

    @checked
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
        self.forecaster.observe_upstream(name, (stamp_ns - first_ns) * intake.NANOSECOND, value)

    def begin(self, converted: intake.ConvertedReading) -> ForecastStep:
        """Take one message or sample that ``intake`` has converted, and forecast one sample ahead.

        What takes longer is left to `finish`, which must follow: in between, ``next`` can be published.
        """
        sample, reasons = converted
        self.installation.add(converted)
        if BURSTS in reasons:
            self._begin_again()
        step = ForecastStep()
        self._since_used += 1
        if sample is not None:
            stamp_ns, elapsed = sample.stamp_ns, None
            if self._first_ns is None:
                self._first_ns = stamp_ns
            elif JUMPED_BACK not in reasons:
                elapsed = (stamp_ns - self.newest_ns) * intake.NANOSECOND
            self.newest_ns = stamp_ns
            self.used += 1
            # seconds since the epoch would resolve 0.2 us only
            stamp = (stamp_ns - self._first_ns) * intake.NANOSECOND
            step = self.forecaster.observe(sample, stamp, elapsed, self._since_used, self._left_out)
            # those that were left out have come after all
            step = step._replace(lost=max(step.lost - self._since_used + 1, min(step.lost, 0)))
            self._since_used = self._left_out = 0
            if STEPPED in step.reasons:
                reasons = tuple(each for each in reasons if each not in (JUMPED_BACK, STEPPED, GAP, LONG_GAP))
        if reasons:
            step = step._replace(reasons=reasons + step.reasons)
        for reason in step.reasons:
            self.counts[reason] += 1
        # one that is late came after all
        self.counts[LOST] = max(self.counts[LOST] + step.lost - reasons.count(OUT_OF_ORDER), 0)
        return step

    def leave_out(self, stamp_ns: int, arrival: float) -> None:
        """A message has come that is not used, for want of time: it is not lost, and the sensor's rate is as before."""
        self.intake.leave_out(stamp_ns, arrival)
        self._since_used += 1
        self._left_out += 1

    def reset(self, settings: PipelineSettings) -> None:
        """Forecast with other settings, and learn the sea anew; the models and what is remembered of the sea stay."""
        self._remembered = self.forecaster.memory
        if settings.installation != self.settings.installation:
            self.installation = InstallationCheck(settings.installation)
            self.intake = intake.Intake(settings.installation, settings.stamps)
        self.settings = settings
        self._begin_again()

    def _begin_again(self) -> None:
        """Forget what was learnt from stamps that were no times of samples."""
        limits = self.forecaster.quiescence
        self.forecaster, self._first_ns = Forecaster(self.settings.forecaster), None
        self.forecaster.memory = self._remembered
        self.forecaster.set_quiescence(limits)
        for axis, model in self.models.items():
            if model is not None:
                self.forecaster.set_model(axis, model)
        self.counts = dict.fromkeys(PIPELINE_REASONS, 0)

    def finish(self, step: ForecastStep, wanted: Callable[[], Wanted] = Wanted) -> ForecastStep:
        """Complete a step of `begin` with the forecasts that are due, as far as they are ``wanted``."""
        return self.forecaster.issue(step, wanted)

    def diagnostics(self) -> ForecasterDiagnostics:
        """The running state; see `Forecaster.diagnostics`."""
        return self.forecaster.diagnostics()


def _refuse_other(value: object, kind: type) -> None:
    """As `checked`, at a thirtieth of its cost, for what comes with every sample."""
    if not isinstance(value, kind):
        raise InputError(f'a ForecastPipeline takes one {kind.__name__} at a time, not a {type(value).__name__}')


def warm_up() -> None:
    """Forecasts of a hull at rest, so that the first samples find everything loaded and compiled."""
    pipeline = ForecastPipeline()
    pipeline.set_models({'roll': IdentifiedModel.exactly(hull_named('swath-roll').model)})
    at_rest = intake.CraftSample(0, *(0.0,) * 6, STANDARD_GRAVITY, *(1e-6,) * 4)
    # so far apart that each is a row
    for number in range(3):
        pipeline.add_sample(at_rest._replace(stamp_ns=number * 100_000_000))
