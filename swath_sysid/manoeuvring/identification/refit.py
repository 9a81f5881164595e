"""Refits a manoeuvring model on a window of live motion, accepts it if it is better, and returns to earlier models."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from swath_sysid.common.conventions import LONGEST, REJECTED
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.hull.model import preset
from swath_sysid.manoeuvring.hull.simulation import simulate
from swath_sysid.manoeuvring.identification.identify import identify_manoeuvring
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.identification.validation import Scores, score
from swath_sysid.manoeuvring.motion.intake import prepare
from swath_sysid.manoeuvring.motion.resampling import LONGEST_GAP
from swath_sysid.manoeuvring.motion.trial import CHANNELS, CraftRun, ManoeuvringTrial

PIECE = 60.0  #: s; least motion for a refit, and length of the runs that it is cut into; a third of them validates.


@dataclass(frozen=True)
class ManoeuvreRefitRequest:
    """Input of a refit."""

    trial: ManoeuvringTrial
    current: IdentifiedManoeuvringModel | None  #: The model in use.
    settings: ManoeuvringSettings = ManoeuvringSettings()
    least_improvement: float = 0.001  #: Least relative reduction of the misfit on held-out motion.
    provenance: dict = field(default_factory=dict)


@dataclass(frozen=True)
class ManoeuvreRefitOutcome:
    """Result of a refit."""

    model: IdentifiedManoeuvringModel | None  #: To be published; None: the current one stays.
    message: str
    misfit: float = float('nan')  #: Of free simulation on held-out motion, over the noise of the new model.
    current_misfit: float = float('nan')  #: The same of the current model; NaN without one.


def refit_manoeuvring(
    request: ManoeuvreRefitRequest,
    *,
    progress: Callable[[float], object] | None = None,
    should_cancel: Callable[[], bool] | None = None,
) -> ManoeuvreRefitOutcome:
    """Identify on a window, and compare with the current model on the part of it that was held out."""
    runs = pieces(prepare(request.trial))
    found = identify_manoeuvring(runs, request.settings, progress=progress, should_cancel=should_cancel)
    held_out = found.validated_on or found.identified_on
    scores = found.validation or found.identification
    r2 = {name: scores.r2[name] for name in CHANNELS if np.isfinite(scores.r2[name])}
    summary = f'{len(found.names)} numbers from {sum(run.duration for run in found.identified_on):.0f} s, r2 '
    summary += ', '.join(f'{name.replace("_", " ")} {value:.3f}' for name, value in r2.items())
    if found.verdict.level == REJECTED:
        return ManoeuvreRefitOutcome(None, f'not published, {found.verdict} ({summary})')
    held = request.current
    misfit = _misfit(scores, found.noise)
    current_misfit = float('nan')
    if held is not None and held.model.thrust_input != found.model.thrust_input:
        held = None
    if held is not None:
        # in today's current, which favours neither
        same_water = replace(held.model, current=found.model.current)
        current_misfit = _misfit(score(same_water, held_out, request.settings.window), found.noise)
        if not misfit < (1.0 - request.least_improvement) * current_misfit:
            message = (
                f'not published, the current model explains the motion held out as well (misfit '
                f'{current_misfit:.4g}, new {misfit:.4g})'
            )
            return ManoeuvreRefitOutcome(None, message, misfit, current_misfit)
    better = '' if held is None else f', misfit {misfit:.4g} instead of {current_misfit:.4g}'
    model = found.identified({'r2': r2, 'held_out': bool(found.validated_on)}, request.provenance)
    return ManoeuvreRefitOutcome(model, f'{summary}{better}; {found.verdict}', misfit, current_misfit)


def pieces(run: CraftRun) -> list[CraftRun]:
    """One run of at least `PIECE` as several, cut at gaps in the odometry and about every `PIECE` seconds."""
    if run.duration < PIECE:
        raise InputError(f'{run.duration:.0f} s are too short: drive {PIECE:.0f} s or more, straight and in zig-zags')
    known = np.isfinite(run.channels).any(axis=0)
    places = np.flatnonzero(known)
    breaks = places[1:][np.diff(places) * run.step > LONGEST_GAP]
    edges = [places[0], *breaks, places[-1] + 1]
    found: list[CraftRun] = []
    for begin, end in pairwise(edges):
        last = places[places < end][-1] + 1
        count = max(1, round((last - begin) * run.step / PIECE))
        for a, b in pairwise(np.linspace(begin, last, count + 1).astype(int)):
            found.append(_part(run, slice(a, b), len(found)))
    return [part for part in found if part.duration >= 0.25 * PIECE]


def _part(run: CraftRun, span: slice, number: int):
    cut: dict[str, Any] = {
        name: values[..., span] for name, values in vars(run).items() if isinstance(values, np.ndarray)
    }
    return replace(run, **cut, source=f'{run.source} part {number + 1}')


def _misfit(scores: Scores, noise: np.ndarray):
    """Root mean square over the channels of simulation error over noise; infinite where a window diverged."""
    if scores.diverged:
        return float('inf')
    shares = [scores.rmse[name] / size for name, size in zip(CHANNELS, noise, strict=True)]
    return float(np.sqrt(np.nanmean(np.square(shares))))


def warm_up() -> None:
    """Simulates a craft for an instant, so that the next refit finds everything loaded and compiled."""
    simulate(preset('wamv-vrx-old'), np.zeros(2), np.zeros(2), 0.1)


class ManoeuvreRefitter:
    """The current manoeuvring model of a craft and its ``history``, oldest first."""

    def __init__(
        self, model: IdentifiedManoeuvringModel | None = None, history: Sequence[IdentifiedManoeuvringModel] = ()
    ):
        self.model, self._history = model, deque(history, LONGEST)

    def take(self, outcome: ManoeuvreRefitOutcome) -> bool:
        """Accept a refit that found a better model; whether it did."""
        if outcome.model is None:
            return False
        if self.model is not None:
            self._history.append(self.model)
        self.model = outcome.model
        return True

    def rollback(self) -> bool:
        """Return to the previous model; whether there was one."""
        if not self._history:
            return False
        self.model = self._history.pop()
        return True

    @property
    def steps_back(self) -> int:
        """How often `rollback` can be called."""
        return len(self._history)

    @property
    def described(self) -> str:
        """The current model in words."""
        if self.model is None:
            return 'no model'
        known = f' ({self.model.verdict})' if self.model.verdict else ''
        return f'{", ".join(self.model.names) or "a model"}{known}'
