"""Forecasts of a published roll hull in simulated seas beside the Kalman filter that is given everything.

Each sea has four hundred incommensurate components and a peak period of its own. The sensor gives roll and roll
rate, the same readings at any rate. The oracle is given hull, noise and the spectrum of the excitation: at 10 Hz
an extended Kalman filter on the hull and a long autoregression of the excitation, from the exact autocovariance (Yule
and Walker). The baselines are those of `swath-sysid forecast`. Errors are of the true angle.

`linear` is the best forecast in proportion to the readings of the last 20 s, given the spectrum of the true angle over
all of the sea, what is scored included: what can be known of the motion without its hull, which is not linear.

    OMP_NUM_THREADS=1 python benchmark/sea_forecasts.py --seeds 20
    OMP_NUM_THREADS=1 python benchmark/sea_forecasts.py --seeds 20 --first 900 --rates 10 100
    OMP_NUM_THREADS=1 python benchmark/sea_forecasts.py --seeds 20 --stiffness 1.15 --quadratic-damping 1.5
    OMP_NUM_THREADS=1 python benchmark/sea_forecasts.py --seeds 12 --sea swell --without-hull
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import solve_toeplitz

from swath_sysid.attitude.hull.catalogue import hull_named
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.hull.simulation import motion_step
from swath_sysid.attitude.hull.terms import TERM_NAMES
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.common.signals import sine_tapers
from swath_sysid.evaluation.baselines import Record, baseline_forecasts
from swath_sysid.evaluation.cli.benchmark import Benchmark
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import followed

HULL = hull_named('swath-roll').model
LEADS = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0)
STEP = 0.1
"""s, of the oracle, of the baselines and of the scores."""

FINE_RATE = 100
"""Hz, of the simulation."""

ANGLE_NOISE, RATE_NOISE = 5e-4, 3e-3
PEAK_PERIODS = (2.0, 4.5)
SIZE = math.radians(1.3)
SMALL = math.radians(0.4)
"""Motion in which the hull, whose restoring vanishes at -8 deg, is nearly linear: what is left is the noise."""
COMPONENTS = 400
ORDER = 200
"""Of the oracle's autoregression: 80 leaves 3 to 5 % from .5 s on."""

WINDOW = 600.0
"""s of past that the baselines learn from."""

LINEAR_PAST = 200
"""Steps of readings that the best linear forecast takes."""

_PARTS = 2
"""Runge-Kutta steps in `STEP`."""

_SMALL = 1e-5


@dataclass(frozen=True)
class Sea:
    """A craft in a sea: components of the excitation, true motion and readings, both at `FINE_RATE`."""

    frequency: np.ndarray
    amplitude: np.ndarray
    peak_period: float
    angle: np.ndarray
    rate: np.ndarray
    seen: np.ndarray

    def readings(self, rate):
        """Angle and rate as read this many times a second, shape (N, 2)."""
        return self.seen[:: _every(rate)]

    def angle_at(self, stamps):
        """The true angle, s from the start; NaN after the end."""
        places = np.round(stamps * FINE_RATE).astype(int)
        return np.where(places < self.angle.size, self.angle[np.minimum(places, self.angle.size - 1)], np.nan)


def _every(rate):
    every = round(FINE_RATE / rate)
    if abs(every * rate - FINE_RATE) > 1e-6:
        raise ValueError(f'the sea is simulated at {FINE_RATE} Hz, which is not a multiple of {rate:g} Hz')
    return every


def jonswap(frequency, peak, peakedness=3.3):
    """Hasselmann et al. (1973), of any height."""
    width = np.where(frequency <= peak, 0.07, 0.09)
    bump = np.exp(-0.5 * ((frequency / peak - 1.0) / width) ** 2)
    return frequency**-5.0 * np.exp(-1.25 * (peak / frequency) ** 4) * peakedness**bump


def wind_sea(frequency):
    """JONSWAP, in frequencies over that of the peak."""
    return jonswap(frequency, 1.0)


def sea_on_swell(frequency):
    """A wind sea on as much of a swell of three times its period."""
    swell = jonswap(frequency, SWELL, 7.0)
    sea = jonswap(frequency, 1.0)
    return sea / np.trapezoid(sea, frequency) + swell / np.trapezoid(swell, frequency)


def narrow_sea(frequency):
    """JONSWAP of a young sea, three times as peaked as the steepest measured one of the North Sea."""
    return jonswap(frequency, 1.0, 20.0)


SWELL = 1.0 / 3.0
"""Frequency of a swell's peak over that of the sea on it."""

SEAS = {
    'jonswap': (wind_sea, 0.5, 5.0, SIZE),
    'swell': (sea_on_swell, 0.5 * SWELL, 5.0, SMALL),
    'narrow': (narrow_sea, 0.5, 5.0, SMALL),
}
"""Spectrum by name, the range of frequencies over that of the peak, and the standard deviation of the motion, rad."""


def make_sea(seed, duration, hull=HULL, lag=0.0, kind='jonswap'):
    """A fresh sea, its excitation in proportion to the elevation, its size such that the motion is moderate.

    The same seed gives another hull the same waves; a phase lag, rad, delays its excitation.
    """
    rng = np.random.default_rng(seed)
    period = rng.uniform(*PEAK_PERIODS)
    peak = 2.0 * math.pi / period
    spectrum, first, last, size = SEAS[kind]
    edges = np.linspace(first * peak, last * peak, COMPONENTS + 1)
    frequency = edges[:-1] + rng.uniform(0.0, 1.0, COMPONENTS) * np.diff(edges)
    density = spectrum(frequency / peak) * np.diff(edges)
    amplitude = 0.3 * np.sqrt(2.0 * density / density.sum())
    phase = rng.uniform(0.0, 2.0 * math.pi, COMPONENTS)
    middle = (np.arange(round(duration * FINE_RATE)) + 0.5) / FINE_RATE
    moments = sum(a * np.cos(w * middle + p - lag) for a, w, p in zip(amplitude, frequency, phase, strict=True))
    scale = math.inf
    while abs(scale - 1.0) > 1e-3:
        # the damping is not linear: the height that gives the size is found step by step
        angle, rate = _swing(moments, hull).T
        scale = size / angle.std()
        amplitude, moments = scale * amplitude, scale * moments
    angle, rate = _swing(moments, hull).T
    noise = rng.normal(0.0, (ANGLE_NOISE, RATE_NOISE), (angle.size, 2))
    return Sea(frequency, amplitude, period, angle, rate, np.column_stack([angle, rate]) + noise)


def _swing(moments, hull):
    """Angle and rate of the craft, from rest, at the start of each interval in which a moment is held."""
    ratios, active, friction_rate = tuple(hull.ratios.tolist()), hull.equation.active, hull.friction_rate
    states, x, rate = np.empty((moments.size, 2)), 0.0, 0.0
    for k, moment in enumerate(moments.tolist()):
        states[k] = x, rate
        _, x, rate = motion_step(x, rate, moment, 1.0 / FINE_RATE, ratios, active, friction_rate)
    return states + (hull.trim, 0.0)


def advance(angle, rate, moment):
    """Angles and rates one `STEP` later under held moments, by the classical Runge-Kutta scheme."""
    step = STEP / _PARTS
    for _ in range(_PARTS):
        a1 = HULL.acceleration(angle, rate, moment)
        w2 = rate + 0.5 * step * a1
        a2 = HULL.acceleration(angle + 0.5 * step * rate, w2, moment)
        w3 = rate + 0.5 * step * a2
        a3 = HULL.acceleration(angle + 0.5 * step * w2, w3, moment)
        w4 = rate + step * a3
        a4 = HULL.acceleration(angle + step * w3, w4, moment)
        angle = angle + step / 6.0 * (rate + 2.0 * (w2 + w3) + w4)
        rate = rate + step / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
    return angle, rate


def shaping_filter(sea):
    """Autoregression of the excitation's mean over a step, and the variance of its noise."""
    variance = 0.5 * (sea.amplitude * np.sinc(sea.frequency * STEP / (2.0 * math.pi))) ** 2
    covariance = (variance * np.cos(np.outer(np.arange(ORDER + 1) * STEP, sea.frequency))).sum(axis=1)
    column = covariance[:ORDER].copy()
    column[0] *= 1.0 + 1e-8
    coefficients = solve_toeplitz(column, covariance[1:])
    return coefficients, column[0] - coefficients @ covariance[1:], covariance


def oracle(sea, leads):
    """Forecasts of the filter that is given everything, shape (N, L).

    Its state is the angle, the rate, and the excitation from now to the next sample and in the steps
    before. Only the first three rows of its transition are more than a shift, so a step costs three rows of products.
    """
    coefficients, noise, covariance = shaping_filter(sea)
    readings, steps = sea.readings(1.0 / STEP), np.round(np.array(leads) / STEP).astype(int)
    size = coefficients.size + 2
    mean, spread = np.zeros(size), np.zeros((size, size))
    mean[0] = HULL.trim
    spread[:2, :2] = np.diag([1e-2, 1e-2])
    spread[2:, 2:] = covariance[np.abs(np.subtract.outer(np.arange(size - 2), np.arange(size - 2)))]
    measured, first = np.diag([ANGLE_NOISE**2, RATE_NOISE**2]), np.zeros((3, size))
    first[2, 2:] = coefficients
    ahead = moments_ahead(coefficients, steps[-1])
    states, moments = np.empty((readings.shape[0], 2)), np.empty((readings.shape[0], steps[-1]))
    for k, seen in enumerate(readings):
        gain = np.linalg.solve(spread[:2, :2] + measured, spread[:2]).T
        mean = mean + gain @ (seen - mean[:2])
        spread -= gain @ spread[:2]
        states[k], moments[k] = mean[:2], ahead @ mean[2:]
        following, first[:2, :3] = _linearised(mean[:3])
        mean = np.concatenate([following, [coefficients @ mean[2:]], mean[2:-1]])
        spread = moved(spread, first)
        spread[2, 2] += noise
    expected, (x, rate) = np.empty((readings.shape[0], steps.size)), states.T
    for j in range(steps[-1]):
        x, rate = advance(x, rate, moments[:, j])
        expected[:, steps == j + 1] = x[:, None]
    return expected


def best_linear(sea, leads):
    """Forecasts in proportion to the newest readings, from the true angle's spectrum, shape (N, L); NaN at first.

    With the spectrum's cosine and sine transforms, angle and rate at one instant covary with those at another.
    """
    every = round(STEP * FINE_RATE)
    angle, readings = sea.angle[::every], sea.readings(1.0 / STEP)
    tapered = sine_tapers(angle.size) * (angle - angle.mean())
    density = (np.abs(np.fft.rfft(tapered, axis=1)) ** 2).mean(axis=0) * 2.0 / angle.size
    frequency = 2.0 * np.pi * np.fft.rfftfreq(angle.size, STEP)
    steps = np.round(np.array(leads) / STEP).astype(int)
    phase = np.outer(STEP * np.arange(LINEAR_PAST + steps[-1]), frequency)
    of_angle, of_both = np.cos(phase) @ density, np.sin(phase) @ (density * frequency)
    of_rate = np.cos(phase) @ (density * frequency**2)
    past = np.arange(LINEAR_PAST)
    apart = past - past[:, None]
    both = np.sign(apart) * of_both[np.abs(apart)]
    within = np.block([[of_angle[np.abs(apart)], both], [both.T, of_rate[np.abs(apart)]]])
    within += np.diag(np.repeat([ANGLE_NOISE**2, RATE_NOISE**2], LINEAR_PAST))
    ahead = steps[:, None] + past
    gains = np.linalg.solve(within, np.hstack([of_angle[ahead], of_both[ahead]]).T)
    level = readings[:, 0].mean()
    pasts = sliding_window_view(readings - [level, 0.0], LINEAR_PAST, axis=0)[..., ::-1]
    forecasts = level + pasts.reshape(len(pasts), -1) @ gains
    return np.vstack([np.full((LINEAR_PAST - 1, steps.size), math.nan), forecasts])


def moments_ahead(coefficients, count):
    """Matrix from the last excitations, newest first, to those expected from now on, shape (count, ORDER)."""
    row, rows = np.eye(1, coefficients.size)[0], []
    for _ in range(count):
        rows.append(row)
        row = row[0] * coefficients + np.append(row[1:], 0.0)
    return np.array(rows)


def moved(spread, first):
    """A P A' for a transition A whose first three rows are given and whose others shift the excitations by one."""
    result = np.empty_like(spread)
    top = first @ spread
    corner = top @ first.T
    result[:3, :3] = 0.5 * (corner + corner.T)
    result[:3, 3:] = top[:, 2:-1]
    result[3:, :3] = result[:3, 3:].T
    result[3:, 3:] = spread[2:-1, 2:-1]
    return result


def _linearised(state):
    """The next angle and rate, and their derivatives by angle, rate and excitation."""
    columns = state[:, None] + _SMALL * np.column_stack([np.zeros(3), np.eye(3), -np.eye(3)])
    ends = np.array(advance(*columns))
    return ends[:, 0], (ends[:, 1:4] - ends[:, 4:]) / (2.0 * _SMALL)


def forecasts_of(sea, rate, hull, leads=LEADS):
    """What the forecaster issues about `STEP` apart: stamps (N,), angles (N, L) and 90 % half widths (N, L).

    Parameters
    ----------
    sea : Sea
    rate : float
        Of the sensor, Hz.
    hull : DecayModel or None
        What the forecaster takes for the hull.
    leads : sequence of float
        s.
    """
    pipeline = ForecastPipeline(PipelineSettings(forecaster=ForecasterSettings(leads=tuple(leads), horizon=leads[-1])))
    if hull is not None:
        pipeline.set_models({'roll': IdentifiedModel.exactly(hull)})
    issued, nan, noise = [], math.nan, (ANGLE_NOISE**2, math.nan, RATE_NOISE**2, math.nan)
    seen = (
        CraftSample(round(k / rate * 1e9), roll, nan, roll_rate, nan, nan, nan, nan, *noise)
        for k, (roll, roll_rate) in enumerate(sea.readings(rate).tolist())
    )
    for k, step in enumerate(followed(pipeline, seen)):
        if step.forecast is not None:
            issued.append((k / rate, step.forecast.angle('roll'), step.forecast.half_width('roll')[:, 1]))
    return tuple(np.array(part) for part in zip(*issued, strict=True))


def hull_off_by(stiffness=1.0, damping=1.0, quadratic_damping=1.0):
    """The hull with its restoring, its damping, and its quadratic damping beyond that, wrong by these factors."""
    factors = {name: damping if name.startswith('b') else stiffness for name in TERM_NAMES}
    factors['b2'] *= quadratic_damping
    return replace(HULL, ratios=HULL.ratios * np.array([factors[name] for name in TERM_NAMES]))


def compare(seed, warmup, scored, leads=LEADS, rates=(10.0,), hull=HULL, kind='jonswap'):
    """A sea, and the scores of everyone's forecasts in it.

    Returns
    -------
    sea : Sea
    nrmse : dict of str to ndarray, shape (L,)
        Of ``oracle``, the baselines, and ``10 Hz`` and so on, the forecaster at these rates. Persistence stands in
        where there is no forecast.
    coverage : dict of str to ndarray, shape (L,)
        Share of the forecaster's 90 % intervals that held the true angle.
    """
    sea = make_sea(seed, warmup + scored, kind=kind)
    seen = sea.readings(1.0 / STEP)
    time = STEP * np.arange(seen.shape[0])
    record = Record.of(Trial(time, roll=seen[:, 0], roll_rate=seen[:, 1]))
    baselines = baseline_forecasts(record, ['roll'], time, np.array(leads), WINDOW)['roll']
    nrmse, coverage = {'oracle': _score(sea, warmup, time, oracle(sea, leads), leads)[0]}, {}
    nrmse['linear'] = _score(sea, warmup, time, best_linear(sea, leads), leads)[0]
    for name, angles in baselines.items():
        nrmse[name] = _score(sea, warmup, time, np.where(np.isfinite(angles), angles, seen[:, :1]), leads)[0]
    for rate in rates:
        stamps, angles, widths = forecasts_of(sea, rate, hull, leads)
        nrmse[f'{rate:g} Hz'], coverage[f'{rate:g} Hz'] = _score(sea, warmup, stamps, angles, leads, widths)
    return sea, nrmse, coverage


def _score(sea, warmup, stamps, angles, leads, widths=math.nan):
    """NRMSE and share of the intervals that held, shape (L,), of what was issued after the warm-up."""
    wanted = stamps[:, None] + np.array(leads)
    counts = (stamps >= warmup - 1e-9)[:, None] & (wanted < sea.angle.size / FINE_RATE - 1e-9)
    errors = np.where(counts, angles - sea.angle_at(wanted), 0.0)
    deviation = sea.angle[round(warmup * FINE_RATE) :].std()
    held = ((np.abs(errors) <= widths) & counts).sum(axis=0) / counts.sum(axis=0)
    return np.sqrt((errors**2).sum(axis=0) / counts.sum(axis=0)) / deviation, held


def _row(name, values, digits):
    return ' '.join([f'{name:40}'[: 40 if len(name) > 28 else 28], *(f'{value:8.{digits}f}' for value in values)])


def lines(
    *,
    seeds: int = 20,
    first: Annotated[int, 'seed of the first sea: another one makes fresh seas'] = 100,
    warmup: Annotated[float, 's'] = 300.0,
    scored: Annotated[float, 's'] = 300.0,
    rates: Annotated[float, 'of the sensor, Hz'] = (10.0,),
    sea: Annotated[str, SEAS] = 'jonswap',
    without_hull: bool = False,
    stiffness: Annotated[float, 'factor by which the hull is wrong in restoring'] = 1.0,
    damping: Annotated[float, 'in all damping'] = 1.0,
    quadratic_damping: Annotated[float, 'in quadratic damping, beyond that'] = 1.0,
):
    """The tables."""
    hull = None if without_hull else hull_off_by(stiffness, damping, quadratic_damping)
    every, held = [], []
    yield ' '.join([f'{"":28}', *(f'{lead:6.1f} s' for lead in LEADS)])
    for seed in range(first, first + seeds):
        made, nrmse, coverage = compare(seed, warmup, scored, LEADS, rates, hull, sea)
        every.append(nrmse)
        held.append(coverage)
        name = f'seed {seed}, Tp {made.peak_period:3.1f} s, {math.degrees(np.abs(made.angle).max()):3.1f} deg'
        for rate in coverage:
            yield _row(f'{name} {rate}', nrmse[rate] / nrmse['oracle'], 3)
    every = {name: np.array([nrmse[name] for nrmse in every]) for name in every[0]}
    total = {name: np.sqrt(np.mean(values**2, axis=0)) for name, values in every.items()}
    yield '\nRMSE / standard deviation'
    for name, values in total.items():
        yield _row(name, values, 4)
    best = np.min([values for name, values in total.items() if name not in ('oracle', 'linear', *coverage)], axis=0)
    slowest = min(coverage, key=lambda name: float(name.split()[0]))
    for name in coverage:
        yield f'\nsensor at {name}'
        yield _row('over the oracle', total[name] / total['oracle'], 3)
        yield _row('over the best linear forecast', total[name] / total['linear'], 3)
        yield _row('worst sea over the oracle', (every[name] / every['oracle']).max(axis=0), 3)
        yield _row('over the best baseline', total[name] / best, 3)
        if name != slowest:
            yield _row(f'over that at {slowest}', total[name] / total[slowest], 3)
        yield _row('90 % held', np.mean([coverage[name] for coverage in held], axis=0), 3)


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
