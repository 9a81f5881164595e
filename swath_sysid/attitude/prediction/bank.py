"""The bank of candidates: each steps through the rows, skips lost ones, and forecasts the readings to come."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import AxisFilter
from swath_sysid.attitude.prediction.candidate import Candidate, OnRows
from swath_sysid.attitude.prediction.forecast import Forecast
from swath_sysid.attitude.prediction.hull_filter import CONVINCING, HEALTHY_STRAIN
from swath_sysid.attitude.prediction.hull_state import TRIM
from swath_sysid.attitude.prediction.memories import NIS_MEMORY
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.pool import Pool
from swath_sysid.attitude.prediction.rows import AT_ONCE, RowClock
from swath_sysid.attitude.prediction.sea_fit import LONG_WAVES, NEW_WAVES, WAVES
from swath_sysid.attitude.prediction.sea_library import SeaLibrary
from swath_sysid.attitude.prediction.sea_memory import MEMORY
from swath_sysid.attitude.prediction.state_space import InnovationsFilter, InnovationsModel
from swath_sysid.attitude.prediction.upstream import NEW_UPSTREAM, PastRows, UpstreamFit, candidates_of, without
from swath_sysid.common.accelerator import accelerated
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import NEGLIGIBLE, THREE_STD

HULL, FREE_HULL, LIBRARY, LEVEL = 'hull-filter', 'free-hull', 'sea-library', 'mean'
#: Weights before any error. A hull is free by a test of such odds, and nothing else is to be known then; the mean knows
#: nothing of the present motion, a memory may be of another sea. The hulls come first: they follow every sample.
CANDIDATES = {
    HULL: 1.0,
    FREE_HULL: math.exp(CONVINCING),
    LIBRARY: 1.0,
    LEVEL: 0.1,
    MEMORY: 0.1,
    NEW_WAVES: 1.0,
    WAVES: 1.0,
    LONG_WAVES: 1.0,
}
HULLS = HULL, FREE_HULL
#: A squared error this much smaller, or larger, than another one is no chance.
_CLEARLY = 1.14

_AXIS_OF_TARGET = [*range(len(AXES))] * 2


class Bank:
    """Candidates and their average at increasing leads (L,), s, on the rows of a clock."""

    def __init__(
        self,
        axes: Sequence[AxisFilter],
        leads: np.ndarray,
        clock: RowClock,
        rows: PastRows,
        others: Mapping[str, Callable[[float, float], Candidate]],
    ) -> None:
        self.channels = rows.names  #: Upstream.
        #: Of the candidates; the upstream channels' come after our own, and then the ``others``.
        self.names = (*CANDIDATES, *candidates_of(self.channels), *others)
        self._place = {name: place for place, name in enumerate(self.names)}
        self._clock, step, period = clock, clock.step, clock.period
        priors = [CANDIDATES.get(name, 1.0) for name in self.names]
        self.pool = Pool.of(leads, step, period, priors, len(HULLS))
        self.state = self.pool.begin(len(axes))
        self.spaces: dict[str, OnRows] = {}  #: State spaces of the craft's own channels.
        self._on_rows: dict[str, Candidate] = {}  # all but the hulls' filters, which follow every sample
        self._rows, self._others = rows, others
        # when upstream channels last helped, s, and at which place of the scores; whether they contradict that since
        self._helped, self._helped_at, self._is_contradicted = -math.inf, 0, False
        self._at_row = np.full((len(self.names), 1, len(ATTITUDE)), math.nan), np.empty(0)
        self._axes, self._leads, self._steps, self._step = axes, leads, self.pool.layout.steps, step
        self._period = period
        self._horizon = leads[-1] + 2.0 * step
        self._library: SeaLibrary  # which `begin` begins
        self._since_break, self._doubt = math.inf, 1.0  # rows, and of the state of what follows them
        whole = leads / step
        are_rows = np.abs(whole - np.round(whole)) < AT_ONCE
        self._leads_are_rows = bool(are_rows.all()) and whole[0] > 0.9 and self._steps.size == whole.size

    @property
    def _noise(self):
        """Variances of the angles' and the rates' noise that the sensor reports, shape (4,).

        A noise that is only measured is an upper bound, with which intervals would come out too narrow.
        """
        return np.array([axis.known_noise for axis in self._axes]).T.ravel()

    @property
    def _present(self):
        """Variances of the angles and the rates now, where the sensor reports its noise, shape (4,).

        Not of a wide filter, which is surer of nothing.
        """
        known = [
            np.minimum(np.diag(axis.hull.P)[:TRIM], axis.known_noise) if axis.hull.is_started else axis.known_noise
            for axis in self._axes
        ]
        return np.array(known).T.ravel()

    @property
    def waves(self) -> InnovationsFilter | None:
        """The state space of the whole past, once there is one."""
        return self.spaces[WAVES].space if WAVES in self.spaces else None

    @property
    def has_waves(self) -> bool:
        """Whether a state space of the waves is in use that the present rows have taught."""
        return bool(self.spaces.keys() - {MEMORY})

    def set_period(self, period: float) -> None:
        """Count memories in another period of the motion, s."""
        self._period = period
        self.pool = self.pool.in_period(self._step, period)

    def begin(self, past: np.ndarray) -> None:
        """Begin with the library of seas, and others that nothing is learnt for, on the newest rows (N, width)."""
        self._library = SeaLibrary(self._step, self._period, self._horizon)
        begun = {name: make(self._step, self._period) for name, make in self._others.items()}
        self._on_rows |= {LIBRARY: self._library, **begun}
        for candidate in (self._library, *begun.values()):
            for row in past:
                candidate.take(row)

    def reset(self) -> None:
        """Forget the motion, not what is known of the sea."""
        self.begin(np.empty((0, 0)))
        for candidate in self.spaces.values():
            candidate.space.reset()

    def use(self, name: str, model: InnovationsModel, past: np.ndarray) -> None:
        """Put a new model to use, after the newest rows (N, width)."""
        every = round(model.step / self._step)
        space = InnovationsFilter(model, ATTITUDE, self._horizon + model.step, NIS_MEMORY * self._period)
        space.seed(past[(len(past) - 1) % every :: every])
        self.spaces[name] = self._on_rows[name] = OnRows(space, every)

    def drop(self, name: str) -> None:
        """Use a model no longer."""
        if self.spaces.pop(name, None) is not None:
            del self._on_rows[name]

    def use_upstream(self, fits: Mapping[str, UpstreamFit], past: np.ndarray, time: float, memory: float) -> None:
        """Put fits of the upstream channels to use at a time, s, after the newest rows (N, width)."""
        is_kept = self._keeps_upstream(time, memory)
        for name, fit in fits.items():
            if name == NEW_UPSTREAM or not is_kept:
                beside = partial(self._rows.beside, delays=fit.delays)
                self._on_rows[name] = candidate = OnRows(fit.space, fit.every, fit.newest, beside)
                for row in past[len(past) - (self._rows.newest - fit.newest) :]:
                    candidate.take(row)

    def _keeps_upstream(self, time: float, memory: float) -> bool:
        """Whether a state space that has helped stays while the upstream channels contradict it, for so many s at most.

        If they come to agree with it again, what they showed meanwhile was wrong and is forgotten.
        """
        of_past = [name for name in candidates_of(self.channels) if name != NEW_UPSTREAM]
        ratio = self._ratio(of_past, (*CANDIDATES, *self._others))
        if not np.isfinite(ratio).any():
            return False
        since, was_contradicted = time - self._helped, self._is_contradicted
        is_recent = since < memory
        if np.nanmin(ratio) < 1.0 / _CLEARLY:
            self._helped, self._helped_at, self._is_contradicted = time, int(np.nanargmin(ratio)), False
            if was_contradicted and is_recent:
                self._rows.forget(int(since / self._step))
        elif is_recent and ratio.flat[self._helped_at] > _CLEARLY:
            self._is_contradicted = True
        return (was_contradicted or self._is_contradicted) and is_recent

    def try_anew(self, name: str, axis: int | slice = slice(None)) -> None:
        """Judge a candidate with a new model, for an axis or all, as an untried one."""
        self.state = self.pool.reset(self.state, self._place[name], axis, is_other=name in HULLS)

    def carry_over(self, other: 'Bank') -> None:
        """Begin with what another bank, on other rows, has learnt of the errors."""
        self.state = self.pool.carried_over(other.pool, other.state, len(self._axes))

    def take(self, row: np.ndarray) -> None:
        """Take the next row in every candidate."""
        self._since_break += 1
        # a period or more was missing until within the newest one
        is_after_break = self._since_break * self._step < self._period
        is_unseen = any(axis.unmeasured.is_missing and not axis.unmeasured.is_unknown for axis in self._axes)
        # as far off as the innovations of a model that is accepted
        self._doubt = HEALTHY_STRAIN if is_after_break or is_unseen else 1.0
        for candidate in self._on_rows.values():
            candidate.take(row)
        for place in self._library.begun_anew():
            self.try_anew(LIBRARY, place)

    def predict(self, count: int) -> None:
        """Go on over missing rows."""
        if count * self._step > self._period:
            self._since_break = 0
        self.state = self.pool.skip(self.state, count)
        for candidate in self._on_rows.values():
            candidate.predict(count)

    def score(self, measured: np.ndarray) -> None:
        """Score past forecasts of the angles (A,) of the newest row; issue others."""
        self._at_row = mean, covariance = self._forecasts(self._step * self._steps, self._steps.astype(float))
        count = measured.size
        centre, largest = self._bounds([0.0] * count)
        self.state = self.pool.take(
            self.state,
            measured,
            mean[..., :count],
            np.diagonal(covariance, axis1=2, axis2=3)[..., :count],
            self._noise[:count],
            centre,
            largest,
        )

    def _bounds(self, doubts: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """What no forecast of an angle is further from, and by how much at most, (A,): no wilder than the motion.

        The motion is that of the last two periods, the present displacement or the ``doubts`` (A,), variances.
        """
        centre = np.array([axis.size.mean if axis.size.mean == axis.size.mean else 0.0 for axis in self._axes])
        largest = [
            THREE_STD * max(axis.size.extent, math.sqrt(max(axis.noise[0], unknown)))
            for axis, unknown in zip(self._axes, doubts, strict=True)
        ]
        return centre, np.array(largest)

    def forecast(self, stamp_ns: int, age: float, lateness: float = 0.0, count: int | None = None) -> Forecast:
        """The average of the candidates at the leads after a stamp, which is ``lateness`` s after the newest sample.

        That is ``age`` s after the newest row. With a count: at so many of the leads, the first.
        """
        at_row = age == lateness == 0.0 and self._leads_are_rows and self._at_row[0].shape[1] == self._steps.size
        if at_row:
            mean, covariance = (values[:, :count] for values in self._at_row)
        else:
            leads = np.maximum(self._leads[:count] + lateness, 0.0)
            mean, covariance = self._forecasts(leads, (leads + age) / self._step)
        ahead = self.pool.combine(self.state, stamp_ns, mean, covariance, _AXIS_OF_TARGET, self._noise, self._present)
        for place, axis in enumerate(self._axes):
            ahead.covariance[:, place, place] += axis.doubt_of_angle
        self.limit(ahead.mean, ahead.covariance)
        return ahead

    def limit(self, mean: np.ndarray, covariance: np.ndarray) -> None:
        """Make means (L, 4) and covariances (L, 4, 4) of the motion no wilder than it is."""
        bound(mean, covariance, *self._bounds([axis.doubt_of_angle for axis in self._axes]), math.tau / self._period)

    def gain_of(self, channel: str) -> np.ndarray:
        """Share of the least running error (S, A) of the others that candidates with an upstream channel save.

        NaN where there are none of the one or the other at present.
        """
        others = (*CANDIDATES, without(channel), *self._others)
        return 1.0 - np.sqrt(self._ratio([name for name in self.names if name not in others], others))

    def _ratio(self, some: Collection[str], others: Collection[str]) -> np.ndarray:
        """Least running square error (S, A) of some candidates over that of others; NaN where either has none."""
        present = np.isfinite(self._at_row[0][..., : len(AXES)])
        squares = np.where(present, self.state.square.transpose(2, 0, 1), math.nan)
        of_some, of_others = (
            np.fmin.reduce(squares[[name in chosen for name in self.names]]) for chosen in (some, others)
        )
        return of_some / np.maximum(of_others, 1e-300)

    def _forecasts(self, ahead: np.ndarray, rows: np.ndarray):
        """Motion (K, L, 4) and covariances (K, L, 4, 4) by candidate; NaN where it has none.

        So many s (L,) after the newest sample, which is so many rows (L,) after the newest row.

        As far as the sensor's noise is known: the covariances are of readings, else.
        """
        count = ahead.size
        mean = np.full((len(self.names), count, len(ATTITUDE)), math.nan)
        covariance = np.zeros((*mean.shape, len(ATTITUDE)))
        level = self._place[LEVEL]
        # without a hull, its filter still follows every sample, which rows do not
        at_once = int(np.count_nonzero(ahead < 1.02 * self._step))
        for place, axis in enumerate(self._axes):
            rate, known = place + len(AXES), at_once if axis.hull.model is None else count
            hull = self._place[FREE_HULL if axis.hull.is_free else HULL]
            if axis.hull.is_started and known:
                mean[hull, :known, place::2], spread = axis.hull.forecast(ahead[:known])
                covariance[hull, :known, place::2, place::2] = spread
                for target, total, told in zip((place, rate), axis.noise, axis.known_noise, strict=True):
                    covariance[hull, :known, target, target] += total - told
            size = axis.size
            mean[level, :, place], mean[level, :, rate] = size.mean, 0.0
            covariance[level, :, place, place] = size.activity**2 + size.doubt_of_mean**2
            covariance[level, :, rate, rate] = (2.0 * math.pi / self._period * size.activity) ** 2
        for name, candidate in self._on_rows.items():
            doubt = (self._doubt,) if name in self.spaces else ()
            mean[self._place[name]], covariance[self._place[name]] = candidate.ahead(rows, *doubt)
        noise = self._present if self._clock.is_smoothed else self._noise
        if noise.any():
            of_readings = [self._place[name] for name in self._on_rows]
            covariance[of_readings] = without_noise(covariance[of_readings], noise)
        for name, candidate in self._on_rows.items():
            factor = np.sqrt(candidate.widening) * np.ones(len(ATTITUDE))
            covariance[self._place[name]] *= factor[:, None] * factor
        angles = mean[..., :2]
        # a third of what np.clip takes
        np.minimum(np.maximum(angles, -math.pi, out=angles), math.pi, out=angles)
        return mean, covariance


@accelerated
def bound(mean: np.ndarray, covariance: np.ndarray, centre: np.ndarray, largest: np.ndarray, rate: float) -> None:
    """Make means (L, 2 A) and covariances (L, 2 A, 2 A) no wilder than the motion of the last two periods or the
    present displacement, whichever is ``largest`` (A,), about a centre (A,); rates are by this factor those of angles.
    """
    for target in range(mean.shape[1]):
        middle, most = 0.0, rate * largest[target % len(centre)]
        if target < len(centre):
            middle, most = centre[target], largest[target]
        for lead in range(len(mean)):
            if mean[lead, target] < middle - most:
                mean[lead, target] = middle - most
            elif mean[lead, target] > middle + most:
                mean[lead, target] = middle + most
            deviation = np.sqrt(covariance[lead, target, target])
            if deviation > most:
                for other in range(mean.shape[1]):
                    covariance[lead, target, other] *= most / deviation
                    covariance[lead, other, target] *= most / deviation


def without_noise(covariance: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Covariances (..., M, M) of readings less the variances (M,) of their noise; correlations stay."""
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    share = np.sqrt(np.maximum(1.0 - noise / np.maximum(variance, 1e-300), NEGLIGIBLE))
    return covariance * (share[..., :, None] * share[..., None, :])


@dataclass(frozen=True)
class ForecasterDiagnostics:
    """The running state, for operators."""

    sample_interval: float  #: s; NaN before the second sample.
    has_model: dict[str, bool]  #: By axis.
    has_waves: bool  #: Whether a state space of the waves is in use.
    nis_ratio: dict[str, float]  #: Innovations squared over their expectation, by axis; one is healthy.
    nrmse: np.ndarray  #: (A, L); running error over the size of the motion.
    coverage: np.ndarray  #: (A, L); coverage of the 90 % intervals.
    candidates: tuple[str, ...]  #: (K,); their names.
    candidate_nrmse: np.ndarray  #: (K, A, L); running error of each.
    weights: np.ndarray  #: (K, A, L); their weights.
    upstream_gain: dict[str, np.ndarray]  #: (A, L); share of the running error that each upstream channel saves.
    advice: tuple[Advice, ...]
    valid_leads: dict[str, float] = field(default_factory=dict)  #: As in `Outlook`.


def diagnose(
    axes: Mapping[str, AxisFilter], bank: Bank | None, asked: Any, count: int, interval: float
) -> ForecasterDiagnostics:
    """The running state at ``count`` leads, the places ``asked`` of the bank's; errors are NaN before any row."""
    started = {name: axis for name, axis in axes.items() if axis.hull.is_started}
    advice = tuple(Advice.of('no-model', axis=name) for name, axis in started.items() if axis.identified is None)
    has_waves = bank is not None and bank.has_waves
    if not has_waves:
        advice += (Advice.of('no-waves'),)
    advice += tuple(note for axis in axes.values() for note in axis.advice())
    gain: dict[str, np.ndarray] = {}
    nrmse = coverage = np.full((len(axes), count), np.nan)
    names = tuple(CANDIDATES) if bank is None else bank.names
    candidate = weights = np.full((len(names), len(axes), count), np.nan)
    if bank is not None:
        # a still craft moves less than its sensor's noise, which no forecast of readings can miss by less
        size = np.array([max(axis.size.deviation, math.sqrt(axis.noise[0])) for axis in axes.values()])[:, None]
        state = bank.state
        places = bank.pool.layout.place_of_lead[asked]
        nrmse, coverage = np.sqrt(state.pooled_square[places]).T / size, state.coverage[places].T
        candidate, weights = (each[places].transpose(2, 1, 0) for each in (np.sqrt(state.square), state.weights))
        candidate = candidate / size
        gain = {channel: bank.gain_of(channel)[places].T for channel in bank.channels}
    return ForecasterDiagnostics(
        interval,
        {name: axis.identified is not None for name, axis in axes.items()},
        has_waves,
        {name: axis.hull.active.strain for name, axis in started.items()},
        nrmse,
        coverage,
        names,
        candidate,
        weights,
        gain,
        advice,
    )
