"""Whether a fit can be used: the likely error of the next release's motion, and its cause."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swath_sysid.attitude.hull.identified_model import HullPosterior
from swath_sysid.attitude.identification.motion_fit import SEARCH_STEPS_PER_PERIOD
from swath_sysid.attitude.identification.uncertainty import release_error
from swath_sysid.attitude.motion.quality import MIN_CYCLES
from swath_sysid.attitude.motion.sensor_checks import MAX_OFFSET
from swath_sysid.attitude.motion.time_base import LONGEST_PERIOD
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.noise import white_noise

if TYPE_CHECKING:
    from swath_sysid.attitude.identification.identify import Identification

ADEQUATE, DOUBTFUL, REJECTED = 'adequate', 'doubtful', 'rejected'

#: Relative error of the next release up to which a model is adequate, and from which a forecast of rest is as good.
ADEQUATE_ERROR, REJECTED_ERROR = 0.1, 1.0
LARGEST_UNEXPLAINED = 0.5  #: Largest share of the motion that a fit may leave, or leave open to the other side.
#: Of `rate_mismatch`: above, a unit, sign or delay is wrong.
MAX_RATE_MISMATCH = 0.35
LEAST_USABLE = 0.5  #: Least share of a record's rows that must be usable.
CHANCE_STDS = 2.0  #: Standard deviations of the products of white residuals that are attributed to chance.
LARGEST_PERIOD_RATIO = 2.2  #: Of the natural period and that of the oscillation, or its inverse.
#: Least righting moment at the release over that of the linear stiffness; a craft that was moved has less.
LEAST_RIGHTING = 0.3


@dataclass(frozen=True)
class Verdict:
    """A judgement of a fit.

    Example:
        >>> verdict = identify([read_trial(records / 'kvlcc2_roll_decay.csv').axis('roll')]).verdict
        >>> verdict.level, verdict.motion_error < 0.05
        ('adequate', True)
    """

    level: str  #: ``adequate``, ``doubtful`` or ``rejected``.
    code: str  #: The cause, kebab-case.
    sentence: str  #: Cause and cure.
    motion_error: float  #: Upper end (90 %) of the error of the next release, a share of its motion; may be infinite.

    def __str__(self):
        return f'{self.level}: {self.sentence}'

    @property
    def warnings(self) -> tuple[Advice, ...]:
        """The verdict as a warning; empty where the fit is adequate."""
        return () if self.level == ADEQUATE else (Advice(self.code, str(self)),)

    @property
    def metrics(self) -> dict[str, float | str | None]:
        """As model files hold it; None for an infinite error."""
        error = float(self.motion_error) if np.isfinite(self.motion_error) else None
        words = {'verdict': self.level, 'verdict_code': self.code, 'verdict_sentence': self.sentence}
        return {**words, 'motion_error': error}


def judge(found: 'Identification') -> Verdict:
    """Judge a fit, the gravest cause first."""
    same_side, other_side = posterior_errors(found)
    uncertain = max(same_side, other_side) if other_side <= ADEQUATE_ERROR else same_side
    angle, rate = (unexplained_share(found, quantity) for quantity in ('angle', 'rate'))
    # a gyro may drift and an angle lag without a fault of the model, as long as little of the rate is left
    unexplained = max(angle, rate) if found.rmse is None or not rate <= LARGEST_UNEXPLAINED else angle
    error = float(np.hypot(uncertain, unexplained))
    causes = [
        *_contradictions(found, unexplained),
        *_errors(uncertain, unexplained),
        *_doubts(found),
        *_one_sided(other_side),
    ]
    for level in (REJECTED, DOUBTFUL):
        for graveness, code, sentence in causes:
            if graveness == level:
                return Verdict(level, code, sentence, error)
    other = f' ({other_side:.0%} to the other side)' if other_side > ADEQUATE_ERROR else ''
    ahead = f'the next release should be forecast to within {error:.1%} of its motion{other}'
    sentence = f'{ahead}; the fit leaves {unexplained:.1%} of the motion'
    return Verdict(ADEQUATE, 'adequate', sentence, error)


def _contradictions(found: 'Identification', unexplained: float) -> Iterator[tuple[str, str, str]]:
    """Causes that make the numbers wrong beyond doubt, NaN included."""
    mismatch = max(rate_mismatch(r.motion, r.segment.period) for r in found.records)
    if not mismatch <= MAX_RATE_MISMATCH:
        yield (
            REJECTED,
            'angle-against-rate',
            f'the measured rate differs from the slope of the measured angle by {mismatch:.0%} of itself: check '
            'unit, sign and delay of both columns',
        )
    if not unexplained <= LARGEST_UNEXPLAINED:
        yield REJECTED, 'poor-fit', _poor_fit(unexplained)
    period = found.model.natural_period
    if not np.isfinite(period):
        yield (
            REJECTED,
            'no-period',
            'the fit has no natural period of small motions: choose the decay by its start and end, or release the '
            'craft again in still water',
        )
    elif not period <= LONGEST_PERIOD:
        yield (
            REJECTED,
            'implausible-period',
            f'the natural period came out as {period:.4g} s, more than {LONGEST_PERIOD:g} s: check the unit of the '
            'time column, which may count milliseconds (time_ms) or samples (time_samples)',
        )


def _poor_fit(unexplained: float) -> str:
    return (
        f'{min(unexplained, 1.0):.0%} of the motion is neither explained by the fit nor white noise: release the craft '
        'in still water, name no equation, or check units, signs and times of the columns and the bounds of the decay'
    )


def _errors(uncertain: float, unexplained: float) -> Iterator[tuple[str, str, str]]:
    error = float(np.hypot(uncertain, unexplained))
    if not error <= ADEQUATE_ERROR:
        level = DOUBTFUL if error <= REJECTED_ERROR else REJECTED
        size = f'by {error:.0%} of its motion' if error < 1.0 else 'by more than its motion'
        yield (
            (level, 'poor-fit', _poor_fit(unexplained))
            if unexplained >= uncertain
            else (
                level,
                'motion-uncertain',
                f'the record leaves the next release uncertain {size}: add another release, or release from a larger '
                'angle',
            )
        )


def _doubts(found: 'Identification') -> Iterator[tuple[str, str, str]]:
    usable = min(r.motion.usable_share for r in found.records)
    if not usable >= LEAST_USABLE:
        yield (
            DOUBTFUL,
            'few-samples',
            f'only {usable:.0%} of the recorded rows have a distinct time: write the time with more digits',
        )
    measured = 2.0 * np.pi / found.problem.scales.frequency
    if not 1.0 / LARGEST_PERIOD_RATIO < found.model.natural_period / measured < LARGEST_PERIOD_RATIO:
        yield (
            DOUBTFUL,
            'implausible-period',
            f'the natural period came out as {found.model.natural_period:.3g} s, but the craft oscillates with '
            f'{measured:.3g} s: choose the decay by its start and end, or release the craft again in still water',
        )
    start = largest_release(found)
    righting = -float(found.model.acceleration(found.model.trim + start, 0.0)) / start
    brief = any(r.segment.beginning == 'pushed' and r.segment.cycles < 1.0 for r in found.records)
    few = all(r.segment.cycles < MIN_CYCLES for r in found.records)
    if brief or (few and not righting >= LEAST_RIGHTING * found.model.natural_frequency**2):
        seen = 'less than one oscillation was recorded' if brief else 'it hardly accelerated at first'
        yield (
            DOUBTFUL,
            'no-release',
            f'the craft may have been moved and not released, because {seen}: hold it still at an angle in still '
            'water, and let it go',
        )
    absent = found.absent_term
    if absent is not None:
        yield (
            DOUBTFUL,
            'absent-term',
            f'{found.model.equation.name} lacks a term that the motion shows ({absent.name}, '
            f'{absent.significance:.0f} standard deviations from zero), which biases its other '
            f'coefficients: fit an equation that has {absent.name}',
        )


def _one_sided(other_side: float) -> Iterator[tuple[str, str, str]]:
    if not other_side <= LARGEST_UNEXPLAINED:
        size = f' by {other_side:.0%} of its motion' if other_side < 1.0 else ''
        yield (
            DOUBTFUL,
            'one-sided',
            'the record shows the motion to one side only, so the forecast of a release to the other side may be wrong'
            f'{size}: release the craft from the other side too',
        )


def largest_release(found: 'Identification') -> float:
    """The largest amplitude seen, rad from trim, to the side on which that record begins."""
    return float(np.copysign(found.problem.scales.amplitude, max((r.state.x for r in found.records), key=abs)))


def posterior_errors(found: 'Identification') -> tuple[float, float]:
    """The `release_error` of a fit from the largest amplitude seen: to the same side, and to the other."""
    model, scales = found.model, found.problem.scales
    start = largest_release(found)
    own = HullPosterior(model.equation, model.ratios[model.equation.indices], found.covariance)
    same, other = (
        release_error(model, found.posterior or own, found.trim_std, side, scales) for side in (start, -start)
    )
    return same, other


def unexplained_share(found: 'Identification', quantity: str) -> float:
    """Residual of angle or rate that is not white noise, over the motion; zero where not measured.

    From the products of neighbouring residuals, in which white noise has no part, less what chance leaves.
    """
    error = motion = 0.0
    for record in found.records:
        measured = getattr(record.motion, quantity)
        if measured is not None:
            residual = measured - getattr(record, quantity)
            lags = max(1, round(record.segment.period / SEARCH_STEPS_PER_PERIOD / record.motion.sample_interval))
            products = [float(np.mean(residual[lag:] * residual[:-lag])) for lag in range(1, lags + 1)]
            chance = CHANCE_STDS * float(np.mean(residual**2)) / np.sqrt(lags * residual.size)
            error += residual.size * (float(np.mean(products)) - chance)
            motion += float(np.sum((measured - measured.mean()) ** 2))
    return float(np.sqrt(max(error, 0.0) / motion)) if motion > 0.0 else 0.0


def rate_mismatch(motion: AxisMotion, period: float) -> float:
    """Rms difference of the rate and the angle's slope over a sixth of a period, over the rate; zero without both.

    The contributions of the angle's white noise and of an uncalibrated gyroscope's offset are subtracted.
    """
    span = max(1, round(period / 6.0 / motion.sample_interval))
    if motion.angle is None or motion.rate is None or motion.size < 8 * span:
        return 0.0
    at = np.arange(motion.size - span)
    elapsed = motion.time[at + span] - motion.time[at]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (motion.rate[1:] + motion.rate[:-1]) * np.diff(motion.time))])
    slope, rate = (motion.angle[at + span] - motion.angle[at]) / elapsed, (integral[at + span] - integral[at]) / elapsed
    noise = np.sqrt(2.0) * white_noise(motion.angle) / float(np.median(elapsed))
    offset = max(abs(float(np.mean(slope - rate))) - MAX_OFFSET, 0.0)
    return float(np.hypot(np.sqrt(max(np.var(slope - rate) - noise**2, 0.0)), offset) / max(np.std(rate), 1e-12))
