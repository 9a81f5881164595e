"""Where the identified models go: model/description, model/coefficients and the model file."""

from pathlib import Path

from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, String

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.formats.messages import coefficients_message
from swath_sysid.formats.model_file import model_to_yaml, read_model, write_model
from swath_sysid.formats.topics import COEFFICIENTS_TOPIC, DESCRIPTION_TOPIC
from swath_sysid.nodes.kept_model import ModelFile
from swath_sysid.nodes.qos import LATCHED, watched_publisher
from swath_sysid.pipeline.health import IdentifierHealth


class ModelPublisher:
    """Publishes models and keeps their file."""

    def __init__(self, node: Node, path: str | Path, health: IdentifierHealth):
        self._file = ModelFile(path, read_model, model_to_yaml, write_model, health)
        self._description = watched_publisher(node, String, DESCRIPTION_TOPIC, LATCHED, health)
        self._coefficients = watched_publisher(node, Float64MultiArray, COEFFICIENTS_TOPIC, LATCHED, health)

    def known(self) -> dict[str, IdentifiedModel]:
        """The models in the file, by axis; empty if the file does not exist or cannot be used."""
        return self._file.read() or {}

    def history(self) -> list[dict[str, IdentifiedModel]]:
        """Those that the file held before, oldest first; see `ModelFile.history`."""
        return self._file.history()

    def replace(self, models: dict[str, IdentifiedModel]) -> str:
        """Publish models by axis and save them; the remark of `ModelFile.keep`."""
        self.publish(models)
        return self._file.keep(models)

    def publish(self, models: dict[str, IdentifiedModel]) -> None:
        """Publish models by axis."""
        self._description.publish(String(data=model_to_yaml(models) if models else ''))
        self._coefficients.publish(coefficients_message(models))
