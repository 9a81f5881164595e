"""Simulation of decays, compiled once for all who integrate: one hull, or a population of candidates at once."""

import math
from typing import Any

import numpy as np

from swath_sysid.attitude.hull import terms
from swath_sysid.attitude.hull.decay_model import DecayModel
from swath_sysid.attitude.motion.attitude import Value
from swath_sysid.common.accelerator import accelerated, has_numba
from swath_sysid.common.errors import InputError

damping_moment = accelerated(terms.damping_moment)
restoring_moment = accelerated(terms.restoring_moment)
damping_slope = accelerated(terms.damping_slope)
restoring_slope = accelerated(terms.restoring_slope)
term_moments = accelerated(terms.term_moments)
mean_damping_slopes = accelerated(terms.mean_damping_slopes)
#: Ratios (9,) as a tuple, which numba cannot make: an array's values are not kept in registers, nor floats in Python.
as_tuple = accelerated(
    eval(f'lambda ratios: ({", ".join(f"ratios[{k}]" for k in range(len(terms.TERMS)))})'),
    lambda ratios: tuple(ratios.tolist()),
)


@accelerated
def motion_step(
    x: Value, rate: Value, moment: float, step: float, ratios: Value, active: tuple[bool, ...], friction_rate: float
) -> tuple[Value, Value, Value]:
    """A Runge-Kutta step, s, under a held moment, rad/s^2: the acceleration before it, angle and rate after it."""
    half, sixth = 0.5 * step, step / 6.0
    a1 = moment - damping_moment(rate, ratios, active, friction_rate) - restoring_moment(x, ratios, active)
    w2 = rate + half * a1
    a2 = moment - damping_moment(w2, ratios, active, friction_rate) - restoring_moment(x + half * rate, ratios, active)
    w3 = rate + half * a2
    a3 = moment - damping_moment(w3, ratios, active, friction_rate) - restoring_moment(x + half * w2, ratios, active)
    w4 = rate + step * a3
    a4 = moment - damping_moment(w4, ratios, active, friction_rate) - restoring_moment(x + step * w3, ratios, active)
    return a1, x + sixth * (rate + 2.0 * (w2 + w3) + w4), rate + sixth * (a1 + 2.0 * (a2 + a3) + a4)


STEPS_PER_PERIOD = 60  #: Runge-Kutta steps a natural period: phase error below 1e-7 rad a step.

_OFFSETS = np.linspace(-1.0, 1.0, 33)


@accelerated
def _integrate(
    x: Value, rate: Value, ratios: tuple, active: tuple[bool, ...], friction_rate: float, step: float, motion: Any
) -> None:
    """Angle, rate, acceleration of one decay into ``motion`` (K, 3), or of P at once, which is fast in plain Python."""
    for k in range(len(motion)):
        motion[k, 0], motion[k, 1] = x, rate
        motion[k, 2], x, rate = motion_step(x, rate, 0.0, step, ratios, active, friction_rate)


@accelerated
def _integrate_each(
    x: Value, rate: Value, ratios: Any, active: tuple[bool, ...], friction_rate: float, step: float, motion: Any
) -> None:
    """P decays one after the other into (K, 3, P): compiled, without temporary arrays, twice as fast."""
    for p in range(x.size):
        _integrate(x[p], rate[p], as_tuple(ratios[:, p]), active, friction_rate, step, motion[:, :, p])


def runge_kutta_population(
    x: np.ndarray,
    rate: np.ndarray,
    ratios: np.ndarray,
    active: tuple[bool, ...],
    friction_rate: float,
    step: float,
    steps: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Integrate P free decays from x, rad from trim, and rate, rad/s, with the classical Runge-Kutta scheme. ``ratios``
    has shape (9, P). Returns angles, rates and accelerations (steps + 1, P), not finite after a divergence.
    """
    motion, ratios = np.empty((steps + 1, 3, x.size)), np.array(ratios, order='C')  # one layout is compiled
    if has_numba():
        _integrate_each(x, rate, ratios, active, friction_rate, step, motion)
    else:
        _integrate(x, rate, tuple(ratios), active, friction_rate, step, motion)
    return motion[:, 0], motion[:, 1], motion[:, 2]


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
    offset = amplitude * _OFFSETS
    stiffness = float(np.abs(model.jacobian(model.trim + offset, 0.0)[0]).max())
    rate = math.sqrt(stiffness) * offset
    # a rate whose damping outweighs every restoring moment is never reached
    reached = np.abs(model.acceleration(model.trim, rate)) <= np.abs(model.acceleration(model.trim + offset, 0.0)).max()
    damping = float(np.abs(model.jacobian(model.trim, rate)[1]).max(where=reached, initial=0.0))
    fastest = max(math.sqrt(stiffness), damping, 1e-6)
    return 2.0 * math.pi / fastest / steps_per_period


def _stick(model: DecayModel, step: float, x: np.ndarray, rate: np.ndarray, acceleration: np.ndarray) -> None:
    """Hold a motion (K,) from where it turns with no more restoring moment than dry friction bears, in place: smoothed
    friction creeps there.
    """
    before = np.flatnonzero(rate[:-1] * rate[1:] <= 0.0)
    change = rate[before] - rate[before + 1]
    share = np.divide(rate[before], change, out=np.zeros(before.size), where=change != 0.0)
    turned = x[before] + 0.5 * step * share * rate[before]
    pull = np.abs(terms.restoring_moment(turned, tuple(model.ratios), model.equation.active))
    held = np.flatnonzero(pull <= model.ratios[terms.AT.b0])
    if held.size:
        after = slice(int(before[held[0]]) + 1, None)
        x[after], rate[after], acceleration[after] = turned[held[0]], 0.0, 0.0


def simulate(model: DecayModel, angle: float, rate: float, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Free decay of one hull, by the classical Runge-Kutta scheme with cubic Hermite interpolation. Dry friction holds
    the hull where it turns with less restoring moment.

    Args:
        model: Of the hull.
        angle: At ``time[0]``, rad.
        rate: At ``time[0]``, rad/s.
        time: (N,); s, increasing, not necessarily even.

    Returns:
        Angles, rad, and rates, rad/s, (N,) each; not finite from where the motion has run away.

    Raises:
        InputError: There is no time.

    Example:
        >>> hull = hull_named('swath-roll').model
        >>> angle, rate = simulate(hull, 0.1, 0.0, np.arange(0.0, 15.0, 0.02))
        >>> angle.shape, bool(abs(angle[-50:]).max() < 0.02)
        ((750,), True)
    """
    if not len(time):
        raise InputError('there is no time to simulate: give at least one')
    elapsed = np.asarray(time, dtype=float) - time[0]
    step = longest_step(model, abs(angle - model.trim))
    before, weights, steps = places_in_steps(elapsed, step)
    x, speed = np.array([angle - model.trim], dtype=float), np.array([rate], dtype=float)
    hull = model.ratios[:, None], model.equation.active, model.friction_rate
    with np.errstate(over='ignore', invalid='ignore'):
        angles, rates, accelerations = motion = runge_kutta_population(x, speed, *hull, step, steps)
        if 'b0' in model.equation.terms:
            _stick(model, step, *(each[:, 0] for each in motion))
        found = interpolate(angles, rates, before, weights)[:, 0] + model.trim
        return found, interpolate(rates, accelerations, before, weights)[:, 0]
