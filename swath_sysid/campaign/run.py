"""Running a campaign: what is asked for by the manifest, what is known already, and the rest."""

import concurrent.futures
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from typing import Any

from swath_sysid import __version__
from swath_sysid.attitude.hull.catalogue import AUTO, GENERAL_HULL, equation_named
from swath_sysid.attitude.hull.scheduled_model import ScheduledModel
from swath_sysid.attitude.identification.identify import Identification, IdentificationSettings
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.motion.sensor_checks import refuse_contradictions
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.campaign import evaluation
from swath_sysid.campaign.evaluation import Condition, Record
from swath_sysid.campaign.executors import connection_losses
from swath_sysid.campaign.manifest import Craft, Manifest, TrialEntry, first_of
from swath_sysid.campaign.result_store import ResultStore, key_of
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import from_plain
from swath_sysid.formats.columns import UNKNOWN
from swath_sysid.formats.reading import read_trial, source_hash

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


@dataclass(frozen=True)
class AxisOutcome:
    """What a campaign found about one axis, at one speed."""

    axis: str  #: Name of the series: see `Condition.series`.
    records: tuple[Record, ...]
    names: tuple[str, ...]
    fits: dict  #: Objective to record to equation, in the order of the names.
    judgements: tuple  #: Record to equation, with the simulation objective.
    best: dict  #: Condition to index of its best repeat.
    together: dict  #: Condition to joint fits of its repeats.
    by_draft: dict  #: Draft to joint fits of all its records.
    ranking: evaluation.Ranking
    schedule: ScheduledModel  #: Of the chosen equation.
    spreads: tuple[evaluation.Spread, ...]  #: Of the chosen equation.

    @property
    def motion(self) -> str:
        """``roll`` or ``pitch``."""
        return self.records[0].condition.axis

    @property
    def speed_m_s(self) -> float:
        """Of all its records."""
        return self.records[0].condition.speed_m_s

    @property
    def is_compared(self) -> bool:
        """Whether there were equations to choose from."""
        return len(self.names) > 1

    @property
    def choice(self) -> int:
        """Index of the chosen equation."""
        return self.names.index(self.ranking.choice.name)


@dataclass(frozen=True)
class CampaignOutcome:
    """A campaign carried out."""

    manifest: Manifest
    quantity: str  #: That gives the loading.
    trials: tuple[TrialOutcome, ...]
    axes: tuple[AxisOutcome, ...]
    failures: tuple[str, ...]  #: Tasks that failed, with their reason.
    computed: int  #: Tasks done now.
    kept: int  #: Tasks known from before.
    cpu_s: float  #: Processor time of all tasks, also of those kept.


@dataclass(frozen=True)
class Task:
    """Something to compute: a function of plain arguments, its key, and what to call it."""

    key: str
    label: str
    function: Callable
    arguments: tuple = field(repr=False)


@dataclass(frozen=True)
class Progress:
    """Progress of a campaign: tasks done and in all, and the labels of those running."""

    done: int
    total: int
    running: tuple[str, ...]


def run_campaign(
    manifest: Manifest,
    store: ResultStore,
    executor: concurrent.futures.Executor,
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> CampaignOutcome:
    """Carry a campaign out; results in the store are not computed again."""
    # that of the first entry which names one
    quantity = next((t.loading[0] for t in manifest.trials if t.loading is not None), 'draft_factor')
    trials = _numbered(_without_copies([_prepared(entry, manifest, quantity) for entry in manifest.trials]))
    _check_drafts(trials)
    axes = {t.record.condition.series for t in trials if t.record is not None}
    if not axes:
        reasons = [f'{t.name}: {t.reason}' for t in trials]
        raise InputError(f'no trial of the campaign can be used: {first_of(reasons)}')
    work = _Work(store, executor, on_progress)
    plans = [_AxisPlan(axis, manifest, trials, work) for axis in sorted(axes)]
    work.total = sum(plan.task_count for plan in plans)
    found = [plan.carry_out(quantity) for plan in plans]
    if not any(found):
        raise InputError(f'no fit of the campaign succeeded: {first_of(work.failures)}')
    left_out = {name: reason for plan in plans for name, reason in plan.left_out.items()}
    trials = [t.left_out(left_out[str(t.record)]) if t.record and str(t.record) in left_out else t for t in trials]
    return CampaignOutcome(
        manifest,
        quantity,
        tuple(trials),
        tuple(a for a in found if a),
        tuple(work.failures),
        work.computed,
        work.kept,
        work.cpu_s,
    )


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
        problem = prepare([trial.axis(entry.axis)], entry.start, entry.end)
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
    record = Record(outcome.name, condition, entry.repeat or 0, trial.axis(entry.axis), problem)
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
                t = t.left_out(f'it has the same content as {original.name}: a copy is not a repeat')
        found.append(t)
    return found


def _numbered(trials: Sequence[TrialOutcome]) -> list[TrialOutcome]:
    """Give repeats without a number the next free one of their condition; refuse those taken twice."""
    stated = {(t.record.condition, t.record.repeat) for t in trials if t.record is not None}
    found, used = [], set()
    for t in trials:
        if (record := t.record) is not None:
            condition, number = record.condition, record.repeat
            numbers = [number] if number else [k for k in range(1, len(trials) + 2) if (condition, k) not in stated]
            free = next((k for k in numbers if (condition, k) not in used), None)
            if free is None:
                t = t.left_out(f'its condition and repeat ({record}) are those of another trial: give another repeat')
            else:
                used.add((condition, free))
                t = replace(t, record=replace(record, repeat=free))
        found.append(t)
    return found


def _timed(function: Callable, arguments: tuple) -> tuple[Any, float]:
    """Result, plain data, and the processor time that it took, s; runs in the worker."""
    began = time.process_time()
    return function(*arguments), time.process_time() - began


class _Work:
    """Gets results of tasks: from the store, or by the executor and then into the store."""

    def __init__(
        self, store: ResultStore, executor: concurrent.futures.Executor, on_progress: Callable[[Progress], None]
    ) -> None:
        self._store, self._executor, self._on_progress = store, executor, on_progress
        self._done = self.total = 0
        self.computed = self.kept = 0
        self.cpu_s = 0.0
        self.failures: list[str] = []

    def results(self, tasks: Sequence[Task]) -> dict[str, Any]:
        """Key to plain result of every task that succeeded."""
        tasks = list({task.key: task for task in tasks}.values())
        found, pending = {}, {}
        for task in tasks:
            kept = self._store.get(task.key)
            if kept is not None:
                found[task.key] = kept['result']
                self._count(kept['cpu_s'])
                self.kept += 1
        try:
            for task in tasks:
                if task.key not in found:
                    future = self._executor.submit(_timed, task.function, task.arguments)
                    if future.done():
                        self._finish(future, task, found)
                    else:
                        pending[future] = task
                    self._say(pending)
            while pending:
                finished, _ = concurrent.futures.wait(pending, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in finished:
                    self._finish(future, pending.pop(future), found)
                self._say(pending)
        except connection_losses() as error:
            raise InputError(
                'the connection to the Dask scheduler was lost: start it again, and give the same command again; '
                'it goes on from the results that are kept'
            ) from error
        except BrokenProcessPool as error:
            raise InputError(
                'a worker process was killed, perhaps because memory ran out: give the same command again, with '
                'fewer processes; it goes on from the results that are kept',
                'worker-killed',
            ) from error
        return found

    def _finish(self, future: concurrent.futures.Future, task: Task, found: dict[str, Any]) -> None:
        fatal: tuple[type[BaseException], ...] = (BrokenProcessPool, *connection_losses())
        try:
            result, cpu_s = future.result()
        except fatal:
            raise
        except InputError as error:
            self._fail(task, str(error))
        except Exception as error:  # noqa: BLE001 - one failed fit must not stop the others; its reason is reported
            self._fail(task, f'{type(error).__name__}: {error}')
        else:
            self._store.put(task.key, {'label': task.label, 'cpu_s': cpu_s, 'result': result})
            # read back, so that a result is the same whether it was computed now or before
            found[task.key] = self._store.get(task.key)['result']
            self._count(cpu_s)
            self.computed += 1

    def _fail(self, task: Task, reason: str) -> None:
        self.failures.append(f'{task.label}: {reason}')
        self._count(0.0)

    def _count(self, cpu_s: float) -> None:
        self._done += 1
        self.cpu_s += cpu_s

    def _say(self, pending: dict[concurrent.futures.Future, Task]) -> None:
        running = tuple(task.label for future, task in pending.items() if future.running())
        self._on_progress(Progress(self._done, max(self.total, self._done), running))


class _AxisPlan:
    """The tasks of one series: an axis at one speed."""

    def __init__(self, axis: str, manifest: Manifest, trials: Sequence[TrialOutcome], work: _Work) -> None:
        used = [(t.record, t) for t in trials if t.record is not None and t.record.condition.series == axis]
        used.sort(key=lambda pair: (pair[0].condition, pair[0].repeat))
        self._axis, self._manifest, self._work = axis, manifest, work
        self._records = [record for record, _ in used]
        self._ids = {str(record): _identity(t) for record, t in used}
        self._sources = {str(record): {'file': t.name, 'sha256': t.sha256} for record, t in used}
        self._names = list(manifest.equations)
        self._pruned: dict[float, Identification] = {}
        self.left_out: dict[str, str] = {}

    @property
    def task_count(self) -> int:
        """Tasks to come, at most."""
        groups = [g for g in (*self._conditions().values(), *self._drafts().values()) if len(g) > 1]
        equations = len(self._names) or 1
        pruned = 0 if self._names else len(self._drafts())
        return (
            pruned
            + len(self._records) * (len(self._manifest.objectives) * (equations + 1) + 1)
            + len(groups) * (equations + 1)
        )

    def carry_out(self, quantity: str) -> AxisOutcome | None:
        """Do everything; None where nothing succeeded."""
        if not self._names:
            self._prune()
        single = self._single_fits()
        self._drop_failed(single)
        if not self._records or not self._names:
            return None
        settled = self._settled(single)
        simulated = settled['simulation']
        groups = self._conditions() | self._drafts()
        together = self._together(groups, simulated)
        judgements = self._judged(simulated)
        records = tuple(self._records)
        order = [str(r) for r in records]
        fits = {objective: tuple(kept[o][1] for o in order) for objective, kept in settled.items()}
        by_draft = {k: v for k, v in together.items() if not isinstance(k, Condition)}
        if self._pruned:
            by_draft = {k: evaluation.with_open_choice(v, self._pruned[k]) for k, v in by_draft.items()}
        ranking = evaluation.rank_campaign(self._axis, list(by_draft.values()), fits['simulation'], judgements)
        if len(self._names) == 1:
            own = dict(zip(order, (only for (only,) in fits['simulation']), strict=True))
            joint = {k: only for k, (only,) in by_draft.items()}
            ranking = evaluation.with_verdicts(ranking, joint, own, bool(self._manifest.equations))
        choice = self._names.index(ranking.choice.name)
        schedule = evaluation.schedule_of(
            list(by_draft.values()),
            ranking.choice.name,
            list(by_draft),
            quantity,
            [self._provenance(group) for group in self._drafts().values()],
        )
        spreads = (
            evaluation.spread_of_repeats(condition, [fits['simulation'][order.index(str(r))][choice] for r in group])
            for condition, group in self._conditions().items()
            if len(group) > 1
        )
        return AxisOutcome(
            axis=self._axis,
            records=records,
            names=tuple(self._names),
            fits=fits,
            judgements=judgements,
            best=evaluation.best_repeats(records, fits['simulation']),
            together={k: v for k, v in together.items() if isinstance(k, Condition)},
            by_draft=by_draft,
            ranking=ranking,
            schedule=schedule,
            spreads=tuple(spread for group in spreads for spread in group),
        )

    def _settings(self, objective: str, equation: str = AUTO) -> IdentificationSettings:
        return IdentificationSettings(equation, objective, self._manifest.search)

    def _conditions(self) -> dict[Condition, list[Record]]:
        return _grouped(self._records, lambda record: record.condition)

    def _drafts(self) -> dict[float, list[Record]]:
        return dict(sorted(_grouped(self._records, lambda record: record.condition.loading).items()))

    def _fit_key(self, record: Record, objective: str, name: str) -> str:
        terms = equation_named(name).terms
        return key_of('fit', self._ids[str(record)], name, terms, objective, asdict(self._manifest.search))

    def _prune(self) -> None:
        """Choose the terms that the records of a draft show jointly; not of all drafts, whose ratios differ."""
        settings, tasks = self._settings('simulation'), {}
        for loading, group in self._drafts().items():
            ids = [self._ids[str(r)] for r in group]
            key = key_of('prune', ids, GENERAL_HULL.terms, asdict(self._manifest.search))
            label = f'{_place_name(loading)}, {len(group)} records, which terms'
            tasks[loading] = Task(key, label, evaluation.fit_one, (evaluation.joint_problem(group), settings))
        found = self._pruned = self._fits(tasks)
        failed = [str(r) for r in self._records if r.condition.loading not in found]
        self.left_out |= dict.fromkeys(failed, 'the fit of all records of its draft failed; see the failures')
        self._records = [r for r in self._records if str(r) not in failed]
        if found:
            with_friction = not self._manifest.search.preset  # the published ranges have none
            self._names = [evaluation.common_equation(self._pruned.values(), with_friction)]

    def _single_fits(self) -> dict:
        """(record, objective, equation) to key and fit."""
        tasks = {
            (str(record), objective, name): Task(
                self._fit_key(record, objective, name),
                f'{record}, {name}, {objective}',
                evaluation.fit_one,
                (record.problem, self._settings(objective, name)),
            )
            for record, objective, name in product(self._records, self._manifest.objectives, self._names)
        }
        return {place: (tasks[place].key, fit) for place, fit in self._fits(tasks).items()}

    def _fits(self, tasks: dict[Any, Task]) -> dict[Any, Identification]:
        """Place to fit of the tasks that succeeded."""
        results = self._work.results(list(tasks.values()))
        return {
            place: Identification.restored(results[task.key], *task.arguments)
            for place, task in tasks.items()
            if task.key in results
        }

    def _drop_failed(self, single: dict) -> None:
        """Leave out equations that failed on every record, and records on which another failed."""

        def failed(record: Record, name: str) -> bool:
            return any((str(record), objective, name) not in single for objective in self._manifest.objectives)

        self._names = [n for n in self._names if not all(failed(r, n) for r in self._records)]
        for record in list(self._records):
            names = [n for n in self._names if failed(record, n)]
            if names:
                self.left_out[str(record)] = f'the fit of {", ".join(names)} failed; see the failures'
                self._records.remove(record)

    def _needed(self, tasks: dict[Any, Task]) -> dict[Any, Any]:
        """Place to plain result of tasks that must not fail."""
        results = self._work.results(list(tasks.values()))
        for task in tasks.values():
            if task.key not in results:
                raise InputError(f'{task.label} failed: {self._work.failures[-1]}')
        return {place: results[task.key] for place, task in tasks.items()}

    def _in_order(self, tasks: dict[Any, Task]) -> dict:
        """Place to key and fits, in the order of the equations, of tasks that settle them."""
        found = {}
        for place, plain in self._needed(tasks).items():
            problem, fits = tasks[place].arguments
            settled = (
                Identification.restored(each, problem, fit.settings) for each, fit in zip(plain, fits, strict=True)
            )
            found[place] = tasks[place].key, tuple(settled)
        return found

    def _settled(self, single: dict) -> dict[str, dict]:
        """Objective to record to key and fits, in the order of the equations."""
        tasks = {}
        for record, objective in product(self._records, self._manifest.objectives):
            keys, fits = zip(*(single[str(record), objective, name] for name in self._names), strict=True)
            label = f'{record}, nested equations, {objective}'
            tasks[objective, str(record)] = Task(
                key_of('settle', keys), label, evaluation.settle, (record.problem, fits)
            )
        found: dict[str, dict] = {}
        for (objective, record), settled in self._in_order(tasks).items():
            found.setdefault(objective, {})[record] = settled
        return found

    def _together(self, groups: dict[Any, list[Record]], simulated: dict) -> dict:
        """Condition or draft to fits, in the order of the equations."""
        several = {place: group for place, group in groups.items() if len(group) > 1}
        problems = {place: evaluation.joint_problem(group) for place, group in several.items()}
        tasks = {}
        for place, group in several.items():
            keys, fits = zip(*(simulated[str(r)] for r in group), strict=True)
            for name, starts in zip(self._names, zip(*fits, strict=True), strict=True):
                label = f'{_place_name(place)}, {len(group)} records, {name}'
                tasks[place, name] = Task(
                    key_of('together', name, keys), label, evaluation.fit_together, (problems[place], starts)
                )
        results, orders = self._needed(tasks), {}
        for place, problem in problems.items():
            own = tuple(
                Identification.restored(results[place, name], problem, self._settings('simulation', name))
                for name in self._names
            )
            key = key_of('settle', [tasks[place, name].key for name in self._names])
            orders[place] = Task(key, f'{_place_name(place)}, nested equations', evaluation.settle, (problem, own))
        settled = self._in_order(orders)
        return {
            place: settled[place][1] if place in settled else simulated[str(group[0])][1]
            for place, group in groups.items()
        }

    def _judged(self, simulated: dict) -> tuple[tuple[evaluation.Judgement, ...], ...]:
        """Record to judgements, in the order of the records."""
        tasks = {}
        for group in self._conditions().values():
            for index, record in enumerate(group):
                other = group[(index + 1) % len(group)] if len(group) > 1 else None
                key, fits = simulated[str(record)]
                tasks[str(record)] = Task(
                    key_of('judge', key, self._ids[str(other)] if other else None),
                    f'{record}, forecasts',
                    evaluation.judge,
                    (fits, other.problem if other else None),
                )
        found = self._needed(tasks)
        return tuple(from_plain(tuple[evaluation.Judgement, ...], found[str(record)]) for record in self._records)

    def _provenance(self, group: Sequence[Record]) -> dict:
        return {
            'software': f'swath_sysid {__version__}',
            'campaign': self._manifest.title,
            'sources': [self._sources[str(r)] for r in group],
        }


def _grouped(records: Sequence[Record], key: Callable[[Record], Any]) -> dict[Any, list[Record]]:
    groups: dict[Any, list[Record]] = {}
    for record in records:
        groups.setdefault(key(record), []).append(record)
    return groups


def _place_name(place: Condition | float) -> str:
    return str(place) if isinstance(place, Condition) else f'all at {place:g}'


def _identity(trial: TrialOutcome) -> list:
    """All that a prepared record depends on."""
    e = trial.entry
    return [RESULT_FORMAT, __version__, trial.sha256, e.axis, e.start, e.end, e.frame, e.topic, e.columns]
