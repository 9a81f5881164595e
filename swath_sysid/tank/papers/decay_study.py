"""A published study of free decays, repeated: its trials simulated, then searched by its method and fitted by ours.

The printed hull is released as printed, with white noise of the rate from the printed objective value of each record:
one step ahead the noise sets it, as the difference of two readings. How the ratios follow the draft is assumed.
"""

from collections.abc import Callable
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS, equation_named
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.attitude.hull.decay_model import DecayModel, Equation
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.identification import search
from swath_sysid.attitude.identification.forecast_check import OneStepObjective
from swath_sysid.attitude.identification.identify import identify_problem
from swath_sysid.attitude.identification.problem import Problem, prepare
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
from swath_sysid.tank.papers.publication import DecayPublication, decay_publication

OTHER_SEEDS = (101, 102, 103)


@dataclass(frozen=True)
class Optimum:
    """What a search of the published objective ended with."""

    value: float  #: rad/s.
    inertia: float  #: The I' at which it stopped.
    ratios: dict


@dataclass(frozen=True)
class SearchedEquation:
    """One equation on one record by the published objective."""

    genetic: Optimum  #: With the study's budget and ranges.
    swarm: Optimum
    exact: Optimum  #: By bounded least squares; its inertia is NaN.


@dataclass(frozen=True)
class StudiedRecord:
    """One condition of the study: its best repeat, searched with every equation, and fitted our way."""

    draft_factor: float
    angle_deg: float
    repeat: int
    hull: DecayModel  #: The simulated one.
    problem: Problem
    searched: dict
    ours: Identification  #: Of the chosen equation, by the simulated motion.


def hull_at(name: str, draft_factor: float) -> DecayModel:
    """The published hull at a multiple of its design draft."""
    model, powers = PUBLISHED_HULLS[name].model, decay_publication(name).draft_powers
    ratios = {term: value * draft_factor ** powers.get(term, 0.0) for term, value in model.terms.items()}
    return DecayModel.from_terms(model.equation, ratios, axis=model.axis)


def study_record(name: str, draft_factor: float, angle_deg: float, seed: int) -> StudiedRecord:
    """One condition: simulate its repeats, keep the best, search every equation, and fit the chosen one our way."""
    publication = decay_publication(name)
    printed = publication.printed_objective[draft_factor, angle_deg]
    hull = hull_at(name, draft_factor)
    problems = [
        _record(publication, hull, angle_deg, min(printed.values()), 100 * seed + repeat)
        for repeat in range(publication.repeats)
    ]
    chosen = equation_named(publication.chosen)
    repeat = int(np.argmin([_exact(p, chosen).value for p in problems]))
    problem = problems[repeat]
    searched = {e: _searched(problem, equation_named(e), name, seed) for e in publication.equations}
    ours = identify_problem(problem, IdentificationSettings(publication.chosen))
    return StudiedRecord(draft_factor, angle_deg, repeat + 1, hull, problem, searched, ours)


def _record(publication: DecayPublication, hull: DecayModel, angle_deg: float, objective_value: float, seed: int):
    """A simulated record, cut from the release to the duration of the study."""
    noise = SensorNoise(rate=objective_value / np.sqrt(2.0))
    trial = simulated_trial(hull, np.radians(angle_deg), publication.duration_s, noise=noise, seed=seed)
    return prepare([trial.axis(hull.axis)], 0.0, publication.duration_s)


def objective_of(problem: Problem) -> OneStepObjective:
    """The published objective of a record."""
    return OneStepObjective.of(problem.motions, [s.trim for s in problem.states], problem.friction_rate)


def _exact(problem: Problem, equation: Equation):
    """The least value within the published ranges, in which a ratio is only bound to be positive."""
    objective = objective_of(problem)
    ratios = objective.minimum(equation, np.zeros(len(TERM_NAMES)), np.full(len(TERM_NAMES), np.inf))
    return Optimum(float(objective(ratios[None])[0]), float('nan'), _by_name(equation, ratios))


def _by_name(equation: Equation, ratios: np.ndarray):
    return {term: float(ratios[k]) for term, k in zip(equation.terms, equation.indices, strict=True)}


def _searched(problem: Problem, equation: Equation, name: str, seed: int):
    # none is printed for the swarm
    budget = search.PRESETS[name].genetic
    swarm = search.SearchSettings('pso', generations=budget.generations, population=budget.population, seed=seed)
    return SearchedEquation(
        genetic=searched_optimum(problem, equation, name, search.SearchSettings(preset=name, seed=seed)),
        swarm=searched_optimum(problem, equation, name, swarm),
        exact=_exact(problem, equation),
    )


def searched_optimum(problem: Problem, equation: Equation, name: str, settings: search.SearchSettings) -> Optimum:
    """Search the published objective in the published variables and ranges."""
    space, objective = search.published_space(equation, search.PRESETS[name], problem.scales), objective_of(problem)
    found = search.run_search(lambda c: objective(search.full_ratios(c, equation, problem.scales)), space, settings)
    ratios = search.full_ratios(space.to_ratios(found.best[None]), equation, problem.scales)[0]
    return Optimum(found.value, float(found.best[0]), _by_name(equation, ratios))


@dataclass(frozen=True)
class DecayStudy:
    """A study carried out again."""

    publication: DecayPublication
    records: tuple[StudiedRecord, ...]  #: In the order of the printed objective values.
    #: I' at which searches with other seeds stop, on the record of the printed coefficients.
    inertias: tuple[float, ...]

    def at(self, draft_factor: float | None, angle_deg: float | None) -> StudiedRecord:
        """The record of one condition."""
        return next(r for r in self.of_draft(draft_factor) if r.angle_deg == angle_deg)

    def of_draft(self, draft_factor: float | None) -> list[StudiedRecord]:
        """The records of one draft, by angle."""
        return sorted((r for r in self.records if r.draft_factor == draft_factor), key=lambda r: r.angle_deg)

    @property
    def inertia(self) -> float:
        """I' that the coefficients are shown with: as printed, or as the catalogue assumes; 0.09 where neither is."""
        form = PUBLISHED_HULLS[self.publication.name].form
        return 0.09 if form is None else form.inertia

    def chosen(self, record: StudiedRecord) -> SearchedEquation:
        """The searches of the chosen equation on a record."""
        return record.searched[self.publication.chosen]


def run_decay_study(
    name: str, executor: Executor, note: Callable[[int, int], None] = lambda done, total: None
) -> DecayStudy:
    """Carry a study out again."""
    publication = decay_publication(name)
    places = list(publication.printed_objective)
    futures = [executor.submit(study_record, name, *place, seed) for seed, place in enumerate(places, start=1)]
    for done, _ in enumerate(as_completed(futures), start=1):
        note(done, len(futures))
    records = tuple(f.result() for f in futures)
    printed = publication.coefficients
    problem = DecayStudy(publication, records, ()).at(printed.draft_factor, printed.angle_deg).problem
    equation = equation_named(publication.chosen)
    found = [searched_optimum(problem, equation, name, search.SearchSettings(preset=name, seed=s)) for s in OTHER_SEEDS]
    return DecayStudy(publication, records, tuple(f.inertia for f in found))
