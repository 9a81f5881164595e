"""Multiple shooting: all windows are simulated at once, each from its own initial state.

Variable projection (Golub and Pereyra 1973, with Kaufman's Jacobian) eliminates the initial state of each window and
the drift of each run, so that only the shared parameters are searched.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from swath_sysid.manoeuvring.hull.measurement import recorded_speeds, through_water, turned
from swath_sysid.manoeuvring.hull.model import active_terms
from swath_sysid.manoeuvring.hull.simulation import UNDISTURBED, runge_kutta_columns
from swath_sysid.manoeuvring.hull.stability import growth_rates
from swath_sysid.manoeuvring.hull.terms import (
    BALANCE,
    DELAY,
    IZ,
    LAG,
    NAMES,
    NR,
    NR_DOT,
    NRR,
    NUR,
    NUUR,
    XU,
    XU_DOT,
    XUU,
    YUV,
    YV,
    YV_DOT,
    YVV,
    M,
)
from swath_sysid.manoeuvring.hull.thrust import CURVE, acting_thrust
from swath_sysid.manoeuvring.identification.least_squares import minimise
from swath_sysid.manoeuvring.identification.windows import Windows

THRUSTER = {*CURVE, BALANCE, LAG, DELAY}
CURRENT = ('current_east', 'current_north')
PERTURBATION = 1e-4
STATE_STEPS = 3
ROBUST_AT = 3.0  #: Standard deviations beyond which a residual counts less (soft_l1).

STABLE_STEP = 1.5
MIN_DECAY = 0.02  #: 1/s; slower decays of small motions on straight courses are penalised.
STABILITY_WEIGHT = 20.0  #: Of an excess of 1/s, times the root of the number of samples.
LARGEST_INFORMATION = 1e14  #: Windows with more have diverged and do not determine their initial state.
MIN_PARTS = 3  #: Least number of parts of the runs, of which one is held out at a time.
UNKNOWN_SWAY = 0.3  #: Spread of an unmeasured initial sway, as a share of the speed.


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


@dataclass(frozen=True)
class ShootingFit:
    """Outcome of `MultipleShooting.refine`."""

    values: np.ndarray  #: (n,)
    cost: float  #: Half the weighted sum of squares, regularisation included.
    evaluations: int


class MultipleShooting:
    """Residuals of windows against a model with parameters ``base`` (n,) except for the unknowns.

    Further: noise (3,) of surge, sway, yaw rate; scale of the initial states, m/s; first guesses of states (3, W) and
    of the drifts (2, R), by which the current of each run differs, with their spread, m/s (0: one current); speeds,
    m/s, at which straight courses may grow by ``largest_growth``, 1/s; parts of a step over which the thrust is held at
    its mean.
    """

    def __init__(
        self,
        windows: Windows,
        base: np.ndarray,
        unknowns: Unknowns,
        noise: np.ndarray,
        speed: float,
        states: np.ndarray | None = None,
        drift: np.ndarray | None = None,
        drift_spread: float = 0.0,
        speeds: Sequence[float] | np.ndarray = (),
        largest_growth: float = -MIN_DECAY,
        parts: int = 1,
    ):
        self.windows, self.unknowns = windows, unknowns
        self._base = np.array(base, dtype=float)
        self._noise = np.asarray(noise, dtype=float)
        self._known = np.isfinite(windows.measured)
        self._measured = np.where(self._known, windows.measured, 0.0)
        self._robust = np.ones_like(windows.measured)
        # wide: current and compass stand between what is recorded and the state through the water
        floor = 10.0 * self._noise[:, None]
        measured_start = np.isfinite(windows.initial)
        self._expected = np.where(measured_start, windows.initial, 0.0)
        unknown = np.array([speed, UNKNOWN_SWAY * speed, 0.3])[:, None]
        self._expected_spread = np.where(measured_start, floor, unknown)
        self.states = self._expected.copy() if states is None else states.copy()
        self._state_units = np.maximum(self._noise, 1e-6)
        self.drift = np.zeros((2, len(windows.runs))) if drift is None else drift.copy()
        self._drift_spread = drift_spread
        self._speeds, self._largest_growth = np.asarray(speeds, dtype=float), largest_growth
        self._member = (windows.run_index == np.arange(len(windows.runs))[:, None]).astype(float)
        self._parts = parts
        self._thrust_cache: dict[bytes, tuple[np.ndarray, ...]] = {}

    def with_unknowns(self, unknowns: Unknowns, base: np.ndarray) -> 'MultipleShooting':
        """The same windows, weights and states with other unknowns."""
        other = copy(self)
        other.unknowns, other._base = unknowns, np.array(base, dtype=float)
        return other

    def parameters(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Full parameter vector, shape (n,), and current, shape (2,)."""
        found = dict(zip(self.unknowns.names, values, strict=True))
        return self.unknowns.placed_in(self._base, values), np.array([found.get(name, 0.0) for name in CURRENT])

    def simulate(self, p_columns: np.ndarray, states: np.ndarray, active: tuple[bool, ...] | None = None) -> np.ndarray:
        """States (S + 1, 3, K, W) of K copies of all windows with parameters (n, K), from (3, K, W)."""
        copies, count = p_columns.shape[1], self.windows.count
        thrust = [
            np.stack(side, axis=1).reshape(-1, copies * count)
            for side in zip(*(self._thrust(p_columns[:, k]) for k in range(copies)), strict=True)
        ]
        active = active or active_terms(_union(p_columns))
        found = self._integrated(
            states.reshape(3, copies * count),
            thrust,
            np.repeat(p_columns, count, axis=1),
            active,
            self._substeps(p_columns[:, 0]),
        )
        return found.reshape(-1, 3, copies, count)

    def _integrated(
        self, states: np.ndarray, thrust: Sequence[np.ndarray], p: np.ndarray, active: tuple[bool, ...], substeps: int
    ):
        """States (S + 1, 3, C) at the samples from initial ones (3, C) under thrusts (S parts, C) of both sides."""
        states, port, starboard = map(np.ascontiguousarray, (states, *thrust))
        with np.errstate(over='ignore', invalid='ignore'):
            found = runge_kutta_columns(
                states, port, starboard, UNDISTURBED, p, active, self.windows.step / self._parts, substeps
            )
        return found[:: self._parts]

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Weighted residuals at the best initial states and drifts, with priors; shape (rows,)."""
        p, current = self.parameters(values)
        for _ in range(STATE_STEPS):
            residual, state_slopes = self._with_state_slopes(p, current)
            move, drift_move = self._best_move(residual, state_slopes)
            self.states = self.states + move
            self.drift = self.drift + drift_move
            if np.max(np.abs(move) / self._state_units[:, None]) < 0.05:
                break
        # the last move is small: its effect is linear
        residual = residual + np.einsum('jcsw,jw->csw', state_slopes, move)
        if self._drift_spread:
            residual = residual + np.einsum('jcsw,jw->csw', self._drift_slopes(), drift_move @ self._member)
        return np.concatenate(
            [
                residual.ravel(),
                self._state_residual().ravel(),
                self._drift_residual().ravel(),
                self._prior(values),
                self._instability(p[:, None])[:, 0],
            ]
        )

    def jacobian(self, values: np.ndarray) -> np.ndarray:
        """Derivatives of `residuals` with the initial states and drifts eliminated, shape (rows, n)."""
        _, *slopes = self._slopes(values)
        projected, state_part, drift_part = self._eliminated(*slopes)
        n = values.size
        prior = np.diag(np.where(np.isfinite(self.unknowns.spread), 1.0 / self.unknowns.spread, 0.0))
        parts = [part.reshape(n, -1).T for part in (projected, state_part, drift_part)]
        return np.concatenate([*parts, prior, self.instability_slopes(values)])

    def refine(self, values: np.ndarray, max_evaluations: int = 20, tolerance: float = 1e-5) -> ShootingFit:
        """Bounded least squares over the unknowns."""
        lower, upper, units = self.unknowns.lower, self.unknowns.upper, self.unknowns.units

        def scaled_residuals(x: np.ndarray) -> np.ndarray:
            found = self.residuals(x * units)
            return np.where(np.isfinite(found), np.clip(found, -1e6, 1e6), 1e6)

        def scaled_jacobian(x: np.ndarray) -> np.ndarray:
            found = self.jacobian(x * units) * units
            return np.where(np.isfinite(found), np.clip(found, -1e9, 1e9), 0.0)

        found = minimise(
            scaled_residuals, scaled_jacobian, values / units, lower / units, upper / units, max_evaluations, tolerance
        )
        return ShootingFit(found.x * units, found.cost, found.evaluations)

    def settle(self, values: np.ndarray) -> None:
        """Find the initial states, the drifts and the robust weights at these values."""
        for _ in range(3):
            self.residuals(values)
            self.weigh(values)
        self.residuals(values)

    def weigh(self, values: np.ndarray) -> None:
        """Set the weights of the robust loss from the residuals at these values."""
        self._robust = np.ones_like(self._robust)
        p, current = self.parameters(values)
        residual, _ = self._with_state_slopes(p, current)
        residual = np.where(np.isfinite(residual), residual, 1e3)
        # soft_l1: rho'(z) = 1 / sqrt(1 + z) at z = (residual / scale)^2
        self._robust = (1.0 + (residual / ROBUST_AT) ** 2) ** -0.25

    def channel_residuals(self, values: np.ndarray) -> np.ndarray:
        """Unweighted residuals, simulated less measured over ground, shape (3, S + 1, W); NaN where not measured."""
        p, current = self.parameters(values)
        states = self.simulate(p[:, None], self.states[:, None, :])[:, :, 0]
        return np.where(self._known, self._over_ground(states, p, current) - self._measured, np.nan)

    def take_weights(self, other: 'MultipleShooting') -> None:
        """Use the robust weights of another shooting over the same windows."""
        self._robust = other._robust

    def linearised(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residuals (3, S + 1, W) and eliminated Jacobian (n, 3, S + 1, W) at the present states."""
        residual, *slopes = self._slopes(values)
        return residual, self._eliminated(*slopes)[0]

    def by_channel(self, residual: np.ndarray, jacobian: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Outcome of `linearised` by window and channel, for the covariance: lists of (N_k,) and (N_k, n)."""
        residuals, jacobians = [], []
        for w in range(self.windows.count):
            for c in range(3):
                known = self._known[c, :, w]
                if known.sum() >= 8:
                    residuals.append(residual[c, known, w])
                    jacobians.append(jacobian[:, c, known, w].T)
        return residuals, jacobians

    @property
    def part_of_window(self) -> np.ndarray:
        """Part of each window, (W,): its run, or its third where there are fewer than three runs."""
        index = self.windows.run_index
        if np.unique(index).size < MIN_PARTS:
            index = np.arange(index.size) * MIN_PARTS // index.size
        return np.unique(index, return_inverse=True)[1]

    def by_part(self, residual: np.ndarray, jacobian: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Outcome of `linearised` by part: a list of residuals (N_k,) and Jacobian (N_k, n)."""
        places = (self._known & (self.part_of_window == k) for k in range(self.part_of_window.max() + 1))
        return [(residual[known], jacobian[:, known].T) for known in places]

    def free_run_residuals(self, values_by_part: np.ndarray) -> np.ndarray:
        """Residuals over the noise of free runs from the measured states without drifts, each part with its own values
        of (K, n); zero where not measured.
        """
        columns, currents = zip(*(self.parameters(values) for values in values_by_part), strict=True)
        part, windows = self.part_of_window, self.windows
        p, current = np.stack(columns, axis=1)[:, part], np.stack(currents, axis=1)[:, part]
        thrust = [np.stack([self._thrust(c)[side] for c in columns], axis=2) for side in (0, 1)]
        surge, sway, rate = windows.initial
        start = np.stack([*through_water(surge, sway, rate, windows.heading[0], current, p), rate])
        states = self._integrated(
            np.where(np.isfinite(start), start, self.states),
            [side[:, np.arange(windows.count), part] for side in thrust],
            p,
            active_terms(_union(p)),
            max(self._substeps(c) for c in columns),
        )
        with np.errstate(over='ignore', invalid='ignore'):
            u, v, r = np.moveaxis(states, 1, 0)
            recorded = np.stack([*recorded_speeds(u, v, r, windows.heading, current, p), r])
            return np.where(self._known, (recorded - self._measured) / self._noise[:, None, None], 0.0)

    def objective_of_population(self, candidates: np.ndarray) -> np.ndarray:
        """Root mean square of the weighted residuals of candidates (P, n) from the present initial states."""
        columns = np.stack([self.parameters(row)[0] for row in candidates], axis=1)
        currents = np.stack([self.parameters(row)[1] for row in candidates], axis=1)
        states = np.repeat(self.states[:, None, :], len(candidates), axis=1)
        found = self.simulate(columns, states)
        total = np.empty(len(candidates))
        for k in range(len(candidates)):
            residual = self._weighted(found[:, :, k], columns[:, k], currents[:, k])
            residual = np.minimum(np.abs(residual), 1e6)
            total[k] = np.sqrt(np.mean(residual[self._known] ** 2))
        return np.where(np.isfinite(total), total, np.inf)

    def _thrust(self, p: np.ndarray):
        key = p[sorted(THRUSTER)].tobytes()
        if key not in self._thrust_cache:
            if len(self._thrust_cache) > 100:
                self._thrust_cache.clear()
            acting = [
                acting_thrust(
                    np.repeat(run.port, self._parts), np.repeat(run.starboard, self._parts), p, run.step / self._parts
                )
                for run in self.windows.runs
            ]
            self._thrust_cache[key] = tuple(
                self.windows.gather([a[side] for a in acting], self._parts) for side in (0, 1)
            )
        return self._thrust_cache[key]

    def _substeps(self, p: np.ndarray):
        speed = 1.0 if not self._known[0].any() else float(np.max(np.abs(self._measured[0])))
        rate = 0.3 if not self._known[2].any() else float(np.max(np.abs(self._measured[2])))
        fastest = max(
            abs(p[XU] + 2.0 * p[XUU] * speed) / (p[M] - p[XU_DOT]),
            abs(p[YV] + p[YVV] * speed + p[YUV] * speed) / (p[M] - p[YV_DOT]),
            abs(p[NR] + 2.0 * p[NRR] * rate + p[NUR] * speed + p[NUUR] * speed**2) / (p[IZ] - p[NR_DOT]),
        )
        return int(np.clip(np.ceil(self.windows.step / self._parts * fastest / STABLE_STEP), 1, 10))

    def _over_ground(self, states: np.ndarray, p: np.ndarray, current: np.ndarray):
        """Surge, sway, yaw rate as recorded, shape (3, S + 1, W), of states (S + 1, 3, W)."""
        u, v, r = np.moveaxis(states, 1, 0)
        water = current[:, None] + self.drift @ self._member
        with np.errstate(over='ignore', invalid='ignore'):
            return np.stack([*recorded_speeds(u, v, r, self.windows.heading, water, p), r])

    def _weighted(self, states: np.ndarray, p: np.ndarray, current: np.ndarray):
        found = (self._over_ground(states, p, current) - self._measured) / self._noise[:, None, None]
        return np.where(self._known, found * self._robust, 0.0)

    def _with_state_slopes(self, p: np.ndarray, current: np.ndarray):
        columns = np.repeat(p[:, None], 4, axis=1)
        states = np.repeat(self.states[:, None, :], 4, axis=1)
        steps = PERTURBATION * np.maximum(self._state_units, 1e-2)
        for j in range(3):
            states[j, j + 1] += steps[j]
        found = self.simulate(columns, states, active_terms(p))
        residual = self._weighted(found[:, :, 0], p, current)
        with np.errstate(over='ignore', invalid='ignore'):
            slopes = np.stack(
                [(self._weighted(found[:, :, j + 1], p, current) - residual) / steps[j] for j in range(3)]
            )
        return residual, slopes

    def _state_residual(self):
        return (self.states - self._expected) / self._expected_spread

    def _drift_residual(self):
        return self.drift / self._drift_spread if self._drift_spread else np.zeros((2, 0))

    def _drift_slopes(self):
        """Derivatives of the weighted residuals by a window's current, shape (2, 3, S + 1, W)."""
        heading = self.windows.heading
        nothing = np.zeros_like(heading)
        slopes = np.array([[*turned(east, north, heading), nothing] for east, north in np.eye(2)])
        slopes /= self._noise[:, None, None]
        return np.where(self._known, slopes * self._robust, 0.0)

    def _best_move(self, residual: np.ndarray, slopes: np.ndarray):
        """Gauss-Newton step of the initial states of every window, shape (3, W), and of the drifts, (2, R)."""
        inverse, usable = self._state_information(slopes)
        drift_move = np.zeros_like(self.drift)
        pull = self._state_residual() / self._expected_spread
        if self._drift_spread:
            drifts = self._drift_slopes()
            projected, _ = self._without_states(drifts, slopes, inverse, usable)
            with np.errstate(over='ignore', invalid='ignore'):
                # what projects out the states also takes out their pull
                right = np.einsum('jcsw,csw->jw', projected, residual)
                taken = np.einsum('wjk,kcsw,ncsw->njw', inverse, slopes, drifts)
                right = np.nan_to_num(right - np.einsum('njw,jw->nw', taken, pull)) * usable
            right = right @ self._member.T + self.drift / self._drift_spread**2
            drift_move = -np.einsum('rjk,kr->jr', self._drift_information(projected, drifts), right)
            drift_move = np.clip(drift_move, -1.0, 1.0)
            residual = residual + np.einsum('jcsw,jw->csw', drifts, drift_move @ self._member)
        with np.errstate(over='ignore', invalid='ignore'):
            right = np.einsum('jcsw,csw->jw', slopes, residual) + pull
            move = -np.einsum('wjk,kw->jw', inverse, right)
        move = np.where(usable & np.all(np.isfinite(move), axis=0), move, 0.0)
        limit = 30.0 * self._state_units[:, None] + 0.2 * np.abs(self.states)
        return np.clip(move, -limit, limit), drift_move

    def _state_information(self, state_slopes: np.ndarray):
        """Inverse information of the initial states, shape (W, 3, 3), and where it could be computed."""
        with np.errstate(over='ignore', invalid='ignore'):
            matrix = np.einsum('jcsw,kcsw->wjk', state_slopes, state_slopes)
            matrix = matrix + np.eye(3) * (1.0 / self._expected_spread**2).T[:, None, :]
            usable = np.max(np.abs(matrix), axis=(1, 2)) < LARGEST_INFORMATION
        matrix[~usable] = np.eye(3)
        return np.linalg.inv(matrix), usable

    def _without_states(self, slopes: np.ndarray, state_slopes: np.ndarray, inverse: np.ndarray, usable: np.ndarray):
        """Slopes (n, 3, S + 1, W) less their part along the initial states, and this part, (n, 3, W)."""
        with np.errstate(over='ignore', invalid='ignore'):
            cross = np.einsum('jcsw,ncsw->wjn', state_slopes, slopes)
            cross = np.where(usable[:, None, None] & np.isfinite(cross), cross, 0.0)
            taken = inverse @ cross
            projected = slopes - np.einsum('jcsw,wjn->ncsw', state_slopes, taken)
        return projected, np.moveaxis(taken, 0, 2).transpose(1, 0, 2)

    def _drift_information(self, projected: np.ndarray, drifts: np.ndarray):
        """Inverse information of the drift of each run, shape (R, 2, 2)."""
        with np.errstate(over='ignore', invalid='ignore'):
            # the projection is idempotent: one projected side is enough, and the states' priors are in it
            each = np.nan_to_num(np.einsum('jcsw,kcsw->jkw', projected, drifts), posinf=0.0, neginf=0.0)
        matrix = np.moveaxis(each @ self._member.T, 2, 0)
        matrix = 0.5 * (matrix + np.moveaxis(matrix, 1, 2)) + np.eye(2) / self._drift_spread**2
        return np.linalg.inv(matrix)

    def drift_variance(self, values: np.ndarray) -> np.ndarray:
        """Variance of the drift of each run by the weights alone, shape (2, R); regularisation included."""
        p, current = self.parameters(values)
        _, state_slopes = self._with_state_slopes(p, current)
        drifts = self._drift_slopes()
        projected, _ = self._without_states(drifts, state_slopes, *self._state_information(state_slopes))
        return np.diagonal(self._drift_information(projected, drifts), axis1=1, axis2=2).T

    def _instability(self, columns: np.ndarray):
        """Weighted excess of growth of candidates (n, K), shape (speeds, K)."""
        if not self._speeds.size:
            return np.zeros((0, columns.shape[1]))
        growth = growth_rates(columns, active_terms(_union(columns)), self._speeds)
        weight = STABILITY_WEIGHT * np.sqrt(self._known.sum())
        return weight * np.maximum(growth - self._largest_growth, 0.0)

    def instability_slopes(self, values: np.ndarray) -> np.ndarray:
        """Derivatives of `_instability` by the unknowns, shape (speeds, n)."""
        p, _ = self.parameters(values)
        searched = np.flatnonzero(self.unknowns.shares.any(axis=0))
        slopes = np.zeros((self._speeds.size, values.size))
        if not self._speeds.size or not searched.size:
            return slopes
        steps = PERTURBATION * self.unknowns.units[searched]
        columns = np.repeat(p[:, None], 1 + searched.size, axis=1)
        columns[:, 1:] += steps * self.unknowns.shares[:, searched]
        found = self._instability(columns)
        slopes[:, searched] = (found[:, 1:] - found[:, :1]) / steps
        return slopes

    def _slopes(self, values: np.ndarray):
        """Weighted residuals (3, S+1, W), their derivatives by the unknowns (n, ...) and by the states (3, ...)."""
        p, current = self.parameters(values)
        searched = np.flatnonzero(self.unknowns.shares.any(axis=0))
        columns = np.repeat(p[:, None], 4 + searched.size, axis=1)
        states = np.repeat(self.states[:, None, :], columns.shape[1], axis=1)
        state_steps = PERTURBATION * np.maximum(self._state_units, 1e-2)
        for j in range(3):
            states[j, j + 1] += state_steps[j]
        steps = PERTURBATION * self.unknowns.units
        for place, k in enumerate(searched):
            # from the side of the range that is open
            if values[k] + steps[k] > self.unknowns.upper[k]:
                steps[k] = -steps[k]
            columns[:, 4 + place] += steps[k] * self.unknowns.shares[:, k]
        found = self.simulate(columns, states)
        residual = self._weighted(found[:, :, 0], p, current)
        state_slopes = np.stack(
            [(self._weighted(found[:, :, j + 1], p, current) - residual) / state_steps[j] for j in range(3)]
        )
        slopes = np.zeros((values.size, *residual.shape))
        for place, k in enumerate(searched):
            slopes[k] = (self._weighted(found[:, :, 4 + place], columns[:, 4 + place], current) - residual) / steps[k]
        for j, name in enumerate(self.unknowns.names):
            if name in CURRENT:
                unit = np.array([name == c for c in CURRENT], dtype=float)
                slopes[j] = np.einsum('j,jcsw->csw', unit, self._drift_slopes())
        return residual, slopes, state_slopes

    def _eliminated(self, slopes: np.ndarray, state_slopes: np.ndarray):
        """Slopes (n, 3, S + 1, W) less the part along the initial states and drifts, and these parts, (n, 3, W) and (n,
        2, R).
        """
        inverse, usable = self._state_information(state_slopes)
        projected, taken = self._without_states(slopes, state_slopes, inverse, usable)
        state_part = -taken / self._expected_spread
        if not self._drift_spread:
            return projected, state_part, np.zeros((len(slopes), 2, 0))
        drifts, drifts_taken = self._without_states(self._drift_slopes(), state_slopes, inverse, usable)
        with np.errstate(over='ignore', invalid='ignore'):
            cross = np.einsum('jcsw,ncsw->njw', drifts, slopes)
        cross = np.nan_to_num(cross, posinf=0.0, neginf=0.0) @ self._member.T
        drift = np.einsum('rjk,nkr->njr', self._drift_information(drifts, self._drift_slopes()), cross)
        with np.errstate(over='ignore', invalid='ignore'):
            by_window = drift @ self._member
            projected = projected - np.einsum('jcsw,njw->ncsw', drifts, by_window)
            state_part = state_part + np.einsum('jkw,njw->nkw', drifts_taken / self._expected_spread, by_window)
        return projected, state_part, -drift / self._drift_spread

    def _prior(self, values: np.ndarray):
        spread = self.unknowns.spread
        return np.where(np.isfinite(spread), (values - self.unknowns.target) / spread, 0.0)


def _union(columns: np.ndarray):
    """A column in which every parameter that any column uses differs from neutral."""
    spread = np.ptp(columns, axis=1)
    return columns[:, 0] + np.where(spread > 0.0, spread * 1.2345 + 1e-9, 0.0)
