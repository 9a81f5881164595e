"""``swath-sysid inspect``: what is in a record."""

from argparse import Namespace

from swath_sysid.cli.progress import print_result
from swath_sysid.cli.sources import check_model_and_plot, read_trials
from swath_sysid.report.figures import save_figure
from swath_sysid.report.record_report import record_as_data, record_figure, record_in_words


def run(arguments: Namespace) -> int:
    """Describe the record, and draw it."""
    check_model_and_plot(arguments, [arguments.trial])
    (trial,), _ = read_trials([arguments.trial], arguments)
    axes = trial.axes if arguments.axis is None else (arguments.axis,)
    motions = [trial.axis(axis).between(arguments.start, arguments.end) for axis in axes]
    if arguments.plot:
        save_figure(record_figure(motions), arguments.plot)
    data = record_as_data(trial, motions)
    print_result(arguments.json, data, record_in_words(data))
    return 0
