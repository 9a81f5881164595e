"""Extended Kalman filter and forecast of a manoeuvring craft.

State: u, v (through the water), r, heading, x, y, current east, current north, and disturbances of the surge
and yaw accelerations (wind, waves, what the model lacks). The mean follows the identified model, the covariance
its linearisation:

    d(current)/dt = slow random walk
    d(disturbance)/dt = -disturbance / tau + white noise      (Singer 1970, first-order Markov)
"""
import math
from collections import deque
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter
from scipy.stats import chi2

from swath_sysid.common.advice import Advice
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.terms import (
    BALANCE,
    DEAD_BAND,
    DELAY,
    EXPONENT,
    GAIN,
    LAG,
    REVERSE_RATIO,
)
from swath_sysid.manoeuvring.hull.thrust import SHORTEST_LAG, thrust_curve

STATES = ('u', 'v', 'r', 'heading', 'x', 'y', 'current_east', 'current_north', 'surge_disturbance', 'yaw_disturbance')
U, V, R, HEADING, X, Y, EAST, NORTH, SURGE_DISTURBANCE, YAW_DISTURBANCE = range(10)
MEASURABLE = ('surge', 'sway', 'yaw_rate', 'heading', 'x', 'y')
LONGEST_STEP = 0.2
"""s of a step of the filter, at most."""

DIFFERENCE = 1e-5


@dataclass(frozen=True)
class ManoeuvreFilterSettings:
    """What the filter believes of sensors and sea.

    Attributes
    ----------
    speed_noise, yaw_rate_noise, heading_noise, position_noise : float
        Standard deviations of the sensors, m/s, rad/s, rad, m, where they do not tell theirs.
    disturbance_time : float
        Correlation time of the disturbances, s.
    gate_probability : float
        A true measurement is taken for an outlier with this probability.
    gate_patience : int
        After so many rejected samples of a kind in a row the sensor is believed.
    """

    speed_noise: float = 0.05
    yaw_rate_noise: float = 0.01
    heading_noise: float = 0.01
    position_noise: float = 0.5
    disturbance_time: float = 5.0
    gate_probability: float = 1e-9
    gate_patience: int = 10

    def __post_init__(self):
        for name, value in vars(self).items():
            if not value > 0:
                raise InputError(f'the filter setting {name} must be positive, not {value}: give a positive number')

    def noise(self, name):
        """Standard deviation of a measurable channel."""
        return {'surge': self.speed_noise, 'sway': self.speed_noise, 'yaw_rate': self.yaw_rate_noise,
                'heading': self.heading_noise, 'x': self.position_noise, 'y': self.position_noise}[name]  # fmt: skip


@dataclass(frozen=True)
class ManoeuvreForecast:
    """Expected motion at some leads.

    Attributes
    ----------
    stamps : ndarray, shape (L,)
        s.
    states : ndarray, shape (L, 10)
        See ``STATES``.
    covariances : ndarray, shape (L, 10, 10)
    """

    stamps: np.ndarray
    states: np.ndarray
    covariances: np.ndarray

    @property
    def over_ground(self):
        """Surge and sway over ground, m/s, shape (L, 2)."""
        s = self.states.T
        cosine, sine = np.cos(s[HEADING]), np.sin(s[HEADING])
        return np.stack([
            s[U] + s[EAST] * cosine + s[NORTH] * sine, s[V] - s[EAST] * sine + s[NORTH] * cosine], axis=1)


class ThrustMemory:
    """Acting thrust of both thrusters from commands at any times: curve, delay, lag.

    Parameters
    ----------
    model : ManoeuvringModel
    """

    def __init__(self, model):
        self._p = model.values
        self._history = deque([(-math.inf, 0.0, 0.0)])
        self._state = None

    def command(self, stamp, port, starboard):
        """Take inputs that hold from a stamp on; NaN and older than the last are refused."""
        if not (math.isfinite(port) and math.isfinite(starboard)) or stamp < self._history[-1][0]:
            return False
        self._history.append((stamp, port, starboard))
        return True

    @property
    def last(self):
        """Stamp and inputs of the last command."""
        return self._history[-1]

    def forget(self):
        """Begin anew (time went backward)."""
        _, port, starboard = self._history[-1]
        self._history = deque([(-math.inf, port, starboard)])
        self._state = None

    def advance(self, start, duration):
        """Mean thrust of port and starboard over a step, N, shape (2,)."""
        begin = start - self._p[DELAY]
        end = begin + duration
        while len(self._history) > 1 and self._history[1][0] <= begin - LONGEST_STEP:
            self._history.popleft()
        target, until = np.zeros(2), end
        for stamp, *inputs in reversed(self._history):
            since = max(stamp, begin)
            if since < until:
                target += (until - since) / duration * self._steady(np.array(inputs))
                until = since
            if until <= begin:
                break
        p = self._p
        if self._state is None or p[LAG] < SHORTEST_LAG:
            self._state = target
            return target
        decay = math.exp(-duration / p[LAG])
        share = p[LAG] / duration * (1.0 - decay)
        mean = target + (self._state - target) * share
        self._state = target + (self._state - target) * decay
        return mean

    def _steady(self, inputs):
        """Thrust that held inputs would settle at, N, shape (2,)."""
        p = self._p
        sides = np.array([1.0 - p[BALANCE], 1.0 + p[BALANCE]])
        return sides * thrust_curve(inputs, p[GAIN], p[REVERSE_RATIO], p[DEAD_BAND], p[EXPONENT])


class ManoeuvreFilter(ExtendedKalmanFilter):
    """Extended Kalman filter of surge, sway and yaw; it holds no clock.

    Parameters
    ----------
    identified : IdentifiedManoeuvringModel
    settings : ManoeuvreFilterSettings, optional
    """

    def __init__(self, identified, settings=None):
        super().__init__(dim_x=10, dim_z=1)
        self.model = identified.model
        self.settings = settings or ManoeuvreFilterSettings()
        self.thrust = ThrustMemory(self.model)
        self.stamp = math.nan
        self._walk = _process_intensity(identified, self.settings)
        self._gate = float(chi2.isf(self.settings.gate_probability, 1))
        self._rejections = dict.fromkeys(MEASURABLE, 0)
        self._mean_after = None

    @property
    def is_started(self):
        """Whether there is a state."""
        return not math.isnan(self.stamp)

    def start(self, stamp, **measured):
        """Begin anew from what is measured (surge, sway, yaw_rate, heading, x, y)."""
        east, north = self.model.current
        noise = self.settings.noise
        heading = measured.get('heading', 0.0)
        surge, sway = measured.get('surge', 0.0), measured.get('sway', 0.0)
        self.x = np.array([
            surge - east * math.cos(heading) - north * math.sin(heading),
            sway + east * math.sin(heading) - north * math.cos(heading),
            measured.get('yaw_rate', 0.0), heading, measured.get('x', 0.0), measured.get('y', 0.0), east, north,
            0.0, 0.0,
        ])  # fmt: skip
        spread = [noise(n) if n in measured else unknown for n, unknown in
                  zip(MEASURABLE, (1.0, 0.3, 0.3, 0.01, 0.01, 0.01), strict=True)]  # fmt: skip
        disturbance = np.sqrt(np.diag(self._walk)[[SURGE_DISTURBANCE, YAW_DISTURBANCE]]
                              * self.settings.disturbance_time / 2.0)  # fmt: skip
        self.P = np.diag(np.square([*spread, 0.1, 0.1, *disturbance]))
        self.stamp = stamp
        self._rejections = dict.fromkeys(MEASURABLE, 0)

    def predict_x(self, u=0):
        """filterpy's hook: the mean was computed together with the transition matrix."""
        self.x = self._mean_after

    def advance(self, stamp):
        """Predict up to a stamp; earlier stamps do nothing."""
        total = stamp - self.stamp
        if total <= 0.0:
            return
        count = max(1, math.ceil(total / LONGEST_STEP - 1e-9))
        for _ in range(count):
            self._step(total / count)
        self.stamp = stamp

    def _step(self, step):
        thrust = self.thrust.advance(self.stamp, step)
        moves = np.concatenate([np.zeros((10, 1)), DIFFERENCE * np.eye(10)], axis=1)
        after = propagate(self.model, self.x[:, None] + moves, thrust, step, self.settings.disturbance_time)
        self._mean_after = after[:, 0]
        self.F = (after[:, 1:] - after[:, :1]) / DIFFERENCE
        self.Q = self._walk * step
        self.predict()
        self.P = 0.5 * (self.P + self.P.T)
        self.stamp += step

    def correct(self, name, value, std=None):
        """Update with one measured channel.

        Parameters
        ----------
        name : str
            One of ``MEASURABLE``.
        value : float
            SI; NaN does nothing.
        std : float, optional
            Of the sensor; by default that of the settings.

        Returns
        -------
        tuple of Advice
            ``outlier`` where the gate refused the value, ``sensor-believed`` where it gave in.
        """
        if not math.isfinite(value):
            return ()
        row, expected = self._observation(name)
        innovation = value - expected
        if name == 'heading':
            innovation = math.remainder(innovation, 2.0 * math.pi)
        variance = (std or self.settings.noise(name)) ** 2
        spread = float(row @ self.P @ row) + variance
        if innovation**2 > self._gate * spread:
            self._rejections[name] += 1
            if self._rejections[name] <= self.settings.gate_patience:
                return (Advice('outlier', f'{name} {value:.3g} was refused: expected {expected:.3g}'),)
            self.P = self.P + np.outer(row, row) * innovation**2
            self._rejections[name] = 0
            advice = (Advice('sensor-believed', f'{name} jumped and stayed: the filter follows it; check the sensor'),)
        else:
            self._rejections[name] = 0
            advice = ()
        self.update(np.array([expected + innovation]), lambda x: row[None, :], lambda x: np.array([expected]),
                    R=np.array([[variance]]))  # fmt: skip
        return advice

    def _observation(self, name):
        """Row of the observation matrix, and the expected value."""
        x, row = self.x, np.zeros(10)
        cosine, sine = math.cos(x[HEADING]), math.sin(x[HEADING])
        if name == 'surge':
            row[[U, EAST, NORTH, HEADING]] = 1.0, cosine, sine, -x[EAST] * sine + x[NORTH] * cosine
            return row, float(x[U] + x[EAST] * cosine + x[NORTH] * sine)
        if name == 'sway':
            row[[V, EAST, NORTH, HEADING]] = 1.0, -sine, cosine, -x[EAST] * cosine - x[NORTH] * sine
            return row, float(x[V] - x[EAST] * sine + x[NORTH] * cosine)
        place = {'yaw_rate': R, 'heading': HEADING, 'x': X, 'y': Y}[name]
        row[place] = 1.0
        return row, float(x[place])

    def forecast(self, leads, future=None):
        """Expected motion under held or supplied inputs; the filter itself stays where it is.

        Parameters
        ----------
        leads : sequence of float
            s, increasing, positive.
        future : sequence of (lead, port, starboard), optional
            Inputs that hold from each lead on; without, the last ones hold.

        Returns
        -------
        ManoeuvreForecast
        """
        ahead = deepcopy(self)
        begin = self.stamp
        for lead, port, starboard in future or ():
            ahead.thrust.command(begin + lead, port, starboard)
        states, covariances = [], []
        for lead in leads:
            ahead.advance(begin + lead)
            states.append(ahead.x.copy())
            covariances.append(ahead.P.copy())
        return ManoeuvreForecast(begin + np.asarray(leads, dtype=float), np.array(states), np.array(covariances))


def propagate(model, states, thrust, step, disturbance_time):
    """States (10, C) after a step under acting thrusts (2,), by the classical Runge-Kutta scheme."""
    port, starboard = thrust

    def slope(s):
        du, dv, dr = model.accelerations(s[U], s[V], s[R], port, starboard)
        cosine, sine = np.cos(s[HEADING]), np.sin(s[HEADING])
        return np.stack([
            du + s[SURGE_DISTURBANCE], dv, dr + s[YAW_DISTURBANCE], s[R],
            s[U] * cosine - s[V] * sine + s[EAST], s[U] * sine + s[V] * cosine + s[NORTH],
            0.0 * s[U], 0.0 * s[U], -s[SURGE_DISTURBANCE] / disturbance_time, -s[YAW_DISTURBANCE] / disturbance_time,
        ])  # fmt: skip

    k1 = slope(states)
    k2 = slope(states + 0.5 * step * k1)
    k3 = slope(states + 0.5 * step * k2)
    k4 = slope(states + step * k3)
    return states + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)


def _process_intensity(identified, settings):
    """White noise that drives the state, a second, shape (10, 10).

    Disturbances are as large as it takes to leave, behind the hull's damping, the residuals of the
    identification; current and what the model lacks in sway walk slowly.
    """
    model, noise = identified.model, identified.noise
    jacobian = model.jacobian(max(identified.region.fastest * 0.6, 0.1), 0.0, 0.0)
    rate = np.maximum(-np.diag(jacobian), 0.05)
    own = np.array([settings.speed_noise, settings.speed_noise, settings.yaw_rate_noise])
    # what the sensors' own noise explains of the residuals needs no disturbance
    left = np.sqrt(np.maximum(noise**2 - own**2, (0.2 * noise) ** 2))
    disturbance = left * rate
    matrix = np.zeros((10, 10))
    matrix[SURGE_DISTURBANCE, SURGE_DISTURBANCE] = 2.0 * disturbance[0] ** 2 / settings.disturbance_time
    matrix[YAW_DISTURBANCE, YAW_DISTURBANCE] = 2.0 * disturbance[2] ** 2 / settings.disturbance_time
    matrix[V, V] = 2.0 * left[1] ** 2 * rate[1]
    matrix[U, U], matrix[R, R] = (0.1 * left[0]) ** 2 * rate[0], (0.1 * left[2]) ** 2 * rate[2]
    matrix[EAST, EAST] = matrix[NORTH, NORTH] = 1e-5
    matrix[X, X] = matrix[Y, Y] = 1e-6
    matrix[HEADING, HEADING] = 1e-8
    return matrix
