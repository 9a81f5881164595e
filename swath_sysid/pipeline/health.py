"""Health of a node for its diagnostics: counts by reason, levels and messages; time is given by the caller."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isnan
from typing import TYPE_CHECKING, NamedTuple

from swath_sysid.attitude.motion.stamps import NANOSECOND, StampSettings
from swath_sysid.attitude.motion.window import MotionWindow
from swath_sysid.common.conditions import CONDITIONS, GROUPS, LEVELS
from swath_sysid.common.conventions import LOST_SHARE

if TYPE_CHECKING:
    from swath_sysid.attitude.identification.stability_watch import StabilityWatch
    from swath_sysid.common.judgement import Judged

OK, WARN, ERROR, STALE = range(len(LEVELS))

QOS_MISMATCH, OTHER_TYPE, SILENT, BEHIND = 'qos-mismatch', 'other-message-type', 'sensor-silent', 'behind'

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

    @classmethod
    def of(cls, name: str, found: Sequence[Finding], well: str, values: dict[str, object]) -> Report:
        """The worst level and the sentences of what was found, or that all is well."""
        level = max((each.level for each in found), default=OK)
        message = '; '.join(dict.fromkeys(each.sentence for each in found)) or well
        return cls(name, level, message, values, codes_of(found))

    def status_of(self, node: str) -> tuple[int, str, str, dict[str, str]]:
        """Level, name, message and values of a DiagnosticStatus of a node, by its full name without first slash."""
        texts = {key: f'{value:.6g}' if isinstance(value, float) else str(value) for key, value in self.values.items()}
        return self.level, f'{node}: {self.name}', self.message, texts


class Finding(NamedTuple):
    """A condition that holds, as a report tells it."""

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
    """Counts of the conditions of some groups, which of them still hold, and what to do about them."""

    def __init__(self, *groups: str):
        own = {code: row for group in groups for code, row in GROUPS[group].items()}
        self._rows = CONDITIONS | own
        self.counts = dict.fromkeys(own, 0)
        self._holding: dict[str, Finding] = {}
        self._reported_counts = dict(self.counts)
        self._grown: set[str] = set()  #: Reasons that grew before the last call of `fresh`.
        self.mismatched: set[str] = set()  #: Topics with an incompatible publisher or subscription.
        self.details: dict[str, str] = {}  #: What is reported of a reason that grows, in place of how often it did.

    def found(self, code: str, seen: str = '', **values: object) -> Finding:
        """A condition by what was ``seen``, or by the sentence of its row with its values, and with its cure."""
        row = self._rows[code]
        seen = seen or (row.sentence.format(**values) + ': ' * bool(row.sentence and row.cure))
        return Finding(LEVELS.index(row.level), code, seen + row.cure)

    def note(self, reason: str, about: str | None = None, sentence: str = '') -> None:
        """Count one more of a reason; one ``about`` something holds until that is settled."""
        self.counts[reason] += 1
        if about is not None:
            self._holding[about] = self.found(reason, f'{reason}: {f"{sentence}; " if sentence else ""}')

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
        """How much each count that is to be warned of has grown since the last call."""
        before, self._reported_counts = self._reported_counts, dict(counts)
        grown = {reason: count - before.get(reason, 0) for reason, count in counts.items()}
        grown = {reason: growth for reason, growth in grown.items() if growth > 0}
        grown = {reason: growth for reason, growth in grown.items() if self._rows[reason].unless not in grown}
        grown_before, self._grown = self._grown, set(grown)
        new = {reason for reason in grown if not before.get(reason, 0)}
        warned = {'always': set(grown), 'recurring': grown_before, 'once': new, 'never': set()}
        return {reason: growth for reason, growth in grown.items() if reason in warned[self._rows[reason].warns]}

    def grown(self, fresh: Mapping[str, int], received: int = 0) -> list[Finding]:
        """The reasons that grew, the most frequent first: how often, of which share of the messages that were
        ``received`` meanwhile where that is large, and what to do about each.
        """
        found = []
        for each in sorted(fresh, key=lambda each: -fresh[each]):
            where = f' on {", ".join(sorted(self.mismatched))}' if each == QOS_MISMATCH and self.mismatched else ''
            often = f'{fresh[each]} times lately'
            if self._rows[each].is_loss and LOST_SHARE * received < fresh[each] <= received:
                often += f', {fresh[each] / received:.0%} of the messages'
            found.append(self.found(each, f'{each}{where} ({self.details.get(each, often)}): '))
        return found

    @property
    def lasting(self) -> str:
        """What lasts of what grew until the last call of `fresh`, and what to do about it."""
        lasting = sorted(each for each in self._grown if self._rows[each].warns == 'once')
        return '; '.join(f'{each}: {self._rows[each].cure}' for each in lasting)

    @property
    def holding(self) -> list[Finding]:
        """What to do about all that still holds."""
        return list(self._holding.values())


def joined(found: Sequence[Finding], others: Iterable[Finding]) -> list[Finding]:
    """Some conditions and, of others, those that they do not tell already."""
    told = codes_of(found)
    return [*found, *(each for each in others if each.code not in told)]


def codes_of(found: Iterable[Finding]) -> tuple[str, ...]:
    """Their codes, each once."""
    return tuple(dict.fromkeys(each.code for each in found))


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
    """How the messages of one topic arrive, counting the reasons of further groups beside those of every stream."""

    def __init__(self, topic: str, *groups: str):
        super().__init__('stream', *groups)
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
                self.note('frame-id-changed')
            self._frame_id = frame_id

    def note_publishers(self, count: int, others: Iterable[str] = ()) -> None:
        """Count the appearance of a second publisher, and of one of other message types."""
        self.note_while(count > 1, 'several-publishers')
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
        return Report.of('imu', found, self._well(age, is_stopped), values)

    def _note_silence(self, now: float, now_ns: int) -> None:
        """Add the time passed by both clocks: none while that of the stamps stands still after it has gone on."""
        before = self._begun if self._reported_at is None else self._reported_at
        by_stamps = max((now_ns - self._reported_ns) * 1e-9, 0.0) if now_ns else inf
        if self._since_report and self._arrival is not None:
            self._silence = min(now - self._arrival, by_stamps)
        elif before is not None:
            self._silence += min(now - before, by_stamps)

    def _conditions(self, age: float | None, fresh: Mapping[str, int], now: float, now_ns: int) -> list[Finding]:
        """All that there is to warn of, the worst first."""
        found = []
        if age is None and self._silence > DISCOVERY:
            cause = self._holding.get(OTHER_TYPE) or self.found('no-message-yet')
            if self.topic in self.mismatched:
                cause = self.found(QOS_MISMATCH)
            found.append(cause._replace(level=ERROR, sentence=f'no message on {self.topic} yet: {cause.sentence}'))
        if SILENT in self._holding:
            found.append(self.found(SILENT, topic=self.topic, silence=self._silence))
        if not now_ns and now - (self._begun or 0.0) > DISCOVERY:
            found.append(self.found('no-clock'))
        found = joined(joined(found, self.holding), self.grown(fresh, self._since_report))
        if age is not None and now_ns:
            late = age - min(self._ages)
            if late > LARGEST_STAMP_AGE:
                found.append(self.found('messages-queued', late=late))
            elif abs(age) > LARGEST_STAMP_AGE:
                side = 'behind' if age > 0.0 else 'ahead of'
                found.append(self.found('clocks-differ', age=abs(age), side=side))
        return found

    def _well(self, age: float | None, clock_is_stopped: bool) -> str:
        """The message where there is nothing to warn of."""
        if age is None:
            return f'waiting for the first message on {self.topic}'
        if clock_is_stopped:
            return self.found('clock-stands-still', topic=self.topic).sentence
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
            level, _, message = self.found('short-of-memory', window=message)
        values: dict[str, object] = {
            'samples': window.size,
            'duration_s': window.duration,
            'recording': window.recording,
            'decays_noticed': self.decays,
            'topic': self.topic,
            'frame': window.settings.installation.frame,
            'mounting_deg': window.settings.installation.described,
        }
        return [
            self.report(now, now_ns, window.counts, window.samples, window.interval),
            Report('window', level, message, values),
        ]


class IdentifierHealth(Reasons):
    """The state of identification."""

    def __init__(self) -> None:
        super().__init__('identifier')
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
        return Report.of('identification', found, doing, values)


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
    values: dict[str, object] = {
        'relative_gm': found.relative,
        'relative_gm_low': found.interval[0],
        'relative_gm_high': found.interval[1],
        'gm_m': 'not known' if isnan(found.height) else found.height,
        'period_before_s': found.period_before,
        'period_s': found.period,
        'changed_at_s': 'no change beyond chance' if found.changed_at is None else f'{found.changed_at:.1f}',
        'estimates': watch.count,
    }
    advice = '; '.join(each.message for each in found.advice)
    return Report('stability', WARN if advice else OK, advice or 'the natural period of roll has not changed', values)
