"""Forecasts of heave, vertical velocity and acceleration from the state of the waves.

True heave is a zero-phase integral, known half a minute later; until then it is regressed on the state of the waves
and on leaky integrals of the vertical acceleration, which as channels would make the state space singular.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.motion.vertical import (
    ACCELERATION,
    EDGE,
    HEAVE,
    VELOCITY,
    LeakyIntegrals,
    vertical_acceleration,
    zero_phase_integral,
)
from swath_sysid.attitude.prediction.memories import MEMORY_OF_SIZE
from swath_sysid.attitude.prediction.point import ATTITUDE, POINT_MOTION
from swath_sysid.attitude.prediction.rows import CHANNELS, RowClock
from swath_sysid.attitude.prediction.sea_state import MIN_DURATION
from swath_sysid.attitude.prediction.state_space import InnovationsFilter, InnovationsModel, cubic_weights
from swath_sysid.common.row_buffer import RowBuffer

#: Forecast here, with errors correlated with those of `ATTITUDE`; angular accelerations are for points.
VERTICAL = (*POINT_MOTION, 'roll_acceleration', 'pitch_acceleration')

FORCE = ('accel_x', 'accel_y', 'accel_z')
_PLACES = [CHANNELS.index(name) for name in (*AXES, *FORCE)]

_TRAINING_STEP = 0.4  #: s; closer rows are redundant for waves below `BAND_HZ`.
_ROWS_A_REGRESSOR = 4.0
#: Relative variance of noise added to the regressors, against rounding with few waves; on measured seas 1e-7 to 1e-4
#: make 2 % of difference.
_RIDGE = 1e-5

#: rad^2 and (rad/s)^2, below any sensor's resolution, for an angle that never changes.
_UNSEEN_VARIANCE = 1e-12


@dataclass(frozen=True)
class VerticalFit:
    """Regression of vertical motion on the present state."""

    #: (H, 9, P); of P regressors (state, leaky integrals, one) for `VERTICAL` and `ATTITUDE` 0 to H - 1 rows ahead.
    weights: np.ndarray
    covariance: np.ndarray  #: (H, 9, 9); Of the errors, `VERTICAL` and then `ATTITUDE` by the same regression.
    truth: np.ndarray  #: (N, 3); Heave, velocity and acceleration until half a minute ago.
    row: int  #: Number of the row of the last of ``truth``.


@dataclass(frozen=True)
class VerticalRequest:
    """Size and alignment of a `fit_vertical`."""

    ahead: int  #: H - 1: rows ahead that are to be forecast.
    delay: float = 0.0  #: s by which the accelerations lag behind the attitude.
    row: int = 0  #: Number of the newest row of the window.


def fit_vertical(
    stretch: np.ndarray,
    names: Sequence[str],
    step: float,
    model: InnovationsModel,
    request: VerticalRequest,
    age: int = 0,
) -> VerticalFit | None:
    """Learn vertical motion from a stretch (N, width) of complete rows, ``age`` rows before the window's end.

    ``model`` is of the waves, with a start from lags. None where a channel is missing or the stretch is too short.
    """
    ahead, place = request.ahead, {name: number for number, name in enumerate(names)}
    measured = stretch[:, [place[name] for name in (*ATTITUDE, *FORCE)]]
    edge, every = round(EDGE / step), max(1, round(_TRAINING_STEP / step))
    used = np.arange(max(edge, model.lags - 1), stretch.shape[0] - edge - ahead, every)
    width = model.a.shape[0] + LeakyIntegrals.COUNT + 1
    if not model.lags or used.size < _ROWS_A_REGRESSOR * width or not np.isfinite(measured).all():
        return None
    acceleration = vertical_acceleration(measured[:, 0], measured[:, 1], measured[:, 4:])
    truth = np.stack(
        [
            *(
                zero_phase_integral(acceleration, step, times, request.delay)
                for times in (HEAVE, VELOCITY, ACCELERATION)
            ),
            *(zero_phase_integral(rate, step, -1) for rate in measured[:, 2:4].T),
        ],
        axis=1,
    )
    states = states_from_lags(model, stretch[:, model.places], used)
    regressors = np.hstack([states, LeakyIntegrals(step).of(acceleration)[used], np.ones((used.size, 1))])
    targets = np.hstack([truth, measured[:, :4]])[used[:, None] + np.arange(ahead + 1)]
    flat = targets.reshape(used.size, -1)
    gram, order = regressors.T @ regressors, model.a.shape[0]
    gram[np.diag_indices(width)] *= 1.0 + _RIDGE
    of_noise = _RIDGE * model.from_lags @ model.from_lags.T
    gram[:order, :order] += used.size * of_noise
    found = np.linalg.solve(gram, regressors.T @ flat)
    errors = (flat - regressors @ found).reshape(targets.shape).transpose(1, 2, 0)
    weights = found.T.reshape(ahead + 1, -1, width)
    of_states = weights[:, :, :order]
    return VerticalFit(
        weights,
        errors @ errors.transpose(0, 2, 1) / (used.size - width) + of_states @ of_noise @ of_states.transpose(0, 2, 1),
        truth[edge:-edge, :3],
        request.row - age - edge,
    )


def states_from_lags(model: InnovationsModel, past: np.ndarray, used: np.ndarray) -> np.ndarray:
    """States (M, n) of the waves after the rows ``used`` (M,) of past channels (N, C), from the lags that end there."""
    z = (past - model.mean) / model.scale
    newest_first = sliding_window_view(z, model.lags, axis=0)[used - (model.lags - 1)][:, :, ::-1]
    return newest_first.transpose(0, 2, 1).reshape(used.size, -1) @ model.from_lags.T


class VerticalForecaster:
    """Vertical motion up to ``ahead`` rows of ``step`` s ahead, row by row."""

    def __init__(self, step: float, period: float, ahead: int) -> None:
        self.ahead = ahead
        self._step, self._period = step, period
        self._integrals = LeakyIntegrals(step)
        self._fit: VerticalFit | None = None
        self._mean: Any = None
        # forecasts by the number of the row after which they were issued, until their truth is known: their errors
        # calibrate the intervals over as many waves as show a sea state
        self._issued = np.full((round((MIN_DURATION + 2.0 * EDGE) / step) + ahead, ahead + 1, 3), np.nan)
        self._rows = 0
        # heave and vertical velocity at the rows, as they were then: what windows of calm are judged by
        self._nowcasts = RowBuffer(len(self._issued), 2)

    def install(self, fit: VerticalFit | None, newest: int, waves: InnovationsFilter) -> None:
        """Use a fit, None to forget the last, calibrated by the errors of the forecasts issued so far.

        ``newest`` is the number of the newest row, ``waves`` the filter of the fit's model after it.
        """
        self._fit = fit
        if fit is None:
            self._mean = None
            return
        kept, leads = self._issued.shape[0], np.arange(self.ahead + 1)
        count = min(fit.truth.shape[0], round(MIN_DURATION / self._step))
        came = self._rows - 1 - (newest - fit.row) - np.arange(count)[::-1]
        issued_after = came[:, None] - leads
        errors = fit.truth[-count:, None] - self._issued[issued_after % kept, leads]
        errors[(issued_after < 0) | (issued_after < self._rows - kept)] = np.nan
        ratio = np.mean(errors**2 / np.diagonal(fit.covariance, axis1=1, axis2=2)[:, :3], axis=2)
        prior = MEMORY_OF_SIZE * self._period / self._step
        scale = np.sqrt((prior + np.nansum(ratio, axis=0)) / (prior + np.isfinite(ratio).sum(axis=0)))[:, None, None]
        count = len(VERTICAL)
        cross = fit.covariance[:, :count, count:] * scale
        of_attitude = fit.covariance[:, count:, count:] + _UNSEEN_VARIANCE * np.eye(len(ATTITUDE))
        # of the vertical motion on the attitude's errors, and what is left of it when they are known
        self._slope = np.linalg.solve(of_attitude, cross.transpose(0, 2, 1)).transpose(0, 2, 1)
        self._left = fit.covariance[:, :count, :count] * scale**2 - self._slope @ cross.transpose(0, 2, 1)
        self._look_ahead(waves)

    def request(self, clock: RowClock, newest: int) -> VerticalRequest:
        """What a fit needs to know, at the newest row of this number."""
        # the accelerations of smoothed rows lag behind the attitude, which the hull filters give
        delay = (0.5 * clock.samples - 1.0) * clock.interval if clock.is_smoothed else 0.0
        return VerticalRequest(self.ahead, delay, newest)

    def take(self, row: np.ndarray, waves: InnovationsFilter | None) -> None:
        """Take one row of `CHANNELS`, NaN where missing; ``waves`` is the filter after it."""
        roll, pitch, *force = row[_PLACES]
        self._integrals.take(float(vertical_acceleration(roll, pitch, np.array(force))))
        self._look_ahead(waves)
        self._nowcasts.append((np.nan, np.nan) if self._mean is None else self._mean[0, :2])
        self._issued[self._rows % self._issued.shape[0]] = np.nan if self._mean is None else self._mean[:, :3]
        self._rows += 1

    def predict(self, count: int, waves: InnovationsFilter | None) -> None:
        """Go on over ``count`` missing rows; ``waves`` is the filter after them."""
        for _ in range(min(count, self._issued.shape[0])):
            self.take(np.full(len(CHANNELS), np.nan), waves)

    def _look_ahead(self, waves: InnovationsFilter | None):
        self._mean = self._state_covariance = None
        if self._fit is not None and waves is not None:
            self._mean = self._fit.weights @ np.concatenate([waves.state, self._integrals.values, [1.0]])
            self._state_covariance = waves.state_covariance

    def nowcasts(self, behind: np.ndarray) -> np.ndarray:
        """Heave and vertical velocity (N, 2), m and m/s, so many rows (N,) ago, NaN before anything was learnt."""
        return self._nowcasts.at(self._nowcasts.newest - behind)

    def forecast(
        self, leads: np.ndarray, age: float, attitude: np.ndarray, attitude_covariance: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """`VERTICAL` and `ATTITUDE` (L, 9) at leads (L,), s from now, in SI units, and their covariance (L, 9, 9).

        Given the attitude forecast (L, 4) and its covariance (L, 4, 4). The regression forecasts the attitude too: by
        the correlation of their errors a better attitude improves the vertical motion. None before anything is learnt.
        """
        if self._fit is None or self._mean is None or not np.isfinite(attitude_covariance).all():
            return None
        steps = np.minimum((leads + age) / self._step, self.ahead)
        low = np.minimum(np.floor(steps + 1e-6).astype(int), self.ahead - 1)
        base = np.clip(low, 1, self.ahead - 2)
        mean = np.einsum('lw,lwm->lm', cubic_weights(steps - base), self._mean[base[:, None] + np.arange(-1, 3)])
        part, count = (steps - low)[:, None, None], len(VERTICAL)
        slope = (1.0 - part) * self._slope[low] + part * self._slope[low + 1]
        both = slope @ attitude_covariance
        own = (1.0 - part) * self._left[low] + part * self._left[low + 1] + both @ slope.transpose(0, 2, 1)
        if self._state_covariance is not None:
            of_state = self._fit.weights[low][:, :count, : self._state_covariance.shape[0]]
            own = own + of_state @ self._state_covariance @ of_state.transpose(0, 2, 1)
        mean = np.hstack([mean[:, :count] + (slope @ (attitude - mean[:, count:])[:, :, None])[:, :, 0], attitude])
        covariance = np.empty((leads.size, len(VERTICAL) + len(ATTITUDE), len(VERTICAL) + len(ATTITUDE)))
        covariance[:, :count, :count], covariance[:, count:, count:] = own, attitude_covariance
        covariance[:, :count, count:], covariance[:, count:, :count] = both, both.transpose(0, 2, 1)
        return mean, covariance
