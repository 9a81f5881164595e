"""``swath-sysid scale``: a model at another scale, by Froude's law."""

from argparse import Namespace
from collections.abc import Iterator

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.cli.progress import print_result, show_advice
from swath_sysid.formats.model_file import read_description, write_model, write_scheduled
from swath_sysid.formats.outputs import MODEL_ENDINGS, Output, check_outputs
from swath_sysid.report.fit_summary import warnings_as_data
from swath_sysid.tank.campaign.manifest import loading_in_words
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
    advice = tuple(dict.fromkeys(a for m in models.values() for a in scaling_advice(m.model, ratio)))
    show_advice(advice)
    data: dict[str, dict] = {'axes': {}, 'loadings': {}}
    lines = []
    for name, before, after in _pairs(models, schedules, arguments.output):
        periods = [before.model.natural_period, after.model.natural_period]
        lines.append(f'{name}: natural period {periods[0]:.4g} s -> {periods[1]:.4g} s')
        ratios = {}
        for term, value in before.model.terms.items():
            scaled_to, std = after.model.terms[term], after.std[term]
            lines.append(f'  {term:<3}{value:>14.6g} -> {scaled_to:.6g} +- {std:.2g}')
            ratios[term] = {'given': value, 'value': scaled_to, 'std': std}
        found = {'natural_period_s': periods, 'ratios': ratios}
        axis = before.model.axis
        if axis in schedules:
            data['loadings'][name] = found
        # of a schedule that of the middle loading, as for all readers without one
        if axis not in schedules or before is schedules[axis].reference:
            data['axes'][axis] = found
    print_result(arguments.json, {**data, **warnings_as_data(advice)}, lines)
    return 0


def _pairs(models: dict, schedules: dict, written: str) -> Iterator[tuple[str, IdentifiedModel, IdentifiedModel]]:
    """Name, model and scaled model of each axis or, of a schedule, of each of its loadings."""
    scaled_models, scaled_schedules = read_description(written)
    if not schedules:
        yield from ((axis, before, scaled_models[axis]) for axis, before in models.items())
    for axis, schedule in schedules.items():
        other = scaled_schedules[axis]
        for loading, to, before, after in zip(
            schedule.loadings, other.loadings, schedule.models, other.models, strict=True
        ):
            moved = '' if to == loading else f' -> {loading_in_words(schedule.quantity, to)}'
            yield f'{axis}, {loading_in_words(schedule.quantity, loading)}{moved}', before, after
