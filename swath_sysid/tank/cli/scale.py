"""``swath-sysid scale``: a model at another scale, by Froude's law."""

from argparse import Namespace

from swath_sysid.cli.progress import print_result, show_advice
from swath_sysid.formats.model_file import read_description, read_model, write_model, write_scheduled
from swath_sysid.formats.outputs import MODEL_ENDINGS, Output, check_outputs
from swath_sysid.report.fit_summary import warnings_as_data
from swath_sysid.tank.froude import length_ratio, scaled, scaled_schedule, scaling_advice


def run(arguments: Namespace) -> int:
    """Scale, warn, and write."""
    check_outputs([Output('--output', arguments.output, endings=MODEL_ENDINGS)], [arguments.model])
    ratio = length_ratio(arguments.ratio)
    models, schedules = read_description(arguments.model)
    if schedules:
        write_scheduled(arguments.output, {axis: scaled_schedule(s, ratio) for axis, s in schedules.items()})
    else:
        write_model(arguments.output, {axis: scaled(m, ratio) for axis, m in models.items()})
    written = read_model(arguments.output)
    advice = tuple(dict.fromkeys(a for m in models.values() for a in scaling_advice(m.model, ratio)))
    show_advice(advice)
    data, lines = {}, []
    for axis, before in models.items():
        after = written[axis]
        periods = [before.model.natural_period, after.model.natural_period]
        lines.append(f'{axis}: natural period {periods[0]:.4g} s -> {periods[1]:.4g} s')
        ratios = {}
        for name, value in before.model.terms.items():
            scaled_to, std = after.model.terms[name], after.std[name]
            lines.append(f'  {name:<3}{value:>14.6g} -> {scaled_to:.6g} +- {std:.2g}')
            ratios[name] = {'given': value, 'value': scaled_to, 'std': std}
        data[axis] = {'natural_period_s': periods, 'ratios': ratios}
    print_result(arguments.json, {'axes': data, **warnings_as_data(advice)}, lines)
    return 0
