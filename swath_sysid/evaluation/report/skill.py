"""A forecast's skill as plain data, and how its scores are named and printed."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from swath_sysid.attitude.motion.trial import axis_in_words
from swath_sysid.attitude.prediction.forecast import LEVELS
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.common.conventions import CONFIDENCE
from swath_sysid.common.plain import finite_or_none
from swath_sysid.evaluation.scoring import AFTER_GAP, QuantitySkill, Skill
from swath_sysid.report.fit_summary import warnings_as_data

POINT_UNITS = {'heave': 'm', 'vertical_velocity': 'm_s', 'vertical_acceleration': 'm_s2'}
#: Of the methods.
LABELS = {
    'forecast': 'forecast',
    'persistence': 'persistence',
    'constant_rate': 'constant rate',
    'mean': 'past mean',
    'ar_40': 'AR(40)',
    'var_40': 'VAR(40)',
    'var_60': 'VAR(60)',
}


def skill_as_data(skill: Skill) -> dict:
    """The scores as plain data for JSON; what is not known is None."""
    data = {
        'leads_s': skill.leads,
        'warmup_s': skill.warmup,
        'until_s': skill.until,
        'window_s': skill.window,
        'confidence_of_intervals': CONFIDENCE,
        'axes': {axis: _scores_as_data(scores, 'rad') for axis, scores in skill.axes.items()},
        **_points_as_data(skill.points),
        'step_s': skill.step_time,
        'refit_s': skill.refit_time,
        **warnings_as_data(skill.advice),
    }
    if skill.quiescence is not None and skill.quiescence_limits is not None:
        r, limits = skill.quiescence, skill.quiescence_limits
        data['quiescence'] = {
            'limits': {name: getattr(limits, name) for name in (*ATTITUDE, 'duration')},
            'edges': r.edges,
            'count': r.count,
            'forecast': r.forecast,
            'observed': r.observed,
            'brier': r.brier,
            'brier_of_climate': r.brier_of_climate,
        }
    if skill.decisions is not None:
        data['decisions'] = asdict(skill.decisions)
    return finite_or_none(data)


def _points_as_data(points: Mapping[str, Mapping[str, Any]]):
    if not points:
        return {}
    return {
        'points': {
            name: {kind: _scores_as_data(scores, POINT_UNITS[kind]) for kind, scores in kinds.items()}
            for name, kinds in points.items()
        }
    }


def _scores_as_data(scores: Any, unit: str):
    return {
        f'deviation_{unit}': scores.deviation,
        'counted': scores.counted,
        'unmeasured': scores.unmeasured,
        'nrmse': scores.nrmse,
        'nrmse_interval': scores.interval,
        'nrmse_expected': scores.expected,
        **({} if scores.valid_lead is None else {'valid_lead': asdict(scores.valid_lead)}),
        'best_baseline': scores.best,
        'ratio': scores.ratio,
        'ratio_interval': scores.ratio_interval,
        'stood_in': scores.replaced_share,
        'coverage': {f'{100 * level:g}': scores.coverage[:, k] for k, level in enumerate(LEVELS)},
        'after_gap': {'within_s': AFTER_GAP, 'share': scores.gap_share, 'nrmse': scores.gap_nrmse},
    }


def conclusion_of(skill: Skill) -> list[str]:
    """Who forecasts best, by how much and to which lead, a line for each axis, and how far forecasts are trusted."""
    leads = np.asarray(skill.leads)
    lines = [f'{axis_in_words(axis, skill.installation)}: {_winner(leads, each)}' for axis, each in skill.axes.items()]
    valid = [
        f'{axis} {scores.valid_lead.lead[0]:.2g} s'
        for axis, scores in skill.axes.items()
        if scores.valid_lead is not None and np.isfinite(scores.valid_lead.lead[0])
    ]
    return [*lines, *([f'valid lead, in the median: {", ".join(valid)}'] if valid else [])]


def _winner(leads: np.ndarray, scores: QuantitySkill) -> str:
    """Where the forecast is better or worse than the best other method, beyond chance, and by how much."""
    if not scores.counted.any():
        return 'no forecast could be scored'
    low, high = scores.ratio_interval.T
    known = np.isfinite(low + high)
    parts = []
    size = '{ratios} of the error of {best}, the best other method'
    for found, words in (
        (high < 1.0, f'the forecast wins {{where}} ({size})'),
        (low > 1.0, f'the forecast loses {{where}} ({size})'),
        (known & (low <= 1.0) & (high >= 1.0), f'the difference is within chance {{where}} ({size})'),
        (
            np.isfinite(scores.ratio) & ~known,
            f'{{where}} the forecast has {size}; the record is too short to exclude chance',
        ),
    ):
        if found.any():
            best = dict.fromkeys(LABELS[name] for name, is_so in zip(scores.best, found, strict=True) if is_so)
            ratios = ', '.join(cell(value, 2) for value in scores.ratio[found])
            where = _leads_in_words(leads, found)
            parts.append(words.format(where=where, ratios=ratios, best=', '.join(best)))
    return '; '.join(parts)


def _leads_in_words(leads: np.ndarray, chosen: np.ndarray) -> str:
    own = [f'{lead:g}' for lead in leads[chosen]]
    if len(own) > 1 and chosen[: len(own)].all():
        return f'from {own[0]} to {own[-1]} s'
    return f'from {own[0]} s on' if chosen[-len(own) :].all() and not chosen.all() else f'at {", ".join(own)} s'


def cell(value: float, digits: int = 3) -> str:
    """A score as it is printed."""
    return f'{value:.{digits}f}' if np.isfinite(value) else '-'


def methods_of(nrmse: dict[str, Any]) -> list[tuple[str, tuple[str, ...]]]:
    """Label and names of the methods with equal scores: on a short record VAR(60) has the order of VAR(40)."""
    methods: dict[tuple, list[str]] = {}
    for name, values in nrmse.items():
        methods.setdefault(tuple(map(cell, values)), []).append(name)
    return [(' = '.join(LABELS[name] for name in names), tuple(names)) for names in methods.values()]
