"""The arithmetic of `HullTrack`, compiled where numba is: what every sample of every axis costs.

The state is [angle, rate, trim, log stiffness scale, log damping scale, moment's states z]; mean (n,) and covariance
(n, n) are changed in place. The moment's blocks are sparse (`modal_moment`), the hull couples to them by one row: a
step takes some thousand multiplications where dense matrices take forty thousand. `FilterpyTrack.linearise` says the
same in matrices, for filterpy.
"""

import math

import numpy as np

from swath_sysid.attitude.hull.compiled import (
    damping_moment,
    damping_slope,
    motion_step,
    restoring_moment,
    restoring_slope,
)
from swath_sysid.common.accelerator import accelerated

HULL_STATES = 5  #: Angle, rate, trim and the two scales stand before the moment's states.
CAPSIZED = 1.5  #: rad from trim; no decay model is used beyond.
LARGEST_JUMP = 10.0  #: rad/s^2; by so much at most the moment changes between two samples.
MOST = 3.0  #: Of the logarithm of a scale, either way.

LARGEST_ANGLE_VARIANCE = math.pi**2
LARGEST_RATE_VARIANCE = 100.0  #: Where nothing observes the angle, its variance would grow without end.


@accelerated
def expected_ratios(ratios: tuple, stiffness: float, damping: float, rate: float, variance: float) -> tuple:
    """The ratios with both scales, and with the linear damping that makes the damping its mean over a normal rate.

    E[w^3] = m^3 + 3 m v, and E[|w| w] is near m sqrt(m^2 + 8 v / pi), right for small and for large m (Roberts and
    Spanos 1990, Random Vibration and Statistical Linearization): the less is known of the rate, the more the motion
    is damped.
    """
    more = ratios[2] * (math.sqrt(rate * rate + 8.0 / math.pi * variance) - abs(rate)) + 3.0 * ratios[3] * variance
    return (
        ratios[0] * damping,
        (ratios[1] + more) * damping,
        ratios[2] * damping,
        ratios[3] * damping,
        ratios[4] * stiffness,
        ratios[5] * stiffness,
        ratios[6] * stiffness,
        ratios[7] * stiffness,
        ratios[8] * stiffness,
    )


@accelerated
def hull_step(
    angle: float,
    rate: float,
    trim: float,
    stiffness: float,
    damping: float,
    moment: float,
    rate_variance: float,
    step: float,
    hull: tuple,
) -> tuple[float, float, tuple, tuple]:
    """One step of the hull under a held moment, and its linearisation in the middle of the step.

    Args:
        angle, rate, trim: rad, rad/s and rad, before the step.
        stiffness, damping: Logarithms of the scales.
        moment: Mean over the step, rad/s^2.
        rate_variance: Of what is known of the rate, rad^2/s^2; see `expected_ratios`.
        step: s, short against the natural period.
        hull: Ratios (9), active (9 bools), friction rate, rad/s.

    Returns:
        angle, rate: After the step.
        to_angle, to_rate: Derivatives of both by angle, rate, trim, log stiffness, log damping and moment: the
            exponential of [[0, 1], [a, c]] and its integral, to third order in the step.
    """
    ratios, active, friction_rate = hull
    stiffness, damping = math.exp(min(max(stiffness, -MOST), MOST)), math.exp(min(max(damping, -MOST), MOST))
    ratios = expected_ratios(ratios, stiffness, damping, rate, rate_variance)
    half = 0.5 * step
    x = angle - trim
    # numpy's functions turn a float into a numpy.float64, which is slow to go on with
    start = moment - float(damping_moment(rate, ratios, active, friction_rate) + restoring_moment(x, ratios, active))
    middle_x, middle_rate = x + half * rate, rate + half * start
    a = -float(restoring_slope(middle_x, ratios, active))
    c = -float(damping_slope(middle_rate, ratios, active, friction_rate))
    if abs(x) < CAPSIZED and step * max(abs(c), math.sqrt(abs(a))) < 1.0:
        restoring = float(restoring_moment(middle_x, ratios, active))
        resisting = float(damping_moment(middle_rate, ratios, active, friction_rate))
        _, x, new_rate = motion_step(x, rate, moment, step, ratios, active, friction_rate)
        angle, rate = float(x) + trim, float(new_rate)
    else:
        # far outside what the hull was identified on, the equation is not valid (nor stable)
        a = c = restoring = resisting = 0.0
        angle, rate = angle + step * (rate + half * moment), rate + step * moment
    h2, h3 = half * step, half * step * step / 3.0
    square = a + c * c
    gain_angle, gain_rate = h2 + c * h3, step + c * h2 + square * h3
    to_angle = (
        1.0 + a * h2 + a * c * h3,
        gain_rate,
        -a * gain_angle,
        -restoring * gain_angle,
        -resisting * gain_angle,
        gain_angle,
    )
    to_rate = (
        a * step + a * c * h2 + a * square * h3,
        1.0 + c * step + square * h2 + c * (a + square) * h3,
        -a * gain_rate,
        -restoring * gain_rate,
        -resisting * gain_rate,
        gain_rate,
    )
    return angle, rate, to_angle, to_rate


@accelerated
def block_transitions(blocks: np.ndarray, step: float) -> np.ndarray:
    """The 2 x 2 blocks of exp(A step), shape (B, 4): two diagonal elements, above, below."""
    made = np.empty((blocks.shape[0], 4))
    for k in range(blocks.shape[0]):
        decay, v = math.exp(blocks[k, 0] * step), blocks[k, 2]
        if v > 0.0:
            c, s = decay * math.cos(v * step), decay * math.sin(v * step)
            made[k, 0], made[k, 1], made[k, 2], made[k, 3] = c, c, s, -s
        else:
            made[k, 0], made[k, 1], made[k, 2], made[k, 3] = decay, math.exp(blocks[k, 1] * step), 0.0, 0.0
    return made


@accelerated
def predict(
    mean: np.ndarray,
    covariance: np.ndarray,
    moment: tuple,
    hull: tuple,
    drifts: tuple[float, float],
    duration: float,
    longest: float,
) -> None:
    """Move mean and covariance on by a duration, in place.

    Over a step the moment acts by the mean of its values at both ends, and so does its noise.

    Args:
        mean, covariance: (n,) and (n, n); of the state, n = 5 + 2 B.
        moment: Blocks (B, 3), output (2 B,), stationary covariance (2 B, 2 B).
        hull: See `hull_step`.
        drifts: Variance a second of the trim, rad^2/s, and of the logarithms of the scales, 1/s.
        duration: s.
        longest: Longest step, s.
    """
    blocks, output, stationary = moment
    count = max(1, math.ceil(duration / longest - 1e-6))
    step = duration / count
    f = block_transitions(blocks, step)
    m, first = output.size, HULL_STATES
    before, moved, after = np.empty(m), np.empty(m), np.empty(m)
    cross, coupling = np.empty((first, m)), np.empty(first)
    part = np.empty((first, first))
    trim_drift, scale_drift = drifts[0] * step, drifts[1] * step
    for _ in range(count):
        m0 = m1 = 0.0
        for j in range(m):
            m0 += output[j] * mean[first + j]
        for k in range(blocks.shape[0]):
            i = first + 2 * k
            z0, z1 = mean[i], mean[i + 1]
            mean[i], mean[i + 1] = f[k, 0] * z0 + f[k, 2] * z1, f[k, 3] * z0 + f[k, 1] * z1
            m1 += output[2 * k] * mean[i] + output[2 * k + 1] * mean[i + 1]
        angle, rate, to_angle, to_rate = hull_step(
            mean[0], mean[1], mean[2], mean[3], mean[4], 0.5 * (m0 + m1), covariance[1, 1], step, hull
        )
        mean[0], mean[1] = angle, rate
        # covariance of the moment before the step with the state before and, moved, with the state after
        for j in range(m):
            total = 0.0
            for i in range(m):
                total += output[i] * covariance[first + i, first + j]
            before[j] = total
        for k in range(blocks.shape[0]):
            j = 2 * k
            moved[j] = before[j] * f[k, 0] + before[j + 1] * f[k, 2]
            moved[j + 1] = before[j] * f[k, 3] + before[j + 1] * f[k, 1]
            for i in range(first):
                p0, p1 = covariance[i, first + j], covariance[i, first + j + 1]
                cross[i, j], cross[i, j + 1] = p0 * f[k, 0] + p1 * f[k, 2], p0 * f[k, 3] + p1 * f[k, 1]
        for i in range(first):
            total = 0.0
            for j in range(m):
                total += (covariance[i, first + j] + cross[i, j]) * output[j]
            coupling[i] = 0.5 * total
        _move_blocks(covariance, f, stationary)
        variance = 0.0
        for j in range(m):
            total = 0.0
            for i in range(m):
                total += output[i] * covariance[first + i, first + j]
            after[j] = total
            variance += (before[j] + 2.0 * moved[j] + total) * output[j]
        variance *= 0.25
        # the hull's own block: A P A' with the mean moment as a sixth state, of which nothing remains
        for i in range(first):
            angle_row = to_angle[5] * coupling[i]
            rate_row = to_rate[5] * coupling[i]
            for j in range(first):
                angle_row += to_angle[j] * covariance[j, i]
                rate_row += to_rate[j] * covariance[j, i]
            part[0, i], part[1, i] = angle_row, rate_row
        with_angle, with_rate = to_angle[5] * variance, to_rate[5] * variance
        for j in range(first):
            with_angle += to_angle[j] * coupling[j]
            with_rate += to_rate[j] * coupling[j]
        p00, p01, p11 = to_angle[5] * with_angle, to_rate[5] * with_angle, to_rate[5] * with_rate
        for j in range(first):
            p00 += part[0, j] * to_angle[j]
            p01 += part[0, j] * to_rate[j]
            p11 += part[1, j] * to_rate[j]
        covariance[0, 0], covariance[0, 1], covariance[1, 0], covariance[1, 1] = p00, p01, p01, p11
        for i in range(2, first):
            covariance[0, i] = covariance[i, 0] = part[0, i]
            covariance[1, i] = covariance[i, 1] = part[1, i]
        covariance[2, 2] += trim_drift
        covariance[3, 3] += scale_drift
        covariance[4, 4] += scale_drift
        for j in range(m):
            with_angle = to_angle[5] * 0.5 * (moved[j] + after[j])
            with_rate = to_rate[5] * 0.5 * (moved[j] + after[j])
            for i in range(first):
                with_angle += to_angle[i] * cross[i, j]
                with_rate += to_rate[i] * cross[i, j]
            covariance[0, first + j] = covariance[first + j, 0] = with_angle
            covariance[1, first + j] = covariance[first + j, 1] = with_rate
            for i in range(2, first):
                covariance[i, first + j] = covariance[first + j, i] = cross[i, j]
    limit(covariance)


@accelerated
def _move_blocks(covariance: np.ndarray, f: np.ndarray, stationary: np.ndarray):
    """The moment's block of the covariance: F (P - Pi) F' + Pi, block by block, from the lower triangle."""
    first = HULL_STATES
    for k in range(f.shape[0]):
        i = 2 * k
        for q in range(k + 1):
            j = 2 * q
            a = covariance[first + i, first + j] - stationary[i, j]
            b = covariance[first + i, first + j + 1] - stationary[i, j + 1]
            c = covariance[first + i + 1, first + j] - stationary[i + 1, j]
            d = covariance[first + i + 1, first + j + 1] - stationary[i + 1, j + 1]
            e, g = f[k, 0] * a + f[k, 2] * c, f[k, 0] * b + f[k, 2] * d
            o, p = f[k, 3] * a + f[k, 1] * c, f[k, 3] * b + f[k, 1] * d
            a, b = e * f[q, 0] + g * f[q, 2] + stationary[i, j], e * f[q, 3] + g * f[q, 1] + stationary[i, j + 1]
            c = o * f[q, 0] + p * f[q, 2] + stationary[i + 1, j]
            d = o * f[q, 3] + p * f[q, 1] + stationary[i + 1, j + 1]
            covariance[first + i, first + j] = covariance[first + j, first + i] = a
            covariance[first + i, first + j + 1] = covariance[first + j + 1, first + i] = b
            covariance[first + i + 1, first + j] = covariance[first + j, first + i + 1] = c
            covariance[first + i + 1, first + j + 1] = covariance[first + j + 1, first + i + 1] = d


@accelerated
def limit(covariance: np.ndarray) -> None:
    """Bound the variances of angle and rate, in place, without a change of their correlations."""
    for place, most in ((0, LARGEST_ANGLE_VARIANCE), (1, LARGEST_RATE_VARIANCE)):
        if covariance[place, place] > most:
            shrink = math.sqrt(most / covariance[place, place])
            for i in range(covariance.shape[0]):
                covariance[place, i] *= shrink
                covariance[i, place] *= shrink


@accelerated
def update(mean: np.ndarray, covariance: np.ndarray, place: int, value: float, variance: float, learns: bool) -> None:
    """Take in one measured state, in place: place 0 the angle, 1 the rate. Independent noises: one after the other.

    Where trim and scales are not learnt they are considered (Schmidt 1966): they and what is known of them stay,
    and their uncertainty goes on to count.
    """
    n = mean.size
    share = covariance[place, place] + variance
    error = value - mean[place]
    gain = np.empty(n)
    for i in range(n):
        gain[i] = covariance[i, place] / share
    for i in range(n):
        is_considered = not learns and 2 <= i < HULL_STATES
        if not is_considered:
            mean[i] += gain[i] * error
        if i != place:
            for j in range(2 if is_considered else i + 1):
                if j != place:
                    covariance[i, j] -= gain[i] * covariance[place, j]
                    covariance[j, i] = covariance[i, j]
    # (1 - gain) P, without the difference of what is nearly equal
    for i in range(n):
        covariance[place, i] = covariance[i, place] = gain[i] * variance


@accelerated
def observe(
    mean: np.ndarray,
    covariance: np.ndarray,
    angle: float,
    rate: float,
    angle_variance: float,
    rate_variance: float,
    learns: bool,
) -> None:
    """Take in what was measured of angle and rate (NaN: not measured), in place; see `update`."""
    if angle == angle:
        update(mean, covariance, 0, angle, angle_variance, learns)
    if rate == rate:
        update(mean, covariance, 1, rate, rate_variance, learns)


@accelerated
def predict_to(
    mean: np.ndarray,
    covariance: np.ndarray,
    moment: tuple,
    hull: tuple,
    drifts: tuple[float, float],
    durations: np.ndarray,
    longest: float,
    means: np.ndarray,
    spreads: np.ndarray,
) -> None:
    """Predict on over successive durations, in place, and keep angle and rate with their covariance after each."""
    for k in range(durations.size):
        if durations[k] > 0.0:
            predict(mean, covariance, moment, hull, drifts, durations[k], longest)
        for i in range(2):
            means[k, i] = mean[i]
            for j in range(2):
                spreads[k, i, j] = covariance[i, j]


@accelerated
def innovation(
    mean: np.ndarray,
    covariance: np.ndarray,
    output: np.ndarray,
    hull: tuple,
    elapsed: float,
    angle: float,
    rate: float,
    angle_variance: float,
    rate_variance: float,
    min_jump: float,
) -> tuple[int, float, float, float]:
    """How far what was measured (NaN: not measured) lies from what was expected.

    Returns:
        measured: How many values.
        nis: Normalised innovation squared.
        log_likelihood
        gate_nis: The same if the moment has jumped since the sample before: a hand that lets go, or takes hold, changes
            it by about what the hull's own moment is now.
    """
    a, b, d = covariance[0, 0] + angle_variance, covariance[0, 1], covariance[1, 1] + rate_variance
    e0, e1 = angle - mean[0], rate - mean[1]
    if e0 != e0 and e1 != e1:
        return 0, math.nan, 0.0, math.nan
    ratios, active, friction_rate = hull
    moment = 0.0
    for j in range(output.size):
        moment += output[j] * mean[HULL_STATES + j]
    own = damping_moment(mean[1], ratios, active, friction_rate) + restoring_moment(mean[0] - mean[2], ratios, active)
    jump = min(2.0 * (min_jump + abs(moment) + abs(mean[1]) + abs(own)), LARGEST_JUMP)
    by_angle, by_rate = 0.5 * elapsed * elapsed * jump, elapsed * jump
    if e1 != e1:
        nis = e0 * e0 / a
        return 1, nis, -0.5 * (nis + math.log(2.0 * math.pi * a)), e0 * e0 / (a + by_angle * by_angle)
    if e0 != e0:
        nis = e1 * e1 / d
        return 1, nis, -0.5 * (nis + math.log(2.0 * math.pi * d)), e1 * e1 / (d + by_rate * by_rate)
    # rounding must not take away what the sensor's noise alone makes
    determinant = max(a * d - b * b, angle_variance * rate_variance)
    nis = (d * e0 * e0 - 2.0 * b * e0 * e1 + a * e1 * e1) / determinant
    log_likelihood = -0.5 * (nis + math.log(determinant)) - math.log(2.0 * math.pi)
    a, b, d = a + by_angle * by_angle, b + by_angle * by_rate, d + by_rate * by_rate
    wider = max(a * d - b * b, angle_variance * rate_variance)
    return 2, nis, log_likelihood, (d * e0 * e0 - 2.0 * b * e0 * e1 + a * e1 * e1) / wider


@accelerated
def support(mean: np.ndarray, covariance: np.ndarray, begin: int, inverse: np.ndarray) -> tuple[float, float]:
    """Of the states from ``begin`` on: the trace of V^-1 P and the square z' V^-1 z, with V^-1 given."""
    trace = square = 0.0
    for i in range(inverse.shape[0]):
        for j in range(inverse.shape[0]):
            trace += inverse[i, j] * covariance[begin + j, begin + i]
            square += inverse[i, j] * mean[begin + i] * mean[begin + j]
    return trace, square
