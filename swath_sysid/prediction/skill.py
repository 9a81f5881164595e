"""Skill, measured honestly: the very predictor run causally through a record, beside what it must beat."""
import math
from dataclasses import dataclass, field, replace

import numpy as np

from swath_sysid.advice import Advice
from swath_sysid.errors import InputError
from swath_sysid.motion.trial import AXES, CHANNELS
from swath_sysid.prediction import baselines
from swath_sysid.prediction.calibration import LEVELS
from swath_sysid.prediction.predictor import ImuSample, Predictor, PredictorSettings
from swath_sysid.prediction.quiescence import QuiescenceLimits, Reliability
from swath_sysid.prediction.waves import fit_waves

FORECAST = 'forecast'
METHODS = (FORECAST, *baselines.BASELINES)
_FANS = (0.35, 0.55, 0.75)
_STRETCH = 40.0
_SELDOM = 2.0
"""Standard deviations: so rarely passed that staying below for some seconds is an open question."""
_LEAST_LIMIT = 1e-4


@dataclass(frozen=True)
class AxisSkill:
    """Scores of one axis.

    Attributes
    ----------
    nrmse : dict of str to ndarray, shape (L,)
        Root mean square error over the standard deviation of the motion scored on, by `METHODS`; NaN where
        a method could not forecast.
    coverage : ndarray, shape (L, 3)
        Share of the 50, 90 and 99 % intervals that held the measured angle.
    samples : ndarray of int, shape (L,)
        Forecasts scored.
    deviation : float
        Of the motion scored on, rad.
    """

    nrmse: dict[str, np.ndarray]
    coverage: np.ndarray
    samples: np.ndarray
    deviation: float


@dataclass(frozen=True)
class Fan:
    """One forecast over the horizon, with what came: for the picture."""

    axis: str
    stamp: float
    leads: np.ndarray
    angle: np.ndarray
    half_width: np.ndarray


@dataclass(frozen=True)
class Skill:
    """Scores of a record.

    Attributes
    ----------
    leads : ndarray, shape (L,)
        s.
    axes : dict of str to AxisSkill
    warmup, window : float
        s.
    step_time, refit_time : dict of str to float
        Seconds ('median', 'most') by the given clock; NaN without one.
    fans : tuple of Fan
    stretch : dict of str to tuple of ndarray
        By axis: times and measured angles about the fans.
    quiescence : Reliability or None
    quiescence_limits : QuiescenceLimits or None
        Whose keeping was forecast.
    advice : tuple of Advice
    """

    leads: np.ndarray
    axes: dict[str, AxisSkill]
    warmup: float
    window: float
    step_time: dict[str, float]
    refit_time: dict[str, float]
    fans: tuple[Fan, ...] = ()
    stretch: dict = field(default_factory=dict)
    quiescence: Reliability | None = None
    quiescence_limits: QuiescenceLimits | None = None
    advice: tuple[Advice, ...] = ()


@dataclass(frozen=True)
class Run:
    """A predictor run through a record.

    Attributes
    ----------
    steps : tuple of Step
        Those that issued a forecast.
    refits : tuple of float
        Stamps of the refits.
    step_times, refit_times : tuple of float
        s.
    reliability : Reliability or None
    """

    steps: tuple
    refits: tuple[float, ...]
    step_times: tuple[float, ...]
    refit_times: tuple[float, ...]
    reliability: Reliability | None


def samples_of(trial):
    """The trial as the sensor would have told it, sample by sample.

    Parameters
    ----------
    trial : Trial

    Yields
    ------
    ImuSample
    """
    absent = np.full(trial.time.size, math.nan)
    columns = [trial.time, *(trial.channels.get(name, absent) for name in CHANNELS)]
    for row in np.column_stack(columns).tolist():
        yield ImuSample(*row)


def run_through(trial, settings, models, clock=None, progress=None, limits_from=None):
    """Run the predictor of the node causally through a record, refits in their place.

    Parameters
    ----------
    trial : Trial
    settings : PredictorSettings
    models : dict of str to DecayModel
    clock : callable or None
        Seconds, for the cost; None: not measured.
    progress : callable or None
        Told the share done.
    limits_from : (float, QuiescenceLimits) or None
        Limits of quiescence from a stamp on; their reliability is recorded from there.

    Returns
    -------
    Run
    """
    now = clock or (lambda: math.nan)
    predictor = Predictor(settings)
    for axis, model in models.items():
        predictor.set_model(axis, model)
    steps, refits, step_times, refit_times = [], [], [], []
    every = max(1, trial.time.size // 200)
    for index, sample in enumerate(samples_of(trial)):
        if limits_from is not None and sample.stamp >= limits_from[0]:
            predictor.set_quiescence(limits_from[1])
            limits_from = None
        begun = now()
        step = predictor.observe(sample)
        step_times.append(now() - begun)
        if step.forecast is not None:
            steps.append(step)
        if step.refit is not None:
            begun = now()
            predictor.install(fit_waves(step.refit))
            refit_times.append(now() - begun)
            refits.append(step.stamp)
            steps[-1] = step._replace(refit=None)
        if progress is not None and index % every == 0:
            progress(index / trial.time.size)
    return Run(
        tuple(steps), tuple(refits), tuple(step_times), tuple(refit_times), predictor.quiescence_reliability()
    )


def score(trial, leads, warmup, window=None, models=None, settings=None, clock=None, progress=None):
    """Score the forecasts of a record and the baselines on the same samples.

    Every forecast issued after the warm-up whose time comes within the record counts, where every causal
    method has one.

    Parameters
    ----------
    trial : Trial
    leads : sequence of float
        s.
    warmup : float
        s from the record's start that are not scored.
    window : float or None
        s of past that forecast and baselines learn from; None: as long as the warm-up.
    models : dict of str to DecayModel
        Hulls known, by axis.
    settings : PredictorSettings or None
        Everything else.
    clock, progress : callable or None
        See `run_through`.

    Returns
    -------
    Skill

    Raises
    ------
    InputError
        The record is not longer than the warm-up and the longest lead, or has no angle.
    """
    leads = np.array(sorted({float(lead) for lead in leads}))
    window = float(window or warmup)
    duration = float(trial.time[-1] - trial.time[0])
    if duration <= warmup + leads[-1]:
        raise InputError(
            f'{trial.source or "the record"} lasts {duration:.0f} s, no longer than the warm-up of {warmup:.0f} s '
            f'and the longest lead: shorten the warm-up'
        )
    axes = [axis for axis in AXES if axis in trial.channels]
    if not axes:
        raise InputError(f'{trial.source or "the record"} has no angles to score forecasts on: give roll or pitch')
    base = settings or PredictorSettings()
    settings = replace(
        base, leads=tuple(leads.tolist()), window=window, skill_memory=min(base.skill_memory, window)
    )
    limits = _quiescence_limits(trial, settings.quiescence, warmup)
    limits_from = None if limits is None else (float(trial.time[0]) + warmup, limits)
    run = run_through(trial, settings, models or {}, clock, progress, limits_from)
    grid = _Grid.of(trial, run, settings)
    scored, advice = {}, []
    for axis in axes:
        scored[axis], told = _score_axis(trial, axis, grid, run, leads, warmup, window)
        advice += told
    fans, stretch = _fans(trial, axes, run, warmup)
    return Skill(
        leads, scored, warmup, window, _spread(run.step_times), _spread(run.refit_times), fans, stretch,
        run.reliability, limits, tuple(advice),
    )  # fmt: skip


def _quiescence_limits(trial, limits, warmup):
    """The given limits; where they limit nothing, the angles that the craft seldom passed in the warm-up."""
    if limits is None or np.isfinite(limits.as_array).any():
        return limits
    seen = trial.time < trial.time[0] + warmup
    warm = {axis: trial.channels[axis][seen] for axis in AXES if axis in trial.channels}
    usual = {axis: abs(np.nanmean(angle)) + _SELDOM * np.nanstd(angle) for axis, angle in warm.items()}
    return replace(limits, **{axis: float(max(limit, _LEAST_LIMIT)) for axis, limit in usual.items()})


@dataclass(frozen=True)
class _Grid:
    """The record on the even grid that the baselines work on."""

    start: float
    step: float
    values: np.ndarray
    names: tuple[str, ...]
    refits: tuple[int, ...]

    @classmethod
    def of(cls, trial, run, settings):
        usual = _interval(trial.time)
        target = 1.0 / settings.excitation_rate
        step = target if usual < 0.25 * target else max(1, round(target / usual)) * usual
        start = float(trial.time[0])
        count = int((trial.time[-1] - start) / step + 1e-6) + 1
        names = tuple(trial.channels)
        times = start + step * np.arange(count)
        columns = [_on_grid(trial.time, values, times, usual) for values in trial.channels.values()]
        refits = tuple(int((stamp - start) / step + 1e-6) for stamp in run.refits)
        return cls(start, step, np.column_stack(columns), names, refits)

    def place(self, stamps):
        """The grid row nearest to each stamp."""
        return np.clip(np.round((stamps - self.start) / self.step).astype(int), 0, self.values.shape[0] - 1)

    def column(self, name):
        """One channel on the grid, or None."""
        return self.values[:, self.names.index(name)] if name in self.names else None


def _interval(time):
    """The sensor's interval as its samples keep it: a grid of the nearest round figure would drift from them."""
    intervals = np.diff(time)
    counts = np.round(intervals / np.median(intervals))
    even = (counts == 1) | (counts == 2)
    return float(intervals[even].sum() / counts[even].sum())


def _on_grid(time, values, wanted, usual):
    """Linear between finite neighbours that are no further apart than a gap; else NaN."""
    finite = np.isfinite(values)
    if finite.sum() < 2:
        return np.full(wanted.size, np.nan)
    time, values = time[finite], values[finite]
    after = np.clip(np.searchsorted(time, wanted - 1e-6 * usual), 1, time.size - 1)
    gap = time[after] - time[after - 1] > 2.5 * usual
    near = np.minimum(np.abs(wanted - time[after]), np.abs(wanted - time[after - 1])) < 0.1 * usual
    result = np.interp(wanted, time, values)
    result[(gap & ~near) | (wanted < time[0] - 0.1 * usual) | (wanted > time[-1] + 0.1 * usual)] = np.nan
    return result


def _score_axis(trial, axis, grid, run, leads, warmup, window):
    issued = [s for s in run.steps if axis in s.forecast.axes and s.stamp >= trial.time[0] + warmup]
    stamps = np.array([s.stamp for s in issued])
    told = np.array([s.forecast.axes[axis].angle for s in issued]).reshape(-1, leads.size)
    widths = np.array([s.forecast.axes[axis].half_width for s in issued]).reshape(-1, leads.size, LEVELS.size)
    usual = float(np.median(np.diff(trial.time)))
    # baselines forecast from the grid's rows: each is scored on what came a lead after its row
    rows = grid.place(stamps)
    row_stamps = grid.start + rows * grid.step
    methods = _baselines(axis, grid, leads, window)
    angle, angles = grid.column(axis), trial.channels[axis]
    scored_angle = _on_grid(trial.time, angles, trial.time[trial.time >= trial.time[0] + warmup], usual)
    deviation = float(np.nanstd(scored_angle))
    nrmse = {name: np.full(leads.size, np.nan) for name in METHODS}
    coverage, samples = np.full((leads.size, LEVELS.size), np.nan), np.zeros(leads.size, dtype=int)
    advice = []
    for i, lead in enumerate(leads):
        if abs(lead / grid.step - round(lead / grid.step)) > 0.05 or lead < 0.9 * grid.step:
            advice.append(Advice(
                'lead-between-samples',
                f'the lead of {lead:g} s is no whole number of steps of {grid.step:g} s, so the baselines are not '
                'scored there: choose multiples',
            ))  # fmt: skip
        truth = _on_grid(trial.time, angles, stamps + lead, usual)
        row_truth = _on_grid(trial.time, angles, row_stamps + lead, usual)
        good = np.isfinite(truth) & np.isfinite(row_truth) & np.isfinite(told[:, i])
        for values in methods.values():
            if np.isfinite(values[rows[good], i]).any():
                good &= np.isfinite(values[rows, i])
        if not good.any() or not deviation > 0.0:
            continue
        error = told[good, i] - truth[good]
        nrmse[FORECAST][i] = np.sqrt(np.mean(error**2)) / deviation
        coverage[i] = (np.abs(error)[:, None] <= widths[good, i]).mean(axis=0)
        samples[i] = good.sum()
        for name, values in methods.items():
            other = values[rows[good], i] - row_truth[good]
            if np.isfinite(other).all():
                nrmse[name][i] = np.sqrt(np.mean(other**2)) / deviation
    after = angle[grid.place(np.array([trial.time[0] + warmup]))[0]:]
    nrmse['bound'] = _at_whole_steps(leads, grid.step, lambda steps: baselines.spectrum_bound(after, steps))
    return AxisSkill(nrmse, coverage, samples, deviation), advice if axis == AXES[0] else []


def _at_whole_steps(leads, step, of_steps):
    """Values at the leads that are whole steps, NaN at the others (leads last, or alone)."""
    whole = (np.abs(leads / step - np.round(leads / step)) <= 0.05) & (leads >= 0.9 * step)
    steps = np.round(leads[whole] / step).astype(int)
    if not steps.size:
        return np.full(leads.size, np.nan)
    values = of_steps(steps)
    result = np.full((*values.shape[:-1], leads.size), np.nan)
    result[..., whole] = values
    return result


def _baselines(axis, grid, leads, window):
    """Forecasts of every causal baseline at every grid row, shape (N, L), NaN where there is none."""
    angle, rate = grid.column(axis), grid.column(f'{axis}_rate')
    rows = int(window / grid.step + 1e-6) + 1
    useful = [k for k in range(len(grid.names)) if np.isfinite(grid.values[:, k]).mean() > 0.5
              and np.nanstd(grid.values[:, k]) > 1e-12]
    place = grid.names.index(axis)
    methods = {
        'persistence': lambda steps: baselines.persistence(angle, steps),
        'constant_rate': lambda steps: baselines.constant_rate(angle, rate, steps, grid.step),
        'gm11': lambda steps: baselines.gm11(angle, steps),
        'ar': lambda steps: baselines.running_regression(
            grid.values[:, [place]], [0], steps, grid.refits, rows)[:, :, 0],
        'var': lambda steps: baselines.running_regression(
            grid.values[:, useful], [useful.index(place)], steps, grid.refits, rows)[:, :, 0],
    }  # fmt: skip
    if place not in useful:
        del methods['var'], methods['ar']
    return {name: _at_whole_steps(leads, grid.step, method) for name, method in methods.items()}


def _fans(trial, axes, run, warmup):
    """A few forecasts over the horizon, evenly over what is scored, and the motion about them."""
    scored = [s for s in run.steps if s.stamp >= trial.time[0] + warmup]
    if not scored:
        return (), {}
    chosen = [scored[int(share * (len(scored) - 1))] for share in _FANS]
    centre = chosen[1].stamp
    near = [s for s in scored if abs(s.stamp - centre) <= 0.5 * _STRETCH]
    spaced, last = [], -math.inf
    for s in near:
        if s.stamp - last >= s.horizon.leads[-1]:
            spaced.append(s)
            last = s.stamp
    fans = tuple(
        Fan(axis, s.stamp, s.horizon.leads, s.horizon.axes[axis].angle, s.horizon.axes[axis].half_width)
        for axis in axes for s in spaced if axis in s.horizon.axes
    )  # fmt: skip
    span = np.abs(trial.time - centre) <= 0.5 * _STRETCH + 5.0
    return fans, {axis: (trial.time[span], trial.channels[axis][span]) for axis in axes}


def _spread(times):
    finite = [t for t in times if t == t]
    if not finite:
        return {'median': math.nan, 'most': math.nan}
    return {'median': float(np.median(finite)), 'most': float(max(finite))}


def skill_as_data(skill):
    """The scores as plain data for JSON; what is not known is None.

    Parameters
    ----------
    skill : Skill

    Returns
    -------
    dict
    """
    levels = [f'{100 * level:g}' for level in LEVELS]
    data = {
        'leads_s': skill.leads.tolist(),
        'warmup_s': skill.warmup,
        'window_s': skill.window,
        'axes': {
            axis: {
                'nrmse': {name: _plain(values) for name, values in scores.nrmse.items()},
                'coverage': {level: _plain(scores.coverage[:, k]) for k, level in enumerate(levels)},
                'samples': scores.samples.tolist(),
                'deviation_rad': scores.deviation,
            }
            for axis, scores in skill.axes.items()
        },
        'step_s': {name: _known(value) for name, value in skill.step_time.items()},
        'refit_s': {name: _known(value) for name, value in skill.refit_time.items()},
        'warnings': [{'code': a.code, 'message': a.message} for a in skill.advice],
    }
    if skill.quiescence is not None:
        r = skill.quiescence
        data['quiescence'] = {
            'limits': {name: _known(limit) for name, limit in vars(skill.quiescence_limits).items()},
            'edges': r.edges.tolist(), 'count': r.count.tolist(), 'told': _plain(r.told),
            'happened': _plain(r.happened), 'brier': _known(r.brier), 'brier_of_climate': _known(r.brier_of_climate),
        }  # fmt: skip
    return data


def _known(value):
    return float(value) if np.isfinite(value) else None


def _plain(values):
    return [_known(value) for value in values]
