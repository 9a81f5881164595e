"""How residuals are weighted, and how much information correlated ones hold."""

from collections.abc import Sequence

import numpy as np
from scipy import fft

from swath_sysid.common.signals import white_noise

MODEL_FLOOR = 0.005  #: No model of a hull is trusted closer than this share of the motion's standard deviation.


def weighting_noise(channels: Sequence[np.ndarray]) -> float:
    """Weighting noise of one channel's residuals in several records: measured noise and model floor in quadrature."""
    white = np.median([white_noise(c) for c in channels])
    motion = max(float(np.std(c)) for c in channels)
    return float(np.hypot(white, MODEL_FLOOR * motion)) or 1.0


def autocovariance(residual: np.ndarray, shortest_memory: int) -> np.ndarray:
    """Tapered autocovariance, lags 0 to L - 1, L at most N / 4, of an evenly sampled residual (N,).

    Cut by the rule of Politis (2003): after it ``shortest_memory`` autocorrelations stay below ``2 sqrt(log10 N / N)``;
    choose more than a quarter period, where an oscillating residual passes through zero. The triangular taper keeps the
    covariance matrix positive.
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
    size = fft.next_fast_len(length, True)
    return fft.irfft(fft.rfft(values, size, axis=0) * fft.rfft(kernel, size, axis=0), size, axis=0)[:length]
