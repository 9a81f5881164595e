"""A state space from a window of rows by canonical variate analysis.

The state is the leading canonical variates of the lags behind and the rows ahead (Larimore 1990; Van Overschee and
De Moor 1996, chapter 4, CVA weighting). A, K, C and S are regressions on states, from the Gram matrix of the lags.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import fft
from scipy.linalg import cholesky, eigh, solve_triangular

from swath_sysid.attitude.prediction.memories import NOW
from swath_sysid.attitude.prediction.rows import ROWS_A_PERIOD
from swath_sysid.attitude.prediction.state_space import RIDGE, InnovationsModel, side_by_side, whole_lags

# lags on either side
MAX_LAGS, _MIN_LAGS = 40, 2
_STATES_A_CHANNEL = 7
ROWS_A_COEFFICIENT = 8.0
_LAGS_A_STATE = 2.0
_MIN_SHARE = 0.5
# where losses break up more of the lags than this, gaps of few rows are filled from so many on both sides
_SIDES = 8, 4, 2
# third differences as many times their median size are not a craft's motion: a spike, or one record appended to another
_BREAK = 60.0
LARGEST_RADIUS = 0.9999
# waves that have just come grow, and by chance a model of little data does: at most so much a period is damped away
_MAX_GROWTH = 2.5


def identify(
    values: np.ndarray,
    names: Sequence[str],
    step: float,
    period: float,
    lags: int | None = None,
    states: int | None = None,
) -> InnovationsModel | None:
    """The innovations model of a window (N, width), oldest first, one row per step, s, NaN where missing.

    With at most so many ``lags`` on either side and ``states``; by default as many as a craft's own motion needs.
    None where the window is too short or the model would not be stable.
    """
    places = useful_channels(values)
    if not places:
        return None
    rows = values[:, places]
    mean, scale = np.nanmean(rows, axis=0), np.nanstd(rows, axis=0)
    rows = without_breaks((rows - mean) / scale)
    usual = usual_lags(step, period) if lags is None else lags
    if broken(rows, usual):
        rows = fill_short_gaps(rows)
    half = lags_for(rows, usual, MAX_LAGS if lags is None else lags)
    if half is None:
        return None
    gram, count = lag_gram(rows, 2 * half)
    width = len(places)
    states = min(states or _STATES_A_CHANNEL * width, round(half * width / _LAGS_A_STATE))
    space = canonical_state_space(gram / count, width, states, _MAX_GROWTH ** (step / period))
    if space is None:
        return None
    a, k, c, s, prior, from_lags = space
    return InnovationsModel(
        tuple([names[p] for p in places]), tuple(places), step, mean, scale, a, k, c, s, prior, from_lags
    )


def identify_alone(
    values: np.ndarray, names: Sequence[str], step: float, period: float, angles: Sequence[str]
) -> InnovationsModel | None:
    """As `identify`, each of the ``angles`` from itself and its rate ``X_rate``: fewer coefficients, for little data.

    Of the angles that have a model; None where none has.
    """
    models = []
    for angle in angles:
        columns = [place for place, name in enumerate(names) if name in (angle, f'{angle}_rate')]
        model = identify(values[:, columns], [names[c] for c in columns], step, period, usual_lags(step, period))
        if model is not None:
            models.append(replace(model, places=tuple([columns[p] for p in model.places])))
    return side_by_side(models) if models else None


def useful_channels(values: np.ndarray) -> list[int]:
    """Columns of values (N, width) that are present most of the time and vary."""
    finite = np.isfinite(values)
    return [
        place
        for place in range(values.shape[1])
        if finite[:, place].sum() > _MIN_SHARE * values.shape[0] and np.nanstd(values[:, place]) > RIDGE
    ]


def without_breaks(rows: np.ndarray) -> np.ndarray:
    """Standardised rows (N, C) with those at a break of the motion set to NaN, so that no lags span it."""
    if rows.shape[0] < 4:
        return rows
    size = np.abs(np.diff(rows, 3, axis=0))
    # most differences of a coarse sensor are zero, the others several of its steps
    usual = [np.median(sizes[sizes > RIDGE]) if (sizes > RIDGE).any() else np.inf for sizes in size.T]
    result = rows.copy()
    result[2:-1][(size > _BREAK * np.array(usual)).any(axis=1)] = np.nan
    return result


def lags_for(rows: np.ndarray, usual: int, most: int) -> int | None:
    """Lags on either side, at most so many, that rows (N, C), NaN where missing, support; None where none.

    What lies further back than the usual ones tells less: as many times more rows show it.
    """
    complete = np.isfinite(rows).all(axis=1)
    for half in range(most, _MIN_LAGS - 1, -1):
        needed = ROWS_A_COEFFICIENT * half * rows.shape[1] * max(1.0, half / usual)
        if whole_lags(complete, 2 * half).sum() >= needed:
            return half
    return None


def usual_lags(step: float, period: float) -> int:
    """Lags on either side that show what a motion is like."""
    return min(MAX_LAGS, round(NOW * period / step))


def broken(rows: np.ndarray, lags: int) -> bool:
    """Whether losses in rows (N, C) have left few of the lags on either side complete that there would be otherwise."""
    complete = np.isfinite(rows).all(axis=1)
    count = 2 * lags
    return not complete.all() and whole_lags(complete, count).sum() < _MIN_SHARE * (complete.size - count + 1)


def fill_short_gaps(rows: np.ndarray) -> np.ndarray:
    """Standardised rows (N, C) with short gaps filled by regression on the rows before and after.

    It looks ahead, so only for a model's identification. Gaps that are too long, or too near to another, are left.
    """
    width = rows.shape[1]
    complete = np.isfinite(rows).all(axis=1)
    result = rows.copy()
    edges = np.diff(np.concatenate([[0], ~complete, [0]]).astype(int))
    first, length = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1)
    for lost in range(1, round(ROWS_A_PERIOD / math.tau) + 1):
        gaps = first[length == lost]
        for side in _SIDES if gaps.size else ():
            if whole_lags(complete, 2 * side + lost).sum() < ROWS_A_COEFFICIENT * 2 * side * width:
                continue
            gram, count = lag_gram(rows, 2 * side + lost)
            middle = np.arange(side * width, (side + lost) * width)
            around = np.delete(np.arange(gram.shape[0]), middle)
            ridge = RIDGE * count * np.eye(around.size)
            weights = np.linalg.solve(gram[np.ix_(around, around)] + ridge, gram[np.ix_(around, middle)])
            inner = gaps[(gaps >= side) & (gaps + lost + side <= complete.size)]
            lags = np.concatenate([np.arange(lost + side - 1, lost - 1, -1), np.arange(-1, -side - 1, -1)])
            places = inner[:, None] + lags
            seen = complete[places].all(axis=1)
            filled = (rows[places[seen]].reshape(seen.sum(), around.size) @ weights).reshape(-1, lost, width)
            result[inner[seen][:, None] + np.arange(lost - 1, -1, -1)] = filled
            break
    return result


def lag_gram(rows: np.ndarray, count: int) -> tuple[np.ndarray, int]:
    """Sum of z z', (count C, count C), over z = [y[t], ..., y[t-count+1]] of the complete t, and their number.

    Nearly block Toeplitz: block (a+1, b+1) is block (a, b) with one product more at the start and one less at the end
    of each run, so only the first row of blocks is summed, by one Fourier transform. Rows (N, C), NaN where missing.
    """
    length, width = rows.shape
    complete = np.isfinite(rows).all(axis=1)
    whole = whole_lags(complete, count)
    filled = np.where(complete[:, None], rows, 0.0)
    size = fft.next_fast_len(length + count, real=True)
    newest, all_rows = fft.rfft(filled * whole[:, None], size, axis=0), fft.rfft(filled, size, axis=0)
    # sum over t of newest[t] all_rows[t - b]': a correlation
    first = fft.irfft(newest[:, :, None] * all_rows[:, None, :].conj(), size, axis=0)[:count]
    edges = np.diff(np.concatenate([[0], whole.astype(np.int8), [0]]))
    lags = np.arange(count - 1)
    entering = filled[(np.flatnonzero(edges == 1) - 1)[:, None] - lags]
    leaving = filled[(np.flatnonzero(edges == -1) - 1)[:, None] - lags]
    added = np.concatenate([entering, leaving]).reshape(2 * entering.shape[0], (count - 1) * width)
    signed = np.concatenate([entering, -leaving]).reshape(added.shape)
    gram = np.empty((count * width, count * width))
    gram[:width] = first.transpose(1, 0, 2).reshape(width, -1)
    gram[width:, :width] = gram[:width, width:].T
    for a in range(count - 1):
        here, below = slice(a * width, (a + 1) * width), slice((a + 1) * width, (a + 2) * width)
        gram[below, width:] = gram[here, :-width] + signed[:, here].T @ added
    return gram, int(whole.sum())


def canonical_state_space(
    gram: np.ndarray, width: int, states: int, max_growth: float
) -> tuple[np.ndarray, ...] | None:
    """The innovations form of C = ``width`` channels from the mean Gram matrix (2 j C, 2 j C), newest lag first.

    ``states``, at most j C, is the number of canonical variates kept; ``max_growth`` a row is damped away.
    """
    half = gram.shape[0] // 2
    lags = half // width
    future = np.arange(half).reshape(lags, width)[::-1].ravel()
    past = np.arange(half, 2 * half)
    # in all that follows alike: then S is no less, and every inverse exists
    gram = gram + RIDGE * np.eye(2 * half)
    try:
        white_future = cholesky(gram[np.ix_(future, future)], lower=True)
        white_past = cholesky(gram[np.ix_(past, past)], lower=True)
        whitened = solve_triangular(
            white_future, solve_triangular(white_past, gram[np.ix_(past, future)], lower=True).T, lower=True
        )
        squared, right = eigh(whitened.T @ whitened, subset_by_index=(half - states, half - 1))
        weight = np.sqrt(np.sqrt(np.maximum(squared, 0.0)))
        from_lags = weight[:, None] * solve_triangular(white_past, right, lower=True, trans='T').T
        # both regressions need the Gram of half + 1 lags only: x[t] is of lags 1 .. j, x[t+1] of lags 0 .. j - 1
        both = gram[: half + width, : half + width]
        before = np.hstack([np.zeros((states, width)), from_lags])
        after = np.hstack([from_lags, np.zeros((states, width))])
        newest = np.eye(width, half + width)
        before_gram = before @ both
        prior = before_gram @ before.T
        c = np.linalg.solve(prior, before_gram[:, :width]).T
        innovation = newest - c @ before
        regressors = np.vstack([before, innovation])
        regressors_gram = regressors @ both
        s = regressors_gram[states:] @ innovation.T
        ak = np.linalg.solve(regressors_gram @ regressors.T, regressors_gram @ after.T).T
    except np.linalg.LinAlgError:
        return None
    a, k = ak[:, :states], ak[:, states:]
    growth = spectral_radius(a) / LARGEST_RADIUS
    a = a / max(growth, 1.0)
    if growth > max_growth or not spectral_radius(a - k @ c) < LARGEST_RADIUS:
        return None
    return a, k, c, 0.5 * (s + s.T), 0.5 * (prior + prior.T), from_lags


def spectral_radius(matrix: np.ndarray) -> float:
    """Largest absolute value of the eigenvalues of a finite matrix (n, n)."""
    return np.abs(np.linalg.eigvals(matrix)).max()
