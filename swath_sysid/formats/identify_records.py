"""Records identified, whatever they are given as, and their models kept in a file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from swath_sysid import __version__
from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.at_sea import AtSeaIdentification, SeaRecord, identify_seas, prior_of
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
Fitted = Identification | AtSeaIdentification | IdentifiedModel


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
    read, axis = _read(records, axis)
    problem = prepare([_motion_of(each, axis) for each in read], settings.start, settings.end)
    return identify_problem(problem, settings, progress=progress, should_cancel=should_cancel)


def identify_at_sea(
    records: Record | Sequence[Record],
    *,
    axis: str | None = None,
    model: IdentifiedModel | None = None,
    progress: Progress | None = None,
    should_cancel: ShouldCancel | None = None,
) -> AtSeaIdentification:
    """Identify natural period and equivalent linear damping of one axis from motion in waves.

    Several records of one craft, and parts of a record on several headings, share the hull but not the waves.

    Args:
        records: Whole records in waves, as of `identify`; a trial is divided where its yaw rate shows a turn.
        axis: As of `identify`.
        model: Of an earlier release, from which another loading may differ.
        progress: Called with 0 to 1.
        should_cancel: Asked often; True raises `Cancelled`.

    Returns:
        The equivalent linear hull; its ``is_usable`` and ``advice`` tell whether the waves determine it.

    Raises:
        InputError: The records are too short or cannot be used; the sentence says why.
        Cancelled: ``should_cancel`` returned True.

    Example:
        >>> buoy = read_trial(records / 'morro_buoy.csv', frame='frd')
        >>> found = identify_at_sea([buoy.between(None, 180.0), buoy.between(180.0, None)], axis='pitch')
        >>> f'{found.natural_period:.1f} s, usable: {found.is_usable}'
        '2.3 s, usable: False'
    """
    read, axis = _read(records, axis)
    seas = [SeaRecord.of(each, axis) if isinstance(each, Trial) else SeaRecord(each) for each in read]
    prior = None if model is None else prior_of(model, seas[0].motion)
    return identify_seas(seas, prior, progress=progress, should_cancel=should_cancel)


def _read(records: Record | Sequence[Record], axis: str | None) -> tuple[list[Trial | AxisMotion], str]:
    """Records, and the axis that all of them are asked for."""
    given = [records] if isinstance(records, Record) else records
    read = [each if isinstance(each, Trial | AxisMotion) else read_trial(each) for each in given]
    if not read:
        raise InputError('give at least one trial')
    for each in read:
        if isinstance(each, AxisMotion) and axis not in (None, each.axis):
            raise InputError(f'{each.source or "a motion"} is about {each.axis}, not {axis}: give records of one axis')
    return read, axis or _axis_of(read[0])


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
        models: What `identify`, `identify_at_sea` or `read_model` gave: one axis, or several by axis, ``roll`` and
            ``pitch``.

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
    motions = fitted.problem.motions if isinstance(fitted, Identification) else fitted.motions
    # of a bag the source names the topic, too
    sources = dict.fromkeys(motion.source.partition(' /')[0] for motion in motions if motion.source)
    return fitted.identified_model(provenance_of(list(sources)))


def provenance_of(sources: Sequence[str]) -> dict:
    """Sources of a model, files with their hashes, and the software version."""
    files = ({'file': s, 'sha256': source_hash(s)} if Path(s).exists() else {'file': s} for s in map(str, sources))
    return {'software': f'swath_sysid {__version__}', 'sources': list(files)}
