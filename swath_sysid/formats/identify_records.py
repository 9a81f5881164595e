"""Records identified, whatever they are given as, and their models kept in a file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from swath_sysid import __version__
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.identify import identify_problem
from swath_sysid.attitude.identification.problem import prepare
from swath_sysid.attitude.identification.result import Identification, IdentificationSettings
from swath_sysid.attitude.motion.sensor_checks import refuse_contradictions
from swath_sysid.attitude.motion.trial import AxisMotion, Trial
from swath_sysid.common.cancelling import Progress, ShouldCancel
from swath_sysid.common.errors import InputError
from swath_sysid.formats import model_file
from swath_sysid.formats.reading import read_trial, source_hash

Record = Trial | AxisMotion | str | Path
Fitted = Identification | IdentifiedModel


def identify(
    records: Record | Sequence[Record],
    settings: IdentificationSettings = IdentificationSettings(),  # noqa: B008 - frozen
    *,
    axis: str | None = None,
    progress: Progress | None = None,
    should_cancel: ShouldCancel | None = None,
) -> Identification:
    """Identify the decay model of one axis from one or several records.

    A genetic search finds the start, and least squares on the simulated motion refines it. Where the equation has the
    terms that the motion shows, a likelihood that allows for residual motion of the basin refines it further.

    Args:
        records: Whole records, as paths, trials or the motion of one axis. The free decays in each are found, unless
            the settings give the bounds of one.
        settings: What to fit and how.
        axis: ``roll`` or ``pitch``; it may be left out where the first record shows only one of them.
        progress: Called with 0 to 1.
        should_cancel: Asked often; True raises `Cancelled`.

    Returns:
        The model with its uncertainty; its ``verdict`` tells whether it can be used.

    Raises:
        InputError: The records cannot be used; the sentence says why.
        Cancelled: ``should_cancel`` returned True.

    Example:
        >>> found = identify(records / 'kvlcc2_roll_decay.csv', axis='roll')
        >>> f'{found.model.natural_period:.2f} s, {found.verdict.level}'
        '2.55 s, adequate'
    """
    given = [records] if isinstance(records, Record) else records
    read = [each if isinstance(each, Trial | AxisMotion) else read_trial(each) for each in given]
    for each in read:
        if isinstance(each, AxisMotion) and axis not in (None, each.axis):
            raise InputError(f'{each.source or "a motion"} is about {each.axis}, not {axis}: give records of one axis')
    if axis is None and read:
        axis = _axis_of(read[0])
    problem = prepare([_motion_of(each, axis or '') for each in read], settings.start, settings.end)
    return identify_problem(problem, settings, progress=progress, should_cancel=should_cancel)


def _axis_of(record: Trial | AxisMotion) -> str:
    """The axis of a record that shows only one."""
    axes = (record.axis,) if isinstance(record, AxisMotion) else record.axes
    if len(axes) != 1:
        shown = ' and '.join(axes) or 'neither roll nor pitch'
        raise InputError(f"{record.source or 'the trial'} holds {shown}: name the axis to identify, as in axis='roll'")
    return axes[0]


def _motion_of(record: Trial | AxisMotion, axis: str) -> AxisMotion:
    if isinstance(record, Trial):
        refuse_contradictions(record, axis, lags=False)
        return record.axis(axis)
    return record


def write_model(path: str | Path, models: Fitted | Mapping[str, Fitted]) -> None:
    """Write a model file (YAML), whole or not at all.

    Args:
        path: Of the file; one that exists is replaced.
        models: What `identify` or `read_model` gave: one axis, or several by axis, ``roll`` and ``pitch``.

    Raises:
        InputError: It cannot be written, or would be rejected by its readers.

    Example:
        >>> write_model('tanker.yaml', identify(records / 'kvlcc2_roll_decay.csv', axis='roll'))
        >>> read_model('tanker.yaml')['roll'].verdict
        'adequate'
    """
    by_axis = {models.model.axis: models} if isinstance(models, Fitted) else models
    model_file.write_model(path, {axis: _identified(fitted) for axis, fitted in by_axis.items()})


def _identified(fitted: Fitted) -> IdentifiedModel:
    if isinstance(fitted, IdentifiedModel):
        return fitted
    # of a bag the source names the topic, too
    sources = dict.fromkeys(motion.source.partition(' /')[0] for motion in fitted.problem.motions if motion.source)
    return fitted.identified_model(provenance_of(list(sources)))


def provenance_of(sources: Sequence[str]) -> dict:
    """Sources of a model, files with their hashes, and the software version."""
    files = ({'file': s, 'sha256': source_hash(s)} if Path(s).exists() else {'file': s} for s in map(str, sources))
    return {'software': f'swath_sysid {__version__}', 'sources': list(files)}
