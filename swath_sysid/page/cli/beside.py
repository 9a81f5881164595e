"""The page beside the nodes that ``swath-sysid run`` starts."""

import sys
import threading
from argparse import Namespace
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from swath_sysid.cli.run import process_beside
from swath_sysid.common.errors import NOTHING_DONE, InputError
from swath_sysid.common.processes import verb_command

LOOK_S = 0.2  #: Between looks whether the page still runs.


def pages_beside(arguments: Namespace) -> list[AbstractContextManager]:
    """The page, where it is asked for: a process of its own, which costs the nodes no sample."""
    if arguments.page:
        return [watched_beside(page_command(arguments))]
    if arguments.port is not None:
        raise InputError('--port is the port of the page: add --page')
    return []


def page_command(arguments: Namespace) -> list[str]:
    """The page as a process of its own."""
    from swath_sysid.page.server import check_installed

    check_installed()
    from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS

    axis = PUBLISHED_HULLS[arguments.simulate].axis if arguments.simulate else None
    named = {'namespace': arguments.namespace, 'imu-topic': arguments.imu_topic, 'port': arguments.port, 'axis': axis}
    given = {f'--{option}': str(value) for option, value in named.items() if value is not None}
    return verb_command('page', *(word for pair in given.items() for word in pair))


@contextmanager
def watched_beside(command: list[str]) -> Iterator[None]:
    """Run the page while the block runs; where it ends by itself, that is reported, and it is started again once."""
    stopping = threading.Event()

    def watch() -> None:
        for what_next in ('it is started again', 'start it again with swath-sysid page'):
            with process_beside(command) as page:
                while page.poll() is None:
                    if stopping.wait(LOOK_S):
                        return
            # exit code 2: the page has printed why it cannot start
            if page.returncode == NOTHING_DONE:
                return
            said = f'swath-sysid run: the page has ended with code {page.returncode}, the nodes go on: {what_next}'
            print(said, file=sys.stderr, flush=True)

    # which ends after the page: on Linux a process is ended with the thread that started it
    watching = threading.Thread(target=watch)
    watching.start()
    try:
        yield
    finally:
        stopping.set()
        watching.join()
