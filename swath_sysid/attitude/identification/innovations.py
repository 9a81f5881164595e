"""Innovations of a free decay in a basin that is never quite still, by an extended Kalman filter.

The state is the angle from trim x, its rate w, the residual motion of the basin as an exciting moment over inertia d
of sixth order (three resonators, side by side in frequency, each driven by the next: its spectrum may be flat and falls
off as steeply as that of waves, which a hull of less damping would have to imitate otherwise), the trim, the gyro's
bias, and first-order noise of the angle and of the rate:

    dx = w dt,   dw = (d - damping(w) - restoring(x)) dt,
    product of (D^2 + 2 zeta_d w_i D + w_i^2) d = white noise,   w_i = w_d e^-s, w_d, w_d e^s,
    angle read = x + trim + n_a + white,   rate read = w + bias + n_r + white.

With innovations e_k of variances s_k the likelihood of the readings is exp(-1/2 sum(log s_k + e_k^2 / s_k)).
"""

import numpy as np

from swath_sysid.attitude.hull.compiled import (
    damping_moment,
    damping_slope,
    motion_step,
    restoring_moment,
    restoring_slope,
)
from swath_sysid.attitude.motion.attitude import Value
from swath_sysid.common.accelerator import accelerated, has_numba

Pair = tuple[Value, Value]
STATES = 12
#: Places in the state; the last six are the disturbance, its slope, and the same of what drives it and that.
X, RATE, TRIM, BIAS, ANGLE_NOISE, RATE_NOISE, MOMENT = range(7)
#: Of the disturbance's exponential: exact to rounding at a radian per step, stable at a hundred.
HALVINGS, TAYLOR_ORDER = 10, 6
SUBSTEPS = 2  #: Runge-Kutta steps in a block: quadratic damping bends where the rate changes its sign.

#: Places of the basin's and the sensor's parameters: the disturbance's standard deviation, rad/s^2, frequency, rad/s,
#: damping ratio and spread; white noise of a reading, rad and rad/s; standard deviation and memory, s, of the coloured
#: noise of either; drift of the trim, rad in the square root of a second.
(
    LEVEL,
    FREQUENCY,
    DAMPING,
    SPREAD,
    ANGLE_WHITE,
    RATE_WHITE,
    ANGLE_COLOUR,
    ANGLE_MEMORY,
    RATE_COLOUR,
    RATE_MEMORY,
    DRIFT,
) = range(11)


def disturbance(
    frequency: np.ndarray, damping: np.ndarray, spread: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Exact transition over a step, s, and covariance for unit variance of d, each (B, 6, 6).

    Of d, its slope and the same of its drives. Frequency in rad/s, damping over critical, spread of the resonators' log
    frequencies, each (B,). The matrix exponential is its Taylor series, halved and squared; the covariance solves
    Lyapunov's equation.
    """
    drift = np.zeros((frequency.size, 6, 6))
    for first, power in zip((0, 2, 4), (-1.0, 0.0, 1.0), strict=True):
        own = np.exp(power * spread)
        drift[:, first, first + 1] = 1.0
        drift[:, first + 1, first], drift[:, first + 1, first + 1] = -(own**2), -2.0 * damping * own
    drift[:, 1, 2] = drift[:, 3, 4] = 1.0
    scaled = drift * (frequency * step)[:, None, None] / 2.0**HALVINGS
    transition = np.eye(6)
    for order in range(TAYLOR_ORDER, 0, -1):
        transition = np.eye(6) + scaled @ transition / order
    for _ in range(HALVINGS):
        transition = transition @ transition
    lyapunov = np.einsum('bik,jl->bijkl', drift, np.eye(6)) + np.einsum('bjl,ik->bijkl', drift, np.eye(6))
    driven = np.zeros((frequency.size, 36, 1))
    driven[:, -1] = -1.0
    covariance = np.linalg.solve(lyapunov.reshape(-1, 36, 36), driven).reshape(-1, 6, 6)
    units = np.stack([np.ones_like(frequency), frequency] * 3, axis=-1)
    transition = transition * units[:, :, None] / units[:, None, :]
    return transition, covariance / covariance[:, :1, :1] * units[:, :, None] * units[:, None, :]


@accelerated
def move_hull(transition: np.ndarray, stiffness: Value, damping: Value, step: float) -> None:
    """The part of the transition that depends on the motion, in place: the matrix exponential to third order."""
    k, c, h2, h3 = stiffness, damping, step * step / 2.0, step * step * step / 6.0
    by_moment, by_slope = step - h2 * c + h3 * (c * c - k), h2 - h3 * c
    kept = 1.0 - k * by_slope
    transition[X, X], transition[X, RATE], transition[X, MOMENT] = kept, by_moment, by_slope
    transition[RATE, X], transition[RATE, RATE] = -k * by_moment, kept - c * by_moment
    transition[RATE, MOMENT], transition[RATE, MOMENT + 1] = by_moment, by_slope


@accelerated
def times_transition(transition: np.ndarray, given: np.ndarray, found: np.ndarray) -> None:
    """The transition (12, 12) times a matrix, written transposed; twice in a row for a covariance."""
    f = transition
    for j in range(STATES):
        x, w, d, slope = given[X, j], given[RATE, j], given[MOMENT, j], given[MOMENT + 1, j]
        found[j, X] = f[X, X] * x + f[X, RATE] * w + f[X, MOMENT] * d + f[X, MOMENT + 1] * slope
        found[j, RATE] = f[RATE, X] * x + f[RATE, RATE] * w + f[RATE, MOMENT] * d + f[RATE, MOMENT + 1] * slope
        found[j, TRIM], found[j, BIAS] = given[TRIM, j], given[BIAS, j]
        found[j, ANGLE_NOISE] = f[ANGLE_NOISE, ANGLE_NOISE] * given[ANGLE_NOISE, j]
        found[j, RATE_NOISE] = f[RATE_NOISE, RATE_NOISE] * given[RATE_NOISE, j]
        # the coupling is one way: each resonator is driven by the next
        for i in range(MOMENT, STATES):
            total = 0.0
            for k in range(i - i % 2, STATES):
                total += f[i, k] * given[k, j]
            found[j, i] = total


def propagate_one(transition: np.ndarray, m: np.ndarray, c: np.ndarray, q: np.ndarray) -> None:
    """Mean (12,), but for x and w, and covariance (12, 12) after a step that adds ``q``, in place."""
    half = np.empty_like(c)
    times_transition(transition, c, half)
    times_transition(transition, half, c)
    for i in range(TRIM, MOMENT):
        m[i] *= transition[i, i]
        c[i, i] += q[i, i]
    for i in range(MOMENT, STATES, 2):
        value = slope = 0.0
        for j in range(i, STATES):
            value += transition[i, j] * m[j]
            slope += transition[i + 1, j] * m[j]
        m[i], m[i + 1] = value, slope
    for i in range(MOMENT, STATES):
        for j in range(MOMENT, STATES):
            c[i, j] += q[i, j]


def propagate_all(transition: np.ndarray, m: np.ndarray, c: np.ndarray, q: np.ndarray) -> None:
    """As `propagate_one`, (12, B) and (12, 12, B): products of matrices cost numpy less than rows do."""
    f, p = transition.transpose(2, 0, 1), c.transpose(2, 0, 1)
    np.matmul(f @ p, f.transpose(0, 2, 1), out=p)
    c += q
    m[TRIM:] = (f[:, TRIM:, TRIM:] @ m.T[:, TRIM:, None])[..., 0].T


def read_one(
    m: np.ndarray,
    c: np.ndarray,
    by_x: Pair,
    by_w: Pair,
    e: Pair,
    noise: np.ndarray,
    innovation: np.ndarray,
    variance: np.ndarray,
) -> None:
    """Update mean (12,) and covariance (12, 12) with readings of the angle, then the rate, in place.

    ``by_x`` and ``by_w`` are the readings' slopes by x and w; ``e`` is readings less prediction; noise variances (2,)
    are infinite where nothing was read. Innovations and variances (2,) are overwritten; the rate's are given the angle.
    """
    with_angle, with_rate = np.empty(STATES), np.empty(STATES)
    for i in range(STATES):
        with_angle[i] = by_x[0] * c[X, i] + by_w[0] * c[RATE, i] + c[TRIM, i] + c[ANGLE_NOISE, i]
        with_rate[i] = by_x[1] * c[X, i] + by_w[1] * c[RATE, i] + c[BIAS, i] + c[RATE_NOISE, i]
    own = by_x[0] * with_angle[X] + by_w[0] * with_angle[RATE] + with_angle[TRIM] + with_angle[ANGLE_NOISE]
    across = by_x[1] * with_angle[X] + by_w[1] * with_angle[RATE] + with_angle[BIAS] + with_angle[RATE_NOISE]
    of_rate = by_x[1] * with_rate[X] + by_w[1] * with_rate[RATE] + with_rate[BIAS] + with_rate[RATE_NOISE]
    variance[0] = own + noise[0]
    share = across / variance[0]
    variance[1] = of_rate + noise[1] - share * across
    innovation[0], innovation[1] = e[0], e[1] - share * e[0]
    for i in range(STATES):
        with_rate[i] -= share * with_angle[i]
    for i in range(STATES):
        of_angle, of_rate = with_angle[i] / variance[0], with_rate[i] / variance[1]
        m[i] += of_angle * innovation[0] + of_rate * innovation[1]
        for j in range(STATES):
            c[i, j] -= of_angle * with_angle[j] + of_rate * with_rate[j]


def read_all(
    m: np.ndarray,
    c: np.ndarray,
    by_x: Pair,
    by_w: Pair,
    e: Pair,
    noise: np.ndarray,
    innovation: np.ndarray,
    variance: np.ndarray,
) -> None:
    """As `read_one`, for B filters, the last axis."""
    p = c.transpose(2, 0, 1)
    h = np.zeros((m.shape[1], 2, STATES))
    h[:, 0, TRIM] = h[:, 0, ANGLE_NOISE] = h[:, 1, BIAS] = h[:, 1, RATE_NOISE] = 1.0
    for i in range(2):
        h[:, i, X], h[:, i, RATE] = by_x[i], by_w[i]
    gain = h @ p
    s = gain @ h.transpose(0, 2, 1)
    variance[0] = s[:, 0, 0] + noise[0]
    share = s[:, 0, 1] / variance[0]
    variance[1] = s[:, 1, 1] + noise[1] - share * s[:, 0, 1]
    innovation[0], innovation[1] = e[0], e[1] - share * e[0]
    gain[:, 1] -= share[:, None] * gain[:, 0]
    shares = gain / variance.T[:, :, None]
    p -= gain.transpose(0, 2, 1).copy() @ shares
    m += shares[:, 0].T * innovation[0] + shares[:, 1].T * innovation[1]


# loops are faster compiled, matrix products faster in numpy
propagate, read = accelerated(propagate_one, propagate_all), accelerated(read_one, read_all)


@accelerated
def run_filter(
    ratios: tuple,
    active: tuple[bool, ...],
    friction_rate: float,
    m: np.ndarray,
    c: np.ndarray,
    q: np.ndarray,
    transition: np.ndarray,
    noise: np.ndarray,
    step: float,
    bend: float,
    angle: np.ndarray,
    rate: np.ndarray,
    innovation: np.ndarray,
    variance: np.ndarray,
) -> None:
    """Innovations and their variances, written into the last two arguments; of one filter or, the last axis, of B.

    Mean ``m`` (12,), covariance ``c`` (12, 12) at the first reading and ``transition`` (12, 12) are overwritten; ``q``
    is a step's covariance; ``noise`` (N, 2) is infinite where nothing was read. Readings (N,) are means over blocks of
    one ``step``, s; ``bend``, s^2, is half a block's second moment: mean = mid value + bend x second derivative.
    """
    sub = step / SUBSTEPS
    for k in range(angle.size):
        if k > 0:
            x, w = m[X], m[RATE]
            for part in range(SUBSTEPS):
                moment = m[MOMENT] + (part + 0.5) * sub * m[MOMENT + 1]
                _, x, w = motion_step(x, w, moment, sub, ratios, active, friction_rate)
            stiffness = restoring_slope(0.5 * (x + m[X]), ratios, active)
            damping = damping_slope(0.5 * (w + m[RATE]), ratios, active, friction_rate)
            move_hull(transition, stiffness, damping, step)
            propagate(transition, m, c, q)
            m[X], m[RATE] = x, w
        x, w = m[X], m[RATE]
        stiffness = restoring_slope(x, ratios, active)
        damping = damping_slope(w, ratios, active, friction_rate)
        force = m[MOMENT] - damping_moment(w, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
        by_x = 1.0 - bend * stiffness, bend * damping * stiffness
        by_w = -bend * damping, 1.0 + bend * (damping * damping - stiffness)
        e = (
            angle[k] - (x + bend * force) - m[TRIM] - m[ANGLE_NOISE],
            rate[k] - (w - bend * (stiffness * w + damping * force)) - m[BIAS] - m[RATE_NOISE],
        )
        read(m, c, by_x, by_w, e, noise[k], innovation[k], variance[k])


@accelerated
def run_one_by_one(
    ratios: np.ndarray,
    active: tuple[bool, ...],
    friction_rate: float,
    m: np.ndarray,
    c: np.ndarray,
    q: np.ndarray,
    transition: np.ndarray,
    noise: np.ndarray,
    step: float,
    bend: float,
    angle: np.ndarray,
    rate: np.ndarray,
    innovation: np.ndarray,
    variance: np.ndarray,
) -> None:
    """`run_filter` for each of B filters, the first axis of what is of each."""
    for b in range(len(m)):
        r = ratios[b]
        run_filter(
            (r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]),
            active,
            friction_rate,
            m[b],
            c[b],
            q[b],
            transition[b],
            noise[b],
            step,
            bend,
            angle,
            rate,
            innovation[b],
            variance[b],
        )


def innovations(
    ratios: np.ndarray,
    active: tuple[bool, ...],
    friction_rate: float,
    basin: np.ndarray,
    initial: np.ndarray,
    bias_std: float,
    floor: np.ndarray,
    step: float,
    bend: float,
    angle: np.ndarray,
    rate: np.ndarray,
    counts: np.ndarray,
) -> np.ndarray:
    """Innovations and their variances under B sets of parameters; zero and one where nothing was read.

    Ratios (9, B); basin (11, B) in the order of ``LEVEL`` to ``DRIFT``; initial angle from trim, rate and trim (3, B);
    ``floor`` (2,): std of a block's mean that no model explains; counts (N, 2): samples in each mean. Filters run one
    after the other if compiled, else all at once: numpy takes as long for 20 as for 2.
    """
    count = ratios.shape[1]
    # most of the sets have the same disturbance
    spectra, which = np.unique(basin[[FREQUENCY, DAMPING, SPREAD]], axis=1, return_inverse=True)
    ahead, stationary = (each[which.ravel()] for each in disturbance(spectra[0], spectra[1], spectra[2], step))
    m, (c, q, transition) = np.zeros((count, STATES)), np.zeros((3, count, STATES, STATES))
    m[:, [X, RATE, TRIM]] = initial.T
    c[:, BIAS, BIAS] = bias_std**2
    for place, std, memory in ((ANGLE_NOISE, ANGLE_COLOUR, ANGLE_MEMORY), (RATE_NOISE, RATE_COLOUR, RATE_MEMORY)):
        transition[:, place, place] = keep = np.exp(-step / basin[memory])
        c[:, place, place] = basin[std] ** 2
        q[:, place, place] = basin[std] ** 2 * (1.0 - keep**2)
    before = stationary * basin[LEVEL][:, None, None] ** 2
    c[:, MOMENT:, MOMENT:] = before
    q[:, MOMENT:, MOMENT:] = before - ahead @ before @ ahead.transpose(0, 2, 1)
    q[:, TRIM, TRIM] = basin[DRIFT] ** 2 * step
    transition[:, [TRIM, BIAS], [TRIM, BIAS]] = 1.0
    transition[:, MOMENT:, MOMENT:] = ahead
    transition[:, X, MOMENT + 1] = step**3 / 6.0
    unread = counts == 0.0
    variances = basin[[ANGLE_WHITE, RATE_WHITE]].T[:, None] ** 2
    noise = np.where(unread, np.inf, variances / np.where(unread, 1.0, counts) + floor**2)
    record = step, bend, angle, rate
    found = np.empty((2, count, angle.size, 2))
    if has_numba():
        columns = np.ascontiguousarray(ratios.T), active, friction_rate, m, c, q, transition, noise
        run_one_by_one(*columns, *record, *found)
    else:
        c, q, transition, noise, *into = (np.moveaxis(each, 0, -1) for each in (c, q, transition, noise, *found))
        with np.errstate(all='ignore'):
            run_filter(tuple(ratios), active, friction_rate, m.T.copy(), c, q, transition, noise, *record, *into)
    found[0][:, unread], found[1][:, unread] = 0.0, 1.0
    return np.moveaxis(found, 1, -1)
