"""filterpy's extended Kalman filter of a hull under a moment; its prediction is compiled where numba is installed.

The state is [angle, rate, trim, ratios, moment's states z]; a prediction changes mean (n,) and covariance (n, n)
in place.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.simulation import (
    as_tuple,
    damping_moment,
    damping_slope,
    motion_step,
    restoring_moment,
    restoring_slope,
    term_moments,
)
from swath_sysid.attitude.hull.terms import AT
from swath_sysid.attitude.prediction.hull_state import (
    ANGLE,
    HULL_STATES,
    LARGEST_ANGLE_VARIANCE,
    LARGEST_JUMP,
    LARGEST_RATE_VARIANCE,
    LONGEST_STEP,
    OF_HULL,
    RATE,
    RATIOS,
    TRIM,
)
from swath_sysid.common.accelerator import accelerated

#: Of a sensor; beside the largest variance, S with less is singular to rounding.
LEAST_NOISE_VARIANCE = LARGEST_RATE_VARIANCE * float(np.finfo(float).resolution)

NO_MOMENT = np.empty((0, 3)), np.empty(0), np.empty((0, 0))
STRAIN_GAIN = 0.2  #: Of the running mean of a filter's innovations squared over their expectation.

Pair = tuple[float, float]  #: Of the angle and of the rate.


@accelerated
def hull_step(
    state: np.ndarray, moment: float, rate_variance: float, step: float, hull: tuple
) -> tuple[float, float, np.ndarray]:
    """Angle and rate after a short step, s, under a held moment, rad/s^2, and their slopes (2, 13).

    Slopes by angle, rate, trim, ratios and moment: exponential of [[0, 1], [a, c]] and its integral to third
    order, in the middle of the step. Mean damping over a normal rate: E[w^3] = m^3 + 3 m v, E[|w| w] near m sqrt(m^2 +
    8 v / pi) (Roberts and Spanos 1990, Random Vibration and Statistical Linearization).
    """
    active, friction_rate = hull
    angle, rate, trim = float(state[0]), float(state[1]), float(state[TRIM])
    of_quadratic = math.sqrt(rate * rate + 8.0 / math.pi * rate_variance) - abs(rate)
    of_cubic = 3.0 * rate_variance
    mean_ratios = state[RATIOS:HULL_STATES].copy()
    mean_ratios[AT.b1] += mean_ratios[AT.b2] * of_quadratic + mean_ratios[AT.b3] * of_cubic
    ratios = as_tuple(mean_ratios)
    half = 0.5 * step
    x = angle - trim
    start = moment - damping_moment(rate, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
    middle_x, middle_rate = x + half * rate, rate + half * start
    a = -restoring_slope(middle_x, ratios, active)
    c = -damping_slope(middle_rate, ratios, active, friction_rate)
    if abs(x) < 0.5 * math.pi and step * max(abs(c), math.sqrt(abs(a))) < 1.0:
        terms = term_moments(middle_x, middle_rate, friction_rate)
        terms[AT.b2] += of_quadratic * middle_rate
        terms[AT.b3] += of_cubic * middle_rate
        _, x, new_rate = motion_step(x, rate, moment, step, ratios, active, friction_rate)
        angle, rate = x + trim, new_rate
    else:
        # capsized, or far outside what the hull was identified on: the equation is not valid (nor stable)
        a = c = 0.0
        terms = np.zeros(HULL_STATES - RATIOS)
        angle, rate = angle + step * (rate + half * moment), rate + step * moment
    h2, h3 = half * step, half * step * step / 3.0
    square = a + c * c
    gain_angle, gain_rate = h2 + c * h3, step + c * h2 + square * h3
    slopes = np.empty((2, HULL_STATES + 1))
    slopes[0, 0], slopes[0, 1] = 1.0 + a * h2 + a * c * h3, gain_rate
    slopes[1, 0] = a * step + a * c * h2 + a * square * h3
    slopes[1, 1] = 1.0 + c * step + square * h2 + c * (a + square) * h3
    for row, gain in ((0, gain_angle), (1, gain_rate)):
        slopes[row, TRIM], slopes[row, HULL_STATES] = -a * gain, gain
        for k in range(HULL_STATES - RATIOS):
            slopes[row, RATIOS + k] = -gain * terms[k]
    return float(angle), float(rate), slopes


@accelerated
def transition(blocks: np.ndarray, step: float) -> np.ndarray:
    """Transition of the state over a step, (n, n), without the rows of angle and rate."""
    n = HULL_STATES + 2 * len(blocks)
    f = np.zeros((n, n))
    for i in range(TRIM, HULL_STATES):
        f[i, i] = 1.0
    for k in range(len(blocks)):
        i, j = HULL_STATES + 2 * k, HULL_STATES + 2 * k + 1
        decay, v = math.exp(blocks[k, 0] * step), blocks[k, 2]
        if v > 0.0:
            f[i, i] = f[j, j] = decay * math.cos(v * step)
            f[i, j] = decay * math.sin(v * step)
            f[j, i] = -f[i, j]
        else:
            f[i, i], f[j, j] = decay, math.exp(blocks[k, 1] * step)
    return f


def _inner_each(a: np.ndarray, b: np.ndarray) -> float:
    """Inner product of two vectors (n,)."""
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


def _settle_each(covariance: np.ndarray, stationary: np.ndarray, sign: float) -> None:
    """Add the moment's stationary covariance to that of the state, or subtract it, in place."""
    for i in range(len(stationary)):
        for j in range(len(stationary)):
            covariance[HULL_STATES + i, HULL_STATES + j] += sign * stationary[i, j]


def _settle_at_once(covariance: np.ndarray, stationary: np.ndarray, sign: float) -> None:
    covariance[HULL_STATES:, HULL_STATES:] += sign * stationary


def _drive_each(f: np.ndarray, output: np.ndarray, mean: np.ndarray) -> float:
    """Move the moment's mean over a step, in place: the moment, by half of its output (2 B,) before and after."""
    held = 0.0
    for k in range(HULL_STATES, len(mean), 2):
        x, y = mean[k], mean[k + 1]
        mean[k], mean[k + 1] = f[k, k] * x + f[k, k + 1] * y, f[k + 1, k] * x + f[k + 1, k + 1] * y
        held += output[k - HULL_STATES] * (x + mean[k]) + output[k + 1 - HULL_STATES] * (y + mean[k + 1])
    return held


def _drive_at_once(f: np.ndarray, output: np.ndarray, mean: np.ndarray) -> float:
    before = mean[HULL_STATES:].copy()
    mean[HULL_STATES:] = f[HULL_STATES:, HULL_STATES:] @ before
    return float(output @ (before + mean[HULL_STATES:]))


def _move_each(
    f: np.ndarray, slopes: np.ndarray, output: np.ndarray, settled: np.ndarray, growth: tuple, covariance: np.ndarray
) -> None:
    """Move a covariance (n, n), less the moment's stationary one, over a step, in place.

    Half of the moment's output (2 B,) acts at the start, by ``rows``, and half at the end, by ``end``; ``settled`` is
    its product with the stationary covariance, ``growth`` has drift and step. The transition's zeros are skipped.
    """
    c, n, first = covariance, len(covariance), HULL_STATES
    by_state, rows, end, of_end = np.empty((2, n)), np.zeros((2, n)), np.zeros(n), 0.0
    for i in range(2):
        for k in range(n):
            by_state[i, k] = slopes[i, k] if k < first else slopes[i, first] * output[k - first]
            for j in range(n):
                rows[i, j] += by_state[i, k] * c[k, j]
        for k in range(first, n):
            rows[i, k] += slopes[i, first] * settled[k - first]
    for i in range(2):
        for j in range(n):
            c[i, j] = rows[i, j]
    # f c f' as f (f c)' twice: pairs of columns, and a transposition without the rows of angle and rate
    for start in (0, TRIM):
        for k in range(first, n, 2):
            a, b, d, e = f[k, k], f[k, k + 1], f[k + 1, k], f[k + 1, k + 1]
            for i in range(start, n):
                c[i, k], c[i, k + 1] = a * c[i, k] + b * c[i, k + 1], d * c[i, k] + e * c[i, k + 1]
        for i in range(TRIM, n):
            for j in range(TRIM, i):
                c[i, j], c[j, i] = c[j, i], c[i, j]
    drift, step = growth
    for i in range(len(drift)):
        for j in range(len(drift)):
            c[TRIM + i, TRIM + j] += step * drift[i, j]
    for i in range(2):
        for j in range(2):
            c[i, j] = 0.0
            for k in range(n):
                c[i, j] += rows[i, k] * by_state[j, k]
        for k in range(first, n):
            end[i] += output[k - first] * c[i, k]
    for k in range(first, n):
        end[k] += settled[k - first]
        for j in range(TRIM, n):
            end[j] += output[k - first] * c[k, j]
    for k in range(first, n):
        of_end += output[k - first] * end[k]
    for i in range(2):
        gain = slopes[i, first]
        for j in range(2):
            c[i, j] += gain * end[j] + slopes[j, first] * (end[i] + gain * of_end)
        for j in range(TRIM, n):
            c[i, j] += gain * end[j]
            c[j, i] = c[i, j]


def _move_at_once(
    f: np.ndarray, slopes: np.ndarray, output: np.ndarray, settled: np.ndarray, growth: tuple, covariance: np.ndarray
) -> None:
    c, first, rest = covariance, HULL_STATES, slice(TRIM, None)
    gain = slopes[:, first:]
    f[:2, :first], f[:2, first:] = slopes[:, :first], gain * output
    rows = f[:2] @ c
    rows[:, first:] += gain * settled
    c[rest, rest] = f[rest, rest] @ c[rest, rest] @ f[rest, rest].T
    c[:2] = rows @ f.T
    c[:, :2] = c[:2].T
    c[OF_HULL, OF_HULL] += growth[1] * growth[0]
    end = output @ c[first:]
    end[first:] += settled
    c[:2] += gain * end
    c[:2, :2] += (end[:2, None] + gain * (output @ end[first:])) * gain.T
    c[rest, :2] = c[:2, rest].T


inner = accelerated(_inner_each, np.dot)
settle = accelerated(_settle_each, _settle_at_once)
drive = accelerated(_drive_each, _drive_at_once)
move = accelerated(_move_each, _move_at_once)


@accelerated
def predict(
    mean: np.ndarray,
    covariance: np.ndarray,
    moment: tuple,
    hull: tuple,
    drift: np.ndarray,
    durations: np.ndarray,
    longest: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Move mean (n,) and covariance (n, n), n = 12 + 2 B, on in place by successive durations (L,), s.

    Returns angle and rate (L, 2) and their covariance (L, 2, 2) after each. Steps are up to ``longest``; over a step
    the moment and its noise act by the mean of their values at both ends. ``moment``: blocks (B, 3), output (2 B,),
    stationary covariance (2 B, 2 B); ``drift`` (10, 10): growth of the covariance of trim and ratios per
    second.
    """
    blocks, output, stationary = moment
    half, settled = np.empty(output.size), np.empty(output.size)
    means, spreads = np.empty((durations.size, 2)), np.empty((durations.size, 2, 2))
    for k in range(output.size):
        half[k], settled[k] = 0.5 * output[k], 0.5 * inner(output, stationary[k])
    # what differs from the moment's stationary covariance dies out, and no noise need be added
    settle(covariance, stationary, -1.0)
    for lead in range(durations.size):
        duration = durations[lead]
        count = max(1, math.ceil(duration / longest - 1e-6)) if duration > 0.0 else 0
        step = duration / max(1, count)
        f = transition(blocks, step)
        for _ in range(count):
            held = drive(f, half, mean)
            mean[0], mean[1], slopes = hull_step(mean, held, covariance[1, 1], step, hull)
            move(f, slopes, half, settled, (drift, step), covariance)
            limit(covariance)
        for i in range(2):
            means[lead, i] = mean[i]
            for j in range(2):
                spreads[lead, i, j] = covariance[i, j]
    settle(covariance, stationary, 1.0)
    return means, spreads


@accelerated
def limit(covariance: np.ndarray) -> None:
    """Bound the variances of angle and rate, in place, without a change of their correlations."""
    for place, most in ((0, LARGEST_ANGLE_VARIANCE), (1, LARGEST_RATE_VARIANCE)):
        if covariance[place, place] > most:
            shrink = math.sqrt(most / covariance[place, place])
            for k in range(len(covariance)):
                covariance[place, k] *= shrink
                covariance[k, place] *= shrink


class HullTrack(ExtendedKalmanFilter):
    """filterpy's filter, moved on by the functions above; each call passes the elapsed time.

    ``x`` (n,) and ``P`` (n, n) are mean and covariance, ``y`` and ``S`` innovation and its covariance of what the last
    sample measured, ``moment`` is `ModalMoment`'s blocks, output and stationary covariance, ``strain`` the running mean
    of squared innovations over their expectation; one is healthy.
    """

    def __init__(self) -> None:
        super().__init__(dim_x=HULL_STATES, dim_z=2)
        self.moment = NO_MOMENT
        self.strain = 1.0
        self.set_state(np.zeros(HULL_STATES), np.eye(HULL_STATES))
        self.set_hull(None, np.zeros((HULL_STATES - TRIM,) * 2))

    def set_hull(self, model: DecayModel | None, drift: np.ndarray) -> None:
        """Swap the equation; None: a constant rate that the moment drives. ``drift`` as `predict` has it."""
        self.hull, self.drift, self.longest = ((False,) * (HULL_STATES - RATIOS), 1.0), drift, LONGEST_STEP
        if model is not None:
            self.hull = model.equation.active, float(model.friction_rate)
            by_angle, by_rate = model.jacobian(model.trim, 0.0)
            fastest = max(math.sqrt(abs(by_angle)), abs(by_rate))
            self.longest = 0.25 / max(fastest, 0.25 / LONGEST_STEP)
        self.foreseen: Any = None

    def set_state(self, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Replace the state, of whatever size."""
        self.x, self.P = np.array(mean), np.array(covariance)
        self.dim_x = n = self.x.size
        self._I, self._rows = np.eye(n), np.eye(2, n)
        self.foreseen = None

    def set_part(self, places: slice, mean: Any, covariance: np.ndarray) -> None:
        """Replace some states and make them independent of the others."""
        self.x[places] = mean
        self.P[places] = self.P[:, places] = 0.0
        self.P[places, places] = covariance
        self.foreseen = None

    def advance(self, duration: float) -> None:
        """Predict over a duration, s."""
        foreseen, self.foreseen = self.foreseen, None
        if foreseen is not None and abs(foreseen[0] - duration) < 1e-6:
            _, self.x, self.P = foreseen
        elif duration > 0.0:
            self.predict(duration)

    def ahead(self, lead: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance one lead after the present state, which stays as it is."""
        if self.foreseen is None or self.foreseen[0] != lead:
            now = self.x.copy(), self.P.copy()
            self.predict(lead)
            self.foreseen = lead, self.x, self.P
            self.x, self.P = now
        return self.foreseen[1:]

    def forecast(self, leads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean, (L, 2), and covariance, (L, 2, 2), of angle and rate at increasing leads, s."""
        durations = np.array(leads, dtype=float)
        durations[1:] -= leads[:-1]
        state = self.x.copy(), self.P.copy()
        return predict(*state, self.moment, self.hull, self.drift, durations, self.longest)

    def predict(self, duration: float) -> None:
        """Move the state on by a duration, s, longer than zero."""
        predict(self.x, self.P, self.moment, self.hull, self.drift, np.array([duration]), self.longest)

    def update(self, values: Pair, variances: Pair, learns: bool) -> None:
        """filterpy's update with angle and rate, of which one may be NaN: not measured.

        Trim and ratios that are not learnt are considered (Schmidt 1966): they are put back, and their uncertainty
        still counts.
        """
        angle, rate = values
        measured = slice(int(angle != angle), 1 + int(rate == rate))
        self.H, self.x_prior, self.P_prior = self._rows[measured], self.x, self.P
        self.R[0, 0], self.R[1, 1] = (max(variance, LEAST_NOISE_VARIANCE) for variance in variances)
        super().update(np.array(values[measured]), lambda _: self.H, self.H.dot, self.R[measured, measured])
        if not learns:
            self.x[OF_HULL], self.P[OF_HULL, OF_HULL] = self.x_prior[OF_HULL], self.P_prior[OF_HULL, OF_HULL]
        self.strain += STRAIN_GAIN * (self.mahalanobis**2 / self.y.size - self.strain)

    @property
    def log_likelihood(self) -> float:
        """Of the last update, in closed form: filterpy's takes 50 us, and drops a known angle beside a free rate."""
        return -0.5 * (self.mahalanobis**2 + math.log(np.linalg.det(2.0 * math.pi * self.S)))

    def is_outlier(self, gates: Sequence[float], elapsed: float, min_jump: float) -> bool:
        """Whether the last update's NIS exceeds its gate, by the number of values, ``elapsed`` s after the one before.

        The moment may have jumped in that time, as at a release, by about the hull's: a variance of rank one.
        """
        nis, gate = self.mahalanobis**2, gates[self.y.size]
        if nis <= gate:
            return False
        active, friction_rate = self.hull
        mean, ratios = self.x_prior, self.x_prior[RATIOS:HULL_STATES]
        moment, rate = float(self.moment[1] @ mean[HULL_STATES:]), float(mean[RATE])
        own = damping_moment(rate, ratios, active, friction_rate)
        own += restoring_moment(float(mean[ANGLE] - mean[TRIM]), ratios, active)
        jump = min(2.0 * (min_jump + abs(moment) + abs(rate) + abs(own)), LARGEST_JUMP * min_jump)
        by_jump = self.H[:, :TRIM] @ [0.5 * elapsed * elapsed * jump, elapsed * jump]
        share = self.SI @ by_jump
        return nis - float(share @ self.y) ** 2 / (1.0 + float(share @ by_jump)) > gate  # Sherman and Morrison (1950)

    def undo_update(self) -> None:
        """Back to the prediction: the last sample is not used."""
        self.x, self.P = self.x_prior, self.P_prior
