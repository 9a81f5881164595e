"""The work of a campaign: where tasks are done, and their results, kept so that stopped work goes on where it was."""

import asyncio
import concurrent.futures
import contextlib
import fcntl
import hashlib
import json
import queue
import shutil
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import interrupts_held, processes
from swath_sysid.formats.files import write_text

try:
    import distributed
except ImportError:
    distributed = None


def connection_losses() -> tuple[type[BaseException], ...]:
    """What distributed raises, or cancels its futures with, where the connection to its scheduler is lost."""
    cancelled = concurrent.futures.CancelledError, asyncio.CancelledError
    if distributed is None:
        return cancelled
    return (*cancelled, distributed.comm.CommClosedError, distributed.client.ClosedClientError)


@contextlib.contextmanager
def executor_of(jobs: int, scheduler: str | None = None) -> Iterator[concurrent.futures.Executor]:
    """An executor for independent tasks: processes on this machine, or the Dask scheduler at an address."""
    if jobs < 1:
        raise InputError('the work needs at least 1 process', 'no-process')
    with processes(jobs) if scheduler is None else _cluster(scheduler) as executor:
        yield executor


@contextlib.contextmanager
def _cluster(address: str) -> Iterator[concurrent.futures.Executor]:
    if distributed is None:
        raise InputError(
            "a Dask scheduler needs the package distributed: install it with pip install 'swath_sysid[cluster]'",
            'no-distributed',
        )
    try:
        client = distributed.Client(address, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f'no Dask scheduler answers at {address}: start one with dask scheduler, and give its address, such as '
            'tcp://host:8786'
        ) from error
    try:
        if not client.scheduler_info()['workers']:
            raise InputError(f'the Dask scheduler at {address} has no workers: start some with dask worker {address}')
        yield client.get_executor(pure=False)
    finally:
        with contextlib.suppress(OSError, TimeoutError, *connection_losses()):
            client.close()


LEFTOVERS = '.writing-*'
LOCK = '.lock'


def key_of(*parts: Any) -> str:
    """Key of a result: the SHA-256, hexadecimal, of all plain data that it depends on."""
    text = json.dumps(parts, sort_keys=True, separators=(',', ':'), allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()


class ResultStore:
    """A folder of results by key; each is written whole or not at all, whenever the process is killed."""

    def __init__(self, folder: str | Path) -> None:
        self._folder = Path(folder)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f'cannot make the folder {folder}: {error.strerror}; choose another') from error

    @contextmanager
    def locked(self) -> Iterator[Self]:
        """Hold the store for one process; what a killed one left half-written is cleared away."""
        with open(self._folder / LOCK, 'w') as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise InputError(
                    f'another campaign is writing to {self._folder.parent}: wait for it, or choose another folder',
                    'store-in-use',
                ) from error
            for leftover in self._folder.rglob(LEFTOVERS):
                shutil.rmtree(leftover, ignore_errors=True)
            yield self

    def get(self, key: str) -> Any:
        """The result of a key, or None; one that cannot be read counts as not there."""
        try:
            return json.loads(self._path(key).read_text(encoding='utf-8'))
        except (FileNotFoundError, json.JSONDecodeError, UnicodeDecodeError):
            return None
        except OSError as error:
            raise InputError(f'cannot read {self._path(key)}: {error.strerror}; check the disk') from error

    def put(self, key: str, result: Any) -> None:
        """Keep a result: plain data, which comes back bit by bit the same."""
        path = self._path(key)
        path.parent.mkdir(exist_ok=True)
        write_text(path, json.dumps(result, allow_nan=True))

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f'{key}.json'


@dataclass(frozen=True)
class Task:
    """Something to compute: a function of plain arguments, its key, and what to call it."""

    key: str
    label: str
    function: Callable
    arguments: tuple = field(repr=False)


@dataclass(frozen=True)
class Progress:
    """Progress of a campaign: tasks done and in all, and the labels of those running."""

    done: int
    total: int
    running: tuple[str, ...]


class Work:
    """Gets results of tasks: from the store, or by the executor and then into the store."""

    def __init__(
        self, store: ResultStore, executor: concurrent.futures.Executor, on_progress: Callable[[Progress], None]
    ) -> None:
        self._store, self._executor, self._on_progress = store, executor, on_progress
        self._done = self.total = 0
        self.computed = self.kept = 0
        self.failures: list[str] = []

    def results(self, tasks: Sequence[Task]) -> dict[str, Any]:
        """Key to plain result of every task that succeeded."""
        tasks = list({task.key: task for task in tasks}.values())
        found, pending = {}, {}
        done: queue.SimpleQueue[concurrent.futures.Future] = queue.SimpleQueue()
        for task in tasks:
            kept = self._store.get(task.key)
            if kept is not None:
                found[task.key] = kept['result']
                self._done += 1
                self.kept += 1
        try:
            for task in tasks:
                if task.key not in found:
                    future = self._executor.submit(task.function, *task.arguments)
                    if future.done():
                        self._finish(future, task, found)
                    else:
                        pending[future] = task
                        with interrupts_held():
                            future.add_done_callback(done.put)
                    self._say(pending)
            while pending:
                # not by concurrent.futures.wait, whose locks an interrupt may leave locked
                future = done.get()
                self._finish(future, pending.pop(future), found)
                self._say(pending)
        except connection_losses() as error:
            raise InputError(
                'the connection to the Dask scheduler was lost: start it again, and give the same command again; '
                'it goes on from the results that are kept'
            ) from error
        except BrokenProcessPool as error:
            raise InputError(
                'a worker process was killed, perhaps because memory ran out: give the same command again, with '
                'fewer processes; it goes on from the results that are kept',
                'worker-killed',
            ) from error
        return found

    @interrupts_held()
    def _finish(self, future: concurrent.futures.Future, task: Task, found: dict[str, Any]) -> None:
        fatal: tuple[type[BaseException], ...] = (BrokenProcessPool, *connection_losses())
        try:
            result = future.result()
        except fatal:
            raise
        except InputError as error:
            self._fail(task, str(error))
        except Exception as error:  # noqa: BLE001 - one failed fit must not stop the others; its reason is reported
            self._fail(task, f'{type(error).__name__}: {error}')
        else:
            self._store.put(task.key, {'label': task.label, 'result': result})
            # read back, so that a result is the same whether it was computed now or before
            found[task.key] = self._store.get(task.key)['result']
            self._done += 1
            self.computed += 1

    def _fail(self, task: Task, reason: str) -> None:
        self.failures.append(f'{task.label}: {reason}')
        self._done += 1

    def _say(self, pending: dict[concurrent.futures.Future, Task]) -> None:
        with interrupts_held():
            running = tuple(task.label for future, task in pending.items() if future.running())
        self._on_progress(Progress(self._done, max(self.total, self._done), running))
