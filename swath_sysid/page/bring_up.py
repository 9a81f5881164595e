"""The guided bring-up of a craft: a table of states, and which of them the present facts are.

Time is the stamps of the motion, so that guidance does not depend on playback speed. The detector of the motion window
judges decays; the verdict in its file judges a model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.segmentation import SMALLEST_AMPLITUDE, find_decays, keeps_oscillating
from swath_sysid.attitude.motion.sensor_checks import TILT_CODES
from swath_sysid.attitude.motion.trial import AXES, AxisMotion
from swath_sysid.attitude.motion.turning_points import split_at_pauses
from swath_sysid.attitude.motion.window import WindowSettings
from swath_sysid.common.conventions import ADEQUATE
from swath_sysid.common.signals import bin_means
from swath_sysid.common.wings import yaml_table
from swath_sysid.page.model_words import described, gain, of_axis, verdict_of
from swath_sysid.page.release import Release
from swath_sysid.pipeline.health import ERROR, OK, Report

GUIDE = yaml_table(Path(__file__).with_name('guide.yaml'))
STEPS = tuple('connect sensor rest push decay identify judge kept'.split())
CONNECT, SENSOR, REST, PUSH, DECAY, IDENTIFY, JUDGE, KEPT = STEPS

NODES = ('imu_buffer', 'predictor', 'identifier')
IDENTIFICATION = 'identifier: identification'

LOWEST_RATE = 8.0  #: Hz; craft roll in 1 s and more, and a period needs some ten samples.

REST_S = 6.0  #: s without motion after which a craft is at rest.
BLOCK_S = 0.5  #: s; rest is judged by means over this time, which average out sensor noise.
STILL = SMALLEST_AMPLITUDE['angle']  #: Peak to peak of such means at rest.
SMALLEST_PUSH = WindowSettings.smallest_decay  #: The buffer reports no smaller decay.

#: s without rest after which waves are blamed, and from the end of a decay without an identification.
PATIENCE_S = 20.0


@dataclass(frozen=True)
class Facts:
    """The present facts."""

    #: Fresh diagnostics by ``NODE: NAME``, values as texts.
    statuses: Mapping[str, Report] = field(default_factory=dict)
    silence: float = float('inf')  #: s since the newest sample came; infinite before the first.
    motions: Mapping[str, AxisMotion] = field(default_factory=dict)  #: The last minute, by axis.
    releases: Mapping[str, Release] = field(default_factory=dict)  #: The newest free decays, by axis.
    models: tuple[IdentifiedModel, ...] = ()  #: Of the axis to be identified, the newest last.
    is_kept: bool = False  #: Whether the user has accepted the model.
    can_push: bool = False  #: Whether the craft is a simulated one, which the page can push.

    @property
    def model(self) -> IdentifiedModel | None:
        """The newest model."""
        return self.models[-1] if self.models else None

    def text(self, status: str, name: str) -> str:
        """A value of a status; empty where it is missing."""
        report = self.statuses.get(status)
        return str(report.values.get(name, '')) if report else ''

    def value(self, status: str, name: str) -> float:
        """A number of a status; zero where it is missing."""
        try:
            return float(self.text(status, name))
        except ValueError:
            return 0.0

    @property
    def is_identifying(self) -> bool:
        """Whether an identification is running."""
        return self.text(IDENTIFICATION, 'state') == 'identifying'


@dataclass(frozen=True)
class Guidance:
    """The present step of the bring-up."""

    step: str  #: One of `STEPS`.
    sentence: str  #: What is happening, or what to do.
    fault: str = ''  #: Code of the fault; empty without one.
    cure: str = ''  #: What to do about it, or without a fault the next step.
    action: str = ''  #: The button to press now; empty: none.


AGAIN = 'push'  #: The action after which the craft is released, by the page or by hand.

#: The guidance of each state, whose texts but the action are formats.
STATES = {name: Guidance(**texts) for name, texts in GUIDE['states'].items()}


def say(name: str, **values: Any) -> Guidance:
    """The guidance of a state of the table with these values in its texts."""
    return Guidance(**{part: text.format(**values) for part, text in vars(STATES[name]).items()})


def of_sensor(facts: Facts) -> Guidance | None:
    """What is missing before the motion can be looked at."""
    missing = [node for node in NODES if not any(name.startswith(f'{node}:') for name in facts.statuses)]
    if missing:
        return say('missing', nodes=', '.join(missing))
    reports = [facts.statuses[f'{node}: imu'] for node in NODES[:2] if f'{node}: imu' in facts.statuses]
    worst = max(reports, key=lambda report: report.level, default=None)
    if worst is not None and worst.level == ERROR:
        code = 'silence' if facts.value('predictor: imu', 'received') else 'no-sensor'
        return say('silent', code=code, message=worst.message)
    if facts.silence == float('inf'):
        return say('no sample')
    if 0.0 < (rate := facts.value('predictor: imu', 'rate_hz')) < LOWEST_RATE:
        return say('slow', rate=rate)
    report = facts.statuses.get('predictor: installation')
    if report is None or report.level == OK:
        return None
    codes = facts.text('predictor: installation', 'contradictions').split()
    # a list may be the craft's: the health of the page shows it
    code = next((each for each in codes if each not in TILT_CODES), '')
    return say('contradiction', code=code, message=report.message) if code else None


class BringUp:
    """Guides from the start of the nodes to an accepted model of an axis; asks for a push."""

    def __init__(self, axis: str) -> None:
        self.axis = axis
        self._other = next(each for each in AXES if each != axis)
        side = 'down on one side' if axis == 'roll' else 'down at the bow'
        self._push, self._degrees = float(np.radians(5.0)), '5 degrees'
        self._ask = f'push the hull {side} by {self._degrees} and let go'
        # the first that gives guidance is the present step
        self._questions = (
            of_sensor,
            self._no_angles,
            self._kept,
            self._identification,
            self._new_release,
            self._unrest,
            self._at_rest,
            self._moving,
        )
        self.restart()

    def restart(self) -> None:
        """Restart with the rest before a push."""
        self._newest = float('-inf')
        self._stays: str | None = None
        self._wait_for_rest(self._newest)

    def look(self, facts: Facts) -> Guidance:
        """The present step and what to do."""
        guidance = next(guidance for ask in self._questions if (guidance := ask(facts)) is not None)
        if guidance.action != AGAIN or facts.can_push:
            return guidance
        # with a real craft it is the hands that release it
        return replace(guidance, action='restart' if guidance.step == JUDGE else '')

    def _wait_for_rest(self, now: float, fault: Guidance | None = None) -> None:
        """Ignore earlier motion; its fault is reported before the next push."""
        self._begun, self._fault = now, fault
        self._levels: dict[str, float] = {}
        self._rest_end, self._released_at = now, float('inf')
        self._has_moved = False

    def _no_angles(self, facts: Facts) -> Guidance | None:
        motion = facts.motions.get(self.axis)
        if motion is None or motion.angle is None or motion.size < 2:
            return say('no orientation' if facts.value('predictor: imu', 'no-orientation') else 'no angles')
        now = float(motion.time[-1])
        if now < self._newest:
            self.restart()
        refits, published = (facts.value(IDENTIFICATION, name) for name in ('refits', 'published'))
        if self._newest == float('-inf'):
            self._wait_for_rest(now)
            self._refits, self._published = refits, published
        self._newest, self._refits, self._published = now, min(self._refits, refits), min(self._published, published)
        return None

    def _kept(self, facts: Facts) -> Guidance | None:
        if not facts.is_kept or facts.model is None:
            return None
        self._wait_for_rest(self._newest)
        return say('kept', model=described(facts.model))

    def _identification(self, facts: Facts) -> Guidance | None:
        """State of the identifier and its results since the last look."""
        if facts.is_identifying:
            return say('identifying', share=100.0 * facts.value(IDENTIFICATION, 'progress'))
        refits, published = (facts.value(IDENTIFICATION, name) for name in ('refits', 'published'))
        is_over, is_new = refits > self._refits, published > self._published
        self._refits, self._published = refits, published
        if not is_over:
            return None
        message, fault = of_axis(facts.text(IDENTIFICATION, 'last_verdict'), self.axis), self._other_axis(facts)
        if facts.model is None and not is_new:
            fault = fault or say('not identified', message=message)
        self._stays = None if fault else '' if is_new else message
        self._wait_for_rest(self._newest, fault)
        return fault or self._judgement(facts)

    def _judgement(self, facts: Facts) -> Guidance | None:
        """What to do with the identified model, until the next motion."""
        return None if self._stays is None or facts.model is None else judgement(facts.models, self._stays)

    def _other_axis(self, facts: Facts) -> Guidance | None:
        """Guidance where the other axis has moved more than this one since the rest."""
        (own, _), (beside, _) = (self._since_rest(facts, axis) for axis in (self.axis, self._other))
        if not self._levels or beside <= max(own, SMALLEST_PUSH):
            return None
        return say('other axis', other=self._other, moved=np.degrees(beside), ask=self._ask)

    def _new_release(self, facts: Facts) -> Guidance | None:
        """Guidance for a detected decay whose identification has not started."""
        release = facts.releases.get(self.axis)
        if release is None or release.motion.time[0] <= self._begun:
            return None
        self._released_at = min(self._released_at, self._newest)
        is_early = self._newest - self._released_at < PATIENCE_S
        return say('found' if is_early else 'not noticed', cycles=release.cycles)

    def _unrest(self, facts: Facts) -> Guidance | None:
        """Guidance until the craft is at rest for the first time."""
        levels = levels_at_rest(facts.motions, self._newest)
        if self._levels or levels:
            self._levels = self._levels or levels
            return None
        shown = self._fault or self._judgement(facts)
        if shown is not None:
            return shown
        if self._newest - self._begun < PATIENCE_S:
            return say('unrest')
        std = np.degrees(np.std(facts.motions[self.axis].between(self._newest - PATIENCE_S, None).primary))
        sentence = f'The craft does not come to rest: {self.axis} of {std:.2g} deg (standard deviation).'
        if facts.model is not None:
            known = ': '.join(filter(None, (described(facts.model), *verdict_of(facts.model))))
            return say('at sea', sentence=sentence, known=known)
        return say('waves', step=REST, sentence=sentence)

    def _at_rest(self, facts: Facts) -> Guidance | None:
        """Guidance for a craft at rest."""
        levels = levels_at_rest(facts.motions, self._newest)
        if not levels:
            return None
        offset = max(abs(levels[axis] - self._levels.get(axis, levels[axis])) for axis in levels)
        if self._has_moved and offset > SMALLEST_PUSH:
            return say('held', offset=np.degrees(offset))
        if self._has_moved:
            self._fault = self._no_decay(facts)
        self._levels, self._rest_end, self._has_moved = levels, self._newest, False
        if self._fault is not None:
            return replace(self._fault, sentence=f'{self._fault.sentence} Now push once more, by {self._degrees}.')
        if (shown := self._judgement(facts)) is not None:
            return shown
        if not facts.value('predictor: installation', 'judgements'):
            return say('gravity')
        known = '' if facts.model is None else f'A model is known: {described(facts.model)}.'
        return say('ready', ask='press Push and release' if facts.can_push else self._ask, known=known)

    def _no_decay(self, facts: Facts) -> Guidance | None:
        """The fault of a motion that ended without a detected decay."""
        if max(self._since_rest(facts, axis)[0] for axis in AXES) < SMALLEST_PUSH:
            return self._fault
        if len(split_at_pauses(facts.motions[self.axis].between(self._rest_end, None))) > 1:
            return say('samples lost')
        return self._other_axis(facts) or say('no decay')

    def _moving(self, facts: Facts) -> Guidance:
        """Guidance while the craft moves after a rest."""
        (own, came_back), (beside, _) = (self._since_rest(facts, axis) for axis in (self.axis, self._other))
        self._has_moved = True
        if max(own, beside) < SMALLEST_PUSH and (shown := self._judgement(facts)) is not None:
            return shown
        self._stays = None
        since = facts.motions[self.axis].between(self._rest_end, None)
        if since.duration > PATIENCE_S and keeps_oscillating(since) and not find_decays(since):
            return say('waves', step=DECAY, sentence='The motion does not die out.')
        if came_back or beside > max(own, SMALLEST_PUSH):
            return say('rolling out')
        way = 'let go.' if own >= 0.8 * self._push else 'further, then let go.'
        return say('pushing', moved=np.degrees(own), push=self._degrees, way=way)

    def _since_rest(self, facts: Facts, axis: str) -> tuple[float, bool]:
        """Largest angle of an axis from its rest, rad, and whether it came back to the other side."""
        motion = facts.motions.get(axis)
        since = None if motion is None else motion.between(self._rest_end, None)
        if since is None or since.angle is None or since.size == 0:
            return 0.0, False
        offset = since.angle - self._levels.get(axis, 0.0)
        offset = offset * np.sign(offset[np.argmax(np.abs(offset))])
        return float(offset.max()), bool(offset.min() < -STILL)


def judgement(models: Sequence[IdentifiedModel], stays: str) -> Guidance:
    """What to do with the newest model of an axis: accept it where adequate, otherwise cure the fault. ``stays`` is
    the reason why it stays although another release was identified.
    """
    level, cure = verdict_of(models[-1])
    model, remark = described(models[-1]), stays and f' The previous model stays: {stays}.'
    if level != ADEQUATE:
        return say('not adequate', model=model, level=level, cure=cure, remark=remark)
    added = remark.strip() or gain(models).capitalize().rstrip('.') + '.'
    return say('adequate', model=model, remark=f'{added} ' if added != '.' else '')


def levels_at_rest(motions: Mapping[str, AxisMotion], now: float) -> dict[str, float]:
    """Mean angle of each axis over the last `REST_S`, rad; empty where one of them moves."""
    levels = {}
    for axis, motion in motions.items():
        late = motion.between(now - REST_S, None)
        if late.angle is None or late.size < 2 or late.duration < REST_S - BLOCK_S:
            return {}
        _, means = bin_means(np.floor((late.time - late.time[0]) / BLOCK_S).astype(int), late.angle)
        if np.ptp(means) >= STILL:
            return {}
        levels[axis] = float(means.mean())
    return levels
