"""A tank's standard output as tables: peaks, extinction curve, damping in dimensions, uncertainty."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from swath_sysid.attitude.identification.peaks import Peaks, measured_peaks
from swath_sysid.attitude.identification.result import Identification
from swath_sysid.common.conventions import TWO_STD, digits
from swath_sysid.common.errors import InputError
from swath_sysid.report.fit_summary import short_name
from swath_sysid.report.tables import Column, Table, columns_of
from swath_sysid.tank.extinction import (
    Extinction,
    Particulars,
    TankQuantity,
    TypeB,
    extinction_of,
    tank_quantities,
)

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
    'Extinction curve: decrement = p1 a + p2 a^2 + p3 a^3 over the mean amplitude a in deg, whose terms mean linear, '
    'quadratic and cubic damping over inertia b1, b2, b3. Beside them those of the motion fitted as a whole. Times '
    'inertia and without dimension: of the motion fit; roll over rho V B^2, pitch over rho V L^2, with sqrt(B / 2 g) '
    'or sqrt(L / g) for the unit of time. Dry friction, for which the curve has no term, makes its p1 large and p2 '
    'negative.'
)
METHOD_ERROR = (
    'The peaks of the fitted motion itself give the same curve, so it is the formula of the curve that errs here (it '
    'is for a symmetric craft with weak damping): use the motion fit.'
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
    note = 'The decrement per half-cycle is of half the double amplitudes before and after the peak: trim cancels.'
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
