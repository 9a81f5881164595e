"""Processor time of the predictor on a 100 Hz sensor in a sea: a plain sample, one with forecasts, a refit.

Roll and pitch each swing as the hull of `benchmark/sea_forecasts.py` in a JONSWAP sea of their own. A plain sample is
one with ``forecast/next``; one with forecasts gives the leads and the horizon as well, ten times a second. The first
half only fills the filters and is not measured. Last come two points away from the sensor and a window of calm of both;
they are to cost half as much again at most. Run it with one thread for linear algebra, as the nodes' background
does:

    OMP_NUM_THREADS=1 python benchmark/prediction_cost.py
    OMP_NUM_THREADS=1 python benchmark/prediction_cost.py --seconds 1200
"""

import math
import time
from dataclasses import replace
from typing import Annotated

import numpy as np
from sea_forecasts import ANGLE_NOISE, FINE_RATE, HULL, RATE_NOISE, make_sea

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.intake import CraftSample
from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings
from swath_sysid.attitude.prediction.point import Point
from swath_sysid.attitude.prediction.quiescence import PointLimits, QuiescenceLimits
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.evaluation.cli.benchmark import Benchmark
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings

NOISE = (ANGLE_NOISE**2,) * 2 + (RATE_NOISE**2,) * 2
GRAVITY = 9.81
POINTS = Point('bow', (2.5, 0.0, 0.0)), Point('crane_tip', (-1.0, 1.5, 4.0))
QUIET = QuiescenceLimits(roll=math.radians(3.0), pitch=math.radians(3.0))
AT_NONE = ForecasterSettings(quiescence=QUIET)
AT_POINTS = ForecasterSettings(
    points=POINTS, quiescence=replace(QUIET, points=tuple(PointLimits(p.name, vertical_velocity=0.5) for p in POINTS))
)


def samples_at_sea(duration, seed=0):
    """Samples of a craft in irregular waves, at `FINE_RATE`, with the accelerations that its attitude alone gives."""
    roll, pitch = (make_sea(seed + place, duration).seen for place in range(len(AXES)))
    force = np.random.default_rng(seed).normal(0.0, 0.05, (roll.shape[0], 3)) + GRAVITY * np.column_stack(
        [-np.sin(pitch[:, 0]), np.sin(roll[:, 0]), np.ones(roll.shape[0])]
    )
    motion = np.column_stack([roll[:, 0], pitch[:, 0], roll[:, 1], pitch[:, 1], force])
    return [CraftSample(round(k / FINE_RATE * 1e9), *row, *NOISE) for k, row in enumerate(motion.tolist())]


def measure(samples, models, forecaster):
    """Processor seconds after the first half: of plain samples, of samples with forecasts, of refits."""
    pipeline, plain, issued, refits = ForecastPipeline(PipelineSettings(forecaster=forecaster)), [], [], []
    pipeline.set_models(models)
    for number, sample in enumerate(samples):
        is_measured = number >= len(samples) // 2
        begun = time.process_time()
        step = pipeline.add_sample(sample)
        spent = time.process_time() - begun
        if is_measured:
            (plain if step.forecast is None else issued).append(spent)
        if step.sea_request is not None:
            begun = time.process_time()
            pipeline.install(fit_sea(step.sea_request))
            if is_measured:
                refits.append(time.process_time() - begun)
    return plain, issued, refits


def lines(*, seconds: Annotated[float, 'of simulated sea'] = 480.0):
    """The table."""
    samples = samples_at_sea(seconds)
    identified = {axis: IdentifiedModel.exactly(HULL) for axis in AXES}
    measure(samples[: 30 * FINE_RATE], identified, AT_NONE)
    yield 'medians, us            with next  and leads        all: median       mean  refit: median, ms  at most, ms'
    cost = {}
    for name, models, settings in (
        ('no hull', {}, AT_NONE),
        ('both hulls', identified, AT_NONE),
        ('no hull, two points', {}, AT_POINTS),
        ('both, two points', identified, AT_POINTS),
    ):
        plain, issued, refits = measure(samples, models, settings)
        both = plain + issued
        cost[name] = np.mean(both)
        yield (
            f'{name:20s} {1e6 * np.median(plain):12.0f} {1e6 * np.median(issued):10.0f} {1e6 * np.median(both):18.0f} '
            f'{1e6 * np.mean(both):10.0f} {1e3 * np.median(refits or math.nan):18.0f} '
            f'{1e3 * max(refits, default=math.nan):12.0f}'
        )
    no_points, points = list(cost.values())[:2], list(cost.values())[2:]
    yield 'two points over none: ' + ', '.join(f'{b / a:.2f}' for a, b in zip(no_points, points, strict=True))


if __name__ == '__main__':
    raise SystemExit(Benchmark(__doc__, lines).run())
