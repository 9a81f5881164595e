"""What verbs show: progress (a bar on a terminal, else lines) and warnings on standard error, results as asked for."""

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from swath_sysid.common.advice import Advice, with_flags
from swath_sysid.common.plain import finite_or_none

PLAIN_STEP = 0.25
IS_QUIET = ContextVar('is_quiet', default=False)  #: Whether the conclusion alone is shown.


@contextmanager
def progress_of(title: str) -> Iterator[Callable[..., None]]:
    """A function that takes the share done, 0 to 1, and optionally what is being done."""
    if IS_QUIET.get():
        yield lambda share, what='': None
        return
    if sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

        columns = (
            TextColumn('{task.description}', markup=False),
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(title, total=1.0)
            yield lambda share, what='': bar.update(task, completed=share, description=f'{title} {what}'.strip())
        return
    yield _plain(title)


def _plain(title: str):
    shown = -PLAIN_STEP

    def show(share: float, what: str = '') -> None:
        nonlocal shown
        if share >= shown + PLAIN_STEP or (share >= 1.0 > shown):
            shown = share
            print(f'{title}: {share:.0%} {what}'.rstrip(), file=sys.stderr)

    return show


def show_advice(advice: Iterable[Advice]) -> None:
    """Print warnings, one a line, on standard error."""
    for item in advice:
        print(f'warning [{item.code}]: {with_flags(item.code, item.message)}', file=sys.stderr)


def print_result(as_json: bool, data: dict[str, Any], lines: Iterable[str], conclusion: Sequence[str] = ()) -> None:
    """Print one JSON object where it was asked for, else lines for a reader and the conclusion last. The version of the
    object rises when a key changes its meaning or goes.
    """
    if as_json:
        said = {'conclusion': list(conclusion)} if conclusion else {}
        print(json.dumps({'json_version': 1, **finite_or_none(data), **said}, indent=2))
    else:
        print('\n'.join([*([] if conclusion and IS_QUIET.get() else lines), *conclusion]))
