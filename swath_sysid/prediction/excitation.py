"""The forecast of the sea: a ridge vector autoregression on every channel of the sensor.

On an even grid of step D the standardised channels y follow

    y[k+1] = sum_j A_j y[k-j] + noise,     j = 0 .. p - 1,

fitted by least squares with a ridge that may grow with a power of the lag (Doan, Litterman and
Sims 1984: what is long past tells less).  Candidate orders and ridges are
averaged, each weighted by its errors several steps ahead on held-out parts of the window.
Iterating a regression gives a matrix from the lags to the channels at any lead, so that a
forecast is one product.
"""
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from swath_sysid.errors import InputError

_CLIP = 8.0
_FURTHER_THAN_SEEN = 2.0
_ENOUGH_TO_JUDGE = 2000
_FEWEST_ROWS_A_COEFFICIENT = 4.0


@dataclass(frozen=True)
class ExcitationSettings:
    """How the regression is fitted.

    Attributes
    ----------
    orders : tuple of int
        Candidate orders p.
    most_coefficients : int
        Of one target: an order that needs more with all the channels is no candidate, for the cost of it.
    ridges : tuple of (float, float)
        Candidate ridges: relative to the channels' variance, and the power of the lag they grow with.
    folds : int
        Parts of the window, each held out once.
    sharpness : float
        How strongly held-out errors decide between the candidates.
    validation_leads : tuple of float
        Leads whose errors decide, s.
    """

    orders: tuple[int, ...] = (5, 10, 20, 40, 80)
    most_coefficients: int = 280
    ridges: tuple[tuple[float, float], ...] = ((1e-6, 0.0), (1e-6, 2.0), (1e-5, 2.0), (1e-4, 2.0), (1e-3, 2.0))
    folds: int = 4
    sharpness: float = 0.8
    validation_leads: tuple[float, ...] = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0)

    def __post_init__(self):
        if not self.orders or min(self.orders) < 1 or not self.ridges or not min(r for r, _ in self.ridges) > 0.0:
            raise InputError('give at least one order of 1 or more and at least one positive ridge')
        if self.folds < 2:
            raise InputError('order and ridge are chosen on held-out parts: give 2 folds or more')
        if not self.validation_leads or min(self.validation_leads) <= 0.0:
            raise InputError('validation_leads must be positive')


@dataclass(frozen=True)
class ForecastTable:
    """An average of regressions made ready: one product from the lags to the targets at given leads.

    Attributes
    ----------
    matrix : ndarray, shape (L * T, M p)
        From lags in physical units less their mean.
    offset : ndarray, shape (T,)
        Mean of the targets.
    mean : ndarray, shape (M,)
    order : int
        Of the longest regression in it.
    step : float
        s between the lags.
    shape : tuple of int
        (L, T).
    error : ndarray, shape (L, T)
        Root mean square error on the held-out parts, in the targets' units.
    limit : ndarray, shape (T,)
        Furthest from their mean that the targets are forecast: twice as far as the window has seen.
    weights : tuple
        ((order, ridge), mean weight) of each candidate, for people.
    """

    matrix: np.ndarray
    offset: np.ndarray
    mean: np.ndarray
    order: int
    step: float
    shape: tuple[int, int]
    error: np.ndarray
    limit: np.ndarray
    weights: tuple = field(repr=False, default=())

    def forecast(self, lags):
        """The targets at the leads.

        Parameters
        ----------
        lags : ndarray, shape (p, M)
            Newest first.

        Returns
        -------
        ndarray, shape (L, T)
        """
        ahead = (self.matrix @ (lags - self.mean).ravel()).reshape(self.shape)
        return np.minimum(np.maximum(ahead, -self.limit), self.limit) + self.offset


def lag_matrix(values, order):
    """Rows of lags, newest first.

    Parameters
    ----------
    values : ndarray, shape (N, M)
    order : int

    Returns
    -------
    ndarray, shape (N - order + 1, M * order)
        Row i holds values[i + order - 1], values[i + order - 2], ..., values[i].
    """
    count, channels = values.shape
    rows = count - order + 1
    windows = np.lib.stride_tricks.sliding_window_view(values, order, axis=0)[:rows]
    return np.ascontiguousarray(windows[:, :, ::-1].transpose(0, 2, 1)).reshape(rows, channels * order)


def solve_ridge(gram, cross, ridge, rows, order):
    """Coefficients of ridge regression with a ridge that may grow with the lag.

    Parameters
    ----------
    gram : ndarray, shape (M p, M p)
    cross : ndarray, shape (M p, T)
    ridge : (float, float)
        Relative to unit variance at the first lag, and the power of the lag it grows with.
    rows : int
        Rows that the Gram matrix was summed over.
    order : int

    Returns
    -------
    ndarray, shape (M p, T)
    """
    channels = gram.shape[0] // order
    size, power = ridge
    weight = np.repeat(np.arange(1.0, order + 1.0) ** power, channels)
    damped = gram.copy()
    damped[np.diag_indices_from(damped)] += size * rows * weight
    return cho_solve(cho_factor(damped, check_finite=False, overwrite_a=True), cross, check_finite=False)


def iterate(coefficients, order, targets, count):
    """Matrices from the lags to the targets 0 .. count steps ahead.

    Parameters
    ----------
    coefficients : ndarray, shape (M p, M)
    order : int
    targets : sequence of int
        Channels.
    count : int

    Returns
    -------
    ndarray, shape (count + 1, T, M p)
    """
    size, channels = coefficients.shape
    rows = np.zeros((len(targets), size))
    rows[np.arange(len(targets)), targets] = 1.0
    result = np.empty((count + 1, len(targets), size))
    result[0] = rows
    for k in range(count):
        # one step of the companion matrix: the newest block is replaced by its regression, the rest shifts
        following = rows[:, :channels] @ coefficients.T
        following[:, :-channels or None] += rows[:, channels:] if order > 1 else 0.0
        rows = result[k + 1] = following
    return result


def _forget_unusable(values):
    finite = np.isfinite(values)
    mean = np.array([c[f].mean() if f.any() else 0.0 for c, f in zip(values.T, finite.T, strict=True)])
    deviation = np.array([c[f].std() if f.any() else 0.0 for c, f in zip(values.T, finite.T, strict=True)])
    return mean, np.where(deviation > 1e-9, deviation, 1.0)


def fit_table(values, step, targets, leads, settings=None, decisive=None):
    """Fit vector autoregressions to a window and average them by their held-out errors.

    A candidate's weight at a lead is its held-out error there to the power of minus
    ``sharpness * sqrt(rows)``: near the best one alone on long windows, a broad average on short ones.

    Parameters
    ----------
    values : ndarray, shape (N, M)
        Channels on an even grid, oldest first; rows with NaN are gaps.
    step : float
        s.
    targets : sequence of int
        The channels to forecast.
    leads : ndarray, shape (L,)
        s, increasing.
    settings : ExcitationSettings
    decisive : int or None
        How many of the targets, from the first, decide between candidates; None: all.

    Returns
    -------
    ForecastTable or None
        None: the window is too short for the smallest order.
    """
    settings = settings or ExcitationSettings()
    targets, leads = list(targets), np.asarray(leads, dtype=float)
    mean, deviation = _forget_unusable(values)
    scaled = np.clip((values - mean) / deviation, -_CLIP, _CLIP)
    window = _Window.cut(scaled, settings)
    if window is None:
        return None
    steps = np.unique(np.maximum(1, np.round(np.array(settings.validation_leads) / step)).astype(int))
    steps = steps[steps <= max(1, window.lags.shape[0] // (2 * settings.folds))]
    aims = _aims(scaled, window, steps, targets)
    candidates = []
    for order in window.orders:
        for ridge in settings.ridges:
            error = _held_out_error(window, aims, order, ridge, steps, targets)
            if error is not None:
                candidates.append((order, ridge, error))
    if not candidates:
        return None
    return _average(window, candidates, mean, deviation, step, targets, leads, steps, settings, decisive)


@dataclass(frozen=True)
class _Window:
    """The rows of a window and their Gram matrices by fold; those of a lower order are their leading blocks."""

    lags: np.ndarray
    places: np.ndarray
    fold_of: np.ndarray
    grams: np.ndarray
    crosses: np.ndarray
    gram: np.ndarray
    cross: np.ndarray
    orders: tuple[int, ...]
    channels: int
    largest: np.ndarray

    @classmethod
    def cut(cls, scaled, settings):
        count, channels = scaled.shape
        needed = {p: _FEWEST_ROWS_A_COEFFICIENT * channels * p + settings.folds for p in sorted(settings.orders)}
        orders = tuple(
            p for p, rows in needed.items() if count - p >= rows and channels * p <= settings.most_coefficients
        )
        if not orders:
            return None
        largest = orders[-1]
        lags, following = lag_matrix(scaled[:-1], largest), scaled[largest:]
        whole = np.isfinite(lags).all(axis=1) & np.isfinite(following).all(axis=1)
        if whole.sum() < needed[orders[0]]:
            return None
        if not whole.all():
            lags, following = lags[whole], following[whole]
        fold_of = np.minimum(np.arange(lags.shape[0]) * settings.folds // lags.shape[0], settings.folds - 1)
        parts = [slice(*np.searchsorted(fold_of, (f, f + 1))) for f in range(settings.folds)]
        grams = np.array([lags[part].T @ lags[part] for part in parts])
        crosses = np.array([lags[part].T @ following[part] for part in parts])
        return cls(
            lags, np.flatnonzero(whole), fold_of, grams, crosses, grams.sum(axis=0), crosses.sum(axis=0), orders,
            channels, np.nanmax(np.abs(scaled), axis=0),
        )  # fmt: skip

    def solve(self, order, ridge, without=None):
        """Coefficients from all folds, or from all but one."""
        size = self.channels * order
        gram, cross, rows = self.gram[:size, :size], self.cross[:size], self.lags.shape[0]
        if without is not None:
            gram = gram - self.grams[without, :size, :size]
            cross = cross - self.crosses[without, :size]
            rows -= int((self.fold_of == without).sum())
        return solve_ridge(gram, cross, ridge, rows, order)

    @property
    def judged(self):
        """Every so many rows judge a candidate: rows soon after each other judge alike."""
        return max(1, self.lags.shape[0] // _ENOUGH_TO_JUDGE)


def _average(window, candidates, mean, deviation, step, targets, leads, steps, settings, decisive):
    errors = np.array([error for _, _, error in candidates])
    over_axes = np.log(np.maximum(errors[:, :, :decisive], 1e-9)).mean(axis=2)
    power = settings.sharpness * np.sqrt(window.lags.shape[0])
    weights = np.exp(-power * (over_axes - over_axes.min(axis=0)))
    weights /= weights.sum(axis=0)
    places = np.log(np.maximum(leads / step, 1e-3))
    by_lead = np.array([np.interp(places, np.log(steps), w) for w in weights])
    largest = max(order for order, _, _ in candidates)
    matrix = np.zeros((leads.size, len(targets), window.channels * largest))
    for (order, ridge, _), weight in zip(candidates, by_lead, strict=True):
        if weight.max() > 1e-3:
            part = _at_leads(window.solve(order, ridge), order, targets, leads, step)
            matrix[:, :, :window.channels * order] += weight[:, None, None] * part
    matrix *= deviation[targets][:, None] / np.tile(deviation, largest)
    pooled = np.einsum('cv,cvt->vt', weights, errors) * deviation[targets]
    return ForecastTable(
        matrix.reshape(-1, matrix.shape[2]),
        mean[targets],
        mean,
        largest,
        step,
        (leads.size, len(targets)),
        np.array([np.interp(places, np.log(steps), column) for column in pooled.T]).T,
        window.largest[targets] * deviation[targets] * _FURTHER_THAN_SEEN,
        tuple(((c[0], c[1]), float(w.mean())) for c, w in zip(candidates, weights, strict=True)),
    )


def _at_leads(coefficients, order, targets, leads, step):
    """Matrices from the lags to the targets at the leads, between the steps by a cubic spline."""
    places = leads / step
    on_grid = iterate(coefficients, order, targets, max(1, int(np.ceil(places[-1] - 1e-6))))
    if np.allclose(places, np.round(places), atol=1e-6):
        return on_grid[np.round(places).astype(int)]
    return CubicSpline(np.arange(on_grid.shape[0]), on_grid, axis=0)(places)


def _aims(scaled, window, steps, targets):
    """Values of the targets the given steps after each row's newest lag; NaN past the end."""
    newest = window.places + window.orders[-1] - 1
    aims = np.full((steps.size, newest.size, len(targets)), np.nan)
    for i, ahead in enumerate(steps):
        inside = newest + ahead < scaled.shape[0]
        aims[i, inside] = scaled[newest[inside] + ahead][:, targets]
    return aims


def _held_out_error(window, aims, order, ridge, steps, targets):
    """Root mean square errors on every part, forecast from the other parts; None where not solvable."""
    size = window.channels * order
    total, count = np.zeros(aims.shape[::2]), np.zeros(aims.shape[::2])
    for fold in range(window.grams.shape[0]):
        try:
            coefficients = window.solve(order, ridge, without=fold)
        except LinAlgError:
            return None
        matrices = iterate(coefficients, order, targets, int(steps[-1]))[steps]
        held = slice(*np.searchsorted(window.fold_of, (fold, fold + 1)), window.judged)
        forecast = window.lags[held, :size] @ matrices.reshape(-1, size).T
        forecast = forecast.reshape(-1, steps.size, len(targets)).transpose(1, 0, 2)
        square = (forecast - aims[:, held]) ** 2
        known = np.isfinite(square)
        total += np.where(known, square, 0.0).sum(axis=1)
        count += known.sum(axis=1)
    error = np.sqrt(total / np.maximum(count, 1))
    return error if np.isfinite(error).all() and (count > 0).all() else None
