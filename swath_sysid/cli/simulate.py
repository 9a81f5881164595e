"""``swath-sysid simulate``: a trial with known truth."""

import math
from argparse import ArgumentParser, Namespace

from swath_sysid.attitude.hull.catalogue import hull_named, hull_of_family
from swath_sysid.attitude.hull.simulated_trial import SensorNoise, simulated_trial
from swath_sysid.cli.hulls import add_hull_arguments, hull_of
from swath_sysid.cli.progress import add_json_argument, print_result
from swath_sysid.cli.settings_flags import add_setting, finite
from swath_sysid.formats.outputs import Output, check_outputs

NO_NOISE = SensorNoise(0.0, 0.0, 0.0)


def add_arguments(parser: ArgumentParser) -> None:
    """The hull, the release, the sensor, and the file."""
    usual = SensorNoise()
    add_hull_arguments(parser)
    parser.add_argument(
        '--initial-angle-deg', type=finite, required=True, metavar='A', help='angle of the release, from rest'
    )
    parser.add_argument(
        '--duration', type=finite, default=15.0, metavar='S', help='time after the release (default: %(default)s)'
    )
    parser.add_argument(
        '--rate', type=finite, default=100.0, metavar='HZ', help='samples per second (default: %(default)s)'
    )
    parser.add_argument(
        '--hold',
        type=finite,
        default=0.0,
        metavar='S',
        help='time held at the angle before the release (default: %(default)s)',
    )
    parser.add_argument(
        '--trim-deg', type=finite, default=0.0, metavar='A', help='angle at rest (default: %(default)s)'
    )
    parser.add_argument(
        '--angle-noise',
        type=finite,
        default=usual.angle,
        metavar='RAD',
        help='standard deviation of the angles (default: %(default)s)',
    )
    parser.add_argument(
        '--rate-noise',
        type=finite,
        metavar='RAD_S',
        help=f'standard deviation of the rates (default: as in the study of the hull or equation, else {usual.rate})',
    )
    parser.add_argument(
        '--accel-noise',
        type=finite,
        default=usual.acceleration,
        metavar='M_S2',
        help='standard deviation of the accelerations (default: %(default)s)',
    )
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
