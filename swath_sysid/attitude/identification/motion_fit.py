"""The simulation objective: how well a simulated decay follows the measured one.

Each record has its own initial state and trim, which are nuisance parameters; the ratios are
shared by all records. Angle and rate are weighted by their noise. All candidates, or all
perturbed copies that a Jacobian needs, are simulated side by side.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swath_sysid.attitude.hull.decay_model import Equation
from swath_sysid.attitude.hull.simulation import STEPS_PER_PERIOD, interpolate, places_in_steps, runge_kutta_population
from swath_sysid.attitude.hull.terms import TERM_NAMES, Scales
from swath_sysid.attitude.motion.trial import AxisMotion
from swath_sysid.common.conventions import ROUNDING

SEARCH_STEPS_PER_PERIOD = 24  #: Within one of them the motion hardly changes.
PERTURBATION = 1e-6
TOLERANCE = 1e-11
STARTING_TOLERANCE = 1e-5  #: Of what another search goes on from.
MAX_EVALUATIONS = 100


@dataclass(frozen=True)
class Noise:
    """Standard deviations that weight the residuals: angle, rad, and rate, rad/s."""

    angle: float
    rate: float


@dataclass(frozen=True)
class InitialState:
    """State at the first sample of a record: angle from trim, rad, rate, rad/s, and trim, rad."""

    x: float
    rate: float
    trim: float


class MotionFit:
    """Residuals, Jacobian and least-squares refinement of an equation on records. Simulated with ``steps_per_period``
    Runge-Kutta steps per period of ``scales.frequency``; ``friction_rate`` in rad/s.
    """

    def __init__(
        self,
        motions: Sequence[AxisMotion],
        equation: Equation,
        scales: Scales,
        noise: Noise,
        friction_rate: float,
        steps_per_period: float = STEPS_PER_PERIOD,
    ) -> None:
        self._motions = motions
        self._equation = equation
        self._noise = noise
        self._friction_rate = friction_rate
        self._terms = equation.indices
        self._units = scales.ratio_units[self._terms]
        self._state_units = np.array([scales.amplitude, scales.rate, scales.amplitude])
        self._step = 2.0 * np.pi / scales.frequency / steps_per_period
        self._places = [places_in_steps(m.time - m.time[0], self._step) for m in motions]
        self._steps = max(steps for _, _, steps in self._places)

    def pack(self, ratios: np.ndarray, states: Sequence[InitialState]) -> np.ndarray:
        """Parameter vector, dimensionless, of ratios (9,) and the initial states, shape (n + 3 M,)."""
        own = [np.array([s.x, s.rate, s.trim]) / self._state_units for s in states]
        return np.concatenate([ratios[self._terms] / self._units, *own])

    def unpack(self, parameters: np.ndarray) -> tuple[np.ndarray, tuple[InitialState, ...]]:
        """Ratios (9,) and initial states of a parameter vector."""
        ratios = self._equation.complete(parameters[: len(self._terms)] * self._units)
        own = parameters[len(self._terms) :].reshape(-1, 3) * self._state_units
        return ratios, tuple(InitialState(*row) for row in own.tolist())

    def objective_of_population(self, candidates: np.ndarray, states: Sequence[InitialState]) -> np.ndarray:
        """Rms of the weighted residuals of dimensionless candidates (P, n); infinite where the motion diverges."""
        population, records = len(candidates), len(self._motions)
        ratios = np.zeros((len(TERM_NAMES), population * records))
        ratios[self._terms] = np.tile((candidates * self._units).T, records)
        x = np.repeat([s.x for s in states], population)
        rate = np.repeat([s.rate for s in states], population)
        total, count = np.zeros(population), 0
        with np.errstate(over='ignore', invalid='ignore'):
            simulated = self._simulate(x, rate, ratios)
            for index, state in enumerate(states):
                columns = slice(index * population, (index + 1) * population)
                for residual, _ in self._channel_residuals(index, simulated, columns, state.trim):
                    total += np.einsum('np,np->p', residual, residual)
                    count += len(residual)
            values = np.sqrt(total / count)
        return np.where(np.isfinite(values), values, np.inf)

    def residuals_and_jacobian(self, parameters: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Weighted residuals (N_k,) per record and channel, angle before rate, and Jacobians (N_k, n + 3 M). By forward
        differences in one simulation, at dimensionless parameters (n + 3 M,) of `pack`.
        """
        n, records = len(self._terms), len(self._motions)
        copies = n + 3
        ratios = np.zeros((len(TERM_NAMES), copies * records))
        ratios[self._terms] = (parameters[:n] * self._units)[:, None]
        own = parameters[n:].reshape(-1, 3)
        x = np.repeat(own[:, 0], copies)
        rate = np.repeat(own[:, 1], copies)
        base = np.arange(records) * copies
        for k, term in enumerate(self._terms):
            ratios[term, base + 1 + k] += PERTURBATION * self._units[k]
        x[base + n + 1] += PERTURBATION
        rate[base + n + 2] += PERTURBATION
        residuals, jacobians = [], []
        with np.errstate(over='ignore', invalid='ignore'):
            simulated = self._simulate(x * self._state_units[0], rate * self._state_units[1], ratios)
            for index in range(records):
                columns = slice(base[index], base[index] + copies)
                trim = own[index, 2] * self._state_units[2]
                for values, trim_slope in self._channel_residuals(index, simulated, columns, trim):
                    jacobian = np.zeros((len(values), parameters.size))
                    slopes = (values[:, 1:] - values[:, :1]) / PERTURBATION
                    place = n + 3 * index
                    jacobian[:, :n] = slopes[:, :n]
                    jacobian[:, place : place + 2] = slopes[:, n:]
                    jacobian[:, place + 2] = trim_slope
                    residuals.append(values[:, 0])
                    jacobians.append(jacobian)
        return residuals, jacobians

    def refine(
        self, parameters: np.ndarray, lower: np.ndarray, upper: np.ndarray, tolerance: float = TOLERANCE
    ) -> tuple[np.ndarray, float]:
        """Least-squares parameters (n + 3 M,) and the rms of their weighted residuals. Bounds (n,) are of the
        dimensionless ratios; states are free. ``tolerance`` is relative.
        """
        free = np.full(parameters.size - len(self._terms), np.inf)
        bounds = (np.concatenate([lower, -free]), np.concatenate([upper, free]))
        start = np.clip(parameters, bounds[0] + ROUNDING, bounds[1] - ROUNDING)
        found = self._least_squares(start, np.arange(parameters.size), bounds, tolerance)
        vanished = found.x - bounds[0] < ROUNDING
        return np.where(vanished, bounds[0], found.x), float(np.sqrt(2.0 * found.cost / found.fun.size))

    def refine_states(self, parameters: np.ndarray) -> np.ndarray:
        """The parameters (n + 3 M,) with their initial states refined and their ratios kept."""
        states = np.arange(len(self._terms), parameters.size)
        refined = parameters.copy()
        refined[states] = self._least_squares(parameters, states, (-np.inf, np.inf), TOLERANCE).x
        return refined

    def simulated(self, parameters: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        """Simulated angle, rad, and rate, rad/s, at the samples of each record."""
        ratios, states = self.unpack(parameters)
        with np.errstate(over='ignore', invalid='ignore'):
            angles, rates, accelerations = self._simulate(
                np.array([s.x for s in states]),
                np.array([s.rate for s in states]),
                np.tile(ratios[:, None], len(states)),
            )
            return tuple(
                (
                    interpolate(angles[:, k : k + 1], rates[:, k : k + 1], before, weights)[:, 0] + state.trim,
                    interpolate(rates[:, k : k + 1], accelerations[:, k : k + 1], before, weights)[:, 0],
                )
                for k, (state, (before, weights, _)) in enumerate(zip(states, self._places, strict=True))
            )

    def settled(self, ratios: np.ndarray, states: Sequence[InitialState]) -> np.ndarray | None:
        """Parameters of ratios (9,) with the states refined from given ones; None where the motion runs away."""
        parameters = self.pack(ratios, states)
        simulated = np.concatenate([channel for pair in self.simulated(parameters) for channel in pair])
        return self.refine_states(parameters) if np.isfinite(simulated).all() else None

    def _least_squares(self, parameters: np.ndarray, chosen: np.ndarray, bounds: tuple, tolerance: float):
        """scipy's least squares over the chosen parameters; one simulation gives residuals and Jacobian. From where the
        motion runs away there is no step: the start is returned, at an infinite cost.
        """
        held = {}

        def residuals(values: np.ndarray):
            trial = parameters.copy()
            trial[chosen] = values
            parts, jacobians = self.residuals_and_jacobian(trial)
            slopes = np.concatenate(jacobians)[:, chosen]
            held['jacobian'] = values.copy(), slopes
            # where the slightest change makes the motion run away, it runs away
            return np.where(np.isfinite(slopes).all(), np.concatenate(parts), np.inf)

        def jacobian(values: np.ndarray):
            if not np.array_equal(held['jacobian'][0], values):
                residuals(values)
            return held['jacobian'][1]

        from scipy.optimize import OptimizeResult, least_squares

        first = residuals(parameters[chosen])
        if not np.isfinite(first).all():
            return OptimizeResult(x=parameters[chosen], cost=np.inf, fun=first)
        # a step after which the motion runs away is shortened
        with np.errstate(over='ignore'):
            return least_squares(
                residuals,
                parameters[chosen],
                jacobian,
                bounds=bounds,
                ftol=tolerance,
                xtol=tolerance,
                gtol=tolerance,
                max_nfev=MAX_EVALUATIONS,
            )

    def _simulate(self, x: np.ndarray, rate: np.ndarray, ratios: np.ndarray):
        return runge_kutta_population(
            x, rate, ratios, self._equation.active, self._friction_rate, self._step, self._steps
        )

    def _channel_residuals(self, index: int, simulated: tuple[np.ndarray, ...], columns: slice, trim: float):
        """Weighted residuals (N, P) of a record's channels, angle before rate, and their slopes by the trim."""
        motion, noise = self._motions[index], self._noise
        before, weights, _ = self._places[index]
        angles, rates, accelerations = (values[:, columns] for values in simulated)
        if motion.angle is not None:
            found = interpolate(angles, rates, before, weights)
            yield (found - (motion.angle - trim)[:, None]) / noise.angle, self._state_units[2] / noise.angle
        if motion.rate is not None:
            found = (interpolate(rates, accelerations, before, weights) - motion.rate[:, None]) / noise.rate
            # the best bias of a gyro is the mean of what is left; with an angle, the likelihood of the basin finds it
            yield found - (found.mean(axis=0) if motion.angle is None else 0.0), 0.0
