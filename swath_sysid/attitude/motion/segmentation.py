"""The free decay in a record that also holds rest, pushes, disturbances and stops.

Waves make falls (see `decay_candidates`) too, but short and rough ones amid motion; around a decay the craft was, or
came to, rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from swath_sysid.attitude.motion.decay_candidates import ASYMMETRY, Fall, find_falls
from swath_sysid.attitude.motion.releases import Release, find_releases
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
MIN_SWINGS = 3  #: Three swings show two losses and one rhythm; fewer are taken only where nothing else moves.

#: A fall this long, smooth and regular needs no rest around it: tank decays reach 0.002 and 0.003, seas 0.009 and 0.01.
SMOOTH_SWINGS, SMOOTH_ROUGHNESS, SMOOTH_SCATTER = 8, 0.005, 0.02

#: Nor does one this long that is smooth and regular within noise: in the seas 20 swings reached 0.023 and 0.006.
MANY_SWINGS, MANY_ROUGHNESS, MANY_SCATTER = 16, 0.015, 0.03

MAX_SEARCHED = 30.0  #: Other motion may then last this many times longer: in hours of waves anything occurs once.
WHOLE_SWINGS, WHOLE_PART = 6, 0.8  #: Nor one of so many swings that fills this part of the record: seas reached 0.75.

#: Periods of rest that prove a decay (seas reached 4.8), and how many times longer other motion may then last.
REST_WANTED, MAX_SEARCHED_WITH_REST = 5.0, 100.0

REST_NEEDED = 1.0  #: Periods of rest that prove it where other motion, per period of rest, lasts no longer.
MAX_UNEXPLAINED = 2.0  #: In no case may other motion last longer than so many times the decay.
SHORT_SCATTER = 0.045  #: Scatter of the periods, where it shows three, that such a decay may have.
REST_IN_JUMP = 1.0  #: Periods of rest that a jump to the first turning point stands for.

#: Mean logarithmic decrement per half-cycle below which something sustains the motion; the lightest decay has 0.012.
MIN_DECREMENT = 0.004

MAX_ACTIVITY_AFTER = 0.5  #: Moving part of the ten periods after a decay that has no rest after it.
HELD_PERIODS = 0.4  #: Dwelling at the first turning point that no swinging craft does: it was held there.
JUMP_PERIODS = 0.05  #: A rise to it faster than the craft swings: it was dropped, or the record was cut.

#: Rest that ends this many periods before the first turning point ended with a push; after the last, with a stop.
PUSH_PERIODS, STOP_PERIODS = 1.25, 1.0

#: Half-cycles left out after a push, as long as they cost no more than this part of the first swing.
PUSH_MEMORY_SWINGS, PUSH_MEMORY_COST = 2, 0.25

#: With this many swings the tail below this part of the first is left out, as it is as much the basin's motion.
PLENTY_OF_SWINGS, PLENTIFUL_TAIL = 20, 0.125

SMALLEST_OF_SEVERAL = 0.3  #: Part of the largest first swing below which a further fall is not a decay of its own.
FINISHED = 0.1  #: Part of its first amplitude at which a decay that is watched counts as over.

#: Forced motion: this many swings reach this part of the largest, and no longer part of the record holds none of them.
SWINGING_PART, MIN_SWINGING, LONGEST_LULL = 0.2, 10, 0.25

FORCED_MOTION = 'forced-motion'

RELEASED_PART = 0.6  #: Natural periods after a release within which its decay is recognised: the first half-cycle.
QUIET_PERIODS = 2.5  #: A release alone shows a decay where so much of the record follows it.

#: Largest and root mean square motion from a period after such a release on, over the angle released from.
LOUDEST_REST, MEAN_REST = 0.7, 0.3


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
    releases: list[Release] = []
    for piece in split_at_pauses(motion):
        falls = [fall for fall in find_falls(piece) if fall.swings[0] >= SMALLEST_SWING[fall.signal.quantity]]
        decays.extend(_free_falls(falls))
        releases.extend(find_releases(piece, SMALLEST_SWING['angle']))
    return _begun_at_releases([_segment_of(fall) for fall in _apart(decays)], releases, motion)


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


def _begun_at_releases(
    decays: list[DecaySegment], releases: list[Release], motion: AxisMotion
) -> tuple[DecaySegment, ...]:
    """The decays with each release's own beginning there, and those that only a release shows."""
    for release in releases:
        begun = release.time + RELEASED_PART * release.period
        own = [d for d in decays if release.hold_start - release.period < d.start < begun]
        followed = [d for d in own if d.end > begun]
        if not followed and any(d.start < release.time < d.end for d in decays):
            continue
        # what ended before the release was the hand's
        kept = [d for d in decays if all(d is not other for other in own)]
        if followed:
            decays = [_released(d, release) if d is followed[0] else d for d in decays if d in kept or d is followed[0]]
        elif _comes_to_rest(release, motion):
            alone = _alone(release, motion)
            large = [d for d in kept if d.initial_amplitude > alone.initial_amplitude]
            decays = [*large, alone, *(d for d in kept if d not in large)]
    return tuple(decays)


def _released(decay: DecaySegment, release: Release) -> DecaySegment:
    """A decay begun at its release."""
    gained = (decay.start - release.time) / decay.period
    return replace(
        decay,
        start=release.time,
        beginning='released',
        cycles=decay.cycles + gained,
        initial_amplitude=max(abs(release.angle - decay.trim), decay.final_amplitude),
    )


def _comes_to_rest(release: Release, motion: AxisMotion) -> bool:
    """Whether a craft that had been held for a period swings by far less from a period after its release on."""
    held, follows = release.time - release.hold_start, motion.time[-1] - release.time
    if held < release.period or follows < (1.0 + QUIET_PERIODS) * release.period:
        return False
    away = _away(motion, release, release.time + release.period, None) / abs(release.angle - release.trim)
    return bool(away.max() < LOUDEST_REST and np.sqrt(np.mean(away**2)) < MEAN_REST)


def _alone(release: Release, motion: AxisMotion) -> DecaySegment:
    """The decay of a release whose swings the motion around them hides."""
    end = min(float(motion.time[-1]), release.time + QUIET_PERIODS * release.period)
    return DecaySegment(
        start=release.time,
        end=end,
        period=release.period,
        cycles=(end - release.time) / release.period,
        initial_amplitude=abs(release.angle - release.trim),
        final_amplitude=float(_away(motion, release, end - 0.5 * release.period, end).max()),
        trim=release.trim,
        beginning='released',
        ending='noise-floor',
    )


def _away(motion: AxisMotion, release: Release, start: float, end: float | None) -> np.ndarray:
    """Angle from the trim of a release, which is found in angles only, rad."""
    return np.abs(np.asarray(motion.between(start, end).angle) - release.trim)


def _free_falls(falls: Sequence[Fall]) -> list[Fall]:
    """The falls whose own regularity, or the rest around them, shows that no waves made them."""
    rhythmic = [fall for fall in falls if _is_rhythmic(fall)]
    certain = [fall for fall in rhythmic if _is_regular(fall) or _is_settled(fall)]
    others = [fall for fall in rhythmic if not any(fall is known for known in certain) and _stands_alone(fall, certain)]
    if certain or others:
        return certain + others
    singles = [single for single in (fall.first_swing() for fall in falls) if _is_single_release(single)]
    # The craft is inclined first and released last.
    return [max(singles, key=lambda single: single.release)] if singles else []


def _is_rhythmic(fall: Fall) -> bool:
    """Long enough to show a rhythm, which its first half cycle keeps, and truly falling."""
    usual = 0.5 * fall.period
    keeps_time = usual < ASYMMETRY * fall.first_half and fall.first_half < ASYMMETRY * usual
    return fall.swings.size >= MIN_SWINGS and fall.is_suited and keeps_time and fall.decrement >= MIN_DECREMENT


def _rest(fall: Fall) -> float:
    return _rest_before(fall) + fall.rest_after(STOP_PERIODS)


def _rest_before(fall: Fall) -> float:
    return fall.rest_before(PUSH_PERIODS)


def _is_regular(fall: Fall) -> bool:
    """Longer or smoother than waves make a fall, or all that the record holds."""
    number, duration = fall.swings.size, fall.end - fall.release
    many = number >= MANY_SWINGS and fall.roughness <= MANY_ROUGHNESS and fall.scatter <= MANY_SCATTER
    smooth = number >= SMOOTH_SWINGS and fall.roughness <= SMOOTH_ROUGHNESS and fall.scatter <= SMOOTH_SCATTER
    if (many or smooth) and fall.unexplained([fall]) <= MAX_SEARCHED * duration:
        return True
    return number >= WHOLE_SWINGS and duration >= WHOLE_PART * (fall.signal.end - fall.signal.start)


def _is_settled(fall: Fall) -> bool:
    """Followed by a long rest, or begun from one without being swamped afterwards."""
    rest_after = fall.rest_after(STOP_PERIODS)
    if rest_after < REST_WANTED and not (_rest(fall) >= REST_WANTED and fall.activity_after() <= MAX_ACTIVITY_AFTER):
        return False
    return fall.unexplained([fall]) <= MAX_SEARCHED_WITH_REST * (fall.end - fall.release)


def _stands_alone(fall: Fall, certain: Sequence[Fall]) -> bool:
    """With some rest beside it, in a record in which, for that, little else moves."""
    regular = fall.whole_periods < 3 or fall.scatter <= SHORT_SCATTER
    rest = _rest(fall) + (REST_IN_JUMP if fall.rise <= JUMP_PERIODS else 0.0)
    if not regular or rest < REST_NEEDED:
        return False
    return fall.unexplained([fall, *certain]) <= min(rest, MAX_UNEXPLAINED) * (fall.end - fall.release)


def _is_single_release(fall: Fall) -> bool:
    """One that hardly overshoots, with rest before and after: the decay of a heavily damped hull."""
    return (
        fall.is_suited
        and fall.rest_after(STOP_PERIODS) >= REST_NEEDED
        and (fall.first == 0 or _was_held(fall) or _rest_before(fall) >= REST_NEEDED)
        and fall.unexplained([fall]) <= fall.end - fall.release
    )


def _was_held(fall: Fall) -> bool:
    """At its first turning point, until it was let go; or it was dropped there."""
    return fall.dwell >= HELD_PERIODS or fall.rise <= JUMP_PERIODS


def _apart(falls: Sequence[Fall]) -> list[Fall]:
    """The falls by decreasing weight, without those that a better one holds, began with or dwarfs."""
    kept: list[Fall] = []
    largest = max((fall.swings[0] for fall in falls), default=0.0)
    for fall in sorted(falls, key=lambda fall: -fall.weight):
        apart = all(fall.end <= other.arrival or fall.release >= other.end for other in kept)
        if apart and fall.swings[0] >= SMALLEST_OF_SEVERAL * largest:
            kept.append(fall)
    return kept


def _segment_of(fall: Fall) -> DecaySegment:
    """Cut a fall to what is free motion."""
    first, beginning = _free_start(fall)
    last, end, ending = _free_end(fall, first)
    start = fall.leaving_time(first)
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
    if _was_held(fall):
        return fall.first, 'released'
    if fall.arrival <= fall.signal.start + fall.signal.interval:
        return fall.first, 'record-start'
    if fall.first == 1 and _rest_before(fall) < REST_NEEDED:
        return fall.first, 'under-way'
    skipped = 0
    for count in range(1, min(PUSH_MEMORY_SWINGS, fall.swings.size - 1) + 1):
        if fall.swings[count] >= (1.0 - PUSH_MEMORY_COST) * fall.swings[0]:
            skipped = count
    return fall.first + skipped, 'pushed'


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
    return tuple(_segment_of(fall) for fall in _apart(large))


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
