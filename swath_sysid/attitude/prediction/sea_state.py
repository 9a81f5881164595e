"""Sea state from the craft's motion: height and periods of the heave at the sensor, and the axis of the waves.

It is the heave's, not the sea's: a craft does not follow waves shorter than a few of its lengths, and under way its
periods are those of encounter.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import fft

from swath_sysid.attitude.motion.vertical import BAND_HZ
from swath_sysid.common.errors import InputError

MIN_DURATION = 300.0  #: s; a shorter record holds too few waves.
_SEGMENT = 200.0  #: s; resolves the peak of a swell of 20 s and leaves ten segments in 20 minutes.
_INDEPENDENT_BINS = 1.5  #: Bandwidth of a Hann window in bins (Harris 1978, table 1).
#: Independent segments of N half-overlapping ones under a Hann window over N / 2 (Welch 1967).
_SEGMENTS_IN_EFFECT = 0.95
_COHERENT = 0.6
_DRAWS = 400
#: No craft heaves so slowly: accelerations there are the sensor's own noise.
_BELOW_THE_WAVES_HZ = (0.015, 0.035)
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
    peak_period_interval: tuple[float, float]  #: Central 95 %, s.
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


def sea_state(acceleration: np.ndarray, roll: np.ndarray, pitch: np.ndarray, step: float, seed: int = 0) -> SeaState:
    """The sea state from vertical acceleration, m/s^2 upwards, and roll and pitch, rad, (N,), finite at even steps, s.

    ``seed`` is for the interval of the peak period. Raises `InputError` where the record is too short, or the heave is
    within the sensor's noise.
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
    below = (frequency > _BELOW_THE_WAVES_HZ[0]) & (frequency < _BELOW_THE_WAVES_HZ[1])
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
    segments = _SEGMENTS_IN_EFFECT * (2.0 * duration / (rows * step) - 1.0)
    squared = spectrum**2 / (1.0 + 1.0 / segments)
    of_m0 = (squared.sum() * width / duration) / m0**2
    of_ratio = (squared * (1.0 / m0 - frequency**2 / m2) ** 2).sum() * width / duration
    period = math.sqrt(m0 / m2)
    axis, axis_std = _axis(spectra[..., inside], spectrum, segments)
    return SeaState(
        duration,
        height,
        0.5 * height * math.sqrt(of_m0),
        period,
        0.5 * period * math.sqrt(of_ratio),
        1.0 / _peak_frequency(frequency, spectrum),
        _peak_interval(frequency, spectrum, segments, seed),
        axis,
        axis_std,
        least_height,
        frequency,
        spectrum,
    )


def _peak_frequency(frequency: np.ndarray, spectrum: np.ndarray):
    """Frequency of the spectrum's maximum, shape (...), by the parabola through the logarithms of three bins."""
    top = np.clip(np.argmax(spectrum, axis=-1), 1, frequency.size - 2)
    before, at, after = (
        np.log(np.take_along_axis(spectrum, np.expand_dims(top + k, -1), axis=-1)[..., 0]) for k in (-1, 0, 1)
    )
    curvature = before - 2.0 * at + after
    shift = np.where(curvature < 0.0, 0.5 * (before - after) / np.minimum(curvature, -1e-12), 0.0)
    return frequency[top] + np.clip(shift, -0.5, 0.5) * (frequency[1] - frequency[0])


def _peak_interval(frequency: np.ndarray, spectrum: np.ndarray, segments: float, seed: int):
    """Interval from draws of equally uncertain spectra (chi-squared), widened by half the resolution either way."""
    rng = np.random.default_rng(seed)
    groups = np.floor(np.arange(frequency.size) / _INDEPENDENT_BINS).astype(int)
    drawn = rng.chisquare(2.0 * segments, (_DRAWS, groups[-1] + 1))[:, groups] / (2.0 * segments)
    low, high = np.quantile(_peak_frequency(frequency, spectrum * drawn), (0.025, 0.975))
    half = 0.5 * (frequency[1] - frequency[0])
    return float(1.0 / (high + half)), float(1.0 / (low - half))


def cross_spectra(channels: np.ndarray, step: float, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """One-sided cross spectra by Welch (1967) of channels (C, N), in segments of ``rows`` under a Hann window.

    Frequencies (F,), Hz, and spectra (C, C, F), units of row times column by Hz; the column leads by the phase angle.
    """
    starts = np.arange(0, channels.shape[1] - rows + 1, rows - rows // 2)
    segments = channels[:, starts[:, None] + np.arange(rows)]
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi / rows * np.arange(rows))
    lines = fft.rfft((segments - segments.mean(axis=-1, keepdims=True)) * window)
    density = np.full(lines.shape[-1], 2.0 * step / (window**2).sum())
    density[0] *= 0.5
    if rows % 2 == 0:
        density[-1] *= 0.5
    return fft.rfftfreq(rows, step), np.einsum('asf,bsf->abf', lines.conj(), lines) * density / starts.size


def _axis(spectra: np.ndarray, spectrum: np.ndarray, segments: float):
    """The waves' axis from cross spectra of acceleration and slopes, which are a quarter period from heave.

    The slope is -pitch along the bow and roll to port; acceleration is heave with the opposite sign.
    """
    of_heave, quadrature = spectra[0, 0].real, spectra[0, 1:].imag
    power = np.array([spectra[1, 1].real, spectra[2, 2].real])
    coherence = (quadrature**2).sum(axis=0) / np.maximum(of_heave * power.sum(axis=0), 1e-300)
    weight = np.where(coherence > _COHERENT, spectrum, 0.0)
    if not weight.sum() > 0.5 * spectrum.sum():
        return math.nan, math.nan
    along, across = quadrature / np.sqrt(of_heave)
    angles = np.arctan2(across, along)
    mean = (weight * np.exp(2j * angles)).sum() / weight.sum()
    # each frequency's angle is as uncertain as its coherence leaves it (Bendat and Piersol 2010, section 9.1)
    variance = (1.0 - coherence) / (2.0 * segments * np.maximum(coherence, _COHERENT))
    std = math.sqrt((weight**2 * variance).sum() * _INDEPENDENT_BINS) / weight.sum()
    return float(0.5 * np.angle(mean)), float(std)
