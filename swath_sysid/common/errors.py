"""The one error that callers show to users instead of a traceback, and the exit codes of commands."""

from collections.abc import Collection
from pathlib import Path

DONE, PARTLY_DONE, NOTHING_DONE = range(3)  #: Exit codes; the second also of a result that is not what was promised.


class InputError(ValueError):
    """What was given cannot be used.

    The message is one sentence that names what was wrong and what to do. The command
    line prints it and exits with `NOTHING_DONE`; a node counts it and reports a diagnostic.

    Args:
        message: The sentence.
        code: Of the `Advice` that it is made of; '': of none.

    Example:
        >>> try:
        ...     hull_named('titanic')
        ... except InputError as error:
        ...     print(error)
        there is no hull 'titanic': choose from swath-pitch, swath-roll, hydrofoil-pitch, swath-usv-pitch
    """

    def __init__(self, message: str = '', code: str = '') -> None:
        super().__init__(message)
        self.code = code


def check_choice(name: str, choices: Collection[str], kind: str) -> None:
    """Reject a name that is not among the choices; ``kind``, such as ``'hull'``, says what is named."""
    if name not in choices:
        raise InputError(f"there is no {kind} '{name}': choose from {', '.join(choices)}")


def of_file(path: str | Path, sentence: str) -> str:
    """A sentence that begins with the name of the file it is of, and names it once."""
    name = Path(path).name
    short = sentence.replace(str(path), name)
    return short if short.startswith(name) else f'{name}: {short}'
