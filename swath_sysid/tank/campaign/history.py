"""A hull's log: period, damping and GM of one craft over days, and the changes that chance does not explain.

A change is a step common to all later entries. Its likelihood ratio, the largest over all places, is compared with that
of `DRAWS` histories without a change. Entries scatter by their own standard deviations and by what differs from day to
day, whose size is fitted with and without the change. Decays and motion in waves have a level of their own each.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from swath_sysid.attitude.hull.identified_model import IdentifiedModel
from swath_sysid.attitude.identification.at_sea import is_at_sea
from swath_sysid.attitude.identification.fit_quality import amplitude_bands
from swath_sysid.common.conventions import ADEQUATE, CONFIDENCE

FALSE_ALARM = 0.01  #: Share of unchanged histories in which a change of GM or of damping is reported.
FEWEST = 5  #: Entries of which a change can be told.
DRAWS = 4000  #: Histories without a change.
LARGEST_BLOCK = 1_000_000  #: Numbers that are worked on at once.
#: Day-to-day standard deviations that are tried, over the scatter about the level.
SCATTERS = np.array([0.0, *np.geomspace(0.1, 2.0, 10)])


@dataclass(frozen=True)
class Entry:
    """What one record, or model file, says of the hull."""

    name: str
    time: float | None  #: s since 1970; None where neither the record nor its name has a date.
    at_sea: bool
    verdict: str
    period: float  #: s.
    period_std: float
    damping_ratio: float
    damping_ratio_std: float
    damping_slope: float  #: Of the logarithm of the damping ratio by that of the amplitude.

    @property
    def is_used(self) -> bool:
        """Whether it counts in the search for changes."""
        return self.verdict == ADEQUATE


@dataclass(frozen=True)
class Logged:
    """A model of the log, with the verdict on it."""

    name: str
    time: float | None
    verdict: str
    model: IdentifiedModel


def entries_of(log: Sequence[Logged]) -> tuple[list[Entry], float]:
    """Entries by time, or as given where one has no date, and the amplitude, rad, that the decays share."""
    decays = [each.model.amplitude_range for each in log if not is_at_sea(each.model)]
    low, high = np.array(decays or [(1.0, 1.0)]).T
    shared = (low.max(), high.min()) if low.max() < high.min() else (np.median(low), np.median(high))
    at = float(np.sqrt(np.prod(shared)))
    is_dated = all(each.time is not None for each in log)
    ordered = sorted(log, key=lambda each: each.time or 0.0) if is_dated else log
    return [_entry(each, at) for each in ordered], at


def _entry(logged: Logged, amplitude: float) -> Entry:
    model, at_sea = logged.model, is_at_sea(logged.model)
    if at_sea:
        names = 'natural_period_s', 'natural_period_std_s', 'damping_ratio', 'damping_ratio_std'
        period, period_std, damping, damping_std = (float(model.metrics[name]) for name in names)
        slope = 0.0
    else:
        # of its neighbours, for the slope
        around = amplitude * np.array([0.99, 1.0, 1.01])
        bands = amplitude_bands(model.model, model.covariance, around, model.posterior)
        period, damping, period_std, damping_std = bands.at(amplitude)
        slope = bands.quantities_at(amplitude)[1][2]
    return Entry(logged.name, logged.time, at_sea, logged.verdict, period, period_std, damping, damping_std, slope)


@dataclass(frozen=True)
class Series:
    """The logarithm of a quantity over the entries, with standard deviations of its own."""

    value: np.ndarray  #: (n,)
    std: np.ndarray  #: (n,)
    at_sea: np.ndarray  #: (n,); bool.

    @cached_property
    def levels(self) -> np.ndarray:
        """Columns (n, 1 or 2), one for each kind of entry."""
        kinds = [kind for kind in (~self.at_sea, self.at_sea) if kind.any()]
        return np.array(kinds, dtype=float).T

    def part(self, start: int, end: int | None) -> 'Series':
        """Some of the entries."""
        return Series(self.value[start:end], self.std[start:end], self.at_sea[start:end])

    def likelihoods(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of histories (S, n): log likelihood without a change (S,), with one at each place (S, n - 1), and the fitted
        scatter (S,) without one.
        """
        size, places = values.std(axis=1), self.value.size - 1
        without, best, scatter = np.full(len(values), -np.inf), np.full((len(values), places), -np.inf), size
        for share in SCATTERS:
            weight = 1.0 / (self.std**2 + (share * size[:, None]) ** 2)
            of_kind = weight[:, :, None] * self.levels
            total = of_kind.sum(axis=1, keepdims=True)
            mean = (of_kind * values[:, :, None]).sum(axis=1) / total[:, 0]
            rest = values - mean @ self.levels.T
            before = np.cumsum(of_kind, axis=1)[:, :-1]
            length = (before - before**2 / total).sum(axis=2)
            gain = np.cumsum(weight * rest, axis=1)[:, :-1] ** 2 / np.maximum(length, 1e-9 * weight[:, :1])
            plain = 0.5 * (np.log(weight) - weight * rest**2).sum(axis=1)
            scatter = np.where(plain > without, share * size, scatter)
            without = np.maximum(without, plain)
            best = np.maximum(best, plain[:, None] + 0.5 * gain)
        return without, best, scatter


@dataclass(frozen=True)
class Change:
    """A significant change."""

    place: int  #: Of the first entry after it.
    earliest: int  #: The same, at the ends of its interval.
    latest: int
    chance: float  #: Share of histories without a change that show one as likely.


def changes_of(series: Series, chance: float, start: int = 0) -> list[Change]:
    """The changes of a series, each tested at a rate of false alarms ``chance``; then its parts before and after it."""
    if series.value.size < FEWEST:
        return []
    without, best, scatter = series.likelihoods(series.value[None])
    ratio = best.max() - without[0]
    own = np.sqrt(series.std**2 + scatter[0] ** 2)
    drawn = own * np.random.default_rng(0).standard_normal((DRAWS, own.size))
    more = 0
    for some in np.array_split(drawn, 1 + drawn.size // LARGEST_BLOCK):
        none, one, _ = series.likelihoods(some)
        more += int(np.count_nonzero(one.max(axis=1) - none >= ratio))
    found = (1 + more) / (DRAWS + 1)
    if found > chance:
        return []
    share = np.cumsum(np.exp(best[0] - best.max()))
    earliest, latest = np.searchsorted(share / share[-1], 0.5 + 0.5 * CONFIDENCE * np.array([-1.0, 1.0]))
    place = 1 + int(np.argmax(best[0]))
    change = Change(start + place, start + 1 + int(earliest), start + 1 + int(latest), found)
    before = changes_of(series.part(0, place), chance, start)
    return [*before, change, *changes_of(series.part(place, None), chance, start + place)]


def steps_of(series: Series, places: Sequence[int]) -> list[tuple[float, float]]:
    """The change at each place with half its `CONFIDENCE` interval, of the logarithm; all places together."""
    from scipy.stats import t as student

    columns = np.column_stack([series.levels, *(np.arange(series.value.size) >= place for place in places)])
    size, freedom = series.value.std(), series.value.size - columns.shape[1]
    found = []
    for share in SCATTERS:
        own = np.sqrt(series.std**2 + (share * size) ** 2)
        step, *_ = np.linalg.lstsq(columns / own[:, None], series.value / own, rcond=None)
        rest = (series.value - columns @ step) / own
        found.append((np.sum(np.log(own)) + 0.5 * rest @ rest, step, own))
    _, step, own = min(found, key=lambda each: each[0])
    covariance = np.linalg.pinv((columns / own[:, None]).T @ (columns / own[:, None]))
    half = student.ppf(0.5 + 0.5 * CONFIDENCE, freedom) * np.sqrt(np.diag(covariance))
    return list(zip(step.tolist(), half.tolist(), strict=True))[series.levels.shape[1] :]


@dataclass(frozen=True)
class Found:
    """What the log says of one quantity."""

    quantity: str
    places: tuple[int, ...]  #: Of the entries that are used.
    changes: tuple[Change, ...]  #: In places of the used entries.
    steps: tuple[tuple[float, float, float], ...]  #: Factor of each change, and the ends of its interval.


def changes_in(entries: Sequence[Entry]) -> tuple[Found, ...]:
    """The changes of GM, which the square of the frequency follows, and of the damping over inertia at one amplitude of
    the rate, which a change of GM alone leaves, as damping is a function of the rate.
    """
    places = tuple(k for k, each in enumerate(entries) if each.is_used)
    used = [entries[k] for k in places]
    at_sea = np.array([each.at_sea for each in used], dtype=bool)
    measured = [(e.period, e.period_std, e.damping_ratio, e.damping_ratio_std, e.damping_slope) for e in used]
    period, period_std, ratio, ratio_std, slope = np.array(measured).reshape(-1, 5).T
    found = []
    # the amplitude of a given rate is proportional to the period
    for quantity, of_period, of_ratio in (('GM', -2.0, 0.0), ('damping', slope - 1.0, 1.0)):
        value = of_period * np.log(period / period[:1]) + of_ratio * np.log(ratio)
        series = Series(value, np.hypot(of_period * period_std / period, of_ratio * ratio_std / ratio), at_sea)
        changes = tuple(changes_of(series, FALSE_ALARM / 2)) if used else ()
        steps = steps_of(series, [each.place for each in changes]) if changes else []
        factors = tuple((math.exp(step), math.exp(step - half), math.exp(step + half)) for step, half in steps)
        found.append(Found(quantity, places, changes, factors))
    return tuple(found)
