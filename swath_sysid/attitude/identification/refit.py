"""Refitting a craft's model on a new window: what is fitted, what is accepted, and the way back.

A window that holds motion in waves instead of a free decay is identified at sea. The linear equivalent that
this gives never replaces the model of a free decay, which covers other amplitudes too; a decay replaces either.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtri

from swath_sysid.attitude.hull.amplitude import amplitude_curves
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.at_sea import (
    PERIOD_USABLE,
    AtSeaIdentification,
    gain_over,
    identify_at_sea,
    is_at_sea,
)
from swath_sysid.attitude.identification.fit_quality import REJECTED
from swath_sysid.attitude.identification.identify import Identification, IdentificationSettings, identify_problem
from swath_sysid.attitude.identification.motion_fit import MotionFit
from swath_sysid.attitude.identification.problem import Problem, decays_or_waves
from swath_sysid.attitude.identification.sea_motion import Heave, heave_of
from swath_sysid.attitude.identification.search import SearchSettings
from swath_sysid.attitude.identification.stability_watch import PeriodEstimate, StabilitySettings, StabilityWatch
from swath_sysid.attitude.motion.sensor_checks import OFFSET_CODES, RATE_CODES, contradictions_in, refuse_contradictions
from swath_sysid.attitude.motion.sensor_mount import Installation
from swath_sysid.attitude.motion.trial import AXES, AxisMotion, Trial
from swath_sysid.attitude.motion.window import MotionTable
from swath_sysid.common.errors import InputError
from swath_sysid.common.stopping import Progress, ShouldCancel

LONGEST_HISTORY = 20

BY_CHANCE = 0.01  #: Probability of taking the luck of a new fit on its own window for an improvement.


@dataclass(frozen=True)
class RefitSettings:
    """What a refit fits, and when it is accepted."""

    axes: tuple[str, ...] = AXES  #: Those to identify.
    identification: IdentificationSettings = field(default_factory=IdentificationSettings)
    #: Part by which the new model's residuals must be smaller than the current model's, or more where chance alone does
    #: as much.
    least_improvement: float = 0.001
    stability: StabilitySettings = field(default_factory=StabilitySettings)

    def __post_init__(self):
        unknown = [axis for axis in self.axes if axis not in AXES]
        if unknown or not self.axes or len(set(self.axes)) < len(self.axes):
            raise InputError(f'axes must be one or both of {", ".join(AXES)}, each once, not {list(self.axes)}')
        if not 0.0 <= self.least_improvement < 1.0:
            raise InputError(f'least_improvement must lie between 0 and 1, not {self.least_improvement}')


@dataclass(frozen=True)
class RefitRequest:
    """All that a refit needs, wherever it runs."""

    table: MotionTable
    current: dict[str, IdentifiedModel]
    settings: RefitSettings
    provenance: dict = field(default_factory=dict)  #: The caller's record of the source.


@dataclass(frozen=True)
class AxisVerdict:
    """What a refit found about one axis."""

    axis: str
    model: IdentifiedModel | None  #: To be published; None: the current one stays.
    message: str  #: One clause that says what was found.
    #: Root mean square of the weighted residuals of the new and of the current model on this window, each from its own
    #: best initial state; NaN where there is none. At sea the deviance a degree of freedom of the new one.
    misfit: float = float('nan')
    #: Root mean square of the weighted residuals of the new and of the current model on this window, each from its own
    #: best initial state; NaN where there is none. At sea the deviance a degree of freedom of the new one.
    current_misfit: float = float('nan')
    #: Of the natural period, whether or not the model is to be published; None where it is not known.
    estimate: PeriodEstimate | None = None


@dataclass(frozen=True)
class RefitOutcome:
    """What a refit found."""

    verdicts: tuple[AxisVerdict, ...]

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
        ordered = sorted(self.verdicts, key=lambda verdict: verdict.model is None)
        return '; '.join(f'{verdict.axis}: {verdict.message}' for verdict in ordered)


def refit(
    request: RefitRequest, *, progress: Progress | None = None, should_cancel: ShouldCancel | None = None
) -> RefitOutcome:
    """Identify each axis on a window and compare with the current model on that window.

    Args:
        request: The window, the settings and the models held.
        progress: Called with 0 to 1.
        should_cancel: Asked often.

    Returns:
        What cannot be fitted is reported in its verdict.

    Raises:
        InputError: The window is empty.
        Cancelled: ``should_cancel`` said so.
    """
    trial = request.table.trial()
    # a hull is fitted to angles and rates, wherever gravity is
    trial = replace(
        trial,
        advice=tuple(
            each
            for each in contradictions_in(trial.time, trial.channels, Installation())
            if each.code in RATE_CODES | OFFSET_CODES
        ),
    )
    axes = request.settings.axes
    verdicts = []
    for index, axis in enumerate(axes):

        def report(share: float, index: int = index):
            if progress is not None:
                progress((index + share) / len(axes))

        try:
            refuse_contradictions(trial, axis)
            verdict, estimate = _refit_axis(axis, trial, request, report, should_cancel)
            if estimate is not None:
                begin, end = request.table.rows[[0, -1], 0].tolist()
                verdict = replace(verdict, estimate=PeriodEstimate(begin, end, *estimate))
            verdicts.append(verdict)
        except InputError as error:
            verdicts.append(AxisVerdict(axis, None, f'not fitted, {error}'))
        report(1.0)
    return RefitOutcome(tuple(verdicts))


def misfit(problem: Problem, model: DecayModel) -> float:
    """How badly a model explains decays, from the initial state that suits it best.

    Args:
        problem: The decays.
        model: Its ratios are kept; its trim is not read.

    Returns:
        Root mean square of the residuals of angle and rate, weighted by their noise; infinite where the simulated
        motion runs away.
    """
    fit = MotionFit(problem.motions, model.equation, problem.scales, problem.noise, model.friction_rate)
    try:
        best = fit.refine_states(fit.pack(model.ratios, problem.states))
        residuals, _ = fit.residuals_and_jacobian(best)
    except (ValueError, np.linalg.LinAlgError):
        # scipy's answer to a motion that runs away
        return float('inf')
    value = float(np.sqrt(np.mean(np.concatenate(residuals) ** 2)))
    return value if np.isfinite(value) else float('inf')


def _refit_axis(
    axis: str, trial: Trial, request: RefitRequest, progress: Progress | None, should_cancel: ShouldCancel | None
):
    settings, motion = request.settings.identification, trial.axis(axis)
    problem = decays_or_waves([motion], settings.start, settings.end)
    if problem is None:
        return _refit_at_sea(axis, motion, heave_of(trial), request, progress, should_cancel)
    found = identify_problem(problem, settings, progress=progress, should_cancel=should_cancel)
    estimate = _period_at_reference(found) if found.verdict.level != REJECTED else None
    return _judged_decay(axis, problem, found, request), estimate


def _period_at_reference(found: Identification):
    """Period, its standard deviation and the amplitude of an `Identification`."""
    amplitude, curves = found.reference_amplitude, found.bands.curves
    frequency = float(np.interp(amplitude, curves.amplitude, curves.frequency))
    std = float(np.interp(amplitude, curves.amplitude, found.bands.frequency_std))
    period = 2.0 * np.pi / frequency
    return (period, period * std / frequency, amplitude) if 0.0 < std < PERIOD_USABLE * frequency else None


def _judged_decay(axis: str, problem: Problem, found: Identification, request: RefitRequest):
    settings = request.settings
    new = misfit(problem, found.model)
    held = request.current.get(axis)
    current = float('nan') if held is None else misfit(problem, held.model)
    summary = f'{found.model.equation.name}, r2 {found.r2:.5f}, period {found.model.natural_period:.3f} s'
    if not np.isfinite(new):
        return AxisVerdict(axis, None, f'not published, the fit runs away ({summary})', new, current)
    worth = min(1.0 - settings.least_improvement, _chance_ratio(found))
    if held is not None and not new < worth * current:
        message = f'not published, the current model explains the window as well (misfit {current:.4g}, new {new:.4g})'
        return AxisVerdict(axis, None, message, new, current)
    better = '' if held is None else f', misfit {new:.4g} instead of {current:.4g}'
    return AxisVerdict(axis, found.identified_model(request.provenance), f'{summary}{better}', new, current)


def _refit_at_sea(
    axis: str,
    motion: AxisMotion,
    heave: Heave | None,
    request: RefitRequest,
    progress: Progress | None,
    should_cancel: ShouldCancel | None,
):
    try:
        found = identify_at_sea(motion, heave, searched=True, progress=progress, should_cancel=should_cancel)
    except InputError as error:
        raise InputError(
            f'{error}; the window is as long as window_s of imu_buffer: raise it where more is needed, as in '
            '`ros2 param set /imu_buffer window_s 300.0`, and identify when it is full'
        ) from error
    estimate = (found.natural_period, found.natural_period_std, found.amplitude) if found.has_period else None
    return _judged_at_sea(axis, motion, heave, found, request, should_cancel), estimate


def _judged_at_sea(
    axis: str,
    motion: AxisMotion,
    heave: Heave | None,
    found: AtSeaIdentification,
    request: RefitRequest,
    should_cancel: ShouldCancel | None,
):
    summary = (
        f'at sea, equivalent linear at {np.degrees(found.amplitude):.2g} deg: period {found.natural_period:.3f} +- '
        f'{found.natural_period_std:.2g} s, damping ratio {found.damping_ratio:.3f} +- {found.damping_ratio_std:.2g}'
    )
    if not found.is_usable:
        message = f'not published, this sea does not determine the hull ({summary})'
        return AxisVerdict(axis, None, message, found.misfit)
    held, better = request.current.get(axis), ''
    if held is not None and not is_at_sea(held):
        message = f'not published, the model of the free decay stays, {_told_there(held, found.amplitude)} ({summary})'
        return AxisVerdict(axis, None, message, found.misfit)
    if held is not None:
        # twice, as in `_chance_ratio`: both are uncertain
        gain, by_chance = gain_over(held.model, motion, heave, should_cancel=should_cancel), chdtri(2, BY_CHANCE)
        if gain < by_chance:
            message = f'not published, the current model explains the window as well ({summary})'
            return AxisVerdict(axis, None, message, found.misfit)
        better = f', log-likelihood {gain:.0f} higher'
    return AxisVerdict(axis, found.identified_model(request.provenance), f'{summary}{better}', found.misfit)


def _told_there(held: IdentifiedModel, amplitude: float):
    """What a model says of an amplitude, in words."""
    curves = amplitude_curves(held.model.ratios, np.array([amplitude]), held.model.friction_rate)
    period, damping = 2.0 * np.pi / float(curves.frequency[0]), float(curves.damping_ratio[0])
    return f'which there has period {period:.3f} s and damping ratio {damping:.3f}'


def window_provenance(table: MotionTable, source: dict, software: str) -> dict:
    """Where a window came from.

    Args:
        table: The window.
        source: What names its source: on a bus ``{'topic': ...}``.
        software: Name and version.
    """
    return {
        'software': software,
        'sources': [
            {
                **source,
                'first_stamp_s': float(table.rows[0, 0]) if len(table.rows) else None,
                'sha256': hashlib.sha256(table.rows.tobytes()).hexdigest(),
            }
        ],
    }


def warm_up() -> None:
    """A small refit of simulated decays, so that the next one finds everything loaded and compiled."""
    time = np.arange(0.0, 12.0, 0.05)
    decay = 0.1 * np.exp(-0.2 * time)
    rows = np.full((time.size, 8), np.nan)
    rows[:, 0] = time
    for index in range(len(AXES)):
        rows[:, 1 + index] = decay * np.cos(3.0 * time)
        rows[:, 3 + index] = -decay * (0.2 * np.cos(3.0 * time) + 3.0 * np.sin(3.0 * time))
    settings = RefitSettings(identification=IdentificationSettings(search=SearchSettings(generations=2)))
    refit(RefitRequest(MotionTable(rows, 0), {}, settings))


def _chance_ratio(found: Identification):
    """Ratio of the misfits, new over current, that chance alone undercuts with probability `BY_CHANCE`.

    Two models of the same craft, each fitted with k ratios to its own window: on the new one's window their
    sums of squared residuals, over the noise variance, differ by twice a chi-squared variable of k
    degrees of freedom (Wilks 1938; twice, because both are uncertain).
    """
    excess = 2.0 * chdtri(len(found.model.equation.terms), BY_CHANCE) / found.effective_samples
    return float(1.0 / np.sqrt(1.0 + excess))


class Refitter:
    """The models of a craft as refits change them, with the way back.

    Args:
        models: Known at the start, by axis.
        history: Those before them, oldest first.
    """

    def __init__(
        self,
        settings: RefitSettings | None = None,
        models: Mapping[str, IdentifiedModel] | None = None,
        history: Sequence[dict[str, IdentifiedModel]] = (),
    ):
        self.settings = settings or RefitSettings()
        self.models = dict(models or {})
        self.version = 0
        self.stability = StabilityWatch()
        self._history = [*history]

    def request(self, table: MotionTable, provenance: dict | None = None) -> RefitRequest:
        """What is to be fitted on a window, by `refit`.

        Args:
            table: The window.
            provenance: The caller's record of the source.
        """
        return RefitRequest(table, dict(self.models), self.settings, provenance or {})

    def take(self, outcome: RefitOutcome) -> bool:
        """Believe what a refit found to be better, and watch the stability by what it found of the period.

        Args:
            outcome: Of `refit`.

        Returns:
            Whether the models have changed and are to be published.
        """
        self.stability.settings = self.settings.stability
        for verdict in outcome.verdicts:
            if verdict.axis == 'roll' and verdict.estimate is not None:
                self.stability.add(verdict.estimate)
        if not outcome.succeeded:
            return False
        self._history = [*self._history, self.models][-LONGEST_HISTORY:]
        self.models = {**self.models, **outcome.models}
        self.version += 1
        return True

    def rollback(self) -> bool:
        """Return to the models before the last refit that was accepted.

        Returns:
            Whether there was one; if so the models are to be published.
        """
        if not self._history:
            return False
        self.models = self._history.pop()
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
