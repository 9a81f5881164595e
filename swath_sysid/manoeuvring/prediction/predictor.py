"""Extended Kalman filter and forecast of a manoeuvring craft.

State: u, v (through the water), r, heading, x, y, current east, current north, disturbances of the surge, sway and
yaw accelerations (wind, waves, what the model lacks), and by how much thrust to come will differ from held thrust, N.
The mean follows the identified model, the covariance its linearisation:

    d(current)/dt = slow random walk
    d(disturbance)/dt = -disturbance / tau + white noise      (Singer 1970, first-order Markov)

Thrust to come is zero but in a forecast under held thrust. Where thrusts are held for a time T on average, and then
others are chosen, independently, with mean m and covariance S, what differs from a held thrust h has the second moment
(1 - exp(-t / T)) (S + (h - m)(h - m)^T) after a time t: that of a first-order Markov process of time constant 2 T.

What is measured is what the sensors record: see `hull.measurement`.
"""

import math
from collections.abc import Sequence
from copy import copy, deepcopy
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.special import chdtri

from swath_sysid.common.advice import Advice
from swath_sysid.common.filterpy_filter import ExtendedKalmanFilter
from swath_sysid.manoeuvring.hull import measurement
from swath_sysid.manoeuvring.hull.identified_model import ForecastNoise, IdentifiedManoeuvringModel
from swath_sysid.manoeuvring.hull.model import DIFFERENCE
from swath_sysid.manoeuvring.hull.simulation import moved, runge_kutta_columns, substeps_for
from swath_sysid.manoeuvring.hull.thrust import ThrustMemory, thrust_curve
from swath_sysid.manoeuvring.identification.disturbances import LAGS
from swath_sysid.manoeuvring.motion.trial import STEP
from swath_sysid.manoeuvring.prediction.filter_settings import MEASURABLE, ManoeuvreFilterSettings

HEADING, X, Y, EAST, NORTH = range(3, 8)
DISTURBANCES, THRUST_TO_COME = slice(8, 11), slice(11, 13)
STATES = THRUST_TO_COME.stop
MOVES = np.concatenate([np.zeros((STATES, 1)), DIFFERENCE * np.eye(STATES)], axis=1)


@dataclass(frozen=True)
class ManoeuvreForecast:
    """Expected motion at some leads."""

    stamps: np.ndarray  #: (L,); s.
    states: np.ndarray  #: (L, 13)
    covariances: np.ndarray  #: (L, 13, 13)
    recorded: np.ndarray  #: (L, 6); Expected sensor readings: see ``MEASURABLE``.
    recorded_covariances: np.ndarray  #: (L, 6, 6); Calibrated; without sensor noise.


class ManoeuvreFilter(ExtendedKalmanFilter):
    """filterpy's filter without a clock: state ``x`` (13,), covariance ``P``, stamp (NaN before the start)."""

    def __init__(self, identified: IdentifiedManoeuvringModel, settings: ManoeuvreFilterSettings | None = None):
        super().__init__(dim_x=STATES, dim_z=1)
        self.model = identified.model
        self.settings = settings or ManoeuvreFilterSettings.of(identified)
        self.thrust = ThrustMemory(self.model.values)
        self.x = np.zeros(STATES)
        self.stamp = math.nan
        self._noise = identified.forecast or _usual_noise(identified, self.settings)
        self._walk = _process_intensity(identified, self._noise)
        self._columns = np.repeat(self.model.values[:, None], MOVES.shape[1], axis=1)
        most = abs(float(thrust_curve(self.model.largest_input, self.model.values)))
        self._substeps = substeps_for(self.model, STEP, np.zeros(3), most)
        self._gate = float(chdtri(1, self.settings.gate_probability))
        self._rejections = dict.fromkeys(MEASURABLE, 0)

    @property
    def is_started(self) -> bool:
        """Whether there is a state."""
        return not math.isnan(self.stamp)

    def start(self, stamp: float, **measured: float) -> None:
        """Restart from measured surge, sway, yaw_rate, heading, x, y."""
        p, current = self.model.values, self.model.current
        compass = measured.get('heading', 0.0)
        heading = compass - float(measurement.deviation(compass, p))
        r = measured.get('yaw_rate', 0.0)
        u, v = measurement.through_water(measured.get('surge', 0.0), measured.get('sway', 0.0), r, compass, current, p)
        ahead, aside = measurement.recorded_position(0.0, 0.0, heading, p)
        place = measured.get('x', ahead) - ahead, measured.get('y', aside) - aside
        self.x = np.array([u, v, r, heading, *place, *current, *np.zeros(5)])
        unknown = dict(zip(MEASURABLE, (1.0, 0.3, 0.3, 0.01, 0.01, 0.01), strict=True))
        spread = [self.settings.noise(name) if name in measured else unknown[name] for name in MEASURABLE]
        self.P = np.diag(np.square([*spread, 0.1, 0.1, *self._noise.disturbance, 0.0, 0.0]))
        self.stamp = stamp
        self._rejections = dict.fromkeys(MEASURABLE, 0)

    def resume(self, before: Self) -> None:
        """Go on with the motion and the thrust of a filter of another model."""
        if before.is_started:
            self.x, self.P, self.stamp = before.x.copy(), before.P.copy(), before.stamp
            self.x[DISTURBANCES] = 0.0
        if before.thrust.last[0] > -math.inf:
            self.thrust.command(*before.thrust.last)

    def advance(self, stamp: float) -> None:
        """Predict up to a stamp; earlier stamps do nothing."""
        self._advance(stamp, self._walk)

    def _advance(self, stamp: float, walk: np.ndarray):
        total = stamp - self.stamp
        if total <= 0.0:
            return
        count = max(1, math.ceil(total / STEP - 1e-9))
        for _ in range(count):
            self.predict(total / count, walk)
        self.stamp = stamp

    def predict(self, step: float, walk: np.ndarray) -> None:
        """Predict over a step, s, of `STEP` at most, driven by white noise of intensity ``walk``."""
        thrust = self.thrust.advance(self.stamp, step)
        after = self._propagated(self.x[:, None] + MOVES, thrust, step)
        transition = (after[:, 1:] - after[:, :1]) / DIFFERENCE
        self.x = after[:, 0]
        covariance = transition @ self.P @ transition.T + walk * step
        self.P = 0.5 * (covariance + covariance.T)
        self.stamp += step

    def _propagated(self, states: np.ndarray, thrust: np.ndarray, step: float):
        """States (13, C) after a step under acting thrusts (2,)."""
        time = self._noise.disturbance_time[:, None]
        decay = np.exp(-step / time)
        push = states[DISTURBANCES] * (time / step * (1.0 - decay))
        acting = (thrust[:, None] + states[THRUST_TO_COME])[:, None]
        before, current = np.ascontiguousarray(states[:3]), states[EAST : NORTH + 1]
        motion = runge_kutta_columns(before, acting, push, self._columns, step, self._substeps)
        pose = states[HEADING : Y + 1] + moved(motion[0], motion[1], states[HEADING], step, current)
        to_come = states[THRUST_TO_COME] * math.exp(-0.5 * step / self._noise.thrust_time)
        return np.concatenate([motion[-1], pose, current, states[DISTURBANCES] * decay, to_come])

    def correct(self, name: str, value: float, std: float | None = None) -> tuple[Advice, ...]:
        """Update with a channel of ``MEASURABLE`` (not with NaN); advice on what the gate rejected or gave in to."""
        if not math.isfinite(value):
            return ()
        variance = (std or self.settings.noise(name)) ** 2
        advice: tuple[Advice, ...] = ()
        expected = self._update(name, value, variance)
        innovation = float(self.y[0])
        if innovation**2 > self._gate * float(self.S[0, 0]):
            self.x, self.P = self.x_prior, self.P_prior
            self._rejections[name] += 1
            if self._rejections[name] <= self.settings.gate_patience:
                return (Advice.of('outlier', name=name, value=value, expected=expected),)
            self.P = self.P + self.H.T @ self.H * innovation**2
            self._update(name, value, variance)
            advice = (Advice.of('sensor-followed', name=name),)
        self._rejections[name] = 0
        return advice

    def _update(self, name: str, value: float, variance: float):
        """filterpy's update with a channel; what it was expected to be."""
        recorded = self._recorded(self.x[:, None] + MOVES)[MEASURABLE.index(name)]
        expected, self.H = recorded[:1], (recorded[None, 1:] - recorded[0]) / DIFFERENCE
        self.x_prior, self.P_prior = self.x, self.P
        residual = _turned if name == 'heading' else np.subtract
        self.update(value, lambda _: self.H, lambda _: expected, variance, residual=residual)
        return float(expected[0])

    def _recorded(self, states: np.ndarray):
        """Sensor readings (6, C) of states (13, C)."""
        u, v, r, heading, x, y, east, north = states[:8]
        p = self.model.values
        compass = measurement.recorded_heading(heading, p)
        speeds = measurement.recorded_speeds(u, v, r, compass, (east, north), p)
        return np.stack([*speeds, r, compass, *measurement.recorded_position(x, y, heading, p)])

    def forecast(
        self, leads: Sequence[float] | np.ndarray, future: Sequence[tuple[float, float, float]] | None = None
    ) -> ManoeuvreForecast:
        """Expected motion at increasing leads, s, under inputs from each lead of ``future`` on, or the last ones."""
        ahead = copy(self)
        ahead.thrust = deepcopy(self.thrust)
        begin = self.stamp
        for lead, port, starboard in future or ():
            ahead.thrust.command(begin + lead, port, starboard)
        walk = self._walk
        if not future:
            walk = walk.copy()
            walk[THRUST_TO_COME, THRUST_TO_COME] = self._thrust_to_come()
        rows = []
        for lead in leads:
            ahead._advance(begin + lead, walk)
            recorded = ahead._recorded(ahead.x[:, None] + MOVES)
            scale = np.array([[np.interp(lead, self._noise.leads, row)] for row in self._noise.scale])
            slopes = (recorded[:, 1:] - recorded[:, :1]) / DIFFERENCE * scale
            rows.append((ahead.x, ahead.P, recorded[:, 0], slopes @ ahead.P @ slopes.T))
        return ManoeuvreForecast(begin + np.asarray(leads, dtype=float), *map(np.array, zip(*rows, strict=True)))

    def _thrust_to_come(self):
        """Intensity of the white noise that drives the change of thrust, N^2/s, shape (2, 2)."""
        noise = self._noise
        away = self.thrust.held - noise.thrust_mean
        return (noise.thrust_covariance + np.outer(away, away)) / noise.thrust_time


def _turned(heading: np.ndarray, expected: np.ndarray):
    """The turn between two headings, rad, the shorter way round."""
    return np.remainder(heading - expected + math.pi, 2.0 * math.pi) - math.pi


def _usual_noise(identified: IdentifiedManoeuvringModel, settings: ManoeuvreFilterSettings):
    """Disturbances that leave, after the damping of the hull, the residuals of the identification."""
    jacobian = identified.model.jacobian(max(identified.region.fastest * 0.6, 0.1), 0.0, 0.0)
    own = np.array([settings.speed_noise, settings.speed_noise, settings.yaw_rate_noise])
    # what the sensors' own noise explains of the residuals needs no disturbance
    left = np.sqrt(np.maximum(identified.noise**2 - own**2, (0.2 * identified.noise) ** 2))
    disturbance = left * np.maximum(-np.diag(jacobian), 0.05)
    return ForecastNoise(disturbance, np.full(3, LAGS[1]), np.zeros(2), np.zeros((2, 2)), math.inf, np.zeros(4))


def _process_intensity(identified: IdentifiedManoeuvringModel, noise: ForecastNoise):
    """Intensity of the white noise that drives the state, shape (13, 13), without the change of thrust."""
    steady = np.square(np.maximum(0.02 * identified.noise, 1e-4))
    driving = 2.0 * noise.disturbance**2 / noise.disturbance_time
    return np.diag([*steady, 1e-8, 1e-6, 1e-6, 1e-5, 1e-5, *driving, 0.0, 0.0])
