"""The free decay in a record that also holds rest, pushes, disturbances and stops.

Waves make decay candidates too (see `decay_candidates`), but short and rough ones amid motion; around a decay the
craft was, or came to, rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import factorial

import numpy as np

from swath_sysid.attitude.motion import turning_points
from swath_sysid.attitude.motion.decay_candidates import (
    EVIDENT,
    HALF_CYCLES_FOR_REST,
    HELD,
    HOLD_BAND,
    IRREGULAR,
    MIN_HALF_CYCLES,
    SEVERAL,
    SLOW_NOISE,
    DecayCandidate,
    are_decays,
    fill_record,
    find_candidates,
    last_crossing,
    stands_out,
    turned_signals,
)
from swath_sysid.attitude.motion.trial import AxisMotion, axis_in_words
from swath_sysid.attitude.motion.turning_points import EvenSignal
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import noise_level

#: rad and rad/s: below it friction and the basin's motion dominate the damping (published tests start at 1 deg); what
#: moves by less from peak to peak is coupled from the other axis.
SMALLEST_AMPLITUDE = {'angle': float(np.radians(0.5)), 'rate': float(np.radians(1.25))}
ASYMMETRY = 2.2  #: Largest ratio of the first half-cycle to the usual one: it may be held, and restoring asymmetric.

#: Mean logarithmic decrement per half-cycle below which something sustains the motion; the lightest decay has 0.012.
MIN_DECREMENT = 0.004

LONGEST_FALL = 3.0  #: A release is at most this many times the drop from `HELD` to `HOLD_BAND` before it, in time.
PUSH_MEMORY_HALF_CYCLES = 2  #: Left out after a push, while more than `HOLD_BAND` of the first one is left.

#: With this many half-cycles the tail below this part of the first is left out, as it is as much the basin's motion.
PLENTY_OF_HALF_CYCLES, PLENTIFUL_TAIL = 20, 0.125

TURN = float(np.radians(30.0))  #: Change of heading of a craft that is under way.

BREAKING_PERIODS = 4.0  #: What breaks a decay grows and decays within this time.
FINISHED = 0.1  #: Part of its first amplitude at which a decay that is watched counts as over.

#: Part of the largest double amplitude from which motion is a decay of its own, or, within every such part of the
#: record, forced.
SIZABLE = 0.25

BEFORE, AFTER = 0.12, 0.3  #: Natural periods before and after the times tried that show the kink.
DEGREE = 6  #: Of the polynomials that follow the hand before the release and the hull after it.
#: Standard deviations tried of their derivatives, in parts of the held angle: per second of a hand, which wobbles about
#: once in it, and per natural period of the hull, both divided by 2 pi.
HAND_SIZES, HULL_SIZES = (0.003, 0.01, 0.03, 0.1), (1.0, 3.0, 10.0, 30.0)
CANDIDATES = 40  #: Times tried.

FORCED_MOTION, TOO_SMALL = 'forced-motion', 'too-small'  #: Codes of `explain_absence`.


@dataclass(frozen=True)
class DecaySegment:
    """A stretch of free decay."""

    start: float  #: Record time, s.
    end: float
    period: float  #: Mean, s.
    cycles: float  #: Length in periods, as far as the half-cycles stand out of the noise.
    initial_amplitude: float  #: About the trim (within given bounds the largest); rad, or rad/s of a ``rate``.
    final_amplitude: float
    trim: float
    quantity: str = 'angle'  #: ``angle`` or ``rate``: what the half-cycles were found in.
    #: ``released`` (held or dropped), ``smoothed`` (without the first half-cycle of a release), ``record-start``,
    #: ``pushed``, ``under-way`` or ``given``.
    beginning: str = 'given'
    ending: str = 'given'  #: ``record-end``, ``noise-floor``, ``faded``, ``disturbed`` or ``given``.
    advice: tuple[Advice, ...] = ()  #: What was left out or had to be chosen.

    @property
    def duration(self) -> float:
        """End minus start, s."""
        return self.end - self.start


def find_decays(motion: AxisMotion) -> tuple[DecaySegment, ...]:
    """The free decays in the angle of a record (or its rate), without overlap, the one with the most motion first. None
    where the craft turned in one of them: it was under way, as a boat that tacks.
    """
    decays = _free_decays(motion)
    if any(_turned(motion, decay) > TURN for decay in decays):
        return ()
    segments = [_segment_of(_without_the_push(candidate, decays), motion) for candidate in _apart(decays)]
    return tuple(_until_the_next(each, segments) for each in segments)


def _free_decays(motion: AxisMotion) -> list[DecayCandidate]:
    pieces = turning_points.split_at_pauses(motion)
    grids = [list(turning_points.pyramid(turning_points.even_signal(piece))) for piece in pieces]
    decays = [decay for levels in grids for decay in _unbroken(levels, _decays_among(_sizable_candidates(levels)))]
    if not decays:
        for levels in map(turning_points.steadied, grids, pieces):
            held, long = (_sizable_candidates(levels, HALF_CYCLES_FOR_REST, part) for part in (IRREGULAR, SLOW_NOISE))
            decays += _decays_among([each for each in held if each.hold])
            decays += [] if decays else _decays_among([each for each in long if fill_record([each], each)])
    return decays


def _unbroken(levels: Sequence[EvenSignal], decays: list[DecayCandidate]) -> list[DecayCandidate]:
    """Decays, and those that go on where slow noise breaks one: whose half-cycles shrink in the mean over several."""
    broken = [decay for decay in decays if decay.broken]
    if not broken:
        return decays
    longer = [
        each
        for each in _sizable_candidates(levels, EVIDENT, SLOW_NOISE)
        if each.shrinks_in_the_mean and any(_goes_on(each, other) for other in broken)
    ]
    return [*decays, *_decays_among(longer)]


def _goes_on(longer: DecayCandidate, broken: DecayCandidate) -> bool:
    """Whether it is the same release, and goes on for so long that it is no other motion."""
    is_same = abs(longer.release - broken.release) < 0.25 * broken.period
    return is_same and longer.double_amplitudes.size >= broken.double_amplitudes.size + SEVERAL


def _turned(motion: AxisMotion, decay: DecayCandidate) -> float:
    """Largest change of the craft's heading within two periods in a decay, rad."""
    if motion.heading is None:
        return 0.0
    # a gyroscope's bias is that of the whole record
    drift = np.median(np.diff(motion.heading[:, 1]) / np.diff(motion.heading[:, 0])) if len(motion.heading) > 1 else 0.0
    time = np.arange(decay.release - decay.period, decay.end + decay.period, 0.25 * decay.period)
    heading = np.interp(time, motion.heading[:, 0], motion.heading[:, 1]) - drift * time
    return float(np.abs(heading[8:] - heading[:-8]).max(initial=0.0))


def _sizable_candidates(levels: Sequence[EvenSignal], half_cycles: float = 1.0, irregular: float = 0.0):
    smallest = SMALLEST_AMPLITUDE[levels[0].quantity]
    return find_candidates(turned_signals(levels), smallest, half_cycles, irregular)


def _until_the_next(segment: DecaySegment, others: Sequence[DecaySegment]) -> DecaySegment:
    """Where another release follows so soon that the missing tail needs no warning, without the quiet after the last
    turning point, too, in which the hand may already move the craft.
    """
    if not any(0.0 <= other.start - segment.end < BREAKING_PERIODS * segment.period for other in others):
        return segment
    end = segment.start + segment.cycles * segment.period if segment.ending == 'noise-floor' else segment.end
    return replace(segment, advice=(), end=end)


def decays_or_absence(
    motion: AxisMotion, start: float | None = None, end: float | None = None, is_decay: bool = False
) -> tuple[DecaySegment, ...] | Advice:
    """`find_decays`, or the one between the bounds; the answer of `explain_absence` where nothing decays freely. With
    ``is_decay``, as with a bound, what decays for long enough is no waves.
    """
    inside = _between(motion, start, end)
    if start is not None and end is not None:
        return (_measured(inside, float(start), float(end)),)
    decays = find_decays(inside)
    is_bounded = start is not None or end is not None
    if not decays and (is_decay or is_bounded):
        decays = _known_to_decay(inside, 2 if is_bounded else EVIDENT)
    if not decays:
        return explain_absence(inside)
    if start is not None:
        return (_with_bounds(min(decays, key=lambda decay: decay.start), inside, start=float(start)),)
    if end is not None:
        return (_with_bounds(max(decays, key=lambda decay: decay.end), inside, end=float(end)),)
    return decays


def is_finished(segment: DecaySegment, motion: AxisMotion) -> bool:
    """Whether a decay found in a growing record is over: small, or ended more than a period ago."""
    fallen = segment.final_amplitude <= FINISHED * segment.initial_amplitude
    return bool(fallen or motion.time[-1] > segment.end + segment.period)


def explain_absence(motion: AxisMotion) -> Advice:
    """Say why a record holds no free decay and what to do: ``too-small``, ``forced-motion``, ``craft-turned`` or
    ``no-decay``.
    """
    signal = turning_points.even_signal(motion)
    name, reach = _name(motion), float(np.ptp(signal.value))
    if reach < 2.0 * SMALLEST_AMPLITUDE[signal.quantity]:
        return Advice.of('too-small: record', name=name, reach=_in_degrees(reach, signal.quantity))
    if keeps_oscillating(motion):
        spread = _in_degrees(float(np.std(signal.value)), signal.quantity)
        return Advice.of(FORCED_MOTION, name=name, spread=spread)
    turns = [] if motion.heading is None else [(_turned(motion, decay), decay) for decay in _free_decays(motion)]
    if any(turn > TURN for turn, _ in turns):
        turn, decay = max(turns, key=lambda each: each[0])
        return Advice.of('craft-turned', name=name, start=decay.release, end=decay.end, turn=np.degrees(turn))
    return Advice.of('no-decay', name=name, reach=_in_degrees(reach, signal.quantity))


def keeps_oscillating(motion: AxisMotion) -> bool:
    """Whether a motion oscillates from start to end, as it does in waves."""
    points = turning_points.find_turning_points(motion)
    if points.time.size < 2:
        return False
    double_amplitudes = points.double_amplitudes
    at = points.time[1:][double_amplitudes >= SIZABLE * double_amplitudes.max()]
    lulls = np.diff(np.concatenate([motion.time[:1], at, motion.time[-1:]]))
    return bool(lulls.max() <= SIZABLE * motion.duration)


def _decays_among(candidates: Sequence[DecayCandidate]) -> list[DecayCandidate]:
    """The candidates that waves did not make."""
    possible = [_rhythmic_part(each) for each in candidates if each.may_be_suited]
    possible = [each for each in possible if each.is_suited and _comes_to_trim(each) and each.evidence >= 1.0]
    free: list[DecayCandidate] = []
    while found := [candidate for candidate in possible if are_decays([candidate], free)] or _together(possible, free):
        free += found
        possible = [candidate for candidate in possible if not any(candidate is other for other in found)]
    # what does not stand out is itself motion around the others
    while (standing := [candidate for candidate in free if stands_out(candidate, free)]) != free:
        free = standing
    return free


def _together(possible: Sequence[DecayCandidate], free: Sequence[DecayCandidate]) -> list[DecayCandidate]:
    """Several releases of one record, each of which is amid the motion of the others, if that is all the motion."""
    after_rest = _apart(
        [candidate for candidate in possible if candidate.rest + candidate.hold + candidate.stillness >= HOLD_BAND]
    )
    return after_rest if len(after_rest) > 1 and are_decays(after_rest, free) else []


def _rhythmic_part(candidate: DecayCandidate) -> DecayCandidate:
    """Of a candidate without a rhythm, what follows a half-cycle of the hand that lets go, or the first half-cycle."""
    if _is_rhythmic(candidate):
        return candidate
    later = replace(candidate, first=min(candidate.first + 1, candidate.last - 1))
    is_sizable = later.double_amplitudes[0] >= SIZABLE * candidate.double_amplitudes[0]
    return later if is_sizable and later.is_evident(EVIDENT) and _is_rhythmic(later) else candidate.first_half


def _is_rhythmic(candidate: DecayCandidate) -> bool:
    """Long enough to show a rhythm, which its first two half-cycles keep, and truly decaying."""
    if candidate.double_amplitudes.size < MIN_HALF_CYCLES or candidate.decrement < MIN_DECREMENT:
        return False
    if candidate.end - candidate.release < candidate.period:
        return False
    turned, following = candidate.time[candidate.first + 1 : candidate.first + 3].tolist()
    halves = candidate.first_half_duration, following - turned
    return all(1.0 / ASYMMETRY < 2.0 * half / candidate.period < ASYMMETRY for half in halves)


def _comes_to_trim(candidate: DecayCandidate) -> bool:
    """Whether it ends nearer than it begins to where the craft is in the last third of the record, or oscillates about
    a level nearer to where it is from then on: a hand inclines it first.
    """
    signal, first = candidate.signal, candidate.value[candidate.first]
    if abs(candidate.value[candidate.last] - signal.final_level) < abs(first - signal.final_level):
        return True
    trim = float(np.median(signal.value[signal.index(candidate.release) :]))
    return not candidate.is_single and abs(candidate.centre - trim) < abs(first - trim)


def _apart(candidates: Sequence[DecayCandidate]) -> list[DecayCandidate]:
    """The candidates by decreasing weight, without those that overlap, break or are dwarfed by a better one."""
    kept: list[DecayCandidate] = []
    largest = max((candidate.double_amplitudes[0] for candidate in candidates), default=0.0)
    for candidate in sorted(candidates, key=lambda candidate: -candidate.weight):
        apart = all(
            candidate.end <= other.arrival or candidate.release >= _end_of_motion(other, candidate) for other in kept
        )
        if apart and candidate.double_amplitudes[0] >= SIZABLE * largest:
            kept.append(candidate)
    return kept


def _without_the_push(candidate: DecayCandidate, others: Sequence[DecayCandidate]) -> DecayCandidate:
    """The same decay on the grid whose noise lets it begin last, where it was pushed: less of it is still forced."""
    begin, size = candidate.release + 0.25 * candidate.period, HELD * candidate.double_amplitudes[0]
    ends = [other for other in others if abs(other.end - candidate.end) < candidate.period and not candidate.hold]
    later = [other for other in ends if other.release > begin and other.double_amplitudes[0] >= size]
    return max(later, key=lambda other: other.release, default=candidate)


def _end_of_motion(candidate: DecayCandidate, following: DecayCandidate) -> float:
    """When a candidate is over, with what broke it unless that was held, s."""
    was_still = following.hold or following.stillness
    return candidate.end + (BREAKING_PERIODS * candidate.period if candidate.broken and not was_still else 0.0)


def _segment_of(candidate: DecayCandidate, motion: AxisMotion) -> DecaySegment:
    """Cut a candidate to what is free motion."""
    first, beginning = _free_start(candidate)
    let_go = _let_go(candidate, motion) if candidate.signal.quantity == 'rate' else None
    if let_go is not None:
        first, beginning, start = candidate.first, 'released', let_go
    else:
        start = _release_time(candidate, motion) if beginning == 'released' else candidate.leaving_time(first)
    last, end, ending = _free_end(candidate, first)
    left = 100.0 * abs(candidate.value[last] - candidate.value[last - 1]) / candidate.double_amplitudes[0]
    turned = candidate.end if last == candidate.last else float(candidate.time[last])
    return DecaySegment(
        start=start,
        end=end,
        period=candidate.period,
        cycles=((end if ending == 'record-end' else turned) - start) / candidate.period,
        initial_amplitude=abs(float(candidate.value[first]) - candidate.centre),
        final_amplitude=abs(float(candidate.value[min(last, candidate.time.size - 2)]) - candidate.centre),
        trim=candidate.centre,
        quantity=candidate.signal.quantity,
        beginning=beginning,
        ending=ending,
        advice=(Advice.of('disturbed-tail', end=end, left=left),) if ending == 'disturbed' else (),
    )


def _free_start(candidate: DecayCandidate) -> tuple[int, str]:
    """Index of the turning point after which the motion is free, and how it began."""
    if candidate.leaves_in_gap and candidate.double_amplitudes.size > 1:
        return candidate.first + 1, 'under-way'
    if candidate.hold:
        return candidate.first, 'released'
    if candidate.arrival <= candidate.signal.start + candidate.signal.interval:
        return candidate.first, 'record-start'
    skipped = 0
    for count in range(1, min(PUSH_MEMORY_HALF_CYCLES, candidate.double_amplitudes.size - 1) + 1):
        if candidate.double_amplitudes[count] >= HOLD_BAND * candidate.double_amplitudes[0]:
            skipped = count
    return candidate.first + skipped, 'pushed'


def _release_time(candidate: DecayCandidate, motion: AxisMotion) -> float:
    """When the craft was let go, by the kink in its motion, s; where there is none, when it had left."""
    signal, first = candidate.signal, candidate.first
    towards = float(np.sign(candidate.value[first + 1] - candidate.value[first]))
    inside = slice(signal.index(candidate.arrival), signal.index(candidate.time[first + 1]) + 1)
    away = towards * (candidate.centre - signal.value[inside])
    # a hand that has not held it still had it elsewhere before
    since = candidate.release - signal.time[inside]
    level = float(np.median(away[(since >= 0.0) & (since <= 0.5 * candidate.period)]))
    at, later = (
        signal.start + signal.interval * (inside.start + last_crossing(away.tolist(), part * level))
        for part in (HELD, HOLD_BAND)
    )
    if not at < later:
        return candidate.release
    fall = later - at
    period = 2.0 * np.pi * fall / (np.arccos(HOLD_BAND) - np.arccos(HELD))
    earliest = max(at - LONGEST_FALL * fall, candidate.arrival, signal.start)
    return max(kink_time(motion, earliest, at - fall, period, level), signal.start)


def _let_go(candidate: DecayCandidate, motion: AxisMotion) -> float | None:
    """When a craft of which only the rate was measured was let go, s; None where it was pushed. At rest for half a
    period, it came to its largest rate within about a quarter of one, and by then half-way to more than half of it.
    """
    signal, first, period = candidate.signal, candidate.first, candidate.period
    peak, left = signal.index(candidate.time[first]), candidate.risen_from
    if not candidate.stay_within(HOLD_BAND):
        return None
    size, *halves = (
        float(signal.value[at]) - candidate.centre for at in (peak, (peak + left) // 2, (peak + left + 1) // 2)
    )
    halfway = 0.5 * sum(halves)
    rise = (peak - left) * signal.interval
    # an oscillation from an angle has sqrt(1/2) half-way, what a steady push starts a half
    if not 1.0 / ASYMMETRY < 4.0 * rise / period < ASYMMETRY or halfway / size < 0.6:
        return None
    rose = signal.start + signal.interval * left
    return kink_time(motion, rose - 0.25 * period, rose, period, abs(size))


def kink_time(motion: AxisMotion, earliest: float, latest: float, period: float, held: float) -> float:
    """The expected time, s, between two, at which a craft was let go, given its natural period, s, and the angle held.
    Until then a polynomial of a hand's size follows the motion, from then on one of the hull's with the same value and
    slope. Each time tried has the likelihood of that Gaussian process, the mean over all sizes: C. E. Rasmussen, C. K.
    I. Williams, Gaussian Processes for Machine Learning, MIT Press, 2006, section 2.7.
    """
    inside = motion.between(earliest - BEFORE * period, latest + AFTER * period)
    if not inside.size:
        return latest
    times = np.linspace(earliest, latest, CANDIDATES)
    pace = 2.0 * np.pi / period
    # over longer periods the polynomial follows a slower hand
    wobble = min(2.0 * np.pi, DEGREE * pace)
    elapsed = inside.time - times[:, None]
    hand, hull = wobble * np.minimum(elapsed, 0.0), pace * np.maximum(elapsed, 0.0)
    size = abs(held) / (pace if motion.angle is None else 1.0)
    rows, right = [], []
    for order, name in enumerate(('angle', 'rate')):
        if getattr(motion, name) is None:
            continue
        values, noise = getattr(inside, name), max(noise_level(getattr(motion, name)), 1e-5 * size * pace**order)
        level, offset = np.full_like(elapsed, 1 - order), np.full_like(elapsed, order * pace)
        columns = [level, offset, wobble * elapsed ** (1 - order)]
        for part, speed in ((hand, wobble), (hull, pace)):
            columns += [speed**order * part ** (k - order) / factorial(k - order) for k in range(2, DEGREE + 1)]
        rows.append(np.stack(columns, axis=2) * size / noise)
        right.append((values - (1 - order) * np.mean(values)) / noise)
    matrix, target = np.concatenate(rows, axis=1), np.concatenate(right)
    normal, common = matrix.transpose(0, 2, 1) @ matrix, matrix.transpose(0, 2, 1) @ target
    scales = (np.repeat([1.0, *sizes], [2, DEGREE, DEGREE - 1]) for sizes in product(HAND_SIZES, HULL_SIZES))
    evidence = np.array([_log_evidence(normal, common, scale) for scale in scales])
    likelihood = np.exp(evidence - evidence.max()).sum(axis=0)
    return float(likelihood @ times / likelihood.sum())


def _log_evidence(normal: np.ndarray, common: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Log evidence of T linear models with unit noise, up to a common constant, shape (T,). From their normal matrices
    (T, n, n) and right-hand sides (T, n); coefficients are zero within ``scale`` (n,).
    """
    scaled = np.eye(scale.size) + scale[:, None] * normal * scale
    explained = np.linalg.solve(scaled, (scale * common)[:, :, None])[:, :, 0]
    return 0.5 * (np.sum(scale * common * explained, axis=1) - np.linalg.slogdet(scaled)[1])


def _free_end(candidate: DecayCandidate, first: int) -> tuple[int, float, str]:
    """Index of the last turning point, end time (s) and kind of ending of the free motion."""
    whole = candidate.double_amplitudes[:-1] if candidate.at_record_end else candidate.double_amplitudes
    measured = ~candidate.bridged[candidate.first : candidate.first + whole.size]
    faint = np.flatnonzero((whole < PLENTIFUL_TAIL * whole.max(initial=0.0)) & measured)
    if faint.size and faint[0] >= PLENTY_OF_HALF_CYCLES:
        last = candidate.first + int(faint[0])
        return last, float(candidate.time[last]), 'faded'
    if candidate.at_record_end:
        return candidate.last, candidate.signal.record_end, 'record-end'
    if candidate.broken:
        # What breaks a candidate began before the turning point that shows it.
        last = candidate.last - 1 if candidate.last - first > 3 else candidate.last
        return last, float(candidate.time[last]), 'disturbed'
    return candidate.last, _end_of_quiet(candidate), 'noise-floor'


def _end_of_quiet(candidate: DecayCandidate) -> float:
    """Half a period (a whole one, if it creeps) after the end, or before the signal leaves its last half-cycle, s."""
    signal = candidate.signal
    settling = candidate.period if candidate.is_single else 0.5 * candidate.period
    begin, end = signal.index(candidate.end), signal.index(candidate.end + settling)
    last = abs(candidate.value[candidate.last] - candidate.centre)
    reach = max(last, 0.5 * candidate.double_amplitudes[-1], signal.prominence)
    outside = np.flatnonzero(np.abs(signal.value[begin : end + 1] - candidate.centre) > 1.2 * reach)
    return signal.start + signal.interval * (begin + int(outside[0]) if outside.size else end)


def _between(motion: AxisMotion, start: float | None, end: float | None) -> AxisMotion:
    """The samples between the given bounds, which must make sense."""
    if start is not None and end is not None and not start < end:
        raise InputError(f'the start ({start:g} s) must lie before the end ({end:g} s)')
    inside = motion.between(start, end)
    if inside.size < 8:
        raise InputError(
            f'{_name(motion)} has too few samples between the bounds of a decay ({inside.size}); '
            f'the record runs from {motion.time[0]:.1f} to {motion.time[-1]:.1f} s'
        )
    return inside


def _measured(motion: AxisMotion, start: float, end: float) -> DecaySegment:
    """The decay between bounds that the user gave."""
    signal = turning_points.even_signal(motion)
    if np.ptp(signal.value) == 0.0:
        raise InputError(f'{_name(motion)} is constant from {start:g} to {end:g} s: give a stretch in which it moves')
    points = turning_points.find_turning_points(motion)
    value = np.concatenate([signal.value[:1], points.value])
    turns = points.time.size > 1
    centre = turning_points.centre_of_decay(value) if turns else float(signal.value[-1])
    period = turning_points.mean_period(points) if turns else _period_of_relaxation(signal, centre)
    amplitudes = np.abs(value - centre)
    return DecaySegment(
        start=start,
        end=end,
        period=period,
        cycles=motion.duration / period,
        initial_amplitude=float(amplitudes.max()),
        final_amplitude=float(amplitudes[-1]) if points.time.size else 0.0,
        trim=centre,
        quantity=signal.quantity,
    )


def _period_of_relaxation(signal: EvenSignal, centre: float) -> float:
    """Natural period guessed from a motion that turns at most once, s. A critically damped hull returns to 10 % of its
    angle in 0.62 periods: (1 + w0 t) exp(-w0 t) = 0.1 at w0 t = 3.89.
    """
    away = np.abs(signal.value - centre)
    far = np.flatnonzero(away > 0.1 * away.max())
    return signal.interval * max((far[-1] - far[0] + 1) / 0.62, 2.0)


def _known_to_decay(motion: AxisMotion, half_cycles: int) -> tuple[DecaySegment, ...]:
    """The large candidates, accepted as free decays because a bound was given, or the record is said to hold one."""
    candidates = []
    for piece in turning_points.split_at_pauses(motion):
        levels = list(turning_points.pyramid(turning_points.even_signal(piece)))
        found = find_candidates(turned_signals(levels))
        found += find_candidates(turned_signals(turning_points.steadied(levels, piece)), irregular=SLOW_NOISE)
        candidates += [each for each in found if each.is_suited and each.is_evident(half_cycles)]
    largest = max((candidate.double_amplitudes[0] for candidate in candidates), default=0.0)
    large = [candidate for candidate in candidates if candidate.double_amplitudes[0] >= 0.5 * largest]
    return tuple(_segment_of(candidate, motion) for candidate in _apart(large))


def _with_bounds(
    found: DecaySegment, motion: AxisMotion, start: float | None = None, end: float | None = None
) -> DecaySegment:
    """A found decay with one bound replaced by the one given."""
    if start is not None:
        found = replace(found, start=start, beginning='given')
    if end is not None:
        found = replace(found, end=end, ending='given', advice=())
    return replace(found, cycles=motion.between(found.start, found.end).duration / found.period)


def _name(motion: AxisMotion) -> str:
    axis = axis_in_words(motion.axis, motion.installation)
    return f'the {axis} of {motion.source}' if motion.source else f'the {axis}'


def _in_degrees(value: float, quantity: str) -> str:
    return f'{np.degrees(value):.2g} {"deg" if quantity == "angle" else "deg/s"}'
