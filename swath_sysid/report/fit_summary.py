"""A fit in words and in plain data, for the terminal and for other programs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from swath_sysid.attitude.hull.catalogue import published_alike, told
from swath_sysid.attitude.hull.published_form import to_published
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, RATIO_UNITS
from swath_sysid.attitude.identification.uncertainty import known_together
from swath_sysid.common.covariance import correlation
from swath_sysid.formats.model_file import ratios_as_data
from swath_sysid.formats.plain_data import finite_or_none

if TYPE_CHECKING:
    from collections.abc import Iterable

    from swath_sysid.attitude.identification.identify import Identification
    from swath_sysid.attitude.identification.selection import Comparison
    from swath_sysid.common.advice import Advice


def fit_as_data(identification: Identification, wall_s: float | None = None, inertia: float | None = None) -> dict:
    """What ``identify --json`` prints, as plain data; an inertia I' adds the coefficients in the published form."""
    model = identification.model
    segments = [[record.segment.start, record.segment.end] for record in identification.records]
    data = {
        'equation': model.equation.name,
        'published_alike': list(published_alike(model.equation, model.axis)),
        'axis': model.axis,
        'ratios': {
            name: {**ratio, 'interval': list(identification.intervals[name])}
            for name, ratio in ratios_as_data(identification).items()
        },
        'verdict': vars(identification.verdict),
        'known_together': [list(group) for group in _together(identification)],
        'correlation': correlation(identification.covariance).tolist(),
        'trim_rad': model.trim,
        'trim_std_rad': identification.trim_std,
        'natural_period_s': model.natural_period,
        'damping_ratio': identification.damping_ratio,
        'reference_amplitude_rad': identification.reference_amplitude,
        'valid_amplitude_rad': list(identification.amplitude_range),
        'r2': identification.r2,
        'rmse': identification.rmse,
        'rate_rmse': identification.rate_rmse,
        'objective': {'name': identification.objective, 'value': identification.objective_value},
        'segment_s': segments[0] if len(segments) == 1 else segments,
        'sources': [record.motion.source for record in identification.records],
        'search': {'value': identification.search.value, 'stop': identification.search.stop},
        'generations': identification.search.generations,
        'evaluations': identification.search.evaluations,
        'samples': identification.samples,
        'effective_samples': identification.effective_samples,
        'wall_s': wall_s,
        **warnings_as_data(identification.advice),
    }
    if inertia is not None:
        data['published_form'] = vars(to_published(model, inertia))
    return finite_or_none(data)


def warnings_as_data(advice: Iterable[Advice]) -> dict[str, list[dict[str, str]]]:
    """The field ``warnings`` of what ``--json`` prints, each warning once."""
    return {'warnings': [{'code': a.code, 'message': a.message} for a in dict.fromkeys(advice)]}


def fit_in_words(identification: Identification, inertia: float | None = None) -> list[str]:
    """Lines for a reader."""
    model = identification.model
    lines = [
        f'{model.axis}: {told(model.equation, model.axis)}, {len(identification.records)} record(s)',
        f'  {identification.verdict}',
    ]
    lines += [
        f'  {short_name(record.motion.source)}: decay from {record.segment.start:.2f} to {record.segment.end:.2f} s, '
        f'{record.segment.cycles:.1f} cycles'
        for record in identification.records
    ]
    lines += ratio_lines(identification, identification.intervals)
    lines += _joint_lines(identification)
    low, high = (math.degrees(a) for a in identification.amplitude_range)
    lines += [
        f'  trim {math.degrees(model.trim):.4f} deg +- {math.degrees(identification.trim_std):.2g}',
        f'  natural period of small motions {model.natural_period:.4f} s, equivalent damping ratio '
        f'{identification.damping_ratio:.4f} at {math.degrees(identification.reference_amplitude):.2f} deg',
        f'  R2 {identification.r2:.6f}, {identification.objective} objective {identification.objective_value:.6g}, '
        f'{identification.effective_samples:.0f} effective of {identification.samples} samples',
        f'  valid from {low:.2f} to {high:.2f} deg; search ended by {identification.search.stop} after '
        f'{identification.search.generations} generations',
    ]
    if inertia is not None:
        form = to_published(model, inertia)
        lines.append('  published form: ' + ', '.join(f'{name} {value:.6g}' for name, value in vars(form).items()))
    return lines


def _together(identification: Identification) -> tuple[tuple[str, ...], ...]:
    return known_together(identification.model.equation.terms, identification.covariance)


def _joint_lines(identification: Identification) -> list[str]:
    """One line that says what the record knows of the terms that it does not separate."""
    groups = _together(identification)
    if not groups:
        return []
    amplitude = identification.reference_amplitude
    period, damping, period_std, damping_std = identification.bands.at(amplitude)
    known = {
        True: f'damping ratio {damping:.4f} +- {damping_std:.2g}',
        False: f'period {period:.4f} +- {period_std:.2g} s',
    }
    words = [f'{" and ".join((", ".join(g[:-1]), g[-1]))}: {known[g[0] in DAMPING_NAMES]}' for g in groups]
    return [f'  known only together (at {math.degrees(amplitude):.2f} deg): {"; ".join(words)}']


def ratio_lines(identified: Any, intervals: dict[str, tuple[float, float]] | None = None) -> list[str]:
    """A line per ratio with unit and standard deviation, or the upper end of an interval that begins at zero."""
    lines = []
    for name, value in identified.model.terms.items():
        std, (low, high) = identified.std[name], (intervals or {}).get(name, (-math.inf, math.inf))
        spread = f'< {high:.3g} (95 %)' if low == 0.0 and value < std else f'+- {std:.3g}'
        lines.append(f'  {name:<3}{value:>14.6g}  {spread:<14} {RATIO_UNITS[name]}')
    return lines


def comparison_as_data(comparison: Comparison, wall_s: float | None = None) -> dict:
    """What ``compare --json`` prints."""
    ranked = [
        {**fit_as_data(r.identification), 'terms': r.term_count, 'criterion': r.criterion, 'held_out_nrmse': r.held_out}
        for r in comparison.ranked
    ]
    return finite_or_none(
        {'ranked': ranked, 'choice': comparison.choice.name, 'reason': comparison.reason, 'wall_s': wall_s}
    )


def short_name(source: str) -> str:
    """The last part of a path, of whichever system."""
    return source.replace('\\', '/').rpartition('/')[2]
