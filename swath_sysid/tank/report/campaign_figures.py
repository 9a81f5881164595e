"""The figures of a campaign; each small, so that a page can lay them out for its width."""

import math
from collections.abc import Iterator, Sequence
from itertools import cycle
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.common.conventions import TWO_STD
from swath_sysid.common.covariance import correlation
from swath_sysid.report.figures import (
    LINE_STYLES,
    MEASURED,
    SERIES,
    Axes,
    curves_of,
    draw_fit,
    legend_below,
    measured_channel,
    new_figure,
    panel,
    quiet,
    two_std_band,
)
from swath_sysid.report.html_page import Drawing
from swath_sysid.tank.campaign.evaluation import Condition
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.report.campaign_tables import LOADING_NAMES


def campaign_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> dict[str, list[Drawing]]:
    """Section name to the list of `Drawing` of one axis of a `CampaignOutcome`."""
    return {
        'decays': list(decay_drawings(outcome, axis)),
        'against_angle': list(against_angle(outcome, axis)),
        'against_draft': list(against_draft(outcome, axis)),
        'damping': list(period_drawings(axis)),
        'records': list(record_drawings(outcome, axis)),
        'correlations': list(correlation_drawings(outcome, axis)),
    }


def decay_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Decays of all drafts on one axis, a figure an angle; with one draft, of all angles on one."""
    several = len({c.loading for c in axis.best}) > 1
    groups: dict[tuple[float, str], list] = {}
    for condition, index in axis.best.items():
        motion = axis.records[index].problem.motions[0]
        measured, label = measured_channel(motion)
        angle = condition.initial_angle_deg if several else 0.0
        groups.setdefault((angle, label), []).append((condition, motion.time, measured))
    for (angle, label), members in sorted(groups.items()):
        title, suffix = (f'from {angle:g} deg', f'{angle:g}deg') if several else ('all angles', 'all')
        figure, axes = panel(title=title, xlabel='time since release [s]', ylabel=label)
        for condition, time, measured in members:
            name = _loading(outcome, condition) if several else f'{condition.initial_angle_deg:g} deg'
            axes.plot(time - time[0], np.degrees(measured), linewidth=1.1, label=name)
        axes.legend(frameon=False)
        suffix += '_rate' if 'rate' in label else ''
        yield Drawing(f'decays_{axis.axis}_{suffix}', f'Recorded decays {title}, best repeats', figure)


def _loading(outcome: CampaignOutcome, condition: Condition):
    return f'{LOADING_NAMES[outcome.quantity]} {condition.loading:g}'


def against_angle(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Each ratio against initial angle, a curve a draft, with the single repeats behind."""
    loadings = sorted({c.loading for c in axis.together})
    for term in axis.schedule.equation.terms:
        figure, axes = _ratio_panel(term, 'initial angle [deg]')
        for colour, loading in zip(cycle(SERIES), loadings):
            members = sorted(c for c in axis.together if c.loading == loading)
            label = _loading(outcome, members[0])
            _ratios(axes, axis, term, members, 'initial_angle_deg', label, color=colour, linewidth=1.2)
            single = [
                (r.condition.initial_angle_deg, fits[axis.choice].ratio(term)[0])
                for r, fits in zip(axis.records, axis.fits['simulation'], strict=True)
                if r.condition.loading == loading
            ]
            axes.plot(*np.transpose(single), 'X', color=colour)
        _finish_ratio(axes)
        caption = (
            f'{term} against initial angle: repeats together with two standard deviations; crosses: single repeats'
        )
        yield Drawing(f'{term}_against_angle_{axis.axis}', caption, figure)


def _ratios(
    axes: Axes, axis: AxisOutcome, term: str, conditions: Sequence[Condition], against: str, label: str, **style: Any
):
    """A ratio of the joint fits with two standard deviations, against what the conditions differ in."""
    value, std = np.array([axis.together[c][axis.choice].ratio(term) for c in conditions]).T
    style |= {'marker': 'o', 'markersize': 4, 'capsize': 3, 'label': label}
    axes.errorbar([getattr(c, against) for c in conditions], value, TWO_STD * std, **style)


def _ratio_panel(term: str, below: str):
    return panel(xlabel=below, ylabel=f'{term} [{RATIO_UNITS[term]}]')


def _finish_ratio(axes: Axes):
    low, high = axes.get_ylim()
    if low < 0 < high and low > -0.2 * high:
        axes.axhline(0.0, color=MEASURED, linewidth=0.6)
    legend_below(axes)


def against_draft(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Each ratio against loading: a curve an angle, and the scheduled model with its band."""
    schedule, quantity = axis.schedule, LOADING_NAMES[outcome.quantity]
    if len(schedule.loadings) < 2:
        return
    angles = sorted({c.initial_angle_deg for c in axis.together})
    fine = np.linspace(schedule.loadings[0], schedule.loadings[-1], 101)
    for term, value, std in zip(schedule.equation.terms, *(part.T for part in schedule.curve(fine)), strict=True):
        figure, axes = _ratio_panel(term, quantity)
        two_std_band(axes, fine, value, std, color=MEASURED, alpha=0.15)
        axes.plot(fine, value, color=MEASURED, linewidth=1.6, label='all angles: the schedule')
        for colour, angle in zip(cycle(SERIES), angles):
            members = sorted(c for c in axis.together if c.initial_angle_deg == angle)
            style = {'color': colour, 'linewidth': 0.9, 'linestyle': '--'}
            _ratios(axes, axis, term, members, 'loading', f'{angle:g} deg', **style)
        _finish_ratio(axes)
        caption = f'{term} against {quantity}, two standard deviations'
        yield Drawing(f'{term}_against_draft_{axis.axis}', caption, figure)


def period_drawings(axis: AxisOutcome) -> Iterator[Drawing]:
    """Natural period against amplitude, all conditions on one axis."""
    loadings = sorted({c.loading for c in axis.together})
    angles = sorted({c.initial_angle_deg for c in axis.together})
    several = len(loadings) > 1
    label = 'natural period [s]'
    figure, axes = panel(xlabel=f'{axis.motion} amplitude [deg]', ylabel=label)
    figure.set_figheight(figure.get_figheight() + 0.22 * math.ceil(len(axis.together) / 2))
    for condition, fits in sorted(axis.together.items()):
        bands, place = fits[axis.choice].bands, angles.index(condition.initial_angle_deg)
        amplitude, (value, std) = np.degrees(bands.curves.amplitude), curves_of(bands)[label]
        colour = SERIES[(loadings.index(condition.loading) if several else place) % len(SERIES)]
        two_std_band(axes, amplitude, value, std, color=colour, alpha=0.12)
        name = f'{condition.initial_angle_deg:g} deg' + (f' at {condition.loading:g}' if several else '')
        style = LINE_STYLES[place % len(LINE_STYLES)]
        axes.plot(amplitude, value, style, color=colour, linewidth=1.2, label=name)
    # by the curves: a band that is wide where nothing was measured shall not hide them
    values = np.concatenate([line.get_ydata() for line in axes.lines])
    if (values := values[np.isfinite(values)]).size:
        low, high = values.min(), values.max()
        margin = 0.35 * (high - low) + 0.01 * abs(high)
        axes.set_ylim(low - margin, high + margin)
    legend_below(axes)
    caption = 'Natural period against amplitude, bands of two standard deviations'
    yield Drawing(f'period_against_amplitude_{axis.axis}', caption, figure)


def record_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Every record with the identified motion and the residual."""
    for record, fits in zip(axis.records, axis.fits['simulation'], strict=True):
        fit, motion = fits[axis.choice], record.problem.motions[0]
        state = fit.states[0]
        angle, rate = simulate(fit.model.with_trim(state.trim), state.x + state.trim, state.rate, motion.time)
        figure = new_figure()
        above, below = map(quiet, figure.subplots(2, 1, sharex=True, height_ratios=(3, 1)))
        draw_fit(above, below, motion, angle, rate)
        above.legend(frameon=False, ncols=2, loc='upper right')
        c = record.condition
        title = f'{c.initial_angle_deg:g} deg, {_loading(outcome, c)}, repeat {record.repeat}'
        above.set_title(title, fontsize='small')
        name = f'record_{axis.axis}_{c.initial_angle_deg:g}deg_{c.loading:g}_repeat{record.repeat}'
        best = ' (best repeat)' if axis.records[axis.best[c]] is record else ''
        yield Drawing(name, f'{record.name}{best}: R² {fit.r2:.5f}', figure)


def correlation_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Correlations between the ratios of the chosen equation, a figure a draft."""
    for loading, fits in axis.by_draft.items():
        fit = fits[axis.choice]
        terms = list(fit.model.terms)
        matrix, count = correlation(fit.covariance), len(terms)
        figure = new_figure()
        axes = figure.subplots()
        # of the colours those on which black is read, whatever the page's own
        axes.pcolormesh(matrix[::-1], cmap='RdBu_r', vmin=-1.5, vmax=1.5, edgecolors='none')
        for (i, j), value in np.ndenumerate(matrix):
            axes.text(
                j + 0.5, count - i - 0.5, f'{value:.2f}', ha='center', va='center', fontsize='small', color='black'
            )
        axes.set_xticks(np.arange(count) + 0.5, terms)
        axes.set_yticks(np.arange(count) + 0.5, terms[::-1])
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set_title(f'{LOADING_NAMES[outcome.quantity]} {loading:g}')
        caption = 'Correlations, all records of the draft together'
        yield Drawing(f'correlation_{axis.axis}_{loading:g}', caption, figure)
