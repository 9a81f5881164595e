"""The worker: a process beside a node that does its long work, spawned once, warm, and never left behind.

A plain child process with one socket, rather than multiprocessing's spawn: that would import the
node's main module, and rclpy with it, into the worker, and start a resource tracker.
"""
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import swath_sysid
from swath_sysid.common.errors import InputError
from swath_sysid.common.stopping import Cancelled

NICENESS = 10
"""The worker yields to the nodes that forecast."""

CANCEL_PATIENCE = 0.3
"""s; a worker that has not given up by then is killed and started again."""

POLL_PERIOD = 0.02
IDLE_PERIOD = 0.5

OnEnd = Callable[[Any, Exception | None], None]
OnProgress = Callable[[float], None]

PROGRESS, DONE, REFUSED, CANCELLED, FAILED = 'progress', 'done', 'refused', 'cancelled', 'failed'


class WorkerError(RuntimeError):
    """The worker died, or its work ended in an error of its own."""


class _Job:
    def __init__(self, work: tuple, on_progress: OnProgress | None, on_end: OnEnd):
        self.work = work
        self.on_progress = on_progress
        self.on_end = on_end
        self.cancelled = threading.Event()


class Worker:
    """Runs one function after the other in a process of its own.

    Parameters
    ----------
    warm_up : callable
        Run in the process when it starts; importable there, as all functions given.
    on_death : callable, optional
        Called (from the worker's thread) when the process died and was started again.
    """

    def __init__(self, warm_up: Callable[[], None], on_death: Callable[[], None] | None = None):
        self._warm_up = warm_up
        self._on_death = on_death
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._unfinished: list[_Job] = []
        self._closing = threading.Event()
        self._process: subprocess.Popen
        self._connection: Connection
        self._ready = False
        self._start()
        self._thread = threading.Thread(target=self._serve, name='worker', daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """Process id of the worker now."""
        return self._process.pid

    def submit(
        self, function: Callable, arguments: tuple, on_end: OnEnd, on_progress: OnProgress | None = None
    ) -> None:
        """Have ``function(*arguments)`` run; with ``on_progress`` also given ``progress=`` and ``should_cancel=``.

        Parameters
        ----------
        function : callable
            Importable in the worker.
        arguments : tuple
            Picklable.
        on_end : callable
            Called from the worker's thread with the result and None, or with None and one of
            `InputError`, `Cancelled`, `WorkerError`.
        on_progress : callable, optional
            Called from the worker's thread with 0 to 1.
        """
        job = _Job((function, arguments, on_progress is not None), on_progress, on_end)
        self._unfinished.append(job)
        self._jobs.put(job)

    def cancel(self) -> None:
        """Have all work submitted end with `Cancelled`, what runs now within half a second."""
        for job in tuple(self._unfinished):
            job.cancelled.set()

    def close(self) -> None:
        """End the process; what runs ends with `Cancelled`."""
        self._closing.set()
        self._jobs.put(None)
        self._thread.join()
        self._end_process()

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
                [sys.executable, '-m', __name__, str(theirs.fileno())],
                pass_fds=[theirs.fileno()], env=environment, stdin=subprocess.DEVNULL,
                # out of the terminal's process group: Ctrl-C is the node's, which then closes the socket
                start_new_session=True,
            )
        self._connection.send((self._warm_up, (), False))

    def _end_process(self) -> None:
        self._connection.close()
        try:
            self._process.wait(CANCEL_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _restart(self) -> None:
        self._process.kill()
        self._end_process()
        self._start()

    def _serve(self) -> None:
        while not self._closing.is_set():
            try:
                job = self._jobs.get(timeout=IDLE_PERIOD)
            except queue.Empty:
                self._look_after()
                continue
            if job is not None:
                result, error = self._do(job)
                self._unfinished.remove(job)
                job.on_end(result, error)

    def _look_after(self) -> None:
        """Amid no work: hear that the process is ready; start another if it died after that.

        One that never got ready is started again with the next work only, not for ever.
        """
        try:
            if not self._ready and self._connection.poll():
                self._hear_ready()
        except (EOFError, OSError, WorkerError):
            return
        if self._ready and self._process.poll() is not None:
            self._ready = False
            self._revive()

    def _hear_ready(self) -> None:
        """The answer of the warm-up, if it has come."""
        kind, content = self._connection.recv()
        if kind == FAILED:
            raise WorkerError(content)
        self._ready = True

    def _revive(self):
        """Start another process in place of one that died; the error that tells so."""
        code = self._process.poll()
        how = f'with code {code}' if code is not None else 'unexpectedly'
        try:
            self._restart()
        except OSError as error:
            return WorkerError(f'the worker process ended {how} and cannot be started again ({error.strerror})')
        if self._on_death is not None:
            self._on_death()
        return WorkerError(f'the worker process ended {how} and was started again: try again')

    def _do(self, job: _Job):
        try:
            return self._exchange(job)
        except WorkerError as error:
            return None, error
        except (EOFError, OSError):
            return None, self._revive()

    def _exchange(self, job: _Job):
        sent, asked_at = False, None
        while True:
            if self._ready and not sent and not job.cancelled.is_set():
                self._connection.send(job.work)
                sent = True
            if self._connection.poll(POLL_PERIOD):
                if not sent:
                    self._hear_ready()
                    continue
                kind, content = self._connection.recv()
                if kind != PROGRESS:
                    return _ending(kind, content)
                if job.on_progress is not None:
                    job.on_progress(content)
            if job.cancelled.is_set() or self._closing.is_set():
                now = time.monotonic()
                if not sent:
                    return None, Cancelled()
                if asked_at is None:
                    asked_at = now
                    self._connection.send(None)
                elif now - asked_at > CANCEL_PATIENCE:
                    self._restart()
                    return None, Cancelled()


def _ending(kind: str, content: Any):
    """What a job ended in: result and error, one of them None."""
    if kind == DONE:
        return content, None
    if kind == REFUSED:
        return None, InputError(content)
    if kind == CANCELLED:
        return None, Cancelled()
    return None, WorkerError(content)


def serve(connection: Any) -> None:
    """What the process does: one function after the other, until the node is gone."""
    while True:
        try:
            work = connection.recv()
            if work is not None:  # else: to stop what has ended already
                connection.send(_carried_out(connection, *work))
        except (EOFError, OSError):
            return


def _carried_out(connection: Any, function: Callable, arguments: tuple, reports: bool):
    """Run a function and say how it ended."""
    reported = [0.0]

    def progress(share: float) -> None:
        if share - reported[0] >= 0.01 or share >= 1.0:
            reported[0] = share
            connection.send((PROGRESS, float(share)))

    def should_cancel():
        # a message amid work can only say: stop
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
    except Exception as error:  # whatever it is, the node tells it and the worker lives
        return FAILED, f'{type(error).__name__}: {error}'


if __name__ == '__main__':
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    with Connection(int(sys.argv[1])) as to_node:
        serve(to_node)
