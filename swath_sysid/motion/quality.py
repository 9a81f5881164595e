"""Quality gates: what speaks against a record or a decay before anything is fitted to it."""
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from swath_sysid.advice import Advice
from swath_sysid.motion.cycles import (
    even_signal,
    find_gaps,
    find_turning_points,
    mean_period,
    quantum,
    spikes,
)
from swath_sysid.motion.falls import FallSettings, find_falls
from swath_sysid.motion.segmentation import explain_absence, find_decays


@dataclass(frozen=True)
class QualityLimits:
    """From where on a weakness is told.

    Attributes
    ----------
    fewest_cycles : float
        Two cycles show four losses: one more than linear, quadratic and cubic damping have
        coefficients.
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
    fewest_steps : float
        Resolution steps in the first amplitude. At 50 rounding alone is noise of 0.6 %.
    shortest_clip : int
        Equal samples at an extreme; noise and rounding make two, rarely three.
    spike_part : float
        Part of the largest swing that a spike must reach to bend a fit.
    late_part : float
        Part of given bounds that may lie before or after the decay found in them.
    """

    fewest_cycles: float = 2.0
    smallest_angle: float = float(np.radians(0.5))
    smallest_rate: float = float(np.radians(1.0))
    least_over_noise: float = 5.0
    fewest_samples: float = 20.0
    longest_gap: float = 0.25
    fewest_steps: float = 50.0
    shortest_clip: int = 4
    spike_part: float = 0.05
    late_part: float = 0.15


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
        ``too-small``, ``forced-motion`` or ``no-decay`` where it holds no free decay, and
        ``saturation``.
    """
    decays = find_decays(motion) if decays is None else decays
    advice = [] if decays else [explain_absence(motion)]
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
    advice = (
        *_cycles(segment, limits),
        *_size(inside, segment, limits),
        *_sampling(inside, segment, limits),
        *_saturation(inside, segment.period, limits),
        *_resolution(inside, segment, limits),
        *_spikes(inside, limits),
    )
    if 'given' in (segment.beginning, segment.ending):
        advice += _bounds(inside, segment, limits)
    return advice


def _cycles(segment, limits):
    if segment.cycles >= limits.fewest_cycles:
        return ()
    return (Advice(
        'too-few-cycles',
        f'the decay shows only {segment.cycles:.1f} cycles, and {limits.fewest_cycles:g} are needed to tell how the '
        'damping depends on the amplitude: release from a larger angle, fit several trials jointly, or choose an '
        'equation with linear damping',
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
            f'the decay begins with an amplitude of {amplitude}, only {segment.initial_amplitude / noise:.1f} times the '
            f'noise of {np.degrees(noise):.2g} {unit}: release from a larger angle, or use a quieter sensor',
        ),)  # fmt: skip
    return ()


def _sampling(inside, segment, limits):
    advice = ()
    samples = segment.period / inside.sample_interval
    if samples < limits.fewest_samples:
        advice += (Advice(
            'low-rate',
            f'the record has {samples:.1f} samples a period, and {limits.fewest_samples:g} are needed for the motion to be '
            f'followed: record at {limits.fewest_samples / segment.period:.3g} Hz or more',
        ),)  # fmt: skip
    gaps = find_gaps(inside, longer_than=max(limits.longest_gap * segment.period, 1.5 * inside.sample_interval))
    if len(gaps):
        longest = gaps[np.argmax(gaps[:, 1] - gaps[:, 0])]
        advice += (Advice(
            'gaps',
            f'{_count(len(gaps), "gap")} in the decay hide more than a quarter of a period, the longest {np.ptp(longest):.2g} s at '
            f'{longest[0]:.1f} s: the fit bridges them, but record again if they cover the first cycles',
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
                f'{_count(number, "sample")} of the {inside.axis} {name} in the decay lie far from their neighbours: a fit '
                'takes them for motion; remove them, or look for lost or broken packets',
            ),)  # fmt: skip
    return advice


def _bounds(inside, segment, limits):
    """Advice on bounds that the user gave: does the motion between them fall from begin to end?"""
    falls = [fall for fall in find_falls(inside, FallSettings()) if fall.is_suited and fall.swings.size >= 3]
    if not falls:
        return ()
    best = max(falls, key=lambda fall: fall.weight)
    begin, end = float(best.time[best.first]), best.end
    covered = (end - begin) / inside.duration
    if covered < 0.5 and best.at_record_end is False and _keeps_moving_after(best):
        return (Advice(
            'forced-motion',
            f'between {segment.start:.1f} and {segment.end:.1f} s the swings do not fall steadily (the longest fall is '
            f'{end - begin:.1f} s): this may be motion in waves; give the bounds of a free decay',
        ),)  # fmt: skip
    advice = ()
    if segment.beginning == 'given' and begin - segment.start > max(
        limits.late_part * inside.duration, segment.period
    ):
        advice += (Advice(
            'late-start',
            f'the swings fall only from {begin:.1f} s on, and before that the motion is not free: give '
            f'--start {begin:.1f}, unless the craft was free from {segment.start:.1f} s',
        ),)  # fmt: skip
    if segment.ending == 'given' and best.broken and inside.time[-1] - end > limits.late_part * inside.duration:
        advice += (Advice(
            'disturbed-tail',
            f'after {end:.1f} s the swings no longer fall steadily: give --end {end:.1f}, unless the motion is free '
            'until the given end',
        ),)  # fmt: skip
    return advice


def _keeps_moving_after(fall):
    return fall.activity_after() > 0.5


def _usual_period(motion):
    """Mean period of the motion, s; nan where nothing turns."""
    points = find_turning_points(motion)
    return mean_period(points) if points.time.size >= 2 else np.nan


def _count(number, noun):
    return f'{number} {noun}' + ('' if number == 1 else 's')
