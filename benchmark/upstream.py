"""Roll in a short-crested sea, forecast with a wave probe upstream and without, and with a probe that fails.

JONSWAP seas of 5 s peak period, long-crested or spread by cos^2s with s = 10; the craft rolls with a damping ratio of
.1 at the peak, and the probe measures the surface one or two wavelengths upstream. 2 % noise everywhere. The whole
package runs as on a record: it learns from the first 20 minutes and on, and errors are those of the true angle over
its size, at .5, 1 and 2 peak periods.

    OMP_NUM_THREADS=1 python benchmark/upstream.py --seeds 10
    OMP_NUM_THREADS=1 python benchmark/upstream.py --seeds 10 --faults
    OMP_NUM_THREADS=1 python benchmark/upstream.py --cost
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.interpolate import CubicSpline

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.evaluation.cli.benchmark import Benchmark
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import ArrivingSamples, UpstreamSeries, run_through, samples_of

PERIOD, DAMPING, NOISE = 5.0, 0.1, 0.02
STEP = 0.2
"""s, of craft and probe."""

LEARNT, SCORED = 1200.0, 1200.0
LEADS = tuple(share * PERIOD for share in (0.5, 1.0, 2.0))
SETTINGS = ForecasterSettings(leads=LEADS, horizon=2.0 * PERIOD, horizon_step=1.0, forecast_rate=1.0)

BEGIN, END = 1200.0, 1500.0
"""s, of a fault."""

SETTLED, RECOVERED = 60.0, 120.0
"""s after a fault's begin and after its end, from which it is scored."""

_WAVES, _TOGETHER = 2000, 250
_GRAVITY = 9.81
_PEAK = 2.0 * math.pi / PERIOD
_LENGTH = 2.0 * math.pi * _GRAVITY / _PEAK**2


@dataclass(frozen=True)
class Sea:
    """A craft and a probe in one sea, each (N,)."""

    time: np.ndarray
    roll: np.ndarray
    rate: np.ndarray
    probe: np.ndarray

    def trial(self, rng: np.random.Generator) -> Trial:
        """What the craft's sensor gives."""
        return Trial(self.time, roll=noisy(self.roll, NOISE, rng), roll_rate=noisy(self.rate, NOISE, rng))


def noisy(values: np.ndarray, share: float | np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Values with white noise, a share of their size."""
    return values + share * values.std() * rng.standard_normal(values.size)


def make_sea(
    seed: int,
    duration: float,
    spread: float | None = 10.0,
    distance: Callable[[np.ndarray], np.ndarray] = np.ones_like,
    heading: Callable[[np.ndarray], np.ndarray] = np.zeros_like,
) -> Sea:
    """A fresh sea; of the time, the distance in wavelengths, and the angle, rad, of the formation to the waves."""
    rng = np.random.default_rng(seed)
    frequency = np.sort(rng.uniform(0.4 * _PEAK, 5.0 * _PEAK, _WAVES))
    width = np.where(frequency < _PEAK, 0.07, 0.09)
    bump = np.exp(-0.5 * ((frequency / _PEAK - 1.0) / width) ** 2)
    density = frequency**-5.0 * np.exp(-1.25 * (_PEAK / frequency) ** 4) * 3.3**bump
    amplitude = np.sqrt(2.0 * density * np.gradient(frequency))
    phase = rng.uniform(0.0, 2.0 * math.pi, _WAVES)
    across = (
        np.zeros(_WAVES)
        if spread is None
        else np.clip(rng.normal(0.0, 1.0 / math.sqrt(2.0 * spread), _WAVES), -1.5, 1.5)
    )
    number = frequency**2 / _GRAVITY
    response = _PEAK**2 * 1j * number / (_PEAK**2 - frequency**2 + 2j * DAMPING * _PEAK * frequency)
    time = np.arange(round(duration / STEP)) * STEP
    away, turned = _LENGTH * distance(time), heading(time)
    roll, rate, probe = np.zeros((3, time.size))
    for k in range(0, _WAVES, _TOGETHER):
        part = slice(k, k + _TOGETHER)
        # the beam's share of the slope, and the distance along the wave, go with the angle to it
        along = np.cos(across[part] - turned[:, None])
        wave = np.exp(1j * (np.outer(time, frequency[part]) + phase[part])) * amplitude[part]
        roll += ((wave * along) @ response[part]).real
        rate += ((wave * along) @ (1j * frequency[part] * response[part])).real
        probe += (wave * np.exp(1j * number[part] * away[:, None] * along)).real.sum(axis=1)
    return Sea(time, roll, rate, probe)


def scored(sea: Sea, run, spans) -> tuple[np.ndarray, np.ndarray]:
    """Errors over the roll's size (S, L), and coverage of the 90 % intervals (S, L), of forecasts issued in spans."""
    truth = CubicSpline(sea.time, sea.roll)
    stamps = np.array([step.stamp for step in run.steps])
    errors = np.array([step.forecast.angle('roll') for step in run.steps]) - truth(stamps[:, None] + LEADS)
    held = np.abs(errors) <= np.array([step.forecast.half_width('roll')[:, 1] for step in run.steps])
    inside = [(stamps >= begin) & (stamps < end) for begin, end in spans]
    size = sea.roll.std()
    return (
        np.array([np.sqrt((errors[some] ** 2).mean(axis=0)) / size for some in inside]),
        np.array([held[some].mean(axis=0) for some in inside]),
    )


def forecasts(sea: Sea, series: UpstreamSeries | None, spans, seed: int):
    """`scored` of the package's forecasts with a probe, or without."""
    trial = sea.trial(np.random.default_rng(seed + 1000))
    return scored(sea, run_through(trial, SETTINGS, upstream={} if series is None else {'probe': series}), spans)


def compare(seeds: int):
    """The errors of each sea, with the probe and without."""
    columns = ' '.join(f'{lead / PERIOD:6.2f}' for lead in LEADS)
    yield f'{"peak periods ahead":44} {columns}  90 % intervals cover'
    span = [(LEARNT, LEARNT + SCORED - LEADS[-1])]
    for spread, away in ((10.0, 1.0), (None, 1.0), (10.0, 2.0), (None, 2.0)):
        results = []
        for seed in range(1, seeds + 1):
            sea = make_sea(seed, LEARNT + SCORED, spread, lambda t, away=away: np.full(t.size, away))
            probe = UpstreamSeries(sea.time, noisy(sea.probe, NOISE, np.random.default_rng(seed + 2000)))
            results.append([forecasts(sea, series, span, seed) for series in (None, probe)])
        of_all = np.array(results).mean(axis=0)[:, :, 0]
        crests = 'long-crested' if spread is None else f'spread, s = {spread:g}'
        for name, (error, coverage) in zip(('own motion', 'with the probe'), of_all, strict=True):
            row = f'{crests}, {away:g} wavelengths: {name}'
            yield ' '.join([f'{row:44}', *(f'{e:6.3f}' for e in error), ' ', *(f'{100 * c:.0f}' for c in coverage)])


def faults() -> dict:
    """Name to the sea's changes and to what becomes of the probe's samples."""

    def during(time):
        return (time >= BEGIN) & (time < END)

    def drifted(time):
        away = np.minimum(np.clip(time - BEGIN, 0.0, END - BEGIN), np.clip(2.0 * END - BEGIN - time, 0.0, None))
        return 1.0 + 0.5 * away / _LENGTH

    def as_is(time, probe, rng):
        return UpstreamSeries(time, probe)

    def lost(time, probe, rng):
        kept = rng.uniform(size=time.size) > 0.05
        return UpstreamSeries(time[kept], probe[kept])

    def late(time, probe, rng):
        return UpstreamSeries(time, np.where(during(time), np.interp(time - 2.0, time, probe), probe))

    def stuck(time, probe, rng):
        return UpstreamSeries(time, np.where(during(time), probe[round(BEGIN / STEP)], probe))

    def loud(time, probe, rng):
        return UpstreamSeries(time, noisy(probe, np.where(during(time), 0.2, 0.0), rng))

    def turned(time):
        return math.radians(45.0) * np.clip((time - BEGIN) / 30.0, 0.0, 1.0)

    return {
        '5 % lost': ({}, lost),
        '2 s late for 5 min': ({}, late),
        'stuck for 5 min': ({}, stuck),
        'noise of 20 % for 5 min': ({}, loud),
        'drift of .5 m/s, 5 min out and back': ({'distance': drifted}, as_is),
        'turn of 45 deg in 30 s': ({'heading': turned}, as_is),
    }


def fail(seeds: int):
    """Each fault's errors over those without the probe, and after it over those of a probe without faults."""
    columns = ' '.join(f'{lead / PERIOD:6.2f}' for lead in LEADS)
    yield f'{"over the forecast without the probe at peak periods":52} {columns} | 120 s after: {columns}'
    without_probe = {}
    for name, (changes, spoilt) in faults().items():
        end = 2.0 * END - BEGIN if 'distance' in changes else END
        spans = [(BEGIN + SETTLED, end), (end + RECOVERED, end + RECOVERED + 240.0)]
        squares = []
        for seed in range(1, seeds + 1):
            sea = make_sea(seed, spans[1][1] + LEADS[-1], **changes)
            rng = np.random.default_rng(seed + 2000)
            series = spoilt(sea.time, noisy(sea.probe, NOISE, rng), rng)
            same_sea = seed, *changes
            if same_sea not in without_probe:
                without_probe[same_sea] = forecasts(sea, None, spans, seed)[0]
            squares.append([without_probe[same_sea] ** 2, forecasts(sea, series, spans, seed)[0] ** 2])
        without, found = np.sqrt(np.mean(squares, axis=0))
        during, after = found / without
        parts = *(f'{r:6.2f}' for r in during), f'{"|":14}', *(f'{r:6.2f}' for r in after)
        yield ' '.join([f'{name:52}', *parts])


def costs():
    """What a sample of 100 Hz takes with a probe and without, and a refit."""
    sea = make_sea(1, 500.0)
    fine = np.arange(0.0, 480.0, 0.01)
    roll, rate, probe = (CubicSpline(sea.time, values)(fine) for values in (sea.roll, sea.rate, sea.probe))
    trial = Trial(fine, roll=roll, pitch=0.5 * roll, roll_rate=rate, pitch_rate=0.5 * rate, accel_z=9.81 + 0.1 * rate)
    for names in ((), ('probe',)):
        pipeline = ForecastPipeline(PipelineSettings(forecaster=ForecasterSettings(upstream=names)))
        beside = ArrivingSamples(
            {name: UpstreamSeries(fine[::10], probe[::10]) for name in names}, pipeline.add_upstream
        )
        spent, refits = [], []
        for sample in samples_of(trial):
            begun = time.process_time()
            beside.until(sample.stamp_ns)
            step = pipeline.add_sample(sample)
            spent.append(time.process_time() - begun)
            if step.sea_request is not None:
                begun = time.process_time()
                fit = fit_sea(step.sea_request)
                refits.append(time.process_time() - begun)
                pipeline.install(fit)
        settled = np.array(spent[len(spent) // 2 :])
        yield (
            f'{"with the probe" if names else "own motion":15} {1e6 * settled.mean():6.0f} us a sample (median '
            f'{1e6 * np.median(settled):.0f}), {1e3 * np.median(refits):.0f} ms a refit '
            f'(longest {1e3 * max(refits):.0f})'
        )


def lines(
    *,
    seeds: int = 10,
    faults: Annotated[bool, 'a probe that fails, lies or moves'] = False,
    cost: Annotated[bool, 'time of a sample and of a fit'] = False,
):
    """What was asked for."""
    return costs() if cost else fail(seeds) if faults else compare(seeds)


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
