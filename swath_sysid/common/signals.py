"""Sampled signals: their noise, resolution, spikes, maxima, means and tapers, and how much correlated residuals say."""

from collections.abc import Sequence
from statistics import NormalDist

import numpy as np
import scipy  # its rooms are loaded when they are used: the buffer subscribes first

NORMAL_MEDIAN = NormalDist().inv_cdf(0.75)  #: Median absolute value of a standard normal variable.
SPIKE_NEIGHBOURS = 5  #: Samples, the one in question among them, whose median a spike differs from.
SPIKE_THRESHOLD = 10.0  #: Standard deviations of the noise by which it does.
TAPERS = 5  #: Over which a spectrum is averaged.


def white_noise(values: np.ndarray) -> float:
    """Standard deviation of the white noise on an even signal (N,) of 20 samples per period or more; 0 for N < 8.
    Median absolute third difference over that of unit noise: third differences have sqrt(20) times its deviation.
    """
    if values.size < 8:
        return 0.0
    return float(np.median(np.abs(np.diff(values, 3))) / (NORMAL_MEDIAN * np.sqrt(20.0)))


def noise_level(values: np.ndarray) -> float:
    """`white_noise` of values that may have been repeated to fill a faster grid, enlarged by the repetition."""
    if values.size < 8:
        return 0.0
    new = values[np.concatenate([[True], np.diff(values) != 0.0])]
    if new.size < 8 or new.size > values.size // 2:
        new = values
    return white_noise(new) * float(np.sqrt(values.size / new.size))


def quantum(values: np.ndarray) -> float:
    """Smallest step between neighbouring values, shape (N,): their resolution, where they were rounded."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12 * max(float(np.ptp(values)), 1e-300)]
    return float(steps.min()) if steps.size else 0.0


def spikes(values: np.ndarray) -> np.ndarray:
    """Mask of the samples, alone or in pairs, of an even signal (N,) that are far outside their neighbourhood. They
    differ from the median of five by more than `SPIKE_THRESHOLD` noise deviations and by more than twice the range of
    the three nearest to it, which the crest of a sparsely sampled oscillation does not.
    """
    if values.size < SPIKE_NEIGHBOURS:
        return np.zeros(values.size, dtype=bool)
    middle = scipy.ndimage.median_filter(values, SPIKE_NEIGHBOURS)
    difference = np.abs(values - middle)
    suspects = np.flatnonzero(difference > max(SPIKE_THRESHOLD * noise_level(values), 1e-12 * np.ptp(values)))
    padded = np.pad(values, 2, mode='reflect')
    others = padded[suspects[:, None] + np.array([0, 1, 3, 4])]
    order = np.argsort(np.abs(others - middle[suspects, None]), axis=1)[:, :3]
    nearest = np.take_along_axis(others, order, axis=1)
    mask = np.zeros(values.size, dtype=bool)
    mask[suspects] = difference[suspects] > 2.0 * np.ptp(nearest, axis=1)
    return mask


def without_spikes(values: np.ndarray) -> np.ndarray:
    """The values, shape (N,), with each spike replaced by the median of its neighbourhood."""
    bad = spikes(values)
    return np.where(bad, scipy.ndimage.median_filter(values, SPIKE_NEIGHBOURS), values) if bad.any() else values


def prominent_extremes(values: np.ndarray, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the extremes of finite values (N,) with this prominence, in order, and whether each is a maximum.

    `scipy.signal.find_peaks` loads 35 MB.
    """
    begins = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]])[: values.size])
    level = values[begins]
    rises = level[1:] > level[:-1]
    turns = np.flatnonzero(rises[1:] != rises[:-1]) + 1
    if not turns.size:
        return turns, turns == 0
    places = np.concatenate([[0], turns, [level.size - 1]])
    while True:
        turned = level[places]
        steps = np.abs(turned[1:] - turned[:-1])
        inner = steps[1:-1]
        # a pair less far apart than from its neighbours has that prominence, and changes that of no other
        noise = (inner < np.minimum(steps[:-2], steps[2:])) & (inner < least)
        if 4 * np.count_nonzero(noise) < places.size:
            break
        keep = np.ones(places.size, dtype=bool)
        keep[1:-2] &= ~noise
        keep[2:-1] &= ~noise
        places = places[keep]
    is_maximum = np.arange(places.size) % 2 == int(rises[0])
    standing = np.zeros(places.size, dtype=bool)
    for sign, first in ((1.0, 2 - int(rises[0])), (-1.0, 1 + int(rises[0]))):
        standing[first:-1:2] = _stand(sign * turned[first:-1:2], sign * turned, first, least)
    found = np.flatnonzero(standing)
    ends = np.append(begins, values.size)[1:] - 1
    return ((begins + ends) // 2)[places[found]], is_maximum[found]


def _stand(heights: np.ndarray, turned: np.ndarray, first: int, least: float) -> np.ndarray:
    """Whether maxima, every second of alternating values (M,) from one on, have this prominence."""
    valleys = turned[first - 1 :: 2].tolist()
    before = _lowest_since_higher(heights.tolist(), valleys[: heights.size])
    after = _lowest_since_higher(heights[::-1].tolist(), valleys[heights.size : 0 : -1])[::-1]
    return heights - np.maximum(before, after) >= least


def _lowest_since_higher(heights: Sequence[float], valleys: Sequence[float]) -> list[float]:
    """For each maximum the lowest valley since a higher one; each valley lies before its maximum."""
    found: list[float] = []
    higher: list[tuple[float, float]] = []
    for height, lowest in zip(heights, valleys, strict=True):
        while higher and higher[-1][0] <= height:
            _, since = higher.pop()
            lowest = since if since < lowest else lowest
        higher.append((height, lowest))
        found.append(lowest)
    return found


def bin_means(bins: np.ndarray, *columns: np.ndarray) -> tuple[np.ndarray, ...]:
    """Numbers (B,) of the bins that hold any sample, increasing, and the mean of each column (N,) over them."""
    count = np.bincount(bins)
    held = np.flatnonzero(count)
    return held, *(np.bincount(bins, column)[held] / count[held] for column in columns)


def running_integral(values: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Integral of values (N,) from the first time (N,) on, by trapezoids; scipy.integrate would cost 18 MB."""
    return np.append(0.0, np.cumsum(np.diff(time) * (values[1:] + values[:-1]) / 2.0))


def sine_tapers(size: int) -> np.ndarray:
    """Sine tapers (Riedel and Sidorenko, IEEE Trans. Signal Processing 43, 1995), shape (TAPERS, size)."""
    order, place = np.arange(1, TAPERS + 1)[:, None], np.arange(1, size + 1)
    return np.sqrt(2.0 / (size + 1)) * np.sin(np.pi * order * place / (size + 1))


MODEL_FLOOR = 0.005  #: No model of a hull is trusted closer than this share of the motion's standard deviation.


def weighting_noise(channels: Sequence[np.ndarray]) -> float:
    """Weighting noise of one channel's residuals in several records: measured noise and model floor in quadrature."""
    white = np.median([white_noise(c) for c in channels])
    motion = max(float(np.std(c)) for c in channels)
    return float(np.hypot(white, MODEL_FLOOR * motion)) or 1.0


def autocovariance(residual: np.ndarray, shortest_memory: int) -> np.ndarray:
    """Tapered autocovariance, lags 0 to L - 1, L at most N / 4, of an evenly sampled residual (N,). Cut by the rule of
    Politis (2003): after it ``shortest_memory`` autocorrelations stay below ``2 sqrt(log10 N / N)``; choose more than a
    quarter period, where an oscillating residual passes through zero. The triangular taper keeps the covariance matrix
    positive.
    """
    count = residual.size
    centred = residual - residual.mean()
    longest = max(1, count // 4)
    covariance = _convolved(centred, centred[::-1])[count - 1 : count - 1 + longest + shortest_memory] / count
    if covariance[0] <= 0.0:
        return np.zeros(1)
    small = np.abs(covariance / covariance[0]) < 2.0 * np.sqrt(np.log10(count) / count)
    run = np.convolve(small, np.ones(shortest_memory), mode='valid') >= shortest_memory
    quiet = np.flatnonzero(run)
    cut = min(quiet[0] if quiet.size else longest, longest)
    length = max(1, min(2 * cut - 1, longest))
    return covariance[:length] * (1.0 - np.arange(length) / length)


def correlated(sensitivity: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Gamma J, (N, p), for a sensitivity J (N, p) of residuals with an autocovariance (L,)."""
    if covariance.size == 1:
        return covariance[0] * sensitivity
    before = covariance.size - 1
    spread = _convolved(sensitivity, np.concatenate([covariance[:0:-1], covariance])[:, None])
    return spread[before : before + len(sensitivity)]


def _convolved(values: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Along the first axis, over its whole length: as scipy.signal.fftconvolve, which takes 20 MB to load."""
    length = len(values) + len(kernel) - 1
    fft = scipy.fft
    size = fft.next_fast_len(length, True)
    return fft.irfft(fft.rfft(values, size, axis=0) * fft.rfft(kernel, size, axis=0), size, axis=0)[:length]
