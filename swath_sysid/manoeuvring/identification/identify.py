"""Identification of a manoeuvring model from several runs jointly."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from swath_sysid.common.advice import Advice
from swath_sysid.common.cancelling import stop_if
from swath_sysid.common.conventions import ADEQUATE, DOUBTFUL, LEVELS, REJECTED, TWO_STD, UNCERTAIN
from swath_sysid.common.covariance import NOT_SEPARABLE, correlation
from swath_sysid.common.errors import InputError
from swath_sysid.common.judgement import Finding, Judgement
from swath_sysid.common.optimisers import GeneticSearch, GeneticSettings
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel, StabilityCheck, check_stability
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.terms import HULL, INDEX, PARAMETERS, PrimeUnits
from swath_sysid.manoeuvring.identification import assembly, selection
from swath_sysid.manoeuvring.identification.assembly import RunProblem
from swath_sysid.manoeuvring.identification.disturbances import forecast_noise
from swath_sysid.manoeuvring.identification.selection import Fit
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.identification.shooting import CURRENT, objective_of_population
from swath_sysid.manoeuvring.identification.validation import Scores, score
from swath_sysid.manoeuvring.motion.trial import CHANNELS, CraftRun

GOOD_R2 = {'surge': 0.9, 'sway': 0.5, 'yaw_rate': 0.8}  #: Of an adequate model.


@dataclass(frozen=True)
class ManoeuvringVerdict(Judgement):
    """A judgement of a manoeuvring model, as `ManoeuvringIdentification.verdict` gives it."""

    channels: dict[str, str]  #: Level of surge, sway and yaw_rate, as far as the runs held out test them.

    @property
    def metrics(self) -> dict[str, Any]:
        """As model files hold it."""
        return {**super().metrics, 'verdict_channels': self.channels}


def judge(
    identification: Scores, validation: Scores | None, noise: np.ndarray, instability: StabilityCheck | None
) -> ManoeuvringVerdict:
    """Judge a model by its gravest cause: its scores on the runs that it was fitted to, those of runs held out (None:
    there were none), the sensor noise (3,), and the check of a model that runs away at the speeds of its runs.
    """
    if instability is not None:
        speed = instability.unstable_speed
        unstable = Advice.of('unstable', where='' if np.isnan(speed) else f' (at {speed:.2f} m/s)')
        return ManoeuvringVerdict.by_gravest([(REJECTED, unstable)], {})
    if validation is None:
        return ManoeuvringVerdict.by_gravest([(DOUBTFUL, Advice.of('no-runs-held-out'))], {})
    levels = {name: level_of(name, validation, size) for name, size in zip(GOOD_R2, noise, strict=True)}
    channels = {name: level for name, level in levels.items() if np.isfinite(validation.r2[name])}
    shares = ', '.join(f'{max(validation.r2[name], 0.0):.0%} of the {_words(name)}' for name in channels)
    good = f'in free simulation of runs that were not fitted the model explains {shares}'
    causes: list[Finding] = [(ADEQUATE, Advice(ADEQUATE, good))]
    idle = [name for name, r2 in validation.r2.items() if np.isnan(r2) and identification.r2[name] > 0.0]
    if idle:
        named = ' and '.join(_words(name) for name in idle)
        causes.append((DOUBTFUL, Advice.of('not-validated', channels=named)))
    if poor := poor_channels(validation, noise):
        worst = min(channels.values(), key=LEVELS.index)
        causes.append((worst, Advice.of('poor-validation', channels=poor)))
    if validation.diverged:
        diverged, windows = validation.diverged, validation.windows
        causes.append((REJECTED, Advice.of('diverged', diverged=diverged, windows=windows, label='validation')))
    return ManoeuvringVerdict.by_gravest(causes, channels)


def level_of(name: str, scores: Scores, noise: float) -> str:
    """The level of a channel; an error of the size of the sensor noise leaves nothing to explain."""
    r2 = scores.r2[name]
    if not r2 < GOOD_R2[name] or scores.rmse[name] <= TWO_STD * noise:
        return ADEQUATE
    return DOUBTFUL if r2 >= 0.0 else REJECTED


def poor_channels(scores: Scores, noise: np.ndarray) -> str:
    """R2 of the channels that are not adequate, in words; empty where there are none."""
    poor = [name for name, size in zip(GOOD_R2, noise, strict=True) if level_of(name, scores, size) != ADEQUATE]
    return ', '.join(f'{_words(name)} {scores.r2[name]:.3g}' for name in poor)


def _words(name: str) -> str:
    return name.replace('_', ' ')


COURSE_UNSTABLE = 'course-unstable'  #: Of a craft whose runs show that it does not keep a straight course.
STRANGE_MASS = 0.6  #: Largest added mass in surge of a small craft, as a share of its mass.


@dataclass(frozen=True)
class Derivative:
    """One identified parameter."""

    value: float  #: In ``unit``.
    std: float  #: In ``unit``; NaN where it was given or assumed.
    prime: float | None  #: Non-dimensional; None for the parameters of the thrusters.
    unit: str
    flags: tuple[str, ...] = ()  #: Codes of its warnings.


@dataclass(frozen=True)
class ManoeuvringIdentification:
    """Outcome of `identify_manoeuvring`."""

    model: ManoeuvringModel
    names: tuple[str, ...]  #: Identified parameters, thrusters and current included.
    values: np.ndarray  #: (n,)
    covariance: np.ndarray  #: (n, n)
    derivatives: dict[str, Derivative]
    fixed: dict[str, float]  #: Given or assumed parameters.
    prime_units: PrimeUnits
    noise: np.ndarray  #: (3,); Residual standard deviation of surge, sway, yaw rate.
    identification: Scores  #: On the runs that it was fitted to.
    validation: Scores | None  #: Of ``validated_model`` on runs kept out of its fit; None: there were none.
    identified_on: tuple  #: The runs that the model was fitted to.
    validated_on: tuple  #: The runs kept out of the fit of ``validated_model``.
    validated_model: (
        ManoeuvringModel  #: The model, or where it is of all runs, one identified without ``validated_on``.
    )
    stability: StabilityCheck
    rejected: dict[str, str]  #: Rejected terms and why.
    currents: np.ndarray  #: (R, 2); East and north, m/s, of each run of the identification.
    effective_samples: float
    evaluations: int
    advice: tuple[Advice, ...]

    @property
    def has_currents_by_run(self) -> bool:
        """Whether each run has a current of its own."""
        return bool(np.any(self.currents != self.model.current))

    @cached_property
    def verdict(self) -> ManoeuvringVerdict:
        """Whether the model can be used, by the runs that were not fitted."""
        runs_away = not self.stability.stable and all(advice.code != COURSE_UNSTABLE for advice in self.advice)
        noise = assembly.sensor_noise(self.identified_on)
        return judge(self.identification, self.validation, noise, self.stability if runs_away else None)

    def identified(self, metrics: dict | None = None, provenance: dict | None = None) -> IdentifiedManoeuvringModel:
        """The model with its uncertainty, verdict and the noise of its forecasts, intervals not yet calibrated."""
        measured = self.model, self.names, self.covariance, self.noise, assembly.seen_region(self.identified_on)
        forecast = forecast_noise(self.model, self.identified_on)
        return IdentifiedManoeuvringModel(*measured, self.verdict.metrics | (metrics or {}), provenance or {}, forecast)


def identify_manoeuvring(
    runs: Sequence[CraftRun],
    settings: ManoeuvringSettings | None = None,
    validation: Sequence[CraftRun] | None = None,
    progress: Callable[[float], object] | None = None,
    should_cancel: Callable[[], bool] | None = None,
) -> ManoeuvringIdentification:
    """Identify the manoeuvring model of a twin-thruster craft from its runs.

    Linear regression and a genetic search give the start; multiple shooting refines it; terms are
    added while they are worth it and the craft stays stable.

    Args:
        runs: Of one craft, as `prepare_runs` gives them.
        settings: What is given, fixed and searched.
        validation: Kept out of the fit and scored. By default a third of the runs, where there are three or more,
            test a fit to the others; the model is then identified from all. Empty: none.
        progress: Called with the share of the work done, 0 to 1.
        should_cancel: Asked between steps.

    Returns:
        The model, its derivatives with their uncertainty, and how well it simulates the runs.

    Raises:
        InputError: The runs cannot be used together, or excite nothing.
        Cancelled: ``should_cancel`` returned True.

    Example:
        >>> runs = prepare_runs([read_manoeuvring_csv('runs/zigzag_20.csv'), read_manoeuvring_csv('runs/mixed.csv')])
        >>> settings = ManoeuvringSettings(mass=180.0, terms=('Xu', 'Xuu', 'Yv', 'Nr'), generations=0)
        >>> found = identify_manoeuvring(runs, settings)
        >>> found.identification.r2['yaw_rate'] > 0.95
        True
    """
    settings = settings or ManoeuvringSettings()
    if not runs:
        raise InputError('there is no run to identify from: give at least one')

    def note(share: float) -> None:
        if progress is not None:
            progress(share)
        stop_if(should_cancel)

    note(0.0)
    kept, advice = assembly.moving_runs(runs)
    if validation is None:
        outcome = _tested_on_a_third(kept, settings, note)
    else:
        held_out, more = assembly.moving_runs(validation) if len(validation) else ((), ())
        advice += more
        outcome = _fitted(kept, held_out, settings, note)
    note(1.0)
    return replace(outcome, advice=advice + outcome.advice)


def _tested_on_a_third(
    runs: tuple[CraftRun, ...], settings: ManoeuvringSettings, note: Callable[[float], object]
) -> ManoeuvringIdentification:
    """Of all runs, with the scores on some of them of a fit to the others: a run held out for good would be wasted."""
    kept, held_out = split(runs)
    if not held_out:
        return _fitted(runs, (), settings, note)
    tested = _fitted(kept, held_out, settings, lambda share: note(0.5 * share))
    whole = _fitted(runs, (), settings, lambda share: note(0.5 + 0.5 * share))
    return replace(whole, validation=tested.validation, validated_on=tested.validated_on, validated_model=tested.model)


def _fitted(
    runs: tuple[CraftRun, ...],
    held_out: tuple[CraftRun, ...],
    settings: ManoeuvringSettings,
    note: Callable[[float], object],
) -> ManoeuvringIdentification:
    """What a fit to some runs says, with its scores, on runs held out too, and its warnings."""
    problem = assembly.assemble(runs, settings)
    start = _searched(problem, settings, lambda share: note(0.05 + 0.3 * share))
    problem, found = selection.identified(problem, start, settings.window, settings.terms is None, note)
    return _outcome(problem, found, held_out, settings)


def _outcome(
    problem: RunProblem, found: Fit, held_out: tuple[CraftRun, ...], settings: ManoeuvringSettings
) -> ManoeuvringIdentification:
    """What a fit says, with its scores and warnings."""
    runs, model = problem.runs, selection.model_of(problem, found.names, found.values)
    stability = check_stability(model, problem.region)
    currents = model.current + found.shooting.hidden.drift.T
    if np.max(np.hypot(*(currents - model.current).T), initial=0.0) <= assembly.EQUAL_CURRENTS:
        currents = np.tile(model.current, (len(currents), 1))
    scores = score(model, runs, settings.window, currents)
    # nothing is fitted to the runs held out, not even their current
    validated = _of_excited(score(model, held_out, settings.window), held_out, settings) if held_out else None
    speed = np.nanmedian(np.concatenate([np.abs(run.smooth[0]) for run in runs])) if 'Xu' in found.names else 1.0
    units = PrimeUnits(problem.length, float(max(speed, 0.05)))
    derivatives, more = _derivatives(problem, found, units)
    advice = [*(a for run in (*runs, *held_out) for a in run.advice), *problem.advice, *more]
    removed = ', '.join(name for name, reason in found.rejected.items() if reason == selection.MADE_STABLE)
    if removed:
        advice.append(Advice.of('made-stable', removed=removed))
    if np.any(currents != model.current):
        strengths = np.hypot(*currents.T)
        advice.append(Advice.of('current-by-run', least=strengths.min(), most=strengths.max()))
    if not stability.stable and stability.bounded and problem.largest_growth >= 0.0:
        growth = stability.largest_growth
        advice.append(Advice.of(COURSE_UNSTABLE, speed=stability.unstable_speed, growth=growth, time=3.0 / growth))
    advice += _simulation_advice(scores, assembly.sensor_noise(runs))
    known = [n for n in ('m', 'Iz', 'lever', 'gain') if n not in found.names]
    assumed = (*known, *problem.assumed, *settings.fixed)
    fixed = {name: model[name] for name in assumed}
    fitted = model, found.names, found.values, found.covariance.matrix, derivatives, fixed, units, problem.noise
    tested = scores, validated, runs, held_out, model, stability, found.rejected, currents
    counts = found.covariance.effective_samples, found.evaluations
    return ManoeuvringIdentification(*fitted, *tested, *counts, tuple(advice))


def _of_excited(scores: Scores, runs: Sequence[CraftRun], settings: ManoeuvringSettings) -> Scores:
    """The scores without the R2 of what neither runs nor model do: it would compare noise with noise."""
    facts, noise = assembly.facts_of(runs, settings), dict(zip(CHANNELS, assembly.sensor_noise(runs), strict=True))
    idle = [name for name, fact in (('sway', 'no Y'), ('yaw_rate', 'no N')) if fact in facts]
    unknown = {name: float('nan') for name in idle if scores.rmse[name] <= TWO_STD * noise[name]}
    return replace(scores, r2=scores.r2 | unknown)


def split(runs: Sequence[CraftRun], share: float = 1.0 / 3.0) -> tuple[tuple[CraftRun, ...], tuple[CraftRun, ...]]:
    """Runs to identify from, and runs held out, whose motion the others cover; none is held out of fewer than three."""
    if len(runs) < 3:
        return tuple(runs), ()
    kept = list(range(len(runs)))
    spans = np.array([_span(run) for run in runs])
    for _ in range(max(1, round(share * len(runs)))):
        whole = np.nanmax(spans[kept], axis=0)

        def rank(k: int, whole: np.ndarray = whole) -> tuple[float, float]:
            rest = np.nanmax(spans[[j for j in kept if j != k]], axis=0)
            size = np.where(whole == 0.0, 1.0, np.abs(whole))
            # first what the others would lack, in steps of a tenth; then the livelier run makes the better test
            return round(float(np.nansum((whole - rest) / size)), 1), -float(np.nansum(spans[k] / size))

        kept.remove(min(kept, key=rank))
    return tuple(runs[k] for k in kept), tuple(run for k, run in enumerate(runs) if k not in kept)


def _span(run: CraftRun):
    """Extremes of speed, yaw rate and thrust difference to both sides, lowest input, and duration."""
    speed, _, rate = run.smooth
    difference = run.starboard - run.port

    def most(values: np.ndarray) -> float:
        return float(np.nanquantile(values, 0.99)) if np.isfinite(values).any() else float('nan')

    least = np.minimum(run.port, run.starboard)
    return [most(speed), most(rate), most(-rate), most(difference), most(-difference), most(-least), run.duration]


def _searched(problem: RunProblem, settings: ManoeuvringSettings, note: Callable[[float], object]):
    """The better of the start by regression and the best of a genetic search around it."""
    start = problem.start(problem.free)
    unknowns = problem.unknowns(problem.free)
    start = np.clip(start, unknowns.lower, unknowns.upper)
    if settings.generations == 0:
        return start
    reach = np.maximum(2.0 * np.abs(start), 0.5 * unknowns.units)
    low, high = np.maximum(start - reach, unknowns.lower), np.minimum(start + reach, unknowns.upper)
    budget = GeneticSettings(generations=settings.generations, population=settings.population, patience=5)
    shooting = selection.shooting_of(problem, settings.window)
    search = GeneticSearch(low, high, budget, settings.seed, [start])
    while not search.should_stop():
        search.tell(objective_of_population(shooting, search.ask()))
        note(min(1.0, search.generation / settings.generations))
    return search.best.copy()


def _derivatives(problem: RunProblem, found: Fit, units: PrimeUnits):
    """Derivatives with their flags, and advice for those that are doubtful."""
    std = np.sqrt(np.diag(found.covariance.matrix))
    flags = {name: [problem.flags[name]] if name in problem.flags else [] for name in found.names}
    advice = []

    def warn(key: str, names: tuple[str, ...], **data: object):
        runs = ' and '.join(dict.fromkeys(PARAMETERS[INDEX[n]].separated_by for n in names if n in INDEX))
        advice.append(Advice.of(key, name=names[-1], runs=runs or 'runs in opposite directions', **data))
        for name in names:
            flags[name].append(advice[-1].code)

    matrix = correlation(found.covariance.matrix)
    for i, j in np.argwhere(np.tril(np.abs(matrix), -1) > NOT_SEPARABLE):
        pair = found.names[j], found.names[i]
        warn('not-separable: derivatives', pair, other=pair[0], correlation=matrix[i, j])
    mass, derivatives = problem.scales.mass, {}
    for name, value, error in zip(found.names, found.values.tolist(), std.tolist(), strict=True):
        if name in CURRENT:
            continue
        parameter = PARAMETERS[INDEX[name]]
        if selection.at_bound(problem, name, value):
            warn('at-bound', (name,), value=value)
        if not error < UNCERTAIN * max(abs(value), 0.1 * problem.scales.unit(name)):
            warn('uncertain', (name,), value=value, std=error)
        if name == 'Xu_dot' and not -STRANGE_MASS * mass < value < 0.2 * mass:
            warn('strange-inertia', (name,), apparent=mass - value, mass=mass)
        prime = float(units.to_prime(name, value)) if parameter.kind in HULL else None
        derivatives[name] = Derivative(value, error, prime, parameter.unit, tuple(dict.fromkeys(flags[name])))
    return derivatives, advice


def _simulation_advice(scores: Scores, noise: np.ndarray) -> list[Advice]:
    """Advice on how well the free simulation follows the runs of the identification, whose sensor noise is (3,)."""
    advice = []
    if scores.diverged:
        advice.append(Advice.of('diverged', diverged=scores.diverged, windows=scores.windows, label='identification'))
    poor = poor_channels(scores, noise)
    if poor:
        advice.append(Advice.of('poor-simulation', channels=poor))
    return advice
