"""The figures of a study of free decays, as the study orders them; all that they show is simulated."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.campaign.papers.decay_study import DRAFT_FACTORS, DecayStudy
from swath_sysid.report.campaign_figures import LINE_STYLES, legend_below, panel
from swath_sysid.report.figures import MEASURED, MODEL, RESIDUAL, SERIES, TWO_STD, Axes
from swath_sysid.report.html_page import Drawing, figures
from swath_sysid.report.paper_decay_claims import BY, GENETIC, HULL, OURS, coefficient, coefficient_names


def drawn(study: DecayStudy, kind: str) -> str:
    """The figures of one kind; nothing where the study has none."""
    return figures(
        [
            replace(drawing, caption=f'As figure {spec["number"]}: {drawing.caption}')
            for spec in study.publication.figures
            if spec['kind'] == kind
            for drawing in FIGURES[kind](study, spec)
        ]
    )


def _decays(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    figure, axes = panel(xlabel='time since release [s]', ylabel=f'{study.publication.axis} rate [rad/s]')
    for factor in DRAFT_FACTORS:
        motion = study.at(factor, spec['angle_deg']).problem.motions[0]
        axes.plot(motion.time - motion.time[0], np.asarray(motion.rate), linewidth=0.9, label=f'{factor:g} T simulated')
    legend_below(axes)
    caption = f'simulated rates at three drafts, released from {spec["angle_deg"]:g} deg'
    yield Drawing('decays', caption, figure)


def _motion(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    record = study.at(spec['draft_factor'], spec['angle_deg'])
    motion, state = record.problem.motions[0], record.ours.states[0]
    searched = record.hull.from_terms(
        equation_named(study.publication.chosen), study.chosen(record).genetic.ratios, axis=motion.axis
    )
    time = motion.time - motion.time[0]
    for quantity, unit in (('angle', '[deg]'), ('rate', 'rate [deg/s]')):
        figure, axes = panel(xlabel='time since release [s]', ylabel=f'{motion.axis} {unit}')
        recorded = np.degrees(getattr(motion, quantity))
        axes.plot(time, recorded, color=MEASURED, linewidth=0.7, alpha=0.7, label='simulated record')
        for model, by, colour, style in (
            (searched, GENETIC, MODEL, '--'),
            (record.ours.model, OURS, RESIDUAL, '-'),
        ):
            own = simulate(model.with_trim(state.trim), state.x + state.trim, state.rate, motion.time)
            label = f'model by {BY[by]}'
            axes.plot(time, np.degrees(own[quantity == 'rate']), style, color=colour, label=label)
        legend_below(axes, columns=1)
        place = f'{record.angle_deg:g} deg at {record.draft_factor:g} T'
        yield Drawing(f'motion_{quantity}', f'{quantity}, simulated record and identified models, {place}', figure)


def _objective_by_equation(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    p = study.publication
    places = np.arange(1, len(p.equations) + 1)
    for angle in sorted({r.angle_deg for r in study.records}):
        figure, axes = panel(title=f'from {angle:g} deg', xlabel='equation', ylabel='objective [rad/s]')
        for colour, factor in zip(SERIES, DRAFT_FACTORS, strict=False):
            printed = list(p.printed_objective[factor, angle].values())
            here = [study.at(factor, angle).searched[e].genetic.value for e in p.equations]
            style: dict[str, Any] = {'color': colour, 'markersize': 4}
            hollow: dict[str, Any] = {'markerfacecolor': 'none', 'linewidth': 0.9, 'label': f'{factor:g} T printed'}
            axes.plot(places, printed, 'o--', **hollow, **style)
            axes.plot(places, here, 'o-', linewidth=1.2, label=f'{factor:g} T simulated', **style)
        axes.set_xticks(places)
        legend_below(axes)
        yield Drawing(f'objective_{angle:g}', f'objective value by equation, {angle:g} deg', figure)


def _against_angle(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    for name, (by, words) in product(spec['coefficients'], BY.items()):
        if name == "I'" and by == OURS:
            continue
        figure, axes = panel(title=f'{name} by {words}', xlabel='initial angle [deg]', ylabel=name)
        curves = zip(SERIES, DRAFT_FACTORS, strict=False)
        shown = np.concatenate([_one_curve(axes, study, name, by, factor, colour) for colour, factor in curves])
        margin = 0.12 * float(np.ptp(shown)) or 0.1
        axes.set_ylim(shown.min() - margin, shown.max() + margin)
        legend_below(axes)
        given = '' if name == "I'" else f"; I' {study.inertia:g} given; dotted: the simulated hull"
        intervals = '; two standard deviations' if by == OURS else ''
        caption = f'{name} against initial angle, a curve a draft, by {words} on simulated records{given}{intervals}'
        yield Drawing(f'{name}_{by}'.replace("'", ''), caption, figure)


def _one_curve(axes: Axes, study: DecayStudy, name: str, by: str, factor: float, colour: str):
    """Draw the curve of one draft with that of the hull; the values that the figure has to show."""
    records = study.of_draft(factor)
    angles = [r.angle_deg for r in records]
    values, stds = np.array([coefficient(study, r, name, by) for r in records]).T
    hull = np.array([coefficient(study, r, name, HULL)[0] for r in records])
    style: dict[str, Any] = {'color': colour, 'marker': 'o', 'markersize': 4, 'linewidth': 1.2, 'capsize': 3}
    axes.errorbar(angles, values, TWO_STD * stds if by == OURS else None, label=f'{factor:g} T simulated', **style)
    axes.plot(angles, hull, ':', color=colour, linewidth=1.2)
    # what is not known at all must not hide the rest
    known = ~(stds > 2.0 * np.nanmax(np.abs([*hull, 0.0])))
    return np.concatenate([hull[np.isfinite(hull)], values[known], [0.0]])


def _all_coefficients(study: DecayStudy, spec: dict[str, Any]) -> Iterator[Drawing]:
    factor = spec['draft_factor']
    records = study.of_draft(factor)
    for by, words in BY.items():
        figure, axes = panel(title=f'{factor:g} T simulated, by {words}', xlabel='initial angle [deg]')
        styles = product(LINE_STYLES, SERIES)
        for name, (style, colour) in zip(["I'", *coefficient_names(study)], styles, strict=False):
            values = [coefficient(study, r, name, by)[0] for r in records]
            if np.isfinite(values).any():
                line = axes.plot([r.angle_deg for r in records], values, style, color=colour, linewidth=1.1)
                line[0].set(marker='o', markersize=4, label=name)
        axes.set_yscale('symlog', linthresh=1e-3)
        axes.legend(frameon=False, ncols=1, loc='center left', bbox_to_anchor=(1.0, 0.5))
        caption = f"all coefficients at {factor:g} T against initial angle, by {words}; I' {study.inertia:g} given"
        yield Drawing(f'coefficients_{factor:g}_{by}', caption, figure)


FIGURES = {
    'decays': _decays,
    'motion': _motion,
    'objective': _objective_by_equation,
    'against-angle': _against_angle,
    'coefficients': _all_coefficients,
}
