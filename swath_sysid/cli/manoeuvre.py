"""``swath-sysid manoeuvre``: identify, forecast and simulate a twin-thruster craft."""

import time
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from swath_sysid.cli.progress import add_json_argument, print_result, progress_of, show_advice
from swath_sysid.cli.settings_flags import add_number, add_setting, finite
from swath_sysid.cli.sources import (
    add_column_argument,
    assignment,
    check_model_and_plot,
    columns_of,
    provenance_of,
    refuse_twice,
    without_copies,
)
from swath_sysid.common.errors import InputError
from swath_sysid.common.plain import finite_or_none
from swath_sysid.formats.bags import is_bag
from swath_sysid.formats.input_files import existing
from swath_sysid.formats.manoeuvring_bags import read_manoeuvring_bag, write_manoeuvring_bag
from swath_sysid.formats.manoeuvring_csv import FRAMES, read_manoeuvring_csv, write_manoeuvring_csv
from swath_sysid.formats.manoeuvring_model_file import read_manoeuvring_model, write_manoeuvring_model
from swath_sysid.formats.manoeuvring_output import play_manoeuvres, write_forecasts
from swath_sysid.formats.outputs import Output, check_outputs
from swath_sysid.manoeuvring.hull.presets import PRESETS, preset
from swath_sysid.manoeuvring.hull.programme import RECIPE, SensorNoise, trial_programme, with_noise
from swath_sysid.manoeuvring.hull.simulation import Manoeuvre
from swath_sysid.manoeuvring.hull.standard_tests import TESTS, DriveSettings, run_test
from swath_sysid.manoeuvring.identification.excitation import excitation, lacking
from swath_sysid.manoeuvring.identification.identify import identify_manoeuvring
from swath_sysid.manoeuvring.identification.settings import CURRENT_CHOICES, ManoeuvringSettings
from swath_sysid.manoeuvring.motion.intake import prepare_runs
from swath_sysid.manoeuvring.motion.trial import CHANNELS, COMMAND, INPUTS, Run
from swath_sysid.manoeuvring.prediction.calibration import calibrated
from swath_sysid.manoeuvring.prediction.pipeline import ManoeuvreOutlookSettings
from swath_sysid.manoeuvring.prediction.skill import LEADS, score_forecasts
from swath_sysid.report.figures import FORMATS, save_figure
from swath_sysid.report.fit_summary import warnings_as_data
from swath_sysid.report.manoeuvring_figures import forecast_figure, identification_figures, test_figure
from swath_sysid.report.manoeuvring_summary import (
    condensed,
    forecast_as_data,
    forecast_in_words,
    identification_as_data,
    identification_in_words,
    terms_in_words,
    test_in_words,
)

PROGRAMME = 'programme'
PREDICTOR = 'manoeuvring_predictor'

#: Fields of ``ManoeuvringSettings`` and of ``DriveSettings`` that are flags, with unit and meaning.
_SETTINGS = (
    ('inertia', 'KGM2', 'yaw inertia of the craft without added inertia'),
    ('thrust_per_command', 'N', 'thrust of one thruster at full command ahead'),
    ('length', 'M', 'length of the hulls, for the prime system'),
    ('window', 'S', 'length of a free simulation'),
    ('generations', 'N', 'generations of the initial search'),
    ('population', 'N', 'candidates per generation'),
    ('seed', 'N', 'seed of the initial search'),
)
_DRIVE = (
    ('base', 'SHARE', 'mean input'),
    ('difference', 'SHARE', 'half the difference of the inputs, positive to starboard'),
)


def add_arguments(parser: ArgumentParser) -> None:
    """The sub-verbs and their arguments."""
    verbs = parser.add_subparsers(dest='task', metavar='TASK', required=True)
    _add_identify(verbs.add_parser('identify', help='identify a manoeuvring model from runs'))
    _add_forecast(verbs.add_parser('forecast', help='score forecasts of runs by lead'))
    _add_simulate(verbs.add_parser('simulate', help='simulate standard tests and trials'))
    programme = verbs.add_parser('programme', help='list runs to drive, and what existing runs lack')
    add_run_arguments(programme, '*')
    programme.add_argument('--json', action='store_true', help='print one JSON object')
    _add_play_through(verbs.add_parser('play-through', help='write what manoeuvring_predictor would publish for a bag'))


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


def add_run_arguments(parser: ArgumentParser, count: str = '+') -> None:
    """Flags for reading runs, shared by the sub-verbs."""
    parser.add_argument(
        'runs',
        nargs=count,
        metavar='RUN',
        help='rosbag2 bag, or table (CSV, .mat, .tdms, .lvm, .xlsx, .parquet or .h5 file) with the columns time_s, '
        'port_thrust_n and starboard_thrust_n (or port_command and starboard_command, -1 to 1; or port_pwm_us and '
        'starboard_pwm_us), and any of surge_m_s, sway_m_s, yaw_rate_rad_s, heading_deg, x_m, y_m',
    )
    parser.add_argument('--frame', choices=FRAMES, help='frame of yaw, sway and position (default: as the file states)')
    add_column_argument(parser)
    parser.add_argument(
        '--gap-means-zero',
        action='store_true',
        help='treat gaps in the commands as zero thrust, if commands are published only while driving',
    )
    parser.add_argument('--thrust-input', choices=INPUTS, help='thrust in a bag: N or commands (default: detected)')
    for name in ('odometry', 'imu', 'port', 'starboard'):
        of = {'odometry': 'odometry', 'imu': 'IMU'}.get(name, f'{name} thruster')
        parser.add_argument(f'--{name}-topic', metavar='TOPIC', help=f'topic of the {of}, for bags with several')


def _add_fields(parser: ArgumentParser, fields: Sequence[tuple[str, str, str]], settings: Any) -> None:
    """Flags of some fields of settings, with their defaults."""
    for name, unit, meaning in fields:
        default = getattr(settings, name)
        kind = int if isinstance(default, int) else finite
        add_number(parser, '--' + name.replace('_', '-'), unit, meaning, default, kind)


def read_runs(paths: Sequence[str], arguments: Namespace) -> list[Run]:
    """Read and prepare runs, all with one step."""
    refuse_twice(paths)
    return prepare_runs([_read(path, arguments) for path in paths], arguments.gap_means_zero)


def _read(path: str | Path, arguments: Namespace):
    if is_bag(existing(path)):
        trial = read_manoeuvring_bag(
            path,
            arguments.odometry_topic,
            arguments.imu_topic,
            arguments.port_topic,
            arguments.starboard_topic,
            arguments.thrust_input,
        )
        return trial if arguments.frame is None else replace(trial, frame=arguments.frame)
    if Path(path).is_dir():
        raise InputError(f'{path} is a folder but not a bag: give files of tables, or bags')
    return read_manoeuvring_csv(path, arguments.frame, columns_of(arguments))


def _add_identify(parser: ArgumentParser) -> None:
    parser.formatter_class = RawDescriptionHelpFormatter
    parser.epilog = 'names for --terms, --fix and --towards, with their units:\n' + '\n'.join(terms_in_words())
    add_run_arguments(parser)
    parser.add_argument(
        '--validate', nargs='+', metavar='RUN', help='runs held out of the fit (default: a third of three or more runs)'
    )
    parser.add_argument('--no-validation', action='store_true', help='identify from all runs')
    add_setting(parser, '--mass', 'manoeuvring_identifier', 'mass_kg')
    add_setting(parser, '--lever', 'manoeuvring_identifier', 'lever_m')
    _add_fields(parser, _SETTINGS, ManoeuvringSettings)
    parser.add_argument('--terms', metavar='A,B,..', help='fit exactly these (default: the simplest adequate set)')
    parser.add_argument('--fix', action='append', default=[], metavar='NAME=VALUE', help='fix a parameter listed below')
    parser.add_argument(
        '--towards',
        action='append',
        default=[],
        metavar='NAME=VALUE:STD',
        help='regularise a parameter towards a value',
    )
    parser.add_argument(
        '--current',
        choices=CURRENT_CHOICES,
        default=CURRENT_CHOICES[0],
        help='auto: one per run if the heading is known; shared: one for all runs; none (default: %(default)s)',
    )
    parser.add_argument('--output', metavar='MODEL.yaml', help='write the model file')
    parser.add_argument('--plot', metavar='DIR', help='write the pictures into this folder')
    add_json_argument(parser)


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
        fixed=dict(assignment(text, 'Xu_dot=-18') for text in arguments.fix),
        towards=dict(_target(text) for text in arguments.towards),
        current=arguments.current,
        **{name: getattr(arguments, name) for name, _, _ in _SETTINGS},
    )
    both = [*arguments.runs, *(arguments.validate or [])]
    check_outputs([Output('--output', arguments.output), Output('--plot', arguments.plot, is_folder=True)], both)
    once, copies = without_copies(both)
    show_advice(copies)
    runs = read_runs(once, arguments)
    validation = None
    if arguments.validate or arguments.no_validation:
        fitted = sum(path in arguments.runs for path in once)
        runs, validation = runs[:fitted], runs[fitted:]
    with progress_of('identify') as progress:
        found = identify_manoeuvring(runs, settings, validation, progress=progress)
    data = identification_as_data(found, time.perf_counter() - began)
    data['warnings'] = [*warnings_as_data(copies)['warnings'], *data['warnings']]
    if arguments.output:
        write_manoeuvring_model(arguments.output, _for_file(found, data, once))
    if arguments.plot:
        folder = Path(arguments.plot)
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in identification_figures(found, arguments.window).items():
            save_figure(figure, folder / f'{name}.png')
    show_advice(condensed(found.advice))
    print_result(arguments.json, data, identification_in_words(found))
    return 0


def _for_file(found: Any, data: dict, paths: Sequence[str]):
    kept = ('r2', 'position_error_m', 'heading_error_rad', 'diverged_windows', 'stability')
    metrics = {key: data[key] for key in kept}
    provenance = {**provenance_of(paths), 'runs': data['runs']}
    return calibrated(found.identified(metrics, provenance), found.identified_on)


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
    recipe = [{'run': name, 'drive': what, 'duration_s': duration} for name, what, duration in RECIPE]
    if runs:
        lines = [
            "Share of each derivative's motion that no other derivative explains, 0 to 1:",
            *(
                f'  {name:<16}{share:>5.2f}  ' + (f'lacks {missing[name]}' if name in missing else 'enough')
                for name, share in shares.items()
            ),
            *_unmeasured(runs),
        ]
    else:
        lines = [
            'Runs to drive, in calm water, clear of traffic; record thrust, speeds, yaw rate, heading, position:',
            *(f'  {name:<14}{duration:>4} s  {what}' for name, what, duration in RECIPE),
        ]
    print_result(arguments.json, {'recipe': recipe, 'excitation': finite_or_none(shares), 'lacking': missing}, lines)
    return 0


def _unmeasured(runs: Sequence[Run]):
    return [
        f'No {name.replace("_", " ")} in these runs: record it, or position and heading, to judge its derivatives.'
        for k, name in enumerate(CHANNELS)
        if not any(np.isfinite(run.smooth[k]).any() for run in runs)
    ]


def _add_forecast(parser: ArgumentParser) -> None:
    add_run_arguments(parser)
    parser.add_argument('--model', required=True, metavar='MODEL.yaml', help='model file of manoeuvre identify')
    parser.add_argument(
        '--train',
        nargs='+',
        metavar='RUN',
        default=[],
        help='runs to fit the ARX baseline to (default: the other runs, or the first half of a single one)',
    )
    parser.add_argument(
        '--future',
        choices=('held', 'supplied'),
        default='held',
        help='future inputs: held at their last value, or known (default: %(default)s)',
    )
    add_setting(parser, '--leads', PREDICTOR, 'leads_s', default=LEADS, meaning='leads that are scored')
    parser.add_argument('--plot', metavar='FILE.png')
    add_json_argument(parser)


def _forecast(arguments: Namespace):
    check_model_and_plot(arguments, [*arguments.runs, *arguments.train, arguments.model])
    identified = read_manoeuvring_model(arguments.model)
    runs = read_runs([*arguments.runs, *arguments.train], arguments)
    scored, training = runs[: len(arguments.runs)], runs[len(arguments.runs) :]
    scores = score_forecasts(identified, scored, training, arguments.future == 'supplied', leads=arguments.leads)
    if arguments.plot:
        save_figure(forecast_figure(scores, arguments.future), arguments.plot)
    advice = condensed([a for run in runs for a in run.advice])
    show_advice(advice)
    data = {**forecast_as_data(scores, arguments.future), **warnings_as_data(advice)}
    print_result(arguments.json, data, forecast_in_words(scores, arguments.future))
    return 0


def _add_play_through(parser: ArgumentParser) -> None:
    add_run_arguments(parser)
    parser.add_argument('--model', metavar='MODEL.yaml', help='model file (default: forecasts assume steady motion)')
    parser.add_argument('--output', required=True, metavar='OUT.mcap')
    add_setting(parser, '--rate', PREDICTOR, 'forecast_rate_hz')
    add_setting(parser, '--leads', PREDICTOR, 'leads_s')


def _play_through(arguments: Namespace):
    if len(arguments.runs) != 1 or not is_bag(arguments.runs[0]):
        raise InputError('play-through needs a single bag: give one rosbag2 bag')
    output = Output('--output', arguments.output, is_recording=True, endings=('mcap',))
    check_outputs([output], [*arguments.runs, arguments.model])
    trial = _read(arguments.runs[0], arguments)
    identified = read_manoeuvring_model(arguments.model) if arguments.model else None
    silence = 0.5 if arguments.gap_means_zero else 0.0
    settings = ManoeuvreOutlookSettings(leads=arguments.leads, rate=arguments.rate, stop_after=silence)
    count = write_forecasts(arguments.output, play_manoeuvres(trial, settings, identified), settings.leads)
    show_advice(condensed(trial.advice))
    print(f'{arguments.output}: {count} forecasts')
    return 0


def _add_simulate(parser: ArgumentParser) -> None:
    choice = parser.add_mutually_exclusive_group(required=True)
    choice.add_argument('--model', metavar='MODEL', help=f'model file, or one of {", ".join(PRESETS)}')
    choice.add_argument('--hull', choices=tuple(PRESETS), help='a ready-made craft')
    parser.add_argument(
        '--test',
        choices=(*TESTS, PROGRAMME),
        required=True,
        help='a standard test, or a whole programme of trials for identification',
    )
    _add_fields(parser, _DRIVE, DriveSettings)
    add_number(parser, '--angle-deg', 'DEG', 'angle of the zig-zag', 20.0)
    parser.add_argument(
        '--current', type=finite, nargs=2, metavar=('EAST', 'NORTH'), help='current, m/s; programme only'
    )
    parser.add_argument(
        '--command',
        nargs='*',
        metavar='NAME=VALUE',
        help='drive with normalised commands: gain, dead_band, reverse_ratio, lag, delay, exponent, balance; programme '
        'only',
    )
    parser.add_argument(
        '--noise',
        type=finite,
        nargs=2,
        metavar=('SPEED', 'YAW_RATE'),
        help='standard deviations of the noise, m/s and rad/s (default: 0.05 0.005 for the programme, else none)',
    )
    parser.add_argument('--seed', type=int, default=1, metavar='N', help='seed of the noise')
    parser.add_argument('--output', metavar='FILE', help='.csv, .mcap or .db3 file; a folder for the programme')
    parser.add_argument('--format', choices=('csv', 'mcap', 'db3'), default='csv', help='file format of the programme')
    parser.add_argument('--plot', metavar='FILE.png')
    add_json_argument(parser)


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
    settings = DriveSettings(arguments.base, arguments.difference, float(np.radians(arguments.angle_deg)))
    report = run_test(arguments.test, model, settings)
    if arguments.output:
        noise = SensorNoise(*arguments.noise) if arguments.noise else SensorNoise(0.0, 0.0, 0.0, 0.0)
        _write(arguments.output, with_noise(report.manoeuvre, noise, arguments.seed), model)
    if arguments.plot:
        save_figure(test_figure(report, model), arguments.plot)
    data = {'test': report.name, 'model': model.name, 'numbers': report.numbers, 'curve': report.curve}
    print_result(arguments.json, finite_or_none(data), test_in_words(report))
    return 0


def _programme(model: Any, arguments: Namespace):
    if not arguments.output:
        raise InputError('the programme writes several runs: name a folder with --output')
    if arguments.plot:
        raise InputError('the programme has no figure: identify from its runs with --plot')
    if arguments.command is not None:
        values = dict(assignment(text, 'Xu_dot=-18') for text in arguments.command)
        values.setdefault('gain', model.largest_input if model.thrust_input != COMMAND else model['gain'])
        model = replace(model.with_values(**values), thrust_input=COMMAND, largest_input=1.0)
    if arguments.current is not None:
        model = replace(model, current=tuple(arguments.current))
    noise = SensorNoise(*arguments.noise) if arguments.noise else SensorNoise()
    folder = Path(arguments.output)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for number, (name, manoeuvre) in enumerate(trial_programme(model).items()):
        path = folder / f'{name}.{arguments.format}'
        _write(path, with_noise(manoeuvre, noise, 100 * arguments.seed + number), model)
        written.append({'file': str(path), 'duration_s': float(manoeuvre.time[-1])})
    lines = [f'{row["file"]}: {row["duration_s"]:.0f} s' for row in written]
    print_result(arguments.json, finite_or_none({'model': model.name, 'runs': written}), lines)
    return 0


def _write(path: str | Path, manoeuvre: Manoeuvre, model: Any) -> None:
    ending = Path(path).suffix
    if ending == '.csv':
        write_manoeuvring_csv(path, manoeuvre, model)
    elif ending in ('.mcap', '.db3', ''):
        write_manoeuvring_bag(path, manoeuvre)
    else:
        raise InputError(f"'{path}' is neither .csv nor a bag (.mcap, .db3, or a folder name): choose one of these")
