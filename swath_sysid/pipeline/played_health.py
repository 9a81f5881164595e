"""The diagnostics of the three nodes in a play-through."""

from collections.abc import Sequence

from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.health import BufferHealth, IdentifierHealth, Report, stability_report
from swath_sysid.pipeline.play_through import Played, PlayThrough
from swath_sysid.pipeline.validity import verdict_values


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
