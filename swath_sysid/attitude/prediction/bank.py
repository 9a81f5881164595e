"""The bank of candidates: each steps through the rows, skips lost ones, and forecasts the readings to come."""

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from swath_sysid.attitude.motion.trial import AXES
from swath_sysid.attitude.prediction.axis_filter import AxisFilter
from swath_sysid.attitude.prediction.blend import UNPROVEN, Blend
from swath_sysid.attitude.prediction.hull_filter import HEALTHY_STRAIN
from swath_sysid.attitude.prediction.point import ATTITUDE
from swath_sysid.attitude.prediction.sea_fit import NEW_WAVES, WAVES
from swath_sysid.attitude.prediction.state_space import InnovationsFilter, InnovationsModel
from swath_sysid.attitude.prediction.upstream import (
    NEW_UPSTREAM,
    UpstreamCandidate,
    UpstreamFit,
    UpstreamRows,
    candidates_of,
    without,
)

HULL, OSCILLATOR = 'hull-filter', 'oscillator'
#: Weights where errors do not distinguish them: largest for the one with the most information.
CANDIDATES = {HULL: 3.0, OSCILLATOR: 0.3, NEW_WAVES: 1.0, WAVES: 1.0}

_AXIS_OF_TARGET = [*range(len(AXES))] * 2


class Bank:
    """Candidates and their average at increasing leads (L,), s, on rows ``step`` s apart."""

    def __init__(self, axes: Sequence[AxisFilter], leads: np.ndarray, step: float, upstream: UpstreamRows) -> None:
        self.channels = upstream.names  #: Upstream.
        #: Of the candidates; the upstream channels' are the last.
        self.names = (*CANDIDATES, *candidates_of(self.channels))
        self._place = {name: place for place, name in enumerate(self.names)}
        priors = [CANDIDATES.get(name, 1.0) for name in self.names]
        self.blend = Blend(leads, step, len(axes), priors)
        self.spaces: dict[str, InnovationsFilter] = {}  #: Those on rows.
        self._upstream: dict[str, UpstreamCandidate] = {}
        self._upstream_rows = upstream
        # when upstream channels last helped, s, and at which place of the scores; whether they contradict that since
        self._helped, self._helped_at, self._is_contradicted = -math.inf, 0, False
        self._at_row = np.full((len(self.names), 1, len(ATTITUDE)), math.nan), np.empty(0)
        self._axes, self._leads, self._steps, self._step = axes, leads, self.blend.steps, step
        self._horizon = leads[-1] + 2.0 * step
        whole = leads / step
        are_rows = np.abs(whole - np.round(whole)) < 0.02
        self._leads_are_rows = bool(are_rows.all()) and whole[0] > 0.9 and self._steps.size == whole.size

    @property
    def _on_rows(self) -> dict[str, InnovationsFilter | UpstreamCandidate]:
        """The candidates that there are at present, but for the hulls' filters, which follow every sample."""
        return {**self.spaces, **self._upstream}

    @property
    def _noise(self):
        """Variances of the angles' and the rates' noise that the sensor reports, shape (4,).

        A noise that is only measured is an upper bound, with which intervals would come out too narrow.
        """
        return np.array([axis.reported for axis in self._axes]).T.ravel()

    def use(self, name: str, model: InnovationsModel, past: np.ndarray) -> None:
        """Put a new model to use, after the newest rows (N, width)."""
        self.spaces[name] = space = InnovationsFilter(model, ATTITUDE, self._horizon, self._steps)
        space.seed(past)

    def use_upstream(self, fits: Mapping[str, UpstreamFit], past: np.ndarray, time: float, memory: float) -> None:
        """Put fits of the upstream channels to use at a time, s, after the newest rows (N, width)."""
        is_kept = self._keeps_upstream(time, memory)
        for name, fit in fits.items():
            if name == NEW_UPSTREAM or not is_kept:
                candidate = UpstreamCandidate(fit, self._upstream_rows, self._steps * self._step, self._step)
                for row in past[len(past) - (self._upstream_rows.newest - fit.newest) :]:
                    candidate.step(row)
                self._upstream[name] = candidate

    def _keeps_upstream(self, time: float, memory: float) -> bool:
        """Whether a state space that has helped stays while the upstream channels contradict it, for so many s at most.

        If they come to agree with it again, what they showed meanwhile was wrong and is forgotten.
        """
        of_past = [name for name in self.names if name not in (*CANDIDATES, NEW_UPSTREAM)]
        ratio = self._ratio(of_past, CANDIDATES)
        if not np.isfinite(ratio).any():
            return False
        since, was_contradicted = time - self._helped, self._is_contradicted
        is_recent = since < memory
        if np.nanmin(ratio) < 1.0 / UNPROVEN:
            self._helped, self._helped_at, self._is_contradicted = time, int(np.nanargmin(ratio)), False
            if was_contradicted and is_recent:
                self._upstream_rows.forget(int(since / self._step))
        elif is_recent and ratio.flat[self._helped_at] > UNPROVEN:
            self._is_contradicted = True
        return (was_contradicted or self._is_contradicted) and is_recent

    def renew(self, name: str, axis: int | slice = slice(None)) -> None:
        """Judge a candidate with a new model, for an axis or all, as an untried one that knows nothing upstream."""
        self.blend.renew(self._place[name], axis, len(CANDIDATES))

    def step(self, row: np.ndarray) -> None:
        """Take the next row in every candidate."""
        for candidate in self._on_rows.values():
            candidate.step(row)

    def skip(self, count: int) -> None:
        """Step over missing rows."""
        self.blend.skip(count)
        for candidate in self._on_rows.values():
            candidate.skip(count)

    def score(self, measured: np.ndarray, steps: int) -> None:
        """Score past forecasts of the angles (A,) of the newest row, ``steps`` after the one before; issue others."""
        self._at_row = mean, covariance = self._forecasts(None, 0.0)
        count = measured.size
        self.blend.take(
            measured,
            mean[..., :count],
            np.diagonal(covariance, axis1=2, axis2=3)[..., :count],
            self._noise[:count],
            np.array([axis.rows_since_surprise for axis in self._axes]),
            np.array([axis.hull.is_free for axis in self._axes], dtype=int),
        )
        for axis in self._axes:
            axis.rows_since_surprise += steps

    def forecast(self, age: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Blend.combine`: (L, 4), (L, 4, 4) and (L, 4) at the leads, ``age`` s after the newest row."""
        at_row = age == 0.0 and self._leads_are_rows
        mean, covariance = self._at_row if at_row else self._forecasts(self._leads, age)
        return self.blend.combine(mean, covariance, _AXIS_OF_TARGET, self._noise)

    def gain_of(self, channel: str) -> np.ndarray:
        """Share of the least running error (S, A) of the others that candidates with an upstream channel save.

        NaN where there are none of the one or the other at present.
        """
        others = (*CANDIDATES, without(channel))
        return 1.0 - np.sqrt(self._ratio([name for name in self.names if name not in others], others))

    def _ratio(self, some: Collection[str], others: Collection[str]) -> np.ndarray:
        """Least running square error (S, A) of some candidates over that of others; NaN where either has none."""
        present = np.isfinite(self._at_row[0][..., : len(AXES)])
        squares = np.where(present, self.blend.mean_square, math.nan)
        of_some, of_others = (
            np.fmin.reduce(squares[[name in chosen for name in self.names]]) for chosen in (some, others)
        )
        return of_some / np.maximum(of_others, 1e-300)

    def _forecasts(self, leads: np.ndarray | None, age: float):
        """Readings (K, L, 4) and covariances (K, L, 4, 4) by candidate; NaN where new samples contradict one."""
        count = self._steps.size if leads is None else leads.size
        mean = np.full((len(self.names), count, len(ATTITUDE)), math.nan)
        covariance = np.zeros((*mean.shape, len(ATTITUDE)))
        hull, ahead = self._place[HULL], self._step * self._steps if leads is None else leads
        for place, axis in enumerate(self._axes):
            if axis.hull.is_started and axis.identified is not None:
                mean[hull, :, place], mean[hull, :, place + 2], spread = axis.hull.forecast(ahead)
                # of the readings to come, as the state spaces'
                covariance[hull, :, place::2, place::2] = spread + np.diag(axis.noise)
        for name, candidate in self._on_rows.items():
            mean[self._place[name]], covariance[self._place[name]] = candidate.forecast(leads, age)
        strained = [self._place[name] for name, each in self._on_rows.items() if each.strain > HEALTHY_STRAIN]
        if strained:
            trusted = self._hull_is_trusted()
            for place in strained:
                mean[place][:, trusted[place]] = math.nan
        for place, axis in enumerate(self._axes):
            if axis.hull.is_free:
                # nothing acts: there is nothing else to know
                mean[hull + 1 :, :, place::2] = math.nan
        angles = mean[..., :2]
        # a third of what np.clip takes
        np.minimum(np.maximum(angles, -math.pi, out=angles), math.pi, out=angles)
        return mean, covariance

    def _hull_is_trusted(self):
        """Targets, by candidate, that an identified hull explains at present, and forecasts better.

        A wide filter explains any sample, but may forecast badly.
        """
        level = np.log(np.maximum(self.blend.mean_square, 1e-300)).mean(axis=1)
        explains = [
            axis.identified is not None and axis.hull.is_started and axis.hull.strain < HEALTHY_STRAIN
            for axis in self._axes
        ]
        return ((level[self._place[HULL]] < level) & explains)[:, _AXIS_OF_TARGET]
