"""filterpy's extended Kalman filter of a hull under a moment; its prediction is compiled where numba is installed.

The state is [angle, rate, trim, ratios, moment's states z]; a prediction changes mean (n,) and covariance (n, n)
in place.
"""

import math
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.simulation import (
    as_tuple,
    damping_moment,
    damping_slope,
    mean_damping_slopes,
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
from swath_sysid.common.filterpy_filter import ExtendedKalmanFilter

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
    order, in the middle of the step. The damping is the mean over a normal rate.
    """
    active, friction_rate = hull
    angle, rate, trim = float(state[0]), float(state[1]), float(state[TRIM])
    spread = mean_damping_slopes(rate, rate_variance)
    mean_ratios = state[RATIOS:HULL_STATES].copy()
    for k in range(len(spread)):
        mean_ratios[AT.b1] += state[RATIOS + k] * spread[k]
    ratios = as_tuple(mean_ratios)
    half = 0.5 * step
    x = angle - trim
    start = moment - damping_moment(rate, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
    middle_x, middle_rate = x + half * rate, rate + half * start
    a = -restoring_slope(middle_x, ratios, active)
    c = -damping_slope(middle_rate, ratios, active, friction_rate)
    if abs(x) < 0.5 * math.pi and step * max(abs(c), math.sqrt(abs(a))) < 1.0:
        terms = term_moments(middle_x, middle_rate, friction_rate)
        for k in range(len(spread)):
            terms[k] += spread[k] * middle_rate
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
def transition(blocks: np.ndarray, output: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Transition (n, n) of the state over a step, without the rows of angle and rate, and mean output (2 B,)."""
    f = np.zeros((HULL_STATES + output.size, HULL_STATES + output.size))
    held = np.empty(output.size)
    for i in range(TRIM, HULL_STATES):
        f[i, i] = 1.0
    for block in range(len(blocks)):
        k, i = 2 * block, HULL_STATES + 2 * block
        v, a = blocks[block, 2], math.exp(blocks[block, 0] * step)
        b, d = 0.0, a
        if v > 0.0:
            a, b = a * math.cos(v * step), a * math.sin(v * step)
            d = a
        else:
            d = math.exp(blocks[block, 1] * step)
        f[i, i], f[i, i + 1], f[i + 1, i], f[i + 1, i + 1] = a, b, -b, d
        first, second = 0.5 * output[k], 0.5 * output[k + 1]
        held[k], held[k + 1] = first + first * a - second * b, second + first * b + second * d
    return f, held


def _inner_each(a: np.ndarray, b: np.ndarray) -> float:
    """Inner product of two vectors (n,)."""
    total = 0.0
    for k in range(len(a)):
        total += a[k] * b[k]
    return total


@accelerated
def turn(f: np.ndarray, c: np.ndarray) -> None:
    """Replace a symmetric c (n, n) by f c f', of the transition's blocks alone, in place."""
    for k in range(HULL_STATES, len(c), 2):
        same, after, before, own = f[k, k], f[k, k + 1], f[k + 1, k], f[k + 1, k + 1]
        for j in range(len(c)):
            x, y = c[k, j], c[k + 1, j]
            c[k, j], c[k + 1, j] = same * x + after * y, before * x + own * y
        for j in range(len(c)):
            x, y = c[j, k], c[j, k + 1]
            c[j, k], c[j, k + 1] = same * x + after * y, before * x + own * y
        c[k + 1, k] = c[k, k + 1]


def _noise_each(f: np.ndarray, stationary: np.ndarray, drift: np.ndarray, step: float) -> np.ndarray:
    """Covariance (n, n) that a step adds, without the rows of angle and rate."""
    noise, first = np.zeros(f.shape), HULL_STATES
    for i in range(len(stationary)):
        for j in range(len(stationary)):
            noise[first + i, first + j] = -stationary[i, j]
    turn(f, noise)
    for i in range(len(stationary)):
        for j in range(len(stationary)):
            noise[first + i, first + j] += stationary[i, j]
    for i in range(len(drift)):
        for j in range(len(drift)):
            noise[TRIM + i, TRIM + j] = step * drift[i, j]
    return noise


def _noise_at_once(f: np.ndarray, stationary: np.ndarray, drift: np.ndarray, step: float) -> np.ndarray:
    noise, moment = np.zeros(f.shape), f[HULL_STATES:, HULL_STATES:]
    noise[HULL_STATES:, HULL_STATES:] = stationary - moment @ stationary @ moment.T
    noise[OF_HULL, OF_HULL] = step * drift
    return noise


def _move_each(over: tuple, slopes: np.ndarray, mean: np.ndarray, c: np.ndarray) -> None:
    """Move the moment's mean (of the state, (n,)) and the covariance (n, n) over a step, in place.

    ``over`` it: transition, output (2 B,) that acts on angle and rate, noise, that of the output with the state (n,),
    and its variance.
    """
    n, first, (f, held, noise, of_states, variance) = len(c), HULL_STATES, over
    # all but the motion acts on the angle as on the rate, but for the gain
    gain = slopes[:, first]
    by_rest, with_rest = np.zeros(n), np.zeros(n)
    for k in range(TRIM, n):
        by_rest[k] = slopes[1, k] / gain[1] if k < first else held[k - first]
        for j in range(n):
            with_rest[j] += by_rest[k] * c[k, j]
    for j in range(n):
        x, y = c[0, j], c[1, j]
        for i in range(2):
            c[i, j] = slopes[i, 0] * x + slopes[i, 1] * y + gain[i] * with_rest[j]
    for i in range(2):
        x, y, rest = c[i, 0], c[i, 1], inner(by_rest, c[i]) + gain[i] * variance
        for j in range(2):
            c[i, j] = slopes[j, 0] * x + slopes[j, 1] * y + gain[j] * rest
        for j in range(TRIM, n):
            c[j, i] = c[i, j]
    c[1, 0] = c[0, 1]
    turn(f, c)
    for i in range(TRIM, n):
        for j in range(2):
            c[i, j] += gain[j] * of_states[i]
            c[j, i] = c[i, j]
        for j in range(TRIM, n):
            c[i, j] += noise[i, j]
    for k in range(first, n, 2):
        x, y = mean[k], mean[k + 1]
        mean[k], mean[k + 1] = f[k, k] * x + f[k, k + 1] * y, f[k + 1, k] * x + f[k + 1, k + 1] * y


def _move_at_once(over: tuple, slopes: np.ndarray, mean: np.ndarray, c: np.ndarray) -> None:
    first, (f, held, noise, of_states, variance) = HULL_STATES, over
    gain = slopes[:, first:]
    f[:2, :first], f[:2, first:] = slopes[:, :first], gain * held
    mean[first:] = f[first:, first:] @ mean[first:]
    c[:] = f @ c @ f.T + noise
    c[:2, :2] += gain * gain.T * variance
    c[:2] += gain * of_states
    c[:, :2] += (gain * of_states).T


inner = accelerated(_inner_each, np.dot)
noise_of = accelerated(_noise_each, _noise_at_once)
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
    means, spreads = np.empty((durations.size, 2)), np.empty((durations.size, 2, 2))
    of_states, n, before = np.zeros(mean.size), mean.size, -1.0
    for lead in range(durations.size):
        duration = durations[lead]
        count = max(1, math.ceil(duration / longest - 1e-6)) if duration > 0.0 else 0
        step = duration / max(1, count)
        # leads are even but for rounding
        if abs(step - before) > 1e-12:
            f, held = transition(blocks, output, step)
            noise, before = noise_of(f, stationary, drift, step), step
            for k in range(HULL_STATES, n):
                of_states[k] = 0.5 * inner(output, noise[k, HULL_STATES:])
        over = f, held, noise, of_states, 0.5 * inner(output, of_states[HULL_STATES:])
        for _ in range(count):
            mean_moment = inner(held, mean[HULL_STATES:])
            mean[0], mean[1], slopes = hull_step(mean, mean_moment, covariance[1, 1], step, hull)
            move(over, slopes, mean, covariance)
            limit(covariance)
        for i in range(2):
            means[lead, i] = mean[i]
            for j in range(2):
                spreads[lead, i, j] = covariance[i, j]
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


def _measured(values: Pair) -> slice:
    """The places of those of angle and rate that are measured, not NaN."""
    angle, rate = values
    return slice(int(angle != angle), 1 + int(rate == rate))


class HullTrack(ExtendedKalmanFilter):
    """filterpy's filter, moved on by the functions above; each call passes the elapsed time.

    ``x`` (n,) and ``P`` (n, n) are mean and covariance, ``y`` and ``S`` innovation and its covariance of what the last
    sample measured, ``moment`` is `ModalMoment`'s blocks, output and stationary covariance, ``strain`` the running mean
    of squared innovations over their expectation; one is healthy.
    """

    def __init__(self) -> None:
        super().__init__(dim_x=HULL_STATES, dim_z=2)
        self.moment, self._rows, self._noise = NO_MOMENT, np.empty((2, 0)), np.zeros((2, 2))
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
        if self.x.size != len(self._rows.T):
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
        measured = _measured(values)
        self.H, of_hull = self._rows[measured], (self.x[OF_HULL], self.P[OF_HULL, OF_HULL])
        self._noise[0, 0] = max(variances[0], LEAST_NOISE_VARIANCE)
        self._noise[1, 1] = max(variances[1], LEAST_NOISE_VARIANCE)
        self.R = self._noise[measured, measured]
        super().update(np.array(values[measured]), lambda _: self.H, lambda x: x[measured])
        if not learns:
            self.x[OF_HULL], self.P[OF_HULL, OF_HULL] = of_hull
        self.strain += STRAIN_GAIN * (self.mahalanobis**2 / self.y.size - self.strain)

    @property
    def log_likelihood(self) -> float:
        """Of the last update, in closed form: filterpy's takes 50 us, and drops a known angle beside a free rate."""
        s, count = self.S.item, self.y.size
        determinant = s(0) if count == 1 else s(0) * s(3) - s(1) * s(2)
        return -0.5 * (self.mahalanobis**2 + math.log(determinant) + count * math.log(2.0 * math.pi))

    def nis(self, values: Pair, variances: Pair) -> float:
        """Squared innovation over its expectation of a sample, of which one may be NaN; the prediction stays."""
        (angle, rate), (of_angle, of_rate) = values, (max(each, LEAST_NOISE_VARIANCE) for each in variances)
        y, z = angle - self.x.item(0), rate - self.x.item(1)
        a, b, c = self.P.item(0, 0) + of_angle, self.P.item(0, 1), self.P.item(1, 1) + of_rate
        if angle != angle:
            return z * z / c
        return y * y / a if rate != rate else (c * y * y - 2.0 * b * y * z + a * z * z) / (a * c - b * b)

    def nis_after_jump(self, values: Pair, variances: Pair, elapsed: float, min_jump: float) -> float:
        """As `nis`, if the moment may have jumped in the ``elapsed`` s before.

        As at a release, by about the hull's: a variance of rank one (Sherman and Morrison 1950).
        """
        measured = _measured(values)
        noise = np.diag(np.maximum(variances, LEAST_NOISE_VARIANCE))
        spread = (self.P[:TRIM, :TRIM] + noise)[measured, measured]
        (active, friction_rate), ratios = self.hull, self.x[RATIOS:HULL_STATES]
        moment, turning = float(self.moment[1] @ self.x[HULL_STATES:]), float(self.x[RATE])
        own = damping_moment(turning, ratios, active, friction_rate)
        own += restoring_moment(float(self.x[ANGLE] - self.x[TRIM]), ratios, active)
        jump = min(2.0 * (min_jump + abs(moment) + abs(turning) + abs(own)), LARGEST_JUMP * min_jump)
        by_jump = np.array([0.5 * elapsed * elapsed * jump, elapsed * jump])[measured]
        share = np.linalg.solve(spread, by_jump)
        of_jump = float(share @ (np.array(values) - self.x[:TRIM])[measured])
        return self.nis(values, variances) - of_jump**2 / (1.0 + float(share @ by_jump))
