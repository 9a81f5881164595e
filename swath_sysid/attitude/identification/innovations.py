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

from typing import Any, NamedTuple

import numpy as np

from swath_sysid.attitude.hull.compiled import (
    damping_moment,
    damping_slope,
    motion_step,
    restoring_moment,
    restoring_slope,
)
from swath_sysid.common.accelerator import accelerated, has_numba

STATES = 12
#: Places in the state; the last six are the disturbance, its slope, and the same of what drives it and that.
X, RATE, TRIM, BIAS, ANGLE_NOISE, RATE_NOISE, MOMENT = range(7)
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


class Hulls(NamedTuple):
    """One hull, or B of them."""

    ratios: Any  #: Nine floats, nine arrays (B,), or (9, B).
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
    """Of one filter or of B, the first axis of each array; overwritten."""

    mean: np.ndarray  #: (12, 1); at the first reading.
    covariance: np.ndarray  #: (12, 12)
    transition: np.ndarray  #: (12, 12)
    transposed: np.ndarray  #: (12, 12); of the same memory.
    driven: np.ndarray  #: (12, 12); covariance of what a step adds.
    noise: np.ndarray  #: (N, 2); variances, infinite where nothing was read.
    innovation: np.ndarray  #: (N, 2)
    variance: np.ndarray  #: (N, 2); of the innovations; the rate's given the angle.


def disturbance(
    frequency: np.ndarray, damping: np.ndarray, spread: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Exact transition over a step, s, and covariance for unit variance of d, each (B, 6, 6).

    Of d, its slope and the same of its drives. Frequency in rad/s, damping over critical, spread of the resonators' log
    frequencies, each (B,). The covariance solves Lyapunov's equation.
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


@accelerated
def move_hull(f: np.ndarray, stiffness: Any, damping: Any, step: float) -> None:
    """The part of the transition, transposed, that depends on the motion: the matrix exponential to third order."""
    k, c, h2, h3 = stiffness, damping, step * step / 2.0, step * step * step / 6.0
    by_moment, by_slope = step - h2 * c + h3 * (c * c - k), h2 - h3 * c
    kept = 1.0 - k * by_slope
    f[X, X], f[RATE, X], f[MOMENT, X] = kept, by_moment, by_slope
    f[X, RATE], f[RATE, RATE] = -k * by_moment, kept - c * by_moment
    f[MOMENT, RATE], f[MOMENT + 1, RATE] = by_moment, by_slope


@accelerated
def run_filter(hulls: Hulls, record: BlockedRecord, filters: Filters) -> None:
    """Innovations and their variances, written into the filters.

    The transposed arrays of one filter and of B are addressed alike: what belongs to a filter is the last axis.
    """
    ratios, active, friction_rate = hulls
    step, bend, angles, rates, _ = record
    mean, covariance, transition, transposed, driven, noises, innovations, variances = filters
    m, c, f = mean.T[0], covariance.T, transition.T
    noise, innovation, variance = noises.T, innovations.T, variances.T
    sub = step / SUBSTEPS
    for k in range(angles.size):
        if k > 0:
            x, w = m[X] + 0.0, m[RATE] + 0.0
            for part in range(SUBSTEPS):
                moment = m[MOMENT] + (part + 0.5) * sub * m[MOMENT + 1]
                _, x, w = motion_step(x, w, moment, sub, ratios, active, friction_rate)
            stiffness = restoring_slope(0.5 * (x + m[X]), ratios, active)
            damping = damping_slope(0.5 * (w + m[RATE]), ratios, active, friction_rate)
            move_hull(f, stiffness, damping, step)
            mean[:] = transition @ mean
            covariance[:] = transition @ covariance @ transposed + driven
            m[X], m[RATE] = x, w
        x, w = m[X], m[RATE]
        stiffness = restoring_slope(x, ratios, active)
        damping = damping_slope(w, ratios, active, friction_rate)
        force = m[MOMENT] - damping_moment(w, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
        # the slopes of both readings by x and w, and the readings less their prediction
        ax, aw = 1.0 - bend * stiffness, -bend * damping
        rx, rw = bend * damping * stiffness, 1.0 + bend * (damping * damping - stiffness)
        e_angle = angles[k] - (x + bend * force) - m[TRIM] - m[ANGLE_NOISE]
        e_rate = rates[k] - (w - bend * (stiffness * w + damping * force)) - m[BIAS] - m[RATE_NOISE]
        a = ax * c[X] + aw * c[RATE] + c[TRIM] + c[ANGLE_NOISE]
        r = rx * c[X] + rw * c[RATE] + c[BIAS] + c[RATE_NOISE]
        s_angle = ax * a[X] + aw * a[RATE] + a[TRIM] + a[ANGLE_NOISE] + noise[0, k]
        share = (rx * a[X] + rw * a[RATE] + a[BIAS] + a[RATE_NOISE]) / s_angle
        # of the rate given the angle
        r = r - share * a
        s_rate = rx * r[X] + rw * r[RATE] + r[BIAS] + r[RATE_NOISE] + noise[1, k]
        e_rate = e_rate - share * e_angle
        by_angle, by_rate = a / s_angle, r / s_rate
        m += by_angle * e_angle + by_rate * e_rate
        c -= by_angle * np.expand_dims(a, 1) + by_rate * np.expand_dims(r, 1)
        innovation[0, k], innovation[1, k] = e_angle, e_rate
        variance[0, k], variance[1, k] = s_angle, s_rate


@accelerated
def run_each(hulls: Hulls, record: BlockedRecord, filters: Filters) -> None:
    """`run_filter` for each of B filters, with ratios (B, 9)."""
    f = filters
    for b, r in enumerate(hulls.ratios):
        ratios = r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]
        arrays = f.mean[b], f.covariance[b], f.transition[b], f.transition[b].T, f.driven[b], f.noise[b]
        own = Filters(*arrays, f.innovation[b], f.variance[b])
        run_filter(Hulls(ratios, hulls.active, hulls.friction_rate), record, own)


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
    m, (c, q, transition) = np.zeros((count, STATES, 1)), np.zeros((3, count, STATES, STATES))
    m[:, [X, RATE, TRIM], 0] = initial.T
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
    found = np.empty((2, *noise.shape[::-1])).transpose(0, 3, 2, 1)
    if has_numba():
        filters = Filters(m, c, transition, transition.transpose(0, 2, 1), q, noise, *found)
        run_each(hulls._replace(ratios=hulls.ratios.T.copy()), record, filters)
    else:
        # numpy is faster where the filters are neighbours
        m, c, transition, q, noise = (np.asfortranarray(each) for each in (m, c, transition, q, noise))
        filters = Filters(m, c, transition, transition.transpose(0, 2, 1), q, noise, *found)
        with np.errstate(all='ignore'):
            run_filter(hulls._replace(ratios=tuple(hulls.ratios)), record, filters)
    found[0][:, unread], found[1][:, unread] = 0.0, 1.0
    return np.moveaxis(found, 1, -1)
