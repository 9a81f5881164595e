"""The guided bring-up of a craft: from what is known now to the next step, and to the cure of what is wrong.

Time is the stamps of the motion, so that the same record is guided alike at any speed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.uncertainty import amplitude_bands
from swath_sysid.attitude.motion.segmentation import explain_absence, find_decays
from swath_sysid.attitude.motion.trial import AXES, AxisMotion
from swath_sysid.common.signals import bin_means, noise_level
from swath_sysid.pipeline.health import ERROR, OK, Report

CONNECT, SENSOR, REST, PUSH, DECAY, IDENTIFY, JUDGE, KEPT = STEPS = (
    'connect',
    'sensor',
    'rest',
    'push',
    'decay',
    'identify',
    'judge',
    'kept',
)

NODES = ('imu_buffer', 'predictor', 'identifier')

LOWEST_RATE = 8.0  #: Hz; craft roll in 1 s and more, and a period needs some ten samples.

REST_S = 6.0
LONGEST_UNREST = 20.0  #: s without rest after which the water is named.

SETTLED_S = 3.0
BLOCK_S = 0.5  #: s; rest is judged by means over so long, in which the noise of a sensor is averaged out.
STILL = float(np.radians(0.4))  #: Peak to peak of such means at rest.

MOVED = float(np.radians(0.7))
SWUNG = float(np.radians(0.25))
#: Motion begins beyond the first, a swing counts beyond the second, and both beyond so many standard deviations of the
#: noise.
NOISES = 6.0

LONGEST_GAP = 1.0  #: s without a sample, after which cycles cannot be counted.

#: The buffer publishes no decay from below 1 deg by itself; the first swing after a push is smaller than the push.
SMALLEST_PUSH = float(np.radians(1.5))

FADED = 0.06  #: Part of the first amplitude at which a decay has ended.

LONGEST_HOLD = 15.0
LONGEST_DECAY = 40.0
STEADY = 0.5  #: Motion of which the last third is larger than this part of the first third is kept up by something.

MIN_CYCLES = 1.0
PATIENCE_S = 10.0  #: s from the end of a decay within which the buffer has noticed it.

#: Relative uncertainty (two standard deviations) of the damping above which another release is advised.
POOR_DAMPING = 0.1


@dataclass(frozen=True)
class Facts:
    """What is known now."""

    #: Fresh diagnostics by ``NODE: NAME``; values as texts.
    statuses: Mapping[str, Report] = field(default_factory=dict)
    silence: float = float('inf')  #: s since the newest sample came; infinite before the first.
    motions: Mapping[str, AxisMotion] = field(default_factory=dict)  #: The last minute, by axis.
    model: IdentifiedModel | None = None  #: Of the axis to be identified.
    models_received: int = 0
    is_kept: bool = False  #: Whether the user has accepted the model.

    def value(self, status: str, name: str) -> float:
        """A number of a status; zero where it is not there."""
        report = self.statuses.get(status)
        try:
            return float(str(report.values[name])) if report else 0.0
        except (KeyError, ValueError):
            return 0.0


@dataclass(frozen=True)
class Guidance:
    """Where the bring-up stands."""

    step: str  #: One of `STEPS`.
    sentence: str  #: What goes on, or what to do.
    fault: str = ''  #: Code of what is wrong; empty where nothing is.
    cure: str = ''  #: What to do about it.


@dataclass(frozen=True)
class _Motion:
    """What an axis has done since the craft was last at rest."""

    peak: float = 0.0
    half_cycles: int = 0
    begun: float = 0.0
    is_settled: bool = False
    is_kept_up: bool = False

    @property
    def cycles(self) -> float:
        return self.half_cycles / 2.0


class BringUp:
    """Guides from the start of the nodes to a model that the user keeps.

    Args:
        axis: To be identified.
        push: Angle that is asked for, rad.
    """

    def __init__(self, axis: str, push: float = float(np.radians(5.0))) -> None:
        self.axis = axis
        self._other = next(each for each in AXES if each != axis)
        self._push = push
        self.restart()

    def restart(self) -> None:
        """Begin anew with the rest before a push."""
        self._rest: dict[str, tuple[float, float]] = {}
        self._rest_end = self._begun = self._newest = float('-inf')
        self._refits = 0.0
        self._received = 0
        self._ended_at: float | None = None
        self._cycles, self._stayed = 0.0, ''
        self._complaint: tuple[str, str, str] | None = None

    def look(self, facts: Facts) -> Guidance:
        """The step at which the bring-up is now, and what to do."""
        return self._connection(facts) or self._installation(facts) or self._release(facts)

    def _connection(self, facts: Facts) -> Guidance | None:
        missing = [node for node in NODES if not any(name.startswith(f'{node}:') for name in facts.statuses)]
        if missing:
            return Guidance(
                CONNECT,
                f'Waiting for {", ".join(missing)}.',
                'nodes-missing',
                'start the nodes with `swath-sysid run` on this network and in the same ROS_DOMAIN_ID and namespace',
            )
        worst = max(
            (facts.statuses[f'{node}: imu'] for node in NODES[:2] if f'{node}: imu' in facts.statuses),
            key=lambda report: report.level,
            default=None,
        )
        if worst is not None and worst.level == ERROR:
            fault = 'silence' if facts.value('predictor: imu', 'received') else 'no-sensor'
            return Guidance(SENSOR, 'Nothing comes from the sensor.', fault, worst.message)
        if facts.silence == float('inf'):
            return Guidance(SENSOR, 'Waiting for the first sample of the sensor.')
        rate = facts.value('predictor: imu', 'rate_hz')
        if 0.0 < rate < LOWEST_RATE:
            return Guidance(
                SENSOR,
                f'The sensor gives {rate:.1f} samples a second, too few to see a craft roll.',
                'low-rate',
                'have its driver publish at 20 Hz or more',
            )
        return None

    def _installation(self, facts: Facts) -> Guidance | None:
        report = facts.statuses.get('predictor: installation')
        if report is not None and report.level != OK:
            code = str(report.values.get('contradictions', '')).partition(' ')[0]
            return Guidance(SENSOR, 'The readings of the sensor contradict each other.', code, report.message)
        motion = facts.motions.get(self.axis)
        if motion is None or motion.angle is None or motion.size < 2:
            if facts.value('predictor: imu', 'no-orientation'):
                return Guidance(
                    SENSOR,
                    'The sensor gives rates without orientation.',
                    'no-orientation',
                    'release the craft, let it roll out and press Identify: the guide needs angles, identification '
                    'does not',
                )
            return Guidance(SENSOR, 'Waiting for samples that can be used.')
        return None

    def _release(self, facts: Facts) -> Guidance:
        motion = facts.motions[self.axis]
        now = float(motion.time[-1])
        if now < self._newest:
            self.restart()
        self._newest = now
        if self._begun == float('-inf'):
            self._begun = float(motion.time[0])
        if facts.is_kept and facts.model is not None:
            self._rest_again(now)
            return Guidance(KEPT, f'The model is kept: {described(facts.model)}.')
        if self._ended_at is None and self._note_rest(facts, now):
            if not facts.value('predictor: installation', 'judgements'):
                return Guidance(REST, 'Lie still, hands off: gravity is compared with the attitude.')
            return self._before_push(facts)
        if not self._rest:
            return self._unrest(facts, now)
        if self._ended_at is not None:
            return self._identification(facts, now)
        return self._under_way(facts, now)

    def _note_rest(self, facts: Facts, now: float) -> bool:
        """Whether the craft is at rest, or has hardly left it; keeps the trim and the noise."""
        motions = {axis: facts.motions[axis] for axis in AXES if facts.motions.get(axis) is not None}
        lasting = SETTLED_S if self._rest else REST_S
        if all(_is_still(motion, now - lasting, STILL) for motion in motions.values()):
            if self._rest and any(self._moved(motion) for motion in motions.values()):
                return False
            self._rest = {axis: _level_and_noise(motion, now - lasting) for axis, motion in motions.items()}
            self._rest_end = now
            self._refits = facts.value('identifier: identification', 'refits')
            self._received = facts.models_received
            return True
        return bool(self._rest) and not any(self._moved(motion) for motion in motions.values())

    def _moved(self, motion: AxisMotion) -> bool:
        return self._since_rest(motion).peak > 0.0

    def _unrest(self, facts: Facts, now: float) -> Guidance:
        if now - self._begun < LONGEST_UNREST:
            if facts.model is not None and self._cycles and not self._complaint:
                return self._judgement(facts)
            return Guidance(REST, 'Lie still, hands off, until the craft has come to rest.')
        motion = facts.motions[self.axis]
        angle = motion.angle[motion.time > now - LONGEST_UNREST]  # type: ignore[index]
        return Guidance(
            REST,
            f'The craft does not come to rest: {self.axis} of {np.degrees(np.std(angle)):.2g} deg (standard '
            'deviation).',
            'waves',
            'wait for calm water or go behind shelter; or stay for some minutes and press Identify: motion in waves '
            'gives the period, and the damping at its amplitude',
        )

    def _before_push(self, facts: Facts) -> Guidance:
        ask = f'push the hull {self._where} by {np.degrees(self._push):.0f} degrees and let go'
        code, sentence, cure = self._complaint or ('', '', '')
        if code:
            return Guidance(PUSH, f'{sentence} Now {ask} once more.', code, cure)
        if facts.model is not None and self._cycles:
            return self._judgement(facts)
        known = f'A model is known: {described(facts.model)}. ' if facts.model is not None else ''
        return Guidance(PUSH, f'{known}The craft is at rest. Now {ask}.')

    @property
    def _where(self) -> str:
        return 'down on one side' if self.axis == 'roll' else 'down at the bow'

    def _under_way(self, facts: Facts, now: float) -> Guidance:
        motion = facts.motions[self.axis]
        moved, beside = self._since_rest(motion), _Motion()
        if facts.motions.get(self._other) is not None:
            beside = self._since_rest(facts.motions[self._other])
        is_push = moved.peak >= SMALLEST_PUSH and moved.peak > beside.peak
        if is_push and (self._has_verdict(facts) or self._is_identifying(facts)):
            # the buffer has noticed it before its tail died out
            self._complaint, self._cycles, self._ended_at = None, moved.cycles, now
            return self._identification(facts, now)
        if all(each.is_settled or not each.peak for each in (moved, beside)):
            return self._conclude(facts, moved, beside, now)
        if (moved.is_kept_up or beside.is_kept_up) and not find_decays(motion.between(self._rest_end, None)):
            return Guidance(
                DECAY,
                'The motion does not die out.',
                'waves',
                'waves keep the craft moving: wait for calm water, or stay for some minutes and press Identify',
            )
        if not moved.half_cycles:
            held = now - moved.begun if moved.peak else 0.0
            if held > LONGEST_HOLD:
                return Guidance(
                    PUSH,
                    f'The hull has been held for {held:.0f} s.',
                    'held',
                    'let go at once and keep hands and lines off; if nobody holds it, it has a new trim: press Start '
                    'again',
                )
            share = np.degrees(max(moved.peak, 0.0))
            return Guidance(
                PUSH,
                f'{share:.1f} of {np.degrees(self._push):.0f} degrees: '
                + ('let go.' if moved.peak >= 0.8 * self._push else 'further, then let go.'),
            )
        return Guidance(DECAY, f'Hands off and let it roll out: {moved.cycles:.1f} cycles so far.')

    def _conclude(self, facts: Facts, moved: _Motion, beside: _Motion, now: float) -> Guidance:
        """A release has died out: whether it can be identified."""
        self._complaint = None
        if not moved.peak and beside.peak < SMALLEST_PUSH:
            return self._rest_again(now)
        since = facts.motions[self.axis].between(self._rest_end, None).time
        if np.max(np.diff(since), initial=0.0) > LONGEST_GAP:
            self._complaint = (
                'samples-lost',
                'Samples were lost on the way to the page.',
                'free the machine of other work, or press Identify: the buffer may have them all',
            )
        elif beside.peak > moved.peak:
            self._complaint = (
                'other-axis',
                f'That was {self._other}, {np.degrees(beside.peak):.1f} deg.',
                f'push {self._where}, or choose {self._other} above',
            )
        elif moved.peak < SMALLEST_PUSH:
            self._complaint = (
                'too-small',
                f'That was {np.degrees(moved.peak):.1f} deg, too small beside what disturbs it.',
                f'push further, to {np.degrees(self._push):.0f} degrees if the craft allows it',
            )
        elif moved.cycles < MIN_CYCLES:
            self._complaint = (
                'few-cycles',
                f'The hull came back after {moved.cycles:.1f} cycles.',
                'let go at once instead of lowering it, and keep hands and lines off; a hull that does not swing by '
                'itself has no period to identify',
            )
        else:
            self._cycles, self._ended_at = moved.cycles, now
            return self._identification(facts, now)
        return self._rest_again(now)

    def _rest_again(self, now: float) -> Guidance:
        """Before the next push, with what was wrong with the last."""
        self._ended_at, self._rest, self._begun = None, {}, now
        code, sentence, cure = self._complaint or ('', 'Lie still, hands off.', '')
        return Guidance(PUSH if code else REST, sentence, code, cure)

    def _identification(self, facts: Facts, now: float) -> Guidance:
        """After a release: what the identifier makes of it."""
        if self._is_identifying(facts):
            share = 100.0 * facts.value('identifier: identification', 'progress')
            return Guidance(IDENTIFY, f'Found {self._cycles:.1f} cycles. Identifying: {share:.0f} %.')
        if self._has_verdict(facts):
            if facts.model is None:
                self._complaint = (
                    'not-identified',
                    'Nothing was identified.',
                    f'{_verdict(facts)}; release again in still water, from a larger angle',
                )
            is_new = facts.models_received > self._received
            self._stayed = '' if is_new else f' The model from before stays: {_verdict(facts)}.'
            again = self._rest_again(now)
            return again if again.fault else self._judgement(facts)
        if self._ended_at is not None and now - self._ended_at > PATIENCE_S:
            since = facts.motions[self.axis].between(self._rest_end, None)
            why = explain_absence(since).message if since.size > 2 else ''
            return Guidance(
                IDENTIFY,
                f'Found {self._cycles:.1f} cycles, but no identification began.',
                'not-noticed',
                f'press Identify (auto_identify or auto_detect_decay may be off); {why}',
            )
        return Guidance(IDENTIFY, f'Found {self._cycles:.1f} cycles. Waiting for the identification.')

    def _is_identifying(self, facts: Facts) -> bool:
        return _identifier(facts).get('state') == 'identifying'

    def _has_verdict(self, facts: Facts) -> bool:
        refits = facts.value('identifier: identification', 'refits')
        return not self._is_identifying(facts) and (refits > self._refits or facts.models_received > self._received)

    def _judgement(self, facts: Facts) -> Guidance:
        assert facts.model is not None, 'judged where there is one'
        return Guidance(
            JUDGE,
            f'Found {self._cycles:.1f} cycles: {described(facts.model)}.{self._stayed} {next_release(facts.model)}',
        )

    def _since_rest(self, motion: AxisMotion) -> _Motion:
        level, noise = self._rest.get(motion.axis, (0.0, 0.0))
        since = motion.time > self._rest_end
        time, offset = motion.time[since], motion.angle[since] - level  # type: ignore[index]
        band = max(MOVED, NOISES * noise)
        large = np.abs(offset) > band
        if not large.any():
            return _Motion()
        peak, begun = float(np.abs(offset).max()), float(time[large.argmax()])
        sides = np.sign(offset[np.abs(offset) > max(SWUNG, NOISES * noise)])
        lasted = float(time[-1]) - begun
        thirds = np.array_split(offset[time >= begun], 3)
        return _Motion(
            peak=peak,
            half_cycles=int(np.count_nonzero(np.diff(sides))),
            begun=begun,
            is_settled=lasted > SETTLED_S
            and _is_still(motion, float(time[-1]) - SETTLED_S, max(STILL, FADED * peak), level),
            is_kept_up=lasted > LONGEST_DECAY and bool(np.std(thirds[2]) > STEADY * np.std(thirds[0])),
        )


def _identifier(facts: Facts) -> Mapping[str, object]:
    report = facts.statuses.get('identifier: identification')
    return report.values if report else {}


def _verdict(facts: Facts) -> str:
    return str(_identifier(facts).get('last_verdict', ''))


def described(model: IdentifiedModel) -> str:
    """Period and damping in words, with two standard deviations, at half the largest amplitude seen."""
    _, (period, period_std), (damping, damping_std) = at_half_amplitude(model)
    return (
        f'period {period:.3f}\u00a0±\u00a0{2.0 * period_std:.2g}\u00a0s, '
        f'damping ratio {damping:.4f}\u00a0±\u00a0{2.0 * damping_std:.2g}'
    )


def next_release(model: IdentifiedModel) -> str:
    """What another release would bring.

    The errors of a fit are those of the noise over the amplitude, and those of the mean of n like it fall with the root
    of n.
    """
    largest = float(np.degrees(model.amplitude_range[1]))
    _, _, (damping, std) = at_half_amplitude(model)
    if 2.0 * std <= POOR_DAMPING * abs(damping):
        return 'That is well known: Accept it, or release again to see whether it repeats.'
    wider = f'one release from {2.0 * largest:.0f} degrees, or ' if 2.0 * largest <= 15.0 else ''
    known = 200.0 * std / abs(damping)
    return f'The damping is known to {known:.0f} %: {wider}three more like it, fitted together, halve that.'


def at_half_amplitude(model: IdentifiedModel) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """Amplitude, rad, natural period, s, and equivalent damping ratio there, both with standard deviation."""
    largest = model.amplitude_range[1]
    amplitude = 0.5 * largest if np.isfinite(largest) and largest > 0.0 else float(np.radians(2.0))
    bands = amplitude_bands(model.model, model.covariance, np.array([amplitude]))
    frequency = float(bands.curves.frequency[0])
    period = 2.0 * np.pi / frequency
    return (
        amplitude,
        (period, period * float(bands.frequency_std[0]) / frequency),
        (float(bands.curves.damping_ratio[0]), float(bands.damping_ratio_std[0])),
    )


def _is_still(motion: AxisMotion, since: float, largest: float, level: float | None = None) -> bool:
    """Whether an angle stays within a band from then on; and about a level, where one is given."""
    if motion.angle is None or motion.time[0] > since + BLOCK_S:
        return False
    late = motion.time > since
    if np.count_nonzero(late) < 2:
        return False
    blocks = np.floor((motion.time[late] - since) / BLOCK_S).astype(int)
    _, means = bin_means(blocks, motion.angle[late])
    return bool(np.ptp(means) < largest and (level is None or abs(means.mean() - level) < max(largest, MOVED)))


def _level_and_noise(motion: AxisMotion, since: float) -> tuple[float, float]:
    """Mean and noise of an angle at rest, rad."""
    angle = motion.angle[motion.time > since]  # type: ignore[index]
    return float(angle.mean()), noise_level(angle)
