"""A tank's standard output of a campaign: conditions, peaks, extinction curves, damping in dimensions, uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import matplotlib
import numpy as np

from swath_sysid.attitude.identification.extinction import (
    Particulars,
    extinction_of,
    froude_number,
    measured_peaks,
    tank_quantities,
)
from swath_sysid.common.errors import InputError
from swath_sysid.report.campaign_figures import STYLE, legend_below, panel
from swath_sysid.report.campaign_page import Drawing
from swath_sysid.report.campaign_tables import LOADING_NAMES
from swath_sysid.report.extinction_tables import (
    CURVE_COLUMNS,
    CURVE_NOTE,
    QUANTITY_COLUMNS,
    curve_rows,
    peaks_table,
    quantity_row,
)
from swath_sysid.report.figures import MEASURED, SERIES, two_std_band
from swath_sysid.report.tables import Column, Table, digits

if TYPE_CHECKING:
    from swath_sysid.attitude.identification.identify import Identification
    from swath_sysid.campaign.evaluation import Condition
    from swath_sysid.campaign.manifest import PredictedDamping
    from swath_sysid.campaign.run import AxisOutcome, CampaignOutcome

PARTICULARS = {
    'length_m': 'length [m]',
    'beam_m': 'breadth [m]',
    'depth_m': 'depth [m]',
    'draft_m': 'draft [m]',
    'displacement_kg': 'displacement [kg]',
    'kg_m': 'KG [m]',
    'gm_transverse_m': 'GM transverse [m]',
    'gm_longitudinal_m': 'GM longitudinal [m]',
    'gyradius_m': 'radius of gyration [m]',
    'inertia_kg_m2': 'inertia with added inertia [kg m^2]',
    'water_density_kg_m3': 'water density [kg/m^3]',
    'water_temperature_c': 'water temperature [deg C]',
    'appendages': 'appendages',
    'basin': 'basin',
}


def conditions_table(outcome: CampaignOutcome) -> Table:
    """What was tried, in which water, under which conditions: as the manifest says."""
    craft = outcome.manifest.craft
    rows = [
        (name, value if isinstance(value, str) else f'{value:g}')
        for key, name in PARTICULARS.items()
        if (value := getattr(craft, key)) is not None
    ]
    if craft.depth_m is not None and craft.draft_m is not None:
        rows.append(('freeboard [m]', f'{craft.depth_m - craft.draft_m:g}'))
    for speed in sorted({t.entry.speed_m_s for t in outcome.trials if t.entry.speed_m_s is not None}):
        number = '' if craft.length_m is None else f', Froude number {froude_number(speed, craft.length_m):.3g}'
        rows.append(('speed [m/s]', f'{speed:g}{number}'))
    note = 'As the manifest says; at the design draft.'
    return Table('conditions', 'Conditions', note, (Column('what'), Column('value')), tuple(rows))


def particulars_of(outcome: CampaignOutcome, condition: Condition) -> Particulars:
    """What is known of the craft in one condition: beside its trials, or at the design draft of the craft itself."""
    craft = outcome.manifest.craft
    entries = [t.entry for t in outcome.trials if t.record is not None and t.record.condition == condition]
    design, by_craft = craft.design_loading(outcome.quantity), {}
    if design is not None and math.isclose(condition.loading, design):
        gm = craft.gm_transverse_m if condition.axis == 'roll' else craft.gm_longitudinal_m
        by_craft = {'mass_kg': craft.displacement_kg, 'inertia_kg_m2': craft.inertia_kg_m2, 'gm_m': gm}
    if outcome.quantity == 'displacement_kg':
        by_craft['mass_kg'] = condition.loading

    def known(key: str):
        return next((v for e in entries if (v := getattr(e, key)) is not None), by_craft.get(key))

    return Particulars(known('mass_kg'), known('gm_m'), known('inertia_kg_m2'), craft.length_m, craft.beam_m)


def _conditions(outcome: CampaignOutcome, axis: AxisOutcome):
    """Condition, its records, extinction curve or None, joint fit, inertia and particulars."""
    for condition, fits in sorted(axis.together.items()):
        members = [k for k, r in enumerate(axis.records) if r.condition == condition]
        problems = [axis.records[k].problem for k in members]
        peaks = [measured_peaks(p.motions[0], p.segments[0].period) for p in problems]
        try:
            curve = extinction_of(peaks)
        except InputError:
            curve = None
        particulars = particulars_of(outcome, condition)
        fit = fits[axis.choice]
        yield condition, members, peaks, curve, fit, particulars.inertia_of(fit.model), particulars


def extinction_tables(outcome: CampaignOutcome, axis: AxisOutcome) -> dict[str, Table]:
    """Tables of one axis: ``damping`` with its budget, ``extinction`` curves, and ``peaks``, every one."""
    damping, curves, labelled = [], [], []
    for condition, members, peaks, curve, fit, inertia, particulars in _conditions(outcome, axis):
        place = condition.loading, condition.initial_angle_deg
        labelled += [(axis.records[k].name, p) for k, p in zip(members, peaks, strict=True)]
        at = fit.reference_amplitude
        repeats = [axis.fits['simulation'][k][axis.choice].bands for k in members]
        found = tank_quantities(axis.motion, fit.bands, at, inertia, particulars, outcome.manifest.uncertainty, repeats)
        damping += [(*place, math.degrees(at), *quantity_row(q)) for q in found]
        terms = {name: fit.ratio(name) for name in fit.model.terms}
        if curve is not None:
            curves += [(*place, *row) for row in curve_rows(curve, terms, inertia, particulars, axis.motion)]
    where = Column(LOADING_NAMES[outcome.quantity], digits(4)), Column('initial angle [deg]', digits(4))
    note = (
        'Of the repeats of a condition together, at the geometric mean of the amplitudes seen. Standard uncertainties; '
        'U = 2 times their root sum of squares. Damping in N m s where the inertia is known (GM and mass, or inertia).'
    )
    budget, columns = (*where, Column('at [deg]', digits(3)), *QUANTITY_COLUMNS), (*where, *CURVE_COLUMNS)
    return {
        'damping': Table(f'damping_{axis.axis}', f'Damping, {axis.axis}', note, budget, tuple(damping)),
        'extinction': Table(
            f'extinction_{axis.axis}', f'Extinction curves, {axis.axis}', CURVE_NOTE, columns, tuple(curves)
        ),
        'peaks': peaks_table(f'peaks_{axis.axis}', labelled),
    }


def extinction_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> list[Drawing]:
    """Decrement and equivalent damping against amplitude, a figure a loading."""
    found = []
    by_loading: dict[float, list] = {}
    for item in _conditions(outcome, axis):
        by_loading.setdefault(item[0].loading, []).append(item)
    with matplotlib.rc_context(STYLE):
        for loading, items in by_loading.items():
            title, name = f'{LOADING_NAMES[outcome.quantity]} {loading:g}', f'{axis.axis}_{loading:g}'
            curves = f'Extinction curves, {title}: half a cycle, every repeat'
            damping = (
                f'Equivalent damping against amplitude, {title}: points of the decrements, bands of the fitted motion '
                '(two standard deviations), crosses as predicted'
            )
            found += [
                Drawing(f'extinction_{name}', curves, _extinction_figure(items, title, axis)),
                Drawing(f'damping_{name}', damping, _damping_figure(outcome, items, title, axis)),
            ]
    return found


def _extinction_figure(items: Sequence[tuple], title: str, axis: AxisOutcome):
    figure, axes = panel(title=title, xlabel=f'{axis.motion} mean amplitude [deg]', ylabel='decrement [deg]')
    for k, (condition, _, peaks, curve, *_) in enumerate(items):
        colour = SERIES[k % len(SERIES)]
        for p in peaks:
            axes.plot(np.degrees(p.mean_amplitude), np.degrees(p.decrement), '.', color=colour, markersize=4)
        if curve is not None:
            amplitude = np.linspace(0.0, max(p.mean_amplitude.max() for p in curve.peaks), 60)
            shown, label = np.degrees(curve.curve(amplitude)), f'from {condition.initial_angle_deg:g} deg'
            axes.plot(np.degrees(amplitude), shown, color=colour, linewidth=1.2, label=label)
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    if axes.lines and any(not str(line.get_label()).startswith('_') for line in axes.lines):
        legend_below(axes)
    return figure


def _damping_figure(outcome: CampaignOutcome, items: Sequence[tuple], title: str, axis: AxisOutcome):
    """In N m s where the inertia is known in every condition of the loading, else as a ratio."""
    dimensional = all(inertia is not None for *_, inertia, _ in items)
    symbol = {'roll': 'B44', 'pitch': 'B55'}[axis.motion]
    ylabel = f'{symbol} [N m s]' if dimensional else 'equivalent damping ratio'
    figure, axes = panel(title=title, xlabel=f'{axis.motion} mean amplitude [deg]', ylabel=ylabel)
    highest = 0.0
    for k, (condition, _, peaks, _, fit, inertia, _) in enumerate(items):
        colour, bands = SERIES[k % len(SERIES)], fit.bands
        frequency = bands.curves.frequency
        factor = 2.0 * inertia * frequency if dimensional else np.ones_like(frequency)
        value, std = bands.curves.damping_ratio * factor, bands.damping_ratio_std * factor
        amplitude = np.degrees(bands.curves.amplitude)
        two_std_band(axes, amplitude, value, std, color=colour, alpha=0.12)
        axes.plot(amplitude, value, color=colour, linewidth=1.2, label=f'from {condition.initial_angle_deg:g} deg')
        for p in peaks:
            half = 0.5 * p.logarithmic_decrement
            ratio = half / np.hypot(np.pi, half)
            at = np.interp(p.mean_amplitude, bands.curves.amplitude, factor)
            axes.plot(np.degrees(p.mean_amplitude), ratio * at, '.', color=colour, markersize=3, alpha=0.7)
        highest = max(highest, float(np.nanmax(value)))
    loading = items[0][0].loading
    fit, inertia = items[-1][4], items[-1][5]
    methods: dict[str, list] = {}
    for p in outcome.manifest.predictions:
        if p.axis in (None, axis.motion) and (p.loading is None or math.isclose(p.loading, loading)):
            value = _predicted(p, fit, inertia, dimensional)
            if value is not None:
                methods.setdefault(p.method, []).append((p.amplitude_deg, value))
    for k, (method, points) in enumerate(sorted(methods.items())):
        at, value = zip(*sorted(points), strict=True)
        axes.plot(at, value, '--', marker='xP^s'[k % 4], color=MEASURED, linewidth=0.8, label=method)
        highest = max(highest, *(value for _, value in points))
    axes.set_ylim(0.0, 1.4 * highest)
    legend_below(axes)
    return figure


def _predicted(prediction: PredictedDamping, fit: Identification, inertia: float | None, dimensional: bool):
    """A prediction in the unit of the figure; None where the inertia that this takes is not known."""
    curves = fit.bands.curves
    frequency = float(np.interp(np.radians(prediction.amplitude_deg), curves.amplitude, curves.frequency))
    moment, ratio = prediction.damping_n_m_s, prediction.damping_ratio
    given = moment if dimensional else ratio
    if given is not None or inertia is None:
        return given
    if ratio is not None:
        return ratio * 2.0 * inertia * frequency
    return None if moment is None else moment / (2.0 * inertia * frequency)
