"""Whether a fit can be used: how far off the motion of the next release may be, and why."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from swath_sysid.attitude.hull.simulation import longest_step, runge_kutta_population
from swath_sysid.attitude.hull.terms import TERM_NAMES, damping_moment
from swath_sysid.attitude.identification.scaling import UPPER
from swath_sysid.attitude.motion.time_base import LONGEST_PERIOD
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.noise import white_noise

if TYPE_CHECKING:
    from swath_sysid.attitude.identification.identify import Identification

ADEQUATE, DOUBTFUL, REJECTED = 'adequate', 'doubtful', 'rejected'

#: Error of the next release, a share of its motion, up to which a model is adequate, and from which it is rejected:
#: it is then no better than a forecast of rest.
ADEQUATE_ERROR, REJECTED_ERROR = 0.1, 1.0
LARGEST_UNEXPLAINED = 0.5  #: Share of the motion: a fit that leaves more is of something else.
UPPER_PART = 0.9  #: Part of the draws whose error is smaller than the error stated.
DRAWS = 100  #: Hulls of the posterior that are simulated,
CANDIDATES = 1000  #: out of so many: those whose damping would give energy are left out.
RELEASE_PERIODS = 4.0  #: Length of the next release.
#: Autocorrelation of the residuals at one period from which they swing with the motion; white noise has 0.
SWINGING = 0.5
#: What the rate and the angle's slope differ by, over the rate, root mean squares: a wrong unit, sign or delay.
MAX_RATE_MISMATCH = 0.35
LEAST_USABLE = 0.5  #: Part of a record's rows that a fit must rest on.
BLOCKS_PER_PERIOD = 24  #: Within one of them the motion hardly changes.
CHANCE_STDS = 2.0  #: Standard deviations of the products of white residuals that are taken for chance.
AT_BOUND = 0.999  #: Of the search range: a stiffness beyond it ended at the bound.


@dataclass(frozen=True)
class Verdict:
    """A judgement of a fit."""

    level: str  #: ``adequate``, ``doubtful`` or ``rejected``.
    code: str  #: The cause, kebab-case.
    sentence: str  #: Cause and cure.
    motion_error: float  #: Upper end (90 %) of the error of the next release, a share of its motion; may be infinite.
    autocorrelation: float  #: Of the residuals at one period; NaN in records shorter than two.

    def __str__(self):
        return f'{self.level}: {self.sentence}'

    @property
    def warnings(self) -> tuple[Advice, ...]:
        """What to warn of: nothing where the fit is adequate."""
        return () if self.level == ADEQUATE else (Advice(self.code, str(self)),)

    @property
    def metrics(self) -> dict[str, float | str | None]:
        """As model files hold it; None for a number that is not finite."""
        numbers = {'motion_error': self.motion_error, 'residual_autocorrelation': self.autocorrelation}
        finite = {name: float(value) if np.isfinite(value) else None for name, value in numbers.items()}
        return {'verdict': self.level, 'verdict_code': self.code, 'verdict_sentence': self.sentence, **finite}


def judge(found: 'Identification') -> Verdict:
    """Judge a fit, the gravest cause first.

    Args:
        found: The fit.
    """
    uncertain, swing = posterior_error(found), residual_autocorrelation(found)
    angle, rate = (unexplained_share(found, quantity) for quantity in ('angle', 'rate'))
    # a gyro may drift and an angle lag without a fault of the model, as long as little of the rate is left
    unexplained = max(angle, rate) if found.rmse is None or not rate <= LARGEST_UNEXPLAINED else angle
    error = float(np.hypot(uncertain, unexplained))
    causes = [*_contradictions(found, unexplained), *_errors(uncertain, unexplained), *_doubts(found)]
    for level in (REJECTED, DOUBTFUL):
        for graveness, code, sentence in causes:
            if graveness == level:
                return Verdict(level, code, sentence, error, swing)
    left = f'; the fit leaves {unexplained:.1%} of the motion'
    if swing > SWINGING:
        left += f', which is not noise: it oscillates with the craft (autocorrelation {swing:+.2f} at one period)'
    sentence = f'the next release should be forecast to within {error:.1%} of its motion{left}'
    return Verdict(ADEQUATE, 'adequate', sentence, error, swing)


def _contradictions(found: 'Identification', unexplained: float) -> Iterator[tuple[str, str, str]]:
    """What makes the numbers wrong beyond doubt; not a number is wrong, too."""
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
    places = [TERM_NAMES.index(name) for name in ('r1', 's1')]
    stiffness = found.model.ratios[places] / found.problem.scales.ratio_units[places]
    if not (np.isfinite(period) and (stiffness <= AT_BOUND * UPPER[places]).all()):
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
        'in still water, or check units, signs and times of the columns and the start and end of the decay'
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
            f'only {usable:.0%} of the recorded rows have a time of their own: write the time with more digits',
        )
    if any(r.segment.beginning == 'pushed' and r.segment.cycles < 1.0 for r in found.records):
        yield (
            DOUBTFUL,
            'no-release',
            'less than one swing was seen and the craft was not held before it, so that it may not have swung freely: '
            'hold the craft still at an angle in still water, and release it',
        )
    absent = found.absent_term
    if absent is not None:
        yield (
            DOUBTFUL,
            'absent-term',
            f'{found.model.equation.name} lacks a term that the motion shows ({absent.name}, '
            f'{absent.significance:.0f} standard deviations from zero), and its other coefficients bend to make '
            f'up for it: add {absent.name}, or name no equation',
        )


def posterior_error(found: 'Identification') -> float:
    """Error of the next release that the uncertainty of every term and of the trim leaves, a share of its motion.

    The craft is released from the largest amplitude seen; the motion of the model is held against that of draws from
    the posterior whose damping takes energy.
    """
    model, problem = found.model, found.problem
    posterior = getattr(found, 'posterior', None)
    equation, ratios, covariance = (
        (model.equation, model.ratios[model.equation.indices], found.covariance)
        if posterior is None
        else (posterior.equation, posterior.ratios, posterior.covariance)
    )
    if not np.isfinite(covariance).all():
        return float('inf')
    rng = np.random.default_rng(0)
    hulls = np.zeros((len(TERM_NAMES), CANDIDATES))
    hulls[equation.indices] = ratios[:, None] + _normal(covariance, rng)
    trims = np.nan_to_num(found.trim_std) * rng.normal(size=DRAWS)
    first = max((r.state.x for r in found.records), key=abs)
    start = float(np.copysign(problem.scales.amplitude, first))
    rates = np.linspace(0.0, problem.scales.rate, 30)[1:]
    active = tuple(a or b for a, b in zip(equation.active, model.equation.active, strict=True))
    taken = damping_moment(rates[:, None], hulls[:, None, :], active, model.friction_rate)
    hulls = hulls[:, (taken >= 0.0).all(axis=0)][:, :DRAWS]
    count = hulls.shape[1]
    if not count:
        return float('inf')
    step = longest_step(model, start)
    steps = int(np.ceil(RELEASE_PERIODS * 2.0 * np.pi / problem.scales.frequency / step))
    offset = np.append(trims[:count], 0.0)
    with np.errstate(over='ignore', invalid='ignore'):
        angles, _, _ = runge_kutta_population(
            start - offset,
            np.zeros(count + 1),
            np.column_stack([hulls, model.ratios]),
            active,
            model.friction_rate,
            step,
            steps,
        )
        motion = angles[:, -1]
        error = np.sqrt(np.mean((angles[:, :-1] + offset[:-1] - motion[:, None]) ** 2, axis=0) / np.mean(motion**2))
    return float(np.quantile(np.where(np.isfinite(error), error, np.inf), UPPER_PART, method='higher'))


def _normal(covariance: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Draws about zero, shape (n, CANDIDATES), of a covariance (n, n) that may be singular and badly scaled."""
    std = np.sqrt(np.diag(covariance))
    scale = np.where(std > 0.0, std, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return scale[:, None] * (vectors * np.sqrt(np.maximum(values, 0.0))) @ rng.normal(size=(std.size, CANDIDATES))


def unexplained_share(found: 'Identification', quantity: str) -> float:
    """What neither the model nor white noise explains of angle or rate, over the motion; zero where not measured.

    White noise has no part in the products of neighbouring residuals, but for chance, which is taken off.
    """
    error = motion = 0.0
    for record in found.records:
        measured = getattr(record.motion, quantity)
        if measured is not None:
            residual = measured - getattr(record, quantity)
            lags = max(1, round(record.segment.period / BLOCKS_PER_PERIOD / record.motion.sample_interval))
            products = [float(np.mean(residual[lag:] * residual[:-lag])) for lag in range(1, lags + 1)]
            chance = CHANCE_STDS * float(np.mean(residual**2)) / np.sqrt(lags * residual.size)
            error += residual.size * (float(np.mean(products)) - chance)
            motion += float(np.sum((measured - measured.mean()) ** 2))
    return float(np.sqrt(max(error, 0.0) / motion)) if motion > 0.0 else 0.0


def residual_autocorrelation(found: 'Identification') -> float:
    """Autocorrelation of the residuals at one period, over all records that are longer than two."""
    product = power = 0.0
    for record in found.records:
        lag = max(1, round(record.segment.period / record.motion.sample_interval))
        residual = record.residual - record.residual.mean()
        if residual.size > 2 * lag:
            product += float(residual[lag:] @ residual[:-lag]) * residual.size / (residual.size - lag)
            power += float(residual @ residual)
    return product / power if power > 0.0 else float('nan')


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
