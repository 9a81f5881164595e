"""Whether a fit can be used: adequate, doubtful or refused, in one sentence with the cause and the cure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swath_sysid.attitude.identification.basin_likelihood import BasinFit
from swath_sysid.attitude.identification.innovations import LEVEL
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.noise import white_noise

if TYPE_CHECKING:
    from swath_sysid.attitude.identification.identify import Identification

ADEQUATE, DOUBTFUL, REFUSED = 'adequate', 'doubtful', 'refused'

#: Below this share of the variance of the angle (or of the rate, where no angle was measured) a model is of no use,
MIN_R2 = 0.9
MIN_R2_IN_WAVES = 0.5  #: or below this one where the likelihood shows that the rest is the basin's motion.
DOUBTFUL_R2 = 0.97

#: Residuals, of angle or rate, that swing as the motion does are not noise; those of measured decays are within 1 %.
MIN_R2_OF_COHERENT_RESIDUALS = 0.95

#: Autocorrelation of the residuals a tenth of a period on: of white noise 0, of the motion 0.8, of an offset 1.
COHERENT = 0.5

#: s; roll and pitch of craft that this package is for are several times as fast, so the time column is in doubt.
LONGEST_PERIOD = 60.0

#: What the rate and the angle's slope differ by, over the rate, root mean squares: a wrong unit, sign or delay.
MAX_RATE_MISMATCH = 0.35
#: Relative standard deviation of the natural period: the linear stiffness is then within two of its own of none.
MAX_PERIOD_STD = 0.25
MAX_DISTURBANCE = 0.1  #: Standard deviation of the moment found on the craft, over the largest restoring moment.
VANISHED = 1e-6  #: Dimensionless damping that is none.
#: Standard deviations of the innovations' correlation from sample to sample that chance does not make.
MAX_CORRELATION = 5.0

CHECK_COLUMNS = (
    'check units, signs and times of the columns, choose the decay by its start and end, or compare other equations'
)


@dataclass(frozen=True)
class Verdict:
    """A judgement of a fit."""

    level: str  #: ``adequate``, ``doubtful`` or ``refused``.
    code: str  #: The cause, kebab-case.
    sentence: str  #: Cause and cure.

    def __str__(self):
        return f'{self.level}: {self.sentence}'

    @property
    def warnings(self) -> tuple[Advice, ...]:
        """What to warn of: nothing where the fit is adequate."""
        return () if self.level == ADEQUATE else (Advice(self.code, str(self)),)


def judge(found: 'Identification') -> Verdict:
    """Judge a fit, the gravest cause first.

    Args:
        found: The fit.
    """
    for level, causes in ((REFUSED, _refusals(found)), (DOUBTFUL, _doubts(found))):
        for code, sentence in causes:
            return Verdict(level, code, sentence)
    return Verdict(
        ADEQUATE,
        'adequate',
        (f'the motion is explained to {found.r2:.2%}, and what is left is the noise of the sensor and of the basin'),
    )


def _refusals(found: 'Identification'):
    mismatch = max(rate_mismatch(r.motion, r.segment.period) for r in found.records)
    if mismatch > MAX_RATE_MISMATCH:
        yield (
            'angle-against-rate',
            (
                f'the measured rate differs from the slope of the measured angle by {mismatch:.0%} of itself: check '
                'unit, sign and delay of both columns'
            ),
        )
    for quantity in ('angle', 'rate'):
        pairs = [
            (getattr(record.motion, quantity), getattr(record, quantity))
            for record in found.records
            if getattr(record.motion, quantity) is not None
        ]
        if pairs:
            yield from _poor(quantity, pairs, found)
    if found.model.natural_period > LONGEST_PERIOD:
        yield (
            'implausible-period',
            (
                f'the natural period came out as {found.model.natural_period:.4g} s, more than '
                f'{LONGEST_PERIOD:g} s: check the unit of the time column, which may count milliseconds (time_ms) or '
                f'samples (time_samples)'
            ),
        )


def _doubts(found: 'Identification'):
    absent = found.absent_term
    if absent is not None:
        yield (
            'absent-term',
            (
                f'{found.model.equation.name} lacks a term that the motion shows ({absent.name}, '
                f'{absent.significance:.0f} standard deviations from zero), and its other coefficients bend to make '
                f'up for it: add {absent.name}, or compare equations'
            ),
        )
    for advice in found.advice:
        if advice.code == 'range-limit':
            yield advice.code, advice.message
    if found.keeps_least_squares and absent is None:
        yield (
            'equation-or-disturbance',
            (
                'the likelihood of a moving basin puts the natural period elsewhere than least squares, whose fit '
                'stays: the equation lacks a term or the basin is not still, so compare equations, or wait for still '
                'water'
            ),
        )
    disturbance = disturbance_of(found)
    if disturbance > MAX_DISTURBANCE:
        yield (
            'disturbed',
            (
                f'something moved the craft with {disturbance:.0%} of the moment it was released from, waves or an '
                'equation that lacks a term: wait for still water, or compare equations'
            ),
        )
    correlation = innovation_correlation(found.basin)
    if correlation > MAX_CORRELATION:
        yield (
            'residual-not-white',
            (
                'what the model leaves of the motion is not noise (its samples are correlated by '
                f'{correlation:.0f} standard deviations): compare equations, or look for a disturbance'
            ),
        )
    stiffness_std = max(found.std.get(name, 0.0) for name in ('r1', 's1'))
    natural = found.model.natural_frequency
    period_std = 0.5 * stiffness_std / natural**2 if np.isfinite(natural) else np.inf
    if not period_std < MAX_PERIOD_STD:
        yield (
            'hardly-known',
            (
                f'the natural period is known to {period_std:.0%} only: release from a larger angle, repeat the '
                'trial, or choose an equation with fewer terms'
            ),
        )
    if found.basin is None and found.r2 < DOUBTFUL_R2:
        yield (
            'noisy',
            (
                f'the simulated motion explains {found.r2:.1%} of the measured one, the rest is the basin or the '
                'sensor: release from a larger angle, or in stiller water'
            ),
        )


def explained_share(pairs: Sequence[tuple[np.ndarray, np.ndarray]]) -> float:
    """R2 of (measured, simulated) pairs, each record about its own mean.

    Args:
        pairs: sequence of tuple of two ndarrays, shape (N,); one a record, all of one unit.
    """
    error = sum(float(np.sum((measured - simulated) ** 2)) for measured, simulated in pairs)
    spread = sum(float(np.sum((measured - measured.mean()) ** 2)) for measured, _ in pairs)
    return 1.0 - error / spread if spread > 0.0 else 0.0


def _poor(quantity: str, pairs: Sequence[tuple[np.ndarray, np.ndarray]], found: 'Identification'):
    fitted = 'rate' if found.records[0].motion.angle is None else 'angle'
    r2 = explained_share(pairs)
    least = MIN_R2 if found.basin is None else MIN_R2_IN_WAVES
    if not r2 >= least and quantity == fitted:
        yield (
            'poor-fit',
            (
                f'the fit explains {max(r2, 0.0):.1%} of the variance of the {quantity}, and {least:.0%} is the least '
                f'that a model is of use with: {CHECK_COLUMNS}'
            ),
        )
    elif found.basin is None and r2 < MIN_R2_OF_COHERENT_RESIDUALS and _coherence(pairs, found) > COHERENT:
        yield (
            'poor-fit',
            (
                f'the fit explains {max(r2, 0.0):.1%} of the variance of the {quantity}, and what is left is not '
                f'noise: {CHECK_COLUMNS}'
            ),
        )


def _coherence(pairs: Sequence[tuple[np.ndarray, np.ndarray]], found: 'Identification'):
    """Autocorrelation of the residuals a tenth of a period on, the median of the records."""
    values = []
    for record, (measured, simulated) in zip(found.records, pairs, strict=False):
        lag = max(1, round(0.1 * record.segment.period / record.motion.sample_interval))
        residual = measured - simulated
        power = float(residual @ residual)
        if residual.size > 2 * lag and power > 0.0:
            values.append(float(residual[lag:] @ residual[:-lag]) / power)
    return float(np.median(values)) if values else 0.0


def rate_mismatch(motion: AxisMotion, period: float) -> float:
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


def disturbance_of(found: 'Identification') -> float:
    """Standard deviation of the disturbance over the restoring moment at the first angle; zero without likelihood."""
    if found.basin is None:
        return 0.0
    first = max((r.state.x for r in found.records), key=abs)
    moment = abs(float(found.model.acceleration(found.model.trim + first, 0.0)))
    return float(found.basin.basin[LEVEL]) / max(moment, 1e-12)


def innovation_correlation(basin: BasinFit | None) -> float:
    """Largest correlation of neighbouring innovations of a channel, in standard deviations of chance."""
    found = [0.0]
    for normalised in () if basin is None else basin.normalised:
        for channel in normalised.T:
            both = np.isfinite(channel[1:]) & np.isfinite(channel[:-1])
            if both.sum() > 20:
                product = channel[1:][both] * channel[:-1][both]
                found.append(abs(float(product.mean())) * np.sqrt(both.sum()))
    return max(found)
