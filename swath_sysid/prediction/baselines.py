"""What a forecast must beat: simple and standard forecasts given the same history, all causal but the bound."""
import numpy as np
from scipy.linalg import solve_toeplitz

from swath_sysid.prediction.excitation import iterate, lag_matrix

BASELINES = ('persistence', 'constant_rate', 'ar', 'var', 'gm11', 'bound')

BASELINE_ORDERS = (40, 20, 10, 5, 2)
BASELINE_RIDGE = 1e-4
_ROWS_A_COEFFICIENT = 8
_GREY_WINDOW = 8


def persistence(angle, steps):
    """The present angle, for every lead.

    Parameters
    ----------
    angle : ndarray, shape (N,)
        On an even grid, rad.
    steps : ndarray of int, shape (L,)

    Returns
    -------
    ndarray, shape (N, L)
        Entry [k, i] is for k + steps[i].
    """
    return np.repeat(angle[:, None], steps.size, axis=1)


def constant_rate(angle, rate, steps, step):
    """The present angle and rate carried on; without a measured rate, that of the last two angles.

    ``step`` is that of the grid, s; the rest as in `persistence`.
    """
    if rate is None or not np.isfinite(rate).any():
        rate = np.diff(angle, prepend=np.nan) / step
    return angle[:, None] + rate[:, None] * steps * step


def gm11(angle, steps):
    """The grey model GM(1,1) of Deng (1989) on the last eight angles, raised to be positive.

    With X the running sum of x and z the mean of neighbouring sums, x[k] + a z[k] = b by least
    squares; then x at n + h is (x[1] - b / a) (1 - e^a) e^(-a (n + h - 1)).

    Parameters and result as in `persistence`.
    """
    count, n = angle.size, _GREY_WINDOW
    result = np.full((count, steps.size), np.nan)
    if count < n:
        return result
    window = np.lib.stride_tricks.sliding_window_view(angle, n)
    raised = 2.0 * np.abs(window).max(axis=1) + 1e-3
    x = window + raised[:, None]
    total = np.cumsum(x, axis=1)
    z = 0.5 * (total[:, 1:] + total[:, :-1])
    y = x[:, 1:]
    mean_z, mean_y = z.mean(axis=1), y.mean(axis=1)
    spread = ((z - mean_z[:, None]) ** 2).sum(axis=1)
    a = -((z - mean_z[:, None]) * (y - mean_y[:, None])).sum(axis=1) / spread
    b = mean_y + a * mean_z
    # at a = 0 the model is the constant b: expm1 keeps the small difference
    small = np.abs(a) < 1e-9
    a = np.where(small, 1e-9, a)
    growth = np.exp(np.clip(-a[:, None] * (n + steps - 1), -50.0, 50.0))
    result[n - 1:] = (x[:, 0] - b / a)[:, None] * -np.expm1(a)[:, None] * growth - raised[:, None]
    return result


def regression_table(values, targets, steps):
    """A plain ridge vector autoregression of a window, iterated: the standard forecast to beat.

    Parameters
    ----------
    values : ndarray, shape (N, M)
        On an even grid, oldest first; rows with NaN are gaps.
    targets : sequence of int
    steps : ndarray of int, shape (L,)

    Returns
    -------
    tuple (order, matrix (L, T, M p), mean, deviation), or None where the window is too short
    """
    count, channels = values.shape
    order = next((p for p in BASELINE_ORDERS if count - p >= _ROWS_A_COEFFICIENT * channels * p), None)
    if order is None:
        return None
    mean, deviation = np.nanmean(values, axis=0), np.nanstd(values, axis=0)
    deviation = np.where(deviation > 0.0, deviation, 1.0)
    scaled = (values - mean) / deviation
    lags, following = lag_matrix(scaled[:-1], order), scaled[order:]
    whole = np.isfinite(lags).all(axis=1) & np.isfinite(following).all(axis=1)
    lags, following = lags[whole], following[whole]
    if lags.shape[0] < channels * order:
        return None
    gram = lags.T @ lags + BASELINE_RIDGE * lags.shape[0] * np.eye(lags.shape[1])
    coefficients = np.linalg.solve(gram, lags.T @ following)
    return order, iterate(coefficients, order, list(targets), int(steps[-1]))[steps], mean, deviation


def running_regression(values, targets, steps, refits, window):
    """Forecasts of `regression_table`, refitted as time goes on.

    Parameters
    ----------
    values : ndarray, shape (N, M)
    targets : sequence of int
    steps : ndarray of int, shape (L,)
    refits : sequence of int
        Rows at which it is fitted anew, on the ``window`` rows up to and with that row.
    window : int

    Returns
    -------
    ndarray, shape (N, L, T)
        NaN before the first fit and where a lag is missing.
    """
    count = values.shape[0]
    result = np.full((count, steps.size, len(targets)), np.nan)
    refits = [r for r in refits if r < count]
    for start, end in zip(refits, [*refits[1:], count], strict=True):
        fit = regression_table(values[max(0, start + 1 - window):start + 1], targets, steps)
        if fit is None:
            continue
        order, matrix, mean, deviation = fit
        begin = max(start, order - 1)
        if begin >= end:
            continue
        lags = (lag_matrix(values[begin - order + 1:end], order) - np.tile(mean, order)) / np.tile(deviation, order)
        ahead = (lags @ matrix.reshape(-1, matrix.shape[2]).T).reshape(-1, steps.size, len(targets))
        places = list(targets)
        result[begin:end] = ahead * deviation[places] + mean[places]
    return result


def spectrum_bound(angle, steps, order=400):
    """NRMSE of the best linear forecast from the angle's own past, knowing its spectrum.

    Solves the normal equations with the record's own autocovariance: no single-channel linear
    forecast fitted without looking ahead does better in the long run (Wiener 1949).

    Parameters
    ----------
    angle : ndarray, shape (N,)
        NaN where missing.
    steps : ndarray of int, shape (L,)
    order : int
        Lags, at most.

    Returns
    -------
    ndarray, shape (L,)
        NaN for a record too short or constant.
    """
    order = min(order, angle.size // 4)
    centred = np.where(np.isfinite(angle), angle - np.nanmean(angle), 0.0)
    size = 2 ** int(np.ceil(np.log2(2 * angle.size)))
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    covariance = np.fft.irfft(spectrum)[:order + int(steps[-1]) + 1] / angle.size
    if order < 2 or not covariance[0] > 0.0:
        return np.full(steps.size, np.nan)
    column = covariance[:order].copy()
    column[0] *= 1.0 + 1e-7
    bound = []
    for ahead in steps:
        cross = covariance[ahead:ahead + order]
        weights = solve_toeplitz(column, cross)
        bound.append(np.sqrt(max(0.0, 1.0 - weights @ cross / covariance[0])))
    return np.array(bound)
