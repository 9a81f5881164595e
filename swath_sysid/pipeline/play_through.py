"""The live pipeline without its processes: buffer, identifier and predictor run over the same messages."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from swath_sysid import __version__
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.live_decays import MOST_DECAYS
from swath_sysid.attitude.identification.refit import RefitOutcome, RefitRequest, RefitSettings, Refitter, refit
from swath_sysid.attitude.motion.intake import NANOSECOND, ImuReading
from swath_sysid.attitude.motion.window import MotionTable, MotionWindow, WindowSettings
from swath_sysid.attitude.prediction.forecaster import ForecastStep
from swath_sysid.attitude.prediction.sea_fit import SeaFit, SeaRequest, fit_sea
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.health import BufferHealth, IdentifierHealth, Report, stability_report, verdict_values


@dataclass(frozen=True)
class PlayThroughSettings:
    """Settings of the three nodes."""

    window: WindowSettings = field(default_factory=WindowSettings)
    refit: RefitSettings = field(default_factory=RefitSettings)
    forecasts: PipelineSettings = field(default_factory=PipelineSettings)
    auto_identify: bool = True  #: Refit whenever the buffer publishes a window.
    refit_delay: float = 0.0  #: s from a window to its models; live, a refit takes 0.1 to 3 s.
    window_source: dict = field(default_factory=dict)  #: Names the windows' source in the provenance of models.
    identify_interval: float = 0.0  #: s after which the window is identified unasked; 0: never.


class Played(NamedTuple):
    """What the three nodes publish after one IMU message, in order."""

    stamp_ns: int
    models: dict[str, IdentifiedModel] | None  #: Where they have changed; already used for this message's forecasts.
    window: MotionTable | None  #: Published because a free decay has ended.
    step: ForecastStep
    verdict: str | None = None  #: One line on a refit that ended.


class PlayThrough:
    """Buffer, identifier and predictor on one thread, clocked by the stamps; ``models`` are those known at the start.
    Deterministic. ``fit`` turns a `RefitRequest` into a `RefitOutcome`, ``fit_sea`` a `SeaRequest` into a `SeaFit`.
    """

    def __init__(
        self,
        settings: PlayThroughSettings | None = None,
        models: Mapping[str, IdentifiedModel] | None = None,
        fit: Callable[[RefitRequest], RefitOutcome] = refit,
        fit_sea: Callable[[SeaRequest], SeaFit] = fit_sea,
    ) -> None:
        self.settings = settings or PlayThroughSettings()
        window, forecasts = self.settings.window, self.settings.forecasts
        self.forecasts = ForecastPipeline(forecasts)
        # both nodes convert the same messages: once is enough where they do so alike
        self._is_shared = (window.installation, window.stamps) == (forecasts.installation, forecasts.stamps)
        self.window = MotionWindow(window, self.forecasts.intake if self._is_shared else None)
        self.refitter = Refitter(self.settings.refit, models)
        self.forecasts.set_models(self.refitter.models)
        self._fit = fit
        self._fit_sea = fit_sea
        self.refits = 0
        self._running: tuple[int, RefitOutcome] | None = None
        self._waiting: deque[MotionTable] = deque(maxlen=MOST_DECAYS)
        self._due_ns: int | None = None
        self._unpublished = bool(models)

    @property
    def is_refitting(self) -> bool:
        """Whether a fit is under way by the stamps."""
        return self._running is not None

    def add(self, reading: ImuReading) -> Played:
        """Process one IMU message."""
        stamp_ns = reading.stamp_ns
        models, verdict = self._finish_refit(stamp_ns)
        converted = self.forecasts.intake.take(reading)
        step = self.forecasts.finish(self.forecasts.begin(converted))
        if step.sea_request is not None:
            # used a while after its stamp, so that a live fit is ready by then
            self.forecasts.install(self._fit_sea(step.sea_request))
        finished = (self.window.add_converted(converted) if self._is_shared else self.window.add(reading)).finished
        if self._is_due(stamp_ns):
            self._waiting.append(self.window.table())
            self._start_refit(stamp_ns)
        if finished is None:
            return Played(stamp_ns, models, None, step, verdict)
        if self.settings.auto_identify:
            self._waiting.append(finished.table)
            self._start_refit(stamp_ns)
        return Played(stamp_ns, models, finished.table, step, verdict)

    def add_upstream(self, name: str, stamp_ns: int | None, value: float) -> None:
        """Process one sample of an upstream channel; see `ForecastPipeline.add_upstream`."""
        self.forecasts.add_upstream(name, stamp_ns, value)

    def _is_due(self, stamp_ns: int):
        """Whether the window is to be identified unasked now."""
        interval_ns = round(self.settings.identify_interval / NANOSECOND)
        if not interval_ns:
            return False
        # restarts when the clock was set back
        if self._due_ns is None or self._due_ns - stamp_ns > interval_ns:
            self._due_ns = stamp_ns + interval_ns
        if stamp_ns < self._due_ns or not self.window.size:
            return False
        self._due_ns = stamp_ns + interval_ns
        return True

    def _start_refit(self, stamp_ns: int):
        """Fit the windows that wait, unless a fit is still under way by the stamps."""
        if self._running is None and self._waiting:
            origin = {'source': self.settings.window_source, 'software': f'swath_sysid {__version__}'}
            outcome = self._fit(self.refitter.request(*self._waiting, is_asked=False, **origin))
            self._running = stamp_ns, outcome
            self._waiting.clear()
            self.refits += 1

    def _finish_refit(self, stamp_ns: int):
        """The models in use from now on where they have changed, and what a fit that ended has found."""
        models = self.refitter.models if self._unpublished else None
        self._unpublished = False
        if self._running is None:
            return models, None
        begun, outcome = self._running
        # a clock that was set back never reaches the time at which the fit would have ended
        if 0.0 <= (stamp_ns - begun) * NANOSECOND < self.settings.refit_delay:
            return models, None
        self._running = None
        if self.refitter.take(outcome):
            models = self.refitter.models
            self.forecasts.set_models(models)
        self._start_refit(stamp_ns)
        return models, outcome.message


class PlayedHealth:
    """What the three nodes report in a play-through, clocked by the stamps, with processing times of zero.
    ``periods``, s: between the diagnostics of imu_buffer, identifier and predictor.
    """

    def __init__(self, pipeline: PlayThrough, topic: str, periods: Sequence[float]):
        self._pipeline = pipeline
        self._buffer = BufferHealth(topic, pipeline.window)
        self._identifier = IdentifierHealth()
        self._predictor = PredictorHealth(topic, pipeline.forecasts)
        nodes = 'imu_buffer', 'identifier', 'predictor'
        self._periods_ns = {node: round(1e9 * period) for node, period in zip(nodes, periods, strict=True)}
        self._due_ns: dict[str, int] = {}
        self._begun_ns = self._next_ns = 0
        self._now_ns: int | None = None

    def follow(self, played: Played) -> list[list[tuple]]:
        """Process one step; where diagnostics are due, those of each node, each as of `Report.status_of`."""
        due: list[list[tuple]] = []
        stamp_ns = played.stamp_ns
        # a stray stamp is not the time
        if played.step.used or self._now_ns is None:
            if self._now_ns is None or not self._now_ns <= stamp_ns < self._next_ns:
                due = self._reports_at(stamp_ns)
            self._now_ns = stamp_ns
        now = (self._now_ns - self._begun_ns) * 1e-9
        self._buffer.note_message(stamp_ns, self._now_ns, now, now)
        self._predictor.note_message(stamp_ns, self._now_ns, now, now)
        if played.models is not None:
            self._predictor.note_model(now)
        self._predictor.published += played.step.next is not None
        if played.window is not None:
            self._buffer.decays += 1
        while self._identifier.refits < self._pipeline.refits:
            self._identifier.begin()
        if played.verdict is not None:
            self._identifier.end(played.models is not None, played.verdict)
        return due

    def _reports_at(self, stamp_ns: int) -> list[list[tuple]]:
        """The reports due at a stamp; time restarts where it is before the last."""
        if self._now_ns is None or stamp_ns < self._now_ns:
            self._begun_ns = stamp_ns
            self._due_ns = {node: stamp_ns + period for node, period in self._periods_ns.items()}
        reported = []
        for node, due_ns in self._due_ns.items():
            if stamp_ns >= due_ns:
                following = due_ns + self._periods_ns[node]
                self._due_ns[node] = following if following > stamp_ns else stamp_ns + self._periods_ns[node]
                reported.append([report.status_of(node) for report in self._reports(node, stamp_ns)])
        self._next_ns = min(self._due_ns.values())
        return reported

    def _reports(self, node: str, now_ns: int) -> list[Report]:
        now = (now_ns - self._begun_ns) * 1e-9
        if node == 'imu_buffer':
            return self._buffer.reports(now, now_ns)
        if node == 'predictor':
            return self._predictor.reports(now, now_ns)
        refitter = self._pipeline.refitter
        return [
            self._identifier.report(
                refitter.described, refitter.steps_back, self._pipeline.is_refitting, verdict_values(refitter.models)
            ),
            stability_report(refitter.stability),
        ]
