"""The picture of an identification at sea: spectra, and the hull's response."""

import math
from typing import Any

import numpy as np

from swath_sysid.attitude.identification.at_sea import AtSeaIdentification
from swath_sysid.report.figures import BAND, MEASURED, MODEL, RESIDUAL, Axes, Figure, new_figure, plain_ticks, quiet


def at_sea_figure(found: AtSeaIdentification) -> Figure:
    """Draw an `AtSeaIdentification`."""
    figure = new_figure(15.0, 4.4)
    spectrum, excitation, response = (quiet(axes) for axes in figure.subplots(1, 3))
    s, unit = found.spectra, np.degrees(1.0) ** 2 * 2.0 * np.pi
    _spectra(spectrum, found, (unit * s.measured, 'measured'), (unit * s.fitted, 'fitted', MODEL))
    spectrum.set(xlabel='frequency [Hz]', ylabel=f'{found.model.axis} [deg²/Hz]')
    _spectra(excitation, found, (s.excitation, 'needed by the hull'), (s.fitted_excitation, 'fitted waves', RESIDUAL))
    excitation.set(xlabel='frequency [Hz]', ylabel='exciting moment / inertia [(rad/s²)² s]')
    _response(response, found)
    figure.suptitle(
        f'{found.model.axis} at sea: natural period {found.natural_period:.3f} ± {found.natural_period_std:.2g} s,  '
        f'equivalent damping ratio {found.damping_ratio:.3f} ± {found.damping_ratio_std:.2g}  '
        f'at {math.degrees(found.amplitude):.2g} deg',
        fontsize='medium',
    )
    return figure


def _in_hertz(axes: Axes, hertz: np.ndarray):
    """The range of the frequencies, with plain numbers."""
    axes.set_xlim(hertz[0], hertz[-1])
    plain_ticks(axes.xaxis)


def _spectra(axes: Axes, found: AtSeaIdentification, measured: tuple, fitted: tuple):
    """Values and label of the measured spectrum; values, label and colour of the fitted one."""
    hertz = found.spectra.frequency / (2.0 * np.pi)
    axes.loglog(hertz, measured[0], color=MEASURED, linewidth=1.0, label=measured[1])
    axes.loglog(hertz, fitted[0], '--', color=fitted[2], linewidth=1.4, label=fitted[1])
    _in_hertz(axes, hertz)
    _marks(axes, found)
    axes.legend(frameon=False, fontsize='small', loc='lower left')


def _marks(axes: Axes, found: AtSeaIdentification):
    """Natural frequency with two standard deviations; peak of the excitation."""
    natural = 1.0 / found.natural_period
    spread = 2.0 * found.natural_period_std / found.natural_period
    axes.axvspan(natural * (1.0 - min(spread, 0.9)), natural * (1.0 + spread), color=BAND, alpha=0.5, linewidth=0)
    axes.axvline(1.0 / found.peak_period, color=RESIDUAL, linewidth=0.8, linestyle=':')


def _response(axes: Axes, found: AtSeaIdentification):
    hertz = found.spectra.frequency / (2.0 * np.pi)
    own = _magnification(hertz, found.natural_period, found.damping_ratio)
    estimate = np.array([found.natural_period, found.damping_ratio])
    spread = np.zeros_like(own)
    values, vectors = np.linalg.eigh(found.estimate_covariance)
    for value, vector in zip(values, vectors.T, strict=True):
        moved = np.maximum(estimate + math.sqrt(max(value, 0.0)) * vector, 0.1 * estimate)
        spread += np.log(_magnification(hertz, *moved) / own) ** 2
    factor = np.exp(2.0 * np.sqrt(spread))
    style: dict[str, Any] = {'color': BAND, 'alpha': 0.6, 'linewidth': 0, 'label': 'two standard deviations'}
    axes.fill_between(hertz, own / factor, own * factor, **style)
    axes.loglog(hertz, own, color=MODEL, label='equivalent linear hull')
    axes.set(xlabel='frequency [Hz]', ylabel='response: angle / static angle [-]', ylim=(1e-2, 3.0 * own.max()))
    _in_hertz(axes, hertz)
    axes.axvline(1.0 / found.peak_period, color=RESIDUAL, linewidth=0.8, linestyle=':', label='peak of the excitation')
    axes.legend(frameon=False, fontsize='small', loc='lower left')


def _magnification(hertz: np.ndarray, period: float, damping: float):
    u = hertz * period
    return 1.0 / np.sqrt((1.0 - u * u) ** 2 + (2.0 * damping * u) ** 2)
