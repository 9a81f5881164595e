"""``swath-sysid simulate``: a trial with known truth."""

import math
from argparse import ArgumentParser, Namespace

from swath_sysid.attitude.hull.catalogue import hull_named, hull_of_family
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.cli.hulls import add_hull_arguments, hull_of
from swath_sysid.cli.progress import add_json_argument, print_result
from swath_sysid.cli.settings_flags import add_number, add_setting, finite
from swath_sysid.formats.outputs import Output, check_outputs

NO_NOISE = SensorNoise(0.0, 0.0, 0.0)


def add_arguments(parser: ArgumentParser) -> None:
    """The hull, the release, the sensor, and the file."""
    usual = SensorNoise()
    add_hull_arguments(parser)
    parser.add_argument(
        '--initial-angle-deg', type=finite, required=True, metavar='A', help='angle of the release, from rest'
    )
    add_number(parser, '--duration', 'S', 'time after the release', 15.0)
    add_number(parser, '--rate', 'HZ', 'samples per second', 100.0)
    add_number(parser, '--hold', 'S', 'time held at the angle before the release', 0.0)
    add_number(parser, '--trim-deg', 'A', 'angle at rest', 0.0)
    add_number(parser, '--angle-noise', 'RAD', 'standard deviation of the angles', usual.angle)
    study = f'(default: as in the study of the hull or equation, else {usual.rate})'
    add_number(parser, '--rate-noise', 'RAD_S', f'standard deviation of the rates {study}')
    add_number(parser, '--accel-noise', 'M_S2', 'standard deviation of the accelerations', usual.acceleration)
    parser.add_argument(
        '--noise',
        choices=('published', 'none'),
        default='published',
        help='noise of the sensor; none: an ideal sensor (default: %(default)s)',
    )
    add_setting(parser, '--seed', 'identifier', 'seed', meaning='seed of the noise')
    parser.add_argument('--output', required=True, metavar='FILE', help='FILE.csv, FILE.mcap, FILE.db3 or a bag folder')
    add_json_argument(parser)


def run(arguments: Namespace) -> int:
    """Write the trial."""
    check_outputs([Output('--output', arguments.output, is_recording=True)], [arguments.model])
    model = hull_of(arguments).with_trim(math.radians(arguments.trim_deg))
    noise = SensorNoise(arguments.angle_noise, _rate_noise(arguments), arguments.accel_noise)
    trial = simulated_trial(
        model,
        math.radians(arguments.initial_angle_deg),
        arguments.duration,
        arguments.rate,
        NO_NOISE if arguments.noise == 'none' else noise,
        arguments.seed,
        arguments.hold,
    )
    if arguments.output.endswith('.csv'):
        from swath_sysid.formats.csv_trials import write_csv as write
    else:
        from swath_sysid.formats.bags import write_imu_bag as write
    write(arguments.output, trial)
    ratios = ', '.join(f'{name} {value:.6g}' for name, value in model.terms.items())
    print_result(
        arguments.json,
        {
            'file': arguments.output,
            'samples': trial.time.size,
            'axis': model.axis,
            'equation': model.equation.name,
            'ratios': model.terms,
        },
        [f'{arguments.output}: {trial.time.size} samples of {model.axis}, {model.equation.name}, true ratios {ratios}'],
    )
    return 0


def _rate_noise(arguments: Namespace):
    if arguments.rate_noise is not None:
        return arguments.rate_noise
    hull = hull_named(arguments.hull) if arguments.hull else hull_of_family(arguments.equation or '')
    return SensorNoise.rate if hull is None else hull.rate_noise
