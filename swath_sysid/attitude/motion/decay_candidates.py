"""Decay candidates: sequences of half-cycles whose double amplitudes shrink steadily.

No double amplitude grows, the loss from one to the next does not jump, and the period stays: with friction, linear,
quadratic and cubic damping, none negative, the loss per half-cycle never grows. Waves make candidates too;
`segmentation` rejects them.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress, pairwise
from statistics import median
from typing import NamedTuple

import numpy as np
import scipy  # its rooms are loaded when they are used: the buffer subscribes first

from swath_sysid.attitude.motion import turning_points
from swath_sysid.attitude.motion.turning_points import EvenSignal

#: Part of the first double amplitude below which a candidate has ended: 1.5 % carries no information.
FAINTEST_DOUBLE_AMPLITUDE = 0.015

#: Largest loss of a half-cycle over the usual one: friction keeps it, linear damping lowers it, braking raises it.
LOSS_GROWTH = 1.5

PERIOD_CHANGE = 1.25  #: Ratio by which a period may differ from those before: restoring bends it slowly.
BRIDGED_GAP = 0.15  #: Part of a half-cycle that a gap must cover to hide a turning point.
RELEASE_BAND = 0.05  #: The motion has left a turning point once it is this part of the double amplitude away.
JUMP_PERIODS = 0.05  #: A rise to it faster than the craft oscillates: it was dropped, or the record was cut.
#: A craft held at a level stays beyond this part of it: a hand wobbles by less than the rest. Motion that reaches this
#: part of a double amplitude within a period is motion like it.
HOLD_BAND = 0.5
HELD = 0.75  #: Part of the held angle from which the angle drops to `HOLD_BAND` after a release.
#: Share of a half-cycle in which an oscillation covers the way from there to its middle.
STEEP_SHARE = 0.5 - float(np.arccos(2.0 * HELD - 1.0)) / np.pi
#: Rest means within this part of the first double amplitude about a level; what breaks a candidate below it is the
#: background.
REST_BAND = 0.07
RESTING_SHARE = 0.25  #: Of the time around a decay; waves leave no craft at rest for so long.
MIN_HALF_CYCLES = 3  #: Three show two losses and one rhythm; fewer are those of a heavily damped hull.
HALF_CYCLES_FOR_REST = 6.0  #: Half-cycles that prove as much as a period of rest.
#: Half-cycles that tell a decay from waves however it began: in a record with nothing else, and amid other motion. As
#: many as prove a period of rest do if the craft rests for so many periods after them.
EVIDENT, EVIDENT_AMID_MOTION, RESTS = 12, 18, 2.0
SEVERAL = 4  #: Half-cycles over which they are compared where slow noise hides that each one is smaller.
#: Part of the first double amplitude by which the others of a released craft may be out of order where slow noise, as
#: of an attitude filter, hides that they shrink, and by which those of a decay that fills its record may.
IRREGULAR, SLOW_NOISE = 0.05, 0.02


@dataclass(frozen=True)
class DecayCandidate:
    """A decay candidate on one grid."""

    signal: EvenSignal  #: The grid it was found on, which suits its period.
    time: np.ndarray  #: (M,); of all turning points of that grid, and the record's first and last sample.
    value: np.ndarray  #: (M,); theirs.
    first: int  #: Index of its first turning point.
    last: int
    broken: bool  #: Whether something other than the noise or the record's end ended it.
    bridged: np.ndarray  #: ndarray of bool, shape (M - 1,); half-cycles that touch a gap, which carry little.

    @cached_property
    def double_amplitudes(self) -> np.ndarray:
        """Its double amplitudes, shape (last - first,)."""
        turns = self.value[self.first : self.last + 1]
        return np.abs(turns[1:] - turns[:-1])

    @property
    def weight(self) -> float:
        """Sum of its squared double amplitudes: how much it shows of the decay, above all of its beginning."""
        return float(np.sum(self.double_amplitudes**2))

    @property
    def decrement(self) -> float:
        """Mean logarithmic decrement per half-cycle over its whole half-cycles."""
        whole = self.double_amplitudes[:-1] if self.at_record_end else self.double_amplitudes
        if whole.size < 2 or whole[-1] == 0.0:
            return np.inf
        return float(np.log(whole[0] / whole[-1]) / (whole.size - 1))

    @cached_property
    def end(self) -> float:
        """Time of its last turning point, s; of a single half-cycle, when it comes near it."""
        near = self._near(self.last, self.first)[0] if self.is_single else None
        return float(self.time[self.last]) if near is None else near

    @property
    def at_record_end(self) -> bool:
        """Whether it ends with the last sample."""
        return self.last == self.time.size - 1

    @cached_property
    def release(self) -> float:
        """Time at which the motion leaves its first turning point for good, s: not that of a hand that only wobbles."""
        steep, halfway = self._steep_part
        return max(self.leaving_time(self.first), halfway - 0.5 * (halfway - steep) / STEEP_SHARE)

    @cached_property
    def centre(self) -> float:
        """Level about which it oscillates, rad or rad/s; of a single half-cycle, that of the three periods after it."""
        if not self.is_single:
            return turning_points.centre_of_decay(self.value[self.first : self.last + 1])
        after = slice(self.signal.index(self.end), self.signal.index(self.end + 3.0 * self.period) + 1)
        return float(np.median(self.signal.value[after]))

    @cached_property
    def period(self) -> float:
        """Mean period, weighted by the double amplitudes, s; by the first half-cycle where there is no whole one."""
        # the first turning point may have been held, the record's end is none
        inner = slice(self.first + 1, self.last if self.at_record_end else self.last + 1)
        if inner.stop - inner.start < 3:
            return 2.0 * self.first_half_duration
        return usual_period(self.time[inner].tolist(), self.value[inner].tolist())

    @cached_property
    def first_half_duration(self) -> float:
        """Duration of the first half-cycle by that of its steep part, s: noise and waves decide where it turns."""
        steep, halfway = self._steep_part
        return (halfway - steep) / STEEP_SHARE

    @cached_property
    def _steep_part(self) -> tuple[float, float]:
        """Times, s, from which on less than `HELD` and than half of the first half-cycle's way is left."""
        signal = self.signal
        begin, end = map(signal.index, self.time[self.first : self.first + 2].tolist())
        left = signal.values[begin : end + 1]
        high, low = self.value[self.first : self.first + 2].tolist()
        steep, halfway = (last_crossing(left, part, low, high - low) for part in (HELD, 0.5))
        # where the grid is too coarse to tell them apart, a sample
        steep = steep if steep < halfway else halfway - 1.0
        return signal.start + signal.interval * (begin + steep), signal.start + signal.interval * (begin + halfway)

    @property
    def is_single(self) -> bool:
        """Whether it is one half-cycle only."""
        return self.last == self.first + 1

    @property
    def first_half(self) -> 'DecayCandidate':
        """Its first half-cycle alone."""
        return self if self.is_single and not self.broken else replace(self, last=self.first + 1, broken=False)

    @property
    def may_be_suited(self) -> bool:
        """Whether its grid is one on which to look at its period, or at that of its first half-cycle."""
        periods = 2.0 * self.first_half_duration, self.period
        return any(turning_points.suits(self.signal, period) for period in periods)

    @property
    def is_suited(self) -> bool:
        """Whether its grid is the one on which to look at its period, and shows the part that times a half-cycle."""
        steep = (HELD - 0.5) * self.double_amplitudes[0]
        is_timed = not self.is_single or steep >= self.signal.prominence
        return is_timed and turning_points.suits(self.signal, self.period) and self.end > self.release

    def _near(self, turn: int, first: int) -> tuple[float | None, float | None]:
        """First and last time, s, near turning point ``turn`` in the half-cycle from turning point ``first`` on."""
        signal = self.signal
        begin, end = map(signal.index, self.time[first : first + 2].tolist())
        level = float(self.value[turn])
        band = max(RELEASE_BAND * abs(float(self.value[first + 1] - self.value[first])), 2.0 * signal.noise)
        near = np.flatnonzero(np.abs(signal.value[begin : end + 1] - level) <= band)
        if not near.size:
            return None, None
        return tuple(signal.start + signal.interval * (begin + at) for at in near[[0, -1]].tolist())

    def leaving_time(self, turn: int) -> float:
        """Last time near turning point ``turn`` on the way to the next, s."""
        last = self._near(turn, turn)[1]
        return float(self.time[turn] if last is None else max(self.time[turn], last))

    @property
    def leaves_in_gap(self) -> bool:
        """Whether samples are missing in the first half-cycle, not only while held before it."""
        gaps, end = self.signal.gaps, self.time[self.first + 1]
        return bool(self.bridged[self.first] and np.any((gaps[:, 0] < end) & (gaps[:, 1] > self.release)))

    @cached_property
    def arrival(self) -> float:
        """Time since when the signal had stayed on the side of the first turning point, s."""
        level = float(self.value[self.first]) - self.centre
        left = first_beyond(self._past, self.centre, -level, -HOLD_BAND) if level else len(self._past)
        return self.release - self.signal.interval * float(left)

    @cached_property
    def hold(self) -> float:
        """Periods for which the craft had stayed where it begins, beyond the half that an oscillating craft does."""
        stay = (self.release - self.arrival) / self.period - 0.5
        return stay if stay >= 0.5 else max(stay, 0.5 if self.was_dropped else 0.0)

    @cached_property
    def risen_from(self) -> int:
        """Sample from which on a signal at its level rose to the first turning point; zero where it was never there."""
        peak = self.signal.index(self.time[self.first])
        at_level = np.flatnonzero(np.abs(self._share_of_first(peak)) < 2.0 * REST_BAND)
        return int(at_level[-1]) if at_level.size else 0

    @cached_property
    def stillness(self) -> float:
        """Periods, beyond a half, for which a craft of which only the rate was measured had been at rest before it."""
        return 0.0 if self.signal.quantity == 'angle' else self.stay_within(2.0 * REST_BAND)

    def stay_within(self, part: float) -> float:
        """Periods, beyond a half, for which a signal had stayed within this part of the first turning point."""
        moving = np.flatnonzero(np.abs(self._share_of_first(self.risen_from)) >= part)
        stay = self.risen_from - (int(moving[-1]) if moving.size else 0)
        return max(stay * self.signal.interval / self.period - 0.5, 0.0)

    def _share_of_first(self, last: int) -> np.ndarray:
        """Samples up to a place, from the centre, over those of the first turning point."""
        return (self.signal.value[: last + 1] - self.centre) / (float(self.value[self.first]) - self.centre)

    @property
    def was_dropped(self) -> bool:
        """Whether it came to the first turning point faster than the craft oscillates, or the record was cut there."""
        turn, following = self.value[self.first : self.first + 2].tolist()
        far = first_beyond(self._past, turn, following - turn, 1.0 - HOLD_BAND)
        if far == len(self._past):
            return False
        arrived = min(first_beyond(self._past, turn, way, RELEASE_BAND) for way in (following - turn, turn - following))
        return bool(self.signal.interval * (far - arrived) <= JUMP_PERIODS * self.period)

    @cached_property
    def _past(self) -> Sequence[float]:
        """Samples up to the release, latest first."""
        return self.signal.values[self.signal.index(self.release) :: -1]

    @cached_property
    def rest(self) -> float:
        """Longest rest about the centre, in periods, that begins at the end or, if noise hides it, up to one later."""
        signal = self.signal
        begin, end = signal.index(self.release), signal.index(self.end)
        later = [signal.index(self.end + part * self.period) for part in (0.25, 0.5, 0.75, 1.0)]
        band = REST_BAND * float(self.double_amplitudes[0])
        longest = longest_rest(signal.values, self.centre, band, begin, (end, *later))
        return (max(longest, 1) - 1) * signal.interval / self.period

    def reach(self, periods: float) -> np.ndarray:
        """Peak to peak within so many periods around each sample, over the first double amplitude, of the signal's
        shape.
        """
        size = max(3, round(periods * self.period / self.signal.interval))
        values = self.signal.value
        highest, lowest = (f(values, size) for f in (scipy.ndimage.maximum_filter1d, scipy.ndimage.minimum_filter1d))
        return (highest - lowest) / self.double_amplitudes[0]

    @property
    def was_held_still(self) -> bool:
        """Whether the craft was dropped or had been still for half a period; a slow wave only holds it on one side."""
        begin, end = (self.signal.index(at) for at in (self.arrival, self.release))
        step = self.signal.interval / self.period
        margin = round(0.25 / step)
        held = self.reach(0.5 + step)[begin + margin : end - margin + 1]
        return bool(self.stillness > 0.0 or self.was_dropped or np.any(held <= 2.0 * REST_BAND))

    def is_evident(self, half_cycles: int) -> bool:
        """Whether it has so many half-cycles, or fewer after which the craft rests."""
        size = self.double_amplitudes.size
        return size >= half_cycles or (size >= HALF_CYCLES_FOR_REST and self.rest >= RESTS)

    @property
    def shrinks_in_the_mean(self) -> bool:
        """Whether every mean over `SEVERAL` neighbouring double amplitudes is smaller than the one before it."""
        sizes = self.double_amplitudes[: -1 if self.at_record_end else None]
        return bool(np.all(sizes[SEVERAL:] < sizes[:-SEVERAL]))

    @cached_property
    def evidence(self) -> float:
        """How much it looks like a release, in periods of rest: below one it is none."""
        return self.rest + self.hold + self.stillness + self.double_amplitudes.size / HALF_CYCLES_FOR_REST


def are_decays(candidates: Sequence[DecayCandidate], others: Sequence[DecayCandidate]) -> bool:
    """Whether candidates of one record are, together, amid more rest, in periods, than motion, in their own durations,
    that is neither theirs nor that of other decays.
    """
    largest = max(candidates, key=lambda candidate: float(candidate.double_amplitudes[0]))
    moving = largest.reach(1.0)[_apart_from((*candidates, *others), largest.signal)] > HOLD_BAND
    unexplained = largest.signal.interval * float(np.count_nonzero(moving))
    evidence = sum(candidate.evidence for candidate in candidates) / len(candidates)
    return evidence >= 1.0 + unexplained / sum(candidate.end - candidate.release for candidate in candidates)


def stands_out(candidate: DecayCandidate, decays: Sequence[DecayCandidate]) -> bool:
    """Whether a decay is more than a group of waves: by its own half-cycles, or because the craft rests for a part of
    the time that is apart from all decays, or because it was held still before this one, which is evidence enough
    without any rest.
    """
    if candidate.is_evident(EVIDENT_AMID_MOTION):
        return True
    if fill_record(decays, candidate):
        return candidate.is_evident(EVIDENT) or not candidate.hold or candidate.was_held_still
    around = candidate.reach(1.0)[_apart_from(decays, candidate.signal)]
    noise = candidate.signal.prominence / candidate.double_amplitudes[0]
    rests = float(np.quantile(around, RESTING_SHARE)) - noise
    if rests < REST_BAND:
        return True
    is_long = candidate.double_amplitudes.size > MIN_HALF_CYCLES and candidate.evidence - candidate.rest >= 1.0
    # a hand that holds a craft moves it a little
    return (is_long or rests < 2.0 * REST_BAND) and candidate.was_held_still


def fill_record(decays: Sequence[DecayCandidate], candidate: DecayCandidate) -> bool:
    """Whether the record of a candidate shows less than one of its periods apart from all decays."""
    apart = np.count_nonzero(_apart_from(decays, candidate.signal))
    return bool(apart * candidate.signal.interval < candidate.period)


def _apart_from(decays: Sequence[DecayCandidate], signal: EvenSignal) -> np.ndarray:
    """Mask of the samples more than a period away from all decays."""
    apart, time = np.ones(signal.value.size, dtype=bool), signal.time
    for decay in decays:
        apart &= (time < decay.arrival - decay.period) | (time > decay.end + decay.period)
    return apart


def last_crossing(values: Sequence[float], part: float, start: float = 0.0, way: float = 1.0) -> float:
    """Place, between samples, from which on less than a part of a way from a start is left; 0 where it always is, the
    last if more is left at the end.
    """
    last = above = len(values) - 1
    while above >= 0 and not (values[above] - start) / way >= part:
        above -= 1
    if above < 0 or above == last:
        return float(max(above, 0))
    high, low = (values[above] - start) / way, (values[above + 1] - start) / way
    return above + (high - part) / (high - low)


def first_beyond(values: Sequence[float], start: float, way: float, part: float) -> int:
    """Index of the first value that has gone more than a part of a way from a start; their number where none has."""
    return next((at for at, value in enumerate(values) if (value - start) / way > part), len(values))


def longest_rest(values: Sequence[float], level: float, band: float, earliest: int, begins: Sequence[int]) -> int:
    """Samples of the longest stretch within a band about a level, around the first of some places or from the others
    on; none before the earliest.
    """
    longest = 0
    for begin in begins:
        first = last = begin
        while last < len(values) and abs(values[last] - level) <= band:
            last += 1
        while begin == begins[0] and first > earliest and abs(values[first - 1] - level) <= band:
            first -= 1
        longest = max(longest, last - first)
    return longest


def usual_period(time: Sequence[float], value: Sequence[float]) -> float:
    """Mean period of turning points (M,), M >= 3, weighted by the double amplitudes, without those that span a gap."""
    periods = [later - each for each, later in zip(time, time[2:], strict=False)]
    weights = [abs(later - each) for each, later in pairwise(value[1:])]
    middle = turning_points.weighted_median(periods, weights)
    usual = [abs(period / middle - 1.0) < PERIOD_CHANGE - 1.0 for period in periods]
    total = sum(compress(weights, usual))
    return sum(period * weight for period, weight in compress(zip(periods, weights, strict=True), usual)) / total


class TurnedSignal(NamedTuple):
    """A motion on one grid, with what candidates are found by."""

    signal: EvenSignal
    time: np.ndarray  #: (M,); of its turning points, and the first and last sample.
    value: np.ndarray  #: (M,); theirs.
    least: float  #: Difference that is none.
    bridged: np.ndarray  #: ndarray of bool, shape (M - 1,); as of `DecayCandidate`.


def turned_signals(levels: Iterable[EvenSignal]) -> list[TurnedSignal]:
    """The turning points of a motion without long pauses, on those of its grids on which it moves."""
    found = []
    for signal in levels:
        least = signal.prominence
        if least == 0.0:
            continue
        points = turning_points.turning_points_of(signal)
        time = np.concatenate([[signal.start], points.time, [signal.end]])
        value = np.concatenate([signal.value[:1], points.value, signal.value[-1:]])
        found.append(TurnedSignal(signal, time, value, least, bridged_half_cycles(time, signal)))
    return found


def find_candidates(
    signals: Sequence[TurnedSignal], smallest: float = 0.0, half_cycles: float = 1.0, irregular: float = 0.0
) -> list[DecayCandidate]:
    """Every candidate on every grid, whether the grid suits its period or not.

    With a first double amplitude and half-cycles of no less. Double amplitudes may be out of order by the noise, or by
    ``irregular`` times the first.
    """
    candidates: list[DecayCandidate] = []
    for signal, time, value, least, bridged in signals:
        sizes = np.abs(value[1:] - value[:-1]).tolist()
        for first, last, broken in split_into_candidates(time, sizes, least, bridged, irregular):
            if 0.0 < sizes[first] >= smallest and last - first >= half_cycles:
                candidates.append(DecayCandidate(signal, time, value, first, last, broken, bridged))
    return candidates


def split_into_candidates(
    time: np.ndarray, double_amplitudes: Sequence[float], least: float, bridged: np.ndarray, irregular: float = 0.0
) -> Iterator[tuple[int, int, bool]]:
    """Maximal candidates: first and last index, and whether broken; ``bridged`` half-cycles (M - 1,) are not judged."""
    halves, skipped = (time[1:] - time[:-1]).tolist(), bridged.tolist()
    first = 0
    while first < len(double_amplitudes):
        if first + 1 < len(double_amplitudes) and double_amplitudes[first + 1] > double_amplitudes[first]:
            first += 1
            continue
        noise = max(least, irregular * double_amplitudes[first])
        last, broken = _end_of_candidate(double_amplitudes, halves, noise, skipped, first)
        yield first, last, broken
        first = last


def bridged_half_cycles(time: np.ndarray, signal: EvenSignal) -> np.ndarray:
    """Mask (M - 1,) of the half-cycles that touch a gap long enough to hide a turning point, at times (M,), s."""
    bridged = np.zeros(time.size - 1, dtype=bool)
    # three standard deviations of the smoothing
    reach = 3.0 * signal.interval
    for begin, end in signal.gaps:
        touched = (time[:-1] <= end + reach) & (time[1:] >= begin - reach)
        bridged |= touched & (end - begin > BRIDGED_GAP * np.diff(time))
    return bridged


def _end_of_candidate(
    double_amplitudes: Sequence[float], halves: Sequence[float], least: float, bridged: Sequence[bool], first: int
) -> tuple[int, bool]:
    """Index of the turning point that ends the candidate from half-cycle ``first``, and whether it was broken off."""
    losses: list[float] = []
    periods: list[float] = []
    known = first
    floor = max(least, FAINTEST_DOUBLE_AMPLITUDE * double_amplitudes[first])
    background = max(3.0 * least, REST_BAND * double_amplitudes[first])
    for at in range(first + 1, len(double_amplitudes)):
        if bridged[at]:
            continue
        loss = double_amplitudes[known] - double_amplitudes[at]
        whole = at < len(double_amplitudes) - 1
        judged = known == at - 1 and whole
        # far more than those before
        if judged and len(losses) >= 2 and loss > LOSS_GROWTH * median(losses) + least:
            return at, double_amplitudes[known] > background
        if double_amplitudes[at] < floor:
            return at, False
        if loss < -0.5 * least:
            return at, double_amplitudes[at] > background
        if judged:
            if at >= first + 2:
                period = halves[at] + halves[at - 1]
                if periods and not 1.0 / PERIOD_CHANGE < period / median(periods) < PERIOD_CHANGE:
                    return at, double_amplitudes[at] > background
                periods.append(period)
            # a record that begins in the middle of a half-cycle loses too little in it
            if known > 0:
                losses.append(loss)
        known = at
    return len(double_amplitudes), False
