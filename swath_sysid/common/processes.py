"""Independent tasks in this process or in several of this machine, all by futures."""
import contextlib
import multiprocessing
import os
import signal
import threading
from concurrent.futures import Executor, Future, ProcessPoolExecutor


class SerialExecutor(Executor):
    """Does the work in this process, each task when it is submitted."""

    def submit(self, function, /, *args, **kwargs):
        """Call the function; the future that is returned is done."""
        future: Future = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - raised again by the result
            future.set_exception(error)
        return future


def results_in_order(function, tasks, count):
    """The result of each task, in order, by this many processes.

    This process begins at the front, the others, which take seconds to start, at the end.

    Parameters
    ----------
    function : callable
        Of one argument; importable by another process.
    tasks : sequence
        Arguments of the function.
    count : int
        Of processes, this one among them.

    Yields
    ------
    object
    """
    if count <= 1 or len(tasks) == 1:
        yield from map(function, tasks)
        return
    with _pool(min(count, len(tasks)) - 1) as executor:
        futures = [executor.submit(function, task) for task in reversed(tasks)]
        for task, future in zip(tasks, reversed(futures), strict=True):
            # a task that has not begun can be cancelled
            yield function(task) if future.cancel() else future.result()


@contextlib.contextmanager
def processes(count):
    """An executor on this many processes; one is this process.

    Parameters
    ----------
    count : int
        Of processes.

    Yields
    ------
    concurrent.futures.Executor
    """
    if count <= 1:
        yield SerialExecutor()
    else:
        with _pool(count) as executor:
            yield executor


@contextlib.contextmanager
def _pool(count):
    # read when a worker imports numpy: more threads than cores would only get in each other's way
    os.environ.setdefault('OMP_NUM_THREADS', '1')
    executor = ProcessPoolExecutor(count, multiprocessing.get_context('spawn'), initializer=_begin_worker)
    try:
        yield executor
    except BaseException:
        # what they are at is lost in any case, and waiting for it can last long
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        executor.shutdown(wait=False, cancel_futures=True)


def _begin_worker():
    """Leave Ctrl-C to the parent, and end when the parent does, however it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(multiprocessing.parent_process(),), daemon=True).start()


def _end_with(parent):
    parent.join()
    os._exit(1)
