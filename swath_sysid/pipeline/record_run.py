"""The forecast pipeline run causally through a record, with sea fits used by stamp."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from heapq import merge
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.motion.intake import CraftSample, ImuReading
from swath_sysid.attitude.motion.trial import CHANNELS, FURTHER_CHANNELS, Trial
from swath_sysid.attitude.prediction.forecast import Forecast
from swath_sysid.attitude.prediction.forecaster import ForecasterSettings, ForecastStep
from swath_sysid.attitude.prediction.outlook import Outlook
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits, Reliability
from swath_sysid.attitude.prediction.sea_fit import fit_sea
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline, PipelineSettings


class Issued(NamedTuple):
    """One forecast that was issued."""

    stamp: float  #: s, in the record's own time.
    forecast: Forecast  #: At the leads.
    horizon: Forecast  #: Over the horizon.
    outlook: Outlook  #: Of the horizon.


@dataclass(frozen=True)
class Run:
    """A predictor run through a record."""

    steps: tuple[Issued, ...]
    step_times: tuple[float, ...] = ()  #: Of each sample, s; NaN where not measured.
    refit_times: tuple[float, ...] = ()  #: Of each fit of the sea, s; NaN where not measured.
    reliability: Reliability | None = None  #: Of the quiescence that was forecast.
    quiescence_limits: QuiescenceLimits | None = None


def samples_of(trial: Trial) -> Iterator[CraftSample]:
    """The trial as its sensor would have sent it, sample by sample.

    Args:
        trial: The channels that it lacks become NaN.

    Yields:
        What `ForecastPipeline.add_sample` takes.

    Example:
        >>> first = next(samples_of(read_trial(records / 'morro_buoy.csv')))
        >>> first.stamp, round(first.roll, 4)
        (0.0, 0.0639)
    """
    measured, absent = trial.channels, np.full(trial.time.size, math.nan)
    columns = [measured.get(name, absent) for name in (*CHANNELS, *FURTHER_CHANNELS)]
    unknown = (math.nan,) * 4
    for stamp_ns, *values in zip(
        np.round(trial.time * 1e9).astype(np.int64).tolist(), *(values.tolist() for values in columns), strict=True
    ):
        motion, further = values[: len(CHANNELS)], values[len(CHANNELS) :]
        yield CraftSample._make((stamp_ns, *motion, *unknown, math.nan, *further, math.nan, math.nan))


class UpstreamSeries(NamedTuple):
    """One upstream channel beside a record."""

    stamps: np.ndarray  #: (N,); s, in the record's time.
    values: np.ndarray  #: (N,); in any unit.
    arrivals: np.ndarray | None = None  #: (N,); s, increasing; by default the stamps.


class ArrivingSamples:
    """Hands the samples of upstream channels, by name, to a pipeline's ``add_upstream`` as they arrive."""

    def __init__(
        self, series: Mapping[str, UpstreamSeries], add: Callable[[str, int, float], None], start_ns: int = 0
    ) -> None:
        self._add = add
        self._samples = merge(*(self._of(name, each, start_ns) for name, each in series.items()))
        self._next = next(self._samples, None)

    @staticmethod
    def _of(name: str, series: UpstreamSeries, start_ns: int) -> Iterator[tuple[int, str, int, float]]:
        arrivals = series.stamps if series.arrivals is None else series.arrivals
        times = (start_ns + np.round(t * 1e9).astype(np.int64) for t in (arrivals, series.stamps))
        for arrival, stamp, value in zip(*(t.tolist() for t in times), series.values.tolist(), strict=True):
            yield arrival, name, stamp, value

    def until(self, stamp_ns: int) -> None:
        """Hand over what has arrived up to a stamp."""
        while self._next is not None and self._next[0] <= stamp_ns:
            self._add(*self._next[1:])
            self._next = next(self._samples, None)


def followed(pipeline: ForecastPipeline, samples: Iterable[CraftSample | ImuReading]) -> Iterator[ForecastStep]:
    """Every sample's step; what is to be learnt of the sea is learnt at once."""
    for sample in samples:
        step = pipeline.add_sample(sample) if isinstance(sample, CraftSample) else pipeline.add(sample)
        if step.sea_request is not None:
            pipeline.install(fit_sea(step.sea_request))
        yield step


def run_through(
    trial: Trial,
    settings: ForecasterSettings | None = None,
    models: Mapping[str, IdentifiedModel] | None = None,
    *,
    clock: Callable[[], float] | None = None,
    progress: Callable[[float], None] | None = None,
    limits_from: tuple[float, QuiescenceLimits] | None = None,
    points_ahead: bool = True,
    upstream: Mapping[str, UpstreamSeries] | None = None,
) -> Run:
    """Run the forecast pipeline through a record, causally.

    Every fit of the sea is used from its request's stamp plus the refit delay on, as on board.

    Args:
        trial: The whole record.
        settings: By default those of `PipelineSettings`.
        models: Identified hulls by axis; an axis without one is forecast without a hull.
        clock: Gives seconds, to measure what samples and fits cost; by default nothing is measured.
        progress: Called with 0 to 1.
        limits_from: Limits of quiescence from a stamp on; their reliability is recorded from there.
        points_ahead: Keep vertical motion over the horizon, which takes 20 kB a point and forecast.
        upstream: Channels beside the trial that show waves on their way to the craft, by name.

    Returns:
        Every forecast that was issued, for `score`.

    Example:
        >>> trial = read_trial(records / 'morro_buoy.csv').between(0.0, 20.0)
        >>> run = run_through(trial, ForecasterSettings(forecast_rate=1.0))
        >>> run.steps[-1].forecast.angle('pitch').shape
        (6,)
    """
    now = clock or (lambda: math.nan)
    upstream = upstream or {}
    settings = replace(settings or ForecasterSettings(), upstream=tuple(upstream))
    pipeline = ForecastPipeline(PipelineSettings(forecaster=settings))
    beside = ArrivingSamples(upstream, pipeline.add_upstream)
    pipeline.set_models(models or {})
    pending, limits = limits_from, pipeline.settings.forecaster.quiescence if limits_from is None else limits_from[1]
    steps, step_times, refit_times = [], [], []
    every = max(1, trial.time.size // 200)
    for index, (stamp, sample) in enumerate(zip(trial.time.tolist(), samples_of(trial), strict=True)):
        if pending is not None and stamp >= pending[0]:
            pipeline.forecaster.set_quiescence(pending[1])
            pending = None
        begun = now()
        beside.until(sample.stamp_ns)
        step = pipeline.add_sample(sample)
        step_times.append(now() - begun)
        if step.forecast is not None and step.horizon is not None and step.outlook is not None:
            horizon = step.horizon if points_ahead else replace(step.horizon, points={})
            steps.append(Issued(stamp, step.forecast, horizon, step.outlook))
        if step.sea_request is not None:
            begun = now()
            pipeline.install(fit_sea(step.sea_request))
            refit_times.append(now() - begun)
        if progress is not None and index % every == 0:
            progress(index / trial.time.size)
    reliability = pipeline.forecaster.quiescence_reliability()
    return Run(tuple(steps), tuple(step_times), tuple(refit_times), reliability, limits)
