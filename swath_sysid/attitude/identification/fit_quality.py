"""Whether a fit can be used: what a record cannot separate, the likely error of the next release, and its cause."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy  # its rooms are loaded when they are used: the buffer subscribes first

from swath_sysid.attitude.hull.decay_model import AmplitudeCurves, DecayModel, amplitude_curves
from swath_sysid.attitude.hull.identified_model import HullPosterior
from swath_sysid.attitude.hull.simulation import longest_step, runge_kutta_population, simulate
from swath_sysid.attitude.hull.terms import (
    DAMPING_NAMES,
    RESTORING_NAMES,
    TERM_NAMES,
    Scales,
    damping_moment,
    term_moments,
)
from swath_sysid.attitude.identification.decay_fit import DecayFit, RecordFit
from swath_sysid.attitude.identification.motion_fit import PERTURBATION, SEARCH_STEPS_PER_PERIOD, InitialState, Noise
from swath_sysid.attitude.identification.problem import FIRST_LOOK_PERIODS, motion_fit, parabola_through
from swath_sysid.attitude.motion.quality import MIN_CYCLES
from swath_sysid.attitude.motion.segmentation import ASYMMETRY
from swath_sysid.attitude.motion.sensor_checks import MAX_OFFSET
from swath_sysid.attitude.motion.stamps import LONGEST_PERIOD
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import ADEQUATE, DOUBTFUL, REJECTED, THREE_STD, TWO_STD, UNCERTAIN
from swath_sysid.common.covariance import NOT_SEPARABLE, correlation
from swath_sysid.common.judgement import Finding, Judgement
from swath_sysid.common.signals import running_integral

UPPER_PART = 0.9  #: Share of the draws whose error is smaller than the stated error.
DRAWS = 100  #: Hulls of the posterior that are simulated, of ten times as many that are drawn.
RATES = 30  #: At which the sign of each hull's damping is checked.
RELEASE_PERIODS = 4.0  #: Length of the next release.


def known_together(terms: Sequence[str], covariance: np.ndarray) -> tuple[tuple[str, ...], ...]:
    """Groups of damping or of restoring terms that the covariance (n, n) of their ratios does not separate."""
    linked = np.abs(correlation(covariance)) > NOT_SEPARABLE
    groups: list[tuple[str, ...]] = []
    for names in (DAMPING_NAMES, RESTORING_NAMES):
        places = [k for k, name in enumerate(terms) if name in names]
        together = [terms[k] for k in places if linked[k, places].sum() > 1]
        groups += [tuple(together)] if together else []
    return tuple(groups)


@dataclass(frozen=True)
class AmplitudeBands:
    """Natural frequency and equivalent damping over the amplitudes seen, with standard deviations."""

    curves: AmplitudeCurves
    frequency_std: np.ndarray  #: (A,)
    damping_ratio_std: np.ndarray  #: (A,)

    def quantities_at(self, amplitude: float) -> list[tuple[float, ...]]:
        """Frequency and damping ratio at an amplitude, rad: value, std, slope of its logarithm by the amplitude's."""
        size, found = self.curves.amplitude, []
        columns = (self.curves.frequency, self.frequency_std), (self.curves.damping_ratio, self.damping_ratio_std)
        for values, std in columns:
            slope = np.gradient(np.log(np.maximum(values, 1e-300)), np.log(size))
            found.append(tuple(float(np.interp(amplitude, size, each)) for each in (values, std, slope)))
        return found

    def at(self, amplitude: float) -> tuple[float, float, float, float]:
        """Natural period, s, damping ratio, and the standard deviation of each, at an amplitude, rad."""
        (frequency, frequency_std, _), (damping, damping_std, _) = self.quantities_at(amplitude)
        period = 2.0 * np.pi / frequency
        return period, damping, period * frequency_std / frequency, damping_std


def amplitude_bands(
    model: DecayModel, covariance: np.ndarray, amplitude: np.ndarray, posterior: HullPosterior | None = None
) -> AmplitudeBands:
    """Curves against amplitude (A,), rad, with standard deviations by the covariance (n, n) of the model's ratios.
    Those of a pruned hull come from the posterior of every term, about which its own curves are off by what was pruned.
    """

    def curves_of(ratios: np.ndarray):
        found = amplitude_curves(ratios, amplitude, model.friction_rate)
        return found, np.array([found.frequency, found.damping_ratio])

    curves, own = curves_of(model.ratios)
    known = posterior or HullPosterior(model.equation, model.ratios[model.equation.indices], covariance)
    complete = known.equation.complete(known.ratios)
    slopes = []
    for index, spread in zip(known.equation.indices, np.sqrt(np.diag(known.covariance)), strict=True):
        step = np.zeros(complete.size)
        step[index] = PERTURBATION * max(abs(complete[index]), spread) or PERTURBATION
        slopes.append((curves_of(complete + step)[1] - curves_of(complete - step)[1]) / (2 * step[index]))
    variance = np.einsum('ika,ij,jka->ka', slopes, known.covariance, slopes)
    return AmplitudeBands(curves, *np.hypot(np.sqrt(np.maximum(variance, 0.0)), curves_of(complete)[1] - own))


def release_error(model: DecayModel, posterior: HullPosterior, trim_std: float, start: float, scales: Scales) -> float:
    """Error of the next release, from ``start``, rad from trim, that posterior and trim leave, a share of its motion.
    `UPPER_PART` of hulls drawn from the posterior, without those of negative damping, are nearer to the model. A NaN
    ``trim_std``, rad, is ignored. Infinite where most hulls do not return, or the posterior is not finite.
    """
    _, motion = drawn_releases(model, posterior, trim_std, start, scales)
    if motion.shape[1] < 2:
        return float('inf')
    with np.errstate(over='ignore', invalid='ignore'):
        error = np.sqrt(np.mean((motion[:, :-1] - motion[:, -1:]) ** 2, axis=0) / np.mean(motion[:, -1] ** 2))
    return float(np.quantile(np.where(np.isfinite(error), error, np.inf), UPPER_PART, method='higher'))


def drawn_releases(
    model: DecayModel, posterior: HullPosterior, trim_std: float, start: float, scales: Scales
) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,), s, and angles (T, up to `DRAWS` + 1), rad from trim, of the next release; the model's last. The
    others are of hulls drawn from the posterior; arguments as of `release_error`.
    """
    active = tuple(a or b for a, b in zip(posterior.equation.active, model.equation.active, strict=True))
    hulls, trim = _drawn(posterior, active, model.friction_rate, scales.rate)
    trim = np.append(np.nan_to_num(trim_std) * trim[: hulls.shape[1]], 0.0)
    step = longest_step(model, start)
    steps = int(np.ceil(RELEASE_PERIODS * 2.0 * np.pi / scales.frequency / step))
    hulls, rest = np.column_stack([hulls, model.ratios]), np.zeros(trim.size)
    with np.errstate(over='ignore', invalid='ignore'):
        angles, *_ = runge_kutta_population(start - trim, rest, hulls, active, model.friction_rate, step, steps)
    return step * np.arange(len(angles)), angles + trim


def _drawn(posterior: HullPosterior, active: Sequence[bool], friction_rate: float, largest_rate: float):
    """Ratios (9, up to `DRAWS`) of a posterior, and as many standard normal values for the trim."""
    rng = np.random.default_rng(0)
    if not np.isfinite(posterior.covariance).all():
        return np.empty((len(TERM_NAMES), 0)), np.empty(0)
    # the covariance may be singular, and is badly scaled
    std = np.sqrt(np.diag(posterior.covariance))
    values, vectors = np.linalg.eigh(correlation(posterior.covariance))
    normal = rng.normal(size=(std.size, 10 * DRAWS))
    hulls = np.zeros((len(TERM_NAMES), normal.shape[1]))
    hulls[posterior.equation.indices] = posterior.ratios[:, None] + std[:, None] * (
        (vectors * np.sqrt(np.maximum(values, 0.0))) @ normal
    )
    rates = np.linspace(0.0, largest_rate, RATES)[1:, None]
    taken = damping_moment(rates, hulls[:, None, :], active, friction_rate)
    return hulls[:, (taken >= 0.0).all(axis=0)][:, :DRAWS], rng.normal(size=DRAWS)


ADEQUATE_ERROR = 0.1  #: Relative error of the next release up to which a model is adequate.
#: Share of its motion by which the next release of one craft differs, however well the last one was fitted: the third
#: repeats of FOSWEC's decays (3, 5 and 8.4 deg) are .037 to .040 off models of the first two.
REPEATABILITY = 0.03
LEAST_USABLE = 0.5  #: Least share of a record's rows that must be usable.
#: Least righting moment at the release over that of the linear stiffness; a craft that was moved has less.
LEAST_RIGHTING = 0.3
MAX_RATE_MISMATCH = 0.35  #: Of `rate_mismatch`: above, a unit, sign or delay is wrong.


@dataclass(frozen=True)
class Verdict(Judgement):
    """A judgement of a fit.

    Example:
        >>> verdict = identify([read_trial(records / 'kvlcc2_roll_decay.csv').axis('roll')]).verdict
        >>> verdict.level, verdict.motion_error < 0.05
        ('adequate', True)
    """

    #: Upper end (90 %) of the error of the next release, a share of its motion; may be infinite. The larger of both
    #: sides, or that of the records' side where the other one is above 0.1.
    motion_error: float

    @property
    def metrics(self) -> dict[str, Any]:
        """As model files hold it; None for an infinite error."""
        error = float(self.motion_error) if np.isfinite(self.motion_error) else None
        return {**super().metrics, 'motion_error': error}


@dataclass(frozen=True)
class Errors:
    """How far the next release may be off, shares of its motion."""

    uncertain: float  #: What posterior and trim leave, to either side, or where that is too much to its own.
    other_side: float  #: From an angle to the side without a release, or with the smaller ones.
    unexplained: float  #: What the fit leaves.
    missed: float = 0.0  #: What a forecast of the releases themselves from their measured starts misses of the fit.
    unseen: float = 0.0  #: `other_side` with `unseen_asymmetry`.

    @property
    def of_model(self) -> float:
        """What the model cannot follow."""
        return float(np.hypot(self.unexplained, self.missed))

    @property
    def total(self) -> float:
        """Of the next release."""
        return float(np.hypot(np.hypot(self.uncertain, self.of_model), REPEATABILITY))


def judge(found: DecayFit, objective: str) -> tuple[Verdict, tuple[Advice, ...]]:
    """The verdict on a fit, by its gravest warning, and the warnings that leave the verdict as it is."""
    same_side, other_side = posterior_errors(found)
    unseen = float(np.hypot(other_side, unseen_asymmetry(found)))
    unexplained = max(unexplained_share(found, quantity) for quantity in ('angle', 'rate'))
    missed = float(np.hypot(missed_share(found), smoothed_away(found)))
    errors = Errors(max(same_side, unseen), other_side, unexplained, missed, unseen)
    errors = errors if errors.total <= ADEQUATE_ERROR else replace(errors, uncertain=same_side)
    findings = list(warnings_of(found, objective, errors))
    causes = [each for each in findings if each[0] != ADEQUATE]
    good = ADEQUATE, Advice(ADEQUATE, _expected(found, errors))
    verdict = Verdict.by_gravest([*causes, good], errors.total)
    return verdict, tuple(advice for level, advice in findings if level == ADEQUATE and advice.code != verdict.code)


def _expected(found: DecayFit, errors: Errors) -> str:
    """What an adequate fit lets expect of the next release."""
    start, opposite = largest_releases(found)
    side, other = ', to either side,', ''
    if errors.unseen > errors.uncertain:
        own, away = sides(found)
        limit = angle_within_reach(found, errors.other_side)
        vanishing = (
            f', where its restoring moment vanishes at about {np.degrees(limit):.1f} deg' if limit is not None else ''
        )
        side, other = f' from a {own} angle', f' ({errors.other_side:.0%} from a {away} one{vanishing})'
        other = f' (a {away} one is unseen)' if errors.other_side <= ADEQUATE_ERROR else other
    elif opposite != -start:
        low, high = sorted(np.degrees([found.model.trim + start, found.model.trim + opposite]))
        side = f', from {low:.1f} to {high:.1f} deg,'
    ahead = f'the next release{side} should be forecast to within {errors.total:.1%} of its motion{other}'
    left = f'{errors.unexplained:.1%}' if errors.unexplained >= 0.0005 else 'less than 0.1%'
    return f'{ahead}; apart from white noise, the fit leaves {left} of the motion unexplained'


def warnings_of(found: DecayFit, objective: str, errors: Errors) -> Iterator[Finding]:
    """Every warning of a fit, first those that make the numbers wrong beyond doubt; NaN is a cause of each."""
    mismatch = max(rate_mismatch(r.motion, r.segment.period) for r in found.records)
    if not mismatch <= MAX_RATE_MISMATCH:
        yield REJECTED, Advice.of('angle-against-rate', mismatch=mismatch)
    cause = 'poor-fit'
    # the start is measured where a push or waves acted last; what dies away raises the decrement, as friction does
    if all(r.segment.beginning == 'pushed' for r in found.records):
        rising = 'still-forced: decrement' if 'b0' in found.model.terms else cause
        cause = 'still-forced' if errors.missed > errors.unexplained else rising
    poor_fit = found.disturbance or Advice.of(cause, left=min(errors.of_model, 1.0))
    if not errors.unexplained <= UNCERTAIN:
        yield REJECTED, poor_fit
    period = found.model.natural_period
    if not np.isfinite(period):
        yield REJECTED, Advice.of('no-period')
    elif not period <= LONGEST_PERIOD:
        yield REJECTED, Advice.of('implausible-period', period=period, longest=LONGEST_PERIOD)
    error = errors.total
    if not error <= ADEQUATE_ERROR:
        # with more, a forecast of rest is as good
        level = DOUBTFUL if error <= 1.0 else REJECTED
        size = f'by {error:.0%} of its motion' if error < 1.0 else 'by more than its motion'
        is_poor = errors.of_model >= errors.uncertain or poor_fit.code == 'still-forced'
        yield level, poor_fit if is_poor else Advice.of('motion-uncertain', size=size)
    usable = min(r.motion.usable_share for r in found.records)
    if not usable >= LEAST_USABLE:
        yield DOUBTFUL, Advice.of('few-samples', usable=usable)
    start, opposite = largest_releases(found)
    righting = -float(found.model.acceleration(found.model.trim + start, 0.0)) / start
    brief = any(r.segment.beginning == 'pushed' and r.segment.cycles < 1.0 for r in found.records)
    # a hull that softens accelerates little at first, too, but swings for several cycles with the period it is given
    few = all(r.segment.cycles < MIN_CYCLES for r in found.records)
    ratio = period * found.problem.scales.frequency / (2.0 * np.pi)
    odd = few or not 1.0 / ASYMMETRY < ratio < ASYMMETRY
    if brief or (odd and not righting >= LEAST_RIGHTING * found.model.natural_frequency**2):
        seen = 'less than one oscillation was recorded' if brief else 'it hardly accelerated at first'
        yield DOUBTFUL, Advice.of('no-release', seen=seen)
    absent, equation = found.absent_term, found.model.equation.name
    if absent is not None:
        yield DOUBTFUL, Advice.of('absent-term', equation=equation, term=absent.name, stds=absent.significance)
    yield from _one_sided(found, errors.other_side)
    for advice in found.problem.advice:
        # which damping terms few cycles show has been decided where the hull was pruned
        if found.posterior is None or advice.code != 'too-few-cycles':
            yield ADEQUATE, advice
    if found.disturbance is not None:
        yield ADEQUATE, found.disturbance
    if objective == 'one-step':
        yield ADEQUATE, Advice.of('one-step-biased')


def _one_sided(found: DecayFit, other_side: float) -> Iterator[Finding]:
    """Whether the motion from angles to the other side is forecast too."""
    start, opposite = largest_releases(found)
    # an adequate forecast may be off by this share of its motion, and one to a side without a release is not checked
    unseen = opposite == -start or other_side > ADEQUATE_ERROR
    is_lost = unseen and angle_within_reach(found, ADEQUATE_ERROR) is not None
    if is_lost or not other_side <= UNCERTAIN:
        size = f' by {other_side:.0%} of its motion' if other_side < 1.0 else ''
        limit, (_, away) = angle_within_reach(found, max(other_side, ADEQUATE_ERROR)), sides(found)
        vanishing = None if limit is None else Advice.of('one-sided: vanishing', side=away, angle=np.degrees(limit))
        yield DOUBTFUL, vanishing or Advice.of('one-sided', side=away, size=size)


def sides(found: DecayFit) -> tuple[str, str]:
    """From which angles the largest release began, and those of the other side, in words."""
    return ('positive', 'negative') if largest_releases(found)[0] > 0.0 else ('negative', 'positive')


def largest_releases(found: DecayFit) -> tuple[float, float]:
    """The largest fitted angle, rad from trim, on the side on which the largest release began, and the largest release
    from the other side; the same angle where none was. A hull that is softer there swings further than it was inclined.
    """
    begun = [float(r.state.x) for r in found.records]
    side = float(np.sign(max(begun, key=abs)))
    start = side * max(float(np.max(side * (r.angle - r.state.trim))) for r in found.records)
    return start, max((x for x in begun if x * start < 0.0), key=abs, default=-start)


def angle_within_reach(found: DecayFit, error: float) -> float | None:
    """Angle, rad, at which the restoring moment vanishes to the other side, if a release may come there. Its motion is
    forecast with an error of this share. None where it does not come that far, or the record does not show the moment
    there.
    """
    _, opposite = largest_releases(found)
    limit = vanishing_angle(found.model, opposite)
    if not abs(limit) <= (1.0 + error) * abs(opposite):
        return None
    # the nonlinear terms cancel the linear moment there, which shows only if the record knows them that well
    slopes = term_moments(limit, 0.0, found.model.friction_rate)[found.model.equation.indices]
    known = abs(limit) * found.model.natural_frequency**2 > TWO_STD * np.sqrt(slopes @ found.covariance @ slopes)
    return found.model.trim + limit if known else None


def vanishing_angle(model: DecayModel, side: float) -> float:
    """Where the restoring moment vanishes, rad from trim, to the side of this sign; NaN where it does not by 90 deg."""
    angles = np.copysign(np.radians(np.arange(0.1, 90.0, 0.1)), side)
    lost = angles[model.acceleration(model.trim + angles, 0.0) * angles >= 0.0]
    return float(lost[0]) if lost.size else float('nan')


def posterior_errors(found: DecayFit) -> tuple[float, float]:
    """The `release_error` of a fit from each of the `largest_releases`."""
    model, scales = found.model, found.problem.scales
    own = HullPosterior(model.equation, model.ratios[model.equation.indices], found.covariance)
    same, other = (
        release_error(model, found.posterior or own, found.trim_std, start, scales) for start in largest_releases(found)
    )
    return same, other


def unseen_asymmetry(found: DecayFit) -> float:
    """How much the model's releases to both sides differ where only one was recorded: fluid memory looks like that."""
    start, opposite = largest_releases(found)
    if opposite != -start:
        return 0.0
    periods = np.arange(0.0, RELEASE_PERIODS, 1.0 / SEARCH_STEPS_PER_PERIOD)
    times = periods * 2.0 * np.pi / found.problem.scales.frequency
    with np.errstate(over='ignore', invalid='ignore'):
        own, other = (simulate(found.model.with_trim(0.0), side, 0.0, times)[0] for side in (start, -start))
        share = np.sqrt(np.mean((own + other) ** 2) / np.mean(own**2))
    return float(np.nan_to_num(share, nan=np.inf))


def missed_share(found: DecayFit) -> float:
    """Miss of the next `RELEASE_PERIODS` as forecast from the measured starts, over the motion. A fit moves its start
    to hide what its equation cannot represent. The parabola that measures a start is drawn through the residuals, so
    the fit's own curvature does not bend it. How far the parabolas through the later half lie from zero is its
    uncertainty: its effect is subtracted, and a miss within three standard deviations of it is none. Zero where no
    angle was measured.
    """
    problem, records = found.problem, [r for r in found.records if r.motion.angle is not None]
    if not records:
        return 0.0
    period = 2.0 * np.pi / problem.scales.frequency
    offsets = [_state_offsets(r, problem.noise) for r in records]
    parts, states = zip(*(_from_start(r, period) for r in records), strict=True)
    fit = motion_fit(problem, found.model.equation, parts)

    def motion_of(moves: Iterable[np.ndarray]) -> np.ndarray:
        moved = [replace(s, x=s.x + m[0], rate=s.rate + m[1]) for s, m in zip(states, moves, strict=True)]
        return np.concatenate([angle for angle, _ in fit.simulated(fit.pack(found.model.ratios, moved))])

    still = np.zeros((len(records), 2))
    fitted, trims = motion_of(still), np.repeat([s.trim for s in states], [m.size for m in parts])
    roots = np.stack([still, still])
    for place, each in enumerate(offsets):
        later = each[len(each) // 2 + 1 :]
        root = np.linalg.qr(later, mode='r') / np.sqrt(max(len(later), 1))
        roots[: len(root), place] = root
    starts = [each[min(_first_clear(r), len(each) - 1)] for r, each in zip(records, offsets, strict=True)]
    missed, *by_chance = (float(np.sum((motion_of(moves) - fitted) ** 2)) for moves in (starts, *roots))
    # each record has a start, so two standard deviations are often exceeded; a start whose uncertainty makes the motion
    # run away shows nothing either
    chance = float(np.nan_to_num(sum(by_chance), nan=np.inf))
    excess = missed - chance if not missed <= THREE_STD**2 * chance else 0.0
    share = float(np.sqrt(excess / np.sum((fitted - trims) ** 2)))
    return share if np.isfinite(share) else np.inf


def smoothed_away(found: DecayFit) -> float:
    """How much the next release differs if a filter made the motion smaller than the craft's by as much as it begins
    smaller after a smoothed release than the hull from the held angle: nonlinear terms change with the size.
    """
    model, period, shares = found.model.with_trim(0.0), 2.0 * np.pi / found.problem.scales.frequency, [0.0]
    times = period * np.arange(0.0, RELEASE_PERIODS, 1.0 / SEARCH_STEPS_PER_PERIOD)
    for record in (each for each in found.records if each.segment.beginning == 'smoothed'):
        held = float(np.copysign(record.segment.initial_amplitude, -record.state.x))
        first = record.motion.time <= record.motion.time[0] + 0.5 * period
        with np.errstate(all='ignore'):
            own, _ = simulate(model, held, 0.0, times)
            gain = np.abs(record.angle[first] - record.state.trim).max() / np.max(-np.sign(held) * own)
            smaller, _ = simulate(model, gain * held, 0.0, times)
            shares.append(float(np.linalg.norm(smaller / gain - own) / np.linalg.norm(own)))
    return float(np.nan_to_num(max(shares), nan=np.inf))


def _first_clear(record: RecordFit) -> int:
    """Which first look shows free motion only: where no release was seen, the first may hold what remains of it."""
    return 0 if record.segment.beginning == 'released' else 1


def _look_size(record: RecordFit) -> int:
    elapsed = record.motion.time - record.motion.time[0]
    return max(4, int(np.searchsorted(elapsed, FIRST_LOOK_PERIODS * record.segment.period)))


def _from_start(record: RecordFit, period: float) -> tuple[AxisMotion, InitialState]:
    """The `RELEASE_PERIODS` that begin with the first clear look, and the fitted state there."""
    begin = min(_first_clear(record) * _look_size(record), record.motion.size - 1)
    start = float(record.motion.time[begin])
    state = replace(record.state, x=float(record.angle[begin]) - record.state.trim, rate=float(record.rate[begin]))
    return record.motion.between(start, start + RELEASE_PERIODS * period), state


def _state_offsets(record: RecordFit, noise: Noise) -> np.ndarray:
    """Offsets of angle and rate from the fit, (K, 2), as each `FIRST_LOOK_PERIODS` of a record measures them."""
    motion, size = record.motion, _look_size(record)
    angle, rate = motion.angle - record.angle, None if motion.rate is None else motion.rate - record.rate
    found = []
    for begin in range(0, max(motion.size - size, 0) + 1, size):
        inside = slice(begin, begin + size)
        own = None if rate is None else rate[inside] - rate.mean()
        offsets, _ = parabola_through(motion.time[inside] - motion.time[begin], angle[inside], own, noise)
        found.append(offsets[:2])
    return np.array(found)


def unexplained_share(found: DecayFit, quantity: str) -> float:
    """Residual of angle or rate that is not white noise, over the motion; zero where not measured. From the products of
    neighbouring residuals, in which white noise has no part, less what chance leaves. A gyro's bias is no motion.
    """
    error = motion = 0.0
    for record in found.records:
        measured = getattr(record.motion, quantity)
        if measured is not None:
            residual = measured - getattr(record, quantity)
            residual = residual - (residual.mean() if quantity == 'rate' else 0.0)
            lags = max(1, round(record.segment.period / SEARCH_STEPS_PER_PERIOD / record.motion.sample_interval))
            products = [float(np.mean(residual[lag:] * residual[:-lag])) for lag in range(1, lags + 1)]
            chance = TWO_STD * float(np.mean(residual**2)) / np.sqrt(lags * residual.size)
            error += residual.size * (float(np.mean(products)) - chance)
            motion += float(np.sum((measured - measured.mean()) ** 2))
    return float(np.sqrt(max(error, 0.0) / motion)) if motion > 0.0 else 0.0


def rate_mismatch(motion: AxisMotion, period: float) -> float:
    """Difference of the rate and the angle's slope over a sixth of a period that is in phase with the motion or a
    quarter period off, over the rate, in the band of the motion; zero without both. What is in neither is noise. The
    contribution of an uncalibrated gyroscope's offset is subtracted.
    """
    span = max(1, round(period / 6.0 / motion.sample_interval))
    if motion.angle is None or motion.rate is None or motion.size < 8 * span:
        return 0.0
    before, after = slice(None, -span), slice(span, None)
    elapsed, integral = motion.time[after] - motion.time[before], running_integral(motion.rate, motion.time)
    slope, rate = ((each[after] - each[before]) / elapsed for each in (motion.angle, integral))
    early = np.pi / period * (motion.angle[after] + motion.angle[before])
    apart, spread = slope - rate, max(float(np.std(rate)), 1e-12)
    # a heel or a gyroscope's offset that changes slowly accuses no unit
    *moved, off = (each - scipy.ndimage.uniform_filter1d(each, 6 * span) for each in (rate, early, apart))
    shares = np.linalg.lstsq(np.column_stack(moved), off, rcond=None)[0]
    offset = max(abs(float(apart.mean())) - MAX_OFFSET, 0.0) / spread
    return float(np.linalg.norm([*shares, offset]))
