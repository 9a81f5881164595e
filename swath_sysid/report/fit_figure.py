"""The picture of a fit: motion, residual, frequency and damping against amplitude."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from swath_sysid.report.figures import (
    BAND,
    MEASURED,
    MODEL,
    RESIDUAL,
    measured_channel,
    new_figure,
    quiet,
    two_std_band,
)
from swath_sysid.report.fit_summary import short_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swath_sysid.attitude.identification.identify import Identification, RecordFit

MAX_PANELS = 12


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
        _draw_motion(motion_axes, residual_axes, record, legend=index == 0)
        if len(records) > 1:
            motion_axes.set_title(short_name(record.motion.source), fontsize='small')
    left, right = lower.subplots(1, 2)
    _draw_curves(quiet(left), quiet(right), identification)
    figure.suptitle(_headline(identification), fontsize='medium')
    return figure


def _draw_motion(motion_axes: Axes, residual_axes: Axes, record: RecordFit, legend: bool):
    motion = record.motion
    measured, label = measured_channel(motion)
    simulated = record.rate if motion.angle is None else record.angle
    motion_axes.plot(motion.time, np.degrees(measured), color=MEASURED, linewidth=1.4, label='measured')
    motion_axes.plot(motion.time, np.degrees(simulated), color=MODEL, linewidth=1.0, linestyle='--', label='simulated')
    motion_axes.set_ylabel(label)
    motion_axes.tick_params(labelbottom=False)
    residual_axes.plot(motion.time, np.degrees(record.residual), color=RESIDUAL, linewidth=0.7)
    residual_axes.axhline(0.0, color=MEASURED, linewidth=0.5)
    residual_axes.set_ylabel('residual [deg]' if motion.angle is not None else 'residual [deg/s]')
    residual_axes.set_xlabel('time [s]')
    if legend:
        motion_axes.legend(frameon=False, loc='upper right', ncols=2, fontsize='small')


def _draw_curves(frequency_axes: Axes, damping_axes: Axes, identification: Identification):
    bands = identification.bands
    amplitude = np.degrees(bands.curves.amplitude)
    period = 2 * np.pi / bands.curves.frequency
    period_std = period * bands.frequency_std / bands.curves.frequency
    _band(frequency_axes, amplitude, period, period_std)
    frequency_axes.set_ylabel('natural period [s]')
    _band(damping_axes, amplitude, bands.curves.damping_ratio, bands.damping_ratio_std)
    damping_axes.set_ylabel('equivalent damping ratio')
    damping_axes.set_ylim(bottom=0.0)
    for axes in (frequency_axes, damping_axes):
        axes.set_xlabel(f'{identification.model.axis} amplitude [deg]')


def _band(axes: Axes, amplitude: np.ndarray, value: np.ndarray, std: np.ndarray):
    two_std_band(axes, amplitude, value, std, color=BAND, alpha=0.6, label='two standard deviations')
    axes.plot(amplitude, value, color=MODEL)
    axes.legend(frameon=False, fontsize='small')


def _headline(identification: Identification):
    model = identification.model
    terms = ',  '.join(f'{n} {v:.4g} ± {identification.std[n]:.2g}' for n, v in model.terms.items())
    headline = f'R² {identification.r2:.5f},  period {model.natural_period:.3f} s'
    return f'{model.axis}, {model.equation.name}:  {headline}\n{terms}'
