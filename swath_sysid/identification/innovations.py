"""Innovations of a free decay in a basin that is never quite still, by an extended Kalman filter.

The state is the angle from trim x, its rate w, the residual motion of the basin as an exciting moment over
inertia d of second order, the trim, the gyro's bias, and first-order noise of the angle and of the rate:

    dx = w dt,   dw = (d - damping(w) - restoring(x)) dt,   d'' + 2 zeta_d w_d d' + w_d^2 d = white noise,
    angle read = x + trim + n_a + white,   rate read = w + bias + n_r + white.

With innovations e_k of variances s_k the likelihood of the readings is exp(-1/2 sum(log s_k + e_k^2 / s_k)).
"""

import numpy as np

from swath_sysid.accelerator import accelerated
from swath_sysid.hull.compiled import damping_slope, motion_step, restoring_slope

STATES = 8
X, RATE, MOMENT, MOMENT_SLOPE, TRIM, BIAS, ANGLE_NOISE, RATE_NOISE = range(STATES)

(
    LEVEL, FREQUENCY, DAMPING, ANGLE_WHITE, RATE_WHITE, ANGLE_COLOUR, ANGLE_MEMORY, RATE_COLOUR, RATE_MEMORY, DRIFT
) = range(10)  # fmt: skip
"""Places of the basin's and the sensor's parameters: the disturbance's standard deviation, rad/s^2, frequency,
rad/s, and damping ratio; white noise of a reading, rad and rad/s; standard deviation and memory, s, of the coloured noise of
either; drift of the trim, rad in the square root of a second."""


@accelerated
def disturbance_transition(frequency, damping, step):
    """Exact transition (2, 2) of an underdamped second-order disturbance and its slope over a step."""
    fade = np.exp(-damping * frequency * step)
    turn = frequency * np.sqrt(1.0 - damping * damping)
    cosine, sine = np.cos(turn * step), np.sin(turn * step) / turn
    found = np.empty((2, 2))
    found[0, 0], found[0, 1] = fade * (cosine + damping * frequency * sine), fade * sine
    found[1, 0], found[1, 1] = -fade * frequency * frequency * sine, fade * (cosine - damping * frequency * sine)
    return found


@accelerated
def hull_transition(stiffness, damping, step, found):
    """Rows of x and w in the transition, by x, w, d and d': the matrix exponential to third order."""
    k, c, h = stiffness, damping, step
    h2, h3 = h * h / 2.0, h * h * h / 6.0
    found[0, 0], found[0, 1] = 1.0 - h2 * k + h3 * c * k, h - h2 * c + h3 * (c * c - k)
    found[1, 0] = -h * k + h2 * c * k + h3 * (k * k - c * c * k)
    found[1, 1] = 1.0 - h * c + h2 * (c * c - k) + h3 * (2.0 * c * k - c * c * c)
    found[0, 2], found[0, 3] = h2 - h3 * c, h3
    found[1, 2], found[1, 3] = h - h2 * c + h3 * (c * c - k), h2 - h3 * c


@accelerated
def innovations(
    ratios, active, friction_rate, basin, initial, bias_std, step, attenuation, angle, rate, counts, innovation, variance
):
    """Innovations and their variances, written into the last two arguments.

    Parameters
    ----------
    ratios : tuple of 9 floats
    active : tuple of 9 bools
    friction_rate : float
        rad/s.
    basin : ndarray, shape (10,)
        In the order of ``LEVEL`` to ``DRIFT``.
    initial : ndarray, shape (3,)
        Angle from trim, rad, rate, rad/s, and trim, rad, at the first reading.
    bias_std : float
        Of the gyro's bias before anything was read, rad/s.
    step : float
        s.
    attenuation : float
        What averaging over a block leaves of the hull's own oscillation.
    angle, rate : ndarray, shape (N,)
        Means over blocks of one step, rad and rad/s; not read where their count is zero.
    counts : ndarray of float, shape (N, 2)
        Samples in each mean of the angle and of the rate.
    innovation, variance : ndarray, shape (N, 2)
        Zero and one where nothing was read.
    """
    f = np.eye(STATES)
    d = disturbance_transition(basin[FREQUENCY], basin[DAMPING], step)
    f[2:4, 2:4] = d
    f[6, 6], f[7, 7] = np.exp(-step / basin[ANGLE_MEMORY]), np.exp(-step / basin[RATE_MEMORY])
    m, c = np.zeros(STATES), np.zeros((STATES, STATES))
    m[0], m[1], m[TRIM] = initial[0], initial[1], initial[2]
    c[BIAS, BIAS] = bias_std * bias_std
    c[2, 2], c[3, 3] = basin[LEVEL] ** 2, (basin[LEVEL] * basin[FREQUENCY]) ** 2
    c[6, 6], c[7, 7] = basin[ANGLE_COLOUR] ** 2, basin[RATE_COLOUR] ** 2
    q = np.zeros((STATES, STATES))
    q[2:4, 2:4] = c[2:4, 2:4] - d @ np.ascontiguousarray(c[2:4, 2:4]) @ d.T
    q[4, 4] = basin[DRIFT] ** 2 * step
    q[6, 6], q[7, 7] = c[6, 6] * (1.0 - f[6, 6] ** 2), c[7, 7] * (1.0 - f[7, 7] ** 2)
    for k in range(angle.size):
        if k > 0:
            x, w, moment = m[0], m[1], m[2] + 0.5 * step * m[3]
            _, m[0], m[1] = motion_step(x, w, moment, step, ratios, active, friction_rate)
            hull_transition(
                restoring_slope(0.5 * (x + m[0]), ratios, active),
                damping_slope(0.5 * (w + m[1]), ratios, active, friction_rate), step, f,
            )  # fmt: skip
            m[2], m[3] = d[0, 0] * m[2] + d[0, 1] * m[3], d[1, 0] * m[2] + d[1, 1] * m[3]
            m[6], m[7] = f[6, 6] * m[6], f[7, 7] * m[7]
            c = f @ c @ f.T + q
        for channel in range(2):
            innovation[k, channel], variance[k, channel] = 0.0, 1.0
            if counts[k, channel] == 0.0:
                continue
            reading = angle[k] if channel == 0 else rate[k]
            white = basin[ANGLE_WHITE + channel]
            gain = attenuation * c[:, channel] + c[:, TRIM + channel] + c[:, ANGLE_NOISE + channel]
            s = attenuation * gain[channel] + gain[TRIM + channel] + gain[ANGLE_NOISE + channel]
            s += white * white / counts[k, channel]
            e = reading - attenuation * m[channel] - m[TRIM + channel] - m[ANGLE_NOISE + channel]
            m += gain * (e / s)
            c -= np.outer(gain, gain) / s
            innovation[k, channel], variance[k, channel] = e, s
