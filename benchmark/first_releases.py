"""Forecasts of the first free decay of a craft, of which nothing is known: after a push, or held and let go.

    OMP_NUM_THREADS=1 python benchmark/first_releases.py
    OMP_NUM_THREADS=1 python benchmark/first_releases.py --rates 100 --periods 1.2 2.4 --seeds 3
    OMP_NUM_THREADS=1 python benchmark/first_releases.py --rest 40

Craft of some natural periods rest for some seconds, and are pushed, or leaned over and held for three; each has several
seeds of noise, damping and amplitude. For each span of seconds after letting go, and lead: how often the 90 % interval
held the true roll, the standard deviation issued over the root mean square error, and the most issued over the
amplitude of then.
"""

from itertools import product
from typing import Annotated

import numpy as np
from shortest_leads import ANGLE_NOISE, RATE_NOISE, TOLD

from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.evaluation.cli.benchmark import Benchmark, LeadErrors, Line
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import followed

PERIODS = 1.0, 1.4, 2.0, 2.8, 3.5, 4.5, 6.0, 8.0  #: s.
SECONDS = (0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 5.0), (5.0, 8.0), (8.0, 12.0)
LEAD, PERIODS_AHEAD = 0.1, (0.25, 0.5, 1.0, 2.0)
LEAN, HELD, PUSH = 1.5, 3.0, 0.5  #: s.


class Release:
    """Roll and its rate of a linear craft at any time; ``begin``, s, is when nothing acts any more."""

    def __init__(self, period: float, kind: str, seed: int, rest: float) -> None:
        rng = np.random.default_rng([seed, round(1000 * period)])
        self.amplitude, ratio = np.radians(rng.uniform(4.0, 10.0)), rng.uniform(0.03, 0.12)
        self._natural = 2.0 * np.pi / period
        self._decay = self._natural * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
        self._is_push, self._rest = kind == 'push', rest
        self.begin = rest + (PUSH if self._is_push else LEAN + HELD)
        angle, rate = self._driven(np.array([self.begin - 1e-9]))
        self._free = angle[0] - 1j * (rate[0] - self._decay.real * angle[0]) / self._decay.imag

    def _driven(self, times):
        since = np.clip(times - self._rest, 0.0, None)
        if self._is_push:
            # a hand that pushes harder and harder
            part = since / PUSH
            peak = self.amplitude * min(self._natural * PUSH, 1.0)
            return 0.5 * peak * part**2, peak * part / PUSH
        part = np.clip(since / LEAN, 0.0, 1.0)
        angle = 0.5 * self.amplitude * (1.0 - np.cos(np.pi * part))
        return angle, np.where(part < 1.0, 0.5 * np.pi / LEAN * self.amplitude * np.sin(np.pi * part), 0.0)

    def motion(self, times):
        """Roll and its rate at times (N,), s."""
        free = self._free * np.exp(self._decay * (np.maximum(times, self.begin) - self.begin))
        driven, is_free = self._driven(times), times >= self.begin
        return np.where(is_free, free.real, driven[0]), np.where(is_free, (self._decay * free).real, driven[1])

    def reach(self, time):
        """Amplitude at a time after the release."""
        return abs(self._free) * np.exp(self._decay.real * (time - self.begin))


def samples(release: Release, rate: float, seed: int):
    """The sensor's samples of a release, one by one."""
    rng = np.random.default_rng(seed)
    told = {f'{axis}{name}': std**2 for axis in AXES for name, std in TOLD.items()}
    unknown = dict.fromkeys(CraftSample._fields, np.nan)
    for time in np.arange(0.0, release.begin + SECONDS[-1][1], 1.0 / rate).tolist():
        angle, angular_rate = (value.item() for value in release.motion(np.array([time])))
        noise = rng.normal(size=4) * [ANGLE_NOISE, RATE_NOISE, ANGLE_NOISE, RATE_NOISE]
        values = {'roll': angle, 'roll_rate': angular_rate, 'pitch': 0.0, 'pitch_rate': 0.0}
        values = {name: value + each for (name, value), each in zip(values.items(), noise.tolist(), strict=True)}
        yield CraftSample(**{**unknown, **told, **values, 'stamp_ns': round(time * 1e9)})


def forecasts(release: Release, period: float, rate: float, seed: int):
    """Seconds since letting go (N,), and errors and deviations (N, L) over the amplitude of then."""
    leads = np.array(sorted({LEAD, *(round(period * ahead, 3) for ahead in PERIODS_AHEAD)}))
    settings = ForecasterSettings(tuple(leads), horizon=leads[-1], horizon_step=leads[-1])
    pipeline, found = ForecastPipeline(PipelineSettings(forecaster=settings)), []
    for k, step in enumerate(followed(pipeline, samples(release, rate, seed))):
        time = k * (1.0 / rate)
        if step.forecast is not None and time >= release.begin:
            error = step.forecast.angle('roll') - release.motion(time + leads)[0]
            reach = release.reach(time)
            found.append((time - release.begin, error / reach, step.forecast.deviation[:, 0] / reach))
    return [np.array(parts) for parts in zip(*found, strict=True)]


def lines(
    *,
    rates: Annotated[float, 'Hz'] = (25.0,),
    periods: Annotated[float, 's'] = PERIODS,
    seeds: int = 3,
    rest: Annotated[float, 's'] = 5.0,
):
    """A line for each rate, kind of release and span of seconds."""
    yield f'leads {LEAD} s and {PERIODS_AHEAD} periods | held | stated over error | most over the amplitude'
    for rate, kind in product(rates, ('push', 'hold')):
        runs = [
            forecasts(Release(period, kind, seed, rest), period, rate, seed)
            for period in periods
            for seed in range(seeds)
        ]
        of_all = LeadErrors.joined(runs)
        for begin, end in SECONDS:
            now = of_all.within(begin, end)
            figures = {
                'held': now.held,
                'stated': now.deviation.mean(axis=0) / now.rms,
                'most': now.deviation.max(axis=0),
            }
            yield Line(f'{rate:3.0f} Hz {kind} {begin:2.0f} to {end:2.0f} s', figures, '6.2f')


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
