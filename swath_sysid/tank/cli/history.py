"""``swath-sysid history``: period, damping and GM of one craft over days, from its records or model files."""

import re
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from datetime import UTC, datetime
from pathlib import Path

from swath_sysid import __version__
from swath_sysid.attitude.identification.at_sea import SeaRecord, identify_seas
from swath_sysid.attitude.identification.identify import identify_problem
from swath_sysid.attitude.identification.problem import decays_or_waves
from swath_sysid.attitude.identification.result import IdentificationSettings
from swath_sysid.attitude.motion.sensor_checks import TILT_CODES, refuse_contradictions
from swath_sysid.attitude.motion.trial import Trial, axis_in_words
from swath_sysid.cli.identify import check_positive
from swath_sysid.cli.progress import print_result, show_advice
from swath_sysid.cli.sources import columns_of, read_record, without_copies
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import ADEQUATE, DOUBTFUL
from swath_sysid.common.errors import DONE, PARTLY_DONE, InputError, of_file
from swath_sysid.formats.bags import is_bag, opened_bag
from swath_sysid.formats.files import write_text
from swath_sysid.formats.model_file import model_from_yaml, model_to_yaml, read_model
from swath_sysid.formats.outputs import MODEL_ENDINGS, Output, check_outputs
from swath_sysid.formats.reading import source_hash
from swath_sysid.report.figures import save_figure
from swath_sysid.report.html_page import Drawing, figures, page, page_style, paragraph, table_as_html
from swath_sysid.report.tables import table_as_csv, table_as_data
from swath_sysid.tank.campaign.history import Logged, changes_in, entries_of
from swath_sysid.tank.campaign.proposal import may_be_trial
from swath_sysid.tank.campaign.trials import RESULT_FORMAT
from swath_sysid.tank.campaign.work import ResultStore, Task, Work, key_of
from swath_sysid.tank.cli.kept_work import kept_work, said_to_continue
from swath_sysid.tank.report.history_report import history_figure, history_sentences, history_table

READ_AT_ONCE = 4  #: Records held for each process.
ON_CLUSTER = 16  #: Processes that a cluster is taken to have.
FIRST_DATE = 1e9  #: s since 1970; a stamp before has no date, as of a clock that was not set.
#: A date in the name of a record, as ``rosbag2_2026_11_27-10_15_00``, ``20261127T1015`` or ``2026-11-27``.
DATE = re.compile(
    r'(?<!\d)(20\d\d)([-_.]?)([01]\d)\2([0-3]\d)(?:[-_T ]?([0-2]\d)[-_:.h]?([0-5]\d)(?:[-_:.]?([0-5]\d))?)?(?!\d)'
)


def run(arguments: Namespace) -> int:
    """Identify every record, and report what changed."""
    with said_to_continue():
        return _followed(arguments)


def _followed(arguments: Namespace) -> int:
    check_positive(arguments, ('gm',))
    paths, advice = without_copies([str(each) for given in arguments.records for each in _records_of(Path(given))])
    folder = Path(arguments.output)
    check_outputs([Output('--output', arguments.output, is_folder=True)], paths)
    with kept_work('history', folder, arguments) as (store, executor, progress):
        log, left_out, sensors = _logged(paths, arguments, store, executor, progress)
    left_out += [f'{each.message}' for each in advice]
    if not log:
        raise InputError(f'no record can be used: {left_out[0]}')
    entries, amplitude = entries_of(log)
    found = changes_in(entries)
    table = history_table(entries, found, amplitude, arguments.gm)
    axis = next((each['axis'] for each in sensors if each['axis'] != arguments.axis), arguments.axis)
    said = history_sentences(entries, found, axis, arguments.gm)
    show_advice(dict.fromkeys(Advice(*each) for sensor in sensors for each in sensor['tilts']))
    with page_style():
        picture = history_figure(entries, found, arguments.axis)
        drawing = Drawing('history', f'Natural period and equivalent damping ratio, {arguments.axis}', picture)
        save_figure(picture, folder / 'history.svg')
        lines = [paragraph(f'Left out: {line}', 'left-out') for line in left_out]
        sections = [
            ('changes', 'Changes', [*map(paragraph, said), figures([drawing])]),
            ('entries', 'Entries', [table_as_html(table), *lines]),
        ]
        write_text(folder / 'history.html', page(f'History of {arguments.axis}', sections))
    write_text(folder / 'history.csv', table_as_csv(table))
    report = str(folder / 'history.html')
    changes = [
        {'quantity': each.quantity, 'first_after': entries[each.places[change.place]].name, 'factor': step}
        for each in found
        for change, step in zip(each.changes, each.steps, strict=True)
    ]
    data = {'entries': table_as_data(table), 'changes': changes, 'left_out': left_out, 'report': report}
    print_result(arguments.json, data, [*(f'left out: {line}' for line in left_out), report], said)
    return PARTLY_DONE if left_out else DONE


def _records_of(given: Path) -> Iterator[Path]:
    """A record or model file itself, or those in a folder."""
    if given.is_dir() and not is_bag(given):
        found = [each for each in sorted(given.iterdir()) if may_be_trial(each) or each.suffix[1:] in MODEL_ENDINGS]
        if not found:
            raise InputError(f'{given} holds no record and no model file')
        yield from found
    else:
        yield given


def _logged(
    paths: Sequence[str], arguments: Namespace, store: ResultStore, executor: Executor, progress: Callable
) -> tuple[list[Logged], list[str], list[dict]]:
    """The models of the records, which are read some at a time, what was left out, and how the sensors are mounted."""
    log, left_out, sensors = [], [], []
    work = Work(store, executor, lambda at: progress(at.done / len(paths), '; '.join(at.running[:2])))
    size = READ_AT_ONCE * (arguments.jobs if arguments.scheduler is None else ON_CLUSTER)
    stated = arguments.params_file and source_hash(arguments.params_file)
    how = arguments.axis, arguments.frame, arguments.mounting, arguments.topic, columns_of(arguments), stated
    for start in range(0, len(paths), size):
        tasks: dict[str, Task] = {}
        for path in paths[start : start + size]:
            try:
                if Path(path).suffix[1:] in MODEL_ENDINGS:
                    model = read_model(path)[arguments.axis]
                    log.append(Logged(Path(path).name, _date_in(path), str(model.verdict or ADEQUATE), model))
                    continue
                key = key_of('history', RESULT_FORMAT, __version__, source_hash(path), how)
                what = (
                    ()
                    if store.get(key) is not None
                    else (read_record(path, arguments), arguments.axis, _start_of(path))
                )
                tasks[path] = Task(key, Path(path).name, hull_of, what)
            except KeyError:
                left_out.append(f'{path} has no {arguments.axis} model')
            except InputError as error:
                left_out.append(of_file(path, str(error)))
        results = work.results(list(tasks.values()))
        for path, task in tasks.items():
            if task.key in results:
                began, verdict, text, sensor = results[task.key]
                sensors.append(sensor)
                log.append(Logged(task.label, began or _date_in(path), verdict, model_from_yaml(text)[arguments.axis]))
    return log, [*left_out, *work.failures], sensors


def hull_of(trial: Trial, axis: str, began: float | None) -> list:
    """Start, s since 1970, verdict and model file of one record, of its decays or of its motion in waves, and what is
    to be said of the mounting of its sensor.
    """
    refuse_contradictions(trial, axis)
    tilts = [(each.code, each.message) for each in trial.advice if each.code in TILT_CODES]
    sensor = {'axis': axis_in_words(axis, trial.installation), 'tilts': tilts}
    problem = decays_or_waves([trial.axis(axis)])
    if problem is None:
        sea = identify_seas([SeaRecord.of(trial, axis)])
        return [began, ADEQUATE if sea.is_usable else DOUBTFUL, model_to_yaml({axis: sea.identified_model({})}), sensor]
    found = identify_problem(problem, IdentificationSettings())
    return [began, found.verdict.level, model_to_yaml({axis: found.identified_model({})}), sensor]


def _start_of(path: str) -> float | None:
    """When the first message of a bag was received, s since 1970, by a clock that was set."""
    if not is_bag(path):
        return None
    with opened_bag(path) as (readers, _):
        first = next((each for reader in readers for each in reader.messages(reader.connections)), None)
    began = 0.0 if first is None else first[1] * 1e-9
    return began if began > FIRST_DATE else None


def _date_in(path: str) -> float | None:
    match = DATE.search(Path(path).stem)
    if match is None:
        return None
    year, _, *rest = match.groups()
    try:
        month, day, hour, minute, second = (int(each or 0) for each in rest)
        return datetime(int(year), month, day, hour, minute, second, tzinfo=UTC).timestamp()
    except ValueError:
        return None
