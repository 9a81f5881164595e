"""A tank's standard output of a campaign: conditions, peaks, extinction curves, damping in dimensions, uncertainty."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import cycle
from typing import Self

import numpy as np

from swath_sysid.attitude.identification.peaks import Peaks, measured_peaks
from swath_sysid.attitude.identification.result import Identification
from swath_sysid.common.conventions import digits
from swath_sysid.common.errors import InputError
from swath_sysid.report.figures import MEASURED, SERIES, legend_below, panel, two_std_band
from swath_sysid.report.html_page import Drawing
from swath_sysid.report.published import PARTICULARS
from swath_sysid.report.tables import Column, Table, columns_of
from swath_sysid.tank.campaign.evaluation import Condition
from swath_sysid.tank.campaign.manifest import PredictedDamping
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.extinction import (
    Extinction,
    Particulars,
    extinction_of,
    froude_number,
    tank_quantities,
)
from swath_sysid.tank.report.campaign_tables import LOADING_NAMES
from swath_sysid.tank.report.extinction_tables import (
    QUANTITY_COLUMNS,
    curve_rows,
    curve_table,
    peaks_table,
    quantity_row,
)


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
    return Table('conditions', '', note, (Column('what'), Column('value')), tuple(rows))


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


@dataclass(frozen=True)
class _Decays:
    """The decays of one condition."""

    condition: Condition
    members: list[int]  #: Places of its records.
    peaks: list[Peaks]  #: Of each record.
    fit: Identification  #: Of all together.
    particulars: Particulars

    @classmethod
    def all_of(cls, outcome: CampaignOutcome, axis: AxisOutcome) -> list[Self]:
        """Of every condition of an axis."""
        found = []
        for condition, fits in sorted(axis.together.items()):
            members = [k for k, r in enumerate(axis.records) if r.condition == condition]
            problems = [axis.records[k].problem for k in members]
            peaks = [measured_peaks(p.motions[0], p.segments[0].period) for p in problems]
            found.append(cls(condition, members, peaks, fits[axis.choice], particulars_of(outcome, condition)))
        return found

    @cached_property
    def inertia(self) -> float | None:
        """kg m^2, where it is known."""
        return self.particulars.inertia_of(self.fit.model)

    @cached_property
    def curve(self) -> Extinction | None:
        """The extinction curve, where there are turning points enough."""
        try:
            return extinction_of(self.peaks)
        except InputError:
            return None

    @property
    def label(self) -> str:
        """Of the legends."""
        return f'from {self.condition.initial_angle_deg:g} deg'


def extinction_tables(outcome: CampaignOutcome, axis: AxisOutcome) -> dict[str, Table]:
    """Tables of one axis: ``damping`` with its budget, ``extinction`` curves, and ``peaks``, every one."""
    damping, curves, labelled = [], [], []
    loading = LOADING_NAMES[outcome.quantity]
    for each in _Decays.all_of(outcome, axis):
        fit, place = each.fit, (each.condition.loading, each.condition.initial_angle_deg)
        labelled += [(axis.records[k].name, p) for k, p in zip(each.members, each.peaks, strict=True)]
        at, repeats = fit.reference_amplitude, [axis.fits['simulation'][k][axis.choice].bands for k in each.members]
        budget = outcome.manifest.uncertainty
        found = tank_quantities(axis.motion, fit.bands, at, each.inertia, each.particulars, budget, repeats)
        damping += [(*place, math.degrees(at), *quantity_row(q)) for q in found]
        if each.curve is not None:
            terms = {name: fit.ratio(name) for name in fit.model.terms}
            rows = curve_rows(each.curve, terms, each.inertia, each.particulars, axis.motion)
            curves += [(*place, *row) for row in rows]
    where = columns_of({loading: digits(4), 'initial angle [deg]': digits(4)})
    note = (
        'Of the repeats of a condition together, at the geometric mean of the amplitudes seen. Standard uncertainties; '
        'U = 2 times their root sum of squares. Damping in N m s where the inertia is known (GM and mass, or inertia).'
    )
    budget_columns = (*where, Column('at [deg]', digits(3)), *QUANTITY_COLUMNS)
    return {
        'damping': Table(f'damping_{axis.axis}', f'Damping, {axis.axis}', note, budget_columns, tuple(damping)),
        'extinction': curve_table(f'extinction_{axis.axis}', f'Extinction curves, {axis.axis}', curves, where),
        'peaks': peaks_table(f'peaks_{axis.axis}', labelled),
    }


def extinction_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Decrement and equivalent damping against amplitude, a figure a loading."""
    every = _Decays.all_of(outcome, axis)
    for loading in sorted({each.condition.loading for each in every}):
        items = [each for each in every if each.condition.loading == loading]
        title, name = f'{LOADING_NAMES[outcome.quantity]} {loading:g}', f'{axis.axis}_{loading:g}'
        curves = f'Extinction curves, {title}: half a cycle, every repeat'
        predicted = ', crosses as predicted' if outcome.manifest.predictions else ''
        damping = (
            f'Equivalent damping against amplitude, {title}: points of the decrements, bands of the fitted motion '
            f'(two standard deviations){predicted}'
        )
        yield Drawing(f'extinction_{name}', curves, _extinction_figure(items, title, axis))
        yield Drawing(f'damping_{name}', damping, _damping_figure(outcome, items, title, axis))


def _extinction_figure(items: Sequence[_Decays], title: str, axis: AxisOutcome):
    figure, axes = panel(title=title, xlabel=f'{axis.motion} mean amplitude [deg]', ylabel='decrement [deg]')
    for colour, each in zip(cycle(SERIES), items):
        for p in each.peaks:
            axes.plot(np.degrees(p.mean_amplitude), np.degrees(p.decrement), '.', color=colour, markersize=4)
        if each.curve is not None:
            amplitude = np.linspace(0.0, max(p.mean_amplitude.max() for p in each.curve.peaks), 60)
            shown = np.degrees(each.curve.curve(amplitude))
            axes.plot(np.degrees(amplitude), shown, color=colour, linewidth=1.2, label=each.label)
    axes.set(xlim=(0.0, None), ylim=(0.0, None))
    legend_below(axes)
    return figure


def _damping_figure(outcome: CampaignOutcome, items: Sequence[_Decays], title: str, axis: AxisOutcome):
    """In N m s where the inertia is known in every condition of the loading, else as a ratio."""
    dimensional = all(each.inertia is not None for each in items)
    symbol = {'roll': 'B44', 'pitch': 'B55'}[axis.motion]
    ylabel = f'{symbol} [N m s]' if dimensional else 'damping ratio [-]'
    figure, axes = panel(title=title, xlabel=f'{axis.motion} mean amplitude [deg]', ylabel=ylabel)
    highest = 0.0
    for colour, decays in zip(cycle(SERIES), items):
        bands = decays.fit.bands
        curves = bands.curves
        factor = 2.0 * (decays.inertia or 0.0) * curves.frequency if dimensional else np.ones_like(curves.frequency)
        value, amplitude = curves.damping_ratio * factor, np.degrees(curves.amplitude)
        two_std_band(axes, amplitude, value, bands.damping_ratio_std * factor, color=colour, alpha=0.12)
        axes.plot(amplitude, value, color=colour, linewidth=1.2, label=decays.label)
        for p in decays.peaks:
            half = 0.5 * p.logarithmic_decrement
            ratio = half / np.hypot(np.pi, half) * np.interp(p.mean_amplitude, curves.amplitude, factor)
            axes.plot(np.degrees(p.mean_amplitude), ratio, '.', color=colour, markersize=3, alpha=0.7)
        highest = max(highest, float(np.nanmax(value)))
    methods: dict[str, list] = {}
    loading = items[0].condition.loading
    for each in outcome.manifest.predictions:
        if each.axis in (None, axis.motion) and (each.loading is None or math.isclose(each.loading, loading)):
            predicted = _predicted(each, items[-1], dimensional)
            if predicted is not None:
                methods.setdefault(each.method, []).append((each.amplitude_deg, predicted))
    for marker, (method, points) in zip(cycle('XP^s'), sorted(methods.items())):
        at, value = zip(*sorted(points), strict=True)
        axes.plot(at, value, '--', marker=marker, color=MEASURED, linewidth=0.8, label=method)
        highest = max(highest, *value)
    axes.set_ylim(0.0, 1.4 * highest)
    legend_below(axes)
    return figure


def _predicted(prediction: PredictedDamping, decays: _Decays, dimensional: bool):
    """A prediction in the unit of the figure; None where the inertia that this takes is not known."""
    curves, inertia = decays.fit.bands.curves, decays.inertia
    moment, ratio = prediction.damping_n_m_s, prediction.damping_ratio
    given = moment if dimensional else ratio
    if given is not None or inertia is None:
        return given
    at = float(np.interp(np.radians(prediction.amplitude_deg), curves.amplitude, curves.frequency))
    if ratio is not None:
        return 2.0 * inertia * at * ratio
    return None if moment is None else moment / (2.0 * inertia * at)
