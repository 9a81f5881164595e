"""The figures of a study of free decays, as the study orders them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.hull.simulation import simulate
from swath_sysid.campaign.papers.decay_study import DRAFT_FACTORS
from swath_sysid.report.campaign_figures import HEIGHT, LINE_STYLES, STYLE, WIDTH, legend_below
from swath_sysid.report.campaign_page import Drawing, figures
from swath_sysid.report.figures import MEASURED, MODEL, RESIDUAL, SERIES, TWO_STD, new_panel
from swath_sysid.report.paper_decay_numbers import BY, GENETIC, HULL, OURS, coefficient, coefficient_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from swath_sysid.campaign.papers.decay_study import DecayStudy


def drawn(study: DecayStudy, kind: str) -> str:
    """The figures of one kind; nothing where the study has none."""
    with matplotlib.rc_context(STYLE):
        drawings = [
            replace(drawing, caption=f'As figure {spec["number"]}: {drawing.caption}')
            for spec in study.publication.figures
            if spec['kind'] == kind
            for drawing in FIGURES[kind](study, spec)
        ]
    return figures(drawings)


def _panel(**labels: str):
    return new_panel(WIDTH, HEIGHT, **labels)


def _decays(study: DecayStudy, spec: dict[str, Any]):
    figure, axes = _panel(xlabel='time since release [s]', ylabel=f'{study.publication.axis} rate [rad/s]')
    for factor in DRAFT_FACTORS:
        motion = study.at(factor, spec['angle_deg']).problem.motions[0]
        axes.plot(motion.time - motion.time[0], motion.rate, linewidth=0.9, label=f'{factor:g} T')
    axes.legend(frameon=False, ncols=3)
    return [Drawing('decays', f'simulated rates at three drafts, released from {spec["angle_deg"]:g} deg', figure)]


def _motion(study: DecayStudy, spec: dict[str, Any]):
    record = study.at(spec['draft_factor'], spec['angle_deg'])
    motion, state = record.problem.motions[0], record.ours.states[0]
    searched = record.hull.from_terms(
        equation_named(study.publication.chosen), study.chosen(record).genetic.ratios, axis=motion.axis
    )
    models = [(searched, BY[GENETIC], MODEL, '--'), (record.ours.model, BY[OURS], RESIDUAL, '-')]
    for quantity, unit in (('angle', '[deg]'), ('rate', 'rate [deg/s]')):
        figure, axes = _panel(xlabel='time since release [s]', ylabel=f'{motion.axis} {unit}')
        time = motion.time - motion.time[0]
        measured = np.degrees(getattr(motion, quantity))
        axes.plot(time, measured, color=MEASURED, linewidth=0.7, alpha=0.7, label='simulated record')
        for model, label, colour, style in models:
            own = simulate(model.with_trim(state.trim), state.x + state.trim, state.rate, motion.time)
            axes.plot(time, np.degrees(own[quantity == 'rate']), style, color=colour, label=label)
        axes.legend(frameon=False)
        caption = (
            f'{quantity}, simulated record and identified models, {record.angle_deg:g} deg at {record.draft_factor:g} T'
        )
        yield Drawing(f'motion_{quantity}', caption, figure)


def _objective_by_equation(study: DecayStudy, spec: dict[str, Any]):
    p = study.publication
    for angle in sorted({r.angle_deg for r in study.records}):
        figure, axes = _panel(title=f'from {angle:g} deg', xlabel='equation', ylabel='objective [rad/s]')
        places = np.arange(1, len(p.equations) + 1)
        for k, factor in enumerate(DRAFT_FACTORS):
            printed = list(p.printed_objective[factor, angle].values())
            here = [study.at(factor, angle).searched[e].genetic.value for e in p.equations]
            style: dict[str, Any] = {'color': SERIES[k], 'markersize': 4}
            axes.plot(
                places, printed, 'o--', linewidth=0.9, markerfacecolor='none', label=f'{factor:g} T printed', **style
            )
            axes.plot(places, here, 'o-', linewidth=1.2, label=f'{factor:g} T simulated', **style)
        axes.set_xticks(places)
        legend_below(axes)
        yield Drawing(f'objective_{angle:g}', f'objective value by equation, {angle:g} deg', figure)


def _against_angle(study: DecayStudy, spec: dict[str, Any]):
    for name in spec['coefficients']:
        for by, words in BY.items():
            if name == "I'" and by == OURS:
                continue
            figure, axes = _panel(title=f'{name} by {words}', xlabel='initial angle [deg]', ylabel=name)
            shown = np.concatenate([_one_curve(axes, study, name, by, k) for k in range(len(DRAFT_FACTORS))])
            margin = 0.12 * float(np.ptp(shown)) or 0.1
            axes.set_ylim(shown.min() - margin, shown.max() + margin)
            legend_below(axes)
            caption = f'{name} against initial angle, a curve a draft, by {words}'
            if name != "I'":
                caption += f"; I' {study.inertia:g} given; dotted: the simulated hull"
            if by == OURS:
                caption += '; two standard deviations'
            yield Drawing(f'{name}_{by}'.replace("'", ''), caption, figure)


def _one_curve(axes: Axes, study: DecayStudy, name: str, by: str, k: int):
    """Draw the curve of the k-th draft with that of the hull; the values that the figure has to show."""
    records = study.of_draft(DRAFT_FACTORS[k])
    angles = [r.angle_deg for r in records]
    values, stds = np.array([coefficient(study, r, name, by) for r in records]).T
    hull = np.array([coefficient(study, r, name, HULL)[0] for r in records])
    style: dict[str, Any] = {
        'color': SERIES[k],
        'marker': 'o',
        'markersize': 4,
        'linewidth': 1.2,
        'label': f'{DRAFT_FACTORS[k]:g} T',
    }
    axes.errorbar(angles, values, TWO_STD * stds if by == OURS else None, capsize=3, **style)
    axes.plot(angles, hull, ':', color=SERIES[k], linewidth=1.2)
    # what is not known at all must not hide the rest
    known = ~(stds > 2.0 * np.nanmax(np.abs([*hull, 0.0])))
    return np.concatenate([hull[np.isfinite(hull)], values[known], [0.0]])


def _all_coefficients(study: DecayStudy, spec: dict[str, Any]):
    factor = spec['draft_factor']
    records = study.of_draft(factor)
    for by, words in BY.items():
        figure, axes = _panel(title=f'{factor:g} T, by {words}', xlabel='initial angle [deg]')
        for k, name in enumerate(["I'", *coefficient_names(study)]):
            values = [coefficient(study, r, name, by)[0] for r in records]
            if np.isfinite(values).any():
                style: dict[str, Any] = {
                    'color': SERIES[k % len(SERIES)],
                    'linestyle': LINE_STYLES[k // len(SERIES)],
                    'linewidth': 1.1,
                }
                axes.plot([r.angle_deg for r in records], values, marker='o', markersize=4, label=name, **style)
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
