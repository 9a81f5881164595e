"""Stability watched over hours: with unchanged inertia GM is proportional to 1 / T^2 of roll.

A likelihood-ratio test for one step at an unknown time in log T (Basseville and Nikiforov 1993, section 2.4), with
an allowance for the amplitude of the roll. No safety device: added weight changes the inertia too, and a craft may be
lost without a change of its period.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swath_sysid.attitude.identification.basin_likelihood import NORMAL
from swath_sysid.common.advice import Advice

MIN_PART = 2  #: Estimates before and after a change: a single one may be an outlier.

#: Standard deviations; chance reaches this in one run of a thousand with the two hundred steps of six hours.
BEYOND_CHANCE = 4.5

PRESENT = 1800.0  #: s; averaging time of the present value while nothing has changed.


@dataclass(frozen=True)
class StabilitySettings:
    """Limits of the stability warning."""

    #: Relative change of GM, either way, that triggers a warning once its 95 % interval excludes zero;
    #: 0: only a change beyond chance does.
    limit: float = 0.0
    known_height: float = 0.0  #: Metacentric height at the start of the watch, m; 0: not known.


class PeriodEstimate(NamedTuple):
    """The natural period of roll by one identification."""

    begin: float  #: First stamp of the motion identified, s.
    end: float  #: Last stamp, s.
    period: float  #: s.
    std: float  #: s.
    amplitude: float  #: At which the craft has this period, rad.


@dataclass(frozen=True)
class Stability:
    """GM relative to the start of the watch."""

    relative: float
    interval: tuple[float, float]  #: Central 95 %.
    period_before: float  #: T0, s.
    period: float  #: T, s.
    changed_at: float | None = None  #: s; stamp of the first estimate after a change that is beyond chance.
    advice: tuple[Advice, ...] = ()  #: Empty where there is nothing to warn of.
    height: float = math.nan  #: GM, m; NaN unless it was known at the start.


class StabilityWatch:
    """Follows the natural period of roll."""

    def __init__(self, settings: StabilitySettings | None = None):
        self.settings = settings or StabilitySettings()
        self.restart()

    def restart(self) -> None:
        """Start anew: the next estimates become the reference."""
        self._rows: list[tuple[float, float, float, float]] = []
        self.newest = None
        """`Stability`; None while there are too few estimates."""

    def add(self, estimate: PeriodEstimate) -> None:
        """Add an estimate unless much of its motion is known; one that ends before the last restarts the watch."""
        begin, end, period, std, amplitude = estimate
        if self._rows and end < self._rows[-1][0]:
            self.restart()
        if self._rows and begin < self._rows[-1][0] - 0.25 * (end - begin):
            return
        self._rows.append((end, math.log(period), std / period, amplitude**2))
        if len(self._rows) >= 2 * MIN_PART:
            self.newest = self._judged()

    @property
    def count(self) -> int:
        """Estimates so far."""
        return len(self._rows)

    def _judged(self):
        stamp, level, std, effect = np.array(self._rows).T
        places = range(MIN_PART, stamp.size - MIN_PART + 1)
        steps = [_step(level, std, effect, place) for place in places]
        largest = max(steps, key=lambda step: abs(step.change) / step.std)
        is_beyond_chance = abs(largest.change) > BEYOND_CHANCE * largest.std
        if not is_beyond_chance:
            place = min(np.searchsorted(stamp, stamp[-1] - PRESENT, side='right'), stamp.size - MIN_PART)
            largest = _step(level, std, effect, max(place, MIN_PART))
        relative, spread = math.exp(-2.0 * largest.change), 2.0 * NORMAL * largest.std
        interval = relative * math.exp(-spread), relative * math.exp(spread)
        before, now = math.exp(largest.before), math.exp(largest.before + largest.change)
        known, limit = self.settings.known_height, self.settings.limit
        is_past_limit = 0.0 < limit < abs(relative - 1.0) and not interval[0] <= 1.0 <= interval[1]
        advice: tuple[Advice, ...] = ()
        if is_beyond_chance or is_past_limit:
            low, high = interval
            advice = (Advice.of('stability-changed', before=before, now=now, share=relative, low=low, high=high),)
        return Stability(
            relative,
            interval,
            before,
            now,
            float(stamp[largest.place]) if is_beyond_chance else None,
            advice,
            known * relative if known else math.nan,
        )


class _Step(NamedTuple):
    place: int
    before: float
    change: float
    std: float


def _step(level: np.ndarray, std: np.ndarray, effect: np.ndarray, place: int):
    """The change of the level between the rows before a place and those from there on."""
    parts, weights = (slice(None, place), slice(place, None)), np.zeros((2, level.size))
    scatter = 0.0
    for weight, part in zip(weights, parts, strict=True):
        weight[part] = std[part] ** -2.0 / np.sum(std[part] ** -2.0)
        scatter += np.sum(((level[part] - weight @ level) / std[part]) ** 2)
    before, after = weights @ level
    contrast = weights[1] - weights[0]
    # scatter beyond the stated standard deviations inflates them
    inflation = max(1.0, scatter / (level.size - 2))
    # at 10 deg the published hulls' periods differ by up to 3 % from small roll: about 1 / rad^2
    variance = inflation * np.sum((contrast * std) ** 2) + (contrast @ effect) ** 2
    return _Step(place, float(before), float(after - before), math.sqrt(variance))
