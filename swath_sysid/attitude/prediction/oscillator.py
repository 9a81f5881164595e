"""The first forecast: each angle a damped oscillator driven by white noise, from however few rows there are.

At short leads it carries the rate on, at long ones it returns to the mean, so that it is what persistence, constant
rate and the mean are each good at.  Its natural frequency is the ratio of the rate's to the angle's standard deviation,
for which the regression of the angle a little later on angle and rate is the best linear one whatever the spectrum.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from swath_sysid.attitude.prediction.state_space import InnovationsModel, side_by_side

_DAMPING = 0.4
# rad/s, and the s of record that it counts for: what is expected of a small craft's motion
_EXPECTED_FREQUENCY, _EXPECTED_FOR = 1.1, 1.5
# rad; the motion before there are two rows
_EXPECTED_ANGLE = 0.05
_MIN_ANGLE = 1e-5
_NOISE = 1e-8


def oscillators(
    values: np.ndarray, names: Sequence[str], step: float, angles: Sequence[str]
) -> InnovationsModel | None:
    """A model of the angles alone, each with its rate where that is measured.

    Args:
        values: (N, width); oldest first, NaN where missing.
        names: Of the columns.
        step: s.
        angles: Which of the names; ``X_rate`` is the rate of ``X``.

    Returns:
        None while no angle has been seen.
    """
    names = list(names)
    parts = []
    for angle in angles:
        column = names.index(angle) if angle in names else None
        if column is not None and np.isfinite(values[:, column]).any():
            rate = names.index(f'{angle}_rate') if f'{angle}_rate' in names else None
            if rate is not None and not np.isfinite(values[:, rate]).any():
                rate = None
            parts.append(_oscillator(values, names, step, column, rate))
    return side_by_side(parts) if parts else None


def _oscillator(values: np.ndarray, names: Sequence[str], step: float, angle: int, rate: int | None):
    mean, deviation, frequency = angle_statistics(values[:, angle], None if rate is None else values[:, rate], step)
    # in units of the standard deviations of angle and rate, whose covariance is then one
    drift = frequency * np.array([[0.0, 1.0], [-1.0, -2.0 * _DAMPING]])
    a = expm(drift * step)
    noise = np.eye(2) - a @ a.T
    if rate is not None:
        s = noise + _NOISE * np.eye(2)
        return InnovationsModel(
            (names[angle], names[rate]),
            (angle, rate),
            step,
            np.array([mean, 0.0]),
            np.array([deviation, deviation * frequency]),
            a,
            a,
            np.eye(2),
            s,
            a @ a.T,
        )
    c = np.array([[1.0, 0.0]])
    error = solve_discrete_are(a.T, c.T, noise + _NOISE * np.eye(2), np.array([[_NOISE]]))
    s = c @ error @ c.T + _NOISE
    return InnovationsModel(
        (names[angle],),
        (angle,),
        step,
        np.array([mean]),
        np.array([deviation]),
        a,
        a @ error @ c.T / s,
        c,
        s,
        np.eye(2) - error,
    )


def angle_statistics(angle: np.ndarray, rate: np.ndarray | None, step: float) -> tuple[float, float, float]:
    """Mean, standard deviation and natural frequency of an angle, drawn to what is expected while little is known.

    Args:
        angle: (N,); rad, NaN where missing.
        rate: (N,), or None; rad/s; without it the angle's differences.
        step: s.

    Returns:
        mean, deviation, frequency: rad, rad, rad/s.
    """
    duration = step * np.isfinite(angle).sum()
    rates = np.diff(angle) / step if rate is None else rate
    rates = rates[np.isfinite(rates)]
    rate_square = np.mean(rates**2) if rates.size else (_EXPECTED_ANGLE * _EXPECTED_FREQUENCY) ** 2
    # less than a period says little of the mean
    mean = duration / (duration + 2.0 * np.pi / _EXPECTED_FREQUENCY) * np.nanmean(angle)
    expected = rate_square / _EXPECTED_FREQUENCY**2
    square = (duration * np.nanmean((angle - mean) ** 2) + _EXPECTED_FOR * expected) / (duration + _EXPECTED_FOR)
    deviation = max(np.sqrt(square), _MIN_ANGLE)
    return mean, deviation, np.sqrt(max(rate_square, 1e-12)) / deviation
