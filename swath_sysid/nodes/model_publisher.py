"""Where the identified models go: model/description, model/coefficients and the model file."""
from pathlib import Path

from std_msgs.msg import Float64MultiArray, String

from swath_sysid.errors import InputError
from swath_sysid.files.model_file import model_to_yaml, read_model, write_model
from swath_sysid.nodes.connections import LATCHED, watched_publisher
from swath_sysid.nodes.health import NOT_SAVED
from swath_sysid.nodes.messages import coefficients_message


class ModelPublisher:
    """Publishes models and keeps their file.

    Parameters
    ----------
    node : rclpy.node.Node
    path : str
        Of the model file; empty: none.
    health : IdentifierHealth
    """

    def __init__(self, node, path, health):
        self._path = Path(path).expanduser() if path else None
        self._health = health
        self._description = watched_publisher(node, String, 'model/description', LATCHED, health)
        self._coefficients = watched_publisher(node, Float64MultiArray, 'model/coefficients', LATCHED, health)

    def known(self):
        """The models in the file, by axis; none where there is no file yet.

        Raises
        ------
        InputError
            The file is there and cannot be read.
        """
        return read_model(self._path) if self._path is not None and self._path.exists() else {}

    def publish(self, models):
        """Publish models by axis and save them.

        Returns
        -------
        str
            A remark where they could not be saved.
        """
        self._description.publish(String(data=model_to_yaml(models) if models else ''))
        self._coefficients.publish(coefficients_message(models))
        if self._path is None:
            return ''
        try:
            if models:
                write_model(self._path, models)
            else:
                self._path.unlink(missing_ok=True)
        except (InputError, OSError) as error:
            self._health.note(NOT_SAVED, 'model_path')
            return f'; not saved: {error}'
        self._health.settle('model_path')
        return ''
