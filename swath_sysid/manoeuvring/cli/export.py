"""``swath-sysid export``: an identified model in the words of simulators and controllers."""

from argparse import Namespace
from pathlib import Path
from typing import Any

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.cli.progress import print_result, show_advice
from swath_sysid.cli.sources import assignment
from swath_sysid.common.errors import InputError
from swath_sysid.formats.files import write_text
from swath_sysid.formats.model_file import FORMAT, read_model
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.formats.schema import text_of
from swath_sysid.manoeuvring.formats.export.expressible import Export
from swath_sysid.manoeuvring.formats.export.fossen import MATLAB, PYTHON, fossen, fossen_attitude
from swath_sysid.manoeuvring.formats.export.gazebo import gazebo, gazebo_attitude
from swath_sysid.manoeuvring.formats.export.nav2 import nav2
from swath_sysid.manoeuvring.formats.export.vrx import vrx
from swath_sysid.manoeuvring.formats.model_file import read_manoeuvring_model
from swath_sysid.report.fit_summary import warnings_as_data

GAZEBO, VRX, NAV2, FOSSEN = TARGETS = ('gazebo', 'vrx', 'nav2', 'fossen')
ATTITUDE_TARGETS = (GAZEBO, FOSSEN)


def run(arguments: Namespace) -> int:
    """Export, warn, and write or print."""
    check_outputs([Output('--output', arguments.output)], [arguments.model])
    found = _exported(arguments)
    show_advice(found.advice)
    data: dict[str, Any] = {'target': arguments.to, 'text': found.text, **warnings_as_data(found.advice)}
    if arguments.output is None:
        print_result(arguments.json, data, [found.text.removesuffix('\n')])
        return 0
    write_text(arguments.output, found.text)
    print_result(arguments.json, {**data, 'file': arguments.output}, [f'{arguments.output} written'])
    return 0


def _exported(arguments: Namespace) -> Export:
    target, output = arguments.to, Path(arguments.output or 'craft')
    if arguments.language and target != FOSSEN:
        raise InputError(f'--language is for --to {FOSSEN}: leave it out')
    language = arguments.language or (MATLAB if output.suffix == '.m' else PYTHON)
    inertias = dict(_inertia(text) for text in arguments.inertia)
    if _is_attitude(arguments.model):
        if target not in ATTITUDE_TARGETS:
            raise InputError(f'{target} cannot express a roll or pitch model: choose {" or ".join(ATTITUDE_TARGETS)}')
        models = read_model(arguments.model)
        _check_inertias(inertias, tuple(models))
        if target == GAZEBO:
            return gazebo_attitude(models, inertias)
        return fossen_attitude(models, inertias, language, output.stem)
    _check_inertias(inertias, ())
    identified = read_manoeuvring_model(arguments.model)
    if target == FOSSEN:
        return fossen(identified.model, language, output.stem)
    return {GAZEBO: gazebo, VRX: vrx, NAV2: nav2}[target](identified.model)


def _check_inertias(inertias: dict[str, float], axes: tuple[str, ...]) -> None:
    stray = [axis for axis in inertias if axis not in axes]
    if stray:
        raise InputError(
            f'--inertia {stray[0]} cannot be used here: it is for the axes of roll and pitch models exported '
            f'to {" or ".join(ATTITUDE_TARGETS)}; leave it out'
        )


def _is_attitude(path: str) -> bool:
    """Whether a file is a decay model; what cannot be read is left to the reader's sentence."""
    try:
        return FORMAT.format in text_of(path)
    except InputError:
        return False


def _inertia(text: str) -> tuple[str, float]:
    axis, value = assignment(text, '--inertia roll=0.08')
    if axis not in AXES or value <= 0.0:
        raise InputError(f"--inertia '{text}' is not understood: give roll=KG_M2 or pitch=KG_M2, greater than zero")
    return axis, value
