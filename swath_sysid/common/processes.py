"""Independent tasks in processes by futures, verbs in processes of their own, and a child that works for its parent.

A plain child with one socket: multiprocessing's spawn would import the parent's main module, and rclpy with it.
"""

import contextlib
import ctypes
import gc
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar

import swath_sysid
from swath_sysid.common.cancelling import Cancelled
from swath_sysid.common.errors import InputError

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


def module_command(module: str, *words: str) -> list[str]:
    """The words that run a module in a process of its own, which imports nothing from the working folder."""
    return [sys.executable, '-P', '-m', module, *words]


def verb_command(verb: str, *options: str) -> list[str]:
    """The words that run a verb of the command line in a process of its own."""
    return module_command('swath_sysid.start', verb, *options)


def end_with_parent() -> None:
    """On Linux, have this process terminated when the parent is: one that is killed cannot end what it started."""
    if sys.platform == 'linux':
        ctypes.CDLL(None).prctl(1, signal.SIGTERM)  # PR_SET_PDEATHSIG


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
def interrupts_held() -> Iterator[None]:
    """Have an interrupt of this thread come after the block: raised within a lock of a library, it leaves it locked."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Pool(ProcessPoolExecutor):
    def submit(self, function: Callable[..., Result], /, *args: Any, **kwargs: Any) -> Future[Result]:
        # the processes and threads that this starts leave interrupts to this thread, from their start on
        with interrupts_held():
            return super().submit(function, *args, **kwargs)


@contextlib.contextmanager
def _pool(count: int) -> Iterator[ProcessPoolExecutor]:
    # read when a worker imports numpy: more threads than cores would only get in each other's way
    os.environ.setdefault('OMP_NUM_THREADS', '1')
    # a worker starts as `python -c`, which would import modules of the working folder
    os.environ.setdefault('PYTHONSAFEPATH', '1')
    try:
        executor = _Pool(count, multiprocessing.get_context('spawn'), initializer=_begin_worker)
    except OSError as error:
        raise InputError(
            f'worker processes cannot share memory ({error.strerror}): make /dev/shm writable, or work in one process'
        ) from error
    try:
        yield executor
    except BaseException:
        # their work is lost in any case
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        # until its semaphores are released, but not for ever: see `interrupts_held`
        end = threading.Thread(target=executor.shutdown, kwargs={'cancel_futures': True}, daemon=True)
        end.start()
        end.join(END_S)


def _begin_worker() -> None:
    """End when asked to, and when the parent does, however it ends; Ctrl-C stays left to the parent."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGTERM])
    threading.Thread(target=_end_with, args=(multiprocessing.parent_process(),), daemon=True).start()


def _end_with(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    os._exit(1)


NICENESS = 5  #: A child yields to the processes that forecast, and still gets its turn on a busy core.
CANCEL_PATIENCE = 0.3  #: s; a child that has not given up by then is killed, and starts with the next work.
POLL_PERIOD = 0.02

Work = tuple[Callable, tuple, bool]

PROGRESS, DONE, REFUSED, CANCELLED, FAILED = 'progress', 'done', 'refused', 'cancelled', 'failed'


class WorkerError(RuntimeError):
    """The worker died, or its work ended in an error of its own."""


class WorkerProcess:
    """The process, as its parent uses it, from one thread at a time; all functions must be importable in it. The clock
    gives monotonic seconds. After a rest the process starts with the next work.
    """

    def __init__(self, warm_up: Callable[[], Any], clock: Callable[[], float], niceness: int = NICENESS) -> None:
        self._warm_up, self._clock, self._niceness = warm_up, clock, niceness
        self._ready = self._is_resting = False
        self._start()

    @property
    def pid(self) -> int:
        """Process id of now."""
        return self._process.pid

    def died_idle(self) -> bool:
        """Whether it was ready and has died since, reported once."""
        if self._is_resting:
            return False
        try:
            if not self._ready and self._connection.poll():
                self._note_ready()
        except (EOFError, OSError, WorkerError):
            return False
        died = self._ready and self._process.poll() is not None
        self._ready = self._ready and not died
        return died

    def run(
        self, work: Work, is_cancelled: Callable[[], bool], on_progress: Callable[[float], None] | None = None
    ) -> Any:
        """The result of a function that the process runs, or what it raised; EOFError or OSError if the process died.
        `Cancelled` comes within half a second of ``is_cancelled()``; ``on_progress`` is called with 0 to 1.
        """
        sent, asked_at = False, None
        if self._is_resting:
            self._start()
        while True:
            if self._ready and not sent and not is_cancelled():
                self._connection.send(work)
                sent = True
            if self._connection.poll(POLL_PERIOD):
                if not sent:
                    self._note_ready()
                    continue
                kind, content = self._connection.recv()
                if kind != PROGRESS:
                    return _result(kind, content)
                if on_progress is not None:
                    on_progress(content)
            if is_cancelled():
                now = self._clock()
                if not sent:
                    raise Cancelled
                if asked_at is None:
                    asked_at = now
                    self._connection.send(None)
                elif now - asked_at > CANCEL_PATIENCE:
                    self._process.kill()
                    self.rest()
                    raise Cancelled

    def restart(self) -> str:
        """Start another process in place of this one: how this one ended, in words."""
        code = None
        if not self._is_resting:
            code = self._process.poll()
            self._process.kill()
        self.end()
        self._start()
        return f'with code {code}' if code is not None else 'unexpectedly'

    def rest(self) -> None:
        """End the process until there is work again."""
        self.end()
        self._is_resting = True

    def end(self) -> None:
        """End the process, which has `CANCEL_PATIENCE` to do so itself, unless it has not begun anything."""
        if self._is_resting:
            return
        self._connection.close()
        try:
            self._process.wait(CANCEL_PATIENCE if self._ready else 0.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _start(self) -> None:
        self._ready = False
        ours, theirs = socket.socketpair()
        # held from here on, so that a start that fails leaves nothing open
        self._connection = Connection(ours.detach())
        environment = {**os.environ, 'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'}
        # `python -m` must find this very package, installed or not
        root = str(Path(swath_sysid.__file__).resolve().parents[1])
        environment['PYTHONPATH'] = os.pathsep.join(filter(None, [root, environment.get('PYTHONPATH')]))
        with theirs:
            self._process = subprocess.Popen(
                module_command(__name__, str(theirs.fileno()), str(self._niceness)),
                pass_fds=[theirs.fileno()],
                env=environment,
                stdin=subprocess.DEVNULL,
                # out of the terminal's process group: Ctrl-C is the parent's, which then closes the socket
                start_new_session=True,
            )
        self._is_resting = False
        self._connection.send((self._warm_up, (), False))

    def _note_ready(self) -> None:
        """The answer of the warm-up, if it has come."""
        kind, content = self._connection.recv()
        if kind == FAILED:
            raise WorkerError(content)
        self._ready = True


def _result(kind: str, content: Any) -> Any:
    """What a function returned or, raised, what it ended in."""
    if kind == DONE:
        return content
    if kind == REFUSED:
        raise InputError(content)
    if kind == CANCELLED:
        raise Cancelled
    raise WorkerError(content)


def serve(connection: Connection) -> None:
    """Run one function after the other until the parent is gone."""
    while True:
        try:
            work = connection.recv()
            if work is not None:  # else: to stop what has ended already
                connection.send(_carried_out(connection, *work))
                _give_memory_back()
        except (EOFError, OSError):
            return


def _give_memory_back() -> None:
    """What the last work needed, 5 to 10 MB, to the system: glibc keeps it for the next, which may be hours away."""
    gc.collect()
    library = ctypes.CDLL(None)
    if hasattr(library, 'malloc_trim'):
        library.malloc_trim(0)


def _carried_out(connection: Connection, function: Callable, arguments: tuple, reports: bool) -> tuple[str, Any]:
    """Run a function and say how it ended."""
    reported = [0.0]

    def progress(share: float) -> None:
        if share - reported[0] >= 0.01 or share >= 1.0:
            reported[0] = share
            connection.send((PROGRESS, float(share)))

    def should_cancel() -> bool:
        # a message during work can only mean: stop
        if connection.poll():
            connection.recv()
            return True
        return False

    try:
        reporting = {'progress': progress, 'should_cancel': should_cancel} if reports else {}
        return DONE, function(*arguments, **reporting)
    except InputError as error:
        return REFUSED, str(error)
    except Cancelled:
        return CANCELLED, None
    except (EOFError, OSError):
        raise
    except Exception as error:  # whatever it is, the parent reports it and the process goes on
        return FAILED, f'{type(error).__name__}: {error}'


if __name__ == '__main__':
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(int(sys.argv[2]))
    with Connection(int(sys.argv[1])) as to_parent:
        serve(to_parent)
