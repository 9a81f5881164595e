"""Where work is done: in this process, on all cores, or on a Dask cluster; all by futures."""

import asyncio
import concurrent.futures
import contextlib
from collections.abc import Iterator

from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import processes

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
