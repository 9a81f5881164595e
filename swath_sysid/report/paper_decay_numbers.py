"""What is compared in a study of free decays: coefficients, trends, and rates one step ahead."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swath_sysid.attitude.hull.catalogue import equation_named
from swath_sysid.attitude.identification.forecast_check import next_step
from swath_sysid.campaign.papers.decay_study import COEFFICIENTS
from swath_sysid.common.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from swath_sysid.campaign.papers.decay_study import DecayStudy, StudiedRecord
    from swath_sysid.campaign.papers.publication import PrintedTable

STEADY = 0.2  #: A curve that changes by less than this share of its largest value hardly changes.

GENETIC, OURS, HULL = 'genetic', 'ours', 'hull'
BY = {GENETIC: "the study's method", OURS: 'the simulated motion'}


def coefficient(study: DecayStudy, record: StudiedRecord, name: str, by: str) -> tuple[float, float]:
    """Value and standard deviation of N, W, x, C1 to C3 with the study's inertia, or of I' of its search; NaN: none."""
    nothing = float('nan'), float('nan')
    if name == "I'":
        return (study.chosen(record).genetic.inertia, float('nan')) if by == GENETIC else nothing
    if by == OURS:
        terms = {t: record.ours.ratio(t) for t in record.ours.model.terms}
    else:
        ratios = record.hull.terms if by == HULL else study.chosen(record).genetic.ratios
        terms = {t: (value, float('nan')) for t, value in ratios.items()}
    for term, (value, std) in terms.items():
        printed, factor = COEFFICIENTS[term]
        if printed == name:
            return value * study.inertia * factor, std * study.inertia * factor
    return nothing


def coefficient_names(study: DecayStudy) -> list[str]:
    """Names of the coefficients of the chosen equation, as the study orders them."""
    used = {COEFFICIENTS[t][0] for t in equation_named(study.publication.chosen).terms}
    return [name for name in ('N', 'W', 'x', 'C1', 'C2', 'C3') if name in used]


def trend_of(values: ArrayLike, steady: float = STEADY) -> str:
    """How a curve runs: ``falls``, ``rises then falls``, ``mixed``; ``steady`` within a share of its largest value."""
    values = np.asarray(values, dtype=float)
    if np.ptp(values) <= steady * np.abs(values).max():
        return 'steady'
    ways = ['rises' if step > 0.0 else 'falls' for step in np.diff(values) if step]
    turns = [way for k, way in enumerate(ways) if way != ways[k - 1] or k == 0]
    return ' then '.join(turns) if len(turns) <= 2 else 'mixed'


def next_step_errors(study: DecayStudy, record: StudiedRecord, ratios: dict[str, float] | None) -> np.ndarray:
    """Relative errors, shape (N,), one step ahead at the printed times; ``ratios`` None: of an unchanged rate."""
    checked = next_steps(study, record, ratios)
    return np.abs(checked[2] - checked[1]) / np.abs(checked[1])


def printed_steps(study: DecayStudy) -> PrintedTable:
    """The table of the rate one step ahead, of a study that has one."""
    table = study.publication.next_step
    if table is None:
        raise InputError(f'{study.publication.title} prints no rate one step ahead')
    return table


def next_steps(
    study: DecayStudy, record: StudiedRecord, ratios: dict[str, float] | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time since release, measured and predicted rate at the times that the study prints."""
    motion, printed = record.problem.motions[0], printed_steps(study)
    model = record.hull.with_trim(record.problem.states[0].trim)
    found = next_step(model.from_terms(equation_named(study.publication.chosen), ratios or {}, trim=model.trim), motion)
    predicted = found.predicted if ratios else np.asarray(motion.rate)[:-1]
    since = found.time - motion.time[0]
    at = [int(np.argmin(np.abs(since - t))) for t, *_ in printed.rows]
    return since[at], found.measured[at], predicted[at]


def checked_models(study: DecayStudy) -> tuple[StudiedRecord, tuple]:
    """The record of the next-step check, and the ratios by the study's method and ours; None: an unchanged rate."""
    printed = printed_steps(study)
    record = study.at(printed.draft_factor, printed.angle_deg)
    ours = record.ours.model.terms
    return record, (study.chosen(record).genetic.ratios, ours, None)
