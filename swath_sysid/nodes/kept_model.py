"""The file that a node keeps its model in: read at the start, replaced whenever the model changes."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import keep_copy, kept_files, set_aside
from swath_sysid.pipeline.health import IdentifierHealth

PARAMETER = 'model_path'  #: The parameter of both identifiers that names the file.


class ModelFile:
    """A model on the disk, previous ones in numbered files; one that cannot be read is never touched."""

    def __init__(
        self, path: str | Path, read: Callable, text_of: Callable[[Any], str], write: Callable, health: IdentifierHealth
    ):
        # not Path.expanduser, which raises an error for a user that does not exist
        self._path = Path(os.path.expanduser(path)) if path else None
        self._read, self._text_of, self._write, self._health = read, text_of, write, health
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
            self._health.note('bad-model-file', PARAMETER, self._refusal)
            return None

    def history(self) -> list:
        """The models that `rollback` can return to, oldest first; a repeated one was itself a return."""
        if self._path is None or self._refusal:
            return []
        stack: list[tuple[str, Any]] = []
        for model in [*self._kept(), self.read()]:
            text = self._text_of(model) if model else ''
            if len(stack) > 1 and stack[-2][0] == text:
                stack.pop()
            elif not stack or stack[-1][0] != text:
                stack.append((text, model))
        return [model for _, model in stack[:-1]]

    def _kept(self) -> list:
        models = []
        for path in reversed(kept_files(self._path) if self._path is not None else []):
            try:
                models.append(self._read(path))
            except InputError:
                # left where it is
                continue
        return models

    def keep(self, model: Any) -> str:
        """Replace what is in the file, and remark where the previous one is, or what failed."""
        if self._path is None:
            return ''
        if self._refusal:
            self._health.note('model-not-saved')
            return f'; not saved: it would replace a file that could not be read, {self._path}'
        try:
            before = self._replace(self._path, model)
        except (InputError, OSError) as error:
            self._health.note('model-not-saved', PARAMETER)
            return f'; not saved: {error}'
        self._health.settle(PARAMETER)
        return '' if before is None else f'; the previous model file is kept as {before}'

    def _replace(self, path: Path, model: Any) -> Path | None:
        """Where the previous file is now; None where there was none."""
        is_there = os.path.exists(path)
        if not model:
            return set_aside(path) if is_there else None
        before = keep_copy(path) if is_there else None
        self._write(path, model)
        return before
