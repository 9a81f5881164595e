"""Coverage of the shortest leads: does the 90 % interval hold the true motion, which a simulated sea knows?

    OMP_NUM_THREADS=1 python benchmark/shortest_leads.py
    OMP_NUM_THREADS=1 python benchmark/shortest_leads.py --rates 100 --noise 2 --seconds 120

A craft rolls and pitches in a sea of many components; its sensor tells its noise, which is as told, half or twice; its
clock drifts by 200 ppm. For each lead: root mean square error of the true angle over the standard deviation of the
noise, how often the 90 % interval held it, and the standard deviation issued, in the same unit.
"""

from itertools import product
from typing import Annotated

import numpy as np

from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.evaluation.cli.benchmark import Benchmark
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings
from swath_sysid.pipeline.record_run import followed

LEADS = 0.02, 0.05, 0.1, 0.2, 0.5
ANGLE_NOISE, RATE_NOISE = 3e-4, 2e-3  #: rad and rad/s; as told.
TOLD = {'_variance': ANGLE_NOISE, '_rate_variance': RATE_NOISE}
DRIFT = 2e-4
PERIOD, SIZE = 3.0, 0.05  #: s and rad; of the roll.


class Sea:
    """Angles and rates of a sum of waves about each axis."""

    def __init__(self, seed: int, period: float = PERIOD) -> None:
        rng = np.random.default_rng(seed)
        self._waves = {}
        for axis, peak in zip(AXES, (period, 0.8 * period), strict=True):
            ratio = np.linspace(0.6, 2.0, 150) + rng.uniform(0.0, 0.009, 150)
            spectrum = ratio**-5.0 * np.exp(-1.25 * ratio**-4.0) / ((1.0 - ratio**2) ** 2 + 0.06 * ratio**2)
            height = np.sqrt(spectrum * rng.exponential(size=150))
            height *= SIZE / np.sqrt(0.5 * np.sum(height**2))
            self._waves[axis] = ratio * 2.0 * np.pi / peak, height, rng.uniform(0.0, 2.0 * np.pi, 150)

    def motion(self, axis: str, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angle and rate at times (N,), s."""
        frequency, height, phase = self._waves[axis]
        angle = np.outer(times, frequency) + phase
        return np.cos(angle) @ height, -np.sin(angle) @ (height * frequency)


def samples(sea: Sea, rate: float, seconds: float, noise: float, seed: int):
    """The sensor's samples, one by one."""
    rng, times = np.random.default_rng(seed), np.arange(0.0, seconds, 1.0 / rate)
    measured = {}
    for axis in AXES:
        angle, angular_rate = sea.motion(axis, times)
        measured[axis] = angle + noise * ANGLE_NOISE * rng.normal(size=times.size)
        measured[axis + '_rate'] = angular_rate + noise * RATE_NOISE * rng.normal(size=times.size)
    told = {f'{axis}{kind}': std**2 for axis in AXES for kind, std in TOLD.items()}
    unknown = dict.fromkeys(CraftSample._fields, np.nan)
    for k, time in enumerate((1.0 + DRIFT) * times):
        values = {name: value.item(k) for name, value in measured.items()}
        yield CraftSample(**{**unknown, **told, **values, 'stamp_ns': round(time * 1e9)})


def scores(rate: float, noise: float, seconds: float, seed: int):
    """Errors (2, N, L) of the true angles, in standard deviations of the noise, and those issued likewise."""
    sea, leads = Sea(seed), [lead for lead in LEADS if lead * rate > 0.9]
    settings = ForecasterSettings(tuple(leads), horizon=1.0, horizon_step=0.5)
    pipeline, errors, deviations = ForecastPipeline(PipelineSettings(forecaster=settings)), [], []
    for step in followed(pipeline, samples(sea, rate, 60.0 + seconds, noise, seed + 100)):
        if step.forecast is None or step.sample.stamp_ns < 60e9:
            continue
        # the time that the sensor's clock calls so many seconds ahead
        at = (step.sample.stamp_ns * 1e-9 + step.forecast.leads) / (1.0 + DRIFT)
        errors.append([step.forecast.angle(axis) - sea.motion(axis, at)[0] for axis in AXES])
        deviations.append(step.forecast.deviation[:, : len(AXES)].T)
    return leads, np.array(errors) / ANGLE_NOISE, np.array(deviations) / ANGLE_NOISE


def lines(
    *,
    rates: Annotated[float, 'Hz'] = (25.0, 50.0, 100.0, 200.0),
    noise: Annotated[float, 'over the noise told'] = (0.5, 1.0, 2.0),
    seconds: Annotated[float, 'scored after the first 60'] = 60.0,
    seed: int = 1,
):
    """A line for each rate, noise and lead."""
    yield 'rate noise | lead s: error, held, stated (roll) (pitch)'
    for rate, share in product(rates, noise):
        leads, errors, deviations = scores(rate, share, seconds, seed)
        held = np.abs(errors) < 1.6449 * deviations
        line = f'{rate:4.0f} {share:4.1f}'
        for k, lead in enumerate(leads):
            line += f' | {lead:g}:'
            for axis in range(len(AXES)):
                rms = np.sqrt(np.mean(errors[:, axis, k] ** 2))
                line += f' {rms:5.2f} {held[:, axis, k].mean():.2f} {deviations[:, axis, k].mean():5.2f}'
        yield line


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
