"""The pictures of forecasts: skill (error against lead, a stretch with its fans, reliability), and demonstration."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecast import LEVELS, NORMAL_QUANTILES
from swath_sysid.pipeline.demonstration import SCORED_SPAN, UNAWARE, Demonstration, LeadForecasts, Verdict
from swath_sysid.pipeline.record_run import Run
from swath_sysid.pipeline.scoring import FORECAST, Skill
from swath_sysid.report.figures import BAND, MEASURED, MODEL, SERIES, Axes, Figure, band, new_figure, plain_ticks, quiet
from swath_sysid.report.forecast_skill import methods_of

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


BEFORE, AFTER, INTERVAL = '#e08e2b', '#0b8a83', '#9fd8d2'
TRUTH = 'simulated craft'
DOTS: Any = {'marker': '.', 'linestyle': ''}


def demo_figure(demonstration: Demonstration, verdict: Verdict) -> Figure:
    """The whole run above, each lead below."""
    figure = new_figure(12.0, 7.4)
    halves: Any = figure.subfigures(2, 1, height_ratios=(1.15, 1.0))
    upper, lower = halves
    limit = 1.45 * np.degrees(demonstration.release_angle)
    _draw_run(quiet(upper.subplots()), demonstration, limit)
    published = [each for each in demonstration.forecasts if each.lead <= demonstration.period_lead]
    unaided = {each.lead: each for each in demonstration.unaided}
    panels = np.atleast_1d(lower.subplots(1, len(published), sharey=True))
    for panel, forecasts in zip(panels, published, strict=True):
        _draw_lead(quiet(panel), demonstration, forecasts, unaided[forecasts.lead], limit)
    panels[0].set_ylabel(f'{demonstration.axis} [deg]')
    panels[0].legend(frameon=False, loc='upper right', fontsize='small', handlelength=1.4)
    lower.supxlabel('time since the second release [s]', fontsize='medium')
    figure.suptitle(_headline(demonstration, verdict), fontsize='large', fontweight='bold', color=MEASURED)
    return figure


def _draw_run(axes: Axes, demonstration: Demonstration, limit: float):
    forecasts = next(f for f in demonstration.forecasts if f.lead == demonstration.period_lead)
    begin = demonstration.releases[0] - 4.0
    # a forecast that was issued while the craft was lifted or held cannot know that it will be released
    before, after = (demonstration.during(forecasts, number) for number in (0, 1))
    ahead = f'forecast {forecasts.lead:g} s ahead'
    for chosen, colour, name in ((before, BEFORE, 'no model yet'), (after, AFTER, 'identified model')):
        style = DOTS | {'color': colour, 'label': f'{ahead}, {name}'}
        axes.plot(chosen.time - begin, np.degrees(chosen.angle), **style)
    middle, half_width = np.degrees(after.angle), np.degrees(NORMAL_QUANTILES[LEVELS == 0.9].item() * after.std)
    band(axes, after.time - begin, middle, half_width, color=INTERVAL, alpha=0.45, label='its 90 % interval')
    angle = np.degrees(demonstration.angle)
    axes.plot(demonstration.time - begin, angle, color=MEASURED, linewidth=1.2, zorder=1.5, label=TRUTH)
    first, second = demonstration.releases
    words: Any = {'color': MEASURED, 'fontsize': 'small', 'textcoords': 'offset points'}
    for moment, what, side in (
        (first, 'release', 'left'),
        (demonstration.model_time, 'decay detected,\nmodel identified', 'right'),
        (second, 'second release', 'left'),
    ):
        axes.axvline(moment - begin, color=MEASURED, linewidth=0.8, linestyle=':')
        beside = 5 if side == 'left' else -5
        axes.annotate(what, (moment - begin, -limit), ha=side, xytext=(beside, 6), **words)
    axes.set(xlim=(0.0, demonstration.time[-1] - begin), ylim=(-limit, limit))
    axes.set(xlabel='time [s]', ylabel=f'{demonstration.axis} [deg]')
    axes.legend(frameon=False, loc='upper center', ncols=4, fontsize='small', bbox_to_anchor=(0.5, 1.1))


def _draw_lead(
    axes: Axes, demonstration: Demonstration, published: LeadForecasts, unaided: LeadForecasts, limit: float
):
    """The second release at one lead: what was published, and what would have been without a model."""
    release = demonstration.releases[1]
    moving = (demonstration.time >= release - 0.5) & (demonstration.time <= demonstration.end(1))
    time, angle = demonstration.time[moving] - release, np.degrees(demonstration.angle[moving])
    axes.plot(time, angle, color=MEASURED, linewidth=1.2, zorder=1.5, label=TRUTH)
    for forecasts, colour, name in ((unaided, BEFORE, 'without a model'), (published, AFTER, 'identified model')):
        scored, style = demonstration.during(forecasts, 1), DOTS | {'label': f'forecast, {name}'}
        axes.plot(scored.time - release, np.degrees(scored.angle), color=colour, **style)
    blind = published.lead + UNAWARE
    axes.axvspan(-0.5, blind, color=MEASURED, alpha=0.05, linewidth=0)
    if blind > 0.25 * SCORED_SPAN:
        place, words = (0.5 * blind - 0.25, -0.9 * limit), 'forecast before\nthe release'
        axes.text(*place, words, ha='center', fontsize='x-small', color=MEASURED, alpha=0.7)
    before, after = (100.0 * demonstration.error(forecasts, 1) for forecasts in (unaided, published))
    ahead = f'{published.lead:g} s ahead ({published.lead / demonstration.period:.2g} period)'
    axes.set_title(f'{ahead}\nerror {before:.0f} % → {after:.0f} %', fontsize='medium', color=MEASURED)
    axes.set(xlim=(-0.5, SCORED_SPAN), ylim=(-limit, limit))


def _headline(demonstration: Demonstration, verdict: Verdict):
    after, unaided = (f'{100 * error:.0f} %' for error in (verdict.after, verdict.unaided))
    return (
        f'{demonstration.hull}: {demonstration.axis} forecast one natural period ahead, error {after} of the motion '
        f'with the identified model, {unaided} without'
    )
