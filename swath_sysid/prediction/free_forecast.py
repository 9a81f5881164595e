"""The forecast of the hull alone: the state carried on by the decay model over the horizon."""
import math
from dataclasses import dataclass

import numpy as np

from swath_sysid.accelerator import HAS_NUMBA, accelerated
from swath_sysid.hull.compiled import damping_slope, motion_step, restoring_slope
from swath_sysid.prediction.ekf import CAPSIZED, process_noise, runge_kutta_step, transition

RADIANS_PER_STEP = 0.35
"""Runge-Kutta steps of a horizon, in radians of the natural oscillation: errors below 1e-4 a period."""

FASTEST = 20.0
"""rad/s; no hull turns this fast."""

LARGEST_MOMENT = 1e4
"""rad/s^2; over inertia."""


def longest_horizon_step(model, grid_step):
    """Step of the horizon's integration, s: a whole fraction of the grid step.

    Parameters
    ----------
    model : DecayModel or FreeMotion
    grid_step : float
        s.

    Returns
    -------
    step : float
        s.
    per_grid : int
        Steps a grid step.
    """
    by_angle, by_rate = model.jacobian(model.trim, 0.0)
    fastest = max(math.sqrt(abs(by_angle)), abs(by_rate), 1e-9)
    per_grid = max(1, math.ceil(grid_step * fastest / RADIANS_PER_STEP))
    return grid_step / per_grid, per_grid


@accelerated
def carry_on_kernel(angle, rate, moments, step, per_grid, ratios, active, friction_rate, angles, rates):
    """Fill angles and rates (from trim) over the grid; see `carry_on`."""
    angles[0], rates[0] = angle, rate
    held = False
    for k in range(moments.size):
        moment = float(moments[k])
        for _ in range(per_grid):
            # past any hull's range of stability the equation says nothing: the angle is held
            held = held or not (abs(angle) < CAPSIZED and abs(rate) < FASTEST)
            if held:
                break
            _, angle, rate = motion_step(angle, rate, moment, step, ratios, active, friction_rate)
            angle, rate = float(angle), float(rate)
        if held:
            angle, rate = angles[k], 0.0
        angles[k + 1] = angle = min(max(angle, -CAPSIZED), CAPSIZED)
        rates[k + 1] = rate


def carry_on(model, angle, rate, trim, moments, step, per_grid):
    """Angles and rates over the grid, from a state and the moments expected (classical Runge-Kutta).

    Parameters
    ----------
    model : DecayModel
    angle, rate, trim : float
        The state now; rad, rad/s, rad.
    moments : ndarray, shape (K,)
        Moment over inertia in each grid interval, rad/s^2.
    step : float
        Of the integration, s.
    per_grid : int
        Steps a grid interval.

    Returns
    -------
    angles, rates : ndarray, shape (K + 1,)
        At the grid times, the first of them now.
    """
    angles, rates = np.empty(moments.size + 1), np.empty(moments.size + 1)
    x = min(max(angle - trim, -CAPSIZED), CAPSIZED)
    with np.errstate(over='ignore', invalid='ignore'):
        carry_on_kernel(
            x, rate, moments, step, per_grid, tuple(model.ratios.tolist()), model.equation.active,
            model.friction_rate, angles, rates,
        )  # fmt: skip
    return angles + trim, np.where(np.isfinite(rates), rates, 0.0)


def mean_moments(model, angles, rates, trim, step, per_grid):
    """The moments that took the hull from each grid point to the next, taken as constant between them.

    The inverse of `carry_on`: what the rate gained beyond the hull's own motion, over what a unit
    moment gains (to third order in the step).

    Parameters
    ----------
    model : DecayModel
    angles, rates : ndarray, shape (N,)
        On the grid, oldest first.
    trim : float
        rad.
    step : float
        Of the integration, s.
    per_grid : int

    Returns
    -------
    ndarray, shape (N - 1,)
        rad/s^2; NaN where the hull ran away.
    """
    if HAS_NUMBA:
        moments = np.empty(max(0, angles.size - 1))
        mean_moments_kernel(
            np.ascontiguousarray(angles), np.ascontiguousarray(rates), trim, step, per_grid,
            tuple(model.ratios.tolist()), model.equation.active, model.friction_rate, moments,
        )  # fmt: skip
        return moments
    return mean_moments_of_arrays(model, angles, rates, trim, step, per_grid)


@accelerated
def mean_moments_kernel(angles, rates, trim, step, per_grid, ratios, active, friction_rate, moments):
    """Fill the moments, one after another; see `mean_moments`."""
    h = step * per_grid
    for k in range(moments.size):
        x = min(max(angles[k] - trim, -CAPSIZED), CAPSIZED)
        w = rates[k]
        for _ in range(per_grid):
            _, x, w = motion_step(x, w, 0.0, step, ratios, active, friction_rate)
            x, w = float(x), float(w)
        middle = min(max((angles[k] + angles[k + 1]) / 2.0 - trim, -CAPSIZED), CAPSIZED)
        speed = (rates[k] + rates[k + 1]) / 2.0
        a = -restoring_slope(middle, ratios, active)
        c = -damping_slope(speed, ratios, active, friction_rate)
        gain = h * (1.0 + c * h / 2.0 + (a + c * c) * h * h / 6.0)
        moment = (rates[k + 1] - w) / (gain if gain > 0.2 * h else h)
        moments[k] = moment if abs(moment) < LARGEST_MOMENT else math.nan


def mean_moments_of_arrays(model, angles, rates, trim, step, per_grid):
    """`mean_moments`, all of them at once: quick without the accelerator."""
    x, w = angles[:-1] + (model.trim - trim), rates[:-1]
    x = np.clip(x, model.trim - CAPSIZED, model.trim + CAPSIZED)
    with np.errstate(over='ignore', invalid='ignore'):
        for _ in range(per_grid):
            x, w = runge_kutta_step(model.acceleration, x, w, 0.0, step)
    middle, speed = (angles[:-1] + angles[1:]) / 2.0 + (model.trim - trim), (rates[:-1] + rates[1:]) / 2.0
    a, c = model.jacobian(np.clip(middle, model.trim - CAPSIZED, model.trim + CAPSIZED), speed)
    h = step * per_grid
    gain = h * (1.0 + c * h / 2.0 + (a + c * c) * h * h / 6.0)
    moments = (rates[1:] - w) / np.where(gain > 0.2 * h, gain, h)
    return np.where(np.abs(moments) < LARGEST_MOMENT, moments, np.nan)


@dataclass(frozen=True)
class SpreadTable:
    """How the uncertainty of now and the disturbance to come spread to L leads.

    Attributes
    ----------
    transitions : ndarray, shape (L, 2, 4)
        Of the linearised state, from now to angle and rate at each lead.
    by_disturbance : ndarray, shape (L, 2, 2)
        Covariance of angle and rate for a disturbance variance of one.
    """

    transitions: np.ndarray
    by_disturbance: np.ndarray

    def covariance(self, state_covariance, disturbance_variance):
        """Covariance of angle and rate at the leads, shape (L, 2, 2)."""
        rows = self.transitions
        return rows @ state_covariance @ rows.transpose(0, 2, 1) + disturbance_variance * self.by_disturbance


def spread_table(model, tau, leads):
    """The `SpreadTable` of a model, linearised at its trim.

    Parameters
    ----------
    model : DecayModel or FreeMotion
    tau : float
        Correlation time of the disturbance, s.
    leads : ndarray, shape (L,)
        s, increasing.
    """
    by_angle, by_rate = (float(slope) for slope in model.jacobian(model.trim, 0.0))
    longest = 0.25 / max(math.sqrt(abs(by_angle)), abs(by_rate), 0.5 / tau)
    total, spread, rows, spreads = np.eye(4), np.zeros((4, 4)), [], []
    for span in np.diff(leads, prepend=0.0):
        count = max(1, math.ceil(span / longest))
        small = transition(by_angle, by_rate, span / count, tau)
        noise = process_noise(1.0, tau, 0.0, span / count)
        for _ in range(count):
            total, spread = small @ total, small @ spread @ small.T + noise
        rows.append(total[:2])
        spreads.append(spread[:2, :2])
    return SpreadTable(np.array(rows), np.array(spreads))
