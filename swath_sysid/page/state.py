"""State shared by all browsers: the guide, the current view, and the buttons with the reasons that disable them."""

import signal
import subprocess
from collections import deque
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any, Protocol

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.common.conventions import REJECTED
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import ended, verb_command
from swath_sysid.common.wings import offered
from swath_sysid.formats.csv_trials import write_csv
from swath_sysid.formats.files import write_text
from swath_sysid.page import live_view
from swath_sysid.page.bring_up import GUIDE, IDENTIFICATION, PATIENCE_S, STEPS, BringUp, Facts, Guidance
from swath_sysid.page.charts import motion_changes
from swath_sysid.page.live_record import STALE_S, LiveRecord
from swath_sysid.page.model_words import of_axis, verdict_of
from swath_sysid.page.release import Release
from swath_sysid.pipeline.health import WARN

SELDOM = 3.0  #: s between looks at what rarely changes: the trials' folder, the predictor's parameters.

SHOWN_ANSWERS = 2
NO_RELEASE: tuple[dict[str, list], str] = {'measured': [], 'fitted': []}, 'No free decay has been detected yet.'

#: Label and meaning, in groups.
GROUPS = [{name: (label, meaning) for name, (label, meaning) in group.items()} for group in GUIDE['buttons']]
BUTTONS = {name: texts for group in GROUPS for name, texts in group.items()}

NO_MODEL = 'there is no model yet: release the craft first'


class Source(Protocol):
    """Supplies the page's data and carries out its requests."""

    lock: Any
    record: LiveRecord
    description: str
    sensor: str  #: Full name of its topic.
    namespace: str  #: Of the nodes, without slashes around it.

    def press(self, button: str) -> None:
        """``push``, ``accept``, ``refine``, or a service of the identifier."""


@dataclass(frozen=True)
class View:
    """The current screen contents, as plain data."""

    axis: str = ''
    guidance: Guidance = field(default_factory=lambda: Guidance(STEPS[0], ''))
    health: list[tuple[str, int, str]] = field(default_factory=list)
    motion: dict[str, dict[str, Any]] = field(default_factory=dict)
    release: dict[str, list] = field(default_factory=dict)
    release_words: str = ''
    model: dict[str, list] = field(default_factory=dict)
    releases: list[str] = field(default_factory=list)
    model_words: list[str] = field(default_factory=list)
    equation: str = ''
    refusals: dict[str, str] = field(default_factory=dict)
    can_push: bool = False
    calm: str = ''
    sea: str = ''
    valid: str = ''
    trials: list[dict[str, Any]] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    is_recording: bool = False
    answers: tuple[str, ...] = ()


class PageState:
    """The state of the page; models and bags are saved in ``folder``."""

    def __init__(self, source: Source, folder: Path, axis: str = AXES[0], manifest: str | None = None) -> None:
        self.view = View()
        self.answers: deque[str] = deque(maxlen=SHOWN_ANSWERS)
        self.manifest = manifest
        self._source = source
        self._folder = folder
        self._guides = {each: BringUp(each) for each in AXES}
        self._axis = axis
        self._answered = float('-inf')
        self._recorder: subprocess.Popen | None = None
        self._fitted_to: tuple[Release | None, IdentifiedModel | None] = None, None
        self._shown_fit = *NO_RELEASE, live_view.model_chart(None, None)
        self._campaign: tuple[list, list] = [], []
        self._campaign_read = float('-inf')

    @property
    def axes(self) -> list[str]:
        """The axes, that which is guided first."""
        return sorted(AXES, key=lambda axis: axis != self._axis)

    def answer(self, line: str) -> None:
        """Show a line in all browsers."""
        self.answers.append(f'{datetime.now():%H:%M:%S} {line}')
        self._answered = monotonic()

    def refresh(self) -> None:
        """Update the view, once for all browsers."""
        now, record = monotonic(), self._source.record
        with self._source.lock:
            facts = record.facts(self._axis, now)
            age = facts.silence if STALE_S < facts.silence < float('inf') else 0.0
            charts = {
                name: motion_changes(
                    live_view.motion_chart(record, name, facts.motions.get(name), age), 'deg' if name in AXES else 'm'
                )
                for name in dict.fromkeys((*AXES, *record.horizons))
            }
            releases = live_view.releases_in_words(record.tried.get(self._axis, ()))
            guidance, verdict = self._guides[self._axis].look(facts), facts.text(IDENTIFICATION, 'last_verdict')
            is_said = bool(verdict) and of_axis(verdict, self._axis) in guidance.cure
            equation = live_view.equation_words(record, self._axis)
            words = live_view.model_words(record, self._axis, None if is_said else verdict)
            valid = '' if age else live_view.valid_words(facts.statuses)
            unreadable = [(source, WARN, f'not shown: {why}') for source, why in record.unreadable.items()]
            waters = live_view.calm_words(record, age), live_view.sea_words(record), valid
        if now - self._answered > 3.0 * PATIENCE_S:
            self.answers.clear()
        if self.manifest and now - self._campaign_read > SELDOM:
            (trials_of,) = offered('trials_shown')
            self._campaign, self._campaign_read = trials_of(self.manifest), now
        if self._recorder is not None and self._recorder.poll() is not None:
            assert self._recorder.stdout is not None, 'it is piped'
            last = self._recorder.stdout.read().strip() or f'the recording failed in {self._folder}: is it writable?'
            self.answer(last)
            self._recorder = None
        self.view = View(
            self._axis,
            guidance,
            [*live_view.health(facts.statuses, facts.motions), *unreadable],
            charts,
            *self._fit(facts.releases.get(self._axis), facts.model),
            releases,
            words,
            equation,
            refusals(facts),
            facts.can_push,
            *waters,
            *self._campaign,
            self._recorder is not None,
            tuple(self.answers),
        )

    def _fit(self, release: Release | None, model: IdentifiedModel | None) -> tuple[dict, str, dict]:
        """The charts of the last decay and of the model, remade where one of them is new."""
        if release is not self._fitted_to[0] or model is not self._fitted_to[1]:
            self._fitted_to = release, model
            shown = NO_RELEASE if release is None else live_view.release_chart(release, model)
            self._shown_fit = *shown, live_view.model_chart(model, release)
        return self._shown_fit

    def choose(self, axis: str) -> None:
        """Guide the identification of this axis."""
        if axis != self._axis and axis in self._guides:
            self._axis = axis
            self._guides[axis].restart()

    def press(self, button: str) -> None:
        """Handle a button pressed in some browser."""
        if button == 'restart':
            self._guides[self._axis].restart()
        elif button == 'save':
            self._save()
        elif button == 'rollback':
            # there may be no file of the identifier's own
            if self._save():
                self._source.press(button)
        elif button == 'record':
            self._record()
        else:
            self._source.press(button)

    def download(self, name: str) -> str:
        """The text of ``model.yaml`` or ``motion.csv``; empty where there is none."""
        if name == 'model.yaml':
            return self._source.description
        with self._source.lock:
            trial = self._source.record.trial()
        if trial is None:
            return ''
        with TemporaryDirectory() as folder:
            path = Path(folder) / name
            write_csv(path, trial)
            return path.read_text(encoding='utf-8')

    def close(self) -> None:
        """End the recording."""
        if self._recorder is not None:
            self._recorder.send_signal(signal.SIGINT)
            # what is on the disk is readable also where it has to be killed
            ended(self._recorder)

    def _save(self) -> bool:
        """Write the present models to a file; False where that failed."""
        if not self._source.description:
            self.answer(NO_MODEL)
            return True
        path = self._folder / f'model_{datetime.now():%Y-%m-%d_%H-%M-%S}.yaml'
        try:
            write_text(path, self._source.description)
        except InputError as error:
            self.answer(str(error))
            return False
        self.answer(f'saved {path}')
        return True

    def _record(self) -> None:
        """Start a bag with the record verb in its own process, or end it."""
        if self._recorder is not None:
            self._recorder.send_signal(signal.SIGINT)
            return
        path = self._folder / f'swath_sysid_{datetime.now():%Y-%m-%d_%H-%M-%S}.mcap'
        self._recorder = subprocess.Popen(
            verb_command(
                'record', '--output', str(path), '--topic', self._source.sensor, '--namespace', self._source.namespace
            ),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            start_new_session=True,
        )
        self.answer(f'recording to {path}')


def refusals(facts: Facts) -> dict[str, str]:
    """Why buttons are disabled, by name; enabled ones are absent."""
    is_there, model = IDENTIFICATION in facts.statuses, facts.model
    busy = '' if is_there else 'the identifier does not answer: start the nodes with swath-sysid run'
    if facts.is_identifying:
        busy = 'an identification is running'
    unmeasured = '' if facts.motions or facts.silence < float('inf') else 'no motion was measured yet'
    reasons = {
        'push': '' if facts.can_push else 'only a simulated craft is pushed from here',
        'identify': busy or unmeasured,
        'motion.csv': unmeasured,
        'accept': NO_MODEL if model is None else 'this model is kept already' if facts.is_kept else busy,
        'refine': '' if facts.is_kept else 'releases already refine the model',
        'save': NO_MODEL if model is None else '',
        'model.yaml': NO_MODEL if model is None else '',
        'rollback': busy
        or ('' if facts.value(IDENTIFICATION, 'rollbacks_kept') else 'the identifier holds no model before this one'),
        'undo_rollback': busy
        or ('' if facts.value(IDENTIFICATION, 'rollbacks_undone') else 'nothing was rolled back since the last model'),
    }
    if model is not None and verdict_of(model)[0] == REJECTED:
        reasons['accept'] = ': '.join(verdict_of(model))
    return {name: reason for name, reason in reasons.items() if reason}
