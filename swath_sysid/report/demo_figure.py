"""The picture of a demonstration: the whole run, and each lead after the second release."""

from typing import Any

import numpy as np

from swath_sysid.attitude.prediction.forecast import LEVELS, NORMAL_QUANTILES
from swath_sysid.pipeline.demonstration import SCORED_SPAN, UNAWARE, Demonstration, LeadForecasts, Outcome
from swath_sysid.report.figures import MEASURED, Axes, Figure, band, new_figure, quiet

BEFORE, AFTER, INTERVAL = '#e08e2b', '#0b8a83', '#9fd8d2'
TRUTH = 'simulated craft'
DOTS: Any = {'marker': '.', 'linestyle': ''}


def demo_figure(demonstration: Demonstration, verdict: Outcome) -> Figure:
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


def _headline(demonstration: Demonstration, verdict: Outcome):
    after, unaided = (f'{100 * error:.0f} %' for error in (verdict.after, verdict.unaided))
    return (
        f'{demonstration.hull}: {demonstration.axis} forecast one natural period ahead, error {after} of the motion '
        f'with the identified model, {unaided} without'
    )
