"""Free simulation over windows, compared with the measurements."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.manoeuvring.hull import measurement
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.simulation import states_under, substeps_for, track
from swath_sysid.manoeuvring.hull.thrust import acting_thrust
from swath_sysid.manoeuvring.identification.settings import LEADS, LENGTH, Windows, cut
from swath_sysid.manoeuvring.motion.resampling import smoothed
from swath_sysid.manoeuvring.motion.trial import CHANNELS, CraftRun, turned

RUN_AWAY = 3.0  #: A motion beyond this multiple of the largest measured one has diverged.


@dataclass(frozen=True)
class Simulated:
    """Free simulation of the windows of some runs."""

    windows: Windows
    states: np.ndarray  #: (S + 1, 3, W); Surge, sway over ground, yaw rate as recorded; NaN beyond the end of a window.
    heading: np.ndarray  #: (S + 1, W); rad; from zero where not measured.
    x: np.ndarray  #: (S + 1, W); m; from zero where not measured.
    y: np.ndarray  #: (S + 1, W); m; from zero where not measured.


@dataclass(frozen=True)
class Scores:
    """Fit of the free simulation of runs, window by window."""

    r2: dict[str, float]  #: Of surge, sway, yaw_rate over all windows together; NaN where not measured or not excited.
    rmse: dict[str, float]  #: m/s and rad/s; NaN where not measured.
    position_error: dict[float, float]  #: Root mean square by lead, m; NaN where all windows are shorter.
    heading_error: dict[float, float]  #: rad.
    windows: int  #: How many there are.
    diverged: int  #: How many of them ran away.


def simulate_windows(
    model: ManoeuvringModel, runs: Sequence[CraftRun], length: float = LENGTH, currents: np.ndarray | None = None
) -> Simulated:
    """Every window of some runs under currents (R, 2), m/s, or the model's; an unmeasured sway starts from zero."""
    windows = cut(runs, length)
    currents = np.tile(model.current, (len(runs), 1)) if currents is None else np.asarray(currents)
    current = currents[windows.run_index].T
    acting = [acting_thrust(run.port, run.starboard, model.values, run.step) for run in runs]
    thrust = np.stack([windows.gather([a[side] for a in acting]) for side in (0, 1)])
    heading = windows.heading
    p = model.values
    surge, sway, rate = windows.initial
    state = np.nan_to_num(np.stack([*measurement.through_water(surge, sway, rate, heading[0], current, p), rate]))
    substeps = substeps_for(model, windows.step, np.max(np.abs(state), axis=1), np.max(np.abs(thrust)))
    with np.errstate(over='ignore', invalid='ignore'):
        u, v, r = np.moveaxis(states_under(p, state, thrust, windows.step, substeps), 1, 0)
        course, nowhere = heading[0] - measurement.deviation(heading[0], p), np.zeros((2, windows.count))
        psi, x, y = track((u, v, r), windows.step, course, nowhere, current)
        compass = measurement.recorded_heading(psi, p)
        recorded = np.stack([*measurement.recorded_speeds(u, v, r, compass, current, p), r], axis=1)
        place = np.stack(measurement.recorded_position(x, y, psi, p))
        start = np.stack([_at_start(windows, name) for name in ('x', 'y')])
        x, y = place - place[:, :1] + start[:, None]
    behind = np.arange(len(psi))[:, None] > windows.steps
    recorded[np.repeat(behind[:, None], 3, axis=1)] = np.nan
    return Simulated(windows, recorded, *(np.where(behind, np.nan, a) for a in (compass, x, y)))


def score(
    model: ManoeuvringModel, runs: Sequence[CraftRun], length: float = LENGTH, currents: np.ndarray | None = None
) -> Scores:
    """Scores of a model on some runs; see `simulate_windows`."""
    found = simulate_windows(model, runs, length, currents=currents)
    windows = found.windows
    r2, rmse = {}, {}
    for c, name in enumerate(CHANNELS):
        known = np.isfinite(windows.measured[c])
        measured, simulated = windows.measured[c][known], found.states[:, c][known]
        spread = np.sum((measured - measured.mean()) ** 2) if known.any() else 0.0
        if spread <= 0.0:
            r2[name] = rmse[name] = float('nan')
            continue
        with np.errstate(over='ignore', invalid='ignore'):
            error = np.sum((measured - simulated) ** 2)
        r2[name] = float(1.0 - error / spread) if np.isfinite(error) else float('-inf')
        rmse[name] = float(np.sqrt(error / measured.size)) if np.isfinite(error) else float('inf')
    position, heading = {}, {}
    references = [_reference_track(run) for run in runs]
    for lead in LEADS:
        position[lead], heading[lead] = _errors_at(found, references, lead)
    return Scores(r2, rmse, position, heading, windows.count, _diverged(found))


def _errors_at(found: Simulated, references: list[tuple], lead: float):
    windows = found.windows
    step = round(lead / windows.step)
    turns, missed = [], []
    for w in np.flatnonzero(windows.steps >= step):
        psi, x, y = references[windows.run_index[w]]
        begin, end = windows.start[w], windows.start[w] + step
        if psi is None:
            continue
        turns.append(found.heading[step, w] - found.heading[0, w] - (psi[end] - psi[begin]))
        if x is None:
            continue
        # directions relative to the course at the start, so that tracks without a compass compare as well
        away = turned(found.x[step, w] - found.x[0, w], found.y[step, w] - found.y[0, w], found.heading[0, w])
        went = turned(x[end] - x[begin], y[end] - y[begin], psi[begin])
        missed.append(np.hypot(away[0] - went[0], away[1] - went[1]))
    return tuple(
        float(np.sqrt(np.mean(np.square(np.clip(errors, -1e6, 1e6))))) if errors else float('nan')
        for errors in (missed, turns)
    )


def _reference_track(run: CraftRun):
    """Measured heading and position, smoothed; integrated from rate and speeds where not measured."""
    surge, sway, rate = (None if np.isnan(s).all() else np.where(np.isfinite(s), s, 0.0) for s in run.smooth)
    heading = run.heading
    if heading is None and rate is not None:
        heading = np.concatenate([[0.0], np.cumsum(0.5 * run.step * (rate[1:] + rate[:-1]))])
    if heading is None:
        return None, None, None
    heading = smoothed(heading, run.step)
    if run.x is not None and run.y is not None and run.heading is not None:
        return heading, smoothed(run.x, run.step, 0.8), smoothed(run.y, run.step, 0.8)
    if surge is None:
        return heading, None, None
    side = np.zeros_like(surge) if sway is None else sway
    _, x, y = track((surge, side, np.gradient(heading, run.step)), run.step, heading[0], (0.0, 0.0), (0.0, 0.0))
    return heading, x, y


def _diverged(found: Simulated):
    """Number of windows beyond the bounds, or not finite."""
    measured = np.nanmax(np.abs(found.windows.measured), axis=(1, 2), initial=0.0)
    limits = RUN_AWAY * np.maximum(measured, [0.5, 0.5, 0.1])
    inside = np.arange(len(found.states))[:, None] <= found.windows.steps
    with np.errstate(invalid='ignore'):
        away = ~(np.abs(found.states) <= limits[:, None]) & inside[:, None]
    # an unmeasured sway has no bound to leave, but must stay finite
    if not np.isfinite(found.windows.measured[1]).any():
        away[:, 1] = ~np.isfinite(found.states[:, 1]) & inside
    return int(np.any(away, axis=(0, 1)).sum())


def _at_start(windows: Windows, name: str):
    series = [getattr(run, name) for run in windows.runs]
    starts = zip(windows.run_index, windows.start, strict=True)
    return np.array([0.0 if series[run] is None else series[run][start] for run, start in starts])
