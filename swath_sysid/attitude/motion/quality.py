"""Quality gates: weaknesses of a record or a decay, found before anything is fitted to it."""

from collections.abc import Iterator, Sequence

import numpy as np
import scipy  # its rooms are loaded when they are used: the buffer subscribes first

from swath_sysid.attitude.motion.segmentation import SMALLEST_AMPLITUDE, DecaySegment, explain_absence, find_decays
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.turning_points import find_gaps, find_turning_points, mean_period
from swath_sysid.common.advice import Advice, counted
from swath_sysid.common.signals import SPIKE_NEIGHBOURS, quantum, spikes

#: One loss each for linear, quadratic and cubic damping, less the part left out at the release; given bounds may reach
#: as far beyond the decay found in them.
MIN_CYCLES = 1.5

MIN_SAMPLES = 20.0  #: Per period: the straight line between two of 20 errs by 1 % of the amplitude.
MAX_GAP = 0.25  #: Periods; a longer gap hides a turning point.
MIN_SPIKE = 0.05  #: Part of the largest amplitude that a spike must reach to bend a fit.

UNITS = {'angle': 'deg', 'rate': 'deg/s'}


def check_motion(motion: AxisMotion, decays: Sequence[DecaySegment] | None = None) -> tuple[Advice, ...]:
    """Check a whole record, and the decays in it, which `find_decays` finds where they are not given."""
    decays = find_decays(motion) if decays is None else decays
    if decays:
        return tuple(_saturation(motion, decays[0].period))
    points = find_turning_points(motion)
    return explain_absence(motion), *(_saturation(motion, mean_period(points)) if points.time.size >= 2 else ())


def check_decay(motion: AxisMotion, segment: DecaySegment) -> tuple[Advice, ...]:
    """Check a decay of a record before a model is fitted to it; `segment.advice` holds what segmentation found."""
    inside = motion.between(segment.start, segment.end)
    if inside.size < 3:
        return ()
    saturation = tuple(_saturation(inside, segment.period))
    advice = (
        *([Advice.of('too-few-cycles', cycles=segment.cycles)] if segment.cycles < MIN_CYCLES else []),
        *_size(segment),
        *_sampling(inside, segment),
        *saturation,
        *_spikes(inside),
    )
    # clipped half-cycles do not shrink, so nothing would be found between the bounds
    if 'given' in (segment.beginning, segment.ending) and not saturation:
        advice += tuple(_bounds(inside, segment))
    return advice


def _size(segment: DecaySegment) -> Iterator[Advice]:
    # published tests start at 1 deg; below half of that friction and basin motion dominate the damping
    if segment.initial_amplitude < SMALLEST_AMPLITUDE[segment.quantity]:
        yield Advice.of('too-small', size=np.degrees(segment.initial_amplitude), unit=UNITS[segment.quantity])


def _sampling(inside: AxisMotion, segment: DecaySegment) -> Iterator[Advice]:
    samples = segment.period / inside.sample_interval
    if samples < MIN_SAMPLES:
        yield Advice.of('low-rate', samples=samples, needed=MIN_SAMPLES, rate=MIN_SAMPLES / segment.period)
    gaps = find_gaps(inside, longer_than=max(MAX_GAP * segment.period, 1.5 * inside.sample_interval))
    if len(gaps):
        begin, end = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
        yield Advice.of('gaps: decay', gaps=counted(len(gaps), 'gap'), longest=end - begin, time=begin)


def _measured(motion: AxisMotion) -> dict[str, np.ndarray]:
    """Angle and rate, those that were measured."""
    return {name: getattr(motion, name) for name in UNITS if getattr(motion, name) is not None}


def _saturation(motion: AxisMotion, period: float) -> Iterator[Advice]:
    """Advice where a measured quantity is cut off at its extremes."""
    for name, value in _measured(motion).items():
        clipped, level = clipped_extremes(value, 0.5 * period / motion.sample_interval)
        if clipped >= 2:
            level, cut = np.degrees(level), counted(clipped, 'half-cycle')
            yield Advice.of('saturation', axis=motion.axis, name=name, level=level, unit=UNITS[name], half_cycles=cut)


def clipped_extremes(value: np.ndarray, longest: float) -> tuple[int, float]:
    """Count the half-cycles cut off at the largest or smallest value, and the largest magnitude of these levels. In a
    clipped half-cycle up to ``longest`` samples equal the extreme and the sample before was moving by more than three
    steps of the resolution.
    """
    count, level = 0, 0.0
    fast = 3.0 * quantum(value)
    for extreme in (value.max(), value.min()):
        at = np.concatenate([[False], value == extreme, [False]])
        begins, ends = np.flatnonzero(at[1:] & ~at[:-1]), np.flatnonzero(~at[1:] & at[:-1])
        for begin, end in zip(begins, ends, strict=True):
            entered_fast = begin >= 2 and abs(value[begin - 1] - value[begin - 2]) > fast
            # noise and rounding make two
            if 2 < end - begin <= longest and entered_fast:
                count, level = count + 1, max(level, abs(float(extreme)))
    return count, level


def _spikes(inside: AxisMotion) -> Iterator[Advice]:
    for name, value in _measured(inside).items():
        number = int(np.count_nonzero(_bending(value)))
        if number:
            yield Advice.of('spikes', axis=inside.axis, name=name, samples=counted(number, 'sample'))


def without_spikes(motion: AxisMotion) -> AxisMotion:
    """The samples of a decay without its spikes."""
    return motion.only(~np.any([_bending(value) for value in _measured(motion).values()], axis=0))


def _bending(value: np.ndarray) -> np.ndarray:
    """Mask of the spikes that are large enough to bend a fit."""
    bad = spikes(value)
    # at an end one side alone cannot tell a glitch from a release
    bad[: SPIKE_NEIGHBOURS // 2] = bad[-(SPIKE_NEIGHBOURS // 2) :] = False
    away = np.abs(value - scipy.ndimage.median_filter(value, SPIKE_NEIGHBOURS))
    return bad & (away > MIN_SPIKE * np.ptp(value[~bad]))


def _bounds(inside: AxisMotion, segment: DecaySegment) -> Iterator[Advice]:
    """Advice on bounds that the user gave: what would have been found between them?"""
    decays = find_decays(inside)
    if not decays:
        if explain_absence(inside).code == 'forced-motion':
            yield Advice.of('forced-motion: bounds', start=segment.start, end=segment.end)
        return
    found, late = decays[0], MIN_CYCLES * segment.period
    # a craft that was held was not free
    early = segment.period if found.beginning == 'released' else late
    if segment.beginning == 'given' and found.start > inside.time[0] + early:
        yield Advice.of('late-start', found=found.start, start=segment.start)
    if segment.ending == 'given' and found.ending == 'disturbed' and found.end < inside.time[-1] - late:
        yield Advice.of('disturbed-tail: bounds', found=found.end, end=segment.end)
