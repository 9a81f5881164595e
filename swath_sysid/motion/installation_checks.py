"""Whether a sensor sits in the craft as it was said to, judged from its own data.

Gravity is held against the attitude, and the rates against the derivative of the angles. A sensor whose orientation,
rates and accelerations are all turned alike about the vertical agrees with itself: no such check can see it.
"""
from collections import deque

import numpy as np

from swath_sysid.motion.contradictions import (
    FROZEN_CODES,
    GRAVITY_CODES,
    OFFSET_CODES,
    RATE_CODES,
    Contradiction,
    Judgement,
)
from swath_sysid.motion.gravity_check import (
    accelerations_follow,
    direction_of_gravity,
    list_of_craft,
    mean_force_of,
    mean_up,
    points_somewhere,
    size_of_gravity,
)
from swath_sysid.motion.rate_check import evidenced_axes, rates_against_angles
from swath_sysid.motion.rate_comparison import compare_rates

WINDOW = 30.0
"""s; over so long the accelerations of waves average out."""

INTERVAL = 5.0
"""s between judgements of a running sensor."""

LEAST_DURATION = 9.0
"""s below which a mean acceleration is not taken for gravity while a sensor runs."""

BIN = 0.05
"""s; samples are averaged to so coarse a time base, unless their own is coarser: craft roll in 1 s and more."""

LEAST_BINS = 40

WINDOW_BINS = 300
"""Bins of a window of a sensor so slow that `WINDOW` holds fewer."""

FROZEN = 5.0
"""s of fresh stamps with the same values; the noise of a sensor does not repeat."""

CONFIRMATIONS = 2
"""Judgements in a row that must agree on a contradiction, or on its end."""

MOST_STRETCHES = 20
"""Of a long record, over which they are spread; up to twice as many are judged."""

MOST_SAMPLES = 60_000
"""Kept between judgements: a minute at 1 kHz."""

LEAST_FRESH = 2

GAP_NS = 3_000_000_000
"""ns; a longer silence begins a window anew."""

PARTS = (
    ('roll', 'pitch', 'yaw'), ('roll_rate', 'pitch_rate', 'yaw_rate'), ('accel_x', 'accel_y', 'accel_z')
)  # fmt: skip


def judge(time, angles, rates, force, *, installation, interval, least_duration=0.0):
    """Judge one stretch of data.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s, increasing.
    angles, rates, force : ndarray, shape (N, 3)
        Roll, pitch, yaw, rad; their rates, rad/s; specific force in the axes of the craft, m/s^2. All as the
        installation makes them; NaN where not known.
    installation : Installation
        What frame and mounting were taken to be.
    interval : float
        s between the samples of the sensor.
    least_duration : float
        s below which nothing is judged.

    Returns
    -------
    Judgement
    """
    if time.size < LEAST_BINS or time[-1] - time[0] < least_duration:
        return Judgement()
    if _is_frozen(time, angles, rates, force):
        return Judgement((Contradiction('sensor-frozen', (
            f'every value of the sensor has been the same for {FROZEN:g} s while its stamps go on: restart its driver, '
            f'and look for one that repeats its last message'
        )),), FROZEN_CODES)  # fmt: skip
    up, mean_force = mean_up(angles), mean_force_of(force)
    comparison = _compared(time, angles, rates)
    decided, found, turn = FROZEN_CODES, [], None
    if mean_force is not None:
        found += size_of_gravity(mean_force)
    if mean_force is not None or up is not None:
        decided |= GRAVITY_CODES
    if mean_force is not None and points_somewhere(mean_force):
        turn, contradictions = direction_of_gravity(
            mean_force / np.linalg.norm(mean_force), up, np.isfinite(angles[:, 0]).any(), comparison, installation
        )
        found += contradictions
    elif up is not None:
        found += list_of_craft(up, installation)
    if comparison is not None and turn is None:
        decided |= OFFSET_CODES | (RATE_CODES if np.any(evidenced_axes(comparison)) else frozenset())
        found += rates_against_angles(comparison, interval, accelerations_follow(angles, force), installation)
    return Judgement(tuple(found), decided)


def _is_frozen(time, angles, rates, force):
    """Whether nothing that is measured has changed for `FROZEN`; angles alone may stand still."""
    if not (np.isfinite(rates).any() or np.isfinite(force).any()):
        return False
    first = np.searchsorted(time, time[-1] - FROZEN)
    if first == 0:
        return False
    return all(
        np.all((part[first:] == part[first]) | np.isnan(part[first:])) for part in (angles, rates, force)
    ) and bool(np.isfinite(rates[first:]).any() or np.isfinite(force[first:]).any())


def _compared(time, angles, rates):
    """Rates and angles compared on an even time base; None where there is too little of either."""
    known = np.isfinite(rates).any(axis=0)
    usable = np.isfinite(angles[:, :2]).any(axis=0)
    if not known.any() or not usable.any():
        return None
    whole = np.ones(time.size, dtype=bool)
    for part in (angles, rates):
        for column in part.T:
            if np.isfinite(column).any():
                whole &= np.isfinite(column)
    # what is left out is bridged, unless it is much
    if np.count_nonzero(whole) < max(LEAST_BINS, 0.5 * time.size):
        return None
    step = float(np.median(np.diff(time)))
    kept = time[whole]
    if np.max(np.diff(kept)) > max(1.0, 4.0 * step):
        return None
    even = np.arange(kept[0], kept[-1], step)
    if even.size < LEAST_BINS:
        return None

    def evened(part):
        columns = [
            np.interp(even, kept, column[whole]) if np.isfinite(column).any() else np.full(even.size, np.nan)
            for column in part.T
        ]
        return np.stack(columns, axis=1)

    unwrapped = np.full(angles.shape, np.nan)
    unwrapped[whole] = np.unwrap(angles[whole], axis=0)
    return compare_rates(step, evened(unwrapped), evened(rates))


def contradictions_in(time, channels, installation):
    """What contradicts itself in a whole record.

    The record is judged in stretches. What stands is found in most of those that can tell; a sensor that froze, in any.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s, increasing.
    channels : dict of str to ndarray, shape (N,)
        Any of ``roll``, ``pitch``, ``yaw``, ``roll_rate``, ``pitch_rate``, ``yaw_rate``, ``accel_x``, ``accel_y``,
        ``accel_z``, as the installation makes them.
    installation : Installation

    Returns
    -------
    tuple of Contradiction
    """
    parts = [
        np.stack([np.asarray(channels.get(name, np.full(time.size, np.nan)), dtype=float) for name in names], axis=1)
        for names in PARTS
    ]
    interval = float(np.median(np.diff(time)))
    time, *parts = _binned(time, parts, interval)
    size = max(WINDOW_BINS, round(WINDOW / float(np.median(np.diff(time)))))
    starts = range(0, max(time.size - size // 2, 1), size // 2)
    judgements = []
    for start in starts[:: max(len(starts) // MOST_STRETCHES, 1)]:
        stretch = slice(start, start + size)
        judgements.append(
            judge(time[stretch], *(part[stretch] for part in parts), installation=installation, interval=interval)
        )
    found = {}
    for judgement in judgements:
        for contradiction in judgement.contradictions:
            found.setdefault((contradiction.code, contradiction.axis), []).append(contradiction)
    return tuple(
        each[len(each) // 2] for (code, _), each in found.items()
        if code in FROZEN_CODES or len(each) > 0.5 * sum(code in judgement.decided for judgement in judgements)
    )  # fmt: skip


def _binned(time, parts, interval):
    """Samples averaged by so many that a bin is `BIN` long; a value that is missing leaves its bin unknown."""
    count = max(int(BIN / interval + 0.5), 1) if interval > 0.0 else 1
    if count == 1 or time.size < 2 * count:
        return time, *parts
    whole = time.size // count * count
    angles, *others = (part[:whole].reshape(-1, count, 3) for part in parts)
    # a mean of angles across the jump at pi would be none
    first = angles[:, :1]
    angles = first + (angles - first + np.pi) % (2.0 * np.pi) - np.pi
    return (
        time[:whole].reshape(-1, count).mean(axis=1), angles.mean(axis=1), *(other.mean(axis=1) for other in others)
    )


class InstallationCheck:
    """The judgement of a running sensor: what it has been found to contradict, until it no longer does.

    Parameters
    ----------
    installation : Installation
        What frame and mounting are taken to be.
    """

    def __init__(self, installation):
        self._installation = installation
        self._fresh = deque(maxlen=MOST_SAMPLES)
        self._bins = None
        self._votes = {}
        self._judged_ns = None
        self._decided = frozenset()
        self.contradictions = ()
        self.judgements = 0

    def add(self, sample):
        """Take in one sample.

        Parameters
        ----------
        sample : CraftSample
        """
        self._fresh.append(sample)

    @property
    def described(self):
        """What could be judged lately, in words."""
        if RATE_CODES <= self._decided:
            return 'gravity and rates agree with the attitude' if GRAVITY_CODES <= self._decided else (
                'the rates agree with the attitude')  # fmt: skip
        if GRAVITY_CODES <= self._decided:
            return 'gravity agrees with the attitude; the rates show when the craft moves'
        return 'not judged yet: it takes 10 s of samples, with orientation or accelerations'

    def judge(self):
        """Judge anew where enough has come in since the last time.

        Returns
        -------
        tuple of Contradiction
            What stands.
        """
        if len(self._fresh) < LEAST_FRESH:
            return self.contradictions
        first_ns, newest_ns = self._fresh[0][0], self._fresh[-1][0]
        if self._judged_ns is None:
            self._judged_ns = first_ns
        # a clock that was set back also is a reason to begin anew
        if 0 <= newest_ns - self._judged_ns < INTERVAL * 1e9:
            return self.contradictions
        self._judged_ns = newest_ns
        time, parts, interval = self._window()
        judgement = judge(
            time, *parts, installation=self._installation, interval=interval, least_duration=LEAST_DURATION
        )
        self._weigh(judgement)
        self._decided = judgement.decided
        self.judgements += bool(judgement.decided)
        return self.contradictions

    def _window(self):
        """Time and parts of the last `WINDOW`, in bins, with what is fresh."""
        table = np.array([sample[1:8] + sample[12:] for sample in self._fresh])
        stamps = np.array([sample[0] for sample in self._fresh], dtype=np.int64)
        self._fresh.clear()
        unbroken = np.flatnonzero((np.diff(stamps) <= 0) | (np.diff(stamps) > GAP_NS))
        if unbroken.size:
            stamps, table, self._bins = stamps[unbroken[-1] + 1:], table[unbroken[-1] + 1:], None
        if stamps.size < 2:
            return np.empty(0), tuple(np.empty((3, 0, 3))), 1.0
        if self._bins is not None and not 0 < stamps[0] - self._bins[0] < GAP_NS:
            self._bins = None
        roll, pitch, roll_rate, pitch_rate, accel_x, accel_y, accel_z, yaw, yaw_rate = table.T
        parts = [
            np.stack(part, axis=1) for part in (
                (roll, pitch, yaw), (roll_rate, pitch_rate, yaw_rate), (accel_x, accel_y, accel_z)
            )
        ]  # fmt: skip
        interval = float(np.median(np.diff(stamps))) * 1e-9
        origin = stamps[0] if self._bins is None else self._bins[1]
        time, *parts = _binned((stamps - origin) * 1e-9, parts, interval)
        if self._bins is not None:
            time = np.concatenate([self._bins[2], time])
            parts = [np.concatenate(both) for both in zip(self._bins[3], parts, strict=True)]
        kept = slice(max(time.size - max(WINDOW_BINS, np.count_nonzero(time > time[-1] - WINDOW)), 0), None)
        time, parts = time[kept], [part[kept] for part in parts]
        self._bins = stamps[-1], origin, time, parts
        return time, parts, interval

    def _weigh(self, judgement):
        """Contradictions stand, and fall, when so many judgements in a row agree."""
        found = {(each.code, each.axis): each for each in judgement.contradictions}
        for key, each in found.items():
            votes = self._votes.get(key, (0, None))[0]
            self._votes[key] = min(votes + 1, CONFIRMATIONS), each
        for key, (votes, each) in list(self._votes.items()):
            if key not in found and each.code in judgement.decided:
                self._votes[key] = votes - 1, each
                if votes <= 1:
                    del self._votes[key]
        held = {(each.code, each.axis) for each in self.contradictions}
        self.contradictions = tuple(
            each for key, (votes, each) in self._votes.items() if votes >= CONFIRMATIONS or key in held
        )
