"""The picture of a forecast's skill: error against lead, a stretch with its fans, reliability."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecast import LEVELS
from swath_sysid.evaluation.report.skill import methods_of
from swath_sysid.evaluation.scoring import FORECAST, Skill
from swath_sysid.pipeline.record_run import Run
from swath_sysid.report.figures import BAND, MEASURED, MODEL, SERIES, Axes, Figure, band, new_figure, plain_ticks, quiet

_STRETCH = 40.0  #: s of the record that show forecasts as issued, in the middle of what was scored.


def forecast_figure(trial: Trial, run: Run, skill: Skill) -> Figure:
    """Draw a `Skill` and some of the forecasts it scores."""
    count = len(skill.axes)
    figure = new_figure(12.0, 3.9 * count)
    grid = figure.add_gridspec(count, 3, width_ratios=(1.0, 1.6, 0.8))
    for row, (axis, scores) in enumerate(skill.axes.items()):
        _error(quiet(figure.add_subplot(grid[row, 0])), axis, skill.leads, scores)
        _stretch(quiet(figure.add_subplot(grid[row, 1])), axis, trial, _spaced(trial, run, skill))
        _reliability(quiet(figure.add_subplot(grid[row, 2])), skill, scores, row == 0)
    return figure


def _error(axes: Axes, axis: str, leads: np.ndarray, scores: Any):
    # the forecast alone has its colour
    others = [colour for colour in (*SERIES, MEASURED) if colour != MODEL]
    colours = dict(zip([n for n in scores.nrmse if n != FORECAST], others, strict=False))
    for label, (name, *_) in methods_of(scores.nrmse):
        values = scores.nrmse[name]
        if not np.isfinite(values).any():
            continue
        style: dict = {'color': colours.get(name, MODEL), 'label': label}
        # dashed over VAR(40), which it may hide
        other: dict = {'linewidth': 1.1, 'marker': '.', 'markersize': 4, 'linestyle': '--' if name == 'var_60' else '-'}
        own: dict = {'linewidth': 2.2, 'markersize': 5, 'marker': 'o', 'zorder': 5}
        axes.plot(leads, values, **style, **(own if name == FORECAST else other))
    axes.axhline(1.0, color=MEASURED, linewidth=0.8, linestyle=':')
    axes.set(xscale='log', yscale='log', xlabel='lead [s]', ylabel='RMSE / standard deviation [-]')
    axes.set_title(f'{axis}: error')
    axes.set_ylim(top=3.0)
    axes.set_xticks(leads, [f'{lead:g}' for lead in leads])
    plain_ticks(axes.yaxis)
    axes.minorticks_off()
    _legend(axes)


def _legend(axes: Axes, **place: Any):
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=7, frameon=False, **place)


def _spaced(trial: Trial, run: Run, skill: Skill):
    """Steps about the middle of what was scored, one after the other's horizon."""
    first, last = (trial.time[0] + skill.warmup, trial.time[0] + min(skill.until, trial.time[-1] - trial.time[0]))
    middle = 0.5 * (first + last)
    spaced: list = []
    for step in run.steps:
        begun = max(first, middle - 0.5 * _STRETCH) if not spaced else spaced[-1].stamp + spaced[-1].horizon.leads[-1]
        if begun <= step.stamp <= min(last, middle + 0.5 * _STRETCH) and step.horizon is not None:
            spaced.append(step)
    return spaced


def _stretch(axes: Axes, axis: str, trial: Trial, steps: Sequence[Any]):
    shown = [s for s in steps if axis in s.horizon.axes]
    about = [s.stamp for s in shown] or [trial.time[0]]
    span = (trial.time >= about[0] - 5.0) & (trial.time <= about[-1] + 10.0)
    time, angle = trial.time[span], trial.channels[axis][span]
    start = time[0] if time.size else 0.0
    axes.plot(time - start, np.degrees(angle), color=MEASURED, linewidth=1.1, label='measured', zorder=4)
    for k, step in enumerate(shown):
        when = step.stamp + step.horizon.leads - start
        middle, half_width = np.degrees(step.horizon.angle(axis)), np.degrees(step.horizon.half_width(axis))
        for level in (2, 1, 0):
            band(axes, when, middle, half_width[:, level], color=BAND, alpha=0.25 + 0.12 * (2 - level))
        axes.plot(when, middle, color=MODEL, linewidth=1.4, label='forecast, 50, 90, 99 %' if k == 0 else None)
        axes.axvline(step.stamp - start, color=MODEL, linewidth=0.5, alpha=0.5)
    if angle.size and np.isfinite(angle).any():
        reach = 2.2 * np.nanmax(np.abs(np.degrees(angle - np.nanmean(angle))))
        centre = np.degrees(np.nanmean(angle))
        axes.set_ylim(centre - reach, centre + reach)
    axes.set(xlabel=f'time after {start:.0f} s [s]', ylabel=f'{axis} [deg]')
    axes.set_title('forecasts as issued, and the measured motion')
    _legend(axes, loc='upper right')


def _reliability(axes: Axes, skill: Skill, scores: Any, with_quiescence: bool):
    axes.plot([0, 1], [0, 1], color=MEASURED, linewidth=0.8, linestyle=':')
    shades = [SERIES[k % len(SERIES)] for k in range(skill.leads.size)]
    for lead, held, colour in zip(skill.leads, scores.coverage, shades, strict=True):
        if np.isfinite(held).all():
            axes.plot(LEVELS, held, 'o-', color=colour, markersize=4, linewidth=1.0, label=f'{lead:g} s')
    if with_quiescence and skill.quiescence is not None:
        found, known = skill.quiescence, skill.quiescence.count > 0
        style: dict = {'color': MEASURED, 'markersize': 4, 'linewidth': 1.0, 'label': 'quiescence'}
        axes.plot(found.forecast[known], found.observed[known], 's--', **style)
        # on white, because lines cross there
        paper = {'boxstyle': 'square,pad=0.1', 'facecolor': 'white', 'edgecolor': 'none', 'alpha': 0.8}
        words: dict = {'fontsize': 7, 'va': 'center', 'xytext': (7, 1), 'textcoords': 'offset points', 'bbox': paper}
        for forecast, observed, count in zip(found.forecast, found.observed, found.count, strict=True):
            if count:
                axes.annotate(f'{count:d}', (forecast, observed), **words)
    axes.set(xlim=(0, 1), ylim=(0, 1), xlabel='forecast probability [-]', ylabel='observed share [-]')
    axes.set_title(
        'reliability (numbers: counts)' if with_quiescence and skill.quiescence is not None else 'reliability'
    )
    _legend(axes, loc='upper left')
