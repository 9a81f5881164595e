"""``swath-sysid simulate``: a trial with known truth."""

import math
from argparse import Namespace
from pathlib import Path

from swath_sysid.attitude.hull.catalogue import hull_named, hull_of_family
from swath_sysid.attitude.hull.craft_simulator import SensorNoise, simulated_trial
from swath_sysid.cli.hulls import hull_of
from swath_sysid.cli.progress import print_result
from swath_sysid.formats.outputs import Output, check_outputs

NO_NOISE = SensorNoise(0.0, 0.0, 0.0)


def run(arguments: Namespace) -> int:
    """Write the trial."""
    # a folder may be named after a number, as in run.5
    is_file = Path(arguments.output).suffix[1:].isalpha()
    endings = ('csv', 'mcap', 'db3') if is_file else ()
    check_outputs([Output('--output', arguments.output, is_recording=True, endings=endings)], [arguments.model])
    model = hull_of(arguments).with_trim(math.radians(arguments.trim_deg))
    studied = hull_named(arguments.hull) if arguments.hull else hull_of_family(arguments.equation or '')
    usual = SensorNoise.rate if studied is None else studied.rate_noise
    rate_noise = usual if arguments.rate_noise is None else arguments.rate_noise
    noise = SensorNoise(arguments.angle_noise, rate_noise, arguments.accel_noise)
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
