"""A craft that is steered while it moves: the simulation, one step at a time."""
import math
from collections import deque

import numpy as np

from swath_sysid.manoeuvring.hull.simulation import Manoeuvre, runge_kutta_columns, steady_speed, substeps_for
from swath_sysid.manoeuvring.hull.terms import BALANCE, DEAD_BAND, DELAY, EXPONENT, GAIN, LAG, REVERSE_RATIO
from swath_sysid.manoeuvring.hull.thrust import SHORTEST_LAG, thrust_curve


class Thruster:
    """One thruster with its memory: the same numbers as `thrust.acting_thrust`, step by step.

    Parameters
    ----------
    p : ndarray, shape (39,)
    side : int
        -1 port, 1 starboard.
    step : float
        s.
    first : float
        Input that has acted so far.
    """

    def __init__(self, p, side, step, first=0.0):
        self._p, self._side = p, side
        whole = int(p[DELAY] / step)
        self._fraction = p[DELAY] / step - whole
        self._decay = math.exp(-step / p[LAG]) if p[LAG] >= SHORTEST_LAG else 0.0
        self._share = p[LAG] / step * (1.0 - self._decay) if self._decay else 0.0
        self._line = deque([self._curve(first)] * (whole + 2), maxlen=whole + 2)
        self._state = self._line[0]

    def advance(self, value):
        """Mean thrust over the next step under an input held over it, N."""
        self._line.append(self._curve(value))
        arriving = (1.0 - self._fraction) * self._line[1] + self._fraction * self._line[0]
        before, self._state = self._state, arriving + (self._state - arriving) * self._decay
        return arriving + (before - arriving) * self._share

    def _curve(self, value):
        p = self._p
        thrust = thrust_curve(np.float64(value), p[GAIN], p[REVERSE_RATIO], p[DEAD_BAND], p[EXPONENT])
        return float((1.0 + self._side * p[BALANCE]) * thrust)


class SteeredCraft:
    """A craft under inputs that may depend on what it does.

    Parameters
    ----------
    model : ManoeuvringModel
    step : float
        s.
    first_input : float
        Both inputs before the start; the craft starts at the speed they drive, heading east.
    at_rest : bool
        Start at rest instead.
    """

    def __init__(self, model, step, first_input=0.0, at_rest=False):
        self.model, self.step = model, step
        self._thrusters = [Thruster(model.values, side, step, first_input) for side in (-1, 1)]
        push = sum(t.advance(first_input) for t in self._thrusters)
        speed = 0.0 if at_rest or push <= 0 else steady_speed(model, push)
        self._state = np.array([speed, 0.0, 0.0])
        self._pose = np.zeros(3)
        most = max(abs(push), 2.0 * abs(thrust_curve(
            np.float64(model.largest_input), *model.values[[GAIN, REVERSE_RATIO, DEAD_BAND, EXPONENT]])))  # fmt: skip
        self._substeps = substeps_for(model, step, self._state, (np.array([most]), np.array([most])))
        self._p = model.values[:, None]
        self._rows = [(*self._state, *self._pose)]
        self._inputs = []

    @property
    def time(self):
        """s."""
        return self.step * len(self._inputs)

    @property
    def u(self):
        """Speed ahead through the water, m/s."""
        return float(self._state[0])

    @property
    def yaw_rate(self):
        """rad/s."""
        return float(self._state[2])

    @property
    def heading(self):
        """rad, not wrapped."""
        return float(self._pose[0])

    def advance(self, port, starboard):
        """Hold both inputs over one step."""
        left, right = (np.array([[t.advance(value)]]) for t, value in
                       zip(self._thrusters, (port, starboard), strict=True))  # fmt: skip
        before = self._state
        self._state = runge_kutta_columns(
            before[:, None], left, right, self._p, self.model.active, self.step, self._substeps
        )[-1, :, 0]
        half = 0.5 * self.step
        psi = self._pose[0] + half * (before[2] + self._state[2])
        east, north = self.model.current
        moved = np.array([[u * math.cos(h) - v * math.sin(h) + east, u * math.sin(h) + v * math.cos(h) + north]
                          for (u, v, _), h in ((before, self._pose[0]), (self._state, psi))])  # fmt: skip
        self._pose = np.array([psi, *(self._pose[1:] + half * moved.sum(axis=0))])
        self._rows.append((*self._state, *self._pose))
        self._inputs.append((port, starboard))

    def hold(self, port, starboard, duration):
        """Hold both inputs for a while, s."""
        for _ in range(round(duration / self.step)):
            self.advance(port, starboard)

    def manoeuvre(self):
        """Everything since the start."""
        u, v, r, psi, x, y = np.array(self._rows).T
        inputs = np.array([*self._inputs, self._inputs[-1]])
        east, north = self.model.current
        return Manoeuvre(
            time=self.step * np.arange(u.size), u=u, v=v, yaw_rate=r, heading=psi, x=x, y=y,
            surge=u + east * np.cos(psi) + north * np.sin(psi), sway=v - east * np.sin(psi) + north * np.cos(psi),
            port=inputs[:, 0], starboard=inputs[:, 1],
        )  # fmt: skip
