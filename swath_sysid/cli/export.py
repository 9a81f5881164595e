"""``swath-sysid export``: an identified model in the words of simulators and controllers."""

from argparse import ArgumentParser, Namespace

from swath_sysid.cli.progress import show_advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.atomic import replacing
from swath_sysid.formats.export.expressible import Export
from swath_sysid.formats.export.fossen import fossen, fossen_attitude
from swath_sysid.formats.export.gazebo import gazebo, gazebo_attitude
from swath_sysid.formats.export.nav2 import nav2
from swath_sysid.formats.export.vrx import vrx
from swath_sysid.formats.manoeuvring_model_file import read_manoeuvring_model
from swath_sysid.formats.model_file import FORMAT, read_model
from swath_sysid.formats.outputs import Output, check_outputs

TARGETS = {'gazebo': gazebo, 'vrx': vrx, 'nav2': nav2, 'fossen': fossen}
ATTITUDE_TARGETS = {'gazebo': gazebo_attitude, 'fossen': fossen_attitude}
SNIFFED_BYTES = 4096


def add_arguments(parser: ArgumentParser) -> None:
    """The model file, the target, and where to write."""
    parser.add_argument('model', metavar='MODEL.yaml', help='model file of manoeuvre identify, or of identify')
    parser.add_argument('--to', required=True, choices=tuple(TARGETS), help='who is to read it')
    parser.add_argument(
        '--inertia',
        action='append',
        default=[],
        metavar='AXIS=KG_M2',
        help='of roll or pitch models, with added inertia: roll=0.08',
    )
    parser.add_argument('--output', metavar='FILE', help='write it there instead of printing it')


def run(arguments: Namespace) -> int:
    """Export, warn, and write or print."""
    check_outputs([Output('--output', arguments.output)], [arguments.model])
    found = _exported(arguments)
    show_advice(found.advice)
    if arguments.output is None:
        print(found.text, end='')
        return 0
    with replacing(arguments.output) as temporary:
        temporary.write_text(found.text, encoding='utf-8')
    print(f'{arguments.output} written')
    return 0


def _exported(arguments: Namespace) -> Export:
    inertias = dict(_inertia(text) for text in arguments.inertia)
    if _is_attitude(arguments.model):
        if arguments.to not in ATTITUDE_TARGETS:
            raise InputError(f'{arguments.to} takes no roll or pitch model: choose {" or ".join(ATTITUDE_TARGETS)}')
        return ATTITUDE_TARGETS[arguments.to](read_model(arguments.model), inertias)
    if inertias:
        raise InputError('--inertia is for roll and pitch models: a manoeuvring model has its own, leave it out')
    return TARGETS[arguments.to](read_manoeuvring_model(arguments.model).model)


def _is_attitude(path: str) -> bool:
    """Whether a file begins as a decay model; what cannot be read is left to the reader's sentence."""
    try:
        with open(path, 'rb') as file:
            return FORMAT.format.encode() in file.read(SNIFFED_BYTES)
    except (OSError, ValueError):
        return False


def _inertia(text: str) -> tuple[str, float]:
    axis, _, number = text.partition('=')
    try:
        value = float(number)
    except ValueError:
        value = float('nan')
    if axis not in ('roll', 'pitch') or not 0.0 < value < float('inf'):
        raise InputError(f"--inertia '{text}' is not understood: give roll=KG_M2 or pitch=KG_M2, greater than zero")
    return axis, value
