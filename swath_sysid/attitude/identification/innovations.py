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
from swath_sysid.common.accelerator import HAS_NUMBA, accelerated

STATES = 10
X, RATE, TRIM, BIAS, ANGLE_NOISE, RATE_NOISE, MOMENT = range(7)
"""Places in the state; the last four are the disturbance, its slope, and the same of what drives it."""
SUBSTEPS = 2
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
def hull_transition(stiffness, damping, step):
    """Rows of x and w in the transition, by x, w, d and d': the matrix exponential to third order."""
    k, c, h = stiffness, damping, step
    h2, h3 = h * h / 2.0, h * h * h / 6.0
    by_moment = h - h2 * c + h3 * (c * c - k)
    of_angle = 1.0 - h2 * k + h3 * c * k, by_moment, h2 - h3 * c, h3 + 0.0 * k
    by_angle = -h * k + h2 * c * k + h3 * (k * k - c * c * k)
    by_rate = 1.0 - h * c + h2 * (c * c - k) + h3 * (2.0 * c * k - c * c * c)
    return of_angle, (by_angle, by_rate, by_moment, h2 - h3 * c)


@accelerated
def moment_row(transition, index, given):
    """One row of the disturbance after a step; what drives it knows nothing of it."""
    row = transition[index, 2] * given[MOMENT + 2] + transition[index, 3] * given[MOMENT + 3]
    if index < 2:
        row = row + transition[index, 0] * given[MOMENT] + transition[index, 1] * given[MOMENT + 1]
    return row


@accelerated
def times_transition(hull, keep, transition, given, found):
    """The transition times a matrix, written transposed; twice in a row for a covariance."""
    for i in range(2):
        by_x, by_w, by_d, by_slope = hull[i]
        found[:, i] = by_x * given[X] + by_w * given[RATE] + by_d * given[MOMENT] + by_slope * given[MOMENT + 1]
        found[:, TRIM + i] = given[TRIM + i]
        found[:, ANGLE_NOISE + i] = keep[i] * given[ANGLE_NOISE + i]
    for i in range(4):
        found[:, MOMENT + i] = moment_row(transition, i, given)


@accelerated
def propagate_by_rows(hull, keep, transition, c, half):
    """The covariance (10, 10) after a step without its noise, in place; ``half`` is room to work in."""
    times_transition(hull, keep, transition, c, half)
    times_transition(hull, keep, transition, half, c)


def propagate_at_once(hull, keep, transition, c, half):
    """As `propagate_by_rows`, for covariances (10, 10, B): products of matrices cost numpy less than rows do."""
    f = np.zeros((c.shape[2], STATES, STATES))
    for i in range(2):
        f[:, i, X], f[:, i, RATE], f[:, i, MOMENT], f[:, i, MOMENT + 1] = hull[i]
        f[:, TRIM + i, TRIM + i] = 1.0
        f[:, ANGLE_NOISE + i, ANGLE_NOISE + i] = keep[i]
    f[:, MOMENT:, MOMENT:] = np.moveaxis(transition, 2, 0)
    c[...] = np.moveaxis(f @ np.moveaxis(c, 2, 0) @ f.transpose(0, 2, 1), 0, 2)


propagate = propagate_by_rows if HAS_NUMBA else propagate_at_once


@accelerated
def run_filter(
    ratios, active, friction_rate, m, c, q, keep, transition, white, floor, step, bend, angle, rate, counts,
    innovation, variance,
):  # fmt: skip
    """Innovations and their variances, written into the last two arguments; of one filter or, the last axis, of B.

    Parameters
    ----------
    ratios : tuple of 9 floats or ndarrays (B,)
        Ratios to inertia, in the order of ``TERM_NAMES``.
    active : tuple of 9 bools
        The terms in use.
    friction_rate : float
        rad/s.
    m, c : ndarray, shape (10,) and (10, 10), or (10, B) and (10, 10, B)
        Mean and covariance of the state at the first reading; overwritten.
    q : ndarray, shape as ``c``
        Covariance that a step adds.
    keep : ndarray, shape (2,) or (2, B)
        What a step leaves of the coloured noise of angle and rate.
    transition : ndarray, shape (4, 4) or (4, 4, B)
        Of `disturbance`.
    white : ndarray, shape (2,) or (2, B)
        Standard deviation of the white noise of a reading, rad and rad/s.
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
    innovation, variance : ndarray, shape (N, 2) or (N, 2, B)
        Zero and one where nothing was read.
    """
    half = np.empty_like(c)
    sub = step / SUBSTEPS
    for k in range(angle.size):
        if k > 0:
            x, w = m[X], m[RATE]
            for part in range(SUBSTEPS):
                moment = m[MOMENT] + (part + 0.5) * sub * m[MOMENT + 1]
                _, x, w = motion_step(x, w, moment, sub, ratios, active, friction_rate)
            hull = hull_transition(
                restoring_slope(0.5 * (x + m[X]), ratios, active),
                damping_slope(0.5 * (w + m[RATE]), ratios, active, friction_rate), step,
            )  # fmt: skip
            propagate(hull, keep, transition, c, half)
            c += q
            ahead = m.copy()
            ahead[X], ahead[RATE] = x, w
            for i in range(2):
                ahead[ANGLE_NOISE + i] = keep[i] * m[ANGLE_NOISE + i]
            for i in range(4):
                ahead[MOMENT + i] = moment_row(transition, i, m)
            m = ahead
        x, w = m[X], m[RATE]
        stiffness = restoring_slope(x, ratios, active)
        damping = damping_slope(w, ratios, active, friction_rate)
        force = m[MOMENT] - damping_moment(w, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
        for channel in range(2):
            innovation[k, channel], variance[k, channel] = 0.0, 1.0
            if counts[k, channel] == 0.0:
                continue
            if channel == 0:
                reading, middle = angle[k], x + bend * force
                by_x, by_w = 1.0 - bend * stiffness, -bend * damping
            else:
                reading, middle = rate[k], w - bend * (stiffness * w + damping * force)
                by_x, by_w = bend * damping * stiffness, 1.0 + bend * (damping * damping - stiffness)
            gain = by_x * c[X] + by_w * c[RATE] + c[TRIM + channel] + c[ANGLE_NOISE + channel]
            s = by_x * gain[X] + by_w * gain[RATE] + gain[TRIM + channel] + gain[ANGLE_NOISE + channel]
            s = s + white[channel] * white[channel] / counts[k, channel] + floor[channel] * floor[channel]
            # the second channel's mean moves with the first's reading
            expected = middle + by_x * (m[X] - x) + by_w * (m[RATE] - w)
            e = reading - expected - m[TRIM + channel] - m[ANGLE_NOISE + channel]
            # a new array: x and w are what they were before the readings
            m = m + gain * (e / s)
            c -= gain[:, None] * (gain / s)
            innovation[k, channel], variance[k, channel] = e, s


def innovations(
    ratios, active, friction_rate, basin, initial, bias_std, floor, step, bend, angle, rate, counts, *,
    compiled=HAS_NUMBA,
):  # fmt: skip
    """Innovations and their variances under B sets of parameters.

    One after the other where the filter is compiled, all at once where it is not: numpy takes as long for 20 as for 2.

    Parameters
    ----------
    ratios : ndarray, shape (9, B)
        Ratios to inertia, a column a set.
    active, friction_rate, floor, step, bend, angle, rate, counts
        See `run_filter`.
    basin : ndarray, shape (10, B)
        In the order of ``LEVEL`` to ``DRIFT``.
    initial : ndarray, shape (3, B)
        Angle from trim, rad, rate, rad/s, and trim, rad, at the first reading.
    bias_std : float
        Of the gyro's bias before anything was read, rad/s.
    compiled : bool
        Whether one after the other.

    Returns
    -------
    ndarray, shape (2, N, 2, B)
    """
    count = ratios.shape[1]
    # most of the sets have the same disturbance
    shapes, which = np.unique(basin[[FREQUENCY, DAMPING]], axis=1, return_inverse=True)
    spectra = [disturbance(frequency, damping, step) for frequency, damping in shapes.T]
    transition, stationary = (np.stack(each, axis=-1)[..., which.ravel()] for each in zip(*spectra, strict=True))
    before = stationary * basin[LEVEL] ** 2
    keep = np.exp(-step / basin[[ANGLE_MEMORY, RATE_MEMORY]])
    colour = basin[[ANGLE_COLOUR, RATE_COLOUR]] ** 2
    m, c, q = np.zeros((STATES, count)), np.zeros((STATES, STATES, count)), np.zeros((STATES, STATES, count))
    m[[X, RATE, TRIM]] = initial
    c[BIAS, BIAS] = bias_std**2
    noises = [ANGLE_NOISE, RATE_NOISE]
    c[noises, noises], q[noises, noises] = colour, colour * (1.0 - keep**2)
    c[MOMENT:, MOMENT:] = before
    q[MOMENT:, MOMENT:] = before - np.einsum('ikb,klb,jlb->ijb', transition, before, transition)
    q[TRIM, TRIM] = basin[DRIFT] ** 2 * step
    white = basin[[ANGLE_WHITE, RATE_WHITE]]
    found = np.empty((2, angle.size, 2, count))
    record = floor, step, bend, angle, rate, counts
    if not compiled:
        c, q = (np.moveaxis(np.moveaxis(each, 2, 0).copy(), 0, 2) for each in (c, q))  # one matrix after the other
        matrices = m, c, q, keep, transition, white
        with np.errstate(all='ignore'):
            run_filter(tuple(ratios), active, friction_rate, *matrices, *record, found[0], found[1])
        return found
    for b in range(count):
        filters = [np.ascontiguousarray(each[..., b]) for each in (m, c, q, keep, transition, white)]
        into = np.empty(found.shape[:-1])
        given = [*filters, *record, *into]
        run_filter(tuple(ratios[:, b].tolist()), active, friction_rate, *given)
        found[..., b] = into
    return found
