"""The work of a campaign: tasks done by an executor, their results kept in a store."""

import concurrent.futures
import time
from collections.abc import Callable, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from typing import Any

from swath_sysid.campaign.executors import connection_losses
from swath_sysid.campaign.result_store import ResultStore
from swath_sysid.common.errors import InputError


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


def _timed(function: Callable, arguments: tuple) -> tuple[Any, float]:
    """Result, plain data, and the processor time that it took, s; runs in the worker."""
    began = time.process_time()
    return function(*arguments), time.process_time() - began


class Work:
    """Gets results of tasks: from the store, or by the executor and then into the store."""

    def __init__(
        self, store: ResultStore, executor: concurrent.futures.Executor, on_progress: Callable[[Progress], None]
    ) -> None:
        self._store, self._executor, self._on_progress = store, executor, on_progress
        self._done = self.total = 0
        self.computed = self.kept = 0
        self.cpu_s = 0.0
        self.failures: list[str] = []

    def results(self, tasks: Sequence[Task]) -> dict[str, Any]:
        """Key to plain result of every task that succeeded."""
        tasks = list({task.key: task for task in tasks}.values())
        found, pending = {}, {}
        for task in tasks:
            kept = self._store.get(task.key)
            if kept is not None:
                found[task.key] = kept['result']
                self._count(kept['cpu_s'])
                self.kept += 1
        try:
            for task in tasks:
                if task.key not in found:
                    future = self._executor.submit(_timed, task.function, task.arguments)
                    if future.done():
                        self._finish(future, task, found)
                    else:
                        pending[future] = task
                    self._say(pending)
            while pending:
                finished, _ = concurrent.futures.wait(pending, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in finished:
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

    def _finish(self, future: concurrent.futures.Future, task: Task, found: dict[str, Any]) -> None:
        fatal: tuple[type[BaseException], ...] = (BrokenProcessPool, *connection_losses())
        try:
            result, cpu_s = future.result()
        except fatal:
            raise
        except InputError as error:
            self._fail(task, str(error))
        except Exception as error:  # noqa: BLE001 - one failed fit must not stop the others; its reason is reported
            self._fail(task, f'{type(error).__name__}: {error}')
        else:
            self._store.put(task.key, {'label': task.label, 'cpu_s': cpu_s, 'result': result})
            # read back, so that a result is the same whether it was computed now or before
            found[task.key] = self._store.get(task.key)['result']
            self._count(cpu_s)
            self.computed += 1

    def _fail(self, task: Task, reason: str) -> None:
        self.failures.append(f'{task.label}: {reason}')
        self._count(0.0)

    def _count(self, cpu_s: float) -> None:
        self._done += 1
        self.cpu_s += cpu_s

    def _say(self, pending: dict[concurrent.futures.Future, Task]) -> None:
        running = tuple(task.label for future, task in pending.items() if future.running())
        self._on_progress(Progress(self._done, max(self.total, self._done), running))
