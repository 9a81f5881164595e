"""Multiple shooting: all windows are simulated at once, each from its own initial state.

Variable projection (Golub and Pereyra 1973, with Kaufman's Jacobian) eliminates the initial state of each window and
the drift of each run, so that only the shared parameters are searched.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from swath_sysid.common.conventions import MIN_ROWS
from swath_sysid.common.errors import InputError
from swath_sysid.manoeuvring.hull.identified_model import growth_rates
from swath_sysid.manoeuvring.hull.measurement import recorded_speeds, through_water
from swath_sysid.manoeuvring.hull.model import DIFFERENCE, jacobians
from swath_sysid.manoeuvring.hull.simulation import STABLE_STEP, UNDISTURBED, runge_kutta_columns
from swath_sysid.manoeuvring.hull.terms import BALANCE, DELAY, LAG, NAMES
from swath_sysid.manoeuvring.hull.thrust import CURVE, acting_thrust
from swath_sysid.manoeuvring.identification.least_squares import minimise
from swath_sysid.manoeuvring.identification.scaling import SWAY_SHARE
from swath_sysid.manoeuvring.identification.settings import Windows
from swath_sysid.manoeuvring.motion.trial import turned

THRUSTER = sorted({*CURVE, BALANCE, LAG, DELAY})
CURRENT = ('current_east', 'current_north')
STATE_STEPS = 3  #: Gauss-Newton steps of the initial states for each step of the unknowns.
ROBUST_AT = 3.0  #: Standard deviations beyond which a residual counts less (soft_l1).
MIN_DECAY = 0.02  #: 1/s; slower decays of small motions on straight courses are penalised.
STABILITY_WEIGHT = 20.0  #: Of an excess of 1/s, times the root of the number of samples.
#: Windows with more have diverged and do not determine their initial state.
LARGEST_INFORMATION = 1.0 / np.finfo(float).eps
MIN_PARTS = 3  #: Least number of parts of the runs, of which one is held out at a time.


@dataclass(frozen=True)
class Unknowns:
    """Unknowns of a search."""

    names: tuple[str, ...]  #: Parameters, and ``current_east`` and ``current_north``.
    units: np.ndarray  #: (n,); Natural units.
    lower: np.ndarray  #: (n,)
    upper: np.ndarray  #: (n,)
    target: np.ndarray  #: (n,); Of the regularisation.
    spread: np.ndarray  #: (n,); Standard deviation of the regularisation; infinite: none.
    ties: dict[str, str] = field(default_factory=dict)  #: Parameter to the unknown that it is equal to.

    @cached_property
    def shares(self) -> np.ndarray:
        """Share of each unknown in each parameter, shape (P, n): one where it is the unknown or tied to it."""
        standing_for = np.array([self.ties.get(name, name) for name in NAMES])
        return (standing_for[:, None] == np.array(self.names, dtype=str)).astype(float)

    def placed_in(self, base: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Full parameter vector, shape (P,): ``base`` with the values of the unknowns."""
        return np.where(self.shares.any(axis=1), self.shares @ values, base)

    def prior(self, values: np.ndarray) -> np.ndarray:
        """Residuals of the regularisation, shape (n,)."""
        return np.where(np.isfinite(self.spread), (values - self.target) / self.spread, 0.0)


@dataclass(frozen=True)
class Hidden:
    """What each window and each run has of its own."""

    states: np.ndarray  #: (3, W); Initial u, v, r of each window.
    drift: np.ndarray  #: (2, R); m/s by which the current of each run differs, east and north.

    @classmethod
    def measured(cls, windows: Windows) -> 'Hidden':
        """Initial states as measured, zero where they were not; no drifts."""
        return cls(np.nan_to_num(windows.initial), np.zeros((2, len(windows.runs))))


@dataclass(frozen=True)
class Shooting:
    """Windows that a model is to explain, with parameters ``base`` except for the unknowns."""

    windows: Windows
    base: np.ndarray  #: (n,)
    unknowns: Unknowns
    noise: np.ndarray  #: (3,); Of surge, sway, yaw rate.
    speed: float  #: Scale of the initial states, m/s.
    hidden: Hidden
    drift_spread: float = 0.0  #: m/s, of the drifts; 0: one current for all runs.
    speeds: np.ndarray = field(default_factory=lambda: np.zeros(0))  #: m/s, at which straight courses are checked.
    largest_growth: float = -MIN_DECAY  #: 1/s, of small motions at these speeds.
    parts: int = 1  #: Parts of a step over which the thrust is held at its mean.
    weights: np.ndarray | float = 1.0  #: (3, S + 1, W); Of the robust loss.
    thrusts: dict = field(default_factory=dict, compare=False, repr=False)  #: Acting thrusts computed before.

    @cached_property
    def known(self) -> np.ndarray:
        """Where something was measured, bool, (3, S + 1, W)."""
        return np.isfinite(self.windows.measured)

    @cached_property
    def measured(self) -> np.ndarray:
        """The measurements, zero where there are none, (3, S + 1, W)."""
        return np.nan_to_num(self.windows.measured)

    @cached_property
    def member(self) -> np.ndarray:
        """One where a window is of a run, else zero, (R, W)."""
        return (self.windows.run_index == np.arange(len(self.windows.runs))[:, None]).astype(float)

    @cached_property
    def state_spread(self) -> np.ndarray:
        """Prior deviation of the initial states, (3, W); wide, as current and compass come before what is recorded."""
        unknown = np.array([self.speed, SWAY_SHARE * self.speed, 0.3])[:, None]
        return np.where(np.isfinite(self.windows.initial), 10.0 * self.noise[:, None], unknown)

    @cached_property
    def drift_slopes(self) -> np.ndarray:
        """Derivatives of the weighted residuals by the current of a window, (2, 3, S + 1, W)."""
        heading = self.windows.heading
        slopes = np.array([[*turned(east, north, heading), np.zeros_like(heading)] for east, north in np.eye(2)])
        return np.where(self.known, slopes / self.noise[:, None, None] * self.weights, 0.0)

    @property
    def part_of_window(self) -> np.ndarray:
        """Part of each window, (W,): its run, or its third where there are fewer than three runs."""
        index = self.windows.run_index
        if np.unique(index).size < MIN_PARTS:
            index = np.arange(index.size) * MIN_PARTS // index.size
        return np.unique(index, return_inverse=True)[1]

    def parameters(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Full parameter vectors, shape (n, K), and currents, shape (2, K), of candidates (K, unknowns)."""
        columns = np.stack([self.unknowns.placed_in(self.base, row) for row in values], axis=1)
        found = dict(zip(self.unknowns.names, np.transpose(values), strict=True))
        return columns, np.stack([found.get(name, np.zeros(len(values))) for name in CURRENT])


def simulate(shooting: Shooting, columns: np.ndarray, states: np.ndarray) -> np.ndarray:
    """States (S + 1, 3, K, W) of K copies of all windows with parameters (n, K), from (3, K, W)."""
    copies, count, parts = columns.shape[1], shooting.windows.count, shooting.parts
    thrust = np.stack([_thrust(shooting, column) for column in columns.T], axis=2).reshape(2, -1, copies * count)
    start, p = np.ascontiguousarray(states.reshape(3, -1)), np.repeat(columns, count, axis=1)
    step, substeps = shooting.windows.step / parts, _substeps(shooting, columns[:, :1])
    with np.errstate(over='ignore', invalid='ignore'):
        found = runge_kutta_columns(start, thrust, UNDISTURBED, p, step, substeps)
    return found[::parts].reshape(-1, 3, copies, count)


def _thrust(shooting: Shooting, p: np.ndarray):
    """Acting thrust of both sides over the parts of the steps of all windows, shape (2, S parts, W)."""
    key, parts = p[THRUSTER].tobytes(), shooting.parts
    if key not in shooting.thrusts:
        if len(shooting.thrusts) > 100:
            shooting.thrusts.clear()
        sides = ((np.repeat(run.port, parts), np.repeat(run.starboard, parts)) for run in shooting.windows.runs)
        acting = [acting_thrust(*side, p, shooting.windows.step / parts) for side in sides]
        shooting.thrusts[key] = np.stack([shooting.windows.gather(side, parts) for side in zip(*acting, strict=True)])
    return shooting.thrusts[key]


def _substeps(shooting: Shooting, p: np.ndarray):
    """Runge-Kutta steps within a part of a step that the fastest damping of parameters (n, 1) needs."""
    state = np.max(np.abs(shooting.measured), axis=(1, 2))[:, None]
    fastest = np.max(np.abs(np.linalg.eigvals(np.nan_to_num(jacobians(p, state)))))
    return int(np.clip(np.ceil(shooting.windows.step / shooting.parts * fastest / STABLE_STEP), 1, 10))


def misses(
    shooting: Shooting, columns: np.ndarray, currents: np.ndarray, states: np.ndarray, drift: np.ndarray
) -> np.ndarray:
    """Simulated less measured over the noise, (K, 3, S + 1, W), zero where nothing was measured, of K candidates."""
    water = currents[:, :, None] + (drift @ shooting.member)[:, None]
    with np.errstate(over='ignore', invalid='ignore'):
        u, v, r = np.moveaxis(simulate(shooting, columns, states), 1, 0)
        speeds = recorded_speeds(u, v, r, shooting.windows.heading[:, None], water, columns[:, :, None])
        found = (np.stack([*speeds, r]) - shooting.measured[:, :, None]) / shooting.noise[:, None, None, None]
    return np.moveaxis(np.where(shooting.known[:, :, None], found, 0.0), 2, 0)


def linearised(
    shooting: Shooting, values: np.ndarray, hidden: Hidden, by_unknowns: bool = False
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weighted residuals (3, S + 1, W), and derivatives by initial states, (3, ...), and unknowns, (n or 0, ...)."""
    unknowns, count = shooting.unknowns, values.size if by_unknowns else 0
    steps = DIFFERENCE * unknowns.units[:count]
    # from the side of the range that is open
    steps = np.where(values[:count] + steps > unknowns.upper[:count], -steps, steps)
    candidates = np.repeat(values[None], 4 + count, axis=0)
    candidates[4:] += steps[:, None] * np.eye(count, values.size)
    states = np.repeat(hidden.states[:, None], 4 + count, axis=1)
    state_steps = DIFFERENCE * np.maximum(shooting.noise, 1e-2)
    states[:, 1:4] += np.diag(state_steps)[:, :, None]
    found = misses(shooting, *shooting.parameters(candidates), states, hidden.drift) * shooting.weights
    with np.errstate(over='ignore', invalid='ignore'):
        slopes = (found[1:] - found[0]) / np.concatenate([state_steps, steps])[:, None, None, None]
    return found[0], slopes[:3], slopes[3:]


@dataclass(frozen=True)
class Elimination:
    """The initial states and drifts, linearised: `best` finds those that explain most of some residuals."""

    shooting: Shooting
    slopes: np.ndarray  #: (3, 3, S + 1, W); Derivatives of the weighted residuals by the initial states.

    @cached_property
    def usable(self) -> np.ndarray:
        """Windows that have not diverged, bool, (W,)."""
        with np.errstate(over='ignore', invalid='ignore'):
            return np.max(np.einsum('jcsw,jcsw->jw', self.slopes, self.slopes), axis=0) < LARGEST_INFORMATION

    @cached_property
    def state_covariance(self) -> np.ndarray:
        """Inverse information of the initial states, (W, 3, 3)."""
        slopes = np.where(self.usable, self.slopes, 0.0)
        prior = np.eye(3) / (self.shooting.state_spread**2).T[:, None]
        return np.linalg.inv(np.einsum('jcsw,kcsw->wjk', slopes, slopes) + prior)

    def states_for(self, rows: np.ndarray, pull: np.ndarray | float = 0.0) -> np.ndarray:
        """Moves of the initial states, (n, 3, W), for rows (n, 3, S + 1, W) and prior residuals (n, 3, W)."""
        with np.errstate(over='ignore', invalid='ignore'):
            right = np.einsum('jcsw,ncsw->njw', self.slopes, rows) + pull / self.shooting.state_spread
        right = np.where(self.usable & np.isfinite(right), right, 0.0)
        return -np.einsum('wjk,nkw->njw', self.state_covariance, right)

    @cached_property
    def drift_moves(self) -> np.ndarray:
        """Moves of the initial states for a unit drift of each run, (2, 3, W)."""
        return self.states_for(self.shooting.drift_slopes)

    @cached_property
    def drift_left(self) -> np.ndarray:
        """Derivatives by the drifts less their part along the initial states, (2, 3, S + 1, W); zero where unusable."""
        with np.errstate(over='ignore', invalid='ignore'):
            left = self.shooting.drift_slopes + np.einsum('jcsw,njw->ncsw', self.slopes, self.drift_moves)
        return np.where(self.usable, np.nan_to_num(left, posinf=0.0, neginf=0.0), 0.0)

    @cached_property
    def drift_covariance(self) -> np.ndarray:
        """Inverse information of the drift of each run, (R, 2, 2)."""
        # the projection is idempotent: one projected side is enough, and the states' priors are in it
        each = np.einsum('jcsw,kcsw->jkw', self.drift_left, self.shooting.drift_slopes) @ self.shooting.member.T
        matrix = np.moveaxis(0.5 * (each + each.swapaxes(0, 1)), 2, 0)
        return np.linalg.inv(matrix + np.eye(2) / self.shooting.drift_spread**2)

    def best(self, rows: np.ndarray, pulls: tuple = (0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
        """Moves of states, (n, 3, W), and drifts, (n, 2, R), that minimise rows and priors with residuals ``pulls``."""
        shooting, (state_pull, drift_pull) = self.shooting, pulls
        moves = self.states_for(rows, state_pull)
        if not shooting.drift_spread:
            return moves, np.zeros((len(rows), *shooting.hidden.drift.shape))
        with np.errstate(over='ignore', invalid='ignore'):
            # what projects out the states also takes out their pull
            pulled = np.broadcast_to(state_pull / shooting.state_spread, moves.shape)
            right = np.einsum('jcsw,ncsw->njw', self.drift_left, rows)
            right = np.nan_to_num(right + np.einsum('jkw,nkw->njw', self.drift_moves, pulled), posinf=0.0, neginf=0.0)
        right = right @ shooting.member.T + drift_pull / shooting.drift_spread
        drift = -np.einsum('rjk,nkr->njr', self.drift_covariance, right)
        return moves + np.einsum('jkw,njw->nkw', self.drift_moves, drift @ shooting.member), drift

    def moved(self, rows: np.ndarray, moves: np.ndarray, drift: np.ndarray) -> np.ndarray:
        """Rows (n, 3, S + 1, W) after moves of the initial states and drifts."""
        with np.errstate(over='ignore', invalid='ignore'):
            rows = rows + np.einsum('jcsw,njw->ncsw', self.slopes, moves)
            if self.shooting.drift_spread:
                rows = rows + np.einsum('jcsw,njw->ncsw', self.shooting.drift_slopes, drift @ self.shooting.member)
        return rows

    def priors(self, moves: np.ndarray, drift: np.ndarray) -> list[np.ndarray]:
        """Residuals of the priors by displacements of initial states (n, 3, W) and drifts (n, 2, R), (n, ...) each."""
        spread = self.shooting.drift_spread
        parts = [moves / self.shooting.state_spread, *([drift / spread] if spread else [])]
        return [part.reshape(len(moves), -1) for part in parts]


def residuals(shooting: Shooting, values: np.ndarray, hidden: Hidden) -> tuple[np.ndarray, Hidden]:
    """Weighted residuals with priors, shape (rows,), at the best initial states and drifts, and these."""
    expected = Hidden.measured(shooting.windows)
    for _ in range(STATE_STEPS):
        residual, slopes, _ = linearised(shooting, values, hidden)
        solver = Elimination(shooting, slopes)
        away = hidden.drift / shooting.drift_spread if shooting.drift_spread else 0.0
        pulls = (hidden.states - expected.states) / shooting.state_spread, away
        moves, drift = solver.best(residual[None], pulls)
        limit = 30.0 * shooting.noise[:, None] + 0.2 * np.abs(hidden.states)
        moves = np.clip(np.where(solver.usable, moves, 0.0), -limit, limit)
        hidden = Hidden(hidden.states + moves[0], hidden.drift + drift[0])
        if np.max(np.abs(moves) / shooting.noise[:, None]) < 0.05:
            break
    # the last move is small: its effect is linear
    left = solver.moved(residual[None], moves, drift)
    priors = solver.priors((hidden.states - expected.states)[None], hidden.drift[None])
    demand = _instability(shooting, shooting.parameters(values[None])[0])[:, 0]
    return np.concatenate([left.ravel(), *(p[0] for p in priors), shooting.unknowns.prior(values), demand]), hidden


def projected(shooting: Shooting, values: np.ndarray, hidden: Hidden) -> tuple[np.ndarray, np.ndarray, list]:
    """Weighted residuals, their Jacobian (n, 3, S + 1, W) with states and drifts eliminated, and that of the priors."""
    residual, slopes, rows = linearised(shooting, values, hidden, by_unknowns=True)
    solver = Elimination(shooting, slopes)
    best = solver.best(rows)
    return residual, solver.moved(rows, *best), solver.priors(*best)


def jacobian(shooting: Shooting, values: np.ndarray, hidden: Hidden) -> np.ndarray:
    """Derivatives of `residuals`, shape (rows, n)."""
    _, rows, priors = projected(shooting, values, hidden)
    spread = shooting.unknowns.spread
    parts = [rows.reshape(values.size, -1), *priors, np.diag(np.where(np.isfinite(spread), 1.0 / spread, 0.0))]
    return np.concatenate([*(part.T for part in parts), instability_slopes(shooting, values)])


def _instability(shooting: Shooting, columns: np.ndarray):
    """Weighted excess of growth of candidates (n, K), shape (speeds, K)."""
    growth = growth_rates(columns, shooting.speeds)
    return STABILITY_WEIGHT * np.sqrt(shooting.known.sum()) * np.maximum(growth - shooting.largest_growth, 0.0)


def instability_slopes(shooting: Shooting, values: np.ndarray) -> np.ndarray:
    """Derivatives of the demand of stable straight courses by the unknowns, shape (speeds, n)."""
    steps = DIFFERENCE * shooting.unknowns.units
    candidates = np.concatenate([values[None], values + np.diag(steps)])
    found = _instability(shooting, shooting.parameters(candidates)[0])
    return (found[:, 1:] - found[:, :1]) / steps


def bounded_slopes(slopes: np.ndarray) -> np.ndarray:
    """Derivatives of residuals, those of diverged windows bounded, so that their squares can be summed."""
    return np.clip(np.nan_to_num(slopes, posinf=0.0, neginf=0.0), -1e9, 1e9)


@dataclass(frozen=True)
class ShootingFit:
    """Outcome of `refine`."""

    values: np.ndarray  #: (n,)
    cost: float  #: Half the weighted sum of squares, regularisation included.
    evaluations: int
    shooting: Shooting  #: With the best initial states and drifts.


def refine(shooting: Shooting, values: np.ndarray, max_evaluations: int = 20) -> ShootingFit:
    """Bounded least squares over the unknowns."""
    lower, upper, units = shooting.unknowns.lower, shooting.unknowns.upper, shooting.unknowns.units

    def scaled_residuals(x: np.ndarray, hidden: Hidden) -> tuple[np.ndarray, Hidden]:
        found, hidden = residuals(shooting, x * units, hidden)
        return np.clip(np.nan_to_num(found, nan=1e6), -1e6, 1e6), hidden

    def scaled_jacobian(x: np.ndarray, hidden: Hidden) -> np.ndarray:
        return bounded_slopes(jacobian(shooting, x * units, hidden) * units)

    bounds = lower / units, upper / units
    found = minimise(scaled_residuals, scaled_jacobian, values / units, *bounds, shooting.hidden, max_evaluations)
    return ShootingFit(found.x * units, found.cost, found.evaluations, replace(shooting, hidden=found.aside))


def weighed(shooting: Shooting, values: np.ndarray) -> Shooting:
    """The shooting with the weights of the robust loss by the residuals at these values."""
    residual = np.clip(np.nan_to_num(_present(shooting, values), nan=1e3), -1e6, 1e6)
    # soft_l1: rho'(z) = 1 / sqrt(1 + z) at z = (residual / scale)^2
    return replace(shooting, weights=(1.0 + (residual / ROBUST_AT) ** 2) ** -0.25)


def _present(shooting: Shooting, values: np.ndarray):
    """Residuals over the noise, (3, S + 1, W), at the present initial states and drifts."""
    parameters = shooting.parameters(values[None])
    return misses(shooting, *parameters, shooting.hidden.states[:, None], shooting.hidden.drift)[0]


def channel_residuals(shooting: Shooting, values: np.ndarray) -> np.ndarray:
    """Simulated less measured, m/s and rad/s, shape (3, S + 1, W); NaN where not measured."""
    return np.where(shooting.known, _present(shooting, values) * shooting.noise[:, None, None], np.nan)


def drift_variance(shooting: Shooting, values: np.ndarray) -> np.ndarray:
    """Variance of the drift of each run by the weights alone, shape (2, R); regularisation included."""
    _, slopes, _ = linearised(shooting, values, shooting.hidden)
    return np.diagonal(Elimination(shooting, slopes).drift_covariance, axis1=1, axis2=2).T


def by_channel(
    shooting: Shooting, residual: np.ndarray, slopes: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Outcome of `projected` by window and channel, for the covariance: lists of (N_k,) and (N_k, n)."""
    places = [(c, shooting.known[c, :, w], w) for w in range(shooting.windows.count) for c in range(3)]
    places = [place for place in places if place[1].sum() >= MIN_ROWS]
    if not places:
        raise InputError(
            f'no stretch holds {MIN_ROWS} readings of a speed or of the yaw rate that are not those before them: '
            'record them as they change, or fit longer stretches'
        )
    return [residual[place] for place in places], [slopes[:, c, known, w].T for c, known, w in places]


def by_part(shooting: Shooting, residual: np.ndarray, slopes: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Outcome of `projected` by part: a list of residuals (N_k,) and Jacobian (N_k, n)."""
    part = shooting.part_of_window
    places = (shooting.known & (part == k) for k in range(part.max() + 1))
    return [(residual[known], slopes[:, known].T) for known in places]


def free_run_residuals(shooting: Shooting, candidates: np.ndarray) -> np.ndarray:
    """Residuals over the noise, (C, 3, S + 1, W), of free runs without drifts with each of some candidates (C, n)."""
    columns, currents = shooting.parameters(candidates)
    windows, water = shooting.windows, currents[:, :, None]
    surge, sway, rate = windows.initial
    speeds = through_water(surge, sway, rate, windows.heading[0], water, columns[:, :, None])
    start = np.stack([*speeds, np.repeat(rate[None], len(candidates), axis=0)])
    start = np.where(np.isfinite(start), start, shooting.hidden.states[:, None])
    return misses(shooting, columns, currents, start, np.zeros_like(shooting.hidden.drift))


def objective_of_population(shooting: Shooting, candidates: np.ndarray) -> np.ndarray:
    """Root mean square of the weighted residuals of candidates (P, n) from the present initial states."""
    states = np.repeat(shooting.hidden.states[:, None], len(candidates), axis=1)
    found = misses(shooting, *shooting.parameters(candidates), states, shooting.hidden.drift) * shooting.weights
    total = np.sqrt(np.sum(np.minimum(np.abs(found), 1e6) ** 2, axis=(1, 2, 3)) / shooting.known.sum())
    return np.where(np.isfinite(total), total, np.inf)
