"""Releases: the last moment at which a craft was held away from its trim.

A hold is a stay on one side longer than a free half-cycle. At the release the acceleration jumps towards the trim.
"""

from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.attitude.motion.turning_points import EvenSignal, even_signal
from swath_sysid.common.signals import noise_level

HOLD_BAND = 0.6  #: Part of a hold's angle above which the craft counts as held: a hand wobbles by less than the rest.
MIN_HOLD = 0.5  #: Natural periods: a free swing stays above the band for 0.3 of one.
#: Parts of the angle between which the first fall is timed: a wobble makes the first pair late, damping the second.
FALLS = (0.9, 0.5), (0.7, 0.3)
BEFORE, AFTER = 0.15, 0.2  #: Natural periods on either side of a release that show its kink.
EARLIEST, LATEST = 0.25, 0.05  #: Natural periods about the beginning of that fall between which the release is sought.
PLAIN_JUMP = 20.0  #: Standard deviations from which half of those show it better: the polynomials bend less.
MIN_FALL = 0.5  #: Of the acceleration of a free swing of that angle and period.
PLAIN_SHARE = 0.35  #: Of the largest jump: the last one that reaches it is the release, those before are the hand's.
MIN_JUMP = 4.0  #: Standard deviations by which the acceleration jumps.
NARROWEST = 8  #: Candidate times in the part after a release below which it is not halved again.
FINEST_STEPS = 80  #: Candidate times across a search.


@dataclass(frozen=True)
class Release:
    """A release: when (record time, s), and since when the craft was held."""

    time: float
    hold_start: float
    angle: float  #: Where it was held, rad.
    trim: float  #: About which it then moved, rad.
    period: float  #: Natural period guessed from the first fall, s.


def find_releases(motion: AxisMotion, smallest: float) -> tuple[Release, ...]:
    """Every release of a motion with an angle, in order of time; a smaller angle from trim, rad, is no hold."""
    if motion.angle is None or motion.size < 50:
        return ()
    signal = even_signal(motion)
    trim = float(np.median(signal.value[-signal.value.size // 3 :]))
    away = signal.value - trim
    reach = float(np.abs(away).max())
    if reach < smallest:
        return ()
    found = [_release_of(motion, signal, away, trim, run) for run in _holds(away, HOLD_BAND * reach)]
    return tuple(release for release in found if release is not None)


def _holds(away: np.ndarray, level: float) -> list[tuple[int, int]]:
    """First and last index of each stay beyond a level on one side."""
    beyond = np.where(np.abs(away) >= level, np.sign(away), 0.0)
    edges = np.flatnonzero(np.diff(beyond) != 0.0)
    starts, ends = np.r_[0, edges + 1], np.r_[edges, away.size - 1]
    return [(a, b) for a, b in zip(starts, ends, strict=True) if beyond[a] != 0.0]


def _release_of(
    motion: AxisMotion, signal: EvenSignal, away: np.ndarray, trim: float, run: tuple[int, int]
) -> Release | None:
    """The release that ends a hold, or None where it was no hold or ended otherwise."""
    first, last = run
    if last - first < 8 or last >= away.size - 8:
        return None
    side = np.sign(away[last])
    held = side * away[first : last + 1]
    level = float(np.median(held))
    falls = [fall for fall in (_fall(side * away[first:] / level, last - first, *parts) for parts in FALLS) if fall]
    if not falls:
        return None
    top, period = min(falls, key=lambda fall: fall[1])
    period *= signal.interval
    if (last - first) * signal.interval < MIN_HOLD * period:
        return None
    at = signal.start + (first + top) * signal.interval
    earliest = max(signal.start + first * signal.interval, at - EARLIEST * period)
    latest = at + LATEST * period
    time = kink_time(motion, earliest, latest, period, -side, level)
    if time is None:
        return None
    return Release(time, signal.start + first * signal.interval, trim + side * level, trim, period)


def _fall(part: np.ndarray, held: int, start: float, end: float) -> tuple[int, float] | None:
    """Index where a hold falls below ``start`` of its angle on the way to ``end``, and samples per period."""
    below = np.flatnonzero(part[held:] < end)
    if not below.size:
        return None
    top = int(np.flatnonzero(part[: held + below[0]] >= start)[-1])
    return top, float(2.0 * np.pi * (held + below[0] - top) / (np.arccos(end) - np.arccos(start)))


def kink_time(
    motion: AxisMotion, earliest: float, latest: float, period: float, towards: float, level: float
) -> float | None:
    """When, s, the acceleration jumps ``towards`` a sign, or None; sought between two times, for a natural period, s.

    A parabola before and a quartic after, continuous in angle and rate, are fitted to both: where the jump is most
    significant, then, ever closer, where the residual is least. ``level`` is the angle held, rad from trim.
    """
    channels = [
        (values, max(noise_level(values), 1e-9), order)
        for order, values in enumerate((motion.angle, motion.rate))
        if values is not None
    ]
    before, after = BEFORE * period, AFTER * period
    least_fall = MIN_FALL * (2.0 * np.pi / period) ** 2 * level

    def fitted(time: float, begin: float, end: float) -> tuple[float, float] | None:
        inside = (motion.time >= begin) & (motion.time <= end)
        elapsed = motion.time[inside] - time
        if (elapsed < 0.0).sum() < 3 or (elapsed > 0.0).sum() < 5:
            return None
        held, free = np.minimum(elapsed, 0.0), np.maximum(elapsed, 0.0)
        one, zero = np.ones(elapsed.size), np.zeros(elapsed.size)
        shapes = (
            np.column_stack([one, elapsed, held**2 / 2, free**2 / 2, free**3 / 6, free**4 / 24]),
            np.column_stack([zero, one, held, free, free**2 / 2, free**3 / 6]),
        )
        rows = np.concatenate([shapes[order] / noise for _, noise, order in channels])
        right = np.concatenate([values[inside] / noise for values, noise, _ in channels])
        normal = np.linalg.pinv(rows.T @ rows)
        solution = normal @ (rows.T @ right)
        jump = np.array([0.0, 0.0, -1.0, 1.0, 0.0, 0.0])
        spread = np.sqrt(max(jump @ normal @ jump, 1e-300))
        falls = towards * solution[3] >= least_fall
        return towards * (jump @ solution) / spread if falls else -np.inf, float(np.sum((rows @ solution - right) ** 2))

    coarse = np.linspace(earliest, latest, FINEST_STEPS)

    def jumps_of(before: float, after: float) -> np.ndarray:
        scores = [fitted(t, t - before, t + after) for t in coarse]
        return np.array([-np.inf if score is None else score[0] for score in scores])

    jumps = jumps_of(before, after)
    # a hand's wobble bends less within half of the time
    while jumps.max() > PLAIN_JUMP and after > NARROWEST * (coarse[1] - coarse[0]):
        closer = jumps_of(0.5 * before, 0.5 * after)
        if not closer.max() > MIN_JUMP:
            break
        before, after, jumps = 0.5 * before, 0.5 * after, closer
    peaks = np.flatnonzero((jumps >= np.r_[-np.inf, jumps[:-1]]) & (jumps >= np.r_[jumps[1:], -np.inf]))
    plain = peaks[jumps[peaks] >= max(MIN_JUMP, PLAIN_SHARE * jumps.max())]
    if not plain.size:
        return None
    best = plain[-1]
    about, width, jump = coarse[best], 0.06 * period, jumps[best]
    while True:
        plain = jump > PLAIN_JUMP
        if plain:
            before, after = 0.5 * before, 0.5 * after
        fine = about + np.linspace(-width, width, FINEST_STEPS)
        fits = [fitted(t, about - before, about + after) for t in fine]
        residuals = [np.inf if fit is None else fit[1] for fit in fits]
        at = int(np.argmin(residuals))
        closest = fits[at]
        if closest is None or not np.isfinite(residuals[at]):
            return float(about)
        about, width, jump = fine[at], 0.5 * width, closest[0]
        if not plain or not jump > PLAIN_JUMP:
            return float(about)
