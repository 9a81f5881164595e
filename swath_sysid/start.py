"""The command line as an executable: from its first import on, Ctrl-C or SIGTERM ends it without a traceback.

Importing everything takes a second or two, in which an interrupt may come up anywhere, also in a library
that swallows it. Nothing is under way by then, so the process just ends.
"""

import os
import sys


def _import_nothing_from_the_working_folder() -> None:
    """Here and in child processes, unless PYTHONPATH names it: `-m`, `-c` and an empty entry of PYTHONPATH put it among
    the places of modules, and it may hold a download called signal.py.
    """
    os.environ['PYTHONSAFEPATH'] = '1'
    given = [entry for entry in os.environ.get('PYTHONPATH', '').split(os.pathsep) if entry]
    os.environ['PYTHONPATH'] = os.pathsep.join(given)
    try:
        kept = {os.path.dirname(os.path.dirname(os.path.abspath(__file__))), *map(os.path.abspath, given)}
        sys.path[:] = [entry for entry in sys.path if entry in kept or (entry and entry != os.getcwd())]
    except FileNotFoundError:
        return  # a folder that has been deleted has no modules


# before anything else is imported
_import_nothing_from_the_working_folder()

import io  # noqa: E402
import signal  # noqa: E402
from contextlib import suppress  # noqa: E402
from importlib import import_module  # noqa: E402

SERVING_VERBS = ('run', 'page', 'replay', 'record')  #: Those that a signal is the regular end of.

#: Also where a shell without job control has started the process with SIGINT ignored.
ENDING = (signal.SIGINT, signal.SIGTERM)

NOTHING_BEGUN = 'stopped before anything was done: give the same command again\n'


def command_line() -> int:
    """``swath-sysid``; returns the exit code."""
    # before numpy is loaded: matrices are small here, and threads would only wait for each other
    os.environ.setdefault('OMP_NUM_THREADS', '1')
    # figures are files; a backend that is named but not installed, such as Jupyter's, stops the import of matplotlib
    os.environ['MPLBACKEND'] = 'Agg'
    if isinstance(sys.stdout, io.TextIOWrapper):
        # the name of a file, whose bytes may be no UTF-8, is printed as it is
        sys.stdout.reconfigure(errors='surrogateescape')
    verb = next((word for word in sys.argv[1:] if not word.startswith('-')), None)
    serving = verb in SERVING_VERBS
    interrupted = 128 + signal.SIGINT  # as shells have it
    _end_on_signals(0 if serving else interrupted, '' if serving else NOTHING_BEGUN)
    cli = import_module('swath_sysid.cli.main')
    if verb in cli.VERBS:
        cli.module_of(verb)
    if serving:
        # all is closed; taking the modules down would take a third of a second more
        _leave(cli.main())
    try:
        code = cli.main(begin=_raise_on_signals)
    except KeyboardInterrupt:
        code = interrupted
    finally:
        _end_on_signals(interrupted)
    if code == interrupted:
        # raised within a lock of a library, the interrupt leaves it locked, and threads of a pool would wait for it
        _leave(code)
    return code


def _leave(code: int) -> None:
    """End at once, what is printed being written; this does not return."""
    with suppress(OSError):
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
    os._exit(code)


def _raise_on_signals():
    # there may be something to clean up
    for number in ENDING:
        signal.signal(number, signal.default_int_handler)


def _end_on_signals(code: int, sentence: str = ''):
    def end(*_) -> None:
        with suppress(OSError):
            os.write(2, sentence.encode())
        os._exit(code)

    for number in ENDING:
        signal.signal(number, end)


if __name__ == '__main__':
    sys.exit(command_line())
