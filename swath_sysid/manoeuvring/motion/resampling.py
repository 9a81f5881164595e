"""Records resampled to even steps: inputs held, fast channels averaged, slow ones at the nearest step; smoothing."""

import math

import numpy as np
from scipy.ndimage import gaussian_filter1d

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.common.signals import bin_means, white_noise
from swath_sysid.manoeuvring.motion.trial import STEP, ManoeuvringTrial, turned

HOLD = 0.5  #: s for which a command holds where gaps mean zero.
MOVING = 0.3  #: m/s; above this the course indicates the heading.
TURNING = 0.02  #: rad/s; a craft with less yaw rate is on a straight course, which says nothing of turns.
LONGEST_GAP = 1.0  #: s; over longer gaps the thrust is unknown.
SMOOTHING = 0.4  #: s, width of the Gaussian window.
NOISY = 0.1  #: Noise of this share of the motion gets the full smoothing.


def smoothed(values: np.ndarray, step: float, width: float = SMOOTHING) -> np.ndarray:
    """Local linear fit with a Gaussian window of ``width`` s, shape (N,); NaN far from all samples."""
    known = np.isfinite(values)
    if not known.any():
        return np.full(values.size, np.nan)
    spacing, motion = values.size / known.sum(), float(np.std(values[known]))
    # of less noise less smoothing
    noisy = known.sum() < 8 or motion == 0.0
    share = 1.0 if noisy else float(np.clip(white_noise(values[known]) / (NOISY * motion), 0.3, 1.0))
    sigma = max(width * share / step, 0.8 * spacing)
    place = np.arange(values.size, dtype=float)
    filled = np.where(known, values, 0.0)

    def spread(weights: np.ndarray) -> np.ndarray:
        return gaussian_filter1d(weights, sigma, mode='constant', truncate=4.0)

    w0, m1, m2 = spread(1.0 * known), spread(known * place), spread(known * place**2)
    y0, y1 = spread(filled), spread(filled * place)
    # moments about each place itself, so that long records lose no digits
    s1, s2 = m1 - place * w0, m2 - 2 * place * m1 + place**2 * w0
    t1 = y1 - place * y0
    with np.errstate(invalid='ignore', divide='ignore'):
        fit = np.where(w0 * s2 - s1**2 > 1e-6 * w0, (s2 * y0 - s1 * t1) / (w0 * s2 - s1**2), y0 / w0)
    return np.where(w0 > 1e-3 / spacing, fit, np.nan)


def thrust_on(
    grid: np.ndarray, trial: ManoeuvringTrial, gap_means_zero: bool, advice: list[Advice]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Port and starboard inputs held on the grid, and where they are known."""
    known = np.isfinite(trial.port) & np.isfinite(trial.starboard)
    if not known.any():
        if not gap_means_zero:
            raise InputError(f'{trial.source} holds no finite thrust of both thrusters: check its columns')
        return np.zeros(grid.size), np.zeros(grid.size), np.ones(grid.size, dtype=bool)
    time = trial.time[known]
    last = np.searchsorted(time, grid + 1e-6, side='right') - 1
    age = grid - time[np.maximum(last, 0)]
    started = last >= 0
    last = np.maximum(last, 0)
    port, starboard = trial.port[known][last], trial.starboard[known][last]
    hold = max(HOLD, 3.0 * float(np.median(np.diff(time)))) if time.size > 1 else HOLD
    if gap_means_zero:
        silent = ~started | (age > min(hold, LONGEST_GAP))
        port, starboard = np.where(silent, 0.0, port), np.where(silent, 0.0, starboard)
        return port, starboard, np.ones(grid.size, dtype=bool)
    driven = started & (age <= max(LONGEST_GAP, hold))
    lost = 1.0 - driven.mean()
    if lost > 0.001:
        advice.append(Advice.of('thrust-gaps', source=trial.source, lost=lost * (grid[-1] - grid[0])))
    return np.where(driven, port, 0.0), np.where(driven, starboard, 0.0), driven


def without_held(name: str, values: np.ndarray, advice: list[Advice], source: str) -> np.ndarray:
    """NaN for repetitions of the last value of a slower sensor."""
    known = np.flatnonzero(np.isfinite(values))
    changed = np.diff(values[known]) != 0.0
    if known.size < 20 or not changed.any() or np.std(values[known]) == 0.0:
        return values
    runs = np.diff(np.flatnonzero(np.concatenate([[True], changed, [True]])))
    usual = float(np.median(runs))
    if usual < 3.0 or np.mean(runs[runs > 1] <= 2.5 * usual) < 0.7:
        return values
    advice.append(Advice.of('held-samples', source=source, name=name, usual=usual))
    fresh = values.copy()
    fresh[known[1:][~changed]] = np.nan
    return fresh


def on_grid(grid: np.ndarray, step: float, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Fast channels averaged around each grid time, slow ones at the nearest, NaN elsewhere."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    interval = float(np.median(np.diff(time))) if time.size > 1 else step
    if interval < 0.75 * step:
        place = np.rint((time - grid[0]) / step).astype(int)
        inside = (place >= 0) & (place < grid.size)
        held, means = bin_means(place[inside], values[inside])
        found = np.full(grid.size, np.nan)
        found[held] = means
        return found
    after = np.clip(np.searchsorted(time, grid), 0, time.size - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(time[after] - grid) <= np.abs(grid - time[before]), after, before)
    near = np.abs(time[nearest] - grid) <= 0.5 * step + 1e-9
    if interval <= 1.5 * step:
        between = (time[after] - time[before] < 1.8 * interval) & (time[before] <= grid) & (grid <= time[after])
        return np.where(between, np.interp(grid, time, values), np.where(near, values[nearest], np.nan))
    return np.where(near, values[nearest], np.nan)


def slope(values: np.ndarray, step: float, span: float) -> np.ndarray:
    """Derivative of even samples by local parabolas over ``span`` seconds, shape (N,)."""
    from scipy.signal import savgol_filter

    window = max(5, 2 * int(span / step / 2) + 1)
    return savgol_filter(values, min(window, 2 * ((values.size - 1) // 2) + 1), 2, deriv=1, delta=step)


def bridged(values: np.ndarray) -> np.ndarray:
    """Values interpolated over gaps, shape (N,)."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(values.size)
    if known.all():
        return values
    place = np.arange(values.size)
    return np.interp(place, place[known], values[known])


def unwrapped(heading: np.ndarray) -> np.ndarray:
    """Heading without jumps of whole turns, also across gaps, shape (N,)."""
    known = np.isfinite(heading)
    found = np.full(heading.size, np.nan)
    found[known] = np.unwrap(heading[known])
    return found


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
    from scipy.signal import lfilter

    decay = math.exp(-STEP / tau)
    return lfilter([1.0 - decay], [1.0, -decay], values, zi=[decay * values[0]])[0]
