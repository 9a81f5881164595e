"""The skill of forecasts as plain data."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from swath_sysid.attitude.prediction.forecast import LEVELS
from swath_sysid.attitude.prediction.quiescence import ATTITUDE
from swath_sysid.pipeline.scoring import AFTER_GAP, CONFIDENCE
from swath_sysid.report.fit_summary import warnings_as_data

if TYPE_CHECKING:
    from swath_sysid.pipeline.scoring import Skill


POINT_UNITS = {'heave': 'm', 'vertical_velocity': 'm_s', 'vertical_acceleration': 'm_s2'}


def skill_as_data(skill: Skill) -> dict:
    """The scores as plain data for JSON; what is not known is None.

    Parameters
    ----------
    skill : Skill

    Returns
    -------
    dict
    """
    data = {
        'leads_s': skill.leads.tolist(),
        'warmup_s': skill.warmup,
        'until_s': skill.until,
        'window_s': skill.window,
        'confidence_of_intervals': CONFIDENCE,
        'axes': {axis: _scores_as_data(scores, 'rad') for axis, scores in skill.axes.items()},
        **_points_as_data(skill.points),
        'step_s': {name: _known(value) for name, value in skill.step_time.items()},
        'refit_s': {name: _known(value) for name, value in skill.refit_time.items()},
        **warnings_as_data(skill.advice),
    }
    if skill.quiescence is not None and skill.quiescence_limits is not None:
        r, limits = skill.quiescence, skill.quiescence_limits
        data['quiescence'] = {
            'limits': {name: _known(getattr(limits, name)) for name in (*ATTITUDE, 'duration')},
            'edges': r.edges.tolist(), 'count': r.count.tolist(), 'told': _plain(r.told),
            'happened': _plain(r.happened), 'brier': _known(r.brier), 'brier_of_climate': _known(r.brier_of_climate),
        }  # fmt: skip
    return data


def _points_as_data(points):
    if not points:
        return {}
    return {'points': {
        name: {kind: _scores_as_data(scores, POINT_UNITS[kind]) for kind, scores in kinds.items()}
        for name, kinds in points.items()
    }}  # fmt: skip


def _scores_as_data(scores, unit):
    return {
        f'deviation_{unit}': scores.deviation,
        'counted': scores.counted.tolist(),
        'unmeasured': scores.unmeasured.tolist(),
        'nrmse': {name: _plain(values) for name, values in scores.nrmse.items()},
        'nrmse_interval': [_plain(ends) for ends in scores.interval],
        'best_baseline': list(scores.best),
        'ratio': _plain(scores.ratio),
        'ratio_interval': [_plain(ends) for ends in scores.ratio_interval],
        'stood_in': {name: _plain(values) for name, values in scores.stood_in.items()},
        'coverage': {f'{100 * level:g}': _plain(scores.coverage[:, k]) for k, level in enumerate(LEVELS)},
        'after_gap': {
            'within_s': AFTER_GAP,
            'share': _plain(scores.gap_share),
            'nrmse': {name: _plain(values) for name, values in scores.gap_nrmse.items()},
        },
    }


def _known(value):
    return float(value) if np.isfinite(value) else None


def _plain(values):
    return [_known(value) for value in values]
