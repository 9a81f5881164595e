"""Corrects a misaligned compass by the motion of the craft."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from swath_sysid.common.advice import Advice
from swath_sysid.common.chance import SIGNIFICANT
from swath_sysid.manoeuvring.motion.resampling import MOVING, TURNING, even, lowpass, speeds_of_track
from swath_sysid.manoeuvring.motion.trial import STEP, ManoeuvringTrial, turned

MIN_MISALIGNMENT = math.radians(4.0)
USUAL_CURRENT = 0.3  #: m/s, prior standard deviation of a current.

#: rad, prior standard deviation of the compass deviation by course, which the identification finds.
USUAL_DEVIATION = 0.15

#: Largest share of time that runs may turn to one side: drift would then look like misalignment.
ONE_SIDED = 0.75
REMEMBERED = 10.0  #: Half seconds of correlated sway, which count as one sample.


def aligned(trials: list[ManoeuvringTrial], advice: list[list[Advice]]) -> list[ManoeuvringTrial]:
    """The trials with heading and speeds turned by the misalignment of the compass, where it is significant.

    The sway is regressed on its causes: misalignment times speed, deviation times speed and sine and cosine of the
    course, the current by course, and turns by the yaw rate.
    """
    rows = [_sway_by_cause(t) for t in trials]
    usable = [r for r in rows if r is not None]
    if not usable:
        return trials
    rate = np.concatenate([causes[:, 1] for _, causes, _ in usable])
    if max(np.mean(rate > TURNING), np.mean(rate < -TURNING)) > ONE_SIDED:
        return trials
    sway, shared = (np.concatenate([row[k] for row in usable]) for k in (0, 1))
    matrix = np.concatenate([shared, block_diag(*(course for _, _, course in usable))], axis=1)
    prior = [0.0] * 3 + [USUAL_DEVIATION**-2.0] * 2 + [USUAL_CURRENT**-2.0] * 2 * len(usable)
    variance = max(float(np.var(sway)), 1e-6)
    for _ in range(3):
        information = matrix.T @ matrix / (variance * REMEMBERED) + np.diag(prior)
        covariance = np.linalg.pinv(information, hermitian=True)
        found = covariance @ (matrix.T @ sway) / (variance * REMEMBERED)
        variance = max(float(np.mean((sway - matrix @ found) ** 2)), 1e-6)
    offset, std = float(np.arctan(found[0])), float(np.sqrt(covariance[0, 0]))
    if abs(offset) < max(MIN_MISALIGNMENT, SIGNIFICANT * std):
        return trials
    size, side = abs(math.degrees(offset)), 'port' if offset > 0.0 else 'starboard'
    for item, trial in zip(advice, trials, strict=True):
        item.append(Advice.of('compass-misaligned', source=trial.source, offset=size, side=side))
    return [_turned(trial, offset) for trial in trials]


def _sway_by_cause(trial: ManoeuvringTrial):
    """Sway (N,) every half second under way ahead, its causes (N, 5), and the effect of an east and a north current (N,
    2). The causes are surge, yaw rate, their product, and surge times sine and cosine of the heading. None where not
    measured.
    """
    _, (heading, surge, sway) = even(trial, 'heading', 'surge', 'sway')
    if heading is None:
        return None
    if surge is None or sway is None:
        track = speeds_of_track(trial)
        if track is None:
            return None
        surge, sway = track
    rate = np.gradient(lowpass(heading, 0.5), STEP)
    surge, sway = lowpass(surge, 0.5), lowpass(sway, 0.5)
    keep = np.arange(surge.size) % round(0.5 / STEP) == 0
    keep &= surge > MOVING
    if keep.sum() < 10:
        return None
    causes = np.stack([surge, rate, surge * rate, surge * np.sin(heading), surge * np.cos(heading)], axis=1)
    return sway[keep], causes[keep], np.stack([-np.sin(heading), np.cos(heading)], axis=1)[keep]


def _turned(trial: ManoeuvringTrial, offset: float):
    """The trial with heading and speeds turned to port by an angle, rad."""
    changed: dict[str, Any] = {}
    if trial.heading is not None:
        changed['heading'] = trial.heading + offset
    if trial.surge is not None and trial.sway is not None:
        changed['surge'], changed['sway'] = turned(trial.surge, trial.sway, offset)
    return replace(trial, **changed)
