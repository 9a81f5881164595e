"""Forecasts of a published roll hull in JONSWAP seas beside the Kalman filter that knows everything.

Each sea has four hundred incommensurate components and a peak period of its own. The sensor gives roll and roll
rate at 10 Hz. The oracle knows the hull, the noise and the spectrum of the excitation: an extended Kalman filter
on the hull and a long autoregression of the excitation, from the exact autocovariance (Yule and Walker).

    OMP_NUM_THREADS=1 python benchmark/sea_forecasts.py --seeds 20
"""
import argparse
import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz

from swath_sysid.hull.catalogue import hull_named
from swath_sysid.prediction.free_forecast import carry_on
from swath_sysid.prediction.predictor import ImuSample, Predictor, PredictorSettings
from swath_sysid.prediction.waves import fit_waves

HULL = hull_named('swath-roll').model
LEADS = (0.1, 0.5, 1.0, 2.0, 3.0, 5.0)
STEP = 0.1
FINE = 5
ANGLE_NOISE, RATE_NOISE = 5e-4, 3e-3
PEAK_PERIODS = (2.0, 4.5)
SIZE = math.radians(1.3)
COMPONENTS = 400
ORDER = 80


@dataclass(frozen=True)
class Sea:
    """A craft in a sea: components of the excitation, what happened and what the sensor saw."""

    frequency: np.ndarray
    amplitude: np.ndarray
    peak_period: float
    angle: np.ndarray
    rate: np.ndarray
    seen: np.ndarray


def jonswap(frequency, peak, peakedness=3.3):
    """Hasselmann et al. (1973), of any height."""
    width = np.where(frequency <= peak, 0.07, 0.09)
    bump = np.exp(-0.5 * ((frequency / peak - 1.0) / width) ** 2)
    return frequency**-5.0 * np.exp(-1.25 * (peak / frequency) ** 4) * peakedness**bump


def make_sea(seed, duration):
    """A fresh sea, its excitation in proportion to the elevation, its size such that the roll is moderate."""
    rng = np.random.default_rng(seed)
    period = rng.uniform(*PEAK_PERIODS)
    peak = 2.0 * math.pi / period
    edges = np.linspace(0.5 * peak, 5.0 * peak, COMPONENTS + 1)
    frequency = edges[:-1] + rng.uniform(0.0, 1.0, COMPONENTS) * np.diff(edges)
    density = jonswap(frequency, peak) * np.diff(edges)
    amplitude = 0.3 * np.sqrt(2.0 * density / density.sum())
    phase = rng.uniform(0.0, 2.0 * math.pi, COMPONENTS)
    fine = STEP / FINE
    middle = fine * (np.arange(round(duration / fine)) + 0.5)
    moments = sum(a * np.cos(w * middle + p) for a, w, p in zip(amplitude, frequency, phase, strict=True))
    for _ in range(4):
        # the damping is not linear: the height that gives the size is found step by step
        angle, rate = (v[::FINE] for v in carry_on(HULL, HULL.trim, 0.0, HULL.trim, moments, fine, 1))
        scale = SIZE / angle.std()
        amplitude, moments = scale * amplitude, scale * moments
    angle, rate = (v[::FINE] for v in carry_on(HULL, HULL.trim, 0.0, HULL.trim, moments, fine, 1))
    seen = np.column_stack([
        angle + rng.normal(0.0, ANGLE_NOISE, angle.size), rate + rng.normal(0.0, RATE_NOISE, rate.size)
    ])  # fmt: skip
    return Sea(frequency, amplitude, period, angle, rate, seen)


def shaping_filter(sea):
    """Autoregression of the excitation's mean over a step, and the variance of its noise."""
    variance = 0.5 * (sea.amplitude * np.sinc(sea.frequency * STEP / (2.0 * math.pi))) ** 2
    covariance = (variance * np.cos(np.outer(np.arange(ORDER + 1) * STEP, sea.frequency))).sum(axis=1)
    column = covariance[:ORDER].copy()
    column[0] *= 1.0 + 1e-8
    coefficients = solve_toeplitz(column, covariance[1:])
    return coefficients, column[0] - coefficients @ covariance[1:], covariance


def oracle(sea, leads):
    """Forecasts of the filter that knows everything, shape (N, L)."""
    coefficients, noise, covariance = shaping_filter(sea)
    size, steps = ORDER + 2, np.round(np.array(leads) / STEP).astype(int)
    mean, spread = np.zeros(size), np.zeros((size, size))
    mean[0] = HULL.trim
    spread[:2, :2] = np.diag([1e-2, 1e-2])
    lags = np.abs(np.subtract.outer(np.arange(ORDER), np.arange(ORDER)))
    spread[2:, 2:] = covariance[lags]
    measured = np.diag([ANGLE_NOISE**2, RATE_NOISE**2])
    move = np.zeros((size, size))
    move[2, 2:] = coefficients
    move[np.arange(3, size), np.arange(2, size - 1)] = 1.0
    told = np.empty((sea.seen.shape[0], steps.size))
    for k, seen in enumerate(sea.seen):
        gain = np.linalg.solve(spread[:2, :2] + measured, spread[:2]).T
        mean = mean + gain @ (seen - mean[:2])
        spread = spread - gain @ spread[:2]
        future, moments = mean[2:], np.empty(steps[-1])
        for j in range(steps[-1]):
            moments[j] = future[0]
            future = np.concatenate([[coefficients @ future], future[:-1]])
        told[k] = carry_on(HULL, mean[0], mean[1], HULL.trim, moments, STEP / FINE, FINE)[0][steps]
        # the first of the excitations in the state acts from now to the next sample
        move[:2, :3] = _slopes(mean)
        angles, rates = carry_on(HULL, mean[0], mean[1], HULL.trim, mean[2:3], STEP / FINE, FINE)
        mean = np.concatenate([[angles[1], rates[1], coefficients @ mean[2:]], mean[2:-1]])
        spread = move @ spread @ move.T
        spread[2, 2] += noise
        spread = 0.5 * (spread + spread.T)
    return told


def _slopes(mean):
    """Derivatives of the next angle and rate by angle, rate and excitation."""
    slopes, small = np.empty((2, 3)), 1e-5
    for j in range(3):
        ends = []
        for sign in (-1.0, 1.0):
            state = mean[:3].copy()
            state[j] += sign * small
            angles, rates = carry_on(HULL, state[0], state[1], HULL.trim, state[2:], STEP / FINE, FINE)
            ends.append((angles[1], rates[1]))
        slopes[:, j] = (np.array(ends[1]) - np.array(ends[0])) / (2.0 * small)
    return slopes


def forecasts(sea, leads, knows_hull=True):
    """What the predictor tells at every sample: angles (N, L) and 90 % half widths (N, L)."""
    predictor = Predictor(PredictorSettings(leads=leads, horizon=leads[-1]))
    if knows_hull:
        predictor.set_model('roll', HULL)
    angles, widths = np.full((2, sea.angle.size, len(leads)), np.nan)
    for k, (roll, rate) in enumerate(sea.seen.tolist()):
        step = predictor.observe(ImuSample(
            k * STEP, roll, roll_rate=rate, roll_variance=ANGLE_NOISE**2, roll_rate_variance=RATE_NOISE**2
        ))  # fmt: skip
        if step.refit is not None:
            predictor.install(fit_waves(step.refit))
        if step.forecast is not None:
            ahead = step.forecast.axes['roll']
            angles[k], widths[k] = ahead.angle, ahead.half_width[:, 1]
    return angles, widths


def compare(seed, warmup, scored, leads=LEADS, knows_hull=True):
    """NRMSE of predictor and oracle, and coverage of the 90 % interval, each of shape (L,), on the same samples."""
    sea = make_sea(seed, warmup + scored)
    ours, widths = forecasts(sea, leads, knows_hull)
    best = oracle(sea, leads)
    first, deviation, result = round(warmup / STEP), sea.angle[round(warmup / STEP):].std(), []
    for i, lead in enumerate(leads):
        ahead = round(lead / STEP)
        issued = np.arange(first, sea.angle.size - ahead)
        issued = issued[np.isfinite(ours[issued, i])]
        truth = sea.angle[issued + ahead]
        errors = ours[issued, i] - truth, best[issued, i] - truth
        result.append((
            *(np.sqrt(np.mean(e**2)) / deviation for e in errors), np.mean(np.abs(errors[0]) <= widths[issued, i])
        ))  # fmt: skip
    return sea, np.array(result).T


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seeds', type=int, default=20)
    parser.add_argument('--first', type=int, default=100, help='seed of the first sea')
    parser.add_argument('--warmup', type=float, default=300.0, help='s')
    parser.add_argument('--scored', type=float, default=300.0, help='s')
    parser.add_argument('--without-hull', action='store_true')
    given = parser.parse_args()
    rows = []
    print('leads, s          ', *(f'{lead:17.1f}' for lead in LEADS))
    for seed in range(given.first, given.first + given.seeds):
        sea, scores = compare(seed, given.warmup, given.scored, knows_hull=not given.without_hull)
        rows.append(scores)
        cells = (f'{a:6.3f} / {b:5.3f} {c:.2f}' for a, b, c in scores.T)
        print(f'Tp {sea.peak_period:4.1f} s, {math.degrees(np.abs(sea.angle).max()):3.1f} deg', *cells, flush=True)
    ours, best, coverage = np.sqrt(np.mean(np.square(rows), axis=0))
    print('all               ', *(f'{a:6.3f} / {b:5.3f} {c:.2f}' for a, b, c in zip(ours, best, coverage, strict=True)))
    print('over the oracle   ', *(f'{ratio:17.3f}' for ratio in ours / best))
    print('worst of all seas ', *(f'{worst:17.3f}' for worst in np.array(rows)[:, 0].max(axis=0)))


if __name__ == '__main__':
    main()
