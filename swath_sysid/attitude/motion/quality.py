"""Quality gates: what speaks against a record or a decay before anything is fitted to it."""
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from swath_sysid.attitude.motion.segmentation import explain_absence, find_decays
from swath_sysid.attitude.motion.turning_points import (
    even_signal,
    find_gaps,
    find_turning_points,
    mean_period,
)
from swath_sysid.common.advice import Advice
from swath_sysid.common.signals import quantum, spikes


@dataclass(frozen=True)
class QualityLimits:
    """From where on a weakness is told.

    Attributes
    ----------
    fewest_cycles : float
        Four swings, less the part of the first that is left out at the release: one loss for
        each of linear, quadratic and cubic damping.
    smallest_angle, smallest_rate : float
        rad, rad/s. First amplitude, 0.5 deg and 1 deg/s: published tests begin at 1 deg, and
        below half of that friction and the basin's own motion rule the damping.
    least_over_noise : float
        First amplitude over the standard deviation of the noise; at 5 the noise of one sample
        hides the fourth swing of a hull with a tenth of critical damping.
    fewest_samples : float
        Samples a period. At 20 the straight line between two samples errs by 1 % of the amplitude.
    longest_gap : float
        Periods; a longer gap hides a turning point.
    missing_samples : float
        Sample intervals between two samples from where on the record has a gap: single losses
        harm nothing.
    fewest_steps : float
        Resolution steps in the first amplitude. At 50 rounding alone is noise of 0.6 %.
    shortest_clip : int
        Equal samples at an extreme; noise and rounding make two, rarely three.
    spike_part : float
        Part of the largest swing that a spike must reach to bend a fit.
    late_periods : float
        Periods by which given bounds may reach beyond the decay that is found in them: what is
        left out after a push, and before a disturbance.
    """

    fewest_cycles: float = 1.75
    smallest_angle: float = float(np.radians(0.5))
    smallest_rate: float = float(np.radians(1.0))
    least_over_noise: float = 5.0
    fewest_samples: float = 20.0
    longest_gap: float = 0.25
    missing_samples: float = 5.0
    fewest_steps: float = 50.0
    shortest_clip: int = 4
    spike_part: float = 0.05
    late_periods: float = 1.6


DEFAULTS = QualityLimits()


def check_motion(motion, decays=None, limits=DEFAULTS):
    """Look at a whole record.

    Parameters
    ----------
    motion : AxisMotion
    decays : sequence of DecaySegment, optional
        Those that `find_decays` found in it; looked for where not given.
    limits : QualityLimits

    Returns
    -------
    tuple of Advice
        ``too-small``, ``forced-motion`` or ``no-decay`` where it holds no free decay,
        ``gaps`` and ``saturation``.
    """
    decays = find_decays(motion) if decays is None else decays
    advice = [] if decays else [explain_absence(motion)]
    gaps = find_gaps(motion, longer_than=limits.missing_samples * motion.sample_interval) if motion.size > 2 else ()
    if len(gaps):
        begin, end = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
        advice.append(Advice(
            'gaps',
            f'the {motion.axis} has {_count(len(gaps), "gap")}, the longest of {end - begin:.2g} s at {begin:.1f} s: '
            'look for lost messages, and keep them out of the decay',
        ))  # fmt: skip
    return (*advice, *_saturation(motion, decays[0].period if decays else _usual_period(motion), limits))


def check_decay(motion, segment, limits=DEFAULTS):
    """Look at a decay before a model is fitted to it.

    Parameters
    ----------
    motion : AxisMotion
        The record.
    segment : DecaySegment
        The decay in it.
    limits : QualityLimits

    Returns
    -------
    tuple of Advice
        ``too-few-cycles``, ``too-small``, ``low-rate``, ``gaps``, ``saturation``,
        ``coarse-quantisation``, ``spikes``; and where the user gave the bounds,
        ``forced-motion``, ``late-start`` and ``disturbed-tail``. What segmentation itself had to say is in
        ``segment.advice``.
    """
    inside = motion.between(segment.start, segment.end)
    if inside.size < 3:
        return ()
    saturation = _saturation(inside, segment.period, limits)
    advice = (
        *_cycles(segment, limits),
        *_size(inside, segment, limits),
        *_sampling(inside, segment, limits),
        *saturation,
        *_resolution(inside, segment, limits),
        *_spikes(inside, limits),
    )
    # Swings that are cut off do not fall, so nothing would be found between the bounds.
    if 'given' in (segment.beginning, segment.ending) and not saturation:
        advice += _bounds(inside, segment, limits)
    return advice


def _cycles(segment, limits):
    if segment.cycles >= limits.fewest_cycles:
        return ()
    return (Advice(
        'too-few-cycles',
        f'the decay shows only {segment.cycles:.1f} cycles, too few to tell how the damping depends on the amplitude '
        '(that takes two): release from a larger angle, fit several trials jointly, or choose an equation with linear '
        'damping',
    ),)  # fmt: skip


def _size(inside, segment, limits):
    smallest = limits.smallest_angle if segment.quantity == 'angle' else limits.smallest_rate
    noise = even_signal(inside).noise
    unit = 'deg' if segment.quantity == 'angle' else 'deg/s'
    amplitude = f'{np.degrees(segment.initial_amplitude):.2g} {unit}'
    if segment.initial_amplitude < smallest:
        return (Advice(
            'too-small',
            f'the decay begins with an amplitude of only {amplitude}, where friction and the basin rule the damping: '
            'release from 3 deg or more',
        ),)  # fmt: skip
    if segment.initial_amplitude < limits.least_over_noise * noise:
        return (Advice(
            'too-small',
            f'the decay begins with an amplitude of {amplitude}, only {segment.initial_amplitude / noise:.1f} times '
            f'the noise of {np.degrees(noise):.2g} {unit}: release from a larger angle, or use a quieter sensor',
        ),)  # fmt: skip
    return ()


def _sampling(inside, segment, limits):
    advice = ()
    samples = segment.period / inside.sample_interval
    if samples < limits.fewest_samples:
        advice += (Advice(
            'low-rate',
            f'the record has {samples:.1f} samples a period, and {limits.fewest_samples:g} are needed to follow the '
            f'motion: record at {limits.fewest_samples / segment.period:.3g} Hz or more',
        ),)  # fmt: skip
    gaps = find_gaps(inside, longer_than=max(limits.longest_gap * segment.period, 1.5 * inside.sample_interval))
    if len(gaps):
        longest = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
        advice += (Advice(
            'gaps',
            f'the decay has {_count(len(gaps), "gap")} longer than a quarter of its period, the longest of '
            f'{np.ptp(longest):.2g} s at {longest[0]:.1f} s: the fit bridges this, but record again if the first '
            'cycles are missing',
        ),)  # fmt: skip
    return advice


def _saturation(motion, period, limits):
    """Advice where a measured quantity is cut off at its extremes."""
    advice = ()
    for name, unit in (('angle', 'deg'), ('rate', 'deg/s')):
        value = getattr(motion, name)
        if value is None or not np.isfinite(period):
            continue
        clipped, level = clipped_extremes(value, limits.shortest_clip, 0.5 * period / motion.sample_interval)
        if clipped >= 2:
            advice += (Advice(
                'saturation',
                f'the {motion.axis} {name} is cut off at {np.degrees(level):.3g} {unit} in {_count(clipped, "swing")}: '
                'the sensor ends there; set a wider range, or release from a smaller angle',
            ),)  # fmt: skip
    return advice


def clipped_extremes(value, shortest, longest):
    """Count the swings that are cut off at the largest or smallest value.

    A swing is cut off where several samples equal the extreme exactly and the sample before
    them was still moving fast: by more than three steps of the resolution, which the top of a
    rounded swing does not.

    Parameters
    ----------
    value : ndarray, shape (N,)
    shortest, longest : float
        Samples at the extreme that make a cut; more than ``longest`` were held there.

    Returns
    -------
    count : int
    level : float
        Largest magnitude of the cut-off levels, unit of ``value``.
    """
    count, level = 0, 0.0
    fast = 3.0 * quantum(value)
    for extreme in (value.max(), value.min()):
        at = np.concatenate([[False], value == extreme, [False]])
        begins, ends = np.flatnonzero(at[1:] & ~at[:-1]), np.flatnonzero(~at[1:] & at[:-1])
        for begin, end in zip(begins, ends, strict=True):
            if shortest <= end - begin <= longest and begin >= 2 and abs(value[begin - 1] - value[begin - 2]) > fast:
                count, level = count + 1, max(level, abs(float(extreme)))
    return count, level


def _resolution(inside, segment, limits):
    value = inside.angle if segment.quantity == 'angle' else inside.rate
    step = quantum(value)
    if segment.initial_amplitude >= limits.fewest_steps * step:
        return ()
    unit = 'deg' if segment.quantity == 'angle' else 'deg/s'
    return (Advice(
        'coarse-quantisation',
        f'the {segment.quantity} is rounded to {np.degrees(step):.2g} {unit}, so that the first amplitude has only '
        f'{segment.initial_amplitude / step:.0f} steps: write more digits, or use a finer sensor',
    ),)  # fmt: skip


def _spikes(inside, limits):
    advice = ()
    for name in ('angle', 'rate'):
        value = getattr(inside, name)
        if value is None:
            continue
        bad = spikes(value)
        if not bad.any():
            continue
        reach = np.ptp(value[~bad])
        number = int(np.count_nonzero(np.abs(value - median_filter(value, 5))[bad] > limits.spike_part * reach))
        if number:
            advice += (Advice(
                'spikes',
                f'the {inside.axis} {name} of the decay has {_count(number, "sample")} far from the neighbours, '
                'which a fit takes for motion: remove them, or look for lost or broken packets',
            ),)  # fmt: skip
    return advice


def _bounds(inside, segment, limits):
    """Advice on bounds that the user gave: what would have been found between them?"""
    decays = find_decays(inside)
    if not decays:
        if explain_absence(inside).code != 'forced-motion':
            return ()
        return (Advice(
            'forced-motion',
            f'between {segment.start:.1f} and {segment.end:.1f} s the motion swings from beginning to end and nowhere '
            'dies out, as it does in waves: give the bounds of a free decay',
        ),)  # fmt: skip
    found, advice = decays[0], ()
    late = limits.late_periods * segment.period
    if segment.beginning == 'given' and found.start > inside.time[0] + late:
        advice += (Advice(
            'late-start',
            f'the motion after the given start seems free only from {found.start:.1f} s on: give '
            f'--start {found.start:.1f}, unless the craft was free from {segment.start:.1f} s',
        ),)  # fmt: skip
    if segment.ending == 'given' and found.ending == 'disturbed' and found.end < inside.time[-1] - late:
        advice += (Advice(
            'disturbed-tail',
            f'the motion before the given end seems free only until {found.end:.1f} s, where its swings or its period '
            f'jump: give --end {found.end:.1f}, unless the craft was free until {segment.end:.1f} s',
        ),)  # fmt: skip
    return advice


def _usual_period(motion):
    """Mean period of the motion, s; nan where nothing turns."""
    points = find_turning_points(motion)
    return mean_period(points) if points.time.size >= 2 else np.nan


def _count(number, noun):
    return f'{number} {noun}' + ('' if number == 1 else 's')
