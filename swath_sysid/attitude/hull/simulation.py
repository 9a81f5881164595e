"""Simulation of decays: one hull, or a whole population of candidate hulls at once."""

import math

import numpy as np

from swath_sysid.attitude.hull.compiled import motion_step, step_of_arrays
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.common.accelerator import accelerated, has_numba

STEPS_PER_PERIOD = 60  #: Runge-Kutta steps a natural period: phase error below 1e-7 rad a step.

_SWING = np.linspace(-1.0, 1.0, 33)


@accelerated
def _one_by_one(
    x: np.ndarray,
    rate: np.ndarray,
    ratios: np.ndarray,
    active: tuple[bool, ...],
    friction_rate: float,
    step: float,
    angles: np.ndarray,
    rates: np.ndarray,
    accelerations: np.ndarray,
) -> None:
    """All candidates one after the other, in registers: without temporary arrays twice as fast, compiled."""
    x, rate = x.copy(), rate.copy()
    for k in range(angles.shape[0]):
        for p in range(x.size):
            column = (
                ratios[0, p],
                ratios[1, p],
                ratios[2, p],
                ratios[3, p],
                ratios[4, p],
                ratios[5, p],
                ratios[6, p],
                ratios[7, p],
                ratios[8, p],
            )
            angles[k, p], rates[k, p] = x[p], rate[p]
            accelerations[k, p], x[p], rate[p] = motion_step(x[p], rate[p], 0.0, step, column, active, friction_rate)


def _side_by_side(
    x: np.ndarray,
    rate: np.ndarray,
    ratios: np.ndarray,
    active: tuple[bool, ...],
    friction_rate: float,
    step: float,
    angles: np.ndarray,
    rates: np.ndarray,
    accelerations: np.ndarray,
) -> None:
    """All candidates at once, which is fast in plain Python."""
    rows = tuple(ratios)
    for k in range(angles.shape[0]):
        angles[k], rates[k] = x, rate
        accelerations[k], x, rate = step_of_arrays(x, rate, 0.0, step, rows, active, friction_rate)


def runge_kutta_population(
    x: np.ndarray,
    rate: np.ndarray,
    ratios: np.ndarray,
    active: tuple[bool, ...],
    friction_rate: float,
    step: float,
    steps: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrate P free decays from x, rad from trim, and rate, rad/s, with the classical Runge-Kutta scheme.

    ``ratios`` has shape (9, P). Returns angles, rates and accelerations (steps + 1, P), not finite after a divergence.
    """
    angles, rates, accelerations = (np.empty((steps + 1, x.size)) for _ in range(3))
    # one step, two loops: compiled code is fast in registers, numpy on whole rows
    integrate = _one_by_one if has_numba() else _side_by_side
    integrate(x, rate, ratios, active, friction_rate, step, angles, rates, accelerations)
    return angles, rates, accelerations


def hermite_weights(fraction: np.ndarray, step: float) -> np.ndarray:
    """Cubic Hermite weights (4, N) of value, slope, next value and next slope, at (N,) of 0 to 1 in a step, s."""
    t = fraction
    return np.array([(1 + 2 * t) * (1 - t) ** 2, t * (1 - t) ** 2 * step, t**2 * (3 - 2 * t), t**2 * (t - 1) * step])


def interpolate(values: np.ndarray, slopes: np.ndarray, before: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Cubic Hermite interpolation (N, P) of columns (K, P) by their slopes and `hermite_weights` after steps (N,)."""
    w = weights[:, :, None]
    return w[0] * values[before] + w[1] * slopes[before] + w[2] * values[before + 1] + w[3] * slopes[before + 1]


def places_in_steps(time: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray, int]:
    """Step before each time (N,), s from the start, interpolation weights there, and number of steps needed."""
    position = np.asarray(time, dtype=float) / step
    before = np.floor(position).astype(np.int64)
    return before, hermite_weights(position - before, step), int(before.max()) + 1


def longest_step(model: DecayModel, amplitude: float = 0.0, steps_per_period: float = STEPS_PER_PERIOD) -> float:
    """Step, s, that resolves a hull's motions up to an amplitude, rad, and their damping, stable or not."""
    swing = amplitude * _SWING
    stiffness = float(np.abs(model.jacobian(model.trim + swing, 0.0)[0]).max())
    rate = math.sqrt(stiffness) * swing
    # a rate whose damping outweighs every restoring moment is never reached
    reached = np.abs(model.acceleration(model.trim, rate)) <= np.abs(model.acceleration(model.trim + swing, 0.0)).max()
    damping = float(np.abs(model.jacobian(model.trim, rate)[1]).max(where=reached, initial=0.0))
    fastest = max(math.sqrt(stiffness), damping, 1e-6)
    return 2.0 * math.pi / fastest / steps_per_period


def simulate(model: DecayModel, angle: float, rate: float, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Free decay of one hull, by the classical Runge-Kutta scheme with cubic Hermite interpolation.

    Args:
        model: Of the hull.
        angle: At ``time[0]``, rad.
        rate: At ``time[0]``, rad/s.
        time: (N,); s, increasing, not necessarily even.

    Returns:
        Angles, rad, and rates, rad/s, (N,) each; not finite from where the motion has run away.

    Example:
        >>> hull = hull_named('swath-roll').model
        >>> angle, rate = simulate(hull, 0.1, 0.0, np.arange(0.0, 15.0, 0.02))
        >>> angle.shape, bool(abs(angle[-50:]).max() < 0.02)
        ((750,), True)
    """
    elapsed = np.asarray(time, dtype=float) - time[0]
    step = longest_step(model, abs(angle - model.trim))
    before, weights, steps = places_in_steps(elapsed, step)
    with np.errstate(over='ignore', invalid='ignore'):
        angles, rates, accelerations = runge_kutta_population(
            np.array([angle - model.trim], dtype=float),
            np.array([rate], dtype=float),
            model.ratios[:, None],
            model.equation.active,
            model.friction_rate,
            step,
            steps,
        )
        return (
            interpolate(angles, rates, before, weights)[:, 0] + model.trim,
            interpolate(rates, accelerations, before, weights)[:, 0],
        )
