"""A Dask connection that is lost ends a campaign with one sentence, and what is done stays done."""

import asyncio
import concurrent.futures
from contextlib import nullcontext
from types import SimpleNamespace

from swath_sysid.campaign import executors
from swath_sysid.cli import campaign
from swath_sysid.cli.main import main
from swath_sysid.common.processes import SerialExecutor


class CommClosedError(OSError):
    """As in distributed.comm."""


class ClosedClientError(Exception):
    """As in distributed.client."""


class LosingExecutor(SerialExecutor):
    """Loses its scheduler after some tasks: as raised on handing in, or as the outcome of a future."""

    def __init__(self, left, loss):
        self.left, self.loss = left, loss

    def submit(self, function, /, *args, **kwargs):
        self.left -= 1
        if self.left >= 0:
            return super().submit(function, *args, **kwargs)
        if isinstance(self.loss, CommClosedError | ClosedClientError):
            raise self.loss
        future = concurrent.futures.Future()
        if self.loss is None:  # what distributed.cfexecutor does with the futures of a lost scheduler
            future.cancel()
            future.set_running_or_notify_cancel()
        else:
            future.set_exception(self.loss)
        return future


def test_lost_scheduler(tmp_path, monkeypatch, capsys):
    trial = tmp_path / 'pitch.csv'
    release = ['--hull', 'swath-pitch', '--initial-angle-deg', '6', '--duration', '8', '--rate', '25']
    assert main(['simulate', *release, '--output', str(trial)]) == 0
    (tmp_path / 'c.yaml').write_text('axis: pitch\nequations: [linear]\ntrials:\n  - file: pitch.csv\n')
    comm = SimpleNamespace(CommClosedError=CommClosedError)
    stub = SimpleNamespace(comm=comm, client=SimpleNamespace(ClosedClientError=ClosedClientError))
    monkeypatch.setattr(executors, 'distributed', stub)
    command = ['campaign', str(tmp_path / 'c.yaml'), '--output', str(tmp_path / 'report')]
    for tasks, loss in (
        (1, ClosedClientError('closed')),
        (0, None),
        (0, CommClosedError('in <TCP>')),
        (0, asyncio.CancelledError()),
    ):
        lost = nullcontext(LosingExecutor(tasks, loss))
        monkeypatch.setattr(campaign, 'executor_of', lambda *_, lost=lost: lost)
        assert main(command) == 2
        error = capsys.readouterr().err
        assert 'the connection to the Dask scheduler was lost' in error and 'Traceback' not in error
        assert not (tmp_path / 'report' / 'report.html').exists()
    monkeypatch.setattr(campaign, 'executor_of', lambda *_: nullcontext(SerialExecutor()))
    monkeypatch.setattr(campaign, 'write_report', lambda *_: None)
    assert main(command) == 0
    assert ', 1 reused' in capsys.readouterr().out
