"""The arithmetic of the attitude filter, in closed form on plain numbers: what every sample of every axis costs.

The functions are compiled where numba is installed, and the same source runs without it. The tests
hold them to filterpy's extended Kalman filter. They take plain tuples, which cost a compiled function
least:

mean
    angle, rate, trim, disturbance.
covariance
    Its upper triangle by rows, ten numbers.
hull
    ratios (9), active (9 bools), friction rate (rad/s), and the longest step of the prediction (s).
drive
    Correlation time of the disturbance (s), drift of the trim (rad/sqrt(s)).
limits
    Time in which the trim moves by its standard deviation at most, adaptation time (s), least and most
    variance of the disturbance (rad^2/s^4), largest normalised innovation squared of one and of two values.
"""
import math

from swath_sysid.accelerator import accelerated
from swath_sysid.hull.compiled import damping_moment, damping_slope, motion_step, restoring_moment, restoring_slope

CAPSIZED = 1.5
"""rad from trim; no decay model is believed beyond."""

LARGEST_ANGLE_VARIANCE = math.pi**2
LARGEST_RATE_VARIANCE = 100.0
LARGEST_RATIO = 6.0
USUAL_RATIO = 1.2
LARGEST_GAIN = 0.2


@accelerated
def transition_elements(by_angle, by_rate, step, tau):
    """What differs from zero and one in the transition matrix of the linearised state over one step.

    The exponential of A = [[0, 1], [a, c]] and its integral, to third order in the step;
    the disturbance is held over the step and decays at its end.

    Returns
    -------
    tuple of 9 floats
        The first row, the second row, and the decay of the disturbance.
    """
    a, c = by_angle, by_rate
    h1, h2, h3 = step, step * step / 2.0, step * step * step / 6.0
    square = a + c * c
    gain_angle = h2 + c * h3
    gain_rate = h1 + c * h2 + square * h3
    return (
        1.0 + a * h2 + a * c * h3, gain_rate, -a * gain_angle, gain_angle,
        a * h1 + a * c * h2 + a * square * h3, 1.0 + c * h1 + square * h2 + c * (a + square) * h3, -a * gain_rate,
        gain_rate,
        math.exp(-step / tau),
    )  # fmt: skip


@accelerated
def noise_elements(disturbance_variance, tau, trim_drift, step):
    """What differs from zero in the process noise over one step: the Singer model's leading terms.

    Singer, IEEE Trans. AES-6 (1970), for a step short against tau: white noise of intensity
    2 variance / tau on the disturbance, integrated into rate and angle.

    Returns
    -------
    tuple of 7 floats
        (0, 0), (0, 1), (0, 3), (1, 1), (1, 3), (2, 2), (3, 3).
    """
    h = step
    first = 2.0 * disturbance_variance / tau * h
    second, third = first * h, first * h * h
    return (
        third * h * h / 20.0, third * h / 8.0, third / 6.0, third / 3.0, second / 2.0,
        trim_drift * trim_drift * h, first,
    )  # fmt: skip


@accelerated
def predict(mean, covariance, disturbance_variance, duration, drive, hull):
    """The state after a duration, in steps short against the hull's period.

    The mean follows the nonlinear equation, the covariance F P F' + Q.

    Parameters
    ----------
    mean : tuple of 4 floats
    covariance : tuple of 10 floats
    disturbance_variance : float
        rad^2/s^4.
    duration : float
        s.
    drive, hull : tuple
        See above.

    Returns
    -------
    mean : tuple of 4 floats
    covariance : tuple of 10 floats
    """
    angle, rate, trim, disturbance = mean
    p00, p01, p02, p03, p11, p12, p13, p22, p23, p33 = covariance
    ratios, active, friction_rate, longest_step = hull
    tau, trim_drift = drive
    count = max(1, math.ceil(duration / longest_step))
    step = duration / count
    q00, q01, q03, q11, q13, q22, q33 = noise_elements(disturbance_variance, tau, trim_drift, step)
    for _ in range(count):
        # linearised in the middle of the step
        x, half = angle - trim, 0.5 * step
        # numpy's functions turn a float into a numpy.float64, which is slow to go on with
        middle_rate = rate - half * float(
            damping_moment(rate, ratios, active, friction_rate) + restoring_moment(x, ratios, active)
        )
        by_angle = -float(restoring_slope(x + half * rate, ratios, active))
        by_rate = -float(damping_slope(middle_rate, ratios, active, friction_rate))
        fast = step * max(abs(by_rate), math.sqrt(abs(by_angle)))
        if abs(x) < CAPSIZED and fast < 1.0:
            _, x, rate = motion_step(x, rate, disturbance, step, ratios, active, friction_rate)
            angle, rate = float(x) + trim, float(rate)
        else:
            # far outside what the hull was identified on, the equation is no longer believed (nor stable)
            by_angle = by_rate = 0.0
            angle, rate = angle + step * (rate + half * disturbance), rate + step * disturbance
        f00, f01, f02, f03, f10, f11, f12, f13, decay = transition_elements(by_angle, by_rate, step, tau)
        disturbance *= decay
        g00 = f00 * p00 + f01 * p01 + f02 * p02 + f03 * p03
        g01 = f00 * p01 + f01 * p11 + f02 * p12 + f03 * p13
        g02 = f00 * p02 + f01 * p12 + f02 * p22 + f03 * p23
        g03 = f00 * p03 + f01 * p13 + f02 * p23 + f03 * p33
        g10 = f10 * p00 + f11 * p01 + f12 * p02 + f13 * p03
        g11 = f10 * p01 + f11 * p11 + f12 * p12 + f13 * p13
        g12 = f10 * p02 + f11 * p12 + f12 * p22 + f13 * p23
        g13 = f10 * p03 + f11 * p13 + f12 * p23 + f13 * p33
        p00 = g00 * f00 + g01 * f01 + g02 * f02 + g03 * f03 + q00
        p01 = g00 * f10 + g01 * f11 + g02 * f12 + g03 * f13 + q01
        p02 = g02
        p03 = g03 * decay + q03
        p11 = g10 * f10 + g11 * f11 + g12 * f12 + g13 * f13 + q11
        p12 = g12
        p13 = g13 * decay + q13
        p22 += q22
        p23 *= decay
        p33 = p33 * decay * decay + q33
    # an angle that nothing observes (rates alone, no hull) would grow without end
    if p00 > LARGEST_ANGLE_VARIANCE:
        s = math.sqrt(LARGEST_ANGLE_VARIANCE / p00)
        p00, p01, p02, p03 = p00 * s * s, p01 * s, p02 * s, p03 * s
    if p11 > LARGEST_RATE_VARIANCE:
        s = math.sqrt(LARGEST_RATE_VARIANCE / p11)
        p01, p11, p12, p13 = p01 * s, p11 * s * s, p12 * s, p13 * s
    return (angle, rate, trim, disturbance), (p00, p01, p02, p03, p11, p12, p13, p22, p23, p33)


@accelerated
def update(mean, covariance, angle, rate, angle_variance, rate_variance, elapsed, variance, nis_ratio, limits):
    """The state after what was measured (NaN: not measured), and the size of the disturbance.

    The values are taken in one after the other, which is the joint update, as their noises are
    independent, but inverts no matrix.

    Parameters
    ----------
    mean : tuple of 4 floats
    covariance : tuple of 10 floats
    angle, rate, angle_variance, rate_variance : float
        Measured, and the sensor's noise.
    elapsed : float
        Since the sample before, s.
    variance, nis_ratio : float
        Of the disturbance, rad^2/s^4; running mean of the normalised innovation squared over its expectation.
    limits : tuple
        See above.

    Returns
    -------
    mean : tuple of 4 floats
    covariance : tuple of 10 floats
        Both as they were, if the gate refuses the sample.
    told : tuple of 5 floats
        Normalised innovation squared, number of values measured, one if they were accepted, variance, nis_ratio.
    """
    trim_time, adaptation_time, least, most, one_gate, two_gate = limits
    x0, x1, x2, x3 = mean
    p00, p01, p02, p03, p11, p12, p13, p22, p23, p33 = covariance
    nis, measured = 0.0, 0
    if angle == angle:
        measured += 1
        s, e = p00 + angle_variance, angle - x0
        nis += e * e / s
        k0, k1, k2, k3 = p00 / s, p01 / s, p02 / s, p03 / s
        x0, x1, x2, x3 = x0 + k0 * e, x1 + k1 * e, x2 + k2 * e, x3 + k3 * e
        p11, p12, p13 = p11 - k1 * p01, p12 - k1 * p02, p13 - k1 * p03
        p22, p23, p33 = p22 - k2 * p02, p23 - k2 * p03, p33 - k3 * p03
        # (1 - k0) p, without the difference of what is nearly equal
        p00, p01, p02, p03 = k0 * angle_variance, k1 * angle_variance, k2 * angle_variance, k3 * angle_variance
    if rate == rate:
        measured += 1
        s, e = p11 + rate_variance, rate - x1
        nis += e * e / s
        k0, k1, k2, k3 = p01 / s, p11 / s, p12 / s, p13 / s
        x0, x1, x2, x3 = x0 + k0 * e, x1 + k1 * e, x2 + k2 * e, x3 + k3 * e
        p00, p02, p03 = p00 - k0 * p01, p02 - k0 * p12, p03 - k0 * p13
        p22, p23, p33 = p22 - k2 * p12, p23 - k2 * p13, p33 - k3 * p13
        p01, p11, p12, p13 = k0 * rate_variance, k1 * rate_variance, k2 * rate_variance, k3 * rate_variance
    if measured == 0:
        return mean, covariance, (math.nan, 0.0, 1.0, variance, nis_ratio)
    # a sensor noisier than it says must not be locked out: the gate is as wide as its innovations are
    gate = two_gate if measured == 2 else one_gate
    if nis > gate * max(1.0, nis_ratio):
        return mean, covariance, (nis, float(measured), 0.0, variance, nis_ratio)
    # ballast moves slowly: a hand on the craft, or a gust, must not be taken for it
    slowest = math.sqrt(max(covariance[7], 0.0)) * elapsed / trim_time
    x2 = min(max(x2, mean[2] - slowest), mean[2] + slowest)
    gain = min(LARGEST_GAIN, elapsed / adaptation_time)
    variance, nis_ratio = _adapted(nis / measured, x3, p33, gain, variance, nis_ratio)
    variance = min(max(variance, least), most)
    return (
        (x0, x1, x2, x3),
        (p00, p01, p02, p03, p11, p12, p13, p22, p23, p33),
        (nis, float(measured), 1.0, variance, nis_ratio),
    )


@accelerated
def _adapted(ratio, disturbance, uncertainty, gain, variance, nis_ratio):
    """Let the disturbance's size follow the innovations and its own estimate.

    Where the size is right, the NIS is its expectation and E[d^2 | data] is the variance
    (the fixed point of expectation-maximisation): both ratios then average one. The first
    answers fast when a sea gets up; the second lets the excitation fade out in still water,
    where the innovations hardly depend on it.
    """
    ratio = min(ratio, LARGEST_RATIO * max(1.0, nis_ratio))
    nis_ratio += gain * (ratio - nis_ratio)
    change = min(ratio, LARGEST_RATIO) - 1.0
    if nis_ratio < USUAL_RATIO:
        share = (disturbance * disturbance + uncertainty) / variance
        change += min(share, LARGEST_RATIO) - 1.0
    return variance * math.exp(gain * change), nis_ratio


@accelerated
def follow(
    mean, covariance, duration, angle, rate, angle_variance, rate_variance, elapsed, variance, nis_ratio, lead, drive,
    limits, hull,
):  # fmt: skip
    """One sample: `predict` over a duration (none if zero), `update`, and `predict` what comes a lead later.

    Returns
    -------
    mean, covariance
        Now.
    told : tuple of 5 floats
        See `update`.
    mean, covariance
        A lead later.
    """
    if duration > 0.0:
        mean, covariance = predict(mean, covariance, variance, duration, drive, hull)
    mean, covariance, told = update(
        mean, covariance, angle, rate, angle_variance, rate_variance, elapsed, variance, nis_ratio, limits
    )
    later, spread = predict(mean, covariance, told[3], lead, drive, hull)
    return mean, covariance, told, later, spread
