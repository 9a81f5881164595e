"""The forecast of the hull alone: the state carried on by the decay model over the horizon."""
import math
from dataclasses import dataclass

import numpy as np

from swath_sysid.prediction.ekf import CAPSIZED, process_noise, runge_kutta_step, transition

RADIANS_PER_STEP = 0.35
"""Runge-Kutta steps of a horizon, in radians of the natural oscillation: errors below 1e-4 a period."""


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


def carry_on(model, angle, rate, trim, moments, step, per_grid):
    """Angles and rates over the grid, from a state and the moments expected.

    Parameters
    ----------
    model : DecayModel or FreeMotion
    angle, rate, trim : float
        The state now; rad, rad/s, rad.
    moments : sequence of float, length K
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
    acceleration = model.acceleration
    shift = model.trim - trim
    angle += shift
    angles, rates = [angle], [rate]
    for k, moment in enumerate(moments):
        if not abs(angle - model.trim) < CAPSIZED:
            # past any hull's range of stability the equation says nothing: the angle is held
            angles += [angles[-1]] * (len(moments) - k)
            rates += [0.0] * (len(moments) - k)
            break
        for _ in range(per_grid):
            angle, rate = runge_kutta_step(acceleration, angle, rate, moment, step)
        angle, rate = float(angle), float(rate)
        angles.append(min(max(angle, model.trim - CAPSIZED), model.trim + CAPSIZED))
        rates.append(rate)
    return np.array(angles) - shift, np.array(rates)


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
        rad/s^2.
    """
    x, w = angles[:-1] + (model.trim - trim), rates[:-1]
    x = np.clip(x, model.trim - CAPSIZED, model.trim + CAPSIZED)
    for _ in range(per_grid):
        x, w = runge_kutta_step(model.acceleration, x, w, 0.0, step)
    middle, speed = (angles[:-1] + angles[1:]) / 2.0 + (model.trim - trim), (rates[:-1] + rates[1:]) / 2.0
    a, c = model.jacobian(np.clip(middle, model.trim - CAPSIZED, model.trim + CAPSIZED), speed)
    h = step * per_grid
    gain = h * (1.0 + c * h / 2.0 + (a + c * c) * h * h / 6.0)
    return (rates[1:] - w) / np.where(gain > 0.2 * h, gain, h)


@dataclass(frozen=True)
class SpreadTable:
    """How the uncertainty of now and the disturbance to come spread over the grid.

    Attributes
    ----------
    transitions : ndarray, shape (K + 1, 4, 4)
        Of the linearised state from now to each grid time.
    by_disturbance : ndarray, shape (K + 1, 2, 2)
        Covariance of angle and rate for a disturbance variance of one.
    """

    transitions: np.ndarray
    by_disturbance: np.ndarray

    def covariance(self, state_covariance, disturbance_variance):
        """Covariance of angle and rate at the grid times, shape (K + 1, 2, 2)."""
        rows = self.transitions[:, :2]
        return rows @ state_covariance @ rows.transpose(0, 2, 1) + disturbance_variance * self.by_disturbance


def spread_table(model, tau, grid_step, count):
    """The `SpreadTable` of a model, linearised at its trim.

    Parameters
    ----------
    model : DecayModel or FreeMotion
    tau : float
        Correlation time of the disturbance, s.
    grid_step : float
        s.
    count : int
        Grid steps K.
    """
    by_angle, by_rate = (float(slope) for slope in model.jacobian(model.trim, 0.0))
    fastest = max(math.sqrt(abs(by_angle)), abs(by_rate), 0.5 / tau)
    per_grid = max(1, math.ceil(grid_step * fastest / 0.25))
    small = transition(by_angle, by_rate, grid_step / per_grid, tau)
    noise = process_noise(1.0, tau, 0.0, grid_step / per_grid)
    transitions = np.empty((count + 1, 4, 4))
    spread = np.zeros((count + 1, 4, 4))
    transitions[0] = np.eye(4)
    for k in range(count):
        transitions[k + 1], spread[k + 1] = transitions[k], spread[k]
        for _ in range(per_grid):
            transitions[k + 1] = small @ transitions[k + 1]
            spread[k + 1] = small @ spread[k + 1] @ small.T + noise
    return SpreadTable(transitions, spread[:, :2, :2].copy())
