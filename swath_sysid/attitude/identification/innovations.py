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

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from swath_sysid.attitude.hull.simulation import (
    as_tuple,
    damping_moment,
    damping_slope,
    motion_step,
    restoring_moment,
    restoring_slope,
)
from swath_sysid.common.accelerator import accelerated, has_numba

#: Places in the state; from ``MOMENT`` on the disturbance, its slope, and the same of what drives it and that.
X, RATE, MOMENT, *_, TRIM, BIAS, ANGLE_NOISE, RATE_NOISE = _PLACES = range(12)
STATES = len(_PLACES)
SUBSTEPS = 2  #: Runge-Kutta steps in a block: quadratic damping bends where the rate changes its sign.

#: Places of the basin's and the sensor's parameters: the disturbance's standard deviation, rad/s^2, frequency, rad/s,
#: damping ratio and spread; white noise of a reading, rad and rad/s; standard deviation and memory, s, of the coloured
#: noise of either; drift of the trim, rad in the square root of a second.
LEVEL, FREQUENCY, DAMPING, SPREAD, ANGLE_WHITE, RATE_WHITE = range(6)
ANGLE_COLOUR, ANGLE_MEMORY, RATE_COLOUR, RATE_MEMORY, DRIFT = range(6, 11)


class Hulls(NamedTuple):
    """One hull, or B of them."""

    ratios: Any  #: A tuple of floats or of arrays (B,), or (9, B).
    active: tuple[bool, ...]
    friction_rate: float  #: rad/s.


class BlockedRecord(NamedTuple):
    """A record in means over blocks of one step: mean = mid value + bend x second derivative."""

    step: float  #: s.
    bend: float  #: Half a block's second moment, s^2.
    angle: np.ndarray  #: (N,); rad; zero where not measured.
    rate: np.ndarray  #: (N,); rad/s; zero where not measured.
    counts: np.ndarray  #: (N, 2); samples in each mean.


class Filters(NamedTuple):
    """One filter, or B side by side, the last axis of each array; overwritten."""

    mean: np.ndarray  #: (12,); at the first reading.
    covariance: np.ndarray  #: (12, 12)
    transition: np.ndarray  #: (12, 12)
    driven: np.ndarray  #: (12, 12); covariance of what a step adds.
    noise: np.ndarray  #: (N, 2); variances, infinite where nothing was read.
    innovation: np.ndarray  #: (N, 2)
    variance: np.ndarray  #: (N, 2); of the innovations; the rate's given the angle.


def disturbance(
    frequency: np.ndarray, damping: np.ndarray, spread: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Exact transition over a step, s, and covariance for unit variance of d, each (B, 6, 6). Of d, its slope and the
    same of its drives. Frequency in rad/s, damping over critical, spread of the resonators' log frequencies, each (B,).
    The covariance solves Lyapunov's equation.
    """
    from scipy.linalg import expm

    drift = np.zeros((frequency.size, 6, 6))
    for first, power in zip((0, 2, 4), (-1.0, 0.0, 1.0), strict=True):
        own = np.exp(power * spread)
        drift[:, first, first + 1] = 1.0
        drift[:, first + 1, first], drift[:, first + 1, first + 1] = -(own**2), -2.0 * damping * own
    drift[:, 1, 2] = drift[:, 3, 4] = 1.0
    transition = expm(drift * (frequency * step)[:, None, None])
    lyapunov = np.einsum('bik,jl->bijkl', drift, np.eye(6)) + np.einsum('bjl,ik->bijkl', drift, np.eye(6))
    driven = np.zeros((frequency.size, 36, 1))
    driven[:, -1] = -1.0
    covariance = np.linalg.solve(lyapunov.reshape(-1, 36, 36), driven).reshape(-1, 6, 6)
    units = np.stack([np.ones_like(frequency), frequency] * 3, axis=-1)
    transition = transition * units[:, :, None] / units[:, None, :]
    return transition, covariance / covariance[:, :1, :1] * units[:, :, None] * units[:, None, :]


def one_by_one() -> Iterable[Any]:
    """Places in a row of a matrix, for a loop that is compiled."""
    return range(STATES)


def all_at_once() -> Iterable[Any]:
    """The whole row as one place: numpy takes as long for it as for a number."""
    return (slice(None),)


along_row = accelerated(one_by_one, all_at_once)


@accelerated
def move_hull(f: np.ndarray, stiffness: Any, damping: Any, step: float) -> None:
    """The part of the transition that depends on the motion, in place: the matrix exponential to third order, with
    Pade's approximants in the damping, which is stiff where dry friction stops the craft.
    """
    k, c, x = stiffness, damping, damping * step
    by_moment = step / (1.0 + x / 2.0 + x * x / 12.0) - step * step * step / 6.0 * k
    by_slope = 0.5 * step * step / (1.0 + x / 3.0)
    kept = 1.0 - k * by_slope
    f[X, X], f[X, RATE], f[X, MOMENT] = kept, by_moment, by_slope
    f[RATE, X], f[RATE, RATE] = -k * by_moment, kept - c * by_moment
    f[RATE, MOMENT], f[RATE, MOMENT + 1] = by_moment, by_slope


def times_one(f: np.ndarray, given: np.ndarray, found: np.ndarray) -> None:
    """The transition times a matrix (12, 12) without its zeros, written transposed: twice for a covariance."""
    for j in range(STATES):
        x, w, d, slope = given[X, j], given[RATE, j], given[MOMENT, j], given[MOMENT + 1, j]
        for i in range(MOMENT):
            found[j, i] = f[i, X] * x + f[i, RATE] * w + f[i, MOMENT] * d + f[i, MOMENT + 1] * slope
        # the coupling is one way: each resonator is driven by the next
        for i in range(MOMENT, TRIM):
            total = 0.0
            for k in range(i - i % 2, TRIM):
                total += f[i, k] * given[k, j]
            found[j, i] = total
        for i in range(TRIM, STATES):
            found[j, i] = f[i, i] * given[i, j]


def times_all(f: np.ndarray, given: np.ndarray, found: np.ndarray) -> None:
    """As `times_one`, (12, 12, B): zeros included, which are no loss in numpy."""
    np.matmul(f.transpose(2, 0, 1), given.transpose(2, 0, 1), out=found.transpose(2, 1, 0))


times_transition = accelerated(times_one, times_all)


@accelerated
def run_filter(hulls: Hulls, record: BlockedRecord, filters: Filters) -> None:
    """Innovations and their variances, written into the filters."""
    ratios, active, friction_rate = hulls
    step, bend, angles, rates, _ = record
    m, c, f, q, noise, innovation, variance = filters
    sub, half, a, r = step / SUBSTEPS, np.empty_like(c), np.empty_like(m), np.empty_like(m)
    for k in range(angles.size):
        if k > 0:
            x, w = m[X] + 0.0, m[RATE] + 0.0
            for part in range(SUBSTEPS):
                moment = m[MOMENT] + (part + 0.5) * sub * m[MOMENT + 1]
                _, x, w = motion_step(x, w, moment, sub, ratios, active, friction_rate)
            stiffness = restoring_slope(0.5 * (x + m[X]), ratios, active)
            damping = damping_slope(0.5 * (w + m[RATE]), ratios, active, friction_rate)
            move_hull(f, stiffness, damping, step)
            times_transition(f, c, half)
            times_transition(f, half, c)
            c += q
            m[X], m[RATE] = x, w
            for i in range(MOMENT, TRIM, 2):
                value = slope = 0.0
                for j in range(i, TRIM):
                    value, slope = value + f[i, j] * m[j], slope + f[i + 1, j] * m[j]
                m[i], m[i + 1] = value, slope
            for i in range(TRIM, STATES):
                m[i] *= f[i, i]
        x, w = m[X], m[RATE]
        stiffness = restoring_slope(x, ratios, active)
        damping = damping_slope(w, ratios, active, friction_rate)
        force = m[MOMENT] - damping_moment(w, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
        # the slopes of both readings by x and w, and the readings less their prediction
        ax, aw = 1.0 - bend * stiffness, -bend * damping
        rx, rw = bend * damping * stiffness, 1.0 + bend * (damping * damping - stiffness)
        e_angle = angles[k] - (x + bend * force) - m[TRIM] - m[ANGLE_NOISE]
        e_rate = rates[k] - (w - bend * (stiffness * w + damping * force)) - m[BIAS] - m[RATE_NOISE]
        for j in along_row():
            a[j] = ax * c[X, j] + aw * c[RATE, j] + c[TRIM, j] + c[ANGLE_NOISE, j]
            r[j] = rx * c[X, j] + rw * c[RATE, j] + c[BIAS, j] + c[RATE_NOISE, j]
        s_angle = ax * a[X] + aw * a[RATE] + a[TRIM] + a[ANGLE_NOISE] + noise[k, 0]
        share = (rx * a[X] + rw * a[RATE] + a[BIAS] + a[RATE_NOISE]) / s_angle
        # of the rate given the angle
        for j in along_row():
            r[j] -= share * a[j]
        s_rate = rx * r[X] + rw * r[RATE] + r[BIAS] + r[RATE_NOISE] + noise[k, 1]
        e_rate = e_rate - share * e_angle
        by_angle, by_rate = 1.0 / np.sqrt(s_angle), 1.0 / np.sqrt(s_rate)
        for j in along_row():
            a[j] *= by_angle
            r[j] *= by_rate
            m[j] += a[j] * (by_angle * e_angle) + r[j] * (by_rate * e_rate)
        for i in range(STATES):
            for j in along_row():
                c[i, j] -= a[i] * a[j] + r[i] * r[j]
        innovation[k, 0], innovation[k, 1] = e_angle, e_rate
        variance[k, 0], variance[k, 1] = s_angle, s_rate


@accelerated
def run_each(hulls: Hulls, record: BlockedRecord, filters: Filters) -> None:
    """`run_filter` for each of B filters, with ratios (9, B)."""
    f = filters
    for b in range(f.mean.shape[1]):
        mean, covariance = f.mean[:, b].copy(), f.covariance[:, :, b].copy()
        transition, driven = f.transition[:, :, b].copy(), f.driven[:, :, b].copy()
        readings = f.noise[:, :, b], f.innovation[:, :, b], f.variance[:, :, b]
        hull = Hulls(as_tuple(hulls.ratios[:, b]), hulls.active, hulls.friction_rate)
        run_filter(hull, record, Filters(mean, covariance, transition, driven, *readings))


def innovations(
    hulls: Hulls, basin: np.ndarray, initial: np.ndarray, bias_std: float, floor: np.ndarray, record: BlockedRecord
) -> np.ndarray:
    """Innovations and their variances under B sets of parameters, (2, N, 2, B); zero and one where nothing was read.
    Ratios (9, B); basin (11, B) in the order of ``LEVEL`` to ``DRIFT``; initial angle from trim, rate and trim (3, B);
    ``floor`` (2,): std of a block's mean that no model explains. Filters run one after the other if compiled, else all
    at once: numpy takes as long for 20 as for 2.
    """
    step, counts, count = record.step, record.counts, basin.shape[1]
    # most of the sets have the same disturbance
    spectra, which = np.unique(basin[[FREQUENCY, DAMPING, SPREAD]], axis=1, return_inverse=True)
    ahead, stationary = (each[which.ravel()] for each in disturbance(spectra[0], spectra[1], spectra[2], step))
    before = stationary * basin[LEVEL][:, None, None] ** 2
    m, (c, q, f) = np.zeros((STATES, count)), np.zeros((3, STATES, STATES, count))
    m[[X, RATE, TRIM]] = initial
    c[BIAS, BIAS] = bias_std**2
    for place, std, memory in ((ANGLE_NOISE, ANGLE_COLOUR, ANGLE_MEMORY), (RATE_NOISE, RATE_COLOUR, RATE_MEMORY)):
        f[place, place] = keep = np.exp(-step / basin[memory])
        c[place, place] = basin[std] ** 2
        q[place, place] = basin[std] ** 2 * (1.0 - keep**2)
    of_disturbance = slice(MOMENT, TRIM), slice(MOMENT, TRIM)
    c[of_disturbance] = np.moveaxis(before, 0, -1)
    q[of_disturbance] = np.moveaxis(before - ahead @ before @ ahead.transpose(0, 2, 1), 0, -1)
    f[of_disturbance] = np.moveaxis(ahead, 0, -1)
    q[TRIM, TRIM] = basin[DRIFT] ** 2 * step
    f[[TRIM, BIAS], [TRIM, BIAS]] = 1.0
    f[X, MOMENT + 1] = step**3 / 6.0
    unread = counts == 0.0
    variances = basin[[ANGLE_WHITE, RATE_WHITE]] ** 2
    noise = np.where(unread, np.inf, 1.0 / np.where(unread, 1.0, counts))[..., None] * variances + floor[:, None] ** 2
    found = np.empty((2, *noise.shape))
    filters = Filters(m, c, f, q, noise, *found)
    if has_numba():
        run_each(hulls, record, filters)
    else:
        with np.errstate(all='ignore'):
            run_filter(hulls._replace(ratios=tuple(hulls.ratios)), record, filters)
    found[0][unread], found[1][unread] = 0.0, 1.0
    return found
