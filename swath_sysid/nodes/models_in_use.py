"""The models that the predictor forecasts with: as they come on model/description, at the present loading."""

from time import perf_counter

from rclpy.node import Node
from std_msgs.msg import Float64, String

from swath_sysid.attitude.hull.identified_model import check_mounting, models_at
from swath_sysid.common.errors import InputError
from swath_sysid.formats.model_file import description_from_yaml
from swath_sysid.formats.topics import DESCRIPTION_TOPIC
from swath_sysid.nodes.diagnostics import EachOnce
from swath_sysid.nodes.model_intake import ModelIntake
from swath_sysid.nodes.parameters.declared import NodeParameters
from swath_sysid.nodes.qos import LATCHED, NEWEST, watched_subscription
from swath_sysid.nodes.transforms import Transforms
from swath_sysid.pipeline.forecast_health import PredictorHealth
from swath_sysid.pipeline.forecast_pipeline import ForecastPipeline


class ModelsInUse:
    """Reads descriptions and loadings, and hands the models on to a pipeline; its filters keep their state."""

    def __init__(
        self,
        node: Node,
        parameters: NodeParameters,
        pipeline: ForecastPipeline,
        health: PredictorHealth,
        transforms: Transforms,
    ) -> None:
        log = node.get_logger()
        # rclpy allows a line of code one severity
        self._log_error = EachOnce(lambda sentence: log.error(sentence))
        self._log_warning = EachOnce(lambda sentence: log.warning(sentence))
        self._log_info = log.info
        self._parameters, self._pipeline, self._health, self._transforms = parameters, pipeline, health, transforms
        self._described: tuple[dict, dict] = {}, {}
        self._published_loading: float | None = None
        self.intake = ModelIntake(self.read, self._refuse)
        watched_subscription(
            node, String, DESCRIPTION_TOPIC, lambda message: self.intake.submit(message.data), LATCHED, health
        )
        watched_subscription(node, Float64, 'craft/loading', self.take_loading, NEWEST, health)

    def read(self, text: str) -> tuple[dict, dict]:
        """Models and schedules of a text, of which an empty one takes the models away."""
        models, schedules = description_from_yaml(text, DESCRIPTION_TOPIC) if text else ({}, {})
        self._check_mounting(models)
        return models, schedules

    def use_new(self) -> bool:
        """Use what came on model/description, once it is read; whether something came."""
        before = self._described
        for description in self.intake.finished():
            self._described = description
            self.load()
            self._health.note_model(perf_counter())
            known = [f'{axis} {held.model.equation.name}' for axis, held in description[0].items()]
            self._log_info(f'new model: {", ".join(known) or "none"}')
        return self._described is not before

    def take_loading(self, message: Float64) -> None:
        """The callback of craft/loading."""
        before, self._published_loading = self._published_loading, message.data
        try:
            self.load()
        except InputError as error:
            self._published_loading = before
            self._health.note('bad-loading', 'loading')
            self._log_error(f'{error}; the previous loading stays')

    def load(self) -> None:
        """Hand on the models at the present loading, unless the sensor is mounted otherwise than theirs."""
        try:
            self._check_mounting(self._described[0])
        except InputError as error:
            self._described = {}, {}
            self._health.note_refused_model(str(error))
            self._log_error(f'{error}; until then it is forecast without a model')
        models, advice = models_at(*self._described, self._parameters['loading'] or self._published_loading)
        self._pipeline.set_models(models)
        self._health.settle('loading')
        for item in advice:
            self._health.note('loading-advice', 'loading')
            self._log_warning(item.message)

    def _check_mounting(self, models: dict) -> None:
        if not self._transforms.are_awaited:
            check_mounting(models, self._pipeline.settings.installation)

    def _refuse(self, sentence: str) -> None:
        self._health.note_refused_model(sentence)
        self._log_error(f'{sentence}; the previous model stays')
