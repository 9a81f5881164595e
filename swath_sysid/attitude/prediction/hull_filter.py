"""The filter of one axis on a known hull: an extended Kalman filter whose exciting moment is a state space inside it.

    d(angle)/dt = rate
    d(rate)/dt  = -exp(d) D(rate) - exp(k) R(angle - trim) + h z        D, R: the identified damping and restoring
    d(trim)/dt, dk/dt, dd/dt = slow random walks, from what the identification knows of them
    dz/dt       = A z + w                                               (`modal_moment`)

The moment is a sum of two: one of which nothing is known but its size (second-order Markov: a hand on the craft, a
gust, a sea not yet learnt) and, once learnt, that of the sea (`excitation_model`). The size of each is the one that
the estimated states support: in still water it vanishes, and the hull alone remains.
"""
import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from scipy.linalg import cho_factor, cho_solve, eigh
from scipy.stats import chi2

from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.hull.terms import term_moments
from swath_sysid.attitude.prediction import hull_step
from swath_sysid.attitude.prediction.hull_step import HULL_STATES
from swath_sysid.attitude.prediction.modal_moment import ModalMoment, joined, markov_moment
from swath_sysid.common.accelerator import HAS_NUMBA
from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError

ANGLE, RATE, TRIM, STIFFNESS, DAMPING = range(HULL_STATES)

NO_HULL = (0.0,) * 9, (False,) * 9, 1.0

TRIM_DRIFT = 3e-6**2
"""rad^2/s; .01 deg in an hour. Thirty times the drift would hide the slow parts of the sea."""

SCALE_DRIFT = 1e-4**2
"""1/s; the scales move by 2 % in ten hours of a voyage."""

UNKNOWN_TRIM_STD = 0.02
IDENTIFIED_TRIM_STD = 5e-4
"""rad; identification reports 3e-5 to 7e-4."""

LEAST_STIFFNESS_STD = 0.001
LEAST_DAMPING_STD = 0.005
MOST_SCALE_STD = 1.0
"""Of the logarithms of the scales: no model is exact, and none is worth nothing."""

USUAL_AMPLITUDE = 0.05
"""rad; where the ratios' covariance is weighed, if the identification does not say which amplitudes it saw."""

INITIAL_ANGLE_STD = 0.3
INITIAL_RATE_STD = 0.3
"""rad and rad/s, of what the first sample does not measure."""

MARKOV_TIME = 0.5
"""s; one over the corner frequency of the moment of which nothing is known."""

MARKOV_STD = 0.3
"""rad/s^2; its size at the start."""

LEAST_LEVEL, MOST_LEVEL = 1e-10, 1e4
"""Of a moment's variance over what it was taken up with; 30 rad/s^2 is the most that moves a craft."""

LEVEL_INTERVAL = 0.05
"""s between two judgements of the moments' sizes."""

FREE_LEVEL_INTERVAL = 1.0
"""s; the same while no hull is known: nothing but the filter's own smoothness hangs on it."""

LEVEL_TIMES = 2.0, 60.0
"""s; a size drifts towards what the states support: the unknown moment's, and that of a learnt sea."""

CONVINCING = 3.0, 12.0
"""Logarithm of the likelihood ratio from which on either is taken to have shrunk at once."""

UNFORESEEN = 1e-8
"""Of a learnt sea's variance: that of the unknown moment beside it, at first."""

RENEWAL = 2.0
"""s; after so long a moment's smallness tells anew."""

STRAIN_GAIN = 0.2
MOST_STRAIN = 3.5
"""Running mean of the innovations squared over their expectation, and from where on something new must be acting."""

NEWCOMER = 0.5
"""Of the moment that one interval's innovation shows: it has often acted for longer. Too little is raised again."""

RECENT = 400
"""Samples that are kept to be taken in anew when a fit arrives."""

INSIGNIFICANT = 0.01
"""rad/s^2; an unknown moment of less is none."""

QUIET = 3.0
"""s; trim and scales are learnt once the unknown moment has been insignificant for so long."""

LONGEST_STEP = 0.05
"""s; the moment acts by the mean of its values at both ends of a step."""


CONTRADICTION = 3.0
"""Standard deviations."""

MUCH = 0.1, 0.3
"""Logarithms of the scales of stiffness and damping that are worth a word however little was known before."""


class HullUncertainty(NamedTuple):
    """What is not known of an identified hull.

    Attributes
    ----------
    trim_std : float
        rad; NaN: not known.
    stiffness_std, damping_std : float
        Relative.
    """

    trim_std: float = IDENTIFIED_TRIM_STD
    stiffness_std: float = 0.0
    damping_std: float = 0.0

    @classmethod
    def of(cls, identified):
        """Relative uncertainty of the restoring and damping moments at the amplitude that the identification saw.

        Parameters
        ----------
        identified : IdentifiedModel

        Returns
        -------
        HullUncertainty
        """
        if not identified.covariance.any():
            return cls()
        model, (_, largest) = identified.model, identified.amplitude_range
        amplitude = 0.5 * largest if math.isfinite(largest) and largest > 0.0 else USUAL_AMPLITUDE
        frequency = model.natural_frequency
        rate = amplitude * (frequency if frequency == frequency else 1.0)
        moments = term_moments(amplitude, rate, model.friction_rate)[model.equation.indices]
        parts = model.ratios[model.equation.indices] * moments
        is_damping = model.equation.indices < 4

        def relative(chosen):
            direction = np.where(chosen, moments, 0.0)
            variance = float(direction @ identified.covariance @ direction)
            return math.sqrt(max(variance, 0.0)) / max(abs(float(parts[chosen].sum())), 1e-12)

        return cls(identified.trim_std, relative(~is_damping), relative(is_damping))


@dataclass(frozen=True)
class HullFilterSettings:
    """When a sample is refused.

    Attributes
    ----------
    gate_probability : float
        A true measurement is taken for an outlier with this probability.
    gate_patience : int
        After so many rejected samples in a row the filter starts anew from the sensor.
    """

    gate_probability: float = 1e-12
    gate_patience: int = 5

    def __post_init__(self):
        if not 0.0 < self.gate_probability < 0.5:
            raise InputError('a gate_probability of 0.5 or more rejects good samples: give 1e-3 or less')
        if not self.gate_patience > 0:
            raise InputError('gate_patience must be 1 sample or more')


class Observed(NamedTuple):
    """What one sample led to.

    Attributes
    ----------
    nis : float
        Normalised innovation squared; NaN where nothing was measured.
    measured : int
        How many values (0, 1 or 2) the sample gave.
    rejected : bool
        The gate refused the sample.
    restarted : bool
        The filter began anew from this sample.
    log_likelihood : float
        Of the sample, natural logarithm; zero where nothing was measured or it was rejected.
    advice : tuple of Advice
    surprised : bool
        A moment that nothing foretold has begun to act: a hand, a line, a gust.
    """

    nis: float = math.nan
    measured: int = 0
    rejected: bool = False
    restarted: bool = False
    log_likelihood: float = 0.0
    advice: tuple[Advice, ...] = ()
    surprised: bool = False


@dataclass(frozen=True)
class ExcitationRequest:
    """A window to learn a moment from (`excitation_model.fit_excitation`).

    Attributes
    ----------
    model : DecayModel
        The hull.
    hull_mean, hull_covariance : ndarray, shapes (3,) and (3, 3)
        Trim, rad, and logarithms of the scales of stiffness and damping, as the filter knows them now.
    hull_is_learnt : bool
        Whether the filter has learnt them in this window already.
    step : float
        s between the samples.
    angle, rate : ndarray, shape (N,)
        rad, rad/s, each the mean of the sensor's samples in a step.
    angle_variance, rate_variance : float
        Of the noise of these means.
    samples : int
        Of the sensor in a step.
    """

    model: DecayModel
    hull_mean: np.ndarray
    hull_covariance: np.ndarray
    hull_is_learnt: bool
    step: float
    angle: np.ndarray
    rate: np.ndarray
    angle_variance: float
    rate_variance: float
    samples: int = 1


@dataclass(frozen=True)
class ExcitationFit:
    """A learnt moment.

    Attributes
    ----------
    moment : ModalMoment
    mean, covariance : ndarray, shapes (n,) and (n, n)
        Of the whole state of a filter with it, at the time of the window's last sample.
    levels : tuple of 2 floats
        Sizes of the unknown moment and of this one then.
    """

    moment: ModalMoment
    mean: np.ndarray
    covariance: np.ndarray
    levels: tuple[float, float]


class HullFilter(ExtendedKalmanFilter):
    """Extended Kalman filter of one axis.

    It holds no clock: every call says how much time has passed. Same calls, same numbers. ``x`` and ``P`` are
    filterpy's; so are ``predict`` and ``update`` where numba is absent, after `linearise`.

    Parameters
    ----------
    settings : HullFilterSettings
    """

    def __init__(self, settings=None):
        self.settings = s = settings or HullFilterSettings()
        self._use_moments([markov_moment(MARKOV_STD**2, MARKOV_TIME)], [1.0])
        self.model = None
        self.is_started = False
        self.rejections = 0
        self._may_learn = True
        self._quiet = 0.0
        self._uncertainty = HullUncertainty(math.nan)
        self._gates = [math.inf, *(float(chi2.isf(s.gate_probability, m)) for m in (1, 2))]
        size = HULL_STATES + self.moments[0].size
        super().__init__(dim_x=size, dim_z=2)
        self.x, self.P = np.zeros(size), np.eye(size)
        self._since_level = 0.0
        self._strain = 1.0
        self._doubt = 0.0
        self._foreseen = None
        self._recent = deque(maxlen=RECENT)
        self._use_hull()

    @classmethod
    def for_window(cls, request, moment):
        """A filter for the window of a request, with the moment learnt from it, not started yet.

        Trim and scales are learnt only if the filter that asked has not learnt them in this window: no sample
        counts twice.

        Parameters
        ----------
        request : ExcitationRequest
        moment : ModalMoment

        Returns
        -------
        HullFilter
        """
        made = cls()
        made.set_hull(request.model)
        hand = made.moments[0]
        made._use_moments([hand, moment], (UNFORESEEN * moment.variance / hand.variance, 1.0))
        size = HULL_STATES + hand.size + moment.size
        made._resize(np.zeros(size), np.eye(size))
        made._set_part(range(TRIM, HULL_STATES), request.hull_mean, request.hull_covariance)
        made._may_learn = not request.hull_is_learnt
        made._quiet = math.inf
        return made

    # -- hull and moment ---------------------------------------------------------------------------------------

    def set_hull(self, model, uncertainty=None):
        """Swap the hull; the state of motion and the moment's estimate go on.

        Parameters
        ----------
        model : DecayModel or None
            None: no restoring and no damping, a constant rate that the moment drives.
        uncertainty : HullUncertainty or None
            None: exactly known, but for what no model is exact in.
        """
        was_without = self.model is None
        self.model = model
        self._uncertainty = uncertainty or HullUncertainty(IDENTIFIED_TRIM_STD if model else math.nan)
        self._foreseen = None
        self._use_hull()
        if was_without and model is not None and self.is_started:
            # the moment that stood for the hull's own has nothing to say of the one that is left
            self.levels[0] = 1.0
            self.start(*self.x[:2].tolist(), *np.diag(self.P)[:2].tolist())

    def _use_hull(self):
        model, u = self.model, self._uncertainty
        self._hull = NO_HULL if model is None else (
            tuple(model.ratios.tolist()), model.equation.active, float(model.friction_rate)
        )  # fmt: skip
        fastest = 0.0
        if model is not None:
            by_angle, by_rate = model.jacobian(model.trim, 0.0)
            fastest = max(math.sqrt(abs(by_angle)), abs(by_rate))
        self._drifts = TRIM_DRIFT, 0.0 if model is None else SCALE_DRIFT
        self._longest = min(LONGEST_STEP, 0.25 / fastest if fastest > 0.0 else LONGEST_STEP)
        self._set_part([TRIM, STIFFNESS, DAMPING], [model.trim if model else 0.0, 0.0, 0.0], np.diag(self._prior(u)))

    def _prior(self, uncertainty):
        if self.model is None:
            return np.array([UNKNOWN_TRIM_STD**2, 0.0, 0.0])
        trim_std = uncertainty.trim_std if uncertainty.trim_std == uncertainty.trim_std else UNKNOWN_TRIM_STD
        return np.square([
            trim_std,
            min(max(uncertainty.stiffness_std, LEAST_STIFFNESS_STD), MOST_SCALE_STD),
            min(max(uncertainty.damping_std, LEAST_DAMPING_STD), MOST_SCALE_STD),
        ])

    def _set_part(self, places, mean, covariance):
        self.x[places] = mean
        self.P[places] = 0.0
        self.P[:, places] = 0.0
        self.P[np.ix_(list(places), list(places))] = covariance

    def set_excitation(self, fit, age=0.0):
        """Take up a learnt moment.

        The filter goes on from the state that the fit found at its window's end, and takes in anew the samples that
        have come since.

        Parameters
        ----------
        fit : ExcitationFit or None
            None: forget the one in use.
        age : float
            s from the time of the window's last sample to that of the newest one here.
        """
        self._foreseen = None
        hand = self.moments[0]
        if fit is None:
            kept = np.arange(HULL_STATES + hand.size)
            self._use_moments([hand], self.levels[:1])
            self._resize(self.x[kept], self.P[np.ix_(kept, kept)])
            return
        self._use_moments([hand, fit.moment], fit.levels)
        self._quiet = math.inf
        self._resize(fit.mean.copy(), fit.covariance)
        since, passed = [], 0.0
        while self._recent and passed + self._recent[-1][0] < age + 1e-6:
            since.append(self._recent.pop())
            passed += since[-1][0]
        if age - passed > 1e-6:
            self._advance_state(self.x, self.P, age - passed)
        for sample in reversed(since):
            self.observe(*sample)

    def _resize(self, mean, covariance):
        self.x, self.P = mean, np.array(covariance)
        self.dim_x = mean.size
        self._I = np.eye(self.dim_x)

    def excitation_request(self, step, angle, rate, angle_variance, rate_variance, samples=1):
        """A window of the past, with what is known of the hull now, for `fit_excitation`.

        Parameters
        ----------
        step : float
            s between the samples.
        angle, rate : ndarray, shape (N,)
            rad, rad/s, each the mean of the sensor's samples in a step; without gaps.
        angle_variance, rate_variance : float
            Of the noise of these means.
        samples : int
            Of the sensor in a step.

        Returns
        -------
        ExcitationRequest or None
            None: there is no hull through which a moment could be seen.
        """
        if self.model is None:
            return None
        hull = slice(TRIM, HULL_STATES)
        return ExcitationRequest(
            self.model, self.x[hull].copy(), self.P[hull, hull].copy(), self.learns_hull, step, angle, rate,
            angle_variance, rate_variance, samples,
        )  # fmt: skip

    def _use_moments(self, moments, levels):
        self.moments, self.levels = list(moments), np.array(levels, dtype=float)
        ends = HULL_STATES + np.cumsum([0, *[m.size for m in self.moments]])
        self._parts = [slice(int(a), int(b)) for a, b in zip(ends, ends[1:], strict=False)]
        self._inverses = [np.linalg.pinv(m.stationary, hermitian=True) for m in self.moments]
        whole = self._whole()
        self._transition = None
        self._insignificant = INSIGNIFICANT**2 / self.moments[0].variance
        self._moment = np.ascontiguousarray(whole.blocks), whole.output, whole.stationary

    def _whole(self):
        return joined([m.scaled(g) for m, g in zip(self.moments, self.levels, strict=True)])

    def _set_level(self, place, level):
        """Give a moment another size: the covariance that it tends to."""
        self.levels[place] = level = min(max(level, LEAST_LEVEL), MOST_LEVEL)
        moment, part = self.moments[place], self._parts[place]
        part = slice(part.start - HULL_STATES, part.stop - HULL_STATES)
        self._moment[2][part, part] = level * moment.stationary

    @property
    def learns_hull(self):
        """Whether trim and scales are learnt: not while a moment of which nothing is known may explain anything."""
        return self._may_learn and self._quiet > QUIET

    @property
    def covariance(self):
        """Of angle and rate, shape (2, 2)."""
        return self.P[:2, :2].copy()

    @property
    def strain(self):
        """Running mean of the innovations squared over their expectation; one is healthy."""
        return self._strain

    @property
    def moment(self):
        """The estimated moment over inertia, rad/s^2."""
        return float(self._moment[1] @ self.x[HULL_STATES:])

    # -- the samples -------------------------------------------------------------------------------------------

    def start(self, angle, rate, angle_variance, rate_variance):
        """Begin anew from one sample (NaN: not measured). Trim, scales and the moments' sizes are kept.

        Parameters
        ----------
        angle, rate : float
            rad, rad/s.
        angle_variance, rate_variance : float
            rad^2, rad^2/s^2.
        """
        has_angle, has_rate = angle == angle, rate == rate
        motion = [angle if has_angle else self.x[TRIM], rate if has_rate else 0.0]
        spread = np.diag([
            angle_variance if has_angle else INITIAL_ANGLE_STD**2, rate_variance if has_rate else INITIAL_RATE_STD**2
        ])
        self._set_part([ANGLE, RATE], motion, spread)
        if len(self.moments) == 1:
            self._set_level(0, max(self.levels[0], 1.0))
        self._set_part(range(HULL_STATES, self.dim_x), 0.0, self._moment[2])
        self.is_started = True
        self.rejections = 0
        self._strain = 1.0
        self._foreseen = None

    def observe(self, elapsed, angle, rate, angle_variance, rate_variance):
        """Predict over the time since the sample before, and take in what was measured (NaN: not measured).

        Parameters
        ----------
        elapsed : float
            s.
        angle, rate : float
            rad, rad/s.
        angle_variance, rate_variance : float
            Of the sensor's noise, rad^2 and rad^2/s^2.

        Returns
        -------
        Observed
        """
        self._recent.append((elapsed, angle, rate, angle_variance, rate_variance))
        if self._foreseen is not None and abs(self._foreseen[0] - elapsed) < 1e-6:
            _, self.x, self.P = self._foreseen
        elif elapsed > 0.0:
            self._advance_state(self.x, self.P, elapsed)
        self._foreseen = None
        measured, nis, log_likelihood, gate_nis = hull_step.innovation(
            self.x, self.P, self._moment[1], self._hull, elapsed, angle, rate, angle_variance, rate_variance,
            MARKOV_STD,
        )  # fmt: skip
        if measured == 0:
            return Observed()
        if gate_nis > self._gates[measured]:
            return self._refuse(angle, rate, angle_variance, rate_variance, nis, measured)
        self.rejections = 0
        self._strain += STRAIN_GAIN * (nis / measured - self._strain)
        surprised = self._strain > MOST_STRAIN
        if surprised:
            self._something_new(angle, rate, elapsed)
        self._take_in(angle, rate, angle_variance, rate_variance)
        self._quiet = self._quiet + elapsed if self.levels[0] < self._insignificant else 0.0
        self._since_level += elapsed
        if self._since_level >= (FREE_LEVEL_INTERVAL if self.model is None else LEVEL_INTERVAL) - 1e-6:
            self._judge_levels(self._since_level)
            self._since_level = 0.0
        return Observed(nis, measured, False, False, log_likelihood, surprised=surprised)

    def _advance_state(self, mean, covariance, duration):
        if HAS_NUMBA:
            hull_step.predict(mean, covariance, self._moment, self._hull, self._drifts, duration, self._longest)
            return
        own = self.x, self.P
        self.x, self.P = mean.copy(), covariance.copy()
        for _ in range(count := self.steps(duration)):
            self.linearise(duration / count)
            self.predict()
        mean[:], covariance[:] = self.x, self.P
        hull_step.limit(covariance)
        self.x, self.P = own

    def steps(self, duration):
        """How many steps a prediction over a duration, s, takes."""
        return max(1, math.ceil(duration / self._longest - 1e-6))

    def linearise(self, step):
        """Set F, Q and the end of the mean for filterpy's own ``predict``.

        Parameters
        ----------
        step : float
            s, short against the hull's period.
        """
        h, at_rest = self._moment[1:]
        if self._transition is None or self._transition[0] != step:
            self._transition = step, self._whole().transition(step)
        f = self._transition[1]
        now = self.x[HULL_STATES:]
        then = f @ now
        mean_output = 0.5 * (h + h @ f)
        angle, rate, to_angle, to_rate = hull_step.hull_step(
            *map(float, self.x[:HULL_STATES]), float(mean_output @ now), float(self.P[1, 1]), step, self._hull
        )
        self._then = np.concatenate([[angle, rate], self.x[2:HULL_STATES], then])
        hull, gain = np.eye(HULL_STATES), np.zeros(HULL_STATES)
        hull[0], hull[1] = to_angle[:5], to_rate[:5]
        gain[:2] = to_angle[5], to_rate[5]
        self.F = np.zeros((self.dim_x, self.dim_x))
        self.F[:HULL_STATES, :HULL_STATES], self.F[HULL_STATES:, HULL_STATES:] = hull, f
        self.F[:HULL_STATES, HULL_STATES:] = np.outer(gain, mean_output)
        # what drives the moment in the step acts on the hull by half
        noise = at_rest - f @ at_rest @ f.T
        driven = np.vstack([np.outer(gain, 0.5 * h), np.eye(h.size)])
        self.Q = driven @ noise @ driven.T
        drifts = np.array(self._drifts)[[0, 1, 1]]
        self.Q[TRIM:HULL_STATES, TRIM:HULL_STATES] += np.diag(drifts * step)

    def predict_x(self, u=0):
        """filterpy's hook: the mean over the step of the nonlinear hull that `linearise` has set."""
        self.x = self._then

    def _take_in(self, angle, rate, angle_variance, rate_variance):
        if HAS_NUMBA:
            hull_step.observe(self.x, self.P, angle, rate, angle_variance, rate_variance, self.learns_hull)
            return
        hull = slice(TRIM, HULL_STATES)
        considered = self.x[hull].copy(), self.P[hull, hull].copy()
        places = [k for k, value in enumerate((angle, rate)) if value == value]
        rows = np.eye(self.dim_x)[places]
        self.update(
            np.array([angle, rate])[places], lambda x: rows, lambda x: rows @ x,
            R=np.diag([angle_variance, rate_variance])[np.ix_(places, places)],
        )  # fmt: skip
        if not self.learns_hull:
            self.x[hull], self.P[hull, hull] = considered

    def _refuse(self, angle, rate, angle_variance, rate_variance, nis, measured):
        self.rejections += 1
        if self.rejections < self.settings.gate_patience:
            return Observed(nis, measured, rejected=True)
        count = self.rejections
        self.start(angle, rate, angle_variance, rate_variance)
        self._hold_still()
        advice = Advice(
            'gate-restarted',
            f'{count} samples in a row disagreed with the forecast, so the filter began anew from the sensor: '
            'check the mounting and the noise settings if this repeats',
        )
        return Observed(nis, measured, restarted=True, advice=(advice,))

    def _hold_still(self):
        """A craft that lies where its hull would not rest is held there by a moment."""
        if self.model is None:
            return
        held = -float(self.model.acceleration(float(self.x[0] - self.x[2]) + self.model.trim, float(self.x[1])))
        self._raise_level(held * held)

    def _something_new(self, angle, rate, elapsed):
        """The innovations are too large: another moment has begun to act, of the size that they show."""
        self._strain = 1.0
        e0, e1 = angle - float(self.x[0]), rate - float(self.x[1])
        size = e1 / elapsed if e1 == e1 else 2.0 * e0 / (elapsed * elapsed)
        self._raise_level((NEWCOMER * size) ** 2)

    def _raise_level(self, variance):
        """Let the unknown moment be that much larger, and a learnt sea as large as when it was learnt."""
        self._add(0, variance / self.moments[0].variance)
        for place in range(1, len(self.moments)):
            self._add(place, max(1.0 - self.levels[place], 0.0))

    def _add(self, place, level):
        part = self._parts[place]
        self.P[part, part] += level * self.moments[place].stationary
        self._set_level(place, self.levels[place] + level)

    # -- the moments' sizes ------------------------------------------------------------------------------------

    def _judge_levels(self, elapsed):
        """Let each moment's size follow what its estimated states support (see `supported_level`)."""
        for place, (moment, part, inverse) in enumerate(zip(self.moments, self._parts, self._inverses, strict=True)):
            level, factor = float(self.levels[place]), 1.0
            unknown, square = hull_step.support(self.x, self.P, part.start, inverse)
            known, square = moment.size - unknown / level, square / level
            # nothing convinces where not even one direction is known
            if square < 0.5 * known and known > 0.99:
                factor, evidence, of_a_quarter = supported_level(
                    self.x[part], self.P[part, part], level * moment.stationary
                )
                if evidence < CONVINCING[place] and not self._has_long_been_small(place, of_a_quarter, elapsed):
                    factor = 1.0
            if factor == 1.0:
                gain = min(elapsed / LEVEL_TIMES[place], 1.0)
                factor = math.exp(gain * min(max((square - known) / moment.size, -1.0), 2.0))
            else:
                self._shrink(part, level * moment.stationary, factor)
            self._set_level(place, factor * level)

    def _has_long_been_small(self, place, of_a_quarter, elapsed):
        """Whether the evidence for a moment much smaller has added up."""
        if place > 0:
            return False
        self._doubt = max(self._doubt + of_a_quarter * elapsed / RENEWAL, 0.0)
        if self._doubt < CONVINCING[0]:
            return False
        self._doubt = 0.0
        return True

    def _shrink(self, part, prior, factor):
        """Had the moment been that much smaller all along: its estimate beside the smaller prior (Bayes' rule)."""
        # a measurement z = 0 of covariance prior / (1 / factor - 1)
        noise = prior / (1.0 / factor - 1.0)
        cross = self.P[:, part]
        gain = cho_solve(cho_factor(self.P[part, part] + noise), cross.T).T
        self.x = self.x - gain @ self.x[part]
        covariance = self.P - gain @ cross.T
        self.P = 0.5 * (covariance + covariance.T)

    def advice(self):
        """What to say of the model: whether the sea, or the craft in still water, contradicts it.

        The scales begin at one with what the identification knows of them. Innovations that draw one further than
        `CONTRADICTION` of its standard deviations were not made by this hull.

        Returns
        -------
        tuple of Advice
        """
        if self.model is None:
            return ()
        found = []
        prior, spread = self._prior(self._uncertainty)[1:], np.diag(self.P)[STIFFNESS:HULL_STATES]
        scales = self.x[STIFFNESS:HULL_STATES]
        for name, log_scale, before, now, much in zip(
            ('stiffness', 'damping'), scales.tolist(), prior.tolist(), spread.tolist(), MUCH, strict=True
        ):
            is_unlikely = abs(log_scale) > CONTRADICTION * math.sqrt(before)
            is_much = abs(log_scale) > much and abs(log_scale) > CONTRADICTION * math.sqrt(now)
            if is_unlikely or is_much:
                found.append(Advice(
                    'model-contradicted',
                    f'the motion asks for {"more" if log_scale > 0.0 else "less"} {name} than the {self.model.axis} '
                    f'model has, and than its uncertainty allows ({log_scale / math.sqrt(before):+.1f} standard '
                    'deviations): identify again',
                ))  # fmt: skip
        return tuple(found)

    # -- the forecast ------------------------------------------------------------------------------------------

    def ahead(self, lead):
        """One lead after the present state, which stays as it is.

        Returns
        -------
        tuple of 5 floats
            Angle, rate, angle variance, covariance of both, rate variance.
        """
        if self._foreseen is None or self._foreseen[0] != lead:
            mean, covariance = self.x.copy(), self.P.copy()
            if lead > 0.0:
                self._advance_state(mean, covariance, lead)
            self._foreseen = lead, mean, covariance
        _, mean, covariance = self._foreseen
        return (
            float(mean[0]), float(mean[1]), float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])
        )

    def forecast(self, leads):
        """Angle and rate at leads after the present state, which stays as it is.

        Parameters
        ----------
        leads : ndarray, shape (L,)
            s, increasing.

        Returns
        -------
        angle, rate : ndarray, shape (L,)
        covariance : ndarray, shape (L, 2, 2)
        """
        durations = np.diff(np.asarray(leads, dtype=float), prepend=0.0)
        mean, covariance = self.x.copy(), self.P.copy()
        means, spreads = np.empty((durations.size, 2)), np.empty((durations.size, 2, 2))
        if HAS_NUMBA:
            hull_step.predict_to(
                mean, covariance, self._moment, self._hull, self._drifts, durations, self._longest, means, spreads
            )
        else:
            for k, duration in enumerate(durations.tolist()):
                if duration > 0.0:
                    self._advance_state(mean, covariance, duration)
                means[k], spreads[k] = mean[:2], covariance[:2, :2]
        return means[:, 0], means[:, 1], spreads


_FACTORS = np.geomspace(4.0, 1e8, 60)[:, None]


def supported_level(mean, covariance, prior):
    """The factor (a quarter or less) on a moment's variance that its estimate supports best, and its evidence.

    With the prior N(0, V) and the estimate N(z, P), the evidence for a prior N(0, V / c) over that for N(0, V) is
    the product over the eigenvectors of P against V, with eigenvalues r and whitened means u, of

        sqrt(c / q) exp(-(c - 1) u^2 / (2 q)),      q = 1 + (c - 1) r,

    so that only what is known (r < 1) counts.

    Parameters
    ----------
    mean : ndarray, shape (n,)
    covariance, prior : ndarray, shape (n, n)

    Returns
    -------
    factor : float
    evidence, of_a_quarter : float
        Logarithms of the likelihood ratio, of that factor and of a quarter.
    """
    size = np.sqrt(np.diag(prior))
    scale = np.outer(size, size)
    values, vectors = eigh(covariance / scale, prior / scale + 1e-12 * np.eye(size.size))
    square = (vectors.T @ (mean / size)) ** 2
    values = np.clip(values, 0.0, 1.0)
    q = 1.0 + (_FACTORS - 1.0) * values
    evidence = 0.5 * (np.log(_FACTORS / q) - (_FACTORS - 1.0) * (square / q)).sum(axis=1)
    best = int(evidence.argmax())
    return 1.0 / float(_FACTORS[best, 0]), float(evidence[best]), float(evidence[0])
