"""The filter of one axis on a known hull: an extended Kalman filter whose exciting moment is a state space inside it.

    d(angle)/dt = rate
    d(rate)/dt  = -D(rate) - R(angle - trim) + h z        D, R: damping and restoring, linear in the ratios c
    d(trim)/dt, dc/dt = slow random walks, from their identified covariance
    dz/dt       = A z + w                                               (`modal_moment`)

Two of them follow every sample: one on which nothing acts, and one that is driven by the sum of two moments: one of
which nothing is known but its size (second-order Markov: an external push, a gust, a sea state not yet learnt) and,
once learnt, that of the waves (`excitation_model`). Which one is used is decided by the likelihood of their
innovations, in Wald's sequential test: once a hand lets go, the hull alone remains within some tenths of a second.

Of a craft whose hull is not known, the driven one alone follows, on a hull that stands in: the moment that moves any
hull as the waves do makes up for what that hull is not, and the sensor's noise is no part of it.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from scipy.linalg import block_diag
from scipy.special import chdtri

from swath_sysid.attitude.hull.decay_model import DecayModel, composed
from swath_sysid.attitude.hull.identified_model import HullPosterior, IdentifiedModel
from swath_sysid.attitude.hull.simulation import term_moments
from swath_sysid.attitude.hull.terms import DAMPING_NAMES, TERM_NAMES
from swath_sysid.attitude.prediction.hull_state import ANGLE, HULL_STATES, LARGEST_JUMP, OF_HULL, RATE, TRIM
from swath_sysid.attitude.prediction.memories import USUAL_PERIOD
from swath_sysid.attitude.prediction.modal_moment import ModalMoment, markov_moment, sum_of_moments
from swath_sysid.common.advice import Advice
from swath_sysid.common.conventions import THREE_STD
from swath_sysid.common.errors import InputError

if TYPE_CHECKING:
    from swath_sysid.attitude.prediction.hull_track import HullTrack

#: Places of their ratios.
FACTORS = {'stiffness': slice(len(DAMPING_NAMES), None), 'damping': slice(len(DAMPING_NAMES))}

TRIM_DRIFT = 3e-6**2  #: rad^2/s; 0.01 deg in an hour. Thirty times this would hide the slow part of the waves.
RATIO_DRIFT = 1e-4**2  #: 1/s, relative; stiffness and damping move by 2 % in ten hours of a voyage.

UNKNOWN_TRIM_STD = 0.02
IDENTIFIED_TRIM_STD = 5e-4  #: rad; identification reports 3e-5 to 7e-4.

#: Relative std of all restoring and all damping terms without an identified covariance, as of a rebuilt hull.
ASSUMED_STD = {'stiffness': 0.02, 'damping': 0.1}

#: rad; expected of a craft before it is known, and where a model does not state what it was identified on; an unknown
#: moment may hold it there.
USUAL_AMPLITUDE = 0.078

INITIAL_STD = 0.3  #: rad, and rad times half the motion's frequency, where the first sample does not measure.
MARKOV_TIME = 0.156  #: Periods of the motion; one over the corner frequency of the unknown moment.
MIN_LEVEL = 1e-10  #: Of a moment's variance over the initial one.
CHALLENGING_LEVEL = 0.01  #: Of the unknown moment in a restarted driven track.

#: Periods between updates of the moments' sizes: with a hull, and without, where they only affect the filter's
#: smoothness.
LEVEL_INTERVALS = 0.016, 0.31

#: Periods; time constants of the sizes of the unknown moment and of a learnt sea. Trim and ratios are learnt after an
#: insignificant unknown moment for the first of them.
LEVEL_TIMES = 0.62, 19.0

#: Log likelihood ratios at which the track not in use takes over, and restarts.
CONVINCING, LOST = 10.0, 2.0

#: Recent squared innovations over their expectation; a valid model stays below, or a new moment must be acting.
HEALTHY_STRAIN = 4.0

RECENT = 400  #: Samples kept to be filtered again when a fit arrives.
INSIGNIFICANT = 0.035  #: Of the unknown moment's size at the start; a smaller one is ignored.

#: Relative changes that are reported whatever the prior uncertainty.
MUCH = {'stiffness': 0.1, 'damping': 0.3}


@dataclass(frozen=True)
class HullPrior:
    """Knowledge of trim and ratios before a sample: `OF_HULL` of a filter's state."""

    mean: np.ndarray  #: (10,)
    covariance: np.ndarray  #: (10, 10)
    drift: np.ndarray  #: (10, 10); growth of the covariance in a second.
    #: Name of a factor to the (10,) derivatives of its logarithm at the usual amplitude.
    directions: dict[str, np.ndarray]
    is_assumed: bool = False  #: Whether the covariance is no one's finding.

    @classmethod
    def of(cls, identified: IdentifiedModel | None) -> Self:
        """From the posterior of every term where the model has one, else from its own terms."""
        size = HULL_STATES - TRIM
        mean, covariance, drift = np.zeros(size), np.zeros((size, size)), np.zeros((size, size))
        if identified is None:
            covariance[0, 0], drift[0, 0] = UNKNOWN_TRIM_STD**2, TRIM_DRIFT
            return cls(mean, covariance, drift, {})
        model, every = identified.model, identified.posterior
        if every is None:
            every = HullPosterior(model.equation, model.ratios[model.equation.indices], identified.covariance)
        at = 1 + every.equation.indices
        mean[0], mean[at], covariance[np.ix_(at, at)] = model.trim, every.ratios, every.covariance
        directions = _directions(model, identified.amplitude_range[1], mean)
        of = max(float(d @ covariance @ d) for d in directions.values())
        is_exact = of == 0.0
        covariance /= max(of, 1.0)
        for name, ratios in FACTORS.items():
            common = np.zeros(size)
            common[1:][ratios] = mean[1:][ratios]
            drift += RATIO_DRIFT * np.outer(common, common)
            covariance += is_exact * ASSUMED_STD[name] ** 2 * np.outer(common, common)
        trim_std = identified.trim_std
        if trim_std != trim_std:
            trim_std = IDENTIFIED_TRIM_STD if is_exact else UNKNOWN_TRIM_STD
        covariance[0, 0], drift[0, 0] = trim_std**2, TRIM_DRIFT
        return cls(mean, covariance, drift, directions, is_exact)


def _directions(model: DecayModel, largest: float, mean: np.ndarray):
    """Derivatives of the logarithms of restoring and damping at the usual amplitude, by trim and ratios."""
    amplitude = 0.5 * largest if math.isfinite(largest) and largest > 0.0 else USUAL_AMPLITUDE
    frequency = model.natural_frequency
    rate = amplitude * (frequency if frequency == frequency else 1.0)
    moments, directions = term_moments(amplitude, rate, model.friction_rate), {}
    for name, ratios in FACTORS.items():
        directions[name] = direction = np.zeros(mean.size)
        direction[1:][ratios] = moments[ratios]
        direction /= max(abs(float(direction @ mean)), 1e-12)
    return directions


@dataclass(frozen=True)
class HullFilterSettings:
    """When a sample is rejected."""

    gate_probability: float = 1e-12  #: Probability of rejecting a valid measurement.
    gate_patience: int = 5  #: Rejected samples in a row after which the filter restarts from the sensor.

    def __post_init__(self):
        if not 0.0 < self.gate_probability < 0.5:
            raise InputError('a gate_probability of 0.5 or more rejects good samples: give 1e-3 or less')
        if not self.gate_patience > 0:
            raise InputError('gate_patience must be 1 sample or more')


class Observed(NamedTuple):
    """The outcome of one sample."""

    rejected: bool = False  #: The gate rejected the sample.
    restarted: bool = False  #: The filter restarted from this sample.


@dataclass(frozen=True)
class ExcitationRequest:
    """A window to learn a moment from (`excitation_model.fit_excitation`)."""

    model: DecayModel  #: The hull, or one that stands in, with trim and ratios as now estimated.
    hull: HullPrior  #: The same, with its covariance.
    hull_is_learnt: bool  #: Whether the filter has already learnt them in this window.
    hull_is_known: bool  #: Whether the hull is the craft's.
    step: float  #: s between the samples.
    period: float  #: s; of the motion.
    angle: np.ndarray  #: (N,); rad; means of the sensor's samples in a step.
    rate: np.ndarray  #: (N,); rad/s; likewise.
    is_measured: np.ndarray  #: (N,); else bridged, which says nothing of the motion.
    angle_variance: float  #: Of the noise of these means, rad^2.
    rate_variance: float  #: (rad/s)^2.
    samples: int = 1  #: Of the sensor in a step.
    age: float = 0.0  #: s since the middle of the last of these steps.


@dataclass(frozen=True)
class ExcitationFit:
    """A learnt moment."""

    moment: ModalMoment
    mean: np.ndarray  #: (n,); of the whole state of a filter with it, when it was requested.
    covariance: np.ndarray  #: (n, n); likewise.
    levels: tuple[float, float]  #: Sizes of the unknown moment and of this one, then.
    stand_in: DecayModel | None = None  #: The hull that it moves; None: the craft's.


class HullFilter:
    """The filter of one axis: free and driven hull, of which one is in use, as ``is_free`` says.

    ``moments`` are the unknown one and, once learnt, that of the sea; ``levels`` their variances over the initial ones.
    It holds no clock: every call passes the elapsed time.
    """

    def __init__(self, settings: HullFilterSettings | None = None) -> None:
        from swath_sysid.attitude.prediction.hull_track import HullTrack  # filterpy, which only forecasts need

        self.settings = s = settings or HullFilterSettings()
        self.free, self.driven = HullTrack(), HullTrack()
        self.is_started = self.is_free = False
        self.rejections = 0
        self._may_learn = True
        self._quiet = self._evidence = self._since_level = self._since_used = 0.0
        self._since_jump = math.inf
        self._gates = [math.inf, *(float(chdtri(m, s.gate_probability)) for m in (1, 2))]
        self._recent: deque = deque(maxlen=RECENT)
        self.period = USUAL_PERIOD  #: s; of the motion.
        self._use_moments([unknown_moment(self.period)], [1.0])
        size = HULL_STATES + self.moments[0].size
        self.driven.set_state(np.zeros(size), np.eye(size))
        self.model: DecayModel | None = None
        self.is_known = False  #: Whether the hull is that of the craft; else it only stands in for it.
        self.set_hull(None)

    @classmethod
    def for_window(cls, request: ExcitationRequest, moment: ModalMoment) -> Self:
        """A filter, not started yet, for the window of a request with the moment learnt from it.

        Trim and ratios are learnt only if the requesting filter has not learnt them in this window: no sample is used
        twice.
        """
        made = cls()
        made.set_period(request.period)
        made._set_hull(request.model, request.hull)
        hand = made.moments[0]
        made._use_moments([hand, moment], (MIN_LEVEL, 1.0))
        size = HULL_STATES + hand.size + moment.size
        made.driven.set_state(np.zeros(size), np.eye(size))
        made.driven.set_part(OF_HULL, request.hull.mean, request.hull.covariance)
        made._may_learn = not request.hull_is_learnt
        made._quiet = math.inf
        return made

    # -- hull and moment ---------------------------------------------------------------------------------------

    @property
    def active(self) -> 'HullTrack':
        """The track in use."""
        return self.free if self.is_free else self.driven

    @property
    def x(self) -> np.ndarray:
        """Mean of the state, shape (n,): angle, rate, trim, ratios, the moment's."""
        return self.active.x

    @property
    def P(self) -> np.ndarray:
        """Covariance of the state, shape (n, n)."""
        return self.active.P

    @property
    def learns_hull(self) -> bool:
        """Whether trim and ratios are learnt: not while an unknown moment may explain any motion."""
        return self._may_learn and self._quiet > LEVEL_TIMES[0] * self.period

    def set_hull(self, identified: IdentifiedModel | None) -> None:
        """Swap the hull and keep motion and moment; None: a constant rate that the moment drives."""
        was_known, self.is_known = self.is_known, identified is not None
        if self.is_known and not was_known:
            self._forget_stand_in()
        model = None if identified is None else identified.model
        if model is not None and identified is not None and identified.posterior is not None:
            model = replace(model, equation=identified.posterior.equation, ratios=np.zeros(len(TERM_NAMES)))
        self._set_hull(model, HullPrior.of(identified))

    def _set_hull(self, model: DecayModel | None, prior: HullPrior):
        had_none, self.prior = self.model is None, prior
        self.model = None if model is None else _hull_of(model, prior.mean)
        for track in (self.free, self.driven):
            track.set_hull(self.model, prior.drift)
            track.set_part(OF_HULL, prior.mean, prior.covariance)
        if model is None:
            self.is_free = False
        elif self.is_known and had_none and self.is_started:
            # the moment that stood for the hull's own has nothing to say of the one that is left
            self.levels[0] = 1.0
            self.start(*self.x[:2].tolist(), *np.diag(self.P)[:2].tolist())

    def _forget_stand_in(self):
        """Keep motion and trim alone: the waves' moment belongs to the hull that has stood in."""
        motion, spread = self.x[:HULL_STATES], self.P[:HULL_STATES, :HULL_STATES]
        self._use_moments(self.moments[:1], [1.0])
        self.driven.set_state(*(np.zeros((HULL_STATES + self.moments[0].size,) * count) for count in (1, 2)))
        self.driven.set_part(slice(HULL_STATES), motion, spread)
        self.model = None

    def set_period(self, period: float) -> None:
        """Expect an unknown moment that belongs to a motion of another period, s, and is of the same size as now.

        Before a moment has been seen to act, its size is a guess that belongs to the period.
        """
        if period != self.period:
            self.period, before = period, self.moments[0].variance
            moments = [unknown_moment(period), *self.moments[1:]]
            size = before / moments[0].variance if self._recent else 1.0
            self._use_moments(moments, [self.levels[0] * size, *self.levels[1:]])
            part = self._parts[0]
            self.driven.set_part(part, 0.0, self.driven.moment[2][self._of_moment[0], self._of_moment[0]])

    def set_excitation(self, fit: ExcitationFit, age: float = 0.0) -> None:
        """Use a learnt moment in the driven hull, from the state when it was requested.

        Samples since then are filtered again; ``age``, s, is the time from the request to the newest one.
        """
        if fit.stand_in is not None:
            self._set_hull(fit.stand_in, replace(self.prior, mean=fit.mean[OF_HULL]))
        self._use_moments([self.moments[0], fit.moment], fit.levels)
        self._evidence = 0.0
        if self.is_free:
            self._challenge()
            return
        self._quiet = math.inf
        self.driven.set_state(fit.mean, fit.covariance)
        self._challenge()
        since, passed = [], 0.0
        while self._recent and passed + self._recent[-1][0] < age + 1e-6:
            since.append(self._recent.pop())
            passed += since[-1][0]
        if age - passed > 1e-6:
            self.driven.advance(age - passed)
            self.free.advance(age - passed)
        for sample in reversed(since):
            self.observe(*sample)

    def learnt_hull(self) -> tuple[DecayModel, HullPrior, bool, bool]:
        """What is known of the hull now, or of one that stands in for it, for an `ExcitationRequest`."""
        model, mean, covariance = self.model, self.x[OF_HULL].copy(), self.P[OF_HULL, OF_HULL].copy()
        if model is None or not self.is_known:
            model = hull_that_stands_in(self.period)
            mean[1:] = model.ratios
        prior = replace(self.prior, mean=mean, covariance=covariance)
        return _hull_of(model, mean), prior, self.learns_hull and self.is_known, self.is_known

    def _use_moments(self, moments: Sequence[ModalMoment], levels: Sequence[float]):
        self.moments, self.levels = list(moments), np.array(levels, dtype=float)
        ends = np.cumsum([0, *[m.size for m in self.moments]]).tolist()
        self._of_moment = [slice(a, b) for a, b in zip(ends, ends[1:], strict=False)]
        self._parts = [slice(HULL_STATES + part.start, HULL_STATES + part.stop) for part in self._of_moment]
        self._inverse = block_diag(*[np.linalg.pinv(m.stationary, hermitian=True) for m in self.moments])
        whole = sum_of_moments(self.moments, self.levels)
        self.driven.moment = np.ascontiguousarray(whole.blocks), whole.output, whole.stationary

    def _set_level(self, place: int, level: float):
        """Scale a moment's stationary covariance."""
        self.levels[place] = level = min(max(level, MIN_LEVEL), LARGEST_JUMP**2)
        part = self._of_moment[place]
        np.multiply(self.moments[place].stationary, level, out=self.driven.moment[2][part, part])
        self.driven.foreseen = None

    # -- the samples -------------------------------------------------------------------------------------------

    def start(self, angle: float, rate: float, angle_variance: float, rate_variance: float) -> None:
        """Restart from one sample, rad and rad/s (NaN: not measured); keep trim, ratios and moments' sizes."""
        has_angle, has_rate = angle == angle, rate == rate
        motion = [angle if has_angle else self.x[TRIM], rate if has_rate else 0.0]
        spread = np.diag(
            [
                angle_variance if has_angle else INITIAL_STD**2,
                rate_variance if has_rate else (INITIAL_STD * math.pi / self.period) ** 2,
            ]
        )
        if self.is_free:
            self.driven.set_part(OF_HULL, self.x[OF_HULL], self.P[OF_HULL, OF_HULL])
        self.driven.set_part(slice(2), motion, spread)
        if len(self.moments) == 1:
            self._set_level(0, max(self.levels[0], 1.0))
        self.driven.set_part(slice(HULL_STATES, None), 0.0, self.driven.moment[2])
        self.is_started, self.is_free = True, False
        self.rejections, self._since_used = 0, 0.0
        self._challenge()

    def observe(
        self, elapsed: float, angle: float, rate: float, angle_variance: float, rate_variance: float
    ) -> Observed:
        """Predict over the elapsed s and update with angle, rad, and rate, rad/s; NaN: not measured."""
        self._recent.append((elapsed, angle, rate, angle_variance, rate_variance))
        values, variances, driven, free = (angle, rate), (angle_variance, rate_variance), self.driven, self.free
        tracks = [driven, free] if self.is_known else [driven]
        for track in tracks:
            track.advance(elapsed)
        self._since_used += elapsed
        self._since_jump += elapsed
        if angle != angle and rate != rate:
            return Observed()
        if self._is_outlier(values, variances):
            return self._refuse(angle, rate, angle_variance, rate_variance)
        since, self._since_used, self.rejections = self._since_used, 0.0, 0
        for track in tracks:
            track.update(values, variances, self.learns_hull and track is self.active)
        if driven.strain > HEALTHY_STRAIN:
            self._something_new(rate == rate, since)
        if self.is_known:
            self._weigh(free.log_likelihood - driven.log_likelihood)
        is_quiet = self.is_free or self.levels[0] < INSIGNIFICANT**2
        self._quiet = self._quiet + elapsed if is_quiet else 0.0
        self._since_level += elapsed
        if self._since_level >= LEVEL_INTERVALS[self.model is None] * self.period - 1e-6:
            if not self.is_free:
                self._judge_levels(self._since_level)
            self._since_level = 0.0
        return Observed()

    def _is_outlier(self, values: tuple[float, float], variances: tuple[float, float]):
        """Whether a sample is beyond its gate; what a jump of the moment explains needs a second sample that says so.

        For a radian of the motion after a jump, others may follow it.
        """
        gate = self._gates[sum(value == value for value in values)]
        if self.active.nis(values, variances) <= gate:
            return False
        least = math.sqrt(self.moments[0].variance)
        if self.active.nis_after_jump(values, variances, self._since_used, least) > gate:
            return True
        if not self.rejections and self._since_jump > self.period / math.tau:
            return True
        self._since_jump = 0.0
        return False

    def _weigh(self, for_free: float):
        """Wald's sequential test (1945, Ann. Math. Stat. 16, 117) of the active track: the other one may take over.

        The other restarts from the active one's state as often as it has lost (Page 1954, Biometrika 41, 100), because
        the time of release is unknown.
        """
        self._evidence += -for_free if self.is_free else for_free
        if self._evidence > CONVINCING:
            self.is_free = not self.is_free
            self._evidence = 0.0
        elif self._evidence < -LOST:
            self._challenge()

    def _challenge(self):
        """Restart the inactive track from the state of the active one."""
        self._evidence = 0.0
        if not self.is_free:
            self.free.set_state(self.x[:HULL_STATES], self.P[:HULL_STATES, :HULL_STATES])
            self.free.strain = 1.0
            return
        self._set_level(0, CHALLENGING_LEVEL)
        self.driven.set_state(np.zeros(self._parts[-1].stop), np.zeros((self._parts[-1].stop,) * 2))
        self.driven.set_part(slice(HULL_STATES), self.x, self.P)
        self.driven.set_part(slice(HULL_STATES, None), 0.0, self.driven.moment[2])
        self.driven.strain = 1.0

    def _refuse(self, angle: float, rate: float, angle_variance: float, rate_variance: float):
        self.rejections += 1
        if self.rejections < self.settings.gate_patience:
            self._recent[-1] = (self._recent[-1][0], math.nan, math.nan, angle_variance, rate_variance)
            return Observed(rejected=True)
        self.start(angle, rate, angle_variance, rate_variance)
        if self.model is not None:
            # a craft that lies where its hull would not rest is held there by a moment
            at = float(self.x[ANGLE] - self.x[TRIM]) + self.model.trim
            self._raise_level(float(self.model.acceleration(at, float(self.x[RATE]))) ** 2)
        return Observed(restarted=True)

    def _something_new(self, has_rate: bool, elapsed: float):
        """Innovations are too large: another moment acts, of the size that they show.

        No row of the update's H sees the moment, so that its variance may grow after the update as well as before it.
        """
        self.driven.strain, innovation = 1.0, float(self.driven.y[-1])
        size = innovation / elapsed if has_rate else 2.0 * innovation / (elapsed * elapsed)
        self._raise_level(size**2)

    def _raise_level(self, variance: float):
        """Enlarge the unknown moment, and a learnt sea to its size when learnt."""
        self._add(0, variance / self.moments[0].variance)
        for place in range(1, len(self.moments)):
            self._add(place, max(1.0 - self.levels[place], 0.0))

    def _add(self, place: int, level: float):
        part = self._parts[place]
        self.driven.P[part, part] += level * self.moments[place].stationary
        self._set_level(place, self.levels[place] + level)

    def _judge_levels(self, elapsed: float):
        """Let each moment's size follow what its estimated states support."""
        state, covariance = self.driven.x[HULL_STATES:], self.driven.P[HULL_STATES:, HULL_STATES:]
        told = state * (self._inverse @ state) + (self._inverse * covariance).sum(axis=1)
        for place, part in enumerate(self._of_moment):
            level, size = self.levels.item(place), part.stop - part.start
            gain = min(elapsed / (LEVEL_TIMES[place] * self.period), 1.0)
            excess = sum(told[part].tolist()) / (level * size) - 1.0
            self._set_level(place, level * math.exp(gain * min(max(excess, -1.0), 2.0)))

    def advice(self) -> tuple[Advice, ...]:
        """Whether the waves, or the craft in still water, contradict the model.

        A factor of stiffness or damping more than three of its identified standard deviations off contradicts
        it.
        """
        found = []
        prior, covariance = self.prior, self.P[OF_HULL, OF_HULL]
        for name, direction in prior.directions.items():
            change = float(direction @ (self.x[OF_HULL] - prior.mean))
            before, now = (math.sqrt(direction @ spread @ direction) for spread in (prior.covariance, covariance))
            # an assumed deviation contradicts nothing, and of damping waves tell this filter little
            if prior.is_assumed and name == 'damping' and not self.is_free:
                continue
            is_unlikely = not prior.is_assumed and abs(change) > THREE_STD * before
            is_much = abs(change) > max(MUCH[name], THREE_STD * now)
            if self.model is not None and (is_unlikely or is_much):
                more, stds = 'more' if change > 0.0 else 'less', change / before
                share, axis = abs(math.expm1(change)), self.model.axis
                found.append(
                    Advice.of('model-contradicted', change=share, more=more, quantity=name, axis=axis, stds=stds)
                )
        return tuple(found)

    # -- the forecast ------------------------------------------------------------------------------------------

    def ahead(self, lead: float) -> tuple[np.ndarray, np.ndarray]:
        """Mean (2,) and covariance (2, 2) of angle and rate one lead, s, ahead; the state stays."""
        mean, covariance = self.active.ahead(lead)
        return mean[:TRIM], covariance[:TRIM, :TRIM]

    def forecast(self, leads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (L, 2) and covariance (L, 2, 2) of angle and rate at increasing leads (L,), s; the state stays."""
        return self.active.forecast(leads)


def unknown_moment(period: float) -> ModalMoment:
    """What may act on a craft that moves with a period, s, before anything is known of it: it may hold it in place."""
    frequency = 2.0 * math.pi / period
    return markov_moment((USUAL_AMPLITUDE * frequency**2) ** 2, MARKOV_TIME * period)


def hull_that_stands_in(period: float) -> DecayModel:
    """A hull of the motion's period, s, with a quarter of critical damping; another one would do as well."""
    frequency = 2.0 * math.pi / period
    ratios = {'b1': 0.5 * frequency, 'r1': frequency**2}
    return DecayModel(composed(ratios), np.array([ratios.get(name, 0.0) for name in TERM_NAMES]))


def _hull_of(model: DecayModel, mean: np.ndarray):
    """The hull with trim and ratios of the state."""
    return replace(model, trim=float(mean[0]), ratios=mean[1:])
