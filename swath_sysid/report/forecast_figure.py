"""The picture of a forecast's skill: error against lead, a stretch with its fans, reliability."""
import numpy as np

from swath_sysid.prediction.calibration import LEVELS
from swath_sysid.report.figures import BAND, MEASURED, MODEL, SERIES, new_figure, quiet

_LABELS = {
    'forecast': 'forecast', 'persistence': 'persistence', 'constant_rate': 'constant rate', 'ar': 'AR',
    'var': 'VAR, all channels', 'gm11': 'GM(1,1)', 'bound': 'bound of its own spectrum',
}  # fmt: skip

_FEWEST_TOLD = 10


def forecast_figure(skill):
    """Draw a `Skill`.

    Parameters
    ----------
    skill : Skill

    Returns
    -------
    Figure
    """
    count = len(skill.axes)
    figure = new_figure(12.0, 3.9 * count)
    grid = figure.add_gridspec(count, 3, width_ratios=(1.0, 1.6, 0.8))
    for row, (axis, scores) in enumerate(skill.axes.items()):
        _error(quiet(figure.add_subplot(grid[row, 0])), axis, skill.leads, scores)
        _stretch(quiet(figure.add_subplot(grid[row, 1])), axis, skill)
        _reliability(quiet(figure.add_subplot(grid[row, 2])), skill, scores, row == 0)
    return figure


def _error(axes, axis, leads, scores):
    # the forecast alone has its colour
    others = [colour for colour in (*SERIES, MEASURED) if colour != MODEL]
    colours = dict(zip([n for n in scores.nrmse if n != 'forecast'], others, strict=False))
    for name, values in scores.nrmse.items():
        if not np.isfinite(values).any():
            continue
        if name == 'forecast':
            axes.plot(leads, values, 'o-', color=MODEL, linewidth=2.2, markersize=5, label=_LABELS[name], zorder=5)
        else:
            style = '--' if name == 'bound' else '-'
            axes.plot(
                leads, values, style, marker='.', color=colours[name], linewidth=1.1, markersize=4, label=_LABELS[name]
            )
    axes.axhline(1.0, color=MEASURED, linewidth=0.8, linestyle=':')
    axes.set(xscale='log', yscale='log', xlabel='lead, s', ylabel='RMSE / standard deviation', title=f'{axis}: error')
    axes.set_ylim(top=3.0)
    axes.set_xticks(leads, [f'{lead:g}' for lead in leads])
    axes.minorticks_off()
    _legend(axes)


def _legend(axes, **place):
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=7, frameon=False, **place)


def _stretch(axes, axis, skill):
    time, angle = skill.stretch.get(axis, (np.empty(0), np.empty(0)))
    start = time[0] if time.size else 0.0
    axes.plot(time - start, np.degrees(angle), color=MEASURED, linewidth=1.1, label='measured', zorder=4)
    for k, fan in enumerate(f for f in skill.fans if f.axis == axis):
        when = fan.stamp + fan.leads - start
        middle = np.degrees(fan.angle)
        for level in (2, 1, 0):
            width = np.degrees(fan.half_width[:, level])
            axes.fill_between(when, middle - width, middle + width, color=BAND, alpha=0.25 + 0.12 * (2 - level), lw=0)
        axes.plot(when, middle, color=MODEL, linewidth=1.4, label='forecast, 50, 90, 99 %' if k == 0 else None)
        axes.axvline(fan.stamp - start, color=MODEL, linewidth=0.5, alpha=0.5)
    if angle.size and np.isfinite(angle).any():
        reach = 2.2 * np.nanmax(np.abs(np.degrees(angle - np.nanmean(angle))))
        centre = np.degrees(np.nanmean(angle))
        axes.set_ylim(centre - reach, centre + reach)
    axes.set(xlabel=f'time from {start:.0f} s, s', ylabel=f'{axis}, deg', title='forecasts as issued, and what came')
    _legend(axes, loc='upper right')


def _reliability(axes, skill, scores, with_quiescence):
    axes.plot([0, 1], [0, 1], color=MEASURED, linewidth=0.8, linestyle=':')
    shades = [SERIES[k % len(SERIES)] for k in range(skill.leads.size)]
    for lead, held, colour in zip(skill.leads, scores.coverage, shades, strict=True):
        if np.isfinite(held).all():
            axes.plot(LEVELS, held, 'o-', color=colour, markersize=4, linewidth=1.0, label=f'{lead:g} s')
    if with_quiescence and skill.quiescence is not None:
        told, enough = skill.quiescence, skill.quiescence.count >= _FEWEST_TOLD
        axes.plot(
            told.told[enough], told.happened[enough], 's--', color=MODEL, markersize=4, linewidth=1.0,
            label='quiescence',
        )  # fmt: skip
    axes.set(xlim=(0, 1), ylim=(0, 1), xlabel='told', ylabel='held', title='reliability')
    _legend(axes)
