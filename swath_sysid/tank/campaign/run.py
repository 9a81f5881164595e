"""Running a campaign: what is asked for by the manifest, as tasks in their order, and what they give."""

import concurrent.futures
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

from swath_sysid import __version__
from swath_sysid.attitude.hull.catalogue import AUTO, GENERAL_HULL, equation_named, title_of
from swath_sysid.attitude.hull.identified_model import ScheduledModel
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import from_plain
from swath_sysid.tank.campaign import evaluation
from swath_sysid.tank.campaign.evaluation import Condition, TankRecord
from swath_sysid.tank.campaign.manifest import Manifest, first_of
from swath_sysid.tank.campaign.trials import TrialOutcome, prepared_trials
from swath_sysid.tank.campaign.work import Progress, ResultStore, Task, Work, key_of


@dataclass(frozen=True)
class AxisOutcome:
    """What a campaign found about one axis, at one speed."""

    axis: str  #: Name of the series: see `Condition.series`.
    records: tuple[TankRecord, ...]
    names: tuple[str, ...]
    fits: dict  #: Objective to record to equation, in the order of the names.
    judgements: tuple  #: TankRecord to equation, with the simulation objective.
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


def run_campaign(
    manifest: Manifest,
    store: ResultStore,
    executor: concurrent.futures.Executor,
    on_progress: Callable[[Progress], None] = lambda progress: None,
) -> CampaignOutcome:
    """Carry a campaign out; results in the store are not computed again."""
    quantity, trials = prepared_trials(manifest)
    axes = {t.record.condition.series for t in trials if t.record is not None}
    if not axes:
        reasons = [f'{t.name}: {t.reason}' for t in trials]
        raise InputError(f'no trial of the campaign can be used: {first_of(reasons)}')
    work = Work(store, executor, on_progress)
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
    )


class _AxisPlan:
    """The tasks of one series: an axis at one speed."""

    def __init__(self, axis: str, manifest: Manifest, trials: Sequence[TrialOutcome], work: Work) -> None:
        used = [(t.record, t) for t in trials if t.record is not None and t.record.condition.series == axis]
        used.sort(key=lambda pair: (pair[0].condition, pair[0].repeat))
        self._axis, self._manifest, self._work = axis, manifest, work
        self._records = [record for record, _ in used]
        self._ids = {str(record): t.identity for record, t in used}
        self._sources = {str(record): {'file': t.entry.path.name, 'sha256': t.sha256} for record, t in used}
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
        choice = self._names.index(ranking.choice.name)
        joint = {loading: own[choice] for loading, own in by_draft.items()}
        single_fits = [own[choice] for own in fits['simulation']]
        # of equations that are compared the page shows no verdicts of single records
        judged = dict(zip(order, single_fits, strict=True)) if len(self._names) == 1 else {}
        ranking = evaluation.with_verdicts(ranking, joint, judged)
        if not self._manifest.equations:
            name = title_of(ranking.choice.equation, self._records[0].condition.axis)
            ranking = replace(
                ranking,
                reason=f'the records give evidence for {name} of the general hull.',
            )
        drafts = zip(joint.values(), self._drafts().values(), strict=True)
        models = tuple(fit.identified_model(self._provenance(group)) for fit, group in drafts)
        spreads = (
            evaluation.spread_of_repeats(condition, [single_fits[order.index(str(r))] for r in group])
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
            schedule=ScheduledModel(quantity, tuple(joint), models),
            spreads=tuple(spread for group in spreads for spread in group),
        )

    def _settings(self, objective: str, equation: str = AUTO) -> IdentificationSettings:
        return IdentificationSettings(equation, objective, self._manifest.search)

    def _conditions(self) -> dict[Condition, list[TankRecord]]:
        return _grouped(self._records, lambda record: record.condition)

    def _drafts(self) -> dict[float, list[TankRecord]]:
        return dict(sorted(_grouped(self._records, lambda record: record.condition.loading).items()))

    def _fit_key(self, record: TankRecord, objective: str, name: str) -> str:
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

        def failed(record: TankRecord, name: str) -> bool:
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

    def _together(self, groups: dict[Any, list[TankRecord]], simulated: dict) -> dict:
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

    def _judged(self, simulated: dict) -> tuple[tuple[evaluation.FitJudgement, ...], ...]:
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
        return tuple(from_plain(tuple[evaluation.FitJudgement, ...], found[str(record)]) for record in self._records)

    def _provenance(self, group: Sequence[TankRecord]) -> dict:
        return {
            'software': f'swath_sysid {__version__}',
            'campaign': self._manifest.title,
            'sources': [self._sources[str(r)] for r in group],
        }


def _grouped(records: Sequence[TankRecord], key: Callable[[TankRecord], Any]) -> dict[Any, list[TankRecord]]:
    groups: dict[Any, list[TankRecord]] = {}
    for record in records:
        groups.setdefault(key(record), []).append(record)
    return groups


def _place_name(place: Condition | float) -> str:
    return str(place) if isinstance(place, Condition) else f'all at {place:g}'
