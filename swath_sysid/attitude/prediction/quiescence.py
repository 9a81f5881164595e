"""How probable it is that the craft stays quiet: for launch, recovery and landing on deck.

Errors of one forecast are correlated along the horizon, so that probabilities of single leads cannot
be multiplied.  Past error trajectories, whole horizons of both axes, each over the size of the motion
then, are laid over the present forecast instead (a causal ensemble, as in ensemble dressing: Roulston
and Smith 2003), and the members that stay inside are counted.
"""
import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from swath_sysid.common.errors import InputError

_ENOUGH = 30
_SIZE_MEMORY = 60.0
"""s; a shorter one follows groups of waves, in which the errors grow less than the motion does."""


@dataclass(frozen=True)
class QuiescenceLimits:
    """What counts as quiet.

    Attributes
    ----------
    roll, pitch : float
        Largest angles either way, rad; infinite: does not matter.
    roll_rate, pitch_rate : float
        Largest rates either way, rad/s.
    duration : float
        s from now.
    """

    roll: float = math.inf
    pitch: float = math.inf
    roll_rate: float = math.inf
    pitch_rate: float = math.inf
    duration: float = 5.0

    def __post_init__(self):
        for name, value in vars(self).items():
            if not value > 0.0:
                raise InputError(f'the quiescence limit {name} must be positive, not {value}')
        if not math.isfinite(self.duration):
            raise InputError('the duration of quiescence must be finite')

    @property
    def as_array(self):
        """Shape (2, 2): axis, then angle and rate."""
        return np.array([[self.roll, self.roll_rate], [self.pitch, self.pitch_rate]])


@dataclass(frozen=True)
class Reliability:
    """How often the craft stayed quiet, by the probability told.

    Attributes
    ----------
    edges : ndarray, shape (B + 1,)
        Of the bins of probability.
    count : ndarray, shape (B,)
    told, happened : ndarray, shape (B,)
        Mean probability told and share that stayed quiet; NaN in empty bins.
    brier, brier_of_climate : float
        Mean squared error of the probability, and of always telling the share that stayed quiet.
    """

    edges: np.ndarray
    count: np.ndarray
    told: np.ndarray
    happened: np.ndarray
    brier: float
    brier_of_climate: float


class ReliabilityRecord:
    """A reliability diagram that fills as outcomes become known; its memory does not grow.

    Parameters
    ----------
    bins : int
    """

    def __init__(self, bins=10):
        self._edges = np.linspace(0.0, 1.0, bins + 1)
        self._count = np.zeros(bins, dtype=int)
        self._told, self._happened = np.zeros((2, bins))
        self._squared_error = 0.0

    def add(self, told, happened):
        """One probability and what came of it.

        Parameters
        ----------
        told : float
        happened : bool
        """
        place = min(int(told * self._count.size), self._count.size - 1)
        self._count[place] += 1
        self._told[place] += told
        self._happened[place] += happened
        self._squared_error += (told - happened) ** 2

    def diagram(self):
        """The diagram so far.

        Returns
        -------
        Reliability
        """
        known = int(self._count.sum())
        with np.errstate(invalid='ignore'):
            told, happened = self._told / self._count, self._happened / self._count
        share = self._happened.sum() / known if known else math.nan
        brier = self._squared_error / known if known else math.nan
        return Reliability(self._edges, self._count.copy(), told, happened, brier, float(share * (1.0 - share)))


@dataclass(frozen=True)
class _Told:
    stamp: float
    motion: np.ndarray
    size: np.ndarray
    probability: float


class Quiescence:
    """Running probability of staying inside the limits.

    Parameters
    ----------
    limits : QuiescenceLimits
    leads : ndarray, shape (H,)
        Of the horizon, s; those up to the duration are used, and one at least must be.
    members : int
        Past error trajectories kept.
    spacing : float
        s between them.
    """

    def __init__(self, limits, leads, members=300, spacing=1.0):
        self._used = leads <= limits.duration + 1e-9
        self._leads = leads[self._used]
        self._spacing = spacing
        self._errors = np.full((*limits.as_array.shape, members, self._leads.size), math.nan)
        self._members = members
        self._seen = 0
        self.clear()
        self.set_limits(limits)

    def set_limits(self, limits):
        """Take other limits; the duration stays, and what was learnt of the forecasts serves them at once.

        Parameters
        ----------
        limits : QuiescenceLimits
        """
        whole = limits.as_array
        # only what is limited can end the quiet
        self._bounded = np.isfinite(whole)
        self._bound = whole[self._bounded]
        self.record = ReliabilityRecord()
        self._pending = deque(replace(told, probability=math.nan) for told in self._pending)

    def clear(self):
        """Forget forecasts that have not come true yet."""
        self._pending = deque()
        self._last = math.nan
        self._square = np.zeros(2)

    def learn(self, now, motion_at):
        """Take in the error trajectories that have become known.

        Parameters
        ----------
        now : float
            s.
        motion_at : callable
            From stamps, shape (H,), to the measured motion, shape (H, 2, 2): axis, then angle and rate.
        """
        while self._pending and self._pending[0].stamp + self._leads[-1] <= now + 1e-9:
            told = self._pending.popleft()
            actual = motion_at(told.stamp + self._leads)
            error = (actual - told.motion) / told.size[:, None]
            self._errors[:, :, self._seen % self._members] = np.moveaxis(error, 0, -1)
            self._seen += 1
            actual = actual[:, self._bounded]
            if told.probability == told.probability and np.isfinite(actual).all():
                self.record.add(told.probability, bool((np.abs(actual) <= self._bound).all()))

    def probability(self, now, motion, deviation, activity):
        """Probability of staying inside, for the forecast issued now.

        Parameters
        ----------
        now : float
            s.
        motion, deviation : ndarray, shape (H, 2, 2)
            Forecast over the whole horizon and its standard deviation; axis, then angle and rate. NaN for
            an axis that is not measured.
        activity : ndarray, shape (2,)
            Present size of the motion by axis, rad; positive.

        Returns
        -------
        float
            NaN where nothing is limited, or what is limited is not measured.
        """
        motion = motion[self._used]
        size = self._follow_size(now, activity)
        result = math.nan
        if self._bound.size and np.isfinite(motion[:, self._bounded]).all():
            result = self._by_members(motion, size)
            if result is None:
                result = self._by_marginals(motion, deviation[self._used])
        if not self._pending or now - self._pending[-1].stamp >= self._spacing - 1e-6:
            self._pending.append(_Told(now, motion, size, result))
        return result

    def _follow_size(self, now, activity):
        """Size of the motion lately, shape (2,)."""
        elapsed, self._last = now - self._last, now
        gain = elapsed / (_SIZE_MEMORY + elapsed) if elapsed > 0.0 else 1.0
        self._square = self._square + gain * (activity * activity - self._square)
        return np.sqrt(self._square)

    def _by_members(self, motion, size):
        """None before enough is known."""
        # forecasts grow better as the sea is learnt: while little is known, its older half is left out
        count = min(max(self._seen // 2, _ENOUGH), self._seen, self._members)
        known = np.arange(self._seen - count, self._seen) % self._members
        inside = np.ones(count, dtype=bool)
        complete = inside.copy()
        for (axis, kind), bound in zip(np.argwhere(self._bounded), self._bound, strict=True):
            members = self._errors[axis, kind][known] * size[axis] + motion[:, axis, kind]
            largest = np.abs(members).max(axis=1)
            complete &= np.isfinite(largest)
            inside &= largest <= bound
        count = int(complete.sum())
        # no count of a finite ensemble proves zero or one
        return (int(inside.sum()) + 0.5) / (count + 1.0) if count >= _ENOUGH else None

    def _by_marginals(self, motion, deviation):
        # before any experience: the worst single lead, as if the errors along the horizon were one
        motion, wide = motion[:, self._bounded], np.maximum(deviation[:, self._bounded], 1e-12)
        upper = ndtr((self._bound - motion) / wide)
        lower = ndtr((-self._bound - motion) / wide)
        return float(np.min(upper - lower))

