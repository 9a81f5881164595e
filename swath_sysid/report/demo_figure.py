"""The picture of the demonstration: forecasts against the measured motion, before and after identification."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from swath_sysid.pipeline.demonstration import SCORED_SPAN, UNAWARE
from swath_sysid.report.figures import MEASURED, new_figure, quiet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from swath_sysid.pipeline.demonstration import Demonstration, LeadForecasts, Verdict

BEFORE, AFTER, BAND = '#e08e2b', '#0b8a83', '#9fd8d2'
NORMAL_90 = 1.6449
MAX_LEADS = 4


def demo_figure(demonstration: Demonstration, verdict: Verdict) -> Figure:
    """The whole run above, each lead below."""
    figure = new_figure(12.0, 7.4)
    halves: Any = figure.subfigures(2, 1, height_ratios=(1.15, 1.0))
    upper, lower = halves
    limit = 1.45 * np.degrees(demonstration.release_angle)
    _draw_run(quiet(upper.subplots()), demonstration, limit)
    shown = [each for each in demonstration.forecasts if each.lead <= demonstration.period_lead][-MAX_LEADS:]
    panels = np.atleast_1d(lower.subplots(1, len(shown), sharey=True))
    for panel, forecasts in zip(panels, shown, strict=True):
        _draw_lead(quiet(panel), demonstration, forecasts, limit)
    panels[0].set_ylabel(f'{demonstration.axis} [deg]')
    panels[0].legend(frameon=False, loc='upper right', fontsize='small', handlelength=1.4)
    lower.supxlabel('time since the release [s]', fontsize='medium')
    figure.suptitle(_headline(demonstration, verdict), fontsize='large', fontweight='bold', color=MEASURED)
    return figure


def _draw_run(axes: Axes, demonstration: Demonstration, limit: float):
    forecasts = next(f for f in demonstration.forecasts if f.lead == demonstration.period_lead)
    begin = demonstration.releases[0] - 4.0
    # a forecast that was issued while the craft was lifted or held cannot know that it will be released
    before, after = (demonstration.during(forecasts, number) for number in (0, 1))
    ahead = f'forecast {forecasts.lead:g} s ahead'
    for chosen, colour, name in (
        (before, BEFORE, f'{ahead}, no model yet'),
        (after, AFTER, f'{ahead}, identified model'),
    ):
        axes.plot(chosen.time - begin, np.degrees(chosen.angle), '.', color=colour, markersize=4.5, label=name)
    axes.fill_between(
        after.time - begin,
        np.degrees(after.angle - NORMAL_90 * after.std),
        np.degrees(after.angle + NORMAL_90 * after.std),
        color=BAND,
        alpha=0.45,
        linewidth=0,
        label='its 90 % interval',
    )
    axes.plot(
        demonstration.time - begin, np.degrees(demonstration.angle), color=MEASURED, linewidth=1.5, label='measured'
    )
    for moment, what in (
        (demonstration.releases[0], 'release'),
        (demonstration.model_time, 'decay noticed,\nmodel identified'),
        (demonstration.releases[1], 'second release'),
    ):
        axes.axvline(moment - begin, color=MEASURED, linewidth=0.8, linestyle=':')
        axes.annotate(
            what, (moment - begin, -limit), xytext=(5, 6), textcoords='offset points', fontsize='small', color=MEASURED
        )
    axes.set_xlim(0.0, demonstration.time[-1] - begin)
    axes.set_ylim(-limit, limit)
    axes.set_ylabel(f'{demonstration.axis} [deg]')
    axes.set_xlabel('time [s]')
    axes.legend(frameon=False, loc='upper center', ncols=4, fontsize='small', bbox_to_anchor=(0.5, 1.1))


def _draw_lead(axes: Axes, demonstration: Demonstration, forecasts: LeadForecasts, limit: float):
    first, second = demonstration.releases
    moving = (demonstration.time >= second - 0.5) & (demonstration.time <= demonstration.end(1))
    axes.plot(
        demonstration.time[moving] - second,
        np.degrees(demonstration.angle[moving]),
        color=MEASURED,
        linewidth=1.2,
        zorder=3,
        label='measured',
    )
    for number, release, colour, name in (
        (0, first, BEFORE, 'forecast, previous release'),
        (1, second, AFTER, 'forecast, this release'),
    ):
        scored = demonstration.during(forecasts, number)
        axes.plot(scored.time - release, np.degrees(scored.angle), '.', color=colour, markersize=4.5, label=name)
    blind = forecasts.lead + UNAWARE
    axes.axvspan(-0.5, blind, color=MEASURED, alpha=0.05, linewidth=0)
    if blind > 0.25 * SCORED_SPAN:
        axes.text(
            0.5 * blind - 0.25,
            -0.9 * limit,
            'forecast before\nthe release',
            ha='center',
            fontsize='x-small',
            color=MEASURED,
            alpha=0.7,
        )
    before, after = (demonstration.error(forecasts, number) for number in (0, 1))
    periods = f'{forecasts.lead / demonstration.period:.2g} period'
    axes.set_title(
        f'{forecasts.lead:g} s ahead ({periods})\nNRMSE {before:.2f} → {after:.2f}', fontsize='medium', color=MEASURED
    )
    axes.set_xlim(-0.5, SCORED_SPAN)
    axes.set_ylim(-limit, limit)


def _headline(demonstration: Demonstration, verdict: Verdict):
    return (
        f'{demonstration.hull}: the next natural period of {demonstration.axis}, forecast with '
        f'{100 * verdict.after:.0f} % error once a release was seen (without the model: {100 * verdict.unaided:.0f} %)'
    )
