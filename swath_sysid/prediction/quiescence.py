"""How probable it is that the craft stays quiet: for launch, recovery and landing on deck.

Errors of one forecast are correlated along the horizon, so that probabilities of single leads cannot
be multiplied.  Past error trajectories, whole horizons of both axes, are laid over the present
forecast instead (a causal ensemble, as in ensemble dressing: Roulston and Smith 2003), and the
members that stay inside are counted.
"""
import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from swath_sysid.errors import InputError

_ENOUGH = 30


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
    def any(self):
        """Whether anything is limited."""
        return bool(np.isfinite(self.as_array).any())

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
    scale: np.ndarray
    probability: float


class Quiescence:
    """Running probability of staying inside the limits.

    Parameters
    ----------
    limits : QuiescenceLimits
    leads : ndarray, shape (H,)
        Of the horizon, s; those up to the duration are used.
    members : int
        Past error trajectories kept.
    spacing : float
        s between them.
    """

    def __init__(self, limits, leads, members=300, spacing=1.0):
        self._limits = limits.as_array
        self._used = leads <= limits.duration + 1e-9
        if not self._used.any() or leads[-1] < limits.duration - 1e-9:
            raise InputError(
                f'quiescence over {limits.duration} s needs a horizon at least as long: lengthen the horizon'
            )
        self._leads = leads[self._used]
        self._spacing = spacing
        # only what is limited can end the quiet
        self._bounded = np.isfinite(self._limits)
        self._bound = self._limits[self._bounded]
        self._errors = np.zeros((members, self._leads.size, self._bound.size))
        self._seen = 0
        self.record = ReliabilityRecord()
        self.clear()

    def clear(self):
        """Forget forecasts that have not come true yet."""
        self._pending = deque()

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
            actual = motion_at(told.stamp + self._leads)[:, self._bounded]
            if not np.isfinite(actual).all():
                continue
            self._errors[self._seen % len(self._errors)] = (actual - told.motion) / told.scale
            self._seen += 1
            if told.probability == told.probability:
                self.record.add(told.probability, bool((np.abs(actual) <= self._bound).all()))

    def probability(self, now, motion, deviation, scale):
        """Probability of staying inside, for the forecast issued now.

        Parameters
        ----------
        now : float
            s.
        motion, deviation : ndarray, shape (H, 2, 2)
            Forecast over the whole horizon and its standard deviation; axis, then angle and rate. NaN for
            an axis that is not measured.
        scale : ndarray, shape (2,)
            Present size of the motion by axis; errors are kept relative to it.

        Returns
        -------
        float
            NaN where a limited axis is not measured.
        """
        motion, deviation = motion[self._used][:, self._bounded], deviation[self._used][:, self._bounded]
        scale = np.broadcast_to(scale[:, None], self._limits.shape)[self._bounded]
        if not np.isfinite(motion).all():
            return math.nan
        if self._seen < _ENOUGH:
            result = self._by_marginals(motion, deviation)
        else:
            known = min(self._seen, len(self._errors))
            members = self._errors[:known] * scale + motion
            inside = int((np.abs(members).max(axis=1) <= self._bound).all(axis=1).sum())
            # no count of a finite ensemble proves zero or one
            result = (inside + 0.5) / (known + 1.0)
        if not self._pending or now - self._pending[-1].stamp >= self._spacing - 1e-6:
            self._pending.append(_Told(now, motion, scale, result))
        return result

    def _by_marginals(self, motion, deviation):
        # before any experience: the worst single lead, as if the errors along the horizon were one
        wide = np.maximum(deviation, 1e-12)
        upper = ndtr((self._bound - motion) / wide)
        lower = ndtr((-self._bound - motion) / wide)
        return float(np.min(upper - lower))

