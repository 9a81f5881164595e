"""Quality gates: weaknesses of a record or a decay, found before anything is fitted to it."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import median_filter

from swath_sysid.attitude.motion.segmentation import DecaySegment, explain_absence, find_decays
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.turning_points import even_signal, find_gaps, find_turning_points, mean_period
from swath_sysid.common.advice import Advice, counted
from swath_sysid.common.signals import SPIKE_NEIGHBOURS, quantum, spikes

#: Four swings, less the part of the first that is left out at the release: one loss for each of linear, quadratic and
#: cubic damping.
MIN_CYCLES = 1.75

#: rad, rad/s. Of the first swing: published tests begin at 1 deg, and below half of that friction and the basin's own
#: motion dominate the damping.
MIN_AMPLITUDE = {'angle': np.radians(0.5), 'rate': np.radians(1.0)}

#: First amplitude over the standard deviation of the noise; at 5 the noise of one sample hides the fourth swing of a
#: hull with a tenth of critical damping.
MIN_OVER_NOISE = 5.0

MIN_SAMPLES = 20.0  #: A period: the straight line between two of 20 errs by 1 % of the amplitude.
MAX_GAP = 0.25  #: Periods; a longer gap hides a turning point.

#: Sample intervals between two samples from which a record has a gap: single losses harm nothing.
MISSING_SAMPLES = 5.0

MIN_STEPS = 50.0  #: Resolution steps in the first amplitude. At 50 rounding alone is noise of 0.6 %.
SHORTEST_CLIP = 4  #: Equal samples at an extreme; noise and rounding make two, rarely three.
MIN_SPIKE = 0.05  #: Part of the largest swing that a spike must reach to bend a fit.

#: Periods by which given bounds may reach beyond the decay that is found in them: what is left out after a push, and
#: before a disturbance.
BOUNDS_TOLERANCE = 1.6

UNITS = {'angle': 'deg', 'rate': 'deg/s'}


def check_motion(motion: AxisMotion, decays: Sequence[DecaySegment] | None = None) -> tuple[Advice, ...]:
    """Check a whole record, and the decays in it, which `find_decays` finds where they are not given."""
    decays = find_decays(motion) if decays is None else decays
    advice = [] if decays else [explain_absence(motion)]
    gaps = find_gaps(motion, MISSING_SAMPLES * motion.sample_interval if motion.size > 2 else None)
    if len(gaps):
        begin, end = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
        advice.append(
            Advice(
                'gaps',
                f'the {motion.axis} has {counted(len(gaps), "gap")}, the longest of {end - begin:.2g} s at '
                f'{begin:.1f} s: look for lost messages, and keep them out of the decay',
            )
        )
    return (*advice, *_saturation(motion, decays[0].period if decays else _usual_period(motion)))


def check_decay(motion: AxisMotion, segment: DecaySegment) -> tuple[Advice, ...]:
    """Check a decay of a record before a model is fitted to it; `segment.advice` holds what segmentation found."""
    inside = motion.between(segment.start, segment.end)
    if inside.size < 3:
        return ()
    saturation = tuple(_saturation(inside, segment.period))
    advice = (
        *_cycles(segment),
        *_size(inside, segment),
        *_sampling(inside, segment),
        *saturation,
        *_resolution(inside, segment),
        *_spikes(inside),
    )
    # swings that are cut off do not fall, so nothing would be found between the bounds
    if 'given' in (segment.beginning, segment.ending) and not saturation:
        advice += tuple(_bounds(inside, segment))
    return advice


def _cycles(segment: DecaySegment) -> Iterator[Advice]:
    if segment.cycles < MIN_CYCLES:
        yield Advice(
            'too-few-cycles',
            f'the decay shows only {segment.cycles:.1f} cycles, too few to show how the damping depends on the '
            'amplitude (that takes two): release from a larger angle, fit several trials jointly, or choose an '
            'equation with linear damping',
        )


def _size(inside: AxisMotion, segment: DecaySegment) -> Iterator[Advice]:
    noise, unit, size = even_signal(inside).noise, UNITS[segment.quantity], segment.initial_amplitude
    begins = 'the decay begins with an amplitude of'
    if size < MIN_AMPLITUDE[segment.quantity]:
        yield Advice(
            'too-small',
            f'{begins} only {np.degrees(size):.2g} {unit}, where friction and the basin dominate the damping: release '
            'from 3 deg or more',
        )
    elif size < MIN_OVER_NOISE * noise:
        yield Advice(
            'too-small',
            f'{begins} {np.degrees(size):.2g} {unit}, only {size / noise:.1f} times the noise of '
            f'{np.degrees(noise):.2g} {unit}: release from a larger angle, or use a quieter sensor',
        )


def _sampling(inside: AxisMotion, segment: DecaySegment) -> Iterator[Advice]:
    samples = segment.period / inside.sample_interval
    if samples < MIN_SAMPLES:
        yield Advice(
            'low-rate',
            f'the record has {samples:.1f} samples a period, and {MIN_SAMPLES:g} are needed to follow the motion: '
            f'record at {MIN_SAMPLES / segment.period:.3g} Hz or more',
        )
    gaps = find_gaps(inside, longer_than=max(MAX_GAP * segment.period, 1.5 * inside.sample_interval))
    if len(gaps):
        longest = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
        yield Advice(
            'gaps',
            f'the decay has {counted(len(gaps), "gap")} longer than a quarter of its period, the longest of '
            f'{np.ptp(longest):.2g} s at {longest[0]:.1f} s: the fit bridges this, but record again if the first '
            'cycles are missing',
        )


def _measured(motion: AxisMotion) -> dict[str, np.ndarray]:
    """Angle and rate, those that were measured."""
    return {name: getattr(motion, name) for name in UNITS if getattr(motion, name) is not None}


def _saturation(motion: AxisMotion, period: float) -> Iterator[Advice]:
    """Advice where a measured quantity is cut off at its extremes."""
    for name, value in _measured(motion).items() if np.isfinite(period) else ():
        clipped, level = clipped_extremes(value, 0.5 * period / motion.sample_interval)
        if clipped >= 2:
            yield Advice(
                'saturation',
                f'the {motion.axis} {name} is cut off at {np.degrees(level):.3g} {UNITS[name]} in '
                f'{counted(clipped, "swing")}: the sensor ends there; set a wider range, or release from a smaller '
                'angle',
            )


def clipped_extremes(value: np.ndarray, longest: float) -> tuple[int, float]:
    """Count the half-cycles cut off at the largest or smallest value, and the largest magnitude of these levels.

    In a clipped half-cycle up to ``longest`` samples equal the extreme and the sample before was moving by more than
    three steps of the resolution.
    """
    count, level = 0, 0.0
    fast = 3.0 * quantum(value)
    for extreme in (value.max(), value.min()):
        at = np.concatenate([[False], value == extreme, [False]])
        begins, ends = np.flatnonzero(at[1:] & ~at[:-1]), np.flatnonzero(~at[1:] & at[:-1])
        for begin, end in zip(begins, ends, strict=True):
            entered_fast = begin >= 2 and abs(value[begin - 1] - value[begin - 2]) > fast
            if SHORTEST_CLIP <= end - begin <= longest and entered_fast:
                count, level = count + 1, max(level, abs(float(extreme)))
    return count, level


def _resolution(inside: AxisMotion, segment: DecaySegment) -> Iterator[Advice]:
    step = quantum(_measured(inside)[segment.quantity])
    if segment.initial_amplitude < MIN_STEPS * step:
        yield Advice(
            'coarse-quantisation',
            f'the {segment.quantity} is rounded to {np.degrees(step):.2g} {UNITS[segment.quantity]}, so that the first '
            f'amplitude has only {segment.initial_amplitude / step:.0f} steps: write more digits, or use a finer '
            'sensor',
        )


def _spikes(inside: AxisMotion) -> Iterator[Advice]:
    for name, value in _measured(inside).items():
        bad = spikes(value)
        away = np.abs(value - median_filter(value, SPIKE_NEIGHBOURS))[bad]
        number = int(np.count_nonzero(away > MIN_SPIKE * np.ptp(value[~bad])))
        if number:
            yield Advice(
                'spikes',
                f'the {inside.axis} {name} of the decay has {counted(number, "sample")} far from the neighbours, '
                'which a fit takes for motion: remove them, or look for lost or broken packets',
            )


def _bounds(inside: AxisMotion, segment: DecaySegment) -> Iterator[Advice]:
    """Advice on bounds that the user gave: what would have been found between them?"""
    decays = find_decays(inside)
    if not decays:
        if explain_absence(inside).code == 'forced-motion':
            yield Advice(
                'forced-motion',
                f'between {segment.start:.1f} and {segment.end:.1f} s the motion swings from beginning to end and '
                'nowhere dies out, as it does in waves: give the bounds of a free decay',
            )
        return
    found, late = decays[0], BOUNDS_TOLERANCE * segment.period
    if segment.beginning == 'given' and found.start > inside.time[0] + late:
        yield Advice(
            'late-start',
            f'the motion after the given start seems free only from {found.start:.1f} s on: give this as the start, '
            f'unless the craft was free from {segment.start:.1f} s',
        )
    if segment.ending == 'given' and found.ending == 'disturbed' and found.end < inside.time[-1] - late:
        yield Advice(
            'disturbed-tail',
            f'the motion before the given end seems free only until {found.end:.1f} s, where its swings or its period '
            f'jump: give this as the end, unless the craft was free until {segment.end:.1f} s',
        )


def _usual_period(motion: AxisMotion) -> float:
    """Mean period of the motion, s; nan where nothing turns."""
    points = find_turning_points(motion)
    return mean_period(points) if points.time.size >= 2 else float('nan')
