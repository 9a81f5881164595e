"""Refitting a craft's models on motion windows, and their replacement and rollback.

All decays that the windows have shown are fitted together; a window without one is identified in waves.
Its linear equivalent never replaces the model of a free decay, which covers other amplitudes too; a decay replaces
either.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import chdtri

from swath_sysid.attitude.hull.decay_model import DecayModel, Equation, amplitude_curves
from swath_sysid.attitude.hull.identified_model import IdentifiedModel, other_mounting
from swath_sysid.attitude.hull.terms import LOWER, TERM_NAMES, UPPER
from swath_sysid.attitude.identification.at_sea import (
    PERIOD_USABLE,
    SeaRecord,
    identify_seas,
    is_at_sea,
    prior_of,
)
from swath_sysid.attitude.identification.hull_terms import CHANCE
from swath_sysid.attitude.identification.identify import identify_problem
from swath_sysid.attitude.identification.live_decays import (
    HeldDecays,
    LiveDecay,
    checked_trial,
    decays_in,
    joint_problem,
    newest,
    window_source,
)
from swath_sysid.attitude.identification.motion_fit import SEARCH_STEPS_PER_PERIOD
from swath_sysid.attitude.identification.problem import Problem, block_means, motion_fit
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.identification.stability_watch import PeriodEstimate, StabilitySettings, StabilityWatch
from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.segmentation import FORCED_MOTION, explain_absence
from swath_sysid.attitude.motion.trial import AXES, Trial, about_sensor
from swath_sysid.attitude.motion.window import MotionTable
from swath_sysid.common.cancelling import Progress, ShouldCancel
from swath_sysid.common.conventions import ADEQUATE, LEVELS, LONGEST, REJECTED
from swath_sysid.common.errors import InputError


def misfit(problem: Problem, model: DecayModel) -> float:
    """Rms residual of a model on decays, weighted by noise, from its best initial states; infinite if it diverges."""
    of_model = replace(problem, friction_rate=model.friction_rate)
    squares = _least_squares(of_model, model.equation, [model], held=True)
    return float(np.sqrt(squares / sum(values.size for values in problem.weighted)))


def _least_squares(problem: Problem, equation: Equation, starts: Sequence[DecayModel], held: bool = False) -> float:
    """The least sum of squares of residuals, started from several hulls, whose ratios may be held."""
    fit, found = motion_fit(problem, equation), [float('inf')]
    for model in starts:
        parameters = fit.refine_states(fit.pack(model.ratios, problem.states))
        if not held:
            parameters, _ = fit.refine(parameters, LOWER[equation.indices], UPPER[equation.indices])
        residuals = np.concatenate(fit.residuals_and_jacobian(parameters)[0])
        # infinite where the motion runs away
        with np.errstate(over='ignore', invalid='ignore'):
            found.append(float(np.nan_to_num(residuals @ residuals, nan=np.inf)))
    return min(found)


def has_changed(problem: Problem, before: DecayModel, of_new: Identification, new: Sequence[int]) -> bool:
    """Whether new decays contradict the others by more than matters; ``new`` are their places in the problem.
    ``before`` is fitted to the others, ``of_new`` to the new ones. One hull for all against one for each part: the sums
    of squares differ by a chi-squared variable (Wilks 1938). The excess matters where it exceeds the new fit's motion
    error.
    """
    places = range(len(problem.motions))
    terms = [name for name in TERM_NAMES if name in (*before.equation.terms, *of_new.model.equation.terms)]
    equation, starts = Equation('', tuple(terms)), (before, of_new.model)
    parts = [_part(problem, each) for each in (places, [k for k in places if k not in new], new)]
    together, *apart = (_least_squares(part, equation, starts) for part in parts)
    measured = parts[0].weighted
    variance = sum(apart) / sum(values.size for values in measured) * of_new.samples / of_new.effective_samples
    by_chance = variance * chdtri(len(terms), CHANCE)
    matters = of_new.verdict.motion_error**2 * sum(values.size * np.var(values) for values in measured)
    return bool(together - sum(apart) > max(by_chance, matters))


def _part(problem: Problem, places: Sequence[int]) -> Problem:
    """Some decays of a problem, at the search's density, in which two hulls still differ."""
    period = 2.0 * np.pi / problem.scales.frequency
    motions = tuple(block_means(problem.motions[k], period, SEARCH_STEPS_PER_PERIOD) for k in places)
    return replace(problem, motions=motions, states=tuple(problem.states[k] for k in places))


def explains_better(found: Identification, held: DecayModel) -> bool:
    """Whether a fit explains its decays better than a model fitted to others, beyond chance. Twice the variable of
    `has_changed`, because both are uncertain.
    """
    terms = len(found.model.equation.terms)
    excess = 2.0 * float(chdtri(terms, CHANCE)) / found.effective_samples
    return bool(misfit(found.problem, found.model) ** 2 * (1.0 + excess) < misfit(found.problem, held) ** 2)


def motion_error(model: IdentifiedModel) -> float:
    """Expected error of the next release, a share of its motion; zero for a model that was given."""
    error = model.metrics.get('motion_error', 0.0)
    return float('inf') if error is None else float(error)


def reason_to_keep(current: IdentifiedModel | None, new: IdentifiedModel, is_contradicted: bool) -> str:
    """Why a model of free decays does not replace the current one; empty where it does. A rejected model replaces
    nothing, and none replaces a better verdict. Among equals a contradiction of the current model decides, otherwise
    the smaller motion error.
    """
    level = new.metrics['verdict']
    if level == REJECTED or not np.isfinite(new.model.natural_period):
        return verdict_text(new)
    if current is None or is_at_sea(current):
        return ''
    held = current.metrics.get('verdict', ADEQUATE)
    better = LEVELS.index(level) - LEVELS.index(held)
    if better < 0:
        return f'{verdict_text(new)}; the current model, which is {held}, stays'
    if better > 0 or is_contradicted or motion_error(new) < motion_error(current):
        return ''
    return (
        f'the current model knows the next release as well (to {motion_error(current):.1%} of its motion, with this '
        f'release {motion_error(new):.1%})'
    )


def verdict_text(model: IdentifiedModel) -> str:
    """The verdict of a model and its sentence."""
    return f'{model.metrics["verdict"]}: {model.metrics["verdict_sentence"]}'


def gain_text(current: IdentifiedModel | None, new: IdentifiedModel, releases: int) -> str:
    """What the last release added to the certainty, in words."""
    count = f'{releases} release{"s" if releases > 1 else ""}'
    if current is None or not 0.0 < motion_error(current) < np.inf:
        return count
    return f'{count}, the next one known to {motion_error(new):.1%} of its motion, {motion_error(current):.1%} before'


#: Codes of verdicts whose decays can be fitted together with the next release.
HARMLESS = ('adequate', 'motion-uncertain')


@dataclass(frozen=True)
class RefitSettings:
    """Axes and settings of a refit."""

    axes: tuple[str, ...] = AXES  #: Those to identify.
    identification: IdentificationSettings = field(default_factory=IdentificationSettings)
    stability: StabilitySettings = field(default_factory=StabilitySettings)

    def __post_init__(self):
        unknown = [axis for axis in self.axes if axis not in AXES]
        if unknown or not self.axes or len(set(self.axes)) < len(self.axes):
            raise InputError(f'axes must be one or both of {", ".join(AXES)}, each once, not {list(self.axes)}')


@dataclass(frozen=True)
class RefitRequest:
    """The input of a refit."""

    windows: tuple[MotionTable, ...]  #: Oldest first.
    current: dict[str, IdentifiedModel]
    held: dict[str, HeldDecays]
    settings: RefitSettings
    is_asked: bool = True  #: Otherwise only waves and decays for which a window was published are fitted.
    source: dict = field(default_factory=dict)  #: Source of the windows for provenance, such as their topic.
    software: str = ''  #: Name and version.


@dataclass(frozen=True)
class AxisVerdict:
    """The finding of a refit about one axis."""

    axis: str
    model: IdentifiedModel | None  #: To be published; None: the current one stays.
    message: str  #: The finding in one clause.
    decays: HeldDecays | None = None  #: To be held from now on; None: no change.
    #: Of the natural period, whether or not the model is to be published; None where it is not known.
    estimate: PeriodEstimate | None = None
    is_absent: bool = False  #: Whether the window showed nothing of this axis that could be fitted.


@dataclass(frozen=True)
class RefitOutcome:
    """The findings of a refit."""

    verdicts: tuple[AxisVerdict, ...]
    installation: Installation | None = None  #: Of the sensor.

    @property
    def models(self) -> dict[str, IdentifiedModel]:
        """Axis to the models that are to replace the current ones."""
        return {verdict.axis: verdict.model for verdict in self.verdicts if verdict.model is not None}

    @property
    def succeeded(self) -> bool:
        """Whether any axis has a new model."""
        return bool(self.models)

    @property
    def message(self) -> str:
        """One line for people, what is published first."""
        shown = [verdict for verdict in self.verdicts if not verdict.is_absent]
        clauses = [f'{each.axis}: {each.message}' for each in sorted(shown, key=lambda each: each.model is None)]
        absent = [each for each in self.verdicts if each.is_absent]
        clauses += [f'{each.axis}: {"no free decay" if shown else each.message}' for each in absent]
        return '; '.join(clauses) or 'no axis that is identified has moved: see the parameter axes'


def refit(
    request: RefitRequest, *, progress: Progress | None = None, should_cancel: ShouldCancel | None = None
) -> RefitOutcome:
    """Fit the decays held and those of the windows, and compare with the current models. What cannot be fitted is
    reported in its verdict. Raises `InputError` for an empty window, and `Cancelled`.
    """
    trials = [checked_trial(table) for table in request.windows]
    noticed = {table.noticed.axis for table in request.windows if table.noticed is not None}
    axes = [axis for axis in request.settings.axes if request.is_asked or not noticed or axis in noticed]
    verdicts = []
    for index, axis in enumerate(axes):

        def report(share: float, index: int = index):
            if progress is not None:
                progress((index + share) / len(axes))

        try:
            decays = _decays_seen(axis, request, trials)
            verdict = _refit_axis(trials[-1], axis, decays, request, report, should_cancel)
            if verdict.model is not None and (about := about_sensor(axis, trials[-1].installation)):
                verdict = replace(verdict, message=f'{verdict.message}, {about}')
            verdicts.append(verdict)
        except InputError as error:
            verdicts.append(AxisVerdict(axis, None, f'not fitted, {error}'))
        report(1.0)
    return RefitOutcome(tuple(verdicts), trials[-1].installation)


def _decays_seen(axis: str, request: RefitRequest, trials: list[Trial]) -> tuple[LiveDecay, ...]:
    found: list[LiveDecay] = []
    for table, trial in zip(request.windows, trials, strict=True):
        noticed = table.noticed is not None and table.noticed.axis == axis
        if noticed or (request.is_asked and table.noticed is None):
            found += decays_in(table, trial, axis, window_source(table, request.source))
    return tuple(found)


def _refit_axis(
    trial: Trial,
    axis: str,
    seen: Sequence[LiveDecay],
    request: RefitRequest,
    progress: Progress,
    should_cancel: ShouldCancel | None,
) -> AxisVerdict:
    """Of one axis; ``trial`` is the newest window's, ``seen`` are the decays of all."""

    def fit(decays: Sequence[LiveDecay], done: float):
        settings, report = request.settings.identification, lambda share: progress(done + 0.5 * share)
        return identify_problem(joint_problem(decays), settings, progress=report, should_cancel=should_cancel)

    held = request.held.get(axis, HeldDecays())
    # a window that starts amid an oscillation holds the tail of a release that is held already
    old, new = held.with_new([each for each in seen if each.has_begun or not held.decays])
    if not seen:
        absence = explain_absence(trial.axis(axis))
        if absence.code == FORCED_MOTION:
            return _refit_at_sea(trial, axis, request, progress, should_cancel)
        if not held.decays or not request.is_asked:
            return AxisVerdict(axis, None, f'not fitted, {absence.message}', is_absent=True)
    if not new and not request.is_asked:
        return AxisVerdict(axis, None, 'not fitted, this release is among those fitted before')
    decays = newest((*old, *new))
    new = tuple(each for each in decays if each in new)
    changed, of_new = False, None
    if 0 < len(new) < len(decays) and held.model is not None:
        of_new = fit(new, 0.0)
        places = [decays.index(each) for each in new]
        changed = of_new.verdict.level != REJECTED and has_changed(joint_problem(decays), held.model, of_new, places)
    if of_new is not None and changed and of_new.verdict.level == ADEQUATE:
        found, fitted = of_new, new
    else:
        found, fitted = fit(decays, 0.5), decays
    verdict = _judged(axis, found, fitted, changed, held, request)
    return replace(verdict, estimate=_period_at_reference(of_new or found, request.windows[-1]) if new else None)


def _judged(
    axis: str,
    found: Identification,
    decays: tuple[LiveDecay, ...],
    changed: bool,
    held: HeldDecays,
    request: RefitRequest,
) -> AxisVerdict:
    """Whether a fit of decays replaces the current model."""
    current = request.current.get(axis)
    if current is not None and not held.decays and not is_at_sea(current):
        changed = explains_better(found, current.model)
    model = found.identified_model({'software': request.software, 'sources': [each.source for each in decays]})
    kept = HeldDecays(decays, found.model)
    reason = reason_to_keep(current, model, changed)
    if reason:
        certain = found.verdict.code in HARMLESS
        return AxisVerdict(axis, None, f'not published, {reason}', kept if certain else None)
    anew = ''
    if changed:
        before = (
            'decays before contradict this one and are'
            if held.decays
            else 'current model contradicts this decay and is'
        )
        anew, current = f'the {before} forgotten; ', None
    terms = f'{model.model.equation.name}, period {model.model.natural_period:.3f} s'
    message = f'{anew}{verdict_text(model)}; {gain_text(current, model, len(decays))} ({terms})'
    return AxisVerdict(axis, model, message, kept)


def _period_at_reference(found: Identification, table: MotionTable) -> PeriodEstimate | None:
    """The period at the decays' amplitude, unless the fit is rejected or too uncertain."""
    amplitude = found.reference_amplitude
    period, _, std, _ = found.bands.at(amplitude)
    if found.verdict.level == REJECTED or not 0.0 < std < PERIOD_USABLE * period:
        return None
    begin, end = table.rows[[0, -1], 0].tolist()
    return PeriodEstimate(begin, end, period, std, amplitude)


def _refit_at_sea(
    trial: Trial, axis: str, request: RefitRequest, progress: Progress, should_cancel: ShouldCancel | None
) -> AxisVerdict:
    record, newest_window, held = SeaRecord.of(trial, axis), request.windows[-1], request.current.get(axis)
    try:
        prior = None if held is None or is_at_sea(held) else prior_of(held, record.motion)
        found = identify_seas([record], prior, searched=True, progress=progress, should_cancel=should_cancel)
    except InputError as error:
        raise InputError(
            f'{error}; if the window is too short, start with a longer one (window_s of imu_buffer, such as 600.0), '
            'and identify when it is full'
        ) from error
    estimate = None
    if found.has_period:
        begin, end = newest_window.rows[[0, -1], 0].tolist()
        estimate = PeriodEstimate(begin, end, found.natural_period, found.natural_period_std, found.amplitude)
    summary = (
        f'at sea, equivalent linear at {np.degrees(found.amplitude):.2g} deg: period {found.natural_period:.3f} +- '
        f'{found.natural_period_std:.2g} s, damping ratio {found.damping_ratio:.3f} +- {found.damping_ratio_std:.2g}'
    )
    better = refusal = ''
    if not found.is_usable:
        refusal = 'this sea does not determine the hull'
        summary = '; '.join(each.message for each in found.shortcomings)
    elif held is not None and not is_at_sea(held):
        refusal = f'the model of the free decay stays, {_equivalent_text(held, found.amplitude)}'
    elif held is not None:
        # twice, as in `explains_better`: both are uncertain
        gain = found.gain_over(held.model)
        better = f', log-likelihood {gain:.0f} higher'
        if gain < chdtri(2, CHANCE):
            refusal = 'the current model explains the window as well'
    if refusal:
        return AxisVerdict(axis, None, f'not published, {refusal} ({summary})', estimate=estimate)
    provenance = {'software': request.software, 'sources': [window_source(newest_window, request.source)]}
    return AxisVerdict(axis, found.identified_model(provenance), f'{summary}{better}', estimate=estimate)


def _equivalent_text(held: IdentifiedModel, amplitude: float):
    """A model's period and damping at an amplitude, in words."""
    curves = amplitude_curves(held.model.ratios, np.array([amplitude]), held.model.friction_rate)
    period, damping = 2.0 * np.pi / float(curves.frequency[0]), float(curves.damping_ratio[0])
    return f'which there has period {period:.3f} s and damping ratio {damping:.3f}'


def warm_up() -> None:
    """A small refit of a simulated decay that loads and compiles everything for the next one."""
    time = np.arange(0.0, 8.0, 0.05)
    decay = 0.1 * np.exp(-0.2 * time)
    rows = np.full((time.size, 8), np.nan)
    rows[:, 0] = time
    rows[:, 1] = decay * np.cos(3.0 * time)
    rows[:, 3] = -decay * (0.2 * np.cos(3.0 * time) + 3.0 * np.sin(3.0 * time))
    settings = RefitSettings(axes=AXES[:1], identification=IdentificationSettings(search=SearchSettings(generations=2)))
    refit(RefitRequest((MotionTable(rows, 0),), {}, {}, settings))


def _of_sensor(models: Mapping[str, IdentifiedModel], installation: Installation | None) -> dict[str, IdentifiedModel]:
    """The models that were not identified with another mounting than a sensor has now."""
    return {axis: each for axis, each in models.items() if not other_mounting(each, installation)}


class Refitter:
    """Models by axis and their changes by refits, with the decays behind them and a history, oldest first."""

    def __init__(
        self,
        settings: RefitSettings | None = None,
        models: Mapping[str, IdentifiedModel] | None = None,
        history: Sequence[dict[str, IdentifiedModel]] = (),
    ):
        self.settings = settings or RefitSettings()
        self.models = dict(models or {})
        self.decays: dict[str, HeldDecays] = {}
        self.version = 0
        self.stability = StabilityWatch()
        self._history = deque(((each, dict[str, HeldDecays]()) for each in history), LONGEST)
        self._undone: list[tuple[dict[str, IdentifiedModel], dict[str, HeldDecays]]] = []
        self._forgot = False

    def request(self, *windows: MotionTable, is_asked: bool = True, **origin: Any) -> RefitRequest:
        """What `refit` needs for windows, oldest first; ``origin`` as in `RefitRequest`."""
        self._forgot = False
        current = _of_sensor(self.models, windows[-1].installation)
        return RefitRequest(windows, current, dict(self.decays), self.settings, is_asked, **origin)

    def take(self, outcome: RefitOutcome) -> bool:
        """Accept an outcome of `refit` and update the stability watch; True where the models are to be published."""
        self.stability.settings = self.settings.stability
        before = self.models, self.decays
        for verdict in outcome.verdicts:
            if verdict.axis == 'roll' and verdict.estimate is not None:
                self.stability.add(verdict.estimate)
            if verdict.decays is not None and not self._forgot:
                self.decays = {**self.decays, verdict.axis: verdict.decays}
        if not outcome.succeeded:
            return False
        self._history.append(before)
        self._undone.clear()
        self.models = {**_of_sensor(self.models, outcome.installation), **outcome.models}
        self.version += 1
        return True

    def forget_decays(self) -> None:
        """Start a new fit with the next release, also while a refit runs; the models stay."""
        self.decays, self._forgot = {}, True

    def rollback(self) -> bool:
        """Return to the models and decays before the last accepted refit; True where there was one."""
        if not self._history:
            return False
        self._undone.append((self.models, self.decays))
        self.models, self.decays = self._history.pop()
        self.version += 1
        return True

    def undo_rollback(self) -> bool:
        """Return to what the last `rollback` withdrew; True where nothing was identified since."""
        if not self._undone:
            return False
        self._history.append((self.models, self.decays))
        self.models, self.decays = self._undone.pop()
        self.version += 1
        return True

    @property
    def described(self) -> str:
        """The models held, for people."""
        return ', '.join(f'{axis} {held.model.equation.name}' for axis, held in self.models.items()) or 'no model'

    @property
    def steps_back(self) -> int:
        """How often `rollback` can be called."""
        return len(self._history)

    @property
    def steps_forward(self) -> int:
        """How often `undo_rollback` can be called."""
        return len(self._undone)
