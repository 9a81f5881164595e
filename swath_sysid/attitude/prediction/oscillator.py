"""The first forecast: each angle a damped oscillator driven by white noise, fitted to few rows.

At short leads it carries the rate on, at long leads it returns to the mean. Its natural frequency is the ratio of the
standard deviations of rate and angle, which gives the best linear regression whatever the spectrum.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from swath_sysid.attitude.prediction.hull_filter import USUAL_AMPLITUDE
from swath_sysid.attitude.prediction.state_space import RIDGE, InnovationsModel, side_by_side

_DAMPING = 0.4
# rad/s; expected of a small craft's motion, and counts for a quarter of its period
_EXPECTED_FREQUENCY = 1.1


def oscillators(
    values: np.ndarray, names: Sequence[str], step: float, angles: Sequence[str]
) -> InnovationsModel | None:
    """A model of each angle, with its rate ``X_rate`` where measured; None while no angle has been seen.

    Values (N, width) are oldest first, one row per step, s, NaN where missing; ``names`` are their columns.
    """
    names = list(names)
    seen = [name for name, column in zip(names, values.T, strict=True) if np.isfinite(column).any()]
    parts = [
        _oscillator(values, names, step, [names.index(name) for name in (angle, f'{angle}_rate') if name in seen])
        for angle in angles
        if angle in seen
    ]
    return side_by_side(parts) if parts else None


def _oscillator(values: np.ndarray, names: Sequence[str], step: float, places: Sequence[int]):
    """Of an angle and, where measured, its rate."""
    count, columns = len(places), [values[:, place] for place in places]
    mean, deviation, frequency = angle_statistics(columns[0], columns[1] if count > 1 else None, step)
    # in units of the standard deviations of angle and rate, whose covariance is then one
    drift = frequency * np.array([[0.0, 1.0], [-1.0, -2.0 * _DAMPING]])
    a, c = expm(drift * step), np.eye(count, 2)
    driven = np.eye(2) - a @ a.T + RIDGE * np.eye(2)
    if count > 1:
        s, k, prior = driven, a, a @ a.T
    else:
        error = solve_discrete_are(a.T, c.T, driven, np.array([[RIDGE]]))
        s = c @ error @ c.T + RIDGE
        k, prior = a @ error @ c.T / s, np.eye(2) - error
    centre, scale = np.array([mean, 0.0]), np.array([deviation, deviation * frequency])
    channels = tuple([names[place] for place in places])
    return InnovationsModel(channels, tuple(places), step, centre[:count], scale[:count], a, k, c, s, prior)


def angle_statistics(angle: np.ndarray, rate: np.ndarray | None, step: float) -> tuple[float, float, float]:
    """Mean, rad, standard deviation, rad, and natural frequency, rad/s, drawn to expected values with few data.

    Angle (N,), rad, and rate (N,), rad/s, NaN where missing; without a rate the angle's differences.
    """
    duration = step * np.isfinite(angle).sum()
    rates = np.diff(angle) / step if rate is None else rate
    rates = rates[np.isfinite(rates)]
    rate_square = np.mean(rates**2) if rates.size else (USUAL_AMPLITUDE * _EXPECTED_FREQUENCY) ** 2
    # less than a period says little of the mean
    mean = duration / (duration + 2.0 * np.pi / _EXPECTED_FREQUENCY) * np.nanmean(angle)
    expected, known_for = rate_square / _EXPECTED_FREQUENCY**2, 0.5 * np.pi / _EXPECTED_FREQUENCY
    square = (duration * np.nanmean((angle - mean) ** 2) + known_for * expected) / (duration + known_for)
    deviation = max(np.sqrt(square), RIDGE)
    return mean, deviation, np.sqrt(max(rate_square, 1e-12)) / deviation
