"""Probability that the craft stays quiet, and the next calm window: for launch, recovery and deck landing.

Errors of one forecast are correlated along the horizon, so past error trajectories of all limited quantities, scaled
by the size of the motion, are added to the present forecast (ensemble dressing: Roulston and Smith 2003), and the
members that stay inside are counted.
"""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from swath_sysid.attitude.prediction.memories import MEMORY_OF_SIZE, USUAL_PERIOD
from swath_sysid.attitude.prediction.point import ATTITUDE, POINT_MOTION
from swath_sysid.common.conventions import THREE_STD
from swath_sysid.common.errors import InputError

AT_A_POINT = POINT_MOTION[:2]  #: What can be limited at each point, beside `ATTITUDE` of the craft.

#: Forecasts of known outcome, from which on their errors give probabilities.
_ENOUGH = 30
MEMBERS, SPACING = 300, 0.31  #: Past errors that are kept, and periods of the motion between them.

#: Standard deviations of a sea that its motion reaches within two periods, at least; at most, three.
_LEAST_REACH = 0.5


@dataclass(frozen=True)
class PointLimits:
    """Limits of quiet at a named point."""

    name: str
    heave: float = math.inf  #: Largest either way, m about the mean level; infinite: no limit.
    vertical_velocity: float = math.inf  #: m/s.


@dataclass(frozen=True)
class QuiescenceLimits:
    """Limits of quiet."""

    roll: float = math.inf  #: Largest angle either way, rad; infinite: no limit.
    pitch: float = math.inf  #: rad.
    roll_rate: float = math.inf  #: rad/s.
    pitch_rate: float = math.inf  #: rad/s.
    duration: float = 5.0  #: s from now for the probability, and the least length of a window of calm.
    points: tuple[PointLimits, ...] = ()
    about_trim: bool = False  #: The angles' limits are about the present trim.
    probability: float = 0.9  #: Least probability of a calm window.

    def __post_init__(self):
        for name, value in {**self._by_quantity(), 'duration': self.duration}.items():
            if not value > 0.0:
                raise InputError(f'the quiescence limit {name} must be positive, not {value}')
        if not math.isfinite(self.duration):
            raise InputError('the duration of quiescence must be finite')
        if not 0.0 < self.probability < 1.0:
            raise InputError(f'the probability of a window of calm must be between 0 and 1, not {self.probability}')

    def bounds(self, quantities: Sequence[str]) -> np.ndarray:
        """The limits of quantities by name, shape (V,); infinite where there is none."""
        limits = self._by_quantity()
        return np.array([limits.get(name, math.inf) for name in quantities])

    def _by_quantity(self):
        at_points = {quantity_at(p.name, kind): getattr(p, kind) for p in self.points for kind in AT_A_POINT}
        return {**{name: getattr(self, name) for name in ATTITUDE}, **at_points}


def quantity_at(point: str, kind: str) -> str:
    """The name of a limited quantity at a point."""
    return f'{point}.{kind}'


class CalmWindow(NamedTuple):
    """A window in which the craft will be quiet."""

    begin: float  #: s from now.
    end: float  #: s from now.
    probability: float  #: Of keeping all limits from start to end.


@dataclass(frozen=True)
class Reliability:
    """Observed share of quiet against the forecast probability."""

    edges: np.ndarray  #: (B + 1,); Of the bins of probability.
    count: np.ndarray  #: (B,)
    forecast: np.ndarray  #: (B,); mean probability forecast; NaN in empty bins.
    observed: np.ndarray  #: (B,); share that stayed quiet; NaN in empty bins.
    brier: float  #: Mean squared error of the probability.
    brier_of_climate: float  #: And of always forecasting the share that stayed quiet.


class ReliabilityRecord:
    """A reliability diagram, filled as outcomes become known, of constant size."""

    def __init__(self, bins: int = 10) -> None:
        self._sums = np.zeros((3, bins))  # counts, probabilities forecast, outcomes
        self._squared_error = np.float64(0.0)

    def add(self, forecast: float, observed: bool) -> None:
        """Add a probability, 0 to 1, and whether the craft stayed quiet."""
        bins = self._sums.shape[1]
        self._sums[:, min(int(forecast * bins), bins - 1)] += 1.0, forecast, observed
        self._squared_error += (forecast - observed) ** 2

    def diagram(self) -> Reliability:
        """The diagram so far."""
        count, _, observed = self._sums
        with np.errstate(invalid='ignore'):
            shares, share = self._sums[1:] / count, float(observed.sum() / count.sum())
            brier = float(self._squared_error / count.sum())
        edges = np.linspace(0.0, 1.0, count.size + 1)
        return Reliability(edges, count.astype(int), shares[0], shares[1], brier, share * (1.0 - share))


@dataclass(frozen=True)
class _Issued:
    stamp: float
    motion: np.ndarray
    size: np.ndarray
    trim: np.ndarray
    probability: float


class Quiescence:
    """Running probability of staying inside the limits of quantities, and the next window of calm.

    Leads (H,), s, are those of the horizon, at least one within the duration.
    """

    def __init__(self, limits: QuiescenceLimits, leads: np.ndarray, quantities: Sequence[str] = ATTITUDE) -> None:
        self._leads = leads
        self._within = int(np.sum(leads <= limits.duration + 1e-9))
        self._quantities = tuple(quantities)
        self._errors = np.full((len(self._quantities), leads.size, MEMBERS), math.nan)
        self._complete = np.zeros((len(self._quantities), MEMBERS), dtype=bool)
        self._seen = 0
        self.reset()
        self.set_limits(limits)

    def set_limits(self, limits: QuiescenceLimits) -> None:
        """Use other limits with the duration and the error trajectories kept."""
        whole = limits.bounds(self._quantities)
        # only what is limited can end the quiet
        self._bounded = np.isfinite(whole)
        self._bound = whole[self._bounded]
        self._asked = limits.probability
        self._about_trim = limits.about_trim
        self.record = ReliabilityRecord()
        for _ in range(len(self._pending)):
            self._pending.append(replace(self._pending.popleft(), probability=math.nan))

    def reset(self) -> None:
        """Forget forecasts that have not come true yet."""
        self._pending: deque = deque()
        self._last = math.nan
        self._square = np.zeros(len(self._quantities))
        self._grown: np.ndarray | float = 0.0

    def learn(self, now: float, motion_at: Callable[[np.ndarray], np.ndarray]) -> None:
        """Keep errors known at ``now``, s; ``motion_at`` maps stamps (H,) to measured quantities (H, V)."""
        while self._pending and self._pending[0].stamp + self._leads[-1] <= now + 1e-9:
            issued = self._pending.popleft()
            actual = motion_at(issued.stamp + self._leads)
            place = self._seen % MEMBERS
            # a push errs by its own size, of which a craft at rest afterwards has nothing to expect
            self._errors[:, :, place] = errors = ((actual - issued.motion) / np.fmax(issued.size, self._grown)).T
            self._complete[:, place] = np.isfinite(errors).all(axis=1)
            self._seen += 1
            actual = (actual - issued.trim)[: self._within, self._bounded]
            if issued.probability == issued.probability and np.isfinite(actual).all():
                self.record.add(issued.probability, bool((np.abs(actual) <= self._bound).all()))

    def assess(
        self,
        now: float,
        motion: np.ndarray,
        deviation: np.ndarray,
        activity: np.ndarray,
        trim: np.ndarray | None = None,
        reach: np.ndarray | float = math.nan,
        period: float = USUAL_PERIOD,
    ) -> tuple[float, CalmWindow | None]:
        """Probability of staying inside for the duration from ``now``, s, and the next calm window.

        Of a forecast (H, V) over the horizon and its standard deviation, the size (V,) of each quantity's motion, trim
        (V,) about which limits may be, how far each has reached (V,) within two periods, NaN where not known, and the
        motion's period, s. NaN where nothing is limited, or a limited quantity is not measured.
        """
        size = self.follow(now, activity, reach, period)
        about = np.zeros(len(self._quantities)) if trim is None or not self._about_trim else trim
        probability, window = math.nan, None
        if self._bound.size and np.isfinite(motion[:, self._bounded]).all():
            centred = motion - about
            inside, members = self._members_inside(centred, size)
            if members < _ENOUGH:
                likely = self._by_marginals(centred[: self._within], deviation[: self._within])
                probability = min(likely, _share(members, members))
            else:
                quiet = int(np.count_nonzero(inside[: self._within].all(axis=0)))
                probability = _share(quiet, members)
                window = self._calm_window(inside, quiet, members)
        if self.is_due(now, period):
            self._pending.append(_Issued(now, motion, size, about, probability))
        return probability, window

    def is_due(self, now: float, period: float) -> bool:
        """Whether the errors of a forecast of ``now``, s, are to be kept, in a motion of a period, s."""
        return not self._pending or now - self._pending[-1].stamp >= SPACING * period - 1e-6

    def follow(self, now: float, activity: np.ndarray, reach: np.ndarray | float, period: float) -> np.ndarray:
        """Size (V,) of the recent motion up to ``now``, s; arguments as of `assess`, which does this itself."""
        self._grown = reach / THREE_STD
        elapsed, self._last = now - self._last, now
        memory = MEMORY_OF_SIZE * period
        gain = elapsed / (memory + elapsed) if elapsed > 0.0 else 1.0
        square = activity * activity
        # what was not known until now begins with its first size
        self._square = np.where(np.isnan(self._square), square, self._square + gain * (square - self._square))
        return np.fmin(np.sqrt(self._square), reach / _LEAST_REACH)

    def _members_inside(self, motion: np.ndarray, size: np.ndarray):
        """Whether each member is inside at each lead, shape (H, members), and how many are; the others are not."""
        # forecasts grow better as the sea is learnt: while little is known, its older half is left out
        count = min(max(self._seen // 2, _ENOUGH), self._seen, MEMBERS)
        known = self._complete[self._bounded].all(axis=0)
        known &= (self._seen - 1 - np.arange(MEMBERS)) % MEMBERS < count
        inside = known
        for quantity, bound in zip(np.flatnonzero(self._bounded), self._bound, strict=True):
            errors, centre = self._errors[quantity], motion[:, quantity, None]
            inside = inside & (errors >= (-bound - centre) / size[quantity])
            inside &= errors <= (bound - centre) / size[quantity]
        return inside, int(np.count_nonzero(known))

    def _calm_window(self, inside: np.ndarray, quiet: int, members: int):
        """The first stretch as long as the duration that is quiet with the asked probability, to its end.

        ``quiet`` members are inside for the duration from now.
        """
        needed = math.ceil(self._asked * (members + 1.0) - 0.5)
        if needed > members:
            return None
        # the quiet of now lasts up to the first lead; any later one begins at a lead, which is one more
        begin = 0
        if quiet < needed:
            later = np.count_nonzero(_inside_from(inside[1:], self._within + 1), axis=1) >= needed
            if not later.any():
                return None
            begin = 1 + int(later.argmax())
        # how many leads each member stays inside
        rest = inside[begin:]
        lasting = np.where(rest.all(axis=0), len(rest), rest.argmin(axis=0))
        longest = np.partition(lasting, -needed)[-needed]
        return CalmWindow(
            0.0 if begin == 0 else float(self._leads[begin]),
            float(self._leads[begin + longest - 1]),
            _share(int(np.count_nonzero(lasting >= longest)), members),
        )

    def _by_marginals(self, motion: np.ndarray, deviation: np.ndarray):
        # before any experience: the worst single lead, as if the errors along the horizon were one
        motion, wide = motion[:, self._bounded], np.maximum(deviation[:, self._bounded], 1e-12)
        upper = ndtr((self._bound - motion) / wide)
        lower = ndtr((-self._bound - motion) / wide)
        return float(np.min(upper - lower))


def _inside_from(inside: np.ndarray, count: int) -> np.ndarray:
    """Whether each member stays inside for ``count`` leads, from each lead on that has so many."""
    length = 1
    while length < count:
        step = min(length, count - length)
        inside = inside[:-step] & inside[step:]
        length += step
    return inside


def _share(quiet: int, members: int):
    # no count of a finite ensemble proves zero or one
    return (quiet + 0.5) / (members + 1.0)
