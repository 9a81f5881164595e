"""A row for `records.py` from outside the package: scikit-learn's Gaussian processes on lags of every channel.

Needs ``pip install swath_sysid[benchmark]``.
"""

import warnings

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, DotProduct, WhiteKernel

LAGS, ROWS = 12, 250
REFIT = 60.0
"""s; the kernels themselves are optimised anew when the past has doubled."""

WINDOW = 600.0
"""s of past."""

KERNEL = RBF(10.0, (1.0, 1e3)) + DotProduct(1.0) + WhiteKernel(1e-2, (1e-8, 2.0))


def forecasts(trial, axes, stamps, leads):
    """Angles at the leads, a process each, refitted each minute on rows spread over the past window."""
    names = list(trial.channels)
    values = np.column_stack([trial.channels[name] for name in names])
    targets = [names.index(axis) for axis in axes]
    steps = np.maximum(1, np.round(leads / np.median(np.diff(trial.time)))).astype(int)
    inputs = _lagged(values)
    result = np.full((stamps.size, leads.size, len(axes)), np.nan)
    newest = np.searchsorted(trial.time, stamps, side='right') - 1
    kernels, optimised = {}, 0
    for begin in np.arange(trial.time[0] + REFIT, trial.time[-1], REFIT):
        now = np.flatnonzero((stamps >= begin) & (stamps < begin + REFIT))
        now = now[np.isfinite(inputs[newest[now]]).all(axis=1)]
        known = int(np.searchsorted(trial.time, begin, side='right'))
        first = max(LAGS, int(np.searchsorted(trial.time, begin - WINDOW)))
        # what a row was followed by must have come
        rows = np.arange(first, known - steps[-1])
        rows = rows[np.isfinite(inputs[rows]).all(axis=1)]
        if not now.size or rows.size < 2 * LAGS:
            continue
        again = known >= 2 * optimised
        optimised = known if again else optimised
        centre, scale = inputs[rows].mean(axis=0), inputs[rows].std(axis=0) + 1e-12
        for place, step in enumerate(steps):
            for k, target in enumerate(targets):
                usable = rows[np.isfinite(values[rows + step, target])]
                chosen = usable[:: -max(1, usable.size // ROWS)]
                start = kernels.get((place, k), KERNEL)
                process = GaussianProcessRegressor(
                    start, normalize_y=True, optimizer='fmin_l_bfgs_b' if again else None, random_state=0
                )
                with warnings.catch_warnings():
                    warnings.simplefilter('ignore', ConvergenceWarning)
                    process.fit((inputs[chosen] - centre) / scale, values[chosen + step, target])
                kernels[place, k] = process.kernel_
                result[now, place, k] = process.predict((inputs[newest[now]] - centre) / scale)
    return {axis: result[..., k] for k, axis in enumerate(axes)}


def _lagged(values):
    """Each sample with those before it, (N, LAGS M); NaN before there are so many."""
    lagged = np.full((values.shape[0], LAGS, values.shape[1]), np.nan)
    for lag in range(LAGS):
        lagged[lag:, lag] = values[: values.shape[0] - lag]
    return lagged.reshape(values.shape[0], -1)
