"""The command line ``swath-sysid``: one verb a module of this room.

A verb's module has ``add_arguments(parser)`` and ``run(arguments) -> int``; it is imported only
when it is asked for.
"""

import importlib
import re
import sys
from argparse import ArgumentParser
from types import ModuleType
from typing import Any, NoReturn

from swath_sysid import __version__
from swath_sysid.common.errors import InputError
from swath_sysid.common.sentences import with_flags

VERBS = {
    'identify': 'identify a hull model from decays, or from motion in waves',
    'compare': 'fit many equations and choose the simplest adequate one',
    'simulate': 'simulate a trial with known truth, as an IMU would have recorded it',
    'campaign': 'process a whole trial matrix into tables, figures and a model scheduled on draft',
    'paper': 'repeat a published study, with printed and obtained values side by side',
    'scale': "convert a model to another scale, by Froude's law",
    'manoeuvre': 'identify, forecast and simulate a twin-thruster craft in surge, sway and yaw',
    'export': "export an identified model to Gazebo, VRX, Nav2 or Fossen's form",
    'forecast': 'score the forecasts of a record against baselines',
    'sea': "estimate height, periods and axis of the waves from the craft's own motion",
    'inspect': 'show what is in a record: sample rates, gaps, decays, quality',
    'play-through': 'write what the nodes would publish for a record, as fast as the machine can',
    'run': 'run imu_buffer, identifier and predictor in one process',
    'page': 'show the nodes in a browser: health, forecasts, a guided bring-up',
    'replay': 'publish the topics of a bag over ROS',
    'record': 'record the topics of these nodes to a bag',
    'demo': 'forecast measured waves, then identify and forecast a simulated craft with the nodes',
}
EXIT_INPUT = 2
EXIT_INTERRUPTED = 130


class OneSentenceParser(ArgumentParser):
    """A parser whose errors are one sentence, as those of everything else."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        # no flag begins with a digit: -1,2 is a list, and its reader says what is wrong with it
        self._negative_number_matcher = re.compile(r'-\.?\d')

    def error(self, message: str) -> NoReturn:
        """Leave the sentence to `main`."""
        raise InputError(f'{message}; see {self.prog} --help')


def build_parser(verb: str | None) -> ArgumentParser:
    """Parser of the command line, with the arguments of one verb filled in."""
    parser = OneSentenceParser(
        prog='swath-sysid', description='Record, identify and forecast the motion of small craft.'
    )
    parser.add_argument('--version', action='version', version=f'swath_sysid {__version__}')
    verbs = parser.add_subparsers(dest='verb', metavar='VERB', required=True)
    for name, summary in VERBS.items():
        sub = verbs.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + '.')
        if name == verb:
            module_of(name).add_arguments(sub)
    return parser


def module_of(verb: str) -> ModuleType:
    """Module of a verb."""
    return importlib.import_module(f'swath_sysid.cli.{verb.replace("-", "_")}')


def main(argv: list[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    argv = sys.argv[1:] if argv is None else argv
    verb = next((word for word in argv if not word.startswith('-')), None)
    try:
        arguments = build_parser(verb).parse_args(argv or ['--help'])
        return module_of(arguments.verb).run(arguments)
    except InputError as error:
        program = f'swath-sysid {verb}' if verb in VERBS else 'swath-sysid'
        print(f'{program}: {with_flags(error.code, str(error))}', file=sys.stderr)
        return EXIT_INPUT
    except KeyboardInterrupt:
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return 0


if __name__ == '__main__':
    sys.exit(main())
