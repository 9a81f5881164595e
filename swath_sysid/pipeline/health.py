"""Health of a node for its diagnostics: counts by reason, levels and messages; time is given by the caller."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isnan
from typing import TYPE_CHECKING, NamedTuple

from swath_sysid.attitude.motion.intake import (
    FROZEN,
    INTAKE_REASONS,
    NANOSECOND,
    NO_ORIENTATION,
    NO_RATES,
    UNKNOWN_COVARIANCE,
)
from swath_sysid.attitude.motion.stamps import LOST, STAMP_REASONS, StampSettings
from swath_sysid.attitude.motion.window import MotionWindow
from swath_sysid.common.advice import CURES
from swath_sysid.common.conventions import LOST_SHARE

if TYPE_CHECKING:
    from swath_sysid.attitude.identification.stability_watch import StabilityWatch
    from swath_sysid.common.judgement import Judged

OK, WARN, ERROR, STALE = range(4)  #: Levels of diagnostic_msgs/DiagnosticStatus.

SEVERAL_PUBLISHERS, SEVERAL_PREDICTORS = 'several-publishers', 'several-predictors'
QOS_MISMATCH, OTHER_TYPE = 'qos-mismatch', 'other-message-type'
SILENT = 'sensor-silent'
BAD_MODEL = 'bad-model'
BAD_LOADING = 'bad-loading'
BAD_UPSTREAM = 'bad-upstream'
LOADING_ADVICE = 'loading-advice'
BAD_WINDOW = 'bad-window'
BAD_MODEL_FILE = 'bad-model-file'
PASSED_OVER = 'passed-over'
BEHIND = 'behind'
LATE_FIT = 'late-fit'
NOT_FITTED = 'waves-not-fitted'
IDENTIFICATION_WORKER_DIED = 'identification-worker-died'
WAVE_WORKER_DIED = 'wave-worker-died'
NOT_SAVED = 'model-not-saved'
FRAME_CHANGED = 'frame-id-changed'

NO_MESSAGE_YET, QUEUED = 'no-message-yet', 'messages-queued'
#: States that are reported but not counted.
CLOCKS_DIFFER, SHORT_OF_MEMORY, CLOCK_STANDS = 'clocks-differ', 'short-of-memory', 'clock-stands-still'
NO_CLOCK = 'no-clock'

HARMLESS = {NO_ORIENTATION, UNKNOWN_COVARIANCE, LATE_FIT}

#: Warned of from the second report in a row: a machine stalls once while programs start, and a driver may repeat one.
RECURRING = {PASSED_OVER, LOST, BEHIND, FROZEN}

#: Of a message or of values in it; the share is reported.
LOSSES = {*STAMP_REASONS[:3], *INTAKE_REASONS, BEHIND}

LASTING = {NO_RATES}  #: Warned of when they begin; then reported while they last, without a warning.

CALM_SINCE_WARNING = 30.0  #: s without a warning after which the log reports its end.

DISCOVERY = 4.0  #: s in which publishers and subscriptions that are there are found: mostly 0.2, now and then three.

LARGEST_STAMP_AGE = 1.0  #: s; more means that clocks differ, or a replay at another time.
REMEMBERED_GAPS = 100  #: Messages; the longest of their intervals is usual.
REMEMBERED_AGES = 60  #: Reports; much older stamps than the best of these have waited in a queue.


@dataclass(frozen=True)
class Report:
    """One diagnostic_msgs/DiagnosticStatus."""

    name: str
    level: int  #: `OK`, `WARN` or `ERROR`.
    message: str
    values: dict[str, object] = field(default_factory=dict)
    codes: tuple[str, ...] = ()  #: Of the conditions that the message warns of.

    def status_of(self, node: str) -> tuple[int, str, str, dict[str, str]]:
        """Level, name, message and values of a DiagnosticStatus of a node, by its full name without first slash."""
        texts = {key: f'{value:.6g}' if isinstance(value, float) else str(value) for key, value in self.values.items()}
        return self.level, f'{node}: {self.name}', self.message, texts


class Condition(NamedTuple):
    """One of the conditions that a report warns of."""

    level: int
    code: str
    sentence: str


class Changes:
    """Which changes of a level, or of the conditions behind it, deserve a line in a log."""

    def __init__(self) -> None:
        self._logged = OK
        self._seen: dict[str, float] = {}
        self._has_been_well = False
        self._better_since: float | None = None

    def is_news(self, level: int, now: float, codes: Iterable[str] = ()) -> bool:
        """Whether to log this level with these conditions now, s.

        A worse level and another condition at once, the end of a warning when it has stayed away.
        """
        others = [code for code in codes if now - self._seen.get(code, -inf) >= CALM_SINCE_WARNING]
        self._seen |= dict.fromkeys(codes, now)
        if level >= self._logged:
            self._better_since = None
        elif self._better_since is None:
            self._better_since = now
        lasted = self._better_since is not None and now - self._better_since >= CALM_SINCE_WARNING
        is_first = level == OK and not self._has_been_well
        is_better = level < self._logged and (self._logged == ERROR or is_first or lasted)
        if level > self._logged or is_better or others:
            self._logged, self._better_since = level if is_better else max(level, self._logged), None
            self._has_been_well = self._has_been_well or level == OK
            return True
        return False


class Reasons:
    """Counts by reason, which of them still hold, and what to do about them."""

    def __init__(self, reasons: Iterable[str], cures: Mapping[str, str] = CURES):
        self._cures = cures
        self.counts = dict.fromkeys(reasons, 0)
        self._holding: dict[str, Condition] = {}
        self._reported_counts = dict(self.counts)
        self._lasting: list[str] = []
        self._grown: set[str] = set()  #: Reasons that grew before the last call of `fresh`.
        self.mismatched: set[str] = set()  #: Topics with an incompatible publisher or subscription.
        self.details: dict[str, str] = {}  #: What is reported of a reason that grows, in place of how often it did.

    def note(self, reason: str, about: str | None = None, sentence: str = '') -> None:
        """Count one more of a reason; one ``about`` something holds until that is settled."""
        self.counts[reason] += 1
        if about is not None:
            cure = self._cures[reason]
            self._holding[about] = Condition(WARN, reason, f'{reason}: {f"{sentence}; " if sentence else ""}{cure}')

    def note_mismatch(self, topic: str) -> None:
        """Count a publisher or a subscription of a topic that does not connect."""
        self.note(QOS_MISMATCH)
        self.mismatched.add(topic)

    def note_while(self, holds: bool, reason: str, sentence: str = '') -> None:
        """Count a reason when it begins to hold; it holds until this is called without."""
        if not holds:
            self.settle(reason)
        elif reason not in self._holding:
            self.note(reason, reason, sentence)

    def settle(self, about: str) -> None:
        """End what was noted about something."""
        self._holding.pop(about, None)

    def fresh(self, counts: Mapping[str, int]) -> dict[str, int]:
        """How much each count has grown since the last call; harmless, single and unchanged ones are left out."""
        before, self._reported_counts = self._reported_counts, dict(counts)
        grown = {reason: count - before.get(reason, 0) for reason, count in counts.items()}
        grown = {reason: growth for reason, growth in grown.items() if growth > 0}
        if BEHIND in grown:
            grown.pop(PASSED_OVER, None)  # which it explains
        self._lasting = sorted(LASTING & grown.keys())
        known = HARMLESS | {reason for reason in LASTING if before.get(reason, 0) > 0} | (RECURRING - self._grown)
        self._grown = set(grown)
        return {reason: growth for reason, growth in grown.items() if reason not in known}

    def grown(self, fresh: Mapping[str, int], received: int = 0) -> list[Condition]:
        """The reasons that grew, the most frequent first: how often, of which share of the messages that were
        ``received`` meanwhile where that is large, and what to do about each.
        """
        reasons = sorted(fresh, key=lambda each: -fresh[each])
        where = {QOS_MISMATCH: f' on {", ".join(sorted(self.mismatched))}'} if self.mismatched else {}
        often = {each: f'{number} times lately' for each, number in fresh.items()}
        for each in LOSSES & fresh.keys():
            if LOST_SHARE * received < fresh[each] <= received:
                often[each] += f', {fresh[each] / received:.0%} of the messages'
        often |= {each: detail for each, detail in self.details.items() if each in fresh}
        return [
            Condition(WARN, each, f'{each}{where.get(each, "")} ({often[each]}): {self._cures[each]}')
            for each in reasons
        ]

    @property
    def lasting(self) -> str:
        """What grew of `LASTING` until the last call of `fresh`, and what to do about it."""
        return '; '.join(f'{reason}: {self._cures[reason]}' for reason in self._lasting)

    @property
    def holding(self) -> list[Condition]:
        """What to do about all that still holds."""
        return list(self._holding.values())


def worst_of(found: Sequence[Condition]) -> tuple[int, str]:
    """The worst level of some conditions, and the sentences of all."""
    return max(each.level for each in found), '; '.join(dict.fromkeys(each.sentence for each in found))


def joined(found: Sequence[Condition], others: Iterable[Condition]) -> list[Condition]:
    """Some conditions and, of others, those that they do not tell already."""
    told = codes_of(found)
    return [*found, *(each for each in others if each.code not in told)]


def codes_of(found: Iterable[Condition]) -> tuple[str, ...]:
    """Their codes."""
    return tuple(each.code for each in found)


def is_unusual(silence: float, interval: float) -> bool:
    """Whether a silence, s, is more than messages at this interval, s, leave."""
    return silence > max(StampSettings.gap_limit, 5.0 * interval)


class Arrivals:
    """How the messages of a topic come, timed by the stamps of another, which stand still while a replay is paused."""

    def __init__(self) -> None:
        self.received = 0
        self._newest_ns = 0
        self._gaps: deque[float] = deque(maxlen=REMEMBERED_GAPS)

    def note(self, now_ns: int) -> None:
        """Count a message that came at this stamp of the other topic, ns; 0 before that has one."""
        self.received += 1
        if self._newest_ns:
            self._gaps.append((now_ns - self._newest_ns) * NANOSECOND)
        self._newest_ns = now_ns

    def silence(self, now_ns: int) -> float:
        """s without a message; zero while that may be no more than usual."""
        silence = (now_ns - self._newest_ns) * NANOSECOND
        return silence if self._gaps and is_unusual(silence, max(self._gaps)) else 0.0


class StreamHealth(Reasons):
    """How the messages of one topic arrive, counting further reasons beside those of every stream."""

    def __init__(self, topic: str, reasons: Iterable[str] = ()):
        super().__init__((SEVERAL_PUBLISHERS, QOS_MISMATCH, OTHER_TYPE, SILENT, FRAME_CHANGED, BEHIND, *reasons))
        self.topic = topic
        self._ages: deque[float] = deque(maxlen=REMEMBERED_AGES)
        self.received = 0
        self._age = 0.0
        self._arrival: float | None = None
        self._silence = 0.0  #: s since the last message, or the first report.
        self._spent = self._longest = 0.0
        self._since_report = 0
        self._frame_id: str | None = None
        self._begun: float | None = None
        self._reported_at: float | None = None
        self._reported_ns = 0

    def note_message(self, stamp_ns: int, clock_ns: int, begun: float, ended: float) -> None:
        """Count a message: its stamp and the clock at its arrival, ns, and two readings around its handling, s."""
        self.received += 1
        self._since_report += 1
        self._age = (clock_ns - stamp_ns) * 1e-9
        self._arrival = begun
        self._spent += ended - begun
        self._longest = max(self._longest, ended - begun)

    def note_left_out(self) -> None:
        """Count a message that is not used because messages come faster than they are handled."""
        self.received += 1
        self._since_report += 1
        self.note(BEHIND)

    def note_frame_id(self, frame_id: str) -> None:
        """Count a change of frame."""
        if frame_id != self._frame_id:
            if self._frame_id is not None:
                self.note(FRAME_CHANGED)
            self._frame_id = frame_id

    def note_publishers(self, count: int, others: Iterable[str] = ()) -> None:
        """Count the appearance of a second publisher, and of one of other message types."""
        self.note_while(count > 1, SEVERAL_PUBLISHERS)
        self.note_while(bool(others), OTHER_TYPE, f'{self.topic} is published as {", ".join(others)}')

    def report(
        self, now: float, now_ns: int, core_counts: Mapping[str, int], used: int, interval: float | None = None
    ) -> Report:
        """The report now, s of the clock of `note_message` and ns of that of the stamps, and start a new period;
        ``core_counts`` count since the start, ``used`` messages the core used, ``interval``, s, is the usual one.
        """
        if self._begun is None:
            self._begun, self._reported_ns = now, now_ns
        self._note_silence(now, now_ns)
        self.note_while(self.received > 0 and is_unusual(self._silence, interval or 0.0), SILENT)
        age = None if self._arrival is None else self._age
        if age is not None:
            # with a simulated clock that the node has not read yet, messages arrive before their time
            self._ages.append(max(age, 0.0))
        counts = {**core_counts, **self.counts}
        is_stopped = now_ns == self._reported_ns and not self._since_report
        found = self._conditions(age, self.fresh(counts), now, now_ns)
        level, message = worst_of(found) if found else (OK, self._well(age, is_stopped))
        period = None if self._reported_at is None else now - self._reported_at
        values: dict[str, object] = {
            'rate_hz': self._since_report / period if period else 0.0,
            'received': self.received,
            'used': used,
            **counts,
            'stamp_age_s': 'unknown' if age is None else age,
            'processing_ms_mean': 1e3 * self._spent / max(self._since_report, 1),
            'processing_ms_max': 1e3 * self._longest,
        }
        self._reported_at, self._reported_ns = now, now_ns
        self._spent = self._longest = 0.0
        self._since_report = 0
        return Report('imu', level, message, values, codes_of(found))

    def _note_silence(self, now: float, now_ns: int) -> None:
        """Add the time passed by both clocks: none while that of the stamps stands still after it has gone on."""
        before = self._begun if self._reported_at is None else self._reported_at
        by_stamps = max((now_ns - self._reported_ns) * 1e-9, 0.0) if now_ns else inf
        if self._since_report and self._arrival is not None:
            self._silence = min(now - self._arrival, by_stamps)
        elif before is not None:
            self._silence += min(now - before, by_stamps)

    def _conditions(self, age: float | None, fresh: Mapping[str, int], now: float, now_ns: int) -> list[Condition]:
        """All that there is to warn of, the worst first."""
        found = []
        if age is None and self._silence > DISCOVERY:
            sentence = f'no message on {self.topic} yet'
            if self.topic in self.mismatched:
                found.append(Condition(ERROR, QOS_MISMATCH, f'{sentence}: {CURES[QOS_MISMATCH]}'))
            elif OTHER_TYPE in self._holding:
                found.append(Condition(ERROR, OTHER_TYPE, f'{sentence}: {self._holding[OTHER_TYPE].sentence}'))
            else:
                found.append(Condition(ERROR, NO_MESSAGE_YET, f'{sentence}: {CURES[NO_MESSAGE_YET]}'))
        if SILENT in self._holding:
            found.append(
                Condition(ERROR, SILENT, f'no message on {self.topic} for {self._silence:.1f} s: {CURES[SILENT]}')
            )
        if not now_ns and now - (self._begun or 0.0) > DISCOVERY:
            found.append(Condition(WARN, NO_CLOCK, CURES[NO_CLOCK]))
        found = joined(joined(found, self.holding), self.grown(fresh, self._since_report))
        if age is not None and now_ns:
            late = age - min(self._ages)
            if late > LARGEST_STAMP_AGE:
                found.append(Condition(WARN, QUEUED, f'messages arrive {late:.1f} s late: {CURES[QUEUED]}'))
            elif abs(age) > LARGEST_STAMP_AGE:
                side = 'behind' if age > 0.0 else 'ahead of'
                sentence = f'stamps are {abs(age):.1f} s {side} the clock of this machine: {CURES[CLOCKS_DIFFER]}'
                found.append(Condition(WARN, CLOCKS_DIFFER, sentence))
        return found

    def _well(self, age: float | None, clock_is_stopped: bool) -> str:
        """The message where there is nothing to warn of."""
        if age is None:
            return f'waiting for the first message on {self.topic}'
        if clock_is_stopped:
            return f'no message on {self.topic} while the clock stands still: {CURES[CLOCK_STANDS]}'
        return f'receiving {self.topic}' + (f'; {self.lasting}' if self.lasting else '')


class BufferHealth(StreamHealth):
    """How the samples of a motion window arrive, and what it holds."""

    def __init__(self, topic: str, window: MotionWindow):
        super().__init__(topic)
        self.decays = 0
        self._window = window

    def reports(self, now: float, now_ns: int) -> list[Report]:
        """The statuses of now; see `StreamHealth.report`."""
        window = self._window
        level, message = OK, window.described
        if window.is_short_of_memory:
            level, message = WARN, f'{message}: {CURES[SHORT_OF_MEMORY]}'
        values: dict[str, object] = {
            'samples': window.size,
            'duration_s': window.duration,
            'recording': window.recording,
            'decays_noticed': self.decays,
        }
        return [
            self.report(now, now_ns, window.counts, window.samples, window.interval),
            Report('window', level, message, values),
        ]


class IdentifierHealth(Reasons):
    """The state of identification."""

    def __init__(self) -> None:
        super().__init__((BAD_WINDOW, IDENTIFICATION_WORKER_DIED, NOT_SAVED, BAD_MODEL_FILE, QOS_MISMATCH))
        self.progress = 0.0
        self.refits = self.published = 0
        self.last = 'none yet'
        self.slower_because = ''  #: Why fits take longer than they could.

    def begin(self) -> None:
        """A refit starts."""
        self.progress = 0.0
        self.refits += 1

    def end(self, published: bool, message: str) -> None:
        """It has ended, published a model or not, with one line about it."""
        self.published += published
        self.last = message

    def report(
        self, models: str, steps_back: int, is_busy: bool, verdicts: Mapping[str, object] | None = None
    ) -> Report:
        """The report now, and start a new period; ``steps_back``: how many models `rollback` can return to."""
        found = joined(self.holding, self.grown(self.fresh(self.counts)))
        doing = f'identifying, {100.0 * self.progress:.0f} % done' if is_busy else f'ready; last: {self.last}'
        level, message = worst_of(found) if found else (OK, doing)
        values: dict[str, object] = {
            'state': 'identifying' if is_busy else 'ready',
            'progress': self.progress,
            'models': models,
            **(verdicts or {}),
            'rollbacks_kept': steps_back,
            'refits': self.refits,
            'published': self.published,
            'last_verdict': self.last,
            'slower_because': self.slower_because,
            **self.counts,
        }
        return Report('identification', level, message, values, codes_of(found))


def verdict_values(models: Mapping[str, Judged | None]) -> dict[str, object]:
    """Verdict and sentence of models by axis, for diagnostics."""
    found: dict[str, object] = {}
    for axis, identified in models.items():
        if identified is not None:
            found[f'verdict_{axis}'] = identified.verdict or 'not known'
            found[f'verdict_sentence_{axis}'] = identified.verdict_sentence
    return found


def stability_report(watch: StabilityWatch) -> Report:
    """What the natural period of roll says of the stability, by the newest finding of the watch."""
    found = watch.newest
    if found is None:
        return Report('stability', OK, 'too few estimates of the natural period yet', {'estimates': watch.count})
    level, message = OK, 'the natural period of roll has not changed'
    if found.advice:
        level, message = WARN, '; '.join(advice.message for advice in found.advice)
    return Report(
        'stability',
        level,
        message,
        {
            'relative_gm': found.relative,
            'relative_gm_low': found.interval[0],
            'relative_gm_high': found.interval[1],
            'gm_m': 'not known' if isnan(found.height) else found.height,
            'period_before_s': found.period_before,
            'period_s': found.period,
            'changed_at_s': 'no change beyond chance' if found.changed_at is None else f'{found.changed_at:.1f}',
            'estimates': watch.count,
        },
    )
