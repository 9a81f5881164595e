"""The trials of a campaign: each read, cut and checked, or left out for a reason."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from swath_sysid import __version__
from swath_sysid.attitude.identification.problem import problem_of
from swath_sysid.attitude.motion.segmentation import find_decay
from swath_sysid.attitude.motion.sensor_checks import refuse_contradictions
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.columns import UNKNOWN
from swath_sysid.formats.reading import read_trial, source_hash
from swath_sysid.tank.campaign.evaluation import Condition, Record
from swath_sysid.tank.campaign.manifest import Craft, Manifest, TrialEntry

RESULT_FORMAT = 4  #: Raised when earlier results can no longer be used.
ANGLE_STEP_DEG = 0.5  #: Resolution of an initial angle that is not given but taken from the decay.


@dataclass(frozen=True)
class TrialOutcome:
    """One trial's record, or the reason why it was left out; no hash where it could not be read."""

    entry: TrialEntry
    name: str
    sha256: str = ''
    record: Record | None = None
    reason: str = ''
    advice: tuple[Advice, ...] = ()
    unused_draft: float | None = None  #: m; that the file gives, of a craft whose design draft is unknown.

    def left_out(self, reason: object) -> 'TrialOutcome':
        """The same, not used."""
        if getattr(reason, 'code', '') == UNKNOWN:
            reason = f"{reason} (columns: {{time: 't:s', roll: 'Phi:deg'}} in the manifest)"
        return replace(self, record=None, reason=f'{self.entry.where}: {reason}', advice=())

    @property
    def identity(self) -> list:
        """All that the prepared record depends on."""
        e = self.entry
        return [RESULT_FORMAT, __version__, self.sha256, e.axis, e.start, e.end, e.frame, e.topic, e.columns]


def prepared_trials(manifest: Manifest, quantity: str) -> list[TrialOutcome]:
    """Every trial of a manifest, read, cut and numbered, or with the reason why it is left out."""
    trials = _numbered(_without_copies([_prepared(entry, manifest, quantity) for entry in manifest.trials]))
    _check_drafts(trials)
    return trials


def hides_drafts(craft: Craft, quantity: str) -> bool:
    """Whether drafts in files have nothing to refer to, so that every trial counts as one at the design draft."""
    return quantity == 'draft_factor' and craft.draft_m is None


def loading_of(entry: TrialEntry, trial: Trial, craft: Craft, quantity: str) -> float:
    """Loading of a trial in the campaign's quantity."""
    given = entry.loading
    if (
        given is None
        and trial.draft is not None
        and quantity != 'displacement_kg'
        and not hides_drafts(craft, quantity)
    ):
        given = ('draft_m', trial.draft)
    if given is None:
        design = craft.design_loading(quantity)
        if design is None:
            raise InputError(f"its {quantity} is not given: write it beside the file, or the craft's design value")
        return design
    name, value = given
    if name == quantity:
        return value
    if craft.draft_m is not None and {name, quantity} == {'draft_factor', 'draft_m'}:
        return value * craft.draft_m if quantity == 'draft_m' else value / craft.draft_m
    raise InputError(
        f"its {name} cannot be converted to {quantity}, which the campaign's other trials give: give {quantity}, or "
        "the craft's draft_m for drafts and draft factors"
    )


def _prepared(entry: TrialEntry, manifest: Manifest, quantity: str) -> TrialOutcome:
    """Read, cut and check one trial; whatever is wrong becomes the reason to leave it out."""
    outcome = TrialOutcome(entry, entry.path.name)
    try:
        sha256 = source_hash(entry.path)
        trial = read_trial(entry.path, topic=entry.topic, frame=entry.frame, columns=dict(entry.columns))
        refuse_contradictions(trial, entry.axis)
        motion = trial.axis(entry.axis)
        problem = problem_of([motion], (find_decay(motion, entry.start, entry.end),))
        angle, stated = entry.initial_angle_deg, trial.initial_angle
        if angle is None and stated is not None:
            angle = round(math.degrees(stated), 6)
        elif angle is None:
            angle = round(math.degrees(problem.scales.amplitude) / ANGLE_STEP_DEG) * ANGLE_STEP_DEG
        loading = round(loading_of(entry, trial, manifest.craft, quantity), 9)
    except InputError as error:
        return outcome.left_out(error)
    except Exception as error:  # noqa: BLE001 - one damaged file must not stop the others; its reason is reported
        return outcome.left_out(f'{type(error).__name__} while reading it: {error}')
    condition = Condition(entry.axis, loading, float(angle), entry.speed_m_s or 0.0)
    record = Record(outcome.name, condition, entry.repeat or 0, motion, problem)
    advice = tuple(dict.fromkeys((*trial.advice, *problem.advice)))
    draft = trial.draft if entry.loading is None and hides_drafts(manifest.craft, quantity) else None
    return replace(outcome, sha256=sha256, record=record, advice=advice, unused_draft=draft)


def _check_drafts(trials: Sequence[TrialOutcome]) -> None:
    """Refuse trials of several drafts that would all count as the design draft."""
    drafts = sorted({t.unused_draft for t in trials if t.record is not None and t.unused_draft is not None})
    if len(drafts) > 1:
        raise InputError(
            f'the files of the trials give several drafts ({", ".join(f"{draft:g}" for draft in drafts)} m), and the '
            "manifest no design draft: write the craft's draft_m under craft:, to which the drafts of trials refer"
        )


def _without_copies(trials: Sequence[TrialOutcome]) -> list[TrialOutcome]:
    """Leave out trials with the content, axis and bounds of an earlier one: a copy is not a repeat."""
    found = []
    first: dict[tuple, TrialOutcome] = {}
    for t in trials:
        if t.record is not None:
            what = t.sha256, t.entry.axis, t.entry.start, t.entry.end, t.entry.topic, t.entry.columns
            original = first.setdefault(what, t)
            if original is not t:
                is_same = original.entry.path.resolve() == t.entry.path.resolve()
                same_content = f'it has the same content as {original.name}: a copy is not a repeat'
                t = t.left_out('it is given twice: name it once' if is_same else same_content)
        found.append(t)
    return found


def _numbered(trials: Sequence[TrialOutcome]) -> list[TrialOutcome]:
    """Give repeats without a number the next free one of their condition; refuse those taken twice."""
    stated = {(t.record.condition, t.record.repeat) for t in trials if t.record is not None}
    found: list[TrialOutcome] = []
    used: dict[tuple, str] = {}
    for t in trials:
        if (record := t.record) is not None:
            condition, number = record.condition, record.repeat
            numbers = [number] if number else [k for k in range(1, len(trials) + 2) if (condition, k) not in stated]
            free = next((k for k in numbers if (condition, k) not in used), None)
            if free is None:
                other = used[condition, number]
                t = t.left_out(f'its condition and repeat ({record}) are those of {other}: give another repeat')
            else:
                used[condition, free] = t.name
                t = replace(t, record=replace(record, repeat=free))
        found.append(t)
    return found
