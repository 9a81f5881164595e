"""Rates compared with the derivatives of the angles: their axis, sign, scale, delay and offset."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

MIN_ANGLE = np.radians(0.25)  #: rad, standard deviation; a craft that moves less shows nothing.

#: rad/s, standard deviation of the derivative; slower angles may be the wander of an attitude filter.
MIN_RATE = np.radians(0.5)

#: Correlation from which a rate shows that the angle moves, though it does so slowly by stamps in a wrong unit.
SURE = 0.95

#: Share of an angle's power below the highest frequency that is looked at; what is above is mostly noise.
BAND_POWER = 0.98

#: Of the Nyquist frequency. An angle that fills more of it is too coarsely sampled, or too noisy, to be differentiated:
#: up to half of it, noise was taken for motion in 20 of 960 simulated decays of 1 to 3 deg, up to this in none.
WIDEST_BAND = 0.3

LIVELY = 0.9  #: Share of the energy of the angles' derivatives within the part of a stretch that is looked at.
SMOOTHING = 0.25  #: s over which derivatives are averaged to find that part.

MIN_ROWS = 40

MIN_SWINGS = 1.0  #: Periods of the highest frequency in a window, below which the window shows no swing.
LONGEST_LAG = 1.0  #: s either way.
LAG_OF_PERIOD = 0.45  #: Longest lag as a share of the mean period: beyond half of it a delay looks like a reversal.

OVERSAMPLING = 4


@dataclass(frozen=True)
class RateComparison:
    """What the rates have in common with the derivatives of roll and pitch.

    Yaw is left out on the side of the angles: compasses are too slow and too rough to be differentiated.
    """

    #: ndarray of bool, shape (2,); Angles that move enough, and smoothly enough, to be differentiated.
    moves: np.ndarray
    has_rate: np.ndarray  #: ndarray of bool, shape (3,); Rates of roll, pitch and yaw that are known.
    #: (3, 2); Correlation of rate i with the derivative of angle j at the same time; NaN where angle j does not move or
    #: there is no rate i.
    at_once: np.ndarray
    lagged: np.ndarray  #: (2,); Highest correlation of each rate with its own derivative over the lags.
    #: (2,); s at which it is reached, positive where the rate comes late, and the standard deviation of that.
    lag: np.ndarray
    #: (2,); s at which it is reached, positive where the rate comes late, and the standard deviation of that.
    lag_std: np.ndarray
    gain: np.ndarray  #: (2,); Rate over its own derivative at that lag by least squares, and its standard deviation.
    #: (2,); Rate over its own derivative at that lag by least squares, and its standard deviation.
    gain_std: np.ndarray
    freedom: np.ndarray  #: (2,); Degrees of freedom that these standard deviations rest on.
    share: np.ndarray  #: (2,); Standard deviation of each rate over that of its own derivative, in the band.
    #: (2,); Mean rate less the change of the angle over the time it took, rad/s; NaN where either is unknown.
    offset: np.ndarray

    @property
    def evidenced(self) -> np.ndarray:
        """Axes (0: roll, 1: pitch) that move while some rate is known, shape (0 to 2,)."""
        return np.flatnonzero(self.moves & self.has_rate.any())

    def agreement(self, arrangement: np.ndarray) -> float:
        """Mean correlation of the rates with the derivatives of the angles when rearranged; 0 where nothing moves.

        Args:
            arrangement: (3, 3); row i has +1 or -1 in the column of the angle whose derivative rate i holds.
        """
        rows = np.argmax(np.abs(arrangement), axis=0)
        correlations = [
            arrangement[rows[j], j] * self.at_once[rows[j], j] for j in self.evidenced if self.has_rate[rows[j]]
        ]
        return float(np.mean(correlations)) if correlations else 0.0


def compare_rates(step: float, angles: np.ndarray, rates: np.ndarray) -> RateComparison:
    """Compare rates with the derivatives of roll and pitch.

    Angle differences are compared with the mean rate between the same two samples, both tapered and limited to
    the band in which the angle has its power, so that the noise of neither is amplified.

    Args:
        step: s between rows, even.
        angles: (N, 2); roll and pitch without jumps, rad; a column of NaN is not known.
        rates: (N, 3); rates of roll, pitch and yaw as measured, rad/s.

    Correlations, gain and delay are those of the cross-spectrum: J. S. Bendat, A. G. Piersol, Random Data, 4th
    edition, Wiley, 2010, chapters 5 and 6. The standard deviation of the delay is its equation for the phase of a
    coherent pair over the mean circular frequency, with twice band times duration degrees of freedom.
    """
    differences, means = np.diff(angles, axis=0) / step, 0.5 * (rates[1:] + rates[:-1])
    known, has_rate = np.isfinite(differences).all(axis=0), np.isfinite(means).all(axis=0)
    offset = np.where(known & has_rate[:2], means[:, :2].mean(axis=0) - differences.mean(axis=0), np.nan)
    lively = _lively(differences, step)
    angles, differences, means = angles[lively], differences[lively], means[lively]
    size = len(differences)
    taper = _taper(size)[:, None]
    frequency = np.fft.rfftfreq(2 * size, step)
    spectra_of_rates, spectra = (
        np.fft.rfft((part - part.mean(axis=0)) * taper, 2 * size, axis=0) for part in (means, differences)
    )
    moves, at_once = np.zeros(2, dtype=bool), np.full((3, 2), np.nan)
    lagged, lag, lag_std, gain, gain_std, freedom, share = np.full((7, 2), np.nan)
    for j in np.flatnonzero(known):
        highest = _highest_frequency(angles[:, j], step)
        if highest is None or highest > WIDEST_BAND * 0.5 / step or highest * size * step < MIN_SWINGS:
            continue
        band = (frequency > 0.0) & (frequency <= highest)
        derivative, own = spectra[band, j], spectra_of_rates[band, j]
        moves[j] = _deviation(derivative, taper) >= MIN_RATE or (
            has_rate[j] and _coherence(derivative, own) >= SURE and _deviation(own, taper) >= MIN_RATE
        )
        if not moves[j]:
            continue
        for i in np.flatnonzero(has_rate):
            at_once[i, j] = _coherence(derivative, spectra_of_rates[band, i])
        if has_rate[j]:
            power = np.abs(derivative) ** 2
            mean_square = np.sum((2.0 * np.pi * frequency[band]) ** 2 * power) / np.sum(power)
            longest = min(LONGEST_LAG, LAG_OF_PERIOD * 2.0 * np.pi / np.sqrt(mean_square))
            lag[j], lagged[j], gain[j] = _delay(derivative, own, frequency[band], step, longest)
            freedom[j] = max(2.0 * highest * step * np.sum(taper**2), 1.0)
            incoherent = max(1.0 - lagged[j] ** 2, 0.0) / max(lagged[j] ** 2, 1e-6)
            lag_std[j] = np.sqrt(incoherent / freedom[j] / mean_square)
            gain_std[j] = abs(gain[j]) * np.sqrt(incoherent / freedom[j])
            share[j] = _deviation(own, taper) / _deviation(derivative, taper)
    return RateComparison(moves, has_rate, at_once, lagged, lag, lag_std, gain, gain_std, freedom, share, offset)


def _taper(size: int) -> np.ndarray:
    """A window that rises and falls as a cosine over a quarter of its length each.

    That of scipy.signal would add a third of a second to the start of every node.
    """
    edge = size // 4
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    return np.concatenate([rise, np.ones(size - 2 * edge), rise[::-1]])


def _lively(differences: np.ndarray, step: float) -> slice:
    """The part of a stretch in which the angles change: a decay is short beside what lies before and after it."""
    width = max(round(SMOOTHING / step), 1)
    known = differences[:, np.isfinite(differences).all(axis=0)]
    energy = np.cumsum(np.sum(uniform_filter1d(known - known.mean(axis=0), width, axis=0) ** 2, axis=1))
    quiet = 0.5 * (1.0 - LIVELY)
    first, last = np.searchsorted(energy, [quiet * energy[-1], (1.0 - quiet) * energy[-1]])
    margin = max(width, (MIN_ROWS - (last - first)) // 2 + 1, (last - first) // 4)
    return slice(max(first - margin, 0), min(last + margin, len(differences)))


def _coherence(first: np.ndarray, second: np.ndarray) -> float:
    """Correlation at the same time, from spectra."""
    scale = np.sqrt(np.sum(np.abs(first) ** 2) * np.sum(np.abs(second) ** 2))
    return float(np.sum((np.conj(first) * second).real) / scale) if scale > 0.0 else 0.0


def _deviation(spectrum: np.ndarray, taper: np.ndarray) -> float:
    """Standard deviation of a tapered signal from its one-sided spectrum, padded to twice its length."""
    return np.sqrt(np.sum(np.abs(spectrum) ** 2) / taper.size / np.sum(taper**2))


def _highest_frequency(angle: np.ndarray, step: float) -> float | None:
    """Hz below which an angle has `BAND_POWER` of its power; None where it hardly moves."""
    size = len(angle)
    row = np.linspace(-1.0, 1.0, size)
    centred = angle - angle.mean()
    centred = centred - row * (row @ centred) / (row @ row)
    if np.std(centred) < MIN_ANGLE:
        return None
    power = np.cumsum(np.abs(np.fft.rfft(centred * _taper(size))) ** 2)
    return float(np.fft.rfftfreq(size, step)[np.searchsorted(power, BAND_POWER * power[-1])])


def _delay(
    derivative: np.ndarray, measured: np.ndarray, frequency: np.ndarray, step: float, longest: float
) -> tuple[float, float, float]:
    """The delay of the measured rate, s, with correlation and gain at that delay."""
    cross = np.conj(derivative) * measured
    power = np.sum(np.abs(derivative) ** 2)
    scale = np.sqrt(power * np.sum(np.abs(measured) ** 2))
    if not scale > 0.0:
        return 0.0, 0.0, 0.0
    count = max(int(np.ceil(OVERSAMPLING * longest / step)), 2)
    lags = np.linspace(-longest, longest, 2 * count + 1)
    common = (cross[None, :] * np.exp(2j * np.pi * lags[:, None] * frequency)).real.sum(axis=1)
    best = int(np.argmax(common))
    lag = lags[best]
    if 0 < best < lags.size - 1:
        before, at, after = common[best - 1 : best + 2]
        lag += 0.5 * (before - after) / (before - 2.0 * at + after) * (lags[1] - lags[0])
    return float(lag), float(common[best] / scale), float(common[best] / power)
