"""The picture of a record: the motion with its decays and gaps, and its spectrum."""

from collections.abc import Sequence

import numpy as np

from swath_sysid.attitude.motion.segmentation import DecaySegment, find_decays
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.turning_points import even_signal, find_gaps, find_turning_points, mean_period
from swath_sysid.report.figures import BAND, MEASURED, MODEL, SERIES, Axes, Figure, measured_channel, new_figure, quiet
from swath_sysid.report.fit_summary import short_name

SPECTRUM_PERIODS = 16.0  #: Length of the averaged windows, in mean periods.
SPECTRUM_REACH = 4.0  #: Highest frequency drawn, over that of the mean period.


def record_figure(motions: Sequence[AxisMotion]) -> Figure:
    """Motion and spectrum of each axis; decays shaded with their turning points, gaps marked."""
    figure = new_figure(11.0, 3.4 * len(motions))
    grid = figure.subplots(len(motions), 2, width_ratios=(3, 1), squeeze=False)
    for (motion_axes, spectrum_axes), motion in zip(grid, motions, strict=True):
        decays = find_decays(motion)
        _draw_motion(quiet(motion_axes), motion, decays)
        _draw_spectrum(quiet(spectrum_axes), motion, decays)
    figure.suptitle(short_name(motions[0].source), fontsize='medium')
    return figure


def _draw_motion(axes: Axes, motion: AxisMotion, decays: Sequence[DecaySegment]):
    measured, label = measured_channel(motion)
    axes.plot(motion.time, np.degrees(measured), color=MEASURED, linewidth=0.9)
    for begin, end in find_gaps(motion, longer_than=3.0 * motion.sample_interval) if motion.size > 2 else ():
        axes.axvspan(begin, end, color=MODEL, alpha=0.5, linewidth=1)
    for index, decay in enumerate(sorted(decays, key=lambda decay: decay.start)):
        axes.axvspan(decay.start, decay.end, color=BAND, alpha=0.35, linewidth=0)
        _draw_turning_points(axes, motion, decay)
        axes.text(
            decay.start,
            0.985,
            f' decay {index + 1}: {decay.cycles:.1f} cycles of {decay.period:.2f} s',
            transform=axes.get_xaxis_transform(),
            va='top',
            fontsize='small',
        )
    # Room for the words above the motion.
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.1 * (high - low) if decays else high)
    axes.set(xlabel='time [s]', ylabel=label)


def _draw_turning_points(axes: Axes, motion: AxisMotion, decay: DecaySegment):
    inside = motion.between(decay.start, decay.end)
    if inside.size < 3:
        return
    points = find_turning_points(inside, decay.period)
    axes.plot(points.time, np.degrees(points.value), '.', color=MODEL, markersize=4)


def _draw_spectrum(axes: Axes, motion: AxisMotion, decays: Sequence[DecaySegment]):
    signal = even_signal(motion)
    points = find_turning_points(motion)
    if signal.value.size < 16 or points.time.size < 2:
        axes.set_visible(False)
        return
    period = decays[0].period if decays else mean_period(points)
    from scipy.signal import welch

    length = int(np.clip(SPECTRUM_PERIODS * period / signal.interval, 16, signal.value.size))
    frequency, density = welch(signal.value, 1.0 / signal.interval, nperseg=length, nfft=4 * length, detrend='linear')
    shown = slice(1, max(3, int(np.searchsorted(frequency, SPECTRUM_REACH / period))))
    axes.plot(frequency[shown], density[shown] / density[shown].max(), color=SERIES[0])
    for decay in decays[:1]:
        axes.axvline(1.0 / decay.period, color=MODEL, linewidth=0.9, linestyle='--', label=f'{decay.period:.2f} s')
        axes.legend(frameon=False, fontsize='small', loc='upper right')
    axes.set(xlabel='frequency [Hz]', ylabel='relative density')
