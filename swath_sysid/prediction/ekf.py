"""The attitude filter of one axis: filterpy's extended Kalman filter on the identified hull.

State: angle, Euler rate, trim, disturbance (moment over inertia). The mean follows the
nonlinear model (classical Runge-Kutta), the covariance its analytic Jacobian:

    d(angle)/dt = rate
    d(rate)/dt  = f(angle - trim, rate) + disturbance
    d(trim)/dt  = slow random walk
    d(disturbance)/dt = -disturbance / tau + white noise      (Singer 1970, first-order Markov)

Before a hull is known f is zero: constant rate, driven by the disturbance.
"""
import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from scipy.stats import chi2

from swath_sysid.advice import Advice
from swath_sysid.errors import InputError
from swath_sysid.prediction import filter_step
from swath_sysid.prediction.filter_step import CAPSIZED
from swath_sysid.prediction.sensor_noise import NoiseSettings

ANGLE, RATE, TRIM, DISTURBANCE = range(4)
STATE_NAMES = ('angle', 'rate', 'trim', 'disturbance')

_UPPER = np.triu_indices(4)
_PLACES = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])
"""Of each element of a covariance in its upper triangle."""

_SAME_LEAD = 1e-6
_FREE_TERMS = (0.0,) * 9, (False,) * 9, 1.0


@dataclass(frozen=True)
class FilterSettings:
    """What the filter believes of sensor and sea before it has seen either.

    Attributes
    ----------
    angle_noise, rate_noise : NoiseSettings
        Noise of a measured angle (rad) and rate (rad/s), for sensors that do not tell theirs.
    gate_probability : float
        A true measurement is taken for an outlier with this probability.
    gate_patience : int
        After so many rejected samples in a row the sensor is believed, and the filter starts anew from it.
    disturbance_time : float
        Correlation time of the disturbance, s.
    disturbance_initial, disturbance_least, disturbance_most : float
        Its standard deviation at the start, and the bounds of its adaptation, rad/s^2.
    adaptation_time : float
        Time over which the disturbance's size follows the innovations, s.
    initial_angle_std, initial_rate_std, trim_std : float
        Of the first state, where not measured, rad, rad/s, rad.
    identified_trim_std : float
        Of the trim that comes with an identified hull, rad; identification tells 3e-5 to 7e-4.
    trim_drift : float
        Random walk of the trim, rad/sqrt(s).
    trim_time : float
        The trim moves by its standard deviation in this time at most, s.
    """

    angle_noise: NoiseSettings = field(default_factory=NoiseSettings)
    rate_noise: NoiseSettings = field(default_factory=lambda: NoiseSettings(0.005, 1e-4, 0.05))
    gate_probability: float = 1e-12
    gate_patience: int = 5
    disturbance_time: float = 0.5
    disturbance_initial: float = 0.3
    disturbance_least: float = 1e-3
    disturbance_most: float = 100.0
    adaptation_time: float = 1.0
    initial_angle_std: float = 0.3
    initial_rate_std: float = 0.3
    trim_std: float = 0.02
    identified_trim_std: float = 5e-4
    trim_drift: float = 1e-4
    trim_time: float = 20.0

    def __post_init__(self):
        for name, value in vars(self).items():
            if not isinstance(value, NoiseSettings) and not value > 0.0:
                raise InputError(f'the filter setting {name} must be positive, not {value}: give a positive number')
        if self.disturbance_least > self.disturbance_most:
            raise InputError('disturbance_least exceeds disturbance_most: swap them')
        if self.gate_probability >= 0.5:
            raise InputError('a gate_probability of 0.5 or more rejects good samples: give 1e-3 or less')


class AttitudeEstimate(NamedTuple):
    """What the filter knows of one axis after a sample.

    Attributes
    ----------
    stamp : float
        s.
    angle, rate, trim, disturbance : float
        rad, rad/s, rad, rad/s^2.
    angle_variance, angle_rate_covariance, rate_variance : float
        rad^2, rad^2/s, rad^2/s^2.
    nis : float
        Normalised innovation squared; NaN when nothing was measured.
    measured : int
        How many values (0, 1 or 2) the sample gave.
    rejected : bool
        The gate refused the sample.
    restarted : bool
        The filter began anew from this sample.
    advice : tuple of Advice
    """

    stamp: float
    angle: float
    rate: float
    trim: float
    disturbance: float
    angle_variance: float
    angle_rate_covariance: float
    rate_variance: float
    nis: float = math.nan
    measured: int = 0
    rejected: bool = False
    restarted: bool = False
    advice: tuple[Advice, ...] = ()

    @property
    def covariance(self):
        """Of angle and rate, shape (2, 2)."""
        return np.array([
            [self.angle_variance, self.angle_rate_covariance], [self.angle_rate_covariance, self.rate_variance]
        ])


@dataclass(frozen=True)
class FilterState:
    """Everything an `AttitudeFilter` remembers (for saving, moving and comparing)."""

    stamp: float
    mean: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    disturbance_variance: float
    rejections: int
    nis_ratio: float


class FreeMotion:
    """The model before a model: no hull moment at all, so that the rate stays constant."""

    trim = 0.0

    def acceleration(self, angle, rate):
        """Zero, rad/s^2."""
        return 0.0

    def jacobian(self, angle, rate):
        """Zero derivatives."""
        return 0.0, 0.0


FREE_MOTION = FreeMotion()

def runge_kutta_step(acceleration, angle, rate, disturbance, step):
    """One classical Runge-Kutta step of d(rate)/dt = acceleration(angle, rate) + disturbance.

    Returns
    -------
    angle, rate : float
    """
    half = 0.5 * step
    a1 = acceleration(angle, rate) + disturbance
    rate2 = rate + half * a1
    a2 = acceleration(angle + half * rate, rate2) + disturbance
    rate3 = rate + half * a2
    a3 = acceleration(angle + half * rate2, rate3) + disturbance
    rate4 = rate + step * a3
    a4 = acceleration(angle + step * rate3, rate4) + disturbance
    return (
        angle + step / 6.0 * (rate + 2.0 * (rate2 + rate3) + rate4),
        rate + step / 6.0 * (a1 + 2.0 * (a2 + a3) + a4),
    )


def transition(by_angle, by_rate, step, tau):
    """Transition matrix of the linearised state over one step, shape (4, 4); see `filter_step`."""
    *rows, decay = filter_step.transition_elements(by_angle, by_rate, step, tau)
    matrix = np.diag([0.0, 0.0, 1.0, decay])
    matrix[:2] = np.reshape(rows, (2, 4))
    return matrix


def process_noise(disturbance_variance, tau, trim_drift, step):
    """Process noise over one step, shape (4, 4): the Singer model's leading terms; see `filter_step`."""
    q00, q01, q03, q11, q13, q22, q33 = filter_step.noise_elements(disturbance_variance, tau, trim_drift, step)
    return np.array([[q00, q01, 0.0, q03], [q01, q11, 0.0, q13], [0.0, 0.0, q22, 0.0], [q03, q13, 0.0, q33]])


class AttitudeFilter(ExtendedKalmanFilter):
    """Extended Kalman filter of one axis.

    It holds no clock: every call says how far to step. Same calls, same numbers.

    The state is filterpy's, ``x`` and ``P``, and after `linearise` filterpy's own ``predict`` and
    ``update`` work on it. `advance`, `correct`, `ahead` and `observe` do the same in closed form
    (`filter_step`), which takes a fiftieth of the time.

    Parameters
    ----------
    settings : FilterSettings
    model : DecayModel or None
        None: constant rate.
    """

    _mean = _upper = _x = _covariance = _foreseen = None

    def __init__(self, settings, model=None):
        super().__init__(dim_x=4, dim_z=2)
        self.settings = s = settings
        self.stamp = math.nan
        self.disturbance_variance = s.disturbance_initial**2
        self.rejections = 0
        self.nis_ratio = 1.0
        self.model = FREE_MOTION
        self._drive = float(s.disturbance_time), float(s.trim_drift)
        self._limits = tuple(map(float, (
            s.trim_time, s.adaptation_time, s.disturbance_least**2, s.disturbance_most**2,
            *(chi2.isf(s.gate_probability, m) for m in (1, 2)),
        )))  # fmt: skip
        self._step = 0.0
        self._elapsed = 0.0
        self.x = np.zeros(4)
        self._use(model)
        self._warm_up()

    def _warm_up(self):
        """One step into the void, so that the first sample finds everything compiled."""
        mean, upper = self._state()
        filter_step.follow(
            mean, upper, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 0.0, self._drive, self._limits, self._hull
        )

    @property
    def x(self):
        """Angle, rate, trim and disturbance, shape (4,)."""
        if self._x is None:
            self._x = np.array(self._mean)
        return self._x

    @x.setter
    def x(self, value):
        self._x = value

    @property
    def P(self):  # noqa: N802 - filterpy's name
        """Covariance of the state, shape (4, 4)."""
        if self._covariance is None:
            self._covariance = np.array(self._upper)[_PLACES]
        return self._covariance

    @P.setter
    def P(self, value):  # noqa: N802
        self._covariance = value

    def _state(self):
        """Mean and upper triangle of the covariance as tuples.

        Arrays that were handed out may have been changed since: what was foreseen is then void.
        """
        if self._x is not None:
            mean = tuple(self._x.tolist())
            if mean != self._mean:
                self._mean, self._foreseen = mean, None
        if self._covariance is not None:
            upper = tuple(self._covariance[_UPPER].tolist())
            if upper != self._upper:
                self._upper, self._foreseen = upper, None
        return self._mean, self._upper

    def _set_state(self, mean, upper):
        self._mean, self._upper = mean, upper
        self._x = self._covariance = None

    @property
    def has_model(self):
        """Whether an identified hull is in use."""
        return self.model is not FREE_MOTION

    @property
    def is_started(self):
        """Whether there is a state."""
        return self.stamp == self.stamp

    def _use(self, model):
        self.model = self._moved_by = FREE_MOTION if model is None else model
        by_angle, by_rate = self.model.jacobian(self.model.trim, 0.0)
        # Runge-Kutta and the third-order transition are both accurate to 1e-4 at a quarter radian of
        # the natural oscillation; the disturbance must not decay much within a step either
        fastest = max(math.sqrt(abs(by_angle)), abs(by_rate), 0.5 / self.settings.disturbance_time)
        terms = _FREE_TERMS if model is None else (
            tuple(model.ratios.tolist()), model.equation.active, float(model.friction_rate)
        )  # fmt: skip
        self._hull = *terms, float(0.25 / fastest)

    def set_model(self, model):
        """Swap the hull under the running filter: angle, rate and total acceleration go on.

        Parameters
        ----------
        model : DecayModel or None
        """
        self._foreseen = None
        was_free = not self.has_model
        if not self.is_started:
            self._use(model)
            self.x[TRIM] = self.model.trim
            return
        angle, rate, trim, disturbance = self.x.tolist()
        total = self._acceleration(angle, rate, trim) + disturbance
        self._use(model)
        if self.has_model and was_free:
            self.x[TRIM] = trim = self.model.trim
            self.P[TRIM] = self.P[:, TRIM] = 0.0
            self.P[TRIM, TRIM] = self.settings.identified_trim_std**2
        self.x[DISTURBANCE] = total - self._acceleration(angle, rate, trim)

    def _acceleration(self, angle, rate, trim):
        return float(self.model.acceleration(angle + (self.model.trim - trim), rate))

    def start(self, stamp, angle, rate, angle_variance, rate_variance):
        """Begin anew from one sample (NaN: not measured). Trim and size of the disturbance are kept."""
        s = self.settings
        self._foreseen = None
        trim = float(self.x[TRIM]) if self.is_started else float(self.model.trim)
        has_angle, has_rate = angle == angle, rate == rate
        self.x = np.array([angle if has_angle else trim, rate if has_rate else 0.0, trim, 0.0])
        self.disturbance_variance = max(self.disturbance_variance, s.disturbance_initial**2)
        self.P = np.diag([
            angle_variance if has_angle else s.initial_angle_std**2,
            rate_variance if has_rate else s.initial_rate_std**2,
            s.trim_std**2,
            self.disturbance_variance,
        ])
        self.stamp = stamp
        self.rejections = 0
        self.nis_ratio = 1.0

    def linearise(self, step):
        """Set F and Q, and the step of the mean, for filterpy's own ``predict``.

        Parameters
        ----------
        step : float
            s, short against the hull's period.
        """
        angle, rate, trim, _ = self.x.tolist()
        half = 0.5 * step
        angle += self.model.trim - trim
        rate_then = rate + half * float(self.model.acceleration(angle, rate))
        by_angle, by_rate = map(float, self.model.jacobian(angle + half * rate, rate_then))
        fast = step * max(abs(by_rate), math.sqrt(abs(by_angle)))
        self._moved_by = self.model
        if not (abs(angle - self.model.trim) < CAPSIZED and fast < 1.0):
            self._moved_by, by_angle, by_rate = FREE_MOTION, 0.0, 0.0
        tau, trim_drift = self._drive
        self._step = step
        self.F = transition(by_angle, by_rate, step, tau)
        self.Q = process_noise(self.disturbance_variance, tau, trim_drift, step)

    def predict_x(self, u=0):
        """filterpy's hook: the mean over the step of the nonlinear model that `linearise` has set."""
        angle, rate, trim, disturbance = self.x.tolist()
        shift = self.model.trim - trim
        angle, rate = runge_kutta_step(self._moved_by.acceleration, angle + shift, rate, disturbance, self._step)
        decay = math.exp(-self._step / self.settings.disturbance_time)
        self.x = np.array([angle - shift, rate, trim, disturbance * decay])

    def advance(self, duration):
        """Predict the state over a duration, s, in sub-steps short against the hull's period."""
        rest, mean, upper = self._from_foreseen(duration)
        if rest > 0.0:
            mean, upper = filter_step.predict(
                mean, upper, self.disturbance_variance, rest, self._drive, self._hull
            )
        self._set_state(mean, upper)
        self._foreseen = None
        self.stamp += duration
        self._elapsed = duration

    def _from_foreseen(self, duration):
        """How far to predict still, and from which state: not at all where just that was foreseen."""
        if self._x is not None or self._covariance is not None:
            self._state()
        foreseen = self._foreseen
        if foreseen is not None and -_SAME_LEAD < duration - foreseen[0] < _SAME_LEAD:
            return 0.0, foreseen[1], foreseen[2]
        return duration, self._mean, self._upper

    def correct(self, angle, rate, angle_variance, rate_variance):
        """Update with what was measured (NaN: not measured).

        Parameters
        ----------
        angle, rate : float
            rad, rad/s.
        angle_variance, rate_variance : float
            rad^2, rad^2/s^2.

        Returns
        -------
        AttitudeEstimate
        """
        self._foreseen = None
        mean, upper, told = filter_step.update(
            *self._state(), angle, rate, angle_variance, rate_variance, self._elapsed, self.disturbance_variance,
            self.nis_ratio, self._limits,
        )  # fmt: skip
        self._set_state(mean, upper)
        return self._conclude(told, angle, rate, angle_variance, rate_variance)

    def observe(self, stamp, angle, rate, angle_variance, rate_variance, lead):
        """`advance` to a stamp, `correct` and `ahead` at once.

        Parameters
        ----------
        stamp : float
            s.
        angle, rate, angle_variance, rate_variance : float
            See `correct`.
        lead : float
            Of the `ahead` that comes next, s.

        Returns
        -------
        AttitudeEstimate
        """
        duration = stamp - self.stamp
        rest, mean, upper = self._from_foreseen(duration)
        mean, upper, told, later, spread = filter_step.follow(
            mean, upper, rest, angle, rate, angle_variance, rate_variance, duration, self.disturbance_variance,
            self.nis_ratio, lead, self._drive, self._limits, self._hull,
        )  # fmt: skip
        self._mean, self._upper, self._x, self._covariance = mean, upper, None, None
        self._foreseen = lead, later, spread
        self.stamp = stamp
        self._elapsed = duration
        return self._conclude(told, angle, rate, angle_variance, rate_variance)

    def _conclude(self, told, angle, rate, angle_variance, rate_variance):
        nis, measured, accepted, self.disturbance_variance, self.nis_ratio = told
        if not accepted:
            return self._refuse(angle, rate, angle_variance, rate_variance, nis, int(measured))
        if measured:
            self.rejections = 0
        upper = self._upper
        return AttitudeEstimate(self.stamp, *self._mean, upper[0], upper[1], upper[4], nis, int(measured))

    def _refuse(self, angle, rate, angle_variance, rate_variance, nis, measured):
        self.rejections += 1
        if self.rejections < self.settings.gate_patience:
            return self.estimate(nis, measured, rejected=True)
        count = self.rejections
        self.start(self.stamp, angle, rate, angle_variance, rate_variance)
        self._hold_still()
        advice = Advice(
            'gate-restarted',
            f'{count} samples in a row disagreed with the forecast, so the filter began anew from the sensor: '
            'check the mounting and the noise settings if this repeats',
        )
        return self.estimate(nis, measured, restarted=True, advice=(advice,))

    def _hold_still(self):
        # a craft that sits where its hull would not rest is held there: without the moment that does so,
        # the next samples would be refused as well
        angle, rate, trim, _ = self.x.tolist()
        moment = -self._acceleration(angle, rate, trim)
        self.disturbance_variance = max(self.disturbance_variance, moment * moment)
        self.x[DISTURBANCE] = moment
        self.P[DISTURBANCE, DISTURBANCE] = self.disturbance_variance

    def estimate(self, nis=math.nan, measured=0, rejected=False, restarted=False, advice=()):
        """The present state as a result."""
        mean, upper = self._state()
        return AttitudeEstimate(
            self.stamp, *mean, upper[0], upper[1], upper[4], nis, measured, rejected, restarted, advice
        )

    def ahead(self, lead):
        """Angle, rate and their covariance one lead after the present state, which stays as it is.

        Returns
        -------
        angle, rate : float
        covariance : ndarray, shape (2, 2)
        """
        angle, rate, angle_variance, both, rate_variance = self.moments_ahead(lead)
        return angle, rate, np.array([[angle_variance, both], [both, rate_variance]])

    def moments_ahead(self, lead):
        """What `ahead` tells, as five floats: angle, rate, angle variance, covariance of both, rate variance."""
        if self._x is not None or self._covariance is not None:
            self._state()
        if self._foreseen is None or self._foreseen[0] != lead:
            # the next sample usually comes just then: its prediction is done
            self._foreseen = lead, *filter_step.predict(
                self._mean, self._upper, self.disturbance_variance, lead, self._drive, self._hull
            )
        _, later, spread = self._foreseen
        return later[0], later[1], spread[0], spread[1], spread[4]

    def export_state(self):
        """Everything remembered, as plain numbers.

        Returns
        -------
        FilterState
        """
        return FilterState(
            self.stamp,
            tuple(self.x.ravel().tolist()),
            tuple(map(tuple, self.P.tolist())),
            self.disturbance_variance,
            self.rejections,
            self.nis_ratio,
        )

    def import_state(self, state):
        """Go on from an exported state.

        Parameters
        ----------
        state : FilterState
        """
        self._foreseen = None
        self.stamp = state.stamp
        self.x = np.array(state.mean)
        self.P = np.array(state.covariance)
        self.disturbance_variance = state.disturbance_variance
        self.rejections = state.rejections
        self.nis_ratio = state.nis_ratio
