"""The picture of a fit: motion, residual and curves against amplitude; of one at sea, spectra and response."""

import math
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.terms import RATIO_UNITS
from swath_sysid.attitude.identification.at_sea import AtSeaIdentification, FittedSpectra
from swath_sysid.attitude.identification.result import Identification
from swath_sysid.report import figures
from swath_sysid.report.fit_summary import short_name, spread_of

MAX_PANELS = 12  #: Of records that are drawn, the first.


def fit_figure(identification: Identification) -> figures.Figure:
    """Measured and simulated motion with residual of each record, and the curves with bands."""
    records = identification.records[:MAX_PANELS]
    columns = min(3, len(records))
    rows = math.ceil(len(records) / columns)
    figure = figures.new_figure(11.0, 3.4 * rows + 3.6)
    halves: Any = figure.subfigures(2, 1, height_ratios=(3.4 * rows, 3.2))
    upper, lower = halves
    grid = upper.add_gridspec(2 * rows, columns, height_ratios=(3, 1) * rows)
    for index, record in enumerate(records):
        row, column = divmod(index, columns)
        motion_axes = figures.quiet(upper.add_subplot(grid[2 * row, column]))
        residual_axes = figures.quiet(upper.add_subplot(grid[2 * row + 1, column], sharex=motion_axes))
        figures.draw_fit(motion_axes, residual_axes, record.motion, record.angle, record.rate)
        if not index:
            motion_axes.legend(frameon=False, loc='upper right', ncols=2, fontsize='small')
        if len(records) > 1:
            motion_axes.set_title(short_name(record.motion.source), fontsize='small')
    left, right = lower.subplots(1, 2)
    _draw_curves(figures.quiet(left), figures.quiet(right), identification)
    figure.suptitle(_headline(identification), fontsize='medium', wrap=True)
    return figure


def _draw_curves(frequency_axes: figures.Axes, damping_axes: figures.Axes, identification: Identification):
    bands = identification.bands
    # a curve's amplitude is half the peak-to-peak motion, of which a damped release shows less than its first angle
    reach = 0.5 * max(np.ptp(each.angle) for each in identification.records)
    for axes, (label, (value, std)) in zip(
        (frequency_axes, damping_axes), figures.curves_of(bands).items(), strict=True
    ):
        seen = (bands.curves.amplitude <= reach) & np.isfinite(std)
        amplitude = np.degrees(bands.curves.amplitude[seen])
        figures.two_std_band(
            axes, amplitude, value[seen], std[seen], color=figures.BAND, alpha=0.6, label='two standard deviations'
        )
        axes.plot(amplitude, value[seen], color=figures.MODEL)
        axes.legend(frameon=False, fontsize='small')
        axes.set(xlabel=f'{identification.model.axis} amplitude [deg]', ylabel=label)
    damping_axes.set_ylim(bottom=0.0)


def _headline(identification: Identification):
    model = identification.model
    terms = [
        f'{name} {value:.4g} {spread_of(identification, name, identification.intervals)} {RATIO_UNITS[name]}'
        for name, value in model.terms.items()
    ]
    headline = f'R² {identification.r2:.5f},  period of small motions {model.natural_period:.3f} s'
    return f'{model.axis}, {model.equation.name}:  {headline}\n{",   ".join(terms)}'


def at_sea_figure(found: AtSeaIdentification) -> figures.Figure:
    """Draw an `AtSeaIdentification`."""
    figure = figures.new_figure(15.0, 4.4)
    spectrum, excitation, response = (figures.quiet(axes) for axes in figure.subplots(1, 3))
    unit = np.degrees(1.0) ** 2 * 2.0 * np.pi
    for place, s in enumerate(found.spectra):
        label = '' if place == 0 else '_'
        _spectrum(
            spectrum, s, (unit * s.measured, f'{label}measured'), (unit * s.fitted, f'{label}fitted', figures.MODEL)
        )
        needed = s.excitation, f'{label}needed by the hull'
        _spectrum(excitation, s, needed, (s.fitted_excitation, f'{label}fitted waves', figures.RESIDUAL))
    for axes in (spectrum, excitation):
        _in_hertz(axes, _hertz_of(found))
        _marks(axes, found)
        axes.legend(frameon=False, fontsize='small', loc='lower left')
    spectrum.set(xlabel='frequency [Hz]', ylabel=f'{found.model.axis} [deg²/Hz]')
    excitation.set(xlabel='frequency [Hz]', ylabel='exciting moment / inertia [(rad/s²)² s]')
    _response(response, found)
    period_std, damping_std = (
        f' ± {std:.2g}' if found.is_usable else '' for std in (found.natural_period_std, found.damping_ratio_std)
    )
    figure.suptitle(
        f'{found.model.axis} at sea: natural period {found.natural_period:.3f}{period_std} s,  '
        f'equivalent damping ratio {found.damping_ratio:.3f}{damping_std}  '
        f'at {math.degrees(found.amplitude):.2g} deg{"" if found.is_usable else " (not usable)"}',
        fontsize='medium',
    )
    return figure


def _in_hertz(axes: figures.Axes, hertz: np.ndarray):
    """The range of the frequencies, with plain numbers."""
    axes.set_xlim(hertz[0], hertz[-1])
    figures.plain_ticks(axes.xaxis)


def _hertz_of(found: AtSeaIdentification) -> np.ndarray:
    """The frequencies of all parts, in order, Hz."""
    return np.sort(np.concatenate([each.frequency for each in found.spectra])) / (2.0 * np.pi)


def _spectrum(axes: figures.Axes, part: FittedSpectra, measured: tuple, fitted: tuple):
    """Values and label of the measured spectrum; values, label and colour of the fitted one."""
    hertz = part.frequency / (2.0 * np.pi)
    axes.loglog(hertz, measured[0], color=figures.MEASURED, linewidth=1.0, label=measured[1])
    axes.loglog(hertz, fitted[0], '--', color=fitted[2], linewidth=1.4, label=fitted[1])


def _marks(axes: figures.Axes, found: AtSeaIdentification):
    """Natural frequency with two standard deviations; peak of the excitation."""
    natural = 1.0 / found.natural_period
    spread = 2.0 * found.natural_period_std / found.natural_period
    axes.axvspan(
        natural * (1.0 - min(spread, 0.9)), natural * (1.0 + spread), color=figures.BAND, alpha=0.5, linewidth=0
    )
    axes.axvline(1.0 / found.peak_period, color=figures.RESIDUAL, linewidth=0.8, linestyle=':')


def _response(axes: figures.Axes, found: AtSeaIdentification):
    hertz = _hertz_of(found)
    own = _magnification(hertz, found.natural_period, found.damping_ratio)
    estimate = np.array([found.natural_period, found.damping_ratio])
    spread = np.zeros_like(own)
    values, vectors = np.linalg.eigh(found.estimate_covariance)
    for value, vector in zip(values, vectors.T, strict=True):
        moved = np.maximum(estimate + math.sqrt(max(value, 0.0)) * vector, 0.1 * estimate)
        spread += np.log(_magnification(hertz, *moved) / own) ** 2
    factor = np.exp(2.0 * np.sqrt(spread))
    style: dict[str, Any] = {'color': figures.BAND, 'alpha': 0.6, 'linewidth': 0, 'label': 'two standard deviations'}
    axes.fill_between(hertz, own / factor, own * factor, **style)
    axes.loglog(hertz, own, color=figures.MODEL, label='equivalent linear hull')
    axes.set(xlabel='frequency [Hz]', ylabel='response: angle / static angle [-]', ylim=(1e-2, 3.0 * own.max()))
    _in_hertz(axes, hertz)
    axes.axvline(
        1.0 / found.peak_period, color=figures.RESIDUAL, linewidth=0.8, linestyle=':', label='peak of the excitation'
    )
    axes.legend(frameon=False, fontsize='small', loc='lower left')


def _magnification(hertz: np.ndarray, period: float, damping: float):
    u = hertz * period
    return 1.0 / np.sqrt((1.0 - u * u) ** 2 + (2.0 * damping * u) ** 2)
