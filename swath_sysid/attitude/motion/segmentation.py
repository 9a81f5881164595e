"""The free decay in a record that also holds rest, pushes, disturbances and stops.

Waves make falls (see `decay_candidates`) too, but short and rough ones amid motion; around a decay the craft was, or
came to, rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.motion.decay_candidates import ASYMMETRY, Fall, find_falls
from swath_sysid.attitude.motion.releases import kink_time
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.turning_points import (
    EvenSignal,
    centre_of_decay,
    even_signal,
    find_turning_points,
    mean_period,
    prominence_of,
    split_at_pauses,
)
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError

# Figures on waves are from 100 simulated seas of 10 minutes (JONSWAP, hulls of every damping) and two measured ones,
# those on decays from two tank models. Of 300 further seas one passes for a decay: a high group before a long lull.
#: rad and rad/s, peak to peak: smaller motion is coupled from the other axis.
SMALLEST_SWING = {'angle': float(np.radians(0.4)), 'rate': float(np.radians(1.0))}

SMALLEST_REACH = 2.5  #: A record without a decay within this many times that (1 deg) is too small.
MIN_SWINGS = 3  #: Three swings show two losses and one rhythm; fewer are those of a heavily damped hull.

#: Mean logarithmic decrement per half-cycle below which something sustains the motion; the lightest decay has 0.012.
MIN_DECREMENT = 0.004

EARLIEST, LATEST = 0.25, 0.05  #: Natural periods about the first of these times between which a release is sought.
HELD, FALLEN = 0.75, 0.5  #: Parts of its angle between which a release is the first to fall.
#: Half-cycles left out after a push, as long as they cost no more than this part of the first swing.
PUSH_MEMORY_SWINGS, PUSH_MEMORY_COST = 2, 0.25

#: With this many swings the tail below this part of the first is left out, as it is as much the basin's motion.
PLENTY_OF_SWINGS, PLENTIFUL_TAIL = 20, 0.125

BREAKING_PERIODS = 4.0  #: What breaks a decay grows and decays within this time.
SMALLEST_OF_SEVERAL = 0.3  #: Part of the largest first swing below which a further fall is not a decay of its own.
FINISHED = 0.1  #: Part of its first amplitude at which a decay that is watched counts as over.

#: Forced motion: this many swings reach this part of the largest, and no longer part of the record holds none of them.
SWINGING_PART, MIN_SWINGING, LONGEST_LULL = 0.2, 10, 0.25

FORCED_MOTION = 'forced-motion'


@dataclass(frozen=True)
class DecaySegment:
    """A stretch of free decay."""

    start: float  #: Record time, s.
    end: float
    period: float  #: Mean, s.
    cycles: float  #: Length in periods, as far as the swings stand out of the noise.
    initial_amplitude: float  #: About the trim (within given bounds the largest); rad, or rad/s of a ``rate``.
    final_amplitude: float
    trim: float
    quantity: str = 'angle'  #: ``angle`` or ``rate``: what the swings were found in.
    #: ``released`` (held or dropped), ``record-start``, ``pushed``, ``under-way`` or ``given``.
    beginning: str = 'given'
    ending: str = 'given'  #: ``record-end``, ``noise-floor``, ``faded``, ``disturbed`` or ``given``.
    advice: tuple[Advice, ...] = ()  #: What was left out or had to be chosen.

    @property
    def duration(self) -> float:
        """End minus start, s."""
        return self.end - self.start


def find_decays(motion: AxisMotion) -> tuple[DecaySegment, ...]:
    """The free decays in the angle of a record (or its rate), without overlap, the one with the most motion first."""
    decays: list[Fall] = []
    for piece in split_at_pauses(motion):
        falls = [fall for fall in find_falls(piece) if fall.swings[0] >= SMALLEST_SWING[fall.signal.quantity]]
        decays.extend(_free_falls(falls))
    return tuple(_segment_of(fall, motion) for fall in _apart(decays))


def find_decay(motion: AxisMotion, start: float | None = None, end: float | None = None) -> DecaySegment:
    """Find the best free decay of a record, or measure the one between given bounds, s of record time.

    A missing bound is found: the end of the first decay after ``start``, the start of the last before ``end``.
    """
    found = decay_or_absence(motion, start, end)
    if isinstance(found, Advice):
        raise InputError(found.message, found.code)
    return found


def decay_or_absence(motion: AxisMotion, start: float | None = None, end: float | None = None) -> DecaySegment | Advice:
    """As `find_decay`, but the answer of `explain_absence` where nothing decays freely."""
    inside = _between(motion, start, end)
    if start is not None and end is not None:
        return _measured(inside, float(start), float(end))
    decays = find_decays(inside)
    if not decays and (start is not None or end is not None):
        decays = _within_a_bound(inside)
    if not decays:
        return explain_absence(inside)
    if start is not None:
        return _with_bounds(min(decays, key=lambda decay: decay.start), inside, start=float(start))
    if end is not None:
        return _with_bounds(max(decays, key=lambda decay: decay.end), inside, end=float(end))
    return _best_of(decays)


def is_finished(segment: DecaySegment, motion: AxisMotion) -> bool:
    """Whether a decay found in a growing record is over: disturbed, faded, small, or more than a period ago."""
    over = segment.ending in ('noise-floor', 'faded', 'disturbed')
    fallen = segment.final_amplitude <= FINISHED * segment.initial_amplitude
    return bool(over or fallen or motion.time[-1] > segment.end + segment.period)


def explain_absence(motion: AxisMotion) -> Advice:
    """Say why a record holds no free decay and what to do: ``too-small``, ``forced-motion`` or ``no-decay``."""
    signal = even_signal(motion)
    name, reach = _name(motion), float(np.ptp(signal.value))
    if reach < SMALLEST_REACH * SMALLEST_SWING[signal.quantity]:
        return Advice.of('too-small: record', name=name, reach=_in_degrees(reach, signal.quantity))
    if keeps_swinging(motion):
        spread = _in_degrees(float(np.std(signal.value)), signal.quantity)
        return Advice.of(FORCED_MOTION, name=name, spread=spread)
    return Advice.of('no-decay', name=name, reach=_in_degrees(reach, signal.quantity))


def keeps_swinging(motion: AxisMotion) -> bool:
    """Whether a motion oscillates from start to end, as it does in waves."""
    points = find_turning_points(motion)
    if points.time.size <= MIN_SWINGING:
        return False
    swings = points.swings
    at = points.time[1:][swings >= SWINGING_PART * swings.max()]
    lulls = np.diff(np.concatenate([motion.time[:1], at, motion.time[-1:]]))
    return bool(at.size >= MIN_SWINGING and lulls.max() <= LONGEST_LULL * motion.duration)


def _free_falls(falls: Sequence[Fall]) -> list[Fall]:
    """The falls that no waves made."""
    possible = [fall if _is_rhythmic(fall) else fall.first_swing() for fall in falls]
    possible = [fall for fall in possible if fall.is_suited and _comes_to_trim(fall)]
    free: list[Fall] = []
    while found := [fall for fall in possible if fall.is_free(free)]:
        free += found
        possible = [fall for fall in possible if not any(fall is other for other in found)]
    return free


def _is_rhythmic(fall: Fall) -> bool:
    """Long enough to show a rhythm, which its first half cycle keeps, and truly falling."""
    usual = 0.5 * fall.period
    keeps_time = usual < ASYMMETRY * fall.first_half and fall.first_half < ASYMMETRY * usual
    return fall.swings.size >= MIN_SWINGS and keeps_time and fall.decrement >= MIN_DECREMENT


def _comes_to_trim(fall: Fall) -> bool:
    """Whether it ends nearer to where the craft is in the last third of the record: a hand inclines it first."""
    trim = float(np.median(fall.signal.value[-(fall.signal.value.size // 3 + 1) :]))
    return abs(fall.value[fall.last] - trim) < abs(fall.value[fall.first] - trim)


def _apart(falls: Sequence[Fall]) -> list[Fall]:
    """The falls by decreasing weight, without those that a better one holds, began with, dwarfs or was broken by."""
    kept: list[Fall] = []
    largest = max((fall.swings[0] for fall in falls), default=0.0)
    for fall in sorted(falls, key=lambda fall: -fall.weight):
        apart = all(fall.end <= other.arrival or fall.release >= _end_of_motion(other, fall) for other in kept)
        if apart and fall.swings[0] >= SMALLEST_OF_SEVERAL * largest:
            kept.append(fall)
    return kept


def _end_of_motion(fall: Fall, following: Fall) -> float:
    """When a fall is over, with what broke it unless that was held, s."""
    return fall.end + (BREAKING_PERIODS * fall.period if fall.broken and not following.hold else 0.0)


def _segment_of(fall: Fall, motion: AxisMotion) -> DecaySegment:
    """Cut a fall to what is free motion."""
    first, beginning = _free_start(fall)
    last, end, ending = _free_end(fall, first)
    start = _release_time(fall, motion) if beginning == 'released' else fall.leaving_time(first)
    left = 100.0 * abs(fall.value[last] - fall.value[last - 1]) / fall.swings[0]
    reliable_end = end if ending == 'record-end' else fall.end if last == fall.last else float(fall.time[last])
    return DecaySegment(
        start=start,
        end=end,
        period=fall.period,
        cycles=(reliable_end - start) / fall.period,
        initial_amplitude=abs(float(fall.value[first]) - fall.centre),
        final_amplitude=abs(float(fall.value[min(last, fall.time.size - 2)]) - fall.centre),
        trim=fall.centre,
        quantity=fall.signal.quantity,
        beginning=beginning,
        ending=ending,
        advice=(Advice.of('disturbed-tail', end=end, left=left),) if ending == 'disturbed' else (),
    )


def _free_start(fall: Fall) -> tuple[int, str]:
    """Index of the turning point after which the motion is free, and how it began."""
    if fall.leaves_in_gap(fall.first) and fall.swings.size > 1:
        return fall.first + 1, 'under-way'
    if fall.hold:
        return fall.first, 'released'
    if fall.arrival <= fall.signal.start + fall.signal.interval:
        return fall.first, 'record-start'
    skipped = 0
    for count in range(1, min(PUSH_MEMORY_SWINGS, fall.swings.size - 1) + 1):
        if fall.swings[count] >= (1.0 - PUSH_MEMORY_COST) * fall.swings[0]:
            skipped = count
    return fall.first + skipped, 'pushed'


def _release_time(fall: Fall, motion: AxisMotion) -> float:
    """When the craft was let go, by the kink in its motion, s; where there is none, when it had left."""
    signal, towards = fall.signal, float(np.sign(fall.value[fall.first + 1] - fall.value[fall.first]))
    inside = slice(signal.index(fall.arrival), signal.index(fall.time[fall.first + 1]) + 1)
    time, away = signal.time[inside], towards * (fall.centre - signal.value[inside])
    level = float(np.median(away[time <= fall.release]))
    below = np.flatnonzero((time > fall.time[fall.first]) & (away < FALLEN * level))
    above = np.flatnonzero(away[: below[0]] >= HELD * level) if below.size else below
    if not above.size:
        return fall.release
    at, later = (
        np.interp(part * level, away[[last + 1, last]], time[[last + 1, last]])
        for part, last in ((HELD, above[-1]), (FALLEN, below[0] - 1))
    )
    period = 2.0 * np.pi * (later - at) / (np.arccos(FALLEN) - np.arccos(HELD))
    earliest = max(at - EARLIEST * period, fall.arrival)
    found = kink_time(motion, earliest, at + LATEST * period, period, -towards * level)
    return fall.release if found is None else found


def _free_end(fall: Fall, first: int) -> tuple[int, float, str]:
    """Index of the last turning point, end time (s) and kind of ending of the free motion."""
    whole = fall.swings[:-1] if fall.at_record_end else fall.swings
    faint = np.flatnonzero(
        (whole < PLENTIFUL_TAIL * whole.max(initial=0.0)) & ~fall.bridged[fall.first : fall.first + whole.size]
    )
    if faint.size and faint[0] >= PLENTY_OF_SWINGS:
        last = fall.first + int(faint[0])
        return last, float(fall.time[last]), 'faded'
    if fall.at_record_end:
        return fall.last, fall.signal.record_end, 'record-end'
    if fall.broken:
        # What breaks a fall began before the turning point that shows it.
        last = fall.last - 1 if fall.last - first > 3 else fall.last
        return last, float(fall.time[last]), 'disturbed'
    return fall.last, _end_of_quiet(fall), 'noise-floor'


def _end_of_quiet(fall: Fall) -> float:
    """Half a period (a whole one, if it creeps) after the end, or before the signal leaves its last swing, s."""
    signal = fall.signal
    settling = fall.period if fall.is_single else 0.5 * fall.period
    begin, end = signal.index(fall.end), signal.index(fall.end + settling)
    reach = max(abs(fall.value[fall.last] - fall.centre), 0.5 * fall.swings[-1], prominence_of(signal))
    outside = np.flatnonzero(np.abs(signal.value[begin : end + 1] - fall.centre) > 1.2 * reach)
    return signal.start + signal.interval * (begin + int(outside[0]) if outside.size else end)


def _between(motion: AxisMotion, start: float | None, end: float | None) -> AxisMotion:
    """The samples between the given bounds, which must make sense."""
    if start is not None and end is not None and not start < end:
        raise InputError(f'the start ({start:g} s) must lie before the end ({end:g} s)')
    inside = motion.between(start, end)
    if inside.size < 8:
        given = start is not None or end is not None
        bounds = f' between {_bound(start, "its start")} and {_bound(end, "its end")}' if given else ''
        raise InputError(
            f'{_name(motion)} has too few samples{bounds} for a decay ({inside.size}); '
            f'the record runs from {motion.time[0]:.1f} to {motion.time[-1]:.1f} s'
        )
    return inside


def _bound(value: float | None, otherwise: str) -> str:
    return otherwise if value is None else f'{value:g} s'


def _measured(motion: AxisMotion, start: float, end: float) -> DecaySegment:
    """The decay between bounds that the user gave."""
    signal = even_signal(motion)
    if np.ptp(signal.value) == 0.0:
        raise InputError(f'{_name(motion)} is constant from {start:g} to {end:g} s: give a stretch in which it moves')
    points = find_turning_points(motion)
    value = np.concatenate([signal.value[:1], points.value])
    turns = points.time.size > 1
    centre = centre_of_decay(value) if turns else float(signal.value[-1])
    period = mean_period(points) if turns else _period_of_relaxation(signal, centre)
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
    """Natural period guessed from a motion that turns at most once, s.

    A critically damped hull falls to 10 % of its angle in 0.62 periods: (1 + w0 t) exp(-w0 t) = 0.1 at w0 t = 3.89.
    """
    away = np.abs(signal.value - centre)
    far = np.flatnonzero(away > 0.1 * away.max())
    return signal.interval * max((far[-1] - far[0] + 1) / 0.62, 2.0)


def _within_a_bound(motion: AxisMotion) -> tuple[DecaySegment, ...]:
    """The large falls, accepted as free decays because the user gave a bound."""
    falls = [
        fall
        for piece in split_at_pauses(motion)
        for fall in find_falls(piece)
        if fall.is_suited and fall.swings.size >= 2
    ]
    largest = max((fall.swings[0] for fall in falls), default=0.0)
    large = [fall for fall in falls if fall.swings[0] >= 0.5 * largest]
    return tuple(_segment_of(fall, motion) for fall in _apart(large))


def _with_bounds(
    found: DecaySegment, motion: AxisMotion, start: float | None = None, end: float | None = None
) -> DecaySegment:
    """A found decay with one bound replaced by the one given."""
    if start is not None:
        found = replace(found, start=start, beginning='given')
    if end is not None:
        found = replace(found, end=end, ending='given', advice=())
    return replace(found, cycles=motion.between(found.start, found.end).duration / found.period)


def _best_of(decays: Sequence[DecaySegment]) -> DecaySegment:
    """The best decay, with advice about the others."""
    best = decays[0]
    if len(decays) == 1:
        return best
    others = ', '.join(f'{decay.start:.1f} to {decay.end:.1f} s' for decay in decays[1:4])
    several = Advice.of('several-decays', number=len(decays), start=best.start, end=best.end, others=others)
    return replace(best, advice=(*best.advice, several))


def _name(motion: AxisMotion) -> str:
    return f'the {motion.axis} of {motion.source}' if motion.source else f'the {motion.axis}'


def _in_degrees(value: float, quantity: str) -> str:
    return f'{np.degrees(value):.2g} {"deg" if quantity == "angle" else "deg/s"}'
