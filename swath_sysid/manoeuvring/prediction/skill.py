"""Forecast errors of manoeuvres by lead, against simple forecasts and an ARX, and intervals calibrated by them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.identification.settings import SETTLING
from swath_sysid.manoeuvring.motion.trial import CraftRun
from swath_sysid.manoeuvring.prediction.filter_settings import MEASURABLE, ManoeuvreFilterSettings

if TYPE_CHECKING:
    from swath_sysid.manoeuvring.prediction.predictor import ManoeuvreFilter

LEADS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
EVERY = 1.0  #: s between forecasts.
ORDER = 10  #: Past samples of the ARX.
HELD = 0.9  #: Probability of the intervals.
INTERVAL = float(ndtri(0.5 + 0.5 * HELD))  #: Standard deviations on either side of them.

RIDGE = 1e-3
METHODS = ('model', 'constant-velocity', 'constant-turn-rate', 'arx')
QUANTITIES = ('surge_m_s', 'sway_m_s', 'yaw_rate_rad_s', 'heading_rad', 'position_m')


@dataclass(frozen=True)
class ForecastScores:
    """Root mean square errors of forecasts."""

    leads: tuple[float, ...]  #: s.
    rmse: dict[str, dict[str, np.ndarray]]  #: Method to quantity to errors by lead (L,); NaN where not measured.
    spread: dict[str, np.ndarray]  #: Quantity to coverage (L,) of the 90 % interval of the model.
    count: int  #: Number of forecasts.


@dataclass(frozen=True)
class Arx:
    """Linear regression of the next surge, sway and yaw rate on past ones and on past inputs."""

    coefficients: np.ndarray  #: (1 + 5 ORDER, 3)

    def run(self, past: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        """Motion (S, 3) after the past (ORDER, 3), latest last, under inputs (ORDER - 1 + S, 2), past and future."""
        ahead = []
        window = np.array(past)
        for k in range(len(inputs) - ORDER + 1):
            row = np.concatenate([[1.0], window.ravel(), inputs[k : k + ORDER].ravel()])
            following = row @ self.coefficients
            window = np.concatenate([window[1:], following[None]])
            ahead.append(following)
        return np.array(ahead)


def fit_arx(runs: Sequence[CraftRun], until: float = 1.0) -> Arx | None:
    """Ridge regression on the first share ``until`` of each run; None where there is too little data."""
    rows, targets = [], []
    for run in runs:
        motion, inputs, known = _arx_series(run)
        last = int(until * len(motion))
        for k in range(ORDER, last):
            if known[k - ORDER : k + 1].all():
                rows.append(np.concatenate([[1.0], motion[k - ORDER : k].ravel(), inputs[k - ORDER : k].ravel()]))
                targets.append(motion[k])
    if len(rows) < 10 * (1 + 5 * ORDER):
        return None
    matrix, target = np.array(rows), np.array(targets)
    size = np.sqrt(np.mean(matrix**2, axis=0)) + 1e-9
    scaled = matrix / size
    normal = scaled.T @ scaled + RIDGE * len(rows) * np.diag([0.0] + [1e-3] * (matrix.shape[1] - 1))
    return Arx(np.linalg.solve(normal, scaled.T @ target) / size[:, None])


def score_forecasts(
    identified: IdentifiedManoeuvringModel,
    runs: Sequence[CraftRun],
    training: Sequence[CraftRun] = (),
    supplied: bool = False,
    leads: Sequence[float] = LEADS,
    truth: Sequence[CraftRun] | None = None,
    held: bool = False,
) -> ForecastScores:
    """Forecast runs once a second as a live filter would have, and compare. The ARX learns from ``training``, or the
    other runs, or the first half of a single one. Inputs are held at their last value unless ``supplied``; ``held``
    scores only leads over which they did hold. Errors are against ``truth`` where given.
    """
    errors, inside = [], []
    for index, run in enumerate(runs):
        if run.thrust_input != identified.model.thrust_input:
            raise InputError(
                f'{run.source} holds thrust as {run.thrust_input}, the model takes '
                f'{identified.model.thrust_input}: give runs of the same kind'
            )
        others = training or [other for k, other in enumerate(runs) if k != index]
        arx = fit_arx(others) if others else fit_arx([run], until=0.5)
        true = run if truth is None else truth[index]
        for k, filter_, reach in due(identified, run, EVERY, leads, held):
            steps = np.array([round(leads[i] / run.step) for i in reach])
            expected, reaches = _expected(filter_, run, k, steps, supplied, arx)
            missed = expected - recorded(true)[:, k + steps].T
            found = np.full((len(METHODS), len(leads), len(QUANTITIES)), np.nan)
            found[:, reach, :4], found[:, reach, 4] = missed[..., :4], np.hypot(missed[..., 4], missed[..., 5])
            errors.append(found)
            held_in = np.full((len(leads), 4), np.nan)
            held_in[reach] = np.where(np.isnan(missed[0, :, :4]), np.nan, np.abs(missed[0, :, :4]) < reaches)
            inside.append(held_in)
    if not errors:
        raise InputError(f'no run is longer than {SETTLING + leads[0]:.0f} s with known thrust: give longer runs')
    rms = np.sqrt(_mean(np.square(np.clip(errors, -1e6, 1e6))))
    rmse = {method: {q: rms[m, :, c] for c, q in enumerate(QUANTITIES)} for m, method in enumerate(METHODS)}
    spread = dict(zip(QUANTITIES, _mean(np.array(inside)).T, strict=False))
    return ForecastScores(tuple(leads), rmse, spread, len(errors))


def _mean(values: np.ndarray):
    """Mean over the first axis; NaN where nothing is known."""
    count = np.isfinite(values).sum(axis=0)
    return np.where(count, np.nansum(values, axis=0), np.nan) / np.maximum(count, 1)


def recorded(run: CraftRun) -> np.ndarray:
    """The channels of ``MEASURABLE``, shape (6, N); NaN where not measured."""
    channels = (getattr(run, name) for name in MEASURABLE)
    return np.array([np.full(run.time.size, np.nan) if values is None else values for values in channels])


def filtered(
    identified: IdentifiedManoeuvringModel, run: CraftRun, settings: ManoeuvreFilterSettings | None = None
) -> Iterator[tuple[int, 'ManoeuvreFilter']]:
    """Index and filter at every sample of a run, from its first; the filter is one object: copy it to keep it."""
    from swath_sysid.manoeuvring.prediction.predictor import ManoeuvreFilter  # filterpy, which only forecasts need

    filter_, channels = ManoeuvreFilter(identified, settings), recorded(run)
    for k, stamp in enumerate(run.time):
        now = {name: value for name, value in zip(MEASURABLE, channels[:, k].tolist(), strict=True) if value == value}
        if not filter_.is_started:
            filter_.start(stamp, **now)
        else:
            filter_.advance(stamp)
            for name, value in now.items():
                filter_.correct(name, value)
        filter_.thrust.command(stamp, float(run.port[k]), float(run.starboard[k]))
        yield k, filter_


def due(
    identified: IdentifiedManoeuvringModel, run: CraftRun, every: float, leads: Sequence[float], held: bool = False
) -> Iterator[tuple[int, 'ManoeuvreFilter', list[int]]]:
    """`filtered` every so many seconds, with the places of the leads over which thrust is known, or ``held``."""
    inputs = np.stack([run.port, run.starboard])
    places = [round(lead / run.step) for lead in leads]
    first, apart = round(SETTLING / run.step), max(1, round(every / run.step))
    for k, filter_ in filtered(identified, run):
        if k < first or (k - first) % apart or not run.driven[k]:
            continue
        usable = run.driven[k:] & (inputs[:, k:] == inputs[:, k : k + 1]).all(axis=0) if held else run.driven[k:]
        reach = [i for i, place in enumerate(places) if k + place < run.time.size and usable[:place].all()]
        if reach:
            yield k, filter_, reach


def _expected(
    filter_: 'ManoeuvreFilter', run: CraftRun, k: int, steps: np.ndarray, supplied: bool, arx: Arx | None
) -> tuple[np.ndarray, np.ndarray]:
    """Forecasts of every method, (methods, L, 6), NaN where there is none; reach of the model's intervals, (L, 4)."""
    leads, longest = steps * run.step, int(steps[-1])
    future = None
    if supplied:
        ahead = zip(run.port[k : k + longest], run.starboard[k : k + longest], strict=True)
        future = [(j * run.step, float(port), float(starboard)) for j, (port, starboard) in enumerate(ahead)]
    forecast = filter_.forecast(leads, future)
    noise = np.array([filter_.settings.noise(name) for name in MEASURABLE[:4]])
    variances = np.diagonal(forecast.recorded_covariances, axis1=1, axis2=2)[:, :4] + noise**2
    now = filter_.forecast([1e-6]).recorded[0]
    surge, sway, rate, *pose = now.tolist()
    found = np.full((len(METHODS), len(leads), len(MEASURABLE)), np.nan)
    found[0] = forecast.recorded
    found[1] = _steady(leads, (surge, sway, 0.0), pose)
    found[2] = _steady(leads, (surge, sway, rate), pose)
    motion, inputs, known = _arx_series(run)
    if arx is not None and known[k - ORDER : k + 1].all():
        coming = inputs[k : k + longest] if supplied else np.repeat(inputs[k : k + 1], longest, axis=0)
        moved = arx.run(motion[k - ORDER + 1 : k + 1], np.concatenate([inputs[k - ORDER + 1 : k], coming]))
        found[3] = _integrated(np.clip(moved, -1e3, 1e3), run.step, pose)[steps - 1]
    return found, INTERVAL * np.sqrt(variances)


def _steady(leads: np.ndarray, motion: Sequence[float], pose: Sequence[float]):
    """Constant surge, sway and yaw rate from heading, x and y: the six channels at some leads, (L, 6)."""
    (surge, sway, rate), (psi, x, y) = motion, pose
    # mean direction over the arc, and the chord's share of it
    heading, half = psi + rate * leads, 0.5 * rate * leads
    chord = leads * np.sinc(half / np.pi)
    ahead, aside = chord * np.cos(psi + half), chord * np.sin(psi + half)
    same = np.ones_like(leads)
    place = x + surge * ahead - sway * aside, y + surge * aside + sway * ahead
    return np.stack([surge * same, sway * same, rate * same, heading, *place], axis=1)


def _integrated(motion: np.ndarray, step: float, pose: Sequence[float]):
    """The six channels (S, 6) of a motion (S, 3) from heading, x and y."""
    surge, sway, rate = motion.T
    psi, x, y = pose
    heading = psi + np.cumsum(rate) * step
    east = x + np.cumsum(surge * np.cos(heading) - sway * np.sin(heading)) * step
    north = y + np.cumsum(surge * np.sin(heading) + sway * np.cos(heading)) * step
    return np.stack([surge, sway, rate, heading, east, north], axis=1)


def _arx_series(run: CraftRun):
    """Motion (N, 3), inputs (N, 2), and where both are known; an unmeasured sway counts as zero."""
    raw = run.channels.T
    # no smoothing ahead of its time: what is measured, the smoothed value only in its gaps
    motion = np.where(np.isfinite(raw), raw, run.smooth.T)
    if not np.isfinite(run.sway).any():
        motion[:, 1] = 0.0
    known = np.all(np.isfinite(motion), axis=1) & run.driven
    return np.nan_to_num(motion), np.stack([run.port, run.starboard], axis=1), known


FORECASTS = 250  #: More hardly improve the estimate of a 90 % interval.
MIN_SCALE = 0.1  #: Seldom changing thrust leaves most errors at short leads far below its variance.


def calibrated(identified: IdentifiedManoeuvringModel, runs: Sequence[CraftRun]) -> IdentifiedManoeuvringModel:
    """The model with the scale of its forecast intervals by lead and channel, from the runs of its identification. With
    it the 90 % interval covers that share of the errors under held thrust, and more for few independent forecasts
    (split conformal prediction, Lei et al. 2018).
    """
    forecast = identified.forecast
    if forecast is None:
        raise InputError('the noise of forecasts was not measured: identify the craft again')
    errors, variances, noise = _errors(identified, runs)
    duration = sum(run.duration for run in runs)
    scale = np.ones((len(MEASURABLE), len(LEADS)))
    for c in range(len(MEASURABLE)):
        for k in range(len(LEADS)):
            known = np.isfinite(errors[:, k, c])
            apart = min(known.sum(), duration / max(LEADS[k], forecast.thrust_time))
            # where the sensor's own noise is larger, the errors say nothing about the forecast
            if known.any() and np.median(variances[known, k, c]) > noise[c] ** 2:
                scale[c, k] = _scale(errors[known, k, c], variances[known, k, c], noise[c], HELD * (1.0 + 1.0 / apart))
    return replace(identified, forecast=replace(forecast, leads=np.array(LEADS), scale=scale))


def _errors(identified: IdentifiedManoeuvringModel, runs: Sequence[CraftRun]):
    """Errors and variances of forecasts, shape (F, L, 6) each, NaN where unknown; and the sensor noise, (6,)."""
    total = sum(run.duration for run in runs)
    errors, variances = [], []
    for run in runs:
        truth = recorded(run)
        for k, filter_, reach in due(identified, run, total / FORECASTS, LEADS):
            steps = np.array([round(LEADS[i] / run.step) for i in reach])
            forecast = filter_.forecast([LEADS[i] for i in reach])
            found = np.full((2, len(LEADS), len(MEASURABLE)), np.nan)
            found[0, reach] = forecast.recorded - truth[:, k + steps].T
            found[1, reach] = np.diagonal(forecast.recorded_covariances, axis1=1, axis2=2)
            errors.append(found[0])
            variances.append(found[1])
    shape, settings = (-1, len(LEADS), len(MEASURABLE)), ManoeuvreFilterSettings.of(identified)
    noise = np.array([settings.noise(name) for name in MEASURABLE])
    return np.reshape(errors, shape), np.reshape(variances, shape), noise


def _scale(errors: np.ndarray, variances: np.ndarray, noise: float, held: float):
    """Factor on the standard deviations, sensor noise apart, for a coverage of ``held``."""
    needed = np.sqrt(np.maximum((errors / INTERVAL) ** 2 - noise**2, 0.0) / variances)
    return max(float(np.quantile(needed, min(held, 1.0), method='higher')), MIN_SCALE)
