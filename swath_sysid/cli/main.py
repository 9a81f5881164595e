"""The command line ``swath-sysid``: one verb a module of this room.

A verb's module has ``run(arguments) -> int``, and is imported only when it is asked for; flags.yaml has its flags.
"""

import importlib
import os
import re
import shutil
import signal
import sys
import textwrap
from argparse import Action, ArgumentParser, HelpFormatter, RawDescriptionHelpFormatter, _SubParsersAction
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout, suppress
from types import ModuleType
from typing import Any, NoReturn

from swath_sysid import __version__
from swath_sysid.cli.flags import SHARED, add_arguments, examples_of, table_of_verbs
from swath_sysid.cli.standard_input import standard_input_as_file
from swath_sysid.common.accelerator import why_uncached
from swath_sysid.common.advice import did_you_mean, with_flags
from swath_sysid.common.errors import DONE, NOTHING_DONE, PARTLY_DONE, InputError

#: Before the script of argcomplete, for bash and zsh: what a zsh without completions of its own lacks.
ZSH_READY = '[ -z "$ZSH_VERSION" ] || command -v compdef >/dev/null || { autoload -U compinit && compinit; }'

VERBS = {verb: entry['summary'] for verb, entry in table_of_verbs().items() if verb != SHARED}


class OneSentenceParser(ArgumentParser):
    """A parser whose errors are one sentence, as those of everything else."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        # no flag begins with a digit: -1,2 is a list, and its reader says what is wrong with it
        self._negative_number_matcher = re.compile(r'-\.?\d')

    def error(self, message: str) -> NoReturn:
        """Leave the sentence to `main`."""
        message = re.sub('^argument ', '', message)
        message = re.sub(r': expected (one|at least one) argument$', ' needs a value', message)
        message = re.sub(r': expected (\d+) arguments$', r' needs \1 values', message)
        message = re.sub('^the following arguments are required: ', 'these are missing: ', message)
        raise InputError(f'{message}; see {self.prog} --help')

    def parse_known_args(self, *args: Any, **options: Any) -> Any:
        """Refuse what is unknown here, where the verb and its flags are known."""
        found, unknown = super().parse_known_args(*args, **options)
        if unknown:
            flags = [flag for action in _actions_of(self) for flag in action.option_strings]
            self.error(f"there is no argument '{unknown[0]}'{did_you_mean(unknown[0].partition('=')[0], flags)}")
        return found, unknown

    def _check_value(self, action: Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            of = action.option_strings[0] if action.option_strings else str(action.metavar or action.dest).lower()
            choices = list(map(str, action.choices))
            raise InputError(
                f"there is no {of} '{value}'{did_you_mean(str(value), choices)}: choose from {', '.join(choices)}"
            )


def _actions_of(parser: ArgumentParser) -> list[Action]:
    """The arguments of a parser and of its sub-verbs."""
    actions = list(parser._actions)
    for action in parser._actions:
        if isinstance(action, _SubParsersAction):
            actions += [each for sub in action.choices.values() for each in _actions_of(sub)]
    return actions


def build_parser(verb: str | None) -> ArgumentParser:
    """Parser of the command line, with the arguments of one verb filled in."""
    parser = OneSentenceParser(
        prog='swath-sysid', description='Record, identify and forecast the motion of small craft.'
    )
    parser.add_argument('--version', action='version', version=f'swath_sysid {__version__}')
    parser.add_argument(
        '--completion',
        action='store_true',
        help='print the script that completes verbs and flags in bash and zsh: eval "$(swath-sysid --completion)"',
    )
    verbs = parser.add_subparsers(dest='verb', metavar='VERB', required=True)
    for name, summary in VERBS.items():
        sub = verbs.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + '.')
        if name == verb:
            add_arguments(sub, name)
            epilog = sub.epilog or ''
            if sub.formatter_class is HelpFormatter:
                sub.formatter_class = RawDescriptionHelpFormatter
                epilog = textwrap.fill(epilog, shutil.get_terminal_size().columns - 2)
            sub.epilog = f'{epilog.rstrip()}\n\n{examples_of(name)}'.lstrip()
    return parser


def module_of(verb: str) -> ModuleType:
    """Module of a verb."""
    room = table_of_verbs()[verb].get('room', 'cli')
    return importlib.import_module(f'swath_sysid.{room}.{verb.replace("-", "_")}')


class _LostError(Exception):
    """A standard stream cannot be written."""


class _Checked:
    """A standard stream whose failures are told from those of files."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        return self._done(self._stream.write, text)

    def flush(self) -> None:
        self._done(self._stream.flush)

    def _done(self, function: Callable, *arguments: str) -> Any:
        try:
            return function(*arguments)
        except OSError as error:
            # what it still holds goes nowhere, or the end of the process would fail too
            with open(os.devnull, 'w') as nowhere:
                os.dup2(nowhere.fileno(), self._stream.fileno())
            raise _LostError(error.strerror) from error


def main(argv: list[str] | None = None, begin: Callable[[], None] = lambda: None) -> int:
    """Run the command line; returns the exit code. ``begin`` is called before anything is done."""
    output, errors = (stream and _Checked(stream) for stream in (sys.stdout, sys.stderr))
    try:
        with redirect_stdout(output), redirect_stderr(errors):
            try:
                return _carried_out(sys.argv[1:] if argv is None else argv, begin)
            finally:
                # most of what was printed is written only now
                if output:
                    output.flush()
    except _LostError as error:
        with suppress(_LostError):
            print(f'swath-sysid: standard output cannot be written ({error}): redirect it elsewhere', file=errors)
        return PARTLY_DONE
    except KeyboardInterrupt:
        return 128 + signal.SIGINT


def _argcomplete() -> ModuleType:
    try:
        import argcomplete
    except ImportError as error:
        raise InputError(
            'completion needs argcomplete, which is not installed: pip install argcomplete, or apt install '
            'python3-argcomplete'
        ) from error
    return argcomplete


def _verb_of(words: list[str]) -> str | None:
    return next((word for word in words if not word.startswith('-')), None)


def _carried_out(argv: list[str], begin: Callable[[], None]) -> int:
    verb = _verb_of(argv)
    try:
        if '_ARGCOMPLETE' in os.environ:  # by a shell, which asks what may come next on its line: this ends the process
            _argcomplete().autocomplete(build_parser(_verb_of(os.environ['COMP_LINE'].split()[1:])))
        if argv == ['--completion']:
            print(f'{ZSH_READY}\n{_argcomplete().shellcode(["swath-sysid"])}')
            return DONE
        arguments = build_parser(verb).parse_args(argv or ['--help'])
        run = module_of(arguments.verb).run
        begin()
        from swath_sysid.cli.progress import IS_QUIET

        IS_QUIET.set(getattr(arguments, 'quiet', False))
        with standard_input_as_file(arguments):
            return run(arguments)
    except InputError as error:
        program = f'swath-sysid {verb}' if verb in VERBS else 'swath-sysid'
        print(f'{program}: {with_flags(error.code, str(error))}', file=sys.stderr)
        return NOTHING_DONE
    finally:
        # nodes, which rclpy is loaded for, log it
        if 'rclpy' not in sys.modules and (uncached := why_uncached()):
            from swath_sysid.cli.progress import show_advice

            show_advice([uncached])


if __name__ == '__main__':
    sys.exit(main())
