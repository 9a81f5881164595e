"""The identification problem: the free decays of records, and first estimates from them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri, stdtrit

from swath_sysid.attitude.hull.catalogue import GENERAL_HULL
from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.terms import AT, LOWER, UPPER, Scales, term_moments
from swath_sysid.attitude.identification.motion_fit import (
    SEARCH_STEPS_PER_PERIOD,
    STARTING_TOLERANCE,
    InitialState,
    MotionFit,
    Noise,
)
from swath_sysid.attitude.motion.decay_candidates import HOLD_BAND, REST_BAND
from swath_sysid.attitude.motion.quality import MIN_CYCLES, check_decay, without_spikes
from swath_sysid.attitude.motion.rate_comparison import aligned
from swath_sysid.attitude.motion.segmentation import ASYMMETRY, FORCED_MOTION, DecaySegment, decays_or_absence
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import CONFIDENCE, THREE_STD
from swath_sysid.common.covariance import ParameterCovariance, sandwich_covariance
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import bin_means, running_integral, weighting_noise

#: Samples per period to which much denser records are averaged, at an error below 1e-5 of the amplitude.
AVERAGED = 400

LONGEST_AFTERMATH = 10.0  #: Periods after a decay that are used.

FIRST_LOOK_PERIODS = 0.12  #: Share of a period that the initial state is estimated from.

ALIKE = 1.5  #: Ratio by which the periods of releases of one craft differ at most: restoring bends them by less.

PROMPT = 0.9  #: Of the hull's own acceleration; a craft that comes to less at first is not free yet.

#: With fewer cycles the frequency is that of the first return to the trim, over twice the time to this share of
#: the angle, if the record can show it.
FEW_CYCLES, RETURNED = 3.0, 0.2


@dataclass(frozen=True)
class Problem:
    """Free decays ready to be fitted; the same for every equation."""

    axis: str
    motions: tuple[AxisMotion, ...]  #: Cut to their free decays.
    segments: tuple[DecaySegment, ...]
    #: From the release to the end of undisturbed motion, which shows how still the basin is.
    observed: tuple[AxisMotion, ...]
    states: tuple[InitialState, ...]  #: First estimates.
    scales: Scales
    noise: Noise
    friction_rate: float  #: rad/s.
    advice: tuple[Advice, ...]  #: What the quality gates found.

    @property
    def shortest_memory(self) -> int:
        """Samples in a quarter of a natural period: the least over which residuals may be correlated."""
        return max(5, round(0.5 * np.pi / self.scales.frequency / self.motions[0].sample_interval))

    @property
    def own_motion(self) -> list[np.ndarray]:
        """Autocorrelation (N_k,) of the motion after a disturbance, for each record and channel: the craft's decay. It
        is taken to fall to 1/e within the record at least: a record shows nothing that lasts longer.
        """
        found = []
        for motion, segment in zip(self.motions, self.segments, strict=True):
            elapsed = np.arange(motion.size) * motion.sample_interval
            decay = max(1.0, np.log(segment.initial_amplitude / segment.final_amplitude)) / motion.duration
            own = np.exp(-decay * elapsed) * np.cos(self.scales.frequency * elapsed)
            found += [own for channel in (motion.angle, motion.rate) if channel is not None]
        return found

    @property
    def weighted(self) -> list[np.ndarray]:
        """Each measured channel, weighted as its residuals are."""
        angles = [m.angle / self.noise.angle for m in self.motions if m.angle is not None]
        return angles + [m.rate / self.noise.rate for m in self.motions if m.rate is not None]

    @property
    def decayed_to(self) -> float:
        """The last amplitude of the record that decays least, over the first."""
        unit = self.scales.rate if self.motions[0].angle is None else self.scales.amplitude
        return min(1.0, max(s.final_amplitude for s in self.segments) / unit)

    @property
    def amplitudes_seen(self) -> tuple[float, float]:
        """Smallest and largest amplitude of the records, rad."""
        last = min(s.final_amplitude for s in self.segments)
        if self.motions[0].angle is None:
            last = last / self.scales.frequency
        return min(last, 0.9 * self.scales.amplitude), self.scales.amplitude

    def until(self, periods: float) -> tuple[AxisMotion, ...]:
        """The records' first part, ``periods`` natural periods long; states as they are."""
        limit = periods * 2.0 * np.pi / self.scales.frequency
        return tuple(m.between(None, m.time[0] + limit) for m in self.motions)


def prepare(
    motions: Sequence[AxisMotion], start: float | None = None, end: float | None = None, is_decay: bool = False
) -> Problem:
    """Find the free decays of one axis, unless bounded by ``start`` and ``end``, s, and first estimates. With
    ``is_decay`` no oscillation that shrinks is taken for waves. Raises `InputError` without a record, with different
    axes, or without a free decay in a record.
    """
    motions = [aligned(m) for m in motions]
    return _joint_problem(motions, [decays_or_absence(m, start, end, is_decay) for m in motions])


def decays_or_waves(motions: Sequence[AxisMotion]) -> Problem | None:
    """As `prepare`, but None where no record holds a free decay and all oscillate from start to end."""
    motions = [aligned(m) for m in motions]
    found = [decays_or_absence(m) for m in motions]
    if all(isinstance(each, Advice) and each.code == FORCED_MOTION for each in found) and found:
        return None
    return _joint_problem(motions, found)


def _joint_problem(motions: Sequence[AxisMotion], found: Sequence[tuple[DecaySegment, ...] | Advice]) -> Problem:
    """One problem of all the decays to be fitted that were found in each record."""
    decays: list[tuple[AxisMotion, DecaySegment]] = []
    for motion, each in zip(motions, found, strict=True):
        if isinstance(each, Advice):
            raise InputError(each.message, each.code)
        decays += [(before_the_next(motion, segment, each), segment) for segment in to_be_fitted(each)]
    return problem_of([motion for motion, _ in decays], tuple(segment for _, segment in decays))


def to_be_fitted(decays: Sequence[DecaySegment]) -> tuple[DecaySegment, ...]:
    """Of the decays of one record, the best first: that one, and the others released, by time. Their periods agree, and
    they are long enough, or even the best is not. The best has a warning of others released with another period.
    """
    if not decays:
        return ()
    best = decays[0]
    is_short = best.cycles < MIN_CYCLES
    unlike = ASYMMETRY if is_short else ALIKE

    # a release too brief for a fit says nothing of the period either
    long = [s for s in decays if s.beginning == 'released' and (s.cycles >= MIN_CYCLES or is_short) and s is not best]
    alike = [s for s in long if 1.0 / unlike < s.period / best.period < unlike]
    left_out = ', '.join(
        f'{s.period:.3g} s from {s.start:.1f} s on' for s in sorted(long, key=lambda s: s.start) if s not in alike
    )
    if left_out:
        warning = Advice.of('unlike-releases', period=best.period, releases=left_out)
        best = replace(best, advice=(*best.advice, warning))
    return tuple(sorted([best, *alike], key=lambda decay: decay.start))


def problem_of(motions: Sequence[AxisMotion], segments: tuple[DecaySegment, ...]) -> Problem:
    """As `prepare`, on decays found before: one segment for each record."""
    if not motions:
        raise InputError('give at least one trial')
    axes = {m.axis for m in motions}
    if len(axes) > 1:
        raise InputError(f'the records are of different axes ({", ".join(sorted(axes))}): identify one axis at a time')
    advice = [a for m, s in zip(motions, segments, strict=True) for a in (*s.advice, *check_decay(m, s))]
    if lag := max((m.lag for m in motions), key=abs):
        late, share = 'rate' if lag > 0.0 else 'angle', abs(lag) / segments[0].period
        advice.append(Advice.of('late-channel', axis=motions[0].axis, late=late, lag=abs(lag), share=share))
    cut = tuple(
        block_means(without_spikes(m.between(s.start, s.end)), s.period, AVERAGED)
        for m, s in zip(motions, segments, strict=True)
    )
    frequency = float(np.median([_frequency(m, s) for m, s in zip(cut, segments, strict=True)]))
    noise = Noise(
        angle=weighting_noise([m.angle for m in cut if m.angle is not None] or [np.zeros(1)]),
        rate=weighting_noise([m.rate for m in cut if m.rate is not None] or [np.zeros(1)]),
    )
    states = tuple(_initial_state(m, s, noise) for m, s in zip(cut, segments, strict=True))
    amplitude = max(_amplitude(m, s, frequency) for m, s in zip(cut, states, strict=True))
    scales = Scales(amplitude, frequency)
    problem = Problem(
        axis=motions[0].axis,
        motions=cut,
        segments=segments,
        observed=tuple(
            without_spikes(m.between(s.start, _left_alone_until(m, s))) for m, s in zip(motions, segments, strict=True)
        ),
        states=states,
        scales=scales,
        noise=noise,
        friction_rate=scales.friction_rate,
        advice=tuple(dict.fromkeys(advice)),
    )
    free = tuple(_once_free(problem))
    return problem if free == segments else problem_of(motions, free)


def _once_free(problem: Problem) -> Iterator[DecaySegment]:
    """The decays, without the first half-cycle of a release that a filter of the sensor, or the hand, has smoothed."""
    for motion, segment, state in zip(problem.motions, problem.segments, problem.states, strict=True):
        is_long = segment.beginning in ('released', 'smoothed') and segment.cycles >= FEW_CYCLES + 0.5
        if is_long and motion.angle is not None and _is_smoothed(problem, motion, segment, state.trim):
            # what goes on for longer is a hand's
            beginning = 'smoothed' if segment.beginning == 'released' else 'pushed'
            warning = Advice.of('smoothed-release', axis=problem.axis, start=segment.start)
            segment = replace(
                segment,
                start=segment.start + 0.5 * segment.period,
                cycles=segment.cycles - 0.5,
                beginning=beginning,
                advice=(*segment.advice, warning),
            )
        yield segment


def _is_smoothed(problem: Problem, motion: AxisMotion, segment: DecaySegment, trim: float) -> bool:
    """Whether the craft accelerates less at first than the hull that is fitted to what follows would. However much the
    equation lacks, a craft that is let go follows its righting moment at once: what lags behind it is held or filtered.
    """
    # the craft may be let go between two samples
    period, begin, noise = segment.period, float(motion.time[1]), problem.noise
    look = _look(motion, begin, (0.0, 1.0), period, noise)
    if look is None:
        return False
    (angle, rate, acceleration), (*_, std) = look
    towards, stiffness = np.sign(trim - angle), (2.0 * np.pi / period) ** 2
    linear = stiffness * abs(trim - angle)
    if towards * acceleration >= PROMPT * linear:
        return False
    later = motion.between(begin + 0.5 * period, begin + (0.5 + 2.0 * FEW_CYCLES) * period)
    later = block_means(later, period, SEARCH_STEPS_PER_PERIOD)
    own, own_std, left, centre = _acceleration_of_hull(problem, later, segment, angle, rate)
    due = min(towards * own, linear)
    short = due - towards * acceleration
    # waves accelerate the craft by about as much as they move it in a period
    others = max(left, 1.0) * np.hypot(std, stiffness * noise.angle)
    chance = THREE_STD * np.hypot(own_std, others)
    # a hull may be softer at angles that it does not reach later, but then its acceleration does not grow on the way
    early, late = (_look(motion, begin, part, period, noise) for part in ((0.0, 0.5), (0.5, 1.0)))
    growth, doubt = (late[0] - early[0], np.hypot(late[1], early[1])) if early and late else (np.zeros(3), np.ones(3))
    is_growing = towards * growth[2] > THREE_STD * doubt[2]
    unknown = 0.0 if is_growing else 1.0 - np.abs(later.primary - centre).max() / abs(trim - angle)
    return bool(short > (1.0 - PROMPT + max(unknown, 0.0)) * due and short > chance)


def _acceleration_of_hull(problem: Problem, motion: AxisMotion, segment: DecaySegment, angle: float, rate: float):
    """At an angle and rate, of the general hull fitted to a motion: the acceleration, its standard deviation, what the
    fit leaves over the noise, and its trim.
    """
    fit, terms = motion_fit(problem, GENERAL_HULL, [motion]), GENERAL_HULL.indices
    ratios = np.zeros(len(LOWER))
    ratios[AT.r1] = (2.0 * np.pi / segment.period) ** 2
    start = fit.pack(ratios, [_initial_state(motion, segment, problem.noise)])
    parameters, left = fit.refine(start, LOWER[terms], UPPER[terms], STARTING_TOLERANCE)
    covariance = sandwich_covariance(*fit.residuals_and_jacobian(parameters), SEARCH_STEPS_PER_PERIOD // 4).matrix
    _, (state,) = fit.unpack(parameters)
    effects = -term_moments(angle - state.trim, rate, problem.friction_rate)[terms] * problem.scales.ratio_units[terms]
    effects = np.r_[effects, np.zeros(parameters.size - terms.size)]
    return float(effects @ parameters), float(np.sqrt(effects @ covariance @ effects)), left, state.trim


def _look(motion: AxisMotion, since: float, part: tuple[float, float], period: float, noise: Noise):
    """The parabola in the middle of a part of the first look, shares of `FIRST_LOOK_PERIODS`; None without samples."""
    begin, end = (since + share * FIRST_LOOK_PERIODS * period for share in part)
    inside = motion.between(begin, end)
    middle = inside.time - 0.5 * (begin + end)
    return parabola_through(middle, inside.primary, inside.rate, noise) if inside.size >= 4 else None


def needed_part(motion: AxisMotion, segment: DecaySegment) -> AxisMotion:
    """The part of a record that `problem_of` uses: the decay and what follows it, no denser than a fit needs."""
    end = segment.end + LONGEST_AFTERMATH * segment.period
    return block_means(motion.between(segment.start, end), segment.period, AVERAGED)


def before_the_next(motion: AxisMotion, segment: DecaySegment, decays: Sequence[DecaySegment]) -> AxisMotion:
    """The record, up to the end of a decay that another follows: a hand moves the craft before it releases it again."""
    later = segment.end + LONGEST_AFTERMATH * segment.period
    is_followed = any(segment.end <= other.start < later for other in decays)
    return motion.between(None, segment.end) if is_followed else motion


def _left_alone_until(motion: AxisMotion, segment: DecaySegment):
    """End of the undisturbed motion after a decay, s; the decay's own end where it was given or stopped."""
    if segment.ending not in ('noise-floor', 'faded', 'disturbed') or motion.angle is None:
        return segment.end
    after = motion.between(segment.end, segment.end + LONGEST_AFTERMATH * segment.period)
    if after.size < 8:
        return segment.end
    later = after.primary[after.size // 2 :]
    # waves keep the craft moving by more than that, peak to peak; a hand stops it
    if segment.ending == 'disturbed' and np.ptp(later) < HOLD_BAND * segment.final_amplitude:
        return segment.end
    # what is louder than that is pushed again
    limit = max(HOLD_BAND * segment.initial_amplitude, 1.5 * segment.final_amplitude)
    loud = np.flatnonzero(np.abs(after.primary - segment.trim) > limit)
    end = float(after.time[loud[0]]) - segment.period if loud.size else float(after.time[-1])
    return max(segment.end, min(end, _held_from(motion, segment, float(after.time[-1]))))


def _held_from(motion: AxisMotion, segment: DecaySegment, end: float) -> float:
    """A period, in which a hand moves the craft, before it holds it away from its trim, s; infinite where none does
    until ``end``. A free craft, in waves too, crosses its trim every half period.
    """
    after = motion.between(segment.end - 0.5 * segment.period, end)
    away = after.primary - segment.trim
    least = max(HOLD_BAND * segment.final_amplitude, REST_BAND * segment.initial_amplitude)
    side = np.where(np.abs(away) > least, np.sign(away), 0.0)
    turns = np.flatnonzero(np.diff(side, prepend=np.nan, append=np.nan) != 0.0)
    first, last = turns[:-1], turns[1:] - 1
    held = first[(side[first] != 0.0) & (after.time[last] - after.time[first] > 0.75 * segment.period)]
    return float(after.time[held[0]]) - segment.period if held.size else np.inf


def block_means(motion: AxisMotion, period: float, blocks: int) -> AxisMotion:
    """Means over a period (s) in ``blocks``, the first sample kept; the record itself where it is hardly denser."""
    if motion.sample_interval * blocks > 0.5 * period:
        return motion
    block = 1 + np.floor((motion.time - motion.time[0]) * blocks / period).astype(int)
    block[0] = 0

    def mean(values: np.ndarray | None):
        return None if values is None else bin_means(block, values)[1]

    return replace(motion, time=mean(motion.time), angle=mean(motion.angle), rate=mean(motion.rate))


def _amplitude(motion: AxisMotion, state: InitialState, frequency: float):
    if motion.angle is not None:
        return float(np.abs(motion.angle - state.trim).max())
    return float(np.abs(motion.primary).max()) / frequency


def _initial_state(motion: AxisMotion, segment: DecaySegment, noise: Noise):
    """Local parabola through the first samples: angle and rate share its coefficients."""
    elapsed = motion.time - motion.time[0]
    first = elapsed <= FIRST_LOOK_PERIODS * segment.period
    first[:4] = True
    t = elapsed[first]
    if motion.angle is None:
        slope, rate = np.polyfit(t, motion.primary[first], 1)
        return InitialState(_angle_from_rate(motion, segment), float(rate), 0.0)
    trim = float(segment.trim)
    rates = None if motion.rate is None else motion.rate[first]
    (x, rate, _), _ = parabola_through(t, motion.angle[first] - trim, rates, noise)
    return InitialState(float(x), float(rate), trim)


def parabola_through(
    elapsed: np.ndarray, angle: np.ndarray, rate: np.ndarray | None, noise: Noise
) -> tuple[np.ndarray, np.ndarray]:
    """Value, slope and curvature of a parabola through angles (N,), and rates if measured, ``elapsed`` s after the time
    they are for, and their standard deviations.
    """
    one, zero = np.ones(elapsed.size), np.zeros(elapsed.size)
    rows = np.column_stack([one, elapsed, elapsed * elapsed / 2]) / noise.angle
    right = angle / noise.angle
    if rate is not None:
        rows = np.concatenate([rows, np.column_stack([zero, one, elapsed]) / noise.rate])
        right = np.concatenate([right, rate / noise.rate])
    inverse = np.linalg.pinv(rows)
    return inverse @ right, np.linalg.norm(inverse, axis=1)


def _frequency(motion: AxisMotion, segment: DecaySegment):
    """Natural frequency to scale by, rad/s: of the oscillation or, with few cycles, of the first return to the trim.
    The return obeys the integrated linear equation, rate = -b1 angle - r1 (integral of the angle) + a + b t, which is
    free of gyro bias and trim; later oscillations of a strongly damped craft are mostly the basin's.
    """
    frequency = 2.0 * np.pi / segment.period
    if segment.cycles >= FEW_CYCLES or motion.angle is None or motion.rate is None:
        return frequency
    away = np.abs(motion.angle - segment.trim)
    returned = motion.time[np.argmax(away < RETURNED * away[0])] - motion.time[0]
    elapsed = motion.time - motion.time[0]
    first = elapsed <= max(2.0 * returned, 8.0 * motion.sample_interval)
    elapsed, angle = elapsed[first], motion.angle[first]
    integral = running_integral(angle, elapsed)
    rows = np.column_stack([-integral, -angle, np.ones(angle.size), elapsed])
    stiffness = np.linalg.lstsq(rows, motion.rate[first], rcond=None)[0][0]
    found = float(np.sqrt(max(stiffness, 0.0)))
    return found if np.pi / motion.duration < found < np.pi / motion.sample_interval else frequency


def _angle_from_rate(motion: AxisMotion, segment: DecaySegment):
    """Initial angle from trim: the integral of the rate has come to rest in the last whole periods."""
    assert motion.rate is not None, 'without an angle there is a rate'
    angle = running_integral(motion.rate, motion.time)
    whole = max(1, int(motion.duration / segment.period) // 2)
    last = motion.time >= motion.time[-1] - whole * segment.period
    return -float(angle[last].mean())


def motion_fit(
    problem: Problem, equation: Equation, motions: Sequence[AxisMotion] | None = None, **options
) -> MotionFit:
    """The simulation objective of an equation on a problem's records, or on parts of them."""
    return MotionFit(
        problem.motions if motions is None else motions,
        equation,
        problem.scales,
        problem.noise,
        problem.friction_rate,
        **options,
    )


def residual_covariance(problem: Problem, fit: MotionFit, parameters: np.ndarray) -> ParameterCovariance:
    """Covariance of least-squares parameters, dimensionless, by the residuals they leave. A disturbance makes the craft
    oscillate at its natural frequency for as long as its decay lasts. The fit absorbs most of this motion, so the
    residuals alone understate it. Where angle and rate were measured, the likelihood of a basin that moves allows for
    it.
    """
    found = fit.residuals_and_jacobian(parameters)
    if all(m.angle is not None and m.rate is not None for m in problem.motions):
        return sandwich_covariance(*found, problem.shortest_memory)
    lasting = sandwich_covariance(*found, problem.shortest_memory, problem.own_motion)
    # few independent samples tell little of the noise itself (Student 1908)
    wider = stdtrit(lasting.effective_samples, 0.5 * (1.0 + CONFIDENCE)) / ndtri(0.5 * (1.0 + CONFIDENCE))
    return replace(lasting, matrix=wider**2 * lasting.matrix)
