"""The trials of a campaign: every release of each file, read, cut and checked, or left out for a reason."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from swath_sysid import __version__
from swath_sysid.attitude.identification.fit_quality import ADEQUATE_ERROR
from swath_sysid.attitude.identification.peaks import Peaks, measured_peaks
from swath_sysid.attitude.identification.problem import before_the_next, problem_of, to_be_fitted
from swath_sysid.attitude.motion.segmentation import DecaySegment, decays_or_absence
from swath_sysid.attitude.motion.sensor_checks import refuse_contradictions
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.attitude.motion.turning_points import find_turning_points
from swath_sysid.common.advice import Advice, counted
from swath_sysid.common.conventions import CONFIDENCE
from swath_sysid.common.errors import InputError
from swath_sysid.formats.columns import UNKNOWN
from swath_sysid.formats.reading import read_trial, source_hash
from swath_sysid.tank.campaign.evaluation import Condition, TankRecord
from swath_sysid.tank.campaign.manifest import Craft, Manifest, TrialEntry, loading_in_words
from swath_sysid.tank.campaign.title_block import said_above

RESULT_FORMAT = 6  #: Raised when earlier results can no longer be used.
SAME_DRAFT = 0.01  #: Relative difference of drafts that is none.
ANGLE_STEP_DEG = 0.5  #: Resolution of an initial angle that is not given but taken from the decay.


@dataclass(frozen=True)
class TrialOutcome:
    """The record of one release, or the reason why it was left out; no hash where the file could not be read."""

    entry: TrialEntry
    name: str
    sha256: str = ''
    record: TankRecord | None = None
    reason: str = ''
    advice: tuple[Advice, ...] = ()
    states_draft: bool = False  #: Whether the file does.
    said_draft: float | None = None  #: m; as the file states it, or the lines above its table.
    release: int = 0  #: Number within a file of several; 0 in one of a single release.

    def left_out(self, reason: object) -> 'TrialOutcome':
        """The same, not used."""
        if getattr(reason, 'code', '') == UNKNOWN:
            reason = f"{reason} (columns: {{time: 't:s', roll: 'Phi:deg'}} in the manifest)"
        return replace(self, record=None, reason=f'{self.entry.where}: {reason}', advice=())

    @property
    def identity(self) -> list:
        """All that the prepared record depends on."""
        e = self.entry
        return [
            RESULT_FORMAT,
            __version__,
            self.sha256,
            e.axis,
            e.start,
            e.end,
            e.frame,
            e.mounting_deg,
            e.topic,
            e.columns,
            self.release,
        ]


def prepared_trials(manifest: Manifest) -> tuple[str, list[TrialOutcome]]:
    """The quantity that gives the loading, of the first entry which names one or of the files, and every release of the
    trials, read, cut and numbered, or with the reason why it is left out.
    """
    named = next((t.loading[0] for t in manifest.trials if t.loading is not None), '')
    quantity = named or 'draft_factor'
    trials = [each for entry in manifest.trials for each in _prepared(entry, manifest, quantity)]
    if not named and any(t.states_draft for t in trials) and manifest.craft.draft_m is None:
        quantity = 'draft_m'
        trials = [each for entry in manifest.trials for each in _prepared(entry, manifest, quantity)]
    used = _without_contradictions(_numbered(_without_copies(trials)), quantity)
    return quantity, _with_several_drafts(used, quantity)


def loading_of(entry: TrialEntry, trial: Trial, craft: Craft, quantity: str) -> float:
    """Loading of a trial in the campaign's quantity."""
    given = entry.loading
    if (
        given is None
        and trial.draft is not None
        and quantity != 'displacement_kg'
        and not (quantity == 'draft_factor' and craft.draft_m is None)
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


def _prepared(entry: TrialEntry, manifest: Manifest, quantity: str) -> list[TrialOutcome]:
    """The releases of one trial, each cut and checked; whatever is wrong becomes the reason to leave them out."""
    outcome = TrialOutcome(entry, entry.path.name)
    try:
        outcome = replace(outcome, sha256=source_hash(entry.path))
        mounting = None if entry.mounting_deg is None else [math.radians(angle) for angle in entry.mounting_deg]
        trial = read_trial(
            entry.path,
            topic=entry.topic,
            frame=entry.frame,
            mounting=None if mounting is None else (mounting[0], mounting[1], mounting[2]),
            columns=dict(entry.columns),
        )
        refuse_contradictions(trial, entry.axis)
        said = said_above(entry.path)[0].get('draft_m') if entry.path.is_file() else None
        outcome = replace(outcome, states_draft=trial.draft is not None, said_draft=trial.draft or said)
        motion = trial.axis(entry.axis)
        decays = decays_or_absence(motion, entry.start, entry.end)
        if isinstance(decays, Advice):
            raise InputError(decays.message, decays.code)
        loading = round(loading_of(entry, trial, manifest.craft, quantity), 9)
        used, ordered = to_be_fitted(decays), sorted(decays, key=lambda decay: decay.start)
        found = []
        for number, segment in enumerate(ordered, 1):
            is_single = len(ordered) == 1
            name = outcome.name if is_single else f'{outcome.name}, release {number}'
            each = replace(outcome, name=name, release=0 if is_single else number)
            if segment not in used:
                short = f'its motion from {segment.start:.1f} to {segment.end:.1f} s ({segment.cycles:.1f} cycles)'
                found.append(each.left_out(f'{short} is no release that can be fitted; start_s and end_s choose it'))
                continue
            own = before_the_next(motion, segment, decays)
            found.append(_of_release(each, trial, own, segment, loading))
        return found
    except InputError as error:
        return [outcome.left_out(error)]
    except Exception as error:  # noqa: BLE001 - one damaged file must not stop the others; its reason is reported
        return [outcome.left_out(f'{type(error).__name__} while reading it: {error}')]


def _of_release(
    outcome: TrialOutcome, trial: Trial, motion: AxisMotion, segment: DecaySegment, loading: float
) -> TrialOutcome:
    """A release ready to be fitted, from the angle that is stated or, where that is of another release, measured."""
    entry, problem = outcome.entry, problem_of([motion], (segment,))
    measured, angle = math.degrees(problem.scales.amplitude), entry.initial_angle_deg
    if angle is None and trial.initial_angle is not None:
        angle = round(math.degrees(trial.initial_angle), 6)
    if angle is None or (outcome.release and not 0.5 < (measured / angle) ** 2 < 2.0):
        angle = round(measured / ANGLE_STEP_DEG) * ANGLE_STEP_DEG
    # a name gives the size of the angle, and only the motion the side
    angle = math.copysign(angle, problem.states[0].x)
    condition = Condition(entry.axis, loading, float(angle), entry.speed_m_s or 0.0)
    # the number of a file is not that of its releases
    repeat = 0 if outcome.release else entry.repeat or 0
    record = TankRecord(outcome.name, condition, repeat, motion, problem)
    return replace(outcome, record=record, advice=tuple(dict.fromkeys((*trial.advice, *problem.advice))))


def _without_contradictions(trials: Sequence[TrialOutcome], quantity: str) -> list[TrialOutcome]:
    """Leave out releases whose period contradicts that of most others of their draft; without a majority, ask."""
    pools: dict[tuple[str, float], list[tuple[TrialOutcome, TankRecord]]] = {}
    for t in trials:
        if t.record is not None:
            pools.setdefault((t.record.condition.series, t.record.condition.loading), []).append((t, t.record))
    reasons: dict[str, str] = {}
    for (series, loading), pool in pools.items():
        segments = [record.problem.segments[0] for _, record in pool]
        turns = [turns_of(record.problem.motions[0], s) for (_, record), s in zip(pool, segments, strict=True)]
        groups = of_like_periods(segments, turns)
        periods = [f'{np.mean([segments[k].period for k in group]):.3g} s' for group in groups]
        place = loading_in_words(quantity, loading)
        if len(groups) > 1 and 2 * len(groups[0]) <= len(pool):
            files = (_names([pool[k][0].entry.path.name for k in group]) for group in groups)
            said = ', '.join(f'{period} ({names})' for period, names in zip(periods, files, strict=True))
            raise InputError(
                f'the natural periods of the {series} records at {place} contradict each other: {said}; they are of '
                'different drafts or loadings: give draft_m (or another loading) beside each trial in the manifest'
            )
        for group, period in zip(groups[1:], periods[1:], strict=True):
            reason = (
                f'its natural period of {period} contradicts the {periods[0]} of '
                f'{counted(len(groups[0]), "other release")} at {place}: give its own draft or loading beside it in '
                'the manifest, or repeat it'
            )
            reasons |= {str(pool[k][1]): reason for k in group}
    return [t.left_out(reasons[str(t.record)]) if str(t.record) in reasons else t for t in trials]


def _with_several_drafts(trials: Sequence[TrialOutcome], quantity: str) -> list[TrialOutcome]:
    """With advice where files of one loading state drafts that differ by more than `SAME_DRAFT`."""
    drafts: dict[float, set[float]] = {}
    for t in trials:
        if t.record is not None and t.said_draft is not None:
            drafts.setdefault(t.record.condition.loading, set()).add(t.said_draft)
    found = {
        loading: Advice.of('several-drafts', place=loading_in_words(quantity, loading), low=min(said), high=max(said))
        for loading, said in drafts.items()
        if max(said) > (1.0 + SAME_DRAFT) * min(said)
    }
    return [
        replace(t, advice=(*t.advice, found[t.record.condition.loading]))
        if t.record is not None and t.said_draft is not None and t.record.condition.loading in found
        else t
        for t in trials
    ]


def _names(files: Sequence[str]) -> str:
    names = list(dict.fromkeys(files))
    return ', '.join(names[:3]) + (f' and {len(names) - 3} more' if len(names) > 3 else '')


def turns_of(motion: AxisMotion, segment: DecaySegment) -> Peaks:
    """The turning points of a decay by parabolas; as they are where it is sampled too seldom for most of these."""
    rough, peaks = find_turning_points(motion, segment.period), measured_peaks(motion, segment.period)
    return peaks if 2 * peaks.time.size > rough.time.size else Peaks(rough.time, rough.value)


def of_like_periods(segments: Sequence[DecaySegment], peaks: Sequence[Peaks]) -> list[list[int]]:
    """Places of decays in groups of which no two contradict each other in period, the largest group first."""
    groups: list[list[int]] = []
    pairs = len(peaks) * (len(peaks) - 1) / 2
    # the confidence is that of all pairs together
    level = 1.0 - 0.5 * (1.0 - CONFIDENCE) / max(pairs, 1.0)
    for k in sorted(range(len(peaks)), key=lambda k: segments[k].period):
        alike = next((g for g in groups if not any(_contradict(peaks[k], peaks[other], level) for other in g)), None)
        if alike is None:
            groups.append([k])
        else:
            alike.append(k)
    return sorted((sorted(g) for g in groups), key=len, reverse=True)


def _contradict(one: Peaks, other: Peaks, level: float) -> bool:
    """Whether two decays differ in period at the same amplitudes, beyond their scatter and so far that a period between
    both would be wrong, one period ahead, by more than an adequate model is. The period is taken to change with the
    square of the amplitude a, and its error to be proportional to 1 / a, as that of a turning point in noise.
    """
    low = max(p.mean_amplitude.min(initial=np.inf) for p in (one, other))
    high = min(p.mean_amplitude.max(initial=0.0) for p in (one, other))
    shared = [(p.mean_amplitude >= low) & (p.mean_amplitude <= high) for p in (one, other)]
    if min(np.count_nonzero(each) for each in shared) < 3:
        return False
    amplitude, period = (
        np.concatenate([getattr(p, name)[each] for p, each in zip((one, other), shared, strict=True)])
        for name in ('mean_amplitude', 'period')
    )
    is_other = np.repeat([0.0, 1.0], [np.count_nonzero(each) for each in shared])
    columns = amplitude[:, None] * np.column_stack([is_other, np.ones(period.size), amplitude**2])
    (apart, mean, _), residual, *_ = np.linalg.lstsq(columns, amplitude * period, rcond=None)
    freedom = period.size - columns.shape[1]
    std = math.sqrt(float(residual.sum()) / freedom * np.linalg.pinv(columns.T @ columns)[0, 0])
    return bool(np.pi * abs(apart) > ADEQUATE_ERROR * mean and abs(apart) > stdtrit(freedom, level) * std)


def _without_copies(trials: Sequence[TrialOutcome]) -> list[TrialOutcome]:
    """Leave out trials with the content, axis and bounds of an earlier one: a copy is not a repeat."""
    found = []
    first: dict[tuple, TrialOutcome] = {}
    for t in trials:
        if t.record is not None:
            e = t.entry
            what = t.sha256, e.axis, e.start, e.end, e.topic, e.columns, t.release
            original = first.setdefault(what, t)
            if original is not t:
                is_same = original.entry.path.resolve() == e.path.resolve()
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
