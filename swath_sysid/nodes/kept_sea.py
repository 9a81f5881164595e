"""The file that the predictor keeps what it learns of the sea in: read at the start, written at the end and asked."""

import os
from pathlib import Path

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_srvs.srv import Trigger

from swath_sysid.common.errors import InputError
from swath_sysid.formats.sea_memory_file import read_sea_memory, write_sea_memory
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline

PARAMETER = 'sea_memory'  #: That names the file.
KEPT_EVERY_S = 600.0


class KeptSea:
    """What a pipeline knows of the sea, on the disk; a file that cannot be read is never touched."""

    def __init__(self, node: Node, path: str, pipeline: ForecastPipeline, health: PredictorHealth) -> None:
        self._path = Path(os.path.expanduser(path)) if path else None
        self._pipeline, self._health, self._is_refused = pipeline, health, False
        if self._path is not None and os.path.exists(self._path):
            try:
                pipeline.remember(read_sea_memory(self._path))
            except InputError as error:
                self._is_refused = True
                health.note('bad-sea-memory', PARAMETER, str(error))
        self._kept = pipeline.memory
        node.create_service(Trigger, '~/save_memory', self._on_save)
        if self._path is not None:
            node.create_timer(KEPT_EVERY_S, self.keep, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def keep(self) -> str:
        """Write what is new; why that was not done, else nothing."""
        if self._path is None:
            return f'no file is named by {PARAMETER}'
        if self._is_refused:
            return f'it would replace a file that could not be read, {self._path}'
        if self._pipeline.memory is None:
            return 'too little of the sea has been learnt yet'
        if self._pipeline.memory is not self._kept:
            try:
                write_sea_memory(self._pipeline.memory, self._path)
            except InputError as error:
                self._health.note('sea-not-saved', PARAMETER)
                return str(error)
            self._kept = self._pipeline.memory
            self._health.settle(PARAMETER)
        return ''

    def _on_save(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        why_not = self.keep()
        response.success, response.message = not why_not, f'not saved: {why_not}' if why_not else f'in {self._path}'
        return response
