"""Channels of a trial at even times, gaps bridged, for diagnoses."""

import math

import numpy as np
from scipy.signal import lfilter

from swath_sysid.manoeuvring.motion.resampling import slope
from swath_sysid.manoeuvring.motion.trial import STEP, ManoeuvringTrial, turned

MOVING = 0.3  #: m/s; above this the course indicates the heading.


def even(trial: ManoeuvringTrial, *names: str) -> tuple[np.ndarray, list[np.ndarray | None]]:
    """Channels at even times, s and values, gaps bridged; None where not measured."""
    time = np.arange(trial.time[0], trial.time[-1], STEP)
    found: list[np.ndarray | None] = []
    for name in names:
        values = getattr(trial, name)
        known = np.isfinite(values) if values is not None else np.zeros(1, dtype=bool)
        if known.sum() < 2:
            found.append(None)
            continue
        values = np.unwrap(values[known]) if name == 'heading' else values[known]
        found.append(np.interp(time, trial.time[known], values))
    return time, found


def speeds_of_track(trial: ManoeuvringTrial) -> tuple[np.ndarray, np.ndarray] | None:
    """Surge and sway from position and heading, m/s, at even times; None where not measured."""
    _, (heading, x, y) = even(trial, 'heading', 'x', 'y')
    if heading is None or x is None or y is None:
        return None
    return turned(slope(x, STEP, 3.1), slope(y, STEP, 3.1), heading)


def lowpass(values: np.ndarray, tau: float) -> np.ndarray:
    """First-order low pass with time constant ``tau``, s."""
    decay = math.exp(-STEP / tau)
    return lfilter([1.0 - decay], [1.0, -decay], values, zi=[decay * values[0]])[0]
