"""What long work reports, and how its caller ends it."""

from collections.abc import Callable

Progress = Callable[[float], None]  #: Is called with the share done, 0 to 1.
ShouldCancel = Callable[[], bool]  #: Is asked often whether to raise `Cancelled`.


class Cancelled(Exception):  # noqa: N818 - an outcome, not an error
    """The caller asked to stop."""


def stop_if(should_cancel: ShouldCancel | None) -> None:
    """Raise `Cancelled` where the caller asks to stop."""
    if should_cancel is not None and should_cancel():
        raise Cancelled
