"""Step-by-step simulation of a craft whose inputs depend on its motion."""

import numpy as np

from swath_sysid.manoeuvring.hull.simulation import Manoeuvre, manoeuvre_of, moved, states_under, steady_speed, substeps_for
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.thrust import ThrustMemory, thrust_curve
from swath_sysid.manoeuvring.motion.trial import STEP


class SteeredCraft:
    """A craft heading east, steered in steps of `STEP`, from the steady speed of ``first_input``."""

    def __init__(self, model: ManoeuvringModel, first_input: float = 0.0):
        self.model = model
        self._thrust = ThrustMemory(model.values, first_input)
        push = float(np.sum(self._thrust.advance(-STEP, STEP)))
        speed = steady_speed(model, push) if push > 0.0 else 0.0
        self._state = np.array([speed, 0.0, 0.0])
        self._pose = np.zeros(3)
        most = max(abs(push), 2.0 * abs(float(thrust_curve(model.largest_input, model.values))))
        self._substeps = substeps_for(model, STEP, self._state, most)
        self._rows = [(*self._state, *self._pose)]
        self._inputs: list[tuple[float, float]] = []

    @property
    def time(self) -> float:
        """s."""
        return STEP * len(self._inputs)

    @property
    def u(self) -> float:
        """Speed ahead through the water, m/s."""
        return float(self._state[0])

    @property
    def yaw_rate(self) -> float:
        """rad/s."""
        return float(self._state[2])

    @property
    def heading(self) -> float:
        """rad, not wrapped."""
        return float(self._pose[0])

    def advance(self, port: float, starboard: float) -> None:
        """Hold both inputs over one step."""
        self._thrust.command(self.time, port, starboard)
        thrust, before = self._thrust.advance(self.time, STEP)[:, None, None], self._state
        states = states_under(self.model.values, before[:, None], thrust, STEP, self._substeps)
        self._state = states[-1, :, 0]
        self._pose = self._pose + moved(before, self._state, self._pose[0], STEP, self.model.current)
        self._rows.append((*self._state, *self._pose))
        self._inputs.append((port, starboard))

    def hold(self, port: float, starboard: float, duration: float) -> None:
        """Hold both inputs for a duration, s."""
        for _ in range(round(duration / STEP)):
            self.advance(port, starboard)

    def manoeuvre(self) -> Manoeuvre:
        """All motion since the start."""
        rows = np.array(self._rows).T
        return manoeuvre_of(STEP, rows[:3], rows[3:], np.array(self._inputs).T, self.model.current)
