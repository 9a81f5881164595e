"""The last minute of motion in fixed memory, and the decays that end in it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import ceil, inf, nan, pi
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.decay_candidates import HALF_CYCLES_FOR_REST, HOLD_BAND, REST_BAND
from swath_sysid.attitude.motion.intake import ConvertedReading, ImuReading, Intake
from swath_sysid.attitude.motion.quality import MAX_GAP, MIN_CYCLES
from swath_sysid.attitude.motion.segmentation import DecaySegment, find_decays, is_finished
from swath_sysid.attitude.motion.stamps import BURSTS, JUMPED_BACK, NANOSECOND, StampSettings
from swath_sysid.attitude.motion.trial import AXES, CHANNELS, AxisMotion, Trial
from swath_sysid.common.conditions import codes_in
from swath_sysid.common.errors import InputError
from swath_sysid.common.row_buffer import RowBuffer
from swath_sysid.common.signals import bin_means

COLUMNS = ('t', *CHANNELS)  #: Columns of a window: the stamp, s, and the channels of a trial.

WINDOW_REASONS = codes_in('stamps', 'intake')

LOOK_INTERVAL = 1.0  #: s from one look for a decay that has ended to the next,
CALM = 0.35  #: ... while the motion of the last two of them stays within this part of all motion in the window.
SEEN_BEFORE_PUSH = 3.0  #: Periods before a decay, among them those left out after the push, that show an earlier rest.
LOOK_RATE = 50.0  #: Hz; a faster record is averaged down to this before a decay is looked for, which then takes 10 ms.


@dataclass(frozen=True)
class WindowSettings:
    """What a motion window holds and looks for."""

    window: float = 60.0  #: Length, s.
    max_rate: float = 1000.0  #: Hz; memory is reserved for this many samples a second, faster ones shorten the window.
    detect_decay: bool = True  #: Whether to look for free decays that have ended.
    smallest_decay: float = pi / 180.0  #: rad; a decay of a smaller first amplitude is not reported.
    installation: Installation = field(default_factory=Installation)
    stamps: StampSettings = field(default_factory=StampSettings)

    def __post_init__(self) -> None:
        for name in ('window', 'max_rate', 'smallest_decay'):
            if not getattr(self, name) > 0.0:
                raise InputError(f'{name} must be positive, not {getattr(self, name)}')


class NoticedDecay(NamedTuple):
    """The free decay for which a window was published by itself."""

    axis: str
    start: float  #: Stamp, s.
    end: float  #: Stamp, s.


@dataclass(frozen=True)
class MotionTable:
    """Rows of a motion window, as they are published and received."""

    rows: np.ndarray  #: (N, 8); `COLUMNS`; NaN marks what is not measured.
    stamp_ns: int  #: Of the last row; 0 where there is none.
    noticed: NoticedDecay | None = None
    installation: Installation | None = None  #: Of the sensor, where it is known.

    def trial(self, source: str = 'the motion window') -> Trial:
        """The rows as a trial whose time starts at zero."""
        if not len(self.rows):
            raise InputError('the motion window is empty: check that the IMU publishes and that imu_buffer receives it')
        time, *channels = np.ascontiguousarray(self.rows.T)
        measured = {name: values for name, values in zip(CHANNELS, channels, strict=True) if np.isfinite(values).any()}
        return Trial(time=time - time[0], **measured, source=source, installation=self.installation)


@dataclass(frozen=True)
class FinishedDecay:
    """A free decay that has ended, and the window that holds it."""

    axis: str
    segment: DecaySegment  #: In the time of ``table.trial()``.
    table: MotionTable


class WindowStep(NamedTuple):
    """What one IMU message did to the window."""

    kept: bool
    reasons: tuple[str, ...] = ()  #: From `WINDOW_REASONS`: what was counted.
    finished: FinishedDecay | None = None  #: To be published.


class MotionWindow:
    """The last samples of an IMU as the motion of the craft, in fixed memory, clocked by the stamps."""

    def __init__(self, settings: WindowSettings | None = None, intake: Intake | None = None) -> None:
        self.settings = settings or WindowSettings()
        self._intake = intake or Intake(self.settings.installation, self.settings.stamps)
        self.counts = dict.fromkeys(WINDOW_REASONS, 0)
        self.samples = 0
        self.recording = True
        self._rows = RowBuffer(self._capacity, len(COLUMNS))
        self._watch = DecayWatch(self.settings)
        self.clear()

    @property
    def interval(self) -> float | None:
        """Typical time between samples, s; None before the second."""
        return self._intake.interval

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self._rows)

    @property
    def duration(self) -> float:
        """Seconds from the first to the last row."""
        rows = self._rows.last()
        return float(rows[-1, 0] - rows[0, 0]) if len(rows) else 0.0

    @property
    def described(self) -> str:
        """What the window holds, for people."""
        state = 'recording' if self.recording else 'not recording'
        held = f'{self.size} samples, {self.duration:.1f} s' if self.size else 'the window is empty'
        return f'{state}, {held}'

    @property
    def is_short_of_memory(self) -> bool:
        """Whether samples come faster than memory was taken for, so that the window is shorter than asked."""
        return self.size == self._rows.capacity and self.duration < 0.95 * self.settings.window

    def clear(self) -> None:
        """Forget all rows."""
        self._rows.clear()
        self._stamp_ns = 0
        self._watch.restart()

    def resize(self, length: float) -> None:
        """Hold so many seconds from now on; what is there stays, as far as it fits."""
        self.settings = replace(self.settings, window=length)
        before = self._rows.last()
        self._rows = RowBuffer(self._capacity, len(COLUMNS))
        for row in before[-self._rows.capacity :]:
            self._rows.append(row)
        self._rows.drop_below(self._stamp_ns * NANOSECOND - length)

    def mount(self, installation: Installation) -> None:
        """Begin a new window, of a sensor that is mounted otherwise."""
        self.settings = replace(self.settings, installation=installation)
        self._intake = Intake(installation, self.settings.stamps)
        self.clear()

    @property
    def _capacity(self) -> int:
        return ceil(self.settings.window * self.settings.max_rate) + 1

    def record(self, on: bool) -> None:
        """Begin a new window, or keep the one there is as it is."""
        if on and not self.recording:
            self.clear()
        self.recording = on

    def detect_decay(self, on: bool) -> None:
        """Look for decays that have ended, or do not."""
        self._watch.restart()
        self._watch.on = on

    def add(self, reading: ImuReading, arrival: float = nan) -> WindowStep:
        """Add one message, which came at a time of a steady clock, s; NaN where that is not known."""
        return self.add_converted(self._intake.take(reading, arrival))

    def add_converted(self, converted: ConvertedReading) -> WindowStep:
        """Add one converted message."""
        sample, reasons = converted
        for reason in reasons:
            self.counts[reason] += 1
        if JUMPED_BACK in reasons or BURSTS in reasons:
            self.clear()
        if sample is None:
            return WindowStep(False, reasons)
        self.samples += 1
        if not self.recording:
            return WindowStep(True, reasons)
        self._stamp_ns, stamp = sample[0], sample[0] * NANOSECOND
        self._rows.append((stamp, *sample[1:8]))
        self._rows.drop_below(stamp - self.settings.window)
        return WindowStep(True, reasons, self._watch.look(stamp, self))

    def table(self, since: float | None = None) -> MotionTable:
        """The rows, oldest first, from a stamp on, s."""
        rows = self._rows.last()
        if since is not None:
            rows = rows[np.searchsorted(rows[:, 0], since) :]
        return MotionTable(rows.copy(), self._stamp_ns, installation=self.settings.installation)


class DecayWatch:
    """Notices that a free decay has ended; looking takes 10 ms, so it waits until large motion has died down."""

    def __init__(self, settings: WindowSettings) -> None:
        self._smallest = settings.smallest_decay
        self.on = settings.detect_decay
        self.restart()

    def restart(self) -> None:
        """Forget what was seen and reported."""
        self._reported_until: dict[str, float | None] = dict.fromkeys(AXES)
        self._next_look = -inf

    def look(self, stamp: float, window: MotionWindow) -> FinishedDecay | None:
        """Whether a decay has ended at a stamp, s, up to which the window reaches."""
        if not self.on or stamp < self._next_look:
            return None
        self._next_look = stamp + LOOK_INTERVAL
        return next(filter(None, (self._search(axis, window) for axis in AXES)), None)

    def _search(self, axis: str, window: MotionWindow) -> FinishedDecay | None:
        """The newest decay about an axis that has ended and was not reported before."""
        table = window.table(self._reported_until[axis])
        try:
            motion = table.trial().axis(axis)
        except InputError:
            return None
        newest = motion.primary[motion.time >= motion.time[-1] - 2.0 * LOOK_INTERVAL]
        if not np.ptp(newest) < CALM * np.ptp(motion.primary):
            return None
        coarse = averaged(table, LOOK_RATE)
        motion = motion if coarse is table else coarse.trial().axis(axis)
        # the stretch before a decay that is about to leave a full window, in time of the table
        newest_stamp, length = float(table.rows[-1, 0]), window.settings.window
        leaves = newest_stamp - length - float(table.rows[0, 0]) if window.duration > length - LOOK_INTERVAL else -inf
        ended = [decay for decay in find_decays(motion) if self._is_worth_reporting(decay, motion, leaves)]
        if not ended:
            return None
        decay = max(ended, key=lambda each: each.end)
        origin = float(table.rows[0, 0])
        self._reported_until[axis] = origin + decay.end
        noticed = NoticedDecay(axis, origin + decay.start, origin + decay.end)
        return FinishedDecay(axis, decay, replace(table, noticed=noticed))

    def _is_worth_reporting(self, decay: DecaySegment, motion: AxisMotion, leaves: float) -> bool:
        """Whether a decay is over, or what shows its start ``leaves`` the window at this time, s, before it is."""
        amplitude = decay.initial_amplitude
        if decay.quantity == 'rate':
            amplitude *= decay.period / (2.0 * pi)
        # a group of waves looks like a push, of a few half-cycles, until the next waves come, or to who saw none before
        rests = rests_after(decay, motion)
        enough = (0.5 if rests else 1.0) * HALF_CYCLES_FOR_REST
        is_seen = rests or decay.start - motion.time[0] >= SEEN_BEFORE_PUSH * decay.period
        pushed = decay.beginning == 'pushed' and decay.cycles >= enough and is_seen
        released = decay.beginning == 'released' and (decay.cycles >= MIN_CYCLES or has_returned(decay, motion))
        is_last_look = decay.cycles >= enough and decay.start - leaves < (SEEN_BEFORE_PUSH + 1.0) * decay.period
        is_due = is_last_look or is_finished(decay, motion)
        return (pushed or released) and amplitude >= self._smallest and is_due


def rests_after(decay: DecaySegment, motion: AxisMotion) -> bool:
    """Whether a craft was seen to rest for two periods after a decay."""
    after = motion.between(decay.end, None)
    quiet = 2.0 * REST_BAND * decay.initial_amplitude
    is_seen = after.size > 1 and after.time[-1] - decay.end >= 2.0 * decay.period
    return bool(is_seen and np.abs(after.primary - decay.trim).max() < quiet)


def has_returned(decay: DecaySegment, motion: AxisMotion) -> bool:
    """Whether a craft whose angle was measured was seen to rest since a decay for as long as it was held before.

    A hand that inclines it moves it by half a cycle, too, and holds it for a shorter time than it lay upright.
    """
    before = motion.between(None, decay.start)
    near = np.flatnonzero(np.abs(before.primary - decay.trim) < HOLD_BAND * decay.initial_amplitude)
    held_since = before.time[near[-1]] if near.size else motion.time[0]
    since = motion.between(decay.start, None).time
    is_seen = decay.quantity == 'angle' and np.diff(since).max(initial=0.0) < MAX_GAP * decay.period
    return bool(is_seen and since[-1] - decay.end >= decay.start - held_since)


def averaged(table: MotionTable, rate: float) -> MotionTable:
    """A table with more than ``rate`` rows per second averaged over even intervals of that rate, Hz."""
    rows = table.rows
    if len(rows) < 2:
        return table
    elapsed = rows[:, 0] - rows[0, 0]
    bins = np.floor(elapsed * rate).astype(int)
    if len(rows) <= 1.5 * (bins[-1] + 1):
        return table
    _, *means = bin_means(bins, *rows.T)
    return replace(table, rows=np.stack(means, axis=1))
