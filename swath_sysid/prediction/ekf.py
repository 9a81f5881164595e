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

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from scipy.stats import chi2

from swath_sysid.advice import Advice
from swath_sysid.errors import InputError
from swath_sysid.prediction.sensor_noise import NoiseSettings

ANGLE, RATE, TRIM, DISTURBANCE = range(4)
STATE_NAMES = ('angle', 'rate', 'trim', 'disturbance')

_MEASURED = {
    (True, True): np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]),
    (True, False): np.array([[1.0, 0.0, 0.0, 0.0]]),
    (False, True): np.array([[0.0, 1.0, 0.0, 0.0]]),
}
_LARGEST_ANGLE_VARIANCE = math.pi**2
_LARGEST_RATE_VARIANCE = 100.0
_LARGEST_RATIO = 6.0
_USUAL_RATIO = 1.2
_SAME_LEAD = 1e-6


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


@dataclass(frozen=True)
class AttitudeEstimate:
    """What the filter knows of one axis after a sample.

    Attributes
    ----------
    stamp : float
        s.
    angle, rate, trim, disturbance : float
        rad, rad/s, rad, rad/s^2.
    covariance : ndarray, shape (2, 2)
        Of angle and rate.
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
    covariance: np.ndarray
    nis: float = math.nan
    measured: int = 0
    rejected: bool = False
    restarted: bool = False
    advice: tuple[Advice, ...] = ()


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

CAPSIZED = 1.5
"""rad from trim; no decay model is believed beyond."""


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
    """Transition matrix of the linearised state over one step, shape (4, 4).

    The exponential of A = [[0, 1], [a, c]] and its integral, to third order in the step;
    the disturbance is held over the step and decays at its end.
    """
    a, c = by_angle, by_rate
    h1, h2, h3 = step, step * step / 2.0, step**3 / 6.0
    square = a + c * c
    gain_angle = h2 + c * h3
    gain_rate = h1 + c * h2 + square * h3
    matrix = np.zeros((4, 4))
    matrix[0] = 1.0 + a * h2 + a * c * h3, h1 + c * h2 + square * h3, -a * gain_angle, gain_angle
    matrix[1] = (
        a * h1 + a * c * h2 + a * square * h3,
        1.0 + c * h1 + square * h2 + c * (a + square) * h3,
        -a * gain_rate,
        gain_rate,
    )
    matrix[2, 2] = 1.0
    matrix[3, 3] = math.exp(-step / tau)
    return matrix


def process_noise(disturbance_variance, tau, trim_drift, step):
    """Process noise over one step, shape (4, 4): the Singer model's leading terms.

    Singer, IEEE Trans. AES-6 (1970), for a step short against tau: white noise of intensity
    2 variance / tau on the disturbance, integrated into rate and angle.
    """
    intensity = 2.0 * disturbance_variance / tau
    h = step
    matrix = np.zeros((4, 4))
    matrix[0, 0] = intensity * h**5 / 20.0
    matrix[0, 1] = matrix[1, 0] = intensity * h**4 / 8.0
    matrix[0, 3] = matrix[3, 0] = intensity * h**3 / 6.0
    matrix[1, 1] = intensity * h**3 / 3.0
    matrix[1, 3] = matrix[3, 1] = intensity * h * h / 2.0
    matrix[2, 2] = trim_drift * trim_drift * h
    matrix[3, 3] = intensity * h
    return matrix


class AttitudeFilter(ExtendedKalmanFilter):
    """Extended Kalman filter of one axis.

    It holds no clock: every call says how far to step. Same calls, same numbers.

    Parameters
    ----------
    settings : FilterSettings
    model : DecayModel or None
        None: constant rate.
    """

    def __init__(self, settings, model=None):
        super().__init__(dim_x=4, dim_z=2)
        self.settings = settings
        self.stamp = math.nan
        self.disturbance_variance = settings.disturbance_initial**2
        self.rejections = 0
        self.nis_ratio = 1.0
        self.model = FREE_MOTION
        self._gates = {m: float(chi2.isf(settings.gate_probability, m)) for m in (1, 2)}
        self._step = 0.0
        self._elapsed = 0.0
        self._foreseen = None
        self._use(model)

    @property
    def has_model(self):
        """Whether an identified hull is in use."""
        return self.model is not FREE_MOTION

    @property
    def is_started(self):
        """Whether there is a state."""
        return not math.isnan(self.stamp)

    def _use(self, model):
        self.model = self._moved_by = FREE_MOTION if model is None else model
        by_angle, by_rate = self.model.jacobian(self.model.trim, 0.0)
        # Runge-Kutta and the third-order transition are both accurate to 1e-4 at a quarter radian of
        # the natural oscillation; the disturbance must not decay much within a step either
        fastest = max(math.sqrt(abs(by_angle)), abs(by_rate), 0.5 / self.settings.disturbance_time)
        self._longest_step = 0.25 / fastest

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
        trim = float(self.x[TRIM]) if self.is_started else self.model.trim
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

    def predict_x(self, u=0):
        """filterpy's hook: the mean over one sub-step of the nonlinear model."""
        angle, rate, trim, disturbance = self.x.tolist()
        shift = self.model.trim - trim
        angle, rate = runge_kutta_step(self._moved_by.acceleration, angle + shift, rate, disturbance, self._step)
        decay = math.exp(-self._step / self.settings.disturbance_time)
        self.x = np.array([angle - shift, rate, trim, disturbance * decay])

    def advance(self, duration):
        """Predict the state over a duration, s, in sub-steps short against the hull's period."""
        if self._foreseen is not None and abs(duration - self._foreseen[0]) < _SAME_LEAD:
            _, self.x, self.P = self._foreseen
            self._foreseen = None
            self.stamp += duration
            self._elapsed = duration
            return
        tau = self.settings.disturbance_time
        count = max(1, math.ceil(duration / self._longest_step))
        self._step = step = duration / count
        self.Q = process_noise(self.disturbance_variance, tau, self.settings.trim_drift, step)
        for _ in range(count):
            by_angle, by_rate = self._linearise(step)
            self.F = transition(by_angle, by_rate, step, tau)
            self.predict()
        if self.P[0, 0] > _LARGEST_ANGLE_VARIANCE or self.P[1, 1] > _LARGEST_RATE_VARIANCE:
            self._bound_covariance()
        self.stamp += duration
        self._elapsed = duration

    def _linearise(self, step):
        """Derivatives of the acceleration in the middle of a step; chooses the hull or free motion."""
        angle, rate, trim, _ = self.x.tolist()
        half = 0.5 * step
        angle += self.model.trim - trim
        self._moved_by = self.model
        rate_then = rate + half * float(self.model.acceleration(angle, rate))
        by_angle, by_rate = map(float, self.model.jacobian(angle + half * rate, rate_then))
        fast = step * max(abs(by_rate), math.sqrt(abs(by_angle)))
        if abs(angle - self.model.trim) < CAPSIZED and fast < 1.0:
            return by_angle, by_rate
        # far outside what the hull was identified on, the equation is no longer believed (nor stable)
        self._moved_by = FREE_MOTION
        return 0.0, 0.0

    def _bound_covariance(self):
        # an angle that nothing observes (rates alone, no hull) would grow without end
        scale = np.ones(4)
        scale[ANGLE] = min(1.0, math.sqrt(_LARGEST_ANGLE_VARIANCE / self.P[0, 0]))
        scale[RATE] = min(1.0, math.sqrt(_LARGEST_RATE_VARIANCE / self.P[1, 1]))
        self.P = self.P * scale * scale[:, None]

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
        has_angle, has_rate = angle == angle, rate == rate
        if not (has_angle or has_rate):
            return self.estimate()
        self._foreseen = None
        e_angle, e_rate = angle - float(self.x[0]), rate - float(self.x[1])
        nis = self._normalised(e_angle, e_rate, has_angle, has_rate, angle_variance, rate_variance)
        measured = int(has_angle) + int(has_rate)
        # a sensor noisier than it says must not be locked out: the gate is as wide as its innovations are
        if nis > self._gates[measured] * max(1.0, self.nis_ratio):
            return self._refuse(angle, rate, angle_variance, rate_variance, nis, measured)
        self.rejections = 0
        matrix = _MEASURED[has_angle, has_rate]
        if measured == 2:
            z, noise = np.array([angle, rate]), np.array([[angle_variance, 0.0], [0.0, rate_variance]])
        else:
            z = np.array([angle if has_angle else rate])
            noise = np.array([[angle_variance if has_angle else rate_variance]])
        trim = float(self.x[TRIM])
        slowest = math.sqrt(float(self.P[TRIM, TRIM])) * self._elapsed / self.settings.trim_time
        self.update(z, lambda x: matrix, matrix.dot, R=noise)
        # ballast moves slowly: a hand on the craft, or a gust, must not be taken for it
        self.x[TRIM] = min(max(float(self.x[TRIM]), trim - slowest), trim + slowest)
        self._adapt(nis / measured)
        return self.estimate(nis, measured)

    def _normalised(self, e_angle, e_rate, has_angle, has_rate, angle_variance, rate_variance):
        p = self.P
        if not has_rate:
            return e_angle * e_angle / (float(p[0, 0]) + angle_variance)
        if not has_angle:
            return e_rate * e_rate / (float(p[1, 1]) + rate_variance)
        s00, s11, s01 = float(p[0, 0]) + angle_variance, float(p[1, 1]) + rate_variance, float(p[0, 1])
        determinant = s00 * s11 - s01 * s01
        return (s11 * e_angle * e_angle - 2.0 * s01 * e_angle * e_rate + s00 * e_rate * e_rate) / determinant

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

    def _adapt(self, ratio):
        """Let the disturbance's size follow the innovations and its own estimate.

        Where the size is right, the NIS is its expectation and E[d^2 | data] is the variance
        (the fixed point of expectation-maximisation): both ratios then average one. The first
        answers fast when a sea gets up; the second lets the excitation fade out in still water,
        where the innovations hardly depend on it.
        """
        s = self.settings
        gain = min(0.2, self._elapsed / s.adaptation_time)
        ratio = min(ratio, _LARGEST_RATIO * max(1.0, self.nis_ratio))
        self.nis_ratio += gain * (ratio - self.nis_ratio)
        change = min(ratio, _LARGEST_RATIO) - 1.0
        if self.nis_ratio < _USUAL_RATIO:
            disturbance = float(self.x[DISTURBANCE])
            share = (disturbance * disturbance + float(self.P[DISTURBANCE, DISTURBANCE])) / self.disturbance_variance
            change += min(share, _LARGEST_RATIO) - 1.0
        variance = self.disturbance_variance * math.exp(gain * change)
        self.disturbance_variance = min(max(variance, s.disturbance_least**2), s.disturbance_most**2)

    def estimate(self, nis=math.nan, measured=0, rejected=False, restarted=False, advice=()):
        """The present state as a result."""
        angle, rate, trim, disturbance = self.x.tolist()
        return AttitudeEstimate(
            self.stamp, angle, rate, trim, disturbance, self.P[:2, :2].copy(), nis, measured, rejected, restarted,
            advice,
        )

    def ahead(self, lead):
        """Angle, rate and their covariance one lead after the present state, which stays as it is.

        Returns
        -------
        angle, rate : float
        covariance : ndarray, shape (2, 2)
        """
        self._foreseen = None
        mean, covariance, stamp, elapsed = self.x, self.P, self.stamp, self._elapsed
        self.advance(lead)
        result = float(self.x[0]), float(self.x[1]), self.P[:2, :2].copy()
        # the next sample usually comes just then: its prediction is done
        self._foreseen = lead, self.x, self.P
        self.x, self.P, self.stamp, self._elapsed = mean, covariance, stamp, elapsed
        return result

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
