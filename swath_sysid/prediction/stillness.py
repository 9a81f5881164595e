"""When the hull alone forecasts: still water, known from the excitation and not from past scores.

Weights learnt from past errors come too late for a craft that is let go: all that was scored lies before,
when hands held it. What is known at once is that the moment has vanished. Where it is a small part of what
it was while the past was scored, and the hull's error under it a small part of the combination's, the hull
alone forecasts. That claim has a record of its own, which withdraws it where it has not come true (a lull
between two waves).
"""
import math
from collections import deque

import numpy as np

_SMALL_ERROR = 1.0 / 4.0
_SMALL_EXCITATION = 1.0 / 24.0
_NOT_SIGNIFICANT = 0.1
_UNHEARD_OF = 9.0
_NO_LONGER_STILL = 16.0
_INFANCY = 5.0
_SHARPNESS = 3.0
_OUT_OF_QUESTION = 2.5
_SHARE_OF_PERIOD = 0.1
_LEAST_INFORMED = 0.1
_RECORD_PRIOR = 0.01
_DOUBT = 1.5
_LASTING_MEMORY, _LASTING_PRIOR = 30.0, 5.0
_RETURNED = 1.5
_SOON = 2.2
_SCALE_MEMORY = 10.0
_SCALE_PRIOR = 0.5
_LEAST_SCALE = 1e-4


class Stillness:
    """The claim of one axis that its water is still, and how far off the hull then is.

    Parameters
    ----------
    leads : ndarray, shape (L,)
        s.
    memory : float
        s; excitation and record are forgotten with this time constant.
    usual : float
        Standard deviation of an excitation before any is known, rad/s^2.
    """

    def __init__(self, leads, memory, usual):
        self._memory = memory
        self._usual = usual
        self._leads = leads.size
        self._lead_times = leads
        self._period = 1.0
        self._reach = float(leads[-1]) + 1.0
        self.forget()

    def forget(self):
        """Start anew: another hull."""
        self._levels = deque()
        self._age = 0.0
        self.mean_level = math.nan
        self._square, self._fourth = self._usual**2, self._usual**4
        # squared errors of the hull and of the combination while stillness was claimed
        self._record = np.full((2, self._leads), _RECORD_PRIOR)
        # s of claims that have lasted, and of all
        self._lasted = np.zeros((2, self._leads))
        self._scale_sum = np.zeros(self._leads)
        self._scale_time = np.zeros(self._leads)
        self.excitation_variance = self._square

    def follow(self, stamp, elapsed, disturbance, variance, prior_variance, period):
        """Take in the filter's present disturbance.

        Parameters
        ----------
        stamp, elapsed : float
            s.
        disturbance, variance : float
            And how well it is known, rad/s^2 and its square.
        prior_variance : float
            What the filter believes of its size, rad^2/s^4.
        period : float
            The hull's natural one, s.
        """
        informed = 1.0 - variance / prior_variance
        now = prior_variance
        if informed > _LEAST_INFORMED:
            # what the sensor's noise explains does not count
            now = max(disturbance**2 - variance, 0.0) / informed + _NOT_SIGNIFICANT * variance
        self._levels.append((stamp, now))
        while self._levels[0][0] < stamp - self._reach:
            self._levels.popleft()
        # for so long it must have been small: passing through zero, an excitation at the hull's pace is not
        self._period = period
        self.excitation_variance = self.level_since(stamp - _SHARE_OF_PERIOD * period)
        self._age += elapsed
        if self.mean_level != self.mean_level:
            self.mean_level = now
        self.mean_level += elapsed / min(self._memory, self._age + 1.0) * (now - self.mean_level)
        gain = min(1.0, elapsed / min(self._memory, self._age + _INFANCY))
        self._square += gain * (now - self._square)
        self._fourth += gain * (now * now - self._fourth)

    def claims(self, hull, combination):
        """How far the hull alone is to forecast: from 0 (waves) to 1 (still).

        Parameters
        ----------
        hull, combination : ndarray, shape (L,)
            Variances of their errors.

        Returns
        -------
        ndarray, shape (L,)
        """
        share = np.maximum(hull / np.maximum(_SMALL_ERROR * combination, 1e-30), self._share_of_past)
        return np.where(share < _OUT_OF_QUESTION, 1.0 / (1.0 + np.minimum(share, 1e3) ** _SHARPNESS), 0.0)

    @property
    def _share_of_past(self):
        return self.excitation_variance / max(_SMALL_EXCITATION * self.past_level, 1e-30)

    @property
    def is_conceivable(self):
        """Whether there may be a claim, whatever the errors."""
        return self._share_of_past < _OUT_OF_QUESTION

    @property
    def past_level(self):
        """Mean square of the excitation, each moment counting by its square, rad^2/s^4."""
        return self._fourth / max(self._square, 1e-30)

    def level_since(self, stamp):
        """Largest squared excitation since a stamp, rad^2/s^4."""
        largest = 0.0
        for when, level in reversed(self._levels):
            if when < stamp:
                break
            largest = max(largest, level)
        return largest

    def _levels_since(self, stamps, known):
        """`level_since` of the known stamps, which grow older with the lead, shape (L,)."""
        result, largest = np.zeros(self._leads), 0.0
        levels, ended = iter(reversed(self._levels)), (-math.inf, 0.0)
        when, level = next(levels, ended)
        for lead in np.flatnonzero(known).tolist():
            stamp = stamps[lead]
            while when >= stamp:
                largest = max(largest, level)
                when, level = next(levels, ended)
            result[lead] = largest
        return result

    @property
    def trust(self):
        """What the record leaves of a claim, shape (L,)."""
        hull, combination = self._record
        lasted, claimed = self._lasted + _LASTING_PRIOR
        lasting = np.minimum(1.0, 2.0 * lasted / claimed) ** 4
        # an excitation that soon returns was not gone at the shorter leads either
        soon = self._lead_times <= _SOON * self._period
        lasting[soon] = np.minimum.accumulate(lasting[soon][::-1])[::-1]
        return np.minimum(1.0, _DOUBT * combination / hull) ** 2 * lasting

    @property
    def scale(self):
        """Squared error of the hull over its nominal variance while still, shape (L,)."""
        result, before = np.empty(self._leads), 1.0
        for lead in range(self._leads):
            # a longer lead, not scored yet, is held to be as far off its nominal variance as a shorter one
            before = (self._scale_sum[lead] + _SCALE_PRIOR * before) / (self._scale_time[lead] + _SCALE_PRIOR)
            result[lead] = before = max(before, _LEAST_SCALE)
        return result

    def learn(self, claims, stamps, levels, mean_levels, past_levels, hull, combination, nominal, elapsed):
        """Take in errors that have become known; NaN where none has.

        Parameters
        ----------
        claims : ndarray, shape (L,)
            What `claims` said when they were issued.
        stamps, levels, mean_levels, past_levels : ndarray, shape (L,)
            When that was, s, and `excitation_variance`, `mean_level` and `past_level` then.
        hull, combination : ndarray, shape (L,)
            Errors over the motion's size.
        nominal : ndarray, shape (L,)
            The hull's error over its nominal deviation.
        elapsed : float
            s.

        Returns
        -------
        ndarray of bool, shape (L,)
            Whether the excitation has stayed what it was.
        """
        known = np.isfinite(hull) & np.isfinite(combination) & np.isfinite(nominal) & (claims > 0.0)
        since = self._levels_since(stamps, known)
        gain = np.where(known, claims, 0.0) * elapsed
        self._lasted *= 1.0 - np.minimum(gain / _LASTING_MEMORY, 1.0)
        self._lasted += gain * ((since <= _RETURNED * _SMALL_EXCITATION * past_levels), np.ones(self._leads))
        # hands that take hold of the craft say nothing of still water
        gain *= since <= _UNHEARD_OF * mean_levels
        squares = np.where(known, (hull, combination), 0.0) ** 2
        self._record *= 1.0 - np.minimum(gain / self._memory, 1.0)
        self._record += gain * squares
        stayed = known & (since <= _NO_LONGER_STILL * levels)
        gain = np.where(stayed, gain, 0.0)
        keep = 1.0 - np.minimum(gain / _SCALE_MEMORY, 1.0)
        self._scale_sum = keep * self._scale_sum + gain * np.where(stayed, nominal, 0.0) ** 2
        self._scale_time = keep * self._scale_time + gain
        return stayed
