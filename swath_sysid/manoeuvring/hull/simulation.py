"""Simulation of manoeuvres: one craft, many windows of many candidates at once, or step by step with feedback."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.common.accelerator import accelerated
from swath_sysid.manoeuvring.hull import terms
from swath_sysid.manoeuvring.hull.model import ManoeuvringModel
from swath_sysid.manoeuvring.hull.terms import Numbers
from swath_sysid.manoeuvring.hull.thrust import ThrustMemory, acting_thrust, thrust_curve
from swath_sysid.manoeuvring.motion.trial import STEP, turned

STABLE_STEP = 2.0  #: Largest product of step and fastest damping rate; the scheme is stable up to 2.78.

_accelerations = terms.accelerations
UNDISTURBED = np.zeros((3, 1))


@accelerated
def _slopes(u: Numbers, v: Numbers, r: Numbers, left: Numbers, right: Numbers, push: np.ndarray, p: np.ndarray):
    du, dv, dr = _accelerations(u, v, r, left, right, p)
    return du + push[0], dv + push[1], dr + push[2]


@accelerated
def runge_kutta_columns(
    state: np.ndarray, thrust: np.ndarray, push: np.ndarray, p: np.ndarray, step: float, substeps: int
) -> np.ndarray:
    """States (S + 1, 3, C) of C craft with parameters (n, C), by the classical Runge-Kutta scheme from (3, C); not
    finite after divergence. Thrusts (2, S, C), N, are held over each step, s; ``push``, (3, C) or (3, 1), adds
    accelerations of u, v, r.
    """
    steps = thrust.shape[1]
    states = np.empty((steps + 1, 3, state.shape[1]))
    states[0] = state
    h = step / substeps
    half, sixth = 0.5 * h, h / 6.0
    u, v, r = state[0].copy(), state[1].copy(), state[2].copy()
    for k in range(steps):
        left, right = thrust[0, k], thrust[1, k]
        for _ in range(substeps):
            u1, v1, r1 = _slopes(u, v, r, left, right, push, p)
            u2, v2, r2 = _slopes(u + half * u1, v + half * v1, r + half * r1, left, right, push, p)
            u3, v3, r3 = _slopes(u + half * u2, v + half * v2, r + half * r2, left, right, push, p)
            u4, v4, r4 = _slopes(u + h * u3, v + h * v3, r + h * r3, left, right, push, p)
            u = u + sixth * (u1 + 2.0 * (u2 + u3) + u4)
            v = v + sixth * (v1 + 2.0 * (v2 + v3) + v4)
            r = r + sixth * (r1 + 2.0 * (r2 + r3) + r4)
        states[k + 1, 0], states[k + 1, 1], states[k + 1, 2] = u, v, r
    return states


@np.errstate(over='ignore', invalid='ignore')
def states_under(p: np.ndarray, state: np.ndarray, thrust: np.ndarray, step: float, substeps: int) -> np.ndarray:
    """`runge_kutta_columns` of undisturbed craft that share their parameters (n,)."""
    columns = np.repeat(p[:, None], state.shape[1], axis=1)
    return runge_kutta_columns(state, np.ascontiguousarray(thrust), UNDISTURBED, columns, step, substeps)


@dataclass(frozen=True)
class Manoeuvre:
    """A simulated manoeuvre; all arrays have shape (N,), N one more than the steps of thrust."""

    time: np.ndarray  #: s.
    u: np.ndarray  #: Through the water, m/s.
    v: np.ndarray  #: Through the water, m/s.
    yaw_rate: np.ndarray  #: rad/s.
    heading: np.ndarray  #: rad from east to north, not wrapped.
    x: np.ndarray  #: East, m.
    y: np.ndarray  #: North, m.
    surge: np.ndarray  #: Over ground, m/s.
    sway: np.ndarray  #: Over ground, m/s.
    port: np.ndarray  #: Input as given, the last one repeated.
    starboard: np.ndarray  #: Input as given, the last one repeated.


def simulate(
    model: ManoeuvringModel,
    port: np.ndarray,
    starboard: np.ndarray,
    step: float,
    state: Sequence[float] = (0.0, 0.0, 0.0),
    heading: float = 0.0,
    position: Sequence | np.ndarray = (0.0, 0.0),
    current: Sequence[float] | None = None,
) -> Manoeuvre:
    """Simulate a craft under inputs (S,), N or commands, held over each step, s, from u, v, r, heading (rad) and east,
    north (m). The current, east and north, m/s, is by default the model's.
    """
    port, starboard = np.asarray(port, dtype=float), np.asarray(starboard, dtype=float)
    thrust = acting_thrust(port, starboard, model.values, step)
    before = np.array(state, dtype=float)[:, None]
    substeps = substeps_for(model, step, state, np.max(np.abs(thrust), initial=0.0))
    motion = states_under(model.values, before, thrust[:, :, None], step, substeps)[:, :, 0].T
    drift = model.current if current is None else current
    with np.errstate(over='ignore', invalid='ignore'):
        pose = track(motion, step, heading, position, drift)
        return manoeuvre_of(step, motion, pose, (port, starboard), drift)


def manoeuvre_of(
    step: float,
    motion: Sequence | np.ndarray,
    pose: Sequence | np.ndarray,
    inputs: Sequence | np.ndarray,
    current: Sequence[float],
) -> Manoeuvre:
    """The manoeuvre of u, v, r and heading, x, y, (3, N) each, under inputs (2, N - 1), in steps of s."""
    (u, v, r), (psi, x, y), (port, starboard) = motion, pose, inputs
    ahead, aside = turned(current[0], current[1], psi)
    held = (np.append(side, side[-1:]) for side in (port, starboard))
    return Manoeuvre(step * np.arange(u.size), u, v, r, psi, x, y, u + ahead, v + aside, *held)


def track(
    motion: Sequence | np.ndarray,
    step: float,
    heading: Numbers,
    position: Sequence | np.ndarray,
    current: Sequence | np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heading and position by the trapezoidal rule along the first axis of u, v, r, in their shape."""
    u, v, r = motion
    psi = heading + _integral(r, step)
    x = position[0] + _integral(u * np.cos(psi) - v * np.sin(psi) + current[0], step)
    y = position[1] + _integral(u * np.sin(psi) + v * np.cos(psi) + current[1], step)
    return psi, x, y


def moved(
    before: Sequence | np.ndarray,
    after: Sequence | np.ndarray,
    heading: Numbers,
    step: float,
    current: Sequence | np.ndarray,
) -> np.ndarray:
    """Change of heading, x and y, (3,) or (3, C), by the rule of `track`, from u, v, r before and after a step."""
    half = 0.5 * step
    turn = half * (before[2] + after[2])
    east, north = (step * speed for speed in current)
    for (u, v, _), psi in ((before, heading), (after, heading + turn)):
        cosine, sine = np.cos(psi), np.sin(psi)
        east, north = east + half * (u * cosine - v * sine), north + half * (u * sine + v * cosine)
    return np.array([turn, east, north])


def substeps_for(
    model: ManoeuvringModel, step: float, state: Sequence[float] | np.ndarray, largest_thrust: float
) -> int:
    """Runge-Kutta steps within a step, 1 to 50, that the fastest damping needs at a state and at full speed."""
    fastest = steady_speed(model, 2.0 * float(largest_thrust))
    speeds = {float(state[0]), fastest, -fastest}
    rate = max(np.max(np.abs(np.linalg.eigvals(model.jacobian(u, state[1], state[2])))) for u in speeds)
    return int(np.clip(np.ceil(step * rate / STABLE_STEP), 1, 50))


def steady_speed(model: ManoeuvringModel, total_thrust: float) -> float:
    """Speed on a straight course at which the hull resists a total thrust, m/s, at most 30."""
    half = 0.5 * total_thrust
    return balance(lambda u: model.accelerations(u, 0.0, 0.0, half, half)[0], 30.0)


def balance(push: Callable[[float], Numbers], most: float) -> float:
    """The least motion, up to a largest, that is no longer accelerated; by bisection."""
    low, high = 0.0, most
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if push(middle) > 0.0 else (low, middle)
    return low


def _integral(values: np.ndarray, step: float):
    middle = 0.5 * step * (values[1:] + values[:-1])
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(middle, axis=0)])


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
