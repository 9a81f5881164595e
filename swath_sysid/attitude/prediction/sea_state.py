"""Sea state from the craft's motion: height and periods of the heave at the sensor, and the axis of the waves.

It is the heave's, not the sea's: a craft does not follow waves shorter than a few of its lengths, and under way its
periods are those of encounter.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import fft
from scipy.special import fdtri

from swath_sysid.attitude.motion.vertical import BAND_HZ
from swath_sysid.common.errors import InputError

MIN_DURATION = 300.0  #: s; a shorter record holds too few waves.
_SEGMENT = 200.0  #: s; resolves the peak of a swell of 20 s and leaves ten segments in 20 minutes.
_MEASURABLE = 2.0  #: Least height over that from noise alone.


@dataclass(frozen=True)
class SeaState:
    """The sea state that the motion of a record shows."""

    duration: float  #: s of motion.
    significant_height: float  #: Four standard deviations of the heave, m.
    significant_height_std: float  #: m.
    mean_period: float  #: Mean zero-crossing period sqrt(m0 / m2), s.
    mean_period_std: float  #: s.
    peak_period: float  #: s; of the largest value of the spectrum.
    peak_period_interval: tuple[float, float]  #: s; of at least 95 %, as the peak is the largest of many lines.
    #: Line along which the waves run, either way, rad from the bow to port, -pi/2 to pi/2; NaN if not coherent.
    axis: float
    axis_std: float  #: rad; NaN likewise.
    least_height: float  #: m; a lower sea is indistinguishable from the sensor's noise.
    frequency: np.ndarray  #: (F,); Hz.
    spectrum: np.ndarray  #: (F,); m^2/Hz.


@dataclass(frozen=True)
class SeaReport:
    """The sea state, or why there is none."""

    state: SeaState | None
    reason: str = ''  #: Why there is none.


def sea_report(acceleration: np.ndarray, roll: np.ndarray, pitch: np.ndarray, step: float) -> SeaReport:
    """As `sea_state`, with the reason instead of an error."""
    try:
        return SeaReport(sea_state(acceleration, roll, pitch, step))
    except InputError as error:
        return SeaReport(None, str(error))


def sea_state(acceleration: np.ndarray, roll: np.ndarray, pitch: np.ndarray, step: float) -> SeaState:
    """The sea state from vertical acceleration, m/s^2 upwards, and roll and pitch, rad, (N,), finite at even steps, s.

    Raises `InputError` where the record is too short, or the heave is within the sensor's noise.
    """
    duration = acceleration.size * step
    if not duration > MIN_DURATION - 0.5 * step:
        raise InputError(
            f'{duration:.0f} s of motion hold too few waves: a sea state needs {MIN_DURATION / 60:.0f} min, better 20'
        )
    rows = round(min(_SEGMENT, duration / 3.0) / step)
    frequency, spectra = cross_spectra(np.stack([acceleration, -pitch, roll]), step, rows)
    of_acceleration = spectra[0, 0].real
    inside = (frequency >= BAND_HZ[0]) & (frequency <= BAND_HZ[1])
    # no craft heaves so slowly; the segments' mean leaks into the first bin, the waves into the last
    below = np.flatnonzero(frequency < BAND_HZ[0])[2:-1]
    frequency = frequency[inside]
    twice_integrated = (2.0 * math.pi * frequency) ** -4
    spectrum = of_acceleration[inside] * twice_integrated
    width = frequency[1] - frequency[0]
    m0, m2 = spectrum.sum() * width, (spectrum * frequency**2).sum() * width
    # white from there on, which is more than a sensor's noise is in the band of the waves
    of_noise = np.median(of_acceleration[below]) * twice_integrated.sum() * width
    height, least_height = 4.0 * math.sqrt(m0), _MEASURABLE * 4.0 * math.sqrt(of_noise)
    if not height > least_height:
        raise InputError(
            f'the waves are below the noise floor: a significant height of {height:.2g} m may be noise of the sensor, '
            f'which shows up to {least_height:.2g} m'
        )
    # a spectrum of few segments is too large where it is squared, by its own variance
    segments = independent_segments(rows, 2.0 * duration / (rows * step) - 1.0)
    squared = spectrum**2 / (1.0 + 1.0 / segments)
    of_m0 = (squared.sum() * width / duration) / m0**2
    of_ratio = (squared * (1.0 / m0 - frequency**2 / m2) ** 2).sum() * width / duration
    period = math.sqrt(m0 / m2)
    axis, axis_std = _axis(spectra[..., inside], spectrum, segments, rows)
    return SeaState(
        duration,
        height,
        0.5 * height * math.sqrt(of_m0),
        period,
        0.5 * period * math.sqrt(of_ratio),
        1.0 / _peak_frequency(frequency, spectrum),
        _peak_interval(frequency, spectrum, segments),
        axis,
        axis_std,
        least_height,
        frequency,
        spectrum,
    )


def _peak_frequency(frequency: np.ndarray, spectrum: np.ndarray):
    """Frequency of the spectrum's maximum, by the parabola through the logarithms of three bins."""
    top = min(max(int(np.argmax(spectrum)), 1), frequency.size - 2)
    before, at, after = np.log(spectrum[top - 1 : top + 2])
    curvature = before - 2.0 * at + after
    shift = 0.5 * (before - after) / curvature if curvature < 0.0 else 0.0
    return frequency[top] + min(max(shift, -0.5), 0.5) * (frequency[1] - frequency[0])


def _peak_interval(frequency: np.ndarray, spectrum: np.ndarray, segments: float):
    """Periods at which the spectrum is not significantly below its maximum (F test), half a bin wider either way."""
    equal = fdtri(2.0 * segments, 2.0 * segments, 0.95)
    likely = frequency[equal * spectrum >= spectrum.max()]
    half = 0.5 * (frequency[1] - frequency[0])
    return float(1.0 / (likely[-1] + half)), float(1.0 / (likely[0] - half))


def _hann(rows: int):
    return 0.5 - 0.5 * np.cos(2.0 * np.pi / rows * np.arange(rows))


def independent_segments(rows: int, count: float) -> float:
    """Independent segments that leave a spectrum as uncertain as ``count`` half-overlapping ones do (Welch 1967)."""
    window, half = _hann(rows), rows // 2
    overlap = (window[half:] @ window[: rows - half]) / (window @ window)
    return count / (1.0 + 2.0 * overlap**2)


def cross_spectra(channels: np.ndarray, step: float, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """One-sided cross spectra by Welch (1967) of channels (C, N), in segments of ``rows`` under a Hann window.

    Frequencies (F,), Hz, and spectra (C, C, F), units of row times column by Hz; the column leads by the phase angle.
    """
    starts = np.arange(0, channels.shape[1] - rows + 1, rows - rows // 2)
    segments = channels[:, starts[:, None] + np.arange(rows)]
    window = _hann(rows)
    lines = fft.rfft((segments - segments.mean(axis=-1, keepdims=True)) * window)
    density = np.full(lines.shape[-1], 2.0 * step / (window**2).sum())
    density[0] *= 0.5
    if rows % 2 == 0:
        density[-1] *= 0.5
    return fft.rfftfreq(rows, step), np.einsum('asf,bsf->abf', lines.conj(), lines) * density / starts.size


def _axis(spectra: np.ndarray, spectrum: np.ndarray, segments: float, rows: int):
    """The waves' axis from cross spectra of acceleration and slopes, which are a quarter period from heave.

    The slope is -pitch along the bow and roll to port; acceleration is heave with the opposite sign. The angles are
    weighted by the coherent part of the spectrum; where that is less than half of it, there is no axis.
    """
    of_heave, quadrature = spectra[0, 0].real, spectra[0, 1:].imag
    power = np.array([spectra[1, 1].real, spectra[2, 2].real])
    coherence = (quadrature**2).sum(axis=0) / np.maximum(of_heave * power.sum(axis=0), 1e-300)
    weight = coherence * spectrum
    if not weight.sum() > 0.5 * spectrum.sum():
        return math.nan, math.nan
    along, across = quadrature / np.sqrt(of_heave)
    angles = np.arctan2(across, along)
    mean = (weight * np.exp(2j * angles)).sum() / weight.sum()
    # each frequency's angle is as uncertain as its coherence leaves it (Bendat and Piersol 2010, section 9.1)
    variance = (spectrum**2 * coherence * (1.0 - coherence)).sum() / (2.0 * segments)
    # the window correlates neighbouring bins (Harris 1978)
    power_window = _hann(rows) ** 2
    bins = rows * (power_window @ power_window) / power_window.sum() ** 2
    return float(0.5 * np.angle(mean)), math.sqrt(variance * bins) / float(weight.sum())
