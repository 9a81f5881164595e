"""The picture of a fit: motion, residual, frequency and damping against amplitude."""

import math
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.attitude.identification.result import Identification
from swath_sysid.report.figures import BAND, MODEL, Axes, Figure, curves_of, draw_fit, new_figure, quiet, two_std_band
from swath_sysid.report.fit_summary import short_name, spread_of

MAX_PANELS = 12  #: Of records that are drawn, the first.


def fit_figure(identification: Identification) -> Figure:
    """Measured and simulated motion with residual of each record, and the curves with bands."""
    records = identification.records[:MAX_PANELS]
    columns = min(3, len(records))
    rows = math.ceil(len(records) / columns)
    figure = new_figure(11.0, 3.4 * rows + 3.6)
    halves: Any = figure.subfigures(2, 1, height_ratios=(3.4 * rows, 3.2))
    upper, lower = halves
    grid = upper.add_gridspec(2 * rows, columns, height_ratios=(3, 1) * rows)
    for index, record in enumerate(records):
        row, column = divmod(index, columns)
        motion_axes = quiet(upper.add_subplot(grid[2 * row, column]))
        residual_axes = quiet(upper.add_subplot(grid[2 * row + 1, column], sharex=motion_axes))
        draw_fit(motion_axes, residual_axes, record.motion, record.angle, record.rate)
        if not index:
            motion_axes.legend(frameon=False, loc='upper right', ncols=2, fontsize='small')
        if len(records) > 1:
            motion_axes.set_title(short_name(record.motion.source), fontsize='small')
    left, right = lower.subplots(1, 2)
    _draw_curves(quiet(left), quiet(right), identification)
    figure.suptitle(_headline(identification), fontsize='medium', wrap=True)
    return figure


def _draw_curves(frequency_axes: Axes, damping_axes: Axes, identification: Identification):
    bands = identification.bands
    # a curve's amplitude is half the peak-to-peak motion, of which a damped release shows less than its first angle
    reach = 0.5 * max(np.ptp(each.angle) for each in identification.records)
    for axes, (label, (value, std)) in zip((frequency_axes, damping_axes), curves_of(bands).items(), strict=True):
        seen = (bands.curves.amplitude <= reach) & np.isfinite(std)
        amplitude = np.degrees(bands.curves.amplitude[seen])
        two_std_band(axes, amplitude, value[seen], std[seen], color=BAND, alpha=0.6, label='two standard deviations')
        axes.plot(amplitude, value[seen], color=MODEL)
        axes.legend(frameon=False, fontsize='small')
        axes.set(xlabel=f'{identification.model.axis} amplitude [deg]', ylabel=label)
    damping_axes.set_ylim(bottom=0.0)


def _headline(identification: Identification):
    model = identification.model
    terms = [
        f'{name} {value:.4g} {spread_of(identification, name, identification.intervals)} {RATIO_UNITS[name]}'
        for name, value in model.terms.items()
    ]
    headline = f'R² {identification.r2:.5f},  period of small motions {model.natural_period:.3f} s'
    return f'{model.axis}, {model.equation.name}:  {headline}\n{",   ".join(terms)}'
