"""How far forecasts said that they can be trusted, and what their errors were there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.pipeline.baselines import Record
from swath_sysid.pipeline.record_run import Issued


@dataclass(frozen=True)
class ValidLeadSkill:
    """The valid leads of one axis, and the errors at them."""

    lead: np.ndarray  #: (3,); s; the median, and the bounds of the central 80 %.
    error_over_limit: float  #: Root mean square of the errors at the valid leads over the limit; 1 is calibrated.
    counted: int  #: Errors in it: neither zero nor the whole horizon, and measured then.
    beyond_horizon: float  #: Share of the forecasts whose limit lies beyond the horizon.


def score_valid_leads(record: Record, axis: str, steps: Sequence[Issued]) -> ValidLeadSkill:
    """Score the valid leads of an axis that were issued at these steps.

    At a valid lead within the horizon the expected error is the limit, so that errors are divided by it as issued.
    """
    leads = np.array([step.horizon.valid_leads.get(axis, np.nan) for step in steps])
    known, end = np.isfinite(leads), np.array([step.horizon.leads[-1] for step in steps])
    ratio = []
    for step, lead in zip(steps, leads, strict=True):
        if 0.0 < lead < step.horizon.leads[-1]:
            ahead = step.horizon.axes[axis]
            columns = ahead.angle, np.sqrt(ahead.covariance[:, 0, 0])
            angle, expected = (np.interp(lead, step.horizon.leads, column) for column in columns)
            came = record.at(np.array(step.stamp + lead), [record.names.index(axis)])[0]
            ratio.append((angle - came) / expected)
    measured = np.array(ratio)[np.isfinite(ratio)]
    return ValidLeadSkill(
        np.quantile(leads[known], (0.5, 0.1, 0.9)) if known.any() else np.full(3, np.nan),
        float(np.sqrt(np.mean(measured**2))) if measured.size else np.nan,
        measured.size,
        float(np.mean(leads[known] >= end[known])) if known.any() else np.nan,
    )
