"""The worker process: warm, cancelled, killed, never left behind."""

import contextlib
import operator
import os
import platform
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from package_process import PATIENCE, environment, is_alive, wait_for

from swath_sysid.common.cancelling import Cancelled
from swath_sysid.common.errors import InputError
from swath_sysid.common.processes import NICENESS
from swath_sysid.nodes.worker import Worker, WorkerError


def process_id(*, progress, should_cancel):
    progress(0.5)
    progress(1.0)
    return os.getpid()


def until_cancelled(*, progress, should_cancel):
    progress(0.1)
    while not should_cancel():
        time.sleep(0.01)
    raise Cancelled


def deaf(*, progress, should_cancel):
    progress(0.1)
    time.sleep(4.0 * PATIENCE)


def refusing(sentence):
    raise InputError(sentence)


KEPT = []


def much_memory(blocks):
    """Blocks of the C library, with one kept behind them, without which it would give all of them back by itself."""
    held = [bytearray(2000) for _ in range(blocks)]
    KEPT.append(held.pop())


def own_memory():
    return int(Path('/proc/self/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE')


@pytest.fixture(scope='module')
def python_path():
    """The worker imports this module too."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('PYTHONPATH', str(Path(__file__).parent), os.pathsep)
        yield


@pytest.fixture(scope='module')
def worker(python_path):
    deaths = []
    with contextlib.closing(Worker(os.getpid, lambda: deaths.append(time.monotonic()))) as worker:
        worker.deaths = deaths
        yield worker


class Ending:
    def __init__(self):
        self.shares, self.result, self.error, self.has_ended = [], None, None, False

    def on_end(self, result, error):
        self.result, self.error, self.has_ended = result, error, True

    def wait(self):
        wait_for(lambda: self.has_ended, 'end')
        return self

    def wait_for_progress(self):
        wait_for(lambda: self.shares, 'progress')


def submit(worker, function, *arguments, reports=False):
    ending = Ending()
    worker.submit(function, arguments, ending.on_end, ending.shares.append if reports else None)
    return ending


@pytest.mark.skipif(platform.libc_ver()[0] != 'glibc', reason='other C libraries keep less')
def test_what_a_work_needed_is_given_back(worker):
    def measured():
        return submit(worker, own_memory).wait().result

    before = measured()
    assert submit(worker, much_memory, 50_000).wait().error is None
    assert measured() < before + 20e6


def test_functions_run_one_after_the_other_in_one_other_process(worker):
    worker.cancel()
    endings = [submit(worker, process_id, reports=True) for _ in range(3)] + [submit(worker, abs, -42)]
    assert {ending.wait().result for ending in endings[:3]} == {worker.pid} and worker.pid != os.getpid()
    least_urgent, own = 19, os.getpriority(os.PRIO_PROCESS, 0)
    assert os.getpriority(os.PRIO_PROCESS, worker.pid) == min(own + NICENESS, least_urgent)
    assert endings[0].shares == [0.5, 1.0] and endings[3].wait().result == 42
    # errors come back as errors
    refused, failed = submit(worker, refusing, 'no such decay'), submit(worker, operator.truediv, 1, 0)
    assert isinstance(refused.wait().error, InputError) and str(refused.error) == 'no such decay'
    assert isinstance(failed.wait().error, WorkerError) and 'ZeroDivisionError' in str(failed.error)
    assert submit(worker, abs, -8).wait().result == 8


@pytest.mark.parametrize('function', [until_cancelled, deaf])
def test_cancelled_whether_it_listens_or_not(worker, function):
    ending = submit(worker, function, reports=True)
    ending.wait_for_progress()
    worker.cancel()
    ending.wait()
    assert isinstance(ending.error, Cancelled)
    assert submit(worker, abs, -10).wait().result == 10


def test_a_worker_that_dies_is_reported_and_started_again_or_ends_once_it_is_idle(worker, python_path):
    before = len(worker.deaths)
    ending = submit(worker, os._exit, 3).wait()
    assert isinstance(ending.error, WorkerError) and 'was restarted' in str(ending.error)
    assert len(worker.deaths) == before + 1
    assert submit(worker, abs, -14).wait().result == 14
    killed = worker.pid
    os.kill(killed, signal.SIGKILL)
    wait_for(lambda: len(worker.deaths) == before + 2, 'report of the idle worker that was killed')
    assert worker.pid != killed and submit(worker, abs, -16).wait().result == 16
    with contextlib.closing(Worker(os.getpid, longest_idle=0.1)) as worker:
        for value in (3, 4):
            assert submit(worker, abs, -value).wait().result == value
            wait_for(lambda: not is_alive(worker.pid), 'end of the idle process')


def test_closing_ends_what_runs_and_what_warms_up(python_path):
    worker = Worker(os.getpid)
    ending = submit(worker, deaf, reports=True)
    ending.wait_for_progress()
    pid = worker.pid
    worker.close()
    assert isinstance(ending.error, Cancelled) and not is_alive(pid)
    warming = Worker(time.sleep)
    ending = submit(warming, abs, 1)
    warming.close()
    assert isinstance(ending.wait().error, Cancelled | WorkerError)


@pytest.mark.parametrize('how', [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_the_worker_ends_with_its_node(python_path, how):
    """Even where the node has no time to say farewell."""
    code = textwrap.dedent("""
        import test_nodes_worker as t
        worker = t.Worker(t.os.getpid)
        ending = t.submit(worker, t.until_cancelled, reports=True)
        ending.wait_for_progress()
        print(worker.pid, flush=True)
        t.time.sleep(t.PATIENCE)
    """)
    pipes = {'stdout': subprocess.PIPE, 'stderr': subprocess.DEVNULL, 'text': True}
    with subprocess.Popen([sys.executable, '-c', code], env=environment(), **pipes) as node:
        pid = int(node.stdout.readline())
        assert is_alive(pid)
        node.send_signal(how)
        node.wait(PATIENCE)
        wait_for(lambda: not is_alive(pid), 'end of the worker')
