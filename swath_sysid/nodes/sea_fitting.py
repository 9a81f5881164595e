"""The sea learnt in a process of its own, and handed back to the pipeline between two samples."""

from queue import Empty, SimpleQueue
from typing import Any

from swath_sysid.attitude.prediction.sea_fit import fit_sea, warm_up
from swath_sysid.formats.messages import SECOND_NS
from swath_sysid.nodes.worker import Worker
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline


class SeaFitting:
    """Takes the requests of a pipeline's steps to a worker, and its fits to the pipeline."""

    def __init__(self, pipeline: ForecastPipeline, health: PredictorHealth, logger: Any, waits: bool = False):
        self._pipeline = pipeline
        self._health = health
        self._logger = logger
        self._waits = waits
        # a fit ends in the worker's thread: a queue hands it over to that of the samples
        self._ended: SimpleQueue[tuple[Any, Exception | None]] = SimpleQueue()
        self.is_fitting = False  #: Whether `hands_over` is to be called before each sample.
        self._due_ns = self._newest_ns = 0
        self._is_of_before = False  #: Whether the fit under way is of a past that the pipeline no longer has.
        self.worker = Worker(warm_up, lambda: health.note('wave-worker-died'))

    def close(self) -> None:
        """End the worker."""
        self.worker.close()

    def drop(self) -> None:
        """Use no fit that is under way."""
        self._is_of_before = self.is_fitting

    def submit(self, request: Any, stamp_ns: int) -> None:
        """Fit the past that a step at this stamp asked for, unless a fit is still under way."""
        if self.is_fitting:
            self._health.note('late-fit')
            return
        self.is_fitting, self._newest_ns = True, stamp_ns
        self._due_ns = stamp_ns + round(self._pipeline.settings.forecaster.refit_delay * SECOND_NS)
        self.worker.submit(fit_sea, (request,), lambda *ending: self._ended.put(ending))

    def hands_over(self, stamp_ns: int, patience: float) -> bool:
        """Install the fits that have ended by the sample of this stamp; False if one is still awaited after s."""
        while self.is_fitting and (not self._ended.empty() or (self._waits and stamp_ns >= self._due_ns)):
            try:
                fit, error = self._ended.get(timeout=patience)
            except Empty:
                return False
            self.is_fitting = False
            if self._is_of_before:
                self._is_of_before = False
                continue
            if error is not None:
                self._health.note('waves-not-fitted', 'waves')
                self._logger.error(f'the waves were not fitted: {error}')
                continue
            if self._newest_ns >= self._due_ns:
                self._health.note('late-fit')
            self._health.settle('waves')
            self._pipeline.install(fit)
        self._newest_ns = stamp_ns
        return True
