"""``swath-sysid play-through`` of a bag that holds odometry and thrust."""

from argparse import Namespace

from swath_sysid.cli.progress import print_result, show_advice
from swath_sysid.common.advice import Advice
from swath_sysid.manoeuvring.formats import bags
from swath_sysid.manoeuvring.formats.model_file import read_manoeuvring_model
from swath_sysid.manoeuvring.nodes.settings import manoeuvring_pipeline_settings
from swath_sysid.nodes.parameters.parameter_files import values_from_file


def play(arguments: Namespace) -> tuple[int | None, list[Advice]]:
    """What manoeuvring_predictor would have published, and the exit code, where the bag holds no IMU; else what the bag
    holds beside it.
    """
    manoeuvres, imu = bags.holds_manoeuvres(arguments.record)
    if imu or not manoeuvres:
        return None, [Advice.of('manoeuvres-beside', record=arguments.record)] if manoeuvres else []
    values = values_from_file(arguments.params_file, 'manoeuvring_predictor')
    trial = bags.read_manoeuvring_bag(arguments.record)
    model = arguments.model or values['model_file']
    settings = manoeuvring_pipeline_settings(values)
    identified = read_manoeuvring_model(model) if model else None
    count = bags.write_forecasts(arguments.output, bags.play_manoeuvres(trial, settings, identified), settings.leads)
    show_advice(trial.advice)
    told = f'{arguments.output}: {count} forecasts of surge, sway and yaw (there is no IMU to forecast attitude from)'
    print_result(arguments.json, {'file': arguments.output, 'forecasts': count}, [told])
    return 0, []
