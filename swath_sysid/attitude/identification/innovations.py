"""Innovations of a free decay in a basin that is never quite still, by an extended Kalman filter.

The state is the angle from trim x, its rate w, the residual motion of the basin as an exciting moment over inertia d
of fourth order (a resonator driven by another: its spectrum falls off as steeply as that of waves, which a hull of less
damping would have to imitate otherwise), the trim, the gyro's bias, and first-order noise of the angle and of the rate:

    dx = w dt,   dw = (d - damping(w) - restoring(x)) dt,   (D^2 + 2 zeta_d w_d D + w_d^2)^2 d = white noise,
    angle read = x + trim + n_a + white,   rate read = w + bias + n_r + white.

With innovations e_k of variances s_k the likelihood of the readings is exp(-1/2 sum(log s_k + e_k^2 / s_k)).
"""

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from swath_sysid.attitude.hull.compiled import (
    damping_moment,
    damping_slope,
    motion_step,
    restoring_moment,
    restoring_slope,
)
from swath_sysid.common.accelerator import accelerated

STATES = 10
X, RATE, TRIM, BIAS, ANGLE_NOISE, RATE_NOISE, MOMENT = range(7)
"""Places in the state; the last four are the disturbance, its slope, and the same of what drives it."""
SUBSTEPS = 3
"""Runge-Kutta steps in a block: quadratic damping bends where the rate changes its sign."""

(
    LEVEL, FREQUENCY, DAMPING, ANGLE_WHITE, RATE_WHITE, ANGLE_COLOUR, ANGLE_MEMORY, RATE_COLOUR, RATE_MEMORY, DRIFT
) = range(10)  # fmt: skip
"""Places of the basin's and the sensor's parameters: the disturbance's standard deviation, rad/s^2, frequency,
rad/s, and damping ratio; white noise of a reading, rad and rad/s; standard deviation and memory, s, of the coloured
noise of either; drift of the trim, rad in the square root of a second."""


def disturbance(frequency, damping, step):
    """Exact transition of the disturbance and its slopes over a step, and their covariance where d has unit variance.

    Parameters
    ----------
    frequency : float
        rad/s.
    damping : float
        Of critical.
    step : float
        s.

    Returns
    -------
    transition, covariance : ndarray, shape (4, 4)
    """
    one = np.array([[0.0, 1.0], [-(frequency**2), -2.0 * damping * frequency]])
    drift = np.zeros((4, 4))
    drift[:2, :2], drift[2:, 2:], drift[1, 2] = one, one, 1.0
    noise = np.zeros((4, 4))
    noise[3, 3] = 1.0
    covariance = solve_continuous_lyapunov(drift, -noise)
    return expm(drift * step), covariance / covariance[0, 0]


@accelerated
def hull_transition(stiffness, damping, step, found):
    """Rows of x and w in the transition, by x, w, d and d': the matrix exponential to third order."""
    k, c, h = stiffness, damping, step
    h2, h3 = h * h / 2.0, h * h * h / 6.0
    found[0, 0], found[0, 1] = 1.0 - h2 * k + h3 * c * k, h - h2 * c + h3 * (c * c - k)
    found[1, 0] = -h * k + h2 * c * k + h3 * (k * k - c * c * k)
    found[1, 1] = 1.0 - h * c + h2 * (c * c - k) + h3 * (2.0 * c * k - c * c * c)
    found[0, MOMENT], found[0, MOMENT + 1] = h2 - h3 * c, h3
    found[1, MOMENT], found[1, MOMENT + 1] = h - h2 * c + h3 * (c * c - k), h2 - h3 * c


@accelerated
def innovations(
    ratios, active, friction_rate, basin, transition, stationary, initial, bias_std, floor, step, bend, angle, rate,
    counts, innovation, variance,
):  # fmt: skip
    """Innovations and their variances, written into the last two arguments.

    Parameters
    ----------
    ratios : tuple of 9 floats
    active : tuple of 9 bools
    friction_rate : float
        rad/s.
    basin : ndarray, shape (10,)
        In the order of ``LEVEL`` to ``DRIFT``.
    transition, stationary : ndarray, shape (4, 4)
        Of `disturbance`.
    initial : ndarray, shape (3,)
        Angle from trim, rad, rate, rad/s, and trim, rad, at the first reading.
    bias_std : float
        Of the gyro's bias before anything was read, rad/s.
    floor : ndarray, shape (2,)
        Standard deviation of what no model explains of a block's mean, rad and rad/s.
    step : float
        s.
    bend : float
        Second moment of a block's samples about its middle over two, s^2: the mean of an angle over a block differs
        from the angle in its middle by so many times its second derivative.
    angle, rate : ndarray, shape (N,)
        Means over blocks of one step, rad and rad/s; not read where their count is zero.
    counts : ndarray of float, shape (N, 2)
        Samples in each mean of the angle and of the rate.
    innovation, variance : ndarray, shape (N, 2)
        Zero and one where nothing was read.
    """
    f = np.eye(STATES)
    f[MOMENT:, MOMENT:] = transition
    keep_angle, keep_rate = np.exp(-step / basin[ANGLE_MEMORY]), np.exp(-step / basin[RATE_MEMORY])
    f[ANGLE_NOISE, ANGLE_NOISE], f[RATE_NOISE, RATE_NOISE] = keep_angle, keep_rate
    m, c = np.zeros(STATES), np.zeros((STATES, STATES))
    m[X], m[RATE], m[TRIM] = initial[0], initial[1], initial[2]
    c[BIAS, BIAS] = bias_std * bias_std
    c[ANGLE_NOISE, ANGLE_NOISE], c[RATE_NOISE, RATE_NOISE] = basin[ANGLE_COLOUR] ** 2, basin[RATE_COLOUR] ** 2
    c[MOMENT:, MOMENT:] = basin[LEVEL] ** 2 * stationary
    q = c - f @ c @ f.T
    q[BIAS, BIAS], q[TRIM, TRIM] = 0.0, basin[DRIFT] ** 2 * step
    sub = step / SUBSTEPS
    for k in range(angle.size):
        if k > 0:
            x, w = m[X], m[RATE]
            for part in range(SUBSTEPS):
                moment = m[MOMENT] + (part + 0.5) * sub * m[MOMENT + 1]
                _, x, w = motion_step(x, w, moment, sub, ratios, active, friction_rate)
            hull_transition(
                restoring_slope(0.5 * (x + m[X]), ratios, active),
                damping_slope(0.5 * (w + m[RATE]), ratios, active, friction_rate), step, f,
            )  # fmt: skip
            m = f @ m
            m[X], m[RATE] = x, w
            c = f @ c @ f.T + q
        x, w = m[0], m[1]
        stiffness = restoring_slope(x, ratios, active)
        damping = damping_slope(w, ratios, active, friction_rate)
        force = m[MOMENT] - damping_moment(w, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
        for channel in range(2):
            innovation[k, channel], variance[k, channel] = 0.0, 1.0
            if counts[k, channel] == 0.0:
                continue
            reading = angle[k] if channel == 0 else rate[k]
            white = basin[ANGLE_WHITE + channel]
            if channel == 0:
                by_x, by_w, curved = 1.0 - bend * stiffness, -bend * damping, bend * force
            else:
                by_x = bend * damping * stiffness
                by_w, curved = 1.0 + bend * (damping * damping - stiffness), -bend * (stiffness * w + damping * force)
            gain = by_x * c[:, 0] + by_w * c[:, 1] + c[:, TRIM + channel] + c[:, ANGLE_NOISE + channel]
            s = by_x * gain[0] + by_w * gain[1] + gain[TRIM + channel] + gain[ANGLE_NOISE + channel]
            s += white * white / counts[k, channel] + floor[channel] * floor[channel]
            # the second channel's mean moves with the first's reading
            expected = (x if channel == 0 else w) + curved + by_x * (m[0] - x) + by_w * (m[1] - w)
            e = reading - expected - m[TRIM + channel] - m[ANGLE_NOISE + channel]
            m += gain * (e / s)
            c -= np.outer(gain, gain) / s
            innovation[k, channel], variance[k, channel] = e, s
