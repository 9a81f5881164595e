"""The picture of a record: the motion with its decays and gaps, and its spectrum."""
import numpy as np
from scipy.signal import welch

from swath_sysid.motion.cycles import find_gaps
from swath_sysid.motion.segmentation import find_decays
from swath_sysid.report.figures import BAND, MEASURED, MODEL, SERIES, new_figure, quiet


def record_figure(motions):
    """Motion and spectrum of each axis; decays shaded, gaps marked.

    Parameters
    ----------
    motions : sequence of AxisMotion

    Returns
    -------
    matplotlib Figure
    """
    figure = new_figure(11.0, 3.4 * len(motions))
    grid = figure.subplots(len(motions), 2, width_ratios=(3, 1), squeeze=False)
    for (motion_axes, spectrum_axes), motion in zip(grid, motions, strict=True):
        _draw_motion(quiet(motion_axes), motion)
        _draw_spectrum(quiet(spectrum_axes), motion)
    figure.suptitle(motions[0].source.replace('\\', '/').rsplit('/', 1)[-1], fontsize='medium')
    return figure


def _quantity(motion):
    return (motion.rate, 'rate [deg/s]') if motion.angle is None else (motion.angle, '[deg]')


def _draw_motion(axes, motion):
    values, label = _quantity(motion)
    for index, decay in enumerate(find_decays(motion)):
        axes.axvspan(decay.start, decay.end, color=BAND, alpha=0.35, linewidth=0)
        axes.text(
            decay.start, 1.0, f' decay {index + 1}: {decay.cycles:.1f} cycles of {decay.period:.2f} s',
            transform=axes.get_xaxis_transform(), va='top', fontsize='small',
        )  # fmt: skip
    for begin, end in find_gaps(motion):
        axes.axvspan(begin, end, color=MODEL, alpha=0.5, linewidth=1)
    axes.plot(motion.time, np.degrees(values), color=MEASURED, linewidth=0.9)
    axes.set_ylabel(f'{motion.axis} {label}')
    axes.set_xlabel('time [s]')


def _draw_spectrum(axes, motion):
    values, _ = _quantity(motion)
    interval = motion.sample_interval
    even = np.arange(motion.time[0], motion.time[-1], interval)
    if even.size < 16:
        axes.set_visible(False)
        return
    frequency, density = welch(np.interp(even, motion.time, values), 1 / interval, nperseg=min(even.size, 8192))
    shown = slice(1, max(2, np.searchsorted(np.cumsum(density), 0.999 * density.sum()) + 2))
    axes.plot(frequency[shown], density[shown] / density.max(), color=SERIES[0])
    axes.set_xlabel('frequency [Hz]')
    axes.set_ylabel('relative density')
