"""``swath-sysid manoeuvre``: identify, forecast and simulate a twin-thruster craft."""

import time
from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.cli import sources
from swath_sysid.cli.flags import finite
from swath_sysid.cli.identify import exit_code_of, is_to_be_written
from swath_sysid.cli.progress import print_result, progress_of, show_advice
from swath_sysid.common.errors import InputError
from swath_sysid.formats.bags import is_bag
from swath_sysid.formats.files import existing
from swath_sysid.formats.identify_records import provenance_of
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.manoeuvring.formats import bags
from swath_sysid.manoeuvring.formats.csv import read_manoeuvring_csv, write_manoeuvring_csv
from swath_sysid.manoeuvring.formats.model_file import read_manoeuvring_model, write_manoeuvring_model
from swath_sysid.manoeuvring.hull import standard_tests
from swath_sysid.manoeuvring.hull.model import PRESETS, preset
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre
from swath_sysid.manoeuvring.identification.excitation import excitation, lacking
from swath_sysid.manoeuvring.identification.identify import identify_manoeuvring
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.motion.intake import prepare_runs
from swath_sysid.manoeuvring.motion.trial import CHANNELS, COMMAND, CraftRun
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreOutlookSettings
from swath_sysid.manoeuvring.prediction.skill import calibrated, score_forecasts
from swath_sysid.manoeuvring.report import summary
from swath_sysid.manoeuvring.report.figures import forecast_figure, identification_figures, test_figure
from swath_sysid.report.figures import FORMATS, save_figure
from swath_sysid.report.fit_summary import warnings_as_data

PROGRAMME = 'programme'

SIMULATED = (*standard_tests.TESTS, PROGRAMME)
#: Fields of ``ManoeuvringSettings`` that are flags.
FLAGS = ('inertia', 'thrust_per_command', 'length', 'window', 'generations', 'population', 'seed')


def names_of_terms() -> str:
    """The end of the help of ``identify``."""
    codes = [
        'Exit code 0: done; 1: the fit was printed but rejected, so no model was written (--force',
        'writes it); 2: the input cannot be used, and one sentence says why.',
    ]
    names = ['names for --terms, --fix and --towards, with their units:', *summary.terms_in_words()]
    return '\n'.join([*codes, '', *names])


def run(arguments: Namespace) -> int:
    """Run the sub-verb; returns the exit code."""
    tasks = {
        'identify': _identify,
        'forecast': _forecast,
        'simulate': _simulate,
        'programme': _recipe,
        'play-through': _play_through,
    }
    return tasks[arguments.task](arguments)


def read_runs(paths: Sequence[str], arguments: Namespace) -> list[CraftRun]:
    """Read and prepare runs, all with one step."""
    sources.refuse_twice(paths)
    return prepare_runs([_read(path, arguments) for path in paths], arguments.gap_means_zero)


def _read(path: str | Path, arguments: Namespace):
    if is_bag(existing(path)):
        if arguments.device is not None:
            raise InputError(f'{path} is a bag, whose devices are chosen by topic: leave the device out')
        trial = bags.read_manoeuvring_bag(
            path,
            arguments.odometry_topic,
            arguments.imu_topic,
            arguments.port_topic,
            arguments.starboard_topic,
            arguments.thrust_input,
            # --frame is that of the odometry
            **sources.installation_of(Namespace(**vars(arguments) | {'frame': None}), 'manoeuvring_predictor'),
        )
        return trial if arguments.frame is None else replace(trial, frame=arguments.frame)
    if Path(path).is_dir():
        raise InputError(f'{path} is a folder but not a bag: give files of tables, or bags')
    if arguments.mounting is not None:
        raise InputError(f'{path} is a table, whose yaw rate is that of the craft: leave the mounting out')
    return read_manoeuvring_csv(path, arguments.frame, sources.columns_of(arguments))


def _identify(arguments: Namespace):
    began = time.perf_counter()
    if arguments.validate and arguments.no_validation:
        raise InputError('give --validate or --no-validation, not both')
    if arguments.seed < 0:
        raise InputError('the seed must not be negative')
    settings = ManoeuvringSettings(
        mass=arguments.mass or None,
        lever=arguments.lever or None,
        terms=tuple(arguments.terms.split(',')) if arguments.terms else None,
        fixed=dict(sources.assignment(text, 'Xu_dot=-18') for text in arguments.fix),
        towards=dict(_target(text) for text in arguments.towards),
        current=arguments.current,
        **{name: getattr(arguments, name) for name in FLAGS},
    )
    both = [*arguments.runs, *(arguments.validate or [])]
    check_outputs([Output('--output', arguments.output), Output('--plot', arguments.plot, is_folder=True)], both)
    once, copies = sources.without_copies(both)
    show_advice(copies)
    runs = read_runs(once, arguments)
    validation = None
    if arguments.validate or arguments.no_validation:
        fitted = sum(path in arguments.runs for path in once)
        runs, validation = runs[:fitted], runs[fitted:]
    with progress_of('identify') as progress:
        found = identify_manoeuvring(runs, settings, validation, progress=progress)
    data = summary.identification_as_data(found, time.perf_counter() - began)
    data['warnings'] = [*warnings_as_data(copies)['warnings'], *data['warnings']]
    if arguments.output and is_to_be_written(arguments, found.verdict.level):
        kept = ('r2', 'position_error_m', 'heading_error_rad', 'diverged_windows', 'stability')
        provenance = {**provenance_of(once), 'runs': data['runs']}
        identified = found.identified({key: data[key] for key in kept}, provenance)
        write_manoeuvring_model(arguments.output, calibrated(identified, found.identified_on))
    if arguments.plot:
        folder = Path(arguments.plot)
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in identification_figures(found, arguments.window).items():
            save_figure(figure, folder / f'{name}.png')
    # the lines of the result begin with the verdict
    told = found.verdict.warnings if arguments.json else ()
    show_advice(summary.condensed((*found.advice, *told)))
    print_result(arguments.json, data, summary.identification_in_words(found))
    return exit_code_of(arguments, found.verdict.level)


def _target(text: str):
    name, _, rest = text.partition('=')
    value, _, spread = rest.partition(':')
    try:
        target = finite(value), finite(spread)
    except ValueError as error:
        raise InputError(f"'{text}' is not NAME=VALUE:STD: write, for example, Yv_dot=-90:30") from error
    if not target[1] > 0.0:
        raise InputError(f"'{text}': the standard deviation must be positive")
    return name.strip(), target


def _recipe(arguments: Namespace) -> int:
    runs = read_runs(arguments.runs, arguments) if arguments.runs else []
    shares = excitation(runs) if runs else {}
    missing = lacking(shares)
    recipe = [{'run': name, 'drive': what, 'duration_s': duration} for name, what, duration in standard_tests.RECIPE]
    if runs:
        lines = [
            "Share of each derivative's motion that no other derivative explains, 0 to 1:",
            *(
                f'  {name:<16}{share:>5.2f}  ' + (f'lacks {missing[name]}' if name in missing else 'enough')
                for name, share in shares.items()
            ),
            *(
                f'No {name.replace("_", " ")} in these runs: record it, or position and heading, to judge its '
                'derivatives.'
                for k, name in enumerate(CHANNELS)
                if not any(np.isfinite(run.smooth[k]).any() for run in runs)
            ),
        ]
    else:
        lines = [
            'Runs to drive, in calm water, clear of traffic; record thrust, speeds, yaw rate, heading, position:',
            *(f'  {name:<14}{duration:>4} s  {what}' for name, what, duration in standard_tests.RECIPE),
        ]
    print_result(arguments.json, {'recipe': recipe, 'excitation': shares, 'lacking': missing}, lines)
    return 0


def _forecast(arguments: Namespace):
    sources.check_model_and_plot(arguments, [*arguments.runs, *arguments.train, arguments.model])
    identified = read_manoeuvring_model(arguments.model)
    runs = read_runs([*arguments.runs, *arguments.train], arguments)
    scored, training = runs[: len(arguments.runs)], runs[len(arguments.runs) :]
    scores = score_forecasts(identified, scored, training, arguments.future == 'supplied', leads=arguments.leads)
    if arguments.plot:
        save_figure(forecast_figure(scores, arguments.future), arguments.plot)
    advice = summary.condensed([a for run in runs for a in run.advice])
    show_advice(advice)
    data = {**summary.forecast_as_data(scores, arguments.future), **warnings_as_data(advice)}
    print_result(arguments.json, data, summary.forecast_in_words(scores, arguments.future))
    return 0


def _play_through(arguments: Namespace):
    if len(arguments.runs) != 1 or not is_bag(arguments.runs[0]):
        raise InputError('play-through needs a single bag: give one rosbag2 bag')
    output = Output('--output', arguments.output, is_recording=True, endings=('mcap',))
    check_outputs([output], [*arguments.runs, arguments.model])
    trial = _read(arguments.runs[0], arguments)
    identified = read_manoeuvring_model(arguments.model) if arguments.model else None
    silence = 0.5 if arguments.gap_means_zero else 0.0
    settings = ManoeuvreOutlookSettings(leads=arguments.leads, rate=arguments.rate, stop_after=silence)
    count = bags.write_forecasts(arguments.output, bags.play_manoeuvres(trial, settings, identified), settings.leads)
    show_advice(summary.condensed(trial.advice))
    print(f'{arguments.output}: {count} forecasts')
    return 0


def _simulate(arguments: Namespace):
    if arguments.seed < 0:
        raise InputError('the seed must not be negative')
    is_folder = arguments.test == PROGRAMME
    check_outputs(
        [
            Output('--output', arguments.output, is_folder=is_folder, is_recording=True),
            Output('--plot', arguments.plot, endings=FORMATS),
        ],
        [arguments.model],
    )
    name = arguments.hull or arguments.model
    model = preset(name) if name in PRESETS else read_manoeuvring_model(name).model
    if is_folder:
        return _programme(model, arguments)
    for option in ('current', 'command'):
        if getattr(arguments, option) is not None:
            raise InputError(f'--{option} is for the programme: standard tests take still water and the model as it is')
    settings = standard_tests.DriveSettings(
        arguments.base, arguments.difference, float(np.radians(arguments.angle_deg))
    )
    report = standard_tests.run_test(arguments.test, model, settings)
    if arguments.output:
        noise = (
            standard_tests.RunNoise(*arguments.noise)
            if arguments.noise
            else standard_tests.RunNoise(0.0, 0.0, 0.0, 0.0)
        )
        _write(arguments.output, standard_tests.with_noise(report.manoeuvre, noise, arguments.seed), model)
    if arguments.plot:
        save_figure(test_figure(report, model), arguments.plot)
    data = {'test': report.name, 'model': model.name, 'numbers': report.numbers, 'curve': report.curve}
    print_result(arguments.json, data, summary.test_in_words(report))
    return 0


def _programme(model: Any, arguments: Namespace):
    if not arguments.output:
        raise InputError('the programme writes several runs: name a folder with --output')
    if arguments.plot:
        raise InputError('the programme has no figure: identify from its runs with --plot')
    if arguments.command is not None:
        values = dict(sources.assignment(text, 'Xu_dot=-18') for text in arguments.command)
        values.setdefault('gain', model.largest_input if model.thrust_input != COMMAND else model['gain'])
        model = replace(model.with_values(**values), thrust_input=COMMAND, largest_input=1.0)
    if arguments.current is not None:
        model = replace(model, current=tuple(arguments.current))
    noise = standard_tests.RunNoise(*arguments.noise) if arguments.noise else standard_tests.RunNoise()
    folder = Path(arguments.output)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for number, (name, manoeuvre) in enumerate(standard_tests.trial_programme(model).items()):
        path = folder / f'{name}.{arguments.format}'
        _write(path, standard_tests.with_noise(manoeuvre, noise, 100 * arguments.seed + number), model)
        written.append({'file': str(path), 'duration_s': float(manoeuvre.time[-1])})
    lines = [f'{row["file"]}: {row["duration_s"]:.0f} s' for row in written]
    print_result(arguments.json, {'model': model.name, 'runs': written}, lines)
    return 0


def _write(path: str | Path, manoeuvre: Manoeuvre, model: Any) -> None:
    ending = Path(path).suffix
    if ending == '.csv':
        write_manoeuvring_csv(path, manoeuvre, model)
    elif ending in ('.mcap', '.db3', ''):
        bags.write_manoeuvring_bag(path, manoeuvre)
    else:
        raise InputError(f"'{path}' is neither .csv nor a bag (.mcap, .db3, or a folder name): choose one of these")
