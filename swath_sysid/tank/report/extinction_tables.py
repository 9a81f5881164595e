"""A tank's standard output as tables: peaks, extinction curve, damping in dimensions, uncertainty."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import cycle
from typing import Self

import numpy as np

from swath_sysid.attitude.identification.peaks import Peaks, measured_peaks
from swath_sysid.attitude.identification.result import Identification
from swath_sysid.common.conventions import TWO_STD, digits
from swath_sysid.common.errors import InputError
from swath_sysid.report.figures import MEASURED, legend_below, panel, two_std_band
from swath_sysid.report.fit_summary import short_name
from swath_sysid.report.html_page import Drawing
from swath_sysid.report.published import PARTICULARS
from swath_sysid.report.tables import Column, Table, columns_of
from swath_sysid.tank.campaign.evaluation import Condition
from swath_sysid.tank.campaign.manifest import LOADING_NAMES, PredictedDamping, loading_in_words
from swath_sysid.tank.campaign.run import AxisOutcome, CampaignOutcome
from swath_sysid.tank.extinction import (
    Extinction,
    Particulars,
    TankQuantity,
    TypeB,
    extinction_of,
    froude_number,
    tank_quantities,
)
from swath_sysid.tank.report.campaign_tables import colour_of, style_of

#: Name, unit, and its power of an angle.
CURVE_TERMS = (('p1', '-', 0), ('p2', '1/deg', 1), ('p3', '1/deg^2', 2), ("Bertin's N", '1/deg', 1))
DAMPING_TERMS = (('b1', '1/s', 'N m s'), ('b2', '1/rad', 'N m s^2'), ('b3', 's/rad^2', 'N m s^3'))
PEAK_COLUMNS = columns_of(
    {
        'record': str,
        'peak': str,
        'time [s]': digits(5),
        'angle [deg]': digits(4),
        'mean amplitude [deg]': digits(4),
        'decrement [deg]': digits(3),
        'logarithmic decrement per cycle': digits(3),
        'period [s]': digits(4),
        "Bertin's N [1/deg]": digits(3),
    }
)
SOURCES = {
    'sensor_scale': 'sensor scale',
    'time_base': 'time base',
    'mass': 'mass',
    'metacentric_height': 'GM',
    'inertia': 'inertia',
}
CURVE_COLUMNS = columns_of(
    {
        'quantity': str,
        'unit': str,
        'extinction curve': digits(4),
        'std': digits(2),
        'motion fit': digits(4),
        'motion fit std': digits(2),
        'times inertia': digits(4),
        'its unit': str,
        'without dimension': digits(4),
    }
)
CURVE_NOTE = (
    'Extinction curve: decrement = p1 a + p2 a^2 + p3 a^3, where a is the mean amplitude in deg. Its terms correspond '
    'to linear, quadratic and cubic damping over inertia, b1, b2 and b3; the motion fit gives the same coefficients '
    'from the whole decay. The columns "times inertia" and "without dimension" are of the motion fit: roll is divided '
    'by rho V B^2, pitch by rho V L^2, and the unit of time is sqrt(B / 2 g) or sqrt(L / g). The curve has no term for '
    'dry friction, which therefore shows as a large p1 and a negative p2.'
)
METHOD_ERROR = (
    'The peaks of the fitted motion give the same curve, so the formula of the curve does not suit this craft: it is '
    'for a symmetric craft with weak damping. Use the motion fit.'
)
UNCERTAINTIES = 'U (k = 2)', 'type A, fit', 'type A, repeats', *(f'type B, {name}' for name in SOURCES.values())
QUANTITY_COLUMNS = columns_of(
    {'quantity': str, 'unit': str, 'value': digits(5), **dict.fromkeys(UNCERTAINTIES, digits(2))}
)


def peaks_table(name: str, labelled: Iterable[tuple[str, Peaks]]) -> Table:
    """Every turning point with its decrement, angles in deg, of records with their names; the name is the file's."""
    rows = []
    for label, peaks in labelled:
        # a decrement belongs to the turning point between its two half cycles
        between = np.pad(
            [
                np.degrees(peaks.mean_amplitude),
                np.degrees(peaks.decrement),
                peaks.logarithmic_decrement,
                peaks.period,
                np.radians(peaks.bertin),
            ],
            ((0, 0), (1, 1)),
            constant_values=np.nan,
        )
        table = np.vstack([peaks.time, np.degrees(peaks.angle), between]).T.tolist()
        rows += [(label, number, *values) for number, values in enumerate(table, 1)]
    note = 'A decrement is the amplitude before a peak less that after it, each half a double amplitude: trim cancels.'
    return Table(name, 'Peaks and decrements', note, PEAK_COLUMNS, tuple(rows))


def _damping_units(particulars: Particulars, axis: str):
    """What moments of b1, b2, b3 are divided by to be dimensionless; None where mass or size is not known."""
    linear, size = particulars.damping_unit(axis), particulars.breadth if axis == 'roll' else particulars.length
    if linear is None or particulars.mass is None or size is None:
        return None, None, None
    quadratic = particulars.mass * size**2
    return linear, quadratic, quadratic**2 / linear


def curve_rows(
    extinction: Extinction,
    model_terms: Mapping[str, tuple[float, float]],
    inertia: float | None,
    particulars: Particulars,
    axis: str,
) -> list[tuple]:
    """Rows of the extinction curve, then of the damping terms by curve and by fitted motion; inertia in kg m^2."""
    values, stds = [*extinction.coefficients, extinction.bertin], [*extinction.std, extinction.bertin_std]
    rows: list[tuple] = [
        (name, unit, *(float(each * np.radians(1.0) ** power) for each in (value, std)), None, None, None, '', None)
        for (name, unit, power), value, std in zip(CURVE_TERMS, values, stds, strict=True)
    ]
    for (name, unit, moment), value, std, divisor in zip(
        DAMPING_TERMS, extinction.damping, extinction.damping_std, _damping_units(particulars, axis), strict=True
    ):
        fitted, fitted_std = model_terms.get(name, (None, None))
        dimensional = None if inertia is None or fitted is None else inertia * float(fitted)
        bare = None if dimensional is None or divisor is None else dimensional / divisor
        moment = '' if dimensional is None else moment
        rows.append((name, unit, float(value), float(std), fitted, fitted_std, dimensional, moment, bare))
    return rows


def curve_table(name: str, title: str, rows: Sequence[tuple], where: tuple[Column, ...] = ()) -> Table:
    """Rows of `curve_rows`, each after its values of ``where``; marked where curve and motion fit differ by more than
    their intervals.
    """
    first = len(where)
    marks: dict[tuple[int, int], str] = {}
    apart: Counter[str] = Counter()
    for k, row in enumerate(rows):
        term, _, curve, std, fitted, fitted_std, *_ = row[first:]
        if fitted is not None and std > 0.0 and abs(curve - fitted) > TWO_STD * (std + fitted_std):
            apart[term] += 1
            marks |= {(k, first + place): 'beyond' for place in (2, 4)}
    conditions = len({row[:first] for row in rows})
    named = ', '.join(
        f'{term} (in {count} of {conditions} conditions)' if first else term for term, count in apart.items()
    )
    finding = named and (
        'The extinction curve, which sees the peaks alone, and the motion fit differ by more than their intervals in: '
        f'{named}.'
    )
    return Table(name, title, CURVE_NOTE, (*where, *CURVE_COLUMNS), tuple(rows), marks, finding)


def quantity_row(quantity: TankQuantity) -> tuple:
    """One `TankQuantity` as the values of ``QUANTITY_COLUMNS``."""
    type_b = (quantity.type_b.get(source) for source in SOURCES)
    return quantity.name, quantity.unit, quantity.value, quantity.expanded, quantity.fit, quantity.repeats, *type_b


def _is_of_fitted_motion(curve: Extinction, identification: Identification):
    """Whether the peaks of the fitted motion give the same damping terms as the curve of the measured ones."""
    simulated = [
        replace(
            r.motion, angle=None if r.motion.angle is None else r.angle, rate=None if r.motion.rate is None else r.rate
        )
        for r in identification.records
    ]
    own = extinction_of(
        [measured_peaks(motion, r.segment.period) for motion, r in zip(simulated, identification.records, strict=True)]
    )
    apart = np.abs(own.damping - curve.damping)
    return bool(np.all(apart <= TWO_STD * (own.damping_std + curve.damping_std)))


def tank_tables(identification: Identification, particulars: Particulars, type_b: TypeB) -> list[Table]:
    """The tables of one `Identification`: peaks, extinction curve where the records hold one, damping."""
    model, axis = identification.model, identification.model.axis
    labelled = [
        (short_name(r.motion.source), measured_peaks(r.motion, r.segment.period)) for r in identification.records
    ]
    terms = {name: (value, identification.std[name]) for name, value in model.terms.items()}
    inertia = particulars.inertia_of(model)
    at = identification.reference_amplitude
    quantities = tank_quantities(axis, identification.bands, at, inertia, particulars, type_b)
    found = [peaks_table('peaks', labelled)]
    try:
        curve = extinction_of([p for _, p in labelled])
        rows = curve_rows(curve, terms, inertia, particulars, axis)
        table = curve_table('extinction', 'Extinction curve and damping terms', rows)
        if table.finding and _is_of_fitted_motion(curve, identification):
            table = replace(table, finding=f'{table.finding} {METHOD_ERROR}')
        found.append(table)
    except InputError as error:
        found[0] = replace(found[0], note=f'{error}.')
    title = f'Damping at {math.degrees(at):.3g} deg and its uncertainty'
    note = (
        'Standard uncertainties; U = 2 times their root sum of squares, with the larger of fit and repeats as type A.'
    )
    return [*found, Table('damping', title, note, QUANTITY_COLUMNS, tuple(map(quantity_row, quantities)))]


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
    used = [(t.record.condition, t.entry) for t in outcome.trials if t.record is not None]
    for what, key, unit in (('mass', 'mass_kg', 'kg'), ('GM', 'gm_m', 'm'), ('inertia', 'inertia_kg_m2', 'kg m^2')):
        known = {
            (f'{c.axis} {what}' if key != 'mass_kg' else what, c.loading): value
            for c, entry in used
            if (value := getattr(entry, key)) is not None
        }
        for (name, loading), value in sorted(known.items()):
            rows.append((f'{name} [{unit}] at {loading_in_words(outcome.quantity, loading)}', f'{value:g}'))
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
    unsuited = False
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
            apart = curve_table('', '', rows).finding
            unsuited = unsuited or bool(apart and _is_of_fitted_motion(each.curve, fit))
    where = columns_of({loading: digits(4), 'initial angle [deg]': digits(4)})
    note = (
        'Of the repeats of a condition together, at the geometric mean of the amplitudes seen. Standard uncertainties; '
        'U = 2 times their root sum of squares. Damping in N m s where the inertia is known (GM and mass, or inertia).'
    )
    extinction = curve_table(f'extinction_{axis.axis}', f'Extinction curves, {axis.axis}', curves, where)
    if unsuited:
        extinction = replace(extinction, finding=f'{extinction.finding} {METHOD_ERROR}')
    budget_columns = (*where, Column('at [deg]', digits(3)), *QUANTITY_COLUMNS)
    return {
        'damping': Table(f'damping_{axis.axis}', f'Damping, {axis.axis}', note, budget_columns, tuple(damping)),
        'extinction': extinction,
        'peaks': peaks_table(f'peaks_{axis.axis}', labelled),
    }


def extinction_drawings(outcome: CampaignOutcome, axis: AxisOutcome) -> Iterator[Drawing]:
    """Decrement and equivalent damping against amplitude, a figure a loading."""
    every = _Decays.all_of(outcome, axis)
    for loading in sorted({each.condition.loading for each in every}):
        items = [each for each in every if each.condition.loading == loading]
        title, name = loading_in_words(outcome.quantity, loading), f'{axis.axis}_{loading:g}'
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
    for each in items:
        colour, style = colour_of(axis, each.condition.loading), style_of(axis, each.condition.initial_angle_deg)
        for p in each.peaks:
            at, marker = np.degrees(p.mean_amplitude), style['marker']
            axes.plot(at, np.degrees(p.decrement), marker, color=colour, markersize=3, markerfacecolor='none')
        if each.curve is not None:
            amplitude = np.linspace(0.0, max(p.mean_amplitude.max() for p in each.curve.peaks), 60)
            shown = np.degrees(each.curve.curve(amplitude))
            axes.plot(np.degrees(amplitude), shown, style['linestyle'], color=colour, linewidth=1.2, label=each.label)
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
    for decays in items:
        where = decays.condition
        colour, style = colour_of(axis, where.loading), style_of(axis, where.initial_angle_deg)
        bands = decays.fit.bands
        curves = bands.curves
        factor = 2.0 * (decays.inertia or 0.0) * curves.frequency if dimensional else np.ones_like(curves.frequency)
        value, amplitude = curves.damping_ratio * factor, np.degrees(curves.amplitude)
        two_std_band(axes, amplitude, value, bands.damping_ratio_std * factor, color=colour, alpha=0.12)
        axes.plot(amplitude, value, style['linestyle'], color=colour, linewidth=1.2, label=decays.label)
        for p in decays.peaks:
            half = 0.5 * p.logarithmic_decrement
            ratio = half / np.hypot(np.pi, half) * np.interp(p.mean_amplitude, curves.amplitude, factor)
            axes.plot(np.degrees(p.mean_amplitude), ratio, style['marker'], color=colour, markersize=3, alpha=0.7)
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
