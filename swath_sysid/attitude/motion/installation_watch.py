"""A running sensor, watched: what its own data say of its installation, from sample to sample."""
from collections import deque

import numpy as np

from swath_sysid.attitude.motion.contradictions import GRAVITY_CODES, RATE_CODES
from swath_sysid.attitude.motion.installation_checks import BIN, PARTS, WINDOW, WINDOW_BINS, binned, judge
from swath_sysid.attitude.motion.intake import NANOSECOND, CraftSample

INTERVAL = 5.0
"""s between judgements of a running sensor."""

LEAST_DURATION = 9.0
"""s below which a mean acceleration is not taken for gravity while a sensor runs."""

CONFIRMATIONS = 2
"""Judgements in a row that must agree on a contradiction, or on its end."""

MOST_SAMPLES = 60_000
"""Kept between judgements: a minute at 1 kHz."""

GAP_NS = 3_000_000_000
"""ns; a longer silence begins a window anew."""

COLUMNS = tuple([CraftSample._fields.index(name) - 1 for name in names] for names in PARTS)
"""Places of the parts in a `CraftSample` without its stamp."""


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
        self._origin_ns = self._newest_ns = None
        self._time, self._parts = np.empty(0), list(np.empty((3, 0, 3)))
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
        if not self._fresh:
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
        """Time and parts of the last `WINDOW`, in bins, with what is fresh; s between the samples."""
        stamps = np.array([sample[0] for sample in self._fresh], dtype=np.int64)
        table = np.array([sample[1:] for sample in self._fresh])
        self._fresh.clear()
        steps = np.diff(stamps, prepend=stamps[0] if self._newest_ns is None else self._newest_ns)
        breaks = np.flatnonzero((steps < 0) | (steps > GAP_NS))
        if breaks.size or self._origin_ns is None:
            first = int(breaks[-1]) if breaks.size else 0
            stamps, table, steps = stamps[first:], table[first:], steps[first:]
            self._origin_ns = stamps[0]
            self._time, self._parts = np.empty(0), list(np.empty((3, 0, 3)))
        self._newest_ns = stamps[-1]
        interval = float(np.median(steps[1:])) * NANOSECOND if stamps.size > 1 else BIN
        parts = [table[:, columns] for columns in COLUMNS]
        time, *fresh = binned((stamps - self._origin_ns) * NANOSECOND, parts, interval)
        time = np.concatenate([self._time, time])
        kept = min(time.size, max(WINDOW_BINS, np.count_nonzero(time > time[-1] - WINDOW)))
        self._time = time[time.size - kept:]
        self._parts = [
            np.concatenate([before, part])[time.size - kept:] for before, part in zip(self._parts, fresh, strict=True)
        ]
        return self._time, self._parts, interval

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
