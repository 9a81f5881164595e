"""Forecast skill: the score of every issued forecast, beside the baselines."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from swath_sysid.attitude.motion.attitude import Installation
from swath_sysid.attitude.motion.intake import BLANK_ORIENTATION
from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.attitude.motion.vertical import EDGE
from swath_sysid.attitude.prediction.forecast import LEVELS, NORMAL_QUANTILES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.point import ATTITUDE, POINT_MOTION, Point
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits, Reliability, quantity_at
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import CONFIDENCE, TWO_STD
from swath_sysid.common.errors import InputError
from swath_sysid.evaluation.baselines import BASELINES, Record, baseline_forecasts, simple_forecasts, vertical_record
from swath_sysid.evaluation.decisions import DecisionSkill, score_decisions
from swath_sysid.pipeline.record_run import Run

FORECAST = 'forecast'
METHODS = (FORECAST, *BASELINES)

SENSOR = Point('sensor', (0.0, 0.0, 0.0))  #: Where vertical motion is scored beside the points asked for.
AFTER_GAP = 4.0  #: s after lost samples for which the forecasts have scores of their own.
#: s: several wave groups, so that the errors of one block say little about the next, and limits of quiescence can be
#: taken from as much.
_BLOCK = 30.0

_MIN_BLOCKS = 8
_REPLICATES = 2000
_LONGEST_WARMUP = 600.0


@dataclass(frozen=True)
class ValidLeadSkill:
    """The valid leads of one axis, and the errors at them."""

    lead: np.ndarray  #: (3,); s; the median, and the bounds of the central 80 %.
    error_over_expected: float  #: Root mean square of the errors at the valid leads over the expected; 1 is calibrated.
    counted: int  #: Errors in it: neither zero nor the whole horizon, and measured then.
    beyond_horizon: float  #: Share of the forecasts whose limit lies beyond the horizon.


@dataclass(frozen=True)
class QuantitySkill:
    """Scores of one quantity; errors are root mean squares over ``deviation``."""

    deviation: float  #: Standard deviation of what came while it was scored: rad, m, m/s or m/s^2.
    counted: np.ndarray  #: (L,); scored forecasts.
    unmeasured: np.ndarray  #: (L,); those that cannot be scored because nothing was measured at their time.
    nrmse: dict[str, np.ndarray]  #: (L,) by `METHODS`, of vertical motion by those that need no measurement of it.
    #: (L,); share for which the method had no value and was replaced by persistence (vertical motion: the mean).
    replaced_share: dict[str, np.ndarray]
    coverage: np.ndarray  #: (L, 3); of the 50, 90 and 99 % intervals.
    interval: np.ndarray  #: (L, 2); of the forecast's error, by a bootstrap of blocks; NaN where there are too few.
    best: tuple[str, ...]  #: The baseline with the least error, by lead.
    ratio: np.ndarray  #: (L,); Error of the forecast over that of the best baseline.
    ratio_interval: np.ndarray  #: (L, 2)
    gap_share: np.ndarray  #: (L,); Share of the counted that were issued in a gap or within `AFTER_GAP` after it.
    gap_nrmse: dict[str, np.ndarray]  #: (L,); their error, of ``forecast`` and ``persistence``.
    #: (L,); the forecast's error as the learnt models expected it, NaN where they expect none.
    expected: np.ndarray
    valid_lead: ValidLeadSkill | None = None  #: Of roll and pitch.


@dataclass(frozen=True)
class Skill:
    """Scores of a record.

    Example:
        >>> trial = read_trial(records / 'morro_buoy.csv').between(0.0, 60.0)
        >>> skill = score(trial, run_through(trial, ForecasterSettings(leads=(1.0,), forecast_rate=2.0)))
        >>> sorted(skill.axes), skill.warmup
        (['pitch', 'roll'], 20)
        >>> skill.axes['roll'].coverage.shape  # of the 50, 90 and 99 % intervals, by lead
        (1, 3)
    """

    leads: np.ndarray  #: (L,); s.
    axes: dict[str, QuantitySkill]
    warmup: float  #: s from the record's start that were not scored.
    until: float  #: s from the record's start up to which forecasts were scored.
    window: float  #: s of past that the baselines learnt from.
    step_time: dict[str, float]  #: 'median' and 'most', s; NaN where not measured.
    refit_time: dict[str, float]
    quiescence: Reliability | None = None
    quiescence_limits: QuiescenceLimits | None = None
    advice: tuple[Advice, ...] = ()
    points: dict[str, dict[str, QuantitySkill]] = field(default_factory=dict)  #: By point and `POINT_MOTION`.
    decisions: DecisionSkill | None = None  #: Where limits of quiescence were scored.
    installation: Installation | None = None  #: Of the sensor, as of the `Trial`.


def usual_warmup(trial: Trial) -> float:
    """Seconds at the start of a record that are not scored: 600, or a third of a shorter one."""
    return min(_LONGEST_WARMUP, round(float(trial.time[-1] - trial.time[0]) / 3.0))


def usual_limits(
    trial: Trial, limits: QuiescenceLimits, warmup: float, axes: Sequence[str] = AXES
) -> QuiescenceLimits | None:
    """Limits of quiescence to score: those given, else the angles of axes seldom exceeded in the warm-up, s. None where
    none are given and the warm-up is too short.
    """
    if np.isfinite(limits.bounds(ATTITUDE)).any():
        return limits
    seen = trial.time < trial.time[0] + warmup
    warm = {axis: trial.channels[axis][seen] for axis in axes if axis in trial.channels}
    warm = {axis: angle for axis, angle in warm.items() if np.nanmax(np.abs(angle), initial=0.0) > 0.0}
    if warmup < _BLOCK or not warm:
        return None
    # passed so rarely that staying below for some seconds is uncertain
    found: dict[str, Any] = {axis: float(abs(np.nanmean(a)) + TWO_STD * np.nanstd(a)) for axis, a in warm.items()}
    return replace(limits, **found)


def check_scorable(trial: Trial, warmup: float, longest_lead: float, until: float | None = None) -> None:
    """Refuse a record without angles, or a warm-up, s, after which no forecast up to ``until``, s, is left to score."""
    if not any(axis in trial.channels for axis in AXES):
        cause = next((each.message for each in trial.advice if each.code == BLANK_ORIENTATION), 'give roll or pitch')
        raise InputError(f'{trial.source or "the record"} has no angles to score forecasts on: {cause}')
    duration = float(trial.time[-1] - trial.time[0])
    if until is not None and until <= warmup < duration - longest_lead:
        raise InputError(
            f'scoring ends at {until:g} s, within the warm-up of {warmup:.0f} s, so no forecast is left to score: '
            'end it later, or shorten the warm-up',
            'ends-in-warmup',
        )
    if duration <= warmup + longest_lead:
        raise InputError(
            f'{trial.source or "the record"} lasts {duration:.0f} s so no forecast is left to score after the warm-up '
            f'of {warmup:.0f} s at the longest lead of {longest_lead:g} s: shorten the warm-up'
        )


def score(
    trial: Trial,
    run: Run,
    leads: Sequence[float] | np.ndarray | None = None,
    warmup: float | None = None,
    window: float = ForecasterSettings.window,
    until: float | None = None,
    seed: int = 0,
    points: Sequence[Point] = (),
) -> Skill:
    """Score the forecasts of a run and the baselines at the same instants.

    Every forecast issued between `warmup` and `until` counts, unless nothing was measured at the time that it is
    for. Where a method has no value, persistence (the last measured angle) replaces it.

    Args:
        trial: The whole record.
        run: Through that record.
        leads: s, of those that the forecasts are for; by default all.
        warmup: s from the record's start that are not scored; by default 600, or a third of a shorter record.
        window: Periods of past that the baselines learn from.
        until: s from the record's start; by default to its end.
        seed: Of the bootstrap.
        points: Of those whose vertical motion was forecast; it is scored by that of the whole record
            (`vertical_record`).

    Returns:
        Root mean square errors over the standard deviation of the motion by axis and lead, beside those of the
        baselines, and the share of the intervals that held what came.

    Raises:
        InputError: The record has no angle, or no forecast was issued in time for one of the leads; with points, it
            does not show its vertical motion.

    Example:
        >>> trial = read_trial(records / 'morro_buoy.csv').between(0.0, 60.0)
        >>> run = run_through(trial, ForecasterSettings(leads=(1.0, 2.0), forecast_rate=2.0))
        >>> roll = score(trial, run).axes['roll']
        >>> bool((roll.nrmse['forecast'] < roll.nrmse['persistence']).all())
        True
    """
    warmup = usual_warmup(trial) if warmup is None else warmup
    if leads is None:
        leads = run.steps[0].forecast.leads if run.steps else (math.inf,)
    leads = np.array(sorted({float(lead) for lead in leads}))
    axes, name = [axis for axis in AXES if axis in trial.channels], trial.source or 'the record'
    check_scorable(trial, warmup, leads[-1], until)
    start, end = float(trial.time[0]), float(trial.time[-1])
    until = end - start if until is None else float(until)
    scored = tuple(s for s in run.steps if start + warmup <= s.stamp <= start + until)
    if not scored:
        raise InputError(f'no forecast of {name} was issued between {warmup:.0f} and {until:.0f} s: score more of it')
    record, stamps = Record.of(trial), np.array([s.stamp for s in scored])
    past = window * record.first_periods[0]
    baselines = baseline_forecasts(record, axes, stamps, leads, past)
    span = start + warmup, start + until + leads[-1]
    results, advice = {}, []
    for axis in axes:
        angle, half_width, own = _issued(scored, axis, leads)
        at = _Occasions(stamps, leads, span, record.after_gap(axis, stamps, AFTER_GAP), seed)
        methods = {FORECAST: angle, **baselines[axis]}
        valid = score_valid_leads(record, axis, scored)
        results[axis] = replace(_score(record, axis, at, methods, half_width, 'persistence', own), valid_lead=valid)
        missing = round(float(np.nan_to_num(results[axis].replaced_share[FORECAST] * results[axis].counted).max()))
        if missing:
            advice.append(Advice.of('forecast-missing', missing=missing, axis=axis))
    vertical: dict[str, dict[str, QuantitySkill]] = {}
    if points:
        truth = vertical_record(trial, points)
        at = _Occasions(stamps, leads, span, record.after_gap('accel_z', stamps, AFTER_GAP), seed)
        if not ((truth.time >= stamps[0] + leads[-1]) & (truth.time <= span[1])).any():
            raise InputError(
                f'{name} does not show its vertical motion from {warmup:.0f} to {until:.0f} s: it is not known within '
                f'{EDGE:.0f} s of the ends of a record and of gaps, so shorten the warm-up'
            )
    for point in points:
        mean, half_widths = _issued_at_point(scored, point.name, leads)
        vertical[point.name] = {}
        for place, kind in enumerate(POINT_MOTION):
            quantity = quantity_at(point.name, kind)
            methods = {FORECAST: mean[..., place], **simple_forecasts(truth, quantity, stamps, leads, past)}
            vertical[point.name][kind] = _score(truth, quantity, at, methods, half_widths[:, :, place], 'mean')
    return Skill(
        leads,
        results,
        warmup,
        until,
        past,
        _spread(run.step_times),
        _spread(run.refit_times),
        run.reliability,
        run.quiescence_limits,
        (*advice, *_leads_between_samples(leads, trial.time)),
        vertical,
        None if run.quiescence_limits is None else score_decisions(trial, scored, run.quiescence_limits),
        trial.installation,
    )


def _leads_between_samples(leads: np.ndarray, time: np.ndarray) -> list[Advice]:
    """Advice about leads at which nothing was measured."""
    interval = float(np.diff(time).min())
    short = [f'{lead:g}' for lead in leads if lead < interval]
    return [Advice.of('leads-between-samples', leads=', '.join(short), interval=interval)] if short else []


def score_forecasts(
    record: Record,
    name: str,
    stamps: np.ndarray,
    leads: np.ndarray,
    forecasts: np.ndarray,
    stand_in: np.ndarray,
    own: np.ndarray | None = None,
) -> QuantitySkill:
    """Score forecasts (N, L) of one channel, issued at stamps (N,), s, for leads (L,), s, beside ``persistence``. Where
    a forecast is NaN, ``stand_in`` (N, L) counts in its place; ``own`` (N, L) are the errors that were expected.
    """
    span = float(stamps[0]), float(stamps[-1] + leads[-1])
    at = _Occasions(stamps, leads, span, record.after_gap(name, stamps, AFTER_GAP), 0)
    none = np.full((*forecasts.shape, LEVELS.size), np.nan)
    return _score(record, name, at, {FORECAST: forecasts, 'persistence': stand_in}, none, 'persistence', own)


def score_valid_leads(record: Record, axis: str, steps: Sequence[Any]) -> ValidLeadSkill:
    """Score the valid leads of an axis that were issued at these steps, by the errors over those expected there."""
    leads = np.array([step.outlook.valid_leads.get(axis, np.nan) for step in steps])
    known, end = np.isfinite(leads), np.array([step.horizon.leads[-1] for step in steps])
    ratio = []
    for step, lead in zip(steps, leads, strict=True):
        if 0.0 < lead < step.horizon.leads[-1]:
            columns = step.horizon.angle(axis), step.horizon.deviation[:, ATTITUDE.index(axis)]
            angle, expected = (np.interp(lead, step.horizon.leads, column) for column in columns)
            came = record.at(np.array(step.stamp + lead), [record.names.index(axis)])[0]
            ratio.append((angle - came) / expected)
    measured = np.array(ratio)[np.isfinite(ratio)]
    return ValidLeadSkill(
        np.quantile(leads[known], (0.5, 0.1, 0.9)) if known.any() else np.full(3, np.nan),
        float(np.sqrt(np.mean(measured**2))) if measured.size else np.nan,
        measured.size,
        float(np.mean(leads[known] >= end[known])) if known.any() else np.nan,
    )


def _issued(steps: Sequence[Any], axis: str, leads: np.ndarray):
    """Angles (N, L), half widths (N, L, 3) and the models' own deviations (N, L) as issued; NaN where not forecast."""
    places = _places(steps, leads)
    angle, own = np.full((2, len(steps), leads.size), np.nan)
    half_width = np.full((*angle.shape, LEVELS.size), np.nan)
    for row, step in enumerate(steps):
        if axis in step.forecast.axes:
            ahead = step.forecast.chosen(places)
            angle[row], half_width[row] = ahead.angle(axis), ahead.half_width(axis)
            own[row] = np.nan if ahead.own_deviation is None else ahead.own_deviation[:, ATTITUDE.index(axis)]
    return angle, half_width, own


def _issued_at_point(steps: Sequence[Any], name: str, leads: np.ndarray):
    """`POINT_MOTION`, shape (N, L, 3), and half widths, shape (N, L, 3, 3), as issued; NaN before it is learnt."""
    places, count = _places(steps, leads), len(POINT_MOTION)
    mean = np.full((len(steps), leads.size, count), np.nan)
    deviation = mean.copy()
    for row, step in enumerate(steps):
        if name in step.forecast.points:
            ahead = step.forecast.points[name]
            mean[row] = ahead.mean[places]
            deviation[row] = np.sqrt(np.diagonal(ahead.covariance[places], axis1=1, axis2=2)[:, :count])
    return mean, deviation[..., None] * NORMAL_QUANTILES


def _places(steps: Sequence[Any], leads: np.ndarray):
    """Of the leads among those that were forecast."""
    given = steps[0].forecast.leads
    places = np.abs(given[:, None] - leads).argmin(axis=0)
    if np.any(np.abs(given[places] - leads) > 1e-9):
        raise InputError(f'the forecasts are for leads of {given.tolist()} s, not {leads.tolist()} s: choose of these')
    return places


class _Occasions(NamedTuple):
    """When forecasts were issued, s, how far ahead, the span of time scored, and which were issued after a gap."""

    stamps: np.ndarray
    leads: np.ndarray
    span: tuple[float, float]
    after_gap: np.ndarray
    seed: int


def _score(
    record: Record,
    name: str,
    at: _Occasions,
    methods: Mapping[str, np.ndarray],
    half_width: np.ndarray,
    stand_in: str,
    own: np.ndarray | None = None,
):
    """Scores of the methods' forecasts of a channel; the named method replaces those without a value."""
    stamps, leads = at.stamps, at.leads
    truth = record.at(stamps[:, None] + leads, [record.names.index(name)])[..., 0]
    resting, baselines = methods[stand_in], [method for method in methods if method != FORECAST]
    deviation = float(np.nanstd(record.column(name)[(record.time >= at.span[0]) & (record.time <= at.span[1])]))
    counts = np.isfinite(truth) & np.isfinite(resting)
    counted = counts.sum(axis=0)
    share = np.where(counted > 0, 1.0 / np.maximum(counted, 1), np.nan)
    absent = {name: counts & ~np.isfinite(values) for name, values in methods.items()}
    errors = {name: np.where(absent[name], resting, values) - truth for name, values in methods.items()}
    squares = {name: np.where(counts, error**2, 0.0) for name, error in errors.items()}
    scale = deviation if deviation > 0.0 else math.nan
    nrmse = {name: np.sqrt(square.sum(axis=0) * share) / scale for name, square in squares.items()}
    held = counts[..., None] & ~absent[FORECAST][..., None] & (np.abs(errors[FORECAST])[..., None] <= half_width)
    expected = np.where(counts, np.nan if own is None else own**2, np.nan)
    best = tuple(min(baselines, key=lambda name: nrmse[name][i]) for i in range(leads.size))
    of_best = np.column_stack([squares[name][:, i] for i, name in enumerate(best)])
    sums = block_sums(stamps, np.stack([squares[FORECAST], of_best, counts.astype(float)]))
    ours, theirs, samples = resampled(sums, at.seed)
    after = counts & at.after_gap[:, None]
    with np.errstate(invalid='ignore', divide='ignore'):
        gap_nrmse = {
            name: np.sqrt((squares[name] * after).sum(axis=0) / after.sum(axis=0)) / scale
            for name in (FORECAST, 'persistence')
        }
        ratio = nrmse[FORECAST] / np.array([nrmse[name][i] for i, name in enumerate(best)])
        expected = np.sqrt(np.nansum(expected, axis=0) / np.isfinite(expected).sum(axis=0)) / scale
        interval, ratio_interval = _middle(np.sqrt(ours / samples) / scale), _middle(np.sqrt(ours / theirs))
    return QuantitySkill(
        deviation=deviation,
        counted=counted,
        unmeasured=stamps.size - counted,
        nrmse=nrmse,
        replaced_share={name: missing.sum(axis=0) * share for name, missing in absent.items()},
        coverage=held.sum(axis=0) * share[:, None],
        interval=interval,
        best=best,
        ratio=ratio,
        ratio_interval=ratio_interval,
        gap_share=after.sum(axis=0) * share,
        gap_nrmse=gap_nrmse,
        expected=expected,
    )


def block_sums(stamps: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Sums (K, B, L) of values (K, N, L) over the B blocks of time that hold any of the stamps (N,), s."""
    blocks = ((stamps - stamps[0]) // _BLOCK).astype(int)
    return np.add.reduceat(values, np.flatnonzero(np.diff(blocks, prepend=-1)), axis=1)


def resampled(sums: np.ndarray, seed: int) -> np.ndarray:
    """Totals of block sums (K, B, L) drawn with replacement (Kuensch 1989); NaN for too few blocks."""
    count = sums.shape[1]
    if count < _MIN_BLOCKS:
        return np.full((sums.shape[0], _REPLICATES, sums.shape[2]), np.nan)
    return np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), _REPLICATES) @ sums


def _middle(values: np.ndarray):
    """The central interval over replicates, shape (L, 2)."""
    tail = 0.5 * (1.0 - CONFIDENCE)
    return np.quantile(values, (tail, 1.0 - tail), axis=0).T


def _spread(times: Sequence[float]):
    finite = [t for t in times if t == t]
    if not finite:
        return {'median': math.nan, 'most': math.nan}
    return {'median': float(np.median(finite)), 'most': float(max(finite))}
