"""What the verbs share whose fits are kept: where they are done and stored, and that the same command goes on."""

import logging
import sys
from argparse import Namespace
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

from swath_sysid.cli.progress import progress_of
from swath_sysid.tank.campaign.work import ResultStore, executor_of

RESULTS = 'results'  #: The folder of the finished fits.


@contextmanager
def said_to_continue() -> Iterator[None]:
    """Say that nothing finished is lost, where the block is interrupted."""
    try:
        yield
    except KeyboardInterrupt:
        print('stopped: the same command continues from the finished fits', file=sys.stderr)
        raise


@contextmanager
def kept_work(name: str, folder: Path, arguments: Namespace) -> Iterator[tuple[ResultStore, Executor, Callable]]:
    """The store of finished fits, what does the others, and how far they are, for what a verb is called."""
    # the loss of a scheduler is reported in one sentence, not by the tracebacks of its client
    for each in ('distributed', 'distributed.client'):
        logging.getLogger(each).setLevel(logging.CRITICAL)
    store = ResultStore(folder / RESULTS)
    with (
        store.locked(),
        executor_of(arguments.jobs, arguments.scheduler) as executor,
        progress_of(name) as progress,
    ):
        yield store, executor, progress
