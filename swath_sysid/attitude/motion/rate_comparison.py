"""What measured rates have in common with the slopes of their angles: correlation, delay and gain."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import accumulate
from math import isfinite

import numpy as np
import scipy  # its rooms are loaded when they are used: the buffer subscribes first

from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.conventions import SIGNIFICANT

MIN_BINS = 40  #: Fewer are not judged.
MIN_ANGLE = np.radians(0.25)  #: rad, standard deviation; a craft that moves less shows nothing.
BAND_POWER = 0.98  #: Share of an angle's power below the highest frequency used; the rest is mostly noise.
#: Of the Nyquist frequency; a wider angle is too coarse or noisy to be differentiated. With half of it, noise passed
#: for motion in 20 of 960 simulated decays of 1 to 3 deg, with this in none.
WIDEST_BAND = 0.3
LIVELY = 0.9  #: Share of the energy of the slopes within the part of a stretch that is looked at.

FOLLOWS = 0.7  #: Correlation with the slope of its angle from which a rate is that of the angle.
EXPLAINS = 0.9  #: Correlation from which a delay, a factor or another arrangement of the axes explains the rates.
LAG_PHASE = 0.15  #: rad of the mean circular frequency up to which a delay is not reported.
UNIT_TOLERANCE = 1.3  #: Factor by which a rate may differ from the slope of its angle, and from another unit of it.


@dataclass(frozen=True)
class Slope:
    """What the rates have in common with the slope of one angle, in the band in which that angle moves."""

    axis: int  #: 0 is roll, 1 is pitch.
    correlations: np.ndarray  #: (3,); of each rate at the same time; NaN where there is no such rate.
    lagged: float  #: Highest correlation of its own rate over the lags.
    lag: float  #: s at which it is reached; positive where the rate comes late.
    lag_std: float  #: s.
    gain: float  #: Of its own rate over the slope at that lag, by least squares.
    gain_std: float
    frequency: float  #: rad/s, mean of the slope.

    @property
    def follows(self) -> bool:
        """Whether its own rate is that of the angle."""
        return bool(self.correlations[self.axis] >= FOLLOWS)

    @property
    def is_late(self) -> bool:
        """Whether its own rate is clearly that of the angle at another time."""
        clear = max(LAG_PHASE / self.frequency, SIGNIFICANT * self.lag_std)
        return self.lagged >= EXPLAINS and abs(self.lag) > clear

    @property
    def differs(self) -> bool:
        """Whether its own rate is more than noise away from the slope."""
        return not is_near(self.gain, 1.0) and abs(self.gain - 1.0) > SIGNIFICANT * self.gain_std


def is_near(gain: float, factor: float) -> bool:
    """Whether a gain is a factor, within `UNIT_TOLERANCE`."""
    return factor / UNIT_TOLERANCE < gain < factor * UNIT_TOLERANCE


def agreement(slopes: Iterable[Slope], arrangement: np.ndarray) -> float:
    """Mean correlation of the rates, rearranged by a signed permutation, with the slopes; 0 where nothing moves."""
    rows = np.argmax(np.abs(arrangement), axis=0)
    correlations = [arrangement[rows[each.axis], each.axis] * each.correlations[rows[each.axis]] for each in slopes]
    known = [float(correlation) for correlation in correlations if isfinite(correlation)]
    return float(np.mean(known)) if known else 0.0


def compare_rates(step: float, angles: np.ndarray, rates: np.ndarray) -> tuple[Slope, ...]:
    """Compare rates (N, 3) with the slopes of roll and pitch (N, 2) at even steps, s; a column of NaN is unknown. Angle
    differences are compared with mean rates over the same steps, both limited to the band of the angle's power, so that
    noise is not amplified. Gain, delay and its deviation are those of the cross-spectrum: J. S. Bendat, A. G. Piersol,
    Random Data, 4th edition, Wiley, 2010, chapters 5 and 6.
    """
    differences, means = np.diff(angles, axis=0) / step, 0.5 * (rates[1:] + rates[:-1])
    known = np.isfinite(differences).all(axis=0) & np.isfinite(means[:, :2]).all(axis=0)
    if not known.any():
        return ()
    lively = _lively(differences[:, known])
    angles, differences, means = angles[lively], differences[lively], means[lively]
    slopes = (_slope(int(axis), step, angles[:, axis], differences[:, axis], means) for axis in np.flatnonzero(known))
    return tuple(slope for slope in slopes if slope is not None)


def aligned(motion: AxisMotion) -> AxisMotion:
    """A motion with whichever of angle and rate clearly comes later moved to the times of the other. An angle that a
    first-order filter delays is the filter's inverse, if that agrees better with the rate.
    """
    slope = _own_slope(motion)
    if slope is None or not slope.is_late:
        return motion
    moved, name = motion.time + abs(slope.lag), 'rate' if slope.lag > 0.0 else 'angle'
    values = np.interp(moved, motion.time, getattr(motion, name))
    delayed = replace(motion, lag=slope.lag, **{name: values}).only(moved <= motion.time[-1])
    if name == 'rate':
        return delayed
    filtered = replace(motion, lag=slope.lag, angle=_unfiltered(motion, slope))
    agreeing = [0.0 if own is None else own.correlations[0] for own in map(_own_slope, (delayed, filtered))]
    return filtered if agreeing[1] > agreeing[0] else delayed


def _own_slope(motion: AxisMotion) -> Slope | None:
    """What the rate of one axis has in common with the slope of its angle; None where that cannot be told."""
    if motion.angle is None or motion.rate is None or motion.size < MIN_BINS:
        return None
    # stamps may be absurd, or leave out much
    if motion.size < 0.5 * motion.duration / (step := motion.sample_interval):
        return None
    time, own = np.arange(motion.time[0], motion.time[-1], step), np.array([1.0, np.nan, np.nan])
    angle, rate = (np.interp(time, motion.time, values)[:, None] for values in (motion.angle, motion.rate))
    return next(iter(compare_rates(step, angle * own[:2], rate * own)), None)


def _unfiltered(motion: AxisMotion, slope: Slope) -> np.ndarray:
    """The angle, rad, before a first-order filter of that delay: by its slope, which is the rate, filtered alike."""
    assert motion.angle is not None and motion.rate is not None, 'both were compared'
    constant = np.tan(slope.frequency * abs(slope.lag)) / slope.frequency
    follows = -np.expm1(-np.diff(motion.time) / constant)
    filtered = list(accumulate(zip(follows, motion.rate[1:], strict=True), _follow, initial=float(motion.rate[0])))
    return motion.angle + constant * np.array(filtered)


def _follow(level: float, step: tuple[float, float]) -> float:
    part, value = step
    return level + part * (value - level)


def _slope(axis: int, step: float, angle: np.ndarray, differences: np.ndarray, rates: np.ndarray) -> Slope | None:
    """What the rates have in common with the slope of one angle; None where it does not move, or not enough."""
    size = len(differences)
    taper = _taper(size)
    highest = _highest_frequency(angle, step)
    freedom = 2.0 * (highest or 0.0) * step * np.sum(taper**2)
    if highest is None or highest > WIDEST_BAND * 0.5 / step:
        return None
    frequency = np.fft.rfftfreq(2 * size, step)
    band = (frequency > 0.0) & (frequency <= highest)
    spectrum, *others = (np.fft.rfft((part - part.mean()) * taper, 2 * size)[band] for part in (differences, *rates.T))
    power = np.abs(spectrum) ** 2
    mean_square = np.sum((2.0 * np.pi * frequency[band]) ** 2 * power) / np.sum(power)
    # beyond half of the mean period a delay looks like a reversal
    lag, lagged, gain = _lag(spectrum, others[axis], frequency[band], step, np.pi / np.sqrt(mean_square))
    incoherent = np.sqrt(max(1.0 - lagged**2, 0.0) / max(lagged**2, 1e-6) / freedom)
    correlations = np.array([_correlation(spectrum, other) for other in others])
    usual = float(np.sqrt(mean_square))
    return Slope(axis, correlations, lagged, lag, float(incoherent / usual), gain, float(abs(gain) * incoherent), usual)


def _taper(size: int) -> np.ndarray:
    """Cosine taper over a quarter of the length at each end, without scipy.signal, which takes 0.3 s to load."""
    edge = size // 4
    rise = 0.5 - 0.5 * np.cos(np.pi * (np.arange(edge) + 0.5) / edge)
    return np.concatenate([rise, np.ones(size - 2 * edge), rise[::-1]])


def _lively(differences: np.ndarray) -> slice:
    """The part of a stretch in which the angles change: a decay is short beside what lies before and after it."""
    width = MIN_BINS // 8
    smooth = scipy.ndimage.uniform_filter1d(differences - differences.mean(axis=0), width, axis=0)
    energy = np.cumsum(np.sum(smooth**2, axis=1))
    quiet = 0.5 * (1.0 - LIVELY)
    first, last = np.searchsorted(energy, [quiet * energy[-1], (1.0 - quiet) * energy[-1]])
    margin = max(width, (MIN_BINS - (last - first)) // 2 + 1, (last - first) // 4)
    return slice(max(first - margin, 0), min(last + margin, len(differences)))


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    """Correlation at the same time, from spectra; NaN where one is not known."""
    scale = np.sqrt(np.sum(np.abs(first) ** 2) * np.sum(np.abs(second) ** 2))
    return 0.0 if scale == 0.0 else float(np.sum((np.conj(first) * second).real) / scale)


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


def _lag(
    slope: np.ndarray, measured: np.ndarray, frequency: np.ndarray, step: float, longest: float
) -> tuple[float, float, float]:
    """The delay of the measured rate, s, with correlation and gain at that delay."""
    cross = np.conj(slope) * measured
    power = np.sum(np.abs(slope) ** 2)
    scale = np.sqrt(power * np.sum(np.abs(measured) ** 2))
    if not scale > 0.0:
        return 0.0, 0.0, 0.0
    count = max(int(np.ceil(4.0 * longest / step)), 2)
    lags = np.linspace(-longest, longest, 2 * count + 1)
    common = (cross[None, :] * np.exp(2j * np.pi * lags[:, None] * frequency)).real.sum(axis=1)
    best = int(np.argmax(common))
    lag = lags[best]
    if 0 < best < lags.size - 1:
        before, at, after = common[best - 1 : best + 2]
        lag += 0.5 * (before - after) / (before - 2.0 * at + after) * (lags[1] - lags[0])
    return float(lag), float(common[best] / scale), float(common[best] / power)
