"""Forecast errors of manoeuvres by lead, against simple forecasts and an ARX."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.identification.windows import SETTLING
from swath_sysid.manoeuvring.motion.trial import Run
from swath_sysid.manoeuvring.prediction.predictor import MEASURABLE, ManoeuvreFilter, ManoeuvreFilterSettings

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
        """Iterate ahead: motion (S, 3) from the past (ORDER, 3), latest last, and inputs (ORDER - 1 + S, 2), port and
        starboard, past and future.
        """
        ahead = []
        window = np.array(past)
        for k in range(len(inputs) - ORDER + 1):
            row = np.concatenate([[1.0], window.ravel(), inputs[k : k + ORDER].ravel()])
            following = row @ self.coefficients
            window = np.concatenate([window[1:], following[None]])
            ahead.append(following)
        return np.array(ahead)


def fit_arx(runs: Sequence[Run], until: float = 1.0) -> Arx | None:
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
    runs: Sequence[Run],
    training: Sequence[Run] = (),
    supplied: bool = False,
    settings: ManoeuvreFilterSettings | None = None,
    leads: Sequence[float] = LEADS,
    truth: Sequence[Run] | None = None,
    held: bool = False,
) -> ForecastScores:
    """Forecast runs once a second as a live filter would have, and compare.

    The ARX learns from ``training``, or the other runs, or the first half of a single one. Inputs are held at their
    last value unless ``supplied``; ``held`` scores only leads over which they did hold. Errors are against ``truth``
    where given.
    """
    errors: dict[str, dict[str, list[list[float]]]] = {
        method: {q: [[] for _ in leads] for q in QUANTITIES} for method in METHODS
    }
    inside: dict[str, list[list[bool]]] = {q: [[] for _ in leads] for q in QUANTITIES[:4]}
    count = 0
    for index, run in enumerate(runs):
        if run.thrust_input != identified.model.thrust_input:
            raise InputError(
                f'{run.source} holds thrust as {run.thrust_input}, the model takes '
                f'{identified.model.thrust_input}: give runs of the same kind'
            )
        others = training or [other for k, other in enumerate(runs) if k != index]
        arx = fit_arx(others) if others else fit_arx([run], until=0.5)
        true = run if truth is None else truth[index]
        for rows in _forecast_errors(filtered(identified, run, settings), run, true, arx, supplied, leads, held):
            count += 1
            for method, q, i, error, reach in rows:
                errors[method][q][i].append(error)
                if method == 'model' and q in inside:
                    inside[q][i].append(abs(error) < reach)
    if not count:
        raise InputError(f'no run is longer than {SETTLING + leads[0]:.0f} s with known thrust: give longer runs')
    rmse = {
        method: {q: np.array([_rms(values) for values in by_lead]) for q, by_lead in quantities.items()}
        for method, quantities in errors.items()
    }
    spread = {q: np.array([np.mean(v) if v else np.nan for v in by_lead]) for q, by_lead in inside.items()}
    return ForecastScores(tuple(leads), rmse, spread, count)


def filtered(
    identified: IdentifiedManoeuvringModel, run: Run, settings: ManoeuvreFilterSettings | None = None
) -> Iterator[tuple[int, ManoeuvreFilter]]:
    """Index and filter at every sample of a run, from its first; the filter is one object: copy it to keep it."""
    filter_ = ManoeuvreFilter(identified, settings)
    channels = {name: getattr(run, name) for name in MEASURABLE}
    channels = {name: values for name, values in channels.items() if values is not None and np.isfinite(values).any()}
    for k, stamp in enumerate(run.time):
        now = {name: float(values[k]) for name, values in channels.items() if np.isfinite(values[k])}
        if not filter_.is_started:
            filter_.start(stamp, **now)
        else:
            filter_.advance(stamp)
            for name, value in now.items():
                filter_.correct(name, value)
        filter_.thrust.command(stamp, float(run.port[k]), float(run.starboard[k]))
        yield k, filter_


def _forecast_errors(
    filters: Iterator[tuple[int, ManoeuvreFilter]],
    run: Run,
    true: Run,
    arx: Arx | None,
    supplied: bool,
    leads: Sequence[float],
    held: bool,
) -> Iterator[list[tuple[str, str, int, float, float]]]:
    """For each forecast its method, quantity, index of the lead, error, and reach of the model's 90 % interval."""
    every, first = max(1, round(EVERY / run.step)), round(SETTLING / run.step)
    motion, inputs, known = _arx_series(run)
    places = [round(lead / run.step) for lead in leads]
    truth = dict(zip(QUANTITIES, (true.surge, true.sway, true.yaw_rate, true.heading), strict=False))
    for k, filter_ in filters:
        if k < first or (k - first) % every or not run.driven[k]:
            continue
        usable = run.driven[k:] & (inputs[k:] == inputs[k]).all(axis=1) if held else run.driven[k:]
        reached = [i for i, place in enumerate(places) if k + place < len(run.time) and usable[:place].all()]
        if not reached:
            continue
        steps = [places[i] for i in reached]
        usable_arx = arx if known[k - ORDER : k + 1].all() else None
        rows = []
        for method, table in _expected(filter_, run, k, steps, supplied, usable_arx, motion, inputs).items():
            for place, i in enumerate(reached):
                at = k + steps[place]
                for q, values in truth.items():
                    if values is not None and np.isfinite(values[at]):
                        reach = INTERVAL * table[f'{q} std'][place] if method == 'model' else np.nan
                        rows.append((method, q, i, table[q][place] - values[at], reach))
                if true.x is not None and true.y is not None:
                    miss = np.hypot(table['x'][place] - true.x[at], table['y'][place] - true.y[at])
                    rows.append((method, 'position_m', i, miss, np.nan))
        yield rows


def _expected(
    filter_: ManoeuvreFilter,
    run: Run,
    k: int,
    steps: list[int],
    supplied: bool,
    arx: Arx | None,
    motion: np.ndarray,
    inputs: np.ndarray,
):
    """Forecasts of every method at some steps ahead."""
    leads = [step * run.step for step in steps]
    future = None
    if supplied:
        places = range(k, min(k + steps[-1], len(run.time)))
        future = [((j - k) * run.step, float(run.port[j]), float(run.starboard[j])) for j in places]
    forecast = filter_.forecast(leads, future)
    noise = filter_.settings.noise
    table = {name: forecast.recorded[:, column] for column, name in enumerate((*QUANTITIES[:4], 'x', 'y'))}
    variances = np.diagonal(forecast.recorded_covariances, axis1=1, axis2=2)
    for column, (q, name) in enumerate(zip(QUANTITIES[:4], MEASURABLE, strict=False)):
        table[f'{q} std'] = np.sqrt(variances[:, column] + noise(name) ** 2)
    expected = {'model': table}
    surge, sway, rate, psi, x, y = map(float, filter_.forecast([1e-6]).recorded[0])
    for method, turning in (('constant-velocity', 0.0), ('constant-turn-rate', rate)):
        expected[method] = _steady(leads, surge, sway, turning, psi, x, y)
    expected['constant-velocity']['yaw_rate_rad_s'] = np.zeros(len(leads))
    if arx is not None:
        coming = inputs[k : k + steps[-1]] if supplied else np.repeat(inputs[k : k + 1], steps[-1], axis=0)
        past = inputs[k - ORDER + 1 : k]
        ahead = arx.run(motion[k - ORDER + 1 : k + 1], np.concatenate([past, coming]))
        expected['arx'] = _integrated(ahead, steps, run.step, psi, x, y)
    return expected


def _steady(times: Sequence[float], surge: float, sway: float, rate: float, psi: float, x: float, y: float):
    """Constant body velocities and yaw rate."""
    leads = np.asarray(times)
    heading = psi + rate * leads
    if abs(rate) > 1e-6:
        along, across = np.sin(rate * leads) / rate, (1.0 - np.cos(rate * leads)) / rate
    else:
        along, across = leads, 0.0 * leads
    ahead, aside = surge * along - sway * across, surge * across + sway * along
    return {
        'surge_m_s': np.full(leads.size, surge),
        'sway_m_s': np.full(leads.size, sway),
        'yaw_rate_rad_s': np.full(leads.size, rate),
        'heading_rad': heading,
        'x': x + ahead * np.cos(psi) - aside * np.sin(psi),
        'y': y + ahead * np.sin(psi) + aside * np.cos(psi),
    }


def _integrated(motion: np.ndarray, steps: list[int], step: float, psi: float, x: float, y: float):
    surge, sway, rate = np.clip(motion, -1e3, 1e3).T
    heading = psi + np.cumsum(rate) * step
    east = x + np.cumsum(surge * np.cos(heading) - sway * np.sin(heading)) * step
    north = y + np.cumsum(surge * np.sin(heading) + sway * np.cos(heading)) * step
    at = np.asarray(steps) - 1
    return {
        'surge_m_s': surge[at],
        'sway_m_s': sway[at],
        'yaw_rate_rad_s': rate[at],
        'heading_rad': heading[at],
        'x': east[at],
        'y': north[at],
    }


def _arx_series(run: Run):
    """Motion (N, 3), inputs (N, 2), and where both are known; an unmeasured sway counts as zero."""
    motion = run.smooth.T.copy()
    # no smoothing ahead of its time: what is measured, the smoothed value only in its gaps
    raw = run.channels.T
    motion = np.where(np.isfinite(raw), raw, motion)
    if not np.isfinite(run.sway).any():
        motion[:, 1] = 0.0
    known = np.all(np.isfinite(motion), axis=1) & run.driven
    return np.where(np.isfinite(motion), motion, 0.0), np.stack([run.port, run.starboard], axis=1), known


def _rms(values: Sequence[float]):
    return float(np.sqrt(np.mean(np.square(np.clip(values, -1e6, 1e6))))) if values else float('nan')
