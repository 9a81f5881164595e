"""The free decays that motion windows have shown, each held once whatever windows it was seen in."""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.identification.problem import Problem, before_the_next, needed_part, problem_of, to_be_fitted
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.rate_comparison import aligned
from swath_sysid.attitude.motion.segmentation import DecaySegment, find_decays
from swath_sysid.attitude.motion.sensor_checks import OFFSET_CODES, RATE_CODES, contradictions_in, refuse_contradictions
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.attitude.motion.window import MotionTable

MOST_DECAYS = 5  #: Held per axis, the newest; the time of a joint fit is proportional to their number.


@dataclass(frozen=True, eq=False)
class LiveDecay:
    """A free decay cut from a motion window."""

    motion: AxisMotion  #: In the time of the window's trial.
    segment: DecaySegment
    origin: float  #: Stamp of the window's first row, s.
    source: dict  #: What names the window in a model's provenance.

    @property
    def start(self) -> float:
        """Stamp of its first sample, s."""
        return self.origin + self.segment.start

    @property
    def end(self) -> float:
        """Stamp of its last sample, s."""
        return self.origin + self.segment.end

    @property
    def has_begun(self) -> bool:
        """Whether the window shows the start of the decay."""
        return self.segment.beginning in ('released', 'pushed')

    def overlaps(self, other: 'LiveDecay') -> bool:
        """Whether both are views of the same release."""
        return self.start < other.end and other.start < self.end

    def shows_more_than(self, other: 'LiveDecay') -> bool:
        """Whether it is longer than another view of the same decay, by half a period."""
        return self.segment.duration > other.segment.duration + 0.5 * other.segment.period


@dataclass(frozen=True)
class HeldDecays:
    """The decays of one axis, oldest first, and the hull that was fitted to them."""

    decays: tuple[LiveDecay, ...] = ()
    model: DecayModel | None = None

    def with_new(self, seen: Iterable[LiveDecay]) -> tuple[tuple[LiveDecay, ...], tuple[LiveDecay, ...]]:
        """Those held that were not seen better now, and those seen that are new or longer than before."""
        held, new = list(self.decays), list[LiveDecay]()
        for decay in seen:
            before = [each for each in (*held, *new) if each.overlaps(decay)]
            if all(decay.shows_more_than(each) for each in before):
                held, new = ([each for each in those if each not in before] for those in (held, new))
                new.append(decay)
        return tuple(held), tuple(new)


def newest(decays: Iterable[LiveDecay]) -> tuple[LiveDecay, ...]:
    """The newest decays, as many as are held, oldest first."""
    return tuple(sorted(decays, key=lambda decay: decay.start)[-MOST_DECAYS:])


def joint_problem(decays: Sequence[LiveDecay]) -> Problem:
    """Several decays as one problem."""
    return problem_of([decay.motion for decay in decays], tuple(decay.segment for decay in decays))


def checked_trial(table: MotionTable) -> Trial:
    """The motion of a window, with advice where its angles and rates contradict each other."""
    trial = table.trial()
    found = contradictions_in(trial.time, trial.channels, Installation())
    return replace(trial, advice=tuple(each for each in found if each.code in RATE_CODES | OFFSET_CODES))


def decays_in(table: MotionTable, trial: Trial, axis: str, source: dict) -> tuple[LiveDecay, ...]:
    """The decays to be fitted in a window. Raises `InputError` where angle and rate contradict each other, or neither
    was measured.
    """
    refuse_contradictions(trial, axis, lags=False)
    motion = aligned(trial.axis(axis))
    found = find_decays(motion)
    return tuple(
        LiveDecay(
            needed_part(before_the_next(motion, segment, found), segment), segment, float(table.rows[0, 0]), source
        )
        for segment in to_be_fitted(found)
    )


def window_source(table: MotionTable, name: dict) -> dict:
    """The source of a window for a model's provenance; ``name`` names it, as a topic does."""
    return {
        **name,
        'first_stamp_s': float(table.rows[0, 0]),
        'sha256': hashlib.sha256(table.rows.tobytes()).hexdigest(),
    }
