"""A linear state space in innovations form (Anderson and Moore 1979, section 9.2), with one filter for all models.

x[t+1] = A x[t] + K e[t], y[t] = C x[t] + e[t], cov e = S. With complete samples x is a known function of the past;
where values are lost, the Kalman update with the correlated noises K e and e gives its uncertainty.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import block_diag

# rows before the newest that the interpolation and the differences at a lead of zero reach back to
_PAST = 4
# fourth-order central difference: 4 % low at six samples a period, where the second-order one is 17 % low
_DIFFERENCE = {-2: 1.0 / 12.0, -1: -8.0 / 12.0, 1: 8.0 / 12.0, 2: -1.0 / 12.0}
#: Variance of white noise that every channel is given, over the channel's own: without it, channels of which one
#: follows from others without error have singular innovations; more costs .1 s ahead (1e-6: 5 to 20 %).
RIDGE = 1e-8
# a state whose errors are this much less than the innovations (in variance) is known
_KNOWN = 1e-4
#: A ratio beyond which a candidate knows nothing of the present motion.
CONTRADICTED = 25.0
#: An error this many times (in variance) what was expected is not an innovation: the motion was broken off.
BREAK = 400.0
#: Standard deviations of the past beyond which what a channel tells of the targets, as in a turn, was never learnt.
_LEARNT_UP_TO = 5.0


@dataclass(frozen=True)
class InnovationsModel:
    """A state space of C channels, n states, on rows one step apart."""

    channels: tuple[str, ...]  #: Names of the channels that the model reads and forecasts.
    places: tuple[int, ...]  #: Their columns in the rows that a filter is given.
    step: float  #: s between rows.
    mean: np.ndarray  #: (C,); the state space is of ``(y - mean) / scale``.
    scale: np.ndarray  #: (C,)
    a: np.ndarray  #: (n, n)
    k: np.ndarray  #: (n, C)
    c: np.ndarray  #: (C, n)
    s: np.ndarray  #: (C, C)
    prior: np.ndarray  #: (n, n); Covariance of the state before any row.
    #: (n, j C), or None; The state at the next row from the j newest rows, newest first: a start without a transient.
    from_lags: Any = None

    @property
    def lags(self) -> int:
        """Complete rows that a start from lags needs."""
        return 0 if self.from_lags is None else self.from_lags.shape[1] // len(self.channels)


class Between(NamedTuple):
    """Places (L,) among whole steps."""

    whole: np.ndarray  #: (L,); steps before.
    part: Any = None  #: (L, 1, 1); of the way to the next one; None: all are whole.
    weights: Any = None  #: (L, 1, 4); of the one before, both and the one after, by cubics.


@lru_cache(maxsize=64)
def _between(steps: bytes) -> Between:
    """Of numbers as they lie in memory: the same leads are asked for again and again."""
    count = np.frombuffer(steps)
    near = np.round(count)
    whole = np.where(np.abs(count - near) < 1e-6, near, np.floor(count)).astype(int)
    part = count - whole
    if not (np.abs(part) > 1e-6).any():
        return Between(whole)
    return Between(whole, part[:, None, None], cubic_weights(part)[:, None])


class InnovationsFilter:
    """Steps a model through rows, complete or not, and forecasts targets from the newest.

    Targets are channels, or the difference ``X_rate`` of a channel ``X``; NaN without either. ``horizon``, s, is the
    longest lead. ``nis`` is the running mean, over a memory in s, of squared innovations over their expectation; one is
    healthy. ``state`` (n,) and ``state_covariance`` (n, n), None where the state is known, are those after the newest
    row.
    """

    def __init__(
        self, model: InnovationsModel, targets: Sequence[str], horizon: float, nis_memory: float = 1.0
    ) -> None:
        self.model = model
        self.targets = tuple(targets)
        self._places = np.array(model.places, dtype=int)
        self._scale = 1.0 / model.scale
        self._following = np.vstack([model.c, model.a])
        self._driven = model.k @ model.s @ model.k.T
        self._floor = _KNOWN * np.diag(model.s)
        watched = [name in self.targets for name in model.channels]
        self._watched = np.array(watched) if any(watched) else np.ones(len(watched), dtype=bool)
        self._precision = np.linalg.inv(model.s[np.ix_(self._watched, self._watched)])
        self._nis_gain = min(1.0, model.step / nis_memory)
        self._largest = BREAK * np.diag(model.s)
        self._learnt_up_to = np.where(self._watched, np.inf, _LEARNT_UP_TO)
        self._last = int(np.ceil(horizon / model.step - 1e-6))
        self._prepare()
        self.reset()

    def reset(self) -> None:
        """Forget all rows."""
        self.state = np.zeros(self.model.a.shape[0])
        self.state_covariance: Any = self.model.prior
        self._recent = deque([np.zeros(len(self.model.channels))] * _PAST, maxlen=_PAST)
        self._ahead: Any = None
        self.nis = 1.0

    def seed(self, rows: np.ndarray) -> None:
        """Begin with recent rows (N, width), oldest first, NaN where missing.

        The state comes from the lags of the first run of complete rows, if any.
        """
        self.reset()
        count = self.model.lags
        complete = np.isfinite(rows[:, self._places]).all(axis=1)
        if count and (whole := whole_lags(complete, count)).any():
            end = int(np.argmax(whole)) + 1
            lags = (rows[end - count : end, self._places] - self.model.mean) * self._scale
            self.state, self.state_covariance = self.model.from_lags @ lags[::-1].ravel(), None
            self._recent.extend(lags[-_PAST:])
            rows = rows[end:]
        for row in rows:
            self.take(row)

    def take(self, row: np.ndarray) -> None:
        """Update with the next row (width,), NaN where missing."""
        z = (row[self._places] - self.model.mean) * self._scale
        self._ahead = None
        if self.state_covariance is None:
            following = self._following @ self.state
            error = z - following[: z.size]
            watched = error[self._watched]
            self._follow_nis(float(watched @ self._precision @ watched) / watched.size)
            # false for NaN, too
            if ((error * error < self._largest) & (np.abs(z) < self._learnt_up_to)).all():
                self.state = following[z.size :] + self.model.k @ error
                self._recent.append(z)
                return
            self.state_covariance = np.zeros_like(self.model.a)
        self._update(z, np.isfinite(z))

    def _follow_nis(self, square: float):
        if square == square:
            self.nis += self._nis_gain * (square - self.nis)

    def _update(self, z: np.ndarray, seen: np.ndarray):
        """The Kalman update with the channels that were seen, all or none of them included.

        With V = C P C' + S of the seen, G = (A P C' + K S) V^-1:  x <- A x + G e,  P <- A P A' + K S K' - G V G'.
        """
        m = self.model
        c = m.c[seen]
        error = z[seen] - c @ self.state
        pc = self.state_covariance @ c.T
        v = c @ pc + m.s[np.ix_(seen, seen)]
        squares = error * error / np.diag(v)
        is_unlearnt = ~self._watched[seen] & ((squares > BREAK) | (np.abs(z[seen]) > _LEARNT_UP_TO))
        if is_unlearnt.any():
            seen = seen.copy()
            seen[seen] = ~is_unlearnt
            self._update(z, seen)
            return
        if (squares > BREAK).any() and self.state_covariance is not m.prior:
            self.state, self.state_covariance = np.zeros_like(self.state), m.prior
            self._update(z, seen)
            return
        of_watched = squares[self._watched[seen]]
        if of_watched.size:
            self._follow_nis(float(of_watched.mean()))
        expected = m.c @ self.state
        self.state, covariance = m.a @ self.state, m.a @ self.state_covariance @ m.a.T + self._driven
        if seen.any():
            both = np.vstack([m.a @ pc + m.k @ m.s[:, seen], m.c @ pc + m.s[:, seen]])
            gain = np.linalg.solve(v, both.T).T
            states = self.state.size
            self.state += gain[:states] @ error
            expected = expected + gain[states:] @ error
            covariance -= gain[:states] @ both[:states].T
        covariance = 0.5 * (covariance + covariance.T)
        known = seen.all() and (((m.c @ covariance) * m.c).sum(axis=1) <= self._floor).all()
        self.state_covariance = None if known else covariance
        self._recent.append(np.where(seen, z, expected))

    def ahead(self, rows: np.ndarray, doubt: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        """Mean (L, M) of the targets, and covariance (L, M, M) with the sensors' noise, so many rows (L,) ahead.

        Between whole rows the mean is interpolated by cubics, the covariance linearly. ``doubt`` multiplies the part of
        the variance that is the state's: a model may err about a state that it has not followed.
        """
        means, covariances = self._at_rows(doubt)
        whole, part, weights = _between(np.asarray(rows, dtype=float).tobytes())
        if weights is None:
            return means[whole + 1], covariances[whole]
        mean = (weights @ means[whole[:, None] + np.arange(4)])[:, 0]
        return mean, (1.0 - part) * covariances[whole] + part * covariances[np.minimum(whole + 1, self._last + 1)]

    def _at_rows(self, doubt: float):
        """Means at rows -1, 0, ... and covariances at rows 0, 1, ..., until the next row comes."""
        if self._ahead is None or self._ahead[0] != doubt:
            means = self._of_past @ np.concatenate([self.state, *self._recent])
            free, p, of_state = self._free, self.state_covariance, self._of_state
            if p is not None:
                free = free + doubt * (of_state @ p @ of_state.transpose(0, 2, 1))
            self._ahead = doubt, means.reshape(-1, len(self.targets)) + self._offset, free
        return self._ahead[1:]

    def _find_targets(self):
        """Units of the targets, their places and channels, and factors of a channel by the steps from the target."""
        model = self.model
        place_of = {name: place for place, name in enumerate(model.channels)}
        self._unit, self._offset = np.full((2, len(self.targets)), np.nan)
        sources = []
        for place, name in enumerate(self.targets):
            is_direct = name in place_of
            source = place_of.get(name if is_direct else name.removesuffix('_rate'))
            if source is not None:
                sources.append((place, source, {0: 1.0} if is_direct else _DIFFERENCE))
                self._unit[place] = model.scale[source] / (1.0 if is_direct else model.step)
                self._offset[place] = model.mean[source] if is_direct else 0.0
        return sources

    def _prepare(self):
        """The model's response for forecasts: psi_0 = 1, psi_j = C A^(j-1) K.

        The error of a forecast h steps ahead is the sum of psi_j e over j < h, and C A^(h-1) times the state's own
        error.
        """
        m, (states, channels) = self.model, self.model.k.shape
        steps = self._last
        sources = self._find_targets()

        def as_targets(path: np.ndarray) -> np.ndarray:
            """Of the channels at consecutive steps, shape (T, C, ...), the targets from two steps further in."""
            result = np.full((path.shape[0] - 4, len(self.targets), *path.shape[2:]), np.nan)
            for place, source, factors in sources:
                terms = [f * path[2 + k : path.shape[0] - 2 + k, source] for k, f in factors.items()]
                result[:, place] = self._unit[place] * sum(terms)
            return result

        ahead = np.empty((steps + 4, channels, states))
        ahead[0] = m.c
        for h in range(1, steps + 4):
            ahead[h] = ahead[h - 1] @ m.a
        past = np.zeros((_PAST + steps + 4, channels, states + _PAST * channels))
        past[_PAST:, :, :states] = ahead
        past[:_PAST, :, states:] = np.eye(_PAST * channels).reshape(_PAST, channels, -1)
        of_past = as_targets(past)
        self._of_past = of_past.reshape(-1, past.shape[2])
        self._of_state = np.ascontiguousarray(of_past[1:-1, :, :states])
        now = np.eye(channels)[None]
        response = as_targets(np.concatenate([np.zeros((_PAST, *now.shape[1:])), now, ahead[:-1] @ m.k]))[:-1]
        self._free = np.cumsum(response @ m.s @ response.transpose(0, 2, 1), axis=0)[1:]


def side_by_side(models: Sequence[InnovationsModel]) -> InnovationsModel:
    """Models of different channels with the same step as one, uncoupled; with a start from lags where all have one."""
    whole = {name: block_diag(*(getattr(m, name) for m in models)) for name in ('a', 'k', 'c', 's', 'prior')}
    from_lags = None
    if all(m.lags for m in models):
        from_lags = np.zeros((whole['a'].shape[0], max(m.lags for m in models), whole['c'].shape[0]))
        state = channel = 0
        for m in models:
            states, channels = m.k.shape
            own = m.from_lags.reshape(states, m.lags, channels)
            from_lags[state : state + states, : m.lags, channel : channel + channels] = own
            state, channel = state + states, channel + channels
        from_lags = from_lags.reshape(from_lags.shape[0], -1)
    return replace(
        models[0],
        channels=sum((m.channels for m in models), ()),
        places=sum((m.places for m in models), ()),
        mean=np.concatenate([m.mean for m in models]),
        scale=np.concatenate([m.scale for m in models]),
        from_lags=from_lags,
        **whole,
    )


def whole_lags(complete: np.ndarray, count: int) -> np.ndarray:
    """Whether a row and the ``count - 1`` before it are ``complete``, shape (N,)."""
    runs = np.cumsum(np.concatenate([np.zeros(count, dtype=int), complete]))
    return runs[count:] - runs[:-count] == count


def cubic_weights(part: np.ndarray) -> np.ndarray:
    """Lagrange weights (L, 4) of the values at -1, 0, 1, 2 for the cubic at ``part`` (L,), 0 to 1."""
    p = np.asarray(part)
    return np.stack(
        [
            -p * (p - 1.0) * (p - 2.0) / 6.0,
            (p + 1.0) * (p - 1.0) * (p - 2.0) / 2.0,
            -(p + 1.0) * p * (p - 2.0) / 2.0,
            (p + 1.0) * p * (p - 1.0) / 6.0,
        ],
        axis=-1,
    )
