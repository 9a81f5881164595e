"""The motion window: the last minute of motion in fixed memory, and the decays that end in it."""
from dataclasses import dataclass, field
from math import ceil, pi
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.motion.intake import INTAKE_REASONS, NANOSECOND, Intake
from swath_sysid.attitude.motion.segmentation import DecaySegment, find_decays, is_finished
from swath_sysid.attitude.motion.sensor_mount import Installation
from swath_sysid.attitude.motion.stamps import JUMPED_BACK, STAMP_REASONS, StampSettings
from swath_sysid.attitude.motion.trial import AXES, CHANNELS, Trial
from swath_sysid.common.errors import InputError
from swath_sysid.common.row_buffer import RowBuffer
from swath_sysid.common.signals import bin_means

COLUMNS = ('t', *CHANNELS)
"""Columns of a window: the stamp, s, and the channels of a trial."""

WINDOW_REASONS = (*STAMP_REASONS, *INTAKE_REASONS)

WATCH_SPAN = 2.0
"""s; motion is large or small over so long."""

WATCH_BLOCK = 0.25
CALM = 0.35
"""Motion below this part of the largest is worth a look for a decay that has ended."""

FIRST_LOOK = 1.0
NEXT_LOOK = 1.5
"""A decay is looked for so many seconds after the last large motion, and then ever more rarely, by this factor."""

LOOK_RATE = 50.0
"""Hz; a faster record is averaged down to this before a decay is looked for, which then takes 10 ms."""

FEWEST_CYCLES = 1.5


@dataclass(frozen=True)
class WindowSettings:
    """What a motion window holds and looks for.

    Attributes
    ----------
    window : float
        Length, s.
    max_rate : float
        Hz; memory is taken for so many samples a second, faster ones shorten the window.
    detect_decay : bool
        Whether to look for free decays that have ended.
    smallest_decay : float
        rad; a decay of a smaller first amplitude is not told.
    installation : Installation
    stamps : StampSettings
    """

    window: float = 60.0
    max_rate: float = 1000.0
    detect_decay: bool = True
    smallest_decay: float = pi / 180.0
    installation: Installation = field(default_factory=Installation)
    stamps: StampSettings = field(default_factory=StampSettings)

    def __post_init__(self):
        for name in ('window', 'max_rate', 'smallest_decay'):
            if not getattr(self, name) > 0.0:
                raise InputError(f'{name} must be positive, not {getattr(self, name)}')


@dataclass(frozen=True)
class MotionTable:
    """Rows of a motion window, as they go out and come in on ``motion/window``.

    Attributes
    ----------
    rows : ndarray, shape (N, 8)
        `COLUMNS`; NaN marks what is not measured.
    stamp_ns : int
        Of the last row; 0 where there is none.
    """

    rows: np.ndarray
    stamp_ns: int

    def trial(self, source='motion/window'):
        """The rows as a trial whose time begins at zero.

        Raises
        ------
        InputError
            The window is empty.
        """
        if not len(self.rows):
            raise InputError('the motion window is empty: check that the IMU publishes and that imu_buffer receives it')
        time, *channels = np.ascontiguousarray(self.rows.T)
        measured = {
            name: values for name, values in zip(CHANNELS, channels, strict=True) if np.isfinite(values).any()
        }
        return Trial(time=time - time[0], **measured, source=source)


@dataclass(frozen=True)
class FinishedDecay:
    """A free decay that has ended, and the window it lies in.

    Attributes
    ----------
    axis : str
    segment : DecaySegment
        In the time of ``table.trial()``.
    table : MotionTable
    """

    axis: str
    segment: DecaySegment
    table: MotionTable


class WindowStep(NamedTuple):
    """What one IMU message did to the window.

    Attributes
    ----------
    kept : bool
    reasons : tuple of str
        From `WINDOW_REASONS`: what was counted.
    finished : FinishedDecay or None
        To be published.
    """

    kept: bool
    reasons: tuple[str, ...] = ()
    finished: FinishedDecay | None = None


class MotionWindow:
    """The last samples of an IMU as the motion of the craft, in memory that does not grow.

    Pure: time is the stamps, the same messages give the same windows.

    Parameters
    ----------
    settings : WindowSettings, optional
    intake : Intake, optional
        That of the settings, where another core shares it.
    """

    def __init__(self, settings=None, intake=None):
        self.settings = settings or WindowSettings()
        self._intake = intake or Intake(self.settings.installation, self.settings.stamps)
        self.counts = dict.fromkeys(WINDOW_REASONS, 0)
        self.samples = 0
        self.recording = True
        self._rows = RowBuffer(ceil(self.settings.window * self.settings.max_rate) + 1, len(COLUMNS))
        self._watch = DecayWatch(self.settings)
        self.clear()

    @property
    def interval(self):
        """Typical time between samples, s; None before the second."""
        return self._intake.interval

    @property
    def size(self):
        """Number of rows."""
        return len(self._rows)

    @property
    def duration(self):
        """Seconds from the first to the last row."""
        rows = self._rows.last()
        return float(rows[-1, 0] - rows[0, 0]) if len(rows) else 0.0

    @property
    def described(self):
        """What the window holds, for people."""
        state = 'recording' if self.recording else 'not recording'
        held = f'{self.size} samples, {self.duration:.1f} s' if self.size else 'the window is empty'
        return f'{state}, {held}'

    @property
    def is_short_of_memory(self):
        """Whether samples come faster than memory was taken for, so that the window is shorter than asked."""
        return self.size == self._rows.capacity and self.duration < 0.95 * self.settings.window

    def clear(self):
        """Forget all rows."""
        self._rows.clear()
        self._stamp_ns = 0
        self._watch.restart()

    def record(self, on):
        """Begin anew, or keep the window as it is."""
        if on and not self.recording:
            self.clear()
        self.recording = on

    def detect_decay(self, on):
        """Look for decays that have ended, or do not."""
        self._watch.restart()
        self._watch.on = on

    def add(self, reading):
        """Take in one message.

        Parameters
        ----------
        reading : ImuReading

        Returns
        -------
        WindowStep
        """
        return self.add_taken(self._intake.take(reading))

    def add_taken(self, taken):
        """Take in what the intake made of one message.

        Parameters
        ----------
        taken : Taken

        Returns
        -------
        WindowStep
        """
        sample, reasons = taken
        for reason in reasons:
            self.counts[reason] += 1
        if JUMPED_BACK in reasons:
            self.clear()
        if sample is None:
            return WindowStep(False, reasons)
        self.samples += 1
        if not self.recording:
            return WindowStep(True, reasons)
        self._append(sample)
        return WindowStep(True, reasons, self._watch.look(sample, self))

    def table(self, since=None):
        """The rows, oldest first.

        Parameters
        ----------
        since : float, optional
            Stamp of the first row wanted, s.

        Returns
        -------
        MotionTable
        """
        rows = self._rows.last()
        if since is not None:
            rows = rows[np.searchsorted(rows[:, 0], since):]
        return MotionTable(rows.copy(), self._stamp_ns)

    def _append(self, sample):
        stamp = sample[0] * NANOSECOND
        self._rows.append((stamp, *sample[1:8]))
        self._rows.drop_below(stamp - self.settings.window)
        self._stamp_ns = sample[0]


class DecayWatch:
    """Notices, from the samples as they come, that a free decay has ended.

    Looking for one takes 10 ms, so it is done only when large motion has died down.

    Parameters
    ----------
    settings : WindowSettings
    """

    def __init__(self, settings):
        self._settings = settings
        self.on = settings.detect_decay
        self._spans = round(WATCH_SPAN / WATCH_BLOCK)
        self._blocks = max(ceil(settings.window / WATCH_BLOCK), self._spans)
        self.restart()

    def restart(self):
        """Forget what was seen and told."""
        self._watches = {axis: _AxisWatch(self._spans, self._blocks) for axis in AXES}
        self._told_until = dict.fromkeys(AXES)
        self._block_end = None

    def look(self, sample, window):
        """Take in a sample that the window holds already.

        Returns
        -------
        FinishedDecay or None
        """
        if not self.on:
            return None
        stamp, roll, pitch, roll_rate, pitch_rate = sample[:5]
        stamp *= NANOSECOND
        by_roll, by_pitch = self._watches.values()
        value = roll if roll == roll else roll_rate
        if not by_roll.low <= value <= by_roll.high:
            by_roll.widen(value)
        value = pitch if pitch == pitch else pitch_rate
        if not by_pitch.low <= value <= by_pitch.high:
            by_pitch.widen(value)
        if self._block_end is None:
            self._block_end = stamp + WATCH_BLOCK
        if stamp < self._block_end:
            return None
        self._block_end = stamp + WATCH_BLOCK
        due = [axis for axis, watch in self._watches.items() if watch.is_due(stamp)]
        return next(filter(None, (self._search(axis, window) for axis in due)), None)

    def _search(self, axis, window):
        """The newest decay about an axis that has ended and was not told before."""
        table = window.table(self._told_until[axis])
        trial = averaged(table, LOOK_RATE).trial()
        try:
            motion = trial.axis(axis)
        except InputError:
            return None
        if motion.size < 2 * LOOK_RATE * FIRST_LOOK:
            return None
        ended = [decay for decay in find_decays(motion) if self._is_worth_telling(decay, motion)]
        if not ended:
            return None
        newest = max(ended, key=lambda decay: decay.end)
        self._told_until[axis] = table.rows[0, 0] + newest.end
        return FinishedDecay(axis, newest, table)

    def _is_worth_telling(self, decay, motion):
        amplitude = decay.initial_amplitude
        if decay.quantity == 'rate':
            amplitude *= decay.period / (2.0 * pi)
        begun = decay.beginning in ('released', 'pushed')
        large = amplitude >= self._settings.smallest_decay and decay.cycles >= FEWEST_CYCLES
        return begun and large and is_finished(decay, motion)


class _AxisWatch:
    """How far one quantity reached lately, and when to look for a decay next."""

    def __init__(self, spans, blocks):
        self._spans = spans
        self._lows, self._highs = np.full(blocks, np.inf), np.full(blocks, -np.inf)
        self.low, self.high = np.inf, -np.inf
        self._reaches = np.zeros(blocks)
        self._calm_since = None
        self._wait = FIRST_LOOK

    def widen(self, value):
        """A value that may lie beyond the block's lowest and highest."""
        if value < self.low:
            self.low = value
        if value > self.high:
            self.high = value

    def is_due(self, stamp):
        """Close a block of samples; whether to look for a decay now."""
        for history, value in ((self._lows, self.low), (self._highs, self.high)):
            history[:-1] = history[1:]
            history[-1] = value
        self.low, self.high = np.inf, -np.inf
        reach = max(float(self._highs[-self._spans:].max() - self._lows[-self._spans:].min()), 0.0)
        self._reaches[:-1] = self._reaches[1:]
        self._reaches[-1] = reach
        if reach >= CALM * self._reaches.max():
            self._calm_since, self._wait = None, FIRST_LOOK
            return False
        if self._calm_since is None:
            self._calm_since = stamp
        if stamp - self._calm_since < self._wait:
            return False
        self._wait *= NEXT_LOOK
        return True


def averaged(table, rate):
    """A table with the means of its rows over even intervals, where it has more than ``rate`` rows a second.

    Parameters
    ----------
    table : MotionTable
    rate : float
        Hz.

    Returns
    -------
    MotionTable
    """
    rows = table.rows
    if len(rows) < 2:
        return table
    elapsed = rows[:, 0] - rows[0, 0]
    bins = np.floor(elapsed * rate).astype(int)
    if len(rows) <= 1.5 * (bins[-1] + 1):
        return table
    _, *means = bin_means(bins, *rows.T)
    return MotionTable(np.stack(means, axis=1), table.stamp_ns)
