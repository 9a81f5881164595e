"""``swath-sysid sea``: the sea that a record's own motion shows."""

from argparse import Namespace

from swath_sysid.attitude.motion.sensor_checks import refuse_contradictions
from swath_sysid.attitude.motion.vertical import WITHOUT_RATES, even_stretches
from swath_sysid.attitude.prediction.sea_state import sea_state
from swath_sysid.cli.progress import print_result, show_advice
from swath_sysid.cli.sources import check_model_and_plot, read_record
from swath_sysid.formats.sea_state_yaml import REMARKS, sea_as_data
from swath_sysid.report.figures import save_figure
from swath_sysid.report.fit_summary import warnings_as_data
from swath_sysid.report.sea_report import sea_figure, sea_in_words


def remarks() -> str:
    """The end of the help."""
    return ' '.join(f'{remark[0].upper()}{remark[1:]}.' for remark in REMARKS)


def run(arguments: Namespace) -> int:
    """Print height, periods and axis of the waves, from the longest stretch without a gap."""
    check_model_and_plot(arguments, [arguments.record])
    trial = read_record(arguments.record, arguments)
    refuse_contradictions(trial)
    show_advice(trial.advice)
    chosen = trial.between(arguments.start, arguments.end)
    longest = max(even_stretches(chosen, WITHOUT_RATES), key=lambda stretch: stretch.time.size)
    found = sea_state(longest.acceleration, longest.channels['roll'], longest.channels['pitch'], longest.step)
    if arguments.plot:
        save_figure(sea_figure(found), arguments.plot)
    data = {**sea_as_data(found), 'remarks': REMARKS, **warnings_as_data(trial.advice)}
    is_stated = trial.installation is None or trial.installation.mounting is not None
    bow = 'the bow' if is_stated else 'the x axis of the sensor, whose mounting is not stated'
    print_result(arguments.json, data, sea_in_words(found, arguments.record, bow))
    return 0
