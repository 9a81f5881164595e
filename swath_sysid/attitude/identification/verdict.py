"""Whether a fit can be used: one level, one code and one sentence with the cause and the cure."""

from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.identification.innovations import LEVEL
from swath_sysid.common.noise import white_noise

ADEQUATE, DOUBTFUL, REFUSED = 'adequate', 'doubtful', 'refused'

LEAST_R2 = 0.9
"""Below, the simulated motion is not the measured one."""
DOUBTFUL_R2 = 0.97
MOST_RATE_MISMATCH = 0.35
"""What the rate and the angle's slope differ by, over the rate, root mean squares: a wrong unit, sign or delay."""
MOST_PERIOD_STD = 0.05
"""Relative standard deviation of the natural period beyond which the coefficients are hardly known."""
LARGEST_DISTURBANCE = 0.1
"""Standard deviation of the moment found on the craft, over the largest restoring moment."""
MOST_CORRELATION = 5.0
"""Standard deviations of the innovations' correlation from sample to sample that chance does not make."""


@dataclass(frozen=True)
class Verdict:
    """A judgement of a fit.

    Attributes
    ----------
    level : str
        ``adequate``, ``doubtful`` or ``refused``.
    code : str
        The cause, kebab-case.
    sentence : str
        Cause and cure.
    """

    level: str
    code: str
    sentence: str


def verdict_on(r2, records, model, std, basin=None):
    """Judge a fit, the gravest cause first.

    Parameters
    ----------
    r2 : float
        Share of the variance explained.
    records : sequence of RecordFit
    model : DecayModel
    std : ndarray, shape (n,)
        Of the ratios of the model's terms.
    basin : BasinFit, optional

    Returns
    -------
    Verdict
    """
    mismatch = max(rate_mismatch(r.motion, r.segment.period) for r in records)
    if mismatch > MOST_RATE_MISMATCH:
        return Verdict(
            REFUSED, 'angle-against-rate',
            f'refused: the measured rate differs from the slope of the measured angle by {mismatch:.0%} of itself: '
            'check unit, sign and delay of both columns',
        )  # fmt: skip
    if not r2 >= LEAST_R2:
        return Verdict(
            REFUSED, 'not-this-motion',
            f'refused: the simulated motion explains {max(r2, 0.0):.0%} of the measured one only: choose an equation '
            'with more terms, or give the bounds of the free decay',
        )  # fmt: skip
    stiffness_std = float(max(s for name, s in zip(model.equation.terms, std, strict=True) if name in ('r1', 's1')))
    natural = model.natural_frequency
    period_std = 0.5 * stiffness_std / natural**2 if np.isfinite(natural) else np.inf
    disturbance = 0.0 if basin is None else disturbance_of(basin, records, model)
    if disturbance > LARGEST_DISTURBANCE:
        return Verdict(
            DOUBTFUL, 'disturbed',
            f'doubtful: something moved the craft with {disturbance:.0%} of the moment it was released from, waves or '
            'an equation that lacks a term: wait for still water, or compare equations',
        )  # fmt: skip
    correlation = 0.0 if basin is None else innovation_correlation(basin)
    if correlation > MOST_CORRELATION:
        return Verdict(
            DOUBTFUL, 'residual-not-white',
            'doubtful: what the model leaves of the motion is not noise (its samples are correlated by '
            f'{correlation:.0f} standard deviations): compare equations, or look for a disturbance',
        )  # fmt: skip
    if not period_std < MOST_PERIOD_STD:
        return Verdict(
            DOUBTFUL, 'hardly-known',
            f'doubtful: the natural period is known to {period_std:.0%} only: release from a larger angle, repeat the '
            'trial, or choose an equation with fewer terms',
        )  # fmt: skip
    if r2 < DOUBTFUL_R2:
        return Verdict(
            DOUBTFUL, 'noisy',
            f'doubtful: the simulated motion explains {r2:.1%} of the measured one, the rest is the basin or the '
            'sensor: release from a larger angle, or in stiller water',
        )  # fmt: skip
    return Verdict(
        ADEQUATE, 'adequate',
        f'adequate: the motion is explained to {r2:.2%}, and what is left is the noise of the sensor and of the basin',
    )  # fmt: skip


def rate_mismatch(motion, period):
    """What the rate and the angle's slope differ by, over the rate, both about their means; zero without both.

    Both are taken over spans of a sixth of a period, and what the white noise of the angles makes of it is taken off.
    """
    span = max(1, round(period / 6.0 / motion.sample_interval))
    if motion.angle is None or motion.rate is None or motion.size < 8 * span:
        return 0.0
    at = np.arange(motion.size - span)
    elapsed = motion.time[at + span] - motion.time[at]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (motion.rate[1:] + motion.rate[:-1]) * np.diff(motion.time))])
    slope, rate = (motion.angle[at + span] - motion.angle[at]) / elapsed, (integral[at + span] - integral[at]) / elapsed
    noise = np.sqrt(2.0) * white_noise(motion.angle) / float(np.median(elapsed))
    return float(np.sqrt(max(np.var(slope - rate) - noise**2, 0.0)) / max(np.std(rate), 1e-12))


def disturbance_of(basin, records, model):
    """Standard deviation of the disturbance over the restoring moment at the first angle."""
    first = max((r.state.x for r in records), key=abs)
    moment = abs(float(model.acceleration(model.trim + first, 0.0)))
    return float(basin.basin[LEVEL]) / max(moment, 1e-12)


def innovation_correlation(basin):
    """Largest correlation of neighbouring innovations of a channel, in standard deviations of chance."""
    found = [0.0]
    for normalised in basin.normalised:
        for channel in normalised.T:
            both = np.isfinite(channel[1:]) & np.isfinite(channel[:-1])
            if both.sum() > 20:
                product = channel[1:][both] * channel[:-1][both]
                found.append(abs(float(product.mean())) * np.sqrt(both.sum()))
    return max(found)
