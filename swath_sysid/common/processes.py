"""Independent tasks in this process or in several of this machine, by futures, and verbs in processes of their own."""

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from typing import Any, TypeVar

Task = TypeVar('Task')
Result = TypeVar('Result')

END_S = 15.0  #: Within which a process has to end before it is killed.


class SerialExecutor(Executor):
    """Does the work in this process, each task when it is submitted."""

    def submit(self, function: Callable[..., Result], /, *args: Any, **kwargs: Any) -> Future[Result]:
        """Call the function; the future that is returned is done."""
        future: Future[Result] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - raised again by the result
            future.set_exception(error)
        return future


def verb_command(verb: str, *options: str) -> list[str]:
    """The words that run a verb of the command line in a process of its own."""
    return [sys.executable, '-m', 'swath_sysid.start', verb, *options]


def ended(process: subprocess.Popen) -> None:
    """Wait for a process that was asked to end, and kill it if it does not."""
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def results_in_order(function: Callable[[Task], Result], tasks: Sequence[Task], count: int) -> Iterator[Result]:
    """The result of each task, in order, by ``count`` processes, this one among them. This process starts at the
    front, the others, which take seconds to start, at the end, one task at a time.
    """
    if count <= 1 or len(tasks) == 1:
        yield from map(function, tasks)
        return
    lock, waiting = threading.Lock(), deque(range(len(tasks)))
    begun: dict[int, Future[Result]] = {}
    with _pool(min(count, len(tasks)) - 1) as executor:

        def hand_out(_: Future | None = None) -> None:
            with lock:
                if not waiting:
                    return
                future = begun[waiting[-1]] = executor.submit(function, tasks[waiting[-1]])
                waiting.pop()
            future.add_done_callback(hand_out)

        for _ in range(min(count, len(tasks)) - 1):
            hand_out()
        try:
            for number, task in enumerate(tasks):
                with lock:
                    is_mine = bool(waiting) and waiting[0] == number
                    if is_mine:
                        waiting.popleft()
                yield function(task) if is_mine else begun[number].result()
        finally:
            waiting.clear()


@contextlib.contextmanager
def processes(count: int) -> Iterator[Executor]:
    """An executor on this many processes; one is this process."""
    if count <= 1:
        yield SerialExecutor()
    else:
        with _pool(count) as executor:
            yield executor


@contextlib.contextmanager
def _pool(count: int) -> Iterator[ProcessPoolExecutor]:
    # read when a worker imports numpy: more threads than cores would only get in each other's way
    os.environ.setdefault('OMP_NUM_THREADS', '1')
    executor = ProcessPoolExecutor(count, multiprocessing.get_context('spawn'), initializer=_begin_worker)
    try:
        yield executor
    except BaseException:
        # their work is lost in any case
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        executor.shutdown(wait=False, cancel_futures=True)


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, and end when the parent does, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(multiprocessing.parent_process(),), daemon=True).start()


def _end_with(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    os._exit(1)
