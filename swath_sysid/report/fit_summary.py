"""Identifications in words and in plain data, for the terminal and for other programs."""

import math
from collections.abc import Iterable
from typing import Any

from swath_sysid.attitude.hull.catalogue import published_alike, title_of
from swath_sysid.attitude.hull.decay_model import to_published
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, RATIO_UNITS
from swath_sysid.attitude.identification.at_sea import AtSeaIdentification
from swath_sysid.attitude.identification.fit_quality import known_together
from swath_sysid.attitude.identification.result import Identification
from swath_sysid.attitude.identification.selection import Comparison
from swath_sysid.attitude.motion.trial import axis_in_words
from swath_sysid.common.advice import Advice, counted, with_flags
from swath_sysid.common.covariance import correlation
from swath_sysid.common.plain import finite_or_none
from swath_sysid.formats.model_file import ratios_as_data

SEAS = {'heave': 'the sea as the vertical acceleration shows it', 'jonswap': 'a JONSWAP sea with a free tail'}


def _as_data(found: Any, wall_s: float | None) -> dict:
    """What a fit of decays and one at sea have in common."""
    model = found.model
    return {
        'equation': model.equation.name,
        'axis': model.axis,
        'axis_in_words': _axis_of(found),
        'ratios': ratios_as_data(found),
        'trim_rad': model.trim,
        'trim_std_rad': found.trim_std,
        'damping_ratio': found.damping_ratio,
        'wall_s': wall_s,
        **warnings_as_data(found.advice),
    }


def _axis_of(found: Identification | AtSeaIdentification) -> str:
    motions = found.problem.motions if isinstance(found, Identification) else found.motions
    return axis_in_words(found.model.axis, motions[0].installation)


def fit_as_data(found: Identification, wall_s: float | None = None, inertia: float | None = None) -> dict:
    """What ``identify --json`` prints, as plain data; an inertia I' adds the coefficients in the published form."""
    data = _as_data(found, wall_s)
    for name, ratio in data['ratios'].items():
        ratio['interval'] = list(found.intervals[name])
    segments = [[record.segment.start, record.segment.end] for record in found.records]
    data |= {
        'published_alike': list(published_alike(found.model.equation, found.model.axis)),
        'verdict': vars(found.verdict),
        'known_together': [list(group) for group in _together(found)],
        'correlation': correlation(found.covariance).tolist(),
        'natural_period_s': found.model.natural_period,
        'natural_period_std_s': found.natural_period_std,
        'reference_amplitude_rad': found.reference_amplitude,
        'valid_amplitude_rad': list(found.amplitude_range),
        **{name: getattr(found, name) for name in ('r2', 'rmse', 'rate_rmse', 'samples', 'effective_samples')},
        'objective': {'name': found.objective, 'value': found.objective_value},
        'segment_s': segments[0] if len(segments) == 1 else segments,
        'sources': [record.motion.source for record in found.records],
        'search': {'value': found.search.value, 'stop': found.search.stop, 'start': found.search.start},
        'generations': found.search.generations,
        'evaluations': found.search.evaluations,
    }
    if inertia is not None:
        data['published_form'] = vars(to_published(found.model, inertia))
    return finite_or_none(data)


def at_sea_as_data(found: AtSeaIdentification, wall_s: float | None = None) -> dict:
    """What ``identify --json`` prints of records in waves."""
    data = _as_data(found, wall_s) | {
        'identified_from': 'motion in waves',
        'natural_period_s': found.natural_period,
        'natural_period_std_s': found.natural_period_std if found.is_usable else None,
        'damping_ratio_std': found.damping_ratio_std if found.is_usable else None,
        'correlation': float(correlation(found.estimate_covariance)[0, 1]) if found.is_usable else None,
        'reference_amplitude_rad': found.amplitude,
        'reference_amplitude_std_rad': found.amplitude_std,
        'valid_amplitude_rad': [found.amplitude, found.amplitude],
        'roughness': found.roughness,
        'parts_apart': found.apart,
        'usable': found.is_usable,
        'sea': found.sea,
        'peak_period_s': found.peak_period,
        'segments_s': [[float(each.time[0]), float(each.time[-1])] for each in found.motions],
        'sources': [each.source for each in found.motions],
    }
    if not found.is_usable:
        data['ratios'] = {name: {**ratio, 'std': None} for name, ratio in data['ratios'].items()}
    return finite_or_none(data)


def comparison_as_data(comparison: Comparison, wall_s: float | None = None) -> dict:
    """What ``compare --json`` prints."""
    ranked = [
        {**fit_as_data(r.identification), 'terms': r.term_count, 'criterion': r.criterion, 'held_out_nrmse': r.held_out}
        for r in comparison.ranked
    ]
    data = {'ranked': ranked, 'choice': comparison.choice.name, 'reason': comparison.reason, 'wall_s': wall_s}
    return finite_or_none(data)


def warnings_as_data(advice: Iterable[Advice]) -> dict[str, list[dict[str, str]]]:
    """The field ``warnings`` of what ``--json`` prints, each warning once."""
    return {'warnings': [{'code': a.code, 'message': a.message} for a in dict.fromkeys(advice)]}


def fit_in_words(found: Identification, inertia: float | None = None) -> list[str]:
    """Lines for a reader."""
    model = found.model
    low, high = (math.degrees(a) for a in found.amplitude_range)
    lines = [
        f'{model.axis}: {title_of(model.equation, model.axis)}, {counted(len(found.records), "decay")}',
        f'  {with_flags(found.verdict.code, str(found.verdict))}',
        *(
            f'  {short_name(r.motion.source)}: decay from {r.segment.start:.2f} to {r.segment.end:.2f} s, '
            f'{r.segment.cycles:.1f} cycles'
            for r in found.records
        ),
        *ratio_lines(found, found.intervals),
        *_joint_lines(found),
        f'  trim {math.degrees(model.trim):.4f} deg'
        + (f' +- {math.degrees(found.trim_std):.2g}' if math.isfinite(found.trim_std) else ''),
        f'  natural period of small motions {model.natural_period:.4f} s +- {found.natural_period_std:.2g} '
        f'(extrapolated below {low:.2f} deg)',
        f'  R2 {found.r2:.6f}, {found.objective} objective {found.objective_value:.6g}, '
        f'{found.samples} samples, as informative as {found.effective_samples:.0f} independent samples',
        f'  valid from {low:.2f} to {high:.2f} deg; found from the {found.search.start}'
        + (f'; the search stopped by {found.search.stop}' if found.search.generations else ''),
    ]
    if inertia is not None:
        form = vars(to_published(model, inertia))
        lines.append('  published form: ' + ', '.join(f'{name} {value:.6g}' for name, value in form.items()))
    return lines


def conclusion_of(found: Identification) -> list[str]:
    """Verdict, period and damping in one line."""
    period, damping, period_std, damping_std = found.bands.at(found.reference_amplitude)
    return [
        f'{_axis_of(found)}: {found.verdict.level}; at {math.degrees(found.reference_amplitude):.2f} deg: natural '
        f'period {period:.4f} s +- {period_std:.2g}, equivalent damping ratio {damping:.4f} +- {damping_std:.2g} '
        '(one standard deviation)'
    ]


def at_sea_in_words(found: AtSeaIdentification) -> list[str]:
    """Lines for a reader; a result that is not usable has no standard deviations that could be relied on."""
    model, usable = found.model, found.is_usable
    period_std, damping_std = (
        f' +- {std:.2g}' if usable else '' for std in (found.natural_period_std, found.damping_ratio_std)
    )
    ratios = ratio_lines(found) if usable else [f'  {name:<3}{value:>14.6g}' for name, value in model.terms.items()]
    return [
        f'{_axis_of(found)}: identified at sea{"" if usable else ", not usable"}, the equivalent linear hull at '
        f'{math.degrees(found.amplitude):.2f} deg +- {math.degrees(found.amplitude_std):.2g}',
        '  no verdict, as there was no release to judge by: score forecasts with this model instead',
        *(
            f'  {short_name(each.source)}: motion in waves from {each.time[0]:.1f} to {each.time[-1]:.1f} s'
            for each in found.motions
        ),
        *ratios,
        f'  mean angle {math.degrees(model.trim):.2f} deg +- {math.degrees(found.trim_std):.2g}; '
        f'waves: {SEAS[found.sea]}',
        f'  the exciting moment peaks at a period of {found.peak_period:.3g} s; it follows the slope of the waves, so '
        'their height peaks at a longer one',
        f'  the excitation deviates from such waves by {found.roughness:.0%}; periods of parts fitted alone are '
        f'{found.apart:.1f} standard deviations apart',
        f'  natural period {found.natural_period:.3f} s{period_std}, equivalent damping ratio '
        f'{found.damping_ratio:.3f}{damping_std}'
        + ('' if usable else ' (not usable, so without standard deviations: the warnings say why)'),
    ]


def _together(found: Identification) -> tuple[tuple[str, ...], ...]:
    return known_together(found.model.equation.terms, found.covariance)


def _joint_lines(found: Identification) -> list[str]:
    """One line that says what the record knows of the terms that it does not separate."""
    groups, amplitude = _together(found), found.reference_amplitude
    if not groups:
        return []
    period, damping, period_std, damping_std = found.bands.at(amplitude)
    known = {
        True: f'damping ratio {damping:.4f} +- {damping_std:.2g}',
        False: f'period {period:.4f} +- {period_std:.2g} s',
    }
    words = [f'{", ".join(g[:-1])} and {g[-1]}: {known[g[0] in DAMPING_NAMES]}' for g in groups]
    return [f'  known only together (at {math.degrees(amplitude):.2f} deg): {"; ".join(words)}']


def ratio_lines(identified: Any, intervals: dict[str, tuple[float, float]] | None = None) -> list[str]:
    """A line per ratio with its spread and unit."""
    lines = []
    for name, value in identified.model.terms.items():
        spread = spread_of(identified, name, intervals).replace('±', '+-')
        lines.append(f'  {name:<3}{value:>14.6g}  {spread:<14} {RATIO_UNITS[name]}')
    return lines


def spread_of(identified: Any, name: str, intervals: dict[str, tuple[float, float]] | None = None) -> str:
    """The standard deviation of a ratio, or the 95 % interval of one that zero is in."""
    std, (low, high) = identified.std[name], (intervals or {}).get(name, (-math.inf, math.inf))
    return f'(95 %: 0 to {high:.3g})' if low == 0.0 and identified.model.terms[name] < std else f'± {std:.3g}'


def short_name(source: str) -> str:
    """The last part of a path, of whichever system; of a topic of a bag, the bag's with the topic."""
    path, space, topic = source.partition(' /')
    return path.replace('\\', '/').rpartition('/')[2] + space + topic
