"""Calm windows scored as decisions: how often to go was right, beside rules that need no forecast.

A decision is to go now, and it is right where the craft then stays inside the limits for the duration. False alarms are
those of an operator who goes at the first chance and is then busy for the duration.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.motion.trial import Trial
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.quiescence import QuiescenceLimits
from swath_sysid.pipeline.record_run import Issued

FORECAST = 'forecast'  #: Go where the forecast probability reaches that of a window of calm.
CALM_NOW = 'calm now'  #: Go where the newest sample is inside the limits.
CLIMATOLOGY = 'climatology'  #: Go at any time, the best that the base rate alone can do for F1.


@dataclass(frozen=True)
class RuleSkill:
    """One rule's decisions."""

    f1: float  #: Harmonic mean of precision and recall; 0 where it never goes and could.
    precision: float  #: Share of its decisions to go that were right; NaN where it never goes.
    recall: float  #: Share of the chances at which it goes; NaN where there was none.
    actions: int  #: Of the operator.
    false_alarms: float  #: Failed actions a minute.


@dataclass(frozen=True)
class DecisionSkill:
    """Decisions by forecast and by rules without one, at the same times."""

    counted: int  #: Decisions.
    base_rate: float  #: Share of the times at which to go was right.
    rules: dict[str, RuleSkill]
    edges: np.ndarray  #: (B + 1,); s; of the histogram of lead times.
    lead_times: np.ndarray  #: (B,); windows of calm that came, by how long before they began they were announced.
    unannounced: int  #: Windows of calm that came without.


def score_decisions(trial: Trial, steps: Sequence[Issued], limits: QuiescenceLimits) -> DecisionSkill | None:
    """Score the decisions at the steps of a run; None where no outcome is known."""
    stamps = np.array([step.stamp for step in steps])
    probability = np.array([step.outlook.quiescence for step in steps])
    inside = samples_inside(trial, limits)
    quiet = stays_inside(trial.time, inside, stamps, limits.duration)
    used = np.isfinite(quiet) & np.isfinite(probability)
    if not used.any():
        return None
    now = inside[np.searchsorted(trial.time, stamps, side='right') - 1]
    came = quiet[used] == 1.0
    going = {
        FORECAST: probability >= limits.probability,
        CALM_NOW: now == 1.0,
        CLIMATOLOGY: np.ones(stamps.size, dtype=bool),
    }
    edges = np.arange(np.ceil(steps[0].horizon.leads[-1]) + 1.0)
    found = lead_times(stamps, [step.outlook.calm for step in steps], quiet, limits.duration)
    return DecisionSkill(
        int(used.sum()),
        float(came.mean()),
        {name: score_rule(stamps[used], go[used], came, limits.duration) for name, go in going.items()},
        edges,
        np.histogram(np.minimum(found[np.isfinite(found)], edges[-1]), edges)[0],
        int(np.isnan(found).sum()),
    )


def samples_inside(trial: Trial, limits: QuiescenceLimits) -> np.ndarray:
    """Whether each sample is inside the limits of attitude, 1 or 0, shape (N,); NaN where one was not measured."""
    inside = np.ones(trial.time.size)
    for name, bound in zip(ATTITUDE, limits.bounds(ATTITUDE), strict=True):
        if np.isfinite(bound):
            values = trial.channels.get(name, np.full(trial.time.size, np.nan))
            inside *= np.where(np.isfinite(values), np.abs(values) <= bound, np.nan)
    return inside


def stays_inside(time: np.ndarray, inside: np.ndarray, stamps: np.ndarray, duration: float) -> np.ndarray:
    """Whether the craft stays inside after each stamp (M,) for the duration, s, 1 or 0. NaN where a sample of that
    time, at ``time`` (N,), was not measured, or the record ends before.
    """
    begin, end = (np.searchsorted(time, stamps + after + 1e-6, side='right') for after in (0.0, duration))
    outside, unknown = (np.concatenate([[0], np.cumsum(each)]) for each in (inside == 0.0, np.isnan(inside)))
    result = np.where(outside[end] == outside[begin], 1.0, 0.0)
    result[(unknown[end] > unknown[begin]) | (stamps + duration > time[-1] + 1e-6) | (begin == end)] = np.nan
    return result


def score_rule(stamps: np.ndarray, go: np.ndarray, came: np.ndarray, duration: float) -> RuleSkill:
    """Score a rule that goes at some stamps (M,), s, where to go was right at those of ``came``."""
    right, tries, chances = int((go & came).sum()), int(go.sum()), int(came.sum())
    actions, failed, busy_until = 0, 0, -np.inf
    for stamp, was_right in zip(stamps[go], came[go], strict=True):
        if stamp >= busy_until:
            actions, failed, busy_until = actions + 1, failed + (not was_right), stamp + duration
    minutes = max(float(stamps[-1] - stamps[0]), duration) / 60.0
    return RuleSkill(
        2.0 * right / (tries + chances) if tries + chances else np.nan,
        right / tries if tries else np.nan,
        right / chances if chances else np.nan,
        actions,
        failed / minutes,
    )


def lead_times(stamps: np.ndarray, windows: Sequence, quiet: np.ndarray, duration: float) -> np.ndarray:
    """How long each window of calm that came had been announced, s, when it began; NaN where it had not. One begins
    where ``quiet`` (M,), of the time from a stamp on, becomes 1, and ends a duration, s, after the last 1. It is
    announced while forecasts hold a window, (start, end, ...) in s from their stamp or None, over its middle.
    """
    found = []
    ends = np.append(np.flatnonzero(quiet[:-1] > quiet[1:]), quiet.size - 1)
    for first in (np.flatnonzero(quiet[1:] > quiet[:-1]) + 1).tolist():
        middle = 0.5 * (stamps[first] + stamps[ends[np.searchsorted(ends, first)]] + duration)
        announced = np.nan
        for stamp, window in zip(stamps[first::-1], windows[first::-1], strict=True):
            if window is None or not window[0] <= middle - stamp <= window[1]:
                break
            announced = stamps[first] - stamp
        found.append(announced)
    return np.array(found)
