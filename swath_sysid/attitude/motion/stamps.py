"""A sensor's stamps: whether they count seconds, what to leave out, and when the clock itself has moved."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.conditions import codes_in
from swath_sysid.common.errors import InputError

DUPLICATE = 'duplicate-stamp'
OUT_OF_ORDER = 'out-of-order'
STRAY = 'stray-stamp'
JUMPED_BACK, STEPPED = 'clock-jumped-back', 'clock-stepped'
GAP, LOST = 'gap', 'lost-sample'
LONG_GAP = 'gap-too-long'
RATE_CHANGED = 'rate-changed'
BURSTS = 'bursts'
STAMP_REASONS = codes_in('stamps')  #: What an order gives. What was lost is found by a sensor's clock.

NANOSECOND = 1e-9  #: s.
GAP_INTERVALS = 2.5
FOLLOWING = {True: 0.02, False: 0.1}  #: Largest relative step per sample of the tracked interval, settled or not.
SETTLING_SAMPLES = 50
#: Of an interval; a larger mean distance of stamps from the next whole interval is jitter, a shorter time none.
JITTER = 0.1
TO_RECOGNISE = 2 * SETTLING_SAMPLES  #: Samples until bursts can be recognised.
RATE_CHANGE = 1.4  #: Factor; the interval is settled when it has moved by less than its root over `SETTLING_SAMPLES`.


@dataclass(frozen=True)
class StampSettings:
    """Limits of late stamps and of gaps."""

    backward_jump: float = 1.0  #: s; a stamp less far back is late, further back the clock was set back.
    gap_limit: float = 1.0  #: s; a longer silence is a restart.

    def __post_init__(self) -> None:
        for name in ('backward_jump', 'gap_limit'):
            if not getattr(self, name) > 0.0:
                raise InputError(f'{name} must be positive, not {getattr(self, name)}')


class Placed(NamedTuple):
    """Whether a sample is in order, and the reasons to count, which may be about the previous one."""

    kept: bool
    reasons: tuple[str, ...] = ()
    stamp_ns: int = 0  #: Of a sample that is kept; later than the one before also where jitter set it back.


class StampOrder:
    """Orders the stamps of one sensor.

    A stamp that is far back or far ahead is held as suspect until the next one shows whether it was a stray packet or
    the clock has jumped; one that is a little behind, until others have followed it for longer than a gap.
    """

    def __init__(self, settings: StampSettings | None = None) -> None:
        self._settings = settings or StampSettings()
        self._last: int | None = None
        self._suspects: tuple[int, ...] = ()
        self._lags: deque[float] = deque(maxlen=SETTLING_SAMPLES)
        self._left_out = 0
        self._interval: float | None = None
        self._settled_interval: float | None = None
        self._looked_at = 0.0
        self._until_look = SETTLING_SAMPLES
        self._jitter = 0.0
        self._judged = 0

    @property
    def interval(self) -> float | None:
        """Typical time between samples, s; None before the second."""
        return self._interval

    def place(self, stamp_ns: int, arrival: float = nan) -> Placed:
        """Place the next stamp, ns, which came at a time of a steady clock, s; NaN where that is not known."""
        lag = arrival - stamp_ns * NANOSECOND
        placed = self._place(stamp_ns, lag)
        self._left_out += 1
        if placed.kept:
            self._lags.append(lag)
            self._left_out = 0
        return placed

    def _place(self, stamp_ns: int, lag: float) -> Placed:
        if self._last is None:
            self._last = stamp_ns
            return Placed(True, (), stamp_ns)
        elapsed = (stamp_ns - self._last) * NANOSECOND
        if stamp_ns == self._last or stamp_ns in self._suspects[-1:]:
            return Placed(False, (DUPLICATE,))
        if self._interval is not None and abs(elapsed) < self._settings.backward_jump:
            intervals = elapsed / self._interval
            self._jitter += (abs(intervals - round(intervals)) - self._jitter) / SETTLING_SAMPLES
            if elapsed < 0.0 and intervals > -1.0 and self._jitter > JITTER:
                self._last += 1
                return Placed(True, (), self._last)
        longest = inf if self._interval is None else max(self._settings.gap_limit, 2.0 * GAP_INTERVALS * self._interval)
        if elapsed < 0.0 or elapsed > longest:
            return self._doubt(stamp_ns, elapsed, lag)
        reasons = self._refuted() + self._judge_interval(elapsed, lag)
        self._last = stamp_ns
        return Placed(True, reasons, stamp_ns)

    def _doubt(self, stamp_ns: int, elapsed: float, lag: float) -> Placed:
        suspects, is_near = self._suspects, self._is_near(stamp_ns)
        if not suspects or stamp_ns < suspects[-1] or self._is_near(suspects[-1]) != is_near:
            reasons, self._suspects = self._refuted(), (stamp_ns,)
            return Placed(False, reasons)
        if is_near and (stamp_ns - suspects[0]) * NANOSECOND < GAP_INTERVALS * (self._interval or 0.0):
            self._suspects = *suspects, stamp_ns
            return Placed(False)
        self._last, self._suspects = stamp_ns, ()
        if elapsed < 0.0:
            return Placed(True, (JUMPED_BACK,), stamp_ns)
        # a sensor that repeated its stamps was not silent
        gap = (LONG_GAP,) if self._left_out < 2 else ()
        return Placed(True, (STEPPED,) if self._is_step(elapsed, lag) else gap, stamp_ns)

    def _is_near(self, stamp_ns: int) -> bool:
        """Whether a stamp that cannot follow is behind, by less than a clock is set back."""
        return self._last is not None and 0.0 < (self._last - stamp_ns) * NANOSECOND <= self._settings.backward_jump

    def _is_step(self, elapsed: float, lag: float) -> bool:
        """Whether the clock has jumped ahead, because a message came sooner after its stamp than any can."""
        return bool(self._lags) and lag < min(self._lags) - 0.5 * elapsed

    def _refuted(self) -> tuple[str, ...]:
        """The reasons to count for suspects that the next stamp does not follow."""
        suspects, self._suspects = self._suspects, ()
        return tuple(OUT_OF_ORDER if self._last is not None and each < self._last else STRAY for each in suspects)

    def _judge_interval(self, elapsed: float, lag: float) -> tuple[str, ...]:
        if self._interval is None:
            self._interval = self._looked_at = elapsed
            return ()
        gap: tuple[str, ...] = ()
        self._judged += 1
        if elapsed > GAP_INTERVALS * self._interval:
            # until bursts are recognised they look like gaps
            gap = (STEPPED,) if self._is_step(elapsed, lag) else (GAP,) * (self._judged >= TO_RECOGNISE)
        step = FOLLOWING[self._settled_interval is not None]
        self._interval *= min(max(elapsed / self._interval, 1.0 - step), 1.0 + step)
        changed = self._has_changed(self._interval)
        return (*gap, *([RATE_CHANGED] if changed else ()))

    def _has_changed(self, interval: float) -> bool:
        if self._settled_interval is not None:
            if _alike(interval, self._settled_interval, RATE_CHANGE):
                return False
            self._settled_interval, self._looked_at, self._until_look = None, interval, SETTLING_SAMPLES
            return True
        self._until_look -= 1
        if self._until_look == 0:
            if _alike(interval, self._looked_at, RATE_CHANGE**0.5):
                self._settled_interval = interval
            self._looked_at, self._until_look = interval, SETTLING_SAMPLES
        return False


class Bursts:
    """Spreads the stamps of samples that arrive several at once by the period of their sensor, the last of them at the
    stamp given. Within a burst the motion goes on as from one burst to the next, which it does not over a pause.
    """

    def __init__(self) -> None:
        self._recent: deque[tuple[int, float]] = deque(maxlen=2 * TO_RECOGNISE)  # stamps, ns, and what has moved
        self._values: tuple[float, ...] = ()
        self._until_look = TO_RECOGNISE
        self._place = 0
        self._spread_ns = 0
        self.size = self.period_ns = 0.0  #: Samples in a burst, zero where there are none, and the time between them.

    def place(self, stamp_ns: int, values: tuple[float, ...]) -> tuple[int, bool]:
        """The stamp of the next sample, ns, and whether bursts have just been found."""
        moved = sum(abs(now - before) for now, before in zip(values, self._values, strict=False))
        before_ns = self._recent[-1][0] if self._recent else stamp_ns
        if stamp_ns == before_ns and moved == 0.0 and self._values:
            return stamp_ns, False
        self._values = values
        self._recent.append((stamp_ns, moved if isfinite(moved) else 0.0))
        self._until_look -= 1
        was_spread = self.size > 0.0
        if self._until_look == 0:
            self._until_look = SETTLING_SAMPLES
            self.size, self.period_ns = self._look()
        if not self.size:
            return stamp_ns, False
        if not was_spread or stamp_ns - before_ns > self.period_ns / GAP_INTERVALS:
            self._place = 0
        target = stamp_ns - max(self.size - 1 - self._place, 0.0) * self.period_ns
        self._place += 1
        ahead = target - self._spread_ns - self.period_ns
        is_far = not was_spread or abs(ahead) > self.size * self.period_ns
        self._spread_ns = round(target if is_far else self._spread_ns + self.period_ns + JITTER * ahead)
        return self._spread_ns, not was_spread

    def _look(self) -> tuple[float, float]:
        """How many samples a burst has, and the time between two of them, ns; zeros without bursts."""
        stamps, moved = np.array(self._recent).T
        steps = np.diff(stamps - stamps[0])
        begins = steps > np.mean(steps) / GAP_INTERVALS
        first = np.flatnonzero(begins) + 1
        # about as many bursts as samples in one, and more than two in each
        if np.any(steps < 0.0) or GAP_INTERVALS * first.size**2 < steps.size or GAP_INTERVALS * first.size > steps.size:
            return 0.0, 0.0
        if np.median(steps[~begins]) > JITTER * np.mean(steps):
            return 0.0, 0.0
        if np.mean(moved[1:][begins]) > GAP_INTERVALS * np.mean(moved[1:][~begins]):
            return 0.0, 0.0
        number, lasted = first[-1] - first[0], stamps[first[-1]] - stamps[first[0]]
        even = stamps[first[0]] + (first - first[0]) * (lasted / number)
        if np.max(np.abs(stamps[first] - even)) > lasted / (first.size - 1):
            return 0.0, 0.0
        return number / (first.size - 1), lasted / number


def _alike(first: float, second: float, factor: float) -> bool:
    return second < factor * first and first < factor * second


MIN_RATE, MAX_RATE = 0.5, 10_000.0  #: Hz: sensors of motion lie well within.

SHORTER_UNITS = {'ms': 1e-3, 'us': 1e-6, 'ns': NANOSECOND}

LONGEST_PERIOD = 60.0  #: s: roll and pitch of small craft take a few seconds, of ships up to 30.


def check_time_base(
    time: np.ndarray, motions: Sequence[np.ndarray], source: str, column: str = 'time_s', unit: str = 's'
) -> None:
    """Reject a time (N,) that cannot be in its unit, or in which motions (N,) have an implausible period."""
    if time.size < 2:
        return
    interval = float(np.median(np.diff(time)))
    name = f"{source}: its column '{column}'"
    if interval > 1.0 / MIN_RATE:
        shorter = SHORTER_UNITS if unit == 's' else {}
        fitting = [u for u, scale in shorter.items() if MIN_RATE <= 1.0 / (interval * scale) <= MAX_RATE]
        cure = f'call it time_{" or time_".join(fitting)}, as its unit is' if fitting else 'give it its true unit'
        raise InputError(
            f'{name} has a sample every {interval:.4g} s, too seldom for the motion of a craft: '
            f'{cure}, or time_samples with a line "# sample_rate_hz: 100" above if it numbers the samples'
        )
    if interval < 1.0 / MAX_RATE:
        raise InputError(
            f'{name} has a sample every {interval:.4g} s, more often than any sensor of motion: call it '
            f'time_s if it counts seconds, or give it its true unit'
        )
    if unit == 's' and np.all(np.abs(np.diff(time) / interval % 1.0) < 1e-9) and interval == 1.0:
        periods = [period for motion in motions if (period := motion_period(time, motion)) is not None]
        if periods and min(periods) > LONGEST_PERIOD:
            raise InputError(Advice.of('time-unit', name=name, period=min(periods)).message)


def motion_period(time: np.ndarray, motion: np.ndarray) -> float | None:
    """Mean period, s, of a motion (N,), by its way up from a standard deviation below the median to one above. None
    with less than a cycle.
    """
    known = np.isfinite(motion)
    if not known.any():
        return None
    time, motion = time[known], motion[known] - np.median(motion[known])
    beyond = np.flatnonzero(np.abs(motion) > motion.std())
    side = motion[beyond] > 0.0
    upward = time[beyond[1:][side[1:] & ~side[:-1]]]
    return float((upward[-1] - upward[0]) / (upward.size - 1)) if upward.size > 1 else None
