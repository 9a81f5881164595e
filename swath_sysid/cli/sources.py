"""Arguments and reading of records, shared by the verbs that take them."""

import os
from argparse import Namespace
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel, check_mounting
from swath_sysid.attitude.identification.problem import Problem
from swath_sysid.attitude.motion.attitude import FRAMES
from swath_sysid.attitude.motion.segmentation import find_decays
from swath_sysid.attitude.motion.sensor_checks import refuse_contradictions
from swath_sysid.attitude.motion.trial import AXES, Trial
from swath_sysid.cli.flags import finite
from swath_sysid.cli.progress import progress_of, show_advice
from swath_sysid.cli.standard_input import STANDARD_INPUT
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.columns import DEVICE
from swath_sysid.formats.files import BLOCK_BYTES, existing
from swath_sysid.formats.identify_records import provenance_of
from swath_sysid.formats.model_file import read_model, write_model
from swath_sysid.formats.outputs import MODEL_ENDINGS, Output, check_outputs
from swath_sysid.formats.reading import read_trial, source_hash
from swath_sysid.nodes.parameters.parameter_files import values_from_file
from swath_sysid.nodes.parameters.settings import installation
from swath_sysid.report.figures import FORMATS, Figure, save_figure


def columns_of(arguments: Namespace) -> dict[str, str]:
    """The assigned columns by quantity, and the chosen device."""
    for text in arguments.columns:
        if not all(text.partition('=')):
            raise InputError(f"--column '{text}' is not QUANTITY=NAME:UNIT: write, for example, --column roll=Phi:deg")
    assigned = {quantity.strip(): source for quantity, _, source in (text.partition('=') for text in arguments.columns)}
    return assigned if arguments.device is None else {**assigned, DEVICE: arguments.device}


def assignment(text: str, example: str) -> tuple[str, float]:
    """Name and value of ``NAME=VALUE``; the error shows the example."""
    name, _, value = text.partition('=')
    try:
        return name.strip(), finite(value)
    except ValueError as error:
        raise InputError(f"'{text}' is not NAME=VALUE: write, for example, {example}") from error


def check_model_and_plot(arguments: Namespace, inputs: Sequence[str | None]) -> None:
    """Refuse a model file (``--output``) and a picture (``--plot``) that cannot be written, before any work."""
    check_outputs(
        [
            Output('--output', getattr(arguments, 'output', None), endings=MODEL_ENDINGS),
            Output('--plot', arguments.plot, endings=FORMATS),
        ],
        inputs,
    )


def installation_of(arguments: Namespace, node: str = 'predictor') -> dict[str, Any]:
    """Frame and mounting that the command line states, else its parameter file; None: as the record does."""
    given = installation(values_from_file(arguments.params_file, node))
    frame = getattr(arguments, 'frame', None) or (None if given.frame == FRAMES[0] else given.frame)
    return {'frame': frame, 'mounting': arguments.mounting or given.mounting}


def read_record(path: str, arguments: Namespace) -> Trial:
    """Read one record as the command line says, with progress where it is long."""
    how = {'topic': arguments.topic, 'columns': columns_of(arguments), **installation_of(arguments)}
    if not os.path.isfile(path) or os.path.getsize(path) < BLOCK_BYTES:
        return read_trial(path, **how)
    with progress_of(f'reading {path}') as progress:
        return read_trial(path, **how, progress=progress)


def read_models(path: str, trial: Trial) -> dict[str, IdentifiedModel]:
    """The models of a file, which were identified with the mounting of the record."""
    models = read_model(path)
    check_mounting(models, trial.installation)
    return models


def read_trials(paths: Sequence[str], arguments: Namespace) -> tuple[list[Trial], tuple[Advice, ...]]:
    """Read the trials of the command line and show all advice on them; of identical files the first counts."""
    once, advice = without_copies(paths)
    trials = [read_record(path, arguments) for path in once]
    advice = tuple(dict.fromkeys([*advice, *(a for t in trials for a in t.advice)]))
    show_advice(advice)
    return trials, advice


def refuse_twice(paths: Sequence[str]) -> None:
    """Refuse a command line that names a record more than once."""
    twice = {str(path) for path in paths if paths.count(path) > 1}
    if twice:
        raise InputError(f'{sorted(twice)[0]} is given twice: name each record once')


def without_copies(paths: Sequence[str]) -> tuple[list[str], tuple[Advice, ...]]:
    """The paths of which the content is that of none before, and advice about the others."""
    refuse_twice(paths)
    if len(paths) < 2:
        return list(paths), ()
    first: dict[str, str] = {}
    advice = []
    for path in paths:
        original = first.setdefault(source_hash(existing(path)), path)
        if original is not path:
            advice.append(Advice.of('identical-files', path=path, original=original))
    return list(first.values()), tuple(advice)


def trials_of(arguments: Namespace) -> tuple[list[Trial], tuple[Advice, ...], str]:
    """The records of a fit, the advice on them, and the axis; outputs are checked before, contradictions refused."""
    check_model_and_plot(arguments, [*arguments.trials, getattr(arguments, 'model', None)])
    trials, advice = read_trials(arguments.trials, arguments)
    # the one that moves more in the first trial
    first = trials[0]
    axis = arguments.axis or max(first.axes or AXES[:1], key=lambda axis: float(np.ptp(first.axis(axis).primary)))
    for trial in trials:
        refuse_contradictions(trial, axis, lags=False)
    return trials, advice, axis


def write_fit(arguments: Namespace, found: Any, draw: Callable[[Any], 'Figure'], is_usable: bool) -> list[str]:
    """Write the model file of a fit that is usable, and its picture, where asked for; a line on each written file."""
    written = []
    if arguments.output and is_usable:
        provenance = provenance_of(without_copies(arguments.trials)[0])
        for source in provenance['sources']:
            if os.path.basename(source['file']) == STANDARD_INPUT:
                source['file'] = STANDARD_INPUT
        identified = found.identified_model(provenance)
        write_model(arguments.output, {found.model.axis: identified})
        written.append(f'wrote the model file {arguments.output}')
    if arguments.plot:
        save_figure(draw(found), arguments.plot)
        written.append(f'wrote the picture {arguments.plot}')
    return written


def decays_of_other_axes(trials: Sequence[Trial], problem: Problem) -> tuple[Advice, ...]:
    """Advice on free decays about another axis of the trials at other times than the decays of a problem."""
    used = {
        trial.source: [s for s, m in zip(problem.segments, problem.motions, strict=True) if m.source == trial.source]
        for trial in trials
    }
    return tuple(
        Advice.of('decay-of-other-axis', source=trial.source, axis=other, start=decay.start, end=decay.end)
        for trial in trials
        for other in trial.axes
        if other != problem.axis
        for decay in find_decays(trial.axis(other))[:1]
        if all(decay.start > segment.end or decay.end < segment.start for segment in used[trial.source])
    )
