"""The file that a node keeps its model in: read at the start, replaced whenever the model changes."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from swath_sysid.common.errors import InputError
from swath_sysid.pipeline.health import BAD_MODEL_FILE, NOT_SAVED, IdentifierHealth

PARAMETER = 'model_path'  #: The parameter of both identifiers that names the file.


class ModelFile:
    """A model on the disk; one that cannot be read is left alone, whatever comes later.

    Args:
        path: Empty: none.
        read: Of a path; the model, or `InputError`.
        write: Of a path and a model.
    """

    def __init__(self, path: str | Path, read: Callable, write: Callable, health: IdentifierHealth):
        # not Path.expanduser, which raises an error for a user that does not exist
        self._path = Path(os.path.expanduser(path)) if path else None
        self._read, self._write, self._health = read, write, health
        self._refusal = ''

    def read(self) -> Any:
        """The model in the file; None where there is none, or one that cannot be used."""
        # nor Path.exists, which raises one for a name that is too long
        if self._path is None or not os.path.exists(self._path):
            return None
        try:
            return self._read(self._path)
        except InputError as error:
            self._refusal = str(error)
            self._health.note(BAD_MODEL_FILE, PARAMETER, self._refusal)
            return None

    def keep(self, model: Any) -> str:
        """Replace what is in the file; an empty model takes it away.

        Returns:
            A remark where that was not possible.
        """
        if self._path is None:
            return ''
        if self._refusal:
            self._health.note(NOT_SAVED)
            return f'; not saved: it would replace a file that could not be read, {self._path}'
        try:
            if model:
                self._write(self._path, model)
            else:
                self._path.unlink(missing_ok=True)
        except (InputError, OSError) as error:
            self._health.note(NOT_SAVED, PARAMETER)
            return f'; not saved: {error}'
        self._health.settle(PARAMETER)
        return ''
